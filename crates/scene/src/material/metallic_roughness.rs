//! The material of glTF 2.0.

use super::{ColorParam, NormalMap, ScalarParam, ShadingPoint};
use crate::bsdf::{Bsdf, CoatedBsdf, Ggx, GlossyBsdf, bounded, fresnel};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;

/// A mix of metal and dielectric: the metallic-roughness model of glTF 2.0 (specification, appendix B) with the extensions
/// `KHR_materials_ior`, `KHR_materials_specular`, `KHR_materials_transmission` (thin walls) and `KHR_materials_clearcoat`. The diffuse base is coupled to the
/// layer so that energy is conserved, where the appendix's example weights it by `1 - F` alone and may gain some.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MetallicRoughness {
    /// Diffuse colour of the dielectric and reflectance of the metal at normal incidence, `[0, 1]`; multiplied by the vertex colour.
    pub base_color: ColorParam,
    /// 0 dielectric, 1 metal.
    pub metallic: ScalarParam,
    /// Perceptual roughness, `[0, 1]`; `alpha` of the distribution is its square.
    pub roughness: ScalarParam,
    /// Index of refraction of the dielectric. 0 (as in the extension) makes it reflect everything.
    pub ior: f32,
    /// Strength of the dielectric's reflection, `[0, 1]`.
    pub specular: ScalarParam,
    /// Colour of the dielectric's reflection at normal incidence; may exceed 1.
    pub specular_color: ColorParam,
    /// Share of the dielectric's base that lets light straight through instead of scattering it, `[0, 1]`.
    pub transmission: ScalarParam,
    /// Share of a clear coat (index 1.5) on top of all that, `[0, 1]`.
    pub clearcoat: ScalarParam,
    /// Perceptual roughness of the coat, `[0, 1]`.
    pub clearcoat_roughness: ScalarParam,
    /// Bends the normal of the coat, which does not follow the material's own normal map.
    pub clearcoat_normal_map: Option<NormalMap>,
}

impl Default for MetallicRoughness {
    /// A smooth white dielectric of index 1.5 (unlike glTF, where an unspecified material is a rough metal).
    fn default() -> Self {
        Self {
            base_color: Rgb::WHITE.into(),
            metallic: 0.0.into(),
            roughness: 0.0.into(),
            ior: 1.5,
            specular: 1.0.into(),
            specular_color: Rgb::WHITE.into(),
            transmission: 0.0.into(),
            clearcoat: 0.0.into(),
            clearcoat_roughness: 0.0.into(),
            clearcoat_normal_map: None,
        }
    }
}

impl MetallicRoughness {
    /// The three core parameters.
    pub fn new(base_color: Rgb, metallic: f32, roughness: f32) -> Self {
        Self {
            base_color: base_color.into(),
            metallic: metallic.into(),
            roughness: roughness.into(),
            ..Self::default()
        }
    }

    /// Materials for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let orange = Rgb::new(0.9, 0.4, 0.05);
        vec![
            Self::new(Rgb::WHITE, 0.0, 1.0),
            Self::new(orange, 1.0, 0.25),
            Self::new(orange, 0.5, 0.5),
            Self::new(orange, 0.0, 0.0),
            Self { transmission: 1.0.into(), ..Self::new(Rgb::WHITE, 0.0, 0.0) },
            Self { transmission: 0.7.into(), ..Self::new(orange, 0.0, 0.4) },
            Self {
                specular_color: Rgb::new(5.0, 1.0, 0.2).into(),
                specular: 0.5.into(),
                ..Self::new(orange, 0.0, 0.3)
            },
            Self { ior: 0.0, ..Self::new(orange, 0.0, 0.3) },
            Self { clearcoat: 1.0.into(), clearcoat_roughness: 0.3.into(), ..Self::new(orange, 0.5, 0.6) },
            Self { clearcoat: 0.7.into(), ..Self::new(Rgb::WHITE, 0.0, 0.5) },
            Self { clearcoat: 1.0.into(), transmission: 0.5.into(), ..Self::new(orange, 0.0, 0.0) },
        ]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        let unit_interval = |p: &ScalarParam| bounded(p.at(point), 1.0);
        let base = point.reflectance(self.base_color.at(point) * point.vertex_color());
        let (metallic, transmission) = (unit_interval(&self.metallic), unit_interval(&self.transmission));
        let specular = unit_interval(&self.specular);
        let ior = if self.ior.is_finite() { self.ior.max(0.0) } else { 1.5 };
        let f0 = point.reflectance(self.specular_color.at(point) * fresnel::f0_from_ior(ior)) * specular;
        let f90 = point.mode.unit() * specular;
        let body = base * (1.0 - metallic);
        let base = GlossyBsdf::new(
            f0.lerp(base, metallic),
            f90.lerp(point.mode.unit(), metallic),
            Ggx::from_roughness(self.roughness.at(point)),
            body * (1.0 - transmission),
            body * transmission,
        );
        let clearcoat = unit_interval(&self.clearcoat);
        if clearcoat == 0.0 {
            return Bsdf::Glossy(base);
        }
        let ggx = Ggx::from_roughness(self.clearcoat_roughness.at(point));
        Bsdf::Coated(CoatedBsdf::new(base, ggx, point.mode.unit() * clearcoat))
    }
}
