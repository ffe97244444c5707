//! Scene files.

pub mod gltf;
pub mod minray;
pub mod nff;
pub mod pbrt;
pub mod scn;
mod shapes;
pub mod snell;
#[cfg(test)]
mod testing;
mod tokens;

/// The readers of scene files, in the order in which contents are tried.
pub const READERS: &[crate::SceneReader] =
    &[snell::READER, gltf::READER, minray::READER, nff::READER, pbrt::READER, scn::READER];
