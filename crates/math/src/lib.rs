//! Numbers: vectors, transforms, rays, bounds, spectra, random numbers, warps and SIMD levels.
//! [`kinds!`] makes an enum from a list of types, and [`parameters`] declares the parameters of
//! such types.
//!
//! This is the base crate of Snell. Nothing here does I/O, starts threads or knows what a scene is.
//! Vectors are [glam](https://docs.rs/glam)'s; positions of a scene are composed in `f64`
//! ([`DVec3`], [`Transform`]) and traced in `f32` ([`Vec3`], [`Ray`]).
//!
//! Maps between spaces are named `to_from`: `world_from_object.point(p_in_object)` is a point in
//! the world.

#![cfg_attr(
    test,
    expect(clippy::disallowed_methods, reason = "tests compare with the standard library")
)]

pub mod angles;
pub mod bounds;
mod disjoint_sets;
pub mod distribution;
pub mod exact;
pub mod exponentials;
pub mod frame;
mod kinds;
pub mod parameters;
pub mod plane;
pub mod ray;
pub mod real;
pub mod rng;
pub mod robust;
pub mod rotation;
pub mod sampling;
pub mod simd;
pub mod spectrum;
pub mod spherical;
pub mod statistics;
pub mod transform;

pub use bounds::{Bounds3, Bounds3d};
pub use disjoint_sets::DisjointSets;
pub use frame::Frame;
pub use glam::{
    self, DAffine3, DMat2, DMat3, DMat4, DVec2, DVec3, DVec4, IVec2, Mat3, Mat4, UVec2, Vec2, Vec3,
    Vec4,
};
pub use ray::{DRay, Ray};
pub use spectrum::{ColorMode, ColorModel, Rgb, SampledSpectrum, SampledWavelengths};
pub use transform::Transform;

/// Makes the example of the README a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
