//! Whatever the bytes are, reading them as a Princeton mesh ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.ray", Mostly, b"", b"");
