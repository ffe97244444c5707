//! The test of a block of a heightfield.

use super::offer_triangle;
use crate::exact::TriangleTest;
use crate::geometry::Heightfield;
use crate::precision::Real;
use crate::search::{Goal, Search};
use snell_math::DRay;

/// Reports the hits on the triangles of a block; `ids` are instance, geometry and block. `ray` is
/// in the coordinates of the group. Returns true if the search is over.
pub(super) fn test_block<G: Goal<Precision: TriangleTest>>(
    search: &mut Search<'_, G>,
    field: &Heightfield,
    [instance, geometry, block]: [u32; 3],
    ray: &DRay,
) -> bool {
    // One unit in the last place more, to include hits that are at equal distance after rounding.
    let end = |search: &Search<'_, G>| search.goal.limit().next_up().into();
    let ray = DRay { t_min: search.t_min().into(), t_max: end(search), ..*ray };
    let mut line = None;
    field.walk(block as usize, &ray, G::Precision::EPSILON, |cell| {
        let line = line.get_or_insert_with(|| G::Precision::line(&ray));
        for half in (0..2u32).filter(|&half| cell.halves[half as usize]) {
            search.goal.count_primitives(1);
            let corners = field.half(half as usize).map(|node| cell.nodes[node]);
            let ids = [instance, geometry, cell.first + half];
            let found =
                G::Precision::hit_at(search, line, &corners, ids, cell.closed[half as usize]);
            if offer_triangle(search, found) {
                return None;
            }
        }
        Some(end(search))
    })
}
