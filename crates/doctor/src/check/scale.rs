//! Implausible sizes.

use crate::{Report, Severity, Subject};
use snell_math::Bounds3d;
use snell_math::real;
use snell_scene::Projection;

/// Single precision has about this many steps per unit of size that a surface needs to look smooth.
const STEPS: f64 = 1000.0;

/// Compares sizes of objects with their distance from the origin and with each other.
pub fn scale(subject: &Subject, report: &mut Report) {
    let scene_bounds = subject.finite_bounds();
    if scene_bounds.is_empty() {
        return;
    }
    let size = scene_bounds.size().max_element();
    if !(1e-5..=1e8).contains(&size) && size > 0.0 {
        let message = format!(
            "the whole scene is {size:.1e} units large; with metres as units, that is not of this \
                world"
        );
        report.add(Severity::Warning, "", message, "scale it: most formats count in metres");
    }
    precision(subject, report);
    stretched(subject, report);
    views(subject, size, report);
}

/// Surfaces so far from zero that coordinates in single precision do not hold their shape: meshes
/// from their own origin, and all in the world, where rays are.
fn precision(subject: &Subject, report: &mut Report) {
    let is_coarse = |bounds: &Bounds3d| {
        let (size, far) = (bounds.size().max_element(), distance(bounds));
        bounds.is_finite() && size > 0.0 && far * f64::from(f32::EPSILON) * STEPS > size
    };
    for body in &subject.bodies {
        let bounds = Bounds3d::from(body.mesh.bounds());
        if !bounds.is_empty() && is_coarse(&bounds) {
            let message = format!(
                "a mesh of {:.2e} units at {:.2e} units from its origin: its coordinates have less \
                    than {STEPS} steps",
                bounds.size().max_element(),
                distance(&bounds)
            );
            let remedy = "move the mesh to the origin and place it by a transform";
            report.add(Severity::Warning, subject.body_name(body), message, remedy);
        }
    }
    let scene = subject.finite_bounds();
    if is_coarse(&scene) {
        let message = format!(
            "a scene of {:.2e} units at {:.2e} units from zero: the coordinates of rays have less \
                than {STEPS} steps",
            scene.size().max_element(),
            distance(&scene)
        );
        report.add(Severity::Warning, "", message, "move the scene near zero");
    }
}

/// The largest coordinate of a box.
fn distance(bounds: &Bounds3d) -> f64 {
    bounds.min.abs().max(bounds.max.abs()).max_element()
}

/// Transforms that scale one direction a thousand times more than another.
fn stretched(subject: &Subject, report: &mut Report) {
    let mut reported = std::collections::BTreeSet::new();
    for (place, placed) in subject.placed.iter().enumerate() {
        let m = &placed.world_from_surface.matrix().matrix3;
        let lengths = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
        let (least, most) =
            lengths.iter().fold((f64::INFINITY, 0.0f64), |(a, b), &x| (a.min(x), b.max(x)));
        // A flat object may be arbitrarily thin.
        let is_flat = placed.surface.geometry.bounds().size().to_array().iter().any(|&s| s <= 0.0);
        if most > 1e5 * least && !is_flat && reported.insert(placed.node) {
            let message = format!(
                "its transform scales one direction {:.0e} times more than another",
                most / least
            );
            report.add(Severity::Warning, subject.name(place), message, "correct the scale");
        }
    }
}

/// Cameras with an implausible angle, lens or distance.
fn views(subject: &Subject, size: f64, report: &mut Report) {
    for (i, camera) in subject.scene.cameras.iter().enumerate() {
        let name = if camera.name.is_empty() {
            format!("camera {i}")
        } else {
            format!("camera \"{}\"", camera.name)
        };
        if let Projection::Perspective { tan_half_fov } = camera.projection {
            let widest = tan_half_fov.iter().flatten().fold(0.0f64, |a, &b| a.max(b));
            let degrees = 2.0 * real::atan(widest).to_degrees();
            if !(0.1..=170.0).contains(&degrees) {
                let message = format!(
                    "an angle of view of {degrees:.2} degrees; was it given in radians, or the \
                        reverse?"
                );
                report.add(Severity::Warning, &name, message, "correct the angle");
            }
        }
        let nearest = (0..subject.placed.len())
            .map(|i| subject.bounds(i))
            .filter(|b| !b.is_empty())
            .map(|b| (camera.eye - camera.eye.clamp(b.min, b.max)).length())
            .fold(f64::INFINITY, f64::min);
        if nearest > 1e4 * size
            && nearest.is_finite()
            && !matches!(camera.projection, Projection::Orthographic { .. })
        {
            let message =
                format!("it is {:.0e} times the size of the scene away from it", nearest / size);
            report.add(
                Severity::Warning,
                &name,
                message,
                "move it nearer, or correct the units of one of the two",
            );
        }
        if camera.aperture_radius > size && size > 0.0 {
            let message = "its lens is larger than the scene";
            report.add(Severity::Warning, &name, message, "correct the units of the lens");
        }
    }
}
