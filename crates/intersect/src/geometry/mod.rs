//! Geometries beyond meshes and shapes: spheres and curves in bulk, whatever a user brings along by
//! [`PrimitiveSet`], quads, and what moves.
//!
//! A set says where each of its primitives is and where a ray first meets it. The rest is done here
//! and is the same for every set: the primitives are sorted into the tree of their group, one by
//! one, at a few bytes each.

pub mod cubic;
pub mod curves;
pub mod linear;
pub mod motion;
mod nearest;
pub mod quads;
mod rounded_cone;
pub mod spheres;
mod sweep;
#[cfg(test)]
mod tests;

pub use cubic::{CubicCurves, CurveBasis};
pub use curves::{Curves, StrandBasis, StrandError};
pub use linear::LinearCurves;
pub use motion::{MeshKey, MovingMesh};
pub use quads::QuadMesh;
pub use spheres::Spheres;

use crate::shape::{Metric, ShapeSurface};
use snell_math::{Bounds3d, DRay, DVec3, Vec2};

/// A point where a ray meets a primitive of a set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveHit {
    /// Ray parameter.
    pub t: f64,
    /// What the set wants to remember of the place: [`crate::Hit::uv`].
    pub uv: Vec2,
}

/// Many primitives of one kind, in the coordinates of the group that holds them: the interface for
/// geometry of one's own.
///
/// All answers must be pure functions of their arguments. Whatever they are, queries end and all
/// acceleration structures agree: a hit that is not finite does not count, one outside of the
/// primitive's bounds is moved to where the ray is inside (or does not count if it never is), and
/// of one primitive a ray meets at most 64 crossings.
pub trait PrimitiveSet: Send + Sync + std::fmt::Debug {
    /// How many primitives there are. [`crate::Hit::primitive`] counts them from 0.
    fn len(&self) -> usize;

    /// True without primitives.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A box around a primitive at all times from 0 to 1. May have infinite sides; such primitives
    /// are tested against every ray. Empty (or NaN) for a primitive that is never hit: it is
    /// skipped, and counted as such.
    fn bounds(&self, primitive: usize) -> Bounds3d;

    /// The nearest point of a primitive in the open interval of the ray, from either side.
    /// Directions have any length. `time` is that of the ray, from 0 to 1.
    fn closest(&self, primitive: usize, ray: &DRay, time: f32) -> Option<PrimitiveHit>;

    /// [`Self::closest`] and [`Self::bounds`] together, which may be less work than one after the
    /// other.
    fn closest_within(
        &self,
        primitive: usize,
        ray: &DRay,
        time: f32,
    ) -> Option<(PrimitiveHit, Bounds3d)> {
        self.closest(primitive, ray, time).map(|hit| (hit, self.bounds(primitive)))
    }

    /// Told some time before [`Self::closest`] is asked about a primitive, so that it can ask for
    /// the memory it reads first. Does nothing, unless a set says otherwise.
    fn fetch(&self, _primitive: usize) {}

    /// The surface of a primitive at `position`, a point on it (or within single-precision rounding
    /// of it), which was hit with this `uv` at this `time`.
    fn surface(&self, primitive: usize, position: DVec3, uv: Vec2, time: f32) -> ShapeSurface;

    /// The point of a primitive's surface nearest to `point` at time 0, where lengths are measured
    /// by `metric`, and its `uv`. `None` if that cannot be said: the primitive is never the
    /// nearest. (So it is unless a set says otherwise.)
    fn nearest_point(
        &self,
        _primitive: usize,
        _point: DVec3,
        _metric: &Metric,
    ) -> Option<(DVec3, Vec2)> {
        None
    }

    /// True if `point` is inside of a primitive that is solid, at time 0. Never, unless a set says
    /// otherwise.
    fn contains(&self, _primitive: usize, _point: DVec3) -> bool {
        false
    }

    /// True for curves, whose surfaces have the derivative by `uv.x` along the fibre:
    /// [`crate::SurfaceInteraction::on_curve`].
    fn is_curve(&self) -> bool {
        false
    }

    /// Linear RGB and alpha at a point: white unless the set has colours.
    fn color(&self, _primitive: usize, _uv: Vec2) -> [f32; 4] {
        [1.0; 4]
    }
}

/// How far a point may be off the bounds of its primitive, relative to the way from the ray's
/// origin, and still be rounding.
const ROUNDING: f64 = 1e-8;

/// The parameter nearest to `t` at which the ray is within the bounds; `None` if it never is, or
/// `t` is not finite.
///
/// Trees skip what lies outside of boxes, so nothing there may count.
pub(crate) fn within_bounds(bounds: &Bounds3d, ray: &DRay, t: f64) -> Option<f64> {
    let way = ray.direction * t;
    let (low, high) = (bounds.min - ray.origin, bounds.max - ray.origin);
    let margin = way.abs() * ROUNDING;
    if (way + margin).cmpge(low).all() && (way - margin).cmple(high).all() {
        return Some(t);
    }
    if bounds.is_empty() || !t.is_finite() {
        return None;
    }
    let inverse = ray.direction.recip();
    let (a, b) = (low * inverse, high * inverse);
    // An axis the ray does not move along tells nothing of `t`, but the ray may be outside all the
    // way.
    let moves = inverse.is_finite_mask();
    let outside = (low.cmpgt(margin) | high.cmplt(-margin)) & !moves;
    let enter = DVec3::select(moves, a.min(b), DVec3::NEG_INFINITY).max_element();
    let leave = DVec3::select(moves, a.max(b), DVec3::INFINITY).min_element();
    let inside = t.max(enter).min(leave);
    (!outside.any() && enter <= leave + leave.abs() * ROUNDING && inside.is_finite())
        .then_some(inside)
}
