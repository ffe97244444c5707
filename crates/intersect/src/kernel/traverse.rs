//! The walk of one ray through the tree of a group and, through instances, the groups below it.

use super::node::{ChildRef, box_distances, quick_distances};
use super::quick::QuickRay;
use super::ray::LocalRay;
use super::triangle::{candidates, hit_in_plane, is_behind, lines_through, plane_distance};
use crate::accel::bvh::{Forest, GroupTree};
use crate::accel::group::{self, offer_triangle, test_triangle};
use crate::query::search::{Goal, Search};
use snell_math::simd::{Lanes8, Level, Portable8};
use snell_math::{DRay, Ray};
use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

/// A child to visit later: its reference below, the bits of its distance above.
pub(super) type Entry = u64;

/// The walk's memory: uninitialised entries, enough for the deepest path through all groups ([`Forest::stack_size`]).
pub(super) type Stack = [MaybeUninit<Entry>];

/// Entries on the thread's stack; deeper forests take memory per query.
pub(super) const SMALL_STACK: usize = 512;

#[inline(always)]
fn entry(distance: f32, child: ChildRef) -> Entry {
    (u64::from(distance.to_bits()) << 32) | u64::from(child.0)
}

#[inline(always)]
fn distance(entry: Entry) -> f32 {
    f32::from_bits((entry >> 32) as u32)
}

/// Searches the forest from its root.
#[inline]
pub(crate) fn search_forest<G: Goal>(forest: &Forest, level: Level, search: &mut Search<'_, G>) {
    let mut small = [const { MaybeUninit::<Entry>::uninit() }; SMALL_STACK];
    if forest.stack_size <= SMALL_STACK {
        enter_root(forest, level, search, &mut small);
    } else {
        let mut large = vec![MaybeUninit::<Entry>::uninit(); forest.stack_size];
        enter_root(forest, level, search, &mut large);
    }
}

#[inline]
fn enter_root<G: Goal>(forest: &Forest, level: Level, search: &mut Search<'_, G>, stack: &mut Stack) {
    let ray = DRay::from(search.ray as &Ray);
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `World` holds only levels that the machine supports, and the stack has `stack_size` entries.
        Level::Avx2 | Level::Avx512 => unsafe { walk_avx2(forest, 0, &ray, 0, search, stack) },
        // SAFETY: portable code, and the stack has `stack_size` entries.
        _ => unsafe { walk_portable(forest, 0, &ray, 0, search, stack) },
    };
}

/// # Safety
/// The machine must have AVX2; `stack` must have room for the group and all below it.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn walk_avx2<G: Goal>(
    forest: &Forest,
    group: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    use snell_math::simd::Avx8;
    // SAFETY: as promised by the caller.
    unsafe { walk::<Avx8, G>(forest, group, ray, instance, search, stack, walk_avx2::<G>) }
}

/// # Safety
/// `stack` must have room for the group and all below it.
pub(super) unsafe fn walk_portable<G: Goal>(
    forest: &Forest,
    group: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    // SAFETY: as promised by the caller.
    unsafe { walk::<Portable8, G>(forest, group, ray, instance, search, stack, walk_portable::<G>) }
}

/// The entry of a level, for the step into an instance.
pub(super) type Walk<G> = unsafe fn(&Forest, usize, &DRay, u32, &mut Search<'_, G>, &mut Stack) -> bool;

/// Walks one group, nearest children first. True if the search is over.
///
/// # Safety
/// The machine must have the instructions of `L`; `stack` must have room for the group and all below it; `enter` must be the
/// entry of the same level.
#[inline(always)]
unsafe fn walk<L: Lanes8, G: Goal>(
    forest: &Forest,
    group: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
    enter: Walk<G>,
) -> bool {
    let tree = &forest.trees[group];
    for &object in &tree.unbounded {
        // SAFETY: as promised by the caller.
        if unsafe { test_object(forest, tree, object as usize, ray, instance, search, stack, enter) } {
            return true;
        }
    }
    if tree.root == ChildRef::NONE {
        return false;
    }
    let mut quick = QuickRay::UNSET;
    // The root's ray is the one of the search.
    let is_quick = forest.ordinary
        && if group == 0 {
            quick.set_from_ray::<L>(search.ray)
        } else {
            search.ray.t_min >= 0.0 && quick.set_from_exact::<L>(&ray.origin, &ray.direction)
        };
    let place = Place { forest, tree, ray, instance, enter };
    // SAFETY: as promised by the caller.
    unsafe { if is_quick { place.walk::<L>(&quick, search, stack) } else { place.walk_carefully::<L>(search, stack) } }
}

/// Where a ray walks.
struct Place<'a, G> {
    forest: &'a Forest,
    tree: &'a GroupTree,
    ray: &'a DRay,
    instance: u32,
    enter: Walk<G>,
}

impl<G: Goal> Place<'_, G> {
    /// The walk of an ordinary ray.
    ///
    /// # Safety
    /// As [`walk`]; `quick` must be prepared for `L`.
    #[inline(always)]
    unsafe fn walk<L: Lanes8>(&self, quick: &QuickRay, search: &mut Search<'_, G>, stack: &mut Stack) -> bool {
        let t_min = search.ray.t_min;
        let (mut top, mut current, mut cull) = (0, self.tree.root, search.cull());
        loop {
            while current.is_node() {
                search.goal.count_node();
                // SAFETY: the builder makes only references to nodes that exist; the rest is promised by the caller.
                let (node, enters, limits) = unsafe {
                    let node = self.tree.nodes.get_unchecked(current.index());
                    let (enters, limits) = quick_distances::<L>(node, quick, t_min, cull);
                    (node, enters, limits)
                };
                let met = enters.le(limits);
                if met == 0 {
                    break;
                }
                let first = met.trailing_zeros() as usize & 7;
                if met & (met - 1) == 0 {
                    current = node.children[first];
                    continue;
                }
                let mut near = [0.0; 8];
                enters.store(&mut near);
                let others = met & (met - 1);
                let second = others.trailing_zeros() as usize & 7;
                if others & (others - 1) == 0 {
                    // Two, most often. Which of them is nearer is as good as random.
                    let [a, b] = [first, second].map(|slot| entry(near[slot], node.children[slot]));
                    let is_first_nearer = near[first] <= near[second];
                    // SAFETY: as below.
                    unsafe { stack.get_unchecked_mut(top).write(select_unpredictable(is_first_nearer, b, a)) };
                    top += 1;
                    current = ChildRef(select_unpredictable(is_first_nearer, a, b) as u32);
                    continue;
                }
                // SAFETY: a walk holds at most 7 entries per level, so there are 8 free ones by the builder's count;
                // `push_sorted` writes at least one.
                unsafe {
                    top = push_sorted(stack, top, met, &near, &node.children) - 1;
                    current = ChildRef(stack.get_unchecked(top).assume_init() as u32);
                }
            }
            if current.is_triangles() {
                search.goal.count_primitives(current.count());
                // SAFETY: the builder makes only references to blocks that exist; the rest is promised by the caller.
                let (block, mut lanes) = unsafe {
                    let block = self.tree.blocks.get_unchecked(current.block());
                    (block, lines_through::<L>(block, quick) & ((2 << (current.count() - 1)) - 1))
                };
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize & 7;
                    lanes &= lanes - 1;
                    let (corners, t_min) = (block.corners(lane), f64::from(t_min));
                    let plane = plane_distance(&self.ray.origin, &self.ray.direction, &corners);
                    if is_behind(plane, t_min) {
                        continue;
                    }
                    let found = hit_in_plane(&quick.exact(self.ray.origin, self.ray.direction), &corners, plane, t_min);
                    let ids = || {
                        let (geometry, primitive) = self.tree.triangle(block.ids[lane]);
                        [self.instance, geometry, primitive]
                    };
                    if offer_triangle(search, found, ids) {
                        return true;
                    }
                    cull = search.cull();
                }
            } else if current.is_object() {
                // SAFETY: as promised by the caller; the entries below `top` stay as they are.
                if unsafe { self.test_object(current, search, stack.get_unchecked_mut(top..)) } {
                    return true;
                }
                cull = search.cull();
            }
            // SAFETY: all entries below `top` are written.
            match unsafe { pop(stack, &mut top, cull) } {
                Some(next) => current = next,
                None => return false,
            }
        }
    }

    /// The walk of any ray.
    ///
    /// # Safety
    /// As [`walk`].
    #[inline(always)]
    unsafe fn walk_carefully<L: Lanes8>(&self, search: &mut Search<'_, G>, stack: &mut Stack) -> bool {
        let local = LocalRay::new(self.ray);
        let t_min = search.ray.t_min;
        let (mut top, mut current, mut cull) = (0, self.tree.root, search.cull());
        loop {
            while current.is_node() {
                search.goal.count_node();
                let node = &self.tree.nodes[current.index()];
                // SAFETY: as promised by the caller.
                let (enters, limits) = unsafe { box_distances::<L>(node, &local, t_min, cull) };
                let met = enters.le(limits);
                if met == 0 {
                    break;
                }
                let mut near = [0.0; 8];
                enters.store(&mut near);
                // SAFETY: as in `walk`.
                unsafe {
                    top = push_sorted(stack, top, met, &near, &node.children) - 1;
                    current = ChildRef(stack.get_unchecked(top).assume_init() as u32);
                }
            }
            if current.is_triangles() {
                let block = &self.tree.blocks[current.block()];
                search.goal.count_primitives(current.count());
                // SAFETY: as promised by the caller.
                let mut lanes = unsafe { candidates::<L>(block, &local, t_min, cull) };
                lanes &= (2 << (current.count() - 1)) - 1;
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize & 7;
                    lanes &= lanes - 1;
                    let ids = || {
                        let (geometry, primitive) = self.tree.triangle(block.ids[lane]);
                        [self.instance, geometry, primitive]
                    };
                    if test_triangle(search, &local, &block.corners(lane), ids) {
                        return true;
                    }
                }
            } else if current.is_object() {
                // SAFETY: as promised by the caller; the entries below `top` stay as they are.
                if unsafe { self.test_object(current, search, stack.get_unchecked_mut(top..)) } {
                    return true;
                }
            }
            cull = search.cull();
            // SAFETY: all entries below `top` are written.
            match unsafe { pop(stack, &mut top, cull) } {
                Some(next) => current = next,
                None => return false,
            }
        }
    }

    /// # Safety
    /// As [`walk`].
    unsafe fn test_object(&self, object: ChildRef, search: &mut Search<'_, G>, stack: &mut Stack) -> bool {
        let Self { forest, tree, ray, instance, enter } = *self;
        // SAFETY: as promised by the caller.
        unsafe { test_object(forest, tree, object.index(), ray, instance, search, stack, enter) }
    }
}

/// Takes entries from the stack until one is not too far.
///
/// # Safety
/// All entries below `top` must be written.
#[inline(always)]
unsafe fn pop(stack: &Stack, top: &mut usize, cull: f32) -> Option<ChildRef> {
    while *top > 0 {
        *top -= 1;
        // SAFETY: as promised by the caller.
        let next = unsafe { stack.get_unchecked(*top).assume_init() };
        if distance(next) <= cull {
            return Some(ChildRef(next as u32));
        }
    }
    None
}

/// Pushes the children that were met, the nearest on top, and returns the new top.
///
/// # Safety
/// `stack` must have 8 entries from `top`.
#[inline(always)]
unsafe fn push_sorted(stack: &mut Stack, top: usize, met: u32, near: &[f32; 8], children: &[ChildRef; 8]) -> usize {
    let mut mask = met;
    let mut end = top;
    while mask != 0 {
        let slot = mask.trailing_zeros() as usize & 7;
        mask &= mask - 1;
        let new = near[slot];
        let mut at = end;
        while at > top {
            // SAFETY: entries from `top` to `end` were just written.
            let before = unsafe { stack.get_unchecked(at - 1).assume_init() };
            if distance(before) >= new {
                break;
            }
            // SAFETY: `at <= end`, which is free by the caller's promise.
            unsafe { stack.get_unchecked_mut(at).write(before) };
            at -= 1;
        }
        // SAFETY: as above.
        unsafe { stack.get_unchecked_mut(at).write(entry(new, children[slot])) };
        end += 1;
    }
    end
}

/// Tests a shape or a primitive of a set, or walks the group of an instance.
///
/// # Safety
/// As [`walk`].
#[inline(never)]
pub(super) unsafe fn test_object<G: Goal>(
    forest: &Forest,
    tree: &GroupTree,
    object: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
    enter: Walk<G>,
) -> bool {
    group::test_object(&tree.objects, object, ray, instance, search, |child, ray, instance, search| {
        // SAFETY: as promised by the caller: the stack has room for all below this group.
        unsafe { enter(forest, child, ray, instance, search, stack) }
    })
}
