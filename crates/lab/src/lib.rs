//! Older ways to see a scene, to be compared with ray casting by `snell bench`. Nothing that
//! renders uses them.
//!
//! * [`coherence`]: beams, pencils and cones, which trace all rays of a region at once.
//! * [`visible`]: hidden-surface algorithms, from the depth buffer to binary space partitions.

#![forbid(unsafe_code)]

pub mod coherence;
pub mod visible;
