//! Metals of formats that have more to say than [`Conductor`]: tints, and roughness that differs by direction.

use snell_math::Rgb;
use snell_math::spectrum::Spectrum;
use snell_scene::Material;
use snell_scene::bsdf::MicrofacetShape;
use snell_scene::material::{ColorParam, Conductor, ConductorSpectrum, OpenPbr, ScalarParam, TangentMap};

/// The roughness of a surface, whose square is the width of the distribution of microfacets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Roughness {
    /// In all directions alike.
    Even(ScalarParam),
    /// By the parameters of OpenPBR: roughness, anisotropy, and radians from the tangent.
    Stretched { roughness: f32, anisotropy: f32, rotation: f32 },
}

impl Roughness {
    /// Of the widths of the distribution along tangent and bitangent.
    pub fn of_widths(u: f32, v: f32) -> Self {
        let (most, least) = (u.max(v).max(0.0), u.min(v).max(0.0));
        if most == least {
            return Self::Even(most.sqrt().into());
        }
        // OpenPBR: the widths are r² sqrt(2 / (1 + (1 - a)²)), and (1 - a) times that.
        let ratio = least / most;
        let roughness = (most * ((1.0 + ratio * ratio) / 2.0).sqrt()).sqrt();
        let rotation = if v > u { std::f32::consts::FRAC_PI_2 } else { 0.0 };
        Self::Stretched { roughness, anisotropy: 1.0 - ratio, rotation }
    }

    /// One number for what cannot be stretched: that of the geometric mean of the widths.
    pub fn mean(self) -> ScalarParam {
        match self {
            Self::Even(roughness) => roughness,
            Self::Stretched { roughness, anisotropy, .. } => {
                let ratio = 1.0 - anisotropy;
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
    let is_even = matches!(roughness, Roughness::Even(_));
    if (is_even && tint == Rgb::WHITE.into()) || microfacets != MicrofacetShape::Ggx {
        let (roughness, anisotropy) = match roughness {
            Roughness::Even(roughness) => (roughness, 0.0),
            Roughness::Stretched { roughness, anisotropy, rotation: 0.0 } => (roughness.into(), anisotropy),
            // (Only quarters of a turn there are.)
            Roughness::Stretched { roughness, anisotropy, .. } => (roughness.into(), -anisotropy),
        };
        let anisotropy = anisotropy.into();
        return Material::new("", Conductor { microfacets, anisotropy, tint, ..Conductor::new(spectrum, roughness) });
    }
    let (base_color, strength) = tinted(normal_color(spectrum), tint);
    let mut kind = OpenPbr {
        base_color,
        base_metalness: 1.0.into(),
        specular_weight: strength.into(),
        specular_roughness: roughness.mean(),
        ..OpenPbr::default()
    };
    if let Roughness::Stretched { roughness, anisotropy, rotation } = roughness {
        kind.specular_roughness = roughness.into();
        kind.specular_roughness_anisotropy = anisotropy.into();
        kind.geometry_tangent = (rotation != 0.0).then_some(TangentMap { rotation, texture: None });
    }
    Material::new("", kind)
}

/// The base colour and the specular weight of OpenPBR's metal, by the colour at normal incidence and a factor on all it reflects.
pub fn tinted(color: ColorParam, tint: ColorParam) -> (ColorParam, f32) {
    let (strength, tint) = match tint.texture {
        Some(_) => (1.0, tint),
        None => {
            let most = tint.factor.max_element().max(1e-6);
            (most.min(1.0), ColorParam { factor: tint.factor * (1.0 / most), ..tint })
        }
    };
    let base_color = ColorParam {
        factor: color.factor * tint.factor,
        texture: color.texture.or(tint.texture),
        spectrum: color.spectrum.or(tint.spectrum),
    };
    (base_color, strength)
}

/// What a metal reflects at normal incidence.
fn normal_color(spectrum: ConductorSpectrum) -> ColorParam {
    match spectrum {
        ConductorSpectrum::Color(color) => color,
        ConductorSpectrum::Metal(metal) => ColorParam { spectrum: Some(Spectrum::metal(metal)), ..Rgb::WHITE.into() },
        ConductorSpectrum::Measured { eta, k } => normal_reflectance(eta, k).into(),
    }
}

/// What a metal reflects at normal incidence (Fresnel).
pub fn normal_reflectance(eta: Rgb, k: Rgb) -> Rgb {
    let channel = |n: f32, k: f32| ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k);
    Rgb::new(channel(eta.r, k.r), channel(eta.g, k.g), channel(eta.b, k.b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_by_direction_are_those_of_the_surface() {
        for (u, v) in [(0.2, 0.05), (0.05, 0.2), (0.3, 0.29)] {
            let Roughness::Stretched { roughness, anisotropy, rotation } = Roughness::of_widths(u, v) else {
                panic!("{u} and {v} differ")
            };
            let ratio = 1.0 - anisotropy;
            let along = roughness * roughness * (2.0 / (1.0 + ratio * ratio)).sqrt();
            let found = if rotation == 0.0 { (along, along * ratio) } else { (along * ratio, along) };
            assert!((found.0 - u).abs() < 1e-6 && (found.1 - v).abs() < 1e-6, "{found:?}");
            assert!((Roughness::of_widths(u, v).mean().factor - (u * v).sqrt().sqrt()).abs() < 1e-6);
        }
        assert_eq!(Roughness::of_widths(0.25, 0.25), Roughness::Even(0.5.into()));
    }
}
