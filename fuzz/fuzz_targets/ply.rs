//! Whatever the bytes are, reading them as a PLY mesh ends in a scene without cycles or in an error
//! with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.ply", Mostly, b"ply\n", b"");
