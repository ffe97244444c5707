//! Spectra: from a number, table, file or plugin.

use super::super::color::blackbody_luminance;
use super::super::value::{self, Hue, shortened};
use super::{File, Loader};
use crate::scene::fault::Fault;
use roxmltree::Node;
use snell_math::Rgb;
use snell_math::spectrum::Spectrum;

impl Loader<'_> {
    pub(super) fn spectrum(&mut self, file: &File, node: &Node) -> Result<Hue, Fault> {
        let at = file.at(node);
        let fault =
            |problem: String| Fault::new(at, format!("<spectrum>: {problem}"), "correct the value");
        let kind = self.attribute(file, node, "type")?.unwrap_or_default();
        if kind == "blackbody" || node.tag_name().name() == "blackbody" {
            return self.blackbody(file, node);
        }
        if kind == "d65" {
            let scale = self.inner_number(file, node, "scale")?.unwrap_or(1.0);
            return Ok(Hue::Rgb(Rgb::splat(scale as f32)));
        }
        if !kind.is_empty() {
            return self.listed_spectrum(file, node, &kind);
        }
        if let Some(name) = self.attribute(file, node, "filename")? {
            let input = self.open_file(file, &name, at)?;
            let text = String::from_utf8_lossy(&input.bytes);
            let lines = text
                .lines()
                .map(|l| l.split('#').next().unwrap_or_default())
                .collect::<Vec<_>>()
                .join("\n");
            let numbers =
                value::numbers(&lines).map_err(|p| fault(format!("{}: {p}", input.name)))?;
            let pairs = numbers
                .chunks(2)
                .map(|p| [p[0] as f32, p.get(1).copied().unwrap_or(f64::NAN) as f32]);
            return value::table(pairs.collect())
                .map_err(|p| fault(format!("{}: {p}", input.name)));
        }
        let text = self.required(file, node, "value")?;
        if text.contains(':') {
            return value::samples(&text).and_then(value::table).map_err(fault);
        }
        match *value::numbers(&text).map_err(fault)? {
            [x] => Ok(Hue::Uniform(x)),
            [r, g, b] => Ok(Hue::Rgb(Rgb::new(r as f32, g as f32, b as f32))),
            ref found => Err(fault(format!("{} numbers without wavelengths", found.len()))),
        }
    }

    /// Reads a spectrum that is a plugin: `uniform`, `srgb`, `regular` or `irregular`.
    fn listed_spectrum(&mut self, file: &File, node: &Node, kind: &str) -> Result<Hue, Fault> {
        let at = file.at(node);
        let fault =
            |problem: String| Fault::new(at, format!("<spectrum>: {problem}"), "correct the value");
        match kind {
            "uniform" => Ok(Hue::Uniform(self.inner_number(file, node, "value")?.unwrap_or(1.0))),
            "srgb" => {
                let text = self.inner(file, node, "color")?.unwrap_or_else(|| "1".into());
                let color = value::triple(&text).map_err(fault)?.as_vec3();
                Ok(Hue::Rgb(Rgb::new(color.x, color.y, color.z)))
            }
            "regular" | "irregular" => {
                let text = self.inner(file, node, "values")?.unwrap_or_default();
                let values = value::numbers(&text).map_err(fault)?;
                let lambdas = match self.inner(file, node, "wavelengths")? {
                    Some(text) => value::numbers(&text).map_err(fault)?,
                    None => {
                        let least =
                            self.inner_number(file, node, "wavelength_min")?.unwrap_or(360.0);
                        let most =
                            self.inner_number(file, node, "wavelength_max")?.unwrap_or(830.0);
                        let step = (most - least) / (values.len().max(2) - 1) as f64;
                        (0..values.len()).map(|i| least + step * i as f64).collect()
                    }
                };
                if lambdas.len() != values.len() {
                    return Err(fault(format!(
                        "{} wavelengths for {} values",
                        lambdas.len(),
                        values.len()
                    )));
                }
                let pairs = lambdas.iter().zip(&values).map(|(l, v)| [*l as f32, *v as f32]);
                value::table(pairs.collect()).map_err(fault)
            }
            other => {
                self.note(format!("spectrum {other}"), at, || {
                    format!(
                        "spectrum \"{}\" is not supported; a uniform 1 was used instead",
                        shortened(other)
                    )
                });
                Ok(Hue::Uniform(1.0))
            }
        }
    }

    /// The value of a nested property.
    fn inner(&mut self, file: &File, node: &Node, name: &str) -> Result<Option<String>, Fault> {
        let is = |child: &Node| {
            child.is_element()
                && child.attribute("name").is_some_and(|n| value::snake_case(n) == name)
        };
        match node.children().find(is) {
            Some(child) => Ok(Some(self.required(file, &child, "value")?)),
            None => Ok(None),
        }
    }

    fn inner_number(&mut self, file: &File, node: &Node, name: &str) -> Result<Option<f64>, Fault> {
        let Some(text) = self.inner(file, node, name)? else { return Ok(None) };
        let fault = |problem: String| {
            Fault::new(file.at(node), format!("\"{name}\": {problem}"), "give a number")
        };
        value::number(&text).map(Some).map_err(fault)
    }

    fn blackbody(&mut self, file: &File, node: &Node) -> Result<Hue, Fault> {
        let at = file.at(node);
        let fault =
            |problem: String| Fault::new(at, problem, "give a temperature from 100 to 1000000 K");
        let kelvin = match self.attribute(file, node, "temperature")? {
            Some(text) => value::number(text.trim().trim_end_matches(['K', 'k'])).map_err(fault)?,
            None => self.inner_number(file, node, "temperature")?.unwrap_or(5000.0),
        };
        let scale = match self.attribute(file, node, "scale")? {
            Some(text) => value::number(&text).map_err(fault)?,
            None => self.inner_number(file, node, "scale")?.unwrap_or(1.0),
        };
        let spectrum = (100.0..=1e6).contains(&kelvin).then(|| Spectrum::blackbody(kelvin as f32));
        let Some(spectrum) = spectrum.flatten() else {
            return Err(fault(format!("a black body of {kelvin} K")));
        };
        Ok(Hue::Spectrum(spectrum, scale * blackbody_luminance(kelvin)))
    }
}
