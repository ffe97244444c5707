//! The span of a ray inside a convex solid: its entry and its exit.
//!
//! Closed shapes here are convex, and a convex solid is the intersection of simpler ones (for a
//! cylinder, a tube and a slab). Intersecting *intervals* instead of testing sides and caps one by
//! one cannot leak: if the span in the tube ends before that in the slab, the ray exits through the
//! side, otherwise through a cap; nothing falls between the two at the rim.

use super::ShapeHit;
use snell_math::{DRay, DVec3, robust};

/// The closed interval of the ray parameter inside a convex solid. It may be unbounded, and is
/// empty if `enter.t > exit.t`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Where the ray enters the solid.
    pub enter: ShapeHit,
    /// Where the ray leaves the solid.
    pub exit: ShapeHit,
}

impl Span {
    /// The span from `enter` to `exit`, with the faces hit there. `None` if it is empty or a
    /// parameter is NaN.
    pub fn new(enter: f64, exit: f64, faces: [u32; 2]) -> Option<Self> {
        let hit = |t, face| ShapeHit { t, face };
        (enter <= exit).then_some(Self { enter: hit(enter, faces[0]), exit: hit(exit, faces[1]) })
    }

    /// The intersection of both spans. Where both end at the same parameter, the face of `self` is
    /// kept.
    pub fn intersection(self, other: Self) -> Option<Self> {
        let enter = if other.enter.t > self.enter.t { other.enter } else { self.enter };
        let exit = if other.exit.t < self.exit.t { other.exit } else { self.exit };
        (enter.t <= exit.t).then_some(Self { enter, exit })
    }
}

/// The part of the line `o + t d`, in one coordinate, between `low` and `high`. `faces` are the
/// face numbers at `low` and `high`.
pub(super) fn slab(o: f64, d: f64, [low, high]: [f64; 2], faces: [u32; 2]) -> Option<Span> {
    if d == 0.0 {
        return if low <= o && o <= high {
            Span::new(f64::NEG_INFINITY, f64::INFINITY, faces)
        } else {
            None
        };
    }
    // These are divisions rather than products with `1 / d`, because their signs and order are
    // exact.
    let (at_low, at_high) = ((low - o) / d, (high - o) / d);
    if d > 0.0 {
        Span::new(at_low, at_high, faces)
    } else {
        Span::new(at_high, at_low, [faces[1], faces[0]])
    }
}

/// Ascending roots of `a t^2 + 2 b t + c = 0` for `a != 0`, given the
/// `discriminant = b^2 - a c >= 0` computed more accurately than by this formula. The sign of a
/// root near 0 follows from the signs of `c` and `b`, so a line that starts off the surface gets no
/// root with the wrong sign.
pub(super) fn roots(a: f64, b: f64, c: f64, discriminant: f64) -> (f64, f64) {
    let q = -(b + discriminant.sqrt().copysign(b));
    let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (q / a, c / q) };
    if t0 <= t1 { (t0, t1) } else { (t1, t0) }
}

/// The cross product, with an error of at most 1.5 units in the last place in each coordinate.
pub(super) fn accurate_cross(a: DVec3, b: DVec3) -> DVec3 {
    let minor = robust::difference_of_products;
    DVec3::new(minor(a.y, b.z, a.z, b.y), minor(a.z, b.x, a.x, b.z), minor(a.x, b.y, a.y, b.x))
}

/// The direction of a ray times the power of two that brings its largest coordinate to `[1, 2)`,
/// and that power. Squares of very long or short directions then neither overflow nor vanish, and
/// the scaling is exact. A parameter along the scaled direction, multiplied by the power, is the
/// parameter along the ray. `None` for rays that hit nothing, because they are not finite or have
/// no direction.
pub(super) fn scaled_direction(ray: &DRay) -> Option<(DVec3, f64)> {
    let largest = ray.direction.abs().max_element();
    if !ray.origin.is_finite() || !ray.direction.is_finite() || largest == 0.0 {
        return None;
    }
    let exponent = largest.to_bits() >> 52;
    let scale = f64::from_bits((2046 - exponent).max(1) << 52);
    Some((ray.direction * scale, scale))
}

/// The ends of a ray's span that lie in its open interval and count as hits, nearest first. `span`
/// is called with the origin and the scaled direction; `counts` returns true for the numbers of
/// faces on which hits count.
#[inline]
pub(super) fn crossings(
    ray: &DRay,
    span: impl FnOnce(DVec3, DVec3) -> Option<Span>,
    counts: impl Fn(u32) -> bool,
) -> [Option<ShapeHit>; 2] {
    let Some((direction, scale)) = scaled_direction(ray) else { return [None; 2] };
    let Some(Span { enter, exit }) = span(ray.origin, direction) else { return [None; 2] };
    let end = |hit: ShapeHit| {
        let t = hit.t * scale;
        (t.is_finite() && ray.contains(t) && counts(hit.face)).then_some(ShapeHit { t, ..hit })
    };
    match [end(enter), end(exit)] {
        [None, exit] => [exit, None],
        both => both,
    }
}
