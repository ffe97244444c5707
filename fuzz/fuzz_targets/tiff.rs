//! Whatever the bytes are, reading them as a TIFF picture ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.tiff", b"II*\0");
