//! Metals by their measured index of refraction, or by their colour.

use super::{ColorParam, ScalarParam, ShadingPoint, bounded};
use crate::bsdf::{
    Bsdf, ComplexIor, ConductorBsdf, F82, FacetReflectance, LobeSpectra, MicrofacetShape, Widths,
};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use snell_math::parameters::Range;
use snell_math::spectrum::Metal;
use snell_math::{ColorMode, Rgb, SampledSpectrum, real};

snell_math::declare! {
    /// The spectrum of a metal. A named metal may also be written as text: `"metal:Au"`.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(remote = "Self")]
    pub enum ConductorSpectrum {
        /// A measured metal by chemical symbol or name. It is exact in spectral mode, and has the
        /// same colour at normal incidence in RGB mode.
        "metal" => Metal(metal: Metal),
        /// Complex index of refraction `eta + i k` relative to air.
        "measured" => Measured {
            /// Real part of the index, at least 0.
            #[range(Range::AMOUNT)]
            eta: Rgb,
            /// Imaginary part of the index (absorption), at least 0.
            #[range(Range::AMOUNT)]
            k: Rgb,
        },
        /// Colour at normal incidence, `[0, 1]`. The metal is white at grazing angles (Schlick).
        "color" => Color(#[range(Range::SHARE)] color: ColorParam),
    }
}

impl Serialize for ConductorSpectrum {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for ConductorSpectrum {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SpectrumVisitor)
    }
}

struct SpectrumVisitor;

impl<'de> Visitor<'de> for SpectrumVisitor {
    type Value = ConductorSpectrum;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(
            "metal:NAME, or one of {\"metal\": NAME}, {\"measured\": {\"eta\": [r, g, b], \
            \"k\": [r, g, b]}} and {\"color\": …}",
        )
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<ConductorSpectrum, E> {
        let name = text.strip_prefix("metal:").unwrap_or(text);
        Metal::try_from(name.to_string()).map(ConductorSpectrum::Metal).map_err(E::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ConductorSpectrum, A::Error> {
        ConductorSpectrum::deserialize(MapAccessDeserializer::new(map))
    }
}

snell_math::declare! {
    /// A metal with a microfacet distribution.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Conductor {
        /// Spectrum of the metal.
        pub spectrum: ConductorSpectrum,
        /// Roughness, `[0, 1]`; the distribution's `alpha` is its square (as in glTF). Below 0.032
        /// the metal is a mirror.
        #[range(Range::SHARE)]
        #[serde(default = "super::defaults::smooth")]
        pub roughness: ScalarParam,
        /// Shape of the microfacet distribution.
        #[serde(default)]
        pub microfacets: MicrofacetShape,
        /// Anisotropy, `[-1, 1]`. Highlights are stretched along the tangent, or along the
        /// bitangent if it is negative, as in `open-pbr`.
        #[range(Range::Within(-1.0, 1.0))]
        #[serde(default = "super::defaults::smooth")]
        pub anisotropy: ScalarParam,
        /// Factor on the reflectance, `[0, 1]`; white for a real metal.
        #[range(Range::SHARE)]
        #[serde(default = "super::defaults::white")]
        pub tint: ColorParam,
    }
}

impl Conductor {
    /// A metal with this spectrum.
    pub fn new(spectrum: ConductorSpectrum, roughness: impl Into<ScalarParam>) -> Self {
        Self {
            spectrum,
            roughness: roughness.into(),
            microfacets: MicrofacetShape::Ggx,
            anisotropy: 0.0.into(),
            tint: Rgb::WHITE.into(),
        }
    }

    /// A metal with this complex index of refraction relative to air.
    pub fn measured(eta: Rgb, k: Rgb, roughness: f32) -> Self {
        Self::new(ConductorSpectrum::Measured { eta, k }, roughness)
    }

    /// A measured metal with this roughness.
    pub fn metal(metal: Metal, roughness: f32) -> Self {
        Self::new(ConductorSpectrum::Metal(metal), roughness)
    }

    /// A metal with this colour at normal incidence.
    pub fn color(color: Rgb, roughness: f32) -> Self {
        Self::new(ConductorSpectrum::Color(color.into()), roughness)
    }

    /// Gold with this roughness.
    pub fn gold(roughness: f32) -> Self {
        Self::measured(Rgb::new(0.143, 0.375, 1.442), Rgb::new(3.983, 2.386, 1.603), roughness)
    }

    /// Copper with this roughness.
    pub fn copper(roughness: f32) -> Self {
        Self::measured(Rgb::new(0.200, 0.924, 1.102), Rgb::new(3.912, 2.452, 2.142), roughness)
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let silver = Metal::named("silver").map(|metal| Self::metal(metal, 0.2));
        let mut all = vec![
            Self::gold(0.0),
            Self::copper(0.35),
            Self::gold(1.0),
            Self::color(Rgb::WHITE, 0.0),
            Self::color(Rgb::new(0.9, 0.2, 0.1), 0.1),
            Self::color(Rgb::WHITE, 0.6),
            Self { tint: Rgb::new(0.3, 0.9, 1.0).into(), ..Self::copper(0.5) },
            Self { anisotropy: (-0.7).into(), ..Self::copper(0.6) },
            Self {
                microfacets: MicrofacetShape::Beckmann,
                anisotropy: 0.7.into(),
                ..Self::copper(0.6)
            },
            Self { microfacets: MicrofacetShape::Beckmann, ..Self::copper(0.3) },
            Self { microfacets: MicrofacetShape::Beckmann, ..Self::color(Rgb::WHITE, 1.0) },
        ];
        all.extend(silver);
        all
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        Bsdf::Conductor(self.lobe(point, 1.0))
    }

    /// The BSDF of the metal under a layer with this index of refraction.
    pub(super) fn lobe(&self, point: &ShadingPoint, outside_ior: f32) -> ConductorBsdf {
        let (roughness, anisotropy) = (self.roughness.at(point), self.anisotropy.at(point));
        let is_even = anisotropy == 0.0;
        let widths = if is_even {
            Widths::from_roughness(roughness)
        } else {
            Widths::stretched(roughness, anisotropy)
        };
        let microfacets = self.microfacets.of_widths(widths);
        ConductorBsdf::new(self.facets(point, outside_ior), self.factor(point), microfacets)
    }

    /// The spectra of [`Self::bsdf`].
    pub(super) fn spectra(&self, point: &ShadingPoint) -> LobeSpectra {
        self.facets(point, 1.0).spectra(self.factor(point))
    }

    fn facets(&self, point: &ShadingPoint, outside_ior: f32) -> FacetReflectance {
        let over = 1.0 / outside_ior;
        match self.spectrum {
            ConductorSpectrum::Metal(metal) => {
                let [eta, k] = metal.indices(point.mode);
                FacetReflectance::Complex(ComplexIor { eta: eta * over, k: k * over })
            }
            ConductorSpectrum::Measured { eta, k } => {
                let ComplexIor { eta, k } = measured_ior(eta, k, point.mode);
                FacetReflectance::Complex(ComplexIor { eta: eta * over, k: k * over })
            }
            ConductorSpectrum::Color(color) => FacetReflectance::F82(F82 {
                f0: point.reflectance(color.at(point)),
                edge: SampledSpectrum::ONE,
            }),
        }
    }

    /// The tint at a point, as a factor on the reflectance.
    fn factor(&self, point: &ShadingPoint) -> SampledSpectrum {
        let unit = point.mode.unit();
        let is_white = self.tint == Rgb::WHITE.into();
        if is_white { unit } else { unit * point.reflectance(self.tint.at(point)) }
    }
}

/// Reflectances nearer to 1 would need an infinite absorption.
const MOST_REFLECTANCE: f32 = 0.999_9;

/// The lanes of a complex index of refraction that is given as colours. As a spectrum it has the
/// colour at normal incidence that it has in RGB mode: its real part is a smooth spectrum, and its
/// imaginary part follows from a smooth spectrum of that reflectance. (The reflectance of smooth
/// spectra of both parts has another colour, since it is not linear in them.)
fn measured_ior(eta: Rgb, k: Rgb, mode: ColorMode) -> ComplexIor {
    let [eta, k] = [eta, k].map(|part| part.map(|x| bounded(x, 1e20)));
    let is_grey = |c: Rgb| c == Rgb::splat(c.r);
    let n = mode.reflectance(eta);
    if mode == ColorMode::Rgb || (is_grey(eta) && is_grey(k)) {
        return ComplexIor { eta: n, k: mode.reflectance(k) };
    }
    let of = |n: f32, k: f32| normal_reflectance(n, k).min(MOST_REFLECTANCE);
    let color = Rgb::new(of(eta.r, k.r), of(eta.g, k.g), of(eta.b, k.b));
    ComplexIor { eta: n, k: n.zip(mode.reflectance(color), absorption_for) }
}

/// The reflectance at normal incidence for the index `n + i k`.
fn normal_reflectance(n: f32, k: f32) -> f32 {
    (real::powi(n - 1.0, 2) + k * k) / (real::powi(n + 1.0, 2) + k * k)
}

/// The absorption with which an index with the real part `n` has this reflectance at normal
/// incidence; 0 if the reflectance is higher without any.
fn absorption_for(n: f32, reflectance: f32) -> f32 {
    let r = reflectance.min(MOST_REFLECTANCE);
    ((r * real::powi(n + 1.0, 2) - real::powi(n - 1.0, 2)) / (1.0 - r)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::SampledWavelengths;

    #[test]
    fn metals_by_rgb_indices_have_the_same_colour_at_normal_incidence_in_both_modes() {
        let nickel = Conductor::measured(Rgb::new(2.0, 1.8, 1.6), Rgb::new(3.8, 3.3, 2.6), 0.0);
        let glass = Conductor::measured(Rgb::new(1.4, 1.5, 1.6), Rgb::BLACK, 0.0);
        let extreme = Conductor::measured(Rgb::new(1.0, 0.5, 0.0), Rgb::new(0.0, 9.0, 1e9), 0.0);
        for metal in [Conductor::gold(0.0), Conductor::copper(0.0), nickel, glass, extreme] {
            let ConductorSpectrum::Measured { eta, k } = metal.spectrum else { unreachable!() };
            const COUNT: u16 = 256;
            let seen = |i: u16| {
                let u = (f32::from(i) + 0.5) / f32::from(COUNT) / 4.0;
                let mode = ColorMode::Spectral(SampledWavelengths::sample(u));
                let ior = measured_ior(eta, k, mode);
                let reflected = ior.eta.zip(ior.k, normal_reflectance);
                assert!(reflected.0.iter().all(|r| (0.0..=1.0).contains(r)), "{reflected:?}");
                mode.to_rgb(reflected * mode.illuminant(Rgb::WHITE))
            };
            let mean = (0..COUNT).map(seen).fold(Rgb::BLACK, |a, b| a + b * (1.0 / 256.0));
            for (found, (n, k)) in
                mean.to_array().into_iter().zip(eta.to_array().into_iter().zip(k.to_array()))
            {
                let expected = normal_reflectance(n, k);
                assert!((found - expected).abs() < 4e-3, "{n} {k}: {found}, not {expected}");
            }
        }
    }
}
