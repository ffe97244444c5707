//! Metals of formats with separate microfacet widths along tangent and bitangent.

use snell_scene::Material;
use snell_scene::bsdf::MicrofacetShape;
use snell_scene::material::{ColorParam, Conductor, ConductorSpectrum, ScalarParam};

/// The roughness of a surface; its square is the width of the microfacet distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Roughness {
    /// Isotropic: the same roughness in all directions.
    Even(ScalarParam),
    /// A surface stretched along the tangent, or along the bitangent if `anisotropy` is negative
    /// ([`Conductor::anisotropy`]).
    Stretched { roughness: ScalarParam, anisotropy: ScalarParam },
}

impl Roughness {
    /// Converts the widths of the distribution along tangent and bitangent.
    pub fn of_widths(u: f32, v: f32) -> Self {
        let (most, least) = (u.max(v).max(0.0), u.min(v).max(0.0));
        if most == least {
            return Self::Even(most.sqrt().into());
        }
        // OpenPBR: the widths are r² sqrt(2 / (1 + (1 - a)²)), and (1 - a) times that.
        let ratio = least / most;
        let roughness = (most * ((1.0 + ratio * ratio) / 2.0).sqrt()).sqrt();
        let anisotropy = if v > u { ratio - 1.0 } else { 1.0 - ratio };
        Self::Stretched { roughness: roughness.into(), anisotropy: anisotropy.into() }
    }

    /// One roughness for isotropic models, from the geometric mean of the widths where they are the
    /// same everywhere.
    pub fn mean(self) -> ScalarParam {
        match self {
            Self::Even(roughness) => roughness,
            Self::Stretched { roughness, .. } if roughness.texture.is_some() => roughness,
            Self::Stretched { roughness, anisotropy } => {
                let (roughness, ratio) = (roughness.factor, 1.0 - anisotropy.factor.abs());
                let most = roughness * roughness * (2.0 / (1.0 + ratio * ratio)).sqrt();
                (most * ratio.sqrt()).sqrt().into()
            }
        }
    }
}

/// A metal whose reflection is multiplied by a tint.
pub fn metal(
    spectrum: ConductorSpectrum,
    tint: ColorParam,
    roughness: Roughness,
    microfacets: MicrofacetShape,
) -> Material {
    let (roughness, anisotropy) = match roughness {
        Roughness::Even(roughness) => (roughness, 0.0.into()),
        Roughness::Stretched { roughness, anisotropy } => (roughness, anisotropy),
    };
    Material::new(
        "",
        Conductor { microfacets, anisotropy, tint, ..Conductor::new(spectrum, roughness) },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_by_direction_are_those_of_the_surface() {
        for (u, v) in [(0.2, 0.05), (0.05, 0.2), (0.3, 0.29)] {
            let Roughness::Stretched { roughness, anisotropy } = Roughness::of_widths(u, v) else {
                panic!("{u} and {v} differ")
            };
            let (roughness, anisotropy) = (roughness.factor, anisotropy.factor);
            let ratio = 1.0 - anisotropy.abs();
            let along = roughness * roughness * (2.0 / (1.0 + ratio * ratio)).sqrt();
            let found =
                if anisotropy > 0.0 { (along, along * ratio) } else { (along * ratio, along) };
            assert!((found.0 - u).abs() < 1e-6 && (found.1 - v).abs() < 1e-6, "{found:?}");
            assert!(
                (Roughness::of_widths(u, v).mean().factor - (u * v).sqrt().sqrt()).abs() < 1e-6
            );
        }
        assert_eq!(Roughness::of_widths(0.25, 0.25), Roughness::Even(0.5.into()));
    }
}
