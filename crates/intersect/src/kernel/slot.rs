//! One walk of the interleaved kernel: a ray in flight, with the memory of its way.

use super::node::WideNode;
use super::node::{ChildRef, quick_distances};
use super::prefetch::fetch_lines;
use super::quick::QuickRay;
use super::traverse::{Stack, Walk, test_object};
use super::triangle::TriangleBlock;
use crate::accel::bvh::{Forest, GroupTree};
use crate::accel::group::{Object, ObjectRef, offer_triangle};
use crate::precision::Rules;
use crate::query::search::{DataOf, Goal, RayOf, Search};
use snell_math::simd::{Lanes8, WideLanes};
use snell_math::{DRay, DVec3};
use std::mem::MaybeUninit;

/// Entries of each stack.
pub(super) const STACK: usize = 504;

/// Where a ray is: in which group, with which coordinates.
#[derive(Clone, Copy)]
pub(super) struct Place {
    ray: QuickRay,
    nodes: *const WideNode,
    blocks: *const TriangleBlock,
    origin: DVec3,
    direction: DVec3,
    /// The group, and the occurrence number of it.
    group: u32,
    instance: u32,
}

impl Place {
    const UNSET: Self = Self {
        ray: QuickRay::UNSET,
        nodes: std::ptr::null(),
        blocks: std::ptr::null(),
        origin: DVec3::ZERO,
        direction: DVec3::ZERO,
        group: 0,
        instance: 0,
    };

    #[inline(always)]
    pub fn ray(&self) -> &QuickRay {
        &self.ray
    }

    #[inline(always)]
    pub fn nodes(&self) -> *const WideNode {
        self.nodes
    }

    /// The ray here; without an interval.
    fn exact(&self) -> DRay {
        DRay::new(self.origin, self.direction)
    }
}

/// Where boxes begin; aligned, so that it is in one line of the cache.
#[repr(align(32))]
struct Enters([f32; 8]);

/// A ray in flight.
#[repr(C, align(64))]
pub(super) struct Slot<'a, G: Goal> {
    /// Where it is.
    pub place: Place,
    t_min: f32,
    /// Padded limit of the search.
    cull: f32,
    /// What to visit next.
    pub current: ChildRef,
    /// Entries on the stack; the lowest one ends the walk.
    top: u32,
    /// What the last leaf left to be tested exactly.
    block: *const TriangleBlock,
    lanes: u32,
    node: *const WideNode,
    /// The children of the current node that are met, in order, and where.
    met: u32,
    enters: Enters,
    /// Which ray this is.
    pub number: usize,
    /// `None` before the first ray and after the last.
    pub search: Option<Search<'a, G>>,
    /// The places to return to.
    outside: Vec<Place>,
    /// Where the boxes of the entries begin, if the goal narrows, and what they lead to.
    distances: [MaybeUninit<f32>; STACK],
    children: [MaybeUninit<u32>; STACK],
}

impl<'a, G: Goal> Slot<'a, G> {
    /// Makes an idle slot, all but its stack.
    ///
    /// # Safety
    /// `slot` must be writable.
    pub unsafe fn init(slot: *mut Self) {
        // SAFETY: as promised by the caller. The stack needs no values.
        unsafe {
            (&raw mut (*slot).place).write(Place::UNSET);
            (&raw mut (*slot).t_min).write(0.0);
            (&raw mut (*slot).cull).write(0.0);
            (&raw mut (*slot).current).write(ChildRef::NONE);
            (&raw mut (*slot).top).write(1);
            (&raw mut (*slot).block).write(std::ptr::null());
            (&raw mut (*slot).lanes).write(0);
            (&raw mut (*slot).node).write(std::ptr::null());
            (&raw mut (*slot).met).write(0);
            (&raw mut (*slot).enters).write(Enters([0.0; 8]));
            (&raw mut (*slot).number).write(0);
            (&raw mut (*slot).search).write(None);
            (&raw mut (*slot).outside).write(Vec::new());
        }
    }

    /// Begins the walk of a ray through the root's tree, or from there on. False, and nothing done, if the ray is not ordinary.
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
        (place.nodes, place.blocks) = (tree.nodes.as_ptr(), tree.blocks.as_ptr());
        let exact = G::Precision::exact(ray);
        (place.origin, place.direction) = (exact.origin, exact.direction);
        (place.group, place.instance) = (0, 0);
        // (A search that was over in an instance has not returned.)
        self.outside.clear();
        let search = self.search.insert(search());
        (self.t_min, self.cull) = (search.start, search.cull());
        self.children[0].write(ChildRef::NONE.0);
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

    /// # Safety
    /// `top` must not be 0: the entry that ends the walk is still there.
    #[inline(always)]
    pub unsafe fn pop(&mut self) {
        self.top -= 1;
        // SAFETY: `top` was between 1 and the size of the stack, and all entries below it are written.
        self.current = ChildRef(unsafe { self.children.get_unchecked(self.top as usize).assume_init() });
    }

    /// What is still to be visited, the next last, and where the boxes begin.
    #[cfg(test)]
    pub fn entries(&self) -> Vec<(f32, ChildRef)> {
        if self.current == ChildRef::NONE {
            return vec![];
        }
        // The current one was popped last, or is the root.
        let at = |i: usize| {
            // SAFETY: entries below the top are written, and what was popped last is still there.
            unsafe { (self.distances[i].assume_init(), ChildRef(self.children[i].assume_init())) }
        };
        let top = self.top as usize;
        let mut entries: Vec<_> = (1..top).map(at).collect();
        entries.push(if entries.is_empty() && self.current.is_node() { (self.t_min, self.current) } else { at(top) });
        entries
    }

    /// Where the search begins, and its padded limit.
    #[inline(always)]
    pub fn interval(&self) -> [f32; 2] {
        [self.t_min, self.cull]
    }

    /// Goes on, after the start, with some of `children` instead of the root: those that the tags ([`WideLanes::look_up`]) of entries that are
    /// not negative tell, which must come first, the last of them at once. Their boxes begin at these distances or farther.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; the children must be of the same group, and no more than what the root would have left on the stack.
    #[inline(always)]
    pub unsafe fn go_on_with<L: WideLanes>(&mut self, entries: L, distances: L, children: &[u32; 32]) {
        // SAFETY: as promised by the caller. References are plain `u32`, and the lowest entry stays.
        unsafe {
            let own = &mut *self.children.as_mut_ptr().add(1).cast::<[u32; 8]>();
            entries.look_up(children, own);
            if G::NARROWS {
                distances.store(&mut *self.distances.as_mut_ptr().add(1).cast::<[f32; 8]>());
            }
            self.top = 1 + (!entries.signs() & 0xff).count_ones();
            self.pop();
        }
    }

    /// Tests the boxes of the current node. (The step is in two parts with the other slots between them: each waits less.)
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; there must be a search; the current reference must be a node of the group.
    #[inline(always)]
    pub unsafe fn boxes_step<L: Lanes8>(&mut self) {
        // SAFETY: as promised by the caller.
        unsafe {
            self.search().goal.count_node();
            let node = &*self.place.nodes.add(self.current.node_index());
            self.node = node;
            let (enter, limit) = quick_distances::<L>(node, &self.place.ray, self.t_min, self.cull);
            self.met = enter.le_in_order(limit, *node.order.get_unchecked(self.place.ray.octant()));
            if G::NARROWS {
                enter.store(&mut self.enters.0);
            }
        }
    }

    /// Goes on to the nearest box that was met, and notes the others.
    ///
    /// # Safety
    /// As [`Self::boxes_step`], which must have been done before; the stack must have room for eight more entries.
    #[inline(always)]
    pub unsafe fn push_step<L: Lanes8>(&mut self) {
        // SAFETY: as promised by the caller. References are plain `u32`, and `top` is at least 1.
        unsafe {
            let (node, top) = (&*self.node, self.top as usize);
            let values = &mut *self.distances.as_mut_ptr().add(top).cast::<[f32; 8]>();
            let children = &mut *self.children.as_mut_ptr().add(top).cast::<[u32; 8]>();
            let payload = &*node.children.as_ptr().cast::<[u32; 8]>();
            let order = *node.order.get_unchecked(self.place.ray.octant());
            if G::NARROWS {
                L::load(&self.enters.0).compress::<true>(self.met, order, payload, values, children);
            } else {
                L::splat(0.0).compress::<false>(self.met, order, payload, values, children);
            }
            self.top += self.met.count_ones();
            self.pop();
        }
    }

    /// Finds which triangles of the current leaf the ray's line may pass through.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; there must be a search; the current reference must be a block of the group.
    #[inline(always)]
    pub unsafe fn leaf_step<L: Lanes8>(&mut self) {
        // SAFETY: as promised by the caller.
        unsafe {
            self.block = self.place.blocks.add(self.current.block());
            let count = self.current.count();
            self.lanes = G::Precision::lines_through::<L>(&*self.block, &self.place.ray) & ((2 << (count - 1)) - 1);
            self.search().goal.count_primitives(count);
        }
    }

    /// Goes on after a leaf. True if [`Self::leaf_step`] has found any triangles.
    ///
    /// # Safety
    /// The current entry must be a leaf.
    #[inline(always)]
    pub unsafe fn leave_leaf(&mut self) -> bool {
        // SAFETY: the entry that ends the walk is below that of a leaf.
        unsafe { self.pop() };
        self.lanes != 0
    }

    /// Tests triangles exactly that [`Self::leaf_step`] has found.
    ///
    /// # Safety
    /// There must be a search; the last step must have found triangles.
    #[inline(always)]
    pub unsafe fn triangles_step(&mut self, forest: &Forest) {
        // SAFETY: as promised by the caller.
        unsafe {
            let (block, mut lanes) = (&*self.block, self.lanes);
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 7;
                lanes &= lanes - 1;
                let Place { ray, origin, direction, group, instance, .. } = &self.place;
                let ids = || {
                    let (geometry, primitive) = forest.trees.get_unchecked(*group as usize).triangle(block.ids[lane]);
                    [*instance, geometry, primitive]
                };
                let search = self.search.as_ref().unwrap_unchecked();
                let corners = block.corners(lane);
                let found = G::Precision::hit_on_line(search, ray, origin, direction, &corners, ids);
                if offer_triangle(self.search(), found) {
                    self.current = ChildRef::NONE;
                    return;
                }
            }
            self.tighten();
        }
    }

    /// After hits: a new limit, and the stack without what lies beyond it. The current entry must have been popped last.
    ///
    /// # Safety
    /// There must be a search.
    #[inline(always)]
    pub unsafe fn tighten(&mut self) {
        if !G::NARROWS {
            return;
        }
        // SAFETY: as promised by the caller; all entries up to the one popped last are written, and the lowest stays.
        unsafe {
            let cull = self.search().cull();
            if cull < self.cull {
                self.cull = cull;
                let mut kept = 1;
                for i in 1..=self.top as usize {
                    let (distance, child) = (*self.distances.get_unchecked(i), *self.children.get_unchecked(i));
                    *self.distances.get_unchecked_mut(kept) = distance;
                    *self.children.get_unchecked_mut(kept) = child;
                    kept += usize::from(distance.assume_init() <= cull);
                }
                self.top = kept as u32;
                self.pop();
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

    /// Tests the shape that is the current object and goes on to the next entry, or goes into an instance.
    ///
    /// # Safety
    /// There must be a search; the current reference must be an object of the group; the stack must have room for one more entry, and
    /// `below` for all groups; `enter` must be the entry of the level of `L`, which the machine must have.
    #[inline(always)]
    pub unsafe fn object_step<L: Lanes8>(&mut self, forest: &Forest, below: &mut Stack, enter: Walk<G>) {
        // SAFETY: as promised by the caller.
        unsafe {
            let object = self.current.index();
            let tree = forest.trees.get_unchecked(self.place.group as usize);
            if self.enter_instance::<L>(forest, tree.objects.get(object)) {
                return;
            }
            self.pop();
            let (exact, instance) = (self.place.exact(), self.place.instance);
            if test_object(forest, tree, object, &exact, instance, self.search(), below, enter) {
                self.current = ChildRef::NONE;
            } else {
                self.tighten();
            }
        }
    }

    /// Goes into an instance, if the object is one that can be walked in this slot.
    ///
    /// # Safety
    /// There must be a search; the stack must have room for one more entry.
    #[inline(always)]
    unsafe fn enter_instance<L: Lanes8>(&mut self, forest: &Forest, object: ObjectRef) -> bool {
        let ObjectRef::Placed(Object::Instance { child, offset, child_from_group, mask }) = object else {
            return false;
        };
        let tree = &forest.trees[*child];
        // SAFETY: as promised by the caller.
        let (visible, time, data) = unsafe { (self.search().mask, self.search().time, self.search().context.data) };
        if mask & visible == 0 || tree.root == ChildRef::NONE || !tree.unbounded.is_empty() {
            return false;
        }
        // (If it overflows, it is not ordinary.)
        let Some(ray) = child_from_group.mapped(&self.place.exact(), time) else { return false };
        self.outside.push(self.place);
        let place = &mut self.place;
        if !G::Precision::prepare::<L>(data, *child, &mut place.ray, &ray) {
            self.return_outside();
            return false;
        }
        (place.nodes, place.blocks) = (tree.nodes.as_ptr(), tree.blocks.as_ptr());
        (place.origin, place.direction) = (ray.origin, ray.direction);
        (place.group, place.instance) = (*child as u32, place.instance + offset);
        let top = self.top as usize;
        // SAFETY: as promised by the caller.
        unsafe {
            // Nearer than any limit.
            self.distances.get_unchecked_mut(top).write(f32::NEG_INFINITY);
            self.children.get_unchecked_mut(top).write(ChildRef::RETURN.0);
        }
        self.top += 1;
        self.current = tree.root;
        true
    }

    #[inline(always)]
    fn return_outside(&mut self) {
        if let Some(place) = self.outside.pop() {
            self.place = place;
        }
    }

    /// Returns from an instance and goes on there.
    ///
    /// # Safety
    /// The current entry must be [`ChildRef::RETURN`].
    #[inline(always)]
    pub unsafe fn leave_instance(&mut self) {
        self.return_outside();
        // SAFETY: the entry that ends the walk is below that of the instance.
        unsafe { self.pop() }
    }

    /// Asks for the memory of the triangles that [`Self::leaf_step`] has found, if they are not in the block.
    ///
    /// # Safety
    /// There must be a search; the last step must have been that of a leaf.
    #[inline(always)]
    pub unsafe fn fetch_triangles(&mut self, forest: &Forest) {
        if <G::Precision as Rules>::TRIANGLES_ELSEWHERE {
            let mut lanes = self.lanes;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 7;
                lanes &= lanes - 1;
                // SAFETY: as promised by the caller.
                unsafe {
                    let tree = forest.trees.get_unchecked(self.place.group as usize);
                    let (geometry, triangle) = tree.triangle((*self.block).ids[lane]);
                    G::Precision::fetch_triangle(self.search().context.data, geometry, triangle);
                }
            }
        }
    }

    /// Asks for the memory of what is current if it is a leaf. (Without a branch, too.)
    #[inline(always)]
    pub fn fetch_leaf(&self) {
        let block = self.place.blocks.wrapping_add(self.current.block()).cast::<u8>();
        let this = (&raw const *self).cast::<u8>();
        fetch_lines(std::hint::select_unpredictable(self.current.is_triangles(), block, this), 5);
    }

    /// Asks for the memory of what is current. (Without a branch: whether it is a node or a leaf is as good as random.)
    #[inline(always)]
    pub fn fetch_ahead(&self) {
        let node = self.place.nodes.wrapping_add(self.current.index()).cast::<u8>();
        let block = self.place.blocks.wrapping_add(self.current.block()).cast::<u8>();
        fetch_lines(std::hint::select_unpredictable(self.current.is_node(), node, block), 5);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::AcceleratorKind;
    use crate::kernel::traverse::{SMALL_STACK, walk_portable};
    use crate::precision::Single;
    use crate::query::AcceptAll;
    use crate::query::search::{Any, Context};
    use crate::world::tests::{Random, build, dust};
    use crate::world::{Structure, WorldBuilder};
    use snell_math::simd::{Level, Portable8};
    use snell_math::{DVec3, Ray, Transform};
    use std::sync::Arc;

    /// A search that is over in an instance does not return from it, so the next one has to forget where it was.
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
        let Structure::Bvh(forest) = &world.structure else { panic!("the product's own structure") };
        let tree = &forest.trees[0];
        let context = Context { filter: &AcceptAll, options: &world.options, data: &() };
        let rays: Vec<Ray> = (0..200).map(|_| Ray::new(random.point(0.5), random.direction())).collect();
        let mut below = [const { MaybeUninit::uninit() }; SMALL_STACK];
        let mut slot = Box::<Slot<Any<Single>>>::new_uninit();
        // SAFETY: the steps follow from what is current; a forest of three levels needs fewer entries than there are.
        unsafe {
            Slot::init(slot.as_mut_ptr());
            let mut slot = slot.assume_init();
            let mut found = 0;
            for (i, ray) in rays.iter().enumerate() {
                let search = || Search::new(ray.into(), &context, Any::new(ray));
                assert!(slot.start::<Portable8>(tree, tree.root, i, &(), search, ray));
                assert_eq!((slot.outside.len(), slot.place.group), (0, 0));
                while slot.current != ChildRef::NONE {
                    if slot.current.is_node() {
                        slot.boxes_step::<Portable8>();
                        slot.push_step::<Portable8>();
                    } else if slot.current.is_triangles() {
                        slot.leaf_step::<Portable8>();
                        if slot.leave_leaf() {
                            slot.triangles_step(forest);
                        }
                    } else if slot.current == ChildRef::RETURN {
                        slot.leave_instance();
                    } else {
                        slot.object_step::<Portable8>(forest, &mut below, walk_portable::<Any<Single>>);
                    }
                }
                let is_found = slot.search().goal.found;
                assert_eq!(slot.outside.is_empty(), !is_found, "what is found is two instances deep");
                found += usize::from(is_found);
            }
            assert!((20..180).contains(&found), "{found}");
        }
    }
}
