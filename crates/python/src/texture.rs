//! The classes `Texture`, `Channel` and `Pattern`: values that vary over surfaces.

use crate::arrays::{array, contiguous, shown, slice};
use crate::declared::{Schema, declared_class};
use crate::encoding::{AS_UINT8, warn_of_bytes};
use crate::image::Image as Picture;
use crate::load::check_there;
use crate::schema::{References, make, read_all, show};
use crate::value::Value;
use crate::work::run_to_end;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};
use serde_json::{Map, Value as Json};
use snell_formats::{Input, ReadOptions, image::read_image};
use snell_math::parameters::Declared as _;
use snell_scene::graph::ImageId;
use snell_scene::{Encoding, Image, ImageTexture as Declared, LayeredImage, Pixels};
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;

/// An image on a surface, in place of a colour or number of a material.
///
/// A colour takes the texture; a number takes one of its channels (:meth:`channel`). The material
/// applies no further factor.
///
/// Parameters
/// ----------
/// image : array, Image, str or os.PathLike
///     `(height, width)` or `(height, width, channels)`, 1 to 4 channels: uint8 and uint16 stand
///     for 0 to 1, floats for themselves. Or an image, or its file.
/// **parameters
///     `encoding`: `"srgb"` (colours of integers, as most files have them) or `"linear"` (data such
///     as roughness and normals). `wrap`: one or two of `"repeat"`, `"mirror"`, `"clamp"` and
///     `"black"`.
///     `filtering`: `"trilinear"` or `"nearest"`. `uv_set`: 0 to 3. `uv_transform`: two rows of
///     three numbers; texel (0, 0) is the upper left one and `v` grows downwards.
///
/// Examples
/// --------
/// >>> import numpy as np, snell
/// >>> checks = np.kron([[0, 1] * 4, [1, 0] * 4] * 4, np.ones((8, 8))).astype(np.uint8) * 255
/// >>> snell.Texture(checks, filtering="nearest")
/// Texture(64 x 64, encoding='srgb', filtering='nearest')
#[pyclass(frozen, module = "snell")]
pub struct Texture {
    /// The image of the texture.
    pub image: Arc<Image>,
    /// The lookup parameters; the image is number 0.
    pub declared: Declared,
}

/// One channel of a texture, in place of a number of a material: the result of
/// :meth:`Texture.channel`.
///
/// Examples
/// --------
/// >>> import snell
/// >>> snell.Texture([[0.2, 0.8]]).channel("r").number
/// 0
#[pyclass(frozen, module = "snell")]
pub struct Channel {
    /// The texture of which this is one channel.
    #[pyo3(get)]
    pub texture: Py<Texture>,
    /// The channel: 0 red, 1 green, 2 blue, 3 alpha.
    #[pyo3(get)]
    pub number: u8,
}

declared_class! {
    /// A procedural texture over a surface or in space, in place of a colour or number of a
    /// material, or of another pattern: checks, dots, noise, marble. :data:`PATTERNS` lists the
    /// kinds and their parameters.
    ///
    /// Parameters
    /// ----------
    /// kind : str
    ///     One of :data:`PATTERNS`, such as `"marble"` or `"checkerboard"`.
    /// **parameters
    ///     The parameters of the kind. Colours take textures and patterns too. Patterns in space
    ///     have `texture_from_world`: three rows of four numbers, the map from the world to the
    ///     space of the pattern. The others have `mapping`: `{"uv": {"uv_set": 0, "uv_transform":
    ///     rows}}` (two rows of three numbers, to `s` and `t` from `u`, `v` and 1), `{"spherical":
    ///     {"texture_from_world": rows}}`, `"cylindrical"` likewise, or `{"planar":
    ///     {"st_from_world": rows}}` (two rows of four numbers).
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> veins = snell.Pattern("marble", scale=4, variation=2)
    /// >>> veins.scale
    /// 4.0
    /// >>> stone = snell.Material("diffuse", reflectance=veins)
    /// >>> snell.Pattern("marbel")
    /// Traceback (most recent call last):
    /// ValueError: there is no pattern "marbel"; did you mean "marble"?
    Pattern of snell_scene::texture::Pattern, restored by _restore_pattern;

    /// A copy of the pattern with some parameters changed.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> snell.Pattern("fbm").replace(octaves=3).octaves
    /// 3
    replace
}

impl Schema for snell_scene::texture::Pattern {
    const FAMILY: &'static str = "pattern";
}

/// A texture of either class, as parameters accept it.
#[derive(Debug, FromPyObject, IntoPyObject)]
pub enum AnyTexture {
    /// An image.
    Image(Py<Texture>),
    /// A procedural texture.
    Pattern(Py<Pattern>),
}

impl AnyTexture {
    /// A new reference to the object.
    pub fn clone_ref(&self, py: Python<'_>) -> Self {
        match self {
            Self::Image(texture) => Self::Image(texture.clone_ref(py)),
            Self::Pattern(pattern) => Self::Pattern(pattern.clone_ref(py)),
        }
    }

    /// True if both are the same object.
    pub fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Image(a), Self::Image(b)) => a.is(b),
            (Self::Pattern(a), Self::Pattern(b)) => a.is(b),
            _ => false,
        }
    }
}

/// The texture of an image with default parameters.
fn default_of(image: &Image) -> Declared {
    Declared::new(ImageId(0), image.encoding)
}

/// The parameters of a texture, without its image.
fn parameters(of: &Declared) -> PyResult<Vec<(String, Value)>> {
    match Value::of(of).map_err(PyTypeError::new_err)? {
        Value::Fields(fields) => Ok(fields.into_iter().filter(|(key, _)| key != "image").collect()),
        _ => Ok(Vec::new()),
    }
}

/// The image that an argument gives: an array, an image, or its file.
pub fn image(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Arc<Image>> {
    let py = value.py();
    if let Ok(picture) = value.cast::<Picture>() {
        return Ok(Arc::new(of_picture(picture.get().picture())));
    }
    if !value.is_instance_of::<PyUntypedArray>()
        && let Ok(path) = value.extract::<PathBuf>()
    {
        check_there(&path)?;
        let read = run_to_end(py, move || {
            let input = Input::open(&path, &ReadOptions::default())?;
            read_image(&input).map(|image| (image, input.take_notes()))
        })?;
        let (image, notes) = read.map_err(|e| PyValueError::new_err(e.to_string()))?;
        for note in notes.into_iter().filter_map(|note| CString::new(note).ok()) {
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &note, 1)?;
        }
        return Ok(Arc::new(image));
    }
    let array = array(value, name)?;
    let (height, width, channels) = match *array.shape() {
        [h, w] => (h, w, 1),
        [h, w, c @ 1..=4] => (h, w, c),
        _ => (0, 0, 0),
    };
    let fits = |side: usize| (1..=1 << 16).contains(&side);
    if !fits(height) || !fits(width) {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!(
            "{name}: shape is {found}, expected (height, width) or (height, width, 1 to 4), sides \
                from 1 to 65536"
        )));
    }
    let kind: char = array.dtype().getattr("kind")?.extract()?;
    let size: usize = array.dtype().getattr("itemsize")?.extract()?;
    let (pixels, encoding) = match (kind, size) {
        ('u', 1) => (Pixels::U8(slice(&contiguous::<u8>(&array)?)?.to_vec()), Encoding::Srgb),
        ('u', 2) => (Pixels::U16(slice(&contiguous::<u16>(&array)?)?.to_vec()), Encoding::Srgb),
        ('f', _) => (Pixels::F32(slice(&contiguous::<f32>(&array)?)?.to_vec()), Encoding::Linear),
        _ => {
            let found = array.dtype();
            return Err(PyTypeError::new_err(format!(
                "{name}: dtype is {found}, expected uint8, uint16 or floats"
            )));
        }
    };
    if let Pixels::F32(values) = &pixels
        && let Some(at) = values.iter().position(|x| !x.is_finite())
    {
        let (pixel, channel) = (at / channels, at % channels);
        let (y, x, value) = (pixel / width, pixel % width, values[at]);
        return Err(PyValueError::new_err(format!(
            "{name}[{y}, {x}, {channel}] is {value}, expected a finite number"
        )));
    }
    if let Pixels::F32(values) = &pixels {
        warn_of_bytes(py, values, name, AS_UINT8)?;
    }
    Ok(Arc::new(Image {
        width: width as u32,
        height: height as u32,
        channels: channels as u32,
        pixels,
        encoding,
    }))
}

/// A picture as an image; alpha is not premultiplied in images.
fn of_picture(picture: &LayeredImage) -> Image {
    let main = &picture.layers[0];
    let channels = main.channels.len();
    let straight = |p: &[f32]| match *p {
        [r, g, b, a] if a > 0.0 => vec![r / a, g / a, b / a, a],
        _ => p.to_vec(),
    };
    let values = main
        .values
        .chunks(channels)
        .flat_map(straight)
        .map(|x| if x.is_finite() { x } else { 0.0 })
        .collect();
    Image::from_f32(picture.width, picture.height, channels as u32, values)
}

#[pymethods]
impl Texture {
    #[new]
    #[pyo3(signature = (image, **parameters))]
    fn new(image: &Bound<'_, PyAny>, parameters: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let pixels = self::image(image, "image")?;
        let Ok(Json::Object(default)) = serde_json::to_value(default_of(&pixels)) else {
            return Err(PyTypeError::new_err("a texture has parameters"));
        };
        // The first parameter is the image.
        let known = &Declared::PARAMETERS[1..];
        let given = match parameters {
            Some(given) => {
                // One word stands for both directions.
                if let Some(word) = given.get_item("wrap")?
                    && word.is_instance_of::<PyString>()
                {
                    given.set_item("wrap", (word.clone(), word))?;
                }
                read_all("Texture", known, given, &mut References::default())?
            }
            None => Vec::new(),
        };
        let whole = |given: Map<String, Json>| {
            let mut all = default.clone();
            all.extend(given);
            Json::Object(all)
        };
        let declared = make("Texture", known, &given, &default, whole)?;
        Ok(Self { image: pixels, declared })
    }

    /// Width and height of the image in texels.
    #[getter]
    fn size(&self) -> [u32; 2] {
        [self.image.width, self.image.height]
    }

    /// One channel, for numbers such as a roughness.
    ///
    /// Parameters
    /// ----------
    /// channel : str or int
    ///     `"r"`, `"g"`, `"b"` or `"a"`, or 0 to 3.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> worn = snell.Texture([[0.2, 0.8]])
    /// >>> metal = snell.Material("metallic-roughness", metallic=1, roughness=worn.channel("r"))
    fn channel(slf: &Bound<'_, Self>, channel: &Bound<'_, PyAny>) -> PyResult<Channel> {
        let by_name = channel
            .extract::<String>()
            .ok()
            .and_then(|name| ["r", "g", "b", "a"].iter().position(|c| *c == name));
        let number = by_name.or_else(|| channel.extract::<usize>().ok()).filter(|&n| n < 4);
        let error =
            || PyValueError::new_err("channel: expected \"r\", \"g\", \"b\" or \"a\", or 0 to 3");
        Ok(Channel { texture: slf.clone().unbind(), number: number.ok_or_else(error)? as u8 })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let default = parameters(&Declared::new(ImageId(0), Encoding::Linear))?;
        let mut text = format!("Texture({} x {}", self.image.width, self.image.height);
        for ((key, value), (_, usual)) in parameters(&self.declared)?.iter().zip(&default) {
            if value != usual {
                text += &format!(", {key}={}", show(py, value, &References::default())?.repr()?);
            }
        }
        Ok(text + ")")
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let restore = py.import("snell._snell")?.getattr("_restore_texture")?;
        let shape =
            [self.image.height as usize, self.image.width as usize, self.image.channels as usize];
        let pixels = match &self.image.pixels {
            Pixels::U8(v) => crate::arrays::from_vec(py, v.clone(), &shape)?,
            Pixels::U16(v) => crate::arrays::from_vec(py, v.clone(), &shape)?,
            Pixels::F32(v) => crate::arrays::from_vec(py, v.clone(), &shape)?,
        };
        let declared = serde_json::to_string(&self.declared)
            .map_err(|e| PyValueError::new_err(e.to_string()))?;
        Ok((restore, (pixels, self.image.encoding == Encoding::Srgb, declared).into_pyobject(py)?))
    }
}

/// Restores a texture from its pickled state.
#[pyfunction]
pub fn _restore_texture(
    pixels: &Bound<'_, PyAny>,
    srgb: bool,
    declared: &str,
) -> PyResult<Texture> {
    let mut image = Arc::unwrap_or_clone(self::image(pixels, "pixels")?);
    image.encoding = if srgb { Encoding::Srgb } else { Encoding::Linear };
    let declared =
        serde_json::from_str(declared).map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(Texture { image: Arc::new(image), declared })
}

#[pymethods]
impl Channel {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let name = ["r", "g", "b", "a"][usize::from(self.number & 3)];
        Ok(format!("{}.channel({name:?})", self.texture.bind(py).repr()?))
    }
}
