//! Eight lanes in one AVX register.

use super::memory::{load_f32x8, load_u32x8, store_f32x8, store_pairs, store_u32x8};
use super::{Avx2, Lanes8};
use std::arch::x86_64::*;

/// `avx2!(token, expression)`: evaluates AVX2 and FMA intrinsics, where a token proves that the
/// machine has these instructions. The expression must not use other instruction sets or intrinsics
/// that take pointers.
macro_rules! avx2 {
    ($token:expr, $instructions:expr) => {{
        let _: $crate::simd::Avx2 = $token;
        // SAFETY: the token proves that the machine has AVX2 and FMA, which is all that these
        // intrinsics require.
        unsafe { $instructions }
    }};
}
pub(super) use avx2;

/// Eight lanes in an AVX register.
#[derive(Clone, Copy, Debug)]
pub struct Avx8(pub(super) __m256);

impl Lanes8 for Avx8 {
    const FUSED: bool = true;
    type Token = Avx2;

    #[inline(always)]
    fn token(self) -> Avx2 {
        // SAFETY: only the functions of this module make values of this type, all of them from a
        // token.
        unsafe { Avx2::assume() }
    }

    #[inline(always)]
    fn splat(token: Avx2, value: f32) -> Self {
        Self(avx2!(token, _mm256_set1_ps(value)))
    }

    #[inline(always)]
    fn load(token: Avx2, values: &[f32; 8]) -> Self {
        Self(avx2!(token, load_f32x8(values)))
    }

    #[inline(always)]
    fn load_permuted(token: Avx2, values: &[f32; 8], lanes: &[u32; 8]) -> Self {
        avx2!(token, {
            let lanes = load_u32x8(lanes);
            Self(_mm256_permutevar8x32_ps(load_f32x8(values), lanes))
        })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        avx2!(self.token(), store_f32x8(self.0, to))
    }

    #[inline(always)]
    fn store_where(self, mask: u32, to: &mut [f32; 8]) {
        let old = Self::load(self.token(), to);
        avx2!(self.token(), store_f32x8(unknown(old.replace(mask, self).0), to))
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_add_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_sub_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_mul_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(avx2!(self.token(), _mm256_fmadd_ps(self.0, factor.0, summand.0)))
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        Self(avx2!(self.token(), _mm256_fmsub_ps(self.0, factor.0, subtrahend.0)))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_min_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(avx2!(self.token(), _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        avx2!(self.token(), _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        avx2!(self.token(), _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) as u32)
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        avx2!(self.token(), _mm256_movemask_ps(self.0) as u32)
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        avx2!(self.token(), {
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let chosen =
                _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits);
            Self(_mm256_blendv_ps(self.0, other.0, _mm256_castsi256_ps(chosen)))
        })
    }

    #[inline(always)]
    fn where_less(self, low: Self, high: Self, other: Self) -> Self {
        Self(avx2!(
            self.token(),
            _mm256_blendv_ps(self.0, other.0, _mm256_cmp_ps::<_CMP_LT_OQ>(low.0, high.0))
        ))
    }

    #[inline(always)]
    fn le_in_order(self, limit: Self, order: u32) -> u32 {
        avx2!(self.token(), {
            let kept = _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, limit.0);
            _mm256_movemask_ps(_mm256_permutevar8x32_ps(kept, lanes_of(order))) as u32
        })
    }

    #[inline(always)]
    fn compress(self, mask: u32, order: u32, payload: &[u32; 8], to: &mut [[u32; 2]; 8]) {
        avx2!(self.token(), {
            let order = front(mask, order);
            let payload = _mm256_permutevar8x32_epi32(load_u32x8(payload), order);
            let numbers = _mm256_castps_si256(_mm256_permutevar8x32_ps(self.0, order));
            // In the order that `front` gives, these are the first four pairs and the last four.
            let first = _mm256_unpacklo_epi32(payload, numbers);
            let last = _mm256_unpackhi_epi32(payload, numbers);
            store_pairs(first, last, to);
        })
    }

    #[inline(always)]
    fn compress_payload(token: Avx2, mask: u32, order: u32, payload: &[u32; 8], to: &mut [u32; 8]) {
        avx2!(token, {
            let payload = load_u32x8(payload);
            let kept = _mm256_permutevar8x32_epi32(payload, front(mask, order));
            store_u32x8(_mm256_permute4x64_epi64::<0b11_01_10_00>(kept), to);
        })
    }

    #[inline(always)]
    fn store_after(self, payload: &[u32; 8], to: &mut [[u32; 2]; 8]) {
        avx2!(self.token(), {
            let quarters = |x: __m256i| _mm256_permute4x64_epi64::<0b11_01_10_00>(x);
            let payload = quarters(load_u32x8(payload));
            let numbers = quarters(_mm256_castps_si256(self.0));
            let first = _mm256_unpacklo_epi32(payload, numbers);
            let last = _mm256_unpackhi_epi32(payload, numbers);
            store_pairs(first, last, to);
        })
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
        avx2!(self.token(), {
            let order = lanes_of(order);
            let kept =
                _mm256_permutevar8x32_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, limit.0), order);
            let mask = _mm256_movemask_ps(kept) as usize;
            let front = _mm_cvtsi64_si128(i64::from_le_bytes(FRONT[mask & 0xff]));
            let order = _mm256_permutevar8x32_epi32(order, _mm256_cvtepu8_epi32(front));
            let payload = load_u32x8(payload);
            store_f32x8(_mm256_permutevar8x32_ps(self.0, order), values_out);
            store_u32x8(_mm256_permutevar8x32_epi32(payload, order), payload_out);
            mask.count_ones() as usize
        })
    }
}

/// The same numbers, hidden from the optimiser. Otherwise it would turn load, blend and store into
/// a masked store, which takes twenty cycles on Zen 2 to Zen 4.
#[inline]
#[target_feature(enable = "avx")]
fn unknown(mut numbers: __m256) -> __m256 {
    // SAFETY: the assembly is a comment, without instructions, and leaves the register as it is.
    unsafe {
        std::arch::asm!(
            "/* {0} */",
            inout(ymm_reg) numbers,
            options(pure, nomem, nostack, preserves_flags)
        )
    };
    numbers
}

/// Unpacks eight lane numbers of 3 bits into the indices of a permutation, which reads only the
/// lowest three bits of each lane.
#[inline]
#[target_feature(enable = "avx2")]
fn lanes_of(order: u32) -> __m256i {
    _mm256_srlv_epi32(
        _mm256_set1_epi32(order as i32),
        _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21),
    )
}

/// For each mask of eight lanes, the numbers of the lanes whose bit is set, in ascending order.
static FRONT: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask][count] = lane as u8;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// The numbers of the lanes that are kept, in [`PAIRED`] order. Only the lowest three bits of each
/// are valid, which is all that a permutation reads.
#[inline]
#[target_feature(enable = "avx2")]
fn front(mask: u32, order: u32) -> __m256i {
    let shifts = load_u32x8(&FRONT_SHIFTS.0[mask as usize & 0xff]);
    _mm256_srlv_epi32(_mm256_set1_epi32(order as i32), shifts)
}

/// The source of each lane for a permutation that puts the first four lanes into the lower halves
/// of the two 128-bit parts of a register, and the last four into the upper halves.
const PAIRED: [usize; 8] = [0, 1, 4, 5, 2, 3, 6, 7];

/// The entries of [`FRONT`], in [`PAIRED`] order, times three: how far to shift a packed order of
/// lanes to the right so that the lane's 3 bits are lowest.
static FRONT_SHIFTS: Aligned<[[u32; 8]; 256]> = {
    let mut table = [[0; 8]; 256];
    let mut i = 0;
    while i < 256 * 8 {
        table[i / 8][i % 8] = 3 * FRONT[i / 8][PAIRED[i % 8]] as u32;
        i += 1;
    }
    Aligned(table)
};

/// Data aligned to the size of a register.
#[repr(align(32))]
struct Aligned<T>(T);

#[cfg(test)]
mod tests {
    use super::super::fours::Fours8;
    use super::super::{Avx2, Lanes8, Portable, Portable8};
    use super::Avx8;

    fn run<L: Lanes8>(
        token: L::Token,
        a: &[f32; 8],
        b: &[f32; 8],
    ) -> (Vec<[u32; 8]>, [u32; 4], Vec<(u32, u32)>) {
        let (x, y) = (L::load(token, a), L::load(token, b));
        let values = [x.add(y), x.sub(y), x.mul(y), x.min(y), x.max(y), x.abs()];
        let bits = values.map(|v| {
            let mut out = [0.0; 8];
            v.store(&mut out);
            out.map(|f| if f.is_nan() { u32::MAX } else { f.to_bits() })
        });
        let order = [5u32, 0, 7, 2, 6, 1, 4, 3].iter().rev().fold(0, |o, lane| (o << 3) | lane);
        let (mut values, mut payload) = ([0.0; 8], [0; 8]);
        let items = [10, 11, 12, 13, 14, 15, 16, 17];
        let kept = x.compress_le(y, order, &items, &mut values, &mut payload);
        let compressed: Vec<_> =
            values.iter().zip(payload).take(kept).map(|(v, p)| (v.to_bits(), p)).collect();
        let mask = x.le_in_order(y, order);
        let (mut pairs, mut alone) = ([[0; 2]; 8], [0; 8]);
        x.compress(mask, order, &items, &mut pairs);
        let in_two_steps: Vec<_> =
            pairs.iter().take(kept).map(|&[payload, value]| (value, payload)).collect();
        assert_eq!(in_two_steps, compressed);
        L::compress_payload(token, mask, order, &items, &mut alone);
        assert_eq!(alone[..kept], payload[..kept]);
        x.store_after(&items, &mut pairs);
        assert_eq!(pairs, std::array::from_fn(|lane| [items[lane], a[lane].to_bits()]));
        (bits.to_vec(), [x.le(y), x.lt(y), x.signs(), mask], compressed)
    }

    #[test]
    fn fused_operations_round_once() {
        let Some(token) = Avx2::new() else {
            eprintln!("skipped: no AVX2");
            return;
        };
        let a = [1.0 + f32::EPSILON; 8];
        let x = Avx8::load(token, &a);
        let (mut sum, mut difference) = ([0.0; 8], [0.0; 8]);
        x.mul_add(x, x).store(&mut sum);
        x.mul_sub(x, x.mul(x)).store(&mut difference);
        assert_eq!(sum, a.map(|a| a.mul_add(a, a)));
        assert_eq!(difference, [f32::EPSILON * f32::EPSILON; 8]);
    }

    #[test]
    fn eight_lanes_give_the_bits_of_the_portable_ones() {
        let Some(token) = Avx2::new() else {
            eprintln!("skipped: no AVX2");
            return;
        };
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
            f32::MIN_POSITIVE,
        ];
        for i in 0..special.len() * special.len() {
            let a = std::array::from_fn(|k| special[(i + k) % special.len()]);
            let b = std::array::from_fn(|k| special[(i / special.len() + 3 * k) % special.len()]);
            let expected = run::<Portable8>(Portable, &a, &b);
            assert_eq!(run::<Avx8>(token, &a, &b), expected, "{a:?} {b:?}");
            assert_eq!(run::<Fours8>(Portable, &a, &b), expected, "{a:?} {b:?}");
        }
    }
}
