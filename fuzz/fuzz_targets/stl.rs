//! Whatever the bytes are, reading them as an STL mesh ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.stl", Mostly, b"", b"");
