//! Fast quality: primitives are sorted along a space-filling curve, and sets are divided at the
//! boundaries of its cells (Lauterbach et al., Fast BVH Construction on GPUs, 2009).

use super::binary::{PartBuilder, Tree};
use super::binning::{Box8, Primitive};
use super::medium::is_leaf;
use super::primitive::{CHUNK, Numbered, OBJECT, Triangles};
use super::wide::fill;
use crate::morton;
use crate::tree::block::TriangleBlock;
use crate::tree::storage::{Plain, Storage};
use rayon::prelude::*;
use snell_math::{Vec3, Vec4};

/// The least and the greatest value of the number of keys up to which a set becomes one part of the
/// tree, built by one thread. (The number depends on how many keys and threads there are.)
const PART: std::ops::RangeInclusive<usize> = 512..=4096;

/// The Morton code of a primitive's centre, in 33 bits, above the number of the primitive in 31
/// bits. So all keys are different, and their order is the same whatever the sorting algorithm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(transparent)]
pub(super) struct Key(u64);

// SAFETY: a `u64` has no padding and accepts any bits.
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

/// Table that spreads the bits of a cell's coordinate on one axis for a Morton code.
static SPREAD: [u32; CELLS_PER_AXIS as usize] = morton::spread();

/// The grid of cells over the doubled centres of primitives.
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
        // Adding `2^23` rounds the coordinates, so that the integers are in the low bits.
        let x = (x - 0.5).max(Vec4::ZERO).min(Vec4::splat((CELLS_PER_AXIS - 1) as f32)) + 8388608.0;
        let cell = |x: f32| u64::from(SPREAD[(x.to_bits() & (CELLS_PER_AXIS - 1)) as usize]);
        Key((cell(x.x) << 2 | cell(x.y) << 1 | cell(x.z)) << NUMBER_BITS | u64::from(number))
    }
}

/// The sorted keys of a group's primitives.
pub(super) struct Fast {
    pub keys: Storage<Key>,
    /// The number of keys in use.
    pub count: usize,
    /// The number of triangles among the keys in use.
    pub triangles: usize,
}

/// Sorts the objects and the triangles that can be hit along the curve.
pub(super) fn sorted(triangles: &Triangles, objects: &[Primitive]) -> Fast {
    let center2 = |[a, b, c]: [Vec3; 3]| (a.min(b).min(c) + a.max(b).max(c)).extend(0.0);
    let around = objects.iter().fold(triangles.centers(center2), |b, p| b.with_point(p.center2()));
    let grid = Grid::new(&around);
    let mut keys = Storage::unset(triangles.count() + objects.len());
    let count = triangles
        .collect(&mut keys[..triangles.count()], |id, corners| grid.key(center2(corners), id));
    for (i, p) in objects.iter().enumerate() {
        keys[count + i] = grid.key(p.center2(), (p.number() & !OBJECT) | OBJECT_BIT);
    }
    let all = count + objects.len();
    Fast { keys: sort(keys, all), count: all, triangles: count }
}

/// The number of bits of a Morton code that one pass of sorting uses; a sort takes three passes.
const DIGIT: u32 = 11;
const DIGITS: usize = 1 << DIGIT;

/// The bits of a key that a pass uses; the last pass uses the highest bits.
#[inline(always)]
fn digit(key: Key, pass: u32) -> usize {
    (key.0 >> (NUMBER_BITS + pass * DIGIT)) as usize & (DIGITS - 1)
}

/// Fewer keys than this (a megabyte, which fits the second-level cache) are sorted by one digit
/// after the other, the lowest first.
const NEAR: usize = 1 << 17;

/// Sorts the first `count` keys, whose primitive numbers ascend. Large inputs are sorted first by
/// their highest digit, in one pass on all threads, and then each bucket by the other digits.
fn sort(mut keys: Storage<Key>, count: usize) -> Storage<Key> {
    let input = &mut keys[..count];
    if count < 1 << 12 {
        input.sort_unstable();
        return keys;
    }
    let threads = rayon::current_num_threads();
    let mut output = Storage::unset(count);
    if count < NEAR {
        // Chunks are not too small, because each needs a counter for every digit.
        let chunk = count.div_ceil(threads).max(CHUNK);
        sort_by(input, &mut output, 0, chunk);
        sort_by(&output, input, 1, chunk);
        sort_by(input, &mut output, 2, chunk);
        return output;
    }
    let chunk = (count / (4 * threads)).max(count.div_ceil(threads).min(2 * CHUNK));
    let sizes = sort_by(input, &mut output, 2, chunk);
    let mut buckets = Vec::with_capacity(DIGITS);
    let (mut rest, mut spare) = (&mut output[..], input);
    for size in sizes {
        let (bucket, others) = rest.split_at_mut(size);
        let (beside, others_beside) = spare.split_at_mut(size);
        buckets.push((bucket, beside));
        (rest, spare) = (others, others_beside);
    }
    buckets.into_par_iter().for_each(|(keys, spare)| sort_bucket(keys, spare));
    output
}

/// One stable pass of a radix sort on all threads, in chunks of `chunk` keys. Returns the number of
/// keys with each digit.
fn sort_by(input: &[Key], output: &mut [Key], pass: u32, chunk: usize) -> Vec<usize> {
    let histogram = |keys: &[Key]| {
        let mut counts = vec![0u32; DIGITS];
        keys.iter().for_each(|&key| counts[digit(key, pass)] += 1);
        counts
    };
    let counts: Vec<Vec<u32>> = input.par_chunks(chunk).map(histogram).collect();
    // For each chunk, the places where its keys of each digit go.
    let mut places: Vec<Vec<std::slice::IterMut<Key>>> =
        counts.iter().map(|_| Vec::with_capacity(DIGITS)).collect();
    let mut rest = output;
    for b in 0..DIGITS {
        for (places, counts) in places.iter_mut().zip(&counts) {
            let (place, others) = rest.split_at_mut(counts[b] as usize);
            places.push(place.iter_mut());
            rest = others;
        }
    }
    input.par_chunks(chunk).zip(places).for_each(|(keys, mut places)| {
        for &key in keys {
            if let Some(place) = places[digit(key, pass)].next() {
                *place = key;
            }
        }
    });
    (0..DIGITS).map(|b| counts.iter().map(|c| c[b] as usize).sum()).collect()
}

/// Buckets smaller than this are sorted by comparison, which takes no longer.
const SMALL_BUCKET: usize = 512;

/// Sorts keys with the same highest digit and ascending numbers. `spare` is scratch memory of the
/// same size.
fn sort_bucket(keys: &mut [Key], spare: &mut [Key]) {
    match keys.len() {
        0..SMALL_BUCKET => keys.sort_unstable(),
        SMALL_BUCKET..0x20000 => {
            sort_by_digit(keys, spare, 0);
            sort_by_digit(spare, keys, 1);
        }
        _ => keys.par_sort_unstable(),
    }
}

/// One stable pass of a radix sort.
fn sort_by_digit(from: &[Key], to: &mut [Key], pass: u32) {
    let mut places = [0u32; DIGITS];
    from.iter().for_each(|&key| places[digit(key, pass)] += 1);
    let mut start = 0;
    for place in &mut places {
        (*place, start) = (start, start + *place);
    }
    for &key in from {
        let place = &mut places[digit(key, pass)];
        to[*place as usize] = key;
        *place += 1;
    }
}

/// For more triangles than this, corners are prefetched. This makes builds of meshes of a million
/// triangles 1.1 to 1.2 times as fast, but of a mesh of 69 thousand, which fits the second-level
/// cache, 0.92 times as fast.
const FETCHED: usize = 1 << 17;

/// Sets of up to this size are divided so that their blocks are full.
const FULL: usize = 32;

/// The position at which to divide two or more sorted keys: between the halves of the smallest cell
/// that contains all, or in the middle if all are in one cell. For small sets, the position nearest
/// to this one at which the two parts need no more blocks of eight than the undivided set.
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
    // The first part's last block may have as many empty lanes as the last block of the undivided
    // set.
    let (over, lacking) = (at % 8, n.next_multiple_of(8) - n);
    if over == 0 || 8 - over <= lacking {
        return at;
    }
    let (down, up) = (at - over, at + (8 - lacking - over));
    if down > 0 && (up >= n || over <= up - at) { down } else { up }
}

/// The inner nodes above the parts; parts are listed separately, in order.
enum Top {
    Part,
    Inner(Box<[Top; 2]>),
}

fn parts<'a>(keys: &'a [Key], most: usize, to: &mut Vec<&'a [Key]>) -> Top {
    if keys.len() <= most {
        to.push(keys);
        return Top::Part;
    }
    let (a, b) = keys.split_at(middle(keys));
    Top::Inner(Box::new([parts(a, most, to), parts(b, most, to)]))
}

/// Builds the tree over sorted keys, at least one, and writes the blocks of its leaves.
pub(super) fn build<'a>(
    keys: &'a [Key],
    triangles: &Triangles,
    objects: &[Primitive],
) -> (Tree<'a, Key>, Storage<TriangleBlock>) {
    let has_objects = !objects.is_empty();
    let mut sets = Vec::new();
    let most = (keys.len() / (8 * rayon::current_num_threads())).clamp(*PART.start(), *PART.end());
    let top = parts(keys, most, &mut sets);
    let outlines: Vec<Outline> = sets.par_iter().map(|set| Outline::of(set, has_objects)).collect();
    let mut blocks = Storage::unset(outlines.iter().map(|outline| outline.blocks).sum());
    let mut rest = &mut blocks[..];
    let mut jobs = Vec::with_capacity(sets.len());
    for (&set, outline) in sets.iter().zip(outlines) {
        let (own, others) = rest.split_at_mut(outline.blocks);
        rest = others;
        jobs.push((set, outline.part, own));
    }
    // The boxes of objects, indexed by object number.
    let mut boxes = Vec::new();
    for p in objects {
        let number = (p.number() & !OBJECT) as usize;
        boxes.resize((number + 1).max(boxes.len()), Box8::EMPTY);
        boxes[number] = *p.bounds();
    }
    let (boxes, fetches_ahead) = (&boxes, keys.len() > FETCHED);
    let build = |(set, mut part, mut blocks): (&'a [Key], PartBuilder, &mut [TriangleBlock])| {
        let (bounds, costs) = part.complete(|first, count| {
            let leaf = &set[first..first + count];
            let id = leaf[0].id();
            if id & OBJECT != 0 {
                return boxes[(id & !OBJECT) as usize];
            }
            let (block, rest) =
                std::mem::take(&mut blocks).split_last_mut().expect("as many as were counted");
            blocks = rest;
            if fetches_ahead {
                // Leaves are visited from the last to the first, so the next leaves are before this
                // one.
                let ahead = |from: usize, to: usize| {
                    let ids = set[first.saturating_sub(from)..first.saturating_sub(to)]
                        .iter()
                        .map(Numbered::id);
                    ids.filter(|id| id & OBJECT == 0)
                };
                ahead(24, 16).for_each(|id| triangles.fetch_indices(id));
                ahead(16, 8).for_each(|id| triangles.fetch_corners(id));
            }
            let bounds = fill(block, leaf, triangles);
            Box8::new(bounds.min, bounds.max)
        });
        (part.finish(set, costs), bounds)
    };
    let built: Vec<_> = jobs.into_par_iter().map(build).collect();
    (assemble(&top, &mut built.into_iter()).0, blocks)
}

fn assemble<'a>(
    top: &Top,
    parts: &mut impl Iterator<Item = (Tree<'a, Key>, Box8)>,
) -> (Tree<'a, Key>, Box8) {
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

/// The topology of a part, whose boxes are not computed yet.
struct Outline {
    part: PartBuilder,
    /// The number of blocks of the part.
    blocks: usize,
}

impl Outline {
    fn of(set: &[Key], has_objects: bool) -> Self {
        let mut outline = Self { part: PartBuilder::new(set.len()), blocks: 0 };
        outline.node(0, set, has_objects);
        outline
    }

    /// Adds the subtree of a set, whose first key has the index `first` in the part.
    fn node(&mut self, first: usize, keys: &[Key], has_objects: bool) {
        if is_leaf(keys, has_objects) {
            self.blocks += usize::from(keys[0].id() & OBJECT == 0);
            return self.part.open_leaf(first, keys.len());
        }
        let at = middle(keys);
        let (a, b) = keys.split_at(at);
        let parent = self.part.open_inner();
        self.node(first, a, has_objects);
        self.part.second_child(parent);
        self.node(first + at, b, has_objects);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_keys_are_sorted() {
        for n in [0usize, 1, 1000, 1 << 12, NEAR - 1, NEAR, 200_000] {
            for bits in [33, 30, 21, 11, 3, 0] {
                let mut keys = Storage::unset(n + 5);
                for (i, key) in keys[..n].iter_mut().enumerate() {
                    let random = snell_math::rng::pcg4d([i as u32, 1, 2, 3]);
                    let cell =
                        (u64::from(random[0]) << 32 | u64::from(random[1])) & ((1 << bits) - 1);
                    *key = Key(cell << NUMBER_BITS | i as u64);
                }
                let mut expected = keys[..n].to_vec();
                expected.sort();
                assert_eq!(sort(keys, n)[..n], expected);
            }
        }
    }
}
