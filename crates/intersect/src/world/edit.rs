//! Edits of a builder: between builds, geometries and instances are added, removed, moved and
//! replaced.
//!
//! Numbers are stable: the number of a removed geometry is never reused.

use super::{Geometry, GeometryId, GroupId, Instance, WorldBuilder};
use crate::mesh::{MeshError, TriangleMesh};
use snell_math::{Transform, Vec3};
use std::sync::Arc;

/// Number of an instance, in order of insertion over all groups. It differs from
/// [`crate::Hit::instance`], which numbers occurrences and changes when instances are added or
/// removed; [`super::World::instance_id`] converts from that number to this one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct InstanceId(pub u32);

/// Errors of edits of a geometry.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EditError {
    /// The geometry with this number was removed.
    #[error("geometry {0} was removed")]
    Removed(u32),
    /// The geometry with this number is not a mesh, and only meshes have vertices.
    #[error("geometry {0} is not a mesh")]
    NotAMesh(u32),
    /// The new vertices do not fit the mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

impl WorldBuilder {
    /// Removes a geometry. Its number stays unused ([`super::World::geometry`] returns an empty
    /// mesh). Returns false if it was already removed.
    ///
    /// # Panics
    /// If no such geometry was ever added.
    pub fn remove(&mut self, geometry: GeometryId) -> bool {
        let Some(group) = self.homes[geometry.0 as usize].take() else { return false };
        self.groups[group.0 as usize].geometries.retain(|&g| g != geometry);
        self.put(geometry, Geometry::Mesh(Arc::default()));
        true
    }

    /// Replaces a geometry; its group, number, mask and filter stay.
    ///
    /// # Errors
    /// If the geometry was removed.
    ///
    /// # Panics
    /// If no such geometry was ever added.
    pub fn replace(&mut self, id: GeometryId, geometry: Geometry) -> Result<(), EditError> {
        self.check(id)?;
        self.put(id, geometry);
        Ok(())
    }

    fn put(&mut self, id: GeometryId, geometry: Geometry) {
        self.options[id.0 as usize].quads = matches!(geometry, Geometry::Quads(_));
        self.geometries[id.0 as usize] = geometry;
    }

    /// Moves the vertices of a mesh; everything else stays. The next build refits the tree where
    /// that is good enough. (To change more of a mesh, call [`Self::replace`]; the tree is also
    /// refitted then if the numbers of vertices and triangles are unchanged.)
    ///
    /// # Errors
    /// If the geometry was removed or is not a mesh, or if the number of positions differs from the
    /// number of vertices.
    ///
    /// # Panics
    /// If no such geometry was ever added.
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

    /// The instance with this number; `None` if it was removed.
    ///
    /// # Panics
    /// If no such instance was ever added.
    pub fn instance_mut(&mut self, id: InstanceId) -> Option<&mut Instance> {
        let group = self.instance_homes[id.0 as usize]?;
        let contents = &mut self.groups[group.0 as usize];
        let at = contents.instance_ids.binary_search(&id).ok()?;
        contents.instances.get_mut(at)
    }

    /// Sets the map of an instance at time 0; the later keys of its motion stay. Returns false if
    /// the instance was removed.
    ///
    /// # Panics
    /// If no such instance was ever added.
    pub fn move_instance(&mut self, id: InstanceId, group_from_child: Transform) -> bool {
        self.instance_mut(id).map(|instance| instance.group_from_child = group_from_child).is_some()
    }

    /// Removes an instance. Returns false if it was already removed.
    ///
    /// # Panics
    /// If no such instance was ever added.
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
    /// If no such geometry was ever added.
    pub fn group_of(&self, geometry: GeometryId) -> Option<GroupId> {
        self.homes[geometry.0 as usize]
    }
}
