//! The steps of a walk, by the kind of its current reference.

use super::{Idle, Leaf, Line, Node, Object, Place, Return, Slot, Walk};
use crate::exact::TriangleTest;
use crate::group::{self, ObjectRef, offer_triangle};
use crate::kernel::Goal;
use crate::kernel::single::boxes::prepared_distances;
use crate::kernel::single::filter::BlockFilter;
use crate::kernel::single::traverse::{Stack, test_object};
use crate::prefetch::fetch_lines;
use crate::tree::block::TriangleBlock;
use crate::tree::node::{ChildRef, WideNode};
use snell_math::simd::Lanes8;
use std::mem::MaybeUninit;

/// The distances at which a ray enters the eight boxes of a node; aligned, so that they are in one
/// cache line.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub(in super::super) struct Enters([f32; 8]);

impl Enters {
    pub const UNSET: Self = Self([0.0; 8]);
}

/// Which of the eight boxes of a node, or of the eight triangles of a block, a ray may hit: one bit
/// each, and no others.
#[derive(Clone, Copy)]
pub(in super::super) struct Mask(u32);

impl Mask {
    pub const NONE: Self = Self(0);
}

impl<'s, 'a, G: Goal> Walk<'s, 'a, G, Node> {
    /// Tests the boxes of the node. Returns those that are hit, in the order in which to visit
    /// them, and writes their distances to `enters` if the goal narrows. (The visit is in two steps
    /// with those of the other slots between them, which hides latency.)
    #[inline(always)]
    pub fn test_boxes<L: Lanes8>(&mut self, token: L::Token, enters: &mut Enters) -> Mask {
        let slot = self.slot_mut();
        // SAFETY: "search"; by "state" and "place", `current` is a node of the place's tree.
        let node = unsafe {
            slot.search().goal.count_node();
            &*slot.place.nodes.add(slot.current.node_index())
        };
        let (enter, limit) =
            prepared_distances::<L>(token, node, &slot.place.ray, slot.t_min, slot.cull);
        if G::NARROWS {
            enter.store(&mut enters.0);
        }
        Mask(enter.le_in_order(limit, node.order[slot.place.ray.octant()]))
    }

    /// Goes on to the nearest box that [`Self::test_boxes`] has found to be hit, and pushes the
    /// others.
    #[inline(always)]
    pub fn push_boxes<L: Lanes8>(
        mut self,
        token: L::Token,
        hit: Mask,
        enters: &Enters,
    ) -> Walk<'s, 'a, G> {
        let (Place { nodes, ray, .. }, top) = (&self.slot().place, self.slot().top as usize);
        let to = self.entry(top);
        // SAFETY: by "state" and "place", `current` is a node of the place's tree. References are
        // plain `u32`. The mask has at most eight bits, so at most eight entries are pushed, for
        // which there is room, and `top` was at least 1 ("stack").
        unsafe {
            let node = &*nodes.add(self.slot().current.node_index());
            let payload = &*node.children.as_ptr().cast::<[u32; 8]>();
            let order = node.order[ray.octant()];
            if G::NARROWS {
                L::load(token, &enters.0).compress(hit.0, order, payload, &mut *to.cast());
            } else {
                L::compress_payload(token, hit.0, order, payload, &mut *to.cast());
            }
            self.slot_mut().top += hit.0.count_ones();
            self.pop()
        }
    }
}

impl<'s, 'a, G: Goal> Walk<'s, 'a, G, Leaf> {
    /// Returns the triangles of the block that the ray's line may hit.
    #[inline(always)]
    pub fn test_lines<L: Lanes8>(&mut self, token: L::Token) -> Mask {
        let slot = self.slot_mut();
        let (mut room, count) = (MaybeUninit::uninit(), slot.current.count());
        // SAFETY: "search"; by "state" and "place", `current` is a block of the place's tree, which
        // outlives this function.
        let block = unsafe {
            slot.search().goal.count_primitives(count);
            slot.place.blocks().block::<L>(token, slot.current.block(), &mut room)
        };
        let hit = G::Precision::lines_through::<L>(token, block, &slot.place.ray);
        Mask(hit & ((2 << (count - 1)) - 1))
    }

    /// Moves to the next entry, with the triangles of the block that are still to be tested: those
    /// that [`Self::test_lines`] has returned.
    #[inline(always)]
    pub fn leave(self, triangles: Mask) -> Candidates<'s, 'a, G> {
        let block = self.slot().current.block() as u32;
        // SAFETY: `current` is a leaf, not `NONE`, so `top` is at least 1 ("stack").
        Candidates { walk: unsafe { self.pop() }, triangles, block }
    }
}

/// A walk that has left a leaf, and the triangles of the leaf that are still to be tested.
pub(in super::super) struct Candidates<'s, 'a, G: Goal> {
    pub walk: Walk<'s, 'a, G>,
    triangles: Mask,
    /// The number of the block in the tree that the walk is in: [`Walk::leave`] has taken it from
    /// `current`, and to pop an entry does not change the tree.
    block: u32,
}

impl<'s, 'a, G: Goal> Candidates<'s, 'a, G> {
    /// True if no triangle is to be tested.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.triangles.0 == 0
    }

    /// Prefetches what the walk visits next, and the triangles if they are not in the block.
    #[inline(always)]
    pub fn fetch(&mut self) {
        self.walk.fetch_ahead();
        if <G::Precision as TriangleTest>::TRIANGLES_ELSEWHERE {
            let (slot, block) = (self.walk.slot_mut(), self.block as usize);
            for lane in lanes(self.triangles) {
                // SAFETY: `block` is a block of the place's tree (see its doc); "search".
                unsafe {
                    let (geometry, triangle) =
                        slot.tree().triangle(slot.place.blocks().id(block, lane));
                    G::Precision::fetch_triangle(slot.search().context.data, geometry, triangle);
                }
            }
        }
    }

    /// Tests the triangles exactly.
    #[inline(always)]
    pub fn test(mut self) -> Walk<'s, 'a, G> {
        let (slot, block) = (self.walk.slot_mut(), self.block as usize);
        for lane in lanes(self.triangles) {
            let Place { ray, origin, direction, group, instance, .. } = &slot.place;
            let (blocks, forest) = (slot.place.blocks(), slot.forest);
            // SAFETY: `block` is a block of the place's tree (see its doc); "search".
            let is_over = unsafe {
                let ids = || {
                    let tree = &forest.trees[*group as usize];
                    let (geometry, primitive) = tree.triangle(blocks.id(block, lane));
                    [*instance, geometry, primitive]
                };
                let search = slot.search.as_ref().unwrap_unchecked();
                let corners = blocks.corners(block, lane);
                let found =
                    G::Precision::hit_on_line(search, ray, origin, direction, &corners, ids);
                offer_triangle(slot.search(), found)
            };
            if is_over {
                slot.current = ChildRef::NONE;
                return self.walk;
            }
        }
        // SAFETY: "search"; `Walk::leave` has popped `current`, and nothing was pushed since.
        unsafe { self.walk.tightened() }
    }
}

/// The numbers of the bits of a mask, ascending.
#[inline(always)]
fn lanes(mask: Mask) -> impl Iterator<Item = usize> {
    let mut rest = mask.0;
    std::iter::from_fn(
        #[inline(always)]
        move || {
            let lane = rest.trailing_zeros() as usize & 7;
            let is_any = rest != 0;
            rest &= rest.wrapping_sub(1);
            is_any.then_some(lane)
        },
    )
}

impl<'s, 'a, G: Goal> Walk<'s, 'a, G, Object> {
    /// Prefetches the object.
    #[inline(always)]
    pub fn fetch(&self) {
        self.slot().tree().objects.fetch(self.slot().current.index());
    }

    /// Enters the object if it is an instance that can be walked in this slot; otherwise tests it
    /// and moves to the next entry.
    #[inline(always)]
    pub fn visit<L: Lanes8>(mut self, token: L::Token, below: &mut Stack) -> Walk<'s, 'a, G> {
        let slot = self.slot_mut();
        let (object, tree) = (slot.current.index(), slot.tree());
        if let Some(root) = slot.enter_instance::<L>(tree.objects.get(object)) {
            let top = slot.top as usize;
            (slot.top, slot.current) = (top as u32 + 1, root);
            let entry = self.entry(top);
            // SAFETY: the group outside has room for eight entries at its bottom, of which this is
            // one, beside those of the group inside ("stack").
            return unsafe {
                entry.write(ChildRef::RETURN.0);
                if G::NARROWS {
                    // This distance is nearer than any limit.
                    entry.add(1).write(f32::NEG_INFINITY.to_bits());
                }
                self.into_state()
            };
        }
        // SAFETY: `current` is an object, not `NONE`, so `top` is at least 1 ("stack").
        let mut walk = unsafe { self.pop() };
        let slot = walk.slot_mut();
        let (forest, exact, instance) = (slot.forest, slot.place.exact(), slot.place.instance);
        // SAFETY: "search".
        let search = unsafe { slot.search() };
        if test_object::<L, G>(token, forest, tree, object, &exact, instance, search, below) {
            slot.current = ChildRef::NONE;
            return walk;
        }
        // SAFETY: "search"; `current` was popped above.
        unsafe { walk.tightened() }
    }
}

impl<G: Goal> Slot<'_, G> {
    /// Moves the place into an instance, if the object is one that can be walked in this slot, and
    /// returns the root of its tree.
    #[inline(always)]
    fn enter_instance<L: Lanes8>(&mut self, object: ObjectRef) -> Option<ChildRef> {
        let ObjectRef::Placed(group::Object::Instance { child, offset, child_from_group, mask }) =
            object
        else {
            return None;
        };
        let tree = &*self.forest.trees[*child];
        let search = self.search.as_ref()?;
        let (visible, time, data) = (search.mask, search.time, search.context.data);
        if mask & visible == 0 || tree.root == ChildRef::NONE || !tree.unbounded.is_empty() {
            return None;
        }
        // A ray that overflows is not ordinary.
        let ray = child_from_group.mapped(&self.place.exact(), time)?;
        self.outside.push(self.place);
        let place = &mut self.place;
        if !G::Precision::prepare::<L>(data, *child, &mut place.ray, &ray) {
            self.return_outside();
            return None;
        }
        place.see(tree);
        (place.origin, place.direction) = (ray.origin, ray.direction);
        (place.group, place.instance) = (*child as u32, place.instance + offset);
        if let Some(search) = &mut self.search {
            search.goal.count_instance();
        }
        Some(tree.root)
    }

    /// Moves the place out of the instance that was entered last.
    #[inline(always)]
    fn return_outside(&mut self) {
        if let Some(place) = self.outside.pop() {
            self.place = place;
        }
    }
}

impl<'s, 'a, G: Goal> Walk<'s, 'a, G, Return> {
    /// Returns from an instance to its parent, and moves to the next entry.
    #[inline(always)]
    pub fn leave_instance(mut self) -> Walk<'s, 'a, G> {
        self.slot_mut().return_outside();
        // SAFETY: `current` is `RETURN`, not `NONE`, so `top` is at least 1. Entries below that one
        // are of the parent, where the place is again ("stack", "place").
        unsafe { self.pop() }
    }
}

impl<'s, 'a, G: Goal> Walk<'s, 'a, G> {
    /// Passes the number of the ray and its goal to `put`, and ends the walk.
    #[inline(always)]
    pub fn finish(mut self, put: impl FnOnce(usize, G)) -> Walk<'s, 'a, G, Idle> {
        let slot = self.slot_mut();
        if let Some(search) = slot.search.take() {
            put(search.ray_number as usize, search.goal);
        }
        // SAFETY: an idle walk needs no search.
        unsafe { self.into_state() }
    }

    /// Prefetches what `current` refers to if that is a leaf. (Without a branch.)
    #[inline(always)]
    pub fn fetch_leaf(&self) {
        let slot = self.slot();
        let block = slot.place.blocks().address(slot.current.block());
        let own = self.slot.as_ptr().cast::<u8>().cast_const();
        fetch_lines(std::hint::select_unpredictable(slot.current.is_triangles(), block, own), 5);
    }

    /// Prefetches what `current` refers to. (Without a branch: whether it is a node or a leaf
    /// cannot be predicted.)
    #[inline(always)]
    pub fn fetch_ahead(&self) {
        let slot = self.slot();
        let node = slot.place.nodes.wrapping_add(slot.current.index()).cast::<u8>();
        let block = slot.place.blocks().address(slot.current.block());
        let is_node = slot.current.is_node();
        let at = std::hint::select_unpredictable(is_node, node, block);
        const {
            assert!(
                size_of::<WideNode>() == 4 * size_of::<Line>()
                    && size_of::<TriangleBlock>() == 5 * size_of::<Line>()
            )
        };
        fetch_lines(at, 4);
        // For a node, the last line is fetched again instead of a fifth.
        fetch_lines(at.wrapping_add((4 - usize::from(is_node)) * size_of::<Line>()), 1);
    }
}
