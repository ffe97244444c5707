//! Tessellation of analytic shapes: each shape lists the patches that make up its surface.

use super::Shape;
use crate::mesh::TriangleMesh;
use snell_math::DVec3;

/// A part of the surface of a shape.
pub struct Patch {
    face: u32,
    form: Form,
}

enum Form {
    /// Corners of a flat convex polygon.
    Flat(Vec<DVec3>),
    /// The position at `(u, v)` in the unit square.
    Round { turns: f64, position: Box<dyn Fn(f64, f64) -> DVec3> },
}

impl Patch {
    /// A flat convex polygon on a face, given by its corners in clockwise or counter-clockwise
    /// order.
    pub fn flat(face: u32, corners: impl Into<Vec<DVec3>>) -> Self {
        Self { face, form: Form::Flat(corners.into()) }
    }

    /// A curved patch on a face, given by its position at `(u, v)` in the unit square. `u` goes
    /// once around the axis. `v`, which is the `v` of the texture coordinates, covers an arc of
    /// `turns` full turns: 0 for a straight profile, 0.5 from pole to pole. Positions that coincide
    /// must be equal bit for bit.
    pub fn round(face: u32, turns: f64, position: impl Fn(f64, f64) -> DVec3 + 'static) -> Self {
        Self { face, form: Form::Round { turns, position: Box::new(position) } }
    }

    /// Upper bound on the number of triangles, with `around` segments around a circle.
    pub fn most_triangles(&self, around: u32) -> u64 {
        match &self.form {
            Form::Flat(corners) => corners.len().saturating_sub(2) as u64,
            Form::Round { turns, .. } => 2 * u64::from(around) * u64::from(rows(*turns, around)),
        }
    }
}

fn rows(turns: f64, around: u32) -> u32 {
    ((turns * f64::from(around)).round() as u32).max(1)
}

/// Triangulates the patches of a shape, with `around` segments around a circle. `None` for a shape
/// without patches.
pub(super) fn tessellate<S: Shape + ?Sized>(shape: &S, around: u32) -> Option<TriangleMesh> {
    let patches = shape.patches();
    let mut builder = Builder { shape, mesh: TriangleMesh::default() };
    for Patch { face, form } in &patches {
        match form {
            Form::Flat(corners) => builder.fan(*face, corners),
            Form::Round { turns, position } => {
                builder.grid(*face, [around, rows(*turns, around)], position);
            }
        }
    }
    (!patches.is_empty()).then_some(builder.mesh)
}

struct Builder<'a, S: ?Sized> {
    shape: &'a S,
    mesh: TriangleMesh,
}

impl<S: Shape + ?Sized> Builder<'_, S> {
    fn vertex(&mut self, position: DVec3, face: u32) -> u32 {
        let surface = self.shape.surface(position, face);
        self.mesh.positions.push(position.as_vec3());
        self.mesh.normals.push(surface.normal.as_vec3());
        self.mesh.uvs[0].push(surface.uv.as_vec2());
        self.mesh.positions.len() as u32 - 1
    }

    /// Adds a triangle, oriented so that its outer side is that of the shape, unless two of its
    /// corners coincide.
    fn triangle(&mut self, corners: [u32; 3]) {
        let [a, b, c] = corners.map(|i| self.mesh.positions[i as usize].as_dvec3());
        if a == b || b == c || c == a {
            return;
        }
        let normal: DVec3 = corners.iter().map(|&i| self.mesh.normals[i as usize].as_dvec3()).sum();
        let outward = (b - a).cross(c - a).dot(normal) >= 0.0;
        self.mesh.indices.push(if outward {
            corners
        } else {
            [corners[0], corners[2], corners[1]]
        });
    }

    fn fan(&mut self, face: u32, corners: &[DVec3]) {
        let numbers: Vec<u32> = corners.iter().map(|&p| self.vertex(p, face)).collect();
        for i in 2..numbers.len() {
            self.triangle([numbers[0], numbers[i - 1], numbers[i]]);
        }
    }

    /// Adds a grid of triangles. Its last column has texture coordinate `u = 1` at the positions
    /// where the shape itself gives `u = 0`.
    fn grid(&mut self, face: u32, [columns, rows]: [u32; 2], position: impl Fn(f64, f64) -> DVec3) {
        let start = self.mesh.positions.len() as u32;
        for j in 0..=rows {
            for i in 0..=columns {
                let (u, v) = (f64::from(i) / f64::from(columns), f64::from(j) / f64::from(rows));
                // Both ends of the seam get the same point, bit for bit.
                let vertex = self.vertex(position(if i == columns { 0.0 } else { u }, v), face);
                self.mesh.uvs[0][vertex as usize].x = u as f32;
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let a = start + j * (columns + 1) + i;
                let b = a + columns + 1;
                self.triangle([a, b, b + 1]);
                self.triangle([a, b + 1, a + 1]);
            }
        }
    }
}
