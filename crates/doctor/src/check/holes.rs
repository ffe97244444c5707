//! Holes and loose edges of surfaces that light enters.
//!
//! A body may be made of several meshes, and exporters do not always give the two sides of a seam
//! the same coordinates. So an edge counts as open only if no other open edge lies within a
//! millionth of the body's size. A surface that is more sheet than body (water in a basin, a pane)
//! is not reported as a body with a hole.

use super::counted;
use crate::subject::{Body, bounds_inside};
use crate::topology::BoundaryEdge;
use crate::{Report, Severity, Subject};
use snell_math::DVec3;
use std::collections::{BTreeMap, HashMap};

/// Surfaces whose openness is at least this, from 0 to 1, are sheets.
const SHEET: f64 = 0.45;

/// Checks all meshes that bound an interior.
pub fn holes(subject: &Subject, report: &mut Report) {
    let seams = Seams::of(subject);
    for body in subject.bodies.iter().filter(|b| b.role.bounds_inside) {
        let Some(&place) = body.places.first() else { continue };
        let is_inside = |face: u32| bounds_inside(subject.material_of_face(place, body.mesh, face));
        let mut open: BTreeMap<u32, Vec<&BoundaryEdge>> = BTreeMap::new();
        for edge in body.topology.boundary.iter().filter(|e| is_inside(e.face)) {
            if !seams.is_closed(subject, place, edge) {
                open.entry(body.topology.component_of[edge.face as usize]).or_default().push(edge);
            }
        }
        tell_of_holes(subject, body, &open, report);
        let loose: Vec<u32> =
            body.topology.non_manifold.iter().copied().filter(|&f| is_inside(f)).collect();
        if let Some(&first) = loose.first() {
            let message = format!(
                "{} of a surface that bounds glass or a medium {} shared by an odd number of \
                    faces: where is inside?",
                counted(loose.len(), "edge"),
                if loose.len() == 1 { "is" } else { "are" }
            );
            let remedy = "remove inner walls and fins, or make them bodies of their own";
            report.add_at_face(
                Severity::Warning,
                subject,
                body,
                (first, loose.len()),
                message,
                remedy,
            );
        }
    }
}

fn tell_of_holes(
    subject: &Subject,
    body: &Body,
    open: &BTreeMap<u32, Vec<&BoundaryEdge>>,
    report: &mut Report,
) {
    let (mut hole_edges, mut sheet_edges): (Vec<&BoundaryEdge>, Vec<&BoundaryEdge>) =
        Default::default();
    for (&component, edges) in open {
        let is_sheet = body.topology.components[component as usize].openness() > SHEET;
        if is_sheet { &mut sheet_edges } else { &mut hole_edges }.extend(edges.iter().copied());
    }
    if let Some(first) = hole_edges.first() {
        let message = format!(
            "holes with {} in a surface that bounds glass or a medium: light that enters there \
                never leaves",
            counted(hole_edges.len(), "open edge")
        );
        let remedy = "close the holes, or make the material thin-walled";
        report.add_at_face(
            Severity::Error,
            subject,
            body,
            (first.face, hole_edges.len()),
            message,
            remedy,
        );
    }
    if let Some(first) = sheet_edges.first() {
        let message = "an open sheet of a material that has an inside: light bends once where it \
            goes through, as in water over a bottom";
        let remedy =
            "nothing for water in a basin; a pane needs a thickness, or a thin-walled material";
        report.add_at_face(
            Severity::Note,
            subject,
            body,
            (first.face, sheet_edges.len()),
            message,
            remedy,
        );
    }
}

/// All open edges in the world of bodies with an interior, by position.
struct Seams {
    cells: HashMap<[i64; 3], u32>,
    cell: f64,
}

impl Seams {
    fn of(subject: &Subject) -> Self {
        let size = subject.finite_bounds().size().max_element();
        let mut this = Self { cells: HashMap::new(), cell: (size * 1e-6).max(f64::MIN_POSITIVE) };
        for body in subject.bodies.iter().filter(|b| b.role.bounds_inside) {
            for &place in &body.places {
                for edge in &body.topology.boundary {
                    *this.cells.entry(this.key(middle(subject, place, edge))).or_default() += 1;
                }
            }
        }
        this
    }

    fn key(&self, p: DVec3) -> [i64; 3] {
        (p / self.cell + 0.271_828).to_array().map(|x| x.floor() as i64)
    }

    /// True if another open edge has the same midpoint.
    fn is_closed(&self, subject: &Subject, place: usize, edge: &BoundaryEdge) -> bool {
        let [x, y, z] = self.key(middle(subject, place, edge));
        let mut count = 0;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    count += self.cells.get(&[x + dx, y + dy, z + dz]).copied().unwrap_or(0);
                }
            }
        }
        count > 1
    }
}

fn middle(subject: &Subject, place: usize, edge: &BoundaryEdge) -> DVec3 {
    let [a, b] = edge.ends.map(|p| p.as_dvec3());
    subject.placed[place].world_from_surface.point((a + b) * 0.5)
}
