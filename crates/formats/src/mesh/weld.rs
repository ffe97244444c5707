//! One vertex for each position.

use snell_math::Vec3;
use std::collections::HashMap;

/// Numbers positions; equal ones get the same number. Both zeros are equal, and so are equal bit patterns of NaN.
#[derive(Clone, Debug, Default)]
pub struct Welder {
    // Never iterated, so its order does not matter; its hash is keyed, so a file cannot make it slow.
    numbers: HashMap<[u32; 3], u32>,
}

impl Welder {
    /// Room for this many positions.
    pub fn with_capacity(capacity: usize) -> Self {
        Self { numbers: HashMap::with_capacity(capacity) }
    }

    /// The number of a position: the next free one if it is new.
    pub fn weld(&mut self, position: Vec3) -> u32 {
        // Adding zero turns -0 into +0.
        let key = (position + Vec3::ZERO).to_array().map(f32::to_bits);
        let next = self.numbers.len() as u32;
        *self.numbers.entry(key).or_insert(next)
    }

    /// How many different positions there were.
    pub fn len(&self) -> usize {
        self.numbers.len()
    }
}
