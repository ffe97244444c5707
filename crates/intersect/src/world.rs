//! Geometries, groups and instances: accelerators over accelerators.
//!
//! A *group* holds triangle meshes (in the group's coordinates), analytic shapes (each with its own placement) and instances of
//! other groups. Group 0 is the root, and its coordinates are the world's. A group is stored and accelerated once, however often
//! and however deep it is instanced.
//!
//! Each way to reach a group from the root is an *occurrence*, numbered depth first: the root is 0, then, instance by instance in
//! order of insertion, the child followed by all that is below it. [`crate::Hit::instance`] is this number, so a hit stays small at
//! any depth, and [`World::instance_path`] gives the way back.

use crate::accel::AcceleratorKind;
use crate::hit::{Hit, SurfaceInteraction};
use crate::mesh::TriangleMesh;
use crate::query::HitFilter;
use crate::shape::Shape;
use snell_math::simd::Level;
use snell_math::{Bounds3d, DRay, Ray, Transform, Vec2, Vec3};
use std::sync::Arc;

/// Number of a group, in order of creation. The root is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GroupId(pub u32);

/// Number of a geometry, in order of insertion over all groups: [`Hit::geometry`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GeometryId(pub u32);

/// Why a world could not be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WorldError {
    /// A group contains itself.
    #[error("group {0} contains itself, directly or through others; a scene graph must not have cycles")]
    Cycle(u32),
    /// More occurrences of groups than 32-bit numbers.
    #[error("more than 4294967294 instances when all nesting is counted; share less or split the scene")]
    TooManyInstances,
    /// A limit of the structure, with what to do.
    #[error("{0}")]
    Limit(String),
}

/// How to build.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// Which acceleration structure.
    pub accelerator: AcceleratorKind,
    /// Which instructions the kernels use.
    pub simd: Level,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { accelerator: AcceleratorKind::default(), simd: Level::best() }
    }
}

/// A geometry as it was given.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// A mesh in the coordinates of its group.
    Mesh(Arc<TriangleMesh>),
    /// A shape and the map from its own coordinates to those of its group.
    Shape(Arc<dyn Shape>, Transform),
}

/// An instance inside a group.
#[derive(Clone, Debug)]
pub struct Instance {
    /// What is placed.
    pub child: GroupId,
    /// The map from the child's coordinates to those of the group that holds the instance.
    pub group_from_child: Transform,
}

/// Collects groups, geometries and instances, then builds a [`World`].
#[derive(Debug)]
pub struct WorldBuilder {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) filtered: Vec<bool>,
    pub(crate) groups: Vec<GroupContents>,
}

/// What a group holds.
#[derive(Clone, Debug, Default)]
pub struct GroupContents {
    /// Geometries, ascending.
    pub geometries: Vec<GeometryId>,
    /// Instances in order of insertion.
    pub instances: Vec<Instance>,
}

impl Default for WorldBuilder {
    fn default() -> Self {
        Self { geometries: Vec::new(), filtered: Vec::new(), groups: vec![GroupContents::default()] }
    }
}

impl WorldBuilder {
    /// The root group: world coordinates.
    pub const ROOT: GroupId = GroupId(0);

    /// A new empty group; it is not in the world until it is instanced.
    pub fn add_group(&mut self) -> GroupId {
        self.groups.push(GroupContents::default());
        GroupId((self.groups.len() - 1) as u32)
    }

    /// Puts a mesh into a group, in the group's coordinates. The mesh must be valid ([`TriangleMesh::validate`]); triangles that
    /// are degenerate or not finite are never hit.
    pub fn add_mesh(&mut self, group: GroupId, mesh: Arc<TriangleMesh>) -> GeometryId {
        self.add_geometry(group, Geometry::Mesh(mesh))
    }

    /// Puts a shape into a group.
    pub fn add_shape(&mut self, group: GroupId, shape: Arc<dyn Shape>, group_from_shape: Transform) -> GeometryId {
        self.add_geometry(group, Geometry::Shape(shape, group_from_shape))
    }

    fn add_geometry(&mut self, group: GroupId, geometry: Geometry) -> GeometryId {
        let id = GeometryId(self.geometries.len() as u32);
        self.geometries.push(geometry);
        self.filtered.push(false);
        self.groups[group.0 as usize].geometries.push(id);
        id
    }

    /// Places `child` in `group`.
    pub fn add_instance(&mut self, group: GroupId, child: GroupId, group_from_child: Transform) {
        self.groups[group.0 as usize].instances.push(Instance { child, group_from_child });
    }

    /// Hits on this geometry are asked about: the query's [`HitFilter`] may reject them.
    pub fn set_filtered(&mut self, geometry: GeometryId) {
        self.filtered[geometry.0 as usize] = true;
    }

    /// Builds the acceleration structures.
    pub fn build(self, _options: &BuildOptions) -> Result<World, WorldError> {
        let occurrences = count_occurrences(&self.groups)?;
        let mut world = World {
            geometries: self.geometries,
            filtered: self.filtered,
            groups: self.groups,
            occurrences,
            bounds: Bounds3d::EMPTY,
        };
        world.bounds = world.group_bounds(GroupId(0));
        Ok(world)
    }
}

/// For each group, how many occurrences (itself and all below) one instance of it adds.
fn count_occurrences(groups: &[GroupContents]) -> Result<Vec<u64>, WorldError> {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done(u64),
    }
    let mut state = vec![State::New; groups.len()];
    // An explicit stack: files may nest deeper than the thread's stack.
    for start in 0..groups.len() {
        let mut stack = vec![(start, 0usize, 1u64)];
        if state[start] != State::New {
            continue;
        }
        state[start] = State::Open;
        while let Some((group, next, count)) = stack.pop() {
            match groups[group].instances.get(next) {
                None => {
                    if count > u64::from(u32::MAX) - 1 {
                        return Err(WorldError::TooManyInstances);
                    }
                    state[group] = State::Done(count);
                }
                Some(instance) => {
                    let child = instance.child.0 as usize;
                    match state[child] {
                        State::Done(n) => stack.push((group, next + 1, count.saturating_add(n))),
                        State::Open => return Err(WorldError::Cycle(child as u32)),
                        State::New => {
                            state[child] = State::Open;
                            stack.push((group, next, count));
                            stack.push((child, 0, 1));
                        }
                    }
                }
            }
        }
    }
    Ok(state.into_iter().map(|s| if let State::Done(n) = s { n } else { 1 }).collect())
}

/// Geometries and instances, ready for queries. Immutable.
#[derive(Debug)]
pub struct World {
    geometries: Vec<Geometry>,
    filtered: Vec<bool>,
    groups: Vec<GroupContents>,
    occurrences: Vec<u64>,
    bounds: Bounds3d,
}

/// What one ray cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounters {
    /// Nodes of acceleration structures whose boxes were tested.
    pub nodes_visited: u32,
    /// Triangles and shapes tested.
    pub primitives_tested: u32,
}

impl World {
    /// The geometry with this number.
    pub fn geometry(&self, id: GeometryId) -> &Geometry {
        &self.geometries[id.0 as usize]
    }

    /// How many geometries there are; ids run from 0.
    pub fn geometry_count(&self) -> usize {
        self.geometries.len()
    }

    /// What a group holds.
    pub fn group(&self, id: GroupId) -> &GroupContents {
        &self.groups[id.0 as usize]
    }

    /// How many groups there are; ids run from 0.
    pub fn group_count(&self) -> usize {
        self.groups.len()
    }

    /// How many occurrences one instance of a group adds: itself and all below.
    pub fn occurrences_below(&self, id: GroupId) -> u32 {
        self.occurrences[id.0 as usize] as u32
    }

    /// The box around everything, in world coordinates; may have infinite sides, is empty for an empty world.
    pub fn bounds(&self) -> Bounds3d {
        self.bounds
    }

    fn group_bounds(&self, id: GroupId) -> Bounds3d {
        let group = self.group(id);
        let own = group.geometries.iter().map(|&g| match self.geometry(g) {
            Geometry::Mesh(mesh) => mesh.bounds().into(),
            Geometry::Shape(shape, placed) => placed.bounds(&shape.bounds()),
        });
        let placed = group.instances.iter().map(|i| i.group_from_child.bounds(&self.group_bounds(i.child)));
        own.chain(placed).fold(Bounds3d::EMPTY, |a, b| a.union(&b))
    }

    /// Number of occurrences of groups in the world: [`Hit::instance`] is below it.
    pub fn instance_count(&self) -> u32 {
        self.occurrences[0] as u32
    }

    /// The way from the root to an occurrence: for each step the group and the position of the instance in its list. Empty for the
    /// root.
    pub fn instance_path(&self, instance: u32) -> Vec<(GroupId, usize)> {
        let mut path = Vec::new();
        let mut group = GroupId(0);
        let mut rest = u64::from(instance);
        while rest > 0 {
            rest -= 1;
            let Some(step) = self.group(group).instances.iter().position(|i| {
                let below = self.occurrences[i.child.0 as usize];
                if rest < below {
                    true
                } else {
                    rest -= below;
                    false
                }
            }) else {
                break;
            };
            path.push((group, step));
            group = self.group(group).instances[step].child;
        }
        path
    }

    /// The map from the coordinates of an occurrence's group to the world.
    pub fn world_from_instance(&self, instance: u32) -> Transform {
        self.instance_path(instance).into_iter().fold(Transform::IDENTITY, |m, (group, step)| {
            m.compose(&self.group(group).instances[step].group_from_child)
        })
    }

    /// The nearest hit of one ray.
    pub fn closest_one(&self, ray: &Ray, filter: &dyn HitFilter) -> Hit {
        let mut best = Hit::MISS;
        if ray.is_valid() {
            self.brute_force(ray, &DRay::from(ray), GroupId(0), 0, filter, &mut best);
        }
        best
    }

    /// True if anything lies in the interval of one ray.
    pub fn occluded_one(&self, ray: &Ray, filter: &dyn HitFilter) -> bool {
        self.closest_one(ray, filter).is_hit()
    }

    /// The nearest hit of one ray, and what it cost to find.
    pub fn closest_counted(&self, ray: &Ray, filter: &dyn HitFilter) -> (Hit, TraversalCounters) {
        (self.closest_one(ray, filter), TraversalCounters::default())
    }

    fn brute_force(
        &self,
        world_ray: &Ray,
        ray: &DRay,
        group: GroupId,
        instance: u32,
        filter: &dyn HitFilter,
        best: &mut Hit,
    ) {
        let contents = self.group(group);
        for &id in &contents.geometries {
            let mut offer = |t: f64, uv: Vec2, primitive: u32| {
                let hit = Hit { t: t as f32, uv, instance, geometry: id.0, primitive };
                let keep = hit.is_before(best) && hit.t > world_ray.t_min && hit.t < world_ray.t_max;
                if keep && (!self.filtered[id.0 as usize] || filter.accept(world_ray, &hit)) {
                    *best = hit;
                }
            };
            match self.geometry(id) {
                Geometry::Mesh(mesh) => {
                    for triangle in 0..mesh.indices.len() {
                        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
                        let (e1, e2) = (b - a, c - a);
                        let p = ray.direction.cross(e2);
                        let det = e1.dot(p);
                        let s = ray.origin - a;
                        let u = s.dot(p) / det;
                        let q = s.cross(e1);
                        let v = ray.direction.dot(q) / det;
                        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                            offer(e2.dot(q) / det, Vec2::new(u as f32, v as f32), triangle as u32);
                        }
                    }
                }
                Geometry::Shape(shape, placed) => {
                    if let Some(hit) = shape.closest(&placed.inverse().ray(ray)) {
                        offer(hit.t, Vec2::ZERO, hit.face);
                    }
                }
            }
        }
        let mut first = instance + 1;
        for child in &contents.instances {
            self.brute_force(world_ray, &child.group_from_child.inverse().ray(ray), child.child, first, filter, best);
            first += self.occurrences[child.child.0 as usize] as u32;
        }
    }

    /// Everything local about the surface at `hit`, which `ray` found.
    ///
    /// # Panics
    /// If `hit` is a miss or does not belong to this world.
    pub fn interaction(&self, ray: &Ray, hit: &Hit) -> SurfaceInteraction {
        let world_from_group = self.world_from_instance(hit.instance);
        let mut result = SurfaceInteraction {
            position: ray.at(hit.t),
            position_error: Vec3::splat(1e-5),
            geometric_normal: Vec3::Z,
            shading_normal: Vec3::Z,
            uv: [Vec2::ZERO; 2],
            dpdu: Vec3::X,
            dpdv: Vec3::Y,
            tangent: None,
            color: [1.0; 4],
            t: hit.t,
            primitive_uv: hit.uv,
            instance: hit.instance,
            geometry: hit.geometry,
            primitive: hit.primitive,
        };
        match self.geometry(GeometryId(hit.geometry)) {
            Geometry::Mesh(mesh) => {
                let [a, b, c] = mesh.corners(hit.primitive as usize).map(|p| p.as_dvec3());
                let n = world_from_group.normal((b - a).cross(c - a)).normalize().as_vec3();
                result.geometric_normal = n;
                result.shading_normal = n;
            }
            Geometry::Shape(shape, placed) => {
                let world_from_shape = world_from_group.compose(placed);
                let p = world_from_shape.inverse().point(DRay::from(ray).at(hit.t.into()));
                let surface = shape.surface(p, hit.primitive);
                result.position = world_from_shape.point(surface.position).as_vec3();
                result.geometric_normal = world_from_shape.normal(surface.normal).normalize().as_vec3();
                result.shading_normal = result.geometric_normal;
                result.uv = [surface.uv.as_vec2(); 2];
                result.dpdu = world_from_shape.vector(surface.dpdu).as_vec3();
                result.dpdv = world_from_shape.vector(surface.dpdv).as_vec3();
            }
        }
        result
    }
}
