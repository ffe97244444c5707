//! SIMD levels: chosen at run time, the same results at each.

mod level;

pub use level::Level;
