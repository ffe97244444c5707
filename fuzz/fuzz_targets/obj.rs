//! Whatever the bytes are, reading them as an OBJ mesh ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.obj", Mostly, b"v 0 0 0\n", b"");
