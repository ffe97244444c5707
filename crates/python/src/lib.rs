//! The Rust half of the Python package `snell`: NumPy arrays in, hits out.
//!
//! One exposed concept per file. [`scene`] is the class with the queries; [`contents`] is its data,
//! [`state`] the worlds that [`assemble`] builds from it; [`rays`] and [`arrays`] read arguments,
//! [`query`], [`nearest`] and [`pairs`] run queries, [`answers`] returns the answers; [`work`] has
//! the threads. The Python half is in `python/snell`.

#![forbid(unsafe_code)]

mod animated;
mod answers;
mod arrays;
mod assemble;
mod bake;
mod camera;
mod camera_poses;
mod cameras;
mod choice;
mod columns;
mod command;
mod contents;
mod declared;
mod distributed;
mod encoding;
mod file;
mod graph;
mod heightfield;
mod image;
mod keeping;
mod light;
mod live;
mod load;
mod material;
mod medium;
mod memory;
mod mesh;
mod motion;
mod names;
mod nearest;
mod objects;
mod origins;
mod pairs;
mod palette;
mod pickle;
mod place;
mod points;
mod precision;
mod prepare;
mod progress;
mod query;
mod rays;
mod receipts;
mod render;
mod scene;
mod schema;
mod settings;
mod spawn;
mod stage;
mod state;
mod surface;
mod surroundings;
mod texture;
mod value;
mod view;
mod work;

use pyo3::prelude::*;

#[pymodule]
fn _snell(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add_class::<scene::Scene>()?;
    module.add_class::<answers::Hits>()?;
    module.add_class::<answers::Intersections>()?;
    module.add_class::<answers::ClosestPoints>()?;
    module.add_class::<image::Image>()?;
    module.add_class::<camera::Camera>()?;
    module.add_class::<light::Light>()?;
    module.add_class::<material::Material>()?;
    module.add_class::<medium::Medium>()?;
    module.add_class::<texture::Texture>()?;
    module.add_class::<texture::Channel>()?;
    module.add_class::<texture::Pattern>()?;
    module.add_function(wrap_pyfunction!(command::_run_command, module)?)?;
    module.add_function(wrap_pyfunction!(load::load, module)?)?;
    module.add_function(wrap_pyfunction!(load::load_stage, module)?)?;
    module.add_function(wrap_pyfunction!(pickle::_restore, module)?)?;
    module.add_function(wrap_pyfunction!(image::_restore_image, module)?)?;
    module.add_function(wrap_pyfunction!(image::_compare, module)?)?;
    module.add_function(wrap_pyfunction!(camera::_restore_camera, module)?)?;
    module.add_function(wrap_pyfunction!(light::_restore_light, module)?)?;
    module.add_function(wrap_pyfunction!(material::_restore_material, module)?)?;
    module.add_function(wrap_pyfunction!(texture::_restore_texture, module)?)?;
    module.add_function(wrap_pyfunction!(texture::_restore_pattern, module)?)?;
    module.add_function(wrap_pyfunction!(medium::_restore_medium, module)?)?;
    module.add_function(wrap_pyfunction!(file::_write_file, module)?)?;
    module.add_function(wrap_pyfunction!(points::_load_points, module)?)?;
    module.add_function(wrap_pyfunction!(surroundings::_upright, module)?)?;
    module.add_class::<view::View>()?;
    module.add_function(wrap_pyfunction!(settings::_render_settings, module)?)?;
    module.add_function(wrap_pyfunction!(view::_explain, module)?)?;
    module.add_function(wrap_pyfunction!(view::_view, module)?)?;
    module.add_function(wrap_pyfunction!(bake::_irradiance, module)?)?;
    module.add_function(wrap_pyfunction!(pairs::_closest_pair, module)?)?;
    module.add_function(wrap_pyfunction!(pairs::_collides, module)?)?;
    module.add_function(wrap_pyfunction!(pairs::_time_of_impact, module)?)?;
    module.add_function(wrap_pyfunction!(pairs::_body_points, module)?)?;
    module.add_class::<render::_Render>()?;
    module.add_class::<distributed::film::_Film>()?;
    module.add_class::<distributed::worker::_Worker>()?;
    module.add_function(wrap_pyfunction!(distributed::_pack_scene, module)?)?;
    module.add_function(wrap_pyfunction!(distributed::_unpack_scene, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("INVALID_ID", snell_intersect::Hit::NONE)?;
    module.add_function(wrap_pyfunction!(schema::describe, module)?)?;
    let families = [
        ("SHAPES", "shape"),
        ("MATERIALS", "material"),
        ("PATTERNS", "pattern"),
        ("MEDIA", "medium"),
        ("LIGHTS", "light"),
        ("PROJECTIONS", "projection"),
    ];
    families
        .into_iter()
        .try_for_each(|(name, family)| module.add(name, schema::catalogue(py, family)?))
}
