//! Plastics: a diffuse body under a dielectric layer.

use super::super::Builder;
use super::super::object::Object;
use super::super::texture::rgb_of;
use super::facets::Layer;
use super::{GRAY, POLYPROPYLENE};
use crate::scene::fault::Fault;
use crate::scene::metal::Roughness;
use snell_math::Vec3;
use snell_scene::Material;
use snell_scene::bsdf::fresnel;
use snell_scene::material::{CoatedDiffuse, ColorParam, Plastic};

impl Builder<'_> {
    pub(super) fn plastic(&mut self, object: &Object) -> Result<Material, Fault> {
        let (roughness, microfacets) = (self.even_roughness(object)?, self.microfacets(object)?);
        let ior = self.relative_index(object, POLYPROPYLENE)?;
        let mut diffuse = self.color(object, "diffuse_reflectance", GRAY)?;
        let is_nonlinear = object.bool_or("nonlinear", false)?;
        let layer = Layer::new(microfacets, Roughness::Even(roughness));
        if is_nonlinear && (diffuse.texture.is_some() || layer.is_none()) {
            self.expect_white(object, "specular_reflectance")?;
            return Ok(Material::new(
                "",
                CoatedDiffuse { reflectance: diffuse, ior, roughness, microfacets },
            ));
        }
        if let Some(layer) = layer {
            let [scale, back] = self.means.of(&layer, ior, || {
                let Passage { scale, back } = Passage::of(layer, ior);
                [scale, back]
            });
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
/// light that bounces between facets. In diffuse light, its body reflects
/// `scale * d / (1 - d * back)` times what the body of [`Plastic`] does, with `d` its reflectance,
/// or 1 in the denominator if it is linear.
struct Passage {
    scale: f32,
    /// Share of diffuse light that the inner side of the layer reflects, without bounces.
    back: f32,
}

impl Passage {
    fn of(layer: Layer, ior: f32) -> Self {
        let fresnel_of =
            |eta: f32| move |wo: Vec3, facet: Vec3| fresnel::dielectric(wo.dot(facet), eta);
        let passed = layer.mean(|wo, facet| {
            let share = 1.0 - fresnel_of(ior)(wo, facet);
            let through = fresnel::refract(wo, facet, ior).filter(|through| through.z < 0.0);
            through.map_or(0.0, |through| share * layer.masking(-through))
        });
        let reflected = layer.mean_reflected(fresnel_of(ior), |wo, wi| layer.shadowing(wo, wi));
        let back = layer.mean_reflected(fresnel_of(1.0 / ior), |_, wi| layer.masking(wi));
        Self { scale: passed * passed / ((1.0 - reflected) * ior * ior), back }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_scene::bsdf::MicrofacetShape;

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
            let layer = Layer::new(shape, Roughness::of_widths(alpha, alpha)).expect("rough");
            let found = Passage::of(layer, 1.5046 / 1.000_277);
            assert!((found.back - back).abs() < 0.004, "{shape:?} {alpha}: {}", found.back);
        }
    }
}
