//! Rays as points of a view, and the division of sets of them.

use super::view::{Facet, View, Window};
use snell_math::{DVec2, Ray};

/// A ray as a point of a view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Query {
    pub place: DVec2,
    /// Surfaces with less nearness than this do not affect the ray.
    pub floor: f64,
    /// The index of the ray in the batch.
    pub index: usize,
}

/// The places of rays from the apex of a view, and the indices of the other rays.
pub(super) fn from_apex(view: &View, rays: &[Ray]) -> (Vec<Query>, Vec<usize>) {
    let (mut queries, mut others) = (Vec::with_capacity(rays.len()), Vec::new());
    for (index, ray) in rays.iter().enumerate() {
        let is_from_apex = view.apex() == Some(ray.origin.as_dvec3()) && ray.is_valid();
        match view.place_of_direction(ray.direction.as_dvec3()) {
            Some(place) if is_from_apex => {
                queries.push(Query { place, floor: view.horizon(), index })
            }
            _ => others.push(index),
        }
    }
    (queries, others)
}

/// Six views around a point, the queries of each, and the indices of the other rays.
pub(super) type Around = ([(View, Vec<Query>); 6], Vec<usize>);

/// The places of rays that end at a point, each in one of six views around it. Their floors are the
/// nearness of their starts.
pub(super) fn towards_point(point: snell_math::DVec3, rays: &[Ray]) -> Around {
    let mut sides =
        std::array::from_fn(|i| (View::cube_side(point, i / 2, i % 2 == 1), Vec::new()));
    let mut others = Vec::new();
    for (index, ray) in rays.iter().enumerate() {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let miss = origin + direction * f64::from(ray.t_max) - point;
        let start = origin + direction * f64::from(ray.t_min);
        let from = start - point;
        let is_near = miss.length() <= 1e-5 * from.length() && ray.is_valid();
        let axis = if from.x.abs() >= from.y.abs() && from.x.abs() >= from.z.abs() {
            0
        } else {
            1 + usize::from(from.y.abs() < from.z.abs())
        };
        let (view, queries): &mut (View, Vec<Query>) =
            &mut sides[2 * axis + usize::from(from[axis] > 0.0)];
        match view.project(start) {
            Some((_, floor)) if is_near => {
                // The whole ray counts, so its place equals that of its start only if the ray ends
                // exactly at the point; the difference is below rounding.
                let place = view.project(origin).map_or(DVec2::ZERO, |(place, _)| place);
                queries.push(Query { place, floor, index });
            }
            _ => others.push(index),
        }
    }
    (sides, others)
}

/// The bounding window of some queries.
pub(super) fn window(queries: &[Query]) -> Window {
    let start = (DVec2::INFINITY, DVec2::NEG_INFINITY, f64::INFINITY);
    let (low, high, floor) = queries.iter().fold(start, |(low, high, floor), q| {
        (low.min(q.place), high.max(q.place), floor.min(q.floor))
    });
    // The window is slightly enlarged, so that no query is on its edge and it has an interior.
    let margin =
        (high - low).max_element() * 1e-6 + low.abs().max(high.abs()).max_element() * 1e-9 + 1e-12;
    Window { low: low - margin, high: high + margin, near: 0.0, floor }
}

/// True if a facet may be in front of the start of any of the rays. For rays from an apex every
/// facet matters.
pub(super) fn matters(queries: &[Query], facet: &Facet) -> bool {
    let (low, high) = facet.polygon.extent();
    // The margin is far larger than rounding errors.
    let margin =
        (high - low).max_element() * 1e-6 + low.abs().max(high.abs()).max_element() * 1e-12;
    let (near_low, near_high) = (low - margin, high + margin);
    queries.iter().any(|q| {
        let is_in_extent = || q.place.cmpge(near_low).all() && q.place.cmple(near_high).all();
        let is_before = q.floor < facet.nearness.at(q.place) * (1.0 + 1e-12);
        is_before && (q.floor == 0.0 || (is_in_extent() && facet.polygon.contains(q.place, margin)))
    })
}

/// Divides queries in the middle of their window, across its longer side. `None` if they all have
/// the same place.
pub(super) fn divide(queries: &mut [Query]) -> Option<(&mut [Query], &mut [Query])> {
    let Window { low, high, .. } = window(queries);
    let (size, middle) = (high - low, (low + high) * 0.5);
    let axis = usize::from(size.y > size.x);
    let is_first = |q: &Query| q.place[axis] < middle[axis];
    let mut count = 0;
    for i in 0..queries.len() {
        if is_first(&queries[i]) {
            queries.swap(i, count);
            count += 1;
        }
    }
    (count > 0 && count < queries.len()).then(|| queries.split_at_mut(count))
}
