//! Traces pencils through a world: regions in which all rays certainly hit one triangle, or none.

use super::CoherenceError;
use super::fragments::Source;
use super::pencil::{Pencil, barycentric_gradients, plane_error};
use super::polygon::{Affine, ConvexPolygon};
use super::queries::{self, Query};
use super::view::{Facet, View, Window};
use super::walk::{Entry, RegionWork, Walk};
use snell_intersect::Hit;
use snell_intersect::World;
use snell_math::{DVec3, Ray, Vec2, real};

/// The largest number of triangles that a pencil may hit without being divided.
const MOST_TRIANGLES: usize = 6;

/// If a pencil has to be divided, rays up to this number are traced one by one instead.
const FEW_RAYS: usize = 4;

/// The largest number of rays in a pencil that is traced without being divided first.
const MANY_RAYS: usize = 64;

/// Traces pencils through a world. Each thread needs its own.
#[derive(Debug)]
pub struct PencilTracer<'w> {
    walk: Walk<'w>,
    tolerance: f64,
    /// The number of rays that were answered by the matrix of a pencil, or because their pencil
    /// hits nothing.
    linear: u64,
}

/// The common result of all rays of a pencil.
enum Certain {
    Nothing,
    Triangle(Source),
}

impl<'w> PencilTracer<'w> {
    /// A tracer for a world of triangles with a bounding volume hierarchy. Hit points of pencils
    /// may have an error of `tolerance`, relative to the distance.
    pub fn new(world: &'w World, tolerance: f64) -> Result<Self, CoherenceError> {
        Ok(Self { walk: Walk::new(world)?, tolerance, linear: 0 })
    }

    /// The work done so far.
    pub fn work(&self) -> RegionWork {
        self.walk.work
    }

    /// The number of rays that were answered by the matrix of a pencil, or because their pencil
    /// hits nothing; all others were traced.
    pub fn linear_rays(&self) -> u64 {
        self.linear
    }

    /// The closest hit of each ray. If a pencil certainly hits one triangle, its axial ray is exact
    /// and the others follow from the matrix, within the tolerance; if it certainly hits nothing,
    /// they miss. The rest is traced one by one, including rays that do not start at the apex of
    /// the view.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest(&mut self, view: &View, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        let (mut queries, others) = queries::from_apex(view, rays);
        let start = self.walk.start();
        self.divide(view, &mut queries, &start, &mut |tracer, queries, certain| match certain {
            None => {
                queries.iter().for_each(|q| hits[q.index] = tracer.walk.closest(&rays[q.index]));
                true
            }
            Some(Certain::Nothing) => {
                tracer.linear += queries.len() as u64;
                queries.iter().for_each(|q| hits[q.index] = Hit::MISS);
                true
            }
            Some(Certain::Triangle(source)) => tracer.follow(&source, queries, rays, hits),
        });
        others.into_iter().for_each(|i| hits[i] = self.walk.closest(&rays[i]));
    }

    /// Tests rays that end at a common point (at their `t_max`) for occlusion within their
    /// interval, by pencils from that point that certainly hit nothing, or one triangle. Other rays
    /// are traced one by one.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded(&mut self, point: DVec3, rays: &[Ray], blocked: &mut [bool]) {
        assert_eq!(rays.len(), blocked.len(), "one answer per ray");
        let (sides, others) = queries::towards_point(point, rays);
        let start = self.walk.start();
        for (view, mut queries) in sides {
            self.divide(&view, &mut queries, &start, &mut |tracer, queries, certain| {
                match certain {
                    None => queries
                        .iter()
                        .for_each(|q| blocked[q.index] = tracer.walk.occluded(&rays[q.index])),
                    Some(certain) => {
                        tracer.linear += queries.len() as u64;
                        let is_blocked = matches!(certain, Certain::Triangle(_));
                        queries.iter().for_each(|q| blocked[q.index] = is_blocked);
                    }
                }
                true
            });
        }
        others.into_iter().for_each(|i| blocked[i] = self.walk.occluded(&rays[i]));
    }

    /// Divides queries until each set has one certain result (and `take` agrees), or is small.
    fn divide(
        &mut self,
        view: &View,
        queries: &mut [Query],
        from: &[Entry],
        take: &mut impl FnMut(&mut Self, &[Query], Option<Certain>) -> bool,
    ) {
        if queries.is_empty() {
            return;
        }
        if queries.len() <= FEW_RAYS {
            take(self, queries, None);
            return;
        }
        let mut inside = None;
        if queries.len() <= MANY_RAYS {
            let (certain, left) = self.certain(view, &queries::window(queries), queries, from);
            if certain.is_some() && take(self, queries, certain) {
                return;
            }
            inside = Some(left);
        }
        let from = inside.as_deref().unwrap_or(from);
        match queries::divide(queries) {
            Some((a, b)) => {
                self.divide(view, a, from, take);
                self.divide(view, b, from, take);
            }
            None => {
                take(self, queries, None);
            }
        }
    }

    /// The result that all rays of a window certainly share, or `None` if no common result is
    /// certain; and the entries at which traversals of parts of the window start.
    fn certain(
        &mut self,
        view: &View,
        window: &Window,
        queries: &[Query],
        from: &[Entry],
    ) -> (Option<Certain>, Vec<Entry>) {
        let region = ConvexPolygon::rectangle(window.low, window.high);
        let farthest_start = queries.iter().map(|q| q.floor).fold(f64::NEG_INFINITY, f64::max);
        let mut met: Vec<(Facet, Source, ConvexPolygon)> = Vec::new();
        let (mut entries, mut floor) = (Vec::new(), f64::NEG_INFINITY);
        let left = self.walk.visit(view, window, from, |entry, facets| {
            let before = met.len();
            for (facet, source) in
                facets.iter().filter(|(facet, _)| queries::matters(queries, facet))
            {
                let Some(common) = overlap(&region, facet) else { continue };
                if covers(facet, &region) {
                    floor = f64::max(floor, region.range(&facet.nearness).0);
                }
                met.push((*facet, *source, common));
            }
            if met.len() > before {
                entries.push(entry);
            }
            if met.len() > MOST_TRIANGLES { f64::INFINITY } else { floor }
        });
        entries.extend(left);
        if met.len() > MOST_TRIANGLES {
            return (None, entries);
        }
        if met.is_empty() {
            return (Some(Certain::Nothing), entries);
        }
        let is_first = |(facet, source, _): &&(Facet, Source, ConvexPolygon)| {
            let is_before = |(other, of, common): &(Facet, Source, ConvexPolygon)| {
                of == source || common.range(&facet.nearness.minus(&other.nearness)).0 > 0.0
            };
            // The facet is in front of the start of every ray, so that all of them hit it.
            let is_ahead = region.range(&facet.nearness).0 > farthest_start;
            covers(facet, &region) && is_ahead && met.iter().all(is_before)
        };
        (met.iter().find(is_first).map(|(_, source, _)| Certain::Triangle(*source)), entries)
    }

    /// Derives the hits of rays that all hit one triangle from the hit of the axial ray. Returns
    /// false if the pencil is too wide for that.
    fn follow(
        &mut self,
        source: &Source,
        queries: &[Query],
        rays: &[Ray],
        hits: &mut [Hit],
    ) -> bool {
        let window = queries::window(queries);
        let middle = (window.low + window.high) * 0.5;
        let apart = |q: &&Query| q.place.distance_squared(middle);
        let Some(axial) = queries.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))) else {
            return true;
        };
        let Some(hit) = self.walk.confirm(&rays[axial.index], source) else { return false };
        let axis = &rays[axial.index];
        let mut pencil = Pencil::new(axis.origin.as_dvec3(), axis.direction.as_dvec3());
        let starts: Option<Vec<_>> =
            queries.iter().map(|q| pencil.paraxial(rays[q.index].direction.as_dvec3())).collect();
        let Some(starts) = starts else { return false };
        let [a, b, c] = self.walk.corners(source);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let cosine = normal.dot(pencil.direction()).abs();
        let slope = starts.iter().map(|s| real::hypot(s.z, s.w)).fold(0.0, f64::max);
        let distance = f64::from(hit.t) * axis.direction.as_dvec3().length();
        let error = plane_error(distance, slope, (1.0 - cosine * cosine).max(0.0).sqrt() / cosine);
        let Some(gradients) = barycentric_gradients(b - a, c - a) else { return false };
        let is_close = error <= self.tolerance * distance;
        if !is_close {
            return false;
        }
        pencil.transfer(distance);
        self.linear += queries.len() as u64;
        for (query, start) in queries.iter().zip(starts) {
            let ray = &rays[query.index];
            let offset = pencil.offset_on(normal, start);
            let direction = ray.direction.as_dvec3();
            let t = (pencil.origin() + offset - ray.origin.as_dvec3()).dot(direction)
                / direction.length_squared();
            let by = gradients.map(|g| g.dot(offset) as f32);
            hits[query.index] = Hit { t: t as f32, uv: hit.uv + Vec2::from_array(by), ..hit };
        }
        hits[axial.index] = hit;
        true
    }
}

/// The overlap of a facet and a region.
fn overlap(region: &ConvexPolygon, facet: &Facet) -> Option<ConvexPolygon> {
    edges(facet).iter().try_fold(*region, |p, edge| p.clipped(edge, 0.0))
}

/// True if the facet covers the whole region.
fn covers(facet: &Facet, region: &ConvexPolygon) -> bool {
    edges(facet).iter().all(|edge| region.range(edge).0 > 0.0)
}

fn edges(facet: &Facet) -> [Affine; 3] {
    let v = facet.polygon.vertices();
    [Affine::left_of(v[0], v[1]), Affine::left_of(v[1], v[2]), Affine::left_of(v[2], v[0])]
}
