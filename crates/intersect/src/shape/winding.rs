//! The generalised winding number of a surface around a point (Jacobson, Kavan and Sorkine-Hornung,
//! Robust Inside-Outside Segmentation using Generalized Winding Numbers, 2013), which is the signed
//! solid angle of the surface over `4 pi`. The angle is positive where the surface is seen from
//! behind (from the side opposite to its normal), so the number is 1 inside a closed surface and 0
//! outside.

use super::Metric;
use snell_math::{DMat3, DVec2, DVec3, real, rotation};
use std::f64::consts::TAU;

/// The winding number of a triangle around the origin (van Oosterom and Strackee, The Solid Angle
/// of a Plane Triangle, 1983); 0 if the origin is in the triangle's plane.
#[inline]
pub(crate) fn of_triangle([a, b, c]: [DVec3; 3]) -> f64 {
    let determinant = a.dot(b.cross(c));
    if determinant == 0.0 || determinant.is_nan() {
        return 0.0;
    }
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    real::atan2(determinant, denominator) / TAU
}

/// The winding number of triangles of a shape around `point`, measured in world space.
pub(super) fn of_triangles(
    metric: &Metric,
    point: DVec3,
    triangles: impl IntoIterator<Item = [DVec3; 3]>,
) -> f64 {
    let in_world = |t: [DVec3; 3]| of_triangle(t.map(|v| *metric.linear() * (v - point)));
    triangles.into_iter().map(in_world).sum::<f64>() * metric.orientation()
}

/// The winding number around `point` of the disk perpendicular to the axis number `axis` at height
/// `h`, with its normal along the axis; 0 if `point` is in the plane of the disk.
///
/// The solid angle is the flux of a monopole at the point through the disk, which equals the
/// integral along the rim of the monopole's vector potential, with its Dirac string (Dirac, 1931)
/// pointing away from the disk. The integrand is smooth and periodic, so the trapezoid rule
/// converges exponentially, except for points within a hundredth of the radius of the rim, where
/// the error may reach `1e-4`.
pub(super) fn of_disk(metric: &Metric, point: DVec3, axis: usize, h: f64, radius: f64) -> f64 {
    let place = |p: DVec2, h: f64| {
        let mut at = DVec3::ZERO;
        (at[(axis + 1) % 3], at[(axis + 2) % 3], at[axis]) = (p.x, p.y, h);
        at
    };
    let rise = h - point[axis];
    let linear = *metric.linear();
    let to_world: DMat3 = linear.inverse().transpose();
    let Some(normal) = (to_world * DVec3::AXES[axis]).try_normalize() else { return 0.0 };
    if rise == 0.0 || radius == 0.0 || !point.is_finite() {
        return 0.0;
    }
    let string = -normal * rise.signum();
    let sum = |first: usize, step: usize, count: usize| {
        (first..count)
            .step_by(step)
            .map(|i| {
                let direction = rotation::unit_vector(TAU * i as f64 / count as f64) * radius;
                let r = linear * (place(direction, h) - point);
                let along = linear * place(direction.perp(), 0.0);
                let length = r.length();
                let flow = string.cross(r).dot(along);
                // The denominator is zero only at the far end of the string, which the rim never
                // reaches.
                if flow == 0.0 { 0.0 } else { flow / (length * (length - string.dot(r))) }
            })
            .sum::<f64>()
    };
    let mut count = 32;
    let mut total = sum(0, 1, count);
    let mut last = total / count as f64;
    while count < 8192 {
        count *= 2;
        total += sum(1, 2, count);
        let mean = total / count as f64;
        if (mean - last).abs() < 1e-12 {
            last = mean;
            break;
        }
        last = mean;
    }
    -0.5 * last * metric.orientation()
}
