//! A stream of single rays, dozens of them in flight at once.

pub(crate) mod interleave;
mod queue;
mod shared_start;
mod slot;
