//! Eight lanes without special instructions: the reference implementation.
//!
//! Long functions are inlined only in builds without debug assertions, because kernels that inline
//! them take minutes to compile.

use super::{Lanes8, Portable};

/// Eight lanes as an array.
#[derive(Clone, Copy, Debug)]
pub struct Portable8([f32; 8]);

impl Portable8 {
    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    pub(super) fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self(self.0.map(f))
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn compare(self, other: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        (0..8).fold(0, |mask, i| mask | (u32::from(f(self.0[i], other.0[i])) << i))
    }
}

impl Lanes8 for Portable8 {
    const FUSED: bool = false;
    type Token = Portable;

    #[inline(always)]
    fn token(self) -> Portable {
        Portable
    }

    #[inline(always)]
    fn splat(_: Portable, value: f32) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    fn load(_: Portable, values: &[f32; 8]) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn load_permuted(token: Portable, values: &[f32; 8], lanes: &[u32; 8]) -> Self {
        Self::load(token, &lanes.map(|lane| values[lane as usize & 7]))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn store_where(self, mask: u32, to: &mut [f32; 8]) {
        *to = Self(*to).replace(mask, self).0;
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
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        self.mul(factor).add(summand)
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        self.mul(factor).sub(subtrahend)
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
        Self(self.0.map(f32::abs))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        self.compare(other, |a, b| a <= b)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        self.compare(other, |a, b| a < b)
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        self.compare(self, |a, _| a.is_sign_negative())
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn replace(self, mask: u32, other: Self) -> Self {
        Self(std::array::from_fn(|i| if mask >> i & 1 == 1 { other.0[i] } else { self.0[i] }))
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn where_less(self, low: Self, high: Self, other: Self) -> Self {
        Self(std::array::from_fn(|i| if low.0[i] < high.0[i] { other.0[i] } else { self.0[i] }))
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn le_in_order(self, limit: Self, order: u32) -> u32 {
        (0..8).fold(0, |mask, i| {
            let lane = ((order >> (3 * i)) & 7) as usize;
            mask | u32::from(self.0[lane] <= limit.0[lane]) << i
        })
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn compress(self, mask: u32, order: u32, payload: &[u32; 8], to: &mut [[u32; 2]; 8]) {
        let mut count = 0;
        for i in 0..8 {
            let lane = ((order >> (3 * i)) & 7) as usize;
            // The pair is always written but only counted if it is kept, which avoids a branch on
            // data.
            to[count & 7] = [payload[lane], self.0[lane].to_bits()];
            count += (mask >> i & 1) as usize;
        }
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn compress_payload(_: Portable, mask: u32, order: u32, payload: &[u32; 8], to: &mut [u32; 8]) {
        let mut count = 0;
        for i in 0..8 {
            to[count & 7] = payload[((order >> (3 * i)) & 7) as usize];
            count += (mask >> i & 1) as usize;
        }
    }

    #[inline(always)]
    fn store_after(self, payload: &[u32; 8], to: &mut [[u32; 2]; 8]) {
        for lane in 0..8 {
            to[lane] = [payload[lane], self.0[lane].to_bits()];
        }
    }

    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn compress_le(
        self,
        limit: Self,
        order: u32,
        payload: &[u32; 8],
        values_out: &mut [f32; 8],
        payload_out: &mut [u32; 8],
    ) -> usize {
        let mut count = 0;
        for i in 0..8 {
            let lane = ((order >> (3 * i)) & 7) as usize;
            // The lane is always written but only counted if it is kept, which avoids a branch on
            // data.
            values_out[count & 7] = self.0[lane];
            payload_out[count & 7] = payload[lane];
            count += usize::from(self.0[lane] <= limit.0[lane]);
        }
        count
    }
}
