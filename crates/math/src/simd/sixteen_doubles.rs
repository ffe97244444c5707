//! Sixteen `f64` lanes, the counterpart of [`Lanes16`].

use super::{DoubleLanes, Lanes4, Lanes8, Lanes16, Pair, Token, WideLanes};

/// Sixteen lanes of double precision, with masks like those of [`Lanes16`]. Every implementation
/// gives the same bits, except for [`Self::mul_add`].
pub trait Doubles16: Copy {
    /// The token of the instruction set, needed to create values.
    type Token: Token;

    /// The type of sixteen lanes in single precision.
    type Singles: Lanes16<Token = Self::Token>;

    /// The token that was used to create this value.
    fn token(self) -> Self::Token;

    /// The same number in all lanes.
    fn splat(token: Self::Token, value: f64) -> Self;

    /// Sixteen numbers from memory.
    fn load(token: Self::Token, values: &[f64; 16]) -> Self;

    /// Writes the sixteen numbers.
    fn store(self, to: &mut [f64; 16]);

    /// Converts sixteen numbers of single precision, exactly.
    fn of(singles: Self::Singles) -> Self;

    /// The lanes rounded to nearest in single precision.
    fn rounded(self) -> Self::Singles;

    /// `self + other`.
    fn add(self, other: Self) -> Self;

    /// `self - other`.
    fn sub(self, other: Self) -> Self;

    /// `self * other`.
    fn mul(self, other: Self) -> Self;

    /// `self / other`.
    fn div(self, other: Self) -> Self;

    /// `self * factor + summand`, fused if the `mul_add` of [`Self::Singles`] is, otherwise rounded
    /// twice.
    fn mul_add(self, factor: Self, summand: Self) -> Self;

    /// `self * factor + summand`, rounded once.
    fn fused(self, factor: Self, summand: Self) -> Self;

    /// Absolute value.
    fn abs(self) -> Self;

    /// Square root.
    fn sqrt(self) -> Self;

    /// The mask of `self < other` (false for NaN).
    fn lt(self, other: Self) -> u32;

    /// `other` in the lanes whose bit is set in `mask`, `self` in the others.
    fn replace(self, mask: u32, other: Self) -> Self;
}

/// Sixteen lanes in four registers of four.
#[derive(Clone, Copy, Debug)]
pub struct PairDoubles<L: WideLanes>([L::Doubles; 4]);

impl<L: WideLanes> Doubles16 for PairDoubles<L> {
    type Token = L::Token;
    type Singles = Pair<L>;

    #[inline(always)]
    fn token(self) -> L::Token {
        self.0[0].token()
    }

    #[inline(always)]
    fn splat(token: L::Token, value: f64) -> Self {
        Self([L::Doubles::splat(token, value); 4])
    }

    #[inline(always)]
    fn load(token: L::Token, values: &[f64; 16]) -> Self {
        let (fours, _) = values.as_chunks::<4>();
        Self([
            L::Doubles::load(token, &fours[0]),
            L::Doubles::load(token, &fours[1]),
            L::Doubles::load(token, &fours[2]),
            L::Doubles::load(token, &fours[3]),
        ])
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 16]) {
        let (fours, _) = to.as_chunks_mut::<4>();
        let [a, b, c, d] = self.0;
        a.store(&mut fours[0]);
        b.store(&mut fours[1]);
        c.store(&mut fours[2]);
        d.store(&mut fours[3]);
    }

    #[inline(always)]
    fn of(singles: Pair<L>) -> Self {
        let [low, high] = singles.halves();
        Self([low.first_doubles(), low.last_doubles(), high.first_doubles(), high.last_doubles()])
    }

    #[inline(always)]
    fn rounded(self) -> Pair<L> {
        let [a, b, c, d] = self.0;
        Pair::from_halves(a.token(), L::from_doubles(a, b), L::from_doubles(c, d))
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a.add(e), b.add(f), c.add(g), d.add(h)])
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a.sub(e), b.sub(f), c.sub(g), d.sub(h)])
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a.mul(e), b.mul(f), c.mul(g), d.mul(h)])
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a.div(e), b.div(f), c.div(g), d.div(h)])
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        if !<L as Lanes8>::FUSED {
            return self.mul(factor).add(summand);
        }
        self.fused(factor, summand)
    }

    #[inline(always)]
    fn fused(self, factor: Self, summand: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h], [i, j, k, l]) = (self.0, factor.0, summand.0);
        Self([a.fused(e, i), b.fused(f, j), c.fused(g, k), d.fused(h, l)])
    }

    #[inline(always)]
    fn abs(self) -> Self {
        let [a, b, c, d] = self.0;
        Self([a.abs(), b.abs(), c.abs(), d.abs()])
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let [a, b, c, d] = self.0;
        Self([a.sqrt(), b.sqrt(), c.sqrt(), d.sqrt()])
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        a.lt(e) | b.lt(f) << 4 | c.lt(g) << 8 | d.lt(h) << 12
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([
            a.replace(mask, e),
            b.replace(mask >> 4, f),
            c.replace(mask >> 8, g),
            d.replace(mask >> 12, h),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::super::fours::Fours8;
    use super::super::{Portable, Portable8};
    use super::*;

    /// The results of all operations of [`Doubles16`] on two vectors.
    fn run<D: Doubles16>(
        token: D::Token,
        a: &[f32; 16],
        b: &[f32; 16],
        mask: u32,
    ) -> (Vec<[u32; 16]>, u32) {
        let [x, y] = [a, b].map(|values| D::of(D::Singles::load(token, values)));
        let three = D::splat(token, 3.0);
        let third = x.div(three);
        // The rounding error is tested, too.
        let rest = third.sub(D::of(third.rounded()));
        let mut kept = [0.0; 16];
        third.store(&mut kept);
        let kept = D::load(token, &kept);
        // The results are exact, so it does not matter whether the operations are fused.
        let values = [
            x.add(y),
            x.sub(y),
            x.mul(y),
            x.div(y),
            third,
            rest,
            kept.sub(D::of(kept.rounded())),
            x.mul_add(three, three),
            third.fused(y, x),
            third.abs(),
            x.sqrt(),
            x.replace(mask, y),
        ];
        let stored = values.map(|value| {
            let mut out = [0.0; 16];
            value.rounded().store(&mut out);
            out.map(|x: f32| if x.is_nan() { u32::MAX } else { x.to_bits() })
        });
        (stored.to_vec(), x.lt(y))
    }

    #[test]
    fn sixteen_doubles_of_every_level_give_the_bits_of_the_portable_ones() {
        let special = [
            0.0,
            -0.0,
            1.0,
            -1.5,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            1e-45,
            3e38,
            7.0,
            -2e9,
        ];
        let n = special.len();
        // Miri takes a second for each, so it tests fewer.
        for i in (0..n * n).step_by(if cfg!(miri) { 10 } else { 1 }) {
            let a: [f32; 16] = std::array::from_fn(|k| special[(i + k) % n]);
            let b: [f32; 16] = std::array::from_fn(|k| special[(i / n + 3 * k) % n]);
            let mask = (i * 1237) as u32 & 0xffff;
            let expected = run::<PairDoubles<Portable8>>(Portable, &a, &b, mask);
            let fours = run::<PairDoubles<Fours8>>(Portable, &a, &b, mask);
            assert_eq!(fours, expected, "{a:?} {b:?}");
            assert_eq!(expected.1, (0..16).fold(0, |m, k| m | u32::from(a[k] < b[k]) << k));
            #[cfg(target_arch = "x86_64")]
            {
                use super::super::{Avx2, Avx8, Avx16Doubles, Avx512};
                if let Some(token) = Avx2::new() {
                    assert_eq!(
                        run::<PairDoubles<Avx8>>(token, &a, &b, mask),
                        expected,
                        "{a:?} {b:?}"
                    );
                }
                if let Some(token) = Avx512::new() {
                    assert_eq!(run::<Avx16Doubles>(token, &a, &b, mask), expected, "{a:?} {b:?}");
                }
            }
        }
    }
}
