//! Whatever the bytes are, reading them as a JPEG picture ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.jpg", b"\xff\xd8\xff");
