//! A ray in the form for tests of planes, boxes and cells, with a thickness that makes them
//! conservative.
//!
//! The exact test of a triangle rounds vertices relative to the ray's origin, so it may report a
//! hit although the line misses the triangle by up to about `4e-7` of the distance between the
//! origin and the farthest vertex. The hit is then moved into the triangle's box. So a structure
//! must treat the ray as a thick one: everything within [`BoxRay::width`] of the line counts. No
//! hit is then lost if the structure keeps a primitive in every cell that the primitive's box
//! touches.
//!
//! A structure may keep a triangle in fewer cells, namely those near the plane of the triangle
//! *within* its box ([`super::primitives::Region`]). A hit lies in that region if the ray's width
//! is below the region's margin. A ray from so far away that its width is larger
//! ([`BoxRay::is_wide`]) still passes the triangle within its width, but the reported distance may
//! belong to another cell. Such a ray finds all hits if it does not stop at the nearest one, which
//! [`BoxRay::cull`] ensures.

use super::Visitor;
use super::primitives::MARGIN;
use snell_math::{Bounds3, Bounds3d, DRay, DVec3};

/// The largest distance from the line at which contents still count, relative to the greatest
/// distance along an axis from the origin to the contents.
const WIDTH: f64 = 1e-6;

/// A thick ray in the coordinates of a group.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxRay {
    /// The origin.
    pub origin: [f64; 3],
    /// The direction, of any length.
    pub direction: [f64; 3],
    /// The reciprocal of the direction; infinite where the direction is 0.
    pub inverse: [f64; 3],
    /// The width with the signs of the direction.
    signed_width: [f64; 3],
    /// The largest distance from the line, along each axis, at which contents still count.
    pub width: f64,
    /// The start of the interval; nothing before it counts.
    pub t_min: f64,
    /// True if the ray comes from so far away that [`super::primitives::Region`]s are not valid for
    /// it.
    pub is_wide: bool,
}

impl BoxRay {
    /// Prepares a ray for contents within `bounds`.
    pub fn new(ray: &DRay, bounds: &Bounds3, t_min: f32) -> Self {
        let (o, d) = (ray.origin, ray.direction);
        let bounds: Bounds3d = (*bounds).into();
        let reach = (bounds.min - o).abs().max((bounds.max - o).abs()).max_element();
        // Triangles are projected relative to the origin rounded to `f32`.
        let rounded = o.as_vec3().as_dvec3();
        let rounding =
            if rounded == o { 0.0 } else { o.abs().max_element() * f64::from(f32::EPSILON) };
        let width = reach * WIDTH + rounding + f64::from(f32::MIN_POSITIVE);
        let signed = |d: f64| width.copysign(d);
        Self {
            origin: o.to_array(),
            direction: d.to_array(),
            inverse: d.recip().to_array(),
            signed_width: [signed(d.x), signed(d.y), signed(d.z)],
            width,
            t_min: t_min.into(),
            is_wide: width > margin_of(&bounds),
        }
    }

    /// The same ray with coordinates relative to a point.
    pub fn relative_to(&self, point: DVec3) -> Self {
        Self { origin: (DVec3::from_array(self.origin) - point).to_array(), ..*self }
    }

    /// The point at the parameter `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        DVec3::from_array(self.origin) + DVec3::from_array(self.direction) * t
    }

    /// True if the direction is negative along the axis.
    #[inline(always)]
    pub fn is_down(&self, axis: usize) -> bool {
        self.signed_width[axis] < 0.0
    }

    /// The interval in which the ray is within its width of a plane perpendicular to an axis. A ray
    /// parallel to the plane is inside always or never: if never, the interval is at plus infinity
    /// if the plane lies on the upper side, otherwise at minus infinity (reversed for a direction
    /// of -0). The ends may be NaN in the worst case; then they do not limit the ray.
    #[inline(always)]
    pub fn crossing(&self, axis: usize, plane: f64) -> (f64, f64) {
        let (distance, width, inverse) =
            (plane - self.origin[axis], self.signed_width[axis], self.inverse[axis]);
        ((distance - width) * inverse, (distance + width) * inverse)
    }

    /// Computes [`Self::crossing`] for a plane in general position, `normal . x = offset`. The
    /// third result is true if the ray goes in the direction of the normal.
    #[inline(always)]
    pub fn plane_crossing(&self, normal: &DVec3, offset: f64) -> (f64, f64, bool) {
        let (o, d) = (DVec3::from_array(self.origin), DVec3::from_array(self.direction));
        let (distance, speed) = (offset - normal.dot(o), normal.dot(d));
        let width =
            (self.width * (normal.x.abs() + normal.y.abs() + normal.z.abs())).copysign(speed);
        let inverse = 1.0 / speed;
        ((distance - width) * inverse, (distance + width) * inverse, speed.is_sign_positive())
    }

    /// The interval in which the ray is in a box, from `t_min` on; empty if its start is greater
    /// than its end.
    #[inline(always)]
    pub fn span(&self, low: [f64; 3], high: [f64; 3]) -> (f64, f64) {
        let (mut start, mut end) = (self.t_min, f64::INFINITY);
        for axis in 0..3 {
            let (near, far) =
                if self.is_down(axis) { (high[axis], low[axis]) } else { (low[axis], high[axis]) };
            // A NaN as the right operand is ignored.
            start = start.max(self.crossing(axis, near).0);
            end = end.min(self.crossing(axis, far).1);
        }
        (start, end)
    }

    /// [`Self::span`] of a box in single precision.
    #[inline(always)]
    pub fn span_of(&self, b: &Bounds3) -> (f64, f64) {
        let wide = |v: snell_math::Vec3| [f64::from(v.x), f64::from(v.y), f64::from(v.z)];
        self.span(wide(b.min), wide(b.max))
    }

    /// The distance beyond which regions can be skipped by structures that keep primitives in their
    /// [`super::primitives::Region`] only.
    #[inline(always)]
    pub fn cull(&self, visitor: &dyn Visitor) -> f64 {
        if self.is_wide { f64::INFINITY } else { visitor.cull() }
    }
}

/// The margin of regions within `bounds`.
pub(crate) fn margin_of(bounds: &Bounds3d) -> f64 {
    bounds.size().max_element() * MARGIN
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec3;

    const UNIT: Bounds3 = Bounds3 { min: Vec3::ZERO, max: Vec3::ONE };

    fn ray(o: [f64; 3], d: [f64; 3]) -> BoxRay {
        BoxRay::new(&DRay::new(DVec3::from_array(o), DVec3::from_array(d)), &UNIT, 0.0)
    }

    #[test]
    fn a_ray_along_a_side_is_in_the_box_and_one_beside_it_is_not() {
        for (y, inside) in [
            (0.0, true),
            (1.0, true),
            (-1e-7, true),
            (1.0 + 1e-7, true),
            (-1e-3, false),
            (1.001, false),
        ] {
            for d in [0.0, -0.0] {
                let (start, end) = ray([-1.0, y, 0.5], [1.0, d, d]).span_of(&UNIT);
                assert_eq!(start <= end, inside, "{y} {d}");
                if inside {
                    assert!((0.999..=1.0).contains(&start) && (2.0..2.001).contains(&end));
                }
            }
        }
    }

    #[test]
    fn wide_rays_come_from_far_away() {
        assert!(!ray([0.0, 3.0, 0.0], [1.0, 0.0, 0.0]).is_wide);
        assert!(ray([0.0, 3e3, 0.0], [1.0, 0.0, 0.0]).is_wide);
        assert!(ray([0.0, 1e300, 0.0], [1.0, 0.0, 0.0]).is_wide);
    }

    #[test]
    fn a_plane_across_an_axis_is_crossed_alike_by_both_ways_to_ask() {
        let r = ray([0.3, 0.2, 0.1], [0.5, -1.0, 2.0]);
        for axis in 0..3 {
            let (a, b) = r.crossing(axis, 0.7);
            let (c, d, up) = r.plane_crossing(
                &DVec3::from_array(std::array::from_fn(|i| f64::from(i == axis))),
                0.7,
            );
            assert_eq!((a, b, r.is_down(axis)), (c, d, !up));
        }
    }
}
