//! Older methods of visible-surface determination, for comparison with ray casting by `snell
//! bench`. The renderer does not use them.
//!
//! * [`coherence`]: beams, pencils and cones, which trace all rays of a region at once.
//! * [`bits`]: what random rays hit, to compare machines.
//! * [`visible`]: hidden-surface algorithms, from the depth buffer to binary space partitions.

#![cfg_attr(
    test,
    expect(clippy::disallowed_methods, reason = "tests compare with the standard library")
)]
#![forbid(unsafe_code)]

pub mod bits;
pub mod coherence;
pub mod visible;
