//! Whether two triangles meet: exactly, at edges and corners too, in one plane, and for triangles
//! that are no more than a segment or a point.
//!
//! Everything follows from signs of determinants of the corners (as with Guigue and Devillers, Fast
//! and Robust Triangle-Triangle Overlap Test Using Orientation Predicates, 2003), which are exact.

use crate::world::winding::sign::{height, turn};
use snell_math::DVec3;
use std::cmp::Ordering;

type Triangle = [DVec3; 3];

/// A point that two triangles have in common; `None` if they do not meet. Whether they meet is
/// exact; the point is rounded, and it is `flat` where they lie in one plane.
pub fn common_point(p: &Triangle, q: &Triangle, flat: DVec3) -> Option<DVec3> {
    let q_above = q.map(|corner| height(p, corner));
    if is_one_side(&q_above) {
        return None;
    }
    let p_above = p.map(|corner| height(q, corner));
    if is_one_side(&p_above) {
        return None;
    }
    let p_is_flat = q_above == [0; 3] && is_flat(p);
    let q_is_flat = p_above == [0; 3] && is_flat(q);
    let is_in_plane = match (p_is_flat, q_is_flat) {
        (true, true) => {
            let ([a, b], [c, d]) = (ends(p), ends(q));
            if height(&[a, b, c], d) != 0 {
                return None;
            }
            true
        }
        (false, _) if q_above == [0; 3] => true,
        (_, false) if p_above == [0; 3] => true,
        _ => false,
    };
    if is_in_plane {
        // A projection along an axis that does not flatten the plane decides; in the others, what
        // meets still meets.
        return (0..3).all(|axis| meet_in_projection(p, q, axis)).then_some(flat);
    }
    let through_p = || if p_is_flat { None } else { crossing(q, &q_above, p) };
    let through_q = || if q_is_flat { None } else { crossing(p, &p_above, q) };
    through_p().or_else(through_q)
}

/// True if no corner is in the plane of the other triangle or on different sides of it.
fn is_one_side(above: &[i32; 3]) -> bool {
    *above == [1; 3] || *above == [-1; 3]
}

/// Two coordinates of a point.
fn projected(p: DVec3, axis: usize) -> [f64; 2] {
    [p[(axis + 1) % 3], p[(axis + 2) % 3]]
}

/// True if the corners are on a line.
fn is_flat(corners: &Triangle) -> bool {
    (0..3).all(|axis| {
        let [a, b, c] = corners.map(|p| projected(p, axis));
        turn(a, b, c) == 0
    })
}

/// The ends of a triangle whose corners are on a line.
fn ends(corners: &Triangle) -> [DVec3; 2] {
    let order = |a: &DVec3, b: &DVec3| {
        let (a, b) = (a.to_array(), b.to_array());
        (0..3).map(|i| a[i].total_cmp(&b[i])).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
    };
    // Zeros have one sign here, so that equal coordinates are equal.
    let mut sorted = corners.map(|p| p + DVec3::ZERO);
    sorted.sort_by(order);
    [sorted[0], sorted[2]]
}

/// A point where an edge of `of` goes through `face`, or ends on it. `above` has the sides of the
/// corners.
fn crossing(of: &Triangle, above: &[i32; 3], face: &Triangle) -> Option<DVec3> {
    (0..3).find_map(|i| {
        let j = (i + 1) % 3;
        if above[i] == above[j] {
            return None;
        }
        let (u, v) = (of[i], of[j]);
        let [a, b, c] = *face;
        let sides = [height(&[u, a, b], v), height(&[u, b, c], v), height(&[u, c, a], v)];
        let is_through = !(sides.contains(&1) && sides.contains(&-1));
        is_through.then(|| {
            let normal = (b - a).cross(c - a);
            let (x, y) = ((u - a).dot(normal).abs(), (v - a).dot(normal).abs());
            let share = match (above[i], above[j]) {
                (0, _) => 0.0,
                (_, 0) => 1.0,
                _ if x + y > 0.0 => x / (x + y),
                _ => 0.5,
            };
            u.lerp(v, share)
        })
    })
}

/// True if the projections of two triangles along an axis meet.
fn meet_in_projection(p: &Triangle, q: &Triangle, axis: usize) -> bool {
    let (p, q) = (p.map(|c| projected(c, axis)), q.map(|c| projected(c, axis)));
    let edges = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
    let meet = |(i, j): (usize, usize)| segments_meet(p[i], p[(i + 1) % 3], q[j], q[(j + 1) % 3]);
    contains(&p, q[0]) || contains(&q, p[0]) || edges.into_iter().any(meet)
}

/// True if a point is in a triangle that is not flat.
fn contains([a, b, c]: &[[f64; 2]; 3], p: [f64; 2]) -> bool {
    let turns = [turn(*a, *b, p), turn(*b, *c, p), turn(*c, *a, p)];
    turn(*a, *b, *c) != 0 && !(turns.contains(&1) && turns.contains(&-1))
}

/// True if two segments of a plane meet.
fn segments_meet(a: [f64; 2], b: [f64; 2], c: [f64; 2], d: [f64; 2]) -> bool {
    let [x, y] = [turn(a, b, c), turn(a, b, d)];
    let [z, w] = [turn(c, d, a), turn(c, d, b)];
    if [x, y, z, w] == [0; 4] {
        // On one line, or points.
        return (0..2).all(|i| {
            let (low, high) = (a[i].min(b[i]), a[i].max(b[i]));
            c[i].min(d[i]) <= high && c[i].max(d[i]) >= low
        });
    }
    x * y <= 0 && z * w <= 0
}
