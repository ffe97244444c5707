//! Whatever the child that reads USD prints, reading it as the scene that it hands over ends in a
//! scene without cycles or in an error with a place. As `snell`, but the name of the file does not
//! say the format.

#![no_main]

snell_fuzz::reader_target!("fuzz.usda", Mostly, b"{\"format\": \"snell scene\",", b"");
