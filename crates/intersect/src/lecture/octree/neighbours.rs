//! Traversal from each cell to its neighbour. Cells have integer coordinates at the deepest level.
//! When the ray leaves a cell, the coordinates beyond the face follow, and the cell that contains
//! them is found from the lowest common ancestor, which is given by the highest bit in which the
//! coordinates differ (Frisken and Perry, Simple and efficient traversal methods for quadtrees and
//! octrees, 2002).
//!
//! The traversal follows the line itself; primitives are stored in all cells within a padding that
//! is larger than the width of rays from nearby. Rays from farther away are traversed from the root
//! down.

use super::hierarchical;
use super::{MAX_LEVEL, Octree};
use crate::lecture::box_ray::BoxRay;
use crate::lecture::{Accelerator, Size, Visitor, Work};
use crate::search::region::Region;

#[derive(Debug)]
pub(super) struct ByNeighbours(pub Octree);

impl Accelerator for ByNeighbours {
    fn walk(&self, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool {
        let tree = &self.0;
        let high = std::array::from_fn(|axis| tree.space.plane(axis, 1, 0));
        let (start, end) = ray.span(tree.space.low, high);
        if start > end {
            return false;
        }
        let is_thin = ray.width <= tree.padding && start.is_finite() && end.is_finite();
        if !is_thin {
            return hierarchical::walk(tree, ray, visitor);
        }
        let mut work = Work::of(visitor);
        let finished = Walk::new(tree, ray, start).run(start, end, visitor, &mut work);
        visitor.count(work);
        finished
    }

    fn repeats(&self) -> bool {
        true
    }

    fn size(&self) -> Size {
        self.0.size()
    }
}

/// The number of places along an axis at the deepest level.
const PLACES: u32 = 1 << MAX_LEVEL;

/// The state of a traversal.
struct Walk<'a> {
    tree: &'a Octree,
    ray: &'a BoxRay,
    /// The number of places per unit of length.
    scale: [f64; 3],
    /// The nodes from the root to the current one, by level.
    path: [u32; MAX_LEVEL as usize + 1],
    level: u32,
    /// The coordinates of a place in the current cell.
    place: [u32; 3],
}

impl<'a> Walk<'a> {
    /// Starts a traversal at the place where the ray enters the tree.
    fn new(tree: &'a Octree, ray: &'a BoxRay, start: f64) -> Self {
        let scale = tree.space.size.map(|s| f64::from(PLACES) / s);
        let mut walk =
            Self { tree, ray, scale, path: [0; MAX_LEVEL as usize + 1], level: 0, place: [0; 3] };
        walk.place = std::array::from_fn(|axis| {
            walk.place_at(axis, start).clamp(0.0, f64::from(PLACES - 1)) as u32
        });
        walk
    }

    /// The place of the ray along an axis, not rounded to an integer.
    #[inline(always)]
    fn place_at(&self, axis: usize, t: f64) -> f64 {
        (self.ray.origin[axis] + self.ray.direction[axis] * t - self.tree.space.low[axis])
            * self.scale[axis]
    }

    fn run(
        &mut self,
        mut start: f64,
        end: f64,
        visitor: &mut dyn Visitor,
        work: &mut Work,
    ) -> bool {
        loop {
            self.descend(visitor, work);
            let leaf = self.tree.nodes[self.path[self.level as usize] as usize];
            work.cell(visitor, || self.cell());
            if visitor.test(self.tree.contents(leaf)) {
                return true;
            }
            let (axis, leaves) = self.exit();
            start = start.max(leaves);
            if start > end || start > self.ray.cull(visitor) || !self.step(axis, start) {
                return false;
            }
        }
    }

    /// The current cell.
    fn cell(&self) -> Region {
        let shift = MAX_LEVEL - self.level;
        Region::of_box(&self.tree.space.cell(self.place.map(|p| p >> shift), self.level))
    }

    /// Descends to the leaf that contains the place.
    #[inline(always)]
    fn descend(&mut self, visitor: &mut dyn Visitor, work: &mut Work) {
        let mut at = self.path[self.level as usize];
        loop {
            let node = self.tree.nodes[at as usize];
            if node.is_leaf() {
                return;
            }
            work.node(visitor, || self.cell());
            let shift = MAX_LEVEL - 1 - self.level;
            let octant = |axis: usize| (self.place[axis] >> shift & 1) << axis;
            at = node.first + octant(0) + octant(1) + octant(2);
            self.level += 1;
            self.path[self.level as usize] = at;
        }
    }

    /// The axis along which the ray leaves the current cell first, and the parameter there.
    #[inline(always)]
    fn exit(&self) -> (usize, f64) {
        let shift = MAX_LEVEL - self.level;
        let mut first = (0, f64::INFINITY);
        for axis in 0..3 {
            let number = (self.place[axis] >> shift) + u32::from(!self.ray.is_down(axis));
            let plane = self.tree.space.plane(axis, number, self.level);
            // NaN, for a ray in the plane, is never the least.
            let t = (plane - self.ray.origin[axis]) * self.ray.inverse[axis];
            // A ray that does not move along the axis never leaves.
            if t < first.1 && self.ray.direction[axis] != 0.0 {
                first = (axis, t);
            }
        }
        first
    }

    /// Moves the place into the next cell along the axis, and the traversal up to the node that
    /// contains both cells. Returns false at the end of the tree.
    #[inline(always)]
    fn step(&mut self, axis: usize, t: f64) -> bool {
        let shift = MAX_LEVEL - self.level;
        let size = 1 << shift;
        let old = self.place;
        let corner = old.map(|p| p >> shift << shift);
        self.place = std::array::from_fn(|i| {
            self.place_at(i, t).clamp(f64::from(corner[i]), f64::from(corner[i] + size - 1)) as u32
        });
        let next = if self.ray.is_down(axis) {
            i64::from(corner[axis]) - 1
        } else {
            i64::from(corner[axis] + size)
        };
        if !(0..i64::from(PLACES)).contains(&next) {
            return false;
        }
        self.place[axis] = next as u32;
        let differs = (0..3).fold(0, |bits, i| bits | (old[i] ^ self.place[i]));
        // The deepest level whose cells contain both places, given by the highest differing bit.
        let shared = MAX_LEVEL - (32 - differs.leading_zeros());
        self.level = self.level.min(shared);
        true
    }
}
