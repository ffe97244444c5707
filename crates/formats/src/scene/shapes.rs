//! Shapes on their way into a scene: equal ones are stored once and placed by nodes.

use snell_intersect::AnyShape;
use snell_math::DAffine3;
use snell_scene::{Geometry, MaterialId, Node, NodeId, Scene, Surface};
use std::collections::HashMap;
use std::sync::Arc;

/// The shapes of a scene so far.
#[derive(Debug, Default)]
pub struct ShapeTable {
    known: HashMap<String, Arc<AnyShape>>,
}

impl ShapeTable {
    /// The shape, shared with all equal ones.
    pub fn shared(&mut self, shape: AnyShape) -> Geometry {
        // The debug form of a float is exact, so equal text is an equal shape.
        let shared = self.known.entry(format!("{shape:?}")).or_insert_with(|| Arc::new(shape));
        Geometry::Shape(shared.clone())
    }

    /// Adds a node below `parent` that holds the shape. Without a material it takes the one of `parent`.
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
        scene.add_child(parent, Node { transform: parent_from_shape, surfaces, ..Node::named(name) });
    }
}

/// A surface of a material, or of the node's if there is none.
pub fn surface(geometry: Geometry, material: Option<MaterialId>) -> Surface {
    material.map_or_else(|| Surface::new(geometry.clone()), |m| Surface::with_material(geometry.clone(), m))
}
