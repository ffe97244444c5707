//! Beams: find exactly what is visible in a region.

use super::fragments::{Fragment, Fragments};
use super::polygon::{Affine, ConvexPolygon, Cut};
use super::queries::{self, Query};
use super::view::{Facet, View, Window};
use super::walk::{Entry, Outcome, RegionWork, Walk};
use super::{CoherenceError, PrimitiveId};
use snell_intersect::Hit;
use snell_intersect::World;
use snell_math::{DVec2, DVec3, Ray};

/// The largest number of pieces of a beam; a beam with more is divided, because the work grows with
/// their square.
const MOST_PIECES: usize = 48;

/// If a beam has to be divided, rays up to this number are traced one by one instead.
const FEW_RAYS: usize = 4;

/// The largest number of rays in a beam that is traced without being divided first.
const MANY_RAYS: usize = 512;

/// Maximum number of divisions of a region.
const MOST_DIVISIONS: u32 = 40;

/// A part of a region, and the triangle that is visible in it.
#[derive(Clone, Copy, Debug)]
pub struct VisiblePiece {
    /// The places of the view where the triangle is visible.
    pub polygon: ConvexPolygon,
    /// The visible primitive; `None` for the background.
    pub primitive: Option<PrimitiveId>,
    nearness: Affine,
}

impl VisiblePiece {
    /// The nearness at a place; see [`View`].
    pub fn nearness(&self, place: DVec2) -> f64 {
        self.nearness.at(place)
    }
}

/// Traces beams through a world. Each thread needs its own.
///
/// A beam starts as one empty piece. The triangles in it are visited in the order of their boxes
/// from near to far, and each cuts the part that it hides from the pieces, until all pieces are
/// nearer than the next box. A beam with many pieces is divided, and its parts continue where the
/// beam stopped.
#[derive(Debug)]
pub struct BeamTracer<'w> {
    walk: Walk<'w>,
}

impl<'w> BeamTracer<'w> {
    /// A tracer for a world of triangles with a bounding volume hierarchy.
    pub fn new(world: &'w World) -> Result<Self, CoherenceError> {
        Ok(Self { walk: Walk::new(world)? })
    }

    /// The work done so far.
    pub fn work(&self) -> RegionWork {
        self.walk.work
    }

    /// Reports everything visible in a region of a view: pieces that do not overlap and cover the
    /// region. The coordinates of a piece are exact up to `f64` rounding. Of equally near triangles
    /// the one with the lowest ids is visible; a triangle that is seen edge-on is not visible.
    pub fn visible(
        &mut self,
        view: &View,
        region: &ConvexPolygon,
        mut each: impl FnMut(&VisiblePiece),
    ) {
        let start = self.walk.start();
        see_all(
            &mut self.walk,
            view,
            region,
            [0.0, view.horizon()],
            &start,
            MOST_DIVISIONS,
            &mut |walk, fragment| {
                each(&piece(walk, fragment));
            },
        );
    }

    /// The closest hit of each ray, with the result of [`World::closest`]: the beams determine the
    /// triangle, and the common intersection test the hit. The result may differ only within
    /// rounding of an edge. Rays that do not start at the apex of the view are traced one by one.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest(&mut self, view: &View, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        let (mut queries, others) = queries::from_apex(view, rays);
        let start = self.walk.start();
        self.answer(view, &mut queries, &start, &mut |walk, query, fragment| {
            let ray = &rays[query.index];
            hits[query.index] = match fragment.map(|f| f.source) {
                Some(None) => Hit::MISS,
                Some(Some(source)) => {
                    walk.confirm(ray, &source).unwrap_or_else(|| walk.closest(ray))
                }
                None => walk.closest(ray),
            };
        });
        others.into_iter().for_each(|i| hits[i] = self.walk.closest(&rays[i]));
    }

    /// Tests rays that end at a common point (at their `t_max`) for occlusion within their
    /// interval, by beams from that point. Other rays are traced one by one.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded(&mut self, point: DVec3, rays: &[Ray], blocked: &mut [bool]) {
        assert_eq!(rays.len(), blocked.len(), "one answer per ray");
        let (sides, others) = queries::towards_point(point, rays);
        let start = self.walk.start();
        for (view, mut queries) in sides {
            self.answer(&view, &mut queries, &start, &mut |walk, query, fragment| {
                let ray = &rays[query.index];
                blocked[query.index] = match fragment {
                    Some(Fragment { source: None, .. }) => false,
                    Some(f) if f.nearness.at(query.place) <= query.floor => false,
                    Some(Fragment { source: Some(source), .. }) => {
                        walk.confirm(ray, source).is_some() || walk.occluded(ray)
                    }
                    None => walk.occluded(ray),
                };
            });
        }
        others.into_iter().for_each(|i| blocked[i] = self.walk.occluded(&rays[i]));
    }

    /// Finds the piece that contains each query; `None` if a ray must be traced.
    fn answer(
        &mut self,
        view: &View,
        queries: &mut [Query],
        from: &[Entry],
        take: &mut impl FnMut(&mut Walk, &Query, Option<&Fragment>),
    ) {
        if queries.len() <= MANY_RAYS {
            return self.trace(view, queries, from, take);
        }
        match queries::divide(queries) {
            Some((a, b)) => {
                self.answer(view, a, from, take);
                self.answer(view, b, from, take);
            }
            None => queries.iter().for_each(|query| take(&mut self.walk, query, None)),
        }
    }

    fn trace(
        &mut self,
        view: &View,
        queries: &mut [Query],
        from: &[Entry],
        take: &mut impl FnMut(&mut Walk, &Query, Option<&Fragment>),
    ) {
        if queries.is_empty() {
            return;
        }
        let window = queries::window(queries);
        let region = ConvexPolygon::rectangle(window.low, window.high);
        let seen = {
            let matters = |facet: &Facet| queries::matters(queries, facet);
            self.walk.see(view, &window, &region, from, MOST_PIECES, matters)
        };
        match seen {
            Outcome::Seen(fragments) => {
                locate(&fragments, queries, &mut |query, fragment| {
                    take(&mut self.walk, query, fragment)
                });
                self.walk.recycle(fragments);
            }
            Outcome::Crowded(inside) => {
                // The queries are divided into four parts, so that little work is wasted.
                let halves = queries::divide(queries).map(|(a, b)| [a, b]);
                for half in halves.into_iter().flatten() {
                    let parts = if half.len() > FEW_RAYS { queries::divide(half) } else { None };
                    match parts {
                        Some((a, b)) => [a, b]
                            .into_iter()
                            .for_each(|q| self.few_or_trace(view, q, &inside, take)),
                        None => self.few_or_trace(view, half, &inside, take),
                    }
                }
            }
        }
    }

    fn few_or_trace(
        &mut self,
        view: &View,
        queries: &mut [Query],
        from: &[Entry],
        take: &mut impl FnMut(&mut Walk, &Query, Option<&Fragment>),
    ) {
        if queries.len() <= FEW_RAYS {
            queries.iter().for_each(|query| take(&mut self.walk, query, None));
        } else {
            self.trace(view, queries, from, take);
        }
    }
}

/// Reports the fragments of a region, dividing it where it is crowded. `near` and `floor` are the
/// limits of a [`Window`].
pub(super) fn see_all(
    walk: &mut Walk,
    view: &View,
    region: &ConvexPolygon,
    [near, floor]: [f64; 2],
    from: &[Entry],
    divisions: u32,
    each: &mut impl FnMut(&Walk, &Fragment),
) {
    let (low, high) = region.extent();
    let window = Window { low, high, near, floor };
    let most = if divisions == 0 { usize::MAX } else { MOST_PIECES };
    match walk.see(view, &window, region, from, most, |_| true) {
        Outcome::Seen(fragments) => {
            fragments.list.iter().for_each(|f| each(walk, f));
            walk.recycle(fragments);
        }
        Outcome::Crowded(inside) => {
            let middle = (low + high) * 0.5;
            let across = if high.x - low.x > high.y - low.y { DVec2::X } else { DVec2::Y };
            let line = Affine { normal: across, offset: -across.dot(middle) };
            let parts = match region.cut(&line, 0.0) {
                Cut::Both(a, b) => [Some(a), Some(b)],
                Cut::Inside | Cut::Outside => [Some(*region), None],
            };
            let left = if parts[1].is_some() { divisions - 1 } else { 0 };
            for part in parts.iter().flatten() {
                see_all(walk, view, part, [near, floor], &inside, left, each);
            }
        }
    }
}

/// Finds the fragment that contains each query; `None` for a query between two fragments.
fn locate(
    fragments: &Fragments,
    queries: &[Query],
    take: &mut impl FnMut(&Query, Option<&Fragment>),
) {
    for query in queries {
        take(query, fragments.list.iter().find(|f| f.contains(query.place, fragments.tolerance)));
    }
}

fn piece(walk: &Walk, fragment: &Fragment) -> VisiblePiece {
    let primitive = fragment.source.map(|source| walk.ids(&source).into());
    VisiblePiece { polygon: fragment.polygon, primitive, nearness: fragment.nearness }
}
