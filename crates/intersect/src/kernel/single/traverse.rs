//! The traversal of the tree of a group by one ray and, through instances, of the groups below it.

use super::filter::BlockFilter;
use super::general;
use crate::exact::TriangleTest;
use crate::exact::prepared::PreparedRay;
use crate::group;
use crate::group::{Object, Placement, offer_triangle};
use crate::kernel::Goal;
use crate::kernel::single::boxes::PreparedBoxes;
use crate::precision::Facts;
use crate::search::Search;
use crate::search::region::Region;
use crate::tree::SMALL_STACK;
use crate::tree::node::ChildRef;
use crate::tree::{Forest, GroupTree};
use snell_math::simd::{Lanes8, Portable, Portable8, Token, Wide, Wide8, WideToken};
use snell_math::{DRay, DVec3};
use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

/// A child to visit later: its reference in the low bits, the bits of its distance in the high
/// ones. Distances are not negative, so that entries are ordered by their distances.
pub(crate) type Entry = u64;

/// The stack of a traversal: uninitialised entries, enough for the deepest path through all groups
/// ([`Forest::stack_size`]).
pub(crate) type Stack = [MaybeUninit<Entry>];

/// The entry at the bottom of the stack, where the traversal ends.
const END: Entry = ChildRef::NONE.0 as Entry;

#[inline(always)]
pub(crate) fn entry(distance: f32, child: ChildRef) -> Entry {
    (u64::from(distance.to_bits()) << 32) | u64::from(child.0)
}

/// An entry greater than all entries that are not beyond `cull`, which must not be negative.
#[inline(always)]
fn first_beyond(cull: f32) -> Entry {
    (u64::from(cull.to_bits()) + 1) << 32
}

/// Searches the forest from its root. Invalid rays find nothing.
#[inline(always)]
pub(crate) fn search_forest<G: Goal>(
    forest: &Forest,
    wide: Option<Wide>,
    search: &mut Search<'_, G>,
) {
    match wide {
        Some(wide) => {
            let token = WideToken::from(wide);
            token.run(
                #[inline(always)]
                move || search_root::<Wide8, G>(token, forest, search),
            );
        }
        None => Portable.run(
            #[inline(always)]
            move || search_root::<Portable8, G>(Portable, forest, search),
        ),
    }
}

/// Searches a group. Returns true if the search is over.
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
        move || Place::<L>::new(token, forest, group, ray, instance).search(search, stack),
    )
}

#[inline(always)]
fn search_root<L: Lanes8, G: Goal>(token: L::Token, forest: &Forest, search: &mut Search<'_, G>) {
    let mut prepared = PreparedRay::UNSET;
    if !forest.simple
        || !G::Precision::prepare_root::<L>(search.context.data, &mut prepared, search.ray)
    {
        return search_with_care::<L, G>(token, forest, search);
    }
    let ray = G::Precision::exact(search.ray);
    let mut stack = [const { MaybeUninit::uninit() }; SMALL_STACK];
    Place::<L>::new(token, forest, 0, &ray, 0).walk(&prepared, search, &mut stack);
}

/// Searches a forest that is not simple, or with a ray that is not ordinary.
#[inline(never)]
fn search_with_care<L: Lanes8, G: Goal>(
    token: L::Token,
    forest: &Forest,
    search: &mut Search<'_, G>,
) {
    if !G::Precision::is_valid(search.ray) {
        return;
    }
    let mut small = [const { MaybeUninit::uninit() }; SMALL_STACK];
    let mut large = Vec::new();
    let stack = if forest.stack_size() <= SMALL_STACK {
        &mut small[..]
    } else {
        large.resize(forest.stack_size(), MaybeUninit::uninit());
        &mut large[..]
    };
    enter::<L, G>(token, forest, 0, &G::Precision::exact(search.ray), 0, search, stack);
}

/// The group that a ray traverses.
#[derive(Clone, Copy)]
struct Place<'a, L: Lanes8> {
    token: L::Token,
    forest: &'a Forest,
    tree: &'a GroupTree,
    group: usize,
    ray: &'a DRay,
    instance: u32,
}

impl<'a, L: Lanes8> Place<'a, L> {
    #[inline(always)]
    fn new(
        token: L::Token,
        forest: &'a Forest,
        group: usize,
        ray: &'a DRay,
        instance: u32,
    ) -> Self {
        Self { token, forest, tree: &forest.trees[group], group, ray, instance }
    }

    /// Searches the group. Returns true if the search is over.
    ///
    /// # Panics
    /// If `stack` has no room for the group and all groups below it.
    #[inline(always)]
    fn search<G: Goal>(self, search: &mut Search<'_, G>, stack: &mut Stack) -> bool {
        let Self { token, forest, tree, group, ray, instance } = self;
        let mut prepared = PreparedRay::UNSET;
        let is_prepared = forest.ordinary
            && search.start >= 0.0
            && G::Precision::prepare::<L>(search.context.data, group, &mut prepared, ray);
        // A ray that overflowed in the transformation to this group hits nothing.
        if !(is_prepared || (ray.origin.is_finite() && ray.direction.is_finite())) {
            return false;
        }
        for &object in &tree.unbounded {
            let object = object as usize;
            if test_object::<L, G>(token, forest, tree, object, ray, instance, search, stack) {
                return true;
            }
        }
        if is_prepared {
            self.enter_prepared(&prepared, search, stack)
        } else {
            general::enter::<L, G>(token, forest, group, ray, instance, search, stack)
        }
    }

    /// Calls [`Self::walk`] without inlining it.
    #[inline(always)]
    fn enter_prepared<G: Goal>(
        self,
        prepared: &PreparedRay,
        search: &mut Search<'_, G>,
        stack: &mut Stack,
    ) -> bool {
        self.token.run(
            #[inline(always)]
            move || self.walk(prepared, search, stack),
        )
    }

    /// Traverses the group with an ordinary ray, which must be prepared for `L`, nearest children
    /// first. Returns true if the search is over.
    ///
    /// # Panics
    /// If `stack` has no room for the group and all groups below it.
    #[inline(always)]
    fn walk<G: Goal>(
        &self,
        prepared: &PreparedRay,
        search: &mut Search<'_, G>,
        stack: &mut Stack,
    ) -> bool {
        let token = self.token;
        let boxes = PreparedBoxes::<L>::new(token, prepared, self.forest.extents[self.group]);
        // Adding 0 turns -0 into +0.
        let t_min = L::splat(token, search.start + 0.0);
        assert!(stack.len() >= self.forest.stack_sizes[self.group], "room for the way down");
        let mut cull = search.cull();
        let mut beyond = first_beyond(cull);
        let is_ascending = is_ascending(self.ray.direction);
        let (mut top, mut current) = (1, self.tree.root);
        // SAFETY: the assertion above compares with `stack_sizes`, which has 7 entries for each
        // level of the tree and 8 more. The traversal leaves at most 7 a level, above `END`.
        unsafe { stack.get_unchecked_mut(0).write(END) };
        loop {
            if current.is_node() {
                search.goal.count_node();
                // SAFETY: `current` is a reference of the tree, which has its node (`GroupTree`).
                let node = unsafe { self.tree.nodes.get_unchecked(current.index()) };
                let (enters, limits) = boxes.distances(node, t_min, L::splat(token, cull));
                let met = enters.le(limits);
                search.goal.visit(false, || Region::of_bounds(&node.bounds()));
                if !G::NARROWS && met != 0 {
                    // SAFETY: at most 7 of eight children are pushed, for which the assertion above
                    // found room at each level, and `met` is not 0.
                    current = unsafe {
                        push_unsorted(stack, &mut top, met, is_ascending, &node.children)
                    };
                    continue;
                }
                if met != 0 {
                    let first = met.trailing_zeros() as usize & 7;
                    let others = met & (met - 1);
                    if others == 0 {
                        current = node.children[first];
                        continue;
                    }
                    let mut near = [0.0; 8];
                    enters.store(&mut near);
                    let second = others.trailing_zeros() as usize & 7;
                    let rest = others & (others - 1);
                    if rest == 0 {
                        // Two children are the most frequent case. A branch, although it is often
                        // mispredicted, because the next steps need not wait for the distances.
                        let (a, b) = (node.children[first], node.children[second]);
                        // SAFETY: one child is pushed, and the assertion above found room for 7 a
                        // level.
                        let next = unsafe { stack.get_unchecked_mut(top) };
                        if near[first] < near[second] {
                            // SAFETY: the pointer is valid. (The write is volatile, because
                            // otherwise the compiler merges the two branches into conditional
                            // moves.)
                            unsafe { next.as_mut_ptr().write_volatile(entry(near[second], b)) };
                            current = a;
                        } else {
                            next.write(entry(near[first], a));
                            current = b;
                        }
                        top += 1;
                        continue;
                    }
                    let [a, b] = [first, second].map(|slot| entry(near[slot], node.children[slot]));
                    let (mut nearest, farther) =
                        (select_unpredictable(a < b, a, b), select_unpredictable(a < b, b, a));
                    // SAFETY: at most 7 of eight children are pushed, for which the assertion above
                    // found room at each level.
                    unsafe {
                        stack.get_unchecked_mut(top).write(farther);
                        nearest = push_sorted(stack, top, nearest, rest, &near, &node.children);
                    }
                    top += rest.count_ones() as usize + 1;
                    current = ChildRef(nearest as u32);
                    continue;
                }
            } else if current.is_triangles() {
                let mut room = MaybeUninit::uninit();
                // SAFETY: `current` is a reference of the tree, which has its block (`GroupTree`).
                let block =
                    unsafe { self.tree.blocks.at().block::<L>(token, current.block(), &mut room) };
                let mut lanes = G::Precision::lines_through::<L>(token, block, prepared)
                    & ((2 << (current.count() - 1)) - 1);
                search.goal.visit(true, || Region::of_bounds(&block.bounds(current.count())));
                search.goal.count_primitives(current.count());
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize & 7;
                    lanes &= lanes - 1;
                    let ids = || {
                        let (geometry, primitive) = self.tree.triangle(block.ids[lane]);
                        [self.instance, geometry, primitive]
                    };
                    let corners = block.corners(lane);
                    let (origin, direction) = (&self.ray.origin, &self.ray.direction);
                    let found = G::Precision::hit_on_line(
                        search, prepared, origin, direction, &corners, ids,
                    );
                    if found.is_some() {
                        if offer_triangle(search, found) {
                            return true;
                        }
                        cull = search.cull();
                        beyond = first_beyond(cull);
                    }
                }
            } else if current.is_object() {
                if self.test_object(current.index(), search, &mut stack[top..]) {
                    return true;
                }
                cull = search.cull();
                beyond = first_beyond(cull);
            } else {
                return false;
            }
            // SAFETY: entries below `top` were pushed. `END`, the lowest, is never beyond the limit
            // and ends the traversal, so `top` was at least 1.
            current = unsafe {
                loop {
                    top -= 1;
                    let next = stack.get_unchecked(top).assume_init();
                    // For goals that do not narrow the limit, no entry is beyond it.
                    if !G::NARROWS || next < beyond {
                        break ChildRef(next as u32);
                    }
                }
            };
        }
    }

    /// Performs [`test_object`] for an ordinary ray in an ordinary forest. Most instances are
    /// static, and the ray is ordinary in their coordinates too, so they are entered directly.
    #[inline(always)]
    fn test_object<G: Goal>(
        self,
        object: usize,
        search: &mut Search<'_, G>,
        stack: &mut Stack,
    ) -> bool {
        self.token.run(
            #[inline(always)]
            move || self.test_object_prepared(object, search, stack),
        )
    }

    #[inline(always)]
    fn test_object_prepared<G: Goal>(
        self,
        object: usize,
        search: &mut Search<'_, G>,
        stack: &mut Stack,
    ) -> bool {
        let Self { token, forest, tree, ray, instance, .. } = self;
        if let Some(Object::Instance {
            child,
            offset,
            child_from_group: Placement::Still(map),
            mask,
        }) = tree.objects.placed().get(object)
        {
            if mask & search.mask == 0 {
                return false;
            }
            if search.is_given_up() {
                return true;
            }
            let ray = group::mapped(map, ray);
            let mut prepared = PreparedRay::UNSET;
            if forest.trees[*child].unbounded.is_empty()
                && G::Precision::prepare::<L>(search.context.data, *child, &mut prepared, &ray)
            {
                search.goal.count_instance();
                search.goal.enter(map);
                let below = Place::<L>::new(token, forest, *child, &ray, instance + offset);
                let is_over = below.enter_prepared(&prepared, search, stack);
                search.goal.leave();
                return is_over;
            }
        }
        test_object::<L, G>(token, forest, tree, object, ray, instance, search, stack)
    }
}

/// True if the component of a direction with the largest magnitude is positive. Children are stored
/// in a node in the order of their positions along the axes, so for such a ray those in the last
/// slots are ahead.
#[inline(always)]
fn is_ascending(direction: DVec3) -> bool {
    let size = direction.abs();
    let along = if size.x > size.y { direction.x } else { direction.y };
    let along = if size.z > size.x.max(size.y) { direction.z } else { along };
    along > 0.0
}

/// Pushes children above `top` in slot order along the ray, without comparing distances, and
/// returns the last. For occlusion rays sorting by distance does not pay: the nearest surface is
/// mostly the one that the ray leaves, and sorting takes longer than it saves.
///
/// # Safety
/// `stack` must have room for the children, and there must be at least one.
#[inline(always)]
unsafe fn push_unsorted(
    stack: &mut Stack,
    top: &mut usize,
    met: u32,
    is_ascending: bool,
    children: &[ChildRef; 8],
) -> ChildRef {
    let (mut rest, turn) =
        if is_ascending { (met, 0) } else { (u32::from((met as u8).reverse_bits()), 7) };
    loop {
        let child = children[(rest.trailing_zeros() ^ turn) as usize & 7];
        rest &= rest - 1;
        if rest == 0 {
            return child;
        }
        // SAFETY: this is done once for each bit of `met` but the last, and the caller promises
        // room for all of them above `top`.
        unsafe { stack.get_unchecked_mut(*top).write(entry(0.0, child)) };
        *top += 1;
    }
}

/// Sorts more children into the stack, far ones first, given one entry at `top` and one child
/// nearer than that; returns the new nearest child.
///
/// # Safety
/// `stack` must have room for the children, and the entry at `top` must be written.
#[inline(always)]
unsafe fn push_sorted(
    stack: &mut Stack,
    top: usize,
    mut nearest: Entry,
    mut rest: u32,
    near: &[f32; 8],
    children: &[ChildRef; 8],
) -> Entry {
    let mut end = top;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize & 7;
        rest &= rest - 1;
        let new = entry(near[slot], children[slot]);
        let (new_nearest, new) = (
            select_unpredictable(new < nearest, new, nearest),
            select_unpredictable(new < nearest, nearest, new),
        );
        nearest = new_nearest;
        end += 1;
        let mut at = end;
        // SAFETY: the caller has written the entry at `top`, and earlier turns of the loop those up
        // to `end - 1`. The caller promises room for one entry for each bit of `rest`.
        unsafe {
            while at > top && stack.get_unchecked(at - 1).assume_init() < new {
                let before = stack.get_unchecked(at - 1).assume_init();
                stack.get_unchecked_mut(at).write(before);
                at -= 1;
            }
            stack.get_unchecked_mut(at).write(new);
        }
    }
    nearest
}

/// Tests a shape or a primitive of a set, or traverses the group of an instance. Returns true if
/// the search is over.
///
/// # Panics
/// If `stack` has no room for all groups below this one.
#[inline(never)]
pub(crate) fn test_object<L: Lanes8, G: Goal>(
    token: L::Token,
    forest: &Forest,
    tree: &GroupTree,
    object: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    group::test_object(
        &tree.objects,
        object,
        ray,
        instance,
        search,
        |child, ray, instance, search| {
            enter::<L, G>(token, forest, child, ray, instance, search, stack)
        },
    )
}
