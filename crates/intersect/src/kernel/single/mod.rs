//! One ray through the trees: the kernel that every other falls back to.

pub(crate) mod boxes;
mod careful;
pub(crate) mod filter;
pub(crate) mod traverse;
