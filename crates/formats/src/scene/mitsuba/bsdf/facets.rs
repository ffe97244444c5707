//! The light that Mitsuba loses between the microfacets of rough surfaces, where a facet hides
//! another: its models follow light to the first facet only.

use crate::scene::metal::Roughness;
use snell_math::{Vec2, Vec3, real};
use snell_scene::bsdf::{MicrofacetShape, Microfacets, Widths, fresnel};
use std::collections::HashMap;

/// The facets of a layer, with their widths along tangent and bitangent.
#[derive(Clone, Copy, Debug)]
pub struct Layer {
    facets: Microfacets,
    widths: [f32; 2],
}

impl Layer {
    /// The facets of this roughness; `None` if they are smooth or differ from place to place.
    pub fn new(shape: MicrofacetShape, roughness: Roughness) -> Option<Self> {
        let (roughness, anisotropy) = match roughness {
            Roughness::Even(roughness) => (roughness, 0.0.into()),
            Roughness::Stretched { roughness, anisotropy } => (roughness, anisotropy),
        };
        if roughness.texture.is_some() || anisotropy.texture.is_some() {
            return None;
        }
        let (roughness, anisotropy) = (roughness.factor.clamp(0.0, 1.0), anisotropy.factor);
        let ratio = 1.0 - anisotropy.abs().min(1.0);
        let most = roughness * roughness * (2.0 / (1.0 + ratio * ratio)).sqrt();
        let [u, v] = [most, most * ratio];
        let widths = if anisotropy < 0.0 { [v, u] } else { [u, v] };
        let facets = shape.of_widths(Widths::from_alphas(widths[0], widths[1]));
        (!facets.is_smooth()).then_some(Self { facets, widths })
    }

    /// The share of diffuse light that Mitsuba's rough metal of this reflectance reflects, over
    /// what ours does, in which light that bounces between facets is not lost.
    pub fn kept_by_metal(&self, reflectance: f32, known: &mut Means) -> f32 {
        let [kept, straight] = known.of(self, 0.0, || {
            [
                self.mean_reflected(|_, _| 1.0, |_, wi| self.masking(wi)),
                self.mean_reflected(|_, _| 1.0, |wo, wi| self.facets.shadowing(wo, wi)),
            ]
        });
        kept / (1.0 - (1.0 - straight) * (1.0 - reflectance.clamp(0.0, 1.0)))
    }

    /// The mean for diffuse light of the share that facets reflect times the share of it that is
    /// visible beyond them, which is a function of the directions of viewer and light.
    pub fn mean_reflected(
        &self,
        share: impl Fn(Vec3, Vec3) -> f32,
        visible: impl Fn(Vec3, Vec3) -> f32,
    ) -> f32 {
        self.mean(|wo, facet| {
            let wi = fresnel::reflect(wo, facet);
            if wi.z > 0.0 { share(wo, facet) * visible(wo, wi) } else { 0.0 }
        })
    }

    /// The mean of a function of a direction and a facet that is visible from it, for diffuse
    /// light.
    pub fn mean(&self, function: impl Fn(Vec3, Vec3) -> f32) -> f32 {
        const STEPS: usize = 20;
        let middles = || (0..STEPS).map(|i| (i as f32 + 0.5) / STEPS as f32);
        // A quarter of the circle, by its symmetry.
        let azimuths = if self.widths[0] == self.widths[1] { 1 } else { 4 };
        let mut sum = 0.0;
        for (cos, azimuth) in middles().flat_map(|cos| (0..azimuths).map(move |i| (cos, i))) {
            let sin = (1.0 - cos * cos).sqrt();
            let angle = std::f32::consts::FRAC_PI_2 * (azimuth as f32 + 0.5) / azimuths as f32;
            let wo = Vec3::new(sin * real::cos(angle), sin * real::sin(angle), cos);
            for (u, v) in middles().flat_map(|u| middles().map(move |v| (u, v))) {
                let facet = self.facets.sample_visible_normal(wo, Vec2::new(u, v));
                sum += 2.0 * cos * function(wo, facet);
            }
        }
        sum / (STEPS * STEPS * STEPS * azimuths) as f32
    }

    /// Smith's masking of facets seen from a direction above; that of Beckmann's distribution by
    /// the fit of Walter et al., Microfacet Models for Refraction through Rough Surfaces, 2007.
    pub fn masking(&self, w: Vec3) -> f32 {
        let slope = real::hypot(self.widths[0] * w.x, self.widths[1] * w.y) / w.z;
        match self.facets.shape() {
            MicrofacetShape::Ggx => 2.0 / (1.0 + (1.0 + slope * slope).sqrt()),
            MicrofacetShape::Beckmann if slope < 0.625 => 1.0,
            MicrofacetShape::Beckmann => {
                let a = 1.0 / slope;
                (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a)
            }
        }
    }

    /// The share of light that is not hidden on its way from a facet, if it was on the way there.
    pub fn shadowing(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.facets.shadowing(wo, wi)
    }
}

/// Means over layers that were computed, each of which takes about a millisecond: many materials
/// of a scene have the same layer.
#[derive(Debug, Default)]
pub struct Means(HashMap<(bool, [u32; 3]), [f32; 2]>);

impl Means {
    /// Two means for a layer over a body of this index of refraction; 0 for a metal.
    pub fn of(&mut self, layer: &Layer, ior: f32, compute: impl FnOnce() -> [f32; 2]) -> [f32; 2] {
        let is_ggx = layer.facets.shape() == MicrofacetShape::Ggx;
        let numbers = [layer.widths[0], layer.widths[1], ior].map(f32::to_bits);
        *self.0.entry((is_ggx, numbers)).or_insert_with(compute)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rough_metals_keep_the_light_that_mitsubas_keep() {
        let kept = |shape, u, v| {
            let layer = Layer::new(shape, Roughness::of_widths(u, v)).expect("rough");
            layer.kept_by_metal(1.0, &mut Means::default())
        };
        // Mean albedos of white metals by the formulas of roughconductor.cpp.
        for (u, v, expected) in
            [(0.1, 0.1, 0.972), (0.25, 0.25, 0.880), (0.25, 0.05, 0.930), (0.6, 0.6, 0.616)]
        {
            let found = kept(MicrofacetShape::Ggx, u, v);
            assert!((found - expected).abs() < 0.01, "{u} {v}: {found}");
        }
        assert!(Layer::new(MicrofacetShape::Ggx, Roughness::Even(0.0.into())).is_none());
    }

    #[test]
    fn means_are_known_by_distribution_widths_and_index() {
        let layer = |shape, u, v| Layer::new(shape, Roughness::of_widths(u, v)).expect("rough");
        use MicrofacetShape::{Beckmann, Ggx};
        let mut known = Means::default();
        let keys = [(Ggx, 0.2, 0.3, 0.0), (Ggx, 0.3, 0.2, 0.0), (Beckmann, 0.2, 0.3, 0.0)];
        for (i, (shape, u, v, ior)) in keys.into_iter().chain([(Ggx, 0.2, 0.3, 1.5)]).enumerate() {
            let own = [i as f32; 2];
            assert_eq!(known.of(&layer(shape, u, v), ior, || own), own);
            assert_eq!(known.of(&layer(shape, u, v), ior, || panic!("computed twice")), own);
        }
    }
}
