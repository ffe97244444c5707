//! The acceleration structures of the lecture.
//!
//! All structures give the same hits, bit for bit: one exact test per ray and primitive decides
//! (`group`), and a structure may skip only primitives that the ray certainly does not hit. Two are
//! separate: `none`, the reference that skips nothing, and `bvh`, the fast structure, which has
//! kernels of its own. All others are `Accelerator`s over the numbered `primitives` of one group;
//! `walk` connects them over instances and serves every query. To add one, write a file with a
//! `build` function, and add a line to the list of `crate::world::accelerator`.

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

/// Variants of the structures, to measure how much each optimisation saves. Hits never depend on
/// them. `none` and `bvh` ignore them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AcceleratorOptions {
    /// Whether children nearer along the ray are visited first (lecture: "visit child nodes in
    /// front-to-back order"). If false, children are visited in the order in which they are stored;
    /// grids and the octree by neighbours have no other order.
    pub front_to_back: bool,
    /// Whether in each group the primitive that was hit last is tested first (lecture: "store
    /// closest child intersection from previous ray and check that node first"). That primitive is
    /// remembered for one batch on one thread, never in the world.
    pub last_hit_cache: bool,
    /// The number of cells of a grid along its longest side; `None` chooses it by the number of
    /// primitives.
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

    /// True if a primitive may be stored in several places.
    fn repeats(&self) -> bool;

    /// Statistics of the build.
    fn size(&self) -> Size;
}

/// The size of a structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Size {
    /// The number of nodes and cells.
    pub nodes: u64,
    /// The number of entries in the lists of primitives.
    pub references: u64,
    /// The number of nodes on the longest path from the root.
    pub depth: u32,
    /// Memory in bytes.
    pub bytes: u64,
}

impl Size {
    /// The size of a tree with these nodes and references.
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
    /// The distance beyond which primitives are skipped. It shrinks as hits are found.
    fn cull(&self) -> f64;

    /// Tests primitives. Returns true if the search is over.
    fn test(&mut self, primitives: &[u32]) -> bool;

    /// Tests the primitives `first..end`. Returns true if the search is over.
    fn test_range(&mut self, first: u32, end: u32) -> bool;

    /// True if the visitor records regions.
    fn records(&self) -> bool;

    /// Called for each region that the traversal enters; `is_leaf` is true if the region holds
    /// primitives rather than other regions.
    fn visit(&mut self, is_leaf: bool, region: Region);

    /// Called at the end of a traversal with the number of nodes and cells that it visited.
    fn count(&mut self, work: Work);

    /// An empty list of nodes to visit later, to be returned by [`Self::give_stack`].
    fn take_stack(&mut self) -> Vec<Later>;

    /// Takes the list back, so that its memory can be reused.
    fn give_stack(&mut self, stack: Vec<Later>);
}

/// Counters of a traversal.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Work {
    /// The number of visited inner nodes.
    pub nodes: u32,
    /// The number of visited cells of grids, or leaves of trees that divide space.
    pub cells: u32,
    /// Whether regions are recorded.
    is_recorded: bool,
}

impl Work {
    /// Counters for a traversal with this visitor.
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

    /// Reports the region that the traversal enters, without counting it.
    #[inline(always)]
    pub fn look(&self, visitor: &mut dyn Visitor, is_leaf: bool, region: impl FnOnce() -> Region) {
        if self.is_recorded {
            visitor.visit(is_leaf, region());
        }
    }
}

/// A node to visit later.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Later {
    /// The parameter at which the ray enters the node.
    pub start: f64,
    /// The parameter at which the ray leaves the node.
    pub end: f64,
    /// The index of the node.
    pub node: u32,
    /// The depth of the node, for structures that need it.
    pub level: u32,
    /// The coordinates of the node among the cells of its level, for structures that need them.
    pub cell: [u32; 3],
}

impl Later {
    /// A node of a tree that needs neither depth nor coordinates.
    pub fn node(node: u32, start: f64, end: f64) -> Self {
        Self { start, end, node, level: 0, cell: [0; 3] }
    }
}

/// Runs `search`, the body of [`Accelerator::walk`], with a list for nodes to visit later and with
/// counters.
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
