//! Stores equal shapes once, and places them by nodes.

use snell_intersect::{AnyShape, TriangleMesh};
use snell_math::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use snell_scene::material::Bitangent;
use snell_scene::{Geometry, MaterialId, Node, NodeId, Scene, Surface};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::Arc;

/// The shapes of a scene so far.
#[derive(Debug, Default)]
pub struct ShapeTable {
    known: HashMap<String, Arc<AnyShape>>,
}

impl ShapeTable {
    /// The geometry of a shape, shared by all equal shapes.
    pub fn shared(&mut self, shape: AnyShape) -> Geometry {
        // The debug form of a float is exact, so equal text means equal shapes.
        let shared = self.known.entry(format!("{shape:?}")).or_insert_with(|| Arc::new(shape));
        Geometry::Shape(shared.clone())
    }

    /// Adds a node below `parent` that holds the shape. Without a material, the node inherits that
    /// of `parent`.
    pub fn place(
        &mut self,
        scene: &mut Scene,
        parent: NodeId,
        parent_from_shape: DAffine3,
        shape: AnyShape,
        material: Option<MaterialId>,
    ) {
        let name = shape.name();
        let geometry = self.shared(shape);
        let surfaces = vec![surface(geometry, material)];
        scene.add_child(
            parent,
            Node { transform: parent_from_shape, surfaces, ..Node::named(name) },
        );
    }
}

/// A surface with a material; without one it has that of its node.
pub fn surface(geometry: Geometry, material: Option<MaterialId>) -> Surface {
    material.map_or_else(
        || Surface::new(geometry.clone()),
        |m| Surface::with_material(geometry.clone(), m),
    )
}

/// Reverses the triangles that face away from the normals of their vertices, and returns whether
/// there were any: in pbrt and Mitsuba, the outer side is that of the normals.
pub fn wind_by_normals(mesh: &mut TriangleMesh) -> bool {
    let TriangleMesh { positions, indices, normals, .. } = mesh;
    let mut found = false;
    for t in indices {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        let normal: Vec3 = t.iter().map(|&i| normals[i as usize]).sum();
        if (b - a).cross(c - a).dot(normal) < 0.0 {
            t.swap(1, 2);
            found = true;
        }
    }
    found
}

/// Number of pieces of a swept surface around a full turn.
pub const AROUND: u32 = 256;
/// Number of pieces of a swept surface from one end to the other.
pub const ALONG: u32 = 128;

/// The rotation from Snell's round shapes to those of pbrt and Mitsuba. Snell's stand around y and
/// count longitude from z towards x; the others stand around z and count it from x towards y.
pub fn around_z() -> DMat3 {
    DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X)
}

/// The direction of green in normal maps that follow the normal and u only, in a world that the
/// reader may have mirrored.
pub fn crossed(world_from_file: &DAffine3) -> Bitangent {
    if world_from_file.matrix3.determinant() < 0.0 {
        Bitangent::CrossedMirrored
    } else {
        Bitangent::Crossed
    }
}

/// Tessellates a surface that is swept by `turn` degrees. `surface` gives the point and the normal
/// at a longitude in radians and at v from 0 to 1; `around` and `along` are the numbers of pieces.
pub fn swept(
    turn: f64,
    [around, along]: [u32; 2],
    surface: impl Fn(f64, f64) -> (DVec3, DVec3),
) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for j in 0..=along {
        for i in 0..=around {
            let (u, v) = (f64::from(i) / f64::from(around), f64::from(j) / f64::from(along));
            let (position, normal) = surface(u * turn / 360.0 * TAU, v);
            // The rounding of a sine of pi would make a tiny circle of a pole.
            let rounding = 1e-12 * position.abs().max_element();
            let position = position.map(|x| if x.abs() < rounding { 0.0 } else { x });
            mesh.positions.push(position.as_vec3());
            mesh.normals.push(normal.as_vec3());
            mesh.uvs[0].push(Vec2::new(u as f32, v as f32));
        }
    }
    for j in 0..along {
        for i in 0..around {
            let a = j * (around + 1) + i;
            let b = a + around + 1;
            // A row that is one point, such as a pole, has no triangles along it.
            let is_degenerate = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                a == b || b == c || c == a
            };
            let both = [[a, a + 1, b + 1], [a, b + 1, b]];
            mesh.indices.extend(both.into_iter().filter(|t| !is_degenerate(t)));
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn swept_surfaces_have_no_degenerate_triangles_at_their_poles() {
        let sphere = |phi: f64, v: f64| {
            let (sin, cos) = (v * std::f64::consts::PI).sin_cos();
            let normal = DVec3::new(sin * phi.cos(), sin * phi.sin(), cos);
            (normal * 3.0, normal)
        };
        let disk = |phi: f64, v: f64| {
            (DVec3::new((1.0 - v) * phi.cos(), (1.0 - v) * phi.sin(), 5.0), DVec3::Z)
        };
        for turn in [360.0, 77.0] {
            let ball = swept(turn, [AROUND, ALONG], sphere);
            assert_eq!(ball.indices.len() as u32, AROUND * (2 * ALONG - 2));
            let flat = swept(turn, [AROUND, 1], disk);
            assert_eq!(flat.indices.len() as u32, AROUND);
            assert_eq!(ball.degenerate_triangles() + flat.degenerate_triangles(), 0);
        }
    }
}
