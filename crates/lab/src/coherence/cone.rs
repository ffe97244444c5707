//! Cones: rays with a width. Each primitive covers a share of the cross-section.

use super::beam::see_all;
use super::polygon::{ConvexPolygon, DISK_AREA};
use super::view::View;
use super::walk::{RegionWork, Walk};
use super::{CoherenceError, PrimitiveId};
use snell_intersect::World;
use snell_math::{DVec3, Ray};

/// A round cone, or a cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// The start of the axis.
    pub origin: DVec3,
    /// Unit vector along the axis.
    pub direction: DVec3,
    /// Diameter at the origin, 0 or more.
    pub width: f64,
    /// Growth of the diameter per unit of distance; 0 or more.
    pub spread: f64,
}

/// The elliptical intersection of a cone with a surface, given by its two diameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The longer diameter, along the surface.
    pub major: DVec3,
    /// The shorter diameter, perpendicular to the longer one.
    pub minor: DVec3,
}

impl Cone {
    /// The cone around a ray with the given diameter and spread (a camera provides both for a
    /// pixel). The ray's direction need not be of unit length.
    pub fn around(ray: &Ray, width: f64, spread: f64) -> Self {
        let direction = ray.direction.as_dvec3().normalize_or(DVec3::Z);
        Self { origin: ray.origin.as_dvec3(), direction, width, spread }
    }

    /// The cone from a point to a ball, such as from a shading point to a spherical light.
    pub fn towards_ball(origin: DVec3, center: DVec3, radius: f64) -> Self {
        let to = center - origin;
        let direction = to.normalize_or(DVec3::Z);
        Self {
            origin,
            direction,
            width: 0.0,
            spread: 2.0 * radius / to.length().max(f64::MIN_POSITIVE),
        }
    }

    /// The diameter at a distance from the origin, which is the filter width for a texture
    /// (Amanatides 1984).
    pub fn width_at(&self, distance: f64) -> f64 {
        self.width + self.spread * distance
    }

    /// The footprint on a plane with this unit normal, at this distance: the diameters of the
    /// ellipse, to first order in the spread. At grazing angles the stretch is limited to 1000.
    pub fn footprint(&self, distance: f64, normal: DVec3) -> Footprint {
        let width = self.width_at(distance);
        let across = self
            .direction
            .cross(normal)
            .try_normalize()
            .unwrap_or_else(|| normal.any_orthonormal_vector());
        let cosine = self.direction.dot(normal).abs().max(1e-3);
        Footprint { major: normal.cross(across) * (width / cosine), minor: across * width }
    }

    /// The view in which the interior of the cone is the unit disk, and the depth of the cone's
    /// origin there.
    fn view(&self) -> Option<(View, f64)> {
        let (right, up) = self.direction.any_orthonormal_pair();
        if self.spread > 0.0 {
            let (before, radius) = (self.width / self.spread, self.spread * 0.5);
            let apex = self.origin - self.direction * before;
            return Some((
                View::perspective(apex, self.direction, right * radius, up * radius)?,
                before,
            ));
        }
        let radius = self.width * 0.5;
        Some((View::parallel(self.direction, self.origin, right * radius, up * radius)?, 0.0))
    }
}

/// A primitive in a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeHit {
    /// The primitive.
    pub primitive: PrimitiveId,
    /// The share of the cross-section that this primitive covers and no nearer primitive does, from
    /// 0 to 1.
    pub coverage: f64,
    /// The share that this primitive and all nearer ones cover, from 0 to 1.
    pub opacity: f64,
    /// Distance along the axis to the nearest visible piece of the primitive.
    pub distance: f64,
}

/// All visible primitives in a cone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConeHits {
    /// The hits in order from near to far.
    pub hits: Vec<ConeHit>,
}

impl ConeHits {
    /// The covered share of the cross-section, from 0 to 1.
    pub fn opacity(&self) -> f64 {
        self.hits.last().map_or(0.0, |hit| hit.opacity)
    }

    /// The primitive that covers the largest share, if any.
    pub fn largest(&self) -> Option<&ConeHit> {
        self.hits.iter().max_by(|a, b| a.coverage.total_cmp(&b.coverage))
    }
}

/// Traces cones through a world. Each thread needs its own.
#[derive(Debug)]
pub struct ConeTracer<'w> {
    walk: Walk<'w>,
}

/// Maximum number of divisions of a cone's region.
const MOST_DIVISIONS: u32 = 16;

impl<'w> ConeTracer<'w> {
    /// A tracer for a world of triangles with a bounding volume hierarchy.
    pub fn new(world: &'w World) -> Result<Self, CoherenceError> {
        Ok(Self { walk: Walk::new(world)? })
    }

    /// The work done so far.
    pub fn work(&self) -> RegionWork {
        self.walk.work
    }

    /// Finds the primitives in a cone between two distances along its axis, each with the share of
    /// the cross-section that it covers. Triangles are projected to the cross-section as a unit
    /// disk and clipped exactly by nearer ones; a share is the area that is left, over that of the
    /// disk. A cone without interior (or not finite) hits nothing.
    pub fn trace(&mut self, cone: &Cone, [start, end]: [f64; 2]) -> ConeHits {
        let Some((view, before)) = cone.view() else { return ConeHits::default() };
        let floor = if view.apex().is_some() { 1.0 / (before + end) } else { -end };
        if !(start < end && floor.is_finite()) && end != f64::INFINITY {
            return ConeHits::default();
        }
        let floor = floor.max(view.horizon());
        let entries = self.walk.start();
        let mut hits: Vec<ConeHit> = Vec::new();
        let (region, range) = (ConvexPolygon::around_unit_disk(), [before + start.max(0.0), floor]);
        see_all(
            &mut self.walk,
            &view,
            &region,
            range,
            &entries,
            MOST_DIVISIONS,
            &mut |walk, fragment| {
                let Some(source) = fragment.source else { return };
                let coverage = fragment.polygon.area_in_unit_disk() / DISK_AREA;
                if coverage <= 0.0 {
                    return;
                }
                let primitive = walk.ids(&source).into();
                let nearness = fragment.nearness.at(fragment.polygon.middle());
                let distance =
                    if view.apex().is_some() { 1.0 / nearness - before } else { -nearness };
                match hits.iter_mut().find(|hit| hit.primitive == primitive) {
                    Some(hit) => {
                        hit.coverage += coverage;
                        hit.distance = hit.distance.min(distance);
                    }
                    None => hits.push(ConeHit { primitive, coverage, opacity: 0.0, distance }),
                }
            },
        );
        hits.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.primitive.cmp(&b.primitive)));
        let mut opacity = 0.0;
        for hit in &mut hits {
            opacity = (opacity + hit.coverage).min(1.0);
            hit.opacity = opacity;
        }
        ConeHits { hits }
    }

    /// The share of a spherical light that is visible from a point. Primitives nearer than the
    /// distance `start` are ignored.
    pub fn visibility_of_ball(
        &mut self,
        origin: DVec3,
        center: DVec3,
        radius: f64,
        start: f64,
    ) -> f64 {
        let cone = Cone::towards_ball(origin, center, radius);
        1.0 - self.trace(&cone, [start, (center - origin).length()]).opacity()
    }
}
