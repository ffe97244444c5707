//! The 8-wide bounding volume hierarchy of each group, and all groups together.
//!
//! A build makes a binary tree (`fast`, `medium` or `high`), in parts that one thread builds each
//! and inner nodes above them; `wide` then counts what the tree needs as 8-wide nodes and blocks,
//! and all threads write it in place. The tree depends neither on the threads nor on the
//! instructions.
//!
//! Measured with `benches/builds.rs` on 4 cores of an EPYC (Zen 3) that was shared with other work,
//! so in processor time: millions of triangles per second as if it were spread evenly over the four
//! (in brackets Embree 4.4 on the same machine, counted alike), surface area cost, bytes per
//! triangle.
//!
//! | scene | fast | medium | high |
//! |---|---|---|---|
//! | 100 bunnies, 7M | 30 (30 to 33), 39.8, 54 B | 9.6 (7.9 to 9.1), 34.8, 51 B | 3.6 (40 bunnies), 34.6, 52 B |
//! | terrain, 4.2M | 40 (40), 19.7, 55 B | 11.2 (11.3), 14.6, 49 B | 7.1, 14.6, 49 B |
//! | room, 1.7M | 29, 81.8, 55 B | 3.0, 25.1, 52 B (by splits; 70.2 without) | 3.1, 25.1, 52 B |
//!
//! On two cores of Zen 5 a bunny (69 thousand) takes 2.3 ms with `fast` on one thread, if nothing
//! else was done before, and 1.3 ms on two. Before what follows it was 3.2 ms on one: 0.17 looking
//! for triangles that can never be hit, 0.46 cells, 0.53 sorting, 0.18 the shape of the tree, 1.17
//! its blocks and boxes, 0.54 gathering it into wide nodes, 0.11 costs.
//! * Fresh memory comes from the system page by page, each filled with zeros: a sixth of the time.
//!   What was given back is used again (`storage/spare.rs`). Where there is nothing, a large piece
//!   begins where a huge page does, and its end is in one too if it fills half of it (pages of the
//!   small kind take a microsecond each on virtual machines).
//! * Up to 131 thousand keys are sorted by one digit after the other. (First by the highest and
//!   then each bucket by itself, as many keys are, leaves few in each: comparing those took 0.4 of
//!   the 0.53 ms.)
//! * Whoever builds from a thread outside of the pool enters it once, not for each of a dozen
//!   parallel stages.
//! * The slots of wide nodes are shared out by numbers of nodes, not by references with their part,
//!   and without steps for "one slot less is no worse"; what the tree costs is worked out once,
//!   eight boxes at a time.
//!
//! With two threads that slept before, the bunny's 3.0 ms become 2.1 to 2.8: the survey of all
//! triangles takes 0.2 with one thread or two (it seems that the second is still waking up), and
//! the writing of blocks (1.1) takes 0.65 at times and 0.95 at others, with two; no pages are asked
//! for.
//!
//! On two cores of Zen 4 (medians of 200 builds, five runs in turns, million triangles a second):
//! bits spread by a table instead of shifts 19.9 to 20.7 and 20.2 to 20.3 (one thread), 37.1 to
//! 39.3 and 38.2 to 38.0 (two). These builds follow each other. After a pause of 5 ms and with 48
//! MB written in between it is 11 to 13 with one thread or two: it seems that caches and the waking
//! of threads take half of the time of so small a build, also in `snell bench build`, which pauses.
//!
//! Rejected: bits of the three axes spread apart side by side in registers (getting them out again
//! takes longer: 30 to 27 million triangles a second). Corners fetched ahead in so small a mesh
//! (Zen 4: no faster cold, slower warm).
//!
//! 50M triangles (720 bunnies) are built with at most 5.4 GB (medium; 4.5 GB fast), the mesh of 0.9
//! GB included.

mod apart;
mod binary;
mod bins;
mod blocks;
mod build;
mod cache;
mod clip;
mod fast;
mod high;
mod medium;
mod partition;
mod primitive;
mod quality;
mod refit;
mod storage;
mod waste;
mod wide;

#[cfg(test)]
mod tests;

pub(crate) use blocks::Blocks;
pub use quality::Quality;

use super::brute_force::GroupList;
use super::group::{Object, Objects};
use crate::kernel::interleave::may_search;
use crate::kernel::list::{Apart, List};
use crate::kernel::node::{ChildRef, WideNode};
use crate::kernel::quick::{extent, is_ordinary};
use crate::kernel::traverse::SMALL_STACK;
use crate::kernel::triangle::TriangleBlock;
use rayon::prelude::*;
use snell_math::simd::Wide;
use snell_math::{Bounds3, Bounds3d};
use std::path::PathBuf;
use std::sync::Arc;
use storage::{Plain, Storage};

// SAFETY: numbers of 32 bits without padding: 6 * 8 + 8 + 8 of them in 256 bytes.
unsafe impl Plain for WideNode {}
// SAFETY: numbers of 32 bits without padding: 9 * 8 + 8 of them in 320 bytes.
unsafe impl Plain for TriangleBlock {}

/// How to build trees.
#[derive(Clone, Debug)]
pub(crate) struct BvhOptions {
    pub quality: Quality,
    /// Whether blocks take less memory, and more time.
    pub compact: bool,
    /// Instructions the builder may use; the tree is the same at every level.
    pub wide: Option<Wide>,
    /// Where trees are kept in files.
    pub cache: Option<PathBuf>,
}

/// Whether a tree came from a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum CacheUse {
    /// Nothing was asked for, or the group is small.
    None,
    /// It did.
    Read,
    /// It was built and written to one.
    Written,
    /// It was built because the file was damaged, or could not be written: what to tell the user.
    Failed(String),
}

/// The tree of one group.
#[derive(Debug)]
pub(crate) struct GroupTree {
    /// In preorder: a subtree is a range of nodes, and a range of blocks.
    pub nodes: Storage<WideNode>,
    pub blocks: Blocks,
    /// Where the walk starts; [`ChildRef::NONE`] for a group without bounded contents.
    pub root: ChildRef,
    /// Where the walk starts among all that does not stand apart ([`apart`]): the first child of
    /// the root, or the root itself.
    pub rest: ChildRef,
    /// Shapes, instances and primitives of sets, as the leaves number them.
    pub objects: Objects,
    /// Objects without finite bounds: always tested.
    pub unbounded: Vec<u32>,
    /// For each mesh the number of its first triangle within the group, and its geometry;
    /// ascending.
    pub meshes: Vec<(u32, u32)>,
    /// Nodes on the longest way down.
    pub depth: usize,
    /// How many triangles the meshes have.
    triangles: usize,
    /// The triangles that can never be hit and are not in the tree.
    pub skipped: Vec<u32>,
    /// The objects without contents; not in the tree.
    empty: Vec<u32>,
    /// Whether it came from a file.
    pub cache: CacheUse,
    /// Nodes and blocks that a random line through the bounds meets on average.
    pub sah_cost: f32,
}

/// Nodes of a tree that [`GroupTree::is_blurred`] looks at.
const LOOKED_AT: usize = 1000;

impl GroupTree {
    /// True if most nodes, each with what is below it, are smaller than this.
    fn is_blurred(&self, size: f32) -> bool {
        let sample = self.nodes.iter().step_by(self.nodes.len() / LOOKED_AT + 1);
        let (mut small, mut all) = (0, 0);
        for bounds in sample.map(WideNode::bounds) {
            small += usize::from(bounds.size().max_element() < size);
            all += 1;
        }
        all > 1 && 2 * small > all
    }

    /// Builds the tree of a group; `bounds` are the boxes of its objects in its coordinates.
    pub fn build(
        list: &GroupList,
        bounds: &[Bounds3d],
        options: &BvhOptions,
    ) -> Result<Self, String> {
        let boxes: Vec<Bounds3> = bounds.iter().map(Bounds3d::outward_f32).collect();
        build::build_group(list, &boxes, options)
    }

    /// Geometry and triangle of a triangle numbered within the group.
    #[inline(always)]
    pub fn triangle(&self, id: u32) -> (u32, u32) {
        let (first, geometry) = match self.meshes.as_slice() {
            [only] => *only,
            all => all[all.partition_point(|m| m.0 <= id).saturating_sub(1)],
        };
        (geometry, id - first)
    }

    /// Geometry and triangle of what is in a lane of a block, both as one number: that of the block
    /// eight times, and the lane.
    #[inline(always)]
    pub fn triangle_at(&self, place: u32) -> (u32, u32) {
        self.triangle(self.blocks.id(place as usize >> 3, place as usize & 7))
    }

    /// True if a triangle is in several blocks, as spatial splits leave them.
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

    /// Entries a walk through this group alone may need at once.
    fn stack_size(&self) -> usize {
        7 * self.depth + 8
    }

    /// Memory of the tree.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + self.blocks.memory_bytes() + self.objects.memory_bytes()
    }
}

/// Nodes and blocks that a random line through the bounds of these nodes, of which the first is the
/// root, meets on average.
fn sah_cost(nodes: &[WideNode]) -> f32 {
    let Some(root) = nodes.first() else { return 0.0 };
    let whole = root.bounds().half_area();
    let area = |nodes: &[WideNode]| nodes.iter().map(WideNode::half_areas).sum::<f64>();
    let pieces: Vec<f64> = nodes.par_chunks(1 << 12).map(area).collect();
    (1.0 + pieces.iter().sum::<f64>() / f64::from(whole)) as f32
}

/// The trees of all groups; group 0 is the root.
#[derive(Debug)]
pub(crate) struct Forest {
    /// Shared with other worlds that hold the same groups.
    pub trees: Vec<Arc<GroupTree>>,
    /// Entries a walk needs on the deepest way from each group through all below it.
    pub stack_sizes: Vec<usize>,
    /// The largest coordinate of each tree.
    pub extents: Vec<f32>,
    /// True if everything is of ordinary size ([`is_ordinary`]).
    pub ordinary: bool,
    /// True if besides nothing in the root is unbounded, and walks need no more than
    /// [`SMALL_STACK`].
    pub simple: bool,
    /// The root's contents without a tree, if they are few.
    pub list: Option<Box<List>>,
    /// What stands apart from the rest of the root.
    pub apart: Option<Apart>,
}

impl Forest {
    /// All groups from their trees; `order` lists the groups with children before parents.
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
            Self { stack_sizes: sizes, trees, extents, ordinary, simple, list, apart: None };
        if forest.list.is_none() && may_search(&forest) {
            forest.apart = Apart::of(&forest.trees[0]);
        }
        forest
    }

    /// Entries a walk needs on the deepest way through all groups.
    #[inline(always)]
    pub fn stack_size(&self) -> usize {
        self.stack_sizes[0]
    }

    /// How far out the coordinates of a group reach, if single precision has no steps there that
    /// are small enough for most of what is in it: boxes are widened by such steps, and so most
    /// rays meet most boxes.
    pub fn blurred(&self) -> Option<f32> {
        let groups = self.trees.iter().zip(&self.extents);
        groups
            .filter(|(tree, extent)| tree.is_blurred(**extent * f32::EPSILON))
            .map(|(_, &extent)| extent)
            .reduce(f32::max)
    }

    /// Memory of all trees.
    pub fn memory_bytes(&self) -> usize {
        self.trees.iter().map(|tree| tree.memory_bytes()).sum()
    }
}
