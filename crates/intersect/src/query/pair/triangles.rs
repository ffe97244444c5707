//! The distance of two triangles.
//!
//! Two triangles that do not meet are nearest at two edges, or at a corner and a face (Larsen,
//! Gottschalk, Lin and Manocha, Fast Proximity Queries with Swept Sphere Volumes, 1999). Whether
//! they meet is decided exactly, by [`super::meeting`].

use super::meeting;
use snell_math::DVec3;

/// The nearest points of two triangles.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// The distance; 0 if and only if the triangles meet.
    pub distance: f64,
    /// A point of each. Both are the same if the triangles meet.
    pub points: [DVec3; 2],
}

/// The nearest points so far.
struct Best {
    squared: f64,
    points: [DVec3; 2],
}

impl Best {
    fn offer(&mut self, p: DVec3, q: DVec3) -> bool {
        let squared = (q - p).length_squared();
        let is_nearer = squared < self.squared;
        if is_nearer {
            *self = Self { squared, points: [p, q] };
        }
        is_nearer
    }
}

/// Where the corners of two triangles are along the normal of the first.
struct Heights {
    /// The normal, which is not normalised.
    normal: DVec3,
    /// Those of the second triangle, above a corner of the first.
    heights: [f64; 3],
    /// The distance of the two along the normal, times its length; 0 if they overlap. What is
    /// rounded of the normal of a sliver does not matter to it.
    gap: f64,
}

impl Heights {
    #[inline]
    fn of([a, b, c]: &[DVec3; 3], points: &[DVec3; 3]) -> Self {
        let (u, v) = (*b - *a, *c - *a);
        let normal = u.cross(v);
        let (own_u, own_v) = (u.dot(normal), v.dot(normal));
        let heights = points.map(|p| (p - *a).dot(normal));
        let [x, y, z] = heights;
        let above = x.min(y).min(z) - own_u.max(own_v).max(0.0);
        let below = own_u.min(own_v).min(0.0) - x.max(y).max(z);
        Self { normal, heights, gap: above.max(below).max(0.0) }
    }

    /// True if the triangles are farther apart than `limit` along the normal.
    #[inline]
    fn exceeds(&self, limit: f64) -> bool {
        self.gap * self.gap > limit * limit * self.normal.length_squared()
    }
}

/// The nearest points of two triangles; `None` if they are certainly farther apart than `limit`, or
/// a coordinate is not a number. Triangles may be degenerate. Distances below `contact`, which is
/// above the rounding of coordinates, are only returned if the triangles do not meet.
pub fn nearest(p: &[DVec3; 3], q: &[DVec3; 3], limit: f64, contact: f64) -> Option<Nearest> {
    let above = [Heights::of(p, q), Heights::of(q, p)];
    if above[0].exceeds(limit) || above[1].exceeds(limit) {
        return None;
    }
    let mut best = Best { squared: f64::INFINITY, points: [DVec3::ZERO; 2] };
    let is_certain = edges(p, q, &mut best) || faces(p, q, &above, &mut best);
    let is_far = best.squared > contact * contact;
    if !(is_certain && is_far)
        && let Some(point) = meeting::common_point(p, q, (best.points[0] + best.points[1]) * 0.5)
    {
        return Some(Nearest { distance: 0.0, points: [point; 2] });
    }
    let distance = best.squared.sqrt();
    // The distance of triangles that do not meet is never 0, whatever is rounded.
    distance
        .is_finite()
        .then(|| Nearest { distance: distance.max(f64::MIN_POSITIVE), points: best.points })
}

/// How far the second triangle begins behind the end of the first along a direction of length 1.
#[inline]
pub fn gap_along(p: &[DVec3; 3], q: &[DVec3; 3], along: DVec3) -> f64 {
    let [a, b, c] = p.map(|corner| corner.dot(along));
    let [d, e, f] = q.map(|corner| corner.dot(along));
    d.min(e).min(f) - a.max(b).max(c)
}

/// Offers the nearest points of each pair of edges; true once these are certainly those of the
/// triangles: when all other corners lie beyond the planes through them.
#[inline]
fn edges(p: &[DVec3; 3], q: &[DVec3; 3], best: &mut Best) -> bool {
    let along = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
    let others = [q[1] - q[0], q[2] - q[1], q[0] - q[2]];
    for i in 0..3 {
        for j in 0..3 {
            let (s, t) = segments(p[i], along[i], q[j], others[j]);
            let (x, y) = (p[i] + along[i] * s, q[j] + others[j] * t);
            if best.offer(x, y) {
                let (v, i, j) = (y - x, (i + 2) % 3, (j + 2) % 3);
                if (p[i] - x).dot(v) <= 0.0 && (q[j] - y).dot(v) >= 0.0 {
                    return true;
                }
            }
        }
    }
    false
}

/// Offers the corner of each triangle that is nearest to the plane of the other, with the point of
/// the face below it; true if a plane of a face is between the triangles.
fn faces(p: &[DVec3; 3], q: &[DVec3; 3], above: &[Heights; 2], best: &mut Best) -> bool {
    for (k, (face, points)) in [(p, q), (q, p)].into_iter().enumerate() {
        let Heights { normal, heights, gap } = above[k];
        if gap == 0.0 {
            continue;
        }
        let [x, y, z] = heights.map(f64::abs);
        let lowest = if x <= y && x <= z { 0 } else { 1 + usize::from(z < y) };
        let corner = points[lowest];
        let [a, b, c] = *face;
        let weight = |from: DVec3, to: DVec3| (to - from).cross(corner - from).dot(normal);
        let weights = [weight(b, c), weight(c, a), weight(a, b)];
        let sum: f64 = weights.iter().sum();
        if weights.iter().all(|&w| w >= 0.0) && sum > 0.0 {
            let foot = (a * weights[0] + b * weights[1] + c * weights[2]) / sum;
            let [x, y] = if k == 0 { [foot, corner] } else { [corner, foot] };
            best.offer(x, y);
        }
    }
    above.iter().any(|h| h.gap > 0.0)
}

/// The parameters of the nearest points of `p + s d` and `q + t e`, for `s` and `t` from 0 to 1.
#[inline]
fn segments(p: DVec3, d: DVec3, q: DVec3, e: DVec3) -> (f64, f64) {
    let w = q - p;
    let (dd, ee, de, dw, ew) = (d.dot(d), e.dot(e), d.dot(e), d.dot(w), e.dot(w));
    let area = dd * ee - de * de;
    let s = if area > 1e-6 * (dd * ee) {
        (dw * ee - de * ew) / area
    } else {
        // Nearly parallel: this form loses fewer digits.
        let n = d.cross(e);
        let nn = n.length_squared();
        if nn > 0.0 { w.cross(e).dot(n) / nn } else { 0.0 }
    };
    let s = s.clamp(0.0, 1.0);
    let t = if ee > 0.0 { (s * de - ew) / ee } else { 0.0 };
    if (0.0..=1.0).contains(&t) && ee > 0.0 {
        return (s, t);
    }
    let t = t.clamp(0.0, 1.0);
    let s = if dd > 0.0 { ((t * de + dw) / dd).clamp(0.0, 1.0) } else { 0.0 };
    (s, t)
}
