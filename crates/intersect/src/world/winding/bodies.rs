//! Takes a mesh apart into bodies: triangles that are joined at edges.
//!
//! Corners at equal positions are one. First, triangles with an edge that no other triangle has are
//! taken off, again and again: they are open. A floor that shares edges with a box standing on it
//! is so separated from it, and a surface with a hole is taken off altogether. What is left is
//! closed, except for bodies with an edge of an odd number of triangles (a box with a wall inside).

use super::Triangles;
use rayon::prelude::*;
use snell_math::{Bounds3d, DVec3, DisjointSets};

/// Surfaces whose area vectors add up to more than this share of their area are sheets, which bound
/// nothing: the share is 0 for a closed surface, a half for half a sphere and 1 for a flat one.
const SHEET: f64 = 0.7;

/// A closed body.
#[derive(Clone, Copy, Debug)]
pub struct ClosedBody {
    /// True if as many triangles run along each edge in one direction as in the other.
    pub is_oriented: bool,
    /// The volume; negative for a body that is inside out.
    pub volume: f64,
    /// A corner of the body.
    pub corner: DVec3,
}

/// An open surface.
#[derive(Clone, Debug, Default)]
pub struct OpenPart {
    /// The triangles.
    pub triangles: Vec<u32>,
    /// The measures of the surface.
    pub extent: Extent,
}

/// Measures that tell whether a surface bounds something.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent {
    area: f64,
    area_vector: DVec3,
    /// The sum of the products of corner and area vector, three times the volume of the cone from
    /// the origin, with the origin near the surface.
    flux: f64,
    /// The sum of centres, weighted by area.
    center: DVec3,
}

impl Extent {
    fn add(&mut self, [a, b, c]: [DVec3; 3]) {
        let vector = (b - a).cross(c - a) * 0.5;
        let (area, center) = (vector.length(), (a + b + c) / 3.0);
        self.area += area;
        self.area_vector += vector;
        self.center += center * area;
        self.flux += center.dot(vector);
    }

    /// The measures of two surfaces together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            area: self.area + other.area,
            area_vector: self.area_vector + other.area_vector,
            flux: self.flux + other.flux,
            center: self.center + other.center,
        }
    }

    /// 1 if the surface bounds something and its normals point away from it, -1 if they point into
    /// it, and 0 for a sheet.
    pub fn side(&self) -> f64 {
        if self.area == 0.0 || self.area_vector.length() > SHEET * self.area {
            return 0.0;
        }
        let volume = self.flux - (self.center / self.area).dot(self.area_vector);
        if volume < 0.0 { -1.0 } else { 1.0 }
    }
}

/// A mesh taken apart.
#[derive(Clone, Debug, Default)]
pub struct Bodies {
    /// The closed bodies.
    pub closed: Vec<ClosedBody>,
    /// The triangles of closed bodies, each with the number of its body.
    pub triangles: Vec<(u32, u32)>,
    /// Open surfaces that bound something.
    pub open: Vec<OpenPart>,
    /// All other triangles, which do not bound anything by themselves.
    pub sheets: OpenPart,
}

/// The number of a triangle that belongs to nothing.
const NONE: u32 = u32::MAX;

impl Bodies {
    /// Takes a mesh with fewer than 2^31 triangles apart.
    pub fn of(mesh: &Triangles, bounds: &Bounds3d) -> Self {
        let edges = Edges::of(mesh);
        let is_open = edges.take_off();
        let mut sets = DisjointSets::new(mesh.len());
        for group in edges.groups() {
            let mut last = [NONE; 2];
            for triangle in group.iter().map(|e| e.triangle()) {
                let last = &mut last[usize::from(is_open[triangle as usize])];
                if *last != NONE {
                    sets.join(*last, triangle);
                }
                *last = triangle;
            }
        }
        let roots: Vec<u32> = (0..mesh.len() as u32).map(|i| sets.root(i)).collect();
        // For each root, whether an edge has an odd number of triangles, and whether all are
        // oriented.
        let mut is_odd = vec![false; mesh.len()];
        let mut is_turned = vec![false; mesh.len()];
        for group in edges.groups() {
            let closed = || group.iter().filter(|e| !is_open[e.triangle() as usize]);
            let Some(first) = closed().next() else { continue };
            let root = roots[first.triangle() as usize] as usize;
            is_odd[root] |= closed().count() % 2 == 1;
            is_turned[root] |= 2 * closed().filter(|e| e.is_backward()).count() != closed().count();
        }
        let middle = bounds.center();
        let mut this = Self::default();
        let mut body_of = vec![NONE; mesh.len()];
        let mut parts: Vec<OpenPart> = Vec::new();
        for triangle in (0..mesh.len()).filter(|&i| edges.is_sound[i]) {
            let root = roots[triangle] as usize;
            let corners = mesh.corners(triangle);
            if is_open[triangle] || is_odd[root] {
                if body_of[root] == NONE {
                    body_of[root] = parts.len() as u32;
                    parts.push(OpenPart::default());
                }
                let part = &mut parts[body_of[root] as usize];
                part.triangles.push(triangle as u32);
                part.extent.add(corners.map(|c| c - middle));
            } else {
                if body_of[root] == NONE {
                    body_of[root] = this.closed.len() as u32;
                    let corner = corners[0];
                    let is_oriented = !is_turned[root];
                    this.closed.push(ClosedBody { is_oriented, volume: 0.0, corner });
                }
                let body = &mut this.closed[body_of[root] as usize];
                let [a, b, c] = corners.map(|p| p - body.corner);
                body.volume += a.dot(b.cross(c)) / 6.0;
                this.triangles.push((triangle as u32, body_of[root]));
            }
        }
        for part in parts {
            if part.extent.side() == 0.0 {
                this.sheets.extent = this.sheets.extent.plus(&part.extent);
                this.sheets.triangles.extend(part.triangles);
            } else {
                this.open.push(part);
            }
        }
        this
    }
}

/// A triangle's edge: the numbers of its ends in ascending order, the triangle, and whether it runs
/// from the higher to the lower one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Edge(u64, u32);

impl Edge {
    fn triangle(self) -> u32 {
        self.1 >> 1
    }

    fn is_backward(self) -> bool {
        self.1 & 1 == 1
    }
}

/// The edges of a mesh, sorted.
struct Edges {
    edges: Vec<Edge>,
    /// Where the edges of each pair of ends begin, and the end.
    starts: Vec<u32>,
    /// False for triangles without three different, finite corners.
    is_sound: Vec<bool>,
}

impl Edges {
    fn of(mesh: &Triangles) -> Self {
        let numbers = welded(mesh);
        let faces: Vec<[u32; 3]> =
            mesh.indices().par_iter().map(|t| t.map(|i| numbers[i as usize])).collect();
        let is_sound: Vec<bool> = faces
            .par_iter()
            .map(|&[a, b, c]| a != NONE && b != NONE && c != NONE && a != b && b != c && c != a)
            .collect();
        let edge = |i: usize, k: usize| {
            let (a, b) = (faces[i][k], faces[i][(k + 1) % 3]);
            Edge(
                (u64::from(a.min(b)) << 32) | u64::from(a.max(b)),
                ((i as u32) << 1) | u32::from(a > b),
            )
        };
        let mut edges: Vec<Edge> = (0..faces.len())
            .into_par_iter()
            .filter(|&i| is_sound[i])
            .flat_map_iter(|i| (0..3).map(move |k| edge(i, k)))
            .collect();
        edges.par_sort_unstable();
        let mut starts: Vec<u32> = (0..edges.len())
            .filter(|&i| i == 0 || edges[i - 1].0 != edges[i].0)
            .map(|i| i as u32)
            .collect();
        starts.push(edges.len() as u32);
        Self { edges, starts, is_sound }
    }

    fn group(&self, number: usize) -> &[Edge] {
        &self.edges[self.starts[number] as usize..self.starts[number + 1] as usize]
    }

    /// The edges with the same ends, for each pair of ends.
    fn groups(&self) -> impl Iterator<Item = &[Edge]> {
        (0..self.starts.len() - 1).map(|i| self.group(i))
    }

    /// Takes off triangles with an edge that no other has, again and again. True for these.
    fn take_off(&self) -> Vec<bool> {
        let mut is_open = vec![false; self.is_sound.len()];
        let mut uses: Vec<u32> = self.groups().map(|g| g.len() as u32).collect();
        let mut single: Vec<u32> =
            (0..uses.len() as u32).filter(|&g| uses[g as usize] == 1).collect();
        if single.is_empty() {
            return is_open;
        }
        // The groups of each triangle's edges.
        let mut of = vec![[NONE; 3]; self.is_sound.len()];
        for (g, group) in self.groups().enumerate() {
            for edge in group {
                let slots = &mut of[edge.triangle() as usize];
                if let Some(slot) = slots.iter_mut().find(|s| **s == NONE) {
                    *slot = g as u32;
                }
            }
        }
        while let Some(group) = single.pop() {
            let left = |e: &&Edge| !is_open[e.triangle() as usize];
            let Some(edge) = self.group(group as usize).iter().find(left) else { continue };
            let triangle = edge.triangle() as usize;
            is_open[triangle] = true;
            for &g in &of[triangle] {
                let uses = &mut uses[g as usize];
                *uses -= 1;
                if *uses == 1 {
                    single.push(g);
                }
            }
        }
        is_open
    }
}

/// Numbers the vertices so that vertices at one position have the same number; [`NONE`] for
/// positions that are not finite.
fn welded(mesh: &Triangles) -> Vec<u32> {
    // Both signs of zero are one position.
    let bits = |x: f64| (x + 0.0).to_bits();
    let mut keys: Vec<([u64; 3], u32)> = (0..mesh.vertex_count())
        .into_par_iter()
        .map(|i| (mesh.position(i).to_array().map(bits), i as u32))
        .collect();
    keys.par_sort_unstable();
    let mut numbers = vec![NONE; keys.len()];
    let mut first = 0;
    for (i, &(key, number)) in keys.iter().enumerate() {
        if i == 0 || keys[i - 1].0 != key {
            first = number;
        }
        if mesh.position(number as usize).is_finite() {
            numbers[number as usize] = first;
        }
    }
    numbers
}
