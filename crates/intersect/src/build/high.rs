//! High quality: instead of the primitives of a set, its space may be divided. Triangles that cross
//! the dividing plane go to both sides, each time with the box of the part on that side (Stich,
//! Friedrich and Dietrich, Spatial Splits in Bounding Volume Hierarchies, 2009). Rooms with long
//! slanted triangles are traced two to three times as fast; scans do not benefit.
//!
//! Each set has free room for further pieces. When it is divided, its two parts share this room in
//! proportion to the summed areas of their primitives' boxes (as in Fuetterling et al., Parallel
//! Spatial Splits in Bounding Volume Hierarchies, 2016). So memory and time are bounded, and parts
//! are built in parallel in place.

use super::binary::{Costs, PartBuilder, Tree};
use super::binning::{Binning, Box8, Primitive};
use super::bins::{Extent, PARALLEL, best_plane, bins_of, blocks};
use super::clip::divided;
use super::medium::{MAX_COST_DEPTH, PART, is_leaf};
use super::partition::partition;
use super::primitive::{CHUNK, Numbered, OBJECT, Triangles};
use rayon::join;
use rayon::prelude::*;
use snell_math::simd::Wide;

/// Space is divided only where the two parts of an object split would overlap by more than this
/// share of the area of everything.
const LEAST_OVERLAP: f32 = 1e-5;

/// Spatial splits are tried only where a random line through the set hits on average at least this
/// many boxes of primitives; otherwise they gain little.
const CROWDED: f64 = 4.0;

/// The number of bins on each axis of space.
const BINS: usize = 16;

/// Options of the build.
#[derive(Clone, Copy)]
pub(super) struct High<'a> {
    /// The SIMD instructions to use.
    pub wide: Option<Wide>,
    /// False if all primitives are triangles.
    pub has_objects: bool,
    /// The triangles whose boxes the primitives are.
    pub triangles: &'a Triangles<'a>,
    /// Half of the surface area of the box around everything.
    area: f32,
}

/// The primitives of a subtree: the first `len` entries of `room`.
struct Set<'p> {
    room: &'p mut [Primitive],
    len: usize,
    extent: Extent,
    /// Sum of the half surface areas of the boxes; not computed if there is no room for more
    /// pieces.
    areas: f64,
    depth: usize,
}

impl Set<'_> {
    fn primitives(&self) -> &[Primitive] {
        &self.room[..self.len]
    }
}

impl<'a> High<'a> {
    pub fn new(wide: Option<Wide>, has_objects: bool, triangles: &'a Triangles<'a>) -> Self {
        Self { wide, has_objects, triangles, area: 0.0 }
    }

    /// Builds the tree of the first `len` (at least one) primitives of `room`, whose extent is
    /// given. The rest is room for pieces.
    pub fn build(
        mut self,
        room: &mut [Primitive],
        len: usize,
        extent: Extent,
    ) -> Tree<'_, Primitive> {
        self.area = extent.bounds.half_area();
        let areas = areas(&room[..len]);
        self.subtree(Set { room, len, extent, areas, depth: 0 })
    }

    fn subtree<'p>(self, set: Set<'p>) -> Tree<'p, Primitive> {
        if set.len <= PART {
            let mut part = PartBuilder::new(set.room.len());
            let Set { room, len, extent, areas, depth } = set;
            let costs =
                self.node(&mut part, 0, Set { room: &mut *room, len, extent, areas, depth });
            return part.finish(room, costs);
        }
        let bounds = set.extent.bounds;
        let (_, [a, b]) = self.divide(set);
        let (a, b) = join(|| self.subtree(a), || self.subtree(b));
        Tree::inner(bounds, [a, b])
    }

    /// Builds a subtree within a part. `first` is the index in the part at which the room of the
    /// set starts.
    fn node(self, part: &mut PartBuilder, first: usize, set: Set<'_>) -> Costs {
        if is_leaf(set.primitives(), self.has_objects) {
            let pieces = &mut set.room[..set.len];
            return part.leaf(&set.extent.bounds, first, without_duplicates(pieces));
        }
        let bounds = set.extent.bounds;
        let (second, [a, b]) = self.divide(set);
        part.inner(
            &bounds,
            |part| self.node(part, first, a),
            |part| self.node(part, first + second, b),
        )
    }

    /// Divides a set of at least two. Also returns the index at which the room of the second part
    /// starts.
    fn divide<'p>(self, set: Set<'p>) -> (usize, [Set<'p>; 2]) {
        let Set { room, len, extent, areas, depth } = set;
        let binning = Binning::new(&extent.centers);
        let may_divide = depth < MAX_COST_DEPTH;
        let plane =
            if may_divide { best_plane(&bins_of(self.wide, &binning, &room[..len])) } else { None };
        let overlap = plane.map_or(extent.bounds.half_area(), |p| {
            p.bounds[0].intersection(&p.bounds[1]).half_area()
        });
        let is_crowded = areas > CROWDED * f64::from(extent.bounds.half_area());
        if may_divide && room.len() > len && is_crowded && overlap > LEAST_OVERLAP * self.area {
            let cost = plane.map_or(f32::INFINITY, |p| p.cost);
            let found = self.space_plane(&room[..len], &extent.bounds);
            if let Some(space) = found.filter(|s| s.cost < cost)
                && let Some((first, second)) = self.divide_space(room, len, &space)
            {
                return share(room, first, second, depth);
            }
        }
        let Some(plane) = plane else {
            return share(room, len / 2, len - len / 2, depth);
        };
        let parts = partition(self.wide, &binning, plane.at, &mut room[..len]);
        share(room, parts.first, len - parts.first, depth)
    }

    /// The plane of least cost for dividing space; `None` if no plane divides it.
    fn space_plane(self, primitives: &[Primitive], bounds: &Box8) -> Option<SpacePlane> {
        let slabs = Slabs::new(bounds);
        let of = |primitives: &[Primitive]| {
            let mut bins = SpaceBins::EMPTY;
            primitives.iter().for_each(|p| bins.add(p, &slabs, self.triangles));
            bins
        };
        let bins = if primitives.len() < PARALLEL {
            of(primitives)
        } else {
            primitives.par_chunks(CHUNK).map(of).reduce(|| SpaceBins::EMPTY, SpaceBins::union)
        };
        bins.best_plane(&slabs)
    }

    /// Divides a set at a plane in space; afterwards the first part is in front, followed by the
    /// second. Returns the sizes of both, or `None` (and nothing has changed) if there is no room,
    /// or if a part would be empty or hold all primitives.
    fn divide_space(
        self,
        room: &mut [Primitive],
        len: usize,
        plane: &SpacePlane,
    ) -> Option<(usize, usize)> {
        let SpacePlane { axis, at, counts, bounds, .. } = *plane;
        let (mut first, mut second) =
            (Vec::with_capacity(counts[0]), Vec::with_capacity(counts[1]));
        let [a_area, b_area] = [bounds[0].half_area(), bounds[1].half_area()];
        let [a_count, b_count] = counts.map(|n| n as f32);
        let both = a_area * a_count + b_area * b_count;
        for p in &room[..len] {
            let b = p.bounds().bounds();
            if b.max[axis] <= at || (p.id() & OBJECT != 0 && b.center()[axis] < at) {
                first.push(*p);
            } else if b.min[axis] >= at || p.id() & OBJECT != 0 {
                second.push(*p);
            } else {
                // A piece stays whole if that costs less ("reference unsplitting", section 4.4).
                let only_first =
                    bounds[0].union(p.bounds()).half_area() * a_count + b_area * (b_count - 1.0);
                let only_second =
                    a_area * (a_count - 1.0) + bounds[1].union(p.bounds()).half_area() * b_count;
                if only_first < both && only_first <= only_second {
                    first.push(*p);
                } else if only_second < both {
                    second.push(*p);
                } else {
                    let pieces = divided(p, &self.triangles.corners(p.id()), axis, at);
                    // Some part of the triangle must be on some side; if rounding loses both parts,
                    // the piece is kept whole.
                    if pieces[0].is_none() && pieces[1].is_none() {
                        first.push(*p);
                    }
                    first.extend(pieces[0]);
                    second.extend(pieces[1]);
                }
            }
        }
        let (n, m) = (first.len(), second.len());
        if n + m > room.len() || n == 0 || m == 0 || n >= len || m >= len {
            return None;
        }
        room[..n].copy_from_slice(&first);
        room[n..n + m].copy_from_slice(&second);
        Some((n, m))
    }
}

/// Divides the room between two consecutive parts of `first` and `second` primitives. The free
/// entries are divided in proportion to the area of the boxes.
fn share(
    room: &mut [Primitive],
    first: usize,
    second: usize,
    depth: usize,
) -> (usize, [Set<'_>; 2]) {
    let free = room.len() - first - second;
    let (mut spare, mut sums) = (0, [0.0; 2]);
    if free > 0 {
        let [a, b] = [areas(&room[..first]), areas(&room[first..first + second])];
        let part = if a + b > 0.0 && (a + b).is_finite() { a / (a + b) } else { 0.5 };
        spare = ((free as f64 * part) as usize).min(free);
        sums = [a, b];
        room.copy_within(first..first + second, first + spare);
    }
    let (a, b) = room.split_at_mut(first + spare);
    let extents = [Extent::of(&a[..first]), Extent::of(&b[..second])];
    let a = Set { room: a, len: first, extent: extents[0], areas: sums[0], depth: depth + 1 };
    let b = Set { room: b, len: second, extent: extents[1], areas: sums[1], depth: depth + 1 };
    (first + spare, [a, b])
}

/// The sum of the half surface areas of the boxes. Sums of pieces of fixed size are added in order,
/// so the result does not depend on the threads.
fn areas(primitives: &[Primitive]) -> f64 {
    let of = |p: &[Primitive]| p.iter().map(|p| f64::from(p.bounds().half_area())).sum::<f64>();
    if primitives.len() < PARALLEL {
        return of(primitives);
    }
    primitives.par_chunks(CHUNK).map(of).collect::<Vec<_>>().iter().sum()
}

/// Moves one piece of each primitive to the front. Returns their number.
fn without_duplicates(pieces: &mut [Primitive]) -> usize {
    pieces.sort_unstable_by_key(Numbered::id);
    let mut kept = 1;
    for i in 1..pieces.len() {
        if pieces[i].id() != pieces[kept - 1].id() {
            pieces[kept] = pieces[i];
            kept += 1;
        }
    }
    kept
}

/// A division of a set by a plane in space.
#[derive(Clone, Copy, Debug)]
struct SpacePlane {
    axis: usize,
    at: f32,
    /// The boxes of both parts.
    bounds: [Box8; 2],
    /// The number of primitives that each part would have.
    counts: [usize; 2],
    /// The sum over both parts of half the area times the number of blocks.
    cost: f32,
}

/// A box divided into equal slabs along each axis.
struct Slabs {
    low: [f32; 3],
    width: [f32; 3],
}

impl Slabs {
    fn new(bounds: &Box8) -> Self {
        let b = bounds.bounds();
        Self { low: b.min.to_array(), width: (b.size() / BINS as f32).to_array() }
    }

    /// The coordinate at which slab `i` begins.
    fn start(&self, axis: usize, i: usize) -> f32 {
        self.low[axis] + self.width[axis] * i as f32
    }

    fn of(&self, axis: usize, x: f32) -> usize {
        // NaN (for a box without width) becomes 0.
        (((x - self.low[axis]) / self.width[axis]) as usize).min(BINS - 1)
    }
}

/// The contents of each slab, by axis: their box, and the numbers of primitives that begin and
/// end in the slab.
struct SpaceBins {
    boxes: [[Box8; BINS]; 3],
    begin: [[u32; BINS]; 3],
    end: [[u32; BINS]; 3],
}

impl SpaceBins {
    const EMPTY: Self =
        Self { boxes: [[Box8::EMPTY; BINS]; 3], begin: [[0; BINS]; 3], end: [[0; BINS]; 3] };

    fn add(&mut self, p: &Primitive, slabs: &Slabs, triangles: &Triangles) {
        let b = p.bounds().bounds();
        for axis in 0..3 {
            let (first, last) = if p.id() & OBJECT != 0 {
                let at = slabs.of(axis, b.center()[axis]);
                (at, at)
            } else {
                (slabs.of(axis, b.min[axis]), slabs.of(axis, b.max[axis]))
            };
            let boxes = &mut self.boxes[axis];
            self.begin[axis][first] += 1;
            self.end[axis][last] += 1;
            if first == last {
                boxes[first] = boxes[first].union(p.bounds());
                continue;
            }
            let corners = triangles.corners(p.id());
            let mut rest = *p;
            for (slab, bin) in (first + 1..).zip(&mut boxes[first..last]) {
                let [before, after] = divided(&rest, &corners, axis, slabs.start(axis, slab));
                if let Some(before) = before {
                    *bin = bin.union(before.bounds());
                }
                let Some(after) = after else { break };
                rest = after;
            }
            boxes[last] = boxes[last].union(rest.bounds());
        }
    }

    fn union(mut self, other: Self) -> Self {
        for axis in 0..3 {
            for i in 0..BINS {
                self.boxes[axis][i] = self.boxes[axis][i].union(&other.boxes[axis][i]);
                self.begin[axis][i] += other.begin[axis][i];
                self.end[axis][i] += other.end[axis][i];
            }
        }
        self
    }

    fn best_plane(&self, slabs: &Slabs) -> Option<SpacePlane> {
        let mut best: Option<SpacePlane> = None;
        for axis in 0..3 {
            let mut right = [(Box8::EMPTY, 0); BINS];
            let (mut bounds, mut count) = (Box8::EMPTY, 0);
            for i in (1..BINS).rev() {
                bounds = bounds.union(&self.boxes[axis][i]);
                count += self.end[axis][i];
                right[i] = (bounds, count);
            }
            (bounds, count) = (Box8::EMPTY, 0);
            for (i, &(right_bounds, right_count)) in right.iter().enumerate().skip(1) {
                bounds = bounds.union(&self.boxes[axis][i - 1]);
                count += self.begin[axis][i - 1];
                if count == 0 || right_count == 0 {
                    continue;
                }
                let cost = bounds.half_area() * blocks(count)
                    + right_bounds.half_area() * blocks(right_count);
                if best.is_none_or(|b| cost < b.cost) {
                    let (bounds, counts) =
                        ([bounds, right_bounds], [count as usize, right_count as usize]);
                    best =
                        Some(SpacePlane { axis, at: slabs.start(axis, i), bounds, counts, cost });
                }
            }
        }
        best
    }
}
