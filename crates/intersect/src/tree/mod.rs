//! The trees that kernels traverse: an 8-wide bounding volume hierarchy for each group, and the
//! forest of all groups. They are data only: `build` makes trees, and kernels traverse them.

pub(crate) mod block;
pub(crate) mod blocks;
pub(crate) mod compact;
pub(crate) mod list;
pub(crate) mod node;
pub(crate) mod storage;

pub(crate) use blocks::Blocks;

use crate::exact::prepared::is_ordinary;
use crate::group::{Object, Objects};
use block::TriangleBlock;
use list::{List, Outliers};
use node::{ChildRef, WideNode};
use std::sync::Arc;
use storage::{Plain, Storage};

// SAFETY: `WideNode` is 6 * 8 + 8 + 8 numbers of 32 bits in 256 bytes, without padding.
unsafe impl Plain for WideNode {}
// SAFETY: `TriangleBlock` is 9 * 8 + 8 numbers of 32 bits in 320 bytes, without padding.
unsafe impl Plain for TriangleBlock {}

/// Whether a tree was read from a cache file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum CacheUse {
    /// No cache was requested, or the group is small.
    None,
    /// The tree was read from a file.
    Read,
    /// The tree was built and written to a file.
    Written,
    /// A warning for the user: the tree was built because its file was damaged, or the file could
    /// not be written.
    Failed(String),
}

/// The tree of one group.
///
/// Kernels rely on the following without checks. `build` makes trees that way, and verifies it for
/// trees in cache files: each reference leads to a node, a block or an object that the tree has,
/// and no path from the root has more nodes than `depth`.
#[derive(Debug)]
pub(crate) struct GroupTree {
    /// The nodes in preorder, so that a subtree is a range of nodes and a range of blocks.
    pub nodes: Storage<WideNode>,
    pub blocks: Blocks,
    /// Where traversal starts; [`ChildRef::NONE`] for a group without bounded contents.
    pub root: ChildRef,
    /// Where the traversal of everything except [outliers](Outliers) starts: the first child of the
    /// root, or the root itself.
    pub rest: ChildRef,
    /// Shapes, instances and primitives of sets, numbered as in the leaves.
    pub objects: Objects,
    /// Numbers of the objects without finite bounds, which are always tested.
    pub unbounded: Vec<u32>,
    /// For each mesh the number of its first triangle within the group, and its geometry, in
    /// ascending order.
    pub meshes: Vec<(u32, u32)>,
    /// The number of nodes on the longest path from the root.
    pub depth: usize,
    /// The number of triangles of the meshes.
    pub triangles: usize,
    /// The triangles that can never be hit and are not in the tree.
    pub skipped: Vec<u32>,
    /// The objects without contents, which are not in the tree.
    pub empty: Vec<u32>,
    /// Whether the tree was read from a cache file.
    pub cache: CacheUse,
    /// The expected number of nodes and blocks that a random line through the bounds visits.
    pub sah_cost: f32,
}

/// The number of nodes that [`GroupTree::is_blurred`] samples.
const LOOKED_AT: usize = 1000;

impl GroupTree {
    /// True if the boxes of most nodes are smaller than `size`.
    fn is_blurred(&self, size: f32) -> bool {
        let sample = self.nodes.iter().step_by(self.nodes.len() / LOOKED_AT + 1);
        let (mut small, mut all) = (0, 0);
        for bounds in sample.map(WideNode::bounds) {
            small += usize::from(bounds.size().max_element() < size);
            all += 1;
        }
        all > 1 && 2 * small > all
    }

    /// Geometry and primitive of a triangle, given its number within the group.
    #[inline(always)]
    pub fn triangle(&self, id: u32) -> (u32, u32) {
        let (first, geometry) = match self.meshes.as_slice() {
            [only] => *only,
            all => all[all.partition_point(|m| m.0 <= id).saturating_sub(1)],
        };
        (geometry, id - first)
    }

    /// Geometry and primitive of the triangle in a lane of a block. `place` is eight times the
    /// number of the block plus the lane.
    #[inline(always)]
    pub fn triangle_at(&self, place: u32) -> (u32, u32) {
        self.triangle(self.blocks.id(place as usize >> 3, place as usize & 7))
    }

    /// True if a triangle is in several blocks, which happens with spatial splits.
    pub fn has_repeated_triangles(&self) -> bool {
        let ids = || {
            self.blocks
                .numbers()
                .flat_map(|block| self.blocks.ids(block))
                .filter(|&id| id != u32::MAX)
        };
        let Some(last) = ids().max() else { return false };
        let mut seen = vec![0u64; last as usize / 64 + 1];
        ids().any(|id| {
            let (word, bit) = (&mut seen[id as usize / 64], 1 << (id % 64));
            let was_seen = *word & bit != 0;
            *word |= bit;
            was_seen
        })
    }

    /// The largest number of stack entries that the traversal of this group alone needs.
    fn stack_size(&self) -> usize {
        7 * self.depth + 8
    }

    /// Memory of the tree in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + self.blocks.memory_bytes() + self.objects.memory_bytes()
    }
}

/// The trees of all groups; group 0 is the root.
#[derive(Debug)]
pub(crate) struct Forest {
    /// The tree of each group, shared with other worlds that hold the same group.
    pub trees: Vec<Arc<GroupTree>>,
    /// For each group, the number of stack entries that traversal needs on the deepest path from
    /// the group through all groups below it.
    pub stack_sizes: Vec<usize>,
    /// The largest coordinate of each tree.
    pub extents: Vec<f32>,
    /// True if all trees are of ordinary size ([`is_ordinary`]).
    pub ordinary: bool,
    /// True if, in addition, nothing in the root is unbounded, and traversal needs at most
    /// [`SMALL_STACK`] entries.
    pub simple: bool,
    /// The contents of the root as a list, if they are few enough to be tested without a tree.
    pub list: Option<Box<List>>,
    /// The outliers of the root.
    pub outliers: Option<Outliers>,
}

impl Forest {
    /// The forest of these trees; `order` lists the groups with children before parents.
    pub fn of(trees: Vec<Arc<GroupTree>>, order: &[usize]) -> Self {
        let mut sizes = vec![0; trees.len()];
        for &group in order {
            let below = |object: &Object| match object {
                Object::Instance { child, .. } => sizes[*child],
                Object::Shape { .. } => 0,
            };
            let tree: &GroupTree = &trees[group];
            sizes[group] =
                tree.stack_size() + tree.objects.placed().iter().map(below).max().unwrap_or(0);
        }
        let extents: Vec<f32> = trees.iter().map(|tree| extent(tree)).collect();
        let ordinary = extents.iter().all(|&extent| is_ordinary(extent));
        let simple = ordinary && trees[0].unbounded.is_empty() && sizes[0] <= SMALL_STACK;
        let list = trees.first().and_then(|root| List::of(root));
        let mut forest =
            Self { stack_sizes: sizes, trees, extents, ordinary, simple, list, outliers: None };
        if forest.list.is_none() && may_search(&forest) {
            forest.outliers = Outliers::of(&forest.trees[0]);
        }
        forest
    }

    /// The number of stack entries that traversal needs on the deepest path through all groups.
    #[inline(always)]
    pub fn stack_size(&self) -> usize {
        self.stack_sizes[0]
    }

    /// The largest coordinate of a group whose nodes are mostly smaller than the spacing of `f32`
    /// at that coordinate; `None` if there is no such group. Boxes are padded by that spacing, so
    /// in such a group most rays hit most boxes.
    pub fn blurred(&self) -> Option<f32> {
        let groups = self.trees.iter().zip(&self.extents);
        groups
            .filter(|(tree, extent)| tree.is_blurred(**extent * f32::EPSILON))
            .map(|(_, &extent)| extent)
            .reduce(f32::max)
    }

    /// Memory of all trees in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.trees.iter().map(|tree| tree.memory_bytes()).sum()
    }
}

/// The number of traversal entries on the thread's stack; deeper forests allocate memory per query.
pub(crate) const SMALL_STACK: usize = 512;

/// True if the fast kernels can traverse the forest: all trees are of ordinary size, the root group
/// has nodes, and the stacks are large enough.
pub(crate) fn may_search(forest: &Forest) -> bool {
    forest.ordinary && forest.trees[0].root.is_node() && forest.stack_size() <= SMALL_STACK
}

/// The largest coordinate in the tree; infinite if a coordinate is NaN.
fn extent(tree: &GroupTree) -> f32 {
    let largest =
        |extent: f32, x: &f32| if x.is_nan() { f32::INFINITY } else { extent.max(x.abs()) };
    if tree.root.is_node() {
        let node = &tree.nodes[tree.root.index()];
        let used = (0..8).filter(|&slot| node.children[slot] != ChildRef::NONE);
        used.fold(0.0, |e, slot| {
            node.bounds.iter().flatten().map(|side| &side[slot]).fold(e, largest)
        })
    } else if tree.root.is_triangles() {
        let triangles = 0..tree.root.count() as usize;
        let corners = triangles.flat_map(|lane| tree.blocks.corners(tree.root.block(), lane));
        corners.flatten().fold(0.0, |extent, x| largest(extent, &x))
    } else {
        0.0
    }
}
