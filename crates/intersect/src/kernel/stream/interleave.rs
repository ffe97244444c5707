//! Traces many single rays in one thread: dozens of walks take turns, one step each, so that the
//! processor always has another ray to work on while one waits for memory or for a long chain of
//! operations. Rays do not influence each other, but those that start one after another may take
//! their first steps together ([`super::shared_start`]).

use super::queue::{Queue, items};
use super::shared_start::{SHARED_RAYS, Trial, shared_start};
use super::slot::{Candidates, Enters, Idle, Leaf, Mask, Node, Object, Return, Slots, Walk};
use crate::kernel::Goal;
use crate::kernel::list::Unresolved;
use crate::kernel::single::traverse::{Stack, search_forest};
use crate::precision::Facts;
use crate::prefetch::fetch;
use crate::search::answers::Answers;
use crate::search::rays::Rays;
use crate::search::{Context, RayOf, Search};
use crate::tree::Forest;
use crate::tree::SMALL_STACK;
use crate::tree::may_search;
use crate::tree::node::ChildRef;
use snell_math::simd::{Lanes8, Level, Portable, Portable8, Token, Wide, Wide8, WideToken};
use std::mem::MaybeUninit;

/// The largest number of rays in flight. When [`SHARED_RAYS`] of them have finished, others start.
pub(super) const SLOTS: usize = 48;

/// Batches of fewer rays are traced one ray at a time.
const MIN_RAYS: usize = 16;

/// In forests of more bytes than this, walks prefetch what they visit next, since much of the
/// forest is not in the second-level cache. (In smaller forests the prefetches cost a little.)
const FETCHED_BYTES: usize = 8 << 20;

/// Rays are sorted in forests of more bytes than this ([`pays_to_sort`]).
const SORTED_BYTES: usize = 32 << 20;
/// The same limit at AVX-512 for queries that want one hit per ray: sixteen of their rays start
/// together in one register, and share more visits if they start near each other.
const SORTED_BYTES_AVX512: usize = 128 << 10;

/// A batch of rays to search for, and the data that their searches share.
pub(crate) struct Batch<'a, P: Facts> {
    pub rays: Rays<'a, P>,
    pub context: &'a Context<'a, P>,
    /// The order of the searches: places in `unresolved`, or numbers of rays if that is `None`. If
    /// empty, the searches are in the order of `unresolved` or of the rays.
    pub order: &'a [u32],
    /// The rays that are left after the outliers of the forest were tested, with their hits so far;
    /// `None` for all rays, from the beginning.
    pub unresolved: Option<&'a [Unresolved<P::Hit>]>,
}

impl<'a, P: Facts> Batch<'a, P> {
    /// A batch of all these rays, whose searches start from the beginning.
    pub fn new(rays: Rays<'a, P>, context: &'a Context<'a, P>) -> Self {
        Self { rays, context, order: &[], unresolved: None }
    }

    /// The number of searches.
    fn len(&self) -> usize {
        self.unresolved.map_or(self.rays.len(), <[_]>::len)
    }

    /// The number of the `i`-th ray of the batch, and its hit so far if it is unresolved.
    /// Prefetches the memory of a later ray and of its result.
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

/// True if the forest is so large that sorting the rays saves more time than it takes.
pub(crate) fn pays_to_sort<G: Goal>(forest: &Forest, wide: Option<Wide>) -> bool {
    let is_widest = Level::of(wide) == Level::Avx512;
    let least = if G::WANTS_ONE && is_widest { SORTED_BYTES_AVX512 } else { SORTED_BYTES };
    forest.memory_bytes() > least
}

/// True if walks through the forest fit the stacks of this kernel, and there are enough rays to
/// interleave.
pub(crate) fn is_suitable(forest: &Forest, rays: usize) -> bool {
    let tree = &forest.trees[0];
    let has_numbers = u32::try_from(rays).is_ok();
    rays >= MIN_RAYS && has_numbers && tree.unbounded.is_empty() && may_search(forest)
}

/// Searches for every ray of a batch, and passes the number and the goal of each ray to `answers`,
/// in no particular order.
pub(crate) fn search_batch<G: Goal>(
    forest: &Forest,
    wide: Option<Wide>,
    batch: &Batch<G::Precision>,
    start: impl Fn(&RayOf<G>) -> G,
    answers: impl Answers<G>,
) {
    debug_assert!(is_suitable(forest, batch.rays.len()) || batch.unresolved.is_some());
    match wide {
        Some(wide) => {
            let token = WideToken::from(wide);
            token.run(
                #[inline(always)]
                move || run::<Wide8, G>(token, forest, Some(wide), batch, start, answers),
            );
        }
        // (Without registers of many lanes, rays are as fast one by one.)
        None => run::<Portable8, G>(Portable, forest, None, batch, start, answers),
    }
}

/// Searches for the rays of a batch: rays start when walks are idle, and in each round all walks
/// make a step.
#[inline(always)]
fn run<L: Lanes8, G: Goal>(
    token: L::Token,
    forest: &Forest,
    wide: Option<Wide>,
    batch: &Batch<G::Precision>,
    start: impl Fn(&RayOf<G>) -> G,
    mut answers: impl Answers<G>,
) {
    let mut slots = Slots::<G>::new(SLOTS.min(batch.len()), forest);
    let count = slots.len();
    let (mut idle, mut nodes, mut rest) = (items(), items(), items());
    let mut idle = Queue::new(&mut idle);
    for walk in slots.walks() {
        idle.push(walk);
    }
    let prefetch = forest.memory_bytes() > FETCHED_BYTES;
    let mut round = Round { nodes: Queue::new(&mut nodes), rest: Queue::new(&mut rest), prefetch };
    let mut pending = Pending { forest, wide, batch, next: 0, trial: Trial::default() };
    // What the first half of a visit leaves for the second, and the stack of groups that are walked
    // outside of slots.
    let (mut enters, mut hits) = ([Enters::UNSET; SLOTS], [Mask::NONE; SLOTS]);
    let mut below = [const { MaybeUninit::uninit() }; SMALL_STACK];
    loop {
        while pending.len() > 0 && idle.len() >= SHARED_RAYS.min(pending.len()).min(count) {
            pending.start::<L, G>(&mut idle, &mut round, &start, &mut answers);
        }
        if round.is_empty() || batch.context.is_cancelled() {
            break;
        }
        let (mut leaves, mut others) = (items(), items());
        let (mut leaves, mut others) = (Queue::new(&mut leaves), Queue::new(&mut others));
        round.split_rest(&mut leaves, &mut others);
        round.visit_nodes::<L>(token, &mut enters, &mut hits);
        round.visit_leaves::<L>(token, &mut leaves, &mut hits);
        round.visit_others::<L>(token, &mut others, &mut below, |walk| {
            idle.push(walk.finish(|number, goal| answers.put(number, goal)));
        });
    }
}

/// The rays of a batch that are still to start.
struct Pending<'b, 'a, P: Facts> {
    forest: &'b Forest,
    wide: Option<Wide>,
    batch: &'b Batch<'a, P>,
    /// The place in the batch of the next ray to start.
    next: usize,
    trial: Trial,
}

impl<'a, P: Facts> Pending<'_, 'a, P> {
    /// The number of rays that are still to start.
    #[inline(always)]
    fn len(&self) -> usize {
        self.batch.len() - self.next
    }

    /// Starts up to [`SHARED_RAYS`] rays with idle walks, which then take part in the round.
    #[inline(always)]
    fn start<'s, L: Lanes8, G: Goal<Precision = P>>(
        &mut self,
        idle: &mut Queue<Walk<'s, 'a, G, Idle>>,
        round: &mut Round<'_, 's, 'a, G>,
        start: &impl Fn(&RayOf<G>) -> G,
        answers: &mut impl Answers<G>,
    ) {
        let mut started = items();
        let mut started = Queue::new(&mut started);
        while started.len() < SHARED_RAYS
            && self.len() > 0
            && let Some(walk) = idle.pop()
        {
            match self.start_next::<L, G>(walk, start, answers) {
                Ok(walk) => started.push(walk),
                Err(walk) => idle.push(walk),
            }
        }
        if let Some(wide) = self.wide
            && G::WANTS_ONE
            && started.len() != 0
            && self.trial.is_on()
        {
            // SAFETY: these are at most `SHARED_RAYS`, and all have just started at one reference.
            let visits = unsafe { shared_start(wide, started.as_mut_slice()) };
            self.trial.count(started.len(), visits);
        }
        for walk in started.drain() {
            round.put(walk);
        }
    }

    /// Starts the next ray with an idle walk. A ray that is not ordinary is searched for at once,
    /// and its walk returned as it was.
    #[inline(always)]
    fn start_next<'s, L: Lanes8, G: Goal<Precision = P>>(
        &mut self,
        walk: Walk<'s, 'a, G, Idle>,
        start: &impl Fn(&RayOf<G>) -> G,
        answers: &mut impl Answers<G>,
    ) -> Result<Walk<'s, 'a, G>, Walk<'s, 'a, G, Idle>> {
        let Batch { rays, context, unresolved: all, .. } = self.batch;
        let (number, unresolved) = self.batch.get(self.next, answers);
        self.next += 1;
        let query = rays.get(number);
        let search = || {
            let mut goal = start(query.ray);
            if let Some(hit) = unresolved.and_then(|unresolved| unresolved.hit) {
                goal.take(hit);
            }
            Search::new(query, context, goal)
        };
        let walk = walk.start::<L>(all.is_some(), number, context.data, search, query.ray);
        if walk.is_err() {
            answers.put(number, search_alone(self.forest, self.wide, search()));
        }
        walk
    }
}

/// Searches for a ray that is not ordinary.
#[cold]
#[inline(never)]
fn search_alone<G: Goal>(forest: &Forest, wide: Option<Wide>, mut search: Search<G>) -> G {
    search_forest(forest, wide, &mut search);
    search.goal
}

/// The walks that take part in the next round; those that are at a node have a queue of their own.
struct Round<'q, 's, 'a, G: Goal> {
    nodes: Queue<'q, Walk<'s, 'a, G, Node>>,
    /// Walks that are not at a node.
    rest: Queue<'q, Walk<'s, 'a, G>>,
    /// True if walks prefetch what they visit next as soon as they know it.
    prefetch: bool,
}

impl<'s, 'a, G: Goal> Round<'_, 's, 'a, G> {
    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.nodes.len() + self.rest.len() == 0
    }

    /// Lets a walk take part, after a prefetch of what it visits next if that is wanted.
    #[inline(always)]
    fn put(&mut self, walk: Walk<'s, 'a, G>) {
        if self.prefetch {
            walk.fetch_ahead();
        }
        self.put_fetched(walk);
    }

    /// Lets a walk take part. (This is done without a branch on what the walk is at.)
    #[inline(always)]
    fn put_fetched(&mut self, walk: Walk<'s, 'a, G>) {
        let is_node = walk.current().is_node();
        // SAFETY: one of the two queues counts the walk, that of nodes only if it is at one. A walk
        // is counted in one queue only, so no queue has more than `SLOTS`.
        unsafe {
            self.nodes.put(walk.copied_as(), is_node);
            self.rest.put(walk, !is_node);
        }
    }

    /// Moves all walks that are not at a node to `leaves` and `others`, without a branch.
    #[inline(always)]
    fn split_rest(
        &mut self,
        leaves: &mut Queue<Walk<'s, 'a, G, Leaf>>,
        others: &mut Queue<Walk<'s, 'a, G>>,
    ) {
        for walk in self.rest.drain() {
            if !self.prefetch {
                walk.fetch_leaf();
            }
            let is_leaf = walk.current().is_triangles();
            // SAFETY: one of the two queues counts the walk, that of leaves only if it is at one. A
            // walk is counted in one queue only, so no queue has more than `SLOTS`.
            unsafe {
                leaves.put(walk.copied_as(), is_leaf);
                others.put(walk, !is_leaf);
            }
        }
    }

    /// Visits the nodes that walks are at: first the boxes for all walks, then the stacks.
    #[inline(always)]
    fn visit_nodes<L: Lanes8>(
        &mut self,
        token: L::Token,
        enters: &mut [Enters; SLOTS],
        hits: &mut [Mask; SLOTS],
    ) {
        let nodes = self.nodes.as_mut_slice().iter_mut();
        for (walk, (enters, hit)) in nodes.zip(enters.iter_mut().zip(hits.iter_mut())) {
            *hit = walk.test_boxes::<L>(token, enters);
        }
        for (i, (enters, hit)) in (0..self.nodes.clear()).zip(enters.iter().zip(hits)) {
            // SAFETY: the queue had this walk before it was cleared. Of each walk that was read
            // before this one, at most one was put back.
            let walk = unsafe { self.nodes.read(i) };
            self.put(walk.push_boxes::<L>(token, *hit, enters));
        }
    }

    /// Visits the blocks of triangles that walks are at: first the filters for all walks, then the
    /// exact tests for those that need them.
    #[inline(always)]
    fn visit_leaves<L: Lanes8>(
        &mut self,
        token: L::Token,
        leaves: &mut Queue<Walk<'s, 'a, G, Leaf>>,
        hits: &mut [Mask; SLOTS],
    ) {
        let mut candidates = items();
        let mut candidates: Queue<Candidates<'s, 'a, G>> = Queue::new(&mut candidates);
        for (walk, hit) in leaves.as_mut_slice().iter_mut().zip(hits.iter_mut()) {
            *hit = walk.test_lines::<L>(token);
        }
        for (walk, hit) in leaves.drain().zip(hits) {
            let mut left = walk.leave(*hit);
            if self.prefetch {
                left.fetch();
            }
            let (is_empty, is_node) = (left.is_empty(), left.walk.current().is_node());
            // SAFETY: one of the three queues counts the walk, that of nodes only if it is at one.
            // A walk is counted in one queue only, so no queue has more than `SLOTS`.
            unsafe {
                self.nodes.put(left.walk.copied_as(), is_empty & is_node);
                self.rest.put(left.walk.copied_as(), is_empty & !is_node);
                candidates.put(left, !is_empty);
            }
        }
        for left in candidates.drain() {
            self.put_fetched(left.test());
        }
    }

    /// Leaves instances, visits objects, and passes walks that have ended to `end`.
    #[inline(always)]
    fn visit_others<L: Lanes8>(
        &mut self,
        token: L::Token,
        others: &mut Queue<Walk<'s, 'a, G>>,
        below: &mut Stack,
        end: impl FnMut(Walk<'s, 'a, G>),
    ) {
        let (mut returns, mut objects, mut ends) = (items(), items(), items());
        let (mut returns, mut objects) = (Queue::new(&mut returns), Queue::new(&mut objects));
        let mut ends = Queue::new(&mut ends);
        for walk in others.drain() {
            let (is_object, is_return) =
                (walk.current().is_object(), walk.current() == ChildRef::RETURN);
            // SAFETY: one of the three queues counts the walk, by its current reference. A walk is
            // counted in one queue only, so no queue has more than `SLOTS`.
            unsafe {
                returns.put(walk.copied_as::<Return>(), is_return);
                objects.put(walk.copied_as::<Object>(), is_object);
                ends.put(walk, !is_object & !is_return);
            }
        }
        for walk in returns.drain() {
            self.put(walk.leave_instance());
        }
        for walk in objects.as_mut_slice() {
            walk.fetch();
        }
        for walk in objects.drain() {
            self.put(walk.visit::<L>(token, below));
        }
        ends.drain().for_each(end);
    }
}
