//! A stream of single rays, dozens of them in flight at once.

pub(crate) mod interleave;
mod queue;
#[cfg_attr(
    not(target_arch = "x86_64"),
    allow(dead_code, unused_imports, reason = "only levels of many lanes use it")
)]
mod shared_start;
mod slot;
