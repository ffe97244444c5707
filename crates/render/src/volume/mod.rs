//! Rays through media: which insides a path is in, and what becomes of it between two surfaces.
//!
//! Light passes the boundaries of media that have no surface of their own; a path, or a light ray,
//! is then traced on from there, so its way to the next vertex may consist of several segments. All
//! here is a function of the ray, what the path carries, and numbers that are bound to (pixel,
//! sample, vertex, step): batches are the driver's business.
//!
//! [`Walker`] is what happens to one ray, as the textbook renderer asks it. Batches ask the same of
//! many at once and get the same bits: insides are numbers ([`KnownInsides`]), where rays go on is
//! worked out 64 at a time ([`InterfaceCrossings`]), and so is what becomes of them in media that are the
//! same everywhere ([`HomogeneousBatch`]). In a Cornell box around a cube of fog, all but tracing took
//! 2,000 ns a sample before: 1,300 with numbers and crossings, 1,000 with ways and vertices
//! (`batch/media.rs`) in lanes too. What is left is spread thin: putting things into lanes
//! and taking them out again costs more than the arithmetic.

mod homogeneous;
mod insides;
mod interface_crossings;
mod known;
mod numbers;
mod surroundings;
#[cfg(test)]
mod tests;
mod walk;

pub use homogeneous::HomogeneousBatch;
pub use insides::{Filling, Insides, OwnMedia};
pub use interface_crossings::InterfaceCrossings;
pub use known::KnownInsides;
pub use numbers::Numbers;
pub use surroundings::Surroundings;
pub use walk::{LightStep, PathStep, Walker, end_of, length_to};
