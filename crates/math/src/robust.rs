//! Error bounds of floating-point arithmetic, and ray origins offset from a surface without a
//! scene-dependent epsilon.

use glam::Vec3;

/// Half a unit in the last place of 1 in `f32`.
pub const MACHINE_EPSILON: f32 = f32::EPSILON * 0.5;

/// Bound of the relative error of `n` successive roundings: `n u / (1 - n u)` (Higham, Accuracy and
/// Stability of Numerical Algorithms, 2002, section 3.1).
#[inline]
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f32 * MACHINE_EPSILON;
    nu / (1.0 - nu)
}

/// A point that is certainly on the side of the surface through `position` into which `direction`
/// points.
///
/// `error` bounds the absolute error of each coordinate of `position`; `normal` is the unit
/// geometric normal (either side). The point moves along the normal until it is outside of the box
/// of possible positions, and each coordinate is rounded away from the surface (Pharr, Jakob and
/// Humphreys, Physically Based Rendering, 4th edition, section 6.8.6).
#[inline(always)]
pub fn offset_ray_origin(position: Vec3, error: Vec3, normal: Vec3, direction: Vec3) -> Vec3 {
    let distance = normal.abs().dot(error);
    let normal = if direction.dot(normal) < 0.0 { -normal } else { normal };
    let offset = normal * distance;
    let moved = position + offset;
    // The function rounds `p` in the direction of `o`. Rounding down is rounding up with the signs
    // reversed.
    let round = |p: f32, o: f32| {
        let sign = o.to_bits() & 0x8000_0000;
        let away = f32::from_bits(p.to_bits() ^ sign).next_up();
        if o.abs() > 0.0 { f32::from_bits(away.to_bits() ^ sign) } else { p }
    };
    Vec3::new(round(moved.x, offset.x), round(moved.y, offset.y), round(moved.z, offset.z))
}

/// `a * b - c * d` with an error of at most 1.5 units in the last place (Kahan; Jeannerod et al.,
/// 2013).
#[inline]
pub fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let cd = c * d;
    let difference = a.mul_add(b, -cd);
    let error = (-c).mul_add(d, cd);
    difference + error
}

/// Real roots of `a t^2 + b t + c = 0` in ascending order, without cancellation. A linear equation
/// returns its root twice; `None` without a real root, or if `a = b = 0`.
#[inline]
pub fn quadratic(a: f64, b: f64, c: f64) -> Option<(f64, f64)> {
    if a == 0.0 {
        return (b != 0.0).then(|| (-c / b, -c / b));
    }
    let discriminant = difference_of_products(b, b, 4.0 * a, c);
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (q / a, c / q) };
    Some(if t0 <= t1 { (t0, t1) } else { (t1, t0) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadratic_keeps_the_small_root() {
        let (small, large) = quadratic(1.0, -1e8, 1.0).expect("two real roots");
        assert!((small - 1e-8).abs() < 1e-22 && (large - 1e8).abs() < 1e-6);
        assert_eq!(quadratic(1.0, 0.0, 1.0), None);
        assert_eq!(quadratic(0.0, 2.0, -4.0), Some((2.0, 2.0)));
        assert_eq!(quadratic(1.0, 0.0, 0.0), Some((0.0, 0.0)));
    }

    #[test]
    fn the_offset_leaves_the_error_box_on_the_right_side() {
        let (p, e, n) =
            (Vec3::new(100.0, -3.0, 1e-6), Vec3::splat(1e-5), Vec3::new(0.6, 0.0, -0.8));
        let above = offset_ray_origin(p, e, n, n);
        let below = offset_ray_origin(p, e, n, -n);
        assert!((above - p).dot(n) >= n.abs().dot(e) && (below - p).dot(n) <= -n.abs().dot(e));
    }

    #[test]
    fn coordinates_are_rounded_away_by_one_step() {
        for p in
            [0.0, -0.0, 1.0, -1.0, f32::MIN_POSITIVE, -1e-45, f32::MAX, f32::MIN, f32::INFINITY]
        {
            for n in [0.0, -0.0, 1e-20, 1.0] {
                let moved = |direction: f32| {
                    offset_ray_origin(
                        Vec3::splat(p),
                        Vec3::splat(1e-12),
                        Vec3::new(n, 0.0, 0.0),
                        Vec3::X * direction,
                    )
                    .x
                };
                let offset = n * (n * 1e-12);
                let (up, down) = if offset > 0.0 {
                    ((p + offset).next_up(), (p - offset).next_down())
                } else {
                    (p, p)
                };
                assert_eq!((moved(1.0), moved(-1.0)), (up, down), "{p} {n}");
            }
        }
    }
}
