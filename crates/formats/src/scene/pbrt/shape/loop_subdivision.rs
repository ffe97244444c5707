//! Loop's subdivision surfaces (Loop, Smooth Subdivision Surfaces Based on Triangles, 1987),
//! refined by the levels in the file and then moved to the limit surface, with its normals.

use super::super::Builder;
use super::super::params::Params;
use super::{Lamps, Made};
use crate::scene::fault::Fault;
use snell_intersect::TriangleMesh;
use snell_math::Vec3;
use snell_math::real;
use std::collections::HashMap;
use std::f32::consts::TAU;

impl Builder<'_> {
    pub(super) fn loop_subdivision(&mut self, params: &Params) -> Result<Made, Fault> {
        let positions = self.points(params)?;
        let (triangles, number) = params.indices::<3>("indices", positions.len())?;
        if number == 0 || number % 3 != 0 {
            let problem = format!("{number} indices, which is not a positive multiple of three");
            return Err(params.fault(problem, "give three for each triangle"));
        }
        let name = if params.has("nlevels") { "nlevels" } else { "levels" };
        let levels = self.count_param(params, name, 3, [0, 12])?;
        params.get("scheme");
        self.note_common(params);
        if !self.may_make(params, triangles.len().saturating_mul(1 << (2 * levels))) {
            return Ok(Made::Nothing);
        }
        let mut control = Control { positions, triangles };
        // A triangle with a repeated vertex has no meaningful neighbours.
        control.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        for _ in 0..levels {
            control = control.refined();
        }
        let (positions, normals) = control.limit();
        let mesh = TriangleMesh {
            positions,
            indices: control.triangles,
            normals,
            ..TriangleMesh::default()
        };
        Ok(self.finish_mesh(mesh, Lamps::Triangles))
    }
}

/// A control mesh.
struct Control {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// The vertices around a vertex, in order.
struct Ring {
    vertices: Vec<u32>,
    /// False at the border of the mesh, where the ring has a first and a last vertex.
    is_closed: bool,
}

/// The neighbourhood of an edge: the third corners of its triangles, and the number of triangles.
#[derive(Clone, Copy, Default)]
struct Edge {
    opposite: [u32; 2],
    count: u32,
    /// The new vertex that divides the edge.
    middle: u32,
}

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

impl Control {
    fn edges(&self) -> HashMap<(u32, u32), Edge> {
        let mut edges: HashMap<_, Edge> = HashMap::with_capacity(self.triangles.len() * 3 / 2);
        let mut next = self.positions.len() as u32;
        for &[a, b, c] in &self.triangles {
            for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
                let edge = edges.entry(key(from, to)).or_insert_with(|| {
                    next += 1;
                    Edge { middle: next - 1, ..Edge::default() }
                });
                if let Some(slot) = edge.opposite.get_mut(edge.count as usize) {
                    *slot = opposite;
                }
                edge.count += 1;
            }
        }
        edges
    }

    /// The ring of each vertex; empty where the triangles do not form one.
    fn rings(&self) -> Vec<Ring> {
        let mut around: Vec<Vec<(u32, u32)>> = vec![Vec::new(); self.positions.len()];
        for &[a, b, c] in &self.triangles {
            for (v, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
                around[v as usize].push((from, to));
            }
        }
        around.into_iter().map(|mut steps| ring(&mut steps)).collect()
    }

    fn refined(&self) -> Self {
        let edges = self.edges();
        let p = |i: u32| self.positions[i as usize];
        let mut positions: Vec<Vec3> = self
            .rings()
            .iter()
            .zip(&self.positions)
            .map(|(ring, &center)| {
                ring.blend(center, &self.positions, beta(ring.vertices.len()), 1.0 / 8.0)
            })
            .collect();
        positions.resize(self.positions.len() + edges.len(), Vec3::ZERO);
        for (&(a, b), edge) in &edges {
            let [c, d] = edge.opposite;
            positions[edge.middle as usize] = if edge.count == 2 {
                (p(a) + p(b)) * 0.375 + (p(c) + p(d)) * 0.125
            } else {
                (p(a) + p(b)) * 0.5
            };
        }
        let mut triangles = Vec::with_capacity(self.triangles.len() * 4);
        for &[a, b, c] in &self.triangles {
            let [ab, bc, ca] =
                [(a, b), (b, c), (c, a)].map(|(from, to)| edges[&key(from, to)].middle);
            triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        Self { positions, triangles }
    }

    /// The limit positions of the vertices, and the normals there.
    fn limit(&self) -> (Vec<Vec3>, Vec<Vec3>) {
        let rings = self.rings();
        let weight = |n: usize| 1.0 / (n as f32 + 3.0 / (8.0 * beta(n)));
        let positions: Vec<Vec3> = rings
            .iter()
            .zip(&self.positions)
            .map(|(ring, &center)| {
                ring.blend(center, &self.positions, weight(ring.vertices.len()), 1.0 / 5.0)
            })
            .collect();
        let mesh =
            TriangleMesh { positions, indices: self.triangles.clone(), ..TriangleMesh::default() };
        let mut normals = mesh.computed_normals();
        for (ring, normal) in rings.iter().zip(&mut normals) {
            if let Some(exact) = ring.normal(&mesh.positions) {
                *normal = if exact.dot(*normal) < 0.0 { -exact } else { exact };
            }
        }
        (mesh.positions, normals)
    }
}

/// Orders the steps `from -> to` around a vertex.
fn ring(steps: &mut Vec<(u32, u32)>) -> Ring {
    let Some(&(first, _)) = steps.first() else {
        return Ring { vertices: Vec::new(), is_closed: false };
    };
    // At the border, the ring begins with the vertex that no step leads to.
    let start =
        steps.iter().map(|s| s.0).find(|from| steps.iter().all(|s| s.1 != *from)).unwrap_or(first);
    let mut vertices = vec![start];
    let mut last = start;
    while let Some(position) = steps.iter().position(|s| s.0 == last) {
        last = steps.swap_remove(position).1;
        if last == start {
            return Ring { vertices, is_closed: true };
        }
        vertices.push(last);
    }
    Ring { vertices, is_closed: false }
}

/// Weight of each neighbour of a vertex with `n` neighbours.
fn beta(n: usize) -> f32 {
    if n == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * n.max(1) as f32) }
}

impl Ring {
    /// The vertex blended with its neighbours, each with `weight`. At the border only the two
    /// neighbours on the border count, each with the weight `border`.
    fn blend(&self, center: Vec3, positions: &[Vec3], weight: f32, border: f32) -> Vec3 {
        let p = |i: u32| positions[i as usize];
        match (&*self.vertices, self.is_closed) {
            (ring, true) => {
                let sum: Vec3 = ring.iter().map(|&i| p(i)).sum();
                center * (1.0 - ring.len() as f32 * weight) + sum * weight
            }
            (&[first, .., last], false) => {
                center * (1.0 - 2.0 * border) + (p(first) + p(last)) * border
            }
            _ => center,
        }
    }

    /// The normal of the limit surface, from its two tangents; inner vertices only.
    fn normal(&self, positions: &[Vec3]) -> Option<Vec3> {
        if !self.is_closed {
            return None;
        }
        let n = self.vertices.len() as f32;
        let (mut s, mut t) = (Vec3::ZERO, Vec3::ZERO);
        for (i, &v) in self.vertices.iter().enumerate() {
            let (sin, cos) = real::sin_cos(TAU * i as f32 / n);
            s += positions[v as usize] * cos;
            t += positions[v as usize] * sin;
        }
        s.cross(t).try_normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octahedron() -> Control {
        let positions = vec![Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        let triangles = (0..4).flat_map(|i| [[i, (i + 1) % 4, 4], [(i + 1) % 4, i, 5]]).collect();
        Control { positions, triangles }
    }

    #[test]
    fn a_closed_mesh_stays_closed_and_round() {
        let refined = octahedron().refined().refined();
        assert_eq!((refined.triangles.len(), refined.positions.len()), (8 * 16, 2 + 8 * 16 / 2));
        assert!(refined.edges().values().all(|e| e.count == 2));
        let (positions, normals) = refined.limit();
        for (p, n) in positions.iter().zip(&normals) {
            assert!(
                p.length() > 0.4 && p.length() < 0.7 && p.normalize().dot(*n) > 0.94,
                "{p} {n}"
            );
        }
    }

    #[test]
    fn levels_do_not_move_the_limit() {
        let coarse = octahedron().limit().0;
        let fine = octahedron().refined().refined().limit().0;
        for (a, b) in coarse.iter().zip(&fine) {
            assert!((*a - *b).length() < 1e-5, "{a} {b}");
        }
    }

    #[test]
    fn the_border_of_a_flat_sheet_stays_in_its_plane() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE.with_z(0.0)];
        let sheet = Control { positions, triangles: vec![[0, 1, 2], [1, 3, 2]] };
        let (positions, normals) = sheet.refined().limit();
        assert!(
            positions
                .iter()
                .all(|p| p.z == 0.0 && p.min_element() >= 0.0 && p.max_element() <= 1.0)
        );
        assert!(normals.iter().all(|n| n.z > 0.9999));
    }
}
