//! Sixteen `f32` lanes, in one register where the machine has registers that wide, otherwise in two
//! registers of eight lanes.

use super::{Doubles16, DoublesOf, Lanes8, PairDoubles, Token, WideLanes};

/// Sixteen lanes. A mask has a bit for each lane, the first lane lowest. Every implementation gives
/// the same bits, with the exceptions of [`super::Lanes8`].
pub trait Lanes16: Copy {
    /// Number of registers.
    const REGISTERS: u32;

    /// The token of the instruction set, needed to create values.
    type Token: Token;

    /// The type of eight of the lanes.
    type Half: WideLanes;

    /// The type of sixteen lanes in double precision.
    type Doubles: Doubles16<Singles = Self, Token = Self::Token>;

    /// The type of some lanes of a half in double precision, as many as fit in a register.
    type HalfDoubles: DoublesOf<Self::Half, Token = Self::Token>;

    /// The token that was used to create this value.
    fn token(self) -> Self::Token;

    /// The token needed to create halves.
    fn half_token(token: Self::Token) -> <Self::Half as Lanes8>::Token;

    /// The same number in all lanes.
    fn splat(token: Self::Token, value: f32) -> Self;

    /// Sixteen numbers from memory.
    fn load(token: Self::Token, values: &[f32; 16]) -> Self;

    /// Loads eight numbers from each of two places in memory.
    fn load_halves(token: Self::Token, low: &[f32; 8], high: &[f32; 8]) -> Self;

    /// The entries of `values` at the indices `lanes` (each below 16).
    fn gather(token: Self::Token, values: &[f32; 16], lanes: &[u32; 8]) -> Self::Half;

    /// Joins the lanes of two halves, those of `low` first.
    fn from_halves(token: Self::Token, low: Self::Half, high: Self::Half) -> Self;

    /// Both halves, the first lanes first.
    fn halves(self) -> [Self::Half; 2];

    /// Writes the sixteen numbers.
    fn store(self, to: &mut [f32; 16]);

    /// Writes the lanes whose bit is set in `mask`.
    fn store_where(self, mask: u32, to: &mut [f32; 16]);

    /// `self + other`.
    fn add(self, other: Self) -> Self;

    /// `self - other`.
    fn sub(self, other: Self) -> Self;

    /// `self * other`.
    fn mul(self, other: Self) -> Self;

    /// `self / other`.
    fn div(self, other: Self) -> Self;

    /// `self * factor + summand`, fused or not: see [`FUSED`](super::Lanes8::FUSED) of
    /// [`Self::Half`].
    fn mul_add(self, factor: Self, summand: Self) -> Self;

    /// `self * factor - subtrahend`, fused or not: see [`FUSED`](super::Lanes8::FUSED) of
    /// [`Self::Half`].
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self;

    /// The minimum of both; `other` if either is NaN.
    fn min(self, other: Self) -> Self;

    /// The maximum of both; `other` if either is NaN.
    fn max(self, other: Self) -> Self;

    /// Absolute value.
    fn abs(self) -> Self;

    /// The mask of `self <= other` (false for NaN).
    fn le(self, other: Self) -> u32;

    /// The mask of `self < other` (false for NaN).
    fn lt(self, other: Self) -> u32;

    /// The mask of lanes with the sign bit set.
    fn signs(self) -> u32;

    /// `other` in the lanes whose bit is set in `mask`, `self` in the others.
    fn replace(self, mask: u32, other: Self) -> Self;

    /// `other` where `low < high` (not for NaN), `self` elsewhere. This is cheaper than
    /// [`Self::lt`] followed by [`Self::replace`], which convert the comparison to bits and back.
    fn where_less(self, low: Self, high: Self, other: Self) -> Self;

    /// The numbers with a tag in place of their lowest five bits; see [`WideLanes::with_tag`].
    fn with_tag(self, tag: u32) -> Self;

    /// Writes `value` to the entries of `to` whose bit is set in `mask`.
    fn write_where(token: Self::Token, mask: u32, value: u32, to: &mut [u32; 16]);

    /// The mask of the entries of `values` that equal `value`.
    fn places_of(token: Self::Token, value: u32, values: &[u32; 16]) -> u32;

    /// The minimum of the sixteen numbers; unspecified if any is NaN.
    fn reduce_min(self) -> f32;

    /// The maximum of the sixteen numbers; unspecified if any is NaN.
    fn reduce_max(self) -> f32;
}

/// Sixteen lanes in two registers of eight.
#[derive(Clone, Copy, Debug)]
pub struct Pair<L>([L; 2]);

impl<L: WideLanes> Lanes16 for Pair<L> {
    const REGISTERS: u32 = 2;
    type Half = L;
    type Doubles = PairDoubles<L>;
    type HalfDoubles = L::Doubles;
    type Token = L::Token;

    #[inline(always)]
    fn token(self) -> L::Token {
        self.0[0].token()
    }

    #[inline(always)]
    fn half_token(token: L::Token) -> L::Token {
        token
    }

    #[inline(always)]
    fn splat(token: L::Token, value: f32) -> Self {
        Self([L::splat(token, value); 2])
    }

    #[inline(always)]
    fn load(token: L::Token, values: &[f32; 16]) -> Self {
        let (halves, _) = values.as_chunks::<8>();
        Self::load_halves(token, &halves[0], &halves[1])
    }

    #[inline(always)]
    fn load_halves(token: L::Token, low: &[f32; 8], high: &[f32; 8]) -> Self {
        Self([L::load(token, low), L::load(token, high)])
    }

    #[inline(always)]
    fn gather(token: L::Token, values: &[f32; 16], lanes: &[u32; 8]) -> L {
        let lane = |i: usize| values[lanes[i] as usize & 15];
        L::load(token, &[lane(0), lane(1), lane(2), lane(3), lane(4), lane(5), lane(6), lane(7)])
    }

    #[inline(always)]
    fn from_halves(_: L::Token, low: L, high: L) -> Self {
        Self([low, high])
    }

    #[inline(always)]
    fn halves(self) -> [L; 2] {
        self.0
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 16]) {
        let (halves, _) = to.as_chunks_mut::<8>();
        self.0[0].store(&mut halves[0]);
        self.0[1].store(&mut halves[1]);
    }

    #[inline(always)]
    fn store_where(self, mask: u32, to: &mut [f32; 16]) {
        let (halves, _) = to.as_chunks_mut::<8>();
        self.0[0].store_where(mask & 0xff, &mut halves[0]);
        self.0[1].store_where(mask >> 8 & 0xff, &mut halves[1]);
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self([self.0[0].add(other.0[0]), self.0[1].add(other.0[1])])
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self([self.0[0].sub(other.0[0]), self.0[1].sub(other.0[1])])
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self([self.0[0].mul(other.0[0]), self.0[1].mul(other.0[1])])
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self([self.0[0].div(other.0[0]), self.0[1].div(other.0[1])])
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        let [low, high] = self.0;
        Self([low.mul_add(factor.0[0], summand.0[0]), high.mul_add(factor.0[1], summand.0[1])])
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        let [low, high] = self.0;
        Self([
            low.mul_sub(factor.0[0], subtrahend.0[0]),
            high.mul_sub(factor.0[1], subtrahend.0[1]),
        ])
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self([self.0[0].min(other.0[0]), self.0[1].min(other.0[1])])
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self([self.0[0].max(other.0[0]), self.0[1].max(other.0[1])])
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self([self.0[0].abs(), self.0[1].abs()])
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        self.0[0].le(other.0[0]) | self.0[1].le(other.0[1]) << 8
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        self.0[0].lt(other.0[0]) | self.0[1].lt(other.0[1]) << 8
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        self.0[0].signs() | self.0[1].signs() << 8
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        Self([
            self.0[0].replace(mask & 0xff, other.0[0]),
            self.0[1].replace(mask >> 8 & 0xff, other.0[1]),
        ])
    }

    #[inline(always)]
    fn where_less(self, low: Self, high: Self, other: Self) -> Self {
        let [first, second] = self.0;
        Self([
            first.where_less(low.0[0], high.0[0], other.0[0]),
            second.where_less(low.0[1], high.0[1], other.0[1]),
        ])
    }

    #[inline(always)]
    fn with_tag(self, tag: u32) -> Self {
        Self([self.0[0].with_tag(tag), self.0[1].with_tag(tag)])
    }

    #[inline(always)]
    fn write_where(token: L::Token, mask: u32, value: u32, to: &mut [u32; 16]) {
        let to: *mut [u32; 16] = to;
        // SAFETY: `f32` and `u32` have the same size and alignment, and both may hold any bits.
        let to = unsafe { &mut *to.cast::<[f32; 16]>() };
        Self::splat(token, f32::from_bits(value)).store_where(mask, to);
    }

    #[inline(always)]
    fn places_of(token: L::Token, value: u32, values: &[u32; 16]) -> u32 {
        let (halves, _) = values.as_chunks::<8>();
        L::places_of(token, value, &halves[0]) | L::places_of(token, value, &halves[1]) << 8
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        self.0[0].min(self.0[1]).reduce_min()
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        self.0[0].max(self.0[1]).reduce_max()
    }
}

#[cfg(test)]
mod tests {
    use super::super::DoubleLanes;
    use super::super::fours::Fours8;
    use super::super::{Portable, Portable8};
    use super::*;

    /// The results of all operations of [`Lanes16`] on two vectors.
    fn run<W: Lanes16>(
        token: W::Token,
        a: &[f32; 16],
        b: &[f32; 16],
        mask: u32,
    ) -> (Vec<[u32; 16]>, [u32; 3], [u32; 2]) {
        let stored = |lanes: W| {
            let mut out = [0.0; 16];
            lanes.store(&mut out);
            out.map(bits)
        };
        let (halves, _) = a.as_chunks::<8>();
        let (x, y, five) = (W::load(token, a), W::load(token, b), W::splat(token, 5.0));
        let swapped = W::load_halves(token, &halves[1], &halves[0]);
        let [low, high] = x.halves();
        let mut values = vec![x, y, swapped, five, W::from_halves(token, high, low)];
        values.extend([
            x.add(y),
            x.sub(y),
            x.mul(y),
            x.div(y),
            x.min(y),
            x.max(y),
            x.abs(),
            x.replace(mask, y),
        ]);
        values.extend([x.where_less(x, y, five), five.where_less(y, x, swapped)]);
        values.extend([x.with_tag(mask), y.with_tag(7)]);
        // The results are exact, so it does not matter whether the operations are fused.
        values.extend([five.mul_add(five, x), five.mul_sub(five, x)]);
        let mut written = [7; 16];
        W::write_where(token, mask, 9, &mut written);
        assert_eq!(written, std::array::from_fn(|lane| if mask >> lane & 1 == 1 { 9 } else { 7 }));
        assert_eq!(W::places_of(token, 9, &written), mask);
        let (table, mut found) = (std::array::from_fn(|i| 1000 + i as u32), [0; 8]);
        for tag in 0..32 {
            low.with_tag(tag).look_up(&table, &mut found);
            assert_eq!(found, [1000 + tag; 8]);
        }
        high.look_up(&table, &mut found);
        assert_eq!(found, std::array::from_fn(|i| 1000 + (a[8 + i].to_bits() & 31)));
        let lanes = std::array::from_fn(|i| mask.rotate_right(i as u32) & 15);
        let (mut picked, mut widened) = ([0.0; 8], [0.0; 8]);
        let wide = a.map(|x| f64::from(x) * 1.1);
        W::gather(token, a, &lanes).store(&mut picked);
        let mut first = 0;
        while first < 8 {
            let (low, high) =
                (W::HalfDoubles::of(token, low, first), W::HalfDoubles::of(token, high, first));
            let more = W::HalfDoubles::gather(token, &wide, &lanes, first)
                .mul(W::HalfDoubles::splat(token, 3.0));
            low.add(high)
                .sub(more)
                .min(low.div(high))
                .max(high.abs())
                .store_rounded_from(&mut widened, first);
            let bit = |compared: u32, lane: usize| compared >> lane & 1 == 1;
            for lane in 0..W::HalfDoubles::LANES {
                let (x, y) = (a[first + lane], a[8 + first + lane]);
                assert_eq!((bit(low.le(high), lane), bit(low.lt(high), lane)), (x <= y, x < y));
            }
            first += W::HalfDoubles::LANES;
        }
        assert_eq!(picked.map(bits), lanes.map(|lane| bits(a[lane as usize])));
        let less = |x: f64, y: f64| if x < y { x } else { y };
        assert_eq!(
            widened.map(bits),
            std::array::from_fn(|i| {
                let (x, y) = (f64::from(a[i]), f64::from(a[8 + i]));
                let least = less(x + y - wide[lanes[i] as usize] * 3.0, x / y);
                bits(if least > y.abs() { least } else { y.abs() } as f32)
            })
        );
        let mut replaced = *b;
        x.store_where(mask, &mut replaced);
        assert_eq!(
            replaced.map(bits),
            std::array::from_fn(|lane| bits(if mask >> lane & 1 == 1 { a[lane] } else { b[lane] }))
        );
        let extremes = if a.iter().any(|x| x.is_nan()) {
            [0; 2]
        } else {
            [bits(x.reduce_min() + 0.0), bits(x.reduce_max() + 0.0)]
        };
        (values.into_iter().map(stored).collect(), [x.le(y), x.lt(y), x.signs()], extremes)
    }

    #[test]
    fn sixteen_lanes_of_every_level_give_the_bits_of_the_portable_ones() {
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
            let a: [f32; 16] = std::array::from_fn(|k| special[(i + k) % (n - i % 3 * 4)]);
            let b: [f32; 16] = std::array::from_fn(|k| special[(i / n + 3 * k) % n]);
            let mask = (i * 1237) as u32 & 0xffff;
            let expected = run::<Pair<Portable8>>(Portable, &a, &b, mask);
            assert_eq!(run::<Pair<Fours8>>(Portable, &a, &b, mask), expected, "{a:?} {b:?}");
            #[cfg(target_arch = "x86_64")]
            {
                use super::super::{Avx2, Avx8, Avx16, Avx512};
                if let Some(token) = Avx2::new() {
                    assert_eq!(run::<Pair<Avx8>>(token, &a, &b, mask), expected, "{a:?} {b:?}");
                }
                if let Some(token) = Avx512::new() {
                    assert_eq!(run::<Avx16>(token, &a, &b, mask), expected, "{a:?} {b:?}");
                }
            }
            assert_eq!(expected.0[5], std::array::from_fn(|k| bits(a[k] + b[k])));
        }
    }

    /// All NaNs compare as equal.
    fn bits(x: f32) -> u32 {
        if x.is_nan() { u32::MAX } else { x.to_bits() }
    }
}
