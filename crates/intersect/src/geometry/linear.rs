//! Round linear curves: chains of cones between spheres.

use super::nearest::on_sweep;
use super::rounded_cone::{Ball, UnitRay};
use super::sweep::tube_surface;
use super::{PrimitiveHit, PrimitiveSet};
use crate::shape::{Metric, ShapeSurface};
use snell_math::{Bounds3d, DRay, DVec3, DVec4, Vec2, Vec4};

/// Line segments with a radius at each end. Each is the convex hull of two balls: a truncated cone
/// tangent to its round ends. Segments that share a point share the whole ball there, so chains
/// have no cracks. Each segment is a separate solid: a ray that passes along a chain also crosses
/// the ends inside it.
///
/// A segment is never hit if a point is out of range or not finite, if a radius is negative, or if
/// both radii are 0; a segment of length 0 is a ball. Hits are decided in double precision.
///
/// [`crate::Hit::uv`] is `(u, 0)` with `u` from 0 at the first ball to 1 at the second. The texture
/// coordinates are `(u, v)` with `v` the angle around the axis, from 0 to 1 for a full turn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinearCurves {
    /// Position (x, y, z) and radius (w).
    pub points: Vec<Vec4>,
    /// For each segment the index of its first point; the next point is its second.
    pub segments: Vec<u32>,
    /// Positions and radii in double precision, of which `points` are rounded copies; empty if
    /// those are all that is known.
    pub exact: Vec<DVec4>,
}

impl LinearCurves {
    /// A single chain of segments through all points.
    pub fn chain(points: Vec<Vec4>) -> Self {
        let segments = (1..points.len() as u32).map(|i| i - 1).collect();
        Self { points, segments, exact: Vec::new() }
    }

    /// Both points of a segment, with the radius in `w`; `None` if the segment is never hit.
    pub(super) fn ends(&self, segment: usize) -> Option<[DVec4; 2]> {
        Some(self.balls(segment)?.map(|ball| ball.center.extend(ball.radius)))
    }

    /// The entry and exit of a ray's line through a segment.
    fn crossings(&self, segment: usize, ray: &DRay) -> Option<[PrimitiveHit; 2]> {
        let ends = UnitRay::new(ray)?.hull_span(&self.balls(segment)?)?;
        Some(ends.map(|(t, u)| PrimitiveHit { t, uv: Vec2::new(u as f32, 0.0) }))
    }

    /// The entry of a ray's line into a segment.
    pub(super) fn entry(&self, segment: usize, ray: &DRay) -> Option<PrimitiveHit> {
        self.crossings(segment, ray).map(|[entry, _]| entry)
    }

    fn balls(&self, segment: usize) -> Option<[Ball; 2]> {
        let first = self.segments[segment] as usize;
        let range = first..first.checked_add(2)?;
        let balls = match (self.exact.get(range.clone()), self.points.get(range)?) {
            (Some(&[a, b]), _) => [Ball::exact(a)?, Ball::exact(b)?],
            (_, &[a, b]) => [Ball::new(a)?, Ball::new(b)?],
            _ => return None,
        };
        balls.iter().any(|b| b.radius > 0.0).then_some(balls)
    }
}

/// The number of balls of a segment that are compared first in the search for its nearest point.
const SAMPLES: usize = 8;

impl PrimitiveSet for LinearCurves {
    fn len(&self) -> usize {
        self.segments.len()
    }

    fn bounds(&self, segment: usize) -> Bounds3d {
        self.balls(segment).map_or(Bounds3d::EMPTY, |[a, b]| a.bounds().union(&b.bounds()))
    }

    fn closest(&self, segment: usize, ray: &DRay, _time: f32) -> Option<PrimitiveHit> {
        self.crossings(segment, ray)?.into_iter().find(|hit| ray.contains(hit.t))
    }

    fn surface(&self, segment: usize, position: DVec3, _uv: Vec2, _time: f32) -> ShapeSurface {
        let nothing = Ball { center: position, radius: 0.0 };
        let [a, b] = self.balls(segment).unwrap_or([nothing; 2]);
        let (axis, narrowing) = (b.center - a.center, a.radius - b.radius);
        let g = axis.length_squared() - narrowing * narrowing;
        let u = if g > 0.0 {
            (((position - a.center).dot(axis) - a.radius * narrowing) / g).clamp(0.0, 1.0)
        } else {
            // One ball contains the other.
            f64::from(u8::from(narrowing < 0.0))
        };
        tube_surface(&a.lerp(&b, u), u, (axis, -narrowing), axis, position)
    }

    fn nearest_point(
        &self,
        segment: usize,
        point: DVec3,
        metric: &Metric,
    ) -> Option<(DVec3, Vec2)> {
        let [a, b] = self.balls(segment)?;
        let (position, _, u) = on_sweep(metric, point, SAMPLES, |u| a.lerp(&b, u));
        Some((position, Vec2::new(u as f32, 0.0)))
    }

    fn contains(&self, segment: usize, point: DVec3) -> bool {
        let inside = |[a, b]: [Ball; 2]| {
            on_sweep(&Metric::EUCLIDEAN, point, SAMPLES, |u| a.lerp(&b, u)).1 <= 0.0
        };
        self.balls(segment).is_some_and(inside)
    }
}
