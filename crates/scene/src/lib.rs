//! The parts of a scene, and what each computes locally: a camera gives a ray, a texture a colour,
//! a material a BSDF, a light its radiance.
//!
//! Everything here is a function of its arguments. There are no files, threads, samplers or
//! acceleration structures in this crate. Random numbers are arguments, so each part can be tested
//! alone.

#![cfg_attr(
    test,
    expect(clippy::disallowed_methods, reason = "tests compare with the standard library")
)]
#![forbid(unsafe_code)]

pub mod bsdf;
pub mod builtin;
pub mod camera;
pub mod families;
pub mod framing;
pub mod graph;
pub mod image;
pub mod light;
pub mod material;
pub mod medium;
pub mod motion;
pub mod noise;
pub mod overrides;
pub mod placed;
mod ranges;
pub mod settings;
pub mod surroundings;
pub mod texture;
pub mod written;

pub use camera::{Camera, CameraRay, CameraRays, CameraSample, CameraView, Projection};
pub use graph::{
    Background, Environment, Geometry, MaterialId, MediumId, Node, NodeId, Scene, SceneError,
    ShadowCatcher, Surface, TextureId, Warning, WarningKind,
};
pub use image::{Encoding, Image, Layer, LayeredImage, Pixels};
pub use light::Light;
pub use material::Material;
pub use medium::Medium;
pub use motion::{Motion, Player, Pose};
pub use ranges::BRIGHTEST;
pub use settings::SceneSettings;
pub use snell_math::parameters::{self, problem_at};
pub use texture::{ImageTexture, Texture, TextureSet};
