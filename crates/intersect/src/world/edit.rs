//! Edits of a builder: between builds, geometries and instances are added, removed, moved and
//! replaced.
//!
//! Numbers are stable: the number of a removed geometry is never used again.

use super::{Geometry, GeometryId, GroupId, Instance, WorldBuilder};
use crate::mesh::{MeshError, TriangleMesh};
use snell_math::{Transform, Vec3};
use std::sync::Arc;

/// Number of an instance, in order of insertion over all groups. (Not [`crate::Hit::instance`],
/// which counts occurrences and changes when instances are added or removed;
/// [`super::World::instance_id`] converts from that to this.)
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct InstanceId(pub u32);

/// Why a geometry could not be changed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EditError {
    /// It was removed.
    #[error("geometry {0} was removed")]
    Removed(u32),
    /// Only meshes have vertices.
    #[error("geometry {0} is not a mesh")]
    NotAMesh(u32),
    /// The new vertices do not fit.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

impl WorldBuilder {
    /// Removes a geometry. Its number stays unused ([`super::World::geometry`] returns an empty
    /// mesh). Returns false if it was already removed.
    ///
    /// # Panics
    /// If there never was such a geometry.
    pub fn remove(&mut self, geometry: GeometryId) -> bool {
        let Some(group) = self.homes[geometry.0 as usize].take() else { return false };
        self.groups[group.0 as usize].geometries.retain(|&g| g != geometry);
        self.put(geometry, Geometry::Mesh(Arc::default()));
        true
    }

    /// Replaces a geometry by another; group, number, mask and filter stay.
    ///
    /// # Errors
    /// If it was removed.
    ///
    /// # Panics
    /// If there never was such a geometry.
    pub fn replace(&mut self, id: GeometryId, geometry: Geometry) -> Result<(), EditError> {
        self.check(id)?;
        self.put(id, geometry);
        Ok(())
    }

    fn put(&mut self, id: GeometryId, geometry: Geometry) {
        self.options[id.0 as usize].quads = matches!(geometry, Geometry::Quads(_));
        self.geometries[id.0 as usize] = geometry;
    }

    /// Moves the vertices of a mesh; all else stays. The next build refits the tree where that is
    /// good enough. (To change more of a mesh, [`Self::replace`] it; if the numbers of vertices and
    /// triangles are unchanged, it is refitted too.)
    ///
    /// # Errors
    /// If the geometry was removed or is not a mesh, or if the number of positions is not that of
    /// the vertices.
    ///
    /// # Panics
    /// If there never was such a geometry.
    pub fn set_positions(&mut self, id: GeometryId, positions: Vec<Vec3>) -> Result<(), EditError> {
        self.check(id)?;
        let Geometry::Mesh(old) = &self.geometries[id.0 as usize] else {
            return Err(EditError::NotAMesh(id.0));
        };
        let (found, expected) = (positions.len(), old.positions.len());
        if found != expected {
            let attribute = "positions";
            return Err(
                MeshError::AttributeLength { attribute, found, expected, per: "vertex" }.into()
            );
        }
        let mesh = TriangleMesh { positions, ..TriangleMesh::clone(old) };
        self.replace(id, Geometry::Mesh(Arc::new(mesh)))
    }

    fn check(&self, id: GeometryId) -> Result<(), EditError> {
        self.homes[id.0 as usize].map(|_| ()).ok_or(EditError::Removed(id.0))
    }

    /// The instance; `None` if it was removed.
    ///
    /// # Panics
    /// If there never was such an instance.
    pub fn instance_mut(&mut self, id: InstanceId) -> Option<&mut Instance> {
        let group = self.instance_homes[id.0 as usize]?;
        let contents = &mut self.groups[group.0 as usize];
        let at = contents.instance_ids.binary_search(&id).ok()?;
        contents.instances.get_mut(at)
    }

    /// Moves an instance; further keys of its motion stay. Returns false if it was removed.
    ///
    /// # Panics
    /// If there never was such an instance.
    pub fn move_instance(&mut self, id: InstanceId, group_from_child: Transform) -> bool {
        self.instance_mut(id).map(|instance| instance.group_from_child = group_from_child).is_some()
    }

    /// Removes an instance. Returns false if it was already removed.
    ///
    /// # Panics
    /// If there never was such an instance.
    pub fn remove_instance(&mut self, id: InstanceId) -> bool {
        let Some(group) = self.instance_homes[id.0 as usize].take() else { return false };
        let contents = &mut self.groups[group.0 as usize];
        let Ok(at) = contents.instance_ids.binary_search(&id) else { return false };
        contents.instance_ids.remove(at);
        contents.instances.remove(at);
        true
    }

    /// The group that holds a geometry; `None` if it was removed.
    ///
    /// # Panics
    /// If there never was such a geometry.
    pub fn group_of(&self, geometry: GeometryId) -> Option<GroupId> {
        self.homes[geometry.0 as usize]
    }
}
