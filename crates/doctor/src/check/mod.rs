//! The checks, one file each.

mod cameras;
mod coplanar;
mod faces;
mod holes;
mod lights;
mod materials;
mod numbers;
mod reader;
mod scale;
mod textures;
mod winding;

pub use cameras::cameras;
pub use coplanar::coplanar;
pub use faces::faces;
pub use holes::holes;
pub use lights::lights;
pub use materials::materials;
pub use numbers::numbers;
pub use reader::reader;
pub use scale::scale;
pub use textures::textures;
pub use winding::winding;

use snell_scene::Material;

/// The name of a material in messages.
fn material_name(index: usize, material: &Material) -> String {
    if material.name.is_empty() {
        format!("material {index}")
    } else {
        format!("material \"{}\"", material.name)
    }
}

/// A number with its noun, such as `1 face` or `2 faces`.
fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}
