//! The way back from the scene graph that is rendered to the objects of a scene in Python, so that
//! the layers of ids have the ids that queries give.

use crate::prepare::Prepared;
use snell_intersect::Hit;
use snell_render::Aov;
use snell_scene::{LayeredImage, NodeId};
use std::collections::HashMap;
use std::sync::Arc;

/// The AOVs whose values are ids of objects. All are needed to find one.
pub const ID_AOVS: [Aov; 3] = [Aov::InstanceId, Aov::GeometryId, Aov::PrimitiveId];

/// The objects that the nodes of a scene graph stand for.
#[derive(Clone, Debug, Default)]
pub struct Origins {
    /// The object that is the first surface of a node; the others follow.
    pub first: HashMap<NodeId, u32>,
    /// The instance that is the step from a node to one below it.
    pub steps: HashMap<(NodeId, NodeId), u32>,
    /// For surfaces that are instances of a scene with one mesh: the id of this mesh.
    pub inner: HashMap<(NodeId, u32), u32>,
    /// The primitive that a node is, for sets that became a node each.
    pub primitives: HashMap<NodeId, u32>,
    /// The numbers of the triangles of a node, for surfaces that leave some out.
    pub triangles: HashMap<NodeId, Arc<[u32]>>,
}

/// The ids of an object as queries give them.
#[derive(Clone, Copy, Debug)]
struct Ids {
    instance: u32,
    geometry: u32,
    primitive: Option<u32>,
    node: NodeId,
}

impl Origins {
    /// Adds those of other nodes.
    pub fn extend(&mut self, other: Self) {
        self.first.extend(other.first);
        self.steps.extend(other.steps);
        self.inner.extend(other.inner);
        self.primitives.extend(other.primitives);
        self.triangles.extend(other.triangles);
    }

    /// Those of nodes that are a single object, with this number in another scene.
    pub fn renumbered(mut self, object: u32) -> Self {
        let all = self.first.values_mut().chain(self.steps.values_mut());
        all.for_each(|number| *number = object);
        self
    }

    /// The ids of the surface with this number of the last node of a path from the root.
    fn ids(&self, path: &[NodeId], surface: u32) -> Option<Ids> {
        let node = *path.last()?;
        let mut instances =
            path.windows(2).filter_map(|step| self.steps.get(&(step[0], step[1])).copied());
        let object = self.first.get(&node)? + surface;
        let inner = self.inner.get(&(node, surface));
        Some(Ids {
            instance: instances.next().or(inner.map(|_| object)).unwrap_or(Hit::NONE),
            geometry: inner.copied().unwrap_or(object),
            primitive: self.primitives.get(&node).copied(),
            node,
        })
    }
}

/// Gives the layers of ids the ids that queries give; -1 is nothing, and no instance.
pub fn rename(picture: &mut LayeredImage, prepared: &Prepared) {
    let place = |aov: Aov| picture.layers.iter().position(|layer| layer.name == aov.name());
    let [Some(instances), Some(geometries), Some(primitives)] = ID_AOVS.map(place) else { return };
    let mut known: HashMap<(u32, u32), Option<Ids>> = HashMap::new();
    let number = |id: u32| if id == Hit::NONE { -1.0 } else { id as f32 };
    for pixel in 0..picture.layers[geometries].values.len() {
        let [instance, geometry] =
            [instances, geometries].map(|layer| picture.layers[layer].values[pixel]);
        if geometry < 0.0 {
            picture.layers[instances].values[pixel] = -1.0;
            continue;
        }
        let (instance, geometry) = (instance as u32, geometry as u32);
        let ids = *known.entry((instance, geometry)).or_insert_with(|| {
            let hit = Hit { instance, geometry, ..Hit::default() };
            let path = prepared.compiled.node_path(&hit);
            prepared.origins.ids(&path, prepared.compiled.surface_number(&hit))
        });
        let Some(ids) = ids else { continue };
        picture.layers[instances].values[pixel] = number(ids.instance);
        picture.layers[geometries].values[pixel] = number(ids.geometry);
        if let Some(primitive) = ids.primitive {
            picture.layers[primitives].values[pixel] = number(primitive);
        } else if let Some(numbers) = prepared.origins.triangles.get(&ids.node) {
            let triangle = &mut picture.layers[primitives].values[pixel];
            *triangle = numbers.get(*triangle as usize).map_or(-1.0, |&n| number(n));
        }
    }
}
