//! Whatever the bytes are, reading them as an OFF mesh ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.off", Mostly, b"OFF\n", b"");
