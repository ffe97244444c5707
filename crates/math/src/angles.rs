//! Trigonometric functions made of basic arithmetic alone: they give the same bits on every
//! machine, and loops over them are vectorised.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::f64::consts;

/// Tangent of pi / 8.
const TAN_PI_8: f32 = 0.414_213_57;

/// The angle of the point `(x, y)`, in `[-pi, pi]`: `y.atan2(x)`, with an error below 3e-7. 0 at
/// the origin; NaN if either is NaN or both are infinite. (Polynomial of the Cephes library for the
/// arc tangent below pi / 8.)
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

/// The angle of the point `(x, y)`, in `[0, 2 pi]`, in double precision, with an error below 2e-15.
/// 0 at the origin; NaN if either is NaN or both are infinite. (The arc tangent below pi / 8 by
/// interpolation at Chebyshev nodes, to 1e-16.)
#[inline(always)]
pub fn turn_to(y: f64, x: f64) -> f64 {
    let (ax, ay) = (x.abs(), y.abs());
    let is_steep = ay > ax;
    let (small, large) = if is_steep { (ax, ay) } else { (ay, ax) };
    let is_middle = small > large * f64::from(TAN_PI_8);
    let (over, under) = if is_middle { (small - large, small + large) } else { (small, large) };
    let q = over / if under == 0.0 { 1.0 } else { under };
    let z = q * q;
    let high = ((0.022_734_660_289_432_31 * z - 0.044_821_745_871_279_49) * z
        + 0.057_359_799_104_905_136)
        * z
        - 0.066_495_562_194_837_89;
    let low = ((high * z + 0.076_910_497_148_761_7) * z - 0.090_908_522_557_283_34) * z
        + 0.111_111_096_272_068_57;
    let series = ((low * z - 0.142_857_142_659_529_3) * z + 0.199_999_999_998_975_6) * z
        - 0.333_333_333_333_332_4;
    let angle = series * z * q + q + if is_middle { consts::FRAC_PI_4 } else { 0.0 };
    let angle = if is_steep { consts::FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { consts::PI - angle } else { angle };
    if y < 0.0 { consts::TAU - angle } else { angle }
}

/// Sine and cosine of an angle of at most a thousand turns, in double precision, with an error
/// below 1e-15 for the first turn. (Interpolation at Chebyshev nodes, to 3e-17.)
#[inline(always)]
pub fn sin_cos(angle: f64) -> (f64, f64) {
    /// A quarter turn, pi / 2, as the sum of two numbers. The first has few significant bits, so
    /// that its product with a small integer is exact.
    const QUARTER: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];
    /// Adding and then subtracting this constant rounds a number to the nearest integer.
    const ROUNDER: f64 = 6_755_399_441_055_744.0;
    let quarters = (angle * consts::FRAC_2_PI + ROUNDER) - ROUNDER;
    let x = (angle - quarters * QUARTER[0]) - quarters * QUARTER[1];
    let z = x * x;
    let series = ((1.591_798_897_939_743_5e-10 * z - 2.505_112_989_645_018_5e-8) * z
        + 2.755_731_609_319_840_4e-6)
        * z
        - 1.984_126_983_674_053_2e-4;
    let sin = ((series * z + 8.333_333_333_330_936e-3) * z - 0.166_666_666_666_666_66) * z * x + x;
    let series = ((-1.138_254_464_534_925e-11 * z + 2.087_614_504_941_318e-9) * z
        - 2.755_731_726_587_808e-7)
        * z
        + 2.480_158_729_875_44e-5;
    let cos = ((series * z - 1.388_888_888_888_738_9e-3) * z + 4.166_666_666_666_666_4e-2) * z * z
        - 0.5 * z
        + 1.0;
    // The quadrant is found by halving the number of quarter turns twice, in floating point: the
    // conversion to integers may be missing in wide registers.
    let half = quarters - 4.0 * ((quarters * 0.25 + ROUNDER) - ROUNDER);
    let is_odd = half.abs() == 1.0;
    let (s, c) = if is_odd { (cos, sin) } else { (sin, cos) };
    // `half` is the quadrant: -2, -1, 0, 1 or 2 quarter turns.
    let s = if half < 0.0 || half == 2.0 { -s } else { s };
    let c = if half == 1.0 || half.abs() == 2.0 { -c } else { c };
    (s, c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_in_double_precision_are_those_of_the_standard_library() {
        for i in 0..100_000 {
            let angle = f64::from(i) / 100_000.0 * consts::TAU;
            let (sin, cos) = sin_cos(angle);
            assert!(
                (sin - angle.sin()).abs() < 1e-15 && (cos - angle.cos()).abs() < 1e-15,
                "{angle}"
            );
            for length in [1e-200, 1e-3, 1.0, 7.5e200] {
                let (x, y) = (angle.cos() * length, angle.sin() * length);
                let exact = y.atan2(x).rem_euclid(consts::TAU);
                assert!((turn_to(y, x) - exact).abs() < 2e-15, "{x} {y}");
            }
        }
        for k in -20..20 {
            let angle = f64::from(k) * 0.7;
            let (sin, cos) = sin_cos(angle);
            assert!(
                (sin - angle.sin()).abs() < 4e-15 && (cos - angle.cos()).abs() < 4e-15,
                "{angle}"
            );
        }
        assert_eq!(turn_to(0.0, 0.0), 0.0);
        assert!(turn_to(f64::NAN, 1.0).is_nan() && turn_to(1.0, f64::NAN).is_nan());
    }

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
        for (y, x) in [
            (0.0, 1.0),
            (-0.0, 1.0),
            (0.0, -1.0),
            (-0.0, -1.0),
            (1.0, 0.0),
            (-1.0, -0.0),
            (0.0, 0.0),
        ] {
            assert!((atan2(y, x) - f32::atan2(y, x)).abs() < 3e-7, "{y} {x}");
        }
        assert!(atan2(f32::NAN, 1.0).is_nan() && atan2(1.0, f32::NAN).is_nan());
    }
}
