//! Surfaces of different objects in one plane, where it is undefined which of them is visible.
//!
//! Triangles are sorted by their planes. The triangles of one plane are put into a grid, and pairs
//! that belong to different pieces are clipped against each other. Invisible overlaps are not
//! reported, such as those of the faces on which one opaque body stands on another.

use crate::subject::bounds_inside;
use crate::{Report, Severity, Subject};
use rayon::prelude::*;
use snell_math::{DVec2, DVec3, real};
use snell_scene::Material;
use std::collections::{BTreeMap, HashMap};

/// Maximum number of triangles, counting each instance. In larger scenes only the first placement
/// of each object is checked.
const MAX_TRIANGLES: usize = 8_000_000;
/// Distance below which planes count as one, relative to the scene's size.
const SAME_PLANE: f64 = 1e-7;

/// Maximum number of pairs of triangles in one plane that are compared. There is a limit because
/// thousands of triangles in one place form millions of pairs.
const MAX_PAIRS: usize = 2_000_000;
/// Maximum number of pairs of pieces in one plane that are stored.
const MAX_FOUND: usize = 10_000;

/// Maximum number of grid cells that a triangle covers on average.
const CELLS: f64 = 64.0;

/// A triangle in the world.
#[derive(Clone, Copy)]
struct Face {
    key: u64,
    place: u32,
    component: u32,
    face: u32,
    corners: [DVec3; 3],
    normal: DVec3,
}

/// A piece: a component of a placed mesh.
type Piece = (u32, u32);

/// The overlap of two pieces.
#[derive(Clone, Copy)]
struct Overlap {
    area: f64,
    faces: [u32; 2],
    at: DVec3,
    is_alike: bool,
    count: u64,
    normal: DVec3,
}

/// Checks all triangles of meshes.
pub fn coplanar(subject: &Subject, report: &mut Report) {
    let faces = all_faces(subject);
    let groups: Vec<&[Face]> = faces
        .chunk_by(|a, b| a.key == b.key)
        .filter(|g| g.iter().any(|f| (f.place, f.component) != (g[0].place, g[0].component)))
        .collect();
    let found: Vec<(BTreeMap<(Piece, Piece), Overlap>, bool)> =
        groups.par_iter().map(|group| overlaps(group)).collect();
    if found.iter().any(|(_, is_whole)| !is_whole) {
        let message = "too many faces lie in one place to compare all of them";
        report.add(Severity::Note, "", message, "take out what is there several times");
    }
    let mut all: BTreeMap<(Piece, Piece), Overlap> = BTreeMap::new();
    for (pair, overlap) in found.into_iter().flat_map(|(found, _)| found) {
        let known = all.entry(pair).or_insert(Overlap { area: 0.0, count: 0, ..overlap });
        known.area += overlap.area;
        known.count += overlap.count;
    }
    // The same two objects may overlap in many pieces, of which at most three are reported.
    let mut reported: HashMap<(u32, u32), usize> = HashMap::new();
    for ((a, b), overlap) in all {
        let seen = reported.entry((a.0, b.0)).or_default();
        if *seen < 3 && tell(subject, a, b, &overlap, report) {
            *seen += 1;
        }
    }
}

fn all_faces(subject: &Subject) -> Vec<Face> {
    let size = subject.finite_bounds().size().length().max(f64::MIN_POSITIVE);
    let total: usize = subject.bodies.iter().map(|b| b.mesh.indices.len() * b.places.len()).sum();
    let places: Vec<(u32, usize)> = match total <= MAX_TRIANGLES {
        true => (0..subject.placed.len())
            .filter_map(|i| Some((i as u32, subject.body_of[i]?)))
            .collect(),
        false => {
            subject.bodies.iter().enumerate().map(|(b, body)| (body.places[0] as u32, b)).collect()
        }
    };
    let faces = |&(place, body): &(u32, usize)| {
        let body = &subject.bodies[body];
        let map = subject.placed[place as usize].world_from_surface;
        (0..body.mesh.indices.len() as u32).into_par_iter().filter_map(move |face| {
            let component = body.topology.component_of[face as usize];
            if component == u32::MAX {
                return None;
            }
            let corners = body.mesh.corners(face as usize).map(|p| map.point(p.as_dvec3()));
            let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let mut normal = cross.try_normalize()?;
            if map.is_mirrored() {
                normal = -normal;
            }
            Some(Face {
                key: plane_key(normal, corners[0], size),
                place,
                component,
                face,
                corners,
                normal,
            })
        })
    };
    let mut all: Vec<Face> = places.iter().flat_map(|p| faces(p).collect::<Vec<_>>()).collect();
    all.par_sort_unstable_by_key(|f| (f.key, f.place, f.component, f.face));
    all
}

/// A key that is the same for all triangles in one plane, whichever way they face.
fn plane_key(normal: DVec3, point: DVec3, size: f64) -> u64 {
    // The sign of the largest coordinate selects one of two opposite directions.
    let a = normal.abs();
    let largest = if a.x >= a.y && a.x >= a.z {
        normal.x
    } else if a.y >= a.z {
        normal.y
    } else {
        normal.z
    };
    let n = if largest > 0.0 { normal } else { -normal };
    // The offset keeps common round numbers away from the boundaries of the quantisation.
    let cut = |x: f64, step: f64| (x / step + 0.271_828).floor() as i64;
    let parts =
        [cut(n.x, 1e-4), cut(n.y, 1e-4), cut(n.z, 1e-4), cut(n.dot(point), size * SAME_PLANE)];
    parts.iter().fold(0x9e37_79b9_7f4a_7c15, |h: u64, &p| {
        let mixed = (h ^ p as u64).wrapping_mul(0xff51_afd7_ed55_8ccd);
        mixed ^ (mixed >> 32)
    })
}

/// The overlaps of the pieces in a plane; the second result is false if there were too many pairs
/// to compare.
fn overlaps(group: &[Face]) -> (BTreeMap<(Piece, Piece), Overlap>, bool) {
    let mut compared = 0;
    let mut found: BTreeMap<(Piece, Piece), Overlap> = BTreeMap::new();
    let axis = group[0].normal.abs();
    let flat = |p: DVec3| {
        if axis.x >= axis.y && axis.x >= axis.z {
            DVec2::new(p.y, p.z)
        } else if axis.y >= axis.z {
            DVec2::new(p.z, p.x)
        } else {
            DVec2::new(p.x, p.y)
        }
    };
    let flat: Vec<[DVec2; 3]> = group.iter().map(|f| f.corners.map(flat)).collect();
    let bounds = |t: &[DVec2; 3]| (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
    // The cells of the grid are about as large as the triangles, and so coarse that large triangles
    // do not fill the memory.
    let (low, high) = flat
        .iter()
        .map(bounds)
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let mut resolution = ((group.len() as f64).sqrt().ceil()).clamp(1.0, 2048.0);
    let cells_of = |t: &[DVec2; 3], resolution: f64| {
        let (a, b) = bounds(t);
        let touched = ((b - a) / (high - low).max(DVec2::splat(f64::MIN_POSITIVE)) * resolution
            + 1.0)
            .floor();
        touched.x * touched.y
    };
    while resolution > 1.0
        && flat.iter().map(|t| cells_of(t, resolution)).sum::<f64>() > CELLS * group.len() as f64
    {
        resolution = (resolution / 2.0).floor();
    }
    let cell = ((high - low) / resolution).max(DVec2::splat(f64::MIN_POSITIVE));
    let index = |p: DVec2| {
        ((p - low) / cell).floor().clamp(DVec2::ZERO, DVec2::splat(resolution - 1.0)).as_uvec2()
    };
    let mut cells: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
    for (i, triangle) in flat.iter().enumerate() {
        let (a, b) = bounds(triangle);
        let (a, b) = (index(a), index(b));
        for x in a.x..=b.x {
            for y in a.y..=b.y {
                cells.entry((x, y)).or_default().push(i as u32);
            }
        }
    }
    for (&(x, y), list) in &cells {
        for (k, &i) in list.iter().enumerate() {
            compared += list.len() - k;
            if compared > MAX_PAIRS || found.len() > MAX_FOUND {
                return (found, false);
            }
            for &j in &list[k + 1..] {
                let (f, g) = (&group[i as usize], &group[j as usize]);
                let (p, q) = ((f.place, f.component), (g.place, g.component));
                if p == q {
                    continue;
                }
                // A pair that shares several cells is counted in the first of them.
                let (a, b) = (bounds(&flat[i as usize]), bounds(&flat[j as usize]));
                let first = index(a.0.max(b.0));
                if (first.x, first.y) != (x, y) || a.0.cmpge(b.1).any() || b.0.cmpge(a.1).any() {
                    continue;
                }
                let area = common(&flat[i as usize], &flat[j as usize]);
                let least =
                    double_area(&flat[i as usize]).abs().min(double_area(&flat[j as usize]).abs())
                        * 0.5;
                if area <= least * 1e-2 {
                    continue;
                }
                let (f, g) = if p < q { (f, g) } else { (g, f) };
                let overlap = found.entry((p.min(q), p.max(q))).or_insert(Overlap {
                    area: 0.0,
                    faces: [f.face, g.face],
                    at: (f.corners[0] + f.corners[1] + f.corners[2]) / 3.0,
                    is_alike: f.normal.dot(g.normal) > 0.0,
                    count: 0,
                    normal: f.normal,
                });
                // Converts the area from the projection to the plane.
                overlap.area += area / axis.max_element();
                overlap.count += 1;
            }
        }
    }
    (found, true)
}

fn double_area(t: &[DVec2; 3]) -> f64 {
    (t[1] - t[0]).perp_dot(t[2] - t[0])
}

/// Area of the intersection of two triangles, by clipping one against the sides of the other
/// (Sutherland and Hodgman, Reentrant Polygon Clipping, 1974).
fn common(a: &[DVec2; 3], b: &[DVec2; 3]) -> f64 {
    let turn = double_area(b).signum();
    let mut polygon = a.to_vec();
    for k in 0..3 {
        let (from, to) = (b[k], b[(k + 1) % 3]);
        let side = |p: DVec2| (to - from).perp_dot(p - from) * turn;
        let mut clipped = Vec::with_capacity(polygon.len() + 1);
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (sp, sq) = (side(p), side(q));
            if sp >= 0.0 {
                clipped.push(p);
            }
            if (sp > 0.0 && sq < 0.0) || (sp < 0.0 && sq > 0.0) {
                clipped.push(p + (q - p) * (sp / (sp - sq)));
            }
        }
        polygon = clipped;
        if polygon.len() < 3 {
            return 0.0;
        }
    }
    (2..polygon.len())
        .map(|i| double_area(&[polygon[0], polygon[i - 1], polygon[i]]))
        .sum::<f64>()
        .abs()
        * 0.5
}

/// Adds a finding if the overlap is visible; true if it does.
fn tell(subject: &Subject, a: Piece, b: Piece, overlap: &Overlap, report: &mut Report) -> bool {
    let body = |piece: Piece| subject.body_of[piece.0 as usize].map(|b| &subject.bodies[b]);
    let (Some(first), Some(second)) = (body(a), body(b)) else { return false };
    let materials: [&Material; 2] = [
        subject.material_of_face(a.0 as usize, first.mesh, overlap.faces[0]),
        subject.material_of_face(b.0 as usize, second.mesh, overlap.faces[1]),
    ];
    let components =
        [&first.topology.components[a.1 as usize], &second.topology.components[b.1 as usize]];
    let closed = components.map(|c| c.is_closed());
    let insides = materials.map(bounds_inside);
    let scale = |place: u32| {
        real::powi(
            real::cbrt(subject.placed[place as usize].world_from_surface.determinant().abs()),
            2,
        )
    };
    let areas = [components[0].area * scale(a.0), components[1].area * scale(b.0)];
    let (severity, message, remedy) = if insides[0] && insides[1] {
        (
            Severity::Warning,
            "where two things with an inside meet, their faces lie in each other",
            "let one reach a little into the other, and give the other the higher priority",
        )
    } else if insides[0] || insides[1] {
        (
            Severity::Warning,
            "a face of glass or of a medium lies in a face of something else",
            "leave a small gap between them",
        )
    } else {
        let is_hidden = match closed {
            // The bodies are back to back, both behind their own faces, or one is inside the other.
            [true, true] => !overlap.is_alike,
            // A body that stands on a sheet hides the overlap. If the faces point the same way and
            // the sheet lies on the body for most of its area, it is a sticker, which is visible.
            [true, false] => !overlap.is_alike || overlap.area < 0.9 * areas[1],
            [false, true] => !overlap.is_alike || overlap.area < 0.9 * areas[0],
            [false, false] => false,
        };
        let is_same =
            std::ptr::eq(materials[0], materials[1]) && materials[0].textures().is_empty();
        let one_sided_apart =
            !overlap.is_alike && !materials[0].double_sided && !materials[1].double_sided;
        if is_hidden || one_sided_apart || is_same || !is_seen(subject, overlap) {
            return false;
        }
        (
            Severity::Warning,
            "faces of two objects lie in one plane: which of them is visible is undefined",
            "move one of them a little, or cut the other out there",
        )
    };
    let message = format!("{message} ({})", subject.name(b.0 as usize));
    let finding = report.add(severity, subject.name(a.0 as usize), message, remedy);
    (finding.face, finding.count) = (Some(overlap.faces[0]), overlap.count);
    finding.position = Some(overlap.at.to_array());
    true
}

/// False if there are cameras, and all of them see only the back of faces that face the same way.
fn is_seen(subject: &Subject, overlap: &Overlap) -> bool {
    let cameras = &subject.scene.cameras;
    !overlap.is_alike
        || cameras.is_empty()
        || cameras.iter().any(|c| (c.eye - overlap.at).dot(overlap.normal) > 0.0)
}
