//! Jittered sampling on a grid of strata.

use snell_math::{Vec2, rng};

/// Sample `index` of `spp`. The strata are visited in an order that `key` chooses.
pub fn point(key: u32, index: u32, spp: u32) -> Vec2 {
    let columns = (1..=spp.isqrt()).rev().find(|c| spp.is_multiple_of(*c)).unwrap_or(1);
    let rows = spp / columns;
    let round = index / spp;
    let cell = permute(index % spp, spp, rng::hash_combine(key, round));
    let jitter = rng::uniform2([key, index, 0x6a09_e667, spp]);
    let corner = Vec2::new((cell % columns) as f32, (cell / columns) as f32);
    ((corner + jitter) / Vec2::new(columns as f32, rows as f32))
        .min(Vec2::splat(rng::ONE_MINUS_EPSILON))
}

/// Position of `index` in a pseudo-random permutation of `0..length` that `p` chooses (Kensler,
/// Correlated Multi-Jittered Sampling, 2013).
fn permute(mut index: u32, length: u32, p: u32) -> u32 {
    let w = length.next_power_of_two() - 1;
    loop {
        index ^= p;
        index = index.wrapping_mul(0xe170_893d);
        index ^= p >> 16;
        index ^= (index & w) >> 4;
        index ^= p >> 8;
        index = index.wrapping_mul(0x0929_eb3f);
        index ^= p >> 23;
        index ^= (index & w) >> 1;
        index = index.wrapping_mul(1 | p >> 27);
        index = index.wrapping_mul(0x6935_fa69);
        index ^= (index & w) >> 11;
        index = index.wrapping_mul(0x74dc_b303);
        index ^= (index & w) >> 2;
        index = index.wrapping_mul(0x9e50_1cc3);
        index ^= (index & w) >> 2;
        index = index.wrapping_mul(0xc860_a3df);
        index &= w;
        index ^= index >> 5;
        if index < length {
            return (index + p % length) % length;
        }
    }
}
