//! Materials that reflect more than they receive, and parameters out of range.

use super::material_name;
use crate::{Report, Severity, Subject};
use snell_math::parameters::{Found, Leaf, Range, Value, find};
use snell_scene::{Material, Pixels, Scene, TextureId};

/// Tolerance for rounding.
const TOLERANCE: f64 = 1e-3;

/// The plausible range of the index of refraction of an interior.
const USUAL_INDICES: std::ops::RangeInclusive<f32> = 0.2..=6.0;

/// Checks all materials in the table, and media.
pub fn materials(subject: &Subject, report: &mut Report) {
    let scene = subject.scene;
    for (i, material) in scene.materials.iter().enumerate() {
        let name = material_name(i, material);
        parameters(scene, &name, material, report);
        inside(&name, material, report);
    }
    for (i, medium) in scene.media.iter().enumerate() {
        parameters(scene, &format!("medium {i} ({})", medium.name()), medium, report);
    }
}

/// Checks the parameters of a material, light or other declared value.
fn parameters(scene: &Scene, name: &str, thing: &impl Value, report: &mut Report) {
    find(thing, &mut |found| {
        if let Some((message, remedy)) = impossible(found).or_else(|| unusual(scene, found)) {
            report.add(Severity::Warning, name, message, remedy);
        }
    });
}

/// The message and remedy for numbers out of their range.
fn impossible(found: &Found) -> Option<(String, &'static str)> {
    let (parameter, range) = (found.name(), found.range);
    let is_near = |x: f64| [x - TOLERANCE, x + TOLERANCE].iter().any(|&x| range.contains(x));
    let numbers = found.numbers();
    // Non-finite numbers are reported by another check.
    let wrong =
        numbers.into_iter().find(|&x| x.is_finite() && !range.contains(x) && !is_near(x))?;
    if wrong < 0.0 && range.contains(0.0) {
        let message = format!("its {parameter} is negative, which counts as 0");
        return Some((message, "make it 0 or more"));
    }
    if matches!(found.leaf, Leaf::Numbers(_)) && range == Range::SHARE {
        return above_one(found);
    }
    let message =
        format!("its {parameter} is {}, expected {range}; it is cut to that", wrong as f32);
    Some((message, "correct it"))
}

/// The message and remedy for numbers that are allowed, but most likely a mistake.
fn unusual(scene: &Scene, found: &Found) -> Option<(String, &'static str)> {
    let (parameter, usual) = (found.name(), found.usual);
    let is_color = matches!(found.leaf, Leaf::Numbers(_));
    match (is_color, found.texture) {
        (true, Some(texture)) if usual == Range::SHARE => {
            let most = largest(found) * f64::from(brightest(scene, TextureId(texture)));
            let message =
                || format!("its {parameter} is up to {most:.3} with its texture, which is above 1");
            (most > 1.01).then(|| (message(), CUT))
        }
        (true, None) if usual == Range::SHARE => above_one(found),
        (false, None) => {
            let wrong = found.numbers().into_iter().find(|&x| !usual.contains(x))?;
            let message = format!("its {parameter} is {}, which usually is {usual}", wrong as f32);
            (usual != found.range).then_some((message, "correct it"))
        }
        _ => None,
    }
}

const CUT: &str = "make it at most 1: more would make light out of nothing, and is cut";

/// The message and remedy for a colour that reflects more than it receives.
fn above_one(found: &Found) -> Option<(String, &'static str)> {
    // The values of a spectrum do not follow from its factor alone.
    if found.is_spectral || largest(found) <= 1.0 + TOLERANCE {
        return None;
    }
    let color: Vec<String> = found.numbers().iter().map(|&x| (x as f32).to_string()).collect();
    let message = format!("its {} is {}, which is above 1", found.name(), color.join(" "));
    Some((message, CUT))
}

fn largest(found: &Found) -> f64 {
    found.numbers().into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// The largest value of a texture; 1 for patterns.
fn brightest(scene: &Scene, texture: TextureId) -> f32 {
    let image = scene
        .textures
        .get(texture.index())
        .and_then(|t| scene.images.get(t.as_image()?.image.index()));
    image.map_or(1.0, |image| match &image.pixels {
        Pixels::F32(values) => values.iter().copied().filter(|x| x.is_finite()).fold(0.0, f32::max),
        Pixels::U8(values) => f32::from(values.iter().copied().max().unwrap_or(0)) / 255.0,
        Pixels::U16(values) => f32::from(values.iter().copied().max().unwrap_or(0)) / 65535.0,
    })
}

/// Checks the index of refraction of a surface's interior.
fn inside(name: &str, material: &Material, report: &mut Report) {
    let ior = material.ior();
    if material.bounded_interior().is_some() && !USUAL_INDICES.contains(&ior) {
        let message =
            format!("an index of refraction of {ior}; water has 1.33, glass 1.5, diamond 2.4");
        report.add(Severity::Warning, name, message, "correct it");
    }
}
