//! Fast quality: primitives are sorted along a space-filling curve, and sets are divided where its cells are (Lauterbach et al., Fast
//! BVH Construction on GPUs, 2009).

use super::binary::{Costs, PartBuilder, Tree};
use super::medium::is_leaf;
use super::primitive::{CHUNK, Numbered, OBJECT, Triangles};
use super::storage::{Plain, Storage};
use super::wide::fill;
use crate::kernel::binning::{Box8, Primitive};
use crate::kernel::triangle::TriangleBlock;
use rayon::prelude::*;
use snell_math::{Vec3, Vec4};

/// Sets up to this size become one part of the tree, built by one thread.
const PART: usize = 4096;

/// The cell of a primitive's centre, in 33 bits, above its number in 31: so keys are all different, and their order is the same however
/// they are sorted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(transparent)]
pub(super) struct Key(u64);

// SAFETY: a number.
unsafe impl Plain for Key {}

const NUMBER_BITS: u32 = 31;
const OBJECT_BIT: u32 = 1 << 30;
const CELLS_PER_AXIS: u32 = 1 << 11;

impl Numbered for Key {
    #[inline(always)]
    fn id(&self) -> u32 {
        let number = self.0 as u32 & (OBJECT_BIT - 1);
        if self.0 as u32 & OBJECT_BIT != 0 { number | OBJECT } else { number }
    }
}

/// Spreads 11 bits so that two zeros follow each.
#[inline(always)]
fn spread(x: u32) -> u64 {
    let x = u64::from(x);
    let x = (x | x << 16) & 0x0700_00ff;
    let x = (x | x << 8) & 0x0700_f00f;
    let x = (x | x << 4) & 0x430c_30c3;
    (x | x << 2) & 0x4924_9249
}

/// Maps doubled centres to cells.
struct Grid {
    low: Vec4,
    scale: Vec4,
}

impl Grid {
    fn new(centers: &Box8) -> Self {
        let size = centers.size();
        let scale = Vec4::splat(CELLS_PER_AXIS as f32 * 0.9999) / size;
        let usable = size.cmpgt(Vec4::ZERO) & scale.is_finite_mask() & size.is_finite_mask();
        Self { low: centers.low(), scale: Vec4::select(usable, scale, Vec4::ZERO) }
    }

    #[inline(always)]
    fn key(&self, center2: Vec4, number: u32) -> Key {
        let x = (center2 - self.low) * self.scale;
        let cell = |x: f32| spread((x as u32).min(CELLS_PER_AXIS - 1));
        Key((cell(x.x) << 2 | cell(x.y) << 1 | cell(x.z)) << NUMBER_BITS | u64::from(number))
    }
}

/// A tree, and the blocks of its leaves in their order.
pub(super) struct Fast {
    pub keys: Storage<Key>,
    /// How many keys are in use.
    pub count: usize,
    /// How many of these are triangles.
    pub triangles: usize,
}

/// Sorts the triangles that can be hit and the objects along the curve.
pub(super) fn sorted(triangles: &Triangles, objects: &[Primitive]) -> Fast {
    let center2 = |[a, b, c]: [Vec3; 3]| (a.min(b).min(c) + a.max(b).max(c)).extend(0.0);
    let around = objects.iter().fold(triangles.centers(center2), |b, p| b.with_point(p.center2()));
    let grid = Grid::new(&around);
    let mut keys = Storage::zeroed(triangles.count() + objects.len());
    let count = triangles.collect(&mut keys[..triangles.count()], |id, corners| grid.key(center2(corners), id));
    for (i, p) in objects.iter().enumerate() {
        keys[count + i] = grid.key(p.center2(), (p.number() & !OBJECT) | OBJECT_BIT);
    }
    let all = count + objects.len();
    Fast { keys: sort(keys, all), count: all, triangles: count }
}

/// Bits that are sorted by first, in one pass of all threads.
const FIRST_BITS: u32 = 12;

/// Sorts the first `count` keys.
fn sort(mut keys: Storage<Key>, count: usize) -> Storage<Key> {
    const BUCKETS: usize = 1 << FIRST_BITS;
    let input = &mut keys[..count];
    if count < 1 << 16 {
        input.sort_unstable();
        return keys;
    }
    let bucket = |key: &Key| (key.0 >> (64 - FIRST_BITS)) as usize;
    let chunk = (count / 64).max(count.div_ceil(rayon::current_num_threads()).min(CHUNK));
    let histogram = |keys: &[Key]| {
        let mut counts = vec![0u32; BUCKETS];
        keys.iter().for_each(|key| counts[bucket(key)] += 1);
        counts
    };
    let counts: Vec<Vec<u32>> = input.par_chunks(chunk).map(histogram).collect();
    let mut output = Storage::zeroed(count);
    // For each chunk its place in each bucket.
    let mut places: Vec<Vec<std::slice::IterMut<Key>>> = counts.iter().map(|_| Vec::with_capacity(BUCKETS)).collect();
    let mut rest = &mut output[..];
    for b in 0..BUCKETS {
        for (places, counts) in places.iter_mut().zip(&counts) {
            let (place, others) = rest.split_at_mut(counts[b] as usize);
            places.push(place.iter_mut());
            rest = others;
        }
    }
    input.par_chunks(chunk).zip(places).for_each(|(keys, mut places)| {
        for key in keys {
            if let Some(place) = places[bucket(key)].next() {
                *place = *key;
            }
        }
    });
    let mut buckets = Vec::with_capacity(BUCKETS);
    let mut rest = &mut output[..];
    for b in 0..BUCKETS {
        let size = counts.iter().map(|c| c[b] as usize).sum();
        let (bucket, others) = rest.split_at_mut(size);
        buckets.push(bucket);
        rest = others;
    }
    buckets
        .into_par_iter()
        .for_each(|keys| if keys.len() < 1 << 17 { keys.sort_unstable() } else { keys.par_sort_unstable() });
    output
}

/// Small sets are divided so that their blocks will be full.
const FULL: usize = 32;

/// Where to divide sorted keys, at least two: between the halves of the smallest cell that holds all, or in the middle if they share
/// one; small sets where it is nearest to that and needs no more blocks of eight than the whole.
#[inline]
fn middle(keys: &[Key]) -> usize {
    let n = keys.len();
    let differing = (keys[0].0 ^ keys[n - 1].0) >> NUMBER_BITS << NUMBER_BITS;
    let at = if differing == 0 {
        n / 2
    } else {
        let bit = 1u64 << (63 - differing.leading_zeros());
        keys.partition_point(|k| k.0 & bit == 0)
    };
    if n <= 8 || n > FULL {
        return at;
    }
    // The last block of the first part may lack as many as the last block of all does.
    let (over, lacking) = (at % 8, n.next_multiple_of(8) - n);
    if over == 0 || 8 - over <= lacking {
        return at;
    }
    let (down, up) = (at - over, at + (8 - lacking - over));
    if down > 0 && (up >= n || over <= up - at) { down } else { up }
}

/// The sets that become parts, in order, and how they hang together.
enum Top {
    Part,
    Inner(Box<[Top; 2]>),
}

fn parts<'a>(keys: &'a [Key], to: &mut Vec<&'a [Key]>) -> Top {
    if keys.len() <= PART {
        to.push(keys);
        return Top::Part;
    }
    let (a, b) = keys.split_at(middle(keys));
    Top::Inner(Box::new([parts(a, to), parts(b, to)]))
}

/// Builds the tree over sorted keys, at least one, and writes the blocks of its leaves.
pub(super) fn build<'a>(
    keys: &'a [Key],
    triangles: &Triangles,
    objects: &[Primitive],
) -> (Tree<'a, Key>, Storage<TriangleBlock>) {
    let has_objects = !objects.is_empty();
    let mut sets = Vec::new();
    let top = parts(keys, &mut sets);
    let counts: Vec<usize> = sets.par_iter().map(|set| blocks(set, has_objects)).collect();
    let mut blocks = Storage::zeroed(counts.iter().sum());
    let mut rest = &mut blocks[..];
    let mut jobs = Vec::with_capacity(sets.len());
    for (&set, &count) in sets.iter().zip(&counts) {
        let (own, others) = rest.split_at_mut(count);
        rest = others;
        jobs.push((set, own));
    }
    // The boxes of objects, by number.
    let mut boxes = Vec::new();
    for p in objects {
        let number = (p.number() & !OBJECT) as usize;
        boxes.resize((number + 1).max(boxes.len()), Box8::EMPTY);
        boxes[number] = *p.bounds();
    }
    let boxes = &boxes;
    let build = |(set, blocks): (&'a [Key], &mut [TriangleBlock])| {
        let mut part = PartBuilder::new(set.len());
        let mut builder = Builder { triangles, boxes, blocks, has_objects };
        let (bounds, costs) = builder.node(&mut part, 0, set);
        (part.finish(set, costs), bounds)
    };
    let built: Vec<_> = jobs.into_par_iter().map(build).collect();
    (assemble(&top, &mut built.into_iter()).0, blocks)
}

fn assemble<'a>(top: &Top, parts: &mut impl Iterator<Item = (Tree<'a, Key>, Box8)>) -> (Tree<'a, Key>, Box8) {
    match top {
        Top::Part => parts.next().expect("a part for each"),
        Top::Inner(children) => {
            let (a, a_bounds) = assemble(&children[0], parts);
            let (b, b_bounds) = assemble(&children[1], parts);
            let bounds = a_bounds.union(&b_bounds);
            (Tree::inner(bounds, [a, b]), bounds)
        }
    }
}

/// How many blocks a set will have.
fn blocks(keys: &[Key], has_objects: bool) -> usize {
    if is_leaf(keys, has_objects) {
        return usize::from(keys[0].id() & OBJECT == 0);
    }
    let (a, b) = keys.split_at(middle(keys));
    blocks(a, has_objects) + blocks(b, has_objects)
}

/// The builder of one part.
struct Builder<'a> {
    triangles: &'a Triangles<'a>,
    boxes: &'a [Box8],
    /// Those not written yet.
    blocks: &'a mut [TriangleBlock],
    has_objects: bool,
}

impl Builder<'_> {
    /// `first` is where the set starts in the part.
    fn node(&mut self, part: &mut PartBuilder, first: usize, keys: &[Key]) -> (Box8, Costs) {
        if is_leaf(keys, self.has_objects) {
            let bounds = self.leaf(keys);
            return (bounds, part.leaf(&bounds, first, keys.len()));
        }
        let at = middle(keys);
        let (a, b) = keys.split_at(at);
        part.inner_from_below(|part| {
            let (a, a_costs) = self.node(part, first, a);
            let second = part.next();
            let (b, b_costs) = self.node(part, first + at, b);
            (a.union(&b), second, a_costs, b_costs)
        })
    }

    fn leaf(&mut self, keys: &[Key]) -> Box8 {
        let id = keys[0].id();
        if id & OBJECT != 0 {
            return self.boxes[(id & !OBJECT) as usize];
        }
        let blocks = std::mem::take(&mut self.blocks);
        let (block, rest) = blocks.split_first_mut().expect("as many as were counted");
        self.blocks = rest;
        let bounds = fill(block, keys, self.triangles);
        Box8::new(bounds.min, bounds.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_bits_are_three_apart() {
        for x in [0, 1, 2, 0x7ff, 0x555, 0x123] {
            let expected = (0..11).fold(0u64, |sum, bit| sum | u64::from(x >> bit & 1) << (3 * bit));
            assert_eq!(spread(x), expected);
        }
    }

    #[test]
    fn many_keys_are_sorted() {
        for n in [0usize, 1, 1000, 1 << 16, 200_000] {
            for shift in [0, 40] {
                let mut keys = Storage::zeroed(n + 5);
                for (i, key) in keys[..n].iter_mut().enumerate() {
                    let random = snell_math::rng::pcg4d([i as u32, 1, 2, 3]);
                    *key = Key((u64::from(random[0]) << 32 | u64::from(random[1])) >> shift);
                }
                let mut expected = keys[..n].to_vec();
                expected.sort();
                assert_eq!(sort(keys, n)[..n], expected);
            }
        }
    }
}
