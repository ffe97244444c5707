//! Traversal kernels, which test rays against boxes and triangles. They are written once over
//! [`snell_math::simd::Lanes8`] and compiled for each SIMD level. `README.md` beside this file
//! explains the traversal and the choice of kernels.

mod columns;
pub(crate) mod list;
pub(crate) mod packet;
pub(crate) mod single;
pub(crate) mod stream;

use crate::search;
use list::ListSearch;
use packet::PacketTests;

/// A precision that all kernels support.
pub(crate) trait Kernels: PacketTests + ListSearch {}

impl<P: PacketTests + ListSearch> Kernels for P {}

/// A goal in a precision that all kernels support.
pub(crate) trait Goal: search::Goal<Precision: Kernels> {}

impl<G: search::Goal<Precision: Kernels>> Goal for G {}
