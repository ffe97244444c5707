//! The traversal of the tree of a group by packets.

use super::certain::CertainHits;
use super::exact::{Found, Pairs};
use super::frustum::{Packet, PerRay, RAYS};
use super::leaf::Leaf;
use super::objects::enter_object;
use super::triangles::Locals;
use crate::kernel::Goal;
use crate::kernel::single::traverse::Entry;
use crate::prefetch::fetch_lines;
use crate::search::GeometryOptions;
use crate::search::{DataOf, HitOf, RayOf, RealOf, Search};
use crate::tree::node::{ChildRef, WideNode};
use crate::tree::{Forest, GroupTree};
use snell_math::simd::{Lanes8, Lanes16, Token, max};
use std::mem::MaybeUninit;
use std::sync::atomic::AtomicBool;

/// The size in bytes of a tree from which on its nodes are prefetched.
const PREFETCH_BYTES: usize = 2 << 20;

/// The size in bytes of a tree from which on all leaves below a node are prefetched with it,
/// whether they are hit or not, because the next packets will hit them.
const LEAVES_BYTES: usize = 32 << 20;

/// The largest number of packets that are traversed together.
pub(super) const MAX_PACKETS: usize = 4;

/// The stacks of traversals. Packets push children with their distances, places (node times eight
/// plus slot) and the packets that hit them; a separate stack is for single rays.
pub(super) struct Stacks {
    pub(super) distances: Vec<f32>,
    pub(super) places: Vec<u32>,
    /// For all slots of the node, the packets that hit them: eight bits per packet.
    pub(super) hit_masks: Vec<u32>,
    pub(super) single: Vec<MaybeUninit<Entry>>,
    /// Memory for packets in instances.
    #[allow(clippy::vec_box, reason = "they are large, and come and go")]
    pub(super) spare: Vec<Box<PacketGroup>>,
    /// Approximate work of a traversal, in units of box tests.
    pub(super) work: u32,
}

impl Stacks {
    /// The number of entries that fit the stacks.
    #[inline(always)]
    fn room(&self) -> usize {
        self.distances.len().min(self.places.len()).min(self.hit_masks.len())
    }
}

/// A subset of the packets: the lowest bit of a byte for each.
pub(super) type Members = u32;

/// The group that packets traverse.
#[derive(Clone, Copy)]
pub(super) struct Group<'t> {
    pub(super) tree: &'t GroupTree,
    /// The occurrence number of the group.
    pub(super) instance: u32,
}

/// The position of a traversal.
#[derive(Clone, Copy)]
pub(super) struct Cursor {
    pub(super) group: usize,
    /// The occurrence number of the group.
    pub(super) instance: u32,
    /// The index of the first free entry of the stacks.
    pub(super) top: usize,
}

/// Calls [`walk`] without inlining it.
#[inline(always)]
pub(super) fn enter<W: Lanes16, G: Goal>(
    token: W::Token,
    states: &mut PacketStates<'_, '_, '_, G>,
    members: Members,
    stacks: &mut Stacks,
    cursor: Cursor,
) {
    token.run(
        #[inline(always)]
        move || walk::<W, G>(token, states, members, stacks, cursor),
    );
}

/// The searches of the rays of a run during a traversal.
pub(super) struct Walker<'w, 's, G: Goal> {
    pub(super) forest: &'w Forest,
    pub(super) data: &'w DataOf<G>,
    pub(super) options: &'w [GeometryOptions],
    /// Ends all searches early when it is set.
    pub(super) cancel: Option<&'w AtomicBool>,
    /// The mask bits that all rays of the run have in common.
    pub(super) masks: u64,
    /// The rays of the run.
    pub(super) rays: &'w [RayOf<G>],
    /// The number of the first ray of the run in the batch.
    pub(super) first: usize,
    /// The searches of rays with hits that need the filter or other checks. Rays that hit nothing
    /// or only plain triangles need no search.
    pub(super) searches: PerRay<Option<Search<'s, G>>>,
    /// A bit for each ray that has a search.
    pub(super) searched: u32,
    /// The rays without a search that have a hit that counts.
    pub(super) hit: u32,
    /// The nearest hit of each of these rays (an arbitrary hit for occlusion queries).
    pub(super) nearest: PerRay<HitOf<G>>,
    /// Begins the search of a ray, given by its number. It writes in place, because a returned
    /// search would be copied as a whole just after it was written in pieces.
    pub(super) begin: &'w dyn Fn(usize, &mut Option<Search<'s, G>>),
    /// Memory for the results of pairs.
    pub(super) found: Found<RealOf<G>>,
    /// The rays whose search is not over.
    pub(super) alive: u32,
    /// Hits in the group that are certain except for their distance.
    pub(super) deferred: Deferred,
    /// Rays that are left to other kernels, because a deferred hit turned out to be elsewhere.
    pub(super) unresolved: u32,
    /// Rays without a search whose nearest hit was deferred and is certain. The data of these hits
    /// are in `certain_hits`.
    pub(super) certain: u32,
    pub(super) certain_hits: CertainHits<RealOf<G>>,
    /// True if triangles count as small ([`super::trial::Detail`]).
    pub(super) is_small: bool,
    /// The numbers of leaves and triangles from which `is_small` is decided.
    pub(super) counted: [u32; 2],
}

/// The nearest certain hit of each ray so far, to be tested exactly at the end.
pub(super) struct Deferred {
    /// The rays that have such a hit.
    pub(super) rays: u32,
    /// The rays among these for which it is only certain that they hit the projection of the
    /// triangle.
    pub(super) projected: u32,
    /// The places of the triangles ([`Pairs`]).
    pub(super) triangles: PerRay<u32>,
    /// The numbers of the triangles, because pieces of one triangle may be in several leaves.
    pub(super) ids: PerRay<u32>,
}

impl Deferred {
    pub(super) const NONE: Self =
        Self { rays: 0, projected: 0, triangles: [0; RAYS], ids: [0; RAYS] };
}

/// A packet that traverses a group.
pub(super) struct PacketState<'r, 'w, 's, G: Goal> {
    pub(super) walker: &'r mut Walker<'w, 's, G>,
    pub(super) packet: &'r mut Packet,
    pub(super) scratch: &'r mut Scratch,
}

/// All packets that may be traversed together.
pub(super) type PacketStates<'r, 'w, 's, G> = [PacketState<'r, 'w, 's, G>; MAX_PACKETS];

/// The scratch data of a packet in a group.
pub(super) struct Scratch {
    pub(super) pairs: Pairs,
    pub(super) locals: Locals,
}

impl Scratch {
    /// Prepares the data for another packet, perhaps in another group. Places of triangles must not
    /// stay, because in double precision unused pairs are read too.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.pairs = Pairs::NONE;
        self.locals.clear();
    }
}

/// The packets in a group and their scratch data. (Never moved, because it is large and most of it
/// is not written.)
pub(super) struct PacketGroup {
    pub(super) packets: [Packet; MAX_PACKETS],
    scratches: [Scratch; MAX_PACKETS],
}

impl PacketGroup {
    pub(super) fn new() -> Box<Self> {
        let scratch = || Scratch { pairs: Pairs::NONE, locals: Locals::new() };
        Box::new(Self {
            packets: [const { Packet::NONE }; MAX_PACKETS],
            scratches: [scratch(), scratch(), scratch(), scratch()],
        })
    }

    /// The first of some packets, and the packets that are coherent with it.
    #[inline(always)]
    pub(super) fn coherent(&mut self, members: Members) -> Members {
        let (first, mut rest, mut coherent) =
            (first(members), members & (members - 1), members & members.wrapping_neg());
        while let Some(number) = next(&mut rest) {
            if let Ok([one, other]) = self.packets.get_disjoint_mut([first, number])
                && one.is_coherent_with(other)
            {
                one.widen(other);
                coherent |= 1 << (8 * number);
            }
        }
        // All packets get the error bounds of the first.
        let mut rest = coherent & (coherent - 1);
        while let Some(number) = next(&mut rest) {
            if let Ok([one, other]) = self.packets.get_disjoint_mut([first, number]) {
                other.widen(one);
            }
        }
        coherent
    }

    /// The states of the packets, given their walkers.
    #[inline(always)]
    pub(super) fn states<'r, 'w, 's, G: Goal>(
        &'r mut self,
        [i, j, k, l]: [&'r mut Walker<'w, 's, G>; MAX_PACKETS],
    ) -> PacketStates<'r, 'w, 's, G> {
        let ([a, b, c, d], [e, f, g, h]) = (&mut self.packets, &mut self.scratches);
        [
            PacketState { walker: i, packet: a, scratch: e },
            PacketState { walker: j, packet: b, scratch: f },
            PacketState { walker: k, packet: c, scratch: g },
            PacketState { walker: l, packet: d, scratch: h },
        ]
    }
}

/// Traverses one group with some of the packets, which must be
/// [coherent](Packet::is_coherent_with). Each visits the nodes that it would visit alone, in the
/// same order.
///
/// # Panics
/// If the stacks have no room for the group and all below it.
#[inline(always)]
fn walk<W: Lanes16, G: Goal>(
    token: W::Token,
    states: &mut PacketStates<'_, '_, '_, G>,
    members: Members,
    stacks: &mut Stacks,
    cursor: Cursor,
) {
    let forest = states[first(members)].walker.forest;
    assert!(
        stacks.room() >= cursor.top + forest.stack_sizes[cursor.group],
        "room for the way down"
    );
    let tree = &forest.trees[cursor.group];
    let group = Group { tree, instance: cursor.instance };
    for &object in &tree.unbounded {
        let mut rest = members;
        while let Some(number) = next(&mut rest) {
            let PacketState { walker, packet, .. } = &mut states[number];
            let alive = walker.alive;
            walker.test_objects::<W>(
                token,
                group,
                object as usize,
                packet,
                alive,
                &mut stacks.single,
            );
        }
    }
    descend::<W, G>(token, group, states, members, stacks, cursor);
    // After an instance, the limits of the rays are needed again.
    let last = cursor.group == 0;
    let mut rest = members;
    while let Some(number) = next(&mut rest) {
        let PacketState { walker, packet, scratch: Scratch { pairs, locals } } =
            &mut states[number];
        if pairs.count != 0 && walker.alive != 0 {
            walker.test_pairs::<W>(token, group, packet, pairs, locals, last);
        }
        walker.test_deferred::<W>(token, group, packet, locals, last);
    }
}

/// Traverses the tree of the group at the cursor.
#[inline(always)]
fn descend<W: Lanes16, G: Goal>(
    token: W::Token,
    group: Group,
    states: &mut PacketStates<'_, '_, '_, G>,
    members: Members,
    stacks: &mut Stacks,
    cursor: Cursor,
) {
    let (base, tree) = (cursor.top, group.tree);
    let bytes = tree.memory_bytes();
    let (prefetch, fetches_leaves) = (bytes > PREFETCH_BYTES, bytes > LEAVES_BYTES);
    let first = first(members);
    let common = states[first].packet.kind.common;
    let mut top = base;
    let (mut far, mut fars) = limits(states, members);
    let (mut node, mut hitting) = (tree.root.index(), members);
    while far > f32::NEG_INFINITY {
        // SAFETY: `node` is the root or a child of a node, which the tree has (`GroupTree`). `walk`
        // has asserted room for 7 entries a level and 8 more, and a node pushes at most eight, of
        // which one is popped before the next level.
        let (parent, pushed) = unsafe {
            let parent = tree.nodes.get_unchecked(node);
            let hitting = [first as u32, hitting];
            (parent, push_children::<W, G>(token, parent, node, states, hitting, far, stacks, top))
        };
        if fetches_leaves {
            let leaves = parent.children.into_iter().filter(|child| child.is_triangles());
            leaves.for_each(|leaf| fetch_ahead(tree, leaf));
        }
        if prefetch {
            for &place in stacks.places[top..top + pushed].iter().rev() {
                // SAFETY: `push_children` has just written the place, of the node that it was
                // given.
                fetch_ahead(tree, unsafe { child_at(tree, place) }.1);
            }
        }
        top += pushed;
        loop {
            if top == base {
                return;
            }
            top -= 1;
            // SAFETY: `top` was more than `base`, so this entry was pushed, within the stacks.
            let (distance, place, hit_masks) = unsafe {
                (
                    *stacks.distances.get_unchecked(top),
                    *stacks.places.get_unchecked(top),
                    *stacks.hit_masks.get_unchecked(top),
                )
            };
            if distance > far {
                continue;
            }
            stacks.work += 1;
            hitting = hit_masks >> (place & 7) & within(distance, &fars);
            // SAFETY: `push_children` has written the place, of a node of the tree.
            let (parent, child) = unsafe { child_at(tree, place) };
            if hitting == 0 {
                continue;
            }
            if common && child.is_node() {
                // For rays with a common origin, the planes around the packet are good enough, and
                // the traversal need not wait for tests of single rays.
                node = child.index();
                break;
            }
            let mut rays = [0; MAX_PACKETS];
            let mut rest = hitting;
            let one = states[first].packet.one_box::<W>(token, parent, place as usize & 7);
            while rest != 0 {
                let bit = rest.trailing_zeros();
                rest &= rest - 1;
                let number = (bit >> 3) as usize & (MAX_PACKETS - 1);
                let state = &states[number];
                let those = state.packet.rays_hitting::<W>(token, &one) & state.walker.alive;
                rays[number] = those;
                hitting &= !(u32::from(those == 0) << bit);
            }
            if hitting == 0 {
                continue;
            }
            if child.is_node() {
                node = child.index();
                break;
            }
            stacks.work += 2;
            if child.is_triangles() {
                let mut room = MaybeUninit::uninit();
                let mut leaf = Leaf::<W>::new(token, tree, child, &mut room);
                while let Some(number) = next(&mut hitting) {
                    let PacketState { walker, packet, scratch } = &mut states[number];
                    walker.test_triangles::<W>(
                        token,
                        group,
                        &mut leaf,
                        packet,
                        rays[number],
                        scratch,
                    );
                }
            } else {
                let mut rest = hitting;
                while let Some(number) = next(&mut rest) {
                    let PacketState { walker, packet, scratch } = &mut states[number];
                    walker.test_deferred::<W>(token, group, packet, &mut scratch.locals, false);
                }
                let inside = Cursor { top, ..cursor };
                enter_object::<W, G>(token, group, child, states, hitting, &rays, &inside, stacks);
            }
            (far, fars) = limits(states, members);
        }
    }
}

/// The number of the first packet of a subset.
#[inline(always)]
pub(super) fn first(members: Members) -> usize {
    members.trailing_zeros() as usize >> 3 & (MAX_PACKETS - 1)
}

/// Removes the first packet from a subset and returns its number.
#[inline(always)]
pub(super) fn next(members: &mut Members) -> Option<usize> {
    if *members == 0 {
        return None;
    }
    let number = first(*members);
    *members &= *members - 1;
    Some(number)
}

/// The distances beyond which nothing matters: to any of the packets, and to each.
#[inline(always)]
fn limits<G: Goal>(
    states: &PacketStates<'_, '_, '_, G>,
    members: Members,
) -> (f32, [f32; MAX_PACKETS]) {
    let (mut farthest, mut fars) = (f32::NEG_INFINITY, [f32::NEG_INFINITY; MAX_PACKETS]);
    for (i, (state, far)) in states.iter().zip(&mut fars).enumerate() {
        *far =
            if members >> (8 * i) & 1 == 1 { state.packet.packet_far } else { f32::NEG_INFINITY };
        farthest = max(farthest, *far);
    }
    (farthest, fars)
}

/// The packets whose limits are not nearer than a distance: the lowest bit of a byte for each.
#[inline(always)]
fn within(distance: f32, fars: &[f32; MAX_PACKETS]) -> u32 {
    let mut packets = 0;
    for (i, &far) in fars.iter().enumerate() {
        packets |= u32::from(distance <= far) << (8 * i);
    }
    packets
}

/// Pushes the children of a node (given with its number) that some of the packets hit onto the
/// stacks, the nearest on top. Returns the number of these children.
///
/// # Safety
/// The stacks must have room for eight entries from `top`.
#[inline(always)]
unsafe fn push_children<W: Lanes16, G: Goal>(
    token: W::Token,
    node: &WideNode,
    number: usize,
    states: &PacketStates<'_, '_, '_, G>,
    [first, mut hitting]: [u32; 2],
    far: f32,
    stacks: &mut Stacks,
    top: usize,
) -> usize {
    let half = W::half_token(token);
    let all: [u32; 8] = std::array::from_fn(|slot| (number * 8 + slot) as u32);
    let first = &states[first as usize & (MAX_PACKETS - 1)].packet;
    let boxes = first.boxes::<W::Half>(half, node);
    let (mut nearest, mut met) = (W::Half::splat(half, f32::INFINITY), 0);
    while hitting != 0 {
        let bit = hitting.trailing_zeros();
        hitting &= hitting - 1;
        let packet = &states[(bit >> 3) as usize & (MAX_PACKETS - 1)].packet;
        let enter = packet.box_distances(half, &boxes);
        met |= enter.le(W::Half::splat(half, packet.packet_far)) << bit;
        nearest = nearest.min(enter);
    }
    // SAFETY: the caller promises room for eight entries from `top` on in each of the three arrays,
    // and an array has the alignment of its elements.
    let (distances, places, hit_masks) = unsafe {
        (
            &mut *stacks.distances.as_mut_ptr().add(top).cast::<[f32; 8]>(),
            &mut *stacks.places.as_mut_ptr().add(top).cast::<[u32; 8]>(),
            &mut *stacks.hit_masks.as_mut_ptr().add(top).cast::<[u32; 8]>(),
        )
    };
    *hit_masks = [met; 8];
    let order = node.order[first.octant & 7];
    nearest.compress_le(W::Half::splat(half, far), order, &all, distances, places)
}

impl<'s, G: Goal> Walker<'_, 's, G> {
    /// The search of a ray, which is begun if necessary.
    #[inline(always)]
    pub(super) fn search(&mut self, ray: usize) -> &mut Search<'s, G> {
        let search = &mut self.searches[ray];
        if self.searched >> ray & 1 == 0 {
            self.searched |= 1 << ray;
            (self.begin)(self.first + ray, search);
            if let Some(search) = search
                && self.hit >> ray & 1 == 1
            {
                self.hit &= !(1 << ray);
                search.goal.take(self.nearest[ray]);
            }
        }
        search.as_mut().expect("it has a search")
    }

    /// Writes the exact rays of the packet, unless that was done before.
    #[inline(always)]
    pub(super) fn want_rays(&self, packet: &mut Packet) {
        if !packet.has_rays {
            if packet.kind.rounded {
                packet.rays.write_columns::<G::Precision>(self.rays, &packet.exact);
            } else {
                packet.rays.write::<G::Precision>(self.rays);
            }
            packet.has_rays = true;
        }
    }
}

/// The child at a place, and its parent node.
///
/// # Safety
/// The place must belong to a node of the tree.
#[inline(always)]
unsafe fn child_at(tree: &GroupTree, place: u32) -> (&WideNode, ChildRef) {
    // SAFETY: a place is eight times the number of its node, plus the slot, and the caller promises
    // that the tree has this node.
    let node = unsafe { tree.nodes.get_unchecked(place as usize >> 3) };
    (node, node.children[place as usize & 7])
}

/// Prefetches a node or block.
#[inline(always)]
fn fetch_ahead(tree: &GroupTree, child: ChildRef) {
    let (start, packet_rays) = if child.is_node() {
        (tree.nodes.as_ptr().wrapping_add(child.index()).cast::<u8>(), 4)
    } else {
        (tree.blocks.at().address(child.block()), 5)
    };
    fetch_lines(start, packet_rays);
}
