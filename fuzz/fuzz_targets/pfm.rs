//! Whatever the bytes are, reading them as a portable float map ends in finite pixels or in an
//! error.

#![no_main]

snell_fuzz::image_target!("fuzz.pfm", b"PF\n");
