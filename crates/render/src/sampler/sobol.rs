//! The first two dimensions of the Sobol sequence, shuffled and Owen-scrambled by hashing.

use snell_math::{Vec2, rng};

/// Sample `index` of the point set chosen by `key`, for sets of `2^set_log2` samples.
#[inline(always)]
pub fn point(key: u32, index: u32, set_log2: u32) -> Vec2 {
    let index = shuffle(index, key, set_log2);
    let x = owen_scramble(index.reverse_bits(), rng::hash_combine(key, 1));
    let y = owen_scramble(second_dimension(index), rng::hash_combine(key, 2));
    Vec2::new(rng::to_unit(x), rng::to_unit(y))
}

/// The first coordinate of [`point`].
#[inline(always)]
pub fn number(key: u32, index: u32, set_log2: u32) -> f32 {
    let index = shuffle(index, key, set_log2);
    rng::to_unit(owen_scramble(index.reverse_bits(), rng::hash_combine(key, 1)))
}

/// Shuffles the order of the points, which decides how values of different dimensions are paired. A
/// nested scramble keeps aligned runs of a power of two together, so that all prefixes are well
/// distributed. But then two neighbours are in opposite halves in *every* dimension, which
/// correlates their products, so runs of up to 16 are permuted freely.
#[inline(always)]
fn shuffle(index: u32, key: u32, set_log2: u32) -> u32 {
    let bits = set_log2.min(4);
    let mask = (1 << bits) - 1;
    let nested = owen_scramble(index, key);
    let run = nested >> bits;
    run << bits | permute(nested & mask, mask, rng::hash32(run ^ key.rotate_left(16)))
}

/// Position of `i` in a permutation of `0..=mask` that `key` chooses; `mask + 1` is a power of two
/// of at most 16.
#[inline(always)]
fn permute(i: u32, mask: u32, key: u32) -> u32 {
    let i = (i ^ key) & mask;
    let i = i.wrapping_mul(key >> 4 | 1) & mask;
    let i = i ^ i >> 2;
    let i = i.wrapping_mul(key >> 8 | 1) & mask;
    let i = i ^ i >> 1;
    let i = i.wrapping_mul(key >> 12 | 1).wrapping_add(key >> 16) & mask;
    let i = i ^ i >> 2;
    i.wrapping_mul(key >> 20 | 1).wrapping_add(key >> 24) & mask
}

/// The second Sobol dimension. Its direction numbers are those of Pascal's triangle modulo 2, so
/// the matrix product is five steps of shift and exclusive or instead of a table.
#[inline(always)]
fn second_dimension(index: u32) -> u32 {
    let mut x = index;
    x ^= (x >> 16) & 0x0000_ffff;
    x ^= (x & 0xff00_ff00) >> 8;
    x ^= (x & 0xf0f0_f0f0) >> 4;
    x ^= (x & 0xcccc_cccc) >> 2;
    x ^= (x & 0xaaaa_aaaa) >> 1;
    x.reverse_bits()
}

/// Nested uniform scramble of a number in `[0, 2^32)` whose highest bit is the first digit. Whether
/// a bit is flipped depends only on the bits above it (Laine and Karras, 2011; constants of
/// Vegdahl's search).
#[inline(always)]
fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_dimension_matches_its_direction_numbers() {
        // The direction numbers: v_1 = 1, v_j = 2 v_(j-1) xor v_(j-1), left aligned.
        let mut directions = [0u32; 32];
        let mut v = 1u32 << 31;
        for d in &mut directions {
            *d = v;
            v ^= v >> 1;
        }
        for index in [0u32, 1, 2, 3, 7, 100, 0xdead_beef, u32::MAX] {
            let direct = (0..32).filter(|b| index >> b & 1 == 1).fold(0, |x, b| x ^ directions[b]);
            assert_eq!(second_dimension(index), direct, "{index:#x}");
        }
    }

    #[test]
    fn permutations_of_a_run_are_permutations_and_send_each_place_everywhere() {
        for mask in [0, 1, 3, 7, 15] {
            let mut counts = [0u32; 16];
            for key in 0..4000 {
                let key = rng::hash32(key);
                let mut seen = 0u32;
                (0..=mask).for_each(|i| seen |= 1 << permute(i, mask, key));
                assert_eq!(seen, (1u64 << (mask + 1)) as u32 - 1);
                counts[permute(mask / 2, mask, key) as usize] += 1;
            }
            let expected = 4000 / (mask + 1);
            assert!(
                counts[..=mask as usize].iter().all(|c| c.abs_diff(expected) < expected / 3),
                "{counts:?}"
            );
        }
    }
}
