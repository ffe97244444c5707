//! NanoVDB files: sparse grids of numbers (Museth, "NanoVDB: A GPU-Friendly and Portable VDB Data
//! Structure For Real-Time Rendering And Simulation", 2021). As a scene, the grid `density`, or
//! else the first suitable grid, is shown as smoke.

#[cfg(test)]
mod tests;
mod volume;

pub use volume::{Volume, Volumes};

use crate::{Input, Place, ReadError, SceneReader};
use snell_intersect::shape::BoxShape;
use snell_math::{DVec3, Rgb};
use snell_scene::Scene;
use snell_scene::graph::{Node, Surface};
use snell_scene::material::Material;
use snell_scene::medium::Grid;

/// The reader of NanoVDB files.
pub const READER: SceneReader = SceneReader {
    name: "nanovdb",
    description: "NanoVDB: grids of density, shown as smoke",
    extensions: &["nvdb"],
    recognises: volume::recognises,
    read,
};

/// The name of the grid that is preferred as smoke.
const DENSITY: &str = "density";

/// Single-scattering albedo of the smoke.
const ALBEDO: f32 = 0.9;

/// Length of the longest side of the box in mean free paths of the densest smoke: objects behind it
/// show faintly.
const THICKNESS: f32 = 40.0;

fn read(input: &Input) -> Result<Scene, ReadError> {
    let volumes = Volumes::of(input)?;
    let names: Vec<&str> = volumes.names().collect();
    let Some(name) = names.iter().find(|name| **name == DENSITY).or(names.first()) else {
        return Err(input.error(Place::Whole, "there is no grid in the file", "export it again"));
    };
    let mut scene = Scene::new(input.stem());
    let Some(volume) = volumes.volume(name)? else { return Ok(scene) };
    let others: Vec<_> = names.iter().filter(|other| *other != name).copied().collect();
    if !others.is_empty() {
        let message = format!("the grids {} are not shown; {name} is", others.join(", "));
        scene.warn(message);
    }
    let densest = volume.grid.values().iter().copied().fold(0.0, f32::max);
    if densest == 0.0 {
        scene.warn(format!("the grid {name} is empty"));
    }
    let side = volume.world_from_grid.matrix3;
    let longest = side.x_axis.length().max(side.y_axis.length()).max(side.z_axis.length()) as f32;
    let extinction = THICKNESS / (densest * longest).max(f32::MIN_POSITIVE);
    let extinction = if extinction.is_finite() { extinction } else { 1.0 };
    let (absorbed, scattered) =
        (Rgb::splat(extinction * (1.0 - ALBEDO)), Rgb::splat(extinction * ALBEDO));
    let transform = volume.world_from_grid;
    let medium = scene.add_medium(Grid::new(absorbed, scattered, 0.0, volume.grid, transform));
    let boundary = scene.add_material(Material::interface(*name, medium));
    let surfaces = vec![Surface::shape(BoxShape { min: DVec3::ZERO, max: DVec3::ONE }, boundary)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::named(*name) });
    Ok(scene)
}
