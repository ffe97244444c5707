//! The C interface of [`snell_intersect`]: scenes of triangles, and batches of rays.
//!
//! The names are like Embree's, without a device. `include/snell.h` is made from this crate, and
//! `docs/user/c.md` is the guide. Functions that take pointers check them for null, report what is
//! wrong by a [`error::SnellError`], and let no panic reach the caller.

mod error;
mod memory;
mod scene;
