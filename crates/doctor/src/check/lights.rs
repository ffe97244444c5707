//! Lights that illuminate nothing.

use super::material_name;
use crate::{Report, Severity, Subject};
use snell_intersect::AcceptAll;
use snell_math::{Bounds3d, DVec3, Ray, real, rotation};
use snell_scene::{Geometry, Light, Material};
use std::collections::BTreeMap;

/// Number of rays that test each point of an emitting surface.
const PROBES: u32 = 64;
/// Maximum number of emitting surfaces that are tested.
const MAX_LOOKS: usize = 2000;
/// A surface nearer than this share of the scene's size covers a lamp.
const NEAR: f64 = 1e-3;

/// Checks lights and emitting surfaces.
pub fn lights(subject: &Subject, report: &mut Report) {
    let scene_bounds = subject.finite_bounds();
    let is_bounded = (0..subject.placed.len()).all(|i| subject.bounds(i).is_finite());
    for (i, light) in subject.scene.lights.iter().enumerate() {
        let name = format!("light {i} ({})", light.name());
        if let Some((message, remedy)) = dark(light) {
            // In old files, black lights mean that surfaces or the sky illuminate the scene.
            let severity =
                if is_lit_otherwise(subject) { Severity::Note } else { Severity::Warning };
            report.add(severity, name, message, remedy);
            continue;
        }
        if is_bounded && !scene_bounds.is_empty() && misses(light, &scene_bounds) {
            let message = "its light misses everything in the scene";
            report
                .add(Severity::Warning, name, message, "turn it, widen its cone, or take it out")
                .position = light.position().map(|p| p.to_array());
        } else if let Some(place) = light.position().and_then(|p| enclosed(subject, light, p)) {
            let message = format!("it is inside of {}, which is opaque", subject.name(place));
            report
                .add(
                    Severity::Warning,
                    name,
                    message,
                    "move it out, or make the body around it clear",
                )
                .position = light.position().map(|p| p.to_array());
        }
    }
    emitters(subject, report);
}

/// True if surfaces or the environment illuminate the scene.
fn is_lit_otherwise(subject: &Subject) -> bool {
    let emits = |(_, id)| subject.material(id).is_emissive();
    subject.scene.environment.is_some()
        || subject.placed.iter().any(|p| p.slots().into_iter().any(emits))
}

/// The message and remedy for a light that emits nothing; `None` for any other light.
fn dark(light: &Light) -> Option<(&'static str, &'static str)> {
    let color = light.color();
    if color.r.min(color.g).min(color.b) < 0.0 {
        return Some(("its colour is negative", "make it positive"));
    }
    if color.is_black() || light.power(1.0) == 0.0 {
        return Some((
            "it has no light: its colour, its power or its cone is 0",
            "give it some, or take it out",
        ));
    }
    None
}

/// True if the whole box is outside the region that the light illuminates.
fn misses(light: &Light, bounds: &Bounds3d) -> bool {
    let Some((apex, (axis, angle))) = light.position().zip(light.cone()) else { return false };
    let to_center = bounds.center() - apex;
    let (distance, radius) = (to_center.length(), bounds.radius());
    if distance <= radius {
        return false;
    }
    let between = rotation::angle_between(to_center, axis);
    between - real::asin(radius / distance) > angle + 1e-6
}

/// The opaque closed surface around a light, if it contains nothing else.
fn enclosed(subject: &Subject, light: &Light, at: DVec3) -> Option<usize> {
    if light.has_body() {
        return None;
    }
    let around = subject.around(at);
    let (place, component) = around.into_iter().find(|&(place, component)| {
        let placed = &subject.placed[place];
        let material = match (component, subject.body_of[place]) {
            (Some(component), Some(body)) => {
                let body = &subject.bodies[body];
                let face = body.topology.components[component].first_face;
                subject.material_of_face(place, body.mesh, face)
            }
            _ => subject.material(placed.material(0)),
        };
        is_opaque(material)
    })?;
    // A light may be inside of a room.
    (!super::cameras::holds_something(subject, place, component)).then_some(place)
}

/// True if no light is transmitted from either side.
pub fn is_opaque(material: &Material) -> bool {
    use snell_scene::material::MaterialKind as Kind;
    let is_whole =
        material.alpha_mode == snell_scene::material::AlphaMode::Opaque && material.double_sided;
    let is_clear = match &material.kind {
        Kind::Dielectric(_) | Kind::Interface(_) => true,
        Kind::Phong(phong) => !phong.transmission.factor.is_black(),
        Kind::MetallicRoughness(kind) => kind.transmission.factor > 0.0,
        Kind::OpenPbr(surface) => {
            surface.transmission_weight.factor > 0.0 || surface.subsurface_weight.factor > 0.0
        }
        _ => false,
    };
    is_whole && !is_clear && !material.is_emissive()
}

/// Checks emitting materials: whether a surface uses each of them, and whether their light escapes.
fn emitters(subject: &Subject, report: &mut Report) {
    let mut lit: BTreeMap<usize, bool> = BTreeMap::new();
    let mut covered: BTreeMap<usize, (usize, DVec3)> = BTreeMap::new();
    let size = subject.finite_bounds().size().length();
    let mut looks = 0;
    for (place, placed) in subject.placed.iter().enumerate() {
        for (slot, id) in placed.slots() {
            let Some(id) = id.filter(|id| id.index() < subject.scene.materials.len()) else {
                continue;
            };
            let material = &subject.scene.materials[id.index()];
            if !material.is_emissive()
                || !material.illuminates
                || lit.get(&id.index()) == Some(&true)
            {
                continue;
            }
            looks += 1;
            if looks > MAX_LOOKS {
                continue;
            }
            match looks_around(subject, place, slot, material, size) {
                None => _ = lit.insert(id.index(), true),
                Some(at) => {
                    lit.entry(id.index()).or_insert(false);
                    covered.entry(id.index()).or_insert((place, at));
                }
            }
        }
    }
    if looks > MAX_LOOKS {
        let message = format!(
            "there are {looks} emitting surfaces, and the first {MAX_LOOKS} were looked at"
        );
        report.add(Severity::Note, "", message, "look at parts of the scene one by one");
    }
    for (i, material) in subject.scene.materials.iter().enumerate() {
        if material.is_emissive() && lit.get(&i) == Some(&false) {
            let (place, at) = covered[&i];
            let message = format!(
                "{} emits, but another surface covers its outer side",
                material_name(i, material)
            );
            let finding = report.add(
                Severity::Warning,
                subject.name(place),
                message,
                "turn the lamp over, move it away from what covers it, or let both sides emit",
            );
            finding.position = Some(at.to_array());
        }
    }
}

/// A tested point of an emitting surface if every ray from its tested points hits something close;
/// `None` if some of its light escapes, or if that is unknown.
fn looks_around(
    subject: &Subject,
    place: usize,
    slot: u16,
    material: &Material,
    size: f64,
) -> Option<DVec3> {
    let points = sampled(subject, place, slot)?;
    let world = subject.world()?;
    let near = size * NEAR;
    let mut last = None;
    for (i, (p, normal)) in points.into_iter().enumerate() {
        for side in if material.emits_on_both_sides { &[1.0, -1.0][..] } else { &[1.0] } {
            let normal = normal * *side;
            let x = normal.any_orthonormal_vector();
            let y = normal.cross(x);
            // Directions are spread by the golden angle, and not too near to the horizon: hits
            // there are far away even if something covers the lamp.
            let (height, turn) =
                (1.0 - 0.7 * (i as f64 + 0.5) / f64::from(PROBES), i as f64 * 2.399_963);
            let (sin, cos) = real::sin_cos(turn);
            let d = normal * height + (x * cos + y * sin) * (1.0 - height * height).max(0.0).sqrt();
            let start = p + normal * (size * 1e-6);
            let mut ray = Ray::new(start.as_vec3(), d.normalize().as_vec3());
            ray.t_max = near as f32;
            if !world.occluded_one(&ray, &AcceptAll) {
                return None;
            }
            last = Some(p);
        }
    }
    last
}

/// Points of a surface with their outer normals in the world, spread over its faces.
fn sampled(subject: &Subject, place: usize, slot: u16) -> Option<Vec<(DVec3, DVec3)>> {
    let placed = &subject.placed[place];
    let map = &placed.world_from_surface;
    let unit = |n: DVec3| map.normal(n).try_normalize();
    match &placed.surface.geometry {
        Geometry::Shape(shape) => {
            use snell_intersect::Shape;
            let points = (0..PROBES).filter_map(|i| {
                let u = snell_math::DVec2::new(
                    (f64::from(i) + 0.5) / f64::from(PROBES),
                    (f64::from(i) * 0.618_034).fract(),
                );
                let sample = shape.sample(u)?;
                Some((map.point(sample.position), unit(sample.normal)?))
            });
            Some(points.collect::<Vec<_>>()).filter(|p| !p.is_empty())
        }
        // Strands are not tested: parts of them see the sky, so nothing covers all of them.
        Geometry::Curves(_) => None,
        Geometry::Mesh(mesh) => {
            let body = &subject.bodies[subject.body_of[place]?];
            let has_slot = |f: &usize| mesh.material_slots.get(*f).copied().unwrap_or(0) == slot;
            let faces: Vec<usize> = (0..mesh.indices.len())
                .filter(|f| body.topology.component_of[*f] != u32::MAX)
                .filter(has_slot)
                .collect();
            let step = (faces.len() / PROBES as usize).max(1);
            let repeat = (PROBES as usize).div_ceil(faces.len().max(1)).max(1);
            let mut points = Vec::new();
            for face in faces.iter().step_by(step) {
                let [a, b, c] = mesh.corners(*face).map(|p| p.as_dvec3());
                for k in 0..repeat {
                    let (s, t) = (
                        0.1 + 0.8 * (k as f64 * 0.754_877).fract(),
                        0.1 + 0.8 * (k as f64 * 0.569_840).fract(),
                    );
                    let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                    let normal = unit((b - a).cross(c - a));
                    points.extend(normal.map(|n| (map.point(a + (b - a) * s + (c - a) * t), n)));
                }
            }
            (!points.is_empty()).then_some(points)
        }
    }
}
