//! Angles in single precision by arithmetic alone: the same bits on every machine, and vector code in loops.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Tangent of an eighth of a turn's half.
const TAN_PI_8: f32 = 0.414_213_57;

/// The angle of the point `(x, y)`, in `[-pi, pi]`: `y.atan2(x)`, off by less than 3e-7. 0 at the origin; NaN if anything is NaN or both
/// are infinite. (Polynomial of the Cephes library for the arc tangent below an eighth of a half-turn.)
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let is_steep = ay > ax;
    let (small, large) = if is_steep { (ax, ay) } else { (ay, ax) };
    let is_middle = small > large * TAN_PI_8;
    let (over, under) = if is_middle { (small - large, small + large) } else { (small, large) };
    let q = over / if under > 0.0 || under.is_nan() { under } else { 1.0 };
    let z = q * q;
    let series = ((0.080_537_45 * z - 0.138_776_86) * z + 0.199_777_1) * z - 0.333_329_5;
    let angle = series * z * q + q + if is_middle { FRAC_PI_4 } else { 0.0 };
    let angle = if is_steep { FRAC_PI_2 - angle } else { angle };
    let angle = if x.is_sign_negative() { PI - angle } else { angle };
    angle.copysign(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_standard_library() {
        for i in 0..100_000 {
            let turn = f64::from(i) / 100_000.0 * std::f64::consts::TAU;
            for length in [1e-30, 1e-3, 1.0, 7.5e8] {
                let (x, y) = ((turn.cos() * length) as f32, (turn.sin() * length) as f32);
                let exact = f64::from(y).atan2(f64::from(x));
                assert!((f64::from(atan2(y, x)) - exact).abs() < 3e-7, "{x} {y}");
            }
        }
        for (y, x) in [(0.0, 1.0), (-0.0, 1.0), (0.0, -1.0), (-0.0, -1.0), (1.0, 0.0), (-1.0, -0.0), (0.0, 0.0)] {
            assert!((atan2(y, x) - f32::atan2(y, x)).abs() < 3e-7, "{y} {x}");
        }
        assert!(atan2(f32::NAN, 1.0).is_nan() && atan2(1.0, f32::NAN).is_nan());
    }
}
