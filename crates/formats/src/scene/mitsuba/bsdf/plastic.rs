//! Plastics: a diffuse body under a dielectric layer.

use super::super::Builder;
use super::super::object::Object;
use super::super::texture::rgb_of;
use super::{GRAY, POLYPROPYLENE};
use crate::scene::fault::Fault;
use snell_math::{Vec2, Vec3};
use snell_scene::Material;
use snell_scene::bsdf::{MicrofacetShape, Microfacets, fresnel};
use snell_scene::material::{CoatedDiffuse, ColorParam, Plastic};

impl Builder<'_> {
    pub(super) fn plastic(&mut self, object: &Object) -> Result<Material, Fault> {
        let (roughness, microfacets) = (self.even_roughness(object)?, self.microfacets(object)?);
        let ior = self.relative_index(object, POLYPROPYLENE)?;
        let mut diffuse = self.color(object, "diffuse_reflectance", GRAY)?;
        let is_nonlinear = object.bool_or("nonlinear", false)?;
        let layer = microfacets.of_roughness(roughness.factor);
        let is_rough = !layer.is_smooth() && roughness.texture.is_none();
        if is_nonlinear && (diffuse.texture.is_some() || !is_rough) {
            self.expect_white(object, "specular_reflectance")?;
            return Ok(Material::new(
                "",
                CoatedDiffuse { reflectance: diffuse, ior, roughness, microfacets },
            ));
        }
        if is_rough {
            let Passage { scale, back } = Passage::of(layer, ior);
            if is_nonlinear {
                diffuse = rgb_of(diffuse).map(|d| d * scale / (1.0 - d * back)).into();
            } else {
                let factor = diffuse.factor * (scale / (1.0 - back));
                diffuse = ColorParam { factor, ..diffuse };
            }
        }
        let specular = self.color(object, "specular_reflectance", 1.0)?;
        Ok(Material::new("", Plastic { diffuse, specular, ior, roughness, microfacets }))
    }
}

/// What the body under a rough layer gets and gives in Mitsuba's `roughplastic`, which loses the
/// light that bounces between facets. In diffuse light, its body reflects `scale * d / (1 - d *
/// back)` times what the body of [`Plastic`] does, with `d` its reflectance, or 1 in the denominator
/// if it is linear.
struct Passage {
    scale: f32,
    /// Share of diffuse light that the inner side of the layer reflects, without bounces.
    back: f32,
}

impl Passage {
    fn of(layer: Microfacets, ior: f32) -> Self {
        let reflected = |eta: f32, visible: &dyn Fn(Vec3, Vec3) -> f32| {
            mean_over_facets(layer, |wo, facet| {
                let wi = fresnel::reflect(wo, facet);
                let share = fresnel::dielectric(wo.dot(facet), eta);
                if wi.z > 0.0 { share * visible(wo, wi) } else { 0.0 }
            })
        };
        let passed = mean_over_facets(layer, |wo, facet| {
            let share = 1.0 - fresnel::dielectric(wo.dot(facet), ior);
            let through = fresnel::refract(wo, facet, ior).filter(|through| through.z < 0.0);
            through.map_or(0.0, |through| share * masking(layer, -through))
        });
        let without_loss = 1.0 - reflected(ior, &|wo, wi| layer.shadowing(wo, wi));
        let back = reflected(1.0 / ior, &|_, wi| masking(layer, wi));
        Self { scale: passed * passed / (without_loss * ior * ior), back }
    }
}

/// The mean of a function of a direction and a facet that is visible from it, for diffuse light.
fn mean_over_facets(layer: Microfacets, function: impl Fn(Vec3, Vec3) -> f32) -> f32 {
    const STEPS: usize = 24;
    let middles = || (0..STEPS).map(|i| (i as f32 + 0.5) / STEPS as f32);
    let mut sum = 0.0;
    for cos in middles() {
        let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        for (u, v) in middles().flat_map(|u| middles().map(move |v| (u, v))) {
            sum += 2.0 * cos * function(wo, layer.sample_visible_normal(wo, Vec2::new(u, v)));
        }
    }
    sum / (STEPS * STEPS * STEPS) as f32
}

/// Smith's masking of facets seen from a direction above; that of Beckmann's distribution by the
/// fit of Walter et al., Microfacet Models for Refraction through Rough Surfaces, 2007.
fn masking(layer: Microfacets, w: Vec3) -> f32 {
    let tan = (1.0 - w.z * w.z).max(0.0).sqrt() / w.z;
    let slope = layer.widths().alpha() * tan;
    match layer.shape() {
        MicrofacetShape::Ggx => 2.0 / (1.0 + (1.0 + slope * slope).sqrt()),
        MicrofacetShape::Beckmann if slope < 0.625 => 1.0,
        MicrofacetShape::Beckmann => {
            let a = 1.0 / slope;
            (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rough_layers_reflect_as_in_mitsuba() {
        use MicrofacetShape::{Beckmann, Ggx};
        // `m_internal_reflectance` of roughplastic.cpp, by a Monte Carlo estimate of its integral.
        for (shape, alpha, back) in [
            (Ggx, 0.01, 0.598),
            (Ggx, 0.1, 0.563),
            (Ggx, 0.4, 0.355),
            (Ggx, 1.0, 0.120),
            (Beckmann, 0.1, 0.592),
            (Beckmann, 0.4, 0.498),
            (Beckmann, 1.0, 0.238),
        ] {
            let layer = shape.of_roughness(f32::sqrt(alpha));
            let found = Passage::of(layer, 1.5046 / 1.000_277);
            assert!((found.back - back).abs() < 0.004, "{shape:?} {alpha}: {}", found.back);
        }
    }
}
