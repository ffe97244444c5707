//! Whatever the bytes are, reading them as a portable any map ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.ppm", b"P");
