//! Acceleration structures, by name.
//!
//! All give the same hits, bit for bit: one exact test per ray and primitive decides (`group`), and
//! a structure may skip only what the ray surely does not hit. Two live on their own: `none`, the
//! oracle that skips nothing, and `bvh`, the fast one with kernels of its own. All others are
//! `Accelerator`s over the numbered `primitives` of one group; `walk` joins them over instances and
//! serves every query. To add one: a file with a `build` function, and a line in the list below.

pub(crate) mod box_ray;
pub(crate) mod brute_force;
pub(crate) mod bsp;
pub(crate) mod graph;
pub(crate) mod grid;
pub(crate) mod kdtree;
mod mailbox;
pub(crate) mod octree;
pub(crate) mod primitives;
pub(crate) mod spheres;
pub(crate) mod walk;

use crate::search::region::Region;
use box_ray::BoxRay;
use primitives::Primitives;

/// Variants of the structures, to measure what each saves. Hits never depend on them. `none` and
/// `bvh` have no switches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AcceleratorOptions {
    /// Whether what is nearer along the ray is visited first (lecture: "visit child nodes in
    /// front-to-back order"). Off, children are visited in the order in which they are stored;
    /// grids and the octree by neighbours have no other order.
    pub front_to_back: bool,
    /// Whether in each group the primitive that was hit last is tested first (lecture: "store
    /// closest child intersection from previous ray and check that node first"). The memory belongs
    /// to one batch on one thread, never to the world.
    pub last_hit_cache: bool,
    /// Cells of a grid along its longest side; `None` chooses by the number of primitives.
    pub grid_resolution: Option<u32>,
    /// Whether crowded cells of a grid become grids themselves.
    pub nested_grids: bool,
}

impl Default for AcceleratorOptions {
    fn default() -> Self {
        Self {
            front_to_back: true,
            last_hit_cache: false,
            grid_resolution: None,
            nested_grids: true,
        }
    }
}

/// Builds the structure of one group.
pub(crate) type Build = fn(&Primitives, &AcceleratorOptions) -> Box<dyn Accelerator>;

/// A structure over the bounded primitives of one group.
pub(crate) trait Accelerator: std::fmt::Debug + Send + Sync {
    /// Visits every primitive that the ray may hit and that does not start beyond
    /// [`Visitor::cull`]. Returns true if the search is over. A primitive may be visited more than
    /// once if [`Self::repeats`] is true.
    fn walk(&self, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool;

    /// True if primitives may lie in several places.
    fn repeats(&self) -> bool;

    /// Statistics of the build.
    fn size(&self) -> Size;
}

/// The size of a structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Size {
    /// Nodes and cells.
    pub nodes: u64,
    /// Entries in the lists of primitives.
    pub references: u64,
    /// Nodes on the longest way down.
    pub depth: u32,
    /// Memory in bytes.
    pub bytes: u64,
}

impl Size {
    /// Of a tree that is these nodes and references.
    fn of_tree<N>(nodes: &[N], references: &[u32], depth: u32) -> Self {
        Self {
            nodes: nodes.len() as u64,
            references: references.len() as u64,
            depth,
            bytes: (size_of_val(nodes) + size_of_val(references)) as u64,
        }
    }
}

/// The visitor of primitives, which tests them and holds the result.
pub(crate) trait Visitor {
    /// Primitives that start beyond this are skipped. It shrinks as hits are found.
    fn cull(&self) -> f64;

    /// Tests primitives. True if the search is over.
    fn test(&mut self, primitives: &[u32]) -> bool;

    /// Tests the primitives `first..end`. True if the search is over.
    fn test_range(&mut self, first: u32, end: u32) -> bool;

    /// True if it records regions.
    fn records(&self) -> bool;

    /// Called for each region that the traversal enters; the flag is true if it holds primitives
    /// and not other regions.
    fn visit(&mut self, is_leaf: bool, region: Region);

    /// Called at the end of a traversal with the number of nodes and cells that it visited.
    fn count(&mut self, work: Work);

    /// An empty list of places to visit later, to be given back by [`Self::give_stack`].
    fn take_stack(&mut self) -> Vec<Later>;

    /// Takes the list back, so that its memory serves again.
    fn give_stack(&mut self, stack: Vec<Later>);
}

/// Counters of a traversal.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Work {
    /// Inner nodes.
    pub nodes: u32,
    /// Cells of grids, leaves of trees that divide space.
    pub cells: u32,
    /// Whether regions are recorded.
    is_recorded: bool,
}

impl Work {
    /// For a walk of this visitor.
    pub fn of(visitor: &dyn Visitor) -> Self {
        Self { is_recorded: visitor.records(), ..Self::default() }
    }

    /// Counts an inner node.
    #[inline(always)]
    pub fn node(&mut self, visitor: &mut dyn Visitor, region: impl FnOnce() -> Region) {
        self.nodes += 1;
        self.look(visitor, false, region);
    }

    /// Counts a cell.
    #[inline(always)]
    pub fn cell(&mut self, visitor: &mut dyn Visitor, region: impl FnOnce() -> Region) {
        self.cells += 1;
        self.look(visitor, true, region);
    }

    /// Reports the region that the traversal enters, without counting.
    #[inline(always)]
    pub fn look(&self, visitor: &mut dyn Visitor, is_leaf: bool, region: impl FnOnce() -> Region) {
        if self.is_recorded {
            visitor.visit(is_leaf, region());
        }
    }
}

/// A place to visit later.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Later {
    /// Where the ray enters it.
    pub start: f64,
    /// Where the ray leaves it.
    pub end: f64,
    /// Which one.
    pub node: u32,
    /// Its depth, where it matters.
    pub level: u32,
    /// Its place among the cells of its level, where it matters.
    pub cell: [u32; 3],
}

impl Later {
    /// A node of a tree without places.
    pub fn node(node: u32, start: f64, end: f64) -> Self {
        Self { start, end, node, level: 0, cell: [0; 3] }
    }
}

/// [`Accelerator::walk`] by a `search` that is given a list for places to visit later, and counts
/// what it costs.
fn walk_with_stack(
    visitor: &mut dyn Visitor,
    search: impl FnOnce(&mut dyn Visitor, &mut Vec<Later>, &mut Work) -> bool,
) -> bool {
    let mut work = Work::of(visitor);
    let mut stack = visitor.take_stack();
    let finished = search(visitor, &mut stack, &mut work);
    visitor.give_stack(stack);
    visitor.count(work);
    finished
}

#[cfg(test)]
mod tests;
