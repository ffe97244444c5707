//! Random numbers of a walk through media.

use crate::integrator::dimension;
use crate::sampler::Random;
use snell_math::Vec2;

/// Pairs of uniform numbers for one way between two vertices, however many it takes. The first pair
/// of a path is a well-distributed one of the sampler; all others are independent.
#[derive(Clone, Copy, Debug)]
pub struct Numbers {
    random: Random,
    step: u32,
}

/// Steps of light rays are counted from here, one such range for each light ray of a vertex.
const LIGHT_RAY: u32 = 1 << 24;

impl Numbers {
    /// For the way of a path to the vertex that `random` belongs to, of which so many steps are
    /// done.
    pub fn of_path(random: Random, step: u32) -> Self {
        Self { random, step }
    }

    /// For the way of the light ray of this number from the vertex that `random` belongs to.
    pub fn of_light_ray(random: Random, number: u32) -> Self {
        Self { random, step: LIGHT_RAY.wrapping_mul(number.wrapping_add(1)) }
    }

    /// How many steps are done.
    pub fn step(&self) -> u32 {
        self.step
    }

    /// The next pair.
    pub fn next(&mut self) -> Vec2 {
        let step = self.step;
        self.step = step.wrapping_add(1);
        if step == 0 {
            self.random.pair(dimension::MEDIUM)
        } else {
            self.random.independent_pair(step)
        }
    }
}
