//! One vertex for each position.

use rayon::prelude::*;
use snell_math::Vec3;
use std::collections::HashMap;
use std::hash::{BuildHasher, RandomState};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// What is compared: adding zero turns -0 into +0.
fn key(position: Vec3) -> [u32; 3] {
    (position + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// No vertex.
const NONE: u32 = u32::MAX;

/// For each position, the number of the first that equals it, in the sense of [`Welder`]. On all cores, with a table of the numbers
/// alone.
pub fn points(positions: &[Vec3]) -> Vec<u32> {
    let size = (positions.len() + positions.len() / 3 + 1).next_power_of_two();
    let mut table = Vec::new();
    table.resize_with(size, || AtomicU32::new(NONE));
    // Keyed by chance, so that a file cannot make it slow; the numbers do not depend on the key.
    let state = RandomState::new();
    let place = |(number, &position): (usize, &Vec3)| {
        let (key_here, number) = (key(position), number as u32);
        let mut place = state.hash_one(key_here) as usize & (size - 1);
        loop {
            // Whoever comes first takes the place for all equal positions, and the lowest number stays.
            let known = table[place].compare_exchange(NONE, number, Relaxed, Relaxed).err();
            if known.is_none_or(|known| key(positions[known as usize]) == key_here) {
                table[place].fetch_min(number, Relaxed);
                return place as u32;
            }
            place = (place + 1) & (size - 1);
        }
    };
    let mut points: Vec<u32> = positions.par_iter().enumerate().with_min_len(1 << 12).map(place).collect();
    points.par_iter_mut().for_each(|place| *place = table[*place as usize].load(Relaxed));
    points
}

/// Numbers positions; equal ones get the same number. Both zeros are equal, and so are equal bit patterns of NaN.
#[derive(Clone, Debug, Default)]
pub struct Welder {
    // Never iterated, so its order does not matter; its hash is keyed, so a file cannot make it slow.
    numbers: HashMap<[u32; 3], u32>,
}

impl Welder {
    /// The number of a position: the next free one if it is new.
    pub fn weld(&mut self, position: Vec3) -> u32 {
        let next = self.numbers.len() as u32;
        *self.numbers.entry(key(position)).or_insert(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_the_first_of_equal_positions() {
        let position =
            |i: u32| Vec3::new((i * 7919 % 1009) as f32 - 500.0, if i % 2 == 0 { 0.0 } else { -0.0 }, f32::NAN);
        let positions: Vec<Vec3> = (0..20_000).map(position).collect();
        let mut welder = Welder::default();
        let mut first = Vec::new();
        let expected: Vec<u32> = (0..)
            .zip(&positions)
            .map(|(i, &p)| {
                let point = welder.weld(p) as usize;
                first.resize(first.len().max(point + 1), i);
                first[point]
            })
            .collect();
        assert_eq!(points(&positions), expected);
        assert_eq!(first.len(), 1009);
    }
}
