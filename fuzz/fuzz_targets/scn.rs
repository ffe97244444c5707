//! Whatever the bytes are, reading them as a scene of lines ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.scn", Mostly, b"", b"");
