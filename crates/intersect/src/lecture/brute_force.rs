//! No structure: every primitive of every occurrence is tested. The reference for all structures.

use crate::exact::TriangleTest;
use crate::group::{GroupList, test_object, test_triangle};
use crate::search::{Goal, Search};
use snell_math::DRay;

/// Tests everything in a group and in the groups below it. Returns true if the search is over.
pub(crate) fn search_all<G: Goal<Precision: TriangleTest>>(
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
    let objects = &groups[group].objects;
    (0..objects.len()).any(|number| {
        test_object(objects, number, ray, instance, search, |child, ray, instance, search| {
            search_all(groups, child, ray, instance, search)
        })
    })
}
