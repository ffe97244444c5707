//! Disjoint sets of numbers, which are joined step by step (union-find).

/// The numbers from 0 on, each in a set of its own until sets are joined.
#[derive(Clone, Debug, Default)]
pub struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// A set for each of so many numbers.
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// Parts all sets again, of so many numbers, and keeps the memory.
    pub fn reset(&mut self, count: usize) {
        self.0.clear();
        self.0.extend(0..count as u32);
    }

    /// The least number of the set that holds this one. It shortens the way of the next question
    /// (path halving; Tarjan and van Leeuwen, Worst-Case Analysis of Set Union Algorithms, 1984).
    ///
    /// # Panics
    /// If there are fewer numbers.
    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Joins the sets of two numbers.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // The lower root wins, so that the result does not depend on the order.
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::DisjointSets;

    #[test]
    fn sets_have_their_least_numbers_whatever_the_order() {
        let pairs = [(5, 3), (1, 5), (4, 2)];
        for turn in 0..3 {
            let mut sets = DisjointSets::new(7);
            (0..3).for_each(|i| sets.join(pairs[(i + turn) % 3].0, pairs[(i + turn) % 3].1));
            let roots: Vec<u32> = (0..7).map(|i| sets.root(i)).collect();
            assert_eq!(roots, [0, 1, 2, 1, 2, 1, 6]);
            sets.reset(3);
            assert_eq!([0, 1, 2].map(|i| sets.root(i)), [0, 1, 2]);
        }
    }
}
