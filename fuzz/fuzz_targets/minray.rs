//! Whatever the bytes are, reading them as a scene of minray ends in a scene without cycles or in
//! an error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.minray", Mostly, b"", b"");
