//! Many single rays at once in one thread: sixteen walks take turns, one step each, so that the processor always has another
//! ray to work on while one waits for memory or for a long chain of operations. Rays do not influence each other.

use super::node::{ChildRef, box_distances};
use super::ray::LocalRay;
use super::traverse::{Entry, SMALL_STACK, Stack, Walk, test_object, walk_portable};
use crate::accel::bvh::{Forest, GroupTree};
use crate::accel::group::test_triangle;
use crate::precision::Rules;
use crate::query::rays::Rays;
use crate::query::search::{Context, Goal, RayOf, Search};
use snell_math::simd::{Lanes8, Level, Portable8};
use std::mem::MaybeUninit;

/// Rays in flight.
const SLOTS: usize = 16;

/// Entries of each ray's stack.
const STACK: usize = 256;

/// Trees larger than this are fetched ahead: most of such a tree is not in the caches. (It costs a little in smaller ones.)
const PREFETCH_BYTES: usize = 8 << 20;

/// Rays to search for, and what is common to them.
pub(crate) struct Batch<'a, P: Rules> {
    pub rays: Rays<'a, P>,
    pub context: &'a Context<'a, P>,
}

/// True if the root's tree fits the stacks of this kernel, and it has something to interleave.
pub(crate) fn is_suitable(forest: &Forest, rays: usize) -> bool {
    let tree = &forest.trees[0];
    rays >= SLOTS && tree.root != ChildRef::NONE && tree.root.is_node() && 7 * tree.depth + 16 <= STACK
}

/// Searches for every ray of a batch; `finish` gets the number of a ray and what was found, in no particular order.
pub(crate) fn search_batch<G: Goal>(
    forest: &Forest,
    level: Level,
    batch: &Batch<G::Precision>,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) {
    debug_assert!(is_suitable(forest, batch.rays.len()));
    let mut small = [const { MaybeUninit::<Entry>::uninit() }; SMALL_STACK];
    let mut large =
        vec![MaybeUninit::<Entry>::uninit(); if forest.stack_size > SMALL_STACK { forest.stack_size } else { 0 }];
    let below = if large.is_empty() { &mut small[..] } else { &mut large[..] };
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `World` holds only levels that the machine supports, and `below` has `stack_size` entries.
        Level::Avx2 | Level::Avx512 => unsafe { run_avx2(forest, batch, below, start, finish) },
        // SAFETY: portable code, and `below` has `stack_size` entries.
        _ => unsafe { run::<Portable8, G>(forest, batch, below, start, finish, walk_portable::<G>) },
    }
}

/// # Safety
/// As [`run`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
unsafe fn run_avx2<G: Goal>(
    forest: &Forest,
    batch: &Batch<G::Precision>,
    below: &mut Stack,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) {
    use super::traverse::walk_avx2;
    // SAFETY: as promised by the caller.
    unsafe { run::<snell_math::simd::Avx8, G>(forest, batch, below, start, finish, walk_avx2::<G>) }
}

/// A ray in flight.
struct Slot<'a, G: Goal> {
    search: Search<'a, G>,
    ray: LocalRay,
    /// Padded limit of the search.
    cull: f32,
    octant: usize,
    /// What to visit next.
    current: ChildRef,
    /// Entries on the stack; the lowest one ends the walk.
    top: usize,
    /// Which ray this is.
    number: usize,
    distances: [f32; STACK],
    children: [u32; STACK],
}

impl<G: Goal> Slot<'_, G> {
    /// # Safety
    /// `top` must not be 0: the entry that ends the walk is still there.
    #[inline(always)]
    unsafe fn pop(&mut self) {
        self.top -= 1;
        // SAFETY: `top` was between 1 and the size of the stack.
        self.current = ChildRef(unsafe { *self.children.get_unchecked(self.top) });
    }

    /// Tests the boxes of the current node and goes on to the nearest that is met.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; the current reference must be a node of the tree, and the stack must
    /// have room for eight more entries.
    #[inline(always)]
    unsafe fn node_step<L: Lanes8>(&mut self, tree: &GroupTree, prefetch: bool) {
        self.search.goal.count_node();
        // SAFETY: as promised by the caller. References are plain `u32`, and `top` is at least 1.
        unsafe {
            let node = tree.nodes.get_unchecked(self.current.index());
            let (enter, limit) = box_distances::<L>(node, &self.ray, self.search.start, self.cull);
            let values = &mut *self.distances.as_mut_ptr().add(self.top).cast::<[f32; 8]>();
            let children = &mut *self.children.as_mut_ptr().add(self.top).cast::<[u32; 8]>();
            let payload = &*node.children.as_ptr().cast::<[u32; 8]>();
            self.top += enter.compress_le(limit, *node.order.get_unchecked(self.octant), payload, values, children);
            self.pop();
        }
        if prefetch {
            fetch_ahead(tree, self.current);
        }
    }

    /// Tests the triangles of the current leaf. True if the search is over.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; the current reference must be a block of the tree.
    #[inline(always)]
    unsafe fn triangles_step<L: Lanes8>(&mut self, tree: &GroupTree) -> bool {
        // SAFETY: as promised by the caller.
        let (block, mut mask) = unsafe {
            let block = tree.blocks.get_unchecked(self.current.block());
            (block, G::Precision::candidates::<L>(block, &self.ray, self.search.start, self.cull))
        };
        let count = self.current.count();
        self.search.goal.count_primitives(count);
        mask &= (2 << (count - 1)) - 1;
        let mut over = false;
        while mask != 0 && !over {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let ids = || {
                let (geometry, primitive) = tree.triangle(block.ids[lane & 7]);
                [0, geometry, primitive]
            };
            over = test_triangle(&mut self.search, &self.ray, &block.corners(lane), ids);
        }
        over
    }

    /// After hits: a new limit, and the stack without what lies beyond it.
    #[inline(always)]
    fn tighten(&mut self) {
        let cull = self.search.cull();
        if cull < self.cull {
            self.cull = cull;
            let mut kept = 1;
            for i in 1..self.top {
                self.distances[kept] = self.distances[i];
                self.children[kept] = self.children[i];
                kept += usize::from(self.distances[i] <= cull);
            }
            self.top = kept;
        }
    }
}

/// Asks for the memory of a node or block.
#[inline(always)]
fn fetch_ahead(tree: &GroupTree, child: ChildRef) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let (start, lines): (*const i8, usize) = if child.is_node() {
            (tree.nodes.as_ptr().wrapping_add(child.index()).cast(), 4)
        } else {
            (tree.blocks.as_ptr().wrapping_add(child.block()).cast(), 5)
        };
        for line in 0..lines {
            // SAFETY: asking ahead reads nothing: any address will do.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (tree, child);
}

/// The loop over all rays in flight: first a step for each that is at a node, then one for each that is at a leaf or done.
///
/// # Safety
/// The machine must have the instructions of `L`; [`is_suitable`] must hold; `below` must have room for all groups; `enter` must be
/// the entry of the same level.
#[inline(always)]
unsafe fn run<L: Lanes8, G: Goal>(
    forest: &Forest,
    batch: &Batch<G::Precision>,
    below: &mut Stack,
    start: impl Fn(&RayOf<G>) -> G,
    mut finish: impl FnMut(usize, G),
    enter: Walk<G>,
) {
    let tree = &forest.trees[0];
    let prefetch = tree.memory_bytes() > PREFETCH_BYTES;
    let mut numbers = 0..batch.rays.len();
    let mut slots: Vec<Slot<G>> = Vec::with_capacity(SLOTS);
    // The slots at nodes, and those elsewhere.
    let (mut nodes, mut others) = ([0u8; SLOTS + 1], [0u8; SLOTS + 1]);
    let (mut node_count, mut other_count) = (0, 0);
    // The next search that needs a walk; those that do not are finished at once.
    let mut next = |below: &mut Stack, finish: &mut dyn FnMut(usize, G)| loop {
        let number = numbers.next()?;
        let query = batch.rays.get(number);
        let ray = query.ray;
        let mut search = Search::new(query, batch.context, start(ray));
        let over = !G::Precision::is_valid(ray)
            || tree.unbounded.iter().any(|&object| {
                // SAFETY: as promised by the caller.
                unsafe {
                    test_object(forest, tree, object as usize, &G::Precision::exact(ray), 0, &mut search, below, enter)
                }
            });
        if !over {
            return Some((number, search));
        }
        finish(number, search.goal);
    };
    while slots.len() < SLOTS {
        let Some((number, search)) = next(below, &mut finish) else { break };
        let ray = G::Precision::local_ray(batch.context.data, 0, &G::Precision::exact(search.ray));
        nodes[node_count] = slots.len() as u8;
        node_count += 1;
        let (cull, octant) = (search.cull(), ray.octant());
        let mut children = [0; STACK];
        children[0] = ChildRef::NONE.0;
        let distances = [0.0; STACK];
        slots.push(Slot { search, ray, cull, octant, current: tree.root, top: 1, number, distances, children });
    }
    while node_count + other_count > 0 {
        let mut kept = 0;
        for i in 0..node_count {
            let at = nodes[i];
            // SAFETY: the queues hold numbers of slots; slots of `nodes` are at nodes; a walk holds at most 7 entries per level and
            // `is_suitable` has counted them.
            let slot = unsafe {
                let slot = slots.get_unchecked_mut(usize::from(at));
                slot.node_step::<L>(tree, prefetch);
                slot
            };
            let is_node = slot.current.is_node();
            // Written to both queues, counted in one: no branch on data.
            nodes[kept] = at;
            kept += usize::from(is_node);
            others[other_count] = at;
            other_count += usize::from(!is_node);
        }
        node_count = kept;
        let mut kept = 0;
        for i in 0..other_count {
            let at = others[i];
            // SAFETY: as above.
            let slot = unsafe { slots.get_unchecked_mut(usize::from(at)) };
            let mut over = slot.current == ChildRef::NONE;
            if slot.current.is_triangles() {
                // SAFETY: the builder makes only references to blocks that exist; `L` as promised by the caller.
                over = unsafe { slot.triangles_step::<L>(tree) };
            } else if !over {
                let (object, exact) = (slot.current.index(), slot.ray.exact);
                // SAFETY: as promised by the caller.
                over = unsafe { test_object(forest, tree, object, &exact, 0, &mut slot.search, below, enter) };
            }
            if !over {
                slot.tighten();
                // SAFETY: the entry that ends the walk is below all others, and it was not popped yet.
                unsafe { slot.pop() };
                if prefetch {
                    fetch_ahead(tree, slot.current);
                }
            } else {
                let (number, search) = (slot.number, next(below, &mut finish));
                let Some((new, search)) = search else {
                    // Nothing left to start: the slot stays out of both queues.
                    let ended = std::mem::replace(&mut slot.search.goal, start(slot.search.ray));
                    finish(number, ended);
                    continue;
                };
                slot.ray = G::Precision::local_ray(batch.context.data, 0, &G::Precision::exact(search.ray));
                (slot.cull, slot.octant) = (search.cull(), slot.ray.octant());
                (slot.current, slot.top, slot.number) = (tree.root, 1, new);
                let ended = std::mem::replace(&mut slot.search, search);
                finish(number, ended.goal);
            }
            let is_node = slot.current.is_node();
            nodes[node_count] = at;
            node_count += usize::from(is_node);
            others[kept] = at;
            kept += usize::from(!is_node);
        }
        other_count = kept;
    }
}
