//! The walk of one ray through the tree of a group and, through instances, the groups below it.

use super::careful;
use super::filter::BlockFilter;
use crate::exact::TriangleTest;
use crate::exact::quick::QuickRay;
use crate::group;
use crate::group::{Object, Placement, offer_triangle};
use crate::kernel::Goal;
use crate::precision::Facts;
use crate::search::Search;
use crate::search::region::Region;
use crate::tree::SMALL_STACK;
use crate::tree::node::{ChildRef, QuickBoxes};
use crate::tree::{Forest, GroupTree};
use snell_math::simd::{Lanes8, Level, Portable8};
use snell_math::{DRay, DVec3};
use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

/// A child to visit later: its reference below, the bits of its distance above. Distances are not
/// negative, so that entries are in the order of their distances.
pub(crate) type Entry = u64;

/// The walk's memory: uninitialised entries, enough for the deepest path through all groups
/// ([`Forest::stack_size`]).
pub(crate) type Stack = [MaybeUninit<Entry>];

/// At the bottom of the stack: here the walk ends.
const END: Entry = ChildRef::NONE.0 as Entry;

#[inline(always)]
pub(crate) fn entry(distance: f32, child: ChildRef) -> Entry {
    (u64::from(distance.to_bits()) << 32) | u64::from(child.0)
}

/// Above all entries that are not beyond `cull`, which is not negative.
#[inline(always)]
fn first_beyond(cull: f32) -> Entry {
    (u64::from(cull.to_bits()) + 1) << 32
}

/// Searches the forest from its root. Rays that are not valid find nothing.
#[inline(always)]
pub(crate) fn search_forest<G: Goal>(forest: &Forest, level: Level, search: &mut Search<'_, G>) {
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `World` holds only levels that the machine supports.
        Level::Avx2 | Level::Avx512 => unsafe { search_avx2(forest, search) },
        _ => search_portable(forest, search),
    }
}

/// # Safety
/// The machine must have AVX2.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn search_avx2<G: Goal>(forest: &Forest, search: &mut Search<'_, G>) {
    // SAFETY: as promised by the caller.
    unsafe { search_root::<snell_math::simd::Avx8, G>(forest, search, Walks::AVX2) }
}

#[inline(never)]
fn search_portable<G: Goal>(forest: &Forest, search: &mut Search<'_, G>) {
    // SAFETY: portable code.
    unsafe { search_root::<Portable8, G>(forest, search, Walks::PORTABLE) }
}

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
    let place =
        Place { forest, tree: &forest.trees[group], group, ray, instance, walks: Walks::AVX2 };
    // SAFETY: as promised by the caller.
    unsafe { place.search::<snell_math::simd::Avx8>(search, stack) }
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
    let place =
        Place { forest, tree: &forest.trees[group], group, ray, instance, walks: Walks::PORTABLE };
    // SAFETY: as promised by the caller.
    unsafe { place.search::<Portable8>(search, stack) }
}

/// # Safety
/// As [`walk_avx2`]; the ray must be prepared for it.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn walk_quick_avx2<G: Goal>(
    forest: &Forest,
    group: usize,
    ray: &DRay,
    quick: &QuickRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    let place =
        Place { forest, tree: &forest.trees[group], group, ray, instance, walks: Walks::AVX2 };
    // SAFETY: as promised by the caller.
    unsafe { place.walk::<snell_math::simd::Avx8>(quick, search, stack) }
}

/// # Safety
/// As [`walk_portable`]; the ray must be prepared for it.
unsafe fn walk_quick_portable<G: Goal>(
    forest: &Forest,
    group: usize,
    ray: &DRay,
    quick: &QuickRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    let place =
        Place { forest, tree: &forest.trees[group], group, ray, instance, walks: Walks::PORTABLE };
    // SAFETY: as promised by the caller.
    unsafe { place.walk::<Portable8>(quick, search, stack) }
}

/// The entry of a level, for the step into an instance.
pub(crate) type Walk<G> =
    unsafe fn(&Forest, usize, &DRay, u32, &mut Search<'_, G>, &mut Stack) -> bool;

/// [`Walk`] with a ray that is prepared; the group must have nothing unbounded.
type QuickWalk<G> =
    unsafe fn(&Forest, usize, &DRay, &QuickRay, u32, &mut Search<'_, G>, &mut Stack) -> bool;

/// [`test_object`] at a level.
type ObjectTest<G> =
    unsafe fn(&Forest, &GroupTree, usize, &DRay, u32, &mut Search<'_, G>, &mut Stack) -> bool;

/// The ways of a level that are not inlined.
#[derive(Clone, Copy)]
struct Walks<G: Goal> {
    /// Searches a group.
    enter: Walk<G>,
    /// Walks through a group with a ray that may not be ordinary.
    careful: Walk<G>,
    /// The same with an ordinary ray.
    quick: QuickWalk<G>,
    /// Tests an object of a group with an ordinary ray.
    object: ObjectTest<G>,
}

impl<G: Goal> Walks<G> {
    #[cfg(target_arch = "x86_64")]
    const AVX2: Self = Self {
        enter: walk_avx2::<G>,
        careful: careful::walk_avx2::<G>,
        quick: walk_quick_avx2::<G>,
        object: test_object_avx2::<G>,
    };
    const PORTABLE: Self = Self {
        enter: walk_portable::<G>,
        careful: careful::walk_portable::<G>,
        quick: walk_quick_portable::<G>,
        object: test_object_portable::<G>,
    };
}

/// # Safety
/// The machine must have the instructions of `L`, and the walks must be of the same level.
#[inline(always)]
unsafe fn search_root<L: Lanes8, G: Goal>(
    forest: &Forest,
    search: &mut Search<'_, G>,
    walks: Walks<G>,
) {
    let mut quick = QuickRay::UNSET;
    if !forest.simple
        || !G::Precision::prepare_root::<L>(search.context.data, &mut quick, search.ray)
    {
        // SAFETY: as promised by the caller.
        return unsafe { search_with_care(forest, search, walks) };
    }
    let ray = G::Precision::exact(search.ray);
    let place = Place { forest, tree: &forest.trees[0], group: 0, ray: &ray, instance: 0, walks };
    let mut stack = [const { MaybeUninit::uninit() }; SMALL_STACK];
    // SAFETY: as promised by the caller, and the stack has `stack_size` entries.
    unsafe { place.walk::<L>(&quick, search, &mut stack) };
}

/// Searches a forest that is not simple, or with a ray that is not ordinary.
///
/// # Safety
/// The machine must be of the level of the walks.
#[inline(never)]
unsafe fn search_with_care<G: Goal>(forest: &Forest, search: &mut Search<'_, G>, walks: Walks<G>) {
    if !G::Precision::is_valid(search.ray) {
        return;
    }
    let mut small = [const { MaybeUninit::uninit() }; SMALL_STACK];
    let mut large = Vec::new();
    let stack = if forest.stack_size <= SMALL_STACK {
        &mut small[..]
    } else {
        large.resize(forest.stack_size, MaybeUninit::uninit());
        &mut large[..]
    };
    // SAFETY: as promised by the caller, and the stack has `stack_size` entries.
    unsafe { (walks.enter)(forest, 0, &G::Precision::exact(search.ray), 0, search, stack) };
}

/// Where a ray walks.
struct Place<'a, G: Goal> {
    forest: &'a Forest,
    tree: &'a GroupTree,
    group: usize,
    ray: &'a DRay,
    instance: u32,
    walks: Walks<G>,
}

impl<G: Goal> Place<'_, G> {
    /// Searches the group. True if the search is over.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`, and the walks must be of the same level;
    /// `stack` must have room for the group and all below it.
    #[inline(always)]
    unsafe fn search<L: Lanes8>(&self, search: &mut Search<'_, G>, stack: &mut Stack) -> bool {
        let Self { forest, group, ray, instance, .. } = *self;
        let mut quick = QuickRay::UNSET;
        let is_quick = forest.ordinary
            && search.start >= 0.0
            && G::Precision::prepare::<L>(search.context.data, group, &mut quick, ray);
        // A ray that has overflowed on its way here hits nothing.
        if !(is_quick || (ray.origin.is_finite() && ray.direction.is_finite())) {
            return false;
        }
        for &object in &self.tree.unbounded {
            // SAFETY: as promised by the caller.
            if unsafe {
                test_object(
                    forest,
                    self.tree,
                    object as usize,
                    ray,
                    instance,
                    search,
                    stack,
                    self.walks.enter,
                )
            } {
                return true;
            }
        }
        // SAFETY: as promised by the caller.
        unsafe {
            if is_quick {
                (self.walks.quick)(forest, group, ray, &quick, instance, search, stack)
            } else {
                (self.walks.careful)(forest, group, ray, instance, search, stack)
            }
        }
    }

    /// The walk of an ordinary ray, nearest children first. True if the search is over.
    ///
    /// # Safety
    /// As [`Self::search`]; the ray must be prepared for `L`.
    #[inline(always)]
    unsafe fn walk<L: Lanes8>(
        &self,
        quick: &QuickRay,
        search: &mut Search<'_, G>,
        stack: &mut Stack,
    ) -> bool {
        // SAFETY: as promised by the caller. (The sum makes zero positive.)
        let (boxes, t_min) = unsafe {
            (
                QuickBoxes::<L>::new(quick, self.forest.extents[self.group]),
                L::splat(search.start + 0.0),
            )
        };
        let mut cull = search.cull();
        let mut beyond = first_beyond(cull);
        let is_ascending = is_ascending(self.ray.direction);
        let (mut top, mut current) = (1, self.tree.root);
        // SAFETY: a walk holds at most 7 entries per level and one at the bottom; the builder's
        // count has room for 8 at the bottom.
        unsafe { stack.get_unchecked_mut(0).write(END) };
        loop {
            if current.is_node() {
                search.goal.count_node();
                // SAFETY: the builder makes only references to nodes that exist; the rest is
                // promised by the caller.
                let (node, enters, met) = unsafe {
                    let node = self.tree.nodes.get_unchecked(current.index());
                    let (enters, limits) = boxes.distances(node, t_min, L::splat(cull));
                    (node, enters, enters.le(limits))
                };
                search.goal.visit(false, || Region::of_bounds(&node.bounds()));
                if !G::NARROWS && met != 0 {
                    // SAFETY: as above.
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
                        // Two, most often. A branch, although it is often wrong: what comes next
                        // need not wait for the distances.
                        let (a, b) = (node.children[first], node.children[second]);
                        // SAFETY: as above.
                        let next = unsafe { stack.get_unchecked_mut(top) };
                        if near[first] < near[second] {
                            // SAFETY: it is valid. (Volatile, or the two branches become one with
                            // conditional moves.)
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
                    // SAFETY: as above.
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
                // SAFETY: the builder makes only references to blocks that exist; the rest is
                // promised by the caller.
                let (block, mut lanes) = unsafe {
                    let block = self.tree.blocks.at().block::<L>(current.block(), &mut room);
                    (
                        block,
                        G::Precision::lines_through::<L>(block, quick)
                            & ((2 << (current.count() - 1)) - 1),
                    )
                };
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
                    let found =
                        G::Precision::hit_on_line(search, quick, origin, direction, &corners, ids);
                    if found.is_some() {
                        if offer_triangle(search, found) {
                            return true;
                        }
                        cull = search.cull();
                        beyond = first_beyond(cull);
                    }
                }
            } else if current.is_object() {
                // SAFETY: the entries below `top` stay as they are.
                let (object, stack) = (current.index(), unsafe { stack.get_unchecked_mut(top..) });
                // SAFETY: as promised by the caller.
                if unsafe {
                    (self.walks.object)(
                        self.forest,
                        self.tree,
                        object,
                        self.ray,
                        self.instance,
                        search,
                        stack,
                    )
                } {
                    return true;
                }
                cull = search.cull();
                beyond = first_beyond(cull);
            } else {
                return false;
            }
            // SAFETY: all entries below `top` are written, and the lowest is never beyond.
            current = unsafe {
                loop {
                    top -= 1;
                    let next = stack.get_unchecked(top).assume_init();
                    // Nothing is beyond what does not come nearer.
                    if !G::NARROWS || next < beyond {
                        break ChildRef(next as u32);
                    }
                }
            };
        }
    }
}

/// True if a direction goes up along the axis that it mostly goes along. Children stand in their
/// node as they lie along the axes, so that those in the last slots are ahead of such a ray.
#[inline(always)]
fn is_ascending(direction: DVec3) -> bool {
    let size = direction.abs();
    let along = if size.x > size.y { direction.x } else { direction.y };
    let along = if size.z > size.x.max(size.y) { direction.z } else { along };
    along > 0.0
}

/// Puts children above `top`, those that are further ahead later, and returns the last. Where any
/// hit will do, the distances tell little: what is near the start of a ray is mostly the surface
/// that it leaves, and to put them in order takes longer than it saves.
///
/// # Safety
/// `stack` must have room for them, and there must be one.
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
        // SAFETY: as promised by the caller.
        unsafe { stack.get_unchecked_mut(*top).write(entry(0.0, child)) };
        *top += 1;
    }
}

/// Puts more children to one that is above `top` and one that is nearer than all, far ones first;
/// returns the new nearest.
///
/// # Safety
/// `stack` must have room for them, and the entry at `top` must be written.
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
        // SAFETY: entries from `top` to before `end` were just written, and there is room for one
        // more.
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

/// Tests a shape or a primitive of a set, or walks the group of an instance.
///
/// # Safety
/// As [`Place::search`].
#[inline(never)]
pub(crate) unsafe fn test_object<G: Goal>(
    forest: &Forest,
    tree: &GroupTree,
    object: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
    enter: Walk<G>,
) -> bool {
    group::test_object(
        &tree.objects,
        object,
        ray,
        instance,
        search,
        |child, ray, instance, search| {
            // SAFETY: as promised by the caller: the stack has room for all below this group.
            unsafe { enter(forest, child, ray, instance, search, stack) }
        },
    )
}

/// # Safety
/// As [`walk_avx2`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn test_object_avx2<G: Goal>(
    forest: &Forest,
    tree: &GroupTree,
    object: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    use snell_math::simd::Avx8;
    // SAFETY: as promised by the caller.
    unsafe {
        test_object_quickly::<Avx8, G>(
            forest,
            tree,
            object,
            ray,
            instance,
            search,
            stack,
            Walks::AVX2,
        )
    }
}

/// # Safety
/// As [`walk_portable`].
unsafe fn test_object_portable<G: Goal>(
    forest: &Forest,
    tree: &GroupTree,
    object: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) -> bool {
    // SAFETY: as promised by the caller.
    unsafe {
        test_object_quickly::<Portable8, G>(
            forest,
            tree,
            object,
            ray,
            instance,
            search,
            stack,
            Walks::PORTABLE,
        )
    }
}

/// [`test_object`] for an ordinary ray in an ordinary forest: most instances stand still, and rays
/// are ordinary there too, so these are entered without a detour.
///
/// # Safety
/// As [`search_root`]; `stack` must have room for all below the group.
#[inline(always)]
unsafe fn test_object_quickly<L: Lanes8, G: Goal>(
    forest: &Forest,
    tree: &GroupTree,
    object: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
    walks: Walks<G>,
) -> bool {
    if let Some(Object::Instance { child, offset, child_from_group: Placement::Still(map), mask }) =
        tree.objects.placed().get(object)
    {
        if mask & search.mask == 0 {
            return false;
        }
        let ray = group::mapped(map, ray);
        let mut quick = QuickRay::UNSET;
        if forest.trees[*child].unbounded.is_empty()
            && G::Precision::prepare::<L>(search.context.data, *child, &mut quick, &ray)
        {
            search.goal.enter(map);
            // SAFETY: as promised by the caller.
            let is_over = unsafe {
                (walks.quick)(forest, *child, &ray, &quick, instance + offset, search, stack)
            };
            search.goal.leave();
            return is_over;
        }
    }
    // SAFETY: as promised by the caller.
    unsafe { test_object(forest, tree, object, ray, instance, search, stack, walks.enter) }
}
