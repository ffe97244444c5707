//! Eight lanes in two registers of four, which all machines of some processors have: NEON on
//! AArch64, SIMD128 in WebAssembly. (x86-64 has SSE2, whose lanes are only for tests.)

use super::{DoubleLanes, Lanes4, Lanes8, Portable, Portable8, WideLanes};
use wide::{f32x4, f64x2, i32x4};

/// Eight lanes in two registers of four.
#[derive(Clone, Copy, Debug)]
pub struct Fours8([f32x4; 2]);

/// Applies a function to both registers.
#[inline(always)]
fn both<T: Copy, R>([a, b]: [T; 2], [c, d]: [T; 2], f: impl Fn(T, T) -> R) -> [R; 2] {
    [f(a, c), f(b, d)]
}

/// All bits set in the lanes whose bit is set in `mask`.
#[inline(always)]
fn lanes_of(mask: u32) -> [f32x4; 2] {
    [[1, 2, 4, 8], [16, 32, 64, 128]].map(|bits| {
        let bits = i32x4::new(bits);
        bytemuck::cast((i32x4::splat(mask as i32) & bits).simd_eq(bits))
    })
}

impl Fours8 {
    #[inline(always)]
    fn array(self) -> [f32; 8] {
        let [[a, b, c, d], [e, f, g, h]] = self.0.map(f32x4::to_array);
        [a, b, c, d, e, f, g, h]
    }

    #[inline(always)]
    fn portable(self) -> Portable8 {
        Portable8::load(Portable, &self.array())
    }

    #[inline(always)]
    fn of_bits(bits: [f32x4; 2]) -> u32 {
        bits[0].to_bitmask() | bits[1].to_bitmask() << 4
    }

    #[inline(always)]
    fn where_set(self, set: [f32x4; 2], other: Self) -> Self {
        let [a, b] = set;
        Self([a.bitselect(other.0[0], self.0[0]), b.bitselect(other.0[1], self.0[1])])
    }
}

impl Lanes8 for Fours8 {
    // WebAssembly has no fused operations, and NEON does not need them here.
    const FUSED: bool = false;
    type Token = Portable;

    #[inline(always)]
    fn token(self) -> Portable {
        Portable
    }

    #[inline(always)]
    fn splat(_: Portable, value: f32) -> Self {
        Self([f32x4::splat(value); 2])
    }

    #[inline(always)]
    fn load(_: Portable, &[a, b, c, d, e, f, g, h]: &[f32; 8]) -> Self {
        Self([f32x4::new([a, b, c, d]), f32x4::new([e, f, g, h])])
    }

    #[inline(always)]
    fn load_permuted(token: Portable, values: &[f32; 8], lanes: &[u32; 8]) -> Self {
        Self::load(token, &lanes.map(|lane| values[lane as usize & 7]))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.array();
    }

    #[inline(always)]
    fn store_where(self, mask: u32, to: &mut [f32; 8]) {
        *to = Self::load(Portable, to).replace(mask, self).array();
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a + b))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a - b))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a * b))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        self.mul(factor).add(summand)
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        self.mul(factor).sub(subtrahend)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a.simd_lt(b).bitselect(a, b)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| b.simd_lt(a).bitselect(a, b)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32x4::abs))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        Self::of_bits(both(self.0, other.0, f32x4::simd_le))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        Self::of_bits(both(self.0, other.0, f32x4::simd_lt))
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        Self::of_bits(self.0)
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        self.where_set(lanes_of(mask), other)
    }

    #[inline(always)]
    fn where_less(self, low: Self, high: Self, other: Self) -> Self {
        self.where_set(both(low.0, high.0, f32x4::simd_lt), other)
    }

    #[inline(always)]
    fn le_in_order(self, limit: Self, order: u32) -> u32 {
        let kept = self.le(limit);
        (0..8).fold(0, |mask, i| mask | (kept >> (order >> (3 * i) & 7) & 1) << i)
    }

    #[inline(always)]
    fn compress(self, mask: u32, order: u32, payload: &[u32; 8], to: &mut [[u32; 2]; 8]) {
        self.portable().compress(mask, order, payload, to);
    }

    #[inline(always)]
    fn compress_payload(
        token: Portable,
        mask: u32,
        order: u32,
        payload: &[u32; 8],
        to: &mut [u32; 8],
    ) {
        Portable8::compress_payload(token, mask, order, payload, to);
    }

    #[inline(always)]
    fn store_after(self, payload: &[u32; 8], to: &mut [[u32; 2]; 8]) {
        self.portable().store_after(payload, to);
    }

    #[inline(always)]
    fn compress_le(
        self,
        limit: Self,
        order: u32,
        payload: &[u32; 8],
        values_out: &mut [f32; 8],
        payload_out: &mut [u32; 8],
    ) -> usize {
        self.portable().compress_le(limit.portable(), order, payload, values_out, payload_out)
    }
}

impl WideLanes for Fours8 {
    type Doubles = Fours4;

    #[inline(always)]
    fn with_tag(self, tag: u32) -> Self {
        Self(self.0.map(|x| {
            let bits: i32x4 = bytemuck::cast(x);
            bytemuck::cast(bits & i32x4::splat(!31) | i32x4::splat((tag & 31) as i32))
        }))
    }

    #[inline(always)]
    fn look_up(self, table: &[u32; 32], to: &mut [u32; 8]) {
        self.portable().look_up(table, to);
    }

    #[inline(always)]
    fn places_of(_: Portable, value: u32, values: &[u32; 8]) -> u32 {
        let value = i32x4::splat(value as i32);
        let [a, b, c, d, e, f, g, h] = values.map(|x| x as i32);
        let equals = |values| i32x4::new(values).simd_eq(value).to_bitmask();
        equals([a, b, c, d]) | equals([e, f, g, h]) << 4
    }

    #[inline(always)]
    fn load_columns(token: Portable, rows: [&[f32; 8]; 8]) -> [Self; 8] {
        let [a, b, c, d, e, f, g, h] = rows.map(|row| Self::load(token, row).0);
        let upper = [0, 1].map(|k| f32x4::transpose([a[k], b[k], c[k], d[k]]));
        let lower = [0, 1].map(|k| f32x4::transpose([e[k], f[k], g[k], h[k]]));
        std::array::from_fn(|i| Self([upper[i / 4][i % 4], lower[i / 4][i % 4]]))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a / b))
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        let [a, b] = self.0;
        let [a, b, c, d] = a.simd_lt(b).bitselect(a, b).to_array();
        let min = |a, b| if a < b { a } else { b };
        min(min(a, b), min(c, d))
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        let [a, b] = self.0;
        let [a, b, c, d] = b.simd_lt(a).bitselect(a, b).to_array();
        let max = |a, b| if a > b { a } else { b };
        max(max(a, b), max(c, d))
    }

    #[inline(always)]
    fn first_doubles(self) -> Fours4 {
        Fours4::of(self.0[0].to_array().map(f64::from))
    }

    #[inline(always)]
    fn last_doubles(self) -> Fours4 {
        Fours4::of(self.0[1].to_array().map(f64::from))
    }

    #[inline(always)]
    fn from_doubles(first: Fours4, last: Fours4) -> Self {
        Self([first, last].map(|x| f32x4::new(x.array().map(|x| x as f32))))
    }
}

/// Four lanes of double precision in two registers of two.
#[derive(Clone, Copy, Debug)]
pub struct Fours4([f64x2; 2]);

impl Fours4 {
    #[inline(always)]
    fn of([a, b, c, d]: [f64; 4]) -> Self {
        Self([f64x2::new([a, b]), f64x2::new([c, d])])
    }

    #[inline(always)]
    fn array(self) -> [f64; 4] {
        let [[a, b], [c, d]] = self.0.map(f64x2::to_array);
        [a, b, c, d]
    }

    #[inline(always)]
    fn of_bits(bits: [f64x2; 2]) -> u32 {
        bits[0].to_bitmask() | bits[1].to_bitmask() << 2
    }
}

impl DoubleLanes for Fours4 {
    const LANES: usize = 4;
    type Token = Portable;

    #[inline(always)]
    fn token(self) -> Portable {
        Portable
    }

    #[inline(always)]
    fn splat(_: Portable, value: f64) -> Self {
        Self([f64x2::splat(value); 2])
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a + b))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a - b))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a * b))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a / b))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| a.simd_lt(b).bitselect(a, b)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(both(self.0, other.0, |a, b| b.simd_lt(a).bitselect(a, b)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f64x2::abs))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        Self::of_bits(both(self.0, other.0, f64x2::simd_le))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        Self::of_bits(both(self.0, other.0, f64x2::simd_lt))
    }
}

impl Lanes4 for Fours4 {
    #[inline(always)]
    fn load(_: Portable, values: &[f64; 4]) -> Self {
        Self::of(*values)
    }

    #[inline(always)]
    fn load_columns(_: Portable, rows: [&[f64; 4]; 4]) -> [Self; 4] {
        std::array::from_fn(|column| Self::of(rows.map(|row| row[column])))
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 4]) {
        *to = self.array();
    }

    #[inline(always)]
    fn store_rounded(self, to: &mut [f32; 4]) {
        *to = self.array().map(|x| x as f32);
    }

    #[inline(always)]
    fn rounded(self) -> Self {
        Self::of(self.array().map(|x| (x as f32).into()))
    }

    #[inline(always)]
    fn fused(self, factor: Self, summand: Self) -> Self {
        let (a, b, c) = (self.array(), factor.array(), summand.array());
        Self::of(std::array::from_fn(|i| a[i].mul_add(b[i], c[i])))
    }

    #[inline(always)]
    fn negated(self) -> Self {
        Self(self.0.map(|x| x ^ f64x2::splat(-0.0)))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64x2::sqrt))
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        let (old, new) = (self.array(), other.array());
        Self::of(std::array::from_fn(|i| if mask >> i & 1 == 1 { new[i] } else { old[i] }))
    }
}
