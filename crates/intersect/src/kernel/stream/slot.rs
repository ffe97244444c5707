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
use std::cell::UnsafeCell;
use std::marker::PhantomData;
use std::mem::{MaybeUninit, offset_of};

/// The position of a ray in the scene: its group and coordinates.
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
    /// The entry to visit next.
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
#[repr(align(64))]
struct Line(#[expect(dead_code, reason = "slots lie in it")] UnsafeCell<MaybeUninit<[u8; 64]>>);

/// Slots, each with its stack behind it.
pub(super) struct Slots<'a, G: Goal> {
    memory: Box<[Line]>,
    /// PacketRays of each.
    lines: usize,
    slots: PhantomData<Slot<'a, G>>,
}

impl<'a, G: Goal> Slots<'a, G> {
    /// Idle slots, for stacks of at most this many entries.
    pub fn new(count: usize, entries: usize) -> Self {
        // (Eight are written at a time.)
        let stack = (entries + 16) * Slot::<G>::ENTRY * size_of::<u32>();
        // An odd number: so they do not compete for the same places in the cache.
        let lines = (size_of::<Slot<G>>() + stack).div_ceil(size_of::<Line>()) | 1;
        let memory =
            (0..count * lines).map(|_| Line(UnsafeCell::new(MaybeUninit::uninit()))).collect();
        let slots = Self { memory, lines, slots: PhantomData };
        for i in 0..count {
            let slot = slots.get(i);
            // SAFETY: the memory is there, and aligned; there is no other reference to it.
            unsafe {
                slot.write(Slot {
                    t_min: 0.0,
                    cull: 0.0,
                    current: ChildRef::NONE,
                    top: 1,
                    place: Place::UNSET,
                    search: None,
                    number: 0,
                    outside: Vec::new(),
                });
                Slot::entry(slot, 0).write(ChildRef::NONE.0);
            }
        }
        slots
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.memory.len() / self.lines
    }

    /// One of them.
    pub fn get(&self, i: usize) -> *mut Slot<'a, G> {
        let lines = &raw const self.memory[i * self.lines..][..self.lines];
        // (All of it is in cells.)
        lines.cast::<Slot<'a, G>>().cast_mut()
    }
}

impl<G: Goal> Drop for Slots<'_, G> {
    fn drop(&mut self) {
        for i in 0..self.len() {
            // SAFETY: they were made in `new`.
            unsafe { self.get(i).drop_in_place() };
        }
    }
}

impl<'a, G: Goal> Slot<'a, G> {
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
        // SAFETY: as promised by the caller.
        unsafe { self.search.as_mut().unwrap_unchecked() }
    }

    /// Numbers of an entry of the stack: what it leads to, and the bits of where its box begins, if
    /// the goal narrows.
    const ENTRY: usize = if G::NARROWS { 2 } else { 1 };

    /// An entry of the stack, which is behind the slot.
    ///
    /// # Safety
    /// It must be a slot of [`Slots`], and have this entry.
    #[inline(always)]
    unsafe fn entry(this: *mut Self, i: usize) -> *mut u32 {
        // SAFETY: as promised by the caller.
        unsafe { this.add(1).cast::<u32>().add(Self::ENTRY * i) }
    }

    /// # Safety
    /// It must be a slot of [`Slots`]; `top` must not be 0: the entry that ends the walk is still
    /// there.
    #[inline(always)]
    pub unsafe fn pop(this: *mut Self) {
        // SAFETY: `top` was between 1 and the size of the stack, and all entries below it are
        // written.
        unsafe {
            (*this).top -= 1;
            (*this).current = ChildRef(Self::entry(this, (*this).top as usize).read());
        }
    }

    /// The stack of entries to visit, with the distances of their boxes.
    #[cfg(test)]
    pub unsafe fn entries(this: *mut Self) -> Vec<(f32, ChildRef)> {
        // SAFETY: entries below the top are written, and what was popped last is still there.
        unsafe {
            let (current, top) = ((*this).current, (*this).top as usize);
            if current == ChildRef::NONE {
                return vec![];
            }
            // The current one was popped last, or is the root.
            let at = |i: usize| {
                (
                    f32::from_bits(Self::entry(this, i).add(1).read()),
                    ChildRef(Self::entry(this, i).read()),
                )
            };
            let mut entries: Vec<_> = (1..top).map(at).collect();
            entries.push(if entries.is_empty() && current.is_node() {
                ((*this).t_min, current)
            } else {
                at(top)
            });
            entries
        }
    }

    /// The start of the search, and its padded limit.
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

    /// Starts with some of `children` instead of the root: those in the tags
    /// ([`WideLanes::look_up`]) of the entries that are not negative, which must come first; the
    /// last of them is visited at once. Their boxes start at these distances or farther.
    ///
    /// # Safety
    /// It must be a slot of [`Slots`]. The children must be of the same group, and no more than
    /// what the root would have left on the stack.
    #[inline(always)]
    pub unsafe fn go_on_with<L: WideLanes>(
        this: *mut Self,
        entries: L,
        distances: L,
        children: &[u32; 32],
    ) {
        // SAFETY: as promised by the caller. References are plain `u32`, and the lowest entry
        // stays.
        unsafe {
            let first = Self::entry(this, 1);
            if G::NARROWS {
                let mut own = [0; 8];
                entries.look_up(children, &mut own);
                distances.store_after(&own, &mut *first.cast());
            } else {
                entries.look_up(children, &mut *first.cast());
            }
            (*this).top = 1 + (!entries.signs() & 0xff).count_ones();
            Self::pop(this);
        }
    }

    /// Tests the boxes of the current node. Returns the children that are hit, in order, and writes
    /// their distances, if the goal narrows. (The step is in two parts with the other slots between
    /// them, which hides latency.)
    ///
    /// # Safety
    /// There must be a search; the current reference must be a node of the group.
    #[inline(always)]
    pub unsafe fn boxes_step<L: Lanes8>(&mut self, token: L::Token, enters: &mut Enters) -> u32 {
        // SAFETY: as promised by the caller.
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

    /// Goes on to the nearest box that was met, and notes the others.
    ///
    /// # Safety
    /// It must be a slot of [`Slots`]. As [`Self::boxes_step`], which must have given `met` and
    /// `enters`; the stack must have room for eight more entries.
    #[inline(always)]
    pub unsafe fn push_step<L: Lanes8>(
        this: *mut Self,
        token: L::Token,
        met: u32,
        enters: &Enters,
    ) {
        // SAFETY: as promised by the caller. References are plain `u32`, and `top` is at least 1.
        unsafe {
            let (Place { nodes, ray, .. }, top) = (&(*this).place, (*this).top as usize);
            let node = &*nodes.add((*this).current.node_index());
            let payload = &*node.children.as_ptr().cast::<[u32; 8]>();
            let order = node.order[ray.octant()];
            let to = Self::entry(this, top);
            if G::NARROWS {
                L::load(token, &enters.0).compress(met, order, payload, &mut *to.cast());
            } else {
                L::compress_payload(token, met, order, payload, &mut *to.cast());
            }
            (*this).top += met.count_ones();
            Self::pop(this);
        }
    }

    /// Returns the triangles of the current leaf that the ray's line may hit.
    ///
    /// # Safety
    /// There must be a search; the current reference must be a block of the group.
    #[inline(always)]
    pub unsafe fn leaf_step<L: Lanes8>(&mut self, token: L::Token) -> u32 {
        // SAFETY: as promised by the caller.
        unsafe {
            let (mut room, count) = (MaybeUninit::uninit(), self.current.count());
            let block = self.place.blocks().block::<L>(token, self.current.block(), &mut room);
            self.search().goal.count_primitives(count);
            G::Precision::lines_through::<L>(token, block, &self.place.ray)
                & ((2 << (count - 1)) - 1)
        }
    }

    /// Goes on after a leaf. Returns the number of its block.
    ///
    /// # Safety
    /// It must be a slot of [`Slots`]. The current entry must be a leaf.
    #[inline(always)]
    pub unsafe fn leave_leaf(this: *mut Self) -> u32 {
        // SAFETY: the entry that ends the walk is below that of a leaf.
        unsafe {
            let block = (*this).current.block() as u32;
            Self::pop(this);
            block
        }
    }

    /// Tests triangles exactly that [`Self::leaf_step`] has found.
    ///
    /// # Safety
    /// It must be a slot of [`Slots`]. There must be a search; `lanes` must be what the last leaf
    /// step has found in this block.
    #[inline(always)]
    pub unsafe fn triangles_step(this: *mut Self, forest: &Forest, mut lanes: u32, block: u32) {
        // SAFETY: as promised by the caller.
        unsafe {
            let slot = &mut *this;
            let (blocks, block) = (slot.place.blocks(), block as usize);
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 7;
                lanes &= lanes - 1;
                let Place { ray, origin, direction, group, instance, .. } = &slot.place;
                let ids = || {
                    let (geometry, primitive) = forest
                        .trees
                        .get_unchecked(*group as usize)
                        .triangle(blocks.id(block, lane));
                    [*instance, geometry, primitive]
                };
                let search = slot.search.as_ref().unwrap_unchecked();
                let corners = blocks.corners(block, lane);
                let found =
                    G::Precision::hit_on_line(search, ray, origin, direction, &corners, ids);
                if offer_triangle(slot.search(), found) {
                    slot.current = ChildRef::NONE;
                    return;
                }
            }
            Self::tighten(this);
        }
    }

    /// After hits: a new limit, and the stack without what lies beyond it. The current entry must
    /// have been popped last.
    ///
    /// # Safety
    /// It must be a slot of [`Slots`], with a search.
    #[inline(always)]
    pub unsafe fn tighten(this: *mut Self) {
        if !G::NARROWS {
            return;
        }
        // SAFETY: as promised by the caller; all entries up to the one popped last are written, and
        // the lowest stays.
        unsafe {
            let cull = (*this).search().cull();
            if cull < (*this).cull {
                (*this).cull = cull;
                let mut kept = 1;
                for i in 1..=(*this).top as usize {
                    let entry = Self::entry(this, i).cast::<[u32; 2]>().read();
                    Self::entry(this, kept).cast::<[u32; 2]>().write(entry);
                    kept += usize::from(f32::from_bits(entry[1]) <= cull);
                }
                (*this).top = kept as u32;
                Self::pop(this);
            }
        }
    }

    /// Asks for the memory of the current object.
    ///
    /// # Safety
    /// The current reference must be an object of the group.
    #[inline(always)]
    pub unsafe fn fetch_object(&self, forest: &Forest) {
        // SAFETY: as promised by the caller.
        let tree = unsafe { forest.trees.get_unchecked(self.place.group as usize) };
        tree.objects.fetch(self.current.index());
    }

    /// Tests the shape that is the current object and moves to the next entry, or enters an
    /// instance.
    ///
    /// # Safety
    /// It must be a slot of [`Slots`]. There must be a search; the current reference must be an
    /// object of the group; the stack must have room for one more entry.
    #[inline(always)]
    pub unsafe fn object_step<L: Lanes8>(
        this: *mut Self,
        token: L::Token,
        forest: &Forest,
        below: &mut Stack,
    ) {
        // SAFETY: as promised by the caller.
        unsafe {
            let slot = &mut *this;
            let object = slot.current.index();
            let tree = forest.trees.get_unchecked(slot.place.group as usize);
            if let Some(root) = slot.enter_instance::<L>(forest, tree.objects.get(object)) {
                let entry = Self::entry(this, slot.top as usize);
                entry.write(ChildRef::RETURN.0);
                if G::NARROWS {
                    // Nearer than any limit.
                    entry.add(1).write(f32::NEG_INFINITY.to_bits());
                }
                (*this).top += 1;
                (*this).current = root;
                return;
            }
            Self::pop(this);
            let slot = &mut *this;
            let (exact, instance) = (slot.place.exact(), slot.place.instance);
            let search = slot.search();
            if test_object::<L, G>(token, forest, tree, object, &exact, instance, search, below) {
                slot.current = ChildRef::NONE;
            } else {
                Self::tighten(this);
            }
        }
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
        // SAFETY: as promised by the caller.
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

    /// Returns from an instance and continues in its parent.
    ///
    /// # Safety
    /// It must be a slot of [`Slots`]. The current entry must be [`ChildRef::RETURN`].
    #[inline(always)]
    pub unsafe fn leave_instance(this: *mut Self) {
        // SAFETY: the entry that ends the walk is below that of the instance.
        unsafe {
            (*this).return_outside();
            Self::pop(this);
        }
    }

    /// Asks for the memory of the triangles that [`Self::leaf_step`] has found, if they are not in
    /// the block.
    ///
    /// # Safety
    /// As [`Self::triangles_step`].
    #[inline(always)]
    pub unsafe fn fetch_triangles(&mut self, forest: &Forest, mut lanes: u32, block: u32) {
        if <G::Precision as TriangleTest>::TRIANGLES_ELSEWHERE {
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 7;
                lanes &= lanes - 1;
                // SAFETY: as promised by the caller.
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
        let slots = Slots::<Any<Single>>::new(1, forest.stack_size());
        // SAFETY: the steps follow from what is current; a forest of three levels needs fewer
        // entries than there are.
        unsafe {
            let slot = slots.get(0);
            let mut found = 0;
            for (i, ray) in rays.iter().enumerate() {
                let search = || Search::new(ray.into(), &context, Any::new(ray));
                assert!((*slot).start::<Portable8>(tree, tree.root, i, &(), search, ray));
                assert_eq!(((*slot).outside.len(), (*slot).place.group), (0, 0));
                while (*slot).current != ChildRef::NONE {
                    if (*slot).current.is_node() {
                        let mut enters = Enters([0.0; 8]);
                        let met = (*slot).boxes_step::<Portable8>(Portable, &mut enters);
                        Slot::push_step::<Portable8>(slot, Portable, met, &enters);
                    } else if (*slot).current.is_triangles() {
                        let (lanes, block) =
                            ((*slot).leaf_step::<Portable8>(Portable), Slot::leave_leaf(slot));
                        if lanes != 0 {
                            Slot::triangles_step(slot, forest, lanes, block);
                        }
                    } else if (*slot).current == ChildRef::RETURN {
                        Slot::leave_instance(slot);
                    } else {
                        Slot::object_step::<Portable8>(slot, Portable, forest, &mut below);
                    }
                }
                let is_found = (*slot).search().goal.found;
                assert_eq!(
                    (*slot).outside.is_empty(),
                    !is_found,
                    "what is found is two instances deep"
                );
                found += usize::from(is_found);
            }
            assert!((20..180).contains(&found), "{found}");
        }
    }
}
