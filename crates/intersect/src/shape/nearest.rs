//! Nearest points on surfaces. Distances are measured after a linear map, so that the result is
//! nearest *in world space* also for a shape that is stretched or sheared there.

use snell_math::{DMat3, DVec2, DVec3, real, rotation};

/// A point on a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapePoint {
    /// The point, in the coordinates of the shape.
    pub position: DVec3,
    /// The face on which the point lies.
    pub face: u32,
}

/// A metric: the difference `v` between two points of a shape has the length `|M v|`.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    linear: DMat3,
    /// `M^T M`.
    gram: DMat3,
    is_similarity: bool,
}

/// Relative tolerance for recognising a rotation with a uniform scale.
const SIMILAR: f64 = 1e-13;

impl Metric {
    /// The Euclidean metric, with `M` the identity.
    pub const EUCLIDEAN: Self =
        Self { linear: DMat3::IDENTITY, gram: DMat3::IDENTITY, is_similarity: true };

    /// The metric of the linear map `M = linear`, which is the linear part of `world_from_shape`.
    pub fn new(linear: DMat3) -> Self {
        let gram = linear.transpose() * linear;
        let g = gram.to_cols_array_2d();
        let small = |x: f64| x.abs() <= SIMILAR * g[0][0];
        let is_similarity = small(g[0][0] - g[1][1])
            && small(g[0][0] - g[2][2])
            && small(g[0][1])
            && small(g[0][2])
            && small(g[1][2]);
        Self { linear, gram, is_similarity }
    }

    /// The linear map `M`.
    pub fn linear(&self) -> &DMat3 {
        &self.linear
    }

    /// Returns -1 if the map is a reflection, otherwise 1.
    pub fn orientation(&self) -> f64 {
        if self.linear.determinant() < 0.0 { -1.0 } else { 1.0 }
    }

    /// True if `M` is a rotation with a uniform scale: then the nearest point is the same as in the
    /// Euclidean metric.
    pub fn is_similarity(&self) -> bool {
        self.is_similarity
    }

    /// The squared length of the difference `v` between two points.
    #[inline]
    pub fn length_squared(&self, v: DVec3) -> f64 {
        (self.linear * v).length_squared()
    }

    /// Weights `w` of a lower bound on lengths without products of different axes:
    /// `|M v|^2 >= sum(w[i] v[i]^2)`. The bound is exact up to `1e-9` for maps that first scale
    /// along the axes and then rotate.
    ///
    /// With `D` the diagonal of `G = M^T M`, this is `w = e D`, where `e` is the least eigenvalue
    /// of `D^-1/2 G D^-1/2`.
    pub fn axis_weights(&self) -> DVec3 {
        let g = self.gram;
        let diagonal = DVec3::new(g.x_axis.x, g.y_axis.y, g.z_axis.z);
        let root = diagonal.map(f64::sqrt);
        let (xy, xz, yz) = (
            g.x_axis.y / (root.x * root.y),
            g.x_axis.z / (root.x * root.z),
            g.y_axis.z / (root.y * root.z),
        );
        // Gershgorin's bound is good enough unless the map shears strongly.
        let off = (xy.abs() + xz.abs()).max(xy.abs() + yz.abs()).max(xz.abs() + yz.abs());
        let least = if off < 0.01 {
            1.0 - off
        } else {
            let unit = DMat3::from_cols(
                DVec3::new(1.0, xy, xz),
                DVec3::new(xy, 1.0, yz),
                DVec3::new(xz, yz, 1.0),
            );
            eigen(&unit).0.into_iter().fold(f64::INFINITY, f64::min)
        };
        let weights = diagonal * (least - 1e-9).max(0.0);
        if weights.is_finite() { weights } else { DVec3::ZERO }
    }

    /// The candidate nearest to `point`; the first one of equally near candidates. Candidates that
    /// are not finite are ignored.
    pub fn nearest(
        &self,
        point: DVec3,
        candidates: impl IntoIterator<Item = ShapePoint>,
    ) -> Option<ShapePoint> {
        let mut best = None;
        let mut least = f64::INFINITY;
        for candidate in candidates {
            let squared = self.length_squared(candidate.position - point);
            if squared < least || (best.is_none() && squared <= least) {
                (best, least) = (Some(candidate), squared);
            }
        }
        best
    }
}

/// The point of a triangle nearest to `point`, and its barycentric coordinates of the second and
/// third corner.
///
/// The plane is divided into the regions nearest to each corner, edge and the inside (Ericson,
/// Real-Time Collision Detection, 2005, section 5.1.5); the region of `point` gives the result.
/// Where rounding makes the region uncertain, as in slivers, all candidates are tried. On an edge
/// the result has the same bits for every triangle that shares the edge.
#[inline]
pub fn on_triangle(metric: &Metric, point: DVec3, corners: &[DVec3; 3]) -> (DVec3, DVec2) {
    let r = corners.map(|c| metric.linear * (c - point));
    let normal = (r[1] - r[0]).cross(r[2] - r[0]);
    let w =
        [normal.dot(r[1].cross(r[2])), normal.dot(r[2].cross(r[0])), normal.dot(r[0].cross(r[1]))];
    let size = r[0].length_squared().max(r[1].length_squared()).max(r[2].length_squared());
    let doubt = 1e-12 * size * normal.length() + 1e-14 * size * size;
    let mut best = (corners[0], DVec2::ZERO);
    let mut least = f64::INFINITY;
    let mut consider = |position: DVec3, uv: DVec2| {
        let squared = metric.length_squared(position - point);
        if squared < least {
            (best, least) = ((position, uv), squared);
        }
    };
    if w.iter().all(|&w| w > 0.0) {
        let uv = DVec2::new(w[1], w[2]) / (w[0] + w[1] + w[2]);
        let [a, b, c] = *corners;
        let position = a + (b - a) * uv.x + (c - a) * uv.y;
        consider(position.max(a.min(b).min(c)).min(a.max(b).max(c)), uv);
    }
    for (edge, _) in w.iter().enumerate().filter(|(_, w)| w.is_nan() || **w <= doubt) {
        let (i, j) = ((edge + 1) % 3, (edge + 2) % 3);
        let (position, s) = on_segment(metric, point, corners[i], corners[j]);
        let mut b = [0.0; 3];
        (b[i], b[j]) = (1.0 - s, s);
        consider(position, DVec2::new(b[1], b[2]));
    }
    best
}

/// The point of a segment nearest to `point`, and its position along the segment from 0 at `a` to 1
/// at `b`. Swapping `a` and `b` gives the same point, bit for bit.
#[inline]
pub(super) fn on_segment(metric: &Metric, point: DVec3, a: DVec3, b: DVec3) -> (DVec3, f64) {
    let swapped = b.to_array() < a.to_array();
    let (a, b) = if swapped { (b, a) } else { (a, b) };
    let (start, along) = (metric.linear * (a - point), metric.linear * (b - a));
    let s = -start.dot(along) / along.length_squared();
    let (position, s) = if s >= 1.0 {
        (b, 1.0)
    } else if s > 0.0 {
        ((a + (b - a) * s).max(a.min(b)).min(a.max(b)), s)
    } else {
        (a, 0.0)
    };
    (position, if swapped { 1.0 - s } else { s })
}

/// The point nearest to `point` on the sphere around the origin.
pub(crate) fn on_sphere(metric: &Metric, point: DVec3, radius: f64) -> DVec3 {
    if metric.is_similarity {
        return point.try_normalize().unwrap_or(DVec3::Y) * radius;
    }
    let (values, axes) = eigen(&metric.gram);
    let q = axes.transpose() * point;
    let x = on_round([values[0], values[1], values[2]], q.to_array(), radius);
    (axes * DVec3::from_array(x)).normalize_or(DVec3::Y) * radius
}

/// The point nearest to `point` on a ring (a disk if `inner_radius` is 0), which lies in the plane
/// perpendicular to the axis number `axis` at height `h` along it.
pub(super) fn on_ring(
    metric: &Metric,
    point: DVec3,
    axis: usize,
    h: f64,
    radius: f64,
    inner_radius: f64,
) -> DVec3 {
    let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
    let center = DVec2::new(point[x], point[y]) + plane_shift(metric, axis, h - point[axis]);
    let place = |p: DVec2| {
        let mut at = DVec3::ZERO;
        (at[x], at[y], at[axis]) = (p.x, p.y, h);
        at
    };
    let rho = center.length();
    if inner_radius <= rho && rho <= radius {
        return place(center);
    }
    let rim = if rho > radius { radius } else { inner_radius };
    if metric.is_similarity {
        return place(center.try_normalize().unwrap_or(DVec2::X) * rim);
    }
    // Distances within the plane follow from the rows and columns of the Gram matrix for `x` and
    // `y`.
    let g = metric.gram.to_cols_array_2d();
    let turn = 0.5 * real::atan2(2.0 * g[x][y], g[x][x] - g[y][y]);
    let axis = rotation::unit_vector(turn);
    let axes = [axis, axis.perp()];
    let value = |v: DVec2| g[x][x] * v.x * v.x + 2.0 * g[x][y] * v.x * v.y + g[y][y] * v.y * v.y;
    let q = on_round(axes.map(value), axes.map(|a| a.dot(center)), rim);
    place((axes[0] * q[0] + axes[1] * q[1]).normalize_or(DVec2::X) * rim)
}

/// The offset between two points of a plane perpendicular to the axis number `axis`, which lies
/// `rise` along that axis from a given point: from the projection of the point along the axis to
/// the point of the plane nearest in the metric.
fn plane_shift(metric: &Metric, axis: usize, rise: f64) -> DVec2 {
    let g = metric.gram.to_cols_array_2d();
    let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
    let (a, b, c) = (g[x][x], g[x][y], g[y][y]);
    let (p, q) = (g[x][axis] * -rise, g[y][axis] * -rise);
    let shift = DVec2::new(p * c - q * b, q * a - p * b) / (a * c - b * b);
    if shift.is_finite() { shift } else { DVec2::ZERO }
}

/// The point of the plane z = 0 nearest to `point`.
pub(super) fn on_plane(metric: &Metric, point: DVec3) -> DVec3 {
    (point.truncate() + plane_shift(metric, 2, -point.z)).extend(0.0)
}

/// The number of angles at which [`around`] compares distances before it refines.
const SAMPLES: usize = 64;

/// The nearest of the points `at(angle)`: evenly spaced angles are compared, and each local minimum
/// is refined by golden-section search.
pub(super) fn around(metric: &Metric, point: DVec3, at: impl Fn(f64) -> DVec3) -> DVec3 {
    let step = std::f64::consts::TAU / SAMPLES as f64;
    let cost = |angle: f64| metric.length_squared(at(angle) - point);
    let samples: [f64; SAMPLES] = std::array::from_fn(|i| cost(i as f64 * step));
    let mut best = 0.0;
    let mut least = f64::INFINITY;
    for i in 0..SAMPLES {
        let (before, after) = (samples[(i + SAMPLES - 1) % SAMPLES], samples[(i + 1) % SAMPLES]);
        if samples[i] <= before && samples[i] <= after {
            let angle = golden_section((i as f64 - 1.0) * step, (i as f64 + 1.0) * step, cost);
            let found = cost(angle);
            if found < least {
                (best, least) = (angle, found);
            }
        }
    }
    at(best)
}

/// The argument at which a unimodal function has its minimum in an interval, by golden-section
/// search (Kiefer, Sequential minimax search for a maximum, 1953).
pub(crate) fn golden_section(mut low: f64, mut high: f64, cost: impl Fn(f64) -> f64) -> f64 {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let (mut a, mut b) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut at_a, mut at_b) = (cost(a), cost(b));
    for _ in 0..48 {
        if at_a <= at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - RATIO * (high - low);
            at_a = cost(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + RATIO * (high - low);
            at_b = cost(b);
        }
    }
    0.5 * (low + high)
}

/// The point of the circle or sphere `|x| = radius` that minimises `sum(g[i] (x[i] - q[i])^2)` with
/// positive `g`.
///
/// The point is `x = g q / (g + m)` for the greatest `m` that gives `x` the right length (the
/// multiplier of the trust region subproblem; Moré and Sorensen, Computing a trust region step,
/// 1983). `m` is found by bisection, as in Eberly, Distance from a point to an ellipsoid, which is
/// slow but never fails.
fn on_round<const N: usize>(g: [f64; N], q: [f64; N], radius: f64) -> [f64; N] {
    let least = (0..N).fold(0, |a, b| if g[b] < g[a] { b } else { a });
    let part = |i: usize, m: f64| {
        // Where both are 0, at the pole, the other coordinates come first and this one takes the
        // rest of the length.
        let (above, below) = (g[i] * q[i], g[i] + m);
        if above == 0.0 { 0.0 } else { above / below }
    };
    let length = |m: f64| (0..N).map(|i| real::powi(part(i, m), 2)).sum::<f64>().sqrt();
    let pull = (0..N).map(|i| real::powi(g[i] * q[i], 2)).sum::<f64>().sqrt();
    // `m` is kept as its distance from the pole at `-g[least]`, which may be far smaller than `m`.
    let (mut low, mut high) = ((g[least] * q[least]).abs() / radius, pull / radius);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if length(middle - g[least]) > radius { low = middle } else { high = middle }
    }
    let m = high - g[least];
    let mut x: [f64; N] = std::array::from_fn(|i| part(i, m));
    let rest = radius * radius - (0..N).filter(|&i| i != least).map(|i| x[i] * x[i]).sum::<f64>();
    // The last coordinate is computed from the length, because near the pole the quotient is
    // inaccurate.
    x[least] = rest.max(0.0).sqrt().copysign(q[least]);
    x
}

/// Eigenvalues and unit eigenvectors (columns) of a symmetric matrix, by Jacobi rotations.
pub(crate) fn eigen(matrix: &DMat3) -> ([f64; 3], DMat3) {
    let mut a = matrix.to_cols_array_2d();
    let mut v = DMat3::IDENTITY.to_cols_array_2d();
    for _ in 0..16 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 || !a[p][q].is_finite() {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + real::hypot(theta, 1.0));
            let c = 1.0 / real::hypot(t, 1.0);
            let s = t * c;
            for column in &mut a {
                (column[p], column[q]) =
                    (c * column[p] - s * column[q], s * column[p] + c * column[q]);
            }
            let (ap, aq) = (a[p], a[q]);
            for k in 0..3 {
                (a[p][k], a[q][k]) = (c * ap[k] - s * aq[k], s * ap[k] + c * aq[k]);
            }
            let (vp, vq) = (v[p], v[q]);
            for k in 0..3 {
                (v[p][k], v[q][k]) = (c * vp[k] - s * vq[k], s * vp[k] + c * vq[k]);
            }
            (a[p][q], a[q][p]) = (0.0, 0.0);
        }
    }
    ([a[0][0], a[1][1], a[2][2]], DMat3::from_cols_array_2d(&v))
}
