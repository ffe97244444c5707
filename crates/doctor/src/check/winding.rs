//! Orientation of surfaces. It matters where light enters, where the back is invisible, and where
//! only the front emits.

use super::counted;
use crate::subject::{Body, bounds_inside};
use crate::{Report, Severity, Subject};
use snell_math::Bounds3;
use snell_math::real;

/// Checks all meshes, component by component.
pub fn winding(subject: &Subject, report: &mut Report) {
    for body in &subject.bodies {
        inconsistent(subject, body, report);
        inside_out(subject, body, report);
        against_normals(subject, body, report);
    }
}

fn inconsistent(subject: &Subject, body: &Body, report: &mut Report) {
    let faces = &body.topology.inconsistent;
    let Some(&first) = faces.first() else { return };
    let message =
        format!("neighbouring faces are wound differently along {}", counted(faces.len(), "edge"));
    let severity = match body.role {
        role if role.bounds_inside => Severity::Error,
        role if role.is_one_sided || role.emits_outwards => Severity::Warning,
        // The mesh is two-sided and opaque: nothing depends on the winding.
        _ => Severity::Note,
    };
    let remedy = "recalculate the outside of the mesh and export it again";
    report.add_at_face(severity, subject, body, (first, faces.len()), message, remedy);
}

/// Reports closed pieces with a negative volume, unless they are the inner wall of another piece.
fn inside_out(subject: &Subject, body: &Body, report: &mut Report) {
    let topology = &body.topology;
    let Some(&place) = body.places.first() else { return };
    let contains = |outer: &Bounds3, inner: &Bounds3| {
        outer.min.cmple(inner.min).all() && outer.max.cmpge(inner.max).all() && outer != inner
    };
    let turned: Vec<_> = topology
        .components
        .iter()
        .filter(|c| c.is_closed() && c.inconsistent_edges == 0 && c.volume < 0.0 && c.faces >= 4)
        .filter(|c| {
            // The volume of flat bodies is only rounding error.
            c.volume.abs() > 1e-6 * real::powf(c.area, 1.5)
        })
        .filter(|c| {
            !topology.components.iter().any(|o| o.volume > 0.0 && contains(&o.bounds, &c.bounds))
        })
        .collect();
    let Some(first) = turned.first() else { return };
    let material = subject.material_of_face(place, body.mesh, first.first_face);
    let agrees_with_normals = !body.mesh.normals.is_empty() && first.faces_against_normals == 0;
    let (severity, message, remedy) = if bounds_inside(material) {
        let message =
            "the surface is inside out: what it bounds is outside of it, and inside is air";
        if is_inner_wall(subject, place, &first.bounds) {
            return;
        }
        (Severity::Error, message, "turn its faces over")
    } else if !material.double_sided && !agrees_with_normals {
        (
            Severity::Warning,
            "the body is inside out, and its material has no back: only the far walls are seen",
            "turn its faces over, or make the material two-sided",
        )
    } else {
        (
            Severity::Note,
            "the body is inside out: its faces look inwards, as those of a room or a sky do; \
                pictures are the same, but programs that take inside and outside from the faces \
                have them the wrong way round",
            "if it is not a room or a sky, turn its faces over",
        )
    };
    report.add_at_face(severity, subject, body, (first.first_face, turned.len()), message, remedy);
}

/// True if another mesh with an interior surrounds the box `inner`: then the two meshes are the
/// walls of a vessel.
fn is_inner_wall(subject: &Subject, place: usize, inner: &Bounds3) -> bool {
    let inner = subject.placed[place].world_from_surface.bounds(&(*inner).into());
    (0..subject.placed.len()).any(|other| {
        let outer = subject.bounds(other);
        let around =
            outer.min.cmple(inner.min).all() && outer.max.cmpge(inner.max).all() && other != place;
        around
            && subject.placed[other]
                .slots()
                .iter()
                .any(|(_, id)| bounds_inside(subject.material(*id)))
    })
}

/// Reports pieces whose vertex normals point to their inner side.
fn against_normals(subject: &Subject, body: &Body, report: &mut Report) {
    let Some(&place) = body.places.first() else { return };
    let against: Vec<_> = body
        .topology
        .components
        .iter()
        .filter(|c| c.faces_against_normals * 10 >= c.faces * 9 && c.faces > 0)
        .collect();
    let Some(first) = against.first() else { return };
    let faces: u64 = against.iter().map(|c| u64::from(c.faces_against_normals)).sum();
    let material = subject.material_of_face(place, body.mesh, first.first_face);
    let severity = match body.role {
        _ if bounds_inside(material) => Severity::Warning,
        role if role.is_one_sided || role.emits_outwards => Severity::Warning,
        _ => Severity::Note,
    };
    let message = format!(
        "the vertex normals of {} point to the inner side according to their winding",
        counted(faces as usize, "face")
    );
    let remedy = "turn the faces over, or compute the normals again";
    report.add_at_face(
        severity,
        subject,
        body,
        (first.first_face, faces as usize),
        message,
        remedy,
    );
}
