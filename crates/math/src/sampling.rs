//! Warps of the unit square, with their densities (Pharr, Jakob and Humphreys, Physically Based
//! Rendering, appendix A).

use crate::angles;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_4};
use std::f64::consts::TAU;

/// Uniform direction on the unit sphere; density [`UNIFORM_SPHERE_PDF`].
#[inline]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = turned(u.y);
    Vec3::new(r * cos, r * sin, z)
}

/// Sine and cosine of the angle that is `part` of a full turn.
#[inline(always)]
fn turned(part: f32) -> (f32, f32) {
    let (sin, cos) = angles::sin_cos(TAU * f64::from(part));
    (sin as f32, cos as f32)
}

/// Density of [`uniform_sphere`] per steradian.
pub const UNIFORM_SPHERE_PDF: f32 = FRAC_1_PI * 0.25;

/// Sine and cosine of an angle of at most an eighth of a turn, to about a unit in the last place
/// (the polynomials of Moshier's Cephes library, single precision). It has no branches, so that
/// loops over it are vectorised.
#[inline(always)]
fn sin_cos_of_eighth(x: f32) -> (f32, f32) {
    let z = x * x;
    let sin = x + x * z * (-1.666_665_5e-1 + z * (8.332_161e-3 + z * -1.951_529_6e-4));
    let cos = 1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5));
    (sin, cos)
}

/// Uniform point in the unit disk by concentric squares (Shirley and Chiu, 1997).
#[inline(always)]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let offset = u * 2.0 - 1.0;
    let is_wide = offset.x.abs() > offset.y.abs();
    let (r, other) = if is_wide { (offset.x, offset.y) } else { (offset.y, offset.x) };
    let ratio = if r == 0.0 { 0.0 } else { other / r };
    // `ratio` times pi / 4 is the angle from the nearer axis, x or y.
    let (sin, cos) = sin_cos_of_eighth(FRAC_PI_4 * ratio);
    if is_wide { Vec2::new(r * cos, r * sin) } else { Vec2::new(r * sin, r * cos) }
}

/// Direction on the upper hemisphere with density `cos(theta) / pi`; `z` is the normal.
#[inline(always)]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = concentric_disk(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`cosine_hemisphere`] per steradian.
#[inline]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// Uniform direction in the cone around `z` whose half-angle has the cosine `cos_theta_max`. The
/// density is `1 / (2 pi (1 - cos_theta_max))` per steradian.
#[inline]
pub fn uniform_cone(u: Vec2, cos_theta_max: f32) -> Vec3 {
    let cos = 1.0 - u.x * (1.0 - cos_theta_max);
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (s, c) = turned(u.y);
    Vec3::new(sin * c, sin * s, cos)
}

/// Uniform barycentric coordinates `(b1, b2)` of a triangle (Heitz, A low-distortion map between
/// triangle and square, 2019).
#[inline(always)]
pub fn uniform_triangle(u: Vec2) -> Vec2 {
    let is_less = u.x < u.y;
    let half = if is_less { u.x } else { u.y } / 2.0;
    let rest = if is_less { u.y } else { u.x } - half;
    let (b0, b1) = if is_less { (half, rest) } else { (rest, half) };
    Vec2::new(b1, 1.0 - b0 - b1)
}

/// The MIS weight of a sample that was taken with density `a` and that another strategy would take
/// with density `b` (power heuristic with exponent 2; Veach, 1997). It is 1 if `a` is infinite, and
/// 0 if both densities are 0.
#[inline(always)]
pub fn power_heuristic(a: f32, b: f32) -> f32 {
    let (a2, b2) = (a * a, b * b);
    let weight = if a2 + b2 > 0.0 { a2 / (a2 + b2) } else { 0.0 };
    if a == f32::INFINITY { 1.0 } else { weight }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::uniform2;

    #[test]
    fn warped_points_have_the_moments_of_their_densities() {
        let n = 200_000;
        let (mut z_sphere, mut z_cosine, mut r2_disk, mut bary) =
            (0.0f64, 0.0f64, 0.0f64, Vec2::ZERO);
        for i in 0..n {
            let u = uniform2([i, 3, 5, 7]);
            z_sphere += f64::from(uniform_sphere(u).z);
            z_cosine += f64::from(cosine_hemisphere(u).z);
            r2_disk += f64::from(concentric_disk(u).length_squared());
            bary += uniform_triangle(u) / n as f32;
        }
        let n = f64::from(n);
        assert!((z_sphere / n).abs() < 0.01);
        assert!((z_cosine / n - 2.0 / 3.0).abs() < 0.005);
        assert!((r2_disk / n - 0.5).abs() < 0.005);
        assert!((bary - 1.0 / 3.0).abs().max_element() < 0.005);
    }

    /// Chi-squared test of each warp: the distribution function is applied to the warped points,
    /// which gives points that should be uniform in the unit square.
    #[test]
    fn warped_points_are_distributed_as_stated() {
        use crate::statistics::{chi_squared_deviation, sidak_deviation};
        const CELLS: usize = 12;
        let azimuth = |x: f32, y: f32| f64::from(y).atan2(x.into()) / std::f64::consts::TAU + 0.5;
        let height = |low: f64, z: f32| (f64::from(z) - low) / (1.0 - low);
        let r2 = |x: f32, y: f32| f64::from(x * x + y * y);
        let flat = move |x: f32, y: f32| [r2(x, y), azimuth(x, y)];
        let sphere = move |u| {
            let d = uniform_sphere(u);
            [height(-1.0, d.z), azimuth(d.x, d.y)]
        };
        let disk = move |u| {
            let p = concentric_disk(u);
            flat(p.x, p.y)
        };
        let cosine = move |u| {
            let d = cosine_hemisphere(u);
            flat(d.x, d.y)
        };
        let mut warps: Vec<(String, Box<dyn Fn(Vec2) -> [f64; 2]>)> = vec![
            ("sphere".into(), Box::new(sphere)),
            ("disk".into(), Box::new(disk)),
            ("cosine".into(), Box::new(cosine)),
            (
                "triangle".into(),
                Box::new(|u| {
                    let b = uniform_triangle(u).as_dvec2();
                    let sum = b.x + b.y;
                    [sum * sum, b.x / sum]
                }),
            ),
        ];
        for cos in [0.999_99f32, 0.99, 0.7, 0.0, -0.8] {
            // The height is computed from below, because heights in narrow cones are close to the
            // rounding of 1.
            let undo = move |d: Vec3| {
                let sin2 = r2(d.x, d.y);
                let drop = if d.z > 0.0 {
                    sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
                } else {
                    1.0 - f64::from(d.z)
                };
                [drop / (1.0 - f64::from(cos)), azimuth(d.x, d.y)]
            };
            warps.push((format!("cone {cos}"), Box::new(move |u| undo(uniform_cone(u, cos)))));
        }
        let (n, tests) = (40_000u32, warps.len() as u32);
        for (key, (name, square)) in (0..).zip(warps) {
            let mut found = vec![0; CELLS * CELLS];
            for i in 0..n {
                let [x, y] = square(uniform2([i, key, 6, 2]))
                    .map(|x| ((x * CELLS as f64) as usize).min(CELLS - 1));
                found[x * CELLS + y] += 1;
            }
            let expected = vec![f64::from(n) / found.len() as f64; found.len()];
            let z = chi_squared_deviation(&found, &expected);
            assert!(z < sidak_deviation(0.01, tests), "{name}: {z} standard deviations");
        }
    }

    #[test]
    fn cone_samples_stay_in_the_cone() {
        for i in 0..1000 {
            let d = uniform_cone(uniform2([i, 0, 0, 0]), 0.9);
            assert!(d.z >= 0.9 - 1e-6 && (d.length() - 1.0).abs() < 1e-5);
        }
    }
}
