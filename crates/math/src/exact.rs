//! Exact arithmetic on `f64`: sums and products with their rounding errors, double-double numbers,
//! and expansions of any length.
//!
//! A predicate or a quotient is first evaluated in plain numbers or in [`DoubleDouble`], with a
//! bound of its error. [`Expansion`]s are computed only if that does not decide (Shewchuk, Adaptive
//! Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates, 1997). All results are
//! valid as long as nothing overflows and no product falls below about `1e-290`.

use crate::simd::{DoubleLanes, Lanes4};
use std::cmp::Ordering;

/// A number type for error-free sums and products: an `f64`, or several side by side ([`Lanes4`]).
pub trait Number: Copy {
    /// `self + other`.
    fn add(self, other: Self) -> Self;

    /// `self - other`.
    fn sub(self, other: Self) -> Self;

    /// `self * other`.
    fn mul(self, other: Self) -> Self;

    /// `self / other`.
    fn div(self, other: Self) -> Self;

    /// `-self`.
    fn negated(self) -> Self;

    /// `self * factor + summand`, rounded once. It is one instruction in code compiled for FMA, and
    /// a function call elsewhere; the bits are the same.
    fn fused(self, factor: Self, summand: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self / other
    }

    #[inline(always)]
    fn negated(self) -> Self {
        -self
    }

    #[inline(always)]
    fn fused(self, factor: Self, summand: Self) -> Self {
        self.mul_add(factor, summand)
    }
}

impl<D: Lanes4> Number for D {
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        DoubleLanes::add(self, other)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        DoubleLanes::sub(self, other)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        DoubleLanes::mul(self, other)
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        DoubleLanes::div(self, other)
    }

    #[inline(always)]
    fn negated(self) -> Self {
        Lanes4::negated(self)
    }

    #[inline(always)]
    fn fused(self, factor: Self, summand: Self) -> Self {
        Lanes4::fused(self, factor, summand)
    }
}

/// `a + b` and its rounding error (Knuth).
#[inline(always)]
pub fn two_sum<T: Number>(a: T, b: T) -> (T, T) {
    let sum = a.add(b);
    let b_part = sum.sub(a);
    let a_part = sum.sub(b_part);
    (sum, a.sub(a_part).add(b.sub(b_part)))
}

/// `a + b` and its rounding error, for `|a| >= |b|` or `a == 0` (Dekker).
#[inline(always)]
fn fast_two_sum<T: Number>(a: T, b: T) -> (T, T) {
    let sum = a.add(b);
    (sum, b.sub(sum.sub(a)))
}

/// `a * b` and its rounding error.
#[inline(always)]
pub fn two_product<T: Number>(a: T, b: T) -> (T, T) {
    let product = a.mul(b);
    (product, a.fused(b, product.negated()))
}

/// Compares `a * b` with `c * d` exactly, at any magnitude; `None` if one of the four is infinite
/// or NaN.
///
/// The products are computed in integers: a product of two significands fits in 106 bits.
pub fn compare_products(a: f64, b: f64, c: f64, d: f64) -> Option<Ordering> {
    let (left, right) = (Product::of(a, b)?, Product::of(c, d)?);
    Some(if left.sign != right.sign {
        left.sign.cmp(&right.sign)
    } else if left.sign >= 0 {
        left.compare_magnitude(&right)
    } else {
        right.compare_magnitude(&left)
    })
}

/// `sign * significand * 2^exponent`, with a 128-bit significand whose highest bit is set (unless
/// it is zero).
struct Product {
    sign: i32,
    significand: u128,
    exponent: i32,
}

impl Product {
    fn of(a: f64, b: f64) -> Option<Self> {
        let ((sa, ma, ea), (sb, mb, eb)) = (integer_parts(a)?, integer_parts(b)?);
        let significand = u128::from(ma) * u128::from(mb);
        if significand == 0 {
            return Some(Self { sign: 0, significand, exponent: 0 });
        }
        let shift = significand.leading_zeros();
        Some(Self {
            sign: sa * sb,
            significand: significand << shift,
            exponent: ea + eb - shift as i32,
        })
    }

    fn compare_magnitude(&self, other: &Self) -> Ordering {
        self.exponent.cmp(&other.exponent).then(self.significand.cmp(&other.significand))
    }
}

/// Sign, significand and exponent: `x = sign * significand * 2^exponent`. `None` for infinities and
/// NaN.
fn integer_parts(x: f64) -> Option<(i32, u64, i32)> {
    let bits = x.to_bits();
    let (biased, fraction) = ((bits >> 52 & 0x7ff) as i32, bits & ((1 << 52) - 1));
    let sign = if bits >> 63 == 0 { 1 } else { -1 };
    match biased {
        0x7ff => None,
        0 => Some((sign, fraction, -1074)),
        _ => Some((sign, fraction | 1 << 52, biased - 1075)),
    }
}

/// An unevaluated sum `high + low` of two numbers, with about 106 significant bits. `low` is at
/// most half a unit in the last place of `high`.
///
/// The error bounds are those of Joldes, Muller and Popescu, Tight and Rigorous Error Bounds for
/// Basic Building Blocks of Double-Word Arithmetic (ACM TOMS, 2017), with `u = 2^-53`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DoubleDouble<T = f64> {
    /// The sum, rounded.
    pub high: T,
    /// The rounding error of the sum.
    pub low: T,
}

impl<T: Number> DoubleDouble<T> {
    /// `a - b`, exactly.
    #[inline(always)]
    pub fn difference(a: T, b: T) -> Self {
        let (high, low) = two_sum(a, b.negated());
        Self { high, low }
    }

    /// The sum, with a relative error of at most `4 u^2` (algorithm 6 of Joldes et al.).
    #[inline(always)]
    pub fn plus(self, other: Self) -> Self {
        let (sum, error) = two_sum(self.high, other.high);
        let (low, low_error) = two_sum(self.low, other.low);
        let (sum, error) = fast_two_sum(sum, error.add(low));
        let (high, low) = fast_two_sum(sum, low_error.add(error));
        Self { high, low }
    }

    /// The difference, with the error of [`Self::plus`].
    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        self.plus(Self { high: other.high.negated(), low: other.low.negated() })
    }

    /// The product, with a relative error of at most `5 u^2` (algorithm 11 of Joldes et al.).
    #[inline(always)]
    pub fn times(self, other: Self) -> Self {
        let (product, error) = two_product(self.high, other.high);
        let cross = self.high.fused(other.low, self.low.mul(other.high));
        let (high, low) = fast_two_sum(product, error.add(cross));
        Self { high, low }
    }

    /// The product with a plain number, with a relative error of at most `2 u^2` (algorithm 9 of
    /// Joldes et al.).
    #[inline(always)]
    pub fn times_plain(self, other: T) -> Self {
        let (product, error) = two_product(self.high, other);
        let (high, low) = fast_two_sum(product, self.low.fused(other, error));
        Self { high, low }
    }

    /// The quotient as a plain number, with an error barely above half a unit in the last place.
    #[inline(always)]
    pub fn divided_by(self, other: Self) -> T {
        let quotient = self.high.div(other.high);
        let rest = self.minus(other.times_plain(quotient));
        quotient.add(rest.high.div(other.high))
    }
}

/// An exact, unevaluated sum of any number of parts, which do not overlap, ascend by magnitude and
/// are not zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expansion(Vec<f64>);

impl Expansion {
    /// `a - b`, exactly.
    pub fn difference(a: f64, b: f64) -> Self {
        let (sum, error) = two_sum(a, -b);
        Self([error, sum].into_iter().filter(|&x| x != 0.0).collect())
    }

    /// The exact sum of both, made by adding one part at a time.
    pub fn plus(&self, other: &Self) -> Self {
        let mut parts: Vec<f64> = self.0.iter().chain(&other.0).copied().collect();
        parts.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        // Adding the parts one by one, in any order, keeps them nonoverlapping.
        let mut sum = Self::default();
        for part in parts {
            sum = sum.grown(part);
        }
        sum
    }

    /// The exact sum of this expansion and one number (Shewchuk's grow expansion).
    fn grown(&self, part: f64) -> Self {
        let mut sum = part;
        let mut parts = Vec::with_capacity(self.0.len() + 1);
        for &x in &self.0 {
            let (next, error) = two_sum(sum, x);
            sum = next;
            if error != 0.0 {
                parts.push(error);
            }
        }
        if sum != 0.0 {
            parts.push(sum);
        }
        Self(parts)
    }

    /// The expansion with the sign of every part reversed.
    pub fn negated(&self) -> Self {
        Self(self.0.iter().map(|x| -x).collect())
    }

    /// The exact product.
    pub fn times(&self, other: &Self) -> Self {
        let mut sum = Self::default();
        for &a in &self.0 {
            for &b in &other.0 {
                let (product, error) = two_product(a, b);
                sum = sum.grown(error).grown(product);
            }
        }
        sum
    }

    /// The value rounded to about 106 bits.
    pub fn rounded(&self) -> DoubleDouble {
        let high: f64 = self.0.iter().sum();
        let rest = self.grown(-high);
        let (high, low) = two_sum(high, rest.0.iter().sum());
        DoubleDouble { high, low }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn products_are_compared_exactly_at_any_size() {
        let e = f64::EPSILON;
        let cases = [
            (1.0 + e, 1.0 - e, 1.0, 1.0, Ordering::Less),
            (-(1.0 + e), 1.0 - e, -1.0, 1.0, Ordering::Greater),
            (f64::MAX, f64::MAX, f64::MAX, f64::MAX.next_down(), Ordering::Greater),
            (5e-324, 5e-324, 5e-324, 1e-323, Ordering::Less),
            (5e-324, 4.0, 2e-323, 1.0, Ordering::Equal),
            (0.0, -3.0, -0.0, 7.0, Ordering::Equal),
            (0.0, 1.0, 5e-324, -5e-324, Ordering::Greater),
            (1e300, 1e-300, -1.0, -1.0, 1e300f64.mul_add(1e-300, -1.0).total_cmp(&0.0)),
        ];
        for (a, b, c, d, expected) in cases {
            assert_eq!(compare_products(a, b, c, d), Some(expected), "{a:e} {b:e} {c:e} {d:e}");
            assert_eq!(compare_products(d, c, b, a), Some(expected.reverse()));
        }
        assert_eq!(compare_products(1.0, f64::INFINITY, 1.0, 1.0), None);
        assert_eq!(compare_products(1.0, 1.0, f64::NAN, 1.0), None);
    }

    fn number() -> impl Strategy<Value = f64> {
        (-1.0f64..1.0, -40i32..40).prop_map(|(x, e)| x * 2f64.powi(e))
    }

    proptest! {
        /// `(a - b)(c - d)`, expanded in two different orders, cancels to zero.
        #[test]
        fn expansions_are_exact(a in number(), b in number(), c in number(), d in number()) {
            let product = Expansion::difference(a, b).times(&Expansion::difference(c, d));
            let single = |x: f64| Expansion::difference(x, 0.0);
            let terms = [(a, c, 1.0), (a, d, -1.0), (b, c, -1.0), (b, d, 1.0)];
            let sum = terms.iter().fold(Expansion::default(), |sum, &(x, y, sign)| {
                sum.plus(&single(x * sign).times(&single(y)))
            });
            prop_assert_eq!(product.plus(&sum.negated()), Expansion::default());
        }

        #[test]
        fn numbers_of_two_parts_keep_their_bounds(
            a in number(), b in number(), c in number(), d in number(),
        ) {
            let (x, y) = (DoubleDouble::difference(a, b), DoubleDouble::difference(c, d));
            let (ex, ey) = (Expansion::difference(a, b), Expansion::difference(c, d));
            let near = |got: DoubleDouble, exact: &Expansion| {
                let parts = Expansion::difference(got.high, -got.low);
                let error = parts.plus(&exact.negated()).rounded().high.abs();
                error <= exact.rounded().high.abs() * 2f64.powi(-103)
            };
            prop_assert!(near(x.plus(y), &ex.plus(&ey)));
            prop_assert!(near(x.minus(y), &ex.plus(&ey.negated())));
            prop_assert!(near(x.times(y), &ex.times(&ey)));
            prop_assert!(near(x.times_plain(c), &ex.times(&Expansion::difference(c, 0.0))));
        }

        #[test]
        fn products_of_plain_numbers_are_ordered_as_expansions_are(
            a in number(), b in number(), c in number(),
        ) {
            // This makes `a * b` and `c * d` equal or nearly so.
            let d = a * b / c;
            prop_assume!(d.is_finite());
            let single = |x: f64| Expansion::difference(x, 0.0);
            let (ab, cd) = (single(a).times(&single(b)), single(c).times(&single(d)));
            let difference = ab.plus(&cd.negated());
            let sign = difference.rounded().high;
            prop_assert_eq!(compare_products(a, b, c, d), sign.partial_cmp(&0.0));
        }
    }
}
