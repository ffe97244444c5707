//! Traversal kernels: ray-boxes and ray-triangles, written once over [`snell_math::simd::Lanes8`],
//! and their entries per level. `README.md` beside this file explains the traversal and the choice
//! of kernels.

mod columns;
pub(crate) mod list;
pub(crate) mod packet;
pub(crate) mod single;
pub(crate) mod stream;

use crate::search;
use list::ListSearch;
use packet::PacketTests;

/// A precision that all kernels know.
pub(crate) trait Kernels: PacketTests + ListSearch {}

impl<P: PacketTests + ListSearch> Kernels for P {}

/// A goal in such a precision.
pub(crate) trait Goal: search::Goal<Precision: Kernels> {}

impl<G: search::Goal<Precision: Kernels>> Goal for G {}
