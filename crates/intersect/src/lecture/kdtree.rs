//! A k-d tree built by the surface area heuristic (MacDonald and Booth, Heuristics for ray tracing
//! using space subdivision, 1990).
//!
//! Large sets are divided at one of 31 planes per axis (with bins that count where primitives start
//! and end: Popov et al., Experiences with streaming construction of SAH kd-trees, 2006), small
//! sets at the best side of all their boxes (Wald and Havran, On building fast kd-trees for ray
//! tracing, and on doing that in O(N log N), 2006). Primitives that a plane cuts are kept on both
//! sides, each with the box of its part. The traversal goes front to back with a stack (Havran,
//! Heuristic ray shooting algorithms, 2000, appendix C); it treats planes as slabs as thick as the
//! ray.

mod build;

use super::box_ray::BoxRay;
use super::primitives::Primitives;
use super::{Accelerator, AcceleratorOptions, Later, Size, Visitor, Work, walk_with_stack};
use crate::search::region::Region;
use snell_math::Bounds3;

/// A node in eight bytes. For an inner node, `word` has the bits of the plane's coordinate, and
/// `data` is four times the index of the second child plus the axis (the first child follows its
/// parent directly). For a leaf, `word` is the index of its first reference, and `data` is four
/// times the number of references plus three.
#[derive(Clone, Copy, Debug)]
struct Node {
    word: u32,
    data: u32,
}

impl Node {
    const LEAF: u32 = 3;

    fn leaf(first: usize, count: usize) -> Self {
        Self { word: first as u32, data: (count as u32) << 2 | Self::LEAF }
    }

    fn inner(axis: usize, plane: f32, second: usize) -> Self {
        Self { word: plane.to_bits(), data: (second as u32) << 2 | axis as u32 }
    }

    #[inline(always)]
    fn is_leaf(self) -> bool {
        self.data & 3 == Self::LEAF
    }
}

#[derive(Debug)]
struct KdTree {
    nodes: Vec<Node>,
    references: Vec<u32>,
    bounds: Bounds3,
    depth: u32,
    front_to_back: bool,
}

/// Builds the k-d tree of a group.
pub(crate) fn build(primitives: &Primitives, options: &AcceleratorOptions) -> Box<dyn Accelerator> {
    let part = build::tree(primitives);
    Box::new(KdTree {
        nodes: part.nodes,
        references: part.references,
        bounds: primitives.bounds,
        depth: part.depth,
        front_to_back: options.front_to_back,
    })
}

impl KdTree {
    /// The region of space that belongs to a node. It is not stored, so the function descends from
    /// the root: children come after their parents, and all nodes below the first child before the
    /// second child.
    fn cell(&self, wanted: u32) -> Bounds3 {
        let (mut at, mut cell) = (0, self.bounds);
        while at < wanted {
            let node = self.nodes[at as usize];
            if node.is_leaf() {
                break;
            }
            let (axis, plane, second) =
                ((node.data & 3) as usize, f32::from_bits(node.word), node.data >> 2);
            if wanted < second {
                at += 1;
                cell.max[axis] = plane;
            } else {
                at = second;
                cell.min[axis] = plane;
            }
        }
        cell
    }

    fn search(
        &self,
        ray: &BoxRay,
        visitor: &mut dyn Visitor,
        stack: &mut Vec<Later>,
        work: &mut Work,
    ) -> bool {
        let (start, end) = ray.span_of(&self.bounds);
        if start <= end {
            stack.push(Later::node(0, start, end));
        }
        while let Some(Later { node: mut at, start, mut end, .. }) = stack.pop() {
            let mut start = start;
            if start > ray.cull(visitor) {
                continue;
            }
            let mut node = self.nodes[at as usize];
            while !node.is_leaf() {
                work.node(visitor, || Region::of_bounds(&self.cell(at)));
                let axis = (node.data & 3) as usize;
                let (low, high) = ray.crossing(axis, f32::from_bits(node.word).into());
                let is_down = ray.is_down(axis);
                let (near, far) =
                    if is_down { (node.data >> 2, at + 1) } else { (at + 1, node.data >> 2) };
                let (ends_near, starts_far) = (end.min(high), start.max(low));
                // The ray passes through the near side first, and through both sides within its
                // thickness.
                let (in_near, in_far) = (start <= ends_near, starts_far <= end);
                if in_near && in_far {
                    if self.front_to_back || !is_down {
                        stack.push(Later::node(far, starts_far, end));
                        (at, end) = (near, ends_near);
                    } else {
                        stack.push(Later::node(near, start, ends_near));
                        (at, start) = (far, starts_far);
                    }
                } else if in_near {
                    (at, end) = (near, ends_near);
                } else {
                    (at, start) = (far, starts_far);
                }
                node = self.nodes[at as usize];
            }
            let (first, count) = (node.word as usize, (node.data >> 2) as usize);
            work.cell(visitor, || Region::of_bounds(&self.cell(at)));
            if visitor.test(&self.references[first..first + count]) {
                return true;
            }
        }
        false
    }
}

impl Accelerator for KdTree {
    fn walk(&self, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool {
        walk_with_stack(visitor, |visitor, stack, work| self.search(ray, visitor, stack, work))
    }

    fn repeats(&self) -> bool {
        true
    }

    fn size(&self) -> Size {
        Size::of_tree(&self.nodes, &self.references, self.depth)
    }
}
