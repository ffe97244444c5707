//! Whatever the bytes are, reading them as a DDS picture ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.dds", b"DDS ");
