//! Which materials cast caustics: smooth and nearly smooth mirrors, metals and clear dielectrics.

use super::{CoatedConductor, ColorParam, Material, MaterialKind, OpenPbr, ScalarParam};

/// The largest roughness of a surface that casts caustics. Light that rougher ones gather is spread
/// so widely that light samples find it.
const MOST_ROUGHNESS: f32 = 0.3;

impl Material {
    /// True if the surface reflects and refracts nearly all of its light within a narrow lobe, at
    /// every point, so that light is gathered behind it: glass, water, polished metal. Matte
    /// surfaces under a coat are not among them.
    pub fn is_caster(&self) -> bool {
        let is_polished = |roughness: &ScalarParam| roughness.factor <= MOST_ROUGHNESS;
        let sheds_light = |color: &ColorParam| !color.factor.is_black();
        match &self.kind {
            MaterialKind::Mirror(mirror) => sheds_light(&mirror.reflectance),
            MaterialKind::Conductor(metal) => is_polished(&metal.roughness),
            MaterialKind::Dielectric(glass) => is_polished(&glass.roughness),
            MaterialKind::CoatedConductor(CoatedConductor { conductor, roughness, .. }) => {
                is_polished(&conductor.roughness) && is_polished(roughness)
            }
            MaterialKind::OpenPbr(surface) => surface.is_caster(),
            MaterialKind::MetallicRoughness(surface) => surface.open_pbr().is_caster(),
            _ => false,
        }
    }
}

impl OpenPbr {
    /// True if the surface is a polished metal or clear dielectric everywhere, without fuzz, and
    /// any coat is polished too.
    fn is_caster(&self) -> bool {
        let is = |share: &ScalarParam, value: f32| share.texture.is_none() && share.factor == value;
        let is_metal = is(&self.base_metalness, 1.0);
        let is_clear = is(&self.base_metalness, 0.0) && is(&self.transmission_weight, 1.0);
        let is_coat_smooth =
            self.coat_weight.factor == 0.0 || self.coat_roughness.factor <= MOST_ROUGHNESS;
        (is_metal || is_clear)
            && self.specular_roughness.factor <= MOST_ROUGHNESS
            && self.fuzz_weight.factor == 0.0
            && is_coat_smooth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Conductor, Dielectric, Diffuse, MetallicRoughness, Mirror, Plastic};
    use snell_math::Rgb;

    #[test]
    fn what_is_polished_casts_caustics() {
        let casts = |kind: MaterialKind| Material::new("", kind).is_caster();
        let clear = OpenPbr {
            transmission_weight: 1.0.into(),
            specular_roughness: 0.0.into(),
            ..OpenPbr::default()
        };
        for kind in [
            Dielectric::smooth(1.5).into(),
            Dielectric::rough(1.5, 0.2).into(),
            Conductor::gold(0.1).into(),
            Mirror::new(Rgb::splat(0.9)).into(),
            clear.clone().into(),
        ] {
            assert!(casts(kind));
        }
        for kind in [
            Dielectric::rough(1.5, 0.5).into(),
            Conductor::gold(0.6).into(),
            Diffuse::new(Rgb::WHITE).into(),
            Plastic::new(Rgb::WHITE, 0.0).into(),
            MetallicRoughness::default().into(),
            OpenPbr { transmission_weight: 0.5.into(), ..clear.clone() }.into(),
            OpenPbr { fuzz_weight: 0.5.into(), ..clear }.into(),
        ] {
            assert!(!casts(kind));
        }
    }
}
