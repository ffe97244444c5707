//! Whatever the bytes are, reading them as a NanoVDB file ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.nvdb", Mostly, b"NanoVDB0", b"");
