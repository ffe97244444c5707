//! The keyword arguments of a render as settings. What is left out is what the scene says, else the default.

use crate::names::choice;
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use snell_intersect::accel::AcceleratorKind;
use snell_intersect::{BuildOptions, Quality};
use snell_math::ColorModel;
use snell_oidn::Denoiser;
use snell_render::layers::{add_light_group, needed_aovs};
use snell_render::{
    Aov, Crop, Filter, Guiding, IntegratorKind, LightGroup, LightSamplerKind, LightStrategy, SamplerKind, Settings,
    Shadows, Terminator,
};
use snell_scene::{Camera, Scene};
use std::path::PathBuf;
use std::time::Duration;

/// Size of a picture if nobody says.
pub const DEFAULT_SIZE: [u32; 2] = [1280, 720];
/// Most samples per pixel.
const MAX_SPP: u32 = 1 << 24;
/// Most samples per pixel that a limit of time or noise alone allows.
const SPP_OF_LIMITS: u32 = 1 << 16;
/// Longest side of a picture.
const MAX_SIDE: u32 = 1 << 16;
/// Most pixels of a picture.
const MAX_PIXELS: u64 = 1 << 28;

/// Keyword arguments by name.
#[derive(Debug)]
pub struct Keywords<'a, 'py>(pub &'a Bound<'py, PyDict>);

impl<'py> Keywords<'_, 'py> {
    /// The value of a name, if there is one.
    pub fn any(&self, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(self.0.get_item(name)?.filter(|value| !value.is_none()))
    }

    /// The value of a name, which is `what`.
    pub fn get<T: for<'a> FromPyObject<'a, 'py>>(&self, name: &str, what: &str) -> PyResult<Option<T>> {
        let Some(value) = self.any(name)? else { return Ok(None) };
        let read = value.extract().map(Some);
        read.map_err(|_| PyTypeError::new_err(format!("{name} is {}, expected {what}", shown(&value))))
    }

    /// A whole number of a range.
    fn whole(&self, name: &str, range: std::ops::RangeInclusive<i64>) -> PyResult<Option<u32>> {
        let Some(number) = self.get::<i64>(name, "a whole number")? else { return Ok(None) };
        if range.contains(&number) {
            return Ok(u32::try_from(number).ok());
        }
        let (low, high) = (range.start(), range.end());
        Err(PyValueError::new_err(format!("{name} is {number}, expected a whole number from {low} to {high}")))
    }

    /// A positive number.
    fn positive(&self, name: &str) -> PyResult<Option<f64>> {
        let Some(number) = self.get::<f64>(name, "a number")? else { return Ok(None) };
        if number > 0.0 && number <= 1e9 {
            return Ok(Some(number));
        }
        Err(PyValueError::new_err(format!("{name} is {number}, expected a positive number up to 1e9")))
    }

    /// A number of a range.
    pub fn within(&self, name: &str, range: std::ops::RangeInclusive<f64>) -> PyResult<Option<f64>> {
        let Some(number) = self.get::<f64>(name, "a number")? else { return Ok(None) };
        if range.contains(&number) {
            return Ok(Some(number));
        }
        let (low, high) = (range.start(), range.end());
        Err(PyValueError::new_err(format!("{name} is {number}, expected a number from {low} to {high}")))
    }

    /// What is switched on or off, or is a value: `Some(None)` if it is just on.
    fn switch<T: for<'a> FromPyObject<'a, 'py>>(&self, name: &str, what: &str) -> PyResult<Option<Option<T>>> {
        match self.any(name)? {
            None => Ok(None),
            Some(value) if value.is_instance_of::<PyBool>() => Ok(value.is_truthy()?.then_some(None)),
            Some(_) => Ok(self.get(name, &format!("True, False or {what}"))?.map(Some)),
        }
    }

    /// One of some names; otherwise what the scene says, or nothing.
    fn one_of<T: Copy>(
        &self,
        name: &str,
        hint: Option<&String>,
        all: &[T],
        name_of: impl Fn(T) -> &'static str,
    ) -> PyResult<Option<T>> {
        let given = self.get::<String>(name, "a name")?;
        let Some(wanted) = given.as_ref().or(hint) else { return Ok(None) };
        choice(name, wanted, all, name_of).map(Some)
    }
}

/// A value in a message: not longer than a line.
pub fn shown(value: &Bound<'_, PyAny>) -> String {
    let text = value.repr().map_or_else(|_| "something".into(), |text| text.to_string_lossy().into_owned());
    if text.chars().count() <= 60 { text } else { text.chars().take(57).chain("...".chars()).collect() }
}

/// What a render is told beside the settings of the renderer.
#[derive(Debug)]
pub struct Request {
    /// Those settings.
    pub settings: Settings,
    /// Stop after this time, once every pixel has a sample.
    pub time: Option<Duration>,
    /// Whether training for guiding ends by the clock.
    pub is_training_timed: bool,
    /// Who removes the noise.
    pub denoiser: Option<Denoiser>,
}

/// Reads the settings.
pub fn read(keywords: &Keywords<'_, '_>, scene: &Scene, camera: &Camera) -> PyResult<Request> {
    let hints = &scene.settings;
    let integrator =
        keywords.one_of("integrator", hints.integrator.as_ref(), &IntegratorKind::ALL, IntegratorKind::name)?;
    let integrator = integrator.unwrap_or_default();
    let given_spp = keywords.whole("spp", 1..=i64::from(MAX_SPP))?;
    let time = keywords.positive("time")?.map(Duration::from_secs_f64);
    let noise = keywords.within("noise", 1e-5..=10.0)?;
    let spp = match (given_spp, time.is_some() || noise.is_some()) {
        (Some(spp), _) => spp,
        (None, true) => SPP_OF_LIMITS,
        (None, false) => hints.spp.unwrap_or(default_spp(integrator)).clamp(1, MAX_SPP),
    };
    let size = size(keywords)?.or(hints.size).or(camera.resolution).unwrap_or(DEFAULT_SIZE);
    let crop = crop(keywords, size)?;
    let denoiser = denoiser(keywords)?;
    let light_groups = light_groups(keywords, scene)?;
    let aovs = needed_aovs(&aovs(keywords)?, integrator, &light_groups, denoiser.is_some());
    let (guiding, is_training_timed) = guiding(keywords, integrator, size, given_spp.ok_or(spp), time.is_some())?;
    let exposure = keywords.within("exposure", -100.0..=100.0)?.or(hints.exposure).unwrap_or(0.0);
    check_pixels(crop.unwrap_or(Crop::full(size)))?;
    let has_filter = keywords.any("filter")?.is_some();
    let max_depth = keywords.whole("max_depth", 0..=i64::from(Settings::MAX_DEPTH))?.or(hints.max_depth);
    let settings = Settings {
        size,
        crop,
        spp,
        noise,
        noise_floor: Settings::NOISE_FLOOR / exposure.exp2(),
        progressive: time.is_some() || spp > 16,
        seed: keywords.whole("seed", 0..=i64::from(u32::MAX))?.unwrap_or(0),
        sampler: keywords
            .one_of("sampler", hints.sampler.as_ref(), &SamplerKind::ALL, SamplerKind::name)?
            .unwrap_or_default(),
        filter: keywords.one_of("filter", hints.filter.as_ref(), &Filter::ALL, Filter::name)?.unwrap_or_default(),
        pixel_position: if has_filter || given_spp.is_some_and(|n| n > 1) { None } else { hints.pixel_position },
        integrator,
        max_depth: max_depth.unwrap_or(integrator.default_max_depth()).min(Settings::MAX_DEPTH),
        shadows: keywords.one_of("shadows", None, &Shadows::ALL, Shadows::name)?.unwrap_or_default(),
        terminator: keywords.one_of("terminator", None, &Terminator::ALL, Terminator::name)?.unwrap_or_default(),
        light_strategy: keywords
            .one_of("light_samples", None, &LightStrategy::ALL, LightStrategy::name)?
            .unwrap_or_default(),
        light_sampler: keywords
            .one_of("light_sampler", None, &LightSamplerKind::ALL, LightSamplerKind::name)?
            .unwrap_or_default(),
        guiding,
        ao_distance: keywords.positive("ao_distance")?.map(|x| x as f32),
        clamp: keywords.positive("clamp")?.map(|x| x as f32),
        light_groups,
        aovs,
        color: keywords.one_of("color", None, &ColorModel::ALL, ColorModel::name)?.unwrap_or_default(),
        build: build(keywords)?,
        ..Settings::default()
    };
    Ok(Request { settings, time, is_training_timed, denoiser })
}

/// How the structures are built.
pub fn build(keywords: &Keywords<'_, '_>) -> PyResult<BuildOptions> {
    let quality = keywords.one_of("quality", None, &Quality::ALL, Quality::name)?;
    let accelerator = keywords.one_of("accelerator", None, &AcceleratorKind::ALL, AcceleratorKind::name)?;
    Ok(BuildOptions {
        quality: quality.unwrap_or(Quality::Medium),
        accelerator: accelerator.unwrap_or_default(),
        compact: keywords.get("bvh_compact", "True or False")?.unwrap_or(false),
        cache: keywords.get::<PathBuf>("bvh_cache", "a folder")?,
        ..BuildOptions::default()
    })
}

/// Guiding, and whether its training ends by the clock. `spp` is what was asked for, or else what is done.
fn guiding(
    keywords: &Keywords<'_, '_>,
    integrator: IntegratorKind,
    size: [u32; 2],
    spp: Result<u32, u32>,
    is_timed: bool,
) -> PyResult<(Option<Guiding>, bool)> {
    let Some(passes) = keywords.switch::<i64>("guiding", "a number of passes")? else { return Ok((None, false)) };
    if integrator != IntegratorKind::Path {
        let name = integrator.name();
        return Err(PyValueError::new_err(format!("guiding is for the integrator path, not for {name}")));
    }
    let by_passes = keywords.whole("guiding", 1..=Guiding::MAX_PASSES.into());
    Ok(match (passes, spp) {
        (Some(_), _) => (by_passes?.map(Guiding::with_passes), false),
        (None, Err(_)) if is_timed => (Some(Guiding::with_passes(Guiding::MAX_PASSES)), true),
        (None, Ok(spp) | Err(spp)) => (Some(Guiding::for_picture(size, spp)), is_timed),
    })
}

/// Open Image Denoise, if noise is to be removed.
fn denoiser(keywords: &Keywords<'_, '_>) -> PyResult<Option<Denoiser>> {
    let Some(path) = keywords.switch::<PathBuf>("denoise", "a path")? else { return Ok(None) };
    Denoiser::load(path.as_deref()).map(Some).map_err(denoise_error)
}

/// An error of the denoiser, whose message speaks of the command's option.
pub fn denoise_error(error: snell_oidn::DenoiseError) -> PyErr {
    PyRuntimeError::new_err(error.to_string().replace("--denoise", "denoise"))
}

/// Lights that layers show apart.
fn light_groups(keywords: &Keywords<'_, '_>, scene: &Scene) -> PyResult<Vec<LightGroup>> {
    let mut groups = Vec::new();
    let what = "a dictionary of lists of lights";
    for (name, lights) in keywords.get::<Bound<'_, PyDict>>("light_groups", what)?.into_iter().flatten() {
        let name: String = name.extract()?;
        let error = |problem: String| PyValueError::new_err(format!("light_groups[{name:?}]: {problem}"));
        let one = |light: &Bound<'_, PyAny>| Ok::<_, PyErr>(light.str()?.to_string_lossy().into_owned());
        let lights = match lights.extract::<Vec<Bound<'_, PyAny>>>() {
            Ok(lights) => lights.iter().map(one).collect::<PyResult<Vec<_>>>()?,
            Err(_) => vec![one(&lights)?],
        };
        add_light_group(&mut groups, &name, &lights, scene).map_err(error)?;
    }
    Ok(groups)
}

/// The size that is asked for.
pub fn size(keywords: &Keywords<'_, '_>) -> PyResult<Option<[u32; 2]>> {
    let Some(size) = keywords.get::<[i64; 2]>("size", "a tuple (width, height) of whole numbers")? else {
        return Ok(None);
    };
    if size.iter().all(|side| (1..=i64::from(MAX_SIDE)).contains(side)) {
        return Ok(Some(size.map(|side| side as u32)));
    }
    let [w, h] = size;
    Err(PyValueError::new_err(format!("size is ({w}, {h}), expected width and height from 1 to {MAX_SIDE}")))
}

/// The part of a picture of this size that is asked for.
pub fn crop(keywords: &Keywords<'_, '_>, size: [u32; 2]) -> PyResult<Option<Crop>> {
    let Some(crop) = keywords.get::<[i64; 4]>("crop", "a tuple (x0, y0, x1, y1) of whole numbers")? else {
        return Ok(None);
    };
    let [x0, y0, x1, y1] = crop;
    let fits = |low: i64, high: i64, side: u32| 0 <= low && low < high && high <= i64::from(side);
    if fits(x0, x1, size[0]) && fits(y0, y1, size[1]) {
        return Ok(Some(Crop { min: [x0 as u32, y0 as u32], max: [x1 as u32, y1 as u32] }));
    }
    let [w, h] = size;
    Err(PyValueError::new_err(format!(
        "crop is ({x0}, {y0}, {x1}, {y1}), expected x0 < x1 and y0 < y1 within the picture of {w} by {h} pixels"
    )))
}

fn aovs(keywords: &Keywords<'_, '_>) -> PyResult<Vec<Aov>> {
    let wanted = match keywords.get::<String>("aovs", "names") {
        Ok(Some(name)) => vec![name],
        _ => keywords.get::<Vec<String>>("aovs", "a list of names")?.unwrap_or_default(),
    };
    let mut aovs: Vec<Aov> = Vec::new();
    for name in wanted {
        if name == "all" {
            aovs.extend(Aov::ALL);
        } else {
            aovs.push(choice("aovs", &name, &Aov::ALL, Aov::name)?);
        }
    }
    Ok(aovs)
}

/// Refuses pictures of more pixels than Snell would read back.
fn check_pixels(crop: Crop) -> PyResult<()> {
    let [w, h] = crop.size();
    if u64::from(w) * u64::from(h) <= MAX_PIXELS {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "size: a picture of {w} by {h} pixels is larger than the limit of {MAX_PIXELS} pixels; render parts of it with crop"
    )))
}

/// Samples per pixel if nobody asks for a number.
fn default_spp(integrator: IntegratorKind) -> u32 {
    match integrator {
        IntegratorKind::Ao => 32,
        IntegratorKind::Flat | IntegratorKind::Raycast | IntegratorKind::Whitted | IntegratorKind::Aov => 16,
        _ => 64,
    }
}
