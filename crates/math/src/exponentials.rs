//! Exponentials, logarithms and the error function made of basic arithmetic alone: they give the
//! same bits on every machine, and loops over them are vectorised.

use std::f64::consts;

/// The natural logarithm of 2 as the sum of two numbers. The first has few significant bits, so
/// that its product with a small integer is exact.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];

/// `e^x` for `x` of at most 700, with a relative error below 1e-14. For `x` below -700 or NaN it
/// returns the value at -700, which is zero in single precision. (Powers of 2 are split off first;
/// the rest is a Taylor series.)
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    /// Adding this constant rounds a number to an integer and leaves that integer in the lowest
    /// bits.
    const ROUNDER: f64 = 6_755_399_441_055_744.0;
    let x = if x > -700.0 { x } else { -700.0 };
    let shifted = x * consts::LOG2_E + ROUNDER;
    let whole = shifted - ROUNDER;
    let r = (x - whole * LN_2[0]) - whole * LN_2[1];
    let high =
        ((r * (1.0 / 39_916_800.0) + 1.0 / 3_628_800.0) * r + 1.0 / 362_880.0) * r + 1.0 / 40_320.0;
    let middle =
        (((high * r + 1.0 / 5_040.0) * r + 1.0 / 720.0) * r + 1.0 / 120.0) * r + 1.0 / 24.0;
    let series = (((middle * r + 1.0 / 6.0) * r + 0.5) * r + 1.0) * r + 1.0;
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    series * power
}

/// The natural logarithm of a normal positive number, with a relative error below 1e-15, by the
/// series of the inverse hyperbolic tangent.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    /// The bits of a number near sqrt(1/2).
    const LOWEST: u64 = 0x3fe6_a09e_0000_0000;
    /// The bits of 1.
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    /// The bits of 2^52. An integer below 2^52, ORed into or added to these bits, gives the float
    /// 2^52 plus that integer.
    const MAKER: u64 = 0x4330_0000_0000_0000;
    let shifted = x.to_bits().wrapping_add(ONE - LOWEST);
    let power = f64::from_bits((shifted >> 52) | MAKER) - (4_503_599_627_370_496.0 + 1023.0);
    // `m` is the significand, scaled to lie between sqrt(1/2) and sqrt(2).
    let m = f64::from_bits((shifted & 0x000f_ffff_ffff_ffff).wrapping_add(LOWEST));
    let f = (m - 1.0) / (m + 1.0);
    let z = f * f;
    let high = ((z * (1.0 / 21.0) + 1.0 / 19.0) * z + 1.0 / 17.0) * z + 1.0 / 15.0;
    let middle = (((high * z + 1.0 / 13.0) * z + 1.0 / 11.0) * z + 1.0 / 9.0) * z + 1.0 / 7.0;
    let series = ((middle * z + 1.0 / 5.0) * z + 1.0 / 3.0) * z;
    power * LN_2[0] + (2.0 * (f + f * series) + power * LN_2[1])
}

/// `e^(x^2) erfc(x)`, the scaled complementary error function, for `x` of at least 0, including
/// infinity, with a relative error below 1e-10. (Interpolation at Chebyshev nodes in
/// `1 / (1 + 0.4 x)`, which covers the whole axis.)
#[inline(always)]
pub fn erfcx(x: f64) -> f64 {
    const POWERS: [f64; 15] = [
        0.421_612_728_12,
        0.321_860_740_052,
        0.181_565_646_983,
        0.068_500_447_563_8,
        0.011_344_613_267_3,
        -0.003_357_100_465_83,
        -0.001_927_460_222_65,
        0.000_175_100_772_99,
        0.000_280_867_605_767,
        -2.180_562_906_64e-5,
        -4.460_392_456_03e-5,
        5.606_826_073_28e-6,
        6.807_579_898_02e-6,
        -9.058_450_473_1e-7,
        -6.827_018_637_78e-7,
    ];
    let t = 1.0 / (1.0 + 0.4 * x);
    let s = 2.0 * t - 1.0;
    t * POWERS.iter().rev().fold(0.0, |sum, power| sum * s + power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scaled_error_function_is_that_of_its_continued_fraction() {
        // Values with fifteen digits for the first three arguments, where the continued fraction
        // converges slowly.
        let known = [(0.0, 1.0), (0.5, 0.615_690_344_192_926), (1.0, 0.427_583_576_155_807)];
        let fraction = |x: f64| {
            let rest = (1..500).rev().fold(x, |rest, k| x + f64::from(k) * 0.5 / rest);
            (x, consts::FRAC_2_SQRT_PI * 0.5 / rest)
        };
        for (x, value) in known.into_iter().chain((12..4000).map(|i| fraction(f64::from(i) * 0.1)))
        {
            assert!((erfcx(x) / value - 1.0).abs() < 1e-10, "{x}: {} {value}", erfcx(x));
        }
        assert_eq!(erfcx(f64::INFINITY), 0.0);
    }

    #[test]
    fn exponentials_and_logarithms_are_those_of_the_standard_library() {
        for i in -1_400_000..1_400_000 {
            let x = f64::from(i) * 0.000_5 + 1e-7;
            assert!((exp(x) / x.exp() - 1.0).abs() < 1e-14, "{x}");
        }
        for i in 1..1_000_000 {
            let x = f64::from(i) * 1e-6;
            for x in [x, 1.0 - x * 1e-3, x * 1e-9, x * 1e200] {
                assert!(
                    (ln(x) - x.ln()).abs() <= 1e-15 * x.ln().abs(),
                    "{x}: {} {}",
                    ln(x),
                    x.ln()
                );
            }
        }
        assert_eq!((exp(0.0), ln(1.0)), (1.0, 0.0));
        assert_eq!(
            [exp(f64::NEG_INFINITY) as f32, exp(-800.0) as f32, exp(f64::NAN) as f32],
            [0.0; 3]
        );
    }
}
