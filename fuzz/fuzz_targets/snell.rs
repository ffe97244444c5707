//! Whatever the bytes are, reading them as a scene of Snell ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.snell", Mostly, b"", b"");
