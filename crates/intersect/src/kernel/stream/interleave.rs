//! Many single rays at once in one thread: dozens of walks take turns, one step each, so that the
//! processor always has another ray to work on while one waits for memory or for a long chain of
//! operations. Rays do not influence each other, but those that start one after another may take
//! their first steps together ([`super::shared_start`]).

use super::shared_start::{SHARED_RAYS, Trial, shared_start};
use super::slot::{Enters, SlotNumber, Slots};
use crate::kernel::Goal;
use crate::kernel::list::Unresolved;
use crate::kernel::single::traverse::{Entry, Stack, search_forest};
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

/// How many rays are in flight at most. When [`SHARED_RAYS`] of them have come to their ends,
/// others start.
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

    /// How many searches there are.
    fn len(&self) -> usize {
        self.unresolved.map_or(self.rays.len(), <[_]>::len)
    }

    /// What is searched for as the `i`-th: the number of the ray, and what is known of it; asks for
    /// the memory of a later ray and of its answer.
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
    let prefetch = forest.memory_bytes() > FETCHED_BYTES;
    let slots = Slots::<G>::new(SLOTS.min(batch.len()), forest.stack_size());
    let mut kernel = Kernel::<L, G> { token, forest, prefetch, slots };
    let mut steps = Steps { enters: [Enters([0.0; 8]); SLOTS], found: [0; SLOTS] };
    let mut below = [const { MaybeUninit::<Entry>::uninit() }; SMALL_STACK];
    let mut items = [[SlotNumber::default(); ROOM]; 7];
    let [nodes, rest, idle, leaves, ends, returns, objects] =
        items.each_mut().map(|items| Queue { items, count: 0 });
    let (mut queues, mut idle) = (Queues { nodes, rest }, idle);
    let (mut leaves, mut others) = (leaves, Others { ends, returns, objects });
    let mut hopeful_items = [Hopeful::default(); ROOM];
    let mut hopeful = Queue { items: &mut hopeful_items, count: 0 };
    kernel.slots.numbers().for_each(|slot| idle.put(slot, true));
    let (mut next, mut trial) = (0, Trial::default());
    loop {
        // Rays that start, some at a time.
        while next < batch.len() {
            let packet = SHARED_RAYS.min(batch.len() - next).min(kernel.slots.len());
            if idle.count < packet {
                break;
            }
            let mut started = [SlotNumber::default(); SHARED_RAYS];
            let count =
                kernel.start(wide, batch, &mut next, &start, &mut answers, &mut idle, &mut started);
            kernel.shared_start(wide, &started[..count], &mut trial, &mut queues);
        }
        if queues.is_empty() || batch.context.is_cancelled() {
            break;
        }
        // SAFETY: each slot is in one queue, has a search there, and is at what the queue says.
        unsafe {
            kernel.sort(&mut queues.rest, &mut leaves, &mut others);
            kernel.nodes(&mut steps, &mut queues);
            kernel.leaves(&mut steps, &mut leaves, &mut hopeful, &mut queues);
            kernel.triangles(&mut hopeful, &mut queues);
            kernel.returns(&mut others.returns, &mut queues);
            kernel.objects(&mut others.objects, &mut below, &mut queues);
        }
        for &number in others.ends.take() {
            let mut slot = kernel.slots.at(number);
            if let Some(search) = slot.search.take() {
                answers.put(slot.number, search.goal);
            }
            idle.put(number, true);
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

/// What a step of each leaves for the next.
struct Steps {
    enters: [Enters; SLOTS],
    found: [u32; SLOTS],
}

/// A ray whose leaf has triangles that it may hit: a bit for each, and the number of the block.
#[derive(Clone, Copy, Default)]
struct Hopeful {
    slot: SlotNumber,
    lanes: u32,
    block: u32,
}

/// The rays in flight, and what all of their steps need.
struct Kernel<'f, 'a, L: Lanes8, G: Goal> {
    token: L::Token,
    forest: &'f Forest,
    /// Asks for memory as soon as it is known.
    prefetch: bool,
    slots: Slots<'a, G>,
}

impl<'a, L: Lanes8, G: Goal> Kernel<'_, 'a, L, G> {
    /// Starts the next rays of a batch in slots that are idle, as many as a packet has at most, and
    /// returns how many. What is not ordinary is answered at once.
    #[inline(always)]
    fn start(
        &mut self,
        wide: Option<Wide>,
        batch: &Batch<'a, G::Precision>,
        next: &mut usize,
        start: &impl Fn(&RayOf<G>) -> G,
        answers: &mut impl Answers<G>,
        idle: &mut Queue<SlotNumber>,
        started: &mut [SlotNumber; SHARED_RAYS],
    ) -> usize {
        let tree = &self.forest.trees[0];
        let from = if batch.unresolved.is_some() { tree.rest } else { tree.root };
        let mut count = 0;
        while count < SHARED_RAYS && *next < batch.len() && idle.count > 0 {
            let (ray, unresolved) = batch.get(*next, answers);
            *next += 1;
            let query = batch.rays.get(ray);
            let search = || {
                let mut goal = start(query.ray);
                if let Some(hit) = unresolved.and_then(|unresolved| unresolved.hit) {
                    goal.take(hit);
                }
                Search::new(query, batch.context, goal)
            };
            let slot = idle.items[(idle.count - 1) & (ROOM - 1)];
            let data = batch.context.data;
            if self.slots.at(slot).start::<L>(tree, from, ray, data, search, query.ray) {
                idle.count -= 1;
                started[count] = slot;
                count += 1;
            } else {
                answers.put(ray, search_alone(self.forest, wide, search()));
            }
        }
        count
    }

    /// Puts slots that have just started where they belong, perhaps after first steps that they
    /// take together.
    #[inline(always)]
    fn shared_start(
        &mut self,
        wide: Option<Wide>,
        started: &[SlotNumber],
        trial: &mut Trial,
        queues: &mut Queues,
    ) {
        if let Some(wide) = wide
            && G::WANTS_ONE
            && !started.is_empty()
            && trial.is_on()
        {
            // SAFETY: they have just started, at the same node.
            trial.count(started.len(), unsafe { shared_start(wide, &mut self.slots, started) });
        }
        for &slot in started {
            self.go_on(slot, queues);
        }
    }

    /// Puts a slot where it belongs.
    #[inline(always)]
    fn go_on(&mut self, slot: SlotNumber, queues: &mut Queues) {
        let current = {
            let slot = self.slots.get(slot);
            if self.prefetch {
                slot.fetch_ahead();
            }
            slot.current
        };
        queues.put(slot, current);
    }

    /// Parts those that are not at nodes by what they are at.
    #[inline(always)]
    fn sort(
        &self,
        rest: &mut Queue<SlotNumber>,
        leaves: &mut Queue<SlotNumber>,
        others: &mut Others,
    ) {
        for &number in rest.take() {
            let slot = self.slots.get(number);
            if !self.prefetch {
                slot.fetch_leaf();
            }
            let current = slot.current;
            let (is_leaf, is_object) = (current.is_triangles(), current.is_object());
            let is_return = current == ChildRef::RETURN;
            leaves.put(number, is_leaf);
            others.objects.put(number, is_object);
            others.returns.put(number, is_return);
            others.ends.put(number, !(is_leaf | is_object | is_return));
        }
    }

    /// A step for each that is at a node.
    ///
    /// # Safety
    /// All in the queue must have a search and be at nodes.
    #[inline(always)]
    unsafe fn nodes(&mut self, steps: &mut Steps, queues: &mut Queues) {
        let Steps { enters, found } = steps;
        let (slots, count) = (*queues.nodes.items, queues.nodes.take().len());
        let slots = &slots[..count];
        for ((&slot, enters), found) in slots.iter().zip(&mut *enters).zip(&mut *found) {
            // SAFETY: the caller promises that all have a search and are at nodes.
            *found = unsafe { self.slots.at(slot).boxes_step::<L>(self.token, enters) };
        }
        for ((&slot, enters), &mut found) in slots.iter().zip(enters).zip(found) {
            // SAFETY: they are still at these nodes; a walk holds at most 7 entries per level, and
            // stacks have room for as many and eight.
            unsafe { self.slots.at(slot).push_step::<L>(self.token, found, enters) };
            self.go_on(slot, queues);
        }
    }

    /// A step for each that is at a leaf: most triangles are missed.
    ///
    /// # Safety
    /// All in the queue must have a search and be at leaves.
    #[inline(always)]
    unsafe fn leaves(
        &mut self,
        steps: &mut Steps,
        leaves: &mut Queue<SlotNumber>,
        hopeful: &mut Queue<Hopeful>,
        queues: &mut Queues,
    ) {
        let (slots, found) = (leaves.take(), &mut steps.found);
        for (&slot, found) in slots.iter().zip(&mut *found) {
            // SAFETY: the caller promises that all have a search and are at leaves.
            *found = unsafe { self.slots.at(slot).leaf_step::<L>(self.token) };
        }
        for (&number, &mut lanes) in slots.iter().zip(found) {
            let mut slot = self.slots.at(number);
            // SAFETY: it is still at this leaf, and the lanes are those that were found there.
            let block = unsafe {
                let block = slot.leave_leaf();
                if self.prefetch {
                    slot.fetch_ahead();
                    slot.fetch_triangles(self.forest, lanes, block);
                }
                block
            };
            let (is_hopeful, is_node) = (lanes != 0, slot.current.is_node());
            hopeful.put(Hopeful { slot: number, lanes, block }, is_hopeful);
            queues.nodes.put(number, is_node & !is_hopeful);
            queues.rest.put(number, !is_node & !is_hopeful);
        }
    }

    /// Tests the triangles that were not missed.
    ///
    /// # Safety
    /// All in the queue must have a search, and have come there from a leaf.
    #[inline(always)]
    unsafe fn triangles(&mut self, hopeful: &mut Queue<Hopeful>, queues: &mut Queues) {
        for &Hopeful { slot: number, lanes, block } in hopeful.take() {
            let mut slot = self.slots.at(number);
            // SAFETY: the caller promises that all come from leaves where these lanes were found.
            unsafe { slot.triangles_step(self.forest, lanes, block) };
            queues.put(number, slot.current);
        }
    }

    /// Returns from instances.
    ///
    /// # Safety
    /// All in the queue must be at the end of an instance.
    #[inline(always)]
    unsafe fn returns(&mut self, returns: &mut Queue<SlotNumber>, queues: &mut Queues) {
        for &slot in returns.take() {
            // SAFETY: the caller promises that all are at the end of an instance.
            unsafe { self.slots.at(slot).leave_instance() };
            self.go_on(slot, queues);
        }
    }

    /// Tests shapes, and goes into instances.
    ///
    /// # Safety
    /// All in the queue must have a search and be at objects.
    #[inline(always)]
    unsafe fn objects(
        &mut self,
        objects: &mut Queue<SlotNumber>,
        below: &mut Stack,
        queues: &mut Queues,
    ) {
        let slots = objects.take();
        for &slot in slots {
            // SAFETY: the caller promises that all are at objects.
            unsafe { self.slots.get(slot).fetch_object(self.forest) };
        }
        for &slot in slots {
            // SAFETY: they are still at these objects, with a search; stacks have room for the
            // deepest way down, with one entry for each instance.
            unsafe { self.slots.at(slot).object_step::<L>(self.token, self.forest, below) };
            self.go_on(slot, queues);
        }
    }
}

/// Items that a queue has room for: more than there are [`SLOTS`], and a power of two, so that
/// places need not be checked.
const ROOM: usize = (SLOTS + 1).next_power_of_two();

/// Slots in order of arrival. (Items and count are apart, so that the count stays in a register.)
struct Queue<'a, T> {
    items: &'a mut [T; ROOM],
    count: usize,
}

impl<T: Copy> Queue<'_, T> {
    /// Writes an item, and counts it or not: no branch on data.
    #[inline(always)]
    fn put(&mut self, item: T, counts: bool) {
        self.items[self.count & (ROOM - 1)] = item;
        self.count += usize::from(counts);
    }

    /// Empties the queue: all that was in it.
    #[inline(always)]
    fn take(&mut self) -> &[T] {
        &self.items[..std::mem::take(&mut self.count).min(ROOM)]
    }
}

/// The slots by what they do next.
struct Queues<'a> {
    nodes: Queue<'a, SlotNumber>,
    rest: Queue<'a, SlotNumber>,
}

impl Queues<'_> {
    /// Puts a slot where it belongs.
    #[inline(always)]
    fn put(&mut self, slot: SlotNumber, current: ChildRef) {
        self.nodes.put(slot, current.is_node());
        self.rest.put(slot, !current.is_node());
    }

    fn is_empty(&self) -> bool {
        self.nodes.count + self.rest.count == 0
    }
}

/// Those of the rest that are not at leaves.
struct Others<'a> {
    /// At the end of their walks.
    ends: Queue<'a, SlotNumber>,
    /// At the end of an instance.
    returns: Queue<'a, SlotNumber>,
    objects: Queue<'a, SlotNumber>,
}
