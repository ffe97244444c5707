//! Octrees: box-shaped cells that are halved along all axes at once where there are many
//! primitives. The tree can be traversed in two ways, as in the lecture: from each cell to its
//! neighbour ([`neighbours`]), or from the root down ([`hierarchical`]).
//!
//! Cells are not stored: their boxes follow from their level and their coordinates among the cells
//! of that level.

mod build;
mod hierarchical;
mod neighbours;

use super::primitives::Primitives;
use super::{Accelerator, AcceleratorOptions, Size};
use snell_math::Bounds3d;

/// The deepest level; the root has level 0.
const MAX_LEVEL: u32 = 16;

/// The distance by which the root is larger than its contents, relative to the longest side, so
/// that contents within the thickness of a ray lie inside.
const PADDING: f64 = 2e-5;

/// A node in eight bytes: the first of eight children, or the references of a leaf.
#[derive(Clone, Copy, Debug)]
struct Node {
    first: u32,
    /// The number of references of a leaf, or [`Self::INNER`].
    count: u32,
}

impl Node {
    const INNER: u32 = u32::MAX;
    const EMPTY: Self = Self { first: 0, count: 0 };

    #[inline(always)]
    fn is_leaf(self) -> bool {
        self.count != Self::INNER
    }
}

/// The tree, for both ways of traversal. Child `x + 2y + 4z` of a node lies in the upper half along
/// each axis whose bit is set.
#[derive(Debug)]
struct Octree {
    /// The nodes; node 0 is the root.
    nodes: Vec<Node>,
    references: Vec<u32>,
    space: Space,
    /// The distance from their boxes within which primitives are stored in cells.
    padding: f64,
    front_to_back: bool,
}

/// The region of space divided by the tree.
#[derive(Clone, Copy, Debug)]
struct Space {
    low: [f64; 3],
    size: [f64; 3],
    /// Level of the deepest cells.
    depth: u32,
}

impl Space {
    /// The coordinate of a plane between cells, given by its number at a level. It has the same
    /// bits at every level.
    #[inline(always)]
    fn plane(&self, axis: usize, number: u32, level: u32) -> f64 {
        let place = u64::from(number) << (MAX_LEVEL - level);
        self.low[axis] + self.size[axis] * (place as f64 * (1.0 / (1u64 << MAX_LEVEL) as f64))
    }

    /// The box of a cell.
    fn cell(&self, cell: [u32; 3], level: u32) -> Bounds3d {
        let side = |up: u32| {
            std::array::from_fn::<_, 3, _>(|axis| self.plane(axis, cell[axis] + up, level))
        };
        Bounds3d { min: side(0).into(), max: side(1).into() }
    }
}

/// Builds an octree that is traversed from cell to cell.
pub(crate) fn build_neighbours(
    primitives: &Primitives,
    options: &AcceleratorOptions,
) -> Box<dyn Accelerator> {
    Box::new(neighbours::ByNeighbours(build::octree(primitives, options)))
}

/// Builds an octree that is traversed from the root down.
pub(crate) fn build_hierarchical(
    primitives: &Primitives,
    options: &AcceleratorOptions,
) -> Box<dyn Accelerator> {
    Box::new(hierarchical::Hierarchical(build::octree(primitives, options)))
}

impl Octree {
    /// The references of a leaf.
    #[inline(always)]
    fn contents(&self, leaf: Node) -> &[u32] {
        &self.references[leaf.first as usize..(leaf.first + leaf.count) as usize]
    }

    fn size(&self) -> Size {
        Size::of_tree(&self.nodes, &self.references, self.space.depth + 1)
    }
}
