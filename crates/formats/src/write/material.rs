//! The nearest OpenPBR surface for any material: the starting point for formats with a single
//! model.

use super::Output;
use snell_math::Rgb;
use snell_math::real;
use snell_math::spectrum::Spectrum;
use snell_scene::Material;
use snell_scene::bsdf::MicrofacetShape;
use snell_scene::material::{
    AlphaMode, ColorParam, ConductorSpectrum, MaterialKind, MetallicRoughness, OpenPbr,
    ScalarParam, TangentMap,
};
use std::f32::consts::FRAC_PI_2;

/// The name of a material in messages.
pub fn shown_name(index: usize, material: &Material) -> String {
    if material.name.is_empty() {
        format!("material {index}")
    } else {
        format!("material \"{}\"", material.name)
    }
}

/// The colour of a metal at normal incidence.
pub fn metal_color(spectrum: &ConductorSpectrum) -> ColorParam {
    match spectrum {
        ConductorSpectrum::Color(color) => *color,
        ConductorSpectrum::Metal(metal) => Spectrum::metal(*metal).reflectance_rgb().into(),
        ConductorSpectrum::Measured { eta, k } => {
            let channel =
                |n: f32, k: f32| ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k);
            Rgb::new(channel(eta.r, k.r), channel(eta.g, k.g), channel(eta.b, k.b)).into()
        }
    }
}

/// The base colour and the specular weight of OpenPBR's metal, from the colour at normal incidence
/// and a factor on all reflection.
fn tinted(color: ColorParam, tint: ColorParam) -> (ColorParam, f32) {
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

/// A colour whose spectrum, if it has one, is converted to RGB and multiplied into the factor.
pub fn without_spectrum(color: ColorParam, is_light: bool) -> ColorParam {
    let Some(spectrum) = color.spectrum else { return color };
    let tint = if is_light { spectrum.light_rgb() } else { spectrum.reflectance_rgb() };
    ColorParam { factor: color.factor * tint, spectrum: None, ..color }
}

/// The GGX roughness whose highlight is about as wide as that of a Phong exponent.
pub fn roughness_of_shininess(shininess: f32) -> f32 {
    (2.0 / (shininess.max(0.0) + 2.0)).sqrt().sqrt()
}

/// Notes that microfacets of another distribution became GGX.
pub fn lose_shape(kind: &MaterialKind, who: &str, output: &mut Output) {
    let shape = match kind {
        MaterialKind::Conductor(metal) => metal.microfacets,
        MaterialKind::CoatedConductor(coated) => coated.conductor.microfacets,
        MaterialKind::Dielectric(glass) => glass.microfacets,
        MaterialKind::Plastic(plastic) => plastic.microfacets,
        MaterialKind::CoatedDiffuse(coated) => coated.microfacets,
        _ => MicrofacetShape::Ggx,
    };
    if shape != MicrofacetShape::Ggx {
        output.lose(format!("{who}: Beckmann's microfacets became GGX's of the same width"));
    }
}

/// The nearest OpenPBR surface; differences are noted as losses of `who`.
pub fn open_pbr(material: &Material, who: &str, output: &mut Output) -> OpenPbr {
    lose_shape(&material.kind, who, output);
    let mut lose = |what: &str| output.lose(format!("{who}: {what}"));
    let matte = |color: ColorParam| OpenPbr {
        base_color: without_spectrum(color, false),
        specular_weight: 0.0.into(),
        ..OpenPbr::default()
    };
    if let AlphaMode::Sheet(ior) = material.alpha_mode {
        let pane =
            MetallicRoughness { ior, transmission: 1.0.into(), ..MetallicRoughness::default() };
        return pane.open_pbr();
    }
    match &material.kind {
        MaterialKind::Black(_) => matte(Rgb::BLACK.into()),
        MaterialKind::Diffuse(diffuse) => matte(diffuse.reflectance),
        MaterialKind::Interface(_) => {
            lose("the boundary of a medium became clear and thin");
            OpenPbr {
                transmission_weight: 1.0.into(),
                specular_ior: 1.0.into(),
                specular_roughness: 0.0.into(),
                geometry_thin_walled: true,
                ..OpenPbr::default()
            }
        }
        MaterialKind::Phong(phong) => {
            lose("Phong's model became microfacets of about the same width");
            let is_clear = !phong.transmission.factor.is_black();
            OpenPbr {
                base_color: without_spectrum(phong.diffuse, false),
                specular_weight: phong.specular.factor.max_element().min(1.0).into(),
                specular_roughness: match phong.reflection.factor.is_black() {
                    true => roughness_of_shininess(phong.shininess).into(),
                    false => 0.0.into(),
                },
                specular_ior: if is_clear { phong.ior.into() } else { 1.5.into() },
                transmission_weight: phong.transmission.factor.max_element().min(1.0).into(),
                ..OpenPbr::default()
            }
        }
        MaterialKind::Mirror(mirror) => {
            lose("an ideal mirror became a smooth metal");
            OpenPbr {
                base_color: without_spectrum(mirror.reflectance, false),
                base_metalness: 1.0.into(),
                specular_roughness: 0.0.into(),
                ..OpenPbr::default()
            }
        }
        MaterialKind::Conductor(conductor) => {
            if !matches!(conductor.spectrum, ConductorSpectrum::Color(_)) {
                lose("a measured metal became one of its colour");
            }
            let (stretched, is_across) = (conductor.anisotropy, conductor.anisotropy.factor < 0.0);
            let tint = without_spectrum(conductor.tint, false);
            let (base_color, strength) =
                tinted(without_spectrum(metal_color(&conductor.spectrum), false), tint);
            OpenPbr {
                base_color,
                base_metalness: 1.0.into(),
                specular_weight: strength.into(),
                specular_roughness: conductor.roughness,
                specular_roughness_anisotropy: ScalarParam {
                    factor: stretched.factor.abs(),
                    ..stretched
                },
                geometry_tangent: is_across
                    .then_some(TangentMap { rotation: FRAC_PI_2, texture: None }),
                ..OpenPbr::default()
            }
        }
        MaterialKind::CoatedConductor(coated) => {
            lose("a coated metal became one of its colour under a coat");
            let metal = &coated.conductor;
            let color = without_spectrum(metal_color(&metal.spectrum), false);
            let (base_color, strength) = tinted(color, without_spectrum(metal.tint, false));
            OpenPbr {
                base_color,
                base_metalness: 1.0.into(),
                specular_weight: strength.into(),
                specular_roughness: coated.conductor.roughness,
                coat_weight: 1.0.into(),
                coat_ior: coated.ior.into(),
                coat_roughness: coated.roughness,
                ..OpenPbr::default()
            }
        }
        MaterialKind::Dielectric(glass) => {
            if glass.ior.is_dispersive() {
                lose("dispersion is left out");
            }
            let absorbs = !glass.absorption.is_black();
            OpenPbr {
                base_color: without_spectrum(glass.tint, false),
                transmission_weight: 1.0.into(),
                transmission_color: match absorbs {
                    true => glass.absorption.map(|sigma| real::exp(-sigma)).into(),
                    false => Rgb::WHITE.into(),
                },
                transmission_depth: if absorbs { 1.0.into() } else { 0.0.into() },
                transmission_tint: without_spectrum(glass.tint, false),
                specular_ior: glass.ior.at_line_d().into(),
                specular_roughness: glass.roughness,
                ..OpenPbr::default()
            }
        }
        MaterialKind::Plastic(plastic) => OpenPbr {
            base_color: without_spectrum(plastic.diffuse, false),
            specular_color: without_spectrum(plastic.specular, false),
            specular_ior: plastic.ior.into(),
            specular_roughness: plastic.roughness,
            ..OpenPbr::default()
        },
        MaterialKind::CoatedDiffuse(coated) => {
            lose("the body under the coat has its colour without the darkening by the coat");
            OpenPbr {
                base_color: without_spectrum(coated.reflectance, false),
                specular_ior: coated.ior.into(),
                specular_roughness: coated.roughness,
                ..OpenPbr::default()
            }
        }
        MaterialKind::Hair(hair) => {
            lose("hair became a matte surface of about its colour");
            matte(hair.seen_color())
        }
        MaterialKind::MetallicRoughness(kind) => kind.open_pbr(),
        MaterialKind::OpenPbr(surface) => surface.clone(),
    }
}
