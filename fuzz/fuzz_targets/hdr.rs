//! Whatever the bytes are, reading them as a Radiance picture ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.hdr", b"#?");
