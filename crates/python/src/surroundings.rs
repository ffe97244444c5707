//! What surrounds the things of a scene: the direction that is up, light from all directions, and
//! the background.

use crate::arrays::{array, contiguous, from_vec, is_double, slice};
use crate::contents::Contents;
use crate::encoding::warn_of_bytes;
use crate::graph::{Purpose, graph};
use crate::image::Image;
use crate::scene::Scene;
use crate::schema::{References, read};
use crate::texture::image;
use crate::value::Value;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;
use snell_math::parameters::Kind;
use snell_math::{DAffine3, DMat3, DVec3, Rgb, real};
use snell_scene::framing::{turned, upright};
use snell_scene::light::sky::{Sky, SkyError};
use snell_scene::{Background, Environment, Scene as Graph};

/// A colour: a number, three numbers, or `#rrggbb`.
fn color(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Rgb> {
    match read(value, Kind::Color, name, &mut References::default())? {
        Value::List(items) => match items[..] {
            [Value::Single(r), Value::Single(g), Value::Single(b)]
                if r >= 0.0 && g >= 0.0 && b >= 0.0 =>
            {
                Ok(Rgb::new(r, g, b))
            }
            _ => Err(PyValueError::new_err(format!("{name}: a colour has no negative numbers"))),
        },
        _ => Err(PyTypeError::new_err(format!("{name}: expected a colour"))),
    }
}

fn color_tuple(py: Python<'_>, color: Rgb) -> PyResult<Bound<'_, PyAny>> {
    let form = Value::List(color.to_array().map(Value::Single).to_vec());
    form.plain(py)
}

#[pymethods]
impl Scene {
    /// The direction that is up: `"y"` unless the scene or its file says otherwise. Can be
    /// assigned:
    /// `"x"`, `"y"`, `"z"`, one of these with a minus, or a vector `(3,)`.
    ///
    /// Cameras and light that a picture gets because the scene has none, the viewer, and the floor
    /// of the studio follow it, and environments have their zenith there: an assignment turns the
    /// one that there is. `.snell` files keep it, and glTF files, where y is up, are turned.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.up
    /// 'y'
    /// >>> scene.up = "z"
    /// >>> scene.environment = "sky"
    #[getter]
    fn up<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let up = up_of(&self.0.contents(py).stage);
        match AXES.into_iter().find(|(_, axis)| *axis == up) {
            Some((name, _)) => Ok(PyString::new(py, name).into_any()),
            None => from_vec(py, up.to_array().to_vec(), &[3]),
        }
    }

    #[setter]
    fn set_up(&self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let up = read_axis(value, "up")?;
        self.0.edit(value.py(), |contents| {
            let turn = upright(up) * upright(up_of(&contents.stage)).inverse();
            let stage = contents.stage_mut();
            stage.settings.up = Some(up);
            stage.environment = stage.environment.take().map(|light| turned(light, &turn));
            if let Background::ShadowCatcher(_) = stage.background {
                let floor = studio(contents)?;
                contents.stage_mut().background = floor;
            }
            Ok(())
        })
    }

    /// Light from all directions: None, a colour (radiance, W / (m^2 sr)), or a latitude-longitude
    /// picture (row 0 is the zenith, which is :attr:`up`; its middle is -z, or +y if z is up). Can
    /// be assigned: a colour, an array, an :class:`Image`, its file, or `"sky"`. See
    /// :meth:`set_environment` to turn and scale a picture.
    #[getter]
    fn environment<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match &self.0.contents(py).stage.environment {
            None => Ok(py.None().into_bound(py)),
            Some(Environment::Constant(color)) => color_tuple(py, *color),
            Some(Environment::Image { image, .. }) => {
                let rgb =
                    (0..image.height).flat_map(|y| (0..image.width).flat_map(move |x| [(x, y)]));
                let values: Vec<f32> = rgb
                    .flat_map(|(x, y)| {
                        let [r, g, b, _] = image.rgba(x, y);
                        [r, g, b]
                    })
                    .collect();
                let pixels =
                    from_vec(py, values, &[image.height as usize, image.width as usize, 3])?;
                py.get_type::<Image>().call1((pixels,))
            }
        }
    }

    #[setter(environment)]
    fn environment_simply(&self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        self.set_environment(value, None, None)
    }

    /// Surrounds the scene with light.
    ///
    /// Parameters
    /// ----------
    /// value
    ///     Any value that can be assigned to :attr:`environment`.
    /// scale : colour, optional
    ///     Factor on the radiance.
    /// transform : array (4, 4) or (3, 4), optional
    ///     Map from the environment's coordinates, in which +y is the zenith, to the scene's; it
    ///     turns the picture. If left out, the zenith is :attr:`up`.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> scene = snell.Scene()
    /// >>> scene.set_environment(np.full((4, 8, 3), 0.5), scale=2)
    #[pyo3(signature = (value, *, scale=None, transform=None))]
    fn set_environment(
        &self,
        value: &Bound<'_, PyAny>,
        scale: Option<&Bound<'_, PyAny>>,
        transform: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let scale = scale.map_or(Ok(Rgb::WHITE), |scale| color(scale, "scale"))?;
        let placed = crate::place::transform(transform)?.map(|map| *map.matrix());
        let environment = read_environment(value, scale)?;
        self.0.edit(value.py(), |contents| {
            let placed = placed.unwrap_or_else(|| upright(up_of(&contents.stage)));
            contents.stage_mut().environment = environment.map(|light| turned(light, &placed));
            Ok(())
        })
    }

    /// Surrounds the scene with the sky of a clear day and its sun, of the model of Hosek and
    /// Wilkie (2012).
    ///
    /// Parameters
    /// ----------
    /// sun : array (3,)
    ///     Direction towards the sun, not below the horizon; such as :func:`sun_direction` gives
    ///     for a place and a time.
    /// turbidity : float
    ///     Haze of the air, 1 to 10: 2 is very clear, 3 a clear day, 6 and more hazy.
    /// ground : float
    ///     Reflectance of the ground, 0 to 1, which is seen below the horizon.
    /// size : float
    ///     Angular diameter of the sun in degrees, 0 to 20: 0.53 in nature, more for softer shadows
    ///     of the same brightness, 0 for a sky without a sun.
    /// scale : float
    ///     Factor on the radiance. With 1, a white surface in full daylight has about 1.
    ///
    /// The horizon is at right angles to :attr:`up`.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> scene = snell.Scene()
    /// >>> scene.up = "z"
    /// >>> evening = np.datetime64("2024-06-20T18:00")
    /// >>> scene.set_sky(snell.sun_direction(48.8, 2.3, evening, up="z"), turbidity=4)
    #[pyo3(signature = (sun, *, turbidity=3.0, ground=0.2, size=0.53, scale=1.0))]
    fn set_sky(
        &self,
        sun: &Bound<'_, PyAny>,
        turbidity: f64,
        ground: f64,
        size: f64,
        scale: f64,
    ) -> PyResult<()> {
        let py = sun.py();
        let towards = direction(sun, "sun")?;
        let up = up_of(&self.0.contents(py).stage).normalize_or(DVec3::Y);
        let elevation = real::asin(towards.dot(up).clamp(-1.0, 1.0)).to_degrees();
        // Rounding puts a sun on the horizon below it.
        if elevation < -1e-6 {
            return Err(PyValueError::new_err(format!(
                "sun is {:.2} degrees below the horizon; there is no sky of a night",
                -elevation
            )));
        }
        let sky = Sky {
            elevation: elevation.max(0.0),
            azimuth: 0.0,
            turbidity,
            ground,
            sun: size,
            scale,
        };
        let sky = py.detach(|| sky.environment()).map_err(|error| {
            let parameter = if error.parameter == "sun" { "size" } else { error.parameter };
            PyValueError::new_err(SkyError { parameter, ..error }.to_string())
        })?;
        // The sun of the picture is over -z; it is turned to where it is.
        let ahead = (towards - up * towards.dot(up)).try_normalize();
        let ahead = ahead.unwrap_or_else(|| upright(up).transform_vector3(DVec3::NEG_Z));
        let turn = DAffine3::from_mat3(DMat3::from_cols(ahead.cross(up), up, -ahead));
        self.0.edit(py, |contents| {
            contents.stage_mut().environment = Some(turned(sky, &turn));
            Ok(())
        })
    }

    /// The background behind the scene: `"environment"`, `"transparent"`, a colour (linear), which
    /// lights nothing, or `"studio"`: a grey that shows the scene's shadow on a floor under its
    /// lowest point at the time of the assignment. Can be assigned.
    #[getter]
    fn background<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match self.0.contents(py).stage.background {
            Background::Environment => Ok(PyString::new(py, "environment").into_any()),
            Background::Transparent => Ok(PyString::new(py, "transparent").into_any()),
            Background::ShadowCatcher(_) => Ok(PyString::new(py, "studio").into_any()),
            Background::Color(color) => color_tuple(py, color),
        }
    }

    #[setter]
    fn set_background(&self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let background = match value.extract::<String>().as_deref() {
            Ok("environment") => Background::Environment,
            Ok("transparent") => Background::Transparent,
            Ok("studio") => studio(&self.0.contents(value.py()))?,
            _ => {
                let color = color(value, "background")?;
                let remedy = "8-bit sRGB is given as \"#rrggbb\"";
                warn_of_bytes(value.py(), &color.to_array(), "background", remedy)?;
                Background::Color(color)
            }
        };
        self.0.edit(value.py(), |contents| {
            contents.stage_mut().background = background;
            Ok(())
        })
    }
}

/// Reads light from all directions in any of the forms that :attr:`environment` accepts.
fn read_environment(value: &Bound<'_, PyAny>, scale: Rgb) -> PyResult<Option<Environment>> {
    if value.is_none() {
        return Ok(None);
    }
    let text = value.extract::<String>();
    if text.as_ref().is_ok_and(|text| text == "sky") {
        return Ok(Some(match snell_scene::framing::default_sky() {
            Environment::Image { image, scale: own, world_from_environment } => {
                Environment::Image { image, scale: own * scale, world_from_environment }
            }
            Environment::Constant(color) => Environment::Constant(color * scale),
        }));
    }
    let is_hex = text.is_ok_and(|text| text.starts_with('#'));
    let is_number = value.extract::<f64>().is_ok()
        || value.len().is_ok_and(|n| n == 3) && value.get_item(0)?.extract::<f64>().is_ok();
    if is_hex || is_number {
        return Ok(Some(Environment::Constant(color(value, "environment")? * scale)));
    }
    let image = image(value, "environment")?;
    Ok(Some(Environment::Image { image, scale, world_from_environment: DAffine3::IDENTITY }))
}

/// The axes by name.
const AXES: [(&str, DVec3); 6] = [
    ("x", DVec3::X),
    ("y", DVec3::Y),
    ("z", DVec3::Z),
    ("-x", DVec3::NEG_X),
    ("-y", DVec3::NEG_Y),
    ("-z", DVec3::NEG_Z),
];

/// The direction that is up in a scene.
fn up_of(stage: &Graph) -> DVec3 {
    stage.settings.up.unwrap_or(DVec3::Y)
}

/// Reads a direction: the name of an axis, or a vector.
fn read_axis(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DVec3> {
    let refused = || {
        PyValueError::new_err(format!(
            "{name} is {}, expected \"x\", \"y\", \"z\", one of these with a minus, or a \
             direction (3,)",
            crate::settings::shown(value)
        ))
    };
    let axis = match value.extract::<String>() {
        Ok(name) => AXES.into_iter().find(|(known, _)| *known == name).ok_or_else(refused)?.1,
        Err(_) => direction(value, name).map_err(|_| refused())?,
    };
    Ok(axis)
}

/// Reads a direction `(3,)`, as a unit vector.
fn direction(value: &Bound<'_, PyAny>, name: &str) -> PyResult<DVec3> {
    let array = array(value, name)?;
    is_double(&array, name)?;
    let values = contiguous::<f64>(&array)?;
    let unit = match slice(&values)? {
        &[x, y, z] => DVec3::new(x, y, z).try_normalize().filter(|unit| unit.is_finite()),
        _ => None,
    };
    unit.ok_or_else(|| {
        let found = crate::settings::shown(value);
        PyValueError::new_err(format!("{name} is {found}, expected a direction (3,)"))
    })
}

/// The rotation `(3, 3)` from axes in which y is up to those in which `up` is.
#[pyfunction]
#[pyo3(signature = (up, name="up"))]
pub fn _upright<'py>(up: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    let turn = upright(read_axis(up, name)?).matrix3;
    from_vec(up.py(), turn.transpose().to_cols_array().to_vec(), &[3, 3])
}

/// The studio's background, with a floor under the lowest point of a scene.
fn studio(contents: &Contents) -> PyResult<Background> {
    let scene = graph(contents, Purpose::Picture).map_err(PyValueError::new_err)?;
    Ok(snell_scene::framing::studio_background(&scene, DVec3::Y))
}
