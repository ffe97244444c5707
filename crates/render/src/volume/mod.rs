//! Rays through media: the objects that a path is inside, and how the path is scattered and
//! attenuated between two surfaces.
//!
//! Light passes boundaries of media that have no surface of their own. A path or light ray is then
//! traced on from the boundary, so its way to the next vertex may consist of several segments. All
//! results are functions of the ray, the state of the path, and random numbers that depend on
//! (pixel, sample, vertex, step) alone; the driver forms the batches.
//!
//! [`Walker`] handles one ray, as the textbook renderer needs it. Batches compute the same with the
//! same bits: sets of objects are numbered ([`KnownInsides`]), the points where rays continue are
//! computed 64 at a time ([`InterfaceCrossings`]), and so is the transport in homogeneous media
//! ([`HomogeneousBatch`]).

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
pub use walk::{LightStep, PathStep, ScatteringMedium, Walker, end_of, length_to};
