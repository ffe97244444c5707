//! No structure: every primitive of every occurrence is tested. The oracle for all others.

use super::group::{Object, mapped, ray_in_child, test_shape, test_triangle};
use crate::mesh::TriangleMesh;
use crate::precision::Rules;
use crate::query::search::{Goal, Search};
use snell_math::DRay;
use std::sync::Arc;

/// What a group holds.
#[derive(Clone, Debug, Default)]
pub(crate) struct GroupList {
    /// Meshes with their geometry numbers.
    pub meshes: Vec<(u32, Arc<TriangleMesh>)>,
    /// Shapes and instances.
    pub objects: Vec<Object>,
}

/// Tests everything in a group and below it. True if the search is over.
pub(crate) fn search_all<G: Goal>(
    groups: &[GroupList],
    group: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
) -> bool {
    let local = G::Precision::local_ray(search.context.data, group, ray);
    for (geometry, mesh) in &groups[group].meshes {
        for triangle in 0..mesh.indices.len() {
            if mesh.is_degenerate(triangle) {
                continue;
            }
            search.goal.count_primitives(1);
            let corners = mesh.corners(triangle).map(|p| p.to_array());
            if test_triangle(search, &local, &corners, || [instance, *geometry, triangle as u32]) {
                return true;
            }
        }
    }
    groups[group].objects.iter().any(|object| match object {
        Object::Shape { shape, geometry, shape_from_group } => {
            test_shape(search, shape.as_ref(), *geometry, instance, &mapped(shape_from_group, ray))
        }
        Object::Instance { mask, .. } if mask & search.mask == 0 => false,
        Object::Instance { child, offset, child_from_group, .. } => ray_in_child(child_from_group, ray)
            .is_some_and(|ray| search_all(groups, *child, &ray, instance + offset, search)),
    })
}
