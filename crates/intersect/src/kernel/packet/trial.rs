//! Choices between ways of traversal that are made by measuring both.

use crate::kernel::Goal;

/// The direction of traversal of packets that go to one point, for occlusion queries: from the
/// starts of the rays (in a closed room the next wall is near) or from the point (towards a light,
/// the rough surface itself may be the only occluder). Periodically a few packets go each way, and
/// the others take the way with less work. The direction changes no result.
#[derive(Default)]
pub(super) struct Trial {
    turn: u32,
    work: [u32; 2],
}

impl Trial {
    /// The number of packets that try each way.
    const TRIALS: u32 = 4;
    /// The number of packets after which both ways are tried again.
    const PERIOD: u32 = 128;

    pub fn is_backward(&self) -> bool {
        match self.turn {
            turn if turn < Self::TRIALS => true,
            turn if turn < 2 * Self::TRIALS => false,
            _ => self.work[1] < self.work[0],
        }
    }

    /// Counts the work of a packet that went the way of [`Self::is_backward`].
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

/// Decides whether triangles are small compared with packets. Then each ray hits a different
/// triangle, and testing ray by ray is better than testing triangle by triangle. Periodically a few
/// traversals count the triangles of a leaf that a packet may hit, and the others use the result.
/// It changes no hit.
#[derive(Default)]
pub(super) struct Detail {
    turn: u32,
    /// The number of leaves that packets visited, and of triangles in them that the packets may
    /// hit.
    counted: [u32; 2],
}

impl Detail {
    /// The number of traversals that count.
    const TRIALS: u32 = 8;
    /// The number of traversals after which counting starts again.
    const PERIOD: u32 = 256;
    /// The average number of triangles per leaf that a packet may hit above which triangles count
    /// as small. (In leaves visited by 7 to 12 rays, a bunny of 280 thousand triangles that fills
    /// the picture has 3.7, one of 1.1 million 6.7, a terrain of 4 million 6.1, a field of small
    /// bunnies 7.5, and a room of slivers 2.8.)
    const SMALL: u32 = 5;
    /// The corresponding number for occlusion queries. (In leaves visited by more than 4 rays, the
    /// bunny has 4.0, a terrain 5.4, a bunny of 1.1 million triangles 7.2, instances 7.5, and a
    /// room 1.1.)
    const SMALL_OF_ANY: u32 = 2;

    pub fn is_small<G: Goal>(&self) -> bool {
        let [leaves, near] = self.counted;
        self.turn >= Self::TRIALS
            && near > if G::ANY { Self::SMALL_OF_ANY } else { Self::SMALL } * leaves
    }

    /// Counts a traversal, with the leaves and triangles that it counted.
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
