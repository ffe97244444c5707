//! Cameras inside of closed surfaces, and cameras with everything behind them.

use super::lights::is_opaque;
use crate::{Report, Severity, Subject};
use snell_math::{Bounds3d, DVec3};
use snell_scene::{Camera, Projection};

/// Checks every camera.
pub fn cameras(subject: &Subject, report: &mut Report) {
    for (i, camera) in subject.scene.cameras.iter().enumerate() {
        let name = if camera.name.is_empty() {
            format!("camera {i}")
        } else {
            format!("camera \"{}\"", camera.name)
        };
        if !camera.eye.is_finite() {
            continue;
        }
        for (place, component) in subject.around(camera.eye) {
            // A camera may be inside of a room.
            if holds_something(subject, place, component) {
                continue;
            }
            let material = match (component, subject.body_of[place]) {
                (Some(component), Some(body)) => {
                    let body = &subject.bodies[body];
                    let face = body.topology.components[component].first_face;
                    subject.material_of_face(place, body.mesh, face)
                }
                _ => subject.material(subject.placed[place].material(0)),
            };
            let inside = subject.name(place);
            let finding = if is_opaque(material) {
                let message =
                    format!("it is inside of {inside}, which is opaque and holds nothing else");
                report.add(Severity::Error, &name, message, "move the camera out, or the body away")
            } else {
                let message = format!("it is inside of {inside}");
                report.add(
                    Severity::Note,
                    &name,
                    message,
                    "nothing, if it is meant to be under water or in fog",
                )
            };
            finding.position = Some(camera.eye.to_array());
        }
        if sees_nothing(subject, camera) {
            let message = "everything in the scene is behind it";
            report.add(Severity::Warning, &name, message, "turn the camera").position =
                Some(camera.eye.to_array());
        }
    }
}

/// True if another surface lies in the bounding box of a closed surface. Then the closed surface is
/// a room, a vessel or a sky.
pub fn holds_something(subject: &Subject, place: usize, component: Option<usize>) -> bool {
    let placed = &subject.placed[place];
    let map = &placed.world_from_surface;
    let own = match (component, subject.body_of[place]) {
        (Some(c), Some(body)) => {
            let body = &subject.bodies[body];
            let outer = &body.topology.components[c].bounds;
            let others = body.topology.components.iter().enumerate();
            let inner = |o: &snell_math::Bounds3| outer.contains(o.center());
            if others.into_iter().any(|(i, o)| i != c && inner(&o.bounds)) {
                return true;
            }
            map.bounds(&(*outer).into())
        }
        _ => subject.bounds(place),
    };
    (0..subject.placed.len()).any(|other| {
        let bounds: Bounds3d = subject.bounds(other);
        other != place
            && bounds.is_finite()
            && !bounds.is_empty()
            && own.contains(bounds.center())
            && {
                // A surface in the box makes it a room only if it is smaller than the box.
                bounds.size().length() < own.size().length()
            }
    })
}

/// True if all surfaces are behind a camera whose picture is flat (perspective or orthographic).
fn sees_nothing(subject: &Subject, camera: &Camera) -> bool {
    let sees_all_around = matches!(
        camera.projection,
        Projection::Panoramic | Projection::EqualArea | Projection::Fisheye { .. }
    );
    if sees_all_around || subject.placed.is_empty() {
        return false;
    }
    // Media are visible without surfaces.
    if subject.scene.medium.is_some() {
        return false;
    }
    let is_behind = |bounds: Bounds3d| {
        bounds.is_finite()
            && (0..8).all(|i| {
                let pick = |bit: u32, low: f64, high: f64| if i & bit == 0 { low } else { high };
                let corner = DVec3::new(
                    pick(1, bounds.min.x, bounds.max.x),
                    pick(2, bounds.min.y, bounds.max.y),
                    pick(4, bounds.min.z, bounds.max.z),
                );
                (corner - camera.eye).dot(camera.towards) < 0.0
            })
    };
    let mut boxes =
        (0..subject.placed.len()).map(|i| subject.bounds(i)).filter(|b| !b.is_empty()).peekable();
    boxes.peek().is_some() && boxes.all(is_behind)
}
