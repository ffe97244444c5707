//! Random numbers of a walk through media.

use crate::integrator::dimension;
use crate::sampler::Random;
use snell_math::Vec2;

/// An unlimited sequence of pairs of uniform numbers for the way between two vertices. The first
/// pair of a path is a well-distributed one of the sampler; all other pairs are independent.
#[derive(Clone, Copy, Debug)]
pub struct Numbers {
    random: Random,
    step: u32,
}

/// The number of steps that are reserved for the path, and for each light ray of a vertex.
const LIGHT_RAY: u32 = 1 << 24;

impl Numbers {
    /// The numbers for the way of a path to the vertex of `random`, of which `step` pairs were used
    /// already.
    pub fn of_path(random: Random, step: u32) -> Self {
        Self { random, step }
    }

    /// The numbers for the way of light ray `number` from the vertex of `random`.
    pub fn of_light_ray(random: Random, number: u32) -> Self {
        Self { random, step: LIGHT_RAY.wrapping_mul(number.wrapping_add(1)) }
    }

    /// The number of pairs used so far.
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
