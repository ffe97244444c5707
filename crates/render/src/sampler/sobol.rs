//! The first two dimensions of the Sobol sequence, shuffled and Owen-scrambled by hashing.

use snell_math::{Vec2, rng};

/// Sample `index` of the point set chosen by `key`.
pub fn point(key: u32, index: u32) -> Vec2 {
    let index = owen_scramble(index, key);
    let x = owen_scramble(index.reverse_bits(), rng::hash_combine(key, 1));
    let y = owen_scramble(second_dimension(index), rng::hash_combine(key, 2));
    Vec2::new(rng::to_unit(x), rng::to_unit(y))
}

/// The first coordinate of [`point`].
pub fn number(key: u32, index: u32) -> f32 {
    let index = owen_scramble(index, key);
    rng::to_unit(owen_scramble(index.reverse_bits(), rng::hash_combine(key, 1)))
}

/// The second Sobol dimension. Its direction numbers are those of Pascal's triangle modulo 2, so the matrix product is five steps of
/// shift and exclusive or instead of a table.
fn second_dimension(index: u32) -> u32 {
    let mut x = index;
    x ^= (x >> 16) & 0x0000_ffff;
    x ^= (x & 0xff00_ff00) >> 8;
    x ^= (x & 0xf0f0_f0f0) >> 4;
    x ^= (x & 0xcccc_cccc) >> 2;
    x ^= (x & 0xaaaa_aaaa) >> 1;
    x.reverse_bits()
}

/// Nested uniform scramble of a number in `[0, 2^32)` whose highest bit is the first digit: each bit is flipped or not depending on
/// the bits above it only (Laine and Karras, 2011; constants of Vegdahl's search).
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
        // v_1 = 1, v_j = 2 v_(j-1) xor v_(j-1), left aligned.
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
}
