//! Morton codes: the interleaved bits of three numbers.

/// A table for one axis of a Morton code: for each number below `N` (at most `2^11`), the number
/// with bit `i` moved to place `3 i`.
pub(crate) const fn spread<const N: usize>() -> [u32; N] {
    let mut table = [0; N];
    let mut x = 1;
    while x < N {
        table[x] = table[x / 2] << 3 | x as u32 & 1;
        x += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_bits_are_three_apart() {
        for (x, spread) in (0u32..).zip(spread::<{ 1 << 11 }>()) {
            let expected = (0..11).fold(0, |sum, bit| sum | (x >> bit & 1) << (3 * bit));
            assert_eq!(spread, expected);
        }
    }
}
