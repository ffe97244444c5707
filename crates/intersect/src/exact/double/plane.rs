//! The intersection of a ray with the plane of a triangle, with an error of little more than one
//! unit in the last place for the given coordinates, however thin the triangle, however grazing the
//! ray, and however far away both are.
//!
//! With the edges `e1`, `e2` and the vector `r` from the ray's origin to a corner,
//! `t = (e1 x e2) . r / (e1 x e2) . d`. Double-double numbers suffice unless nearly 50 bits cancel,
//! which a bound on their error detects; then the two determinants are computed exactly.

use snell_math::exact::{DoubleDouble, Expansion, Number};
use snell_math::{DRay, DVec3, real};

/// The least ratio of a determinant to the sum of the magnitudes of its products for which
/// double-double numbers are accurate enough. Their error is at most `20 u^2 = 2^-101.6` of that
/// sum (`u` is `2^-53`: products of exact differences `5 u^2`, their difference 3, the product with
/// the third factor 5, two sums 6), so above this ratio the relative error is at most `2^-55`.
pub(crate) const CERTAIN: f64 = 1.0 / (1u64 << 46) as f64;

/// [`CERTAIN`] times this is the least ratio for which double-double numbers have the right sign:
/// their error is below `2^-101` of the sum.
const SURE_SIGN: f64 = 1.0 / (1u64 << 54) as f64;

/// Sums of the magnitudes of products up to this may have lost their last bits to underflow, even
/// if no factor is beyond [`LARGE`].
pub(crate) const TINY: f64 = 1e-150;
/// If the magnitudes of all factors add up to less than this, no product overflows.
pub(crate) const LARGE: f64 = 1e60;

/// A generous bound on the relative error of a determinant in plain `f64`, which is `8 u`.
pub(crate) const ROUGH: f64 = 1.0 / (1u64 << 49) as f64;

/// A rough intersection of a ray with the plane of a triangle, in plain `f64`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimate {
    /// A determinant for the distance of the ray's origin from the plane is accurate enough in
    /// double-double numbers if its magnitude is greater than this.
    least_height: f64,
    /// The same limit for the determinant of the ray's direction.
    least_speed: f64,
}

impl Estimate {
    /// Makes the estimate. `None` if the line of the ray certainly does not cross the plane after
    /// `t_min`.
    #[inline(always)]
    pub fn of(ray: &DRay, corners: &[DVec3; 3], t_min: f64) -> Option<Self> {
        let [a, b, c] = *corners;
        let (e1, e2, r, d) = (b - a, c - a, a - ray.origin, ray.direction);
        let normal = e1.cross(e2);
        let (height, speed) = (normal.dot(r), normal.dot(d));
        // The magnitudes of all products.
        let (e1, e2, r, d) = (e1.abs(), e2.abs(), r.abs(), d.abs());
        let sizes = DVec3::new(
            e1.y * e2.z + e1.z * e2.y,
            e1.z * e2.x + e1.x * e2.z,
            e1.x * e2.y + e1.y * e2.x,
        );
        let (heights, speeds) = (sizes.dot(r), sizes.dot(d));
        let in_range = heights > TINY && speeds > TINY && (r + d + e1 + e2).element_sum() < LARGE;
        // Most rays leave a surface, and the surface's own plane is behind their start.
        let (after, pace) = (height * speed.signum(), speed.abs());
        let error = (heights + t_min.abs() * speeds) * ROUGH;
        if in_range && pace > speeds * ROUGH && after - t_min * pace < -error {
            return None;
        }
        let least_speed = if in_range { speeds * CERTAIN } else { f64::INFINITY };
        Some(Self { least_height: heights * CERTAIN, least_speed })
    }

    /// The ray parameter at which the line of the ray crosses the plane. Infinite or NaN if both
    /// are parallel, or if it is out of the range of `f64`.
    ///
    /// A distance before `t_min` has the right sign, and may be less accurate.
    #[inline(always)]
    pub fn distance(self, ray: &DRay, corners: &[DVec3; 3], t_min: f64) -> f64 {
        let Self { least_height, least_speed } = self;
        let corners_by_axis = [corners[0].to_array(), corners[1].to_array(), corners[2].to_array()];
        let (height, speed) =
            determinants(&corners_by_axis, &ray.origin.to_array(), &ray.direction.to_array());
        let t = height.divided_by(speed);
        let is_fast = speed.high.abs() > least_speed;
        if is_fast && height.high.abs() > least_height {
            return t;
        }
        // A ray that starts on the triangle, and leaves it, as most rays there do.
        let is_behind = t < 0.0 && t_min >= 0.0;
        if is_fast && is_behind && height.high.abs() > least_height * SURE_SIGN {
            return t;
        }
        exact_plane_distance(ray, corners)
    }
}

/// The product of a direction and the normal of a triangle by the right-hand rule, of any length
/// but with the exact sign.
pub(crate) fn turning(direction: &DVec3, corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = *corners;
    let (e1, e2, d) = (b - a, c - a, *direction);
    let product = e1.cross(e2).dot(d);
    let (e1, e2, d) = (e1.abs(), e2.abs(), d.abs());
    let sizes =
        DVec3::new(e1.y * e2.z + e1.z * e2.y, e1.z * e2.x + e1.x * e2.z, e1.x * e2.y + e1.y * e2.x);
    let size = sizes.dot(d);
    if size > TINY && size < LARGE && product.abs() > size * ROUGH {
        product
    } else {
        exact_determinants(&DRay::new(a, *direction), corners).1.high
    }
}

/// The two determinants in double-double numbers, for one ray and triangle or for several in lanes.
#[inline(always)]
pub(crate) fn determinants<T: Number>(
    [a, b, c]: &[[T; 3]; 3],
    origin: &[T; 3],
    direction: &[T; 3],
) -> (DoubleDouble<T>, DoubleDouble<T>) {
    let (e1, e2, r) = (differences(b, a), differences(c, a), differences(a, origin));
    let normal = [minor(&e1, &e2, 1, 2), minor(&e1, &e2, 2, 0), minor(&e1, &e2, 0, 1)];
    let height = normal[0].times(r[0]).plus(normal[1].times(r[1])).plus(normal[2].times(r[2]));
    let [x, y, z] = *direction;
    let speed =
        normal[0].times_plain(x).plus(normal[1].times_plain(y)).plus(normal[2].times_plain(z));
    (height, speed)
}

/// A 2x2 minor of the matrix of two edges.
#[inline(always)]
fn minor<T: Number>(
    p: &[DoubleDouble<T>; 3],
    q: &[DoubleDouble<T>; 3],
    i: usize,
    j: usize,
) -> DoubleDouble<T> {
    p[i].times(q[j]).minus(p[j].times(q[i]))
}

#[inline(always)]
fn differences<T: Number>(p: &[T; 3], q: &[T; 3]) -> [DoubleDouble<T>; 3] {
    [
        DoubleDouble::difference(p[0], q[0]),
        DoubleDouble::difference(p[1], q[1]),
        DoubleDouble::difference(p[2], q[2]),
    ]
}

/// Computes [`Estimate::distance`] without rounding before the quotient.
#[cold]
#[inline(never)]
pub(super) fn exact_plane_distance(ray: &DRay, corners: &[DVec3; 3]) -> f64 {
    let (height, speed, exponent) = exact_determinants(ray, corners);
    scaled(height.divided_by(speed), exponent)
}

/// The two determinants of a ray and a triangle, computed without rounding and then rounded, and
/// the exponent of the power of two that their quotient lacks.
///
/// Positions and the direction are first scaled to near 1 by powers of two, so that nothing
/// overflows, and only negligible numbers underflow.
#[cold]
#[inline(never)]
fn exact_determinants(ray: &DRay, corners: &[DVec3; 3]) -> (DoubleDouble, DoubleDouble, i32) {
    let largest = corners.iter().fold(ray.origin.abs(), |m, v| m.max(v.abs())).max_element();
    let (place, pace) = (exponent(largest), exponent(ray.direction.abs().max_element()));
    let [a, b, c] = corners.map(|v| v.to_array().map(|x| scaled(x, -place)));
    let (o, d) = (
        ray.origin.to_array().map(|x| scaled(x, -place)),
        ray.direction.to_array().map(|x| scaled(x, -pace)),
    );
    let edge = |p: &[f64; 3]| -> [Expansion; 3] {
        std::array::from_fn(|i| Expansion::difference(p[i], a[i]))
    };
    let (e1, e2) = (edge(&b), edge(&c));
    let (mut height, mut speed) = (Expansion::default(), Expansion::default());
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let normal = e1[i].times(&e2[j]).plus(&e1[j].times(&e2[i]).negated());
        height = height.plus(&normal.times(&Expansion::difference(a[k], o[k])));
        speed = speed.plus(&normal.times(&Expansion::difference(d[k], 0.0)));
    }
    (height.rounded(), speed.rounded(), place - pace)
}

/// The power of two at or below `x`; 0 for 0.
fn exponent(x: f64) -> i32 {
    if x == 0.0 { 0 } else { ((x.to_bits() >> 52) as i32 & 0x7ff).max(1) - 1023 }
}

/// `x 2^exponent`, in steps, because `2^exponent` itself may be out of range.
fn scaled(x: f64, exponent: i32) -> f64 {
    let half = exponent / 2;
    x * real::powi(2f64, half) * real::powi(2f64, exponent - half)
}
