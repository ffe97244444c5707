//! Vertex normals for meshes that come without.
//!
//! Around a vertex, two triangles that share an edge belong together if the edge is not sharp. Each such group of triangles gets
//! the angle-weighted mean of their normals (Thürmer and Wüthrich, "Computing Vertex Normals from Polygonal Facets", 1998), and a
//! vertex with several groups is split. So balls look round and boxes keep their edges.

use super::weld::Welder;
use rayon::prelude::*;
use snell_intersect::TriangleMesh;
use snell_math::Vec3;
use std::collections::HashMap;

/// Edges at which faces meet at more than this are sharp, in degrees.
pub const CREASE_ANGLE: f32 = 40.0;

/// No group.
const NONE: u32 = u32::MAX;

/// What decides whether an edge is sharp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Smoothing {
    /// The angle between the faces.
    Angle,
    /// Always sharp: the face is flat.
    Flat,
    /// Smooth among faces of the same group, sharp to others.
    Group(u32),
}

impl Smoothing {
    fn joins(self, other: Self, cosine: f32, crease_cosine: f32) -> bool {
        match (self, other) {
            (Self::Angle, Self::Angle) => cosine >= crease_cosine,
            (Self::Group(a), Self::Group(b)) => a == b,
            _ => false,
        }
    }
}

/// Gives a mesh vertex normals, splitting vertices at edges sharper than `crease_degrees`. Vertices at equal positions count as
/// one, so seams of texture coordinates stay smooth. `smoothing` has one entry per triangle, or none: then angles decide.
pub fn smooth(mesh: &mut TriangleMesh, crease_degrees: f32, smoothing: &[Smoothing]) {
    if mesh.indices.is_empty() {
        return;
    }
    let facets = Facets::of(mesh, crease_degrees, smoothing);
    let mut group_of_corner = vec![NONE; mesh.indices.len() * 3];
    let mut normals = Vec::new();
    let mut around = Around::default();
    for corners in facets.corners_by_point() {
        around.group(&facets, corners, &mut group_of_corner, &mut normals);
    }
    split(mesh, &group_of_corner, &normals);
}

/// The triangles with what grouping needs to know.
struct Facets<'a> {
    /// Welded vertices of each triangle.
    points: Vec<[u32; 3]>,
    /// Unit normals; zero where there is none.
    normals: Vec<Vec3>,
    smoothing: &'a [Smoothing],
    crease_cosine: f32,
    /// Cosine of half the crease angle: normals this close to one of them are within the crease angle of each other.
    half_cosine: f32,
    /// Angles at the corners.
    angles: Vec<[f32; 3]>,
    /// Corner numbers (3 times triangle plus corner) sorted by welded vertex.
    corners: Vec<u32>,
    /// Where each welded vertex's corners end.
    ends: Vec<u32>,
}

impl<'a> Facets<'a> {
    fn of(mesh: &TriangleMesh, crease_degrees: f32, smoothing: &'a [Smoothing]) -> Self {
        let mut welder = Welder::with_capacity(mesh.positions.len());
        let welded: Vec<u32> = mesh.positions.iter().map(|&p| welder.weld(p)).collect();
        let points: Vec<[u32; 3]> = mesh.indices.iter().map(|t| t.map(|i| welded[i as usize])).collect();
        let crease = crease_degrees.to_radians();
        let (normals, angles): (Vec<_>, _) =
            (0..mesh.indices.len()).into_par_iter().map(|t| facet(mesh.corners(t))).unzip();
        let (corners, ends) = sorted_corners(&points, &normals, welder.len());
        let (crease_cosine, half_cosine) = (crease.cos(), (crease / 2.0).cos());
        Self { points, normals, smoothing, crease_cosine, half_cosine, angles, corners, ends }
    }

    fn corners_by_point(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.corners[start as usize..end as usize])
    }

    fn smoothing(&self, triangle: usize) -> Smoothing {
        self.smoothing.get(triangle).copied().unwrap_or(Smoothing::Angle)
    }

    fn joins(&self, a: u32, b: u32) -> bool {
        let (a, b) = (a as usize / 3, b as usize / 3);
        let cosine = self.normals[a].dot(self.normals[b]);
        self.smoothing(a).joins(self.smoothing(b), cosine, self.crease_cosine)
    }
}

/// Height of a triangle, as a share of its largest coordinate, below which its normal is but rounding of its corners.
const LEAST_HEIGHT: f64 = 1e-6;

/// Unit normal and corner angles of a triangle, in double precision inside: tiny triangles have normals too. Zero for slivers.
fn facet(corners: [Vec3; 3]) -> (Vec3, [f32; 3]) {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let cross = (b - a).cross(c - a);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
    let is_proper = cross.length() > LEAST_HEIGHT * largest * longest;
    let Some(normal) = cross.try_normalize().filter(|_| is_proper) else { return (Vec3::ZERO, [0.0; 3]) };
    let edges = [(b - a), (c - b), (a - c)].map(|e| e.normalize_or_zero());
    let angle = |before: usize, after: usize| (-edges[before]).dot(edges[after]).clamp(-1.0, 1.0).acos() as f32;
    (normal.as_vec3(), [angle(2, 0), angle(0, 1), angle(1, 2)])
}

/// Counting sort of the corners by point. Triangles without a normal have no say: their corners are left out.
fn sorted_corners(points: &[[u32; 3]], normals: &[Vec3], count: usize) -> (Vec<u32>, Vec<u32>) {
    let corners_with_points = || {
        let proper = points.iter().zip(normals).enumerate().filter(|(_, (_, n))| **n != Vec3::ZERO);
        proper.flat_map(|(t, (points, _))| (0..3).map(move |k| (3 * t as u32 + k as u32, points[k])))
    };
    let mut ends = vec![0u32; count];
    for (_, point) in corners_with_points() {
        ends[point as usize] += 1;
    }
    let mut start = 0;
    for end in &mut ends {
        let number = *end;
        *end = start;
        start += number;
    }
    let mut corners = vec![0u32; start as usize];
    for (corner, point) in corners_with_points() {
        let at = &mut ends[point as usize];
        corners[*at as usize] = corner;
        *at += 1;
    }
    (corners, ends)
}

/// Scratch memory for grouping the corners around a point.
#[derive(Default)]
struct Around {
    /// Other end of an edge, and the corner (by place around the point) that has it.
    edges: Vec<(u32, u32)>,
    parents: Vec<u32>,
    group: Vec<u32>,
}

impl Around {
    /// Numbers the groups of a point's corners and appends their normals.
    fn group(&mut self, facets: &Facets, corners: &[u32], group_of_corner: &mut [u32], normals: &mut Vec<Vec3>) {
        let weighted = |corner: u32| {
            let (triangle, k) = (corner as usize / 3, corner as usize % 3);
            facets.normals[triangle] * facets.angles[triangle][k]
        };
        let Some(&first) = corners.first() else { return };
        if Self::all_join(facets, first, corners) {
            let sum: Vec3 = corners.iter().map(|&c| weighted(c)).sum();
            corners.iter().for_each(|&c| group_of_corner[c as usize] = normals.len() as u32);
            normals.push(sum.normalize_or_zero());
            return;
        }
        self.join_across_edges(facets, corners);
        self.group.clear();
        self.group.resize(corners.len(), NONE);
        let base = normals.len();
        for (i, &corner) in corners.iter().enumerate() {
            let root = self.root(i as u32) as usize;
            if self.group[root] == NONE {
                self.group[root] = normals.len() as u32;
                normals.push(Vec3::ZERO);
            }
            group_of_corner[corner as usize] = self.group[root];
            normals[self.group[root] as usize] += weighted(corner);
        }
        normals[base..].iter_mut().for_each(|n| *n = n.normalize_or_zero());
    }

    /// The common case, decided quickly: all normals close to the first, or all in its smoothing group.
    fn all_join(facets: &Facets, first: u32, corners: &[u32]) -> bool {
        let first = first as usize / 3;
        let smoothing = facets.smoothing(first);
        if smoothing == Smoothing::Flat {
            return corners.len() == 1;
        }
        corners.iter().all(|&c| {
            let triangle = c as usize / 3;
            let close = facets.normals[triangle].dot(facets.normals[first]) >= facets.half_cosine;
            facets.smoothing(triangle) == smoothing && (smoothing != Smoothing::Angle || close)
        })
    }

    fn join_across_edges(&mut self, facets: &Facets, corners: &[u32]) {
        self.edges.clear();
        self.parents.clear();
        self.parents.extend(0..corners.len() as u32);
        for (i, &corner) in corners.iter().enumerate() {
            let (triangle, k) = (corner as usize / 3, corner as usize % 3);
            let points = facets.points[triangle];
            self.edges.push((points[(k + 1) % 3], i as u32));
            self.edges.push((points[(k + 2) % 3], i as u32));
        }
        self.edges.sort_unstable();
        for e in 1..self.edges.len() {
            let ((point, a), (other, b)) = (self.edges[e - 1], self.edges[e]);
            if point == other && facets.joins(corners[a as usize], corners[b as usize]) {
                let (a, b) = (self.root(a), self.root(b));
                self.parents[a.max(b) as usize] = a.min(b);
            }
        }
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.parents[i as usize] != i {
            let grandparent = self.parents[self.parents[i as usize] as usize];
            self.parents[i as usize] = grandparent;
            i = grandparent;
        }
        i
    }
}

/// Makes one vertex of each pair of vertex and group. Vertices that no proper triangle uses get `+z`.
fn split(mesh: &mut TriangleMesh, group_of_corner: &[u32], normals: &[Vec3]) {
    let mut group_of = vec![NONE; mesh.positions.len()];
    // Vertices of further groups by old vertex and group. Looked up only.
    let mut further: HashMap<(u32, u32), u32> = HashMap::new();
    let mut sources: Vec<u32> = Vec::new();
    for (index, &group) in mesh.indices.iter_mut().flatten().zip(group_of_corner) {
        let own = &mut group_of[*index as usize];
        if *own == NONE {
            *own = group;
        }
        if *own != group && group != NONE {
            let old = *index;
            *index = *further.entry((old, group)).or_insert_with(|| {
                group_of.push(group);
                sources.push(old);
                group_of.len() as u32 - 1
            });
        }
    }
    extend(&mut mesh.positions, &sources);
    extend(&mut mesh.colors, &sources);
    extend(&mut mesh.tangents, &sources);
    mesh.uvs.iter_mut().for_each(|uvs| extend(uvs, &sources));
    let normal = |group: u32| normals.get(group as usize).copied().filter(|&n| n != Vec3::ZERO).unwrap_or(Vec3::Z);
    mesh.normals = group_of.into_iter().map(normal).collect();
}

/// Appends copies of the values at `sources`, unless the attribute is absent.
fn extend<T: Copy>(values: &mut Vec<T>, sources: &[u32]) {
    if !values.is_empty() {
        values.reserve(sources.len());
        sources.iter().for_each(|&i| values.push(values[i as usize]));
    }
}
