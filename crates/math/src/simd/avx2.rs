//! Eight lanes in one AVX register.

use super::Lanes8;
use std::arch::x86_64::*;

/// Eight lanes of AVX. A value exists only where `splat` or `load` was allowed to make it, so its operations are safe to call.
/// Callers carry `#[target_feature(enable = "avx2")]`; everything here is inlined into them.
#[derive(Clone, Copy, Debug)]
pub struct Avx8(__m256);

impl Lanes8 for Avx8 {
    #[inline(always)]
    unsafe fn splat(value: f32) -> Self {
        // SAFETY: the caller guarantees AVX.
        Self(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    unsafe fn load(values: &[f32; 8]) -> Self {
        // SAFETY: the caller guarantees AVX; the reference covers 32 readable bytes.
        Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        // SAFETY: a value of this type exists, so the machine has AVX; the reference covers 32 writable bytes.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        // SAFETY: a value of this type exists, so the machine has AVX.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        // SAFETY: a value of this type exists, so the machine has AVX.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Lanes8, Level, Portable8};
    use super::Avx8;

    fn run<L: Lanes8>(a: &[f32; 8], b: &[f32; 8]) -> (Vec<[u32; 8]>, [u32; 2]) {
        // SAFETY: the test has checked the level.
        let (x, y) = unsafe { (L::load(a), L::load(b)) };
        let values = [x.add(y), x.sub(y), x.mul(y), x.min(y), x.max(y), x.abs()];
        let bits = values.map(|v| {
            let mut out = [0.0; 8];
            v.store(&mut out);
            out.map(|f| if f.is_nan() { u32::MAX } else { f.to_bits() })
        });
        (bits.to_vec(), [x.le(y), x.lt(y)])
    }

    #[test]
    fn avx_lanes_give_the_bits_of_the_portable_ones() {
        if !Level::Avx2.is_supported() {
            eprintln!("skipped: no AVX2");
            return;
        }
        let special =
            [0.0, -0.0, 1.0, -1.5, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e-45, 3e38, f32::MIN_POSITIVE];
        for i in 0..special.len() * special.len() {
            let a = std::array::from_fn(|k| special[(i + k) % special.len()]);
            let b = std::array::from_fn(|k| special[(i / special.len() + 3 * k) % special.len()]);
            assert_eq!(run::<Avx8>(&a, &b), run::<Portable8>(&a, &b), "{a:?} {b:?}");
        }
    }
}
