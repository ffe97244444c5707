//! Whatever the bytes are, reading them as a GIF picture ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.gif", b"GIF89a");
