//! The walk of any ray through one group: of rays and trees that are not ordinary
//! ([`crate::exact::quick`]).

use super::filter::BlockFilter;
use super::traverse;
use super::traverse::{Entry, Stack, Walk, entry, test_object};
use crate::exact::TriangleTest;
use crate::group::test_triangle;
use crate::kernel::Goal;
use crate::search::Search;
use crate::search::region::Region;
use crate::tree::node::{ChildRef, box_distances};
use crate::tree::{Forest, GroupTree};
use snell_math::DRay;
use snell_math::simd::{Lanes8, Portable8};
use std::mem::MaybeUninit;

/// # Safety
/// The machine must have AVX2; `stack` must have room for the group and all below it.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(crate) unsafe fn walk_avx2<G: Goal>(
    forest: &Forest,
    group: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    use snell_math::simd::Avx8;
    // SAFETY: as promised by the caller.
    unsafe {
        walk::<Avx8, G>(forest, group, ray, instance, search, stack, traverse::walk_avx2::<G>)
    }
}

/// # Safety
/// `stack` must have room for the group and all below it.
pub(crate) unsafe fn walk_portable<G: Goal>(
    forest: &Forest,
    group: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    // SAFETY: as promised by the caller.
    unsafe {
        walk::<Portable8, G>(
            forest,
            group,
            ray,
            instance,
            search,
            stack,
            traverse::walk_portable::<G>,
        )
    }
}

/// Walks one group, nearest children first. True if the search is over.
///
/// # Safety
/// The machine must have the instructions of `L`; `stack` must have room for the group and all
/// below it; `enter` must be the entry of the same level.
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
    let tree: &GroupTree = &forest.trees[group];
    let local = G::Precision::local_ray(search.context.data, group, ray);
    let t_min = search.start;
    let (mut top, mut current, mut cull) = (0, tree.root, search.cull());
    loop {
        while current.is_node() {
            search.goal.count_node();
            let node = &tree.nodes[current.index()];
            search.goal.visit(false, || Region::of_bounds(&node.bounds()));
            // SAFETY: as promised by the caller.
            let (enters, limits) = unsafe { box_distances::<L>(node, &local, t_min, cull) };
            let met = enters.le(limits);
            if met == 0 {
                break;
            }
            let mut near = [0.0; 8];
            enters.store(&mut near);
            // SAFETY: a walk holds at most 7 entries per level, so there are 8 free ones by the
            // builder's count; `push_sorted` writes at least one.
            unsafe {
                top = push_sorted(stack, top, met, &near, &node.children) - 1;
                current = ChildRef(stack.get_unchecked(top).assume_init() as u32);
            }
        }
        if current.is_triangles() {
            let mut room = MaybeUninit::uninit();
            let block = tree.blocks.get(current.block(), &mut room);
            search.goal.visit(true, || Region::of_bounds(&block.bounds(current.count())));
            search.goal.count_primitives(current.count());
            // SAFETY: as promised by the caller.
            let mut lanes = unsafe { G::Precision::candidates::<L>(block, &local, t_min, cull) };
            lanes &= (2 << (current.count() - 1)) - 1;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 7;
                lanes &= lanes - 1;
                let ids = || {
                    let (geometry, primitive) = tree.triangle(block.ids[lane]);
                    [instance, geometry, primitive]
                };
                if test_triangle(search, &local, &block.corners(lane), ids) {
                    return true;
                }
            }
        } else if current.is_object() {
            // SAFETY: as promised by the caller; the entries below `top` stay as they are.
            if unsafe {
                test_object(
                    forest,
                    tree,
                    current.index(),
                    ray,
                    instance,
                    search,
                    stack.get_unchecked_mut(top..),
                    enter,
                )
            } {
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

/// The distance of an entry.
#[inline(always)]
fn distance(entry: Entry) -> f32 {
    f32::from_bits((entry >> 32) as u32)
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
unsafe fn push_sorted(
    stack: &mut Stack,
    top: usize,
    met: u32,
    near: &[f32; 8],
    children: &[ChildRef; 8],
) -> usize {
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
