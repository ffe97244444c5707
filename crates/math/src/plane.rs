//! Planes, and convex polygons cut by them.

use crate::{Bounds3d, DVec3};

/// The plane of all points `p` with `normal . p = offset`. Points with `normal . p > offset` are in
/// front of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The plane's normal, which points to the front. It may have any length, and distances are
    /// multiplied by that length.
    pub normal: DVec3,
    /// `normal . p` for the points `p` of the plane.
    pub offset: f64,
}

/// The vertices of convex polygons, one polygon after another.
pub type Vertices = Vec<DVec3>;

/// The side of a plane on which a polygon or box lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// All of the polygon or box is on the plane.
    On,
    /// None of the polygon or box is in front of the plane.
    Back,
    /// None of the polygon or box is behind the plane.
    Front,
    /// Some of the polygon or box is in front of the plane, and some behind.
    Across,
}

impl Plane {
    /// `normal . p - offset`: the signed distance of a point, times the length of the normal;
    /// positive in front.
    #[inline(always)]
    pub fn distance(&self, p: &DVec3) -> f64 {
        self.normal.dot(*p) - self.offset
    }

    /// The side on which a polygon lies; distances up to `tolerance` count as zero.
    #[inline(always)]
    pub fn side(&self, polygon: &[DVec3], tolerance: f64) -> Side {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for p in polygon {
            let d = self.distance(p);
            (low, high) = (low.min(d), high.max(d));
        }
        side_of(low, high, tolerance)
    }

    /// The side on which a box lies. A box is never on a plane, unless it is flat.
    #[inline(always)]
    pub fn side_of_box(&self, b: &Bounds3d, tolerance: f64) -> Side {
        let (center, half) = (b.center(), b.size() * 0.5);
        let (middle, radius) = (self.distance(&center), self.normal.abs().dot(half));
        side_of(middle - radius, middle + radius, tolerance)
    }

    /// Appends to `out` the part of a polygon on one side of the plane (`sign` 1: the front, -1:
    /// the back). Vertices on the plane belong to both parts.
    pub fn cut(&self, polygon: &[DVec3], sign: f64, out: &mut Vertices) {
        let Some(mut from) = polygon.last() else { return };
        let mut d_from = self.distance(from) * sign;
        for to in polygon {
            let d_to = self.distance(to) * sign;
            if (d_from < 0.0 && d_to > 0.0) || (d_from > 0.0 && d_to < 0.0) {
                // The order of the two ends makes the intersection point the same for both sides.
                let (a, b, da, db) =
                    if d_from < 0.0 { (from, to, d_from, d_to) } else { (to, from, d_to, d_from) };
                out.push(*a + (*b - *a) * (da / (da - db)));
            }
            if d_to >= 0.0 {
                out.push(*to);
            }
            (from, d_from) = (to, d_to);
        }
    }
}

fn side_of(low: f64, high: f64, tolerance: f64) -> Side {
    match (low < -tolerance, high > tolerance) {
        (false, false) => Side::On,
        (true, false) => Side::Back,
        (false, true) => Side::Front,
        (true, true) => Side::Across,
    }
}
