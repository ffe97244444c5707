//! Colours: RGB in several spaces, black bodies, and spectra from values, files and names.

use super::Builder;
use super::lexer::quoted;
use super::params::{Param, Type, Values};
use crate::input::CONFINED;
use crate::scene::fault::{Fault, Spot};
use snell_math::Rgb;
use snell_math::real;
use snell_math::spectrum::cie::{LAMBDA_MIN, OBSERVER_1931};

/// The colour space of RGB values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorSpace {
    Srgb,
    Rec2020,
    DciP3,
    /// ACES 2065-1 (AP0).
    Aces,
}

impl ColorSpace {
    /// The space of this name.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "srgb" => Self::Srgb,
            "rec2020" => Self::Rec2020,
            "dci-p3" => Self::DciP3,
            "aces2065-1" => Self::Aces,
            _ => return None,
        })
    }

    /// Chromaticities of red, green, blue and white.
    fn primaries(self) -> [[f64; 2]; 4] {
        const D65: [f64; 2] = [0.3127, 0.3290];
        match self {
            Self::Srgb => [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65],
            Self::Rec2020 => [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65],
            Self::DciP3 => [[0.68, 0.32], [0.265, 0.690], [0.15, 0.06], D65],
            Self::Aces => [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], [0.32168, 0.33767]],
        }
    }

    /// Converts a colour of this space to linear Rec. 709. Out-of-gamut components are clipped at
    /// 0.
    pub fn to_rgb(self, [r, g, b]: [f64; 3]) -> Rgb {
        if self == Self::Srgb {
            return Rgb::new(r as f32, g as f32, b as f32);
        }
        let Some(m) = crate::image::rec709_from(self.primaries()) else { return Rgb::BLACK };
        let [r, g, b] = m.map(|row| {
            (f64::from(row[0]) * r + f64::from(row[1]) * g + f64::from(row[2]) * b) as f32
        });
        Rgb::new(r.max(0.0), g.max(0.0), b.max(0.0))
    }
}

/// The use of a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A reflectance, or any other factor.
    Factor,
    /// Light: a spectrum other than RGB is scaled to luminance 1, as in pbrt.
    Light,
}

impl Builder<'_> {
    /// The colour of a parameter, in linear Rec. 709.
    pub(super) fn color(&mut self, param: &Param, role: Role) -> Result<Rgb, Fault> {
        match (param.kind, &param.values) {
            (Type::Rgb, Values::Numbers(n)) if n.len() == 3 => {
                Ok(self.state.color_space.to_rgb([n[0], n[1], n[2]]))
            }
            (Type::Float, Values::Numbers(n)) if n.len() == 1 => Ok(Rgb::splat(n[0] as f32)),
            (Type::Xyz, Values::Numbers(n)) if n.len() == 3 => Ok(rgb_of_xyz([n[0], n[1], n[2]])),
            // pbrt-v3 wrote a scale after the temperature.
            (Type::Blackbody, Values::Numbers(n)) if !n.is_empty() && n.len() <= 2 => {
                Ok(blackbody(param, n[0])? * n.get(1).map_or(1.0, |s| *s as f32))
            }
            (Type::Spectrum, Values::Numbers(n)) => {
                let samples = pairs(n).ok_or_else(|| {
                    let problem =
                        "the values are not pairs of wavelength (nm) and value, ascending";
                    param.fault(problem, "correct the list")
                })?;
                Ok(average(&samples, role))
            }
            (Type::Spectrum, Values::Strings(names)) if names.len() == 1 => {
                self.named_spectrum(&names[0], param.at, role)
            }
            _ => {
                Err(param
                    .fault("this is not one colour", "give one rgb colour, blackbody or spectrum"))
            }
        }
    }

    /// A spectrum by name, or by the name of a file of wavelengths and values.
    fn named_spectrum(&mut self, name: &str, at: Spot, role: Role) -> Result<Rgb, Fault> {
        if let Some(color) = named(name) {
            return Ok(color);
        }
        if let Some(part) = name.strip_prefix("metal-CuZn-") {
            self.note("brass", at, || {
                format!("the table {} of brass: gold was used instead", quoted(name.as_bytes()))
            });
            return named(&format!("metal-Au-{part}")).ok_or_else(|| {
                Fault::new(at, "this is not a table of brass", "use metal-CuZn-eta or metal-CuZn-k")
            });
        }
        if name.starts_with("stdillum-") || name.starts_with("illum-") {
            let name = quoted(name.as_bytes());
            self.note(format!("illuminant {name}"), at, || {
                format!("the illuminant {name} became white")
            });
            return Ok(Rgb::WHITE);
        }
        let input = self.open(name, at).map_err(|fault| match fault {
            Fault::Here { at, problem, remedy } => {
                let problem = format!(
                    "{} is not the name of a spectrum, and as a file: {problem}",
                    quoted(name.as_bytes())
                );
                let other = "use a name such as metal-Cu-eta, or a file of wavelengths and values";
                Fault::new(at, problem, if remedy == CONFINED { CONFINED } else { other })
            }
            other => other,
        })?;
        let text = String::from_utf8_lossy(&input.bytes);
        let lines = text.lines().map(|l| l.split('#').next().unwrap_or_default());
        let numbers: Result<Vec<f64>, _> =
            lines.flat_map(str::split_ascii_whitespace).map(str::parse).collect();
        let samples = numbers.ok().and_then(|n| pairs(&n)).ok_or_else(|| {
            let problem =
                format!("{} is not a list of wavelengths (nm) and values, ascending", input.name);
            Fault::new(at, problem, "write one wavelength and value on each line")
        })?;
        Ok(average(&samples, role))
    }
}

/// Wavelengths and values, ascending; at least one.
fn pairs(numbers: &[f64]) -> Option<Vec<(f64, f64)>> {
    if numbers.is_empty()
        || !numbers.len().is_multiple_of(2)
        || numbers.iter().any(|n| !n.is_finite())
    {
        return None;
    }
    let samples: Vec<_> = numbers.chunks_exact(2).map(|p| (p[0], p[1])).collect();
    samples.windows(2).all(|w| w[0].0 < w[1].0).then_some(samples)
}

/// The value of a sampled spectrum at a wavelength: linear between the samples, 0 outside.
fn at_wavelength(samples: &[(f64, f64)], lambda: f64) -> f64 {
    let next = samples.partition_point(|(l, _)| *l <= lambda);
    match (next.checked_sub(1).map(|i| samples[i]), samples.get(next)) {
        (Some((l0, v0)), Some(&(l1, v1))) => v0 + (v1 - v0) * (lambda - l0) / (l1 - l0),
        (Some((l, v)), None) if l == lambda => v,
        _ => 0.0,
    }
}

/// The colour of a spectrum. A factor is relative to an equal-energy spectrum, so that the constant
/// 1 is white.
fn average(samples: &[(f64, f64)], role: Role) -> Rgb {
    let (mut xyz, mut white) = ([0.0; 3], [0.0; 3]);
    for (i, cie) in OBSERVER_1931.iter().enumerate() {
        let value = at_wavelength(samples, f64::from(LAMBDA_MIN) + i as f64);
        for c in 0..3 {
            xyz[c] += cie[c] * value;
            white[c] += cie[c];
        }
    }
    match role {
        // Each channel is divided by that of the constant spectrum.
        Role::Factor => {
            let (color, white) = (unclamped_rgb(xyz), unclamped_rgb(white));
            let [r, g, b] = [0, 1, 2].map(|c| (color[c] / white[c]).max(0.0) as f32);
            Rgb::new(r, g, b)
        }
        Role::Light if xyz[1] > 0.0 => rgb_of_xyz(xyz.map(|v| v / xyz[1])),
        Role::Light => Rgb::BLACK,
    }
}

/// The colour of a black body (Planck's law), with luminance 1.
fn blackbody(param: &Param, kelvin: f64) -> Result<Rgb, Fault> {
    if !(100.0..=1e6).contains(&kelvin) {
        return Err(param.fault(
            format!("a black body of {kelvin} K"),
            "give a temperature from 100 to 1000000 K",
        ));
    }
    let samples: Vec<_> = (360..=830)
        .map(|l| {
            let lambda = f64::from(l);
            // hc / k in nm K; the constants in front cancel.
            (
                lambda,
                real::powi(lambda / 560.0, -5) / real::exp_m1(1.438_776_877e7 / (lambda * kelvin)),
            )
        })
        .collect();
    Ok(average(&samples, Role::Light))
}

fn rgb_of_xyz(xyz: [f64; 3]) -> Rgb {
    let [r, g, b] = unclamped_rgb(xyz).map(|v| v.max(0.0) as f32);
    Rgb::new(r, g, b)
}

/// Converts CIE XYZ to linear Rec. 709 (IEC 61966-2-1).
fn unclamped_rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266_0 * x + 1.876_010_8 * y + 0.041_556_0 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    ]
}

/// A spectrum that pbrt knows by name: the index of refraction of a glass or a metal.
fn named(name: &str) -> Option<Rgb> {
    let glass = [
        ("glass-BK7", 1.5168),
        ("glass-BAF10", 1.6700),
        ("glass-FK51A", 1.4866),
        ("glass-LASF9", 1.8503),
        ("glass-F5", 1.6034),
        ("glass-F10", 1.6228),
        ("glass-F11", 1.6206),
        ("glass-SF5", 1.6727),
        ("glass-SF10", 1.7283),
        ("glass-SF11", 1.7847),
    ];
    if let Some((_, eta)) = glass.into_iter().find(|(n, _)| *n == name) {
        return Some(Rgb::splat(eta));
    }
    let (metal, part) = name.strip_prefix("metal-")?.rsplit_once('-')?;
    let (eta, k) = metal_index(metal)?;
    match part {
        "eta" => Some(eta),
        "k" => Some(k),
        _ => None,
    }
}

/// Real and imaginary part of the index of refraction of copper: pbrt's default conductor.
pub const COPPER: [Rgb; 2] = [Rgb::new(0.2332, 1.0410, 1.2976), Rgb::new(3.2553, 2.5941, 2.3530)];

/// Real and imaginary part of the index of refraction of metals in the three channels, weighted as
/// in `average`. From refractiveindex.info (CC0): Johnson and Christy, 1972 (Ag, Au, Cu); Rakic,
/// 1995 (Al). The oxides are clear: they have their typical index.
fn metal_index(name: &str) -> Option<(Rgb, Rgb)> {
    let (eta, k) = match name {
        "Ag" => ([0.0553, 0.0547, 0.0427], [4.3023, 3.5365, 2.5348]),
        "Al" => ([1.4480, 0.9840, 0.5857], [7.5690, 6.5581, 5.3065]),
        "Au" => ([0.1048, 0.4915, 1.4773], [3.5190, 2.3297, 1.8102]),
        "Cu" => (COPPER[0].to_array(), COPPER[1].to_array()),
        "MgO" => ([1.737; 3], [0.0; 3]),
        "TiO2" => ([2.65; 3], [0.0; 3]),
        _ => return None,
    };
    Some((Rgb::from(eta), Rgb::from(k)))
}
