//! Loads and stores of x86-64 registers through references.

use std::arch::x86_64::*;

/// Makes pairs of functions that load and store a register:
/// `name(intrinsics: type in memory, register type) = load, store`.
macro_rules! registers {
    ($(
        $load:ident, $store:ident ($feature:literal): $memory:ty, $register:ty =
            $load_instruction:path, $store_instruction:path;
    )*) => {$(
        #[allow(dead_code, reason = "not every kind is both read and written")]
        #[inline]
        #[target_feature(enable = $feature)]
        pub(super) fn $load(from: &$memory) -> $register {
            const { assert!(size_of::<$memory>() == size_of::<$register>()) };
            // SAFETY: the reference covers all bytes that are read, as many as the register has,
            // and the instruction requires no alignment.
            unsafe { $load_instruction(from.as_ptr().cast()) }
        }

        #[allow(dead_code, reason = "not every kind is both read and written")]
        #[inline]
        #[target_feature(enable = $feature)]
        pub(super) fn $store(register: $register, to: &mut $memory) {
            const { assert!(size_of::<$memory>() == size_of::<$register>()) };
            // SAFETY: the reference covers all bytes that are written, as many as the register has,
            // and the instruction requires no alignment. Any bits are valid numbers.
            unsafe { $store_instruction(to.as_mut_ptr().cast(), register) }
        }
    )*};
}

registers! {
    load_f32x8, store_f32x8 ("avx"): [f32; 8], __m256 = _mm256_loadu_ps, _mm256_storeu_ps;
    load_u32x8, store_u32x8 ("avx"): [u32; 8], __m256i = _mm256_loadu_si256, _mm256_storeu_si256;
    load_f32x4, store_f32x4 ("sse"): [f32; 4], __m128 = _mm_loadu_ps, _mm_storeu_ps;
    load_f64x4, store_f64x4 ("avx"): [f64; 4], __m256d = _mm256_loadu_pd, _mm256_storeu_pd;
    load_f32x16, store_f32x16 ("avx512f"): [f32; 16], __m512 = _mm512_loadu_ps, _mm512_storeu_ps;
    load_u32x16, store_u32x16 ("avx512f"): [u32; 16], __m512i =
        _mm512_loadu_si512, _mm512_storeu_si512;
    load_f64x8, store_f64x8 ("avx512f"): [f64; 8], __m512d = _mm512_loadu_pd, _mm512_storeu_pd;
}

/// Writes the numbers whose bit is set in `mask`.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn store_f32x16_where(register: __m512, mask: u16, to: &mut [f32; 16]) {
    // SAFETY: the reference covers all that may be written, and no alignment is required.
    unsafe { _mm512_mask_storeu_ps(to.as_mut_ptr(), mask, register) }
}

/// Writes the numbers whose bit is set in `mask`.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn store_u32x16_where(register: __m512i, mask: u16, to: &mut [u32; 16]) {
    // SAFETY: the reference covers all that may be written, and no alignment is required.
    unsafe { _mm512_mask_storeu_epi32(to.as_mut_ptr().cast(), mask, register) }
}

/// Writes eight pairs of numbers: four from each register.
#[inline]
#[target_feature(enable = "avx")]
pub(super) fn store_pairs(first: __m256i, last: __m256i, to: &mut [[u32; 2]; 8]) {
    let (halves, _) = to.as_flattened_mut().as_chunks_mut::<8>();
    store_u32x8(first, &mut halves[0]);
    store_u32x8(last, &mut halves[1]);
}
