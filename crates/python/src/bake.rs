//! Light that is baked into textures.

use crate::arrays::{PointArray, array, from_vec, slice};
use crate::prepare::Request as Preparation;
use crate::scene::Scene;
use crate::settings::{self, Keywords};
use crate::work::{Stopped, Threads, run};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use snell_math::DVec3;
use snell_render::irradiance::{Place, irradiance};
use snell_render::{IntegratorKind, Request, Settings};

/// The irradiance `(n, 3)` at points `(n, 3)` with normals `(n, 3)` and texels; the options are
/// those of a render.
#[pyfunction]
pub fn _irradiance<'py>(
    py: Python<'py>,
    scene: &Bound<'py, Scene>,
    points: &Bound<'py, PyAny>,
    normals: &Bound<'py, PyAny>,
    texels: Vec<[u32; 2]>,
    options: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let keywords = Keywords(options);
    let request = settings::request(&keywords)?;
    let threads = Threads::new(keywords.get("threads", "a whole number")?)?;
    let mut build = request.build();
    build.compact |= scene.get().0.contents(py).compact;
    let wanted = Preparation { build, size: Request::DEFAULT_SIZE, shutter: None };
    let prepared = scene.get().0.prepared(py, &wanted, threads)?;
    let (points, normals) = (array(points, "points")?, array(normals, "normals")?);
    let points = PointArray::<f64>::new(&points, "points")?;
    let normals = PointArray::<f64>::new(&normals, "normals")?;
    let vectors = |values| Ok::<_, PyErr>(slice(values)?.as_chunks::<3>().0);
    let (points, normals) = (vectors(&points.values)?, vectors(&normals.values)?);
    if points.len() != normals.len() || points.len() != texels.len() {
        return Err(PyValueError::new_err("points, normals and texels: expected equal numbers"));
    }
    let place = |((point, normal), texel): ((&[f64; 3], &[f64; 3]), &[u32; 2])| Place {
        position: (DVec3::from_array(*point) + prepared.moved_by).as_vec3(),
        normal: DVec3::from_array(*normal).as_vec3(),
        texel: *texel,
    };
    let places: Vec<Place> = points.iter().zip(normals).zip(&texels).map(place).collect();
    let camera = prepared.scene.cameras.first().cloned();
    let camera = camera.ok_or_else(|| PyValueError::new_err("the scene is empty"))?;
    let problem = |error: snell_render::RequestError| PyValueError::new_err(error.to_string());
    let resolved = request.resolve(&prepared.scene, &camera).map_err(problem)?;
    let settings = Settings { integrator: IntegratorKind::Path, ..resolved };
    let found = run(py, threads, false, |cancel| {
        let keep_going = || cancel.check().is_ok();
        irradiance(&prepared.compiled, &places, &settings, &keep_going).ok_or(Stopped)
    })?;
    from_vec(py, found.iter().flat_map(|rgb| rgb.to_array()).collect(), &[places.len(), 3])
}
