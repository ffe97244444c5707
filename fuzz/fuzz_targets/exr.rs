//! Whatever the bytes are, reading them as an OpenEXR picture ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.exr", b"\x76\x2f\x31\x01");
