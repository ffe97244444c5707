//! Elementary functions of real numbers that give the same bits on every machine. Those of the
//! standard library are the platform's, and their last bits differ from one C library to the next;
//! Clippy forbids them. These are the crate `libm`'s, which is written in Rust.
//!
//! [`angles`](crate::angles) and [`exponentials`](crate::exponentials) have others for loops that
//! are vectorised.

/// Declares the functions: what each returns, its name and arguments, and the functions of `libm`
/// for `f32` and for `f64`.
macro_rules! functions {
    ($($about:literal $name:ident($($x:ident),+) = $single:ident, $double:ident;)*) => {
        /// A number that has elementary functions: `f32` or `f64`.
        pub trait Real: Copy {
            $(#[doc = $about]
            fn $name($($x: Self),+) -> Self;)*

            /// The sine and the cosine of an angle in radians.
            fn sin_cos(x: Self) -> (Self, Self);

            /// `x` multiplied by itself `power` times, or its inverse for a negative power.
            fn powi(x: Self, power: i32) -> Self;
        }

        impl Real for f32 {
            $(#[inline(always)]
            fn $name($($x: Self),+) -> Self {
                libm::$single($($x),+)
            })*

            #[inline(always)]
            fn sin_cos(x: Self) -> (Self, Self) {
                libm::sincosf(x)
            }

            power!();
        }

        impl Real for f64 {
            $(#[inline(always)]
            fn $name($($x: Self),+) -> Self {
                libm::$double($($x),+)
            })*

            #[inline(always)]
            fn sin_cos(x: Self) -> (Self, Self) {
                libm::sincos(x)
            }

            power!();
        }

        $(#[doc = $about]
        #[inline(always)]
        pub fn $name<T: Real>($($x: T),+) -> T {
            T::$name($($x),+)
        })*
    };
}

/// Writes the function for whole powers, by squaring, of a type.
macro_rules! power {
    () => {
        #[inline(always)]
        fn powi(x: Self, power: i32) -> Self {
            let (mut rest, mut square, mut product) = (power.unsigned_abs(), x, 1.0);
            while rest > 0 {
                if rest % 2 == 1 {
                    product *= square;
                }
                square *= square;
                rest /= 2;
            }
            if power < 0 { 1.0 / product } else { product }
        }
    };
}

functions! {
    "The sine of an angle in radians."
    sin(x) = sinf, sin;
    "The cosine of an angle in radians."
    cos(x) = cosf, cos;
    "The tangent of an angle in radians."
    tan(x) = tanf, tan;
    "The angle in `[-pi/2, pi/2]` with this sine; NaN beyond `[-1, 1]`."
    asin(x) = asinf, asin;
    "The angle in `[0, pi]` with this cosine; NaN beyond `[-1, 1]`."
    acos(x) = acosf, acos;
    "The angle in `[-pi/2, pi/2]` with this tangent."
    atan(x) = atanf, atan;
    "The angle of the point `(x, y)`, in `[-pi, pi]`."
    atan2(y, x) = atan2f, atan2;
    "`e^x`."
    exp(x) = expf, exp;
    "`2^x`."
    exp2(x) = exp2f, exp2;
    "`e^x - 1`, exact near 0."
    exp_m1(x) = expm1f, expm1;
    "The natural logarithm."
    ln(x) = logf, log;
    "The natural logarithm of `1 + x`, exact near 0."
    ln_1p(x) = log1pf, log1p;
    "The logarithm to base 2."
    log2(x) = log2f, log2;
    "The logarithm to base 10."
    log10(x) = log10f, log10;
    "`x^power`."
    powf(x, power) = powf, pow;
    "The cube root."
    cbrt(x) = cbrtf, cbrt;
    "`sqrt(x^2 + y^2)`, without overflow."
    hypot(x, y) = hypotf, hypot;
}

/// The sine and the cosine of an angle in radians.
#[inline(always)]
pub fn sin_cos<T: Real>(x: T) -> (T, T) {
    T::sin_cos(x)
}

/// `x` multiplied by itself `power` times, or its inverse for a negative power.
#[inline(always)]
pub fn powi<T: Real>(x: T, power: i32) -> T {
    T::powi(x, power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Whether a result is within a few units in the last place of the standard library's, or both
    /// are not numbers.
    fn agree(ours: f64, theirs: f64, unit: f64) -> bool {
        (ours - theirs).abs() <= 2.0 * unit * theirs.abs().max(f64::from(f32::MIN_POSITIVE))
            || ours == theirs
            || ours.is_nan() && theirs.is_nan()
    }

    /// Asserts of functions that ours are those of the standard library, in both precisions.
    macro_rules! assert_agree {
        ($($name:ident($x:expr $(, $y:expr)?);)*) => {
            $({
                let (ours, theirs) = ($name($x $(, $y)?), f64::$name($x $(, $y)?));
                prop_assert!(
                    agree(ours, theirs, f64::EPSILON),
                    "{}{:?}: {ours} {theirs}", stringify!($name), ($x $(, $y)?)
                );
                let (ours, theirs) =
                    ($name($x as f32 $(, $y as f32)?), f32::$name($x as f32 $(, $y as f32)?));
                prop_assert!(
                    agree(ours.into(), theirs.into(), f32::EPSILON.into()),
                    "{}{:?}: {ours} {theirs}", stringify!($name), ($x $(, $y)?)
                );
            })*
        };
    }

    proptest! {
        #[test]
        fn elementary_functions_are_those_of_the_standard_library(
            x in prop_oneof![-1.0..1.0f64, -50.0..50.0f64, 1e-30..1e30f64],
            y in prop_oneof![-1.0..1.0f64, -5.0..5.0f64],
            power in -8..8i32,
        ) {
            let positive = x.abs();
            assert_agree! {
                sin(x);
                cos(x);
                tan(x);
                asin(x);
                acos(x);
                atan(x);
                atan2(x, y);
                exp(x);
                exp2(x);
                exp_m1(x);
                ln(positive);
                ln_1p(positive);
                log2(positive);
                log10(positive);
                powf(positive, y);
                cbrt(x);
                hypot(x, y);
            }
            prop_assert_eq!(sin_cos(x), (sin(x), cos(x)));
            prop_assert_eq!(sin_cos(x as f32), (sin(x as f32), cos(x as f32)));
            prop_assert!(agree(powi(y, power), y.powi(power), 4.0 * f64::EPSILON));
        }
    }

    #[test]
    fn elementary_functions_of_what_is_no_number_are_none() {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(sin(x).is_nan() && cos(x).is_nan() && tan(x).is_nan(), "{x}");
        }
        assert!(ln(-1f64).is_nan() && powf(-1f64, 0.5).is_nan() && acos(1.1f64).is_nan());
        assert_eq!((exp(f64::NEG_INFINITY), ln(0.0)), (0.0, f64::NEG_INFINITY));
        assert_eq!((powi(3.0, 4), powi(2.0, -3), powi(0.0, 0)), (81.0, 0.125, 1.0));
    }

    /// Bits that every machine must find. They are those of x86-64.
    #[test]
    fn elementary_functions_have_the_bits_of_every_other_machine() {
        let mut digest = 0xcbf2_9ce4_8422_2325_u64;
        let mut add = |values: &[f64]| {
            for value in values {
                digest = (digest ^ value.to_bits()).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
            }
        };
        for i in 1..2000 {
            let x = f64::from(i) * 0.013;
            let (s, c) = sin_cos(x);
            let share = s.abs();
            add(&[s, c, tan(x), asin(share), acos(share), atan(x), atan2(s, c - 0.3)]);
            add(&[exp(x), exp2(-x), exp_m1(share), ln(x), ln_1p(share), log2(x)]);
            add(&[log10(x), powf(x, s), cbrt(x), hypot(x, s), powi(s, i % 7)]);
            let (x, share) = (x as f32, share as f32);
            let (s, c) = sin_cos(x);
            let single = [s, c, tan(x), asin(share), acos(share), atan(x), atan2(s, c - 0.3)];
            add(&single.map(f64::from));
            let single = [exp(x), exp2(-x), exp_m1(share), ln(x), ln_1p(share), log2(x)];
            add(&single.map(f64::from));
            let single = [log10(x), powf(x, s), cbrt(x), hypot(x, s), powi(s, i % 7)];
            add(&single.map(f64::from));
        }
        assert_eq!(format!("{digest:016x}"), "85858733e4c15d51");
    }
}
