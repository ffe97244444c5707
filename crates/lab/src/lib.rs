//! Older methods of visible-surface determination, for comparison with ray casting by `snell
//! bench`. The renderer does not use them.
//!
//! * [`coherence`]: beams, pencils and cones, which trace all rays of a region at once.
//! * [`visible`]: hidden-surface algorithms, from the depth buffer to binary space partitions.

#![forbid(unsafe_code)]

pub mod coherence;
pub mod visible;
