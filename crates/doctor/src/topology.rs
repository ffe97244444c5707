//! The topology of a mesh.
//!
//! Vertices in one place are one vertex, whatever their numbers: readers split them where normals
//! or texture coordinates differ. Edges are found by sorting, which uses all cores and is fast for
//! millions of triangles.

use rayon::prelude::*;
use snell_intersect::TriangleMesh;
use snell_math::glam::Vec3Swizzles;
use snell_math::{Bounds3, DVec3, DisjointSets, Vec3};

/// A face that is the copy of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Duplicate {
    /// Number of the face that is the copy.
    pub face: u32,
    /// Number of the face that is copied.
    pub of: u32,
    /// True if both have the same winding; false if they are back to back.
    pub has_same_winding: bool,
}

/// A connected component: triangles that share edges, directly or through others.
#[derive(Clone, Debug)]
pub struct Component {
    /// Number of the first face of the component.
    pub first_face: u32,
    /// Number of faces.
    pub faces: u32,
    /// Number of edges with one face only.
    pub boundary_edges: u32,
    /// Number of edges whose two faces go along them in the same direction.
    pub inconsistent_edges: u32,
    /// Number of faces whose vertex normals all point to the side opposite to their winding.
    pub faces_against_normals: u32,
    /// Sum of the areas of the faces.
    pub area: f64,
    /// Sum of the area vectors of the faces: zero for closed surfaces.
    pub vector_area: DVec3,
    /// Signed volume; negative for a closed surface that is inside out.
    pub volume: f64,
    /// The box around the component.
    pub bounds: Bounds3,
}

impl Component {
    /// True if every edge has a face on either side.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// The openness of the component: 0 for closed surfaces, 1 for a flat sheet.
    pub fn openness(&self) -> f64 {
        if self.area > 0.0 { self.vector_area.length() / self.area } else { 0.0 }
    }
}

/// An edge of one face only, in the direction of that face.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryEdge {
    /// Number of the face.
    pub face: u32,
    /// The ends of the edge.
    pub ends: [Vec3; 2],
}

/// The topology of a mesh, independent of its material.
#[derive(Clone, Debug, Default)]
pub struct Topology {
    /// Faces without an area.
    pub degenerate: Vec<u32>,
    /// Faces with a vertex that is not finite.
    pub non_finite: Vec<u32>,
    /// Copies of other faces.
    pub duplicates: Vec<Duplicate>,
    /// Edges of one face only.
    pub boundary: Vec<BoundaryEdge>,
    /// The first face of each edge that more than two faces share, unless as many of them run along
    /// it in one direction as in the other.
    pub non_manifold: Vec<u32>,
    /// A face of each edge whose two faces are wound differently.
    pub inconsistent: Vec<u32>,
    /// Connected components.
    pub components: Vec<Component>,
    /// The component of each face; `u32::MAX` for faces that are ignored.
    pub component_of: Vec<u32>,
}

/// The component of ignored faces.
const NONE: u32 = u32::MAX;

/// True if three points lie on a line within rounding. The test does not compare the area with the
/// length: a face may be as thin as its coordinates allow, and rays still hit it.
fn is_on_a_line([a, b, c]: [DVec3; 3]) -> bool {
    const ROUNDING: f64 = 4.0 * f64::EPSILON;
    let (u, v) = (b - a, c - a);
    let (first, second) = (u.yzx() * v.zxy(), u.zxy() * v.yzx());
    (first - second).abs().cmple((first.abs() + second.abs()) * ROUNDING).all()
}

/// Numbers the vertices so that vertices at one position have the same number.
fn welded(mesh: &TriangleMesh) -> Vec<u32> {
    // Both signs of zero are one position.
    let bits = |x: f32| u128::from((x + 0.0).to_bits());
    let key = |(i, p): (usize, &Vec3)| {
        (bits(p.x) << 96) | (bits(p.y) << 64) | (bits(p.z) << 32) | i as u128
    };
    let mut keys: Vec<u128> = mesh.positions.par_iter().enumerate().map(key).collect();
    keys.par_sort_unstable();
    let mut numbers = vec![0; keys.len()];
    let mut first = 0;
    for (i, key) in keys.iter().enumerate() {
        if i == 0 || (keys[i - 1] >> 32) != (key >> 32) {
            first = *key as u32;
        }
        numbers[*key as u32 as usize] = first;
    }
    numbers
}

/// Rotates three numbers so that the smallest comes first, in cyclic order.
fn rotated([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

impl Topology {
    /// The topology of a valid mesh with fewer than 2³¹ triangles.
    pub fn of(mesh: &TriangleMesh) -> Self {
        let mut this = Self::default();
        let numbers = welded(mesh);
        let faces: Vec<[u32; 3]> =
            mesh.indices.par_iter().map(|t| t.map(|i| numbers[i as usize])).collect();
        let mut counts = this.sort_out(mesh, &faces);
        this.find_duplicates(&faces, &mut counts);
        let mut sets = DisjointSets::new(faces.len());
        let (boundary, inconsistent) = this.find_edges(mesh, &faces, &counts, &mut sets);
        this.find_components(mesh, &counts, sets);
        for face in boundary {
            this.components[this.component_of[face as usize] as usize].boundary_edges += 1;
        }
        for face in inconsistent {
            this.components[this.component_of[face as usize] as usize].inconsistent_edges += 1;
            this.inconsistent.push(face);
        }
        this
    }

    /// Records degenerate and non-finite faces. The result is true for faces that connect their
    /// neighbours.
    fn sort_out(&mut self, mesh: &TriangleMesh, faces: &[[u32; 3]]) -> Vec<bool> {
        #[derive(Clone, Copy, PartialEq)]
        enum Kind {
            Sound,
            Flat,
            NonFinite,
        }
        let kind = |(i, [a, b, c]): (usize, &[u32; 3])| {
            let corners = mesh.corners(i).map(|p| p.as_dvec3());
            if !corners.iter().all(|p| p.is_finite()) {
                return Kind::NonFinite;
            }
            if a == b || b == c || c == a {
                return Kind::Flat;
            }
            if is_on_a_line(corners) { Kind::Flat } else { Kind::Sound }
        };
        let kinds: Vec<Kind> = faces.par_iter().enumerate().map(kind).collect();
        let all_of = |kind: Kind| {
            (0..faces.len()).filter(|&i| kinds[i] == kind).map(|i| i as u32).collect::<Vec<u32>>()
        };
        (self.degenerate, self.non_finite) = (all_of(Kind::Flat), all_of(Kind::NonFinite));
        // A degenerate face still connects its neighbours.
        let holds = |(kind, [a, b, c]): (&Kind, &[u32; 3])| {
            *kind != Kind::NonFinite && a != b && b != c && c != a
        };
        kinds.iter().zip(faces).map(holds).collect()
    }

    fn find_duplicates(&mut self, faces: &[[u32; 3]], counts: &mut [bool]) {
        let sorted = |mut t: [u32; 3]| {
            t.sort_unstable();
            t
        };
        let mut keys: Vec<([u32; 3], u32)> = (0..faces.len() as u32)
            .into_par_iter()
            .filter(|&i| counts[i as usize])
            .map(|i| (sorted(faces[i as usize]), i))
            .collect();
        keys.par_sort_unstable();
        for group in keys.chunk_by(|a, b| a.0 == b.0).filter(|g| g.len() > 1) {
            let of = group[0].1;
            for &(_, face) in &group[1..] {
                let has_same_winding = rotated(faces[face as usize]) == rotated(faces[of as usize]);
                self.duplicates.push(Duplicate { face, of, has_same_winding });
                counts[face as usize] = false;
            }
        }
        self.duplicates.sort_unstable_by_key(|d| d.face);
    }

    /// Joins faces over edges; returns a face for each boundary edge, and for each edge with
    /// inconsistent winding.
    fn find_edges(
        &mut self,
        mesh: &TriangleMesh,
        faces: &[[u32; 3]],
        counts: &[bool],
        sets: &mut DisjointSets,
    ) -> (Vec<u32>, Vec<u32>) {
        let edge = |i: u32, k: usize| {
            let t = faces[i as usize];
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let key = (u64::from(a.min(b)) << 32) | u64::from(a.max(b));
            (key, (i << 1) | u32::from(a > b))
        };
        let mut edges: Vec<(u64, u32)> = (0..faces.len() as u32)
            .into_par_iter()
            .filter(|&i| counts[i as usize])
            .flat_map_iter(|i| (0..3).map(move |k| edge(i, k)))
            .collect();
        edges.par_sort_unstable();
        let (mut boundary, mut inconsistent) = (Vec::new(), Vec::new());
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            let face = group[0].1 >> 1;
            group.iter().for_each(|e| sets.join(face, e.1 >> 1));
            let backwards = group.iter().filter(|e| e.1 & 1 == 1).count();
            match group.len() {
                1 => {
                    let ends = [(group[0].0 >> 32) as u32, group[0].0 as u32]
                        .map(|i| mesh.positions[i as usize]);
                    let ends = if backwards == 1 { [ends[1], ends[0]] } else { ends };
                    self.boundary.push(BoundaryEdge { face, ends });
                    boundary.push(face);
                }
                2 if backwards != 1 => inconsistent.push(face),
                2 => {}
                // Bodies that touch along an edge have faces that pair up.
                n if 2 * backwards == n => {}
                _ => self.non_manifold.push(face),
            }
        }
        (boundary, inconsistent)
    }

    fn find_components(&mut self, mesh: &TriangleMesh, counts: &[bool], mut sets: DisjointSets) {
        let mut number_of_root = vec![NONE; counts.len()];
        self.component_of = vec![NONE; counts.len()];
        let mut origins: Vec<DVec3> = Vec::new();
        for face in (0..counts.len()).filter(|&i| counts[i]) {
            let root = sets.root(face as u32) as usize;
            let [a, b, c] = mesh.corners(face);
            if number_of_root[root] == NONE {
                number_of_root[root] = self.components.len() as u32;
                origins.push(a.as_dvec3());
                self.components.push(Component {
                    first_face: face as u32,
                    faces: 0,
                    boundary_edges: 0,
                    inconsistent_edges: 0,
                    faces_against_normals: 0,
                    area: 0.0,
                    vector_area: DVec3::ZERO,
                    volume: 0.0,
                    bounds: Bounds3::EMPTY,
                });
            }
            let number = number_of_root[root];
            self.component_of[face] = number;
            let (component, origin) =
                (&mut self.components[number as usize], origins[number as usize]);
            component.bounds = component.bounds.union(&Bounds3::of([a, b, c]));
            let [a, b, c] = [a, b, c].map(|p| p.as_dvec3() - origin);
            let area = (b - a).cross(c - a) * 0.5;
            component.faces += 1;
            component.area += area.length();
            component.vector_area += area;
            component.volume += a.dot(b.cross(c)) / 6.0;
            if !mesh.normals.is_empty() {
                let normals = mesh.indices[face].map(|i| mesh.normals[i as usize].as_dvec3());
                let against =
                    normals.iter().all(|n| n.dot(area) < -0.1 * n.length() * area.length());
                component.faces_against_normals += u32::from(against);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The unit cube, every face with vertices of its own.
    pub fn cube() -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for axis in 0..3 {
            for (side, corners) in
                [(0.0, [[0, 0], [0, 1], [1, 1], [1, 0]]), (1.0, [[0, 0], [1, 0], [1, 1], [0, 1]])]
            {
                let base = mesh.positions.len() as u32;
                for [s, t] in corners {
                    let mut p = Vec3::ZERO;
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, s as f32, t as f32);
                    mesh.positions.push(p);
                }
                mesh.indices.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
            }
        }
        mesh
    }

    #[test]
    fn a_cube_of_separate_faces_is_one_closed_body() {
        let topology = Topology::of(&cube());
        assert_eq!(
            (topology.components.len(), topology.boundary.len(), topology.inconsistent.len()),
            (1, 0, 0)
        );
        let body = &topology.components[0];
        assert!(
            (body.volume - 1.0).abs() < 1e-12
                && (body.area - 6.0).abs() < 1e-12
                && body.openness() < 1e-12
        );
    }

    #[test]
    fn what_is_missing_turned_or_doubled_is_found() {
        let mut open = cube();
        open.indices.pop();
        assert_eq!(Topology::of(&open).boundary.len(), 3);
        let mut turned = cube();
        turned.indices[5].swap(0, 1);
        assert_eq!(Topology::of(&turned).inconsistent.len(), 3);
        let mut doubled = cube();
        let [a, b, c] = doubled.indices[7];
        doubled.indices.extend([[b, c, a], [a, c, b], [a, a, b]]);
        let topology = Topology::of(&doubled);
        let duplicate = |face, has_same_winding| Duplicate { face, of: 7, has_same_winding };
        assert_eq!(topology.duplicates, [duplicate(12, true), duplicate(13, false)]);
        assert_eq!((topology.degenerate, topology.boundary.len()), (vec![14], 0));
        let mut thin = cube();
        let at = |x, y, z| Vec3::new(x, y, z) + 2.0;
        thin.positions.extend([
            at(0.0, 0.0, 0.0),
            at(0.1, 0.2, 0.3),
            at(0.3, 0.6, 0.9),
            at(0.1, 0.2 + 1e-6, 0.3),
        ]);
        thin.positions.extend([
            Vec3::ZERO,
            Vec3::X,
            Vec3::new(0.0, 0.5, 1e30),
            Vec3::splat(1.0),
            Vec3::splat(-7.0),
        ]);
        thin.indices.extend([[24, 25, 26], [24, 26, 27], [28, 29, 30], [28, 31, 32]]);
        assert_eq!(
            Topology::of(&thin).degenerate,
            [15],
            "only points on a line: a face of 1e30 by 1 has an area"
        );
        let mut fin = cube();
        fin.positions.push(Vec3::splat(3.0));
        let edge = fin.indices[0];
        fin.indices.push([edge[0], edge[1], 24]);
        let topology = Topology::of(&fin);
        assert_eq!(
            (topology.non_manifold.len(), topology.boundary.len(), topology.components.len()),
            (1, 2, 1)
        );
    }
}
