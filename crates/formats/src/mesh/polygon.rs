//! Triangulates polygons.
//!
//! Convex polygons become fans from their first corner. Concave ones are cut by ear clipping in
//! their plane (Meisters, 1975; re-examining only the two neighbours of a cut follows Eberly,
//! "Triangulation by Ear Clipping", 2002). Any polygon of `n` corners yields `n - 2` triangles, so
//! a broken polygon yields odd triangles rather than none.

use snell_math::glam::DVec2;
use snell_math::{DVec3, Vec3};

/// Concave polygons with more corners become fans: ear clipping takes quadratic time.
const MOST_CORNERS: usize = 4096;

/// Triangulator with its scratch memory.
#[derive(Clone, Debug, Default)]
pub struct Triangulator {
    corners: Vec<Vec3>,
    flat: Vec<DVec2>,
    next: Vec<usize>,
    previous: Vec<usize>,
    reflex: Vec<bool>,
    triangles: Vec<[usize; 3]>,
}

impl Triangulator {
    /// Triangles of a polygon as corner numbers, with the winding of the polygon. Fewer than three
    /// corners give none.
    pub fn triangulate(&mut self, corners: impl Iterator<Item = Vec3>) -> &[[usize; 3]] {
        self.corners.clear();
        self.corners.extend(corners);
        self.triangles.clear();
        let n = self.corners.len();
        if n <= 3 || n > MOST_CORNERS || self.is_convex() {
            self.triangles.extend((2..n).map(|i| [0, i - 1, i]));
        } else {
            self.clip_ears();
        }
        &self.triangles
    }

    /// Projects the polygon along its normal (Newell's) and finds its reflex corners. True if there
    /// are none, or if the polygon has no normal.
    fn is_convex(&mut self) -> bool {
        let n = self.corners.len();
        let origin = self.corners[0].as_dvec3();
        let corner = |i: usize| self.corners[i % n].as_dvec3() - origin;
        let normal: DVec3 = (0..n).map(|i| corner(i).cross(corner(i + 1))).sum();
        let Some(normal) = normal.try_normalize() else { return true };
        let (x, y) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat.extend((0..n).map(|i| DVec2::new(corner(i).dot(x), corner(i).dot(y))));
        let flat = &self.flat;
        self.reflex.clear();
        self.reflex
            .extend((0..n).map(|i| turn(flat[(i + n - 1) % n], flat[i], flat[(i + 1) % n]) < 0.0));
        !self.reflex.contains(&true)
    }

    fn clip_ears(&mut self) {
        let n = self.corners.len();
        self.next.clear();
        self.next.extend((0..n).map(|i| (i + 1) % n));
        self.previous.clear();
        self.previous.extend((0..n).map(|i| (i + n - 1) % n));
        let mut at = 0;
        let mut left = n;
        // Corners examined since the last cut; if all failed, the polygon crosses itself and any
        // cut is as good.
        let mut failed = 0;
        while left > 3 {
            let (before, after) = (self.previous[at], self.next[at]);
            if failed < left && !self.is_ear(at) {
                at = after;
                failed += 1;
                continue;
            }
            self.triangles.push([before, at, after]);
            self.next[before] = after;
            self.previous[after] = before;
            for i in [before, after] {
                self.reflex[i] =
                    turn(self.flat[self.previous[i]], self.flat[i], self.flat[self.next[i]]) < 0.0;
            }
            left -= 1;
            // If there was no ear at all, do not search again: cut the rest as a fan.
            failed = if failed < left + 1 { 0 } else { left };
            at = after;
        }
        self.triangles.push([self.previous[at], at, self.next[at]]);
    }

    /// True if the triangle at a corner turns the right way and holds no reflex corner of the rest.
    fn is_ear(&self, at: usize) -> bool {
        let (before, after) = (self.previous[at], self.next[at]);
        let [a, b, c] = [before, at, after].map(|i| self.flat[i]);
        if turn(a, b, c) <= 0.0 {
            return false;
        }
        let mut i = self.next[after];
        while i != before {
            let p = self.flat[i];
            if self.reflex[i]
                && p != a
                && p != b
                && p != c
                && turn(a, b, p) >= 0.0
                && turn(b, c, p) >= 0.0
                && turn(c, a, p) >= 0.0
            {
                return false;
            }
            i = self.next[i];
        }
        true
    }
}

/// Twice the signed area of a triangle: positive if it turns left.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn area(corners: &[Vec3], triangles: &[[usize; 3]]) -> (f64, f64) {
        let mut signed = DVec3::ZERO;
        let mut unsigned = 0.0;
        for t in triangles {
            let [a, b, c] = t.map(|i| corners[i].as_dvec3());
            let twice = (b - a).cross(c - a);
            signed += twice / 2.0;
            unsigned += twice.length() / 2.0;
        }
        (signed.length(), unsigned)
    }

    #[test]
    fn an_arrow_is_cut_inside() {
        let arrow =
            [[0.0, 0.0], [2.0, -1.0], [0.0, 2.0], [-2.0, -1.0]].map(|[x, y]| Vec3::new(x, y, 7.0));
        let mut triangulator = Triangulator::default();
        let triangles = triangulator.triangulate(arrow.into_iter());
        let (signed, unsigned) = area(&arrow, triangles);
        assert_eq!(triangles.len(), 2);
        assert!((signed - unsigned).abs() < 1e-9, "{signed} {unsigned}");
        assert!((signed - 4.0).abs() < 1e-6);
    }

    #[test]
    fn non_finite_or_flat_polygons_still_give_triangles() {
        let mut triangulator = Triangulator::default();
        assert_eq!(triangulator.triangulate([Vec3::NAN; 6].into_iter()).len(), 4);
        assert_eq!(triangulator.triangulate([Vec3::ONE; 5].into_iter()).len(), 3);
        assert_eq!(triangulator.triangulate([Vec3::ONE; 2].into_iter()).len(), 0);
    }

    proptest! {
        /// Star-shaped polygons are simple: their triangles must cover each point of them once.
        #[test]
        fn star_shaped_polygons_are_covered_exactly(
            radii in prop::collection::vec(0.1f32..2.0, 4..40),
            tilt in 0.0f32..3.0,
        ) {
            let n = radii.len() as f32;
            let corners: Vec<Vec3> = radii.iter().enumerate().map(|(i, r)| {
                let (s, c) = (i as f32 / n * std::f32::consts::TAU).sin_cos();
                Vec3::new(r * c, r * s * tilt.cos(), r * s * tilt.sin())
            }).collect();
            let mut triangulator = Triangulator::default();
            let triangles = triangulator.triangulate(corners.iter().copied());
            prop_assert_eq!(triangles.len(), corners.len() - 2);
            let (signed, unsigned) = area(&corners, triangles);
            prop_assert!((signed - unsigned).abs() <= 1e-4 * unsigned, "{} {}", signed, unsigned);
        }

        #[test]
        fn any_corners_give_two_triangles_less(
            corners in prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), 3..60),
        ) {
            let mut triangulator = Triangulator::default();
            let triangles = triangulator.triangulate(corners.iter().map(|&c| Vec3::from(c)));
            prop_assert_eq!(triangles.len(), corners.len() - 2);
        }
    }
}
