//! The material of glTF 2.0.

use super::{ColorParam, NormalMap, OpenPbr, ScalarParam, ShadingPoint};
use crate::bsdf::{Bsdf, bounded, fresnel};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;
use snell_math::parameters::Range;

snell_math::declare! {
    /// A mixture of metal and dielectric: the metallic-roughness model of glTF 2.0 (specification,
    /// appendix B) with the extensions `KHR_materials_ior`, `KHR_materials_specular`,
    /// `KHR_materials_transmission` (thin walls) and `KHR_materials_clearcoat`. Its parameters are
    /// some of those of `open-pbr`, under the names of glTF.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct MetallicRoughness {
        /// Diffuse colour of the dielectric and reflectance of the metal at normal incidence,
        /// `[0, 1]`; multiplied by the vertex colour.
        #[range(Range::SHARE)]
        pub base_color: ColorParam,
        /// Fraction of metal: 0 is a dielectric, 1 a metal.
        #[range(Range::SHARE)]
        pub metallic: ScalarParam,
        /// Perceptual roughness, `[0, 1]`; `alpha` of the distribution is its square.
        #[range(Range::SHARE)]
        pub roughness: ScalarParam,
        /// Index of refraction of the dielectric. With 0 it reflects all light, as in
        /// `KHR_materials_ior`.
        #[range(Range::AMOUNT)]
        pub ior: f32,
        /// Strength of the dielectric's reflection, `[0, 1]`.
        #[range(Range::SHARE)]
        pub specular: ScalarParam,
        /// Colour of the dielectric's reflection at normal incidence, which may exceed 1.
        #[range(Range::AMOUNT)]
        pub specular_color: ColorParam,
        /// Fraction of the dielectric's base that transmits light straight on instead of scattering
        /// it, `[0, 1]`.
        #[range(Range::SHARE)]
        pub transmission: ScalarParam,
        /// Fraction of the surface with a clear coat (index 1.5) on top, `[0, 1]`.
        #[range(Range::SHARE)]
        pub clearcoat: ScalarParam,
        /// Perceptual roughness of the coat, `[0, 1]`.
        #[range(Range::SHARE)]
        pub clearcoat_roughness: ScalarParam,
        /// Normal map of the coat, which does not follow the material's own normal map.
        pub clearcoat_normal_map: Option<NormalMap>,
    }
}

impl Default for MetallicRoughness {
    /// A smooth white dielectric of index 1.5 (unlike glTF, where an unspecified material is a
    /// rough metal).
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
    /// A material with the three core parameters.
    pub fn new(base_color: Rgb, metallic: f32, roughness: f32) -> Self {
        Self {
            base_color: base_color.into(),
            metallic: metallic.into(),
            roughness: roughness.into(),
            ..Self::default()
        }
    }

    /// Examples for tests and galleries.
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
            Self {
                clearcoat: 1.0.into(),
                clearcoat_roughness: 0.3.into(),
                ..Self::new(orange, 0.5, 0.6)
            },
            Self { clearcoat: 0.7.into(), ..Self::new(Rgb::WHITE, 0.0, 0.5) },
            Self { clearcoat: 1.0.into(), transmission: 0.5.into(), ..Self::new(orange, 0.0, 0.0) },
        ]
    }

    /// The same surface as an [`OpenPbr`].
    pub fn open_pbr(&self) -> OpenPbr {
        let (ior, specular_color) = reflectance_at_most_white(self.ior, self.specular_color);
        OpenPbr {
            base_color: self.base_color,
            base_metalness: self.metallic,
            specular_weight: self.specular,
            specular_color,
            specular_roughness: self.roughness,
            specular_ior: ior.into(),
            transmission_weight: self.transmission,
            transmission_color: self.base_color,
            geometry_thin_walled: true,
            coat_weight: self.clearcoat,
            coat_roughness: self.clearcoat_roughness,
            coat_ior: 1.5.into(),
            coat_darkening: 0.0.into(),
            geometry_coat_normal: self.clearcoat_normal_map,
            ..OpenPbr::default()
        }
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        self.open_pbr().bsdf(point)
    }
}

/// An index of refraction and a tint of at most 1 that together have the reflectance at normal
/// incidence which glTF defines for `ior` and `color`. An index of 0 reflects all light, as in
/// `KHR_materials_ior`.
pub fn reflectance_at_most_white(ior: f32, color: ColorParam) -> (f32, ColorParam) {
    let most = color.factor.max_element();
    let ior = if ior.is_finite() { ior.max(0.0) } else { 1.5 };
    if most <= 1.0 && ior > 0.0 {
        return (ior, color);
    }
    let root = bounded(fresnel::f0_from_ior(ior) * most, 0.95).sqrt();
    let factor =
        if most > 0.0 && most.is_finite() { color.factor * (1.0 / most) } else { color.factor };
    ((1.0 + root) / (1.0 - root), ColorParam { factor, ..color })
}
