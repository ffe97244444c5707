//! Whatever the bytes are, reading them as a Mitsuba scene ends in a scene without cycles or in an
//! error with a place.

#![no_main]

snell_fuzz::reader_target!("fuzz.xml", Always, b"<scene version=\"3.0.0\">\n", b"</scene>");
