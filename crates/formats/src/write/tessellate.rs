//! Tessellates analytic shapes.

use snell_intersect::{AnyShape, Shape, TriangleMesh};
use snell_math::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Pieces around a circle.
const AROUND: u32 = 96;
/// Pieces from pole to pole.
const ALONG: u32 = 48;

/// Triangles with the normals, texture coordinates and orientation of the shape; `None` for
/// infinite shapes.
pub fn tessellate(shape: &AnyShape) -> Option<TriangleMesh> {
    let mut mesh = Builder { shape, mesh: TriangleMesh::default() };
    match shape {
        AnyShape::Plane(_) => return None,
        AnyShape::Sphere(sphere) => mesh.grid(0, AROUND, ALONG, |u, v| {
            let ((sin, cos), (sin_phi, cos_phi)) = ((v * PI).sin_cos(), (u * TAU).sin_cos());
            // A pole is exactly one point, so degenerate triangles are detected and left out.
            let sin = if v == 1.0 { 0.0 } else { sin };
            DVec3::new(sin * sin_phi, cos, sin * cos_phi) * sphere.radius
        }),
        AnyShape::Cylinder(c) => mesh.frustum([c.radius; 2], c.height, c.caps),
        AnyShape::Cone(c) => mesh.frustum([c.radius, 0.0], c.height, true),
        AnyShape::Frustum(f) => mesh.frustum([f.bottom_radius, f.top_radius], f.height, f.caps),
        AnyShape::Disk(disk) => mesh.grid(0, AROUND, 1, |u, v| {
            let radius = disk.radius + (disk.inner_radius - disk.radius) * v;
            (DVec2::from_angle(u * TAU) * radius).extend(0.0)
        }),
        AnyShape::Rectangle(rectangle) => {
            let [x, y] = rectangle.half_size.to_array();
            mesh.fan(0, &[[-x, -y], [x, -y], [x, y], [-x, y]].map(|[x, y]| DVec3::new(x, y, 0.0)));
        }
        AnyShape::BoxShape(b) => {
            for face in 0..6 {
                mesh.fan(face, &box_face(b.min, b.max, face));
            }
        }
        AnyShape::Triangle(triangle) => mesh.fan(0, &triangle.vertices),
        AnyShape::Polygon(polygon) => mesh.fan(0, polygon.vertices()),
    }
    Some(mesh.mesh)
}

/// The maximum number of triangles that [`tessellate`] makes.
pub fn most_triangles(shape: &AnyShape) -> u64 {
    let (around, along) = (u64::from(AROUND), u64::from(ALONG));
    match shape {
        AnyShape::Plane(_) => 0,
        AnyShape::Sphere(_) => 2 * around * along,
        AnyShape::Cylinder(_) | AnyShape::Cone(_) | AnyShape::Frustum(_) => 3 * 2 * around,
        AnyShape::Disk(_) => 2 * around,
        AnyShape::Rectangle(_) => 2,
        AnyShape::BoxShape(_) => 12,
        AnyShape::Triangle(_) => 1,
        AnyShape::Polygon(polygon) => polygon.vertices().len() as u64,
    }
}

/// The corners of a face of a box, counter-clockwise from outside.
fn box_face(min: DVec3, max: DVec3, face: u32) -> [DVec3; 4] {
    let (axis, upper) = ((face / 2) as usize, face % 2 == 1);
    let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
    let corner = |a: bool, b: bool| {
        let mut p = min;
        p[axis] = if upper { max[axis] } else { min[axis] };
        p[s] = if a { max[s] } else { min[s] };
        p[t] = if b { max[t] } else { min[t] };
        p
    };
    let corners =
        [corner(false, false), corner(true, false), corner(true, true), corner(false, true)];
    if upper { corners } else { [corners[0], corners[3], corners[2], corners[1]] }
}

struct Builder<'a> {
    shape: &'a AnyShape,
    mesh: TriangleMesh,
}

impl Builder<'_> {
    fn vertex(&mut self, position: DVec3, face: u32) -> u32 {
        let surface = self.shape.surface(position, face);
        self.mesh.positions.push(position.as_vec3());
        self.mesh.normals.push(surface.normal.as_vec3());
        self.mesh.uvs[0].push(surface.uv.as_vec2());
        self.mesh.positions.len() as u32 - 1
    }

    /// Adds a triangle with the shape's orientation, unless two corners coincide.
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

    /// A patch over the unit square that closes in `u`: the last column has coordinate 1 where the
    /// shape has 0 again.
    fn grid(&mut self, face: u32, columns: u32, rows: u32, point: impl Fn(f64, f64) -> DVec3) {
        let start = self.mesh.positions.len() as u32;
        for j in 0..=rows {
            for i in 0..=columns {
                let (u, v) = (f64::from(i) / f64::from(columns), f64::from(j) / f64::from(rows));
                // Exactly the same point at both ends of the seam.
                let vertex = self.vertex(point(if i == columns { 0.0 } else { u }, v), face);
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

    fn frustum(&mut self, [bottom, top]: [f64; 2], height: f64, caps: bool) {
        let ring = |u: f64, radius: f64, y: f64| {
            let (sin, cos) = (u * TAU).sin_cos();
            DVec3::new(radius * sin, y, radius * cos)
        };
        self.grid(0, AROUND, 1, |u, v| ring(u, top + (bottom - top) * v, height * (0.5 - v)));
        for (face, radius, y) in [(1, bottom, -height * 0.5), (2, top, height * 0.5)] {
            if caps && radius > 0.0 {
                self.grid(face, AROUND, 1, |u, v| ring(u, radius * (1.0 - v), y));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_shape_becomes_triangles_of_about_its_area_that_face_outwards() {
        for shape in AnyShape::examples() {
            let Some(mesh) = tessellate(&shape) else {
                assert_eq!(shape.name(), "plane");
                continue;
            };
            mesh.validate().expect("a sound mesh");
            assert!(mesh.indices.len() as u64 <= most_triangles(&shape), "{shape:?}");
            let mut area = 0.0;
            for (i, triangle) in mesh.indices.iter().enumerate() {
                let [a, b, c] = mesh.corners(i).map(|p| p.as_dvec3());
                let cross = (b - a).cross(c - a);
                area += cross.length() * 0.5;
                // Three corners of a polygon may lie on a line.
                let may_be_flat = matches!(shape, AnyShape::Polygon(_));
                assert!(
                    may_be_flat || cross.length() > 1e-9 * shape.area(),
                    "{shape:?}: triangle {i} has no area"
                );
                let normal: DVec3 =
                    triangle.iter().map(|&i| mesh.normals[i as usize].as_dvec3()).sum();
                assert!(cross.dot(normal) >= 0.0, "{shape:?}: triangle {i} looks inwards");
            }
            let ratio = area / shape.area();
            assert!((0.995..1.001).contains(&ratio), "{shape:?}: {ratio} of the area");
        }
    }
}
