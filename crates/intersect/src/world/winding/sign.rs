//! Exact decisions about a point and a triangle: on which side the point is, and whether it is on
//! the triangle.
//!
//! The signs are those of Shewchuk's orientation predicates (Adaptive Precision Floating-Point
//! Arithmetic and Fast Robust Geometric Predicates, 1997): plain arithmetic with a bound on its
//! error, and exact arithmetic where the bound does not decide. Coordinates must neither overflow
//! nor underflow when three of them are multiplied.

use snell_math::exact::Expansion;
use snell_math::glam::Vec3Swizzles;
use snell_math::{Bounds3d, DVec3};

/// The bound on the relative error of [`turn`], generously rounded.
const TURN_ERROR: f64 = 4.5e-16;

/// The bound on the relative error of [`height`], generously rounded.
const HEIGHT_ERROR: f64 = 1e-15;

/// The sign of a number; 0 for NaN.
fn sign(x: f64) -> i32 {
    i32::from(x > 0.0) - i32::from(x < 0.0)
}

fn sign_of(sum: &Expansion) -> i32 {
    sign(sum.rounded().high)
}

/// 1 if `p` is to the left of the line from `a` to `b`, -1 if it is to the right, 0 on the line.
#[inline]
pub fn turn(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> i32 {
    let (ax, ay, bx, by) = (a[0] - p[0], a[1] - p[1], b[0] - p[0], b[1] - p[1]);
    let (left, right) = (ax * by, ay * bx);
    let value = left - right;
    if value.abs() > (left.abs() + right.abs()) * TURN_ERROR {
        return sign(value);
    }
    // A difference is zero only if both numbers are equal, so these products are exact.
    match (ax == 0.0 || by == 0.0, ay == 0.0 || bx == 0.0) {
        (true, true) => 0,
        (true, false) => -sign(ay) * sign(bx),
        (false, true) => sign(ax) * sign(by),
        (false, false) => exact_turn(a, b, p),
    }
}

#[cold]
fn exact_turn(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> i32 {
    let d = |x: [f64; 2], i: usize| Expansion::difference(x[i], p[i]);
    sign_of(&d(a, 0).times(&d(b, 1)).plus(&d(a, 1).times(&d(b, 0)).negated()))
}

/// 1 if the corners run anticlockwise as seen from the side of their plane where `p` is not, -1 if
/// clockwise, 0 if `p` is in the plane: the sign of the determinant of the vectors from `p` to the
/// corners.
#[inline]
pub fn height([a, b, c]: &[DVec3; 3], p: DVec3) -> i32 {
    let (u, v, w) = (*a - p, *b - p, *c - p);
    let (first, second) = (v.yzx() * w.zxy(), v.zxy() * w.yzx());
    let value = u.dot(first - second);
    let size = u.abs().dot(first.abs() + second.abs());
    if value.abs() > size * HEIGHT_ERROR {
        return sign(value);
    }
    if size == 0.0 { 0 } else { exact_height([*a, *b, *c], p) }
}

#[cold]
fn exact_height(corners: [DVec3; 3], p: DVec3) -> i32 {
    let d = |corner: usize, axis: usize| Expansion::difference(corners[corner][axis], p[axis]);
    let mut sum = Expansion::default();
    for axis in 0..3 {
        let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
        let minor = d(1, y).times(&d(2, z)).plus(&d(1, z).times(&d(2, y)).negated());
        sum = sum.plus(&d(0, axis).times(&minor));
    }
    sign_of(&sum)
}

/// True if `p` is exactly on the triangle, its edges and corners included. If products of three
/// lengths of the triangle are out of range, only the corners are recognised.
#[inline]
pub fn is_on(corners: &[DVec3; 3], p: DVec3) -> bool {
    let [a, b, c] = *corners;
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    Bounds3d { min: low, max: high }.contains(p) && is_on_inside_box(corners, p, high - low)
}

#[cold]
fn is_on_inside_box(corners: &[DVec3; 3], p: DVec3, size: DVec3) -> bool {
    if !(1e-90..1e90).contains(&size.max_element()) {
        return corners.contains(&p);
    }
    if height(corners, p) != 0 {
        return false;
    }
    // A point of the plane is on the triangle if it is so in the projection along each axis; a
    // projection that is flat excludes only points beside its line.
    (0..3).all(|axis| {
        let flat = |v: DVec3| [v[(axis + 1) % 3], v[(axis + 2) % 3]];
        let [a, b, c] = corners.map(flat);
        let p = flat(p);
        let turns = [turn(a, b, p), turn(b, c, p), turn(c, a, p)];
        !(turns.contains(&1) && turns.contains(&-1))
    })
}

/// The number of times that the outline of a flat triangle runs round `p`: 1 if `p` is inside and
/// the corners run anticlockwise, -1 if they run clockwise, and 0 outside.
///
/// A point on an edge or corner counts as moved by an infinitely small step, the same for all
/// triangles, so that it is in just one of the triangles that meet there.
#[inline]
pub fn rounds([a, b, c]: [[f64; 2]; 3], p: [f64; 2]) -> i32 {
    let below = [a[1] <= p[1], b[1] <= p[1], c[1] <= p[1]];
    if below[0] == below[1] && below[1] == below[2] {
        return 0;
    }
    let edge = |from: [f64; 2], to: [f64; 2], starts_below: bool, ends_below: bool| {
        if starts_below == ends_below {
            0
        } else if starts_below {
            i32::from(turn(from, to, p) > 0)
        } else {
            -i32::from(turn(from, to, p) < 0)
        }
    };
    edge(a, b, below[0], below[1]) + edge(b, c, below[1], below[2]) + edge(c, a, below[2], below[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_exact_where_plain_arithmetic_has_only_rounding() {
        let e = f64::EPSILON;
        let (a, b) = ([0.1, 0.1], [12.0, 12.0]);
        for (p, expected) in [([0.5, 0.5], 0), ([0.5, 0.5 + e], 1), ([0.5 + e, 0.5], -1)] {
            assert_eq!((turn(a, b, p), turn(b, a, p)), (expected, -expected));
        }
        let corners = [DVec3::new(0.1, 0.1, 0.1), DVec3::new(12.0, 12.0, 12.0), DVec3::X];
        for (z, expected) in [(0.5, 0), (0.5 + e, 1), (0.5 - e, -1)] {
            let p = DVec3::new(0.5, 0.5, z);
            assert_eq!(height(&corners, p).abs(), i32::abs(expected), "{z}");
            assert_eq!(is_on(&corners, p), expected == 0, "{z}");
        }
    }

    #[test]
    fn a_point_where_triangles_meet_is_in_one_of_them() {
        let at = |x: i32, y: i32| [f64::from(x), f64::from(y)];
        // Eight triangles round the origin, which make a square.
        let rim: Vec<_> = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
            .map(|(x, y)| at(x, y))
            .into();
        for p in [at(0, 0), [0.5, 0.0], [0.0, 0.5], [0.5, 0.5], [-0.5, 0.5], [0.1, 0.7]] {
            let count: i32 = (0..8).map(|i| rounds([at(0, 0), rim[i], rim[(i + 1) % 8]], p)).sum();
            assert_eq!(count, 1, "{p:?}");
        }
    }
}
