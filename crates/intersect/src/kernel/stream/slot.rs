//! One walk of the interleaved kernel: a ray in flight, with the memory of its way.

use crate::exact::TriangleTest;
use crate::exact::prepared::PreparedRay;
use crate::group::{Object, ObjectRef, offer_triangle};
use crate::kernel::Goal;
use crate::kernel::single::boxes::prepared_distances;
use crate::kernel::single::filter::BlockFilter;
use crate::kernel::single::traverse::{Stack, test_object};
use crate::precision::Facts;
use crate::prefetch::fetch_lines;
use crate::search::{DataOf, RayOf, Search};
use crate::tree::block::TriangleBlock;
use crate::tree::compact::BlocksAt;
use crate::tree::node::ChildRef;
use crate::tree::node::WideNode;
use crate::tree::{Forest, GroupTree};
use snell_math::simd::{Lanes8, WideLanes};
use snell_math::{DRay, DVec3};
use std::marker::PhantomData;
use std::mem::{MaybeUninit, offset_of};
use std::ops::{Deref, DerefMut};

/// Where a ray is: in which group, with which coordinates.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct Place {
    nodes: *const WideNode,
    ray: PreparedRay,
    /// The group, and the occurrence number of it.
    group: u32,
    instance: u32,
    /// As [`BlocksAt::parts`] gives it. (Together they would take a line more.)
    stride: u32,
    blocks: *const u8,
    origin: DVec3,
    direction: DVec3,
}

impl Place {
    const UNSET: Self = Self {
        ray: PreparedRay::UNSET,
        nodes: std::ptr::null(),
        stride: 0,
        blocks: std::ptr::null(),
        origin: DVec3::ZERO,
        direction: DVec3::ZERO,
        group: 0,
        instance: 0,
    };

    #[cfg(test)]
    pub fn ray(&self) -> &PreparedRay {
        &self.ray
    }

    #[inline(always)]
    pub fn nodes(&self) -> *const WideNode {
        self.nodes
    }

    #[inline(always)]
    fn see(&mut self, tree: &GroupTree) {
        self.nodes = tree.nodes.as_ptr();
        (self.blocks, self.stride) = tree.blocks.at().parts();
    }

    #[inline(always)]
    fn blocks(&self) -> BlocksAt {
        BlocksAt::new(self.blocks, self.stride)
    }

    /// The ray here; without an interval.
    fn exact(&self) -> DRay {
        DRay::new(self.origin, self.direction)
    }
}

/// Where boxes begin; aligned, so that it is in one line of the cache.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub(super) struct Enters(pub [f32; 8]);

/// A ray in flight. (What boxes need is in the first line of the cache. What one step leaves for
/// the next is elsewhere, side by side for all rays: with dozens of them in flight, each line
/// counts.)
#[repr(C, align(64))]
pub(super) struct Slot<'a, G: Goal> {
    t_min: f32,
    /// Padded limit of the search.
    cull: f32,
    /// What to visit next.
    pub current: ChildRef,
    /// Entries on the stack; the lowest one ends the walk.
    top: u32,
    /// Where it is.
    pub place: Place,
    /// `None` before the first ray and after the last.
    pub search: Option<Search<'a, G>>,
    /// Which ray this is.
    pub number: usize,
    /// The places to return to.
    outside: Vec<Place>,
}

/// Bytes that are in the cache together.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Line(#[expect(dead_code, reason = "slots lie in it")] MaybeUninit<[u8; 64]>);

/// Which of the slots: the number of its first line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct SlotNumber(u32);

/// Slots, each with its stack behind it.
pub(super) struct Slots<'a, G: Goal> {
    memory: Box<[Line]>,
    /// PacketRays of each.
    lines: usize,
    slots: PhantomData<Slot<'a, G>>,
}

impl<'a, G: Goal> Slots<'a, G> {
    /// Idle slots, for walks of so many entries at most.
    pub fn new(count: usize, entries: usize) -> Self {
        // (Eight are written at a time.)
        let stack = (entries + 16) * Slot::<G>::ENTRY * size_of::<u32>();
        // An odd number: so they do not compete for the same places in the cache.
        let lines = (size_of::<Slot<G>>() + stack).div_ceil(size_of::<Line>()) | 1;
        let memory = vec![Line(MaybeUninit::uninit()); count * lines].into();
        let mut slots = Self { memory, lines, slots: PhantomData };
        for number in slots.numbers() {
            let slot = Slot {
                t_min: 0.0,
                cull: 0.0,
                current: ChildRef::NONE,
                top: 1,
                place: Place::UNSET,
                search: None,
                number: 0,
                outside: Vec::new(),
            };
            let first = slots.start_of(number);
            // SAFETY: the memory is there, aligned, and of as many lines as a slot and its stack.
            unsafe {
                slots.memory.as_mut_ptr().add(first).cast::<Slot<G>>().write(slot);
                slots.at(number).entry(0).write(ChildRef::NONE.0);
            }
        }
        slots
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.memory.len() / self.lines
    }

    /// The numbers of all.
    pub fn numbers(&self) -> impl Iterator<Item = SlotNumber> + use<G> {
        let lines = self.lines as u32;
        (0..self.len() as u32).map(move |i| SlotNumber(i * lines))
    }

    /// Where one of them is.
    #[inline(always)]
    fn start_of(&self, number: SlotNumber) -> usize {
        let first = number.0 as usize;
        assert!(first + self.lines <= self.memory.len(), "there is no such slot");
        first
    }

    /// One of them.
    #[inline(always)]
    pub fn at(&mut self, number: SlotNumber) -> InFlight<'_, 'a, G> {
        let first = self.start_of(number);
        let bytes = self.lines * size_of::<Line>() - size_of::<Slot<G>>();
        // SAFETY: `new` has written a slot at the beginning of as many lines, and the rest of them
        // is the memory of its stack, which may hold anything.
        unsafe {
            let start = self.memory.as_mut_ptr().add(first).cast::<Slot<'a, G>>();
            let stack = start.add(1).cast::<MaybeUninit<u32>>();
            InFlight {
                slot: &mut *start,
                stack: std::slice::from_raw_parts_mut(stack, bytes / size_of::<u32>()),
            }
        }
    }

    /// One of them, without its stack.
    #[inline(always)]
    pub fn get(&self, number: SlotNumber) -> &Slot<'a, G> {
        let first = self.start_of(number);
        // SAFETY: `new` has written a slot there.
        unsafe { &*self.memory.as_ptr().add(first).cast() }
    }
}

impl<G: Goal> Drop for Slots<'_, G> {
    fn drop(&mut self) {
        for number in self.numbers() {
            let slot: *mut _ = self.at(number).slot;
            // SAFETY: they were made in `new`, and nothing is done with them any more.
            unsafe { slot.drop_in_place() };
        }
    }
}

/// A slot and the stack behind it.
pub(super) struct InFlight<'s, 'a, G: Goal> {
    slot: &'s mut Slot<'a, G>,
    stack: &'s mut [MaybeUninit<u32>],
}

impl<'a, G: Goal> Deref for InFlight<'_, 'a, G> {
    type Target = Slot<'a, G>;

    #[inline(always)]
    fn deref(&self) -> &Slot<'a, G> {
        self.slot
    }
}

impl<G: Goal> DerefMut for InFlight<'_, '_, G> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Self::Target {
        self.slot
    }
}

impl<'a, G: Goal> Slot<'a, G> {
    /// Numbers of an entry of the stack: what it leads to, and the bits of where its box begins, if
    /// the goal narrows.
    const ENTRY: usize = if G::NARROWS { 2 } else { 1 };

    /// Begins the walk of a ray through the root's tree, or from there on. False, and nothing done,
    /// if the ray is not ordinary.
    #[inline(always)]
    pub fn start<L: Lanes8>(
        &mut self,
        tree: &GroupTree,
        from: ChildRef,
        number: usize,
        data: &DataOf<G>,
        search: impl FnOnce() -> Search<'a, G>,
        ray: &RayOf<G>,
    ) -> bool {
        let place = &mut self.place;
        if !G::Precision::prepare_root::<L>(data, &mut place.ray, ray) {
            return false;
        }
        place.see(tree);
        let exact = G::Precision::exact(ray);
        (place.origin, place.direction) = (exact.origin, exact.direction);
        (place.group, place.instance) = (0, 0);
        // (A search that was over in an instance has not returned.)
        self.outside.clear();
        let search = self.search.insert(search());
        (self.t_min, self.cull) = (search.start, search.cull());
        (self.current, self.top, self.number) = (from, 1, number);
        true
    }

    /// # Safety
    /// There must be a search.
    #[inline(always)]
    pub unsafe fn search(&mut self) -> &mut Search<'a, G> {
        // SAFETY: the caller promises that there is one.
        unsafe { self.search.as_mut().unwrap_unchecked() }
    }

    /// Where the search begins, and its padded limit.
    #[cfg(test)]
    pub fn interval(&self) -> [f32; 2] {
        [self.t_min, self.cull]
    }

    /// Its first sixteen numbers: where the search begins, its padded limit, four that mean
    /// nothing, then `inverse`, `near` and `far` of the ray, and one that means nothing.
    #[inline(always)]
    pub fn rows(&self) -> [&[f32; 8]; 2] {
        const {
            assert!(offset_of!(Slot<'static, G>, place) == 16);
            assert!(offset_of!(Place, ray) == 8);
            assert!(offset_of!(PreparedRay, near) == 12 && offset_of!(PreparedRay, far) == 24);
        }
        let first: *const Self = self;
        // SAFETY: these are the first 64 bytes, all of plain numbers and a pointer, and any bits
        // are an `f32`.
        unsafe { [&*first.cast(), &*first.cast::<[f32; 8]>().add(1)] }
    }

    /// Tests the boxes of the current node: tells which children are met, in order, and writes
    /// where, if the goal narrows. (The step is in two parts with the other slots between them:
    /// each waits less.)
    ///
    /// # Safety
    /// There must be a search; the current reference must be a node of the group.
    #[inline(always)]
    pub unsafe fn boxes_step<L: Lanes8>(&mut self, token: L::Token, enters: &mut Enters) -> u32 {
        // SAFETY: the search and the node are there by the caller's promise.
        unsafe {
            self.search().goal.count_node();
            let node = &*self.place.nodes.add(self.current.node_index());
            let (enter, limit) =
                prepared_distances::<L>(token, node, &self.place.ray, self.t_min, self.cull);
            if G::NARROWS {
                enter.store(&mut enters.0);
            }
            enter.le_in_order(limit, node.order[self.place.ray.octant()])
        }
    }

    /// Tells which triangles of the current leaf the ray's line may pass through.
    ///
    /// # Safety
    /// There must be a search; the current reference must be a block of the group.
    #[inline(always)]
    pub unsafe fn leaf_step<L: Lanes8>(&mut self, token: L::Token) -> u32 {
        // SAFETY: the search and the block are there by the caller's promise.
        unsafe {
            let (mut room, count) = (MaybeUninit::uninit(), self.current.count());
            let block = self.place.blocks().block::<L>(token, self.current.block(), &mut room);
            self.search().goal.count_primitives(count);
            G::Precision::lines_through::<L>(token, block, &self.place.ray)
                & ((2 << (count - 1)) - 1)
        }
    }

    /// Asks for the memory of the current object.
    ///
    /// # Safety
    /// The current reference must be an object of the group.
    #[inline(always)]
    pub unsafe fn fetch_object(&self, forest: &Forest) {
        // SAFETY: there is the group, since the caller promises that something of it is current.
        let tree = unsafe { forest.trees.get_unchecked(self.place.group as usize) };
        tree.objects.fetch(self.current.index());
    }

    /// Goes into an instance, if the object is one that can be walked in this slot.
    ///
    /// # Safety
    /// There must be a search; the stack must have room for one more entry.
    #[inline(always)]
    unsafe fn enter_instance<L: Lanes8>(
        &mut self,
        forest: &Forest,
        object: ObjectRef,
    ) -> Option<ChildRef> {
        let ObjectRef::Placed(Object::Instance { child, offset, child_from_group, mask }) = object
        else {
            return None;
        };
        let tree = &forest.trees[*child];
        // SAFETY: the caller promises a search.
        let (visible, time, data) =
            unsafe { (self.search().mask, self.search().time, self.search().context.data) };
        if mask & visible == 0 || tree.root == ChildRef::NONE || !tree.unbounded.is_empty() {
            return None;
        }
        // (If it overflows, it is not ordinary.)
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
        Some(tree.root)
    }

    #[inline(always)]
    fn return_outside(&mut self) {
        if let Some(place) = self.outside.pop() {
            self.place = place;
        }
    }

    /// Asks for the memory of the triangles that [`Self::leaf_step`] has found, if they are not in
    /// the block.
    ///
    /// # Safety
    /// As [`InFlight::triangles_step`].
    #[inline(always)]
    pub unsafe fn fetch_triangles(&mut self, forest: &Forest, mut lanes: u32, block: u32) {
        if <G::Precision as TriangleTest>::TRIANGLES_ELSEWHERE {
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 7;
                lanes &= lanes - 1;
                // SAFETY: the block, its group and a search are there by the caller's promise.
                unsafe {
                    let tree = forest.trees.get_unchecked(self.place.group as usize);
                    let (geometry, triangle) =
                        tree.triangle(self.place.blocks().id(block as usize, lane));
                    G::Precision::fetch_triangle(self.search().context.data, geometry, triangle);
                }
            }
        }
    }

    /// Asks for the memory of what is current if it is a leaf. (Without a branch, too.)
    #[inline(always)]
    pub fn fetch_leaf(&self) {
        let block = self.place.blocks().address(self.current.block());
        let this = (&raw const *self).cast::<u8>();
        fetch_lines(std::hint::select_unpredictable(self.current.is_triangles(), block, this), 5);
    }

    /// Asks for the memory of what is current. (Without a branch: whether it is a node or a leaf is
    /// as good as random.)
    #[inline(always)]
    pub fn fetch_ahead(&self) {
        let node = self.place.nodes.wrapping_add(self.current.index()).cast::<u8>();
        let block = self.place.blocks().address(self.current.block());
        let is_node = self.current.is_node();
        let at = std::hint::select_unpredictable(is_node, node, block);
        const {
            assert!(
                size_of::<WideNode>() == 4 * size_of::<Line>()
                    && size_of::<TriangleBlock>() == 5 * size_of::<Line>()
            )
        };
        fetch_lines(at, 4);
        // (Of a node, the fourth again.)
        fetch_lines(at.wrapping_add((4 - usize::from(is_node)) * size_of::<Line>()), 1);
    }
}

impl<'a, G: Goal> InFlight<'_, 'a, G> {
    /// The first number of an entry of the stack.
    ///
    /// # Safety
    /// The entry must be within the stack.
    #[inline(always)]
    unsafe fn entry(&mut self, i: usize) -> &mut MaybeUninit<u32> {
        // SAFETY: the caller promises that it is within the stack.
        unsafe { self.stack.get_unchecked_mut(Slot::<G>::ENTRY * i) }
    }

    /// The numbers of entries from this one on, to be read when they are written.
    ///
    /// # Safety
    /// The entry must be within the stack.
    #[inline(always)]
    unsafe fn entries_from<T>(&mut self, i: usize) -> *mut T {
        // SAFETY: the caller promises that it is within the stack.
        unsafe { self.stack.as_mut_ptr().add(Slot::<G>::ENTRY * i).cast() }
    }

    /// Goes on to the entry that is on top of the stack.
    ///
    /// # Safety
    /// There must be one: below all others is the one that ends the walk.
    #[inline(always)]
    unsafe fn pop(&mut self) {
        self.slot.top -= 1;
        let top = self.slot.top as usize;
        // SAFETY: entries below the top are within the stack, and written.
        self.slot.current = ChildRef(unsafe { self.entry(top).assume_init() });
    }

    /// What is still to be visited, the next last, and where the boxes begin.
    #[cfg(test)]
    pub fn entries(&mut self) -> Vec<(f32, ChildRef)> {
        let (current, top) = (self.current, self.top as usize);
        if current == ChildRef::NONE {
            return vec![];
        }
        // The current one was popped last, or is the root.
        let at = |i: usize| {
            // SAFETY: entries below the top are written, and what was popped last is still there.
            let [child, distance] = [0, 1].map(|k| unsafe { self.stack[2 * i + k].assume_init() });
            (f32::from_bits(distance), ChildRef(child))
        };
        let mut entries: Vec<_> = (1..top).map(at).collect();
        let is_root = entries.is_empty() && current.is_node();
        entries.push(if is_root { (self.t_min, current) } else { at(top) });
        entries
    }

    /// Goes on, after the start, with some of `children` instead of the root: those that the tags
    /// ([`WideLanes::look_up`]) of entries that are not negative tell, which must come first, the
    /// last of them at once. Their boxes begin at these distances or farther.
    ///
    /// # Safety
    /// The children must be of the same group, and no more than what the root would have left on
    /// the stack.
    #[inline(always)]
    pub unsafe fn go_on_with<L: WideLanes>(
        &mut self,
        entries: L,
        distances: L,
        children: &[u32; 32],
    ) {
        // SAFETY: a stack has room for eight and one; the lowest entry stays.
        unsafe {
            if G::NARROWS {
                let mut own = [0; 8];
                entries.look_up(children, &mut own);
                distances.store_after(&own, &mut *self.entries_from(1));
            } else {
                entries.look_up(children, &mut *self.entries_from(1));
            }
            self.slot.top = 1 + (!entries.signs() & 0xff).count_ones();
            self.pop();
        }
    }

    /// Goes on to the nearest box that was met, and notes the others.
    ///
    /// # Safety
    /// As [`Slot::boxes_step`], which must have given `met` and `enters`; the stack must have room
    /// for eight more entries.
    #[inline(always)]
    pub unsafe fn push_step<L: Lanes8>(&mut self, token: L::Token, met: u32, enters: &Enters) {
        let (Place { nodes, ray, .. }, top) = (&self.slot.place, self.slot.top as usize);
        // SAFETY: the node is there and the stack has room by the caller's promise; references are
        // plain `u32`. The entry that ends the walk is below those that are added.
        unsafe {
            let node = &*nodes.add(self.slot.current.node_index());
            let payload = &*node.children.as_ptr().cast::<[u32; 8]>();
            let order = node.order[ray.octant()];
            if G::NARROWS {
                let to = &mut *self.stack.as_mut_ptr().add(2 * top).cast();
                L::load(token, &enters.0).compress(met, order, payload, to);
            } else {
                let to = &mut *self.stack.as_mut_ptr().add(top).cast();
                L::compress_payload(token, met, order, payload, to);
            }
            self.slot.top += met.count_ones();
            self.pop();
        }
    }

    /// Goes on after a leaf. Returns the number of its block.
    ///
    /// # Safety
    /// The current entry must be a leaf.
    #[inline(always)]
    pub unsafe fn leave_leaf(&mut self) -> u32 {
        let block = self.slot.current.block() as u32;
        // SAFETY: the entry that ends the walk is below that of a leaf.
        unsafe { self.pop() };
        block
    }

    /// Tests triangles exactly that [`Slot::leaf_step`] has found.
    ///
    /// # Safety
    /// There must be a search; `lanes` must be what the last leaf step has found in this block.
    #[inline(always)]
    pub unsafe fn triangles_step(&mut self, forest: &Forest, mut lanes: u32, block: u32) {
        let (blocks, block) = (self.slot.place.blocks(), block as usize);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 7;
            lanes &= lanes - 1;
            // SAFETY: the block and the search are there by the caller's promise, and so is the
            // group that it is in.
            unsafe {
                let Place { ray, origin, direction, group, instance, .. } = &self.slot.place;
                let ids = || {
                    let tree = forest.trees.get_unchecked(*group as usize);
                    let (geometry, primitive) = tree.triangle(blocks.id(block, lane));
                    [*instance, geometry, primitive]
                };
                let search = self.slot.search.as_ref().unwrap_unchecked();
                let corners = blocks.corners(block, lane);
                let found =
                    G::Precision::hit_on_line(search, ray, origin, direction, &corners, ids);
                if offer_triangle(self.slot.search(), found) {
                    self.slot.current = ChildRef::NONE;
                    return;
                }
            }
        }
        // SAFETY: there is a search.
        unsafe { self.tighten() };
    }

    /// After hits: a new limit, and the stack without what lies beyond it. The current entry must
    /// have been popped last.
    ///
    /// # Safety
    /// There must be a search.
    #[inline(always)]
    unsafe fn tighten(&mut self) {
        if !G::NARROWS {
            return;
        }
        // SAFETY: the caller promises a search; all entries up to the one popped last are written, and
        // the lowest stays.
        unsafe {
            let cull = self.slot.search().cull();
            if cull < self.slot.cull {
                self.slot.cull = cull;
                let mut kept = 1;
                for i in 1..=self.slot.top as usize {
                    let entry = self.entries_from::<[u32; 2]>(i).read();
                    self.entries_from::<[u32; 2]>(kept).write(entry);
                    kept += usize::from(f32::from_bits(entry[1]) <= cull);
                }
                self.slot.top = kept as u32;
                self.pop();
            }
        }
    }

    /// Tests the shape that is the current object and goes on to the next entry, or goes into an
    /// instance.
    ///
    /// # Safety
    /// There must be a search; the current reference must be an object of the group; the stack must
    /// have room for one more entry.
    #[inline(always)]
    pub unsafe fn object_step<L: Lanes8>(
        &mut self,
        token: L::Token,
        forest: &Forest,
        below: &mut Stack,
    ) {
        // SAFETY: the search, the group and the room on the stack are there by the caller's
        // promise; the entry that ends the walk is below that of an object.
        unsafe {
            let object = self.slot.current.index();
            let tree = forest.trees.get_unchecked(self.slot.place.group as usize);
            if let Some(root) = self.slot.enter_instance::<L>(forest, tree.objects.get(object)) {
                let top = self.slot.top as usize;
                if G::NARROWS {
                    // Nearer than any limit.
                    let entry = [ChildRef::RETURN.0, f32::NEG_INFINITY.to_bits()];
                    self.entries_from::<[u32; 2]>(top).write(entry);
                } else {
                    self.entry(top).write(ChildRef::RETURN.0);
                }
                self.slot.top += 1;
                self.slot.current = root;
                return;
            }
            self.pop();
            let (exact, instance) = (self.slot.place.exact(), self.slot.place.instance);
            let search = self.slot.search();
            if test_object::<L, G>(token, forest, tree, object, &exact, instance, search, below) {
                self.slot.current = ChildRef::NONE;
            } else {
                self.tighten();
            }
        }
    }

    /// Returns from an instance and goes on there.
    ///
    /// # Safety
    /// The current entry must be [`ChildRef::RETURN`].
    #[inline(always)]
    pub unsafe fn leave_instance(&mut self) {
        self.slot.return_outside();
        // SAFETY: the entry that ends the walk is below that of the instance.
        unsafe { self.pop() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::precision::Single;
    use crate::search::AcceptAll;
    use crate::search::{Any, Context};
    use crate::tree::SMALL_STACK;
    use crate::world::AcceleratorKind;
    use crate::world::tests::{Random, build, dust};
    use crate::world::{Structure, WorldBuilder};
    use snell_math::simd::{Level, Portable, Portable8};
    use snell_math::{DVec3, Ray, Transform};
    use std::sync::Arc;

    /// Dozens are in flight, and the first cache is small.
    #[test]
    #[cfg(target_pointer_width = "64")]
    fn a_slot_of_rays_of_single_precision_has_four_lines() {
        assert_eq!(size_of::<Slot<crate::search::Closest<Single>>>(), 4 * size_of::<Line>());
    }

    /// A search that is over in an instance does not return from it, so the next one has to forget
    /// where it was.
    #[test]
    fn searches_that_end_in_instances_leave_nothing_behind() {
        let mut random = Random(3);
        let mut builder = WorldBuilder::default();
        let [outer, inner] = [builder.add_group(), builder.add_group()];
        builder.add_mesh(inner, Arc::new(dust(&mut random, 3000)));
        for (group, child) in [(outer, inner), (WorldBuilder::ROOT, outer)] {
            for x in [-0.1, 0.0, 0.2] {
                builder.add_instance(group, child, Transform::translation(DVec3::splat(x)));
            }
        }
        let world = build(builder, AcceleratorKind::Bvh, Level::Scalar);
        let Structure::Bvh(forest) = &world.structure else {
            panic!("the product's own structure")
        };
        let tree = &forest.trees[0];
        let context =
            Context { filter: &AcceptAll, options: &world.options, data: &(), cancel: None };
        let rays: Vec<Ray> =
            (0..200).map(|_| Ray::new(random.point(0.5), random.direction())).collect();
        let mut below = [const { MaybeUninit::uninit() }; SMALL_STACK];
        let mut slots = Slots::<Any<Single>>::new(1, forest.stack_size());
        let number = slots.numbers().next().expect("one");
        // SAFETY: the steps follow from what is current; a forest of three levels needs fewer
        // entries than there are.
        unsafe {
            let mut slot = slots.at(number);
            let mut found = 0;
            for (i, ray) in rays.iter().enumerate() {
                let search = || Search::new(ray.into(), &context, Any::new(ray));
                assert!(slot.start::<Portable8>(tree, tree.root, i, &(), search, ray));
                assert_eq!((slot.outside.len(), slot.place.group), (0, 0));
                while slot.current != ChildRef::NONE {
                    if slot.current.is_node() {
                        let mut enters = Enters([0.0; 8]);
                        let met = slot.boxes_step::<Portable8>(Portable, &mut enters);
                        slot.push_step::<Portable8>(Portable, met, &enters);
                    } else if slot.current.is_triangles() {
                        let (lanes, block) =
                            (slot.leaf_step::<Portable8>(Portable), slot.leave_leaf());
                        if lanes != 0 {
                            slot.triangles_step(forest, lanes, block);
                        }
                    } else if slot.current == ChildRef::RETURN {
                        slot.leave_instance();
                    } else {
                        slot.object_step::<Portable8>(Portable, forest, &mut below);
                    }
                }
                let is_found = slot.search().goal.found;
                assert_eq!(
                    slot.outside.is_empty(),
                    !is_found,
                    "what is found is two instances deep"
                );
                found += usize::from(is_found);
            }
            assert!((20..180).contains(&found), "{found}");
        }
    }
}
