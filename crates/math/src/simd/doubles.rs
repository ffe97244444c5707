//! Four `f64` lanes, and conversions from eight `f32` lanes, for exact decisions about several rays
//! at once.

use super::{Lanes8, Portable, Portable8, Token};

/// Lanes of double precision, as many as a register holds. Every implementation gives the same
/// bits: nothing is fused, and `min` and `max` return the second operand if one is NaN.
pub trait DoubleLanes: Copy {
    /// Number of lanes.
    const LANES: usize;

    /// The token of the instruction set, needed to create values.
    type Token: Token;

    /// The token that was used to create this value.
    fn token(self) -> Self::Token;

    /// The same number in all lanes.
    fn splat(token: Self::Token, value: f64) -> Self;

    /// `self + other`.
    fn add(self, other: Self) -> Self;

    /// `self - other`.
    fn sub(self, other: Self) -> Self;

    /// `self * other`.
    fn mul(self, other: Self) -> Self;

    /// `self / other`.
    fn div(self, other: Self) -> Self;

    /// The minimum of both; `other` if either is NaN.
    fn min(self, other: Self) -> Self;

    /// The maximum of both; `other` if either is NaN.
    fn max(self, other: Self) -> Self;

    /// Absolute value.
    fn abs(self) -> Self;

    /// Bit `i` is set if `self <= other` in lane `i` (not for NaN).
    fn le(self, other: Self) -> u32;

    /// Bit `i` is set if `self < other` in lane `i` (not for NaN).
    fn lt(self, other: Self) -> u32;
}

/// Conversion of a part of eight numbers to double precision: the [`DoubleLanes::LANES`] numbers
/// from index `first` on, which is a multiple of `LANES` below 8.
pub trait DoublesOf<S>: DoubleLanes {
    /// The `LANES` numbers of `singles` from index `first` on, converted exactly.
    fn of(token: Self::Token, singles: S, first: usize) -> Self;

    /// The entries of `values` at the indices `lanes[first..]` (each below 16), `LANES` of them.
    fn gather(token: Self::Token, values: &[f64; 16], lanes: &[u32; 8], first: usize) -> Self;

    /// Writes the lanes to `to[first..]`, rounded to nearest.
    fn store_rounded_from(self, to: &mut [f32; 8], first: usize);
}

/// Four lanes that support fused operations ([`Lanes4::fused`]) and permutations.
pub trait Lanes4: DoubleLanes {
    /// Loads four numbers from memory.
    fn load(token: Self::Token, values: &[f64; 4]) -> Self;

    /// The columns of the matrix whose rows are given.
    fn load_columns(token: Self::Token, rows: [&[f64; 4]; 4]) -> [Self; 4];

    /// Writes the four numbers.
    fn store(self, to: &mut [f64; 4]);

    /// Writes the four numbers, rounded to nearest.
    fn store_rounded(self, to: &mut [f32; 4]);

    /// The lanes rounded to `f32` and converted back.
    fn rounded(self) -> Self;

    /// `self * factor + summand`, rounded once.
    fn fused(self, factor: Self, summand: Self) -> Self;

    /// `-self`.
    fn negated(self) -> Self;

    /// Square root.
    fn sqrt(self) -> Self;

    /// `other` in the lanes whose bit is set in `mask`, `self` in the others.
    fn replace(self, mask: u32, other: Self) -> Self;
}

/// Conversion of four of the eight lanes of [`WideLanes`].
impl<S: WideLanes<Doubles = D>, D: Lanes4> DoublesOf<S> for D {
    #[inline(always)]
    fn of(_: Self::Token, singles: S, first: usize) -> Self {
        if first == 0 { singles.first_doubles() } else { singles.last_doubles() }
    }

    #[inline(always)]
    fn gather(token: Self::Token, values: &[f64; 16], lanes: &[u32; 8], first: usize) -> Self {
        let lane = |i: usize| values[lanes[first + i] as usize & 15];
        Self::load(token, &[lane(0), lane(1), lane(2), lane(3)])
    }

    #[inline(always)]
    fn store_rounded_from(self, to: &mut [f32; 8], first: usize) {
        let (halves, _) = to.as_chunks_mut::<4>();
        self.store_rounded(&mut halves[first / 4]);
    }
}

/// Eight lanes that support permutations and conversion to double precision.
pub trait WideLanes: Lanes8 {
    /// The type of four lanes in double precision.
    type Doubles: Lanes4<Token = Self::Token> + DoublesOf<Self>;

    /// The numbers with a tag in place of their lowest five bits. (Infinity becomes NaN, and zero
    /// becomes a subnormal number.)
    fn with_tag(self, tag: u32) -> Self;

    /// Writes to `to` the entries of a table at the tags of the lanes.
    fn look_up(self, table: &[u32; 32], to: &mut [u32; 8]);

    /// Bit `i` is set if `values[i] == value`.
    fn places_of(token: Self::Token, value: u32, values: &[u32; 8]) -> u32;

    /// The columns of the matrix whose rows are given.
    fn load_columns(token: Self::Token, rows: [&[f32; 8]; 8]) -> [Self; 8];

    /// `self / other`.
    fn div(self, other: Self) -> Self;

    /// The minimum of the eight numbers; unspecified if any is NaN.
    fn reduce_min(self) -> f32;

    /// The maximum of the eight numbers; unspecified if any is NaN.
    fn reduce_max(self) -> f32;

    /// The first four lanes, converted exactly.
    fn first_doubles(self) -> Self::Doubles;

    /// The last four lanes, converted exactly.
    fn last_doubles(self) -> Self::Doubles;

    /// The four lanes of `first`, then the four lanes of `last`, rounded to nearest.
    fn from_doubles(first: Self::Doubles, last: Self::Doubles) -> Self;
}

/// Four lanes as an array: the portable implementation.
#[derive(Clone, Copy, Debug)]
pub struct Portable4([f64; 4]);

impl Portable4 {
    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn compare(self, other: Self, f: impl Fn(f64, f64) -> bool) -> u32 {
        (0..4).fold(0, |mask, i| mask | (u32::from(f(self.0[i], other.0[i])) << i))
    }
}

impl DoubleLanes for Portable4 {
    const LANES: usize = 4;
    type Token = Portable;

    #[inline(always)]
    fn token(self) -> Portable {
        Portable
    }

    #[inline(always)]
    fn splat(_: Portable, value: f64) -> Self {
        Self([value; 4])
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        self.compare(other, |a, b| a <= b)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        self.compare(other, |a, b| a < b)
    }
}

impl Lanes4 for Portable4 {
    #[inline(always)]
    fn load(_: Portable, values: &[f64; 4]) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn load_columns(_: Portable, rows: [&[f64; 4]; 4]) -> [Self; 4] {
        std::array::from_fn(|column| Self(rows.map(|row| row[column])))
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 4]) {
        *to = self.0;
    }

    #[inline(always)]
    fn store_rounded(self, to: &mut [f32; 4]) {
        *to = self.0.map(|x| x as f32);
    }

    #[inline(always)]
    fn rounded(self) -> Self {
        Self(self.0.map(|x| (x as f32).into()))
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn fused(self, factor: Self, summand: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].mul_add(factor.0[i], summand.0[i])))
    }

    #[inline(always)]
    fn negated(self) -> Self {
        Self(self.0.map(|x| -x))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn replace(self, mask: u32, other: Self) -> Self {
        Self(std::array::from_fn(|i| if mask >> i & 1 == 1 { other.0[i] } else { self.0[i] }))
    }
}

impl WideLanes for Portable8 {
    type Doubles = Portable4;

    #[inline(always)]
    fn with_tag(self, tag: u32) -> Self {
        self.map(|x| f32::from_bits(x.to_bits() & !31 | tag & 31))
    }

    #[inline(always)]
    fn look_up(self, table: &[u32; 32], to: &mut [u32; 8]) {
        let mut numbers = [0.0f32; 8];
        self.store(&mut numbers);
        *to = numbers.map(|x| table[x.to_bits() as usize & 31]);
    }

    #[inline(always)]
    fn places_of(_: Portable, value: u32, values: &[u32; 8]) -> u32 {
        (0..8).fold(0, |places, lane| places | u32::from(values[lane] == value) << lane)
    }

    #[inline(always)]
    fn load_columns(token: Portable, rows: [&[f32; 8]; 8]) -> [Self; 8] {
        std::array::from_fn(|column| Self::load(token, &rows.map(|row| row[column])))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let (mut a, mut b) = ([0.0; 8], [0.0; 8]);
        self.store(&mut a);
        other.store(&mut b);
        Self::load(Portable, &std::array::from_fn(|i| a[i] / b[i]))
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        let mut values = [0.0; 8];
        self.store(&mut values);
        values.into_iter().fold(values[0], |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        let mut values = [0.0; 8];
        self.store(&mut values);
        values.into_iter().fold(values[0], |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn first_doubles(self) -> Portable4 {
        let mut values = [0.0; 8];
        self.store(&mut values);
        Portable4(std::array::from_fn(|i| values[i].into()))
    }

    #[inline(always)]
    fn last_doubles(self) -> Portable4 {
        let mut values = [0.0; 8];
        self.store(&mut values);
        Portable4(std::array::from_fn(|i| values[i + 4].into()))
    }

    #[inline(always)]
    fn from_doubles(first: Portable4, last: Portable4) -> Self {
        Self::load(
            Portable,
            &std::array::from_fn(|i| if i < 4 { first.0[i] } else { last.0[i - 4] } as f32),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::fours::Fours8;
    use super::*;

    #[test]
    fn doubles_of_all_lanes_give_the_bits_of_the_portable_ones() {
        let special = [
            0.0,
            -0.0,
            1.0,
            -1.5,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            5e-324,
            3e38,
            1e-45,
            1.0 + f64::EPSILON,
        ];
        let n = special.len();
        for i in 0..n * n {
            let a: [[f64; 4]; 4] =
                std::array::from_fn(|r| std::array::from_fn(|k| special[(i + r + k) % n]));
            let b: [[f64; 4]; 4] =
                std::array::from_fn(|r| std::array::from_fn(|k| special[(i / n + 3 * r + k) % n]));
            let expected = run::<Portable8>(Portable, &a, &b);
            assert_eq!(run::<Fours8>(Portable, &a, &b), expected, "{a:?} {b:?}");
            #[cfg(target_arch = "x86_64")]
            if let Some(token) = super::super::Avx2::new() {
                let found = run::<super::super::Avx8>(token, &a, &b);
                assert_eq!(found, expected, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn columns_quotients_and_extremes_of_all_lanes_are_the_portable_ones() {
        let rows: [[f32; 8]; 8] = std::array::from_fn(|r| {
            std::array::from_fn(|k| ((r * 8 + k) * 37 % 64) as f32 - 20.5 + r as f32)
        });
        let expected = columns::<Portable8>(Portable, &rows);
        assert_eq!(expected[3], rows.map(|row| row[3]));
        assert_eq!(columns::<Fours8>(Portable, &rows), expected);
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = super::super::Avx2::new() {
            assert_eq!(columns::<super::super::Avx8>(token, &rows), expected);
        }
    }

    fn columns<L: WideLanes>(token: L::Token, rows: &[[f32; 8]; 8]) -> Vec<[f32; 8]> {
        let columns = L::load_columns(token, rows.each_ref());
        let stored = |lanes: L| {
            let mut out = [0.0; 8];
            lanes.store(&mut out);
            out
        };
        let mut all = columns.map(stored).to_vec();
        all.push(stored(columns[1].div(columns[2])));
        all.push(columns.map(L::reduce_min));
        all.push(columns.map(L::reduce_max));
        all
    }

    fn run<L: WideLanes>(
        token: L::Token,
        a: &[[f64; 4]; 4],
        b: &[[f64; 4]; 4],
    ) -> (Vec<([u32; 4], [u64; 4])>, [u32; 2]) {
        let [x, ..] = L::Doubles::load_columns(token, a.each_ref());
        let [.., y] = L::Doubles::load_columns(token, b.each_ref());
        let one = L::Doubles::splat(token, 1.0);
        let singles: [f32; 8] = std::array::from_fn(|i| a[i / 4][i % 4] as f32);
        let permuted = L::load_permuted(token, &singles, &[5, 0, 7, 2, 6, 1, 4, 4]);
        let values = [
            x,
            x.add(y),
            x.sub(y),
            x.mul(y),
            x.div(y),
            x.fused(y, one),
            x.negated(),
            x.min(y),
            x.max(y),
            x.abs(),
            x.sqrt(),
            x.rounded(),
            one,
            permuted.first_doubles(),
            permuted.last_doubles(),
            x.replace(5, y),
            L::from_doubles(x, y).last_doubles(),
        ];
        let bits = values.map(|v| {
            let (mut rounded, mut out) = ([0.0; 4], [0.0; 4]);
            v.store_rounded(&mut rounded);
            v.store(&mut out);
            let rounded = rounded.map(|f| if f.is_nan() { u32::MAX } else { f.to_bits() });
            (rounded, out.map(|f| if f.is_nan() { u64::MAX } else { f.to_bits() }))
        });
        (bits.to_vec(), [x.le(y), x.lt(y)])
    }
}
