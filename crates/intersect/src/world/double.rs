//! Worlds in double precision, for large coordinates such as those of a city with details of
//! millimetres.
//!
//! All methods are those of [`World`], with [`DTriangleMesh`]es, [`snell_math::DRay`]s and
//! [`crate::DHit`]s; only [`World::interaction`] is missing. The trees have the same form: they
//! hold the meshes relative to their centre, scaled and rounded to `f32`, to find the few triangles
//! that a ray may hit, which are then tested in `f64`.

use super::occurrence::Occurrences;
use super::reuse::Summary;
use super::{
    BuildOptions, BuildStats, EditError, Geometry, GeometryId, GroupBounds, GroupId, Instance,
    InstanceId, World, WorldBuilder, WorldError,
};
use crate::geometry::PrimitiveSet;
use crate::mesh::DTriangleMesh;
use crate::precision::DoubleData;
use crate::precision::frame::Frame;
use crate::shape::Shape;
use rayon::prelude::*;
use snell_math::{Bounds3d, Transform};
use std::sync::Arc;

/// Collects groups, geometries and instances, then builds a [`DWorld`]. Its methods are those of
/// [`WorldBuilder`].
#[derive(Clone, Debug, Default)]
pub struct DWorldBuilder {
    /// A builder in single precision that has an empty mesh in the place of each mesh.
    builder: WorldBuilder,
    /// The mesh of each geometry; empty for a geometry that is not a mesh.
    meshes: Vec<Arc<DTriangleMesh>>,
}

impl DWorldBuilder {
    /// The root group: world coordinates.
    pub const ROOT: GroupId = WorldBuilder::ROOT;

    /// Adds a new empty group; see [`WorldBuilder::add_group`].
    pub fn add_group(&mut self) -> GroupId {
        self.builder.add_group()
    }

    /// Puts a mesh into a group, in the group's coordinates. The mesh must be valid
    /// ([`DTriangleMesh::validate`]); triangles with two equal vertices, or with a vertex that is
    /// not finite, are never hit. A mesh in single precision converts into one in double precision.
    pub fn add_mesh(&mut self, group: GroupId, mesh: Arc<DTriangleMesh>) -> GeometryId {
        self.meshes.push(mesh);
        self.builder.add_mesh(group, Arc::default())
    }

    /// Puts a shape into a group; see [`WorldBuilder::add_shape`].
    pub fn add_shape(
        &mut self,
        group: GroupId,
        shape: Arc<dyn Shape>,
        group_from_shape: Transform,
    ) -> GeometryId {
        self.meshes.push(Arc::default());
        self.builder.add_shape(group, shape, group_from_shape)
    }

    /// Puts a set of primitives into a group; see [`WorldBuilder::add_set`].
    pub fn add_set(&mut self, group: GroupId, set: Arc<dyn PrimitiveSet>) -> GeometryId {
        self.meshes.push(Arc::default());
        self.builder.add_set(group, set)
    }

    /// Places `child` in `group`; see [`WorldBuilder::add_instance`].
    pub fn add_instance(
        &mut self,
        group: GroupId,
        child: GroupId,
        group_from_child: Transform,
    ) -> InstanceId {
        self.builder.add_instance(group, child, group_from_child)
    }

    /// Places an instance in `group`; see [`WorldBuilder::add`].
    pub fn add(&mut self, group: GroupId, instance: Instance) -> InstanceId {
        self.builder.add(group, instance)
    }

    /// Sets the mask of a geometry; see [`WorldBuilder::set_mask`].
    pub fn set_mask(&mut self, geometry: GeometryId, mask: u32) {
        self.builder.set_mask(geometry, mask);
    }

    /// Lets the filter of queries decide about hits on this geometry; see
    /// [`WorldBuilder::set_filtered`].
    pub fn set_filtered(&mut self, geometry: GeometryId) {
        self.builder.set_filtered(geometry);
    }

    /// Removes a geometry. Returns false if it was already removed; see [`WorldBuilder::remove`].
    pub fn remove(&mut self, geometry: GeometryId) -> bool {
        self.meshes[geometry.0 as usize] = Arc::default();
        self.builder.remove(geometry)
    }

    /// Replaces a mesh; its group, number, mask and filter stay. If the numbers of vertices and
    /// triangles are unchanged, [`Self::rebuild`] refits the tree where that is good enough.
    ///
    /// # Errors
    /// If the geometry was removed.
    pub fn set_mesh(
        &mut self,
        geometry: GeometryId,
        mesh: Arc<DTriangleMesh>,
    ) -> Result<(), EditError> {
        self.builder.replace(geometry, Geometry::Mesh(Arc::default()))?;
        self.meshes[geometry.0 as usize] = mesh;
        Ok(())
    }

    /// Moves an instance. Returns false if it was removed; see [`WorldBuilder::move_instance`].
    pub fn move_instance(&mut self, id: InstanceId, group_from_child: Transform) -> bool {
        self.builder.move_instance(id, group_from_child)
    }

    /// Removes an instance. Returns false if it was already removed; see
    /// [`WorldBuilder::remove_instance`].
    pub fn remove_instance(&mut self, id: InstanceId) -> bool {
        self.builder.remove_instance(id)
    }

    /// Builds the world; see [`WorldBuilder::build`].
    pub fn build(self, options: &BuildOptions) -> Result<DWorld, WorldError> {
        self.assemble(options, None)
    }

    /// Builds a world that shares with `previous` whatever did not change, and refits trees whose
    /// contents only moved; see [`WorldBuilder::rebuild`].
    pub fn rebuild(&self, options: &BuildOptions, previous: &DWorld) -> Result<DWorld, WorldError> {
        self.clone().assemble(options, Some(previous))
    }

    fn assemble(
        mut self,
        options: &BuildOptions,
        previous: Option<&DWorld>,
    ) -> Result<DWorld, WorldError> {
        let occurrences = Occurrences::count(&self.builder.groups)?;
        self.recognise(previous);
        let summaries = self.summaries(previous);
        let same_build = WorldBuilder::same_build(options, previous.map(|p| &p.world));
        let (mut bounds, unchanged) = self.builder.measure(&occurrences, &summaries, same_build);
        // Empty meshes stand for the meshes in double precision, until rounded copies replace them.
        let empty = self.builder.geometries.clone();
        let frame = |group: usize| match previous.filter(|_| unchanged[group]) {
            Some(previous) => previous.data.frames[group],
            None => self.enter_frame(group, &summaries, &mut bounds),
        };
        let frames = (0..unchanged.len()).map(frame).collect();
        let parts = self.builder.structures(
            options,
            &occurrences,
            summaries,
            (bounds, unchanged),
            same_build,
        )?;
        let mut world = self.builder.into_world(occurrences, parts);
        // The rounded copies are no longer needed; the empty meshes take their place again.
        world.geometries = empty;
        let known = |i: usize| previous.filter(|p| p.holds(i, &self.meshes[i])).map(|p| &p.data);
        let data = DoubleData::new(frames, &self.meshes, known);
        world.stats.memory_bytes += data.memory_bytes() as u64;
        Ok(DWorld { world, meshes: self.meshes, data })
    }

    /// Gives each mesh that the previous world also holds the same empty stand-in, so that the mesh
    /// is recognised as unchanged.
    fn recognise(&mut self, previous: Option<&DWorld>) {
        let Some(previous) = previous else { return };
        for (i, geometry) in self.builder.geometries.iter_mut().enumerate() {
            if matches!(geometry, Geometry::Mesh(_)) && previous.holds(i, &self.meshes[i]) {
                *geometry = previous.world.geometries[i].clone();
            }
        }
    }

    fn summaries(&self, previous: Option<&DWorld>) -> Vec<Summary> {
        let summary = |(i, geometry): (usize, &Geometry)| match (geometry, &self.meshes[i]) {
            (Geometry::Mesh(_), mesh) => match previous.filter(|p| p.holds(i, mesh)) {
                Some(previous) => previous.world.inventory.summaries[i].clone(),
                None => Summary {
                    bounds: mesh.bounds(),
                    count: mesh.indices.len() as u64,
                    skipped: (0..mesh.indices.len()).filter(|&i| mesh.is_degenerate(i)).count()
                        as u64,
                    cover: None,
                },
            },
            (other, _) => Summary::of(other),
        };
        self.builder.geometries.par_iter().enumerate().map(summary).collect()
    }

    /// Chooses the frame of a group, and transforms the group's meshes and the boxes of its objects
    /// to it.
    fn enter_frame(
        &mut self,
        group: usize,
        summaries: &[Summary],
        bounds: &mut GroupBounds,
    ) -> Frame {
        let objects = &mut bounds.objects[group];
        let finite =
            objects.iter().filter(|b| b.is_finite()).fold(Bounds3d::EMPTY, |all, b| all.union(b));
        let ids = &self.builder.groups[group].geometries;
        let meshes =
            ids.iter().map(|id| id.0 as usize).filter(|&id| !self.meshes[id].indices.is_empty());
        let all = meshes.fold(finite, |all, id| all.union(&summaries[id].bounds));
        let mut frame = Frame::of(&all);
        for b in objects {
            *b = frame.bounds(b);
        }
        for id in ids.iter().map(|id| id.0 as usize) {
            if let Geometry::Mesh(mesh) = &mut self.builder.geometries[id] {
                *mesh = Arc::new(frame.shadow(&self.meshes[id]));
            }
        }
        frame
    }
}

/// Geometries and instances in double precision, ready for queries. Immutable.
#[derive(Debug)]
pub struct DWorld {
    /// The world in single precision with an empty mesh for each mesh; it must not be queried
    /// directly.
    pub(crate) world: World,
    meshes: Vec<Arc<DTriangleMesh>>,
    pub(crate) data: DoubleData,
}

impl DWorld {
    /// True if the geometry with this number is the same mesh, compared by address.
    fn holds(&self, geometry: usize, mesh: &Arc<DTriangleMesh>) -> bool {
        let is_mesh = matches!(self.world.geometries.get(geometry), Some(Geometry::Mesh(_)));
        is_mesh && Arc::ptr_eq(&self.meshes[geometry], mesh)
    }

    /// The mesh with this number; `None` for a shape or a set.
    pub fn mesh(&self, id: GeometryId) -> Option<&Arc<DTriangleMesh>> {
        let is_mesh = matches!(self.world.geometry(id), Geometry::Mesh(_));
        is_mesh.then(|| &self.meshes[id.0 as usize])
    }

    /// The bounds of everything in world coordinates. They may have infinite sides, and are empty
    /// for an empty world.
    pub fn bounds(&self) -> Bounds3d {
        self.world.bounds()
    }

    /// Statistics of the build.
    pub fn stats(&self) -> &BuildStats {
        self.world.stats()
    }

    /// The number of occurrences of groups; see [`World::instance_count`].
    pub fn instance_count(&self) -> u32 {
        self.world.instance_count()
    }

    /// The path from the root to an occurrence; see [`World::instance_path`].
    pub fn instance_path(&self, instance: u32) -> Vec<(GroupId, usize)> {
        self.world.instance_path(instance)
    }

    /// The map from the coordinates of an occurrence's group to the world; see
    /// [`World::world_from_instance`].
    pub fn world_from_instance(&self, instance: u32) -> Transform {
        self.world.world_from_instance(instance)
    }

    /// That map at a time from 0 to 1; see [`World::world_from_instance_at`].
    pub fn world_from_instance_at(&self, instance: u32, time: f32) -> Transform {
        self.world.world_from_instance_at(instance, time)
    }
}

#[cfg(test)]
mod tests;
