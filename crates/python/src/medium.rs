//! The class `Medium`.

use crate::arrays::{array, contiguous, from_vec, is_double, shown, slice};
use crate::declared::{Schema, declared_class};
use crate::place::{matrix, named_transform};
use numpy::PyUntypedArrayMethods;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use snell_math::{DAffine3, DVec3, Rgb, Transform};
use snell_scene::medium::{ColorGrid, ScalarGrid};
use std::sync::Arc;

declared_class! {
    /// A participating medium: fog, smoke, milk. It fills the inside of a closed surface, as the
    /// `interior` of its material, or all of the scene, as :attr:`Scene.medium`.
    ///
    /// Parameters
    /// ----------
    /// kind : str
    ///     One of :data:`MEDIA`, such as `"homogeneous"`.
    /// **parameters
    ///     The parameters of the kind. Coefficients are per unit of length of the scene.
    ///
    /// Notes
    /// -----
    /// A `"grid"` has a `density`, an array of the shape (z, y, x). Its numbers are values at the
    /// centres of cells, are interpolated linearly between them, and multiply `sigma_a` and
    /// `sigma_s`. Cells fill the box between two corners, `bounds`, or the unit cube mapped by the
    /// matrix `world_from_grid`. `sigma_a_tint`, `sigma_s_tint` and `emission_tint`, of the shape
    /// (z, y, x, 3) or (z, y, x), are factors of each colour. The emitted light is `emission` times
    /// the `density` or, if given, `emission_scale`, in the colour of a black body if there is a
    /// `temperature` (kelvin). Arrays may be of different sizes; negative values and NaN count as
    /// 0. Media lie in the scene's coordinates: they do not move with the surface around them.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> milk = snell.Medium("homogeneous", sigma_a=0.1, sigma_s=(5, 5, 4.8))
    /// >>> glass = snell.Material("dielectric", ior=1.5, interior=milk)
    ///
    /// A cloud from an array, in a box without a surface:
    ///
    /// >>> import numpy as np
    /// >>> z, y, x = np.mgrid[-1:1:32j, -1:1:32j, -1:1:32j]
    /// >>> density = np.exp(-4 * (x**2 + y**2 + z**2))
    /// >>> bounds = [(-1, -1, -1), (1, 1, 1)]
    /// >>> smoke = snell.Medium("grid", density=density, sigma_s=5, bounds=bounds)
    /// >>> smoke.density.shape
    /// (32, 32, 32)
    /// >>> scene = snell.Scene()
    /// >>> border = snell.Material("interface", interior=smoke)
    /// >>> scene.add_shape("box", min=(-1, -1, -1), max=(1, 1, 1), material=border)
    /// 0
    Medium of snell_scene::Medium, restored by _restore_medium;

    /// A copy of the medium with some parameters changed.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> fog = snell.Medium("homogeneous", sigma_s=0.1)
    /// >>> fog.replace(g=0.5).g
    /// 0.5
    replace
}

impl Schema for snell_scene::Medium {
    const FAMILY: &'static str = "medium";

    fn is_shorthand(name: &str) -> bool {
        name == "bounds"
    }

    fn set_array(&mut self, name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let place = |value| match name {
            "bounds" => bounds(value),
            _ => named_transform(value, name).map(|map| *map.matrix()),
        };
        match (self, name) {
            (Self::Grid(grid), "density") => grid.density = Arc::new(scalars(value, name)?),
            (Self::Grid(grid), "emission_scale") => {
                grid.emission_scale = Some(Arc::new(scalars(value, name)?))
            }
            (Self::Grid(grid), "temperature") => {
                grid.temperature = Some(Arc::new(scalars(value, name)?))
            }
            (Self::Grid(grid), "sigma_a_tint") => {
                grid.sigma_a_tint = Some(Arc::new(colors(value, name)?))
            }
            (Self::Grid(grid), "sigma_s_tint") => {
                grid.sigma_s_tint = Some(Arc::new(colors(value, name)?))
            }
            (Self::Grid(grid), "emission_tint") => {
                grid.emission_tint = Some(Arc::new(colors(value, name)?))
            }
            (Self::Grid(grid), "world_from_grid" | "bounds") => {
                grid.world_from_grid = place(value)?
            }
            (Self::Cloud(cloud), "world_from_cloud" | "bounds") => {
                cloud.world_from_cloud = place(value)?
            }
            _ => return Err(PyTypeError::new_err(format!("there is no array {name:?}"))),
        }
        Ok(())
    }

    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let place = |map: &DAffine3| Transform::new(*map).map(|map| matrix(py, &map)).transpose();
        let of_colors = |tint: &Option<Arc<ColorGrid>>| {
            tint.as_ref().map(|tint| of_colors(py, tint)).transpose()
        };
        let of = |grid: &Option<Arc<ScalarGrid>>| {
            grid.as_ref().map(|grid| of_scalars(py, grid)).transpose()
        };
        match (self, name) {
            (Self::Grid(grid), "density") => of_scalars(py, &grid.density).map(Some),
            (Self::Grid(grid), "emission_scale") => of(&grid.emission_scale),
            (Self::Grid(grid), "temperature") => of(&grid.temperature),
            (Self::Grid(grid), "sigma_a_tint") => of_colors(&grid.sigma_a_tint),
            (Self::Grid(grid), "sigma_s_tint") => of_colors(&grid.sigma_s_tint),
            (Self::Grid(grid), "emission_tint") => of_colors(&grid.emission_tint),
            (Self::Grid(grid), "world_from_grid") => place(&grid.world_from_grid),
            (Self::Cloud(cloud), "world_from_cloud") => place(&cloud.world_from_cloud),
            _ => Ok(None),
        }
    }

    fn complete(self) -> PyResult<Self> {
        match &self {
            Self::Grid(grid) if grid.density.values().is_empty() => {
                Err(PyTypeError::new_err("grid: the parameter \"density\" is missing"))
            }
            _ => Ok(self),
        }
    }
}

/// The numbers of an array of the shape `(z, y, x)`, or `(z, y, x, 3)` with a colour for each cell,
/// and the numbers of cells along x, y and z.
fn numbers(
    value: &Bound<'_, PyAny>,
    name: &str,
    with_colors: bool,
) -> PyResult<(Vec<f32>, [usize; 3], usize)> {
    let array = array(value, name)?;
    is_double(&array, name)?;
    let (size, channels) = match *array.shape() {
        [z, y, x] => ([x, y, z], 1),
        [z, y, x, 3] if with_colors => ([x, y, z], 3),
        _ => {
            let expected = if with_colors { "(z, y, x, 3) or (z, y, x)" } else { "(z, y, x)" };
            let found = shown(array.shape());
            return Err(PyValueError::new_err(format!(
                "{name}: shape is {found}, expected {expected}"
            )));
        }
    };
    if size.contains(&0) {
        return Err(PyValueError::new_err(format!("{name}: there are no cells")));
    }
    let values = contiguous::<f32>(&array)?;
    Ok((slice(&values)?.to_vec(), size, channels))
}

fn scalars(value: &Bound<'_, PyAny>, name: &str) -> PyResult<ScalarGrid> {
    let (values, size, _) = numbers(value, name, false)?;
    Ok(ScalarGrid::new(size, values).unwrap_or_default())
}

fn colors(value: &Bound<'_, PyAny>, name: &str) -> PyResult<ColorGrid> {
    let (values, size, channels) = numbers(value, name, true)?;
    let color = |c: &[f32]| Rgb::new(c[0], c[1 % channels], c[2 % channels]);
    ColorGrid::new(size, values.chunks_exact(channels).map(color).collect())
        .ok_or_else(|| PyValueError::new_err(format!("{name}: too many cells")))
}

fn of_scalars<'py>(py: Python<'py>, grid: &ScalarGrid) -> PyResult<Bound<'py, PyAny>> {
    let [x, y, z] = grid.size();
    from_vec(py, grid.values().to_vec(), &[z, y, x])
}

fn of_colors<'py>(py: Python<'py>, grid: &ColorGrid) -> PyResult<Bound<'py, PyAny>> {
    let [x, y, z] = grid.size();
    from_vec(py, grid.values().iter().flat_map(|color| color.to_array()).collect(), &[z, y, x, 3])
}

/// The map from the unit cube to the box between two corners.
fn bounds(value: &Bound<'_, PyAny>) -> PyResult<DAffine3> {
    let array = array(value, "bounds")?;
    is_double(&array, "bounds")?;
    if *array.shape() != [2, 3] {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!(
            "bounds: shape is {found}, expected (2, 3): two corners"
        )));
    }
    let corners = contiguous::<f64>(&array)?;
    let corners = slice(&corners)?;
    let (low, high) = (DVec3::from_slice(&corners[..3]), DVec3::from_slice(&corners[3..]));
    if !(low.is_finite() && high.is_finite() && high.cmpgt(low).all()) {
        let [low, high] = [low, high].map(|c| c.to_array());
        return Err(PyValueError::new_err(format!(
            "bounds are {low:?} and {high:?}, expected the lower corner first"
        )));
    }
    Ok(DAffine3::from_translation(low) * DAffine3::from_scale(high - low))
}
