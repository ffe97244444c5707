//! The first steps of rays that start near each other, for a packet of up to [`SHARED_RAYS`] at
//! once.
//!
//! Even incoherent rays visit mostly the nodes around their origins, which neighbouring rays have
//! in common. So the boxes of such a node are tested for sixteen rays in lanes. The few leaves and
//! nodes that remain for each ray are passed to its slot in the order of its own distances, where
//! its traversal continues alone. Visits of nodes that contain a ray's origin are never wasted,
//! since its limit cannot be nearer; those of nodes that half of a packet hits seldom are.
//!
//! (Packets of rays that part when few are left are known: Benthin, Wald, Woop, Ernst and Mark,
//! Combining Single and Packet-Ray Tracing for Arbitrary Ray Distributions on the Intel MIC
//! Architecture, 2012. Here no triangle is tested before they part, and no order is common to them,
//! so that directions do not matter.)

#[cfg(test)]
mod tests;

use super::slot::Walk;
use crate::exact::prepared::FAR_FACTOR;
use crate::kernel::Goal;
use crate::kernel::columns::columns;
use crate::tree::node::{ChildRef, WideNode};
#[cfg(target_arch = "x86_64")]
use snell_math::simd::Avx16;
use snell_math::simd::{Lanes8, Lanes16, Pair, Token, Wide, Wide8, WideLanes, WideToken};
use std::array::from_fn;
use std::mem::MaybeUninit;

/// The largest number of rays that start together.
pub(super) const SHARED_RAYS: usize = 2 * ROW;

/// The number of rays that are tested with a box at once.
const ROW: usize = 16;

/// A node is visited together if at least this number of rays start in it and hit it.
const MIN_INSIDE: u32 = 8;
/// A node is also visited together if at least this number of rays hit it.
const MIN_MET: u32 = 16;

/// The largest number of nodes and leaves that are left to the rays of a packet, limited by the
/// tags.
const MAX_LEFT: usize = 32;

/// The largest number of nodes and leaves that are left to one ray. (A ray with more starts alone.)
const MAX_OWN: usize = 8;

/// Smaller distances are replaced by this one, so that a distance with a tag is never subnormal.
const LEAST: f32 = 1.0e-30;

/// The relative amount by which a distance with a tag is reduced, so that it is not above the
/// distance without the tag: tags are below 32 units in the last place, and the rest is for
/// rounding errors of the reduction.
const TAG_PADDING: f32 = 8.0e-6;

/// Rays whose distances may be off by this much or more start alone: those that run along an axis.
const MAX_MARGIN: f32 = 1.0e20;

/// Lets walks make their first steps together. Returns the number of visits of nodes, summed over
/// the rays. Walks of rays that do not take part stay where they are.
///
/// # Safety
/// There must be one to [`SHARED_RAYS`] walks, which have [started](Walk::start) at the same
/// reference and made no step.
#[inline(always)]
pub(super) unsafe fn shared_start<G: Goal>(wide: Wide, walks: &mut [Walk<G>]) -> u32 {
    match wide {
        #[cfg(target_arch = "x86_64")]
        Wide::Avx512(token) => token.run(
            #[inline(always)]
            // SAFETY: these are the walks of the caller, who promises the same of them.
            move || unsafe { shared_start_with::<Avx16, G>(token, walks) },
        ),
        wide => {
            let token = WideToken::from(wide);
            token.run(
                #[inline(always)]
                // SAFETY: these are the walks of the caller, who promises the same of them.
                move || unsafe { shared_start_with::<Pair<Wide8>, G>(token, walks) },
            )
        }
    }
}

/// [`shared_start`] with rays that are prepared for [`Lanes8::FUSED`] of these lanes.
///
/// # Safety
/// As [`shared_start`].
#[inline(always)]
unsafe fn shared_start_with<W: Lanes16, G: Goal>(token: W::Token, walks: &mut [Walk<G>]) -> u32 {
    debug_assert!((1..=SHARED_RAYS).contains(&walks.len()));
    // SAFETY: there are one to 32 walks by the caller's promise, so a second row begins after the
    // sixteenth if there are more, and no row is empty.
    unsafe {
        if walks.len() > ROW {
            let (first, second) = walks.split_at_unchecked(ROW);
            let rows = [Row::<W>::new(token, first), Row::new(token, second)];
            start_rows(token, walks, rows)
        } else {
            let rows = [Row::<W>::new(token, walks)];
            start_rows(token, walks, rows)
        }
    }
}

/// [`shared_start`] with the walks' rays in rows of sixteen.
///
/// # Safety
/// As [`shared_start`]; the rows must be those of the walks.
#[inline(always)]
unsafe fn start_rows<W: Lanes16, G: Goal, const N: usize>(
    token: W::Token,
    walks: &mut [Walk<G>],
    rows: [Row<W>; N],
) -> u32 {
    let mut left = Left::NONE;
    // SAFETY: there is a first walk by the caller's promise, and it has made no step. All of a row
    // but the last has sixteen walks, so that `ROW * i` is within them, and those from there on
    // are the lanes of the row. What is left are references below the node where all of them start.
    unsafe {
        let visits = visit(walks.get_unchecked(0), &rows, &mut left);
        if visits != 0 {
            for (i, row) in rows.iter().enumerate() {
                hand_out(token, walks.get_unchecked_mut(ROW * i..), row, &left, i);
            }
        }
        visits
    }
}

/// A number for each lane.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct PerLane([f32; ROW]);

/// Sixteen rays, prepared for tests with boxes.
struct Row<W> {
    inverse: [W; 3],
    /// The offsets of [`crate::exact::prepared::PreparedRay::near`] and `far`, but rounded to
    /// neither side.
    offset: [W; 3],
    t_min: W,
    /// The padded limits of the searches, plus `margin`.
    cull: W,
    /// A bound on the error of the distances, which are not rounded to the safe side.
    margin: W,
    /// The lanes whose rays take part: a bit each.
    rays: u32,
}

impl<W: Lanes16> Row<W> {
    /// The rays of the first sixteen walks.
    ///
    /// # Safety
    /// There must be a walk.
    #[inline(always)]
    unsafe fn new<G: Goal>(token: W::Token, walks: &[Walk<G>]) -> Self {
        let mut slabs = [[&[0.0; 8]; 2]; ROW];
        for (lane, slabs) in slabs.iter_mut().enumerate() {
            // (Lanes without a ray have the first one.)
            // SAFETY: the number is below that of the walks, or 0, and the caller promises a walk.
            let walk = unsafe { walks.get_unchecked(if lane < walks.len() { lane } else { 0 }) };
            *slabs = walk.rows();
        }
        let rows = |side: usize, from: usize| from_fn(|i| slabs[from + i][side]);
        let [t_min, cull, _, _, _, _, i, j] = columns::<W>(token, rows(0, 0), rows(0, 8));
        let [k, a, b, c, d, e, f, _] = columns::<W>(token, rows(1, 0), rows(1, 8));
        let (inverse, near, far) = ([i, j, k], [a, b, c], [d, e, f]);
        let half = W::splat(token, 0.5);
        let offset = [
            near[0].add(far[0]).mul(half),
            near[1].add(far[1]).mul(half),
            near[2].add(far[2]).mul(half),
        ];
        // The margin is twice as large as it must be, and boxes that are left before the least
        // distance are met, too.
        let mut margin = W::splat(token, LEAST);
        for axis in 0..3 {
            let side = far[axis].sub(near[axis]).abs();
            margin = margin.max(if Self::FUSED { side } else { side.mul(inverse[axis].abs()) });
        }
        let rays =
            margin.lt(W::splat(token, MAX_MARGIN)) & (0xffff >> (ROW - walks.len().min(ROW)));
        let t_min = t_min.max(W::splat(token, LEAST));
        Self { inverse, offset, t_min, cull: cull.add(margin), margin, rays }
    }

    const FUSED: bool = <W::Half as Lanes8>::FUSED;

    /// The entry distances of the rays into a box of a node, and the rays that hit it. (An inverted
    /// box is hit, unlike elsewhere.)
    #[inline(always)]
    fn meet(&self, node: &WideNode, slot: usize) -> (W, u32) {
        let [low, high] = &node.bounds;
        let (low, high) = (self.crossings(low, slot), self.crossings(high, slot));
        let enter =
            (low[0].min(high[0])).max(low[1].min(high[1])).max(low[2].min(high[2]).max(self.t_min));
        let leave = (low[0].max(high[0])).min(low[1].max(high[1])).min(low[2].max(high[2]));
        let factor = W::splat(self.t_min.token(), FAR_FACTOR);
        let leave = leave.mul_add(factor, self.margin.add(self.margin)).min(self.cull);
        (enter, enter.le(leave))
    }

    /// The distances at which the rays cross one of eight planes on each axis.
    #[inline(always)]
    fn crossings(&self, [x, y, z]: &[[f32; 8]; 3], slot: usize) -> [W; 3] {
        let (token, slot) = (self.t_min.token(), slot & 7);
        let [x, y, z] =
            [W::splat(token, x[slot]), W::splat(token, y[slot]), W::splat(token, z[slot])];
        let ([i, j, k], [a, b, c]) = (self.inverse, self.offset);
        if Self::FUSED {
            [x.mul_add(i, a), y.mul_add(j, b), z.mul_add(k, c)]
        } else {
            [x.sub(a).mul(i), y.sub(b).mul(j), z.sub(c).mul(k)]
        }
    }
}

/// The nodes and leaves that a shared start leaves to the rays.
struct Left<const N: usize> {
    count: usize,
    children: Aligned<[u32; MAX_LEFT]>,
    /// For each child, the distances at which the rays enter its box.
    enters: [MaybeUninit<[PerLane; N]>; MAX_LEFT],
    /// For each child, the rays that enter its box: sixteen bits a row.
    masks: [MaybeUninit<u32>; MAX_LEFT],
}

#[repr(C, align(64))]
struct Aligned<T>(T);

impl<const N: usize> Left<N> {
    const NONE: Self = Self {
        count: 0,
        children: Aligned([0; MAX_LEFT]),
        enters: [const { MaybeUninit::uninit() }; MAX_LEFT],
        masks: [MaybeUninit::uninit(); MAX_LEFT],
    };
}

/// Visits the root and all nodes below it that have enough rays, in no particular order, and writes
/// the children that are left to `left`. Returns the number of visits, summed over the rays.
///
/// # Safety
/// The walk must have made no step.
#[inline(always)]
unsafe fn visit<W: Lanes16, G: Goal, const N: usize>(
    walk: &Walk<G>,
    rows: &[Row<W>; N],
    left: &mut Left<N>,
) -> u32 {
    let rays = rows.iter().enumerate().fold(0, |rays, (i, row)| rays | row.rays << (ROW * i));
    let (root, nodes) = (walk.current(), &*walk.tree().nodes);
    if !root.is_node() || rays.count_ones() < MIN_INSIDE {
        return 0;
    }
    // The queue is a ring: because of `has_room` it never holds more nodes than this.
    const QUEUE: usize = MAX_LEFT / 8;
    let mut queue = [const { MaybeUninit::<(u32, u32)>::uninit() }; QUEUE];
    queue[0].write((root.0, rays));
    let (mut next, mut end, mut count, mut visits) = (0, 1, 0, 0);
    while next < end {
        // SAFETY: items before `end` are written. They are the root, which is a node, and children
        // that are nodes, so the tree has them. `has_room` keeps eight places of `left` for the
        // children of this node, and of each node that is queued: `count` stays below `MAX_LEFT`.
        unsafe {
            let (node, those) = queue[next % QUEUE].assume_init();
            let node = nodes.get_unchecked(node as usize);
            visits += those.count_ones();
            for (number, &child) in node.children.iter().enumerate() {
                let (mut met, mut inside) = (0, 0);
                let enters = left.enters.get_unchecked_mut(count).as_mut_ptr().cast::<PerLane>();
                for (i, row) in rows.iter().enumerate() {
                    let (enter, rays) = row.meet(node, number);
                    met |= rays << (ROW * i);
                    inside |= enter.le(row.t_min) << (ROW * i);
                    enter.store(&mut (*enters.add(i)).0);
                }
                // (No branches: neither whether a child is met nor what becomes of it can be
                // foreseen.)
                met &= those & u32::from(child == ChildRef::NONE).wrapping_sub(1);
                let has_room = count + 8 * (end - next) <= MAX_LEFT - 8;
                let is_common =
                    ((inside & met).count_ones() >= MIN_INSIDE) | (met.count_ones() >= MIN_MET);
                let expands = child.is_node() & is_common & has_room;
                queue[end % QUEUE].write((child.0, met));
                end += usize::from(expands);
                *left.children.0.get_unchecked_mut(count) = child.0;
                left.masks.get_unchecked_mut(count).write(met);
                count += usize::from(!expands & (met != 0));
            }
            next += 1;
        }
    }
    left.count = count;
    visits
}

/// Gives each ray of a row what is left to it, the nearest last.
///
/// # Safety
/// Each lane of [`Row::rays`] must have a walk, which has made no step. Row `number` of `left` must
/// be what is left to the rays of the row: references below the node where the walks have started,
/// none below another.
#[inline(always)]
unsafe fn hand_out<W: Lanes16, G: Goal, const N: usize>(
    token: W::Token,
    walks: &mut [Walk<G>],
    row: &Row<W>,
    left: &Left<N>,
    number: usize,
) {
    // SAFETY: `visit` writes distances and masks below `count`, for all rows. Bits of `row.rays`
    // are lanes with a walk that has made no step, and tags are numbers of references in `left`,
    // all by the caller's promise.
    unsafe {
        // By lane: distances in falling order, each with its number as a tag; below zero where
        // there is none.
        let (none, zero) = (W::splat(token, -1.0), W::splat(token, 0.0));
        let (mut own, mut lost) = ([none; MAX_OWN], none);
        for i in 0..left.count {
            let enter = W::load(token, &left.enters.get_unchecked(i).assume_init_ref()[number].0);
            let met = left.masks.get_unchecked(i).assume_init() >> (ROW * number) & 0xffff;
            let mut entry = none.replace(met, enter.with_tag(i as u32));
            for place in &mut own {
                (*place, entry) = (place.max(entry), place.min(entry));
            }
            lost = lost.max(entry);
        }
        let mut sorted = [const { PerLane([0.0; ROW]) }; MAX_OWN];
        for (to, place) in sorted.iter_mut().zip(own) {
            place.store(&mut to.0);
        }
        let mut margins = PerLane([0.0; ROW]);
        row.margin.store(&mut margins.0);
        let half_token: <W::Half as Lanes8>::Token = W::half_token(token);
        let columns = |half: usize| {
            W::Half::load_columns(half_token, from_fn(|i| &sorted[i].0.as_chunks::<8>().0[half]))
        };
        let entries = [columns(0), columns(1)];
        let entries = entries.as_flattened();
        let mut rays = row.rays & !zero.le(lost);
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize & (ROW - 1);
            rays &= rays - 1;
            let margin = W::Half::splat(half_token, margins.0[lane] + 2.0 * LEAST);
            let scale = W::Half::splat(half_token, 1.0 - TAG_PADDING);
            let distances = entries[lane].mul(scale).sub(margin);
            walks.get_unchecked_mut(lane).go_on_with(entries[lane], distances, &left.children.0);
        }
    }
}

/// Decides whether a shared start pays: it does if rays have many visits in common, and
/// neighbouring packets are similar.
#[derive(Default)]
pub(super) struct Trial {
    /// The number of packets that start ray by ray before a shared start is tried again.
    rest: u32,
}

impl Trial {
    /// The number of packets to skip after one for which it did not pay.
    const REST: u32 = 3;

    /// The least number of shared visits per ray for which a shared start pays: they take as long
    /// as two or three visits of a ray alone.
    const MIN_VISITS: u32 = 3;

    /// True if the next packet should start together.
    #[inline(always)]
    pub fn is_on(&mut self) -> bool {
        if self.rest == 0 {
            return true;
        }
        self.rest -= 1;
        false
    }

    /// Updates the decision after a packet.
    #[inline(always)]
    pub fn count(&mut self, rays: usize, visits: u32) {
        if visits < Self::MIN_VISITS * rays as u32 {
            self.rest = Self::REST;
        }
    }
}
