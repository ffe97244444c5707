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

use snell_math::Rgb;

/// The radiance from which on a surface is a lamp, in formats made for viewers with lighting of
/// their own: emission up to it is that of displays and unlit surfaces.
pub(crate) const LEAST_LAMP: f32 = 1.0;

/// Makes a scene dark whose file has lamps that are all off; otherwise it would be taken for one
/// without light, and be lit by the default sky.
fn keep_dark(scene: &mut ::snell_scene::Scene) {
    let emits = scene.materials.iter().any(::snell_scene::Material::is_emissive);
    if scene.lights.is_empty() && scene.environment.is_none() && !emits {
        scene.environment = Some(::snell_scene::Environment::Constant(Rgb::BLACK));
    }
}

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
