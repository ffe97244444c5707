//! Scene files.

pub mod gltf;
