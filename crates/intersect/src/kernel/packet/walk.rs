//! The walk of a bundle through the tree of a group.

use super::super::node::ChildRef;
use super::super::traverse::{Entry, Walk};
use super::bundle::{Bundle, PerRay};
use super::exact::{Found, Pairs};
use super::sure::Sure;
use super::triangles::Locals;
use crate::accel::bvh::{Forest, GroupTree};
use crate::query::search::{DataOf, Goal, RayOf, RealOf, Search};
use crate::world::GeometryOptions;
#[cfg(target_arch = "x86_64")]
use snell_math::simd::{Avx8, Avx16};
use snell_math::simd::{Lanes8, Lanes16, Pair, Portable8};
use std::mem::MaybeUninit;

/// Trees larger than this are fetched ahead.
const PREFETCH_BYTES: usize = 8 << 20;

/// Memory of the walks: what bundles put off, by distance, place (node times eight plus slot) and the rays that meet the node, and the
/// stack of single rays.
pub(super) struct Stacks {
    pub(super) distances: Vec<f32>,
    pub(super) places: Vec<u32>,
    pub(super) masks: Vec<u32>,
    pub(super) single: Vec<MaybeUninit<Entry>>,
}

/// The walk of a level.
pub(super) type WalkBundle<G> = unsafe fn(&mut Walker<'_, '_, G>, Position, &mut Bundle);

/// Where a bundle is.
#[derive(Clone, Copy)]
pub(super) struct Position {
    pub(super) group: usize,
    /// The occurrence number of the group.
    pub(super) instance: u32,
    /// From where the stack is free.
    pub(super) top: usize,
}

/// # Safety
/// As [`Walker::walk`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn walk_bundle_avx2<G: Goal>(
    walker: &mut Walker<'_, '_, G>,
    position: Position,
    bundle: &mut Bundle,
) {
    // SAFETY: as promised by the caller.
    unsafe { walker.walk::<Pair<Avx8>>(position, bundle) }
}

/// # Safety
/// As [`Walker::walk`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn walk_bundle_avx512<G: Goal>(
    walker: &mut Walker<'_, '_, G>,
    position: Position,
    bundle: &mut Bundle,
) {
    // SAFETY: as promised by the caller.
    unsafe { walker.walk::<Avx16>(position, bundle) }
}

/// # Safety
/// As [`Walker::walk`].
pub(super) unsafe fn walk_bundle_portable<G: Goal>(
    walker: &mut Walker<'_, '_, G>,
    position: Position,
    bundle: &mut Bundle,
) {
    // SAFETY: as promised by the caller.
    unsafe { walker.walk::<Pair<Portable8>>(position, bundle) }
}

/// The searches of a run on their way through the forest.
pub(super) struct Walker<'w, 's, G: Goal> {
    pub(super) forest: &'w Forest,
    pub(super) data: &'w DataOf<G>,
    pub(super) options: &'w [GeometryOptions],
    /// What all rays have in their masks.
    pub(super) masks: u32,
    /// The rays of the run.
    pub(super) rays: &'w [RayOf<G>],
    /// Begun when something was found that may count: rays that surely meet nothing need none.
    pub(super) searches: &'w mut PerRay<Option<Search<'s, G>>>,
    /// Begins the search of a ray.
    pub(super) begin: &'w dyn Fn(usize, &mut Option<Search<'s, G>>),
    /// Memory for what becomes of pairs.
    pub(super) found: &'w mut Found<RealOf<G>>,
    pub(super) stacks: &'w mut Stacks,
    /// The rays whose search is not over.
    pub(super) alive: u32,
    /// The rays of the group that surely hit something, and the place of the nearest of that ([`Pairs`]): tested exactly in the end.
    pub(super) waiting: u32,
    pub(super) put_off: PerRay<u32>,
    /// Memory for bundles in instances.
    #[allow(clippy::vec_box, reason = "they are large, and come and go")]
    pub(super) spare: &'w mut Vec<Box<Bundle>>,
    /// About what it took: a box tested is one.
    pub(super) work: u32,
    /// Rays without a search whose nearest hit is known: in `sure`, of what was put off.
    pub(super) known: u32,
    pub(super) sure: &'w mut Sure<RealOf<G>>,
    pub(super) enter: WalkBundle<G>,
    pub(super) enter_single: Walk<G>,
}

impl<'s, G: Goal> Walker<'_, 's, G> {
    /// Walks one group.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; the stacks must have room for the group and all below it.
    #[inline(always)]
    unsafe fn walk<W: Lanes16>(&mut self, position: Position, bundle: &mut Bundle) {
        let tree = &self.forest.trees[position.group];
        let instance = position.instance;
        let (mut pairs, mut locals) = (Pairs::NONE, Locals::new());
        // SAFETY: as promised by the caller.
        unsafe {
            for &object in &tree.unbounded {
                self.test_objects::<W>(tree, object as usize, bundle, self.alive, instance);
            }
            self.descend::<W>(tree, position, bundle, &mut pairs, &mut locals);
            if pairs.count != 0 && self.alive != 0 {
                self.test_pairs::<W>(tree, bundle, &mut pairs, &mut locals, instance, true);
            }
            self.test_put_off::<W>(tree, bundle, &mut locals, instance, true, position.group == 0);
        }
    }

    /// Walks the tree of a group.
    ///
    /// # Safety
    /// As [`Self::walk`].
    #[inline(always)]
    unsafe fn descend<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        position: Position,
        bundle: &mut Bundle,
        pairs: &mut Pairs,
        locals: &mut Locals,
    ) {
        let (base, instance) = (position.top, position.instance);
        let prefetch = tree.memory_bytes() > PREFETCH_BYTES;
        let mut top = base;
        let (mut node, mut mask) = (tree.root.index(), self.alive);
        while self.alive != 0 {
            // SAFETY: the builder makes only references to nodes that exist; a walk holds at most 7 entries per level.
            unsafe {
                let pushed = self.push_children::<W>(tree, node, mask, bundle, top);
                if prefetch {
                    for i in top..top + pushed {
                        fetch_ahead(tree, child_at(tree, *self.stacks.places.get_unchecked(i)));
                    }
                }
                top += pushed;
            }
            loop {
                if top == base {
                    return;
                }
                top -= 1;
                // SAFETY: entries below the former `top` are written.
                let (distance, place, meeting) = unsafe {
                    (
                        *self.stacks.distances.get_unchecked(top),
                        *self.stacks.places.get_unchecked(top),
                        *self.stacks.masks.get_unchecked(top),
                    )
                };
                if distance > bundle.bundle_far {
                    continue;
                }
                self.work += 1;
                // SAFETY: places come from nodes that exist.
                let child = unsafe { child_at(tree, place) };
                if bundle.kind.common && child.is_node() {
                    // (Planes are as good here, and the walk goes on without waiting for the rays.)
                    (node, mask) = (child.index(), meeting);
                    break;
                }
                // SAFETY: places come from nodes that exist; `W` as promised by the caller.
                let meeting = unsafe {
                    let node = tree.nodes.get_unchecked(place as usize >> 3);
                    bundle.rays_meeting::<W>(node, place as usize & 7) & meeting
                };
                if meeting == 0 {
                    continue;
                }
                if child.is_node() {
                    (node, mask) = (child.index(), meeting);
                    break;
                }
                self.work += 2;
                // SAFETY: as promised by the caller.
                unsafe {
                    if child.is_triangles() {
                        self.test_triangles::<W>(tree, child, bundle, meeting, pairs, locals, instance);
                    } else {
                        self.test_put_off::<W>(tree, bundle, locals, instance, false, false);
                        self.enter_object::<W>(tree, child, bundle, meeting, &Position { top, ..position });
                    }
                }
            }
        }
    }

    /// The search of a ray; it begins if it has not.
    #[inline(always)]
    pub(super) fn search(&mut self, ray: usize) -> &mut Search<'s, G> {
        let search = &mut self.searches[ray];
        if search.is_none() {
            (self.begin)(ray, search);
        }
        search.as_mut().expect("it has begun")
    }

    /// Writes the rays of the bundle exactly, if that has not been done.
    #[inline(always)]
    pub(super) fn want_rays(&self, bundle: &mut Bundle) {
        if !bundle.has_rays {
            bundle.rays.write::<G::Precision>(self.rays);
            bundle.has_rays = true;
        }
    }

    /// Puts the children of a node that the bundle meets on the stack, the nearest on top, and returns how many they are.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; the node must exist, and the stack must have room for eight entries from `top`.
    #[inline(always)]
    unsafe fn push_children<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        node: usize,
        mask: u32,
        bundle: &Bundle,
        top: usize,
    ) -> usize {
        // SAFETY: as promised by the caller.
        unsafe {
            *self.stacks.masks.as_mut_ptr().add(top).cast::<[u32; 8]>() = [mask; 8];
            let places: [u32; 8] = std::array::from_fn(|slot| (node * 8 + slot) as u32);
            let node = tree.nodes.get_unchecked(node);
            let enter = bundle.box_distances::<W::Half>(node);
            let distances = &mut *self.stacks.distances.as_mut_ptr().add(top).cast::<[f32; 8]>();
            let payload = &mut *self.stacks.places.as_mut_ptr().add(top).cast::<[u32; 8]>();
            let order = *node.order.get_unchecked(bundle.octant);
            enter.compress_le(W::Half::splat(bundle.bundle_far), order, &places, distances, payload)
        }
    }
}

/// The child at a place.
///
/// # Safety
/// The place must be one of the tree.
#[inline(always)]
unsafe fn child_at(tree: &GroupTree, place: u32) -> ChildRef {
    // SAFETY: as promised by the caller.
    unsafe { tree.nodes.get_unchecked(place as usize >> 3).children[place as usize & 7] }
}

/// Asks for the memory of a node or block.
#[inline(always)]
fn fetch_ahead(tree: &GroupTree, child: ChildRef) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let (start, lines): (*const i8, usize) = if child.is_node() {
            (tree.nodes.as_ptr().wrapping_add(child.index()).cast(), 4)
        } else {
            (tree.blocks.as_ptr().wrapping_add(child.block()).cast(), 5)
        };
        for line in 0..lines {
            // SAFETY: asking ahead reads nothing: any address will do.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (tree, child);
}
