//! The tests of single primitives, shared by every structure: what a group holds, ready to be tested.

use crate::kernel::ray::LocalRay;
use crate::precision::{Real, Rules};
use crate::query::search::{Goal, Search, Verdict};
use crate::shape::Shape;
use snell_math::{DAffine3, DRay, Vec2};
use std::sync::Arc;

/// A shape or an instance in a group.
#[derive(Clone, Debug)]
pub(crate) enum Object {
    /// A shape.
    Shape {
        /// What is tested.
        shape: Arc<dyn Shape>,
        /// Its number.
        geometry: u32,
        /// The map from the group to the shape.
        shape_from_group: DAffine3,
    },
    /// Another group.
    Instance {
        /// Which group.
        child: usize,
        /// What to add to the occurrence number of the group to get that of the child.
        offset: u32,
        /// The map from the group to the child.
        child_from_group: DAffine3,
        /// Rays whose mask shares no bit with this pass by.
        mask: u32,
    },
}

/// The ray mapped by an affine matrix; `t` is shared.
#[inline(always)]
pub(crate) fn mapped(map: &DAffine3, ray: &DRay) -> DRay {
    DRay { origin: map.transform_point3(ray.origin), direction: map.transform_vector3(ray.direction), ..*ray }
}

/// The ray in the coordinates of an instanced group; `None` if it overflows on the way, then nothing there can be hit.
#[inline(always)]
pub(crate) fn ray_in_child(child_from_group: &DAffine3, ray: &DRay) -> Option<DRay> {
    let ray = mapped(child_from_group, ray);
    (ray.origin.is_finite() && ray.direction.is_finite()).then_some(ray)
}

/// How often one shape is asked again after a hit on it did not count. No shape has that many crossings.
const MAX_CROSSINGS: usize = 64;

/// Offers the crossings of one shape, nearest first. `ray` is in the shape's coordinates. True if the search is over.
pub(crate) fn test_shape<G: Goal>(
    search: &mut Search<'_, G>,
    shape: &dyn Shape,
    geometry: u32,
    instance: u32,
    ray: &DRay,
) -> bool {
    search.goal.count_primitives(1);
    let mut ray = DRay { t_min: search.t_min().into(), ..*ray };
    for _ in 0..MAX_CROSSINGS {
        // One step more, for hits that are equally far once they are rounded.
        ray.t_max = search.goal.limit().next_up().into();
        let Some(found) = shape.closest(&ray) else { return false };
        let hit = G::Precision::hit(found.t, Vec2::ZERO, [instance, geometry, found.face]);
        match search.offer(hit) {
            Verdict::Finished => return true,
            Verdict::Behind => return false,
            Verdict::Taken | Verdict::Rejected => ray.t_min = found.t,
        }
    }
    false
}

/// Offers the hit on one triangle. True if the search is over.
#[inline(always)]
pub(crate) fn test_triangle<G: Goal>(
    search: &mut Search<'_, G>,
    ray: &LocalRay,
    corners: &[[f32; 3]; 3],
    ids: impl FnOnce() -> [u32; 3],
) -> bool {
    let Some(hit) = G::Precision::triangle_hit(search, ray, corners, ids) else { return false };
    search.offer(hit) == Verdict::Finished
}
