//! The general traversal of one group: the textbook's loop, for any ray and any tree. It is used
//! for rays and trees that are not ordinary ([`crate::exact::prepared`]).

use super::filter::BlockFilter;
use super::traverse::{Entry, Stack, entry, test_object};
use crate::exact::TriangleTest;
use crate::group::test_triangle;
use crate::kernel::Goal;
use crate::kernel::single::boxes::box_distances;
use crate::search::Search;
use crate::search::region::Region;
use crate::tree::node::ChildRef;
use crate::tree::{Forest, GroupTree};
use snell_math::DRay;
use snell_math::simd::{Lanes8, Token};
use std::mem::MaybeUninit;

/// Searches one group except for its unbounded objects, nearest children first. Returns true if the
/// search is over.
///
/// # Panics
/// If `stack` has no room for the group and all groups below it.
#[inline(always)]
pub(super) fn enter<L: Lanes8, G: Goal>(
    token: L::Token,
    forest: &Forest,
    group: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    token.run(
        #[inline(always)]
        move || walk::<L, G>(token, forest, group, ray, instance, search, stack),
    )
}

#[inline(always)]
fn walk<L: Lanes8, G: Goal>(
    token: L::Token,
    forest: &Forest,
    group: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
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
            let (enters, limits) = box_distances::<L>(token, node, &local, t_min, cull);
            let met = enters.le(limits);
            if met == 0 {
                break;
            }
            let mut near = [0.0; 8];
            enters.store(&mut near);
            current = push_sorted(stack, &mut top, met, &near, &node.children);
        }
        if current.is_triangles() {
            let mut room = MaybeUninit::uninit();
            let block = tree.blocks.get(current.block(), &mut room);
            search.goal.visit(true, || Region::of_bounds(&block.bounds(current.count())));
            search.goal.count_primitives(current.count());
            let mut lanes = G::Precision::candidates::<L>(token, block, &local, t_min, cull);
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
            let (object, stack) = (current.index(), &mut stack[top..]);
            if test_object::<L, G>(token, forest, tree, object, ray, instance, search, stack) {
                return true;
            }
        }
        cull = search.cull();
        // SAFETY: `top` was 0 at first, and grows only by entries that `push_sorted` has written.
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

/// Pops entries from the stack until one is within the limit; `None` if there is none.
///
/// # Safety
/// All entries below `top` must be written.
#[inline(always)]
unsafe fn pop(stack: &Stack, top: &mut usize, cull: f32) -> Option<ChildRef> {
    while *top > 0 {
        *top -= 1;
        // SAFETY: the caller promises that entries below `top` are written, so they are within the
        // stack; `top` was just reduced.
        let next = unsafe { stack.get_unchecked(*top).assume_init() };
        if distance(next) <= cull {
            return Some(ChildRef(next as u32));
        }
    }
    None
}

/// Pushes the children that were hit (at least one) except the nearest, which is returned; nearer
/// children are on top.
#[inline(always)]
fn push_sorted(
    stack: &mut Stack,
    top: &mut usize,
    met: u32,
    near: &[f32; 8],
    children: &[ChildRef; 8],
) -> ChildRef {
    let (mut mask, mut count, mut sorted) = (met, 0, [0; 8]);
    while mask != 0 {
        let slot = mask.trailing_zeros() as usize & 7;
        mask &= mask - 1;
        let mut at = count;
        while at > 0 && distance(sorted[at - 1]) < near[slot] {
            sorted[at] = sorted[at - 1];
            at -= 1;
        }
        sorted[at] = entry(near[slot], children[slot]);
        count += 1;
    }
    let others = count - 1;
    for (to, &entry) in stack[*top..][..others].iter_mut().zip(&sorted) {
        to.write(entry);
    }
    *top += others;
    ChildRef(sorted[others] as u32)
}
