//! Materials that reflect more than they receive, and parameters out of range.

use super::material_name;
use crate::{Report, Severity, Subject};
use snell_math::Rgb;
use snell_scene::material::{ColorParam, ConductorSpectrum, MaterialKind, ScalarParam};
use snell_scene::medium::Medium;
use snell_scene::{Pixels, Scene};

/// Rounding that nobody minds.
const TOLERANCE: f32 = 1.0 + 1e-3;

/// Looks at all materials in the table, and at media.
pub fn materials(subject: &Subject, report: &mut Report) {
    let scene = subject.scene;
    for (i, material) in scene.materials.iter().enumerate() {
        let name = material_name(i, material);
        for (what, color) in reflectances(&material.kind) {
            reflectance(scene, &name, what, color, report);
        }
        for (what, scalar) in fractions(&material.kind) {
            if !(0.0..=TOLERANCE).contains(&scalar.factor) {
                let message =
                    format!("{what} is {}, expected 0 to 1; it is cut to that", scalar.factor);
                report.add(Severity::Warning, &name, message, "correct it");
            }
        }
        if let Some(ior) = index(&material.kind)
            && !(0.2..=6.0).contains(&ior)
        {
            let message =
                format!("an index of refraction of {ior}; water has 1.33, glass 1.5, diamond 2.4");
            report.add(Severity::Warning, &name, message, "correct it");
        }
        let emission = material.emission.factor;
        if emission.r.min(emission.g).min(emission.b) < 0.0 {
            report.add(
                Severity::Warning,
                &name,
                "its emission is negative, which counts as none",
                "make it positive",
            );
        }
    }
    for (i, medium) in scene.media.iter().enumerate() {
        let (sigma_a, sigma_s) = match medium {
            Medium::Homogeneous(m) => (m.sigma_a, m.sigma_s),
            Medium::Grid(m) => (m.sigma_a, m.sigma_s),
            Medium::HeightFog(m) => (m.sigma_a, m.sigma_s),
            Medium::Cloud(m) => (m.sigma_a, m.sigma_s),
        };
        let least = |c: Rgb| c.r.min(c.g).min(c.b);
        if least(sigma_a).min(least(sigma_s)) < 0.0 {
            let message = "a negative coefficient, which counts as 0: it would scatter more light \
                than it takes";
            report.add(
                Severity::Warning,
                format!("medium {i} ({})", medium.name()),
                message,
                "make it 0 or more",
            );
        }
    }
}

fn reflectance(scene: &Scene, name: &str, what: &str, color: ColorParam, report: &mut Report) {
    let remedy = "make it at most 1: more would make light out of nothing, and is cut";
    let factor = color.factor;
    if factor.r.min(factor.g).min(factor.b) < 0.0 {
        report.add(
            Severity::Warning,
            name,
            format!("{what} is negative, which counts as 0"),
            "make it 0 or more",
        );
    }
    let Some(id) = color.texture else {
        // A spectrum has a shape of its own.
        if color.spectrum.is_none() && factor.max_element() > TOLERANCE {
            let Rgb { r, g, b } = factor;
            report.add(
                Severity::Warning,
                name,
                format!("{what} is {r} {g} {b}, which is above 1"),
                remedy,
            );
        }
        return;
    };
    let most = scene
        .textures
        .get(id.index())
        .and_then(|t| scene.images.get(t.as_image()?.image.index()))
        .map_or(1.0, |image| match &image.pixels {
            Pixels::F32(values) => {
                values.iter().copied().filter(|x| x.is_finite()).fold(0.0, f32::max)
            }
            Pixels::U8(values) => f32::from(values.iter().copied().max().unwrap_or(0)) / 255.0,
            Pixels::U16(values) => f32::from(values.iter().copied().max().unwrap_or(0)) / 65535.0,
        });
    if factor.max_element() * most > 1.01 {
        let message = format!(
            "{what} is up to {} with its texture, which is above 1",
            factor.max_element() * most
        );
        report.add(Severity::Warning, name, message, remedy);
    }
}

/// The parameters that are shares of light.
fn reflectances(kind: &MaterialKind) -> Vec<(&'static str, ColorParam)> {
    match kind {
        MaterialKind::Black(_) | MaterialKind::Interface(_) => Vec::new(),
        MaterialKind::Diffuse(m) => vec![("reflectance", m.reflectance)],
        MaterialKind::CoatedDiffuse(m) => vec![("reflectance", m.reflectance)],
        MaterialKind::Phong(m) => vec![
            ("diffuse", m.diffuse),
            ("specular", m.specular),
            ("reflection", m.reflection),
            ("transmission", m.transmission),
        ],
        MaterialKind::Mirror(m) => vec![("reflectance", m.reflectance)],
        MaterialKind::Conductor(m) => metal(&m.spectrum),
        MaterialKind::CoatedConductor(m) => metal(&m.conductor.spectrum),
        MaterialKind::Dielectric(m) => vec![("tint", m.tint)],
        MaterialKind::Plastic(m) => vec![("diffuse", m.diffuse), ("specular", m.specular)],
        MaterialKind::Hair(m) => vec![("color", m.color)],
        // The tint of its reflection may exceed 1.
        MaterialKind::MetallicRoughness(m) => vec![("base_color", m.base_color)],
        MaterialKind::OpenPbr(m) => vec![
            ("base_color", m.base_color),
            ("transmission_color", m.transmission_color),
            ("transmission_tint", m.transmission_tint),
            ("subsurface_color", m.subsurface_color),
            ("coat_color", m.coat_color),
            ("fuzz_color", m.fuzz_color),
        ],
    }
}

fn metal(spectrum: &ConductorSpectrum) -> Vec<(&'static str, ColorParam)> {
    match spectrum {
        ConductorSpectrum::Color(color) => vec![("color", *color)],
        ConductorSpectrum::Metal(_) | ConductorSpectrum::Measured { .. } => Vec::new(),
    }
}

/// The scalars that lie between 0 and 1.
fn fractions(kind: &MaterialKind) -> Vec<(&'static str, ScalarParam)> {
    match kind {
        MaterialKind::Conductor(m) => vec![("roughness", m.roughness)],
        MaterialKind::CoatedConductor(m) => vec![("roughness", m.roughness)],
        MaterialKind::Dielectric(m) => vec![("roughness", m.roughness)],
        MaterialKind::Plastic(m) => vec![("roughness", m.roughness)],
        MaterialKind::CoatedDiffuse(m) => vec![("roughness", m.roughness)],
        MaterialKind::Hair(m) => {
            vec![
                ("longitudinal_roughness", m.longitudinal_roughness),
                ("azimuthal_roughness", m.azimuthal_roughness),
            ]
        }
        MaterialKind::MetallicRoughness(m) => {
            vec![
                ("roughness", m.roughness),
                ("metallic", m.metallic),
                ("transmission", m.transmission),
            ]
        }
        MaterialKind::OpenPbr(m) => vec![
            ("specular_roughness", m.specular_roughness),
            ("base_metalness", m.base_metalness),
            ("transmission_weight", m.transmission_weight),
            ("coat_weight", m.coat_weight),
            ("coat_roughness", m.coat_roughness),
        ],
        _ => Vec::new(),
    }
}

fn index(kind: &MaterialKind) -> Option<f32> {
    match kind {
        MaterialKind::Dielectric(m) => Some(m.ior.at_line_d()),
        MaterialKind::Plastic(m) => Some(m.ior),
        MaterialKind::CoatedDiffuse(m) => Some(m.ior),
        MaterialKind::CoatedConductor(m) => Some(m.ior),
        MaterialKind::Hair(m) => Some(m.ior),
        // glTF's 0 has a meaning, and large ones stand for coloured highlights.
        MaterialKind::OpenPbr(m)
            if m.transmission_weight.factor > 0.0 && m.specular_ior.factor > 0.0 =>
        {
            Some(m.specular_ior.factor)
        }
        _ => None,
    }
}
