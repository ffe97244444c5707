//! Eight `f64` at a time, beside [`super::Lanes8`]: what the triangle filter of double-precision worlds needs.

/// Eight `f64` that are worked on together. As with [`super::Lanes8`] every implementation gives the same bits: nothing is fused,
/// and `min` and `max` return the second operand if one is NaN.
pub trait DoubleLanes8: Copy {
    /// The same number in all lanes.
    ///
    /// # Safety
    /// The machine must have the instructions of the implementation.
    unsafe fn splat(value: f64) -> Self;

    /// Eight numbers from memory.
    ///
    /// # Safety
    /// The machine must have the instructions of the implementation.
    unsafe fn load(values: &[f64; 8]) -> Self;

    /// `self + other`.
    fn add(self, other: Self) -> Self;

    /// `self - other`.
    fn sub(self, other: Self) -> Self;

    /// `self * other`.
    fn mul(self, other: Self) -> Self;

    /// The lesser of both; `other` if either is NaN.
    fn min(self, other: Self) -> Self;

    /// The greater of both; `other` if either is NaN.
    fn max(self, other: Self) -> Self;

    /// Absolute value.
    fn abs(self) -> Self;

    /// Bit `i` is set if `self < other` in lane `i` (not for NaN).
    fn lt(self, other: Self) -> u32;
}

/// Eight lanes as an array: the readable twin.
#[derive(Clone, Copy, Debug)]
pub struct PortableDouble8([f64; 8]);

impl PortableDouble8 {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl DoubleLanes8 for PortableDouble8 {
    #[inline(always)]
    unsafe fn splat(value: f64) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    unsafe fn load(values: &[f64; 8]) -> Self {
        Self(*values)
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
    fn lt(self, other: Self) -> u32 {
        (0..8).fold(0, |mask, i| mask | (u32::from(self.0[i] < other.0[i]) << i))
    }
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use super::DoubleLanes8;
    use std::arch::x86_64::*;

    /// Eight lanes in two AVX registers. A value exists only where `splat` or `load` was allowed to make it, so its operations
    /// are safe to call.
    #[derive(Clone, Copy, Debug)]
    pub struct AvxDouble8(__m256d, __m256d);

    impl DoubleLanes8 for AvxDouble8 {
        #[inline(always)]
        unsafe fn splat(value: f64) -> Self {
            // SAFETY: the caller guarantees AVX.
            let lanes = unsafe { _mm256_set1_pd(value) };
            Self(lanes, lanes)
        }

        #[inline(always)]
        unsafe fn load(values: &[f64; 8]) -> Self {
            // SAFETY: the caller guarantees AVX; the reference covers 64 readable bytes.
            unsafe { Self(_mm256_loadu_pd(values.as_ptr()), _mm256_loadu_pd(values.as_ptr().add(4))) }
        }

        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: a value of this type exists, so the machine has AVX.
            unsafe { Self(_mm256_add_pd(self.0, other.0), _mm256_add_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: a value of this type exists, so the machine has AVX.
            unsafe { Self(_mm256_sub_pd(self.0, other.0), _mm256_sub_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: a value of this type exists, so the machine has AVX.
            unsafe { Self(_mm256_mul_pd(self.0, other.0), _mm256_mul_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: a value of this type exists, so the machine has AVX.
            unsafe { Self(_mm256_min_pd(self.0, other.0), _mm256_min_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: a value of this type exists, so the machine has AVX.
            unsafe { Self(_mm256_max_pd(self.0, other.0), _mm256_max_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: a value of this type exists, so the machine has AVX.
            unsafe {
                let sign = _mm256_set1_pd(-0.0);
                Self(_mm256_andnot_pd(sign, self.0), _mm256_andnot_pd(sign, self.1))
            }
        }

        #[inline(always)]
        fn lt(self, other: Self) -> u32 {
            // SAFETY: a value of this type exists, so the machine has AVX.
            unsafe {
                let low = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0));
                let high = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.1, other.1));
                (low | high << 4) as u32
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub use avx::AvxDouble8;

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::super::Level;
    use super::{AvxDouble8, DoubleLanes8, PortableDouble8};

    /// For each operation which lanes of its result lie between those of two bounds: enough to tell all values apart.
    fn run<L: DoubleLanes8>(a: &[f64; 8], b: &[f64; 8], probes: &[f64]) -> Vec<u32> {
        // SAFETY: the test has checked the level.
        let (x, y) = unsafe { (L::load(a), L::load(b)) };
        let results = [x.add(y), x.sub(y), x.mul(y), x.min(y), x.max(y), x.abs(), x];
        let mut masks = Vec::new();
        for result in results {
            for &probe in probes {
                // SAFETY: as above.
                let probe = unsafe { L::splat(probe) };
                masks.extend([result.lt(probe), probe.lt(result)]);
            }
            masks.extend([result.lt(y), y.lt(result)]);
        }
        masks
    }

    #[test]
    fn avx_lanes_give_the_bits_of_the_portable_ones() {
        if !Level::Avx2.is_supported() {
            eprintln!("skipped: no AVX2");
            return;
        }
        let special = [0.0, -0.0, 1.0, -1.5, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-324, 1e308, 0.1, -3e-200];
        let mut probes = special.to_vec();
        for x in special {
            for y in special {
                probes.extend([x + y, x - y, x * y]);
            }
        }
        for i in 0..special.len() * special.len() {
            let a = std::array::from_fn(|k| special[(i + k) % special.len()]);
            let b = std::array::from_fn(|k| special[(i / special.len() + 3 * k) % special.len()]);
            let (avx, portable) = (run::<AvxDouble8>(&a, &b, &probes), run::<PortableDouble8>(&a, &b, &probes));
            assert_eq!(avx, portable, "{a:?} {b:?}");
        }
    }
}
