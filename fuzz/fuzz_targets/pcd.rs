//! Whatever the bytes are, reading them as a PCD cloud of points ends in a scene without cycles or
//! in an error.

#![no_main]

snell_fuzz::reader_target!("fuzz.pcd", Mostly, b"# .PCD v0.7\n", b"");
