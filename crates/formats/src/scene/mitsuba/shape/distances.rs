//! Surfaces of signed distances on a grid (`sdfgrid`), as meshes.

use super::super::Builder;
use super::super::medium::{VolumeFile, read_volume};
use super::super::object::Object;
use super::Made;
use crate::scene::fault::Fault;
use snell_intersect::TriangleMesh;
use snell_math::{Vec2, Vec3};
use std::collections::HashMap;

impl Builder<'_> {
    /// The mesh of an `sdfgrid`; `None` if there is no surface in its grid.
    pub(super) fn distances(&mut self, object: &Object) -> Result<Option<Made>, Fault> {
        let (name, at) = object.file_name()?;
        let file = read_volume(&self.open(name, at)?)?;
        // Both kinds of normals are those of the distances.
        object.get("normals");
        let limit = self.main.options.limits.elements;
        if file.numbers().is_none() {
            return Err(Fault::new(at, "its cells hold several numbers", "give one distance each"));
        }
        let Some(mesh) = Distances::of(&file, limit) else {
            let problem = format!("its surface has more than {limit} triangles, the limit");
            return Err(Fault::new(at, problem, "make the grid coarser"));
        };
        self.count_triangles(object.at, mesh.indices.len())?;
        if mesh.indices.is_empty() {
            self.note("empty grid", at, || {
                "a grid of distances without a surface; it was left out".into()
            });
            return Ok(None);
        }
        self.made(object, mesh).map(Some)
    }
}

/// The corners of the six tetrahedra of a cube; each bit of a corner is one of its coordinates.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// Makes the surface where distances are zero, by marching tetrahedra (Doi and Koide, An Efficient
/// Method of Triangulating Equi-Valued Surfaces, 1991).
struct Distances<'a> {
    size: [usize; 3],
    values: &'a [f32],
    mesh: TriangleMesh,
    /// Vertices by the ends of the edges of the grid on which they are.
    vertices: HashMap<[usize; 2], u32>,
}

impl<'a> Distances<'a> {
    /// The surface in the unit cube; `None` if it has more triangles than `limit`.
    fn of(file: &'a VolumeFile, limit: usize) -> Option<TriangleMesh> {
        let (size, values) = file.numbers()?;
        let mesh = TriangleMesh::default();
        let mut distances = Self { size, values, mesh, vertices: HashMap::new() };
        let [x, y, z] = size.map(|n| n.saturating_sub(1));
        for cell in 0..x * y * z {
            distances.cube([cell % x, cell / x % y, cell / (x * y)]);
            if distances.mesh.indices.len() > limit {
                return None;
            }
        }
        let mut mesh = distances.mesh;
        mesh.uvs[0] = vec![Vec2::ZERO; mesh.positions.len()];
        Some(mesh)
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn cube(&mut self, at: [usize; 3]) {
        let corners: [usize; 8] = std::array::from_fn(|corner| {
            self.index(std::array::from_fn(|i| at[i] + (corner >> i & 1)))
        });
        let is_inside = corners.map(|corner| self.values[corner] < 0.0);
        if is_inside.iter().all(|inside| *inside == is_inside[0]) {
            return;
        }
        for tetrahedron in TETRAHEDRA {
            let (inside, outside): (Vec<_>, Vec<_>) =
                tetrahedron.into_iter().partition(|corner| is_inside[*corner]);
            let edges: Vec<[usize; 2]> = inside
                .iter()
                .flat_map(|a| outside.iter().map(|b| [corners[*a], corners[*b]]))
                .collect();
            match *edges {
                [a, b, c] => self.triangle([a, b, c]),
                // The edges of two corners with two others, in the order ac, ad, bc, bd.
                [ac, ad, bc, bd] => {
                    self.triangle([ac, ad, bd]);
                    self.triangle([ac, bd, bc]);
                }
                _ => {}
            }
        }
    }

    /// Adds a triangle with vertices on edges of the grid, facing where distances grow.
    fn triangle(&mut self, edges: [[usize; 2]; 3]) {
        let [a, mut b, mut c] = edges.map(|edge| self.vertex(edge));
        let at = |i: u32| self.mesh.positions[i as usize];
        if at(a) == at(b) || at(b) == at(c) || at(c) == at(a) {
            // The surface passes a corner of the grid.
            return;
        }
        let up: Vec3 = [a, b, c].iter().map(|i| self.mesh.normals[*i as usize]).sum();
        if (at(b) - at(a)).cross(at(c) - at(a)).dot(up) < 0.0 {
            std::mem::swap(&mut b, &mut c);
        }
        self.mesh.indices.push([a, b, c]);
    }

    fn vertex(&mut self, [a, b]: [usize; 2]) -> u32 {
        let key = [a.min(b), a.max(b)];
        if let Some(known) = self.vertices.get(&key) {
            return *known;
        }
        let (from, to) = (self.values[a], self.values[b]);
        let t = if from == to { 0.5 } else { from / (from - to) };
        let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.5 };
        let normal = self.gradient(a).lerp(self.gradient(b), t);
        let number = self.mesh.positions.len() as u32;
        self.mesh.positions.push(self.place(a).lerp(self.place(b), t));
        self.mesh.normals.push(normal.try_normalize().unwrap_or(Vec3::Z));
        self.vertices.insert(key, number);
        number
    }

    fn coordinates(&self, index: usize) -> [usize; 3] {
        let [x, y, _] = self.size;
        [index % x, index / x % y, index / (x * y)]
    }

    /// The place of a value in the unit cube.
    fn place(&self, index: usize) -> Vec3 {
        let at = self.coordinates(index);
        Vec3::from_array(std::array::from_fn(|i| at[i] as f32 / (self.size[i] - 1) as f32))
    }

    /// The derivatives of the distances, by the differences of neighbours.
    fn gradient(&self, index: usize) -> Vec3 {
        let at = self.coordinates(index);
        Vec3::from_array(std::array::from_fn(|axis| {
            let neighbour = |place: usize| {
                let mut there = at;
                there[axis] = place;
                self.values[self.index(there)]
            };
            let (low, high) = (at[axis].saturating_sub(1), (at[axis] + 1).min(self.size[axis] - 1));
            let slope = (neighbour(high) - neighbour(low)) / (high - low) as f32;
            slope * (self.size[axis] - 1) as f32
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_of_a_ball_is_round_and_faces_outwards() {
        const N: usize = 24;
        let at = |i: usize| i as f32 / (N - 1) as f32 - 0.5;
        let distance = |i: usize| {
            let p = Vec3::new(at(i % N), at(i / N % N), at(i / (N * N)));
            p.length() - 0.3
        };
        let file = VolumeFile::of_numbers([N; 3], (0..N * N * N).map(distance).collect());
        let mesh = Distances::of(&file, 1 << 20).expect("few triangles");
        mesh.validate().expect("sound");
        assert!(mesh.indices.len() > 1000);
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            let from_middle = *position - Vec3::splat(0.5);
            assert!((from_middle.length() - 0.3).abs() < 2e-3, "{position}");
            assert!(normal.dot(from_middle.normalize()) > 0.99, "{normal}");
        }
        for t in 0..mesh.indices.len() {
            let [a, b, c] = mesh.corners(t);
            assert!((b - a).cross(c - a).dot(a - Vec3::splat(0.5)) >= 0.0, "{t}");
        }
        assert!(Distances::of(&file, 10).is_none());
    }
}
