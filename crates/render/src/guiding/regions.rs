//! Finds the region of a point. The binary trees over space are stored as tables of eight entries,
//! which cover three halvings at once.

/// The number of bits of coordinates in the unit cube.
const DIGITS: u32 = 24;

/// Marks an entry as the number of a region, not of a table.
const REGION: u32 = 1 << 31;

/// The regions of several trees, each over the same cube.
#[derive(Clone, Debug, Default)]
pub struct Regions {
    /// The entry of each tree's root: a region (see [`REGION`]) or a table.
    roots: Vec<u32>,
    /// The content of each octant, numbered by its position along x, y and z (1, 2 and 4): a region
    /// (see [`REGION`]) or a further table.
    tables: Vec<[u32; 8]>,
}

/// A node of a binary tree over a box: two halves, or a region. The axes of halving take turns, x
/// first.
pub trait Halves: Copy {
    /// The two halves of the node, or the number of its region as error.
    fn halves(self) -> Result<[Self; 2], u32>;
}

/// The coordinates of a point in the unit cube, in units of `2^-DIGITS`.
pub type Place = [u32; 3];

/// The coordinate of a [`Place`] for `x` in `[0, 1)`.
#[inline(always)]
pub fn place(x: f32) -> u32 {
    // The conversion goes through signed integers, which wide registers support.
    (x * (1u32 << DIGITS) as f32) as i32 as u32
}

impl Regions {
    /// The regions of trees with these roots.
    pub fn new<N: Halves>(roots: impl Iterator<Item = N>) -> Self {
        let mut regions = Self::default();
        for root in roots {
            let entry = regions.entry(root);
            regions.roots.push(entry);
        }
        regions
    }

    /// The entry for a node: the number of its region, or of a new table.
    fn entry<N: Halves>(&mut self, node: N) -> u32 {
        if let Err(region) = node.halves() {
            return region | REGION;
        }
        let number = self.tables.len();
        self.tables.push([0; 8]);
        for eighth in 0..8 {
            let mut at = node;
            for axis in 0..3 {
                if let Ok(halves) = at.halves() {
                    at = halves[eighth >> axis & 1];
                }
            }
            // A region larger than an octant fills several entries, with the same value.
            let entry = self.entry(at);
            self.tables[number][eighth] = entry;
        }
        number as u32
    }

    /// The number of the region at a place in a tree.
    #[inline]
    pub fn find(&self, tree: usize, [x, y, z]: Place) -> u32 {
        let (mut at, mut digit) = (self.roots[tree], DIGITS);
        while at & REGION == 0 {
            digit -= 1;
            let eighth = (x >> digit & 1) | (y >> digit & 1) << 1 | (z >> digit & 1) << 2;
            at = self.tables[at as usize][eighth as usize];
        }
        at & !REGION
    }

    /// Finds the regions of the first `count` points. All points take each step together.
    pub fn find_many<const N: usize>(
        &self,
        trees: &[u32; N],
        [x, y, z]: &[[u32; N]; 3],
        count: usize,
        to: &mut [u32; N],
    ) {
        let (mut walking, mut left) = ([0u16; N], 0);
        for i in 0..count.min(N) {
            to[i] = self.roots[trees[i] as usize];
            walking[left] = i as u16;
            left += usize::from(to[i] & REGION == 0);
        }
        let mut digit = DIGITS;
        while left > 0 && digit > 0 {
            digit -= 1;
            let count = std::mem::take(&mut left);
            for k in 0..count {
                let i = usize::from(walking[k]);
                let eighth =
                    (x[i] >> digit & 1) | (y[i] >> digit & 1) << 1 | (z[i] >> digit & 1) << 2;
                to[i] = self.tables[to[i] as usize][eighth as usize & 7];
                walking[left] = walking[k];
                left += usize::from(to[i] & REGION == 0);
            }
        }
        to.iter_mut().take(count).for_each(|region| *region &= !REGION);
    }

    /// Memory use in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.tables[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng;

    /// A tree whose boxes are halved at random, by a hash.
    #[derive(Clone, Copy)]
    struct Chance {
        key: u32,
        depth: u32,
    }

    impl Halves for Chance {
        fn halves(self) -> Result<[Self; 2], u32> {
            let Self { key, depth } = self;
            let is_halved = depth < 30 && !rng::hash_combine(key, 5).is_multiple_of(3);
            let half = |k| Self { key: rng::hash_combine(key, k), depth: depth + 1 };
            if is_halved { Ok([half(1), half(2)]) } else { Err(key >> 1) }
        }
    }

    #[test]
    fn regions_are_those_of_the_trees_step_by_step() {
        let roots: Vec<_> =
            (0..6).map(|key| Chance { key: rng::hash_combine(key, 77), depth: 0 }).collect();
        let regions = Regions::new(roots.iter().copied());
        let mut depths = 0;
        for i in 0..10_000 {
            let u = rng::uniform2([i, 1, 1, 1]);
            let point = [u.x, u.y, rng::uniform2([i, 1, 1, 2]).x];
            let tree = i as usize % roots.len();
            let (mut at, mut p) = (roots[tree], point);
            while let Ok(halves) = at.halves() {
                let x = &mut p[at.depth as usize % 3];
                *x *= 2.0;
                at = halves[usize::from(*x >= 1.0)];
                *x = x.fract();
            }
            depths += at.depth;
            let found = regions.find(tree, point.map(place));
            assert_eq!(Err(found), at.halves().map(|_| ()), "{point:?}");
            let mut many = [0; 3];
            regions.find_many(
                &[tree as u32; 3],
                &point.map(|x| [place(0.5), place(x), 0]),
                2,
                &mut many,
            );
            assert_eq!(many[1..], [found, 0]);
        }
        assert!(depths > 20_000, "{depths}");
    }
}
