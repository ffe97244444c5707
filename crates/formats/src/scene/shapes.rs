//! Stores equal shapes once, and places them by nodes.

use snell_intersect::{AnyShape, TriangleMesh};
use snell_math::{DAffine3, DMat3, DVec3, Vec2};
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

/// Number of pieces of a swept surface: around a full turn, and from one end to the other.
pub const AROUND: u32 = 256;
pub const ALONG: u32 = 128;

/// The rotation from Snell's round shapes to those of pbrt and Mitsuba. Snell's stand around y and
/// count longitude from z towards x; the others stand around z and count it from x towards y.
pub fn around_z() -> DMat3 {
    DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X)
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
            mesh.positions.push(position.as_vec3());
            mesh.normals.push(normal.as_vec3());
            mesh.uvs[0].push(Vec2::new(u as f32, v as f32));
        }
    }
    for j in 0..along {
        for i in 0..around {
            let a = j * (around + 1) + i;
            let b = a + around + 1;
            mesh.indices.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
        }
    }
    mesh
}
