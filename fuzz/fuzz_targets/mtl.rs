//! Whatever the bytes are, reading them as the material file of a mesh ends in a scene without
//! cycles or in an error.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| snell_fuzz::read_beside(
    "fuzz.obj", SCENE, "fuzz.mtl", bytes
));

/// The scene that names the file.
const SCENE: &str = "mtllib fuzz.mtl\n\
    v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n";
