//! Glass, water and other clear media.

use super::{ColorParam, ScalarParam, ShadingPoint, positive_ior, relative_ior};
use crate::bsdf::{Bsdf, DielectricBsdf, Interface, MicrofacetShape, bounded};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::spectrum::{Glass, LINE_D, RefractiveIndex};
use snell_math::{ColorMode, Rgb, SampledSpectrum, real};

snell_math::declare! {
    /// The interface between air (outer side) and a clear medium, which reflects and refracts by
    /// Fresnel's and Snell's laws. It is meant for closed surfaces; a single sheet refracts light
    /// once.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Dielectric {
        /// Index of refraction inside divided by that outside: 1.33 for water, 1.5 for glass, or a
        /// glass by name. Positive, otherwise 1. If it depends on the wavelength, only the hero
        /// wavelength continues behind the interface (and in the mirror direction); in RGB mode all
        /// colours have the index at the d line.
        #[range(Range::Positive)]
        #[usual(Range::Within(0.2, 6.0))]
        pub ior: RefractiveIndex,
        /// Roughness, `[0, 1]`; the distribution's `alpha` is its square. Below 0.032 the interface
        /// is perfectly smooth.
        #[range(Range::SHARE)]
        #[serde(default = "super::defaults::smooth")]
        pub roughness: ScalarParam,
        /// Shape of the microfacet distribution.
        #[serde(default)]
        pub microfacets: MicrofacetShape,
        /// Factor on light at each crossing, `[0, 1]`.
        #[range(Range::SHARE)]
        #[serde(default = "super::defaults::white")]
        pub tint: ColorParam,
        /// Absorption coefficient of the medium (Beer and Lambert): after a distance `d` the
        /// fraction `exp(-absorption d)` of the light is left. It applies to paths that hit the
        /// surface from inside; shadow rays to objects inside the medium ignore it.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        #[serde(default)]
        pub absorption: Rgb,
    }
}

impl Dielectric {
    /// A smooth interface that absorbs nothing.
    pub fn smooth(ior: impl Into<RefractiveIndex>) -> Self {
        Self {
            ior: ior.into(),
            roughness: 0.0.into(),
            microfacets: MicrofacetShape::Ggx,
            tint: Rgb::WHITE.into(),
            absorption: Rgb::BLACK,
        }
    }

    /// A rough interface that absorbs nothing, such as frosted glass.
    pub fn rough(ior: impl Into<RefractiveIndex>, roughness: f32) -> Self {
        Self { roughness: roughness.into(), ..Self::smooth(ior) }
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![
            Self::smooth(1.5),
            Self { tint: Rgb::new(0.2, 0.9, 0.4).into(), ..Self::smooth(1.33) },
            Self::smooth(1.0),
            Self::rough(1.5, 0.2),
            Self::rough(1.5, 0.7),
            Self { tint: Rgb::new(1.0, 0.5, 0.0).into(), ..Self::rough(2.4, 0.4) },
            Self::rough(0.75, 0.5),
            Self::smooth(Glass::SF11),
            Self::rough(RefractiveIndex::from_abbe(1.6, 20.0), 0.4),
            Self { microfacets: MicrofacetShape::Beckmann, ..Self::rough(1.5, 0.5) },
            Self { microfacets: MicrofacetShape::Beckmann, ..Self::rough(0.6, 0.9) },
        ]
    }

    /// Transmittance of the medium over a distance in scene units.
    pub(super) fn transmittance(&self, distance: f32, mode: ColorMode) -> SampledSpectrum {
        if self.absorption.is_black() {
            return SampledSpectrum::ONE;
        }
        mode.reflectance(
            self.absorption
                .map(|sigma| bounded(real::exp(-bounded(sigma, f32::MAX) * distance), 1.0)),
        )
    }

    /// Factor on light that crosses the interface at a point.
    pub(super) fn tint_at(&self, point: &ShadingPoint) -> SampledSpectrum {
        point.reflectance(self.tint.at(point))
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        self.bsdf_like(None, point)
    }

    /// The BSDF at a point. It reuses the tables of `other`, the BSDF of another point, if both
    /// have the same parameters.
    pub(super) fn bsdf_like(&self, other: Option<&DielectricBsdf>, point: &ShadingPoint) -> Bsdf {
        let mode = point.mode;
        let ior = relative_ior(positive_ior(self.ior.at(mode.hero(LINE_D))), point.outside_ior);
        let microfacets = self.microfacets.of_roughness(self.roughness.at(point));
        // With dispersion, the hero wavelength represents all of them.
        let unit = if self.ior.is_dispersive() { mode.hero_factor() } else { mode.unit() };
        let interface = Interface {
            ior,
            tint: self.tint_at(point) * unit,
            reflection_tint: SampledSpectrum::ONE,
            unit,
            film: None,
            microfacets,
            arriving: self.transmittance(point.surface.t, mode),
        };
        Bsdf::Dielectric(DielectricBsdf::like(other, interface))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::Lobes;
    use crate::material::MaterialKind;
    use crate::texture::TextureSet;
    use snell_intersect::SurfaceInteraction;
    use snell_math::{Vec2, Vec3};

    #[test]
    fn only_rays_from_within_are_absorbed_by_their_length() {
        let surface = SurfaceInteraction { t: 2.0, ..crate::material::tests::surface() };
        let textures = TextureSet::default();
        let point = ShadingPoint {
            surface: &surface,
            footprint: 0.0,
            textures: &textures,
            mode: ColorMode::Rgb,
            outside_ior: 1.0,
        };
        let absorption = Rgb::new(0.5f32.ln().abs(), 0.0, 0.0);
        for clear in [Dielectric::smooth(1.5), Dielectric::rough(1.5, 0.5)] {
            let dark = MaterialKind::from(Dielectric { absorption, ..clear.clone() }).bsdf(&point);
            let clear = MaterialKind::from(clear).bsdf(&point);
            for (wo, red) in [(Vec3::new(0.3, 0.0, 0.9), 1.0), (Vec3::new(0.3, 0.0, -0.9), 0.25)] {
                let wo = wo.normalize();
                for u_lobe in [0.0, 0.999] {
                    let [a, b] = [&clear, &dark]
                        .map(|b| b.sample(wo, u_lobe, Vec2::splat(0.3)).expect("a direction"));
                    assert!(
                        (b.weight[0] / a.weight[0] - red).abs() < 1e-5
                            && b.weight[1] == a.weight[1],
                        "{wo}"
                    );
                    let [a, b] = [&clear, &dark].map(|bsdf| bsdf.eval(wo, a.wi)[0]);
                    assert!((b - a * red).abs() <= 1e-5 * a, "{wo}: {a} {b}");
                }
            }
        }
    }
}
