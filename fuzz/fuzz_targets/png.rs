//! Whatever the bytes are, reading them as a PNG picture ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.png", b"\x89PNG\r\n\x1a\n");
