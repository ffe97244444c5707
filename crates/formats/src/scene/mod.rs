//! Scene files.

mod fault;
pub mod gltf;
mod layers;
pub(crate) mod metal;
pub mod minray;
pub mod mitsuba;
pub mod nanovdb;
pub mod nff;
mod notes;
pub mod pbrt;
mod scattering;
pub mod scn;
mod shapes;
mod sheet;
pub mod snell;
#[cfg(test)]
mod testing;
mod tokens;

/// The readers of scene files, in the order in which contents are tried.
pub const READERS: &[crate::SceneReader] = &[
    snell::READER,
    gltf::READER,
    minray::READER,
    nff::READER,
    nanovdb::READER,
    pbrt::READER,
    mitsuba::READER,
    scn::READER,
];
