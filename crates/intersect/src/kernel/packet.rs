//! Coherent rays sixteen at a time: one test of eight boxes serves a whole bundle of rays.
//!
//! A run of sixteen rays of the batch becomes a [`Bundle`] if it is one: rays from one point, or towards one point, or otherwise close together.
//! Runs that are none, and those that turn out to have little in common in this tree, are left to the caller. The
//! decision is made by the run alone, and every pair of ray and triangle that is not surely a miss goes to the same exact test
//! as everywhere else, so that neighbours change neither results nor what is done for a ray.

mod bundle;
mod leaf;

use super::interleave::Batch;
use super::node::ChildRef;
use super::ray::LocalRay;
use super::traverse::{Entry, Stack, Walk, test_object, walk_portable};
use crate::accel::bvh::{Forest, GroupTree};
use crate::accel::group::{Object, ObjectRef, ray_in_child, test_triangle};
use crate::precision::{Real, Rules};
use crate::query::search::{DataOf, Goal, RayOf, Search};
use bundle::{Bundle, ExactRays, Kind, RAYS};
use leaf::SeenBlock;
use snell_math::simd::{Lanes8, Level, Portable8};
use snell_math::{DAffine3, DRay, DVec3};
use std::mem::MaybeUninit;
use std::ops::Range;

/// Runs with fewer rays are not worth a bundle.
const MIN_RAYS: usize = 6;

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
        single: vec![MaybeUninit::uninit(); forest.stack_size],
    };
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `World` holds only levels that the machine supports, and the stacks have `stack_size` entries.
        Level::Avx2 | Level::Avx512 => unsafe { run_avx2(forest, batch, &mut stacks, start, finish) },
        // SAFETY: portable code, and the stacks have `stack_size` entries.
        _ => unsafe {
            run::<Portable8, G>(
                forest,
                batch,
                &mut stacks,
                start,
                finish,
                [walk_bundle_portable::<G>],
                walk_portable::<G>,
            )
        },
    }
}

/// # Safety
/// As [`run`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
unsafe fn run_avx2<G: Goal>(
    forest: &Forest,
    batch: &Batch<G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) -> Vec<Range<usize>> {
    use super::traverse::walk_avx2;
    use snell_math::simd::Avx8;
    // SAFETY: as promised by the caller.
    unsafe { run::<Avx8, G>(forest, batch, stacks, start, finish, [walk_bundle_avx2::<G>], walk_avx2::<G>) }
}

/// Memory of the walks: what bundles put off, by distance and place (node times eight plus slot), and the stack of single rays.
struct Stacks {
    distances: Vec<f32>,
    places: Vec<u32>,
    single: Vec<MaybeUninit<Entry>>,
}

/// # Safety
/// The machine must have the instructions of `L`; the stacks must have room for all groups; `enter` and `enter_single` must be
/// entries of the same level.
#[inline(always)]
unsafe fn run<L: Lanes8, G: Goal>(
    forest: &Forest,
    batch: &Batch<G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    mut finish: impl FnMut(usize, G),
    [enter]: [WalkBundle<G>; 1],
    enter_single: Walk<G>,
) -> Vec<Range<usize>> {
    let mut left: Vec<Range<usize>> = Vec::new();
    let mut first = 0;
    while first < batch.rays.len() {
        let run = first..(first + RAYS).min(batch.rays.len());
        first = run.end;
        if let Some(mut bundle) = bundle_of::<G>(batch.context.data, &batch.rays.rays()[run.clone()]) {
            let mut searches: [Search<G>; RAYS] = std::array::from_fn(|i| {
                let query = batch.rays.get((run.start + i).min(run.end - 1));
                Search::new(query, batch.context, start(query.ray))
            });
            let mut walker = Walker {
                forest,
                searches: &mut searches,
                stacks,
                alive: u32::MAX >> (32 - run.len()),
                enter,
                enter_single,
            };
            // SAFETY: as promised by the caller.
            if unsafe { walker.walk::<L>(0, &mut bundle, 0, 0) } {
                for (number, search) in run.zip(searches) {
                    finish(number, search.goal);
                }
                continue;
            }
        }
        match left.last_mut() {
            Some(last) if last.end == run.start => last.end = run.end,
            _ => left.push(run),
        }
    }
    left
}

/// The bundle of a run, if it is one. Lanes without a ray repeat the first one and want nothing.
#[inline(always)]
fn bundle_of<G: Goal>(data: &DataOf<G>, rays: &[RayOf<G>]) -> Option<Bundle> {
    if rays.len() < MIN_RAYS {
        return None;
    }
    let mut exact = ExactRays { origin: [[0.0; RAYS]; 3], direction: [[0.0; RAYS]; 3] };
    let (mut t_min, mut cull) = ([0.0; RAYS], [-1.0; RAYS]);
    let first = G::Precision::exact(&rays[0]);
    let mut valid = true;
    let mut common = true;
    let mut ends = true;
    for i in 0..RAYS {
        let ray = if i < rays.len() { &rays[i] } else { &rays[0] };
        let [start, end] = G::Precision::interval(ray).map(|t| [t.below(), t.above()]);
        valid &= start[0] >= 0.0 && G::Precision::is_valid(ray);
        ends &= end[1] < f32::INFINITY;
        t_min[i] = start[0];
        if i < rays.len() {
            cull[i] = super::node::padded(end[1]);
        }
        let ray = G::Precision::exact(ray);
        common &= ray.origin == first.origin;
        for axis in 0..3 {
            exact.origin[axis][i] = ray.origin[axis];
            exact.direction[axis][i] = ray.direction[axis];
        }
    }
    if !valid {
        return None;
    }
    // A little beyond the ends, so that all rays end before it.
    let reversed = !common && ends;
    let end = G::Precision::interval(&rays[0])[1].into() * (1.0 + 1.0 / 4096.0);
    let apex = if reversed { first.at(end) } else { first.origin };
    bundle_in_group::<G>(data, 0, exact, Place { apex, reversed, common, rounded: false }, &t_min, &cull)
}

/// What is known of rays in the coordinates of a group: see [`Kind`].
#[derive(Clone, Copy)]
struct Place {
    apex: DVec3,
    reversed: bool,
    common: bool,
    rounded: bool,
}

/// The bundle of rays in the coordinates of a group.
#[inline(always)]
fn bundle_in_group<G: Goal>(
    data: &DataOf<G>,
    group: usize,
    rays: ExactRays,
    place: Place,
    t_min: &[f32; RAYS],
    cull: &[f32; RAYS],
) -> Option<Bundle> {
    let Place { apex, reversed, common, rounded } = place;
    let slack = G::Precision::slack(data, group);
    let in_structure = |ray: &DRay| G::Precision::ray_in_structure(data, group, ray);
    let seen_apex = in_structure(&DRay::new(apex, DVec3::ZERO)).origin.as_vec3().to_array();
    let kind = Kind { apex: seen_apex, reversed, common, rounded: rounded || slack > 0.0, slack };
    if slack == 0.0 {
        return Bundle::new(&rays, kind, t_min, cull);
    }
    let mut seen = rays.clone();
    for lane in 0..RAYS {
        let ray = in_structure(&rays.get(lane));
        for axis in 0..3 {
            seen.origin[axis][lane] = ray.origin[axis];
            seen.direction[axis][lane] = ray.direction[axis];
        }
    }
    // Where it goes is seen in the coordinates of the structure, and the rays are kept as they are.
    let mut bundle = Bundle::new(&seen, kind, t_min, cull)?;
    bundle.rays = rays;
    Some(bundle)
}

/// The entry of a level, for the step into an instance.
type WalkBundle<G> = unsafe fn(&mut Walker<'_, '_, G>, usize, &mut Bundle, u32, usize) -> bool;

/// # Safety
/// As [`Walker::walk`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
unsafe fn walk_bundle_avx2<G: Goal>(
    walker: &mut Walker<'_, '_, G>,
    group: usize,
    bundle: &mut Bundle,
    instance: u32,
    base: usize,
) -> bool {
    // SAFETY: as promised by the caller.
    unsafe { walker.walk::<snell_math::simd::Avx8>(group, bundle, instance, base) }
}

/// # Safety
/// As [`Walker::walk`].
unsafe fn walk_bundle_portable<G: Goal>(
    walker: &mut Walker<'_, '_, G>,
    group: usize,
    bundle: &mut Bundle,
    instance: u32,
    base: usize,
) -> bool {
    // SAFETY: as promised by the caller.
    unsafe { walker.walk::<Portable8>(group, bundle, instance, base) }
}

/// The searches of a run on their way through the forest.
struct Walker<'w, 's, G: Goal> {
    forest: &'w Forest,
    searches: &'w mut [Search<'s, G>; RAYS],
    stacks: &'w mut Stacks,
    /// The rays whose search is not over.
    alive: u32,
    enter: WalkBundle<G>,
    enter_single: Walk<G>,
}

impl<G: Goal> Walker<'_, '_, G> {
    /// Walks one group. False if the run is given up: then nothing of what was found may be used.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; the stacks must have room for the group and all below it from `base`.
    #[inline(always)]
    unsafe fn walk<L: Lanes8>(&mut self, group: usize, bundle: &mut Bundle, instance: u32, base: usize) -> bool {
        let tree = &self.forest.trees[group];
        let mut locals = Locals { built: 0, rays: [const { MaybeUninit::uninit() }; RAYS] };
        for &object in &tree.unbounded {
            // SAFETY: as promised by the caller.
            unsafe { self.test_objects(tree, object as usize, bundle, self.alive, instance) };
        }
        let prefetch = tree.memory_bytes() > PREFETCH_BYTES;
        let mut top = base;
        let mut node = tree.root.index();
        while self.alive != 0 {
            // SAFETY: the builder makes only references to nodes that exist; a walk holds at most 7 entries per level.
            unsafe {
                let pushed = self.push_children::<L>(tree, node, bundle, top);
                if prefetch {
                    for i in top..top + pushed {
                        fetch_ahead(tree, child_at(tree, *self.stacks.places.get_unchecked(i)));
                    }
                }
                top += pushed;
            }
            loop {
                if top == base {
                    return true;
                }
                top -= 1;
                // SAFETY: entries below the former `top` are written.
                let (distance, place) =
                    unsafe { (*self.stacks.distances.get_unchecked(top), *self.stacks.places.get_unchecked(top)) };
                if distance > bundle.bundle_far {
                    continue;
                }
                // SAFETY: places come from nodes that exist.
                let child = unsafe { child_at(tree, place) };
                if child.is_node() {
                    node = child.index();
                    break;
                }
                // SAFETY: as above; `L` as promised by the caller.
                let mask = unsafe {
                    bundle.rays_meeting::<L>(tree.nodes.get_unchecked(place as usize >> 3), place as usize & 7)
                };
                if mask == 0 {
                    continue;
                }
                // SAFETY: as promised by the caller.
                unsafe {
                    if child.is_triangles() {
                        self.test_triangles::<L>(tree, child, bundle, mask, &mut locals, group, instance);
                    } else if !self.enter_object(tree, group, child.index(), bundle, mask, instance, top) {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// Puts the children of a node that the bundle meets on the stack, the nearest on top, and returns how many they are.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; the node must exist, and the stack must have room for eight entries from `top`.
    #[inline(always)]
    unsafe fn push_children<L: Lanes8>(&mut self, tree: &GroupTree, node: usize, bundle: &Bundle, top: usize) -> usize {
        // SAFETY: as promised by the caller.
        unsafe {
            let places: [u32; 8] = std::array::from_fn(|slot| (node * 8 + slot) as u32);
            let node = tree.nodes.get_unchecked(node);
            let enter = bundle.box_distances::<L>(node);
            let distances = &mut *self.stacks.distances.as_mut_ptr().add(top).cast::<[f32; 8]>();
            let payload = &mut *self.stacks.places.as_mut_ptr().add(top).cast::<[u32; 8]>();
            let order = *node.order.get_unchecked(bundle.octant);
            enter.compress_le(L::splat(bundle.bundle_far), order, &places, distances, payload)
        }
    }

    /// Tests the triangles of a block for some of the rays.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; `child` must be a block of the tree.
    #[inline(always)]
    unsafe fn test_triangles<L: Lanes8>(
        &mut self,
        tree: &GroupTree,
        child: ChildRef,
        bundle: &mut Bundle,
        mut mask: u32,
        locals: &mut Locals,
        group: usize,
        instance: u32,
    ) {
        // SAFETY: as promised by the caller.
        let (block, seen) = unsafe {
            let block = tree.blocks.get_unchecked(child.block());
            (block, SeenBlock::<L>::new(block, bundle))
        };
        let used = (2 << (child.count() - 1)) - 1;
        let mut found = false;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & (RAYS - 1);
            mask &= mask - 1;
            // SAFETY: as promised by the caller.
            let mut triangles = unsafe { seen.candidates(bundle, lane) } & used;
            if triangles == 0 {
                continue;
            }
            let search = &mut self.searches[lane];
            let local =
                locals.get(|| G::Precision::local_ray(search.context.data, group, &bundle.rays.get(lane)), lane);
            let limit = search.goal.limit();
            let mut over = false;
            while triangles != 0 && !over {
                let triangle = triangles.trailing_zeros() as usize;
                triangles &= triangles - 1;
                let ids = || {
                    let (geometry, primitive) = tree.triangle(block.ids[triangle & 7]);
                    [instance, geometry, primitive]
                };
                over = test_triangle(search, local, &block.corners(triangle), ids);
            }
            if over {
                self.alive &= !(1 << lane);
                bundle.tighten(lane, -1.0);
                found = true;
            } else if search.goal.limit() < limit {
                bundle.tighten(lane, search.cull());
                found = true;
            }
        }
        if found {
            bundle.update_limits();
        }
    }

    /// Tests a shape or instance for some of the rays, one by one.
    ///
    /// # Safety
    /// The machine must have the instructions of the entries; the stacks must have room for all below the group.
    #[inline(never)]
    unsafe fn test_objects(
        &mut self,
        tree: &GroupTree,
        object: usize,
        bundle: &mut Bundle,
        mut mask: u32,
        instance: u32,
    ) {
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & (RAYS - 1);
            mask &= mask - 1;
            let search = &mut self.searches[lane];
            let ray = bundle.rays.get(lane);
            let stack: &mut Stack = &mut self.stacks.single;
            // SAFETY: as promised by the caller.
            if unsafe { test_object(self.forest, tree, object, &ray, instance, search, stack, self.enter_single) } {
                self.alive &= !(1 << lane);
                bundle.tighten(lane, -1.0);
            } else {
                bundle.tighten(lane, search.cull());
            }
        }
        bundle.update_limits();
    }

    /// Tests a shape or instance for some of the rays: in an instance they go on as a bundle if they can. False if the run is given up.
    ///
    /// # Safety
    /// As [`Self::walk`]; the stack is free from `top`.
    #[inline(never)]
    unsafe fn enter_object(
        &mut self,
        tree: &GroupTree,
        group: usize,
        object: usize,
        bundle: &mut Bundle,
        mask: u32,
        instance: u32,
        top: usize,
    ) -> bool {
        if let ObjectRef::Placed(Object::Instance { child, offset, child_from_group, mask: visible }) =
            tree.objects.get(object)
        {
            let mut wanted = mask;
            for lane in 0..RAYS {
                if self.searches[lane].mask & visible == 0 {
                    wanted &= !(1 << lane);
                }
            }
            if wanted.count_ones() as usize >= MIN_RAYS && fits(&self.forest.trees[*child]) {
                if let Some(mut below) = self.bundle_in_child(bundle, wanted, [group, *child], child_from_group) {
                    let alive = self.alive;
                    self.alive = wanted;
                    // SAFETY: as promised by the caller.
                    let complete = unsafe { (self.enter)(self, *child, &mut below, instance + offset, top) };
                    let over = wanted & !self.alive;
                    self.alive = alive & !over;
                    for lane in 0..RAYS {
                        if wanted >> lane & 1 == 1 {
                            let over = over >> lane & 1 == 1;
                            bundle.tighten(lane, if over { -1.0 } else { self.searches[lane].cull() });
                        }
                    }
                    bundle.update_limits();
                    return complete;
                }
            }
        }
        // SAFETY: as promised by the caller.
        unsafe { self.test_objects(tree, object, bundle, mask, instance) };
        true
    }

    /// Some of the rays of a bundle in the coordinates of an instanced group.
    fn bundle_in_child(
        &self,
        bundle: &Bundle,
        mask: u32,
        [group, child]: [usize; 2],
        child_from_group: &DAffine3,
    ) -> Option<Bundle> {
        let mut exact = bundle.rays.clone();
        let (mut t_min, mut cull) = ([0.0; RAYS], [-1.0; RAYS]);
        let mut valid = true;
        for lane in 0..RAYS {
            let ray = ray_in_child(child_from_group, &bundle.rays.get(lane));
            valid &= ray.is_some();
            let ray = ray.unwrap_or(DRay::new(DVec3::ZERO, DVec3::ZERO));
            for axis in 0..3 {
                exact.origin[axis][lane] = ray.origin[axis];
                exact.direction[axis][lane] = ray.direction[axis];
            }
            t_min[lane] = self.searches[lane].start;
            if mask >> lane & 1 == 1 {
                cull[lane] = self.searches[lane].cull();
            }
        }
        if !valid {
            return None;
        }
        let data = self.searches[0].context.data;
        let apex = DVec3::from(bundle.kind.apex.map(f64::from));
        let apex = child_from_group.transform_point3(G::Precision::point_of_structure(data, group, apex));
        let Kind { reversed, common, .. } = bundle.kind;
        bundle_in_group::<G>(data, child, exact, Place { apex, reversed, common, rounded: true }, &t_min, &cull)
    }
}

/// What the exact test wants to know of the rays, worked out when it is needed.
struct Locals {
    built: u32,
    rays: [MaybeUninit<LocalRay>; RAYS],
}

impl Locals {
    #[inline(always)]
    fn get(&mut self, build: impl FnOnce() -> LocalRay, lane: usize) -> &LocalRay {
        if self.built >> lane & 1 == 0 {
            self.built |= 1 << lane;
            self.rays[lane].write(build());
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
