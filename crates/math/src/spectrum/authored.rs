//! Authored colours: red, green and blue, multiplied by an optional spectrum.

use super::response::{luminance_of_light, rgb_of_light, rgb_of_reflectance, white_light};
use super::{ColorMode, Metal, Rgb, SampledSpectrum, table};
use crate::real;
use serde::{Deserialize, Serialize};
use std::ops::Mul;
use std::sync::LazyLock;

/// The second radiation constant `h c / k` (CODATA 2018) in nm K.
const SECOND_CONSTANT: f64 = 1.438_776_877e7;

/// The temperature of illuminant A in kelvin: 2848 K by the second radiation constant of 1931,
/// 1.435e7 nm K, converted to today's constant.
const KELVIN_OF_A: f64 = 2848.0 * SECOND_CONSTANT / 1.435e7;
static LUMINANCE_OF_A: LazyLock<f64> =
    LazyLock::new(|| luminance(|lambda| planck(lambda.into(), KELVIN_OF_A)));

/// An authored spectrum, of emitted light or of a factor on light.
///
/// As text it is `"blackbody:3000"`, `"illuminant:A"` or `"metal:Au"`, or a table of pairs of a
/// wavelength in nm and a value.
///
/// It is small and `Copy`, because every colour may have one. Definitions are never freed; their
/// number is bounded by what authors write.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Spectrum(&'static Definition);

#[derive(Debug, PartialEq)]
struct Definition {
    kind: Kind,
    /// The spectrum's value in RGB mode as light: the colour of that light.
    light: Rgb,
    /// The spectrum's value in RGB mode as a reflectance: the colour of a surface in white light.
    reflectance: Rgb,
}

#[derive(Debug, PartialEq)]
enum Kind {
    /// A black body of this temperature in kelvin, with luminance 1.
    Blackbody {
        kelvin: f32,
        luminance: f64,
    },
    Illuminant(Illuminant),
    /// The reflectance of a metal at normal incidence.
    Metal(Metal),
    /// Pairs of an ascending wavelength in nm and a value.
    Table(Vec<[f32; 2]>),
}

/// A standard illuminant of the CIE with luminance 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Illuminant {
    /// An incandescent lamp.
    A,
    /// Daylight: white.
    D65,
    /// Constant at all wavelengths.
    E,
}

impl Illuminant {
    const ALL: [(&str, Self); 3] = [("A", Self::A), ("D65", Self::D65), ("E", Self::E)];
}

impl Spectrum {
    /// Light of a black body of this temperature in kelvin, at least 100, with luminance 1. `None`
    /// if the temperature is invalid.
    pub fn blackbody(kelvin: f32) -> Option<Self> {
        if !(100.0..=1e9).contains(&kelvin) {
            return None;
        }
        let luminance = luminance(|lambda| planck(lambda.into(), kelvin.into()));
        Some(Self::new(Kind::Blackbody { kelvin, luminance }))
    }

    /// The reflectance of a metal at normal incidence.
    pub fn metal(metal: Metal) -> Self {
        Self::new(Kind::Metal(metal))
    }

    /// A table of wavelengths in nm and values, interpolated linearly and constant beyond the ends.
    /// As light, a table of ones has luminance 1. An invalid table gives an error.
    pub fn table(pairs: &[[f32; 2]]) -> Result<Self, String> {
        let ascends = pairs.windows(2).all(|w| w[0][0] < w[1][0]);
        let is_sound = pairs.iter().flatten().all(|x| x.is_finite() && *x >= 0.0);
        if pairs.is_empty() || !ascends || !is_sound {
            return Err(
                "a table of a spectrum needs pairs of a wavelength in nm, ascending, and a value \
                    that is not negative"
                    .into(),
            );
        }
        Ok(Self::new(Kind::Table(pairs.to_vec())))
    }

    fn new(kind: Kind) -> Self {
        let light = rgb_of_light(|lambda| kind.at(lambda));
        let reflectance = rgb_of_reflectance(|lambda| kind.at(lambda));
        Self(Box::leak(Box::new(Definition { kind, light, reflectance })))
    }

    /// The colour of this spectrum as light.
    pub fn light_rgb(&self) -> Rgb {
        self.0.light
    }

    /// The colour of a surface with this reflectance in white light.
    pub fn reflectance_rgb(&self) -> Rgb {
        self.0.reflectance
    }

    /// The value at a wavelength in nm.
    pub fn at(&self, lambda: f32) -> f32 {
        self.0.kind.at(lambda) as f32
    }
}

impl Kind {
    fn at(&self, lambda: f32) -> f64 {
        match self {
            Self::Blackbody { kelvin, luminance } => {
                planck(lambda.into(), (*kelvin).into()) / luminance
            }
            Self::Illuminant(Illuminant::A) => planck(lambda.into(), KELVIN_OF_A) / *LUMINANCE_OF_A,
            Self::Illuminant(Illuminant::D65) => white_light(lambda).into(),
            Self::Illuminant(Illuminant::E) => 1.0,
            Self::Metal(metal) => metal.reflectance(lambda).into(),
            Self::Table(rows) => {
                let [value] = table::lookup(rows, lambda);
                value.into()
            }
        }
    }
}

/// The luminance of light of this spectral radiance. A radiance of 1 at all wavelengths has
/// luminance 1.
fn luminance(radiance: impl Fn(f32) -> f64) -> f64 {
    luminance_of_light(radiance).max(f64::MIN_POSITIVE)
}

/// Planck's law up to a factor: spectral radiance at a wavelength in nm and a temperature in
/// kelvin.
pub(super) fn planck(lambda: f64, kelvin: f64) -> f64 {
    // The values are relative to 560 nm, so that neither factor overflows.
    let x = |lambda: f64| SECOND_CONSTANT / (lambda * kelvin);
    let ratio = real::powi(560.0 / lambda, 5);
    ratio * (real::exp(x(560.0) - x(lambda)) * -real::exp_m1(-x(560.0)) / -real::exp_m1(-x(lambda)))
}

/// A colour: red, green and blue, multiplied by an optional spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Color {
    /// The colour in linear Rec. 709, or the factor on the spectrum.
    pub rgb: Rgb,
    /// The spectrum that `rgb` multiplies.
    pub spectrum: Option<Spectrum>,
}

impl Color {
    /// The same spectrum with `f` applied to each component of the factor.
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self { rgb: self.rgb.map(f), ..self }
    }
}

impl From<Rgb> for Color {
    #[inline]
    fn from(rgb: Rgb) -> Self {
        Self { rgb, spectrum: None }
    }
}

impl Mul<Rgb> for Color {
    type Output = Self;
    #[inline]
    fn mul(self, factor: Rgb) -> Self {
        Self { rgb: self.rgb * factor, ..self }
    }
}

impl Mul<f32> for Color {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f32) -> Self {
        Self { rgb: self.rgb * factor, ..self }
    }
}

impl ColorMode {
    /// The lanes of a reflectance: a factor multiplied by a spectrum.
    pub(super) fn spectral_reflectance(self, rgb: Rgb, spectrum: &Spectrum) -> SampledSpectrum {
        self.reflectance(rgb) * self.lanes(spectrum.0.reflectance, |lambda| spectrum.at(lambda))
    }

    /// The lanes of emitted light: a factor multiplied by a spectrum.
    pub(super) fn spectral_illuminant(self, rgb: Rgb, spectrum: &Spectrum) -> SampledSpectrum {
        // The spectrum includes the white light already.
        self.reflectance(rgb) * self.lanes(spectrum.0.light, |lambda| spectrum.at(lambda))
    }
}

/// The serialised form of a [`Spectrum`].
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a spectrum: a text, or a table of [wavelength, value]")]
enum Written {
    Text(String),
    Table(Vec<[f32; 2]>),
}

impl From<Spectrum> for Written {
    fn from(spectrum: Spectrum) -> Self {
        match &spectrum.0.kind {
            Kind::Blackbody { kelvin, .. } => Self::Text(format!("blackbody:{kelvin}")),
            Kind::Illuminant(which) => {
                let name = Illuminant::ALL
                    .iter()
                    .find(|(_, i)| i == which)
                    .map_or("D65", |(name, _)| name);
                Self::Text(format!("illuminant:{name}"))
            }
            Kind::Metal(metal) => Self::Text(format!("metal:{}", metal.symbol())),
            Kind::Table(rows) => Self::Table(rows.to_vec()),
        }
    }
}

impl TryFrom<Written> for Spectrum {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        let text = match written {
            Written::Table(pairs) => return Self::table(&pairs),
            Written::Text(text) => text,
        };
        let known = match text.split_once(':') {
            Some(("blackbody", kelvin)) => {
                kelvin.trim().trim_end_matches('K').parse().ok().and_then(Self::blackbody)
            }
            Some(("illuminant", name)) => Illuminant::ALL
                .iter()
                .find(|(known, _)| known.eq_ignore_ascii_case(name))
                .map(|&(_, which)| Self::new(Kind::Illuminant(which))),
            Some(("metal", name)) => return Metal::try_from(name.to_string()).map(Self::metal),
            _ => None,
        };
        known.ok_or_else(|| {
            format!(
                "\"{text}\" is not a spectrum; write blackbody:KELVIN (100 or more), illuminant:A, \
                    D65 or E, metal:NAME, or a table \
                 [[nm, value], …]"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::response::RGB_FROM_XYZ;

    /// CIE 1931 chromaticity x, y of a linear colour.
    fn chromaticity(rgb: Rgb) -> [f64; 2] {
        let m = glam::DMat3::from_cols_array_2d(&RGB_FROM_XYZ).transpose();
        let [r, g, b] = rgb.to_array().map(f64::from);
        let xyz = m.inverse() * glam::DVec3::new(r, g, b);
        [xyz.x / xyz.element_sum(), xyz.y / xyz.element_sum()]
    }

    #[test]
    fn lights_have_their_published_chromaticities() {
        let read = |text: &str| Spectrum::try_from(Written::Text(text.into())).expect("a spectrum");
        // Expected values: the Planckian locus of the CIE 1931 observer (Wyszecki and Stiles, Color
        // Science, table 1(3.11)), and CIE 15.
        for (text, x, y) in [
            ("blackbody:2000", 0.5267, 0.4133),
            ("blackbody:3000", 0.4369, 0.4041),
            ("blackbody:4000", 0.3805, 0.3768),
            ("blackbody:6500", 0.3135, 0.3237),
            ("blackbody:10000", 0.2807, 0.2884),
            ("illuminant:A", 0.447_58, 0.407_45),
            ("illuminant:D65", 0.312_72, 0.329_03),
            ("illuminant:E", 0.333_33, 0.333_33),
        ] {
            let [found_x, found_y] = chromaticity(read(text).light_rgb());
            assert!(
                (found_x - x).abs() < 3e-4 && (found_y - y).abs() < 3e-4,
                "{text}: {found_x} {found_y}"
            );
            assert!((read(text).light_rgb().luminance() - 1.0).abs() < 2e-3, "{text}");
        }
    }

    #[test]
    fn extreme_temperatures_are_finite() {
        for kelvin in [100.0, 500.0, 1e5, 1e9] {
            let spectrum = Spectrum::blackbody(kelvin).expect("a temperature");
            assert!(
                spectrum.light_rgb().is_finite()
                    && spectrum.at(360.0).is_finite()
                    && spectrum.at(830.0).is_finite(),
                "{kelvin}"
            );
        }
        assert!(
            [0.0, -5.0, f32::NAN, f32::INFINITY].iter().all(|&k| Spectrum::blackbody(k).is_none())
        );
    }

    #[test]
    fn spectra_are_read_as_they_are_written() {
        for json in
            ["\"blackbody:3000\"", "\"illuminant:A\"", "\"metal:Au\"", "[[400.0,0.1],[700.0,0.9]]"]
        {
            let spectrum: Spectrum = serde_json::from_str(json).expect("reads");
            assert_eq!(serde_json::to_string(&spectrum).expect("serialises"), json);
        }
        for bad in [
            "\"blackbody:cold\"",
            "\"illuminant:X\"",
            "[]",
            "[[500,1],[400,1]]",
            "[[400,-1]]",
            "\"red\"",
        ] {
            assert!(serde_json::from_str::<Spectrum>(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_table_of_ones_changes_no_reflectance_and_daylight_is_white_light() {
        let ones = Spectrum::table(&[[300.0, 1.0], [900.0, 1.0]]).expect("a table");
        let daylight = Spectrum::new(Kind::Illuminant(Illuminant::D65));
        let spectral = super::super::ColorModel::Spectral.mode(|| 0.3);
        for mode in [ColorMode::Rgb, spectral] {
            let color = Rgb::new(0.2, 0.5, 0.7);
            let [a, b] = [mode.reflectance(color), mode.spectral_reflectance(color, &ones)];
            assert!((0..4).all(|i| (a[i] - b[i]).abs() < 1e-4), "{a:?} {b:?}");
            let [a, b] = [
                mode.illuminant(Rgb::splat(3.0)),
                mode.spectral_illuminant(Rgb::splat(3.0), &daylight),
            ];
            assert!((0..4).all(|i| (a[i] - b[i]).abs() < 1e-4), "{a:?} {b:?}");
        }
    }
}
