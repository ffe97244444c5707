//! Vertex normals for meshes without any.
//!
//! Around a vertex, two triangles that share an edge belong together if the edge is not sharp. Each
//! such group of triangles gets the angle-weighted mean of their normals (Thürmer and Wüthrich,
//! "Computing Vertex Normals from Polygonal Facets", 1998), and a vertex with several groups is
//! split. So balls look round and boxes keep their edges.
//!
//! The work runs on all cores with little memory: the corners that meet at a point are listed for
//! one range of points at a time ([`corners`](super::corners)), and a triangle's normal and angle
//! are recomputed at each of its corners. The result does not depend on the number of threads.

use super::corners::Corners;
use super::weld;
use rayon::prelude::*;
use snell_intersect::TriangleMesh;
use snell_math::{DisjointSets, Vec3, real};

/// Edges at which faces meet at more than this are sharp, in degrees.
pub const CREASE_ANGLE: f32 = 40.0;

/// No group.
const NONE: u32 = u32::MAX;

/// Points that one thread works on at a time.
const BLOCK: usize = 1 << 12;

/// How the edges of a face are judged sharp or smooth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Smoothing {
    /// An edge is smooth if its faces meet at less than the crease angle.
    Angle,
    /// Every edge of the face is sharp: the face is flat.
    Flat,
    /// Edges to faces of the same group are smooth, all others sharp.
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

/// Computes vertex normals, splitting vertices at edges sharper than `crease_degrees`. Vertices at
/// equal positions count as one, so seams of texture coordinates stay smooth. `smoothing` has one
/// entry per triangle, or is empty: then angles decide.
pub fn smooth(mesh: &mut TriangleMesh, crease_degrees: f32, smoothing: &[Smoothing]) {
    if mesh.indices.is_empty() {
        return;
    }
    // Vertices that only degenerate triangles use, or none, keep `+z`.
    let mut normals = vec![Vec3::Z; mesh.positions.len()];
    let points = weld::points(&mesh.positions, &mesh.indices);
    let facets = Facets::new(mesh, &points, crease_degrees, smoothing);
    let mut corners = Corners::count(&mesh.indices, &points);
    let mut splits = Vec::new();
    for range in corners.parts() {
        let part = corners.of_points(&mesh.indices, &points, range.clone());
        let blocks =
            normals[range.clone()].par_chunks_mut(BLOCK).enumerate().map(|(block, normals)| {
                let first = range.start + block * BLOCK;
                let mut around = Around::default();
                for (i, normal) in normals.iter_mut().enumerate() {
                    if let Some(mean) = around.group(&facets, part.around(first + i)) {
                        *normal = mean;
                    }
                }
                around.split
            });
        splits.extend(blocks.collect::<Vec<_>>());
    }
    for (vertex, &point) in
        points.iter().enumerate().filter(|(vertex, point)| *vertex != **point as usize)
    {
        normals[vertex] = normals[point as usize];
    }
    drop((points, corners));
    mesh.normals = normals;
    splits.into_iter().for_each(|split| split.apply(mesh));
}

/// The triangles, and the criterion that groups them.
struct Facets<'a> {
    positions: &'a [Vec3],
    indices: &'a [[u32; 3]],
    points: &'a [u32],
    smoothing: &'a [Smoothing],
    crease_cosine: f32,
    /// Cosine of half the crease angle: two normals that are both this close to a third are within
    /// the crease angle of each other.
    half_cosine: f32,
}

impl<'a> Facets<'a> {
    fn new(
        mesh: &'a TriangleMesh,
        points: &'a [u32],
        crease_degrees: f32,
        smoothing: &'a [Smoothing],
    ) -> Self {
        let crease = crease_degrees.to_radians();
        let (crease_cosine, half_cosine) = (real::cos(crease), real::cos(crease / 2.0));
        let (positions, indices) = (&mesh.positions[..], &mesh.indices[..]);
        Self { positions, indices, points, smoothing, crease_cosine, half_cosine }
    }

    /// The corner with this number, as seen from its point; `None` for corners of triangles without
    /// a normal, which are ignored.
    fn corner(&self, number: u32) -> Option<Corner> {
        let (triangle, k) = (number as usize / 3, number as usize % 3);
        let vertices = [0, 1, 2].map(|i| self.indices[triangle][(k + i) % 3]);
        let (normal, angle) = facet(vertices.map(|v| self.positions[v as usize]))?;
        let smoothing = self.smoothing.get(triangle).copied().unwrap_or(Smoothing::Angle);
        Some(Corner { number, vertex: vertices[0], normal, weighted: normal * angle, smoothing })
    }

    /// The points that a corner's edges lead to.
    fn neighbours(&self, corner: &Corner) -> [u32; 2] {
        let (triangle, k) = (corner.number as usize / 3, corner.number as usize % 3);
        [1, 2].map(|i| self.points[self.indices[triangle][(k + i) % 3] as usize])
    }

    fn joins(&self, a: &Corner, b: &Corner) -> bool {
        a.smoothing.joins(b.smoothing, a.normal.dot(b.normal), self.crease_cosine)
    }

    /// Fast path for the common case: all normals are close to the first, or all corners are in its
    /// smoothing group.
    fn all_join(&self, first: &Corner, corners: &[Corner]) -> bool {
        if first.smoothing == Smoothing::Flat {
            return corners.len() == 1;
        }
        corners.iter().all(|corner| {
            let close = corner.normal.dot(first.normal) >= self.half_cosine;
            corner.smoothing == first.smoothing && (first.smoothing != Smoothing::Angle || close)
        })
    }
}

/// Height of a triangle, relative to its largest coordinate, below which its normal is only
/// rounding error of its corners.
const LEAST_HEIGHT: f64 = 1e-6;

/// Unit normal of a triangle and the angle at its first corner, computed in double precision so
/// that tiny triangles have normals too. `None` for slivers.
fn facet(corners: [Vec3; 3]) -> Option<(Vec3, f32)> {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (ab, ac) = (b - a, c - a);
    let cross = ab.cross(ac);
    let longest_squared =
        ab.length_squared().max(ac.length_squared()).max((c - b).length_squared());
    let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
    let (squared, least) = (cross.length_squared(), LEAST_HEIGHT * largest);
    if !(squared > least * least * longest_squared && squared.is_normal()) {
        return None;
    }
    let length = squared.sqrt();
    Some(((cross * length.recip()).as_vec3(), angle(length, ab.dot(ac)) as f32))
}

/// The angle between two vectors, 0 to pi, from the length of their cross product and their dot
/// product. Its error is below 3e-8: the polynomial is number 4.4.49 of Abramowitz and Stegun,
/// "Handbook of Mathematical Functions", 1964.
fn angle(cross: f64, dot: f64) -> f64 {
    use std::f64::consts::{FRAC_PI_2, PI};
    const SERIES: [f64; 9] = [
        0.002_866_225_7,
        -0.016_165_736_7,
        0.042_909_613_8,
        -0.075_289_64,
        0.106_562_639_3,
        -0.142_088_994_4,
        0.199_935_508_5,
        -0.333_331_452_8,
        1.0,
    ];
    let (less, more) = (cross.min(dot.abs()), cross.max(dot.abs()));
    let tangent = less / more;
    let square = tangent * tangent;
    let arc = tangent * SERIES.iter().fold(0.0, |sum, c| sum * square + c);
    let acute = if cross > dot.abs() { FRAC_PI_2 - arc } else { arc };
    if dot < 0.0 { PI - acute } else { acute }
}

/// A corner of a triangle that has a normal.
struct Corner {
    /// Number of the corner: 3 times the triangle plus 0, 1 or 2.
    number: u32,
    vertex: u32,
    normal: Vec3,
    /// The normal times the angle of the triangle at this corner.
    weighted: Vec3,
    smoothing: Smoothing,
}

/// Changes where one normal per point is not enough. New vertices are numbered from 0.
#[derive(Default)]
struct Split {
    /// Normals of vertices whose point has several normals.
    kept: Vec<(u32, Vec3)>,
    /// New vertices: copies of others, with normals of their own.
    added: Vec<(u32, Vec3)>,
    /// Corners that get a new vertex, each with the number of this vertex.
    moved: Vec<(u32, u32)>,
}

impl Split {
    fn apply(self, mesh: &mut TriangleMesh) {
        let first = mesh.positions.len() as u32;
        let sources = || self.added.iter().map(|(source, _)| *source);
        extend(&mut mesh.positions, sources());
        extend(&mut mesh.exact, sources());
        extend(&mut mesh.colors, sources());
        extend(&mut mesh.tangents, sources());
        mesh.uvs.iter_mut().for_each(|uvs| extend(uvs, sources()));
        self.kept.iter().for_each(|(vertex, normal)| mesh.normals[*vertex as usize] = *normal);
        mesh.normals.extend(self.added.iter().map(|(_, normal)| *normal));
        for (corner, vertex) in self.moved {
            mesh.indices[corner as usize / 3][corner as usize % 3] = first + vertex;
        }
    }
}

/// Appends copies of the values at `sources`, unless the attribute is absent.
fn extend<T: Copy>(values: &mut Vec<T>, sources: impl ExactSizeIterator<Item = u32>) {
    if !values.is_empty() {
        values.reserve(sources.len());
        sources.for_each(|i| values.push(values[i as usize]));
    }
}

/// Groups the corners around one point after another. All but `split` is scratch memory.
#[derive(Default)]
struct Around {
    split: Split,
    corners: Vec<Corner>,
    /// For each edge, the point at its other end and the corner that has the edge, by the corner's
    /// place in `corners`.
    edges: Vec<(u32, u32)>,
    /// Corners that are in the same group.
    sets: DisjointSets,
    /// The group of each corner; filled by [`Self::number_groups`].
    group: Vec<u32>,
    /// Normals of the groups.
    means: Vec<Vec3>,
    /// Vertex, group and number of each corner.
    users: Vec<(u32, u32, u32)>,
}

impl Around {
    /// Returns the normal of a point's first group, which all of its vertices have except those in
    /// `split`. `None` if no triangle at the point has a normal.
    fn group(&mut self, facets: &Facets, corners: impl Iterator<Item = u32>) -> Option<Vec3> {
        self.corners.clear();
        self.corners.extend(corners.filter_map(|corner| facets.corner(corner)));
        // Sums must not depend on the order of the threads.
        self.corners.sort_unstable_by_key(|corner| corner.number);
        if facets.all_join(self.corners.first()?, &self.corners) {
            return Some(upright(self.corners.iter().map(|corner| corner.weighted).sum()));
        }
        self.join_across_edges(facets);
        self.number_groups();
        self.split_vertices();
        Some(self.means[0])
    }

    fn join_across_edges(&mut self, facets: &Facets) {
        self.edges.clear();
        self.sets.reset(self.corners.len());
        for (i, corner) in self.corners.iter().enumerate() {
            self.edges.extend(facets.neighbours(corner).map(|point| (point, i as u32)));
        }
        self.edges.sort_unstable();
        for e in 1..self.edges.len() {
            let ((point, a), (other, b)) = (self.edges[e - 1], self.edges[e]);
            if point == other && facets.joins(&self.corners[a as usize], &self.corners[b as usize])
            {
                self.sets.join(a, b);
            }
        }
    }

    /// Numbers the groups in the order of their first corners, which are the roots of the groups.
    fn number_groups(&mut self) {
        self.group.clear();
        self.means.clear();
        for i in 0..self.corners.len() {
            let root = self.sets.root(i as u32) as usize;
            if root == i {
                self.group.push(self.means.len() as u32);
                self.means.push(Vec3::ZERO);
            } else {
                self.group.push(self.group[root]);
            }
            self.means[self.group[i] as usize] += self.corners[i].weighted;
        }
        self.means.iter_mut().for_each(|mean| *mean = upright(*mean));
    }

    /// Makes new vertices: each vertex stays with its first group, and gets a copy for every other
    /// group.
    fn split_vertices(&mut self) {
        self.users.clear();
        self.users.extend(
            self.corners.iter().zip(&self.group).map(|(c, group)| (c.vertex, *group, c.number)),
        );
        self.users.sort_unstable();
        let Split { kept, added, moved } = &mut self.split;
        let (mut before, mut keeps) = ((NONE, NONE), true);
        for &(vertex, group, corner) in &self.users {
            if before != (vertex, group) {
                keeps = before.0 != vertex;
                let list = if keeps { &mut *kept } else { &mut *added };
                list.push((vertex, self.means[group as usize]));
                before = (vertex, group);
            }
            if !keeps {
                moved.push((corner, added.len() as u32 - 1));
            }
        }
    }
}

/// The unit vector of a sum of normals; `+z` where the normals cancel.
fn upright(sum: Vec3) -> Vec3 {
    sum.try_normalize().unwrap_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_library() {
        for i in 1..1000 {
            let expected = f64::from(i) * std::f64::consts::PI / 1000.0;
            assert!(
                (angle(3.0 * expected.sin(), 3.0 * expected.cos()) - expected).abs() < 3e-8,
                "{expected}"
            );
        }
    }

    /// A sheet in folds, partly as loose triangles: smooth and sharp vertices, vertices that share
    /// a position, and a sliver.
    fn sheet(side: u32) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for i in 0..side * side {
            let (x, y) = ((i % side) as f32, (i / side) as f32);
            mesh.positions.push(Vec3::new(
                x,
                y,
                if i % 7 == 0 { 1.5 } else { 0.1 * (x * 0.3).sin() },
            ));
        }
        for i in (0..side * (side - 1)).filter(|i| i % side < side - 1) {
            mesh.indices.extend([
                [i, i + 1, i + side],
                [i + 1, i + side + 1, i + side],
                [i, i, i + 1],
            ]);
        }
        for triangle in mesh.indices.iter_mut().skip(300) {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(triangle.map(|i| mesh.positions[i as usize]));
            *triangle = [first, first + 1, first + 2];
        }
        mesh
    }

    fn smoothed(mut mesh: TriangleMesh, threads: usize) -> TriangleMesh {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| smooth(&mut mesh, CREASE_ANGLE, &[]));
        mesh
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let mesh = sheet(90);
        let alone = smoothed(mesh.clone(), 1);
        for threads in [2, 5] {
            let together = smoothed(mesh.clone(), threads);
            assert_eq!(together.indices, alone.indices);
            let bits = |mesh: &TriangleMesh| {
                mesh.normals.iter().flat_map(|n| n.to_array().map(f32::to_bits)).collect()
            };
            let (a, b): (Vec<u32>, Vec<u32>) = (bits(&together), bits(&alone));
            assert!(a == b && together.positions == alone.positions);
        }
    }

    #[test]
    fn normals_are_the_means_by_angle_of_the_faces_that_are_near() {
        let mesh = smoothed(sheet(20), 3);
        let face = |t: usize, k: usize| {
            let corners = mesh.indices[t].map(|i| mesh.positions[i as usize]);
            let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
            let (u, v) = ((b - a).normalize_or_zero(), (c - a).normalize_or_zero());
            (u.cross(v).normalize_or_zero(), u.dot(v).clamp(-1.0, 1.0).acos())
        };
        let corners: Vec<_> =
            (0..mesh.indices.len()).flat_map(|t| (0..3).map(move |k| (t, k))).collect();
        for &(t, k) in corners.iter().filter(|(t, k)| face(*t, *k).0 != Vec3::ZERO) {
            let vertex = mesh.indices[t][k] as usize;
            // All faces at this place whose corners got the same normal must be one group.
            let here = corners.iter().filter(|(t, k)| {
                let other = mesh.indices[*t][*k] as usize;
                mesh.positions[other] == mesh.positions[vertex]
                    && mesh.normals[other] == mesh.normals[vertex]
            });
            let sum: Vec3 = here.map(|&(t, k)| face(t, k).0 * face(t, k).1).sum();
            assert!(sum.normalize().dot(mesh.normals[vertex]) > 0.9999, "{t} {k}");
        }
    }
}
