//! Coherent rays sixteen at a time: one test of eight boxes serves a whole bundle of rays.
//!
//! A run of sixteen rays of the batch becomes a [`Bundle`] if it is one: rays from one point, or towards one point, or otherwise close together.
//! Runs that are none, and those that turn out to have little in common in this tree, are left to the caller. The
//! decision is made by the run alone, and every pair of ray and triangle that is not surely a miss goes to the same exact test
//! as everywhere else, so that neighbours change neither results nor what is done for a ray.

pub(crate) mod bundle;
pub(crate) mod doubles;
pub(crate) mod exact;
mod leaf;
mod lines;
pub(crate) mod runs;
#[cfg(test)]
mod tests;
mod trial;

use super::interleave::Batch;
use super::node::ChildRef;
use super::ray::LocalRay;
use super::traverse::{Entry, Stack, Walk, test_object, walk_portable};
use crate::accel::bvh::{Forest, GroupTree};
use crate::accel::group::{Object, ObjectRef, Placement, mapped, test_triangle};
use crate::precision::Rules;
use crate::query::search::{DataOf, Goal, RayOf, RealOf, Search, Verdict};
use crate::world::GeometryOptions;
use bundle::{Bundle, PerRay, RAYS};
use exact::{Found, PAIRS, Pairs};
use leaf::{SeenBlock, SharedOrigin};
use snell_math::simd::{Lanes8, Lanes16, Level, Pair, Portable8};
use snell_math::{DAffine3, DVec3, Vec2, Vec3};
use std::mem::MaybeUninit;
use std::ops::Range;
use trial::Trial;
#[cfg(target_arch = "x86_64")]
use {
    super::traverse::walk_avx2,
    snell_math::simd::{Avx8, Avx16},
};

/// Fewer rays are not worth a bundle.
const MIN_RAYS: usize = 6;

/// So few rays are worth a look at which triangles they are near, two at a time.
const FEW_RAYS: u32 = 6;

/// Trees larger than this are fetched ahead.
const PREFETCH_BYTES: usize = 8 << 20;

/// True if the forest can be searched with bundles at all.
pub(crate) fn is_suitable(forest: &Forest) -> bool {
    fits(&forest.trees[0])
}

/// True if bundles can walk this tree.
fn fits(tree: &GroupTree) -> bool {
    // A child is remembered as its place: eight to a node.
    tree.root != ChildRef::NONE
        && tree.root.is_node()
        && tree.nodes.len() < 1 << 29
        && bundle::is_in_range(&tree.nodes[tree.root.index()])
}

/// Searches for the rays of the batch run by run; `finish` gets the number of a ray and what was found. Returns the ranges of
/// rays that were left out.
pub(crate) fn search_runs<G: Goal>(
    forest: &Forest,
    level: Level,
    batch: &Batch<G::Precision>,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) -> Vec<Range<usize>> {
    debug_assert!(is_suitable(forest));
    let mut stacks = Stacks {
        distances: vec![0.0; forest.stack_size],
        places: vec![0; forest.stack_size],
        masks: vec![0; forest.stack_size],
        single: vec![MaybeUninit::uninit(); forest.stack_size],
    };
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `World` holds only levels that the machine supports, and the stacks have `stack_size` entries.
        Level::Avx512 => unsafe { run_avx512(forest, batch, &mut stacks, start, finish) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Level::Avx2 => unsafe { run_avx2(forest, batch, &mut stacks, start, finish) },
        // SAFETY: portable code, and the stacks have `stack_size` entries.
        _ => unsafe {
            let entries = (walk_bundle_portable::<G> as WalkBundle<G>, walk_portable::<G> as Walk<G>);
            run::<Pair<Portable8>, G>(forest, batch, &mut stacks, start, finish, entries)
        },
    }
}

/// # Safety
/// As [`run`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn run_avx2<G: Goal>(
    forest: &Forest,
    batch: &Batch<G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) -> Vec<Range<usize>> {
    let entries = (walk_bundle_avx2::<G> as WalkBundle<G>, walk_avx2::<G> as Walk<G>);
    // SAFETY: as promised by the caller.
    unsafe { run::<Pair<Avx8>, G>(forest, batch, stacks, start, finish, entries) }
}

/// # Safety
/// As [`run`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn run_avx512<G: Goal>(
    forest: &Forest,
    batch: &Batch<G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) -> Vec<Range<usize>> {
    let entries = (walk_bundle_avx512::<G> as WalkBundle<G>, walk_avx2::<G> as Walk<G>);
    // SAFETY: as promised by the caller.
    unsafe { run::<Avx16, G>(forest, batch, stacks, start, finish, entries) }
}

/// Memory of the walks: what bundles put off, by distance, place (node times eight plus slot) and the rays that meet the node, and the
/// stack of single rays.
struct Stacks {
    distances: Vec<f32>,
    places: Vec<u32>,
    masks: Vec<u32>,
    single: Vec<MaybeUninit<Entry>>,
}

/// # Safety
/// The machine must have the instructions of `W`; the stacks must have room for all groups; `enter` and `enter_single` must be
/// entries of the same level.
#[inline(always)]
unsafe fn run<'s, W: Lanes16, G: Goal>(
    forest: &Forest,
    batch: &Batch<'s, G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    mut finish: impl FnMut(usize, G),
    (enter, enter_single): (WalkBundle<G>, Walk<G>),
) -> Vec<Range<usize>> {
    let mut left: Vec<Range<usize>> = Vec::new();
    let (mut bundle, mut found) = (Bundle::NONE, Found::NONE);
    let (mut trial, mut spare) = (Trial::default(), Vec::new());
    let mut searches = [const { None }; RAYS];
    let mut first = 0;
    while first < batch.rays.len() {
        let run = first..(first + RAYS).min(batch.rays.len());
        first = run.end;
        // SAFETY: as promised by the caller.
        if unsafe {
            let (data, rays) = (batch.context.data, &batch.rays.rays()[run.clone()]);
            let backward = G::ANY && trial.is_backward();
            G::Precision::set_up_bundle::<W>(data, &mut bundle, rays, backward)
        } {
            // (In place: what is returned would be copied as a whole after it was written in pieces.)
            let begin = |lane: usize, search: &mut Option<Search<'s, G>>| {
                let query = batch.rays.get((run.start + lane).min(run.end - 1));
                *search = Some(Search::new(query, batch.context, start(query.ray)));
            };
            let alive = u32::MAX >> (32 - run.len());
            let mut walker = Walker {
                forest,
                data: batch.context.data,
                options: batch.context.options,
                masks: batch.rays.common_mask(run.clone()),
                rays: &batch.rays.rays()[run.clone()],
                searches: &mut searches,
                begin: &begin,
                found: &mut found,
                stacks,
                alive,
                waiting: 0,
                put_off: [0; RAYS],
                spare: &mut spare,
                work: 0,
                enter,
                enter_single,
            };
            // SAFETY: as promised by the caller.
            unsafe { enter(&mut walker, Position { group: 0, instance: 0, top: 0 }, &mut bundle) };
            if bundle.kind.reversed {
                trial.count(walker.work);
            }
            for (number, search) in run.zip(&mut searches) {
                match search.take() {
                    Some(search) => finish(number, search.goal),
                    None => finish(number, start(&batch.rays.rays()[number])),
                }
            }
            continue;
        }
        match left.last_mut() {
            Some(last) if last.end == run.start => last.end = run.end,
            _ => left.push(run),
        }
    }
    left
}

/// The walk of a level.
type WalkBundle<G> = unsafe fn(&mut Walker<'_, '_, G>, Position, &mut Bundle);

/// Where a bundle is.
#[derive(Clone, Copy)]
struct Position {
    group: usize,
    /// The occurrence number of the group.
    instance: u32,
    /// From where the stack is free.
    top: usize,
}

/// # Safety
/// As [`Walker::walk`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn walk_bundle_avx2<G: Goal>(walker: &mut Walker<'_, '_, G>, position: Position, bundle: &mut Bundle) {
    // SAFETY: as promised by the caller.
    unsafe { walker.walk::<Pair<Avx8>>(position, bundle) }
}

/// # Safety
/// As [`Walker::walk`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn walk_bundle_avx512<G: Goal>(walker: &mut Walker<'_, '_, G>, position: Position, bundle: &mut Bundle) {
    // SAFETY: as promised by the caller.
    unsafe { walker.walk::<Avx16>(position, bundle) }
}

/// # Safety
/// As [`Walker::walk`].
unsafe fn walk_bundle_portable<G: Goal>(walker: &mut Walker<'_, '_, G>, position: Position, bundle: &mut Bundle) {
    // SAFETY: as promised by the caller.
    unsafe { walker.walk::<Pair<Portable8>>(position, bundle) }
}

/// The searches of a run on their way through the forest.
struct Walker<'w, 's, G: Goal> {
    forest: &'w Forest,
    data: &'w DataOf<G>,
    options: &'w [GeometryOptions],
    /// What all rays have in their masks.
    masks: u32,
    /// The rays of the run.
    rays: &'w [RayOf<G>],
    /// Begun when something was found that may count: rays that surely meet nothing need none.
    searches: &'w mut PerRay<Option<Search<'s, G>>>,
    /// Begins the search of a ray.
    begin: &'w dyn Fn(usize, &mut Option<Search<'s, G>>),
    /// Memory for what becomes of pairs.
    found: &'w mut Found<RealOf<G>>,
    stacks: &'w mut Stacks,
    /// The rays whose search is not over.
    alive: u32,
    /// The rays of the group that surely hit something, and the place of the nearest of that ([`Pairs`]): tested exactly in the end.
    waiting: u32,
    put_off: PerRay<u32>,
    /// Memory for bundles in instances.
    #[allow(clippy::vec_box, reason = "they are large, and come and go")]
    spare: &'w mut Vec<Box<Bundle>>,
    /// About what it took: a box tested is one.
    work: u32,
    enter: WalkBundle<G>,
    enter_single: Walk<G>,
}

impl<'s, G: Goal> Walker<'_, 's, G> {
    /// Only the nearest hit counts: if it is certain which that is, the exact test of others is saved.
    const PUTS_OFF: bool = G::NARROWS && G::WANTS_ONE;

    /// Walks one group.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; the stacks must have room for the group and all below it.
    #[inline(always)]
    unsafe fn walk<W: Lanes16>(&mut self, position: Position, bundle: &mut Bundle) {
        let tree = &self.forest.trees[position.group];
        let instance = position.instance;
        let mut locals = Locals::new();
        // SAFETY: as promised by the caller.
        unsafe {
            for &object in &tree.unbounded {
                self.test_objects::<W>(tree, object as usize, bundle, self.alive, instance);
            }
            self.descend::<W>(tree, position, bundle, &mut locals);
            self.test_put_off::<W>(tree, bundle, &mut locals, instance, true);
        }
    }

    /// Walks the tree of a group.
    ///
    /// # Safety
    /// As [`Self::walk`].
    #[inline(always)]
    unsafe fn descend<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        position: Position,
        bundle: &mut Bundle,
        locals: &mut Locals,
    ) {
        let (base, instance) = (position.top, position.instance);
        let prefetch = tree.memory_bytes() > PREFETCH_BYTES;
        let mut top = base;
        let (mut node, mut mask) = (tree.root.index(), self.alive);
        while self.alive != 0 {
            // SAFETY: the builder makes only references to nodes that exist; a walk holds at most 7 entries per level.
            unsafe {
                let pushed = self.push_children::<W>(tree, node, mask, bundle, top);
                if prefetch {
                    for i in top..top + pushed {
                        fetch_ahead(tree, child_at(tree, *self.stacks.places.get_unchecked(i)));
                    }
                }
                top += pushed;
            }
            loop {
                if top == base {
                    return;
                }
                top -= 1;
                // SAFETY: entries below the former `top` are written.
                let (distance, place, meeting) = unsafe {
                    (
                        *self.stacks.distances.get_unchecked(top),
                        *self.stacks.places.get_unchecked(top),
                        *self.stacks.masks.get_unchecked(top),
                    )
                };
                if distance > bundle.bundle_far {
                    continue;
                }
                self.work += 1;
                // SAFETY: places come from nodes that exist; `W` as promised by the caller.
                let (child, meeting) = unsafe {
                    let node = tree.nodes.get_unchecked(place as usize >> 3);
                    (child_at(tree, place), bundle.rays_meeting::<W>(node, place as usize & 7) & meeting)
                };
                if meeting == 0 {
                    continue;
                }
                if child.is_node() {
                    (node, mask) = (child.index(), meeting);
                    break;
                }
                self.work += 2;
                // SAFETY: as promised by the caller.
                unsafe {
                    if child.is_triangles() {
                        self.test_triangles::<W>(tree, child, bundle, meeting, locals, instance);
                    } else {
                        self.test_put_off::<W>(tree, bundle, locals, instance, false);
                        self.enter_object::<W>(tree, child, bundle, meeting, &Position { top, ..position });
                    }
                }
            }
        }
    }

    /// The search of a ray; it begins if it has not.
    #[inline(always)]
    fn search(&mut self, ray: usize) -> &mut Search<'s, G> {
        let search = &mut self.searches[ray];
        if search.is_none() {
            (self.begin)(ray, search);
        }
        search.as_mut().expect("it has begun")
    }

    /// Writes the rays of the bundle exactly, if that has not been done.
    #[inline(always)]
    fn want_rays(&self, bundle: &mut Bundle) {
        if !bundle.has_rays {
            bundle.rays.write::<G::Precision>(self.rays);
            bundle.has_rays = true;
        }
    }

    /// Puts the children of a node that the bundle meets on the stack, the nearest on top, and returns how many they are.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; the node must exist, and the stack must have room for eight entries from `top`.
    #[inline(always)]
    unsafe fn push_children<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        node: usize,
        mask: u32,
        bundle: &Bundle,
        top: usize,
    ) -> usize {
        // SAFETY: as promised by the caller.
        unsafe {
            *self.stacks.masks.as_mut_ptr().add(top).cast::<[u32; 8]>() = [mask; 8];
            let places: [u32; 8] = std::array::from_fn(|slot| (node * 8 + slot) as u32);
            let node = tree.nodes.get_unchecked(node);
            let enter = bundle.box_distances::<W::Half>(node);
            let distances = &mut *self.stacks.distances.as_mut_ptr().add(top).cast::<[f32; 8]>();
            let payload = &mut *self.stacks.places.as_mut_ptr().add(top).cast::<[u32; 8]>();
            let order = *node.order.get_unchecked(bundle.octant);
            enter.compress_le(W::Half::splat(bundle.bundle_far), order, &places, distances, payload)
        }
    }

    /// Tests the triangles of a block for some of the rays.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; `child` must be a block of the tree.
    #[inline(always)]
    unsafe fn test_triangles<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        child: ChildRef,
        bundle: &mut Bundle,
        rays: u32,
        locals: &mut Locals,
        instance: u32,
    ) {
        let mut pairs = Pairs::NONE;
        // SAFETY: as promised by the caller.
        unsafe {
            let found = if !G::ANY && !bundle.lines.apart {
                self.find_pairs_of_origin::<W>(tree, child, bundle, rays, &mut pairs, locals, instance)
            } else {
                self.find_pairs::<W>(tree, child, bundle, rays, &mut pairs, locals, instance)
            };
            let last = pairs.count != 0 && self.test_pairs::<W>(tree, bundle, &mut pairs, locals, instance, false);
            if found || last {
                bundle.update_limits::<W>();
            }
        }
    }

    /// Finds what rays that share their origin may hit of a block. True if anything was tested, because there were many, and counted.
    ///
    /// # Safety
    /// As [`Self::test_triangles`].
    #[inline(always)]
    unsafe fn find_pairs_of_origin<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        child: ChildRef,
        bundle: &mut Bundle,
        mut rays: u32,
        pairs: &mut Pairs,
        locals: &mut Locals,
        instance: u32,
    ) -> bool {
        let (place, used, mut found) = (child.block() as u32 * 8, (2 << (child.count() - 1)) - 1, false);
        // SAFETY: as promised by the caller.
        unsafe {
            let block = tree.blocks.get_unchecked(child.block());
            let seen = SharedOrigin::<W::Half>::new::<G::Precision>(block, &bundle.lines, bundle.axes);
            while rays != 0 {
                let ray = rays.trailing_zeros();
                rays &= rays - 1;
                let mut triangles = seen.candidates(&bundle.lines, ray as usize & (RAYS - 1)) & used;
                // Mostly there is one.
                loop {
                    pairs.push_if(ray, place + (triangles.trailing_zeros() & 7), triangles != 0);
                    if pairs.is_full() {
                        found |= self.test_pairs::<W>(tree, bundle, pairs, locals, instance, false);
                    }
                    triangles &= triangles.wrapping_sub(1);
                    if triangles == 0 {
                        break;
                    }
                }
            }
        }
        found
    }

    /// Finds what rays may hit of a block, and what they surely hit. True if anything counted already.
    ///
    /// # Safety
    /// As [`Self::test_triangles`].
    #[inline(always)]
    unsafe fn find_pairs<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        child: ChildRef,
        bundle: &mut Bundle,
        mut rays: u32,
        pairs: &mut Pairs,
        locals: &mut Locals,
        instance: u32,
    ) -> bool {
        let (place, mut triangles, mut found) = (child.block() as u32 * 8, (2 << (child.count() - 1)) - 1, false);
        // SAFETY: as promised by the caller.
        unsafe {
            let block = tree.blocks.get_unchecked(child.block());
            let seen = SeenBlock::new::<W::Half, G::Precision>(block, &bundle.lines, bundle.axes);
            if rays.count_ones() <= FEW_RAYS {
                let (mut all, mut rest) = (0, rays);
                while rest != 0 {
                    all |= seen.near_two::<W>(&bundle.lines, &mut rest);
                }
                triangles &= all | all >> 8;
            }
            while triangles != 0 {
                let triangle = triangles.trailing_zeros();
                triangles &= triangles - 1;
                let meeting = seen.meeting::<W>(&bundle.lines, triangle as usize, rays);
                let mut possible = meeting.possible;
                if meeting.sure != 0
                    && (G::ANY || (Self::PUTS_OFF && !bundle.kind.reversed))
                    && self.is_plain(tree, block.ids[triangle as usize & 7])
                {
                    if G::ANY {
                        self.take_any::<W>(meeting.sure, bundle);
                        rays &= !meeting.sure;
                    } else {
                        W::write_where(meeting.sure, place + triangle, &mut self.put_off);
                        self.waiting |= meeting.sure;
                        bundle.tighten_to(meeting.sure, meeting.low, meeting.high);
                    }
                    possible &= !meeting.sure;
                    found = true;
                }
                while possible != 0 {
                    pairs.push(possible.trailing_zeros(), place + triangle);
                    possible &= possible - 1;
                    if pairs.is_full() {
                        found |= self.test_pairs::<W>(tree, bundle, pairs, locals, instance, false);
                        rays &= self.alive;
                    }
                }
            }
        }
        found
    }

    /// True if hits of a triangle count for all rays, whatever they are.
    #[inline(always)]
    fn is_plain(&self, tree: &GroupTree, triangle: u32) -> bool {
        let options = &self.options[tree.triangle(triangle).0 as usize];
        options.mask & self.masks != 0 && !options.filtered
    }

    /// Ends the searches of rays that surely hit something that counts.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    unsafe fn take_any<W: Lanes16>(&mut self, mut rays: u32, bundle: &mut Bundle) {
        self.alive &= !rays;
        // SAFETY: passed on to the caller.
        unsafe { bundle.finish::<W>(rays) };
        while rays != 0 {
            let ray = rays.trailing_zeros() as usize & (RAYS - 1);
            rays &= rays - 1;
            self.search(ray).goal.take(G::Precision::hit(0.0, Vec2::ZERO, [0; 3]));
        }
    }

    /// Tests what was put off. [`Bundle::update_limits`] must follow if this is not the `last` that the bundle is used for.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; what was put off must be in this tree.
    #[inline(always)]
    unsafe fn test_put_off<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        bundle: &mut Bundle,
        locals: &mut Locals,
        instance: u32,
        last: bool,
    ) {
        if !Self::PUTS_OFF {
            return;
        }
        let mut rays = std::mem::take(&mut self.waiting);
        while rays != 0 {
            let mut pairs = Pairs::NONE;
            while rays != 0 && !pairs.is_full() {
                let ray = rays.trailing_zeros();
                rays &= rays - 1;
                pairs.push(ray, self.put_off[ray as usize & (RAYS - 1)]);
            }
            // SAFETY: as promised by the caller.
            unsafe { self.test_pairs::<W>(tree, bundle, &mut pairs, locals, instance, last) };
        }
    }

    /// Offers the hits of pairs of rays and triangles, and forgets the pairs. True if there are any that count. If nothing comes after the
    /// `last` ones, the bundle is left as it is.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; the triangles must be of the tree.
    #[inline(always)]
    unsafe fn test_pairs<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        bundle: &mut Bundle,
        pairs: &mut Pairs,
        locals: &mut Locals,
        instance: u32,
        last: bool,
    ) -> bool {
        self.want_rays(bundle);
        let all = u32::MAX >> (32 - pairs.count);
        // Rays whose searches go on or are over, and where they end now.
        let (mut nearer, mut over, mut culls) = (0, 0, [0.0; RAYS]);
        (self.found.hits, self.found.unsure) = (0, all);
        if bundle.is_aligned {
            self.found.unsure = 0;
            // SAFETY: as promised by the caller.
            unsafe { G::Precision::exact_hits::<W::Half>(self.data, tree, bundle, pairs, self.found) };
        }
        let (mut hits, mut unsure) = (self.found.hits & all, self.found.unsure & all);
        while hits != 0 {
            let pair = hits.trailing_zeros() as usize & (PAIRS - 1);
            hits &= hits - 1;
            let ray = pairs.rays[pair] as usize & (RAYS - 1);
            let (t, b) = (self.found.t[pair], [self.found.b1[pair], self.found.b2[pair]]);
            let is_over = (self.alive & !over) >> ray & 1 == 0;
            let search = self.search(ray);
            if is_over || t > search.goal.limit() {
                continue;
            }
            let (block, triangle) = pairs.place(pair);
            let (geometry, primitive) = tree.triangle(tree.blocks[block].ids[triangle]);
            let verdict = search.offer(G::Precision::found(t, b, [instance, geometry, primitive]));
            culls[ray] = search.cull();
            nearer |= 1 << ray;
            over |= u32::from(verdict == Verdict::Finished) << ray;
        }
        while unsure != 0 {
            let pair = unsure.trailing_zeros() as usize & (PAIRS - 1);
            unsure &= unsure - 1;
            let ray = pairs.rays[pair] as usize & (RAYS - 1);
            if (self.alive & !over) >> ray & 1 == 0 {
                continue;
            }
            let (block, triangle) = pairs.place(pair);
            let block = &tree.blocks[block];
            let ids = || {
                let (geometry, primitive) = tree.triangle(block.ids[triangle]);
                [instance, geometry, primitive]
            };
            let (local, search) = (locals.get(bundle, ray), self.search(ray));
            let is_over = test_triangle(search, local, &block.corners(triangle), ids);
            culls[ray] = search.cull();
            nearer |= 1 << ray;
            over |= u32::from(is_over) << ray;
        }
        pairs.count = 0;
        self.alive &= !over;
        let is_narrowed = !last && (over != 0 || (G::NARROWS && nearer != 0));
        if is_narrowed {
            // SAFETY: as promised by the caller.
            unsafe { bundle.narrow::<W>(nearer, over, &culls) };
        }
        is_narrowed
    }

    /// Tests a shape or instance for some of the rays.
    ///
    /// # Safety
    /// As [`Self::walk`].
    #[inline(always)]
    unsafe fn test_objects<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        object: usize,
        bundle: &mut Bundle,
        rays: u32,
        instance: u32,
    ) {
        let mut culls = [0.0; RAYS];
        // SAFETY: as promised by the caller.
        unsafe {
            let over = self.test_one_by_one(tree, object, bundle, rays, instance, &mut culls);
            self.alive &= !over;
            bundle.narrow::<W>(rays, over, &culls);
            bundle.update_limits::<W>();
        }
    }

    /// Tests a shape or instance for some of the rays, one by one; notes their new padded limits, and returns whose searches are over.
    ///
    /// # Safety
    /// The machine must have the instructions of the entries; the stacks must have room for all below the group.
    #[inline(never)]
    unsafe fn test_one_by_one(
        &mut self,
        tree: &GroupTree,
        object: usize,
        bundle: &mut Bundle,
        mut rays: u32,
        instance: u32,
        culls: &mut PerRay<f32>,
    ) -> u32 {
        self.want_rays(bundle);
        let mut over = 0;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize & (RAYS - 1);
            rays &= rays - 1;
            self.search(lane);
            let (Some(search), ray) = (&mut self.searches[lane], bundle.rays.get(lane)) else { continue };
            let stack: &mut Stack = &mut self.stacks.single;
            // SAFETY: as promised by the caller.
            let is_over =
                unsafe { test_object(self.forest, tree, object, &ray, instance, search, stack, self.enter_single) };
            culls[lane] = search.cull();
            over |= u32::from(is_over) << lane;
        }
        over
    }

    /// Tests a shape or instance for some of the rays: in an instance they go on as a bundle if they can.
    ///
    /// # Safety
    /// As [`Self::walk`].
    #[inline(always)]
    unsafe fn enter_object<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        object: ChildRef,
        bundle: &mut Bundle,
        mask: u32,
        position: &Position,
    ) {
        if let ObjectRef::Placed(Object::Instance {
            child,
            offset,
            child_from_group: Placement::Still(child_from_group),
            mask: visible,
        }) = tree.objects.get(object.index())
        {
            let mut wanted = 0;
            for lane in (0..RAYS).filter(|lane| mask >> lane & 1 == 1) {
                wanted |= u32::from(self.search(lane).mask & visible != 0) << lane;
            }
            if wanted.count_ones() as usize >= MIN_RAYS && fits(&self.forest.trees[*child]) {
                let mut below = self.spare.pop().unwrap_or_else(|| Box::new(Bundle::NONE));
                let groups = (position.group, *child);
                // SAFETY: as promised by the caller.
                if unsafe { self.set_up_in_child::<W>(&mut below, bundle, wanted, groups, child_from_group) } {
                    let alive = std::mem::replace(&mut self.alive, wanted);
                    let inside = Position { group: *child, instance: position.instance + offset, ..*position };
                    // SAFETY: as promised by the caller.
                    unsafe { (self.enter)(self, inside, &mut below) };
                    self.spare.push(below);
                    let over = wanted & !self.alive;
                    self.alive = alive & !over;
                    let mut culls = [0.0; RAYS];
                    for lane in (0..RAYS).filter(|lane| wanted >> lane & 1 == 1) {
                        culls[lane] = self.search(lane).cull();
                    }
                    // SAFETY: as promised by the caller.
                    unsafe {
                        bundle.narrow::<W>(wanted, over, &culls);
                        bundle.update_limits::<W>();
                    }
                    return;
                }
                self.spare.push(below);
            }
        }
        // SAFETY: as promised by the caller.
        unsafe { self.test_objects::<W>(tree, object.index(), bundle, mask, position.instance) };
    }

    /// Makes a bundle of some of the rays in the coordinates of an instanced group; false if it is none.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    unsafe fn set_up_in_child<W: Lanes16>(
        &mut self,
        below: &mut Bundle,
        bundle: &mut Bundle,
        mask: u32,
        (group, child): (usize, usize),
        child_from_group: &DAffine3,
    ) -> bool {
        self.want_rays(bundle);
        let [mut t_min, mut cull] = [[0.0; RAYS]; 2];
        for lane in 0..RAYS {
            let ray = mapped(child_from_group, &bundle.rays.get(lane));
            let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
            let search = self.search(lane);
            t_min[lane] = search.start;
            cull[lane] = if mask >> lane & 1 == 1 { search.cull() } else { -1.0 };
            below.rays.origin[lane] = [o[0], o[1], o[2], bundle.rays.origin[lane][3]];
            below.rays.direction[lane] = [d[0], d[1], d[2], 0.0];
        }
        let [x, y, z, _] = below.rays.origin[0];
        let apex = if bundle.kind.common {
            DVec3::new(x, y, z)
        } else {
            let apex = Vec3::from_array(bundle.kind.apex).as_dvec3();
            child_from_group.transform_point3(G::Precision::point_in_group(self.data, group, apex))
        };
        // SAFETY: as promised by the caller.
        unsafe { below.set_up_exactly::<W, G::Precision>(&[t_min, cull], self.data, child, apex, &bundle.kind) }
    }
}

/// What the exact test wants to know of the rays, worked out when it is needed.
struct Locals {
    built: u32,
    rays: [MaybeUninit<LocalRay>; RAYS],
}

impl Locals {
    /// None yet. (As a constant, all of it would be cleared for each bundle.)
    #[inline(always)]
    fn new() -> Self {
        Self { built: 0, rays: [const { MaybeUninit::uninit() }; RAYS] }
    }

    #[inline(always)]
    fn get(&mut self, bundle: &Bundle, lane: usize) -> &LocalRay {
        if self.built >> lane & 1 == 0 {
            self.built |= 1 << lane;
            self.rays[lane].write(LocalRay::new(&bundle.rays.get(lane)));
        }
        // SAFETY: written now or before.
        unsafe { self.rays[lane].assume_init_ref() }
    }
}

/// The child at a place.
///
/// # Safety
/// The place must be one of the tree.
#[inline(always)]
unsafe fn child_at(tree: &GroupTree, place: u32) -> ChildRef {
    // SAFETY: as promised by the caller.
    unsafe { tree.nodes.get_unchecked(place as usize >> 3).children[place as usize & 7] }
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
