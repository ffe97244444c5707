//! Sobol points distributed along a space-filling curve over the pixels. The errors of neighbouring
//! pixels are negatively correlated, so that the error of the picture is blue noise (Ahmed and
//! Wonka, Screen-space blue-noise diffusion of Monte Carlo sampling error via hierarchical ordering
//! of pixels, 2020; `ZSobolSampler` of pbrt-v4).
//!
//! One scrambled sequence per dimension serves a square of pixels. The pixel's position on the
//! curve followed by the sample's number, as digits, give the index in that sequence. The samples
//! of a pixel are therefore a run whose length is a power of two, which is a (0, m, 2)-net by
//! itself; the union of two, four, sixteen … neighbours on the curve is a net too. The curve is
//! Hilbert's instead of Morton's. Pairs along a Morton curve are always side by side, while some of
//! Hilbert's pairs are one above the other, so that a binary scramble (see [`super::sobol`])
//! shuffles as well as a quaternary one.

/// The place of a pixel's samples in the sequences of its square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stretch {
    /// The square of pixels that share sequences.
    pub square: [u32; 2],
    /// Index of the first sample in the sequences.
    pub start: u32,
}

/// Binary logarithm of the side of the largest square, in pixels.
const MAX_SIDE_LOG2: u32 = 8;

/// The place of a pixel that takes `spp` samples. Squares are smaller where many samples would
/// exceed the range of 32-bit indices.
pub fn stretch(pixel: [u32; 2], spp: u32) -> Stretch {
    let samples_log2 = spp.max(1).next_power_of_two().trailing_zeros();
    let side_log2 = ((32 - samples_log2) / 2).min(MAX_SIDE_LOG2);
    let mask = (1 << side_log2) - 1;
    let position = hilbert_position(pixel.map(|p| p & mask), side_log2);
    Stretch { square: pixel.map(|p| p >> side_log2), start: position << samples_log2 }
}

/// Position of a pixel on the Hilbert curve through a square of `2^side_log2` pixels a side.
fn hilbert_position([mut x, mut y]: [u32; 2], side_log2: u32) -> u32 {
    let mut position = 0;
    for level in (0..side_log2).rev() {
        let (right, low) = (x >> level & 1, y >> level & 1);
        position = position << 2 | (3 * right) ^ low;
        // Rotates and mirrors the quarter so that its curve runs like the curve of the whole
        // square.
        if low == 0 {
            if right == 1 {
                (x, y) = (!x, !y);
            }
            std::mem::swap(&mut x, &mut y);
        }
    }
    position
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_every_pixel_once_and_moves_by_one_pixel() {
        for side_log2 in [1, 2, 5] {
            let side = 1u32 << side_log2;
            let mut visited = vec![None; (side * side) as usize];
            for y in 0..side {
                for x in 0..side {
                    visited[hilbert_position([x, y], side_log2) as usize] = Some([x, y]);
                }
            }
            let curve: Vec<_> =
                visited.into_iter().map(|p| p.expect("every position has a pixel")).collect();
            assert!(
                curve
                    .windows(2)
                    .all(|w| w[0][0].abs_diff(w[1][0]) + w[0][1].abs_diff(w[1][1]) == 1)
            );
        }
    }

    #[test]
    fn stretches_do_not_overlap_and_fit_into_32_bits() {
        for spp in [1, 3, 16, 100, 1 << 16, 1 << 24] {
            let mut starts: Vec<_> = (0..64).map(|i| stretch([i % 8, i / 8], spp)).collect();
            starts.sort_by_key(|s| (s.square, s.start));
            assert!(
                starts
                    .windows(2)
                    .all(|w| w[0].square != w[1].square || w[1].start - w[0].start >= spp),
                "{spp}"
            );
            assert!(starts.iter().all(|s| s.start.checked_add(spp - 1).is_some()), "{spp}");
        }
    }
}
