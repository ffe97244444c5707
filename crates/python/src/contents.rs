//! The contents of a scene as plain data: objects by number, and the stage around them (materials,
//! lights, cameras). [`crate::assemble`] builds worlds from the contents, and [`crate::graph`] the
//! scene graph that is rendered.

use crate::heightfield::Field;
use crate::mesh::Mesh;
use crate::motion::Motion;
use crate::origins::Origins;
use crate::place::Place;
use pyo3::PyResult;
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use snell_intersect::{AnyShape, Curves, PrimitiveSet, Shape, Spheres};
use snell_math::{Bounds3d, Transform};
use snell_scene::{MaterialId, Node, NodeId, Scene};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Maximum nesting depth of instanced scenes.
const MAX_NESTING: usize = 500;

/// The kind of an object.
#[derive(Clone, Debug)]
pub enum Kind {
    /// Triangles.
    Mesh(Arc<Mesh>),
    /// An analytic shape.
    Shape(Arc<AnyShape>),
    /// Spheres in bulk.
    Spheres(Arc<Spheres>),
    /// Strands.
    Curves(Arc<Curves>),
    /// Heights on a grid.
    Heightfield(Arc<Field>),
    /// An instance: the contents that another scene had when it was added.
    Instance(Arc<Contents>),
}

impl Kind {
    /// The name of the kind.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Mesh(_) => "mesh",
            Self::Shape(_) => "shape",
            Self::Spheres(_) => "spheres",
            Self::Curves(_) => "curves",
            Self::Heightfield(_) => "heightfield",
            Self::Instance(_) => "instance",
        }
    }
}

/// An object of a scene.
#[derive(Clone, Debug)]
pub struct Object {
    /// The kind of the object.
    pub kind: Kind,
    /// The map from the object's coordinates to the scene's, at the first key if it moves; `None`
    /// for the identity, if the object was never moved.
    pub transform: Option<Transform>,
    /// The motion of the object; `None` if it rests.
    pub motion: Option<Arc<Motion>>,
    /// A name for users.
    pub name: Option<Arc<str>>,
    /// The mask: only rays whose mask shares a bit with it hit the object.
    pub mask: u64,
    /// Materials of the stage by slot of a mesh; other objects have one slot. The material of an
    /// instance is for the objects in it that have no material of their own.
    pub materials: Vec<Option<MaterialId>>,
}

impl Object {
    /// An object that every ray can hit, without a material of its own.
    pub fn new(kind: Kind, transform: Option<Transform>, name: Option<String>) -> Self {
        let name = name.map(Into::into);
        Self { kind, transform, motion: None, name, mask: u64::MAX, materials: Vec::new() }
    }

    /// Puts the object in another place.
    pub fn put(&mut self, place: Place) {
        (self.transform, self.motion) = (place.transform, place.motion);
    }

    /// True if worlds have a group for the object alone, so that it costs little to move it.
    pub fn has_own_group(&self) -> bool {
        match self.kind {
            Kind::Instance(_) => false,
            Kind::Shape(_) => self.motion.is_some(),
            Kind::Mesh(_) | Kind::Spheres(_) | Kind::Curves(_) | Kind::Heightfield(_) => {
                self.transform.is_some()
            }
        }
    }
}

/// The slot of an object in the list of a scene.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "almost all are the large one")]
pub enum Slot {
    /// An object that is present.
    Here(Object),
    /// An object that was removed; true if it had a group of its own.
    Gone(bool),
}

/// The nodes of a file.
#[derive(Clone, Debug)]
pub struct Nodes {
    /// All nodes.
    pub nodes: Vec<Node>,
    /// The root of the file.
    pub root: NodeId,
    /// The animation of the file.
    pub motion: Option<Arc<snell_scene::Motion>>,
    /// The objects that the nodes became.
    pub origins: Origins,
}

/// All objects of a scene. The numbers of removed objects stay unused.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// Objects by number.
    pub slots: Vec<Slot>,
    /// Everything else that a picture needs: materials, textures, lights, cameras. A scene graph
    /// without nodes.
    pub stage: Arc<Scene>,
    /// True if acceleration structures are compact: these take less memory, but queries take more
    /// time.
    pub compact: bool,
    /// The nodes that the objects were read from; `None` once an object was changed. They keep the
    /// names and nesting of the file.
    nodes: Option<Arc<Nodes>>,
    nesting: usize,
}

impl Contents {
    /// An empty scene with a stage.
    pub fn on(stage: Arc<Scene>) -> Self {
        Self { stage, ..Self::default() }
    }

    /// Adds an object and returns its number.
    pub fn add(&mut self, object: Object) -> PyResult<u32> {
        if let Kind::Instance(child) = &object.kind {
            if child.nesting >= MAX_NESTING {
                let message = format!("scene: instances are nested more than {MAX_NESTING} deep");
                return Err(PyValueError::new_err(message));
            }
            self.nesting = self.nesting.max(child.nesting + 1);
        }
        // The largest number stands for no object.
        let number = u32::try_from(self.slots.len()).ok().filter(|&n| n != u32::MAX);
        let number = number.ok_or_else(|| {
            PyValueError::new_err("a scene holds no more than 4294967295 objects")
        })?;
        self.nodes = None;
        self.slots.push(Slot::Here(object));
        Ok(number)
    }

    /// Adds an object at each of these places, with these names. Returns their numbers.
    pub fn add_many(
        &mut self,
        object: Object,
        places: Vec<Place>,
        names: Vec<Option<String>>,
    ) -> PyResult<Range<u32>> {
        let first = self.slots.len();
        let mut all = places.into_iter().zip(names).map(|(place, name)| {
            let mut object = Object { name: name.map(Into::into), ..object.clone() };
            object.put(place);
            object
        });
        let added = all.try_for_each(|object| self.add(object).map(drop));
        if added.is_err() {
            self.slots.truncate(first);
        }
        added.map(|()| first as u32..self.slots.len() as u32)
    }

    /// Adds an unused number.
    pub fn add_gap(&mut self) {
        self.slots.push(Slot::Gone(false));
    }

    /// Removes an object.
    pub fn remove(&mut self, id: i64) -> PyResult<()> {
        let had_own_group = self.get_mut(id)?.has_own_group();
        self.slots[id as usize] = Slot::Gone(had_own_group);
        Ok(())
    }

    /// The object with this number.
    pub fn get(&self, id: i64) -> PyResult<&Object> {
        match usize::try_from(id).ok().and_then(|i| self.slots.get(i)) {
            Some(Slot::Here(object)) => Ok(object),
            Some(Slot::Gone(_)) => {
                Err(PyIndexError::new_err(format!("id {id} was removed from the scene")))
            }
            None => Err(PyIndexError::new_err(format!(
                "id {id} is not in the scene, which has given {} ids",
                self.slots.len()
            ))),
        }
    }

    /// The object with this number, mutable.
    pub fn get_mut(&mut self, id: i64) -> PyResult<&mut Object> {
        self.get(id)?;
        self.nodes = None;
        match &mut self.slots[id as usize] {
            Slot::Here(object) => Ok(object),
            Slot::Gone(_) => unreachable!("it was found above"),
        }
    }

    /// Replaces a mesh.
    pub fn set_mesh(&mut self, id: i64, mesh: Arc<Mesh>) -> PyResult<()> {
        self.mesh(id)?;
        self.get_mut(id)?.kind = Kind::Mesh(mesh);
        Ok(())
    }

    /// The mesh with this number.
    pub fn mesh(&self, id: i64) -> PyResult<&Arc<Mesh>> {
        match &self.get(id)?.kind {
            Kind::Mesh(mesh) => Ok(mesh),
            Kind::Heightfield(_) => Err(PyTypeError::new_err(format!(
                "id {id} is a heightfield, not a mesh; update_heights(id, z) changes it"
            ))),
            _ => Err(PyTypeError::new_err(format!("id {id} is not a mesh"))),
        }
    }

    /// The heightfield with this number.
    pub fn heightfield(&self, id: i64) -> PyResult<&Arc<Field>> {
        match &self.get(id)?.kind {
            Kind::Heightfield(field) => Ok(field),
            _ => Err(PyTypeError::new_err(format!("id {id} is not a heightfield"))),
        }
    }

    /// Replaces a heightfield.
    pub fn set_heightfield(&mut self, id: i64, field: Arc<Field>) -> PyResult<()> {
        self.heightfield(id)?;
        self.get_mut(id)?.kind = Kind::Heightfield(field);
        Ok(())
    }

    /// Sets the nodes that the objects were read from.
    pub fn set_nodes(&mut self, nodes: Nodes) {
        self.nodes = Some(Arc::new(nodes));
    }

    /// The nodes that the objects were read from; `None` if an object was changed since.
    pub fn nodes(&self) -> Option<&Arc<Nodes>> {
        self.nodes.as_ref()
    }

    /// The stage, mutable.
    pub fn stage_mut(&mut self) -> &mut Scene {
        Arc::make_mut(&mut self.stage)
    }

    /// The box around all objects, at all times.
    pub fn bounds(&self) -> Bounds3d {
        self.bounds_with(&mut HashMap::new())
    }

    /// Like [`Self::bounds`], with a cache of the boxes of instanced scenes.
    fn bounds_with(&self, known: &mut HashMap<*const Self, Bounds3d>) -> Bounds3d {
        let mut all = Bounds3d::EMPTY;
        for (_, object) in self.objects() {
            let own = match &object.kind {
                Kind::Mesh(mesh) if mesh.is_double() => mesh.double().bounds(),
                Kind::Mesh(mesh) => mesh.single().bounds().into(),
                Kind::Shape(shape) => shape.bounds(),
                Kind::Spheres(spheres) => {
                    (0..spheres.len()).fold(Bounds3d::EMPTY, |all, i| all.union(&spheres.bounds(i)))
                }
                Kind::Curves(curves) => curves.bounds_of_all(),
                Kind::Heightfield(field) => field.grid.bounds(),
                Kind::Instance(child) => match known.get(&Arc::as_ptr(child)) {
                    Some(bounds) => *bounds,
                    None => {
                        let bounds = child.bounds_with(known);
                        known.insert(Arc::as_ptr(child), bounds);
                        bounds
                    }
                },
            };
            let placed = match &object.motion {
                Some(motion) => motion.bounds(&own),
                None => object.transform.map_or(own, |map| map.bounds(&own)),
            };
            all = all.union(&placed);
        }
        all
    }

    /// The present objects, with their numbers.
    pub fn objects(&self) -> impl Iterator<Item = (u32, &Object)> {
        self.slots.iter().enumerate().filter_map(|(i, slot)| match slot {
            Slot::Here(object) => Some((i as u32, object)),
            Slot::Gone(_) => None,
        })
    }
}
