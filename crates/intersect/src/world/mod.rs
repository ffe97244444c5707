//! Geometries, groups and instances, with nested acceleration structures.
//!
//! A *group* holds triangle meshes and sets of primitives (in the group's coordinates), analytic
//! shapes (each with its own placement) and instances of other groups. Group 0 is the root, and its
//! coordinates are those of the world. A group is stored once and its structure is built once,
//! however often and deep the group is instanced.
//!
//! Each path from the root to a group is an *occurrence*. Occurrences are numbered depth first: the
//! root is 0, then, for each instance in order of insertion, come the child and all occurrences
//! below it. [`crate::Hit::instance`] is this number, so a hit stays small at any depth, and
//! [`World::instance_path`] gives the path.

mod accelerator;
mod cover;
pub(crate) mod double;
pub mod dynamic;
mod edit;
mod facing;
mod interaction;
pub(crate) mod loose;
mod occurrence;
mod reuse;
pub mod smooth;
pub mod spheres;
pub mod tree_view;
pub mod triangles;
pub(crate) mod winding;

pub use accelerator::AcceleratorKind;
pub use dynamic::{DynamicWorld, Snapshots};
pub use edit::{EditError, InstanceId};
pub use interaction::interaction_on;
pub use reuse::Reuse;

use crate::build::Quality;
use crate::geometry::motion::transform_at;
use crate::geometry::{Heightfield, MovingMesh, PrimitiveSet, QuadMesh};
use crate::group::{BulkContents, GroupList, Object, Placement};
use crate::lecture::AcceleratorOptions;
use crate::lecture::walk::Structures;
use crate::mesh::TriangleMesh;
use crate::search::GeometryOptions;
use crate::shape::Shape;
use crate::tree::{CacheUse, Forest};
use cover::Cover;
use loose::Loose;
use occurrence::Occurrences;
use rayon::prelude::*;
use reuse::{Inventory, Summary};
use snell_math::simd::{Level, Wide};
use snell_math::{Bounds3d, DMat3, Transform};
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use winding::Winding;

/// Number of a group, in order of creation. The root is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GroupId(pub u32);

/// Number of a geometry, in order of insertion over all groups: [`crate::Hit::geometry`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GeometryId(pub u32);

/// Errors of a build.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WorldError {
    /// The group with this number contains itself.
    #[error(
        "group {0} contains itself, directly or through others; a scene graph must not have cycles"
    )]
    Cycle(u32),
    /// The number of occurrences of groups does not fit 32 bits.
    #[error(
        "more than 4294967294 instances when all nesting is counted; share less or split the scene"
    )]
    TooManyInstances,
    /// A limit of the structure is exceeded; the text names it and a remedy.
    #[error("{0}")]
    Limit(String),
}

/// Options of a build.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// The acceleration structure.
    pub accelerator: AcceleratorKind,
    /// Variants of the structure.
    pub accelerator_options: AcceleratorOptions,
    /// The quality of an [`AcceleratorKind::Bvh`]: build time against tracing speed.
    pub quality: Quality,
    /// Whether an [`AcceleratorKind::Bvh`] stores each vertex that several triangles share only
    /// once. It then takes about two thirds of the memory, and rays are somewhat slower. Hits do
    /// not change.
    pub compact: bool,
    /// A folder in which the [`AcceleratorKind::Bvh`] of large groups (65,536 triangles and more)
    /// is cached in files; the next build of the same group reads its file. The folder must be
    /// trusted, because hits are computed from its files. `None` disables the cache.
    pub cache: Option<PathBuf>,
    /// The SIMD instructions that the kernels use.
    pub simd: Level,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            accelerator: AcceleratorKind::default(),
            accelerator_options: AcceleratorOptions::default(),
            quality: Quality::default(),
            compact: false,
            cache: None,
            simd: Level::best(),
        }
    }
}

/// A geometry in the form in which it was added.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// A mesh in the coordinates of its group.
    Mesh(Arc<TriangleMesh>),
    /// Quadrilaterals in the coordinates of their group.
    Quads(Arc<QuadMesh>),
    /// A mesh whose vertices move, in the coordinates of its group.
    MovingMesh(Arc<MovingMesh>),
    /// Heights on a grid, in the coordinates of their group.
    Heightfield(Arc<Heightfield>),
    /// A shape and the transformation from its own coordinates to those of its group.
    Shape(Arc<dyn Shape>, Transform),
    /// Many primitives in the coordinates of their group.
    Set(Arc<dyn PrimitiveSet>),
}

/// An instance inside a group.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The instanced group.
    pub child: GroupId,
    /// The map from the child's coordinates to those of the group that holds the instance.
    pub group_from_child: Transform,
    /// Only rays whose mask has a bit in common with this one enter the instance.
    pub mask: u64,
    /// The map of a moving instance at its later keys; `group_from_child` is the map at the first.
    /// Between keys the matrices are interpolated linearly. Empty for a static instance.
    pub later: Vec<Transform>,
    /// The times of all keys, the first and the later ones: ascending, each from 0 to 1. The
    /// instance rests before the first and after the last. Empty if keys are evenly spaced in time
    /// from 0 to 1.
    pub times: Vec<f32>,
}

impl Instance {
    /// An instance that all rays may enter and that does not move.
    pub fn new(child: GroupId, group_from_child: Transform) -> Self {
        Self { child, group_from_child, mask: u64::MAX, later: Vec::new(), times: Vec::new() }
    }

    /// The map at every key, starting at the first.
    pub(crate) fn keys(&self) -> impl Iterator<Item = &Transform> {
        std::iter::once(&self.group_from_child).chain(&self.later)
    }

    /// The map at a time from 0 to 1. At times when the map is singular, so that the instance is
    /// not hit, the map at the first key.
    pub(crate) fn at(&self, time: f32) -> Transform {
        self.at_time(time).unwrap_or(self.group_from_child)
    }

    /// The map at a time from 0 to 1; `None` at times when the map is singular, so that the
    /// instance is not hit.
    pub fn at_time(&self, time: f32) -> Option<Transform> {
        if self.later.is_empty() {
            return Some(self.group_from_child);
        }
        transform_at(&self.group_from_child, &self.later, &self.times, time)
    }
}

impl Placement {
    /// The map of an instance.
    pub fn of(instance: &Instance) -> Self {
        if instance.later.is_empty() {
            Self::Still(*instance.group_from_child.inverse_matrix())
        } else {
            Self::Moving(instance.keys().copied().collect(), instance.times.clone().into())
        }
    }
}

impl BulkContents {
    /// A geometry whose primitives are separate objects of the tree.
    pub fn of(geometry: &Geometry) -> Option<Self> {
        match geometry {
            Geometry::Set(set) => Some(Self::Set(set.clone())),
            Geometry::MovingMesh(mesh) => Some(Self::MovingMesh(mesh.clone())),
            Geometry::Heightfield(field) => Some(Self::Heightfield(field.clone())),
            Geometry::Mesh(_) | Geometry::Quads(_) | Geometry::Shape(..) => None,
        }
    }
}

/// Collects groups, geometries and instances, then builds a [`World`].
#[derive(Clone, Debug)]
pub struct WorldBuilder {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) options: Vec<GeometryOptions>,
    pub(crate) groups: Vec<GroupContents>,
    /// The group of each geometry; `None` if it was removed.
    homes: Vec<Option<GroupId>>,
    /// The group of each instance; `None` if it was removed.
    instance_homes: Vec<Option<GroupId>>,
}

/// The contents of a group.
#[derive(Clone, Debug, Default)]
pub struct GroupContents {
    /// The geometries of the group, in ascending order.
    pub geometries: Vec<GeometryId>,
    /// The instances of the group, in order of insertion.
    pub instances: Vec<Instance>,
    /// The number of each instance, in ascending order.
    pub instance_ids: Vec<InstanceId>,
}

impl Default for WorldBuilder {
    fn default() -> Self {
        Self {
            geometries: Vec::new(),
            options: Vec::new(),
            groups: vec![GroupContents::default()],
            homes: Vec::new(),
            instance_homes: Vec::new(),
        }
    }
}

impl WorldBuilder {
    /// The root group: world coordinates.
    pub const ROOT: GroupId = GroupId(0);

    /// Adds a new empty group. It becomes part of the world when it is instanced.
    pub fn add_group(&mut self) -> GroupId {
        self.groups.push(GroupContents::default());
        GroupId((self.groups.len() - 1) as u32)
    }

    /// Puts a mesh into a group, in the group's coordinates. The mesh must be valid
    /// ([`TriangleMesh::validate`]); triangles that are degenerate or not finite are never hit.
    pub fn add_mesh(&mut self, group: GroupId, mesh: Arc<TriangleMesh>) -> GeometryId {
        self.add_geometry(group, Geometry::Mesh(mesh))
    }

    /// Puts quads into a group, in the group's coordinates.
    pub fn add_quads(&mut self, group: GroupId, quads: Arc<QuadMesh>) -> GeometryId {
        self.add_geometry(group, Geometry::Quads(quads))
    }

    /// Puts a mesh whose vertices move into a group, in the group's coordinates.
    pub fn add_moving_mesh(&mut self, group: GroupId, mesh: Arc<MovingMesh>) -> GeometryId {
        self.add_geometry(group, Geometry::MovingMesh(mesh))
    }

    /// Puts a shape into a group.
    pub fn add_shape(
        &mut self,
        group: GroupId,
        shape: Arc<dyn Shape>,
        group_from_shape: Transform,
    ) -> GeometryId {
        self.add_geometry(group, Geometry::Shape(shape, group_from_shape))
    }

    /// Puts a set of primitives into a group, in the group's coordinates: spheres, curves, or a
    /// user-defined set.
    pub fn add_set(&mut self, group: GroupId, set: Arc<dyn PrimitiveSet>) -> GeometryId {
        self.add_geometry(group, Geometry::Set(set))
    }

    /// Puts a heightfield into a group, in the group's coordinates. Its triangles are hit as those
    /// of a mesh, but no tree is built over them.
    pub fn add_heightfield(&mut self, group: GroupId, field: Arc<Heightfield>) -> GeometryId {
        self.add_geometry(group, Geometry::Heightfield(field))
    }

    fn add_geometry(&mut self, group: GroupId, geometry: Geometry) -> GeometryId {
        let id = GeometryId(self.geometries.len() as u32);
        let quads = matches!(geometry, Geometry::Quads(_));
        self.geometries.push(geometry);
        self.options.push(GeometryOptions { quads, ..GeometryOptions::default() });
        self.homes.push(Some(group));
        self.groups[group.0 as usize].geometries.push(id);
        id
    }

    /// Places `child` in `group`.
    pub fn add_instance(
        &mut self,
        group: GroupId,
        child: GroupId,
        group_from_child: Transform,
    ) -> InstanceId {
        self.add(group, Instance::new(child, group_from_child))
    }

    /// Places an instance in `group`.
    pub fn add(&mut self, group: GroupId, instance: Instance) -> InstanceId {
        let id = InstanceId(self.instance_homes.len() as u32);
        self.instance_homes.push(Some(group));
        let contents = &mut self.groups[group.0 as usize];
        contents.instances.push(instance);
        contents.instance_ids.push(id);
        id
    }

    /// Sets the mask of a geometry: only rays whose mask has a bit in common with it hit the
    /// geometry ([`crate::search::rays::RayQuery::mask`]). All bits are set by default.
    pub fn set_mask(&mut self, geometry: GeometryId, mask: u64) {
        self.options[geometry.0 as usize].mask = mask;
    }

    /// The mask of a geometry, and whether hits on it are filtered.
    pub fn options_mut(&mut self, geometry: GeometryId) -> &mut GeometryOptions {
        &mut self.options[geometry.0 as usize]
    }

    /// Lets the query's [`crate::HitFilter`] decide about hits on this geometry.
    pub fn set_filtered(&mut self, geometry: GeometryId) {
        self.options[geometry.0 as usize].filtered = true;
    }

    /// Builds the acceleration structures, on the threads of the current rayon pool. The result
    /// does not depend on the number of threads. A SIMD level that the processor lacks is replaced
    /// by its best level.
    pub fn build(self, options: &BuildOptions) -> Result<World, WorldError> {
        let (occurrences, parts) = on_the_pool(|| self.parts(options, None))?;
        Ok(self.into_world(occurrences, parts))
    }

    /// Builds a world that shares with `previous`, an earlier world of this builder (or of a copy
    /// of it), everything whose contents did not change; see [`DynamicWorld`]. Queries of the
    /// result give the same bits as after a build from scratch.
    pub fn rebuild(&self, options: &BuildOptions, previous: &World) -> Result<World, WorldError> {
        let (occurrences, parts) = on_the_pool(|| self.parts(options, Some(previous)))?;
        Ok(self.clone().into_world(occurrences, parts))
    }

    fn parts(
        &self,
        options: &BuildOptions,
        previous: Option<&World>,
    ) -> Result<(Occurrences, Parts), WorldError> {
        let occurrences = Occurrences::count(&self.groups)?;
        let summaries = self.summaries(previous);
        let same_build = Self::same_build(options, previous);
        let bounds = self.measure(&occurrences, &summaries, same_build);
        let parts = self.structures(options, &occurrences, summaries, bounds, same_build)?;
        Ok((occurrences, parts))
    }

    fn into_world(self, occurrences: Occurrences, parts: Parts) -> World {
        let Parts { bounds, structure, inventory, wide, stats } = parts;
        World {
            geometries: self.geometries,
            options: self.options,
            groups: self.groups,
            occurrences,
            bounds,
            structure,
            inventory,
            wide,
            stats,
            winding: OnceLock::new(),
            loose: OnceLock::new(),
            repeats: OnceLock::new(),
            all_filtered: OnceLock::new(),
        }
    }

    /// Prepares the contents of each group for intersection tests.
    fn group_lists(&self, occurrences: &Occurrences) -> Result<Vec<GroupList>, WorldError> {
        let list = |(group, contents): (usize, &GroupContents)| {
            let mut list = GroupList::default();
            for &id in &contents.geometries {
                match &self.geometries[id.0 as usize] {
                    Geometry::Mesh(mesh) => list.meshes.push((id.0, mesh.clone())),
                    Geometry::Quads(quads) => list.meshes.push((id.0, quads.triangles().clone())),
                    Geometry::Shape(shape, placed) => list.objects.push(Object::Shape {
                        shape: shape.clone(),
                        geometry: id.0,
                        shape_from_group: *placed.inverse_matrix(),
                    }),
                    Geometry::Set(_) | Geometry::MovingMesh(_) | Geometry::Heightfield(_) => {}
                }
            }
            for (instance, &offset) in contents.instances.iter().zip(&occurrences.offsets[group]) {
                list.objects.push(Object::Instance {
                    child: instance.child.0 as usize,
                    offset,
                    child_from_group: Placement::of(instance),
                    mask: instance.mask,
                });
            }
            for (id, set) in self.sets(contents) {
                if !list.objects.push_set(id.0, set) {
                    let limit = "a group holds more than 4294967295 primitives: spread them over \
                        several groups";
                    return Err(WorldError::Limit(limit.into()));
                }
            }
            Ok(list)
        };
        self.groups.iter().enumerate().map(list).collect()
    }

    /// The geometries of a group that consist of many objects, in the order in which they follow
    /// its shapes and instances in the tree.
    fn sets(&self, contents: &GroupContents) -> impl Iterator<Item = (GeometryId, BulkContents)> {
        contents
            .geometries
            .iter()
            .filter_map(|&id| Some((id, BulkContents::of(&self.geometries[id.0 as usize])?)))
    }

    fn count_triangles(
        &self,
        occurrences: &Occurrences,
        structure: &Structure,
        inventory: &Inventory,
    ) -> BuildStats {
        let mut stats = BuildStats { reuse: inventory.reuse, ..BuildStats::default() };
        for (geometry, summary) in self.geometries.iter().zip(&inventory.summaries) {
            match geometry {
                Geometry::Mesh(_)
                | Geometry::Quads(_)
                | Geometry::MovingMesh(_)
                | Geometry::Heightfield(_) => {
                    stats.triangles += summary.count;
                    stats.skipped_triangles += summary.skipped;
                }
                Geometry::Set(_) => {
                    stats.primitives += summary.count;
                    stats.skipped_primitives += summary.skipped;
                }
                Geometry::Shape(..) => {}
            }
        }
        let mut below = vec![0u64; self.groups.len()];
        for &group in &occurrences.order {
            let contents = &self.groups[group];
            let own = contents.geometries.iter().map(|g| match &self.geometries[g.0 as usize] {
                Geometry::Mesh(mesh) => mesh.indices.len() as u64,
                Geometry::Quads(quads) => 2 * quads.len() as u64,
                Geometry::MovingMesh(mesh) => mesh.len() as u64,
                Geometry::Heightfield(field) => field.triangle_count() as u64,
                Geometry::Shape(..) | Geometry::Set(_) => 0,
            });
            let placed = contents.instances.iter().map(|i| below[i.child.0 as usize]);
            below[group] = own.chain(placed).fold(0, u64::saturating_add);
        }
        stats.instanced_triangles = below[0];
        if let Structure::Bvh(forest) = structure {
            stats.cached_groups =
                forest.trees.iter().filter(|t| t.cache == CacheUse::Read).count() as u64;
            stats.nodes = forest.trees.iter().map(|t| t.nodes.len() as u64).sum();
            stats.triangle_blocks = forest.trees.iter().map(|t| t.blocks.count() as u64).sum();
            stats.depth = forest.trees.iter().map(|t| t.depth as u32).max().unwrap_or(0);
            stats.memory_bytes = forest.memory_bytes() as u64;
            stats.sah_cost = forest.trees[0].sah_cost;
        }
        if let Structure::Walked(structures) = structure {
            let size = structures.size();
            stats.nodes = size.nodes;
            stats.references = size.references;
            stats.depth = size.depth;
            stats.memory_bytes = size.bytes;
        }
        stats
    }
}

/// The largest number of cover boxes to transform for the instances of a group. If it would be
/// exceeded, each instance has one box.
const MAX_PIECES: usize = 1 << 24;

/// The bounds of all groups and of their objects.
struct GroupBounds {
    /// Bounds of each group in its own coordinates.
    exact: Vec<Bounds3d>,
    /// For each group the boxes of its shapes, instances and primitives of sets, in the order of
    /// [`GroupList::objects`], grown by the largest error of transforming a ray.
    objects: Vec<Vec<Bounds3d>>,
    /// Bounds of each group in its own coordinates, grown by the same margins as `objects`.
    grown: Vec<Bounds3d>,
    /// The cover of each group; empty if the cover of one of its meshes was not computed.
    covers: Vec<Cover>,
}

impl GroupBounds {
    fn empty(groups: usize) -> Self {
        let none = vec![Bounds3d::EMPTY; groups];
        let covers = vec![Cover::default(); groups];
        Self { exact: none.clone(), objects: vec![Vec::new(); groups], grown: none, covers }
    }

    /// Computes the bounds of a group, after those of the groups that it instances.
    fn measure(&mut self, builder: &WorldBuilder, summaries: &[Summary], group: usize) {
        let contents = &builder.groups[group];
        let (mut exact, mut outer) = (Bounds3d::EMPTY, Bounds3d::EMPTY);
        let mut objects = Vec::new();
        for &id in &contents.geometries {
            match &builder.geometries[id.0 as usize] {
                Geometry::Mesh(_) | Geometry::Quads(_) => {
                    let b = summaries[id.0 as usize].bounds;
                    (exact, outer) = (exact.union(&b), outer.union(&b));
                }
                Geometry::Shape(shape, placed) => {
                    let b = shape.bounds();
                    exact = exact.union(&placed.bounds(&b));
                    objects.push(grown_bounds(placed, &b));
                }
                Geometry::Set(_) | Geometry::MovingMesh(_) | Geometry::Heightfield(_) => {}
            }
        }
        for instance in &contents.instances {
            let child = instance.child.0 as usize;
            let images = instance.keys().map(|map| map.bounds(&self.exact[child]));
            exact = images.fold(exact, |all, b| all.union(&b));
        }
        let pieces: usize =
            contents.instances.iter().map(|i| self.covers[i.child.0 as usize].len()).sum();
        let instance_box = |instance: &Instance| {
            let child = instance.child.0 as usize;
            if pieces > MAX_PIECES || !instance.later.is_empty() || self.covers[child].is_empty() {
                return instance_bounds(instance, &self.grown[child]);
            }
            self.covers[child]
                .iter()
                .fold(Bounds3d::EMPTY, |all, b| all.union(&instance_bounds(instance, b)))
        };
        objects.par_extend(contents.instances.par_iter().with_min_len(16).map(instance_box));
        for (_, set) in builder.sets(contents) {
            let first = objects.len();
            objects.par_extend(
                (0..set.len()).into_par_iter().with_min_len(1024).map(|i| set.bounds(i)),
            );
            exact = objects[first..].iter().fold(exact, |all, b| all.union(b));
            objects[first..]
                .par_iter_mut()
                .for_each(|b| *b = grown_bounds(&Transform::IDENTITY, b));
        }
        let is_mesh = |id: &&GeometryId| {
            matches!(builder.geometries[id.0 as usize], Geometry::Mesh(_) | Geometry::Quads(_))
        };
        let meshes = contents
            .geometries
            .iter()
            .filter(is_mesh)
            .map(|id| summaries[id.0 as usize].cover.as_ref());
        if let Some(meshes) = meshes.collect::<Option<Vec<_>>>() {
            self.covers[group] = cover::of_group(meshes.into_iter(), &objects);
        }
        self.exact[group] = exact;
        self.grown[group] = objects.iter().fold(outer, |a, b| a.union(b));
        self.objects[group] = objects;
    }
}

/// Runs a closure on a thread of the current rayon pool, so that its parallel stages need not wait
/// for a thread to wake up.
fn on_the_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// The box of a placed object, grown by a bound on the rounding errors of its placement and of rays
/// transformed into its coordinates.
fn grown_bounds(placed: &Transform, b: &Bounds3d) -> Bounds3d {
    let image = placed.bounds(b);
    if image.is_empty() || !b.is_finite() {
        return image;
    }
    let m = placed.matrix();
    let size = abs_matrix(&m.matrix3) * b.min.abs().max(b.max.abs()) + m.translation.abs();
    let margin = (size + image.size()) * 1e-13;
    Bounds3d { min: image.min - margin, max: image.max + margin }
}

/// The box of an instance at all times, grown for rounding like [`grown_bounds`]. Between keys
/// every point moves on a straight line, so the boxes at the keys contain it. The margin is larger
/// if the instance moves, because the inverse of an interpolated matrix may be less accurate.
fn instance_bounds(instance: &Instance, b: &Bounds3d) -> Bounds3d {
    let all = instance
        .keys()
        .map(|map| grown_bounds(map, b))
        .fold(Bounds3d::EMPTY, |all, b| all.union(&b));
    if instance.later.is_empty() || !all.is_finite() {
        return all;
    }
    let margin = all.size() * 1e-6;
    Bounds3d { min: all.min - margin, max: all.max + margin }
}

/// The matrix of the absolute values of the entries.
fn abs_matrix(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

/// The result of a build.
struct Parts {
    bounds: Bounds3d,
    structure: Structure,
    inventory: Inventory,
    wide: Option<Wide>,
    stats: BuildStats,
}

/// The acceleration structure of a world.
#[derive(Debug)]
pub(crate) enum Structure {
    /// No structure: every primitive is tested.
    None(Vec<GroupList>),
    /// A tree for each group.
    Bvh(Forest),
    /// One of the lecture's structures for each group.
    Walked(Structures),
}

/// Geometries and instances, ready for queries. A world is immutable.
#[derive(Debug)]
pub struct World {
    pub(crate) geometries: Vec<Geometry>,
    pub(crate) options: Vec<GeometryOptions>,
    groups: Vec<GroupContents>,
    occurrences: Occurrences,
    bounds: Bounds3d,
    pub(crate) structure: Structure,
    inventory: Inventory,
    /// The SIMD level of queries; holding it proves that the processor has it.
    pub(crate) wide: Option<Wide>,
    stats: BuildStats,
    /// The data for winding numbers, computed at first use.
    pub(crate) winding: OnceLock<Winding>,
    /// The triangles that have a distance but are never hit; found at first use.
    pub(crate) loose: OnceLock<Vec<Loose>>,
    /// True if the structure may report a hit several times; computed at first use.
    pub(crate) repeats: OnceLock<bool>,
    /// The options of all geometries with hits filtered, for filters that decide about every hit.
    all_filtered: OnceLock<Vec<GeometryOptions>>,
}

/// Statistics of a build.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildStats {
    /// Triangles of all meshes, each mesh counted once; a quad counts as two triangles.
    pub triangles: u64,
    /// Triangles that can never be hit ([`TriangleMesh::is_degenerate`]); part of `triangles`.
    pub skipped_triangles: u64,
    /// Triangles in the world, counted once per occurrence.
    pub instanced_triangles: u64,
    /// Primitives of all sets (spheres, curves), each counted once.
    pub primitives: u64,
    /// Primitives of sets that can never be hit: part of `primitives`.
    pub skipped_primitives: u64,
    /// Groups whose structure was found in a file of [`BuildOptions::cache`].
    pub cached_groups: u64,
    /// Nodes of acceleration structures.
    pub nodes: u64,
    /// Blocks of up to eight triangles in the leaves.
    pub triangle_blocks: u64,
    /// Entries in the lists of primitives, for structures that have lists.
    pub references: u64,
    /// Depth of the deepest tree: the number of nodes on the longest path from the root of any
    /// group.
    pub depth: u32,
    /// Memory of the acceleration structures in bytes, without the geometries.
    pub memory_bytes: u64,
    /// The expected number of nodes and triangle blocks that a random line through the root's
    /// bounds visits, by the surface area heuristic, without the contents of instances.
    pub sah_cost: f32,
    /// How much was reused from the previous world.
    pub reuse: Reuse,
}

impl World {
    /// The geometry with this number.
    pub fn geometry(&self, id: GeometryId) -> &Geometry {
        &self.geometries[id.0 as usize]
    }

    /// The number of geometries; their ids run from 0.
    pub fn geometry_count(&self) -> usize {
        self.geometries.len()
    }

    /// The contents of a group.
    pub fn group(&self, id: GroupId) -> &GroupContents {
        &self.groups[id.0 as usize]
    }

    /// Number of analytic shapes, each counted once.
    pub fn shape_count(&self) -> usize {
        self.geometries.iter().filter(|g| matches!(g, Geometry::Shape(..))).count()
    }

    /// The number of the instance that leads to an occurrence ([`crate::Hit::instance`]) in the
    /// last step of its [`Self::instance_path`]. `None` for the root.
    pub fn instance_id(&self, occurrence: u32) -> Option<InstanceId> {
        let (group, at) = self.instance_path(occurrence).pop()?;
        Some(self.group(group).instance_ids[at])
    }

    /// The options of all geometries for a query with this filter.
    #[inline]
    pub(crate) fn options_for(&self, filters_all: bool) -> &[GeometryOptions] {
        if !filters_all {
            return &self.options;
        }
        self.all_filtered.get_or_init(|| {
            self.options.iter().map(|o| GeometryOptions { filtered: true, ..*o }).collect()
        })
    }

    /// A world without contents.
    fn empty(options: &BuildOptions) -> Self {
        WorldBuilder::default().build(options).expect("nothing exceeds no limit")
    }

    /// The number of groups; their ids run from 0.
    pub fn group_count(&self) -> usize {
        self.groups.len()
    }

    /// The numbers of all groups, children before parents.
    pub(crate) fn children_first(&self) -> impl Iterator<Item = usize> {
        self.occurrences.order.iter().copied()
    }

    /// The number of occurrences that one instance of a group adds: one for the group itself, and
    /// one for each occurrence below it.
    pub fn occurrences_below(&self, id: GroupId) -> u32 {
        self.occurrences.counts[id.0 as usize] as u32
    }

    /// The bounds of everything in world coordinates. They may have infinite sides, and are empty
    /// for an empty world.
    pub fn bounds(&self) -> Bounds3d {
        self.bounds
    }

    /// The bounds of everything in a group, in its own coordinates. They may have infinite sides,
    /// and are empty for an empty group.
    pub fn group_bounds(&self, id: GroupId) -> Bounds3d {
        self.inventory.exact[id.0 as usize]
    }

    /// Statistics of the build.
    pub fn stats(&self) -> &BuildStats {
        &self.stats
    }

    /// Warnings of the build: files in the folder [`BuildOptions::cache`] that were damaged or
    /// could not be written, and coordinates so large that they make rays slow.
    pub fn warnings(&self) -> Vec<String> {
        let Structure::Bvh(forest) = &self.structure else { return Vec::new() };
        let warning = |tree: &std::sync::Arc<crate::tree::GroupTree>| match &tree.cache {
            CacheUse::Failed(warning) => Some(warning.clone()),
            _ => None,
        };
        let slow = (!forest.ordinary).then(|| {
            let reach = forest.extents.iter().copied().fold(0.0, f32::max);
            let limit = crate::exact::prepared::MAX_COORDINATE;
            format!(
                "coordinates reach {reach:.1e}, and beyond {limit:.0e} all rays are several times \
                    as slow; move what lies so far out, \
                 or scale the scene"
            )
        });
        let blurred = forest.ordinary.then(|| forest.blurred()).flatten().map(|reach| {
            format!(
                "coordinates reach {reach:.1e}, where single precision is {:.1e} apart: that is \
                    more than the size of most \
                 things, so that rays meet nearly all of them and are slow; move what lies so far \
                 out, or scale it down",
                reach * f32::EPSILON
            )
        });
        forest.trees.iter().filter_map(warning).chain(slow).chain(blurred).collect()
    }

    /// Memory of the acceleration structures in bytes, without the geometries.
    pub fn memory_bytes(&self) -> u64 {
        self.stats.memory_bytes
    }

    /// Triangles of all meshes, each mesh counted once.
    pub fn triangle_count(&self) -> u64 {
        self.stats.triangles
    }

    /// Triangles in the world, counted once per occurrence.
    pub fn instanced_triangle_count(&self) -> u64 {
        self.stats.instanced_triangles
    }

    /// Triangles that can never be hit: degenerate, or with a vertex that is not finite.
    pub fn skipped_triangles(&self) -> u64 {
        self.stats.skipped_triangles
    }

    /// The SIMD level of the queries.
    pub fn simd(&self) -> Level {
        Level::of(self.wide)
    }
}

#[cfg(test)]
pub(crate) mod tests;
