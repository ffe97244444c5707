//! The walk of a bundle through the tree of a group.

use super::bundle::{Bundle, PerRay};
use super::exact::{Found, Pairs};
use super::leaf::Leaf;
use super::objects::enter_object;
use super::sure::Sure;
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

/// Trees larger than this are fetched ahead.
const PREFETCH_BYTES: usize = 2 << 20;

/// In trees larger than this all leaves below a node are fetched with it, whether they are met or
/// not: the bundles that come next will meet them.
const LEAVES_BYTES: usize = 32 << 20;

/// Bundles that walk together at most.
pub(super) const ROWS: usize = 4;

/// Memory of the walks: what bundles put off, by distance, place (node times eight plus slot) and
/// which bundles meet the node, and the stack of single rays.
pub(super) struct Stacks {
    pub(super) distances: Vec<f32>,
    pub(super) places: Vec<u32>,
    /// Of all slots of the node: eight bits a bundle.
    pub(super) meetings: Vec<u32>,
    pub(super) single: Vec<MaybeUninit<Entry>>,
    /// Of bundles in instances.
    #[allow(clippy::vec_box, reason = "they are large, and come and go")]
    pub(super) spare: Vec<Box<Luggage>>,
    /// About what walks took: a box tested is one.
    pub(super) work: u32,
}

impl Stacks {
    /// Of how many entries.
    #[inline(always)]
    fn room(&self) -> usize {
        self.distances.len().min(self.places.len()).min(self.meetings.len())
    }
}

/// Some of the rows: the first bit of a byte for each.
pub(super) type Members = u32;

/// The group that bundles are in.
#[derive(Clone, Copy)]
pub(super) struct Group<'t> {
    pub(super) tree: &'t GroupTree,
    /// Its occurrence number.
    pub(super) instance: u32,
}

/// Where bundles are.
#[derive(Clone, Copy)]
pub(super) struct Position {
    pub(super) group: usize,
    /// The occurrence number of the group.
    pub(super) instance: u32,
    /// From where the stack is free.
    pub(super) top: usize,
}

/// [`walk`], not inlined.
#[inline(always)]
pub(super) fn enter<W: Lanes16, G: Goal>(
    token: W::Token,
    rows: &mut Rows<'_, '_, '_, G>,
    members: Members,
    stacks: &mut Stacks,
    position: Position,
) {
    token.run(
        #[inline(always)]
        move || walk::<W, G>(token, rows, members, stacks, position),
    );
}

/// The searches of a run on their way through the forest.
pub(super) struct Walker<'w, 's, G: Goal> {
    pub(super) forest: &'w Forest,
    pub(super) data: &'w DataOf<G>,
    pub(super) options: &'w [GeometryOptions],
    /// Ends all searches early when it is set.
    pub(super) cancel: Option<&'w AtomicBool>,
    /// What all rays have in their masks.
    pub(super) masks: u32,
    /// The rays of the run, and the number of the first.
    pub(super) rays: &'w [RayOf<G>],
    pub(super) first: usize,
    /// Begun when something was found that must be asked about: rays that meet nothing, or plain
    /// triangles only, need none.
    pub(super) searches: PerRay<Option<Search<'s, G>>>,
    pub(super) begun: u32,
    /// Rays without a search that met something that counts, and the nearest of that (anything
    /// where any hit will do).
    pub(super) met: u32,
    pub(super) nearest: PerRay<HitOf<G>>,
    /// Begins the search of a ray, given by its number. (In place: what is returned would be copied
    /// as a whole after it was written in pieces.)
    pub(super) begin: &'w dyn Fn(usize, &mut Option<Search<'s, G>>),
    /// Memory for what becomes of pairs.
    pub(super) found: Found<RealOf<G>>,
    /// The rays whose search is not over.
    pub(super) alive: u32,
    /// The rays of the group that surely hit something, and the place of the nearest of that
    /// ([`Pairs`]): tested exactly in the end.
    pub(super) waiting: u32,
    pub(super) put_off: PerRay<u32>,
    /// Which triangles these are (pieces of one may be in several leaves), and of which it is only
    /// known that their drawing is hit.
    pub(super) put_off_ids: PerRay<u32>,
    pub(super) drawn: u32,
    /// The rays that are left to others: something was put off that does not count where it seemed
    /// to.
    pub(super) given_up: u32,
    /// Rays without a search whose nearest hit is known: in `sure`, of what was put off.
    pub(super) known: u32,
    pub(super) sure: Sure<RealOf<G>>,
    /// As [`super::trial::Detail`] has it: triangles are small; and what was counted.
    pub(super) is_small: bool,
    pub(super) counted: [u32; 2],
}

/// A bundle on its walk through a group.
pub(super) struct Row<'r, 'w, 's, G: Goal> {
    pub(super) walker: &'r mut Walker<'w, 's, G>,
    pub(super) bundle: &'r mut Bundle,
    pub(super) memory: &'r mut Memory,
}

/// All that may walk together.
pub(super) type Rows<'r, 'w, 's, G> = [Row<'r, 'w, 's, G>; ROWS];

/// What a bundle keeps on its way through a group.
pub(super) struct Memory {
    pub(super) pairs: Pairs,
    pub(super) locals: Locals,
}

impl Memory {
    /// Prepares it for another bundle, perhaps in another group: places of triangles must not stay,
    /// since in double precision what is not used is read, too.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.pairs = Pairs::NONE;
        self.locals.clear();
    }
}

/// What belongs to rows in a group. (Never moved: it is large, and most of it is not written.)
pub(super) struct Luggage {
    pub(super) bundles: [Bundle; ROWS],
    memories: [Memory; ROWS],
}

impl Luggage {
    pub(super) fn new() -> Box<Self> {
        let memory = || Memory { pairs: Pairs::NONE, locals: Locals::new() };
        Box::new(Self {
            bundles: [const { Bundle::NONE }; ROWS],
            memories: [memory(), memory(), memory(), memory()],
        })
    }

    /// The first of some members, and those that may walk with it.
    #[inline(always)]
    pub(super) fn alike(&mut self, members: Members) -> Members {
        let (first, mut rest, mut alike) =
            (first(members), members & (members - 1), members & members.wrapping_neg());
        while let Some(number) = next(&mut rest) {
            if let Ok([one, other]) = self.bundles.get_disjoint_mut([first, number])
                && one.is_like(other)
            {
                one.widen(other);
                alike |= 1 << (8 * number);
            }
        }
        // All see boxes and triangles as the first one does.
        let mut rest = alike & (alike - 1);
        while let Some(number) = next(&mut rest) {
            if let Ok([one, other]) = self.bundles.get_disjoint_mut([first, number]) {
                other.widen(one);
            }
        }
        alike
    }

    /// Rows for some walkers.
    #[inline(always)]
    pub(super) fn rows<'r, 'w, 's, G: Goal>(
        &'r mut self,
        [i, j, k, l]: [&'r mut Walker<'w, 's, G>; ROWS],
    ) -> Rows<'r, 'w, 's, G> {
        let ([a, b, c, d], [e, f, g, h]) = (&mut self.bundles, &mut self.memories);
        [
            Row { walker: i, bundle: a, memory: e },
            Row { walker: j, bundle: b, memory: f },
            Row { walker: k, bundle: c, memory: g },
            Row { walker: l, bundle: d, memory: h },
        ]
    }
}

/// Walks one group with some of the bundles, which must be [alike](Bundle::is_like): each meets
/// what it would meet alone, in the same order.
///
/// # Panics
/// If the stacks have no room for the group and all below it.
#[inline(always)]
fn walk<W: Lanes16, G: Goal>(
    token: W::Token,
    rows: &mut Rows<'_, '_, '_, G>,
    members: Members,
    stacks: &mut Stacks,
    position: Position,
) {
    let forest = rows[first(members)].walker.forest;
    assert!(
        stacks.room() >= position.top + forest.stack_sizes[position.group],
        "room for the way down"
    );
    let tree = &forest.trees[position.group];
    let group = Group { tree, instance: position.instance };
    for &object in &tree.unbounded {
        let mut rest = members;
        while let Some(number) = next(&mut rest) {
            let Row { walker, bundle, .. } = &mut rows[number];
            let alive = walker.alive;
            walker.test_objects::<W>(
                token,
                group,
                object as usize,
                bundle,
                alive,
                &mut stacks.single,
            );
        }
    }
    descend::<W, G>(token, group, rows, members, stacks, position);
    // (From an instance, the limits of the rays are taken back.)
    let last = position.group == 0;
    let mut rest = members;
    while let Some(number) = next(&mut rest) {
        let Row { walker, bundle, memory: Memory { pairs, locals } } = &mut rows[number];
        if pairs.count != 0 && walker.alive != 0 {
            walker.test_pairs::<W>(token, group, bundle, pairs, locals, last);
        }
        walker.test_put_off::<W>(token, group, bundle, locals, last);
    }
}

/// Walks the tree of the group at the position.
#[inline(always)]
fn descend<W: Lanes16, G: Goal>(
    token: W::Token,
    group: Group,
    rows: &mut Rows<'_, '_, '_, G>,
    members: Members,
    stacks: &mut Stacks,
    position: Position,
) {
    let (base, tree) = (position.top, group.tree);
    let bytes = tree.memory_bytes();
    let (prefetch, fetches_leaves) = (bytes > PREFETCH_BYTES, bytes > LEAVES_BYTES);
    let first = first(members);
    let common = rows[first].bundle.kind.common;
    let mut top = base;
    let (mut far, mut fars) = limits(rows, members);
    let (mut node, mut meeting) = (tree.root.index(), members);
    while far > f32::NEG_INFINITY {
        // SAFETY: nodes are the root and those that nodes refer to, which exist; a walk holds at
        // most 7 entries per level, and `walk` has seen that there is room for 8 at the bottom.
        let (parent, pushed) = unsafe {
            let parent = tree.nodes.get_unchecked(node);
            let meeting = [first as u32, meeting];
            (parent, push_children::<W, G>(token, parent, node, rows, meeting, far, stacks, top))
        };
        if fetches_leaves {
            let leaves = parent.children.into_iter().filter(|child| child.is_triangles());
            leaves.for_each(|leaf| fetch_ahead(tree, leaf));
        }
        if prefetch {
            for &place in stacks.places[top..top + pushed].iter().rev() {
                // SAFETY: places are those of nodes that exist.
                fetch_ahead(tree, unsafe { child_at(tree, place) }.1);
            }
        }
        top += pushed;
        loop {
            if top == base {
                return;
            }
            top -= 1;
            // SAFETY: `top` was within the stacks.
            let (distance, place, meetings) = unsafe {
                (
                    *stacks.distances.get_unchecked(top),
                    *stacks.places.get_unchecked(top),
                    *stacks.meetings.get_unchecked(top),
                )
            };
            if distance > far {
                continue;
            }
            stacks.work += 1;
            meeting = meetings >> (place & 7) & within(distance, &fars);
            // SAFETY: places are those of nodes that exist.
            let (parent, child) = unsafe { child_at(tree, place) };
            if meeting == 0 {
                continue;
            }
            if common && child.is_node() {
                // (Planes are as good here, and the walk goes on without waiting for the rays.)
                node = child.index();
                break;
            }
            let mut rays = [0; ROWS];
            let mut rest = meeting;
            let one = rows[first].bundle.one_box::<W>(token, parent, place as usize & 7);
            while rest != 0 {
                let bit = rest.trailing_zeros();
                rest &= rest - 1;
                let number = (bit >> 3) as usize & (ROWS - 1);
                let row = &rows[number];
                let those = row.bundle.rays_meeting::<W>(token, &one) & row.walker.alive;
                rays[number] = those;
                meeting &= !(u32::from(those == 0) << bit);
            }
            if meeting == 0 {
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
                while let Some(number) = next(&mut meeting) {
                    let Row { walker, bundle, memory } = &mut rows[number];
                    walker.test_triangles::<W>(
                        token,
                        group,
                        &mut leaf,
                        bundle,
                        rays[number],
                        memory,
                    );
                }
            } else {
                let mut rest = meeting;
                while let Some(number) = next(&mut rest) {
                    let Row { walker, bundle, memory } = &mut rows[number];
                    walker.test_put_off::<W>(token, group, bundle, &mut memory.locals, false);
                }
                let inside = Position { top, ..position };
                enter_object::<W, G>(token, group, child, rows, meeting, &rays, &inside, stacks);
            }
            (far, fars) = limits(rows, members);
        }
    }
}

/// The number of the first of some members.
#[inline(always)]
pub(super) fn first(members: Members) -> usize {
    members.trailing_zeros() as usize >> 3 & (ROWS - 1)
}

/// Takes the first of some members.
#[inline(always)]
pub(super) fn next(members: &mut Members) -> Option<usize> {
    if *members == 0 {
        return None;
    }
    let number = first(*members);
    *members &= *members - 1;
    Some(number)
}

/// Beyond which nothing is of interest to any bundle, and to each.
#[inline(always)]
fn limits<G: Goal>(rows: &Rows<'_, '_, '_, G>, members: Members) -> (f32, [f32; ROWS]) {
    let (mut farthest, mut fars) = (f32::NEG_INFINITY, [f32::NEG_INFINITY; ROWS]);
    for (i, (row, far)) in rows.iter().zip(&mut fars).enumerate() {
        *far = if members >> (8 * i) & 1 == 1 { row.bundle.bundle_far } else { f32::NEG_INFINITY };
        farthest = max(farthest, *far);
    }
    (farthest, fars)
}

/// The bundles whose limits are not nearer than a distance: the first bit of a byte for each.
#[inline(always)]
fn within(distance: f32, fars: &[f32; ROWS]) -> u32 {
    let mut bundles = 0;
    for (i, &far) in fars.iter().enumerate() {
        bundles |= u32::from(distance <= far) << (8 * i);
    }
    bundles
}

/// Puts the children of a node, given with its number, that some of the bundles meet on the stack,
/// the nearest on top, and returns how many they are.
///
/// # Safety
/// The stacks must have room for eight entries from `top`.
#[inline(always)]
unsafe fn push_children<W: Lanes16, G: Goal>(
    token: W::Token,
    node: &WideNode,
    number: usize,
    rows: &Rows<'_, '_, '_, G>,
    [first, mut meeting]: [u32; 2],
    far: f32,
    stacks: &mut Stacks,
    top: usize,
) -> usize {
    let half = W::half_token(token);
    let all: [u32; 8] = std::array::from_fn(|slot| (number * 8 + slot) as u32);
    let first = &rows[first as usize & (ROWS - 1)].bundle;
    let boxes = first.boxes::<W::Half>(half, node);
    let (mut nearest, mut met) = (W::Half::splat(half, f32::INFINITY), 0);
    while meeting != 0 {
        let bit = meeting.trailing_zeros();
        meeting &= meeting - 1;
        let bundle = &rows[(bit >> 3) as usize & (ROWS - 1)].bundle;
        let enter = bundle.box_distances(half, &boxes);
        met |= enter.le(W::Half::splat(half, bundle.bundle_far)) << bit;
        nearest = nearest.min(enter);
    }
    // SAFETY: by the caller's promise there are eight entries of each.
    let (distances, places, meetings) = unsafe {
        (
            &mut *stacks.distances.as_mut_ptr().add(top).cast::<[f32; 8]>(),
            &mut *stacks.places.as_mut_ptr().add(top).cast::<[u32; 8]>(),
            &mut *stacks.meetings.as_mut_ptr().add(top).cast::<[u32; 8]>(),
        )
    };
    *meetings = [met; 8];
    let order = node.order[first.octant & 7];
    nearest.compress_le(W::Half::splat(half, far), order, &all, distances, places)
}

impl<'s, G: Goal> Walker<'_, 's, G> {
    /// The search of a ray; it begins if it has not.
    #[inline(always)]
    pub(super) fn search(&mut self, ray: usize) -> &mut Search<'s, G> {
        let search = &mut self.searches[ray];
        if self.begun >> ray & 1 == 0 {
            self.begun |= 1 << ray;
            (self.begin)(self.first + ray, search);
            if let Some(search) = search
                && self.met >> ray & 1 == 1
            {
                self.met &= !(1 << ray);
                search.goal.take(self.nearest[ray]);
            }
        }
        search.as_mut().expect("it has begun")
    }

    /// Writes the rays of the bundle exactly, if that has not been done.
    #[inline(always)]
    pub(super) fn want_rays(&self, bundle: &mut Bundle) {
        if !bundle.has_rays {
            if bundle.kind.rounded {
                bundle.rays.write_columns::<G::Precision>(self.rays, &bundle.exact);
            } else {
                bundle.rays.write::<G::Precision>(self.rays);
            }
            bundle.has_rays = true;
        }
    }
}

/// The child at a place, and the node that it is of.
///
/// # Safety
/// The place must be one of a node of the tree.
#[inline(always)]
unsafe fn child_at(tree: &GroupTree, place: u32) -> (&WideNode, ChildRef) {
    // SAFETY: the caller promises that the place is of a node.
    let node = unsafe { tree.nodes.get_unchecked(place as usize >> 3) };
    (node, node.children[place as usize & 7])
}

/// Asks for the memory of a node or block.
#[inline(always)]
fn fetch_ahead(tree: &GroupTree, child: ChildRef) {
    let (start, lines) = if child.is_node() {
        (tree.nodes.as_ptr().wrapping_add(child.index()).cast::<u8>(), 4)
    } else {
        (tree.blocks.at().address(child.block()), 5)
    };
    fetch_lines(start, lines);
}
