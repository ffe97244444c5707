//! Rays through media: which insides a path is in, and what becomes of it between two surfaces.
//!
//! Light passes the boundaries of media that have no surface of their own; a path, or a light ray, is then traced on from there, so
//! its way to the next vertex may consist of several segments. All here is a function of the ray, what the path carries, and
//! numbers that are bound to (pixel, sample, vertex, step): batches are the driver's business.

mod alike;
mod crossings;
mod insides;
mod known;
mod numbers;
#[cfg(test)]
mod tests;
mod walk;

pub use alike::AlikeWays;
pub use crossings::Crossings;
pub use insides::{Insides, OwnMedia};
pub use known::KnownInsides;
pub use numbers::Numbers;
pub use walk::{LightStep, PathStep, Walker, end_of, length_to};
