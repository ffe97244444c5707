//! Whatever the bytes are, reading them as a file of luminous intensities ends in a scene without
//! cycles or in an error.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| snell_fuzz::read_beside(
    "fuzz.gltf",
    SCENE,
    "fuzz.ies",
    bytes
));

/// The scene that names the file.
const SCENE: &str = "{\"asset\": {\"version\": \"2.0\"}, \"extensions\":\
    {\"EXT_lights_ies\": {\"lights\": [{\"uri\": \"fuzz.ies\"}]}}, \"scene\": 0, \"scenes\": \
    [{\"nodes\": [0]}],\
    \"nodes\": [{\"extensions\": {\"EXT_lights_ies\": {\"light\": 0}}}]}";
