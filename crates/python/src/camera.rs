//! The class `Camera`.

use crate::cameras::rays_of;
use crate::names::Name;
use crate::schema::{References, family, kind_of, make, read, read_all, show};
use crate::value::Value;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::{Map, Value as Json};
use snell_math::DVec3;
use snell_math::parameters::Kind;
use snell_scene::Projection;

/// A camera: viewpoint and projection.
///
/// Parameters
/// ----------
/// projection : str
///     One of :data:`PROJECTIONS`: `"perspective"`, `"intrinsics"` (a camera matrix),
///     `"orthographic"`, `"panoramic"`, `"equal-area"` or `"fisheye"`.
/// eye : three numbers
///     Where the camera is.
/// target : three numbers, optional
///     The point that the camera looks at; alternatively `towards`, the viewing direction. -z if
///     both are left out.
/// up : three numbers
///     The up direction of the picture; it need not be perpendicular.
/// fov : float, optional
///     Angle of view in degrees: from the bottom to the top of a perspective picture (45 if nothing
///     is given), across the circle of a fisheye (180).
/// aperture_radius : float
///     Radius of a thin lens, in units of the scene; 0 for a pinhole.
/// focus_distance : float, optional
///     Distance of the plane in focus; the distance of the target if left out.
/// resolution : two whole numbers, optional
///     Size of the picture that the camera is made for.
/// clip : four numbers, optional
///     A plane `(a, b, c, d)` that cuts the scene open: the camera sees only points with
///     `a x + b y + c z + d >= 0`. Light is that of the whole scene.
/// name : str
///     A name, for `camera="name"`.
/// **parameters
///     The parameters of the projection, in place of `fov`.
///
/// Examples
/// --------
/// >>> import snell
/// >>> view = {"eye": (0, 10, 0), "target": (0, 0, 0), "up": (0, 0, -1)}
/// >>> above = snell.Camera("orthographic", **view, half_size=(None, 4))
/// >>> above.towards
/// (0.0, -1.0, 0.0)
/// >>> lens = snell.Camera(eye=(0, 1, 5), target=(0, 1, 0), fov=30, aperture_radius=0.1)
/// >>> lens.focus_distance
/// 5.0
#[pyclass(frozen, module = "snell")]
pub struct Camera(pub snell_scene::Camera);

/// Reads three finite numbers.
fn vector(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DVec3> {
    match read(value, Kind::Vector(3), name, &mut References::default())? {
        Value::List(items) => match items[..] {
            [Value::Double(x), Value::Double(y), Value::Double(z)] => Ok(DVec3::new(x, y, z)),
            _ => Err(PyTypeError::new_err(format!("{name}: expected 3 numbers"))),
        },
        _ => Err(PyTypeError::new_err(format!("{name}: expected 3 numbers"))),
    }
}

/// The parameters of a camera or a projection.
fn fields_of<'py>(
    py: Python<'py>,
    of: &impl serde::Serialize,
) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
    let Value::Fields(fields) = Value::of(of).map_err(PyTypeError::new_err)? else {
        return Ok(Vec::new());
    };
    let others = fields.iter().filter(|(key, _)| *key != "projection");
    others
        .map(|(key, value)| Ok((key.to_string(), show(py, value, &References::default())?)))
        .collect()
}

fn at_least(value: f64, low: f64, name: &str) -> PyResult<f64> {
    if value >= low && value.is_finite() {
        return Ok(value);
    }
    Err(PyValueError::new_err(format!("{name} is {value}, expected a number from {low}")))
}

/// The coefficients of a plane, checked.
fn plane(clip: [f64; 4]) -> PyResult<[f64; 4]> {
    if clip.iter().all(|c| c.is_finite()) && clip[..3] != [0.0; 3] {
        return Ok(clip);
    }
    let message = format!(
        "clip is {clip:?}, expected a plane (a, b, c, d) whose first three numbers, its normal, \
         are not all 0"
    );
    Err(PyValueError::new_err(message))
}

/// The size of the pictures that a camera is made for: the given one, or that of its matrix.
pub fn made_for(
    resolution: Option<[u32; 2]>,
    projection: &Projection,
) -> PyResult<Option<[u32; 2]>> {
    if let Some(size) = resolution.filter(|size| size.contains(&0)) {
        let message = format!("resolution is {size:?}, expected numbers from 1");
        return Err(PyValueError::new_err(message));
    }
    Ok(resolution.or(match projection {
        Projection::Intrinsics(matrix) => Some(matrix.size),
        _ => None,
    }))
}

/// Makes a projection from its parameters.
pub fn projection(
    py: Python<'_>,
    kind: &str,
    fov: Option<f64>,
    parameters: Option<&Bound<'_, PyDict>>,
) -> PyResult<Projection> {
    let family = family("projection")?;
    let known = kind_of(family, kind)?.fields();
    let given = match parameters {
        Some(given) => read_all(kind, known, given, &mut References::default())?,
        None => Vec::new(),
    };
    let angle = |degrees: f64, limit: f64| {
        if degrees > 0.0 && degrees <= limit {
            return Ok(degrees.to_radians());
        }
        Err(PyValueError::new_err(format!("fov is {degrees}, expected degrees from 0 to {limit}")))
    };
    if let (Some(degrees), Some(value)) = (fov.filter(|fov| fov.fract() != 0.0), fov)
        && degrees > 0.0
        && degrees <= std::f64::consts::PI
    {
        crate::encoding::warn(
            py,
            format!(
                "fov is {value} degrees; of radians, give math.degrees({value}) = {:.4}",
                value.to_degrees()
            ),
        )?;
    }
    match (kind, fov, given.is_empty()) {
        ("perspective", fov, true) => {
            Ok(Projection::from_half_angle_y(angle(fov.unwrap_or(45.0), 179.9)? / 2.0))
        }
        ("fisheye", fov, true) => {
            Ok(Projection::Fisheye { max_angle: angle(fov.unwrap_or(180.0), 360.0)? })
        }
        (_, Some(_), _) => {
            let message = format!("{kind} takes fov or its own parameters, not both");
            Err(PyTypeError::new_err(message))
        }
        _ => {
            let whole = |mut fields: Map<String, Json>| {
                fields.insert(family.tag.to_string(), kind.into());
                Json::Object(fields)
            };
            make(kind, known, &given, &family.example(kind), whole)
        }
    }
}

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (
        projection="perspective", /, *, eye, target=None, towards=None, up=None, fov=None,
        aperture_radius=0.0, focus_distance=None, resolution=None, clip=None, name=None,
        **parameters
    ))]
    fn new(
        projection: &str,
        eye: &Bound<'_, PyAny>,
        target: Option<&Bound<'_, PyAny>>,
        towards: Option<&Bound<'_, PyAny>>,
        up: Option<&Bound<'_, PyAny>>,
        fov: Option<f64>,
        aperture_radius: f64,
        focus_distance: Option<f64>,
        resolution: Option<[u32; 2]>,
        clip: Option<[f64; 4]>,
        name: Option<Name>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let projection = self::projection(eye.py(), projection, fov, parameters)?;
        let eye = vector(eye, "eye")?;
        let up = up.map_or(Ok(DVec3::Y), |up| vector(up, "up"))?;
        let mut camera = match (target, towards) {
            (Some(_), Some(_)) => {
                return Err(PyTypeError::new_err("a camera takes target or towards, not both"));
            }
            (Some(target), None) => {
                let target = vector(target, "target")?;
                if target == eye {
                    return Err(PyValueError::new_err(
                        "target is where eye is, expected another point",
                    ));
                }
                snell_scene::Camera::from_target(eye, target, up, projection)
            }
            (None, towards) => {
                let towards =
                    towards.map_or(Ok(DVec3::NEG_Z), |towards| vector(towards, "towards"))?;
                snell_scene::Camera::from_direction(eye, towards, up, projection)
            }
        };
        camera.aperture_radius = at_least(aperture_radius, 0.0, "aperture_radius")?;
        if let Some(distance) = focus_distance {
            camera.focus_distance = at_least(distance, f64::MIN_POSITIVE, "focus_distance")?;
        }
        camera.resolution = made_for(resolution, &camera.projection)?;
        camera.clip = clip.map(plane).transpose()?;
        camera.name = name.map_or(String::new(), |name| name.0);
        Ok(Self(camera))
    }

    /// A copy with other parameters; what is not given stays. A new `eye` keeps the direction of
    /// view, and `target` or `towards` turn the camera. A `fov`, or other parameters of the
    /// projection, stand for its own.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> camera = snell.Camera(eye=(0, 0, 5), target=(0, 0, 0), fov=30, name="front")
    /// >>> other = camera.replace(eye=(1, 0, 5), resolution=(64, 48))
    /// >>> other.eye, other.towards, other.resolution, other.name
    /// ((1.0, 0.0, 5.0), (0.0, 0.0, -1.0), (64, 48), 'front')
    #[pyo3(signature = (
        *, eye=None, target=None, towards=None, up=None, fov=None, aperture_radius=None,
        focus_distance=None, resolution=None, clip=None, name=None, **parameters
    ))]
    fn replace(
        &self,
        py: Python<'_>,
        eye: Option<&Bound<'_, PyAny>>,
        target: Option<&Bound<'_, PyAny>>,
        towards: Option<&Bound<'_, PyAny>>,
        up: Option<&Bound<'_, PyAny>>,
        fov: Option<f64>,
        aperture_radius: Option<f64>,
        focus_distance: Option<f64>,
        resolution: Option<[u32; 2]>,
        clip: Option<[f64; 4]>,
        name: Option<Name>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let old = &self.0;
        let changes = parameters.filter(|changes| !changes.is_empty());
        let projection = match (fov, changes) {
            (None, None) => old.projection,
            _ => {
                let kind: String = self.kind(py)?.extract()?;
                let all = PyDict::new(py);
                if fov.is_none() {
                    for (key, value) in fields_of(py, &old.projection)? {
                        all.set_item(key, value)?;
                    }
                }
                changes.map_or(Ok(()), |changes| all.update(changes.as_mapping()))?;
                self::projection(py, &kind, fov, Some(&all))?
            }
        };
        let eye = eye.map_or(Ok(old.eye), |eye| vector(eye, "eye"))?;
        let towards = match (target, towards) {
            (Some(_), Some(_)) => {
                return Err(PyTypeError::new_err("a camera takes target or towards, not both"));
            }
            (Some(target), None) => vector(target, "target")? - eye,
            (None, Some(towards)) => vector(towards, "towards")?,
            (None, None) => old.towards,
        };
        if target.is_some() && towards == DVec3::ZERO {
            let message = "target is where eye is, expected another point";
            return Err(PyValueError::new_err(message));
        }
        let up = up.map_or(Ok(old.up), |up| vector(up, "up"))?;
        let mut camera = snell_scene::Camera { projection, ..old.clone() };
        if (eye, towards, up) != (old.eye, old.towards, old.up) {
            let projection = camera.projection;
            let placed = snell_scene::Camera::from_direction(eye, towards, up, projection);
            (camera.eye, camera.towards, camera.up) = (placed.eye, placed.towards, placed.up);
        }
        if target.is_some() {
            camera.focus_distance = towards.length();
        }
        if let Some(radius) = aperture_radius {
            camera.aperture_radius = at_least(radius, 0.0, "aperture_radius")?;
        }
        if let Some(distance) = focus_distance {
            camera.focus_distance = at_least(distance, f64::MIN_POSITIVE, "focus_distance")?;
        }
        let kept = resolution.or(match changes {
            None => old.resolution,
            Some(_) => None,
        });
        camera.resolution = made_for(kept, &camera.projection)?.or(old.resolution);
        if let Some(clip) = clip {
            camera.clip = Some(plane(clip)?);
        }
        if let Some(name) = name {
            camera.name = name.0;
        }
        Ok(Self(camera))
    }

    /// The same as :meth:`replace`, for :func:`copy.replace`.
    #[pyo3(signature = (**changes))]
    fn __replace__<'py>(
        slf: Bound<'py, Self>,
        changes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        slf.getattr("replace")?.call((), changes)
    }

    /// The projection, one of :data:`PROJECTIONS`.
    #[getter]
    fn kind<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let projection = Value::of(&self.0.projection).map_err(PyTypeError::new_err)?;
        projection.get("projection").unwrap_or(&Value::Nothing).plain(py)
    }

    /// The parameters by name: position and axes, and those of the projection. Each is an
    /// attribute, too.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        let parts = [fields_of(py, &self.0)?, fields_of(py, &self.0.projection)?];
        for (key, value) in parts.into_iter().flatten() {
            all.set_item(key, value)?;
        }
        Ok(all)
    }

    /// One ray through the centre of each pixel: an array `(height_px, width_px, 6)`, for
    /// :meth:`Scene.cast_rays`.
    ///
    /// Directions have unit length, so `t_hit` is the distance; where a projection shows nothing
    /// (outside of a fisheye's circle) they are 0. They are whole rays, whatever `clip` cuts away.
    ///
    /// Parameters
    /// ----------
    /// width_px, height_px : int, optional
    ///     Size of the picture; the camera's if left out.
    /// dtype : float32 or float64
    ///     The precision of the rays, float32 if left out. Rays are computed in double precision;
    ///     `np.float64` keeps it, which a camera far from zero needs: near 5,000,000 float32 has
    ///     steps of 0.5.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> snell.Camera(eye=(0, 0, 5)).rays(4, 3).shape
    /// (3, 4, 6)
    #[pyo3(signature = (width_px=None, height_px=None, dtype=None))]
    fn rays<'py>(
        &self,
        py: Python<'py>,
        width_px: Option<u32>,
        height_px: Option<u32>,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        rays_of(py, &self.0, [width_px, height_px], dtype)
    }

    /// The projections of points in a picture of some size, in pixels from its upper left corner:
    /// an array `(..., 2)`, NaN for points that are not visible. The centre of the first pixel is
    /// `(0.5, 0.5)`, for a camera of :meth:`from_opencv` it is `(0, 0)`. Points outside of the
    /// picture have places outside of it, and nothing hides any.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> snell.Camera(eye=(0, 0, 5)).project([[0, 0, 0]], (640, 480)).tolist()
    /// [[320.0, 240.0]]
    fn project<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        size: [u32; 2],
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = points.py();
        let array = crate::arrays::array(points, "points")?;
        let points = crate::arrays::PointArray::<f64>::new(&array, "points")?;
        let values = crate::arrays::slice(&points.values)?.as_chunks::<3>().0;
        let first = match &self.0.projection {
            Projection::Intrinsics(k) => k.pixel_center - 0.5,
            _ => 0.0,
        };
        let seen = |p: &[f64; 3]| {
            let seen = self.0.project(DVec3::from_array(*p), size);
            seen.map_or([f64::NAN; 2], |p| (p + first).to_array())
        };
        let pixels = values.iter().flat_map(seen).collect();
        crate::arrays::from_vec(py, pixels, &[&points.shape[..], &[2]].concat())
    }

    fn __setattr__(&self, name: &str, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        Err(pyo3::exceptions::PyAttributeError::new_err(format!(
            "{name}: a camera never changes; replace({name}=…) makes another one"
        )))
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let found = self.parameters(py)?.get_item(name)?;
        let error =
            || pyo3::exceptions::PyAttributeError::new_err(format!("this camera has no {name:?}"));
        found.ok_or_else(error)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let mut text = format!("Camera({}", self.kind(py)?.repr()?);
        for (key, value) in self.parameters(py)? {
            text += &format!(", {key}={}", value.repr()?);
        }
        Ok(text + ")")
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let restore = py.import("snell._snell")?.getattr("_restore_camera")?;
        let json =
            serde_json::to_string(&self.0).map_err(|e| PyValueError::new_err(e.to_string()))?;
        Ok((restore, (json,).into_pyobject(py)?))
    }
}

/// Restores a stored camera.
#[pyfunction]
pub fn _restore_camera(json: &str) -> PyResult<Camera> {
    serde_json::from_str(json).map(Camera).map_err(|e| PyValueError::new_err(e.to_string()))
}
