//! Traversal kernels: ray-boxes and ray-triangles, written once over [`snell_math::simd::Lanes8`],
//! and their entries per level. `README.md` beside this file says how a ray travels and which
//! kernel is used when.

pub(crate) mod binning;
mod careful;
mod columns;
pub(crate) mod compact;
pub(crate) mod double;
pub(crate) mod interleave;
pub(crate) mod list;
mod meeting;
pub(crate) mod node;
pub(crate) mod packet;
pub(crate) mod prefetch;
pub(crate) mod quick;
pub(crate) mod ray;
mod slot;
#[cfg_attr(
    not(target_arch = "x86_64"),
    allow(dead_code, unused_imports, reason = "only levels of many lanes use it")
)]
mod together;
pub(crate) mod traverse;
pub(crate) mod triangle;
