//! The rays of cameras, and the choice of a camera.

use crate::arrays::from_vec;
use crate::contents::Contents;
use crate::names::suggestion;
use crate::scene::precision;
use crate::work::{Threads, run};
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use rayon::prelude::*;
use snell_math::{DVec2, Vec2};
use snell_scene::{Camera, CameraSample};

/// The requested camera: one of `cameras` by number or name, or a camera itself. By default the
/// first of `cameras`.
pub fn choose(cameras: &[Camera], wanted: Option<&Bound<'_, PyAny>>) -> PyResult<Camera> {
    let Some(wanted) = wanted else {
        return cameras
            .first()
            .cloned()
            .ok_or_else(|| PyIndexError::new_err("camera: the scene has none"));
    };
    if let Ok(camera) = wanted.cast::<crate::camera::Camera>() {
        return Ok(camera.get().0.clone());
    }
    if let Ok(name) = wanted.extract::<String>() {
        let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
        let found = cameras.iter().find(|camera| camera.name == name).cloned();
        return found.ok_or_else(|| {
            PyValueError::new_err(format!("camera is {name:?}{}", suggestion(&name, &names)))
        });
    }
    let number: usize = wanted.extract().map_err(|_| {
        PyTypeError::new_err("camera: expected a Camera, a number from 0, or a name")
    })?;
    let error = || {
        PyIndexError::new_err(format!("camera is {number}, but the scene has {}", cameras.len()))
    };
    cameras.get(number).cloned().ok_or_else(error)
}

/// The rays of one of a scene's cameras.
pub fn rays<'py>(
    py: Python<'py>,
    contents: &Contents,
    camera: Option<&Bound<'py, PyAny>>,
    size: [Option<u32>; 2],
    dtype: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    rays_of(py, &choose(&contents.stage.cameras, camera)?, size, dtype)
}

/// One ray through the centre of each pixel: an array `(height, width, 6)`.
pub fn rays_of<'py>(
    py: Python<'py>,
    camera: &Camera,
    size: [Option<u32>; 2],
    dtype: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let is_double = precision(py, dtype)?;
    let own = camera.resolution;
    let side = |given: Option<u32>, at: usize, name: &str| match given.or(own.map(|size| size[at]))
    {
        Some(0) => {
            Err(PyValueError::new_err(format!("{name} is 0, expected a whole number from 1")))
        }
        Some(pixels) => Ok(pixels),
        None => Err(PyTypeError::new_err(format!(
            "{name} is left out, and the camera has no size of its own"
        ))),
    };
    let size = [side(size[0], 0, "width_px")?, side(size[1], 1, "height_px")?];
    if size.iter().any(|&side| side > 1 << 16) {
        return Err(PyValueError::new_err(format!(
            "width_px and height_px are {size:?}, expected at most 65536"
        )));
    }
    // Outside the projection a ray has no direction, so it misses.
    if is_double {
        return each_pixel(py, size, |film| match camera.central_ray(film, size) {
            Some(ray) => [ray.origin.to_array(), ray.direction.to_array()],
            None => [camera.eye.to_array(), [0.0; 3]],
        });
    }
    each_pixel(py, size, |film| {
        let found = camera.ray(&CameraSample { film, lens: Vec2::splat(0.5) }, size);
        let is_there = found.weight > 0.0;
        let direction = if is_there { found.ray.direction.to_array() } else { [0.0; 3] };
        [found.ray.origin.to_array(), direction]
    })
}

/// An array of the origins and directions of the rays of all pixels.
fn each_pixel<T: numpy::Element + Copy + Default + Send + Sync>(
    py: Python<'_>,
    size: [u32; 2],
    ray: impl Fn(DVec2) -> [[T; 3]; 2] + Sync,
) -> PyResult<Bound<'_, PyAny>> {
    let [width, height] = size.map(|side| side as usize);
    crate::memory::admit_all("the rays", width * height, 6 * size_of::<T>())?;
    let rows = run(py, Threads::new(None)?, false, |cancel| {
        let mut rays = vec![T::default(); width * height * 6];
        rays.par_chunks_mut(width * 6).enumerate().try_for_each(|(y, row)| {
            cancel.check()?;
            for (x, place) in row.as_chunks_mut::<6>().0.iter_mut().enumerate() {
                let found = ray(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
                place.copy_from_slice(found.as_flattened());
            }
            Ok(())
        })?;
        Ok(rays)
    })?;
    from_vec(py, rows, &[height, width, 6])
}
