//! Whatever the bytes are, reading them as a serialized mesh of Mitsuba ends in a scene without
//! cycles or in an error.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| snell_fuzz::read_beside(
    "fuzz.xml",
    SCENE,
    "fuzz.serialized",
    bytes
));

/// The scene that names the file.
const SCENE: &str = "<scene version=\"3.0.0\">\
    <shape type=\"serialized\"><string name=\"filename\" \
    value=\"fuzz.serialized\"/></shape></scene>";
