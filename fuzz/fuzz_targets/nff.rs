//! Whatever the bytes are, reading them as an NFF scene ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.nff", Mostly, b"", b"");
