//! The kernel for one ray, which all other kernels fall back to.

pub(crate) mod boxes;
pub(crate) mod filter;
mod general;
pub(crate) mod traverse;
