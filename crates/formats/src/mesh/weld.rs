//! Welds vertices at equal positions.

use rayon::prelude::*;
use snell_math::{DVec3, Vec3};
use std::collections::HashMap;
use std::hash::{BuildHasher, Hash, RandomState};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// The key for comparison: adding zero turns -0 into +0.
pub fn key(position: Vec3) -> [u32; 3] {
    (position + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// The key of a position in double precision.
pub fn exact_key(position: DVec3) -> [u64; 3] {
    (position + DVec3::ZERO).to_array().map(f64::to_bits)
}

/// No vertex.
const NONE: u32 = u32::MAX;

/// For each vertex, the lowest number of a vertex at an equal position (equal as for [`Welder`]). A
/// vertex around which the triangles close keeps its own number, because it has no duplicate. This
/// runs on all cores, with a table of numbers only.
pub fn points(positions: &[Vec3], indices: &[[u32; 3]]) -> Vec<u32> {
    let open = open_vertices(positions.len(), indices);
    let number = open.par_iter().with_min_len(1 << 12).filter(|open| is_open(open)).count();
    let size = (number + number / 3 + 1).next_power_of_two();
    let mut table = Vec::new();
    table.resize_with(size, || AtomicU32::new(NONE));
    // The hash has a random key, so that a file cannot make it slow; the resulting numbers do not
    // depend on the key.
    let state = RandomState::new();
    let place = |number: usize| {
        if !is_open(&open[number]) {
            return NONE;
        }
        let here = key(positions[number]);
        let mut place = state.hash_one(here) as usize & (size - 1);
        loop {
            // The first thread to arrive takes the place for all equal positions; the lowest number
            // wins.
            let known = table[place].compare_exchange(NONE, number as u32, Relaxed, Relaxed).err();
            if known.is_none_or(|known| key(positions[known as usize]) == here) {
                table[place].fetch_min(number as u32, Relaxed);
                return place as u32;
            }
            place = (place + 1) & (size - 1);
        }
    };
    let mut points: Vec<u32> =
        (0..positions.len()).into_par_iter().with_min_len(1 << 12).map(place).collect();
    points.par_iter_mut().enumerate().with_min_len(1 << 12).for_each(|(number, place)| {
        *place = if *place == NONE { number as u32 } else { table[*place as usize].load(Relaxed) };
    });
    points
}

fn is_open(balance: &AtomicU32) -> bool {
    balance.load(Relaxed) != 0
}

/// For each vertex, a number that is not 0 if the triangles around it do not close. If they close
/// with consistent winding, each neighbour follows the vertex in one triangle and precedes it in
/// another, and what is added for the first is subtracted for the second. (One in 2³² open vertices
/// gets 0 by chance.)
fn open_vertices(count: usize, indices: &[[u32; 3]]) -> Vec<AtomicU32> {
    let mut balance = Vec::new();
    balance.resize_with(count, AtomicU32::default);
    indices.par_iter().with_min_len(1 << 12).for_each(|triangle| {
        let [a, b, c] = triangle.map(mixed);
        for (vertex, change) in
            triangle.iter().zip([b.wrapping_sub(c), c.wrapping_sub(a), a.wrapping_sub(b)])
        {
            balance[*vertex as usize].fetch_add(change, Relaxed);
        }
    });
    balance
}

/// A hash of 32 bits (`lowbias32`, Wellons, "Prospecting for Hash Functions", 2018).
fn mixed(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Numbers positions, given by their [`key`] or [`exact_key`]; equal ones get the same number. The
/// two zeros are equal, and so are NaNs of the same bits.
#[derive(Clone, Debug, Default)]
pub struct Welder<Key> {
    // The table is never iterated, so its order does not matter. Its hash is keyed, so a file
    // cannot make it slow.
    numbers: HashMap<Key, u32>,
}

impl<Key: Eq + Hash> Welder<Key> {
    /// The number of a position. A new position gets the next free number.
    pub fn weld(&mut self, key: Key) -> u32 {
        let next = self.numbers.len() as u32;
        *self.numbers.entry(key).or_insert(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_the_first_of_equal_positions() {
        let position = |i: u32| {
            Vec3::new(
                (i * 7919 % 1009) as f32 - 500.0,
                if i.is_multiple_of(2) { 0.0 } else { -0.0 },
                f32::NAN,
            )
        };
        let positions: Vec<Vec3> = (0..20_000).map(position).collect();
        let mut welder = Welder::default();
        let mut first = Vec::new();
        let expected: Vec<u32> = (0..)
            .zip(&positions)
            .map(|(i, &p)| {
                let point = welder.weld(key(p)) as usize;
                first.resize(first.len().max(point + 1), i);
                first[point]
            })
            .collect();
        let loose: Vec<[u32; 3]> = (0..20_000 - 2).map(|i| [i, i + 1, i + 2]).collect();
        assert_eq!(points(&positions, &loose), expected);
        assert_eq!(first.len(), 1009);
        let alone: Vec<u32> = (0..20_000).collect();
        assert_eq!(points(&positions, &[]), alone, "what no triangle has");
    }

    #[test]
    fn around_the_vertices_of_a_closed_body_the_triangles_close() {
        let tetrahedron = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];
        let open = |indices: &[[u32; 3]]| -> Vec<bool> {
            open_vertices(4, indices).iter().map(is_open).collect()
        };
        assert_eq!(open(&tetrahedron), [false; 4]);
        assert_eq!(open(&tetrahedron[1..]), [true, true, true, false]);
    }
}
