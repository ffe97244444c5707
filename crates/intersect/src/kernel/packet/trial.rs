//! Which way to go when any hit will do.

/// Which way bundles to one point go, where any hit will do: from their starts (in a closed room the next wall is near) or from the
/// point (towards the light, a rough surface is all that is in the way)? Now and then a few go each way, and the others as those that had
/// less work. The way changes no answer.
#[derive(Default)]
pub(super) struct Trial {
    turn: u32,
    work: [u32; 2],
}

impl Trial {
    /// Bundles that try each way.
    const TRIALS: u32 = 4;
    /// Bundles after which it is tried again.
    const PERIOD: u32 = 128;

    pub fn is_backward(&self) -> bool {
        match self.turn {
            turn if turn < Self::TRIALS => true,
            turn if turn < 2 * Self::TRIALS => false,
            _ => self.work[1] < self.work[0],
        }
    }

    /// Counts the work of a bundle that went the way it should.
    pub fn count(&mut self, work: u32) {
        if self.turn < 2 * Self::TRIALS {
            self.work[usize::from(self.is_backward())] += work;
        }
        self.turn += 1;
        if self.turn == Self::PERIOD {
            *self = Self::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_both_ways_are_tried_the_one_with_less_work_is_kept() {
        for (forward, backward) in [(3, 2), (2, 3)] {
            let mut trial = Trial::default();
            for turn in 0..2 * Trial::PERIOD {
                let way = trial.is_backward();
                if turn % Trial::PERIOD >= 2 * Trial::TRIALS {
                    assert_eq!(way, backward < forward);
                }
                trial.count(if way { backward } else { forward });
            }
        }
    }
}
