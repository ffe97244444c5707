//! Builds the world of a scene for queries, in single or in double precision.
//!
//! Objects without a transform lie in the group of their scene. A mesh or set of spheres with a
//! transform has a group of its own, so that moving it costs little. A scene is one group, however
//! often it is instanced. Numbers do not change when objects are added or removed at the end, so
//! the next world shares what did not change.

use crate::contents::{Contents, Kind, Object, Slot};
use crate::mesh::Mesh;
use crate::motion::Axis;
use snell_intersect::{
    AnyShape, BuildOptions, Curves, GeometryId, GroupId, Hit, Instance, Spheres, WorldBuilder,
    WorldError,
};
use snell_math::Transform;
use snell_scene::MaterialId;
use std::collections::HashMap;
use std::sync::Arc;

/// A geometry of a world in the form from which surfaces are computed.
#[derive(Clone, Debug)]
pub enum Surface {
    /// Triangles, in the coordinates of the group.
    Mesh(Arc<Mesh>),
    /// A shape, with the map to the coordinates of the group.
    Shape(Arc<AnyShape>, Transform),
    /// Spheres, in the coordinates of the group.
    Spheres(Arc<Spheres>),
    /// Strands, in the coordinates of the group.
    Curves(Arc<Curves>),
    /// A removed geometry.
    Gone,
}

/// The objects that the ids in a world's hits stand for.
#[derive(Debug, Default)]
pub struct Names {
    /// For each geometry of the world, the number of its object in the scene that holds the object.
    objects: Vec<u32>,
    /// The name of each geometry's object.
    labels: Vec<Option<Arc<str>>>,
    /// The materials of each geometry by slot, in the scene that holds the object.
    materials: Vec<Vec<Option<MaterialId>>>,
    /// Surfaces by geometry of the world.
    pub surfaces: Vec<Surface>,
    /// The instances in each scene, the root's first, ascending by occurrence.
    scenes: Vec<Vec<Step>>,
}

/// An instance in a scene, or a moved object of it.
#[derive(Debug)]
struct Step {
    /// Its first occurrence, counted from that of the scene that holds it.
    first: u32,
    /// The number of the instance; [`Hit::NONE`] for an object that only is moved.
    id: u32,
    /// The name of the instance.
    label: Option<Arc<str>>,
    /// The material of the instance for objects that have none.
    material: Option<MaterialId>,
    /// The position of the instanced scene in [`Names::scenes`].
    scene: Option<usize>,
}

impl Names {
    /// The number of a geometry's object in the scene that holds the object.
    #[inline]
    pub fn object(&self, geometry: u32) -> u32 {
        self.objects.get(geometry as usize).copied().unwrap_or(Hit::NONE)
    }

    /// The number of the instance that an occurrence is in; [`Hit::NONE`] for occurrences outside
    /// of all instances.
    #[inline]
    pub fn instance(&self, occurrence: u32) -> u32 {
        self.steps(occurrence).next().map_or(Hit::NONE, |step| step.id)
    }

    /// The instances that an occurrence is in, the outermost first.
    fn steps(&self, occurrence: u32) -> impl Iterator<Item = &Step> {
        let (mut scene, mut rest) = ((occurrence != Hit::NONE).then_some(0), occurrence);
        let steps = std::iter::from_fn(move || {
            let all: &[Step] = self.scenes.get(scene?)?;
            let at = all.partition_point(|step| step.first <= rest).checked_sub(1)?;
            rest -= all[at].first;
            scene = all[at].scene;
            Some(&all[at])
        });
        steps.filter(|step| step.id != Hit::NONE)
    }

    /// The numbers of the instances that an occurrence is in, the outermost first; each in the
    /// scene that holds it.
    pub fn path(&self, occurrence: u32) -> impl Iterator<Item = u32> {
        self.steps(occurrence).map(|step| step.id)
    }

    /// The number of the material of a hit, in the scene that holds the object, or that holds the
    /// innermost instance with a material; [`Hit::NONE`] without a material.
    pub fn material(&self, occurrence: u32, geometry: u32, primitive: u32) -> u32 {
        let Some(slots) = self.materials.get(geometry as usize) else { return Hit::NONE };
        let slot = match &self.surfaces[geometry as usize] {
            Surface::Mesh(mesh) => mesh.attributes().material_slots.get(primitive as usize),
            _ => None,
        };
        let own = slots.get(slot.map_or(0, |&slot| usize::from(slot))).copied().flatten();
        let handed = || self.steps(occurrence).filter_map(|step| step.material).last();
        own.or_else(handed).map_or(Hit::NONE, |id| id.0)
    }

    /// Maximum number of instances within each other.
    pub fn depth(&self) -> usize {
        // Scenes come before those that instance them, but for the root, which is the first.
        let mut depths = vec![0; self.scenes.len()];
        for scene in (1..self.scenes.len()).chain([0]) {
            let below = |step: &Step| step.scene.map_or(0, |below| depths[below] + 1);
            let depth = self.scenes.get(scene).into_iter().flatten().map(below).max();
            if let Some(place) = depths.get_mut(scene) {
                *place = depth.unwrap_or(0);
            }
        }
        depths.first().copied().unwrap_or(0)
    }

    /// The name of the object of a hit: the names of the instances around it and its own, with
    /// slashes between them. What has no name is called by its number; an object in no instance
    /// that has none, by nothing.
    pub fn label(&self, occurrence: u32, geometry: u32) -> String {
        let Some(own) = self.labels.get(geometry as usize) else { return String::new() };
        let called = |label: &Option<Arc<str>>, id: u32| {
            label.as_deref().map_or_else(|| id.to_string(), str::to_string)
        };
        let around: Vec<_> =
            self.steps(occurrence).map(|step| called(&step.label, step.id)).collect();
        if around.is_empty() {
            return own.as_deref().unwrap_or_default().to_string();
        }
        around.join("/") + "/" + &called(own, self.object(geometry))
    }

    /// True if surfaces can be computed without the ray that hit them.
    pub fn are_all_meshes(&self) -> bool {
        self.surfaces.iter().all(|s| matches!(s, Surface::Mesh(_) | Surface::Gone))
    }
}

/// A world and the meaning of its ids. A snapshot never changes.
#[derive(Debug)]
pub struct Snapshot<F: Form> {
    /// The world in which rays are traced.
    pub world: Arc<F::World>,
    /// The meaning of the world's ids.
    pub names: Arc<Names>,
    /// The times of the world; `None` if nothing moves.
    pub axis: Option<Axis>,
}

/// A kind of world built from a scene.
pub trait Form: 'static {
    /// The type of the world.
    type World: Send + Sync + std::fmt::Debug + 'static;
    /// The type of the world's builder.
    type Builder: Builder;

    /// Builds a world, sharing unchanged parts with the previous one.
    fn build(
        builder: Self::Builder,
        options: &BuildOptions,
        previous: Option<&Self::World>,
    ) -> Result<Self::World, WorldError>;

    /// The transform of an occurrence at a time of the world.
    fn placed(world: &Self::World, occurrence: u32, time: f32) -> Transform;
}

/// A builder of groups and geometries.
pub trait Builder: Default {
    /// Adds a group.
    fn add_group(&mut self) -> GroupId;
    /// Adds triangles to a group.
    fn add_mesh(&mut self, group: GroupId, mesh: &Mesh) -> GeometryId;
    /// Adds a shape to a group.
    fn add_shape(&mut self, group: GroupId, shape: &Arc<AnyShape>, placed: Transform)
    -> GeometryId;
    /// Adds spheres to a group.
    fn add_spheres(&mut self, group: GroupId, spheres: &Arc<Spheres>) -> GeometryId;
    /// Adds strands to a group.
    fn add_curves(&mut self, group: GroupId, curves: &Arc<Curves>) -> GeometryId;
    /// Reserves an unused number for a geometry.
    fn add_gap(&mut self);
    /// Adds an instance of a group to a group.
    fn add(&mut self, group: GroupId, instance: Instance);
    /// Sets the mask of a geometry.
    fn set_mask(&mut self, geometry: GeometryId, mask: u32);
}

struct Assembler<F: Form> {
    builder: F::Builder,
    names: Names,
    axis: Option<Axis>,
    /// The group of each instanced scene, its number of occurrences, and its position in
    /// [`Names::scenes`]. The scene is kept alive, so that no other scene gets its address.
    scenes: HashMap<*const Contents, (GroupId, u64, usize)>,
}

/// Builds the world of a scene, sharing unchanged parts with `previous`.
pub fn assemble<F: Form>(
    contents: &Contents,
    options: &BuildOptions,
    previous: Option<&F::World>,
) -> Result<Snapshot<F>, WorldError> {
    let mut assembler: Assembler<F> = Assembler {
        builder: F::Builder::default(),
        names: Names::default(),
        axis: Axis::of(contents),
        scenes: HashMap::new(),
    };
    assembler.names.scenes.push(Vec::new());
    let (_, steps) = assembler.fill(WorldBuilder::ROOT, contents);
    assembler.names.scenes[0] = steps;
    let Assembler { builder, names, axis, .. } = assembler;
    let world = Arc::new(F::build(builder, options, previous)?);
    Ok(Snapshot { world, names: Arc::new(names), axis })
}

impl<F: Form> Assembler<F> {
    /// Adds the objects of a scene to the scene's group. Returns the number of occurrences (the
    /// group and everything below it) and the scene's instances.
    fn fill(&mut self, group: GroupId, contents: &Contents) -> (u64, Vec<Step>) {
        let (mut occurrences, mut steps) = (1u64, Vec::new());
        for (number, slot) in contents.slots.iter().enumerate() {
            let Slot::Here(object) = slot else {
                self.builder.add_gap();
                self.name(Hit::NONE, None, Surface::Gone);
                if let Slot::Gone(true) = slot {
                    self.builder.add_group();
                }
                continue;
            };
            let number = number as u32;
            let (child, below, instance, scene) = match &object.kind {
                Kind::Instance(scene) => {
                    let (child, below, scene) = self.scene(scene);
                    (child, below, number, Some(scene))
                }
                _ if object.has_own_group() => {
                    let own = self.builder.add_group();
                    self.geometry(own, Transform::IDENTITY, number, object);
                    (own, 1, Hit::NONE, None)
                }
                _ => {
                    let placed = object.transform.unwrap_or(Transform::IDENTITY);
                    self.geometry(group, placed, number, object);
                    continue;
                }
            };
            let mask = if instance == Hit::NONE { u32::MAX } else { object.mask };
            let placed = object.transform.unwrap_or(Transform::IDENTITY);
            let instance_of_group = Instance { mask, ..Instance::new(child, placed) };
            let instance_of_group = match (&object.motion, self.axis) {
                (Some(motion), Some(axis)) => axis.moving(instance_of_group, motion),
                _ => instance_of_group,
            };
            self.builder.add(group, instance_of_group);
            // A world with more occurrences than numbers is refused when it is built, so a clamped
            // number is never used.
            let first = occurrences.min(u32::MAX.into()) as u32;
            let label = scene.and(object.name.clone());
            let material = scene.and(object.materials.first().copied().flatten());
            steps.push(Step { first, id: instance, label, material, scene });
            occurrences = occurrences.saturating_add(below);
        }
        (occurrences, steps)
    }

    /// The group of an instanced scene, its number of occurrences, and its position in
    /// [`Names::scenes`].
    fn scene(&mut self, scene: &Arc<Contents>) -> (GroupId, u64, usize) {
        if let Some(&known) = self.scenes.get(&Arc::as_ptr(scene)) {
            return known;
        }
        let group = self.builder.add_group();
        let (occurrences, steps) = self.fill(group, scene);
        self.names.scenes.push(steps);
        let made = (group, occurrences, self.names.scenes.len() - 1);
        self.scenes.insert(Arc::as_ptr(scene), made);
        made
    }

    /// Adds an object to a group, with the map from its coordinates to the group's, which must be
    /// the identity for what is not a shape.
    fn geometry(&mut self, group: GroupId, placed: Transform, number: u32, object: &Object) {
        let (id, surface) = match &object.kind {
            Kind::Mesh(mesh) => (self.builder.add_mesh(group, mesh), Surface::Mesh(mesh.clone())),
            Kind::Shape(shape) => (
                self.builder.add_shape(group, shape, placed),
                Surface::Shape(shape.clone(), placed),
            ),
            Kind::Spheres(spheres) => {
                (self.builder.add_spheres(group, spheres), Surface::Spheres(spheres.clone()))
            }
            Kind::Curves(curves) => {
                (self.builder.add_curves(group, curves), Surface::Curves(curves.clone()))
            }
            Kind::Instance(_) => return,
        };
        self.builder.set_mask(id, object.mask);
        self.name(number, Some(object), surface);
    }

    fn name(&mut self, number: u32, object: Option<&Object>, surface: Surface) {
        self.names.objects.push(number);
        self.names.labels.push(object.and_then(|object| object.name.clone()));
        self.names.materials.push(object.map_or(Vec::new(), |object| object.materials.clone()));
        self.names.surfaces.push(surface);
    }
}
