//! The Rust half of the Python package `snell`: NumPy arrays in, hits out.
//!
//! One exposed concept per file. [`scene`] is the class that is asked; [`contents`] is what it holds, [`state`] the worlds made of that by
//! [`assemble`]; [`rays`] and [`arrays`] read arguments, [`query`] and [`nearest`] answer, [`answers`] hands the answers out; [`work`] has
//! the threads. The Python half is in `python/snell`.

#![forbid(unsafe_code)]

mod answers;
mod arrays;
mod assemble;
mod cameras;
mod contents;
mod graph;
mod image;
mod load;
mod mesh;
mod names;
mod nearest;
mod objects;
mod pickle;
mod precision;
mod prepare;
mod query;
mod rays;
mod render;
mod scene;
mod settings;
mod state;
mod surface;
mod tree;
mod work;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

#[pymodule]
fn _snell(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add_class::<scene::Scene>()?;
    module.add_class::<answers::Hits>()?;
    module.add_class::<answers::Intersections>()?;
    module.add_class::<answers::ClosestPoints>()?;
    module.add_class::<image::Image>()?;
    module.add_function(wrap_pyfunction!(load::load, module)?)?;
    module.add_function(wrap_pyfunction!(pickle::_restore, module)?)?;
    module.add_function(wrap_pyfunction!(image::_restore_image, module)?)?;
    module.add_function(wrap_pyfunction!(image::_compare, module)?)?;
    module.add_function(wrap_pyfunction!(render::_render, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("INVALID_ID", snell_intersect::Hit::NONE)?;
    let shapes = PyDict::new(py);
    for (name, parameters) in objects::shape_parameters() {
        shapes.set_item(name, PyTuple::new(py, parameters)?)?;
    }
    module.add("SHAPES", shapes)
}
