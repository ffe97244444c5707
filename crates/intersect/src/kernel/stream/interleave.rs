//! Many single rays at once in one thread: dozens of walks take turns, one step each, so that the
//! processor always has another ray to work on while one waits for memory or for a long chain of
//! operations. Rays do not influence each other, but those that start one after another may take
//! their first steps together ([`super::shared_start`]).

use super::shared_start::{SHARED_RAYS, Trial, shared_start};
use super::slot::{Enters, Slot, Slots};
use crate::kernel::Goal;
use crate::kernel::list::Unresolved;
use crate::kernel::single::traverse::{Entry, search_forest};
use crate::precision::Facts;
use crate::prefetch::fetch;
use crate::search::answers::Answers;
use crate::search::rays::Rays;
use crate::search::{Context, RayOf, Search};
use crate::tree::Forest;
use crate::tree::SMALL_STACK;
use crate::tree::may_search;
use crate::tree::node::ChildRef;
#[cfg(target_arch = "x86_64")]
use snell_math::simd::{Avx2, Avx8, Token};
use snell_math::simd::{Lanes8, Level, Portable, Portable8, Wide};
use std::mem::MaybeUninit;

/// The largest number of rays in flight. When [`SHARED_RAYS`] of them have finished, others start.
const SLOTS: usize = 48;

/// Batches of fewer rays are not worth it.
const MIN_RAYS: usize = 16;

/// Forests of more bytes are fetched ahead: much of them is not in the second cache. (It costs a
/// little in smaller ones.)
const FETCHED_BYTES: usize = 8 << 20;

/// See [`pays_to_sort`]: rays that start together in one register are worth more if neighbours
/// start near each other.
const SORTED_BYTES: usize = 32 << 20;
const SORTED_BYTES_AVX512: usize = 128 << 10;

/// Rays to search for, and what is common to them.
pub(crate) struct Batch<'a, P: Facts> {
    pub rays: Rays<'a, P>,
    pub context: &'a Context<'a, P>,
    /// In which order to search for them: their numbers, or places in `unresolved`; if empty, as
    /// they are.
    pub order: &'a [u32],
    /// The rays to search for, if these are not all from the beginning.
    pub unresolved: Option<&'a [Unresolved<P::Hit>]>,
}

impl<'a, P: Facts> Batch<'a, P> {
    /// All of these rays, from the beginning.
    pub fn new(rays: Rays<'a, P>, context: &'a Context<'a, P>) -> Self {
        Self { rays, context, order: &[], unresolved: None }
    }

    /// The number of searches.
    fn len(&self) -> usize {
        self.unresolved.map_or(self.rays.len(), <[_]>::len)
    }

    /// The `i`-th ray: its number and its search. Prefetches the memory of a later ray and of its
    /// result.
    #[inline(always)]
    fn get<G>(
        &self,
        i: usize,
        answers: &impl Answers<G>,
    ) -> (usize, Option<&'a Unresolved<P::Hit>>) {
        if !self.order.is_empty()
            && let Some(&later) = self.order.get(i + SHARED_RAYS)
        {
            let later =
                self.unresolved.map_or(later, |unresolved| unresolved[later as usize].number);
            fetch(self.rays.rays().as_ptr().wrapping_add(later as usize));
            answers.fetch(later as usize);
        }
        let place = if self.order.is_empty() { i } else { self.order[i] as usize };
        match self.unresolved {
            Some(unresolved) => (unresolved[place].number as usize, Some(&unresolved[place])),
            None => (place, None),
        }
    }
}

/// True if forests are so large that rays should be in an order. (In smaller ones, sorting costs
/// more than it saves.)
pub(crate) fn pays_to_sort<G: Goal>(forest: &Forest, wide: Option<Wide>) -> bool {
    let is_widest = Level::of(wide) == Level::Avx512;
    let least = if G::WANTS_ONE && is_widest { SORTED_BYTES_AVX512 } else { SORTED_BYTES };
    forest.memory_bytes() > least
}

/// True if walks through the forest fit the stacks of this kernel, and it has something to
/// interleave.
pub(crate) fn is_suitable(forest: &Forest, rays: usize) -> bool {
    let tree = &forest.trees[0];
    rays >= MIN_RAYS && tree.unbounded.is_empty() && may_search(forest)
}

/// Searches for every ray of a batch; `answers` get the number of a ray and what was found, in no
/// particular order.
pub(crate) fn search_batch<G: Goal>(
    forest: &Forest,
    wide: Option<Wide>,
    batch: &Batch<G::Precision>,
    start: impl Fn(&RayOf<G>) -> G,
    answers: impl Answers<G>,
) {
    debug_assert!(is_suitable(forest, batch.rays.len()) || batch.unresolved.is_some());
    match wide {
        #[cfg(target_arch = "x86_64")]
        Some(wide) => {
            let token = Avx2::from(wide);
            token.run(
                #[inline(always)]
                move || run::<Avx8, G>(token, forest, Some(wide), batch, start, answers),
            );
        }
        // (Without registers of many lanes, rays are as fast one by one.)
        _ => run::<Portable8, G>(Portable, forest, None, batch, start, answers),
    }
}

/// The loop over all rays in flight: first a step for each that is at a node, then one for each
/// that is at a leaf or done.
#[inline(always)]
fn run<L: Lanes8, G: Goal>(
    token: L::Token,
    forest: &Forest,
    wide: Option<Wide>,
    batch: &Batch<G::Precision>,
    start: impl Fn(&RayOf<G>) -> G,
    mut answers: impl Answers<G>,
) {
    let tree = &forest.trees[0];
    let prefetch = forest.memory_bytes() > FETCHED_BYTES;
    let mut below = [const { MaybeUninit::<Entry>::uninit() }; SMALL_STACK];
    let slots = Slots::<G>::new(SLOTS.min(batch.len()), forest.stack_size());
    let mut items: [Items<*mut Slot<G>>; 3] =
        [const { [const { MaybeUninit::uninit() }; SLOTS + 1] }; 3];
    let [nodes, rest, mut idle] = items.each_mut().map(|items| Queue { items, count: 0 });
    let mut hopeful_items: Items<(*mut Slot<G>, u32, u32)> =
        [const { MaybeUninit::uninit() }; SLOTS + 1];
    let mut hopeful = Queue { items: &mut hopeful_items, count: 0 };
    // The state that a step leaves for the next.
    let (mut enters, mut found) = ([Enters([0.0; 8]); SLOTS], [0; SLOTS]);
    let mut queues = Queues { nodes, rest };
    let mut other_slots: Items<*mut Slot<G>> = [const { MaybeUninit::uninit() }; SLOTS + 1];
    let (mut leaf_slots, mut return_slots, mut object_slots) =
        (other_slots, other_slots, other_slots);
    for i in 0..slots.len() {
        // SAFETY: there are no more slots than items.
        unsafe { idle.put(slots.get(i), true) };
    }
    let from = if batch.unresolved.is_some() { tree.rest } else { tree.root };
    let (mut number, mut trial) = (0, Trial::default());
    loop {
        // Rays that start, some at a time.
        while number < batch.len()
            && idle.count >= SHARED_RAYS.min(batch.len() - number).min(slots.len())
        {
            let mut started: [*mut Slot<G>; SHARED_RAYS] = [std::ptr::null_mut(); SHARED_RAYS];
            let mut count = 0;
            while count < SHARED_RAYS && number < batch.len() && idle.count > 0 {
                let (ray, unresolved) = batch.get(number, &answers);
                number += 1;
                let query = batch.rays.get(ray);
                let search = || {
                    let mut goal = start(query.ray);
                    if let Some(hit) = unresolved.and_then(|unresolved| unresolved.hit) {
                        goal.take(hit);
                    }
                    Search::new(query, batch.context, goal)
                };
                // SAFETY: slots that are idle are in no other queue.
                unsafe {
                    let slot = idle.get(idle.count - 1);
                    if (*slot).start::<L>(tree, from, ray, batch.context.data, search, query.ray) {
                        idle.count -= 1;
                        started[count] = slot;
                        count += 1;
                    } else {
                        answers.put(ray, search_alone(forest, wide, search()));
                    }
                }
            }
            let started = &started[..count];
            if let Some(wide) = wide
                && G::WANTS_ONE
                && count != 0
                && trial.is_on()
            {
                // SAFETY: they have just started.
                trial.count(count, unsafe { shared_start(wide, started) });
            }
            for &slot in started {
                // SAFETY: slots that have started are in no queue.
                unsafe {
                    if prefetch {
                        (*slot).fetch_ahead();
                    }
                    queues.put(slot, (*slot).current);
                }
            }
        }
        if queues.is_empty() || batch.context.is_cancelled() {
            break;
        }
        // SAFETY: the queues hold slots, each at most once, which have a search, and are at what
        // their queue says; a walk holds at most 7 entries per level and `is_suitable` has counted
        // them.
        unsafe {
            // Leaves apart from the others.
            let (mut leaves, mut others) = (0, 0);
            for i in 0..queues.rest.take() {
                let slot = queues.rest.get(i);
                let is_leaf = (*slot).current.is_triangles();
                leaf_slots.get_unchecked_mut(leaves).write(slot);
                leaves += usize::from(is_leaf);
                if !prefetch {
                    (*slot).fetch_leaf();
                }
                other_slots.get_unchecked_mut(others).write(slot);
                others += usize::from(!is_leaf);
            }
            let count = queues.nodes.take();
            for i in 0..count {
                *found.get_unchecked_mut(i) =
                    (*queues.nodes.get(i)).boxes_step::<L>(token, enters.get_unchecked_mut(i));
            }
            for i in 0..count {
                let slot = queues.nodes.get(i);
                Slot::push_step::<L>(slot, token, *found.get_unchecked(i), enters.get_unchecked(i));
                if prefetch {
                    (*slot).fetch_ahead();
                }
                queues.put(slot, (*slot).current);
            }
            for i in 0..leaves {
                *found.get_unchecked_mut(i) =
                    (*leaf_slots.get_unchecked(i).assume_init()).leaf_step::<L>(token);
            }
            for i in 0..leaves {
                let (slot, lanes) =
                    (leaf_slots.get_unchecked(i).assume_init(), *found.get_unchecked(i));
                let block = Slot::leave_leaf(slot);
                if prefetch {
                    (*slot).fetch_ahead();
                    (*slot).fetch_triangles(forest, lanes, block);
                }
                let (is_hopeful, is_node) = (lanes != 0, (*slot).current.is_node());
                hopeful.put((slot, lanes, block), is_hopeful);
                queues.nodes.put(slot, is_node & !is_hopeful);
                queues.rest.put(slot, !is_node & !is_hopeful);
            }
            for i in 0..hopeful.take() {
                let (slot, lanes, block) = hopeful.get(i);
                Slot::triangles_step(slot, forest, lanes, block);
                queues.put(slot, (*slot).current);
            }
            // Those at an end to the front, the others apart again.
            let (mut ends, mut returns, mut objects) = (0, 0, 0);
            for i in 0..others {
                let slot = other_slots.get_unchecked(i).assume_init();
                let (is_object, is_return) =
                    ((*slot).current.is_object(), (*slot).current == ChildRef::RETURN);
                other_slots.get_unchecked_mut(ends).write(slot);
                ends += usize::from(!is_object & !is_return);
                return_slots.get_unchecked_mut(returns).write(slot);
                returns += usize::from(is_return);
                object_slots.get_unchecked_mut(objects).write(slot);
                objects += usize::from(is_object);
            }
            for i in 0..returns {
                let slot = return_slots.get_unchecked(i).assume_init();
                Slot::leave_instance(slot);
                if prefetch {
                    (*slot).fetch_ahead();
                }
                queues.put(slot, (*slot).current);
            }
            for i in 0..objects {
                (*object_slots.get_unchecked(i).assume_init()).fetch_object(forest);
            }
            for i in 0..objects {
                let slot = object_slots.get_unchecked(i).assume_init();
                Slot::object_step::<L>(slot, token, forest, &mut below);
                if prefetch {
                    (*slot).fetch_ahead();
                }
                queues.put(slot, (*slot).current);
            }
            for i in 0..ends {
                let slot = other_slots.get_unchecked(i).assume_init();
                if let Some(search) = (*slot).search.take() {
                    answers.put((*slot).number, search.goal);
                }
                idle.put(slot, true);
            }
        }
    }
}

/// A ray that is not ordinary.
#[cold]
#[inline(never)]
fn search_alone<G: Goal>(forest: &Forest, wide: Option<Wide>, mut search: Search<G>) -> G {
    search_forest(forest, wide, &mut search);
    search.goal
}

/// The memory of a queue: all slots and one more.
type Items<T> = [MaybeUninit<T>; SLOTS + 1];

/// Slots in order of arrival; read and rewritten in one pass. (Items and count are apart, so that
/// the count stays in a register.)
struct Queue<'a, T> {
    items: &'a mut Items<T>,
    count: usize,
}

impl<T: Copy> Queue<'_, T> {
    /// Writes an item, and counts it or not: no branch on data.
    ///
    /// # Safety
    /// The queue must have at most as many items as there are [`SLOTS`].
    #[inline(always)]
    unsafe fn put(&mut self, item: T, counts: bool) {
        // SAFETY: as promised by the caller.
        unsafe { self.items.get_unchecked_mut(self.count).write(item) };
        self.count += usize::from(counts);
    }

    /// Empties the queue and returns the number of its items; they can be read until that many are
    /// put.
    #[inline(always)]
    fn take(&mut self) -> usize {
        std::mem::take(&mut self.count)
    }

    /// # Safety
    /// `i` must be less than what [`Self::take`] gave, and at most `i` items put since.
    #[inline(always)]
    unsafe fn get(&self, i: usize) -> T {
        // SAFETY: as promised by the caller.
        unsafe { self.items.get_unchecked(i).assume_init() }
    }
}

/// The slots by what they do next.
struct Queues<'a, T> {
    nodes: Queue<'a, T>,
    rest: Queue<'a, T>,
}

impl<T: Copy> Queues<'_, T> {
    /// Puts a slot where it belongs.
    ///
    /// # Safety
    /// There must be fewer items in all than there are [`SLOTS`].
    #[inline(always)]
    unsafe fn put(&mut self, item: T, current: ChildRef) {
        // SAFETY: as promised by the caller.
        unsafe {
            self.nodes.put(item, current.is_node());
            self.rest.put(item, !current.is_node());
        }
    }

    fn is_empty(&self) -> bool {
        self.nodes.count + self.rest.count == 0
    }
}
