//! The class `Image`: a picture in linear light, with its layers.

use crate::arrays::{array, contiguous, from_vec, is_double, shown, slice};
use crate::encoding;
use crate::load::check_there;
use crate::memory::{admit, admit_all};
use crate::names::choice;
use crate::work::{Threads, run_to_end, run_to_end_on};
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyOSError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict, PyList, PyTuple};
use snell_formats::image::compare::{BYTES_PER_PIXEL, CompareOptions, LinearImage, compare};
use snell_formats::image::{
    Display, Tonemap, WriteOptions, display_value, encode_image_as, encoder_bytes, read_layers,
    write_image,
};
use snell_formats::{Input, ReadOptions, WriteError};
use snell_persist::Receipt;
use snell_render::IntegratorKind;
use snell_scene::{Layer, LayeredImage, SceneSettings};
use std::path::PathBuf;
use std::sync::Arc;

/// The conversion of a picture to display values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Look(Display);

impl Look {
    /// The display settings of the scene's file, or their defaults.
    pub fn of(hints: &SceneSettings, integrator: IntegratorKind) -> PyResult<Self> {
        let name = hints.tonemap.as_deref().unwrap_or("none");
        Ok(Self(Display {
            exposure: hints.exposure.unwrap_or(0.0),
            tonemap: choice("tonemap", name, &Tonemap::ALL, Tonemap::name)?,
            srgb: !hints.raw_display && integrator != IntegratorKind::Aov,
        }))
    }

    /// The settings with the given ones replaced.
    pub fn with(self, exposure: Option<f64>, tonemap: Option<&str>) -> PyResult<Self> {
        let mut display = self.0;
        if let Some(stops) = exposure {
            if stops.is_nan() || stops.abs() > 100.0 {
                return Err(PyValueError::new_err(format!(
                    "exposure is {stops}, expected stops from -100 to 100"
                )));
            }
            display.exposure = stops;
        }
        if let Some(name) = tonemap {
            display.tonemap = choice("tonemap", name, &Tonemap::ALL, Tonemap::name)?;
        }
        Ok(Self(display))
    }
}

/// A picture: linear light, pixel by pixel, with any number of extra layers.
///
/// NumPy sees it as an array `(height, width, channels)` of float32, rows from the top: linear Rec.
/// 709 red, green and blue, and alpha (premultiplied) if it is transparent somewhere. Notebooks
/// show it. It never changes.
///
/// Parameters
/// ----------
/// pixels : array (height, width), (height, width, 3) or (height, width, 4)
///     Floats are linear light. uint8 and uint16 are sRGB display values, as in most programs, and
///     their alpha is not premultiplied.
///
/// Examples
/// --------
/// >>> import numpy as np, snell
/// >>> image = snell.Image(np.full((2, 3, 3), 0.5))
/// >>> image.width, image.height
/// (3, 2)
/// >>> np.asarray(image).dtype
/// dtype('float32')
/// >>> snell.Image(np.full((2, 3, 3), 128, dtype=np.uint8)).to_uint8()[0, 0].tolist()
/// [128, 128, 128]
#[pyclass(frozen, module = "snell")]
pub struct Image {
    picture: Arc<LayeredImage>,
    variance: Option<Arc<LayeredImage>>,
    look: Look,
    facts: Py<PyDict>,
    receipt: Option<Receipt>,
    array: PyOnceLock<Py<PyAny>>,
    layers: PyOnceLock<Py<PyDict>>,
}

/// The receipt of a picture that is written with these options; `None` if another exposure would
/// give it other pixels.
fn written_receipt(
    receipt: &Receipt,
    exposure: Option<f64>,
    tonemap: Option<&str>,
    bits: i64,
    half: bool,
) -> Option<Receipt> {
    // The error of each pixel is that of the picture with the exposure of the render.
    if exposure.is_some() && receipt.has("--noise") {
        return None;
    }
    let changes = [
        exposure.map(|stops| format!("--exposure={stops}")),
        tonemap.map(|name| format!("--tonemap={name}")),
        (bits != 8).then(|| format!("--bits={bits}")),
        half.then(|| "--half".to_string()),
    ];
    let of = |receipt: Receipt, argument| receipt.with_argument(argument);
    Some(changes.into_iter().flatten().fold(receipt.clone(), of))
}

/// A layer as a read-only array. Layers of ids become int32, and layers with one channel have no
/// channel axis.
fn layer_array<'py>(
    py: Python<'py>,
    image: &LayeredImage,
    layer: &Layer,
) -> PyResult<Bound<'py, PyAny>> {
    let (width, height) = (image.width as usize, image.height as usize);
    admit_all("the array", layer.values.len(), size_of::<f32>())?;
    let made = match layer.channels.len() {
        1 if layer.channels[0] == "id" => {
            from_vec(py, layer.values.iter().map(|&x| x as i32).collect(), &[height, width])
        }
        1 => from_vec(py, layer.values.clone(), &[height, width]),
        n => from_vec(py, layer.values.clone(), &[height, width, n]),
    }?;
    let flags = PyDict::new(py);
    flags.set_item("write", false)?;
    made.call_method("setflags", (), Some(&flags))?;
    Ok(made)
}

impl Image {
    /// The image of a rendered picture.
    pub fn new(
        picture: LayeredImage,
        variance: Option<LayeredImage>,
        look: Look,
        facts: Py<PyDict>,
    ) -> Self {
        Self {
            picture: Arc::new(picture),
            variance: variance.map(Arc::new),
            look,
            facts,
            receipt: None,
            array: PyOnceLock::new(),
            layers: PyOnceLock::new(),
        }
    }

    /// The image with the receipt of its render.
    pub fn with_receipt(self, receipt: Option<Receipt>) -> Self {
        Self { receipt, ..self }
    }

    /// The pixels and their layers.
    pub fn picture(&self) -> &Arc<LayeredImage> {
        &self.picture
    }

    /// Fails if there is no memory for a copy of the picture and for its encoder.
    fn admit_file(&self, extension: &str, png_bits: u8) -> PyResult<()> {
        let values: usize = self.picture.layers.iter().map(|layer| layer.channels.len()).sum();
        let each = 4 * (values as u64 + 4) + encoder_bytes(extension, values as u64, png_bits);
        admit("the picture as a file", u64::from(self.width()) * u64::from(self.height()) * each)
    }

    fn main(&self) -> &Layer {
        &self.picture.layers[0]
    }

    fn written_metadata(&self, py: Python<'_>) -> PyResult<Vec<(String, String)>> {
        let mut all =
            vec![("Software".to_string(), format!("Snell {}", env!("CARGO_PKG_VERSION")))];
        for (key, value) in self.facts.bind(py) {
            let (key, value) = (key.extract::<String>()?, value.str()?.extract::<String>()?);
            // These values belong to the run, not to the picture.
            if !["seconds", "warnings", "is_complete", "estimated_memory_bytes", "Software"]
                .contains(&key.as_str())
            {
                all.push((key, value));
            }
        }
        Ok(all)
    }
}

/// Pixels of sRGB integers as linear light, with premultiplied alpha.
fn decoded(values: &[f32], channels: usize, levels: f32) -> Vec<f32> {
    let pixel = |p: &[f32]| match *p {
        [r, g, b, a] => {
            let [r, g, b, a] = encoding::linear([r, g, b, a], levels);
            [r * a, g * a, b * a, a]
        }
        [r, g, b] => encoding::linear([r, g, b, levels], levels),
        [y, ..] => encoding::linear([y, y, y, levels], levels),
        [] => [0.0; 4],
    };
    values.chunks(channels).flat_map(|p| pixel(p).into_iter().take(channels)).collect()
}

/// Reads pixels from an array.
fn read_pixels(value: &Bound<'_, PyAny>, name: &str) -> PyResult<LayeredImage> {
    let array = array(value, name)?;
    is_double(&array, name)?;
    let (height, width, channels) = match *array.shape() {
        [h, w] => (h, w, 1),
        [h, w, c @ (1 | 3 | 4)] => (h, w, c),
        _ => (0, 0, 0),
    };
    let fits = |side: usize| (1..=1 << 16).contains(&side);
    if !fits(height) || !fits(width) {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!(
            "{name}: shape is {found}, expected (height, width), (height, width, 3) or (height, \
                width, 4), sides from 1 to 65536"
        )));
    }
    admit_all("the picture", height * width * channels.max(3), 2 * size_of::<f32>())?;
    let levels = encoding::levels(&array, name)?;
    let values = contiguous::<f32>(&array)?;
    let values = slice(&values)?;
    let decoded = levels.map(|levels| decoded(values, channels, levels));
    if decoded.is_none() {
        encoding::warn_of_bytes(value.py(), values, name, encoding::AS_UINT8)?;
    }
    let values = decoded.as_deref().unwrap_or(values);
    let (values, names): (Vec<f32>, &[&str]) = match channels {
        1 => (values.iter().flat_map(|&y| [y; 3]).collect(), &["R", "G", "B"]),
        3 => (values.to_vec(), &["R", "G", "B"]),
        _ => (values.to_vec(), &["R", "G", "B", "A"]),
    };
    let channels = names.iter().map(|name| (*name).to_string()).collect();
    let layers = vec![Layer { name: String::new(), channels, values }];
    Ok(LayeredImage { width: width as u32, height: height as u32, layers, metadata: Vec::new() })
}

#[pymethods]
impl Image {
    #[new]
    fn py_new(py: Python<'_>, pixels: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self::new(
            read_pixels(pixels, "pixels")?,
            None,
            Look::default(),
            PyDict::new(py).unbind(),
        ))
    }

    /// Reads a picture: OpenEXR with its layers, PNG, JPEG, Radiance HDR and others, whose values
    /// are made linear.
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile, snell
    /// >>> with tempfile.TemporaryDirectory() as folder:
    /// ...     path = pathlib.Path(folder, "grey.exr")
    /// ...     snell.Image([[0.25, 0.5]]).save(path)
    /// ...     float(snell.Image.open(path).pixels[0, 1, 0])
    /// 0.5
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        check_there(&path)?;
        let picture = run_to_end(py, move || {
            let input = Input::open(&path, &ReadOptions::default())?;
            read_layers(&input)
        })?;
        let picture = picture.map_err(|e| PyValueError::new_err(e.to_string()))?;
        let facts = PyDict::new(py);
        for (key, value) in &picture.metadata {
            facts.set_item(key, value)?;
        }
        Ok(Self::new(picture, None, Look::default(), facts.unbind()))
    }

    /// Number of pixels in a row.
    #[getter]
    fn width(&self) -> u32 {
        self.picture.width
    }

    /// Number of rows of pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.picture.height
    }

    /// The shape of :attr:`pixels`.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(
            py,
            [self.height() as usize, self.width() as usize, self.main().channels.len()],
        )
    }

    /// The linear values, `(height, width, 3)` or `(height, width, 4)`, float32, read-only: the
    /// same as `np.asarray(image)`.
    #[getter]
    fn pixels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let make = || {
            let shape = [self.height() as usize, self.width() as usize, self.main().channels.len()];
            admit_all("the array of pixels", self.main().values.len(), size_of::<f32>())?;
            let made = from_vec(py, self.main().values.clone(), &shape)?;
            let flags = PyDict::new(py);
            flags.set_item("write", false)?;
            made.call_method("setflags", (), Some(&flags))?;
            Ok::<_, PyErr>(made.unbind())
        };
        Ok(self.array.get_or_try_init(py, make)?.bind(py).clone())
    }

    /// The extra layers by name: read-only arrays `(height, width)`, or `(height, width, channels)`
    /// for more than one channel. Ids are int32, -1 where there is nothing; all else is float32.
    #[getter]
    fn aovs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let make = || {
            let all = PyDict::new(py);
            for layer in &self.picture.layers[1..] {
                all.set_item(&layer.name, layer_array(py, &self.picture, layer)?)?;
            }
            Ok::<_, PyErr>(all.unbind())
        };
        Ok(self.layers.get_or_try_init(py, make)?.bind(py).clone())
    }

    /// The estimated variance of each value of :attr:`pixels`, in the same shape; None for a
    /// picture that was not rendered.
    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.variance
            .as_ref()
            .map(|variance| layer_array(py, variance, &variance.layers[0]))
            .transpose()
    }

    /// Metadata of the render, or of the picture's file: a dictionary.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.facts.bind(py).copy()
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pixels = self.pixels(py)?;
        let wanted = match dtype {
            Some(dtype) => dtype.clone(),
            None => pixels.getattr("dtype")?,
        };
        let is_same = pixels.getattr("dtype")?.eq(&wanted)?;
        match copy {
            Some(false) if !is_same => Err(PyValueError::new_err("another dtype needs a copy")),
            Some(true) => pixels.call_method1("astype", (wanted,)),
            _ if is_same => Ok(pixels),
            _ => pixels.call_method1("astype", (wanted,)),
        }
    }

    /// Display values: an array `(height, width, 3)` or `(height, width, 4)` of uint8, with the
    /// sRGB curve.
    ///
    /// Parameters
    /// ----------
    /// exposure : float, optional
    ///     Stops: values are multiplied by two to this power.
    /// tonemap : str, optional
    ///     `"none"` (clamps), `"aces"` or `"agx"`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> snell.Image([[0.0, 0.5, 2.0]]).to_uint8()[0, :, 0].tolist()
    /// [0, 188, 255]
    #[pyo3(signature = (*, exposure=None, tonemap=None))]
    fn to_uint8<'py>(
        &self,
        py: Python<'py>,
        exposure: Option<f64>,
        tonemap: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let display = self.look.with(exposure, tonemap)?.0;
        let count = self.main().channels.len();
        admit_all("the array", self.main().values.len(), 1)?;
        let level = |x: f32| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let bytes: Vec<u8> = py.detach(|| {
            let pixel = |p: &[f32]| {
                let alpha = if count == 4 { p[3].clamp(0.0, 1.0) } else { 1.0 };
                let straight = |x: f32| if alpha > 0.0 { x / alpha } else { 0.0 };
                let [r, g, b] =
                    display_value([straight(p[0]), straight(p[1]), straight(p[2])], &display)
                        .map(level);
                [r, g, b, level(alpha)]
            };
            self.main()
                .values
                .chunks(count)
                .flat_map(|p| pixel(p).into_iter().take(count))
                .collect()
        });
        from_vec(py, bytes, &[self.height() as usize, self.width() as usize, count])
    }

    /// Writes the picture; the extension decides the format: `.exr` keeps linear light and all
    /// layers, `.hdr` and `.pfm` linear light, `.png`, `.jpg` and `.ppm` display values.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The path of the file. It is written completely or not at all.
    /// exposure, tonemap
    ///     As for :meth:`to_uint8`, for formats with display values.
    /// bits : int
    ///     Bits per channel of PNG: 8 or 16.
    /// half : bool
    ///     Writes colours of OpenEXR with 16 instead of 32 bits.
    /// variance : bool
    ///     Writes the variance as a layer, too (OpenEXR).
    /// threads : int, optional
    ///     Number of threads for the encoding. Default: one per core.
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile, snell
    /// >>> with tempfile.TemporaryDirectory() as folder:
    /// ...     snell.Image([[0.0, 1.0]]).save(pathlib.Path(folder, "two-pixels.png"))
    #[pyo3(signature = (
        path, *, exposure=None, tonemap=None, bits=8, half=false, variance=false, threads=None,
    ))]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        exposure: Option<f64>,
        tonemap: Option<&str>,
        bits: i64,
        half: bool,
        variance: bool,
        threads: Option<i64>,
    ) -> PyResult<()> {
        let threads = Threads::new(threads)?;
        let png_bits = match bits {
            8 | 16 => bits as u8,
            _ => return Err(PyValueError::new_err(format!("bits is {bits}, expected 8 or 16"))),
        };
        let display = self.look.with(exposure, tonemap)?.0;
        let options = WriteOptions { display, png_bits, exr_half: half, ..WriteOptions::default() };
        self.admit_file(
            &path.extension().unwrap_or_default().to_string_lossy().to_lowercase(),
            png_bits,
        )?;
        let mut picture = Arc::unwrap_or_clone(self.picture.clone());
        if let Some(of) = self.variance.as_ref().filter(|_| variance) {
            picture.layers.push(Layer { name: "variance".into(), ..of.layers[0].clone() });
        }
        picture.metadata = self.written_metadata(py)?;
        let receipt = self.receipt.as_ref().filter(|_| !variance);
        if let Some(receipt) =
            receipt.and_then(|of| written_receipt(of, exposure, tonemap, bits, half))
        {
            picture.metadata.push((Receipt::KEY.into(), receipt.text()));
        }
        let written = run_to_end_on(py, threads, move || write_image(&path, &picture, &options))?;
        written.map_err(|error| match &error {
            WriteError::Io { .. } => PyOSError::new_err(error.to_string()),
            WriteError::Format { .. } => PyValueError::new_err(error.to_string()),
        })
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let options = WriteOptions { display: self.look.0, ..WriteOptions::default() };
        self.admit_file("png", 8)?;
        let picture = self.picture.clone();
        let bytes = run_to_end(py, move || encode_image_as("png", &picture, &options))?;
        let bytes = bytes.map_err(|e| PyValueError::new_err(e.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let [w, h] = [self.width(), self.height()];
        let mut text = format!("<snell.Image: {w} x {h} pixels");
        if let Some(samples) = self.facts.bind(py).get_item("samples")? {
            text += &format!(", {samples} samples each");
        }
        let layers: Vec<_> =
            self.picture.layers[1..].iter().map(|layer| layer.name.as_str()).collect();
        if !layers.is_empty() {
            text += &format!(", with {}", layers.join(", "));
        }
        Ok(text + ">")
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let restore = py.import("snell._snell")?.getattr("_restore_image")?;
        let variance = self.variance.as_ref().map(|v| stored(py, v)).transpose()?;
        let Display { exposure, tonemap, srgb } = self.look.0;
        let look = (exposure, tonemap.name(), srgb);
        Ok((
            restore,
            (
                stored(py, &self.picture)?,
                variance,
                look,
                self.facts.clone_ref(py),
                self.receipt.as_ref().map(Receipt::text),
            )
                .into_pyobject(py)?,
        ))
    }
}

/// The layers of a picture in a form that pickles.
fn stored<'py>(py: Python<'py>, image: &LayeredImage) -> PyResult<Bound<'py, PyAny>> {
    let layers = PyList::empty(py);
    for layer in &image.layers {
        admit_all("the picture", layer.values.len(), size_of::<f32>())?;
        let values = from_vec(py, layer.values.clone(), &[layer.values.len()])?;
        layers.append((&layer.name, &layer.channels, values))?;
    }
    Ok((image.width, image.height, layers).into_pyobject(py)?.into_any())
}

type Stored<'py> = (u32, u32, Vec<(String, Vec<String>, Bound<'py, PyUntypedArray>)>);

fn restored((width, height, stored): Stored<'_>) -> PyResult<LayeredImage> {
    let mut layers = Vec::new();
    for (name, channels, array) in stored {
        let values = slice(&contiguous::<f32>(&array)?)?.to_vec();
        let expected = width as usize * height as usize * channels.len();
        if values.len() != expected {
            let found = values.len();
            return Err(PyValueError::new_err(format!(
                "layer {name:?} has {found} values, expected {expected}"
            )));
        }
        layers.push(Layer { name, channels, values });
    }
    if width == 0
        || height == 0
        || !layers.first().is_some_and(|main| matches!(main.channels.len(), 3 | 4))
    {
        return Err(PyValueError::new_err("this is not a stored picture"));
    }
    Ok(LayeredImage { width, height, layers, metadata: Vec::new() })
}

/// Restores a picture from its pickled state.
#[pyfunction]
#[pyo3(signature = (picture, variance, look, facts, receipt=None))]
pub fn _restore_image(
    picture: Stored<'_>,
    variance: Option<Stored<'_>>,
    look: (f64, String, bool),
    facts: &Bound<'_, PyDict>,
    receipt: Option<&str>,
) -> PyResult<Image> {
    let (exposure, tonemap, srgb) = look;
    let tonemap = choice("tonemap", &tonemap, &Tonemap::ALL, Tonemap::name)?;
    let look = Look(Display { exposure, tonemap, srgb });
    let variance = variance.map(restored).transpose()?;
    let receipt = receipt.and_then(|text| Receipt::parse(text).ok());
    let image = Image::new(restored(picture)?, variance, look, facts.copy()?.unbind());
    Ok(image.with_receipt(receipt))
}

/// A picture in the form for comparison.
fn linear(value: &Bound<'_, PyAny>, name: &str) -> PyResult<LinearImage> {
    let of = |picture: &LayeredImage| LinearImage::from_layer(picture, &picture.layers[0]);
    match value.cast::<Image>() {
        Ok(image) => Ok(of(image.get().picture())),
        Err(_) => Ok(of(&read_pixels(value, name)?)),
    }
}

/// The differences of two pictures: numbers by name, and the FLIP error of each pixel.
#[pyfunction]
pub fn _compare<'py>(
    py: Python<'py>,
    reference: &Bound<'py, PyAny>,
    test: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let (reference, test) = (linear(reference, "reference")?, linear(test, "test")?);
    let size = [reference.height as usize, reference.width as usize];
    admit_all("comparing the pictures", size[0] * size[1], BYTES_PER_PIXEL)?;
    let compared = run_to_end(py, move || compare(&reference, &test, &CompareOptions::default()))?;
    let compared = compared.map_err(|e| PyValueError::new_err(e.to_string()))?;
    let numbers = crate::value::Value::of(&compared.comparison).map_err(PyTypeError::new_err)?;
    Ok((numbers.plain(py)?, from_vec(py, compared.flip, &size)?))
}
