//! Counter-based random numbers: pure functions of their inputs, without state or order.

use glam::Vec2;

/// Four independent 32-bit hashes of four inputs: `pcg4d` of Jarzynski and Olano, Hash Functions
/// for GPU Rendering, JCGT 2020.
#[inline]
pub fn pcg4d(v: [u32; 4]) -> [u32; 4] {
    let [mut x, mut y, mut z, mut w] =
        v.map(|c| c.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    let mix = |x: &mut u32, y: &mut u32, z: &mut u32, w: &mut u32| {
        *x = x.wrapping_add(y.wrapping_mul(*w));
        *y = y.wrapping_add(z.wrapping_mul(*x));
        *z = z.wrapping_add(x.wrapping_mul(*y));
        *w = w.wrapping_add(y.wrapping_mul(*z));
    };
    mix(&mut x, &mut y, &mut z, &mut w);
    x ^= x >> 16;
    y ^= y >> 16;
    z ^= z >> 16;
    w ^= w >> 16;
    mix(&mut x, &mut y, &mut z, &mut w);
    [x, y, z, w]
}

/// A well-mixed 32-bit hash of one integer (the `lowbias32` finaliser found by Wellons' hash
/// prospector search).
#[inline(always)]
pub fn hash32(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A hash that depends on both inputs and on their order.
#[inline(always)]
pub fn hash_combine(a: u32, b: u32) -> u32 {
    hash32(a ^ hash32(b).wrapping_mul(0x9e37_79b9).rotate_left(7))
}

/// The largest `f32` below 1.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON * 0.5;

/// A number in `[0, 1)` from the upper 24 bits.
#[inline(always)]
pub fn to_unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// Two independent uniform numbers in `[0, 1)` from four integers.
#[inline]
pub fn uniform2(key: [u32; 4]) -> Vec2 {
    let [a, b, _, _] = pcg4d(key);
    Vec2::new(to_unit(a), to_unit(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_numbers_have_the_right_mean_and_stay_below_one() {
        let n = 100_000;
        let mut sum = Vec2::ZERO;
        for i in 0..n {
            let u = uniform2([i, 7, 0, 1]);
            assert!(u.cmpge(Vec2::ZERO).all() && u.cmplt(Vec2::ONE).all());
            sum += u;
        }
        let mean = sum / n as f32;
        // The standard error of the mean is 0.0009.
        assert!((mean - 0.5).abs().max_element() < 0.005, "{mean}");
        assert!(to_unit(u32::MAX) == ONE_MINUS_EPSILON);
    }
}
