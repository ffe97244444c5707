//! Geometries other than meshes and shapes: sets of spheres and curves, user-defined sets
//! ([`PrimitiveSet`]), quads, heightfields, and moving geometry.
//!
//! A set gives the bounds of each of its primitives and its nearest intersection with a ray. All
//! else is common to every set: each primitive is an object in the tree of its group, at a few
//! bytes each.

pub mod cubic;
pub mod curves;
pub mod heightfield;
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
pub use heightfield::{Heightfield, HeightfieldError, HeightfieldMesh, Heights};
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
    /// Parameters of the point, defined by the set; they are reported as [`crate::Hit::uv`].
    pub uv: Vec2,
}

/// Many primitives of one kind, in the coordinates of the group that holds them: the interface for
/// user-defined geometry.
///
/// All methods must be pure functions of their arguments. Whatever they return, queries terminate
/// and all acceleration structures agree. A hit that is not finite does not count. A hit outside
/// the primitive's bounds is moved to the interval in which the ray is inside them, or does not
/// count if there is no such interval. A ray has at most 64 hits on one primitive.
pub trait PrimitiveSet: Send + Sync + std::fmt::Debug {
    /// The number of primitives; [`crate::Hit::primitive`] is an index below it.
    fn len(&self) -> usize;

    /// True if the set has no primitives.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The bounds of a primitive at all times from 0 to 1. They may be infinite; such primitives
    /// are tested against every ray. They are empty (or NaN) for a degenerate primitive, which is
    /// skipped and counted as degenerate.
    fn bounds(&self, primitive: usize) -> Bounds3d;

    /// The nearest intersection with a primitive in the open interval of the ray, from either side.
    /// Directions may have any length. `time` is that of the ray, from 0 to 1.
    fn closest(&self, primitive: usize, ray: &DRay, time: f32) -> Option<PrimitiveHit>;

    /// Returns [`Self::closest`] and [`Self::bounds`] together, which may be cheaper than two
    /// calls.
    fn closest_within(
        &self,
        primitive: usize,
        ray: &DRay,
        time: f32,
    ) -> Option<(PrimitiveHit, Bounds3d)> {
        self.closest(primitive, ray, time).map(|hit| (hit, self.bounds(primitive)))
    }

    /// Prefetches the memory that [`Self::closest`] will read first; called some time before it.
    /// Does nothing by default.
    fn fetch(&self, _primitive: usize) {}

    /// The surface of a primitive at `position`, a point on the primitive to within
    /// single-precision rounding, which was hit with this `uv` at this `time`.
    fn surface(&self, primitive: usize, position: DVec3, uv: Vec2, time: f32) -> ShapeSurface;

    /// The point of a primitive's surface nearest to `point` at time 0, with lengths measured by
    /// `metric`, and the `uv` of that point. `None`, the default, excludes the primitive from
    /// nearest-point queries.
    fn nearest_point(
        &self,
        _primitive: usize,
        _point: DVec3,
        _metric: &Metric,
    ) -> Option<(DVec3, Vec2)> {
        None
    }

    /// True if `point` is inside a solid primitive at time 0 or on its surface. False by default.
    fn contains(&self, _primitive: usize, _point: DVec3) -> bool {
        false
    }

    /// True for curves, whose `dpdu` runs along the fibre; reported as
    /// [`crate::SurfaceInteraction::on_curve`].
    fn is_curve(&self) -> bool {
        false
    }

    /// Linear RGB and alpha at a point: white unless the set has colours.
    fn color(&self, _primitive: usize, _uv: Vec2) -> [f32; 4] {
        [1.0; 4]
    }
}

/// The largest distance of a hit from its primitive's bounds, relative to its distance from the
/// ray's origin, that is still attributed to rounding.
const ROUNDING: f64 = 1e-8;

/// The parameter nearest to `t` at which the ray is within the bounds; `None` if it never is, or
/// `t` is not finite.
///
/// Hits outside the bounds must not count, because trees skip whatever lies outside their boxes.
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
    // An axis along which the ray does not move does not limit `t`, but the whole ray may be
    // outside the bounds on that axis.
    let moves = inverse.is_finite_mask();
    let outside = (low.cmpgt(margin) | high.cmplt(-margin)) & !moves;
    let enter = DVec3::select(moves, a.min(b), DVec3::NEG_INFINITY).max_element();
    let leave = DVec3::select(moves, a.max(b), DVec3::INFINITY).min_element();
    let inside = t.max(enter).min(leave);
    (!outside.any() && enter <= leave + leave.abs() * ROUNDING && inside.is_finite())
        .then_some(inside)
}
