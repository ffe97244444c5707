//! The binary tree that every builder makes, and how it is best collapsed into 8-wide nodes.
//!
//! Each inner node stores, for each number of slots (2 to 8) of a wide node that its subtree may
//! get, how many of them go to its first child so that the total area of all wide nodes is least.
//! This is the dynamic programme of Ylitie, Karras and Laine (Efficient Incoherent Ray Traversal on
//! GPUs Through Compressed Wide BVHs, 2017, section 3.1). Leaves have the same cost in every
//! arrangement and do not count.

use super::binning::Box8;
use snell_math::{Bounds3, Vec3};

/// The least total area of the wide nodes of a subtree that gets `i` slots, at index `i` from 1 to
/// 7.
pub(super) type Costs = [f32; 8];

/// The costs of a leaf.
pub(super) const LEAF_COSTS: Costs = [0.0; 8];

/// For 2 to 8 slots, the number of slots for the first child, in 3 bits each. 0 means that the
/// subtree is best a wide node of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Choices(u32);

/// `SHARES[k][slots - 1]` is the bits of [`Choices`] that give `k` of `slots` slots to the first
/// child.
const SHARES: [[u32; 8]; 8] = {
    let mut shares = [[0; 8]; 8];
    let mut k = 0;
    while k < 8 {
        let mut slots = 2;
        while slots <= 8 {
            shares[k][slots - 1] = (k as u32) << (3 * slots);
            slots += 1;
        }
        k += 1;
    }
    shares
};

impl Choices {
    /// One slot for the first child, the others for the second. (It sets a bit that [`Self::best`]
    /// never sets, so it can be recognised.)
    const ONE: Self = Self(0o1_111_111_100);

    /// The number of slots that the first child gets of `slots`.
    #[inline(always)]
    fn first(self, slots: usize) -> usize {
        (self.0 >> (3 * slots)) as usize & 7
    }

    /// Computes the best choices of an inner node, and its costs.
    #[inline]
    pub fn best(half_area: f32, first: &Costs, second: &Costs) -> (Self, Costs) {
        // The costs for 1 to 8 slots (lanes 0 to 7) if the first child gets `k` of them. Less than
        // one slot for the second child has an infinite cost.
        let mut seconds = [f32::INFINITY; 16];
        seconds[9..].copy_from_slice(&second[1..]);
        let given =
            |k: usize| -> [f32; 8] { std::array::from_fn(|lane| first[k] + seconds[9 - k + lane]) };
        let (mut least, mut shares) = (given(1), SHARES[1]);
        for (k, shares_of_k) in SHARES.iter().enumerate().skip(2) {
            let costs = given(k);
            for lane in 0..8 {
                let better = costs[lane] < least[lane];
                least[lane] = if better { costs[lane] } else { least[lane] };
                shares[lane] = if better { shares_of_k[lane] } else { shares[lane] };
            }
        }
        let mut choices = shares.iter().fold(0, |all, share| all | share);
        // With one slot, the subtree is a wide node of its own. The best choice for fewer slots may
        // also be the best for more slots.
        let mut costs = [f32::INFINITY; 8];
        costs[1] = half_area + least[7];
        for slots in 2..8 {
            let (more, fewer) = (least[slots - 1], costs[slots - 1]);
            costs[slots] = if more >= fewer { fewer } else { more };
            // If one slot less is no worse, its choice is used; the second child may get one slot
            // more than it needs.
            let field = 7 << (3 * slots);
            choices ^= (choices ^ (choices << 3)) & (field * u32::from(more >= fewer));
        }
        (Self(choices), costs)
    }
}

/// A node of a [`Part`]. The first child of an inner node follows it directly.
#[derive(Clone, Copy, Debug)]
pub(super) struct BinaryNode {
    low: [f32; 3],
    /// The index of the second child, or for a leaf the index of its first primitive.
    link: u32,
    high: [f32; 3],
    /// The choices of an inner node, or [`LEAF`] plus the number of primitives of a leaf. That
    /// number lies below the bits of choices, so a leaf reads as choices that are all 0.
    kind: u32,
}

const LEAF: u32 = 1 << 31;

/// A subtree whose nodes are stored together, with the primitives of its leaves.
#[derive(Debug)]
pub(super) struct Part<'a, P> {
    nodes: Vec<BinaryNode>,
    primitives: &'a [P],
    costs: Costs,
}

/// Collects the nodes of a part.
#[derive(Debug, Default)]
pub(super) struct PartBuilder {
    nodes: Vec<BinaryNode>,
}

impl PartBuilder {
    /// A builder for about this many primitives.
    pub fn new(primitives: usize) -> Self {
        Self { nodes: Vec::with_capacity(primitives / 2 + 8) }
    }

    #[inline(always)]
    fn push(&mut self, bounds: &Box8, link: u32, kind: u32) {
        let b = bounds.bounds();
        self.nodes.push(BinaryNode { low: b.min.to_array(), link, high: b.max.to_array(), kind });
    }

    /// Adds a leaf of `count` primitives: one object, or up to eight triangles.
    pub fn leaf(&mut self, bounds: &Box8, first: usize, count: usize) -> Costs {
        self.push(bounds, first as u32, LEAF | count as u32);
        LEAF_COSTS
    }

    /// Adds an inner node whose children are added by `first` and `second`, in this order.
    pub fn inner(
        &mut self,
        bounds: &Box8,
        first: impl FnOnce(&mut Self) -> Costs,
        second: impl FnOnce(&mut Self) -> Costs,
    ) -> Costs {
        let index = self.nodes.len();
        self.push(bounds, 0, 0);
        let first = first(self);
        let link = self.nodes.len() as u32;
        let second = second(self);
        let (choices, costs) = Choices::best(bounds.half_area(), &first, &second);
        let node = &mut self.nodes[index];
        (node.link, node.kind) = (link, choices.0);
        costs
    }

    /// Adds a leaf whose box is computed later by [`Self::complete`].
    pub fn open_leaf(&mut self, first: usize, count: usize) {
        self.push(&Box8::EMPTY, first as u32, LEAF | count as u32);
    }

    /// Adds an inner node whose box is computed later by [`Self::complete`]. The next node added is
    /// its first child; the second child follows after a call of [`Self::second_child`].
    pub fn open_inner(&mut self) -> usize {
        self.push(&Box8::EMPTY, 0, 0);
        self.nodes.len() - 1
    }

    /// Declares that the next node added is the second child of the inner node `of`.
    pub fn second_child(&mut self, of: usize) {
        self.nodes[of].link = self.nodes.len() as u32;
    }

    /// Computes the boxes of all nodes, and the costs of the part, from the boxes of leaves. `leaf`
    /// is called for each leaf, from last to first, with the index of its first primitive and the
    /// number of its primitives.
    pub fn complete(&mut self, mut leaf: impl FnMut(usize, usize) -> Box8) -> (Box8, Costs) {
        // Children come after their parents, so in this reverse order they come before: the
        // children of a node are the last two entries of `waiting`.
        let mut waiting: Vec<(Box8, Costs)> = Vec::with_capacity(64);
        for node in self.nodes.iter_mut().rev() {
            let (bounds, costs) = if node.kind & LEAF != 0 {
                (leaf(node.link as usize, (node.kind & !LEAF) as usize), LEAF_COSTS)
            } else {
                let [(a, first), (b, second)] =
                    [waiting.pop(), waiting.pop()].map(Option::unwrap_or_default);
                let bounds = a.union(&b);
                let (choices, costs) = Choices::best(bounds.half_area(), &first, &second);
                node.kind = choices.0;
                (bounds, costs)
            };
            let b = bounds.bounds();
            (node.low, node.high) = (b.min.to_array(), b.max.to_array());
            waiting.push((bounds, costs));
        }
        waiting.pop().unwrap_or_default()
    }

    /// Finishes the part. `costs` are the costs of its root.
    pub fn finish<P>(self, primitives: &[P], costs: Costs) -> Tree<'_, P> {
        Tree::Part(Part { nodes: self.nodes, primitives, costs })
    }
}

/// A binary tree: parts, and inner nodes above them.
#[derive(Debug)]
pub(super) enum Tree<'a, P> {
    Part(Part<'a, P>),
    Inner(Box<Inner<'a, P>>),
}

/// A node above the parts.
#[derive(Debug)]
pub(super) struct Inner<'a, P> {
    bounds: Box8,
    choices: Choices,
    costs: Costs,
    children: [Tree<'a, P>; 2],
}

impl<'a, P> Tree<'a, P> {
    /// An inner node above two trees.
    pub fn inner(bounds: Box8, children: [Self; 2]) -> Self {
        let (choices, costs) =
            Choices::best(bounds.half_area(), children[0].costs(), children[1].costs());
        Self::Inner(Box::new(Inner { bounds, choices, costs, children }))
    }

    /// A root above two trees, of which the first becomes one child of the wide node, and the
    /// second takes all other slots.
    pub fn beside(first: Self, second: Self) -> Self {
        let bounds = [&first, &second].map(|tree| tree.root().bounds());
        let all = bounds[0].union(&bounds[1]);
        let bounds = Box8::new(all.min, all.max);
        let choices = Choices::ONE;
        Self::Inner(Box::new(Inner {
            bounds,
            choices,
            costs: LEAF_COSTS,
            children: [first, second],
        }))
    }

    /// True if the tree was made by [`Self::beside`].
    pub fn is_beside(&self) -> bool {
        matches!(self, Self::Inner(inner) if inner.choices == Choices::ONE)
    }

    fn costs(&self) -> &Costs {
        match self {
            Self::Part(part) => &part.costs,
            Self::Inner(inner) => &inner.costs,
        }
    }

    /// The root of the tree.
    pub fn root(&self) -> Cursor<'_, P> {
        match self {
            Self::Part(part) => Cursor::Part(PartCursor { part, node: 0 }),
            Self::Inner(inner) => Cursor::Inner(inner),
        }
    }
}

/// A node of a tree.
#[derive(Debug)]
pub(super) enum Cursor<'t, P> {
    Inner(&'t Inner<'t, P>),
    Part(PartCursor<'t, P>),
}

impl<P> Clone for Cursor<'_, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for Cursor<'_, P> {}

impl<'t, P> Cursor<'t, P> {
    /// The box around the subtree.
    pub fn bounds(self) -> Bounds3 {
        match self {
            Self::Inner(inner) => inner.bounds.bounds(),
            Self::Part(part) => part.bounds(),
        }
    }

    /// The primitives of a leaf; `None` for an inner node.
    pub fn leaf(self) -> Option<&'t [P]> {
        match self {
            Self::Inner(_) => None,
            Self::Part(part) => part.leaf(),
        }
    }

    /// The children of an inner node that becomes a wide node: two to eight of them, in order.
    pub fn wide_children(self) -> Vec<Self> {
        let mut found = Vec::with_capacity(8);
        self.share(8, &mut found);
        found
    }

    /// Adds the nodes that represent this subtree in the given number of slots.
    fn share(self, slots: usize, to: &mut Vec<Self>) {
        match self {
            Self::Inner(inner) => match inner.choices.first(slots) {
                0 => to.push(self),
                first => {
                    inner.children[0].root().share(first, to);
                    inner.children[1].root().share(slots - first, to);
                }
            },
            Self::Part(part) => {
                let mut found = WideChildren { part: part.part, nodes: [0; 8], count: 0 };
                found.share(part.node, slots);
                to.extend(found.iter().map(Self::Part));
            }
        }
    }
}

/// A node of a part.
#[derive(Debug)]
pub(super) struct PartCursor<'t, P> {
    part: &'t Part<'t, P>,
    node: u32,
}

impl<P> Clone for PartCursor<'_, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for PartCursor<'_, P> {}

impl<'t, P> PartCursor<'t, P> {
    /// The box around the subtree.
    #[inline(always)]
    pub fn bounds(self) -> Bounds3 {
        let node = &self.part.nodes[self.node as usize];
        Bounds3 { min: Vec3::from_array(node.low), max: Vec3::from_array(node.high) }
    }

    /// The primitives of a leaf; `None` for an inner node.
    #[inline(always)]
    pub fn leaf(self) -> Option<&'t [P]> {
        let node = &self.part.nodes[self.node as usize];
        let range = node.link as usize..(node.link + (node.kind & !LEAF)) as usize;
        (node.kind & LEAF != 0).then(|| &self.part.primitives[range])
    }

    /// The children of an inner node that becomes a wide node: two to eight of them, in order.
    #[inline]
    pub fn wide_children(self) -> WideChildren<'t, P> {
        let mut found = WideChildren { part: self.part, nodes: [0; 8], count: 0 };
        found.share(self.node, 8);
        found
    }
}

/// Two to eight nodes of a part.
pub(super) struct WideChildren<'t, P> {
    part: &'t Part<'t, P>,
    nodes: [u32; 8],
    count: usize,
}

impl<'t, P> WideChildren<'t, P> {
    /// Adds the nodes that represent a subtree in the given number of slots.
    fn share(&mut self, mut node: u32, mut slots: usize) {
        while slots > 1 {
            let own = &self.part.nodes[node as usize];
            // The result is 0 also for a leaf.
            let first = Choices(own.kind).first(slots);
            if first == 0 {
                break;
            }
            self.share(node + 1, first);
            (node, slots) = (own.link, slots - first);
        }
        self.nodes[self.count] = node;
        self.count += 1;
    }

    /// The nodes in order.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = PartCursor<'t, P>> {
        self.nodes[..self.count].iter().map(|&node| PartCursor { part: self.part, node })
    }
}
