//! The keyword arguments of a render as wishes, from which the renderer makes its settings.

use crate::names::choice;
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use snell_intersect::AcceleratorKind;
use snell_intersect::Quality;
use snell_math::ColorModel;
use snell_oidn::Denoiser;
use snell_render::{
    Aov, Crop, Filter, Guiding, GuidingPasses, IntegratorKind, LightSamplerKind, LightStrategy,
    Request, RequestError, SamplerKind, Shadows, Terminator,
};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

/// Keyword arguments by name.
#[derive(Debug)]
pub struct Keywords<'a, 'py>(pub &'a Bound<'py, PyDict>);

impl<'py> Keywords<'_, 'py> {
    /// The value of a name, if there is one.
    pub fn any(&self, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(self.0.get_item(name)?.filter(|value| !value.is_none()))
    }

    /// The value of a name, which is `what`.
    pub fn get<T: for<'a> FromPyObject<'a, 'py>>(
        &self,
        name: &str,
        what: &str,
    ) -> PyResult<Option<T>> {
        let Some(value) = self.any(name)? else { return Ok(None) };
        let read = value.extract().map(Some);
        read.map_err(|_| {
            PyTypeError::new_err(format!("{name} is {}, expected {what}", shown(&value)))
        })
    }

    /// A whole number of a range.
    fn whole(&self, name: &str, range: RangeInclusive<u32>) -> PyResult<Option<u32>> {
        let Some(number) = self.get::<i64>(name, "a whole number")? else { return Ok(None) };
        if let Some(number) = u32::try_from(number).ok().filter(|n| range.contains(n)) {
            return Ok(Some(number));
        }
        let (low, high) = (range.start(), range.end());
        Err(PyValueError::new_err(format!(
            "{name} is {number}, expected a whole number from {low} to {high}"
        )))
    }

    /// A number.
    fn number(&self, name: &str) -> PyResult<Option<f64>> {
        self.get(name, "a number")
    }

    /// What is switched on or off, or is a value: `Some(None)` if it is just on.
    fn switch<T: for<'a> FromPyObject<'a, 'py>>(
        &self,
        name: &str,
        what: &str,
    ) -> PyResult<Option<Option<T>>> {
        match self.any(name)? {
            None => Ok(None),
            Some(value) if value.is_instance_of::<PyBool>() => {
                Ok(value.is_truthy()?.then_some(None))
            }
            Some(_) => Ok(self.get(name, &format!("True, False or {what}"))?.map(Some)),
        }
    }

    /// One of some names.
    fn one_of<T: Copy>(
        &self,
        name: &str,
        all: &[T],
        name_of: fn(T) -> &'static str,
    ) -> PyResult<Option<T>> {
        let Some(wanted) = self.get::<String>(name, "a name")? else { return Ok(None) };
        choice(name, &wanted, all, name_of).map(Some)
    }
}

/// A value in a message: not longer than a line.
pub fn shown(value: &Bound<'_, PyAny>) -> String {
    let text = value
        .repr()
        .map_or_else(|_| "something".into(), |text| text.to_string_lossy().into_owned());
    if text.chars().count() <= 60 {
        text
    } else {
        text.chars().take(57).chain("...".chars()).collect()
    }
}

/// Reads what the keyword arguments ask of the renderer.
pub fn request(keywords: &Keywords<'_, '_>) -> PyResult<Request> {
    let k = keywords;
    Ok(Request {
        size: size(k)?,
        crop: crop(k)?,
        integrator: k.one_of("integrator", &IntegratorKind::ALL, IntegratorKind::name)?,
        color: k.one_of("color", &ColorModel::ALL, ColorModel::name)?,
        spp: k.whole("spp", Request::SPP)?,
        noise: k.number("noise")?,
        time: time(k)?,
        max_depth: k.whole("max_depth", 0..=u32::MAX)?,
        seed: k.whole("seed", 0..=u32::MAX)?,
        sampler: k.one_of("sampler", &SamplerKind::ALL, SamplerKind::name)?,
        filter: k.one_of("filter", &Filter::ALL, Filter::name)?,
        shadows: k.one_of("shadows", &Shadows::ALL, Shadows::name)?,
        terminator: k.one_of("terminator", &Terminator::ALL, Terminator::name)?,
        light_samples: k.one_of("light_samples", &LightStrategy::ALL, LightStrategy::name)?,
        light_sampler: k.one_of("light_sampler", &LightSamplerKind::ALL, LightSamplerKind::name)?,
        guiding: guiding(k)?,
        ao_distance: k.number("ao_distance")?.map(|x| x as f32),
        clamp: k.number("clamp")?.map(|x| x as f32),
        light_groups: Some(light_groups(k)?),
        aovs: Some(aovs(k)?),
        denoise: Some(k.switch::<PathBuf>("denoise", "a path")?.is_some()),
        exposure: k.number("exposure")?,
        accelerator: k.one_of("accelerator", &AcceleratorKind::ALL, AcceleratorKind::name)?,
        quality: k.one_of("quality", &Quality::ALL, Quality::name)?,
        bvh_compact: k.get("bvh_compact", "True or False")?,
        bvh_cache: k.get("bvh_cache", "a folder")?,
        simd: None,
    })
}

/// A request that cannot be fulfilled, with the parameters as Python spells them.
pub fn request_error(error: RequestError) -> PyErr {
    PyValueError::new_err(match error {
        RequestError::TooManyPixels { .. } => {
            format!("size: {error}; render parts of it with crop")
        }
        _ => error.to_string(),
    })
}

fn time(keywords: &Keywords<'_, '_>) -> PyResult<Option<Duration>> {
    let Some(seconds) = keywords.number("time")? else { return Ok(None) };
    if seconds > 0.0 && seconds <= Request::MAX_SECONDS {
        return Ok(Some(Duration::from_secs_f64(seconds)));
    }
    let expected = "expected a positive number of seconds up to 1e9";
    Err(PyValueError::new_err(format!("time is {seconds}, {expected}")))
}

fn guiding(keywords: &Keywords<'_, '_>) -> PyResult<Option<GuidingPasses>> {
    Ok(match keywords.switch::<i64>("guiding", "a number of passes")? {
        None => None,
        Some(None) => Some(GuidingPasses::Auto),
        Some(Some(_)) => {
            let passes = keywords.whole("guiding", 1..=Guiding::MAX_PASSES)?;
            passes.map(GuidingPasses::Count)
        }
    })
}

/// Open Image Denoise, if noise is to be removed.
pub fn denoiser(keywords: &Keywords<'_, '_>) -> PyResult<Option<Denoiser>> {
    let Some(path) = keywords.switch::<PathBuf>("denoise", "a path")? else { return Ok(None) };
    Denoiser::load(path.as_deref()).map(Some).map_err(denoise_error)
}

/// An error of the denoiser, whose message speaks of the command's option.
pub fn denoise_error(error: snell_oidn::DenoiseError) -> PyErr {
    PyRuntimeError::new_err(error.to_string().replace("--denoise", "denoise"))
}

/// Lights that layers show apart.
fn light_groups(keywords: &Keywords<'_, '_>) -> PyResult<Vec<(String, Vec<String>)>> {
    let mut groups = Vec::new();
    let what = "a dictionary of lists of lights";
    for (name, lights) in
        keywords.get::<Bound<'_, PyDict>>("light_groups", what)?.into_iter().flatten()
    {
        let one =
            |light: &Bound<'_, PyAny>| Ok::<_, PyErr>(light.str()?.to_string_lossy().into_owned());
        let lights = match lights.extract::<Vec<Bound<'_, PyAny>>>() {
            Ok(lights) => lights.iter().map(one).collect::<PyResult<Vec<_>>>()?,
            Err(_) => vec![one(&lights)?],
        };
        groups.push((name.extract()?, lights));
    }
    Ok(groups)
}

fn size(keywords: &Keywords<'_, '_>) -> PyResult<Option<[u32; 2]>> {
    let what = "a tuple (width, height) of whole numbers";
    let Some([w, h]) = keywords.get::<[i64; 2]>("size", what)? else { return Ok(None) };
    let side = |side: i64| u32::try_from(side).ok().filter(|side| Request::SIDE.contains(side));
    if let (Some(width), Some(height)) = (side(w), side(h)) {
        return Ok(Some([width, height]));
    }
    let expected = format!("expected width and height from 1 to {}", Request::SIDE.end());
    Err(PyValueError::new_err(format!("size is ({w}, {h}), {expected}")))
}

fn crop(keywords: &Keywords<'_, '_>) -> PyResult<Option<Crop>> {
    let what = "a tuple (x0, y0, x1, y1) of whole numbers";
    let Some(given) = keywords.get::<[i64; 4]>("crop", what)? else { return Ok(None) };
    if given.iter().all(|&border| u32::try_from(border).is_ok()) {
        let [x0, y0, x1, y1] = given.map(|border| border as u32);
        return Ok(Some(Crop { min: [x0, y0], max: [x1, y1] }));
    }
    let [x0, y0, x1, y1] = given;
    let expected = "expected borders within the picture";
    Err(PyValueError::new_err(format!("crop is ({x0}, {y0}, {x1}, {y1}), {expected}")))
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
