//! Whatever the bytes are, reading them as a glTF scene ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.gltf", Mostly, b"", b"");
