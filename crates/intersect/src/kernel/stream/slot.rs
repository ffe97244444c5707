//! The memory of the rays in flight: a slot with a stack for each, and the handles by which the
//! loop of [`super::interleave`] moves them from step to step.
//!
//! # Why the unsafe code here is sound
//!
//! `SAFETY` comments in this module and in [`steps`] refer to these facts by their names:
//!
//! * **one handle**: [`Slots::walks`] makes one [`Walk`] for each slot, and a `Walk` is moved,
//!   never cloned. ([`Walk::copied_as`] makes a copy of which its caller must drop one.) Therefore
//!   nothing else refers to the slot or its stack while a `Walk` is used.
//! * **search**: the slot of every walk that is not [`Idle`] has a search. [`Walk::start`] sets it,
//!   and only [`Walk::finish`] takes it, which returns an idle walk.
//! * **place**: `place` describes a ray in a group of `forest`, and its addresses are those of the
//!   group's tree ([`Place::see`] sets them together). `current` is a reference of that tree, or
//!   [`ChildRef::NONE`] or [`ChildRef::RETURN`]. References of a tree lead to nodes, blocks and
//!   objects that the tree has. The slot borrows the forest, so the tree outlives it.
//! * **state**: a `Walk<Node>`, `Walk<Leaf>`, `Walk<Object>` or `Walk<Return>` is made only where
//!   `current` was just seen to be of that kind, and its steps consume it.
//! * **stack**: entries below `top` are written. The lowest is [`ChildRef::NONE`], and it is the
//!   last to be popped; so `top` is at least 1 until `current` is `NONE`. A group of depth `d`
//!   leaves at most 7 entries a level and needs at most 8 at the bottom, which is what
//!   [`Forest::stack_size`] adds up along the deepest path through groups; [`Slots::new`] makes
//!   room for that many and 16 more, since steps write eight at a time.

mod steps;
#[cfg(test)]
mod tests;

pub(super) use steps::{Candidates, Enters, Mask};

use crate::exact::TriangleTest;
use crate::exact::prepared::PreparedRay;
use crate::kernel::Goal;
use crate::precision::Facts;
use crate::search::{DataOf, RayOf, Search};
use crate::tree::compact::BlocksAt;
use crate::tree::node::{ChildRef, WideNode};
use crate::tree::{Forest, GroupTree};
use snell_math::simd::{Lanes8, WideLanes};
use snell_math::{DRay, DVec3};
use std::marker::PhantomData;
use std::mem::{MaybeUninit, offset_of};
use std::ptr::NonNull;

/// The position of a ray in the scene: its group, and the ray in the coordinates of the group.
#[derive(Clone, Copy)]
#[repr(C)]
struct Place {
    nodes: *const WideNode,
    /// Places `ray` as on machines with pointers of 64 bits: see [`Walk::rows`].
    #[cfg(target_pointer_width = "32")]
    unused: u32,
    ray: PreparedRay,
    /// The number of the group.
    group: u32,
    /// The number of this occurrence of the group.
    instance: u32,
    /// The stride of [`BlocksAt::parts`]. (Kept apart from `blocks`: together with it, padding
    /// would make the slot a cache line larger.)
    stride: u32,
    blocks: *const u8,
    origin: DVec3,
    direction: DVec3,
}

impl Place {
    const UNSET: Self = Self {
        ray: PreparedRay::UNSET,
        nodes: std::ptr::null(),
        #[cfg(target_pointer_width = "32")]
        unused: 0,
        stride: 0,
        blocks: std::ptr::null(),
        origin: DVec3::ZERO,
        direction: DVec3::ZERO,
        group: 0,
        instance: 0,
    };

    /// Takes the addresses of the nodes and blocks of a tree.
    #[inline(always)]
    fn see(&mut self, tree: &GroupTree) {
        self.nodes = tree.nodes.as_ptr();
        (self.blocks, self.stride) = tree.blocks.at().parts();
    }

    #[inline(always)]
    fn blocks(&self) -> BlocksAt {
        BlocksAt::new(self.blocks, self.stride)
    }

    /// The ray in double precision, without its interval.
    fn exact(&self) -> DRay {
        DRay::new(self.origin, self.direction)
    }
}

/// A ray in flight. The fields that box tests need fill the first cache line. What one step leaves
/// for the next is stored elsewhere, side by side for all rays: with dozens of rays in flight,
/// every cache line of a slot counts.
#[repr(C, align(64))]
struct Slot<'a, G: Goal> {
    t_min: f32,
    /// The padded limit of the search.
    cull: f32,
    /// The reference to visit next.
    current: ChildRef,
    /// The number of entries on the stack.
    top: u32,
    place: Place,
    /// The search for the ray; `None` before the first ray and after the last.
    search: Option<Search<'a, G>>,
    /// The positions of the ray in the groups outside of the current one, outermost first.
    outside: Vec<Place>,
    forest: &'a Forest,
}

impl<'a, G: Goal> Slot<'a, G> {
    /// # Safety
    /// There must be a search.
    #[inline(always)]
    unsafe fn search(&mut self) -> &mut Search<'a, G> {
        // SAFETY: the caller promises a search.
        unsafe { self.search.as_mut().unwrap_unchecked() }
    }

    /// The tree of the group that the ray is in.
    #[inline(always)]
    fn tree(&self) -> &'a GroupTree {
        &self.forest.trees[self.place.group as usize]
    }
}

/// A cache line.
#[repr(align(64))]
struct Line(#[expect(dead_code, reason = "slots and stacks lie in it")] MaybeUninit<[u8; 64]>);

/// The memory of several slots, each followed by its stack.
pub(super) struct Slots<'a, G: Goal> {
    memory: Box<[Line]>,
    /// The number of cache lines of one slot and its stack.
    lines: usize,
    slots: PhantomData<Slot<'a, G>>,
}

impl<'a, G: Goal> Slots<'a, G> {
    /// Makes `count` idle slots for walks through a forest.
    pub fn new(count: usize, forest: &'a Forest) -> Self {
        let stack = (forest.stack_size() + 16) * Slot::<G>::ENTRY * size_of::<u32>();
        // The number is odd, so that slots do not compete for the same sets of the cache.
        let lines = (size_of::<Slot<G>>() + stack).div_ceil(size_of::<Line>()) | 1;
        let memory = (0..count * lines).map(|_| Line(MaybeUninit::uninit())).collect();
        let mut slots = Self { memory, lines, slots: PhantomData };
        for walk in slots.handles() {
            let slot = Slot {
                t_min: 0.0,
                cull: 0.0,
                current: ChildRef::NONE,
                top: 1,
                place: Place::UNSET,
                search: None,
                outside: Vec::new(),
                forest,
            };
            // SAFETY: `lines` cache lines, aligned as a slot is, hold a slot and at least 16
            // entries of a stack. Nothing else refers to them ("one handle").
            unsafe {
                walk.slot.write(slot);
                walk.entry(0).write(ChildRef::NONE.0);
            }
        }
        slots
    }

    /// The number of slots.
    pub fn len(&self) -> usize {
        self.memory.len() / self.lines
    }

    /// The handles of all slots, which are idle.
    pub fn walks(&mut self) -> impl Iterator<Item = Walk<'_, 'a, G, Idle>> {
        self.handles()
    }

    /// One handle for each slot, whether the slot is written yet or not.
    fn handles(&mut self) -> impl Iterator<Item = Walk<'_, 'a, G, Idle>> {
        let slots = self.memory.chunks_exact_mut(self.lines);
        slots.map(|lines| Walk { slot: NonNull::from_mut(lines).cast(), state: PhantomData })
    }
}

impl<G: Goal> Drop for Slots<'_, G> {
    fn drop(&mut self) {
        for walk in self.handles() {
            // SAFETY: `new` wrote all slots, and handles of before borrowed `self`, so they are
            // gone.
            unsafe { walk.slot.drop_in_place() };
        }
    }
}

/// The state of a walk before its ray starts, and after it has ended.
pub(super) enum Idle {}
/// The state of a walk whose `current` may be anything.
pub(super) enum Started {}
/// The state of a walk that visits a node next.
pub(super) enum Node {}
/// The state of a walk that visits a block of triangles next.
pub(super) enum Leaf {}
/// The state of a walk that visits a shape or an instance next.
pub(super) enum Object {}
/// The state of a walk that leaves an instance next.
pub(super) enum Return {}

/// The only handle of a slot, which has a ray in flight; `At` is the state of the walk, such as
/// [`Idle`]. The handle is a pointer, so that queues of walks need neither an address computation
/// nor a bounds check to get to a slot.
#[repr(transparent)]
pub(super) struct Walk<'s, 'a, G: Goal, At = Started> {
    slot: NonNull<Slot<'a, G>>,
    state: PhantomData<(&'s mut Slot<'a, G>, At)>,
}

impl<'s, 'a, G: Goal, At> Walk<'s, 'a, G, At> {
    #[inline(always)]
    fn slot(&self) -> &Slot<'a, G> {
        // SAFETY: `Slots::new` wrote the slot, and the walk borrows its memory for `'s`; "one
        // handle".
        unsafe { self.slot.as_ref() }
    }

    #[inline(always)]
    fn slot_mut(&mut self) -> &mut Slot<'a, G> {
        // SAFETY: `Slots::new` wrote the slot, and the walk borrows its memory for `'s`; "one
        // handle".
        unsafe { self.slot.as_mut() }
    }

    /// The address of an entry of the stack, which follows the slot.
    #[inline(always)]
    fn entry(&self, i: usize) -> *mut u32 {
        let stack = self.slot.as_ptr().wrapping_add(1).cast::<u32>();
        stack.wrapping_add(Slot::<G>::ENTRY * i)
    }

    /// The same walk in another state.
    ///
    /// # Safety
    /// The walk must be in that state, by the facts in the [documentation of the module](self).
    #[inline(always)]
    unsafe fn into_state<To>(self) -> Walk<'s, 'a, G, To> {
        Walk { slot: self.slot, state: PhantomData }
    }

    /// A second handle of the slot, in another state: for loops that write a walk to several queues
    /// and count it in one of them, without a branch.
    ///
    /// # Safety
    /// At most one of the two may be used; the copy only if the walk is in that state.
    #[inline(always)]
    pub unsafe fn copied_as<To>(&self) -> Walk<'s, 'a, G, To> {
        Walk { slot: self.slot, state: PhantomData }
    }

    /// Moves to the entry on top of the stack.
    ///
    /// # Safety
    /// `top` must not be 0.
    #[inline(always)]
    unsafe fn pop(mut self) -> Walk<'s, 'a, G> {
        let slot = self.slot_mut();
        slot.top -= 1;
        let top = slot.top as usize;
        // SAFETY: `top` was at least 1 by the caller's promise, so this entry is written ("stack").
        // A walk that has popped an entry may be at anything.
        unsafe {
            let current = ChildRef(self.entry(top).read());
            self.slot_mut().current = current;
            self.into_state()
        }
    }

    /// Takes the new limit after hits, and removes the entries beyond it from the stack.
    ///
    /// # Safety
    /// There must be a search, and `current` must have been popped last.
    #[inline(always)]
    unsafe fn tightened(mut self) -> Walk<'s, 'a, G> {
        if G::NARROWS {
            let slot = self.slot_mut();
            // SAFETY: there is a search by the caller's promise.
            let cull = unsafe { slot.search() }.cull();
            if cull < slot.cull {
                slot.cull = cull;
                let (mut kept, top) = (1, slot.top as usize);
                for i in 1..=top {
                    // SAFETY: entries below `top` are written, and that at `top` still is, since
                    // nothing was pushed since it was popped. `kept` is at most `i`.
                    unsafe {
                        let entry = self.entry(i).cast::<[u32; 2]>().read();
                        self.entry(kept).cast::<[u32; 2]>().write(entry);
                        kept += usize::from(f32::from_bits(entry[1]) <= cull);
                    }
                }
                self.slot_mut().top = kept as u32;
                // SAFETY: `kept` is at least 1.
                return unsafe { self.pop() };
            }
        }
        // SAFETY: the walk has a search, so it has started.
        unsafe { self.into_state() }
    }
}

impl<G: Goal> Slot<'_, G> {
    /// The count of 32-bit numbers of an entry of the stack: its reference, and the bits of the
    /// distance of its box if the goal narrows.
    const ENTRY: usize = if G::NARROWS { 2 } else { 1 };
}

impl<'s, 'a, G: Goal> Walk<'s, 'a, G, Idle> {
    /// Starts the walk of a ray at the root of the forest, or at [`GroupTree::rest`] of the root's
    /// tree. Returns the walk unchanged if the ray is not [ordinary](PreparedRay).
    #[inline(always)]
    pub fn start<L: Lanes8>(
        mut self,
        starts_at_rest: bool,
        number: usize,
        data: &DataOf<G>,
        search: impl FnOnce() -> Search<'a, G>,
        ray: &RayOf<G>,
    ) -> Result<Walk<'s, 'a, G>, Self> {
        let slot = self.slot_mut();
        let place = &mut slot.place;
        if !G::Precision::prepare_root::<L>(data, &mut place.ray, ray) {
            return Err(self);
        }
        let tree = &*slot.forest.trees[0];
        place.see(tree);
        let exact = G::Precision::exact(ray);
        (place.origin, place.direction) = (exact.origin, exact.direction);
        (place.group, place.instance) = (0, 0);
        // A search that ended inside an instance has left its positions here.
        slot.outside.clear();
        let search = slot.search.insert(search());
        (slot.t_min, slot.cull) = (search.start, search.cull());
        let from = if starts_at_rest { tree.rest } else { tree.root };
        // Batches of this kernel have at most `u32::MAX` rays.
        search.ray_number = number as u32;
        (slot.current, slot.top) = (from, 1);
        // SAFETY: there is a search now, and place, `current` and stack are those of the root.
        Ok(unsafe { self.into_state() })
    }
}

impl<'s, 'a, G: Goal> Walk<'s, 'a, G> {
    /// The reference to visit next; [`ChildRef::NONE`] at the end of the walk.
    #[inline(always)]
    pub fn current(&self) -> ChildRef {
        self.slot().current
    }

    /// The tree of the group that the ray is in.
    #[inline(always)]
    pub fn tree(&self) -> &'a GroupTree {
        self.slot().tree()
    }

    /// The first sixteen numbers of the slot: where the search begins, its padded limit, four
    /// unused ones, then `inverse`, `near` and `far` of the [ray](PreparedRay), and one unused
    /// number.
    #[inline(always)]
    pub fn rows(&self) -> [&[f32; 8]; 2] {
        const {
            assert!(offset_of!(Slot<'static, G>, place) == 16);
            assert!(offset_of!(Place, ray) == 8);
            assert!(offset_of!(PreparedRay, near) == 12 && offset_of!(PreparedRay, far) == 24);
        }
        let first: *const Slot<'a, G> = self.slot();
        // SAFETY: by the offsets above, the first 64 bytes of a slot are numbers and a pointer,
        // without padding, and any bits are an `f32`.
        unsafe { [&*first.cast(), &*first.cast::<[f32; 8]>().add(1)] }
    }

    /// Replaces the root by some of `children`: those in the tags ([`WideLanes::look_up`]) of the
    /// `entries` that are not negative, which must come first. The walk goes on at the last of
    /// them; `distances` are lower bounds of the distances of their boxes.
    ///
    /// # Safety
    /// The walk must have started and made no step. The children in tags must be references of the
    /// same tree, from below its root, and none an ancestor of another.
    #[inline(always)]
    pub unsafe fn go_on_with<L: WideLanes>(
        &mut self,
        entries: L,
        distances: L,
        children: &[u32; 32],
    ) {
        let first = self.entry(1);
        // SAFETY: the stack has room for eight entries above the lowest, and the walk then holds
        // no more than the root would have left: at most eight, of which one is popped. They are
        // references of the tree by the caller's promise.
        unsafe {
            if G::NARROWS {
                let mut own = [0; 8];
                entries.look_up(children, &mut own);
                distances.store_after(&own, &mut *first.cast());
            } else {
                entries.look_up(children, &mut *first.cast());
            }
            self.slot_mut().top = 1 + (!entries.signs() & 0xff).count_ones();
            *self = self.copied_as::<Started>().pop();
        }
    }
}
