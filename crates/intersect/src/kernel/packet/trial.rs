//! Which way to go when any hit will do.

use crate::kernel::Goal;

/// Which way packets to one point go, where any hit will do: from their starts (in a closed room
/// the next wall is near) or from the point (towards the light, a rough surface is all that is in
/// the way)? Now and then a few go each way, and the others as those that had less work. The way
/// changes no answer.
#[derive(Default)]
pub(super) struct Trial {
    turn: u32,
    work: [u32; 2],
}

impl Trial {
    /// Packets that try each way.
    const TRIALS: u32 = 4;
    /// Packets after which it is tried again.
    const PERIOD: u32 = 128;

    pub fn is_backward(&self) -> bool {
        match self.turn {
            turn if turn < Self::TRIALS => true,
            turn if turn < 2 * Self::TRIALS => false,
            _ => self.work[1] < self.work[0],
        }
    }

    /// Counts the work of a packet that went the way it should.
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

/// Whether triangles are small beside the packets: then each ray meets another one, and it is
/// better to take rays one by one than triangles. Now and then a few walks count how many triangles
/// of a leaf a packet is near, and the others follow them. It changes no answer.
#[derive(Default)]
pub(super) struct Detail {
    turn: u32,
    /// Leaves that packets came to, and triangles that these were near.
    counted: [u32; 2],
}

impl Detail {
    /// Walks that count.
    const TRIALS: u32 = 8;
    /// Walks after which they are counted again.
    const PERIOD: u32 = 256;
    /// The average number of small triangles of eight above which a leaf counts as finely
    /// tessellated. (In leaves of 7 to 12 rays a bunny of 280 thousand that fills the picture has
    /// 3.7, of 1.1 million 6.7; a terrain of 4 million has 6.1, a field of small bunnies 7.5, a
    /// room of slivers 2.8.)
    const SMALL: u32 = 5;
    /// The same where any hit will do (in leaves of more than 4 rays the bunny has 4.0, a terrain
    /// 5.4, 1.1 million 7.2, instances 7.5, a room 1.1).
    const SMALL_OF_ANY: u32 = 2;

    pub fn is_small<G: Goal>(&self) -> bool {
        let [leaves, near] = self.counted;
        self.turn >= Self::TRIALS
            && near > if G::ANY { Self::SMALL_OF_ANY } else { Self::SMALL } * leaves
    }

    /// Counts a walk, and what it has come to.
    pub fn count(&mut self, [leaves, near]: [u32; 2]) {
        if self.turn < Self::TRIALS {
            self.counted = [self.counted[0] + leaves, self.counted[1] + near];
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
    use crate::precision::Single;
    use crate::search::Closest;

    #[test]
    fn triangles_are_small_where_packets_are_near_many() {
        for (near, expected) in [(4, false), (6, true)] {
            let mut detail = Detail::default();
            for turn in 0..2 * Detail::PERIOD {
                assert_eq!(
                    detail.is_small::<Closest<Single>>(),
                    expected && turn % Detail::PERIOD >= Detail::TRIALS
                );
                detail.count(if turn % Detail::PERIOD < Detail::TRIALS {
                    [2, 2 * near]
                } else {
                    [100, 100]
                });
            }
        }
    }

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
