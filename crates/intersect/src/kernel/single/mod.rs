//! One ray through the trees: the kernel that every other falls back to.

pub(crate) mod boxes;
pub(crate) mod filter;
mod general;
pub(crate) mod traverse;
