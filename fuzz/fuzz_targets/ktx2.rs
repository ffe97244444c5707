//! Whatever the bytes are, reading them as a KTX2 picture ends in finite pixels or in an error.

#![no_main]

snell_fuzz::image_target!("fuzz.ktx2", b"\xabKTX 20\xbb\r\n\x1a\n");
