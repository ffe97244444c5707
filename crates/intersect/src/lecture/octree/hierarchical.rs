//! Traversal from the root down: the ray's parameters at the three planes of a node along each axis
//! give the parameters of all eight children (Revelles, Ureña and Lastra, An efficient parametric
//! algorithm for octree traversal, 2000), which are then visited front to back. The planes are
//! treated as slabs as thick as the ray, so children may overlap.

use super::{Node, Octree};
use crate::lecture::box_ray::BoxRay;
use crate::lecture::{Accelerator, Later, Size, Visitor, Work, walk_with_stack};
use crate::search::region::Region;

#[derive(Debug)]
pub(super) struct Hierarchical(pub Octree);

impl Accelerator for Hierarchical {
    fn walk(&self, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool {
        walk(&self.0, ray, visitor)
    }

    fn repeats(&self) -> bool {
        true
    }

    fn size(&self) -> Size {
        self.0.size()
    }
}

/// Traverses the tree from its root.
pub(super) fn walk(tree: &Octree, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool {
    walk_with_stack(visitor, |visitor, stack, work| search(tree, ray, visitor, stack, work))
}

fn search(
    tree: &Octree,
    ray: &BoxRay,
    visitor: &mut dyn Visitor,
    stack: &mut Vec<Later>,
    work: &mut Work,
) -> bool {
    let high = std::array::from_fn(|axis| tree.space.plane(axis, 1, 0));
    let (start, end) = ray.span(tree.space.low, high);
    if start <= end {
        stack.push(Later { start, end, node: 0, level: 0, cell: [0; 3] });
    }
    while let Some(later) = stack.pop() {
        if later.start > ray.cull(visitor) {
            continue;
        }
        let node = tree.nodes[later.node as usize];
        if node.is_leaf() {
            work.cell(visitor, || Region::of_box(&tree.space.cell(later.cell, later.level)));
            if visitor.test(tree.contents(node)) {
                return true;
            }
        } else {
            work.node(visitor, || Region::of_box(&tree.space.cell(later.cell, later.level)));
            push_children(tree, ray, node, &later, stack);
        }
    }
    false
}

/// Pushes the children that the ray passes onto the stack, the nearest on top.
#[inline(always)]
fn push_children(tree: &Octree, ray: &BoxRay, node: Node, parent: &Later, stack: &mut Vec<Later>) {
    // The interval of the ray in each half, by axis.
    let halves: [[(f64, f64); 2]; 3] = std::array::from_fn(|axis| {
        let plane = |up: u32| {
            ray.crossing(axis, tree.space.plane(axis, parent.cell[axis] * 2 + up, parent.level + 1))
        };
        let [low, middle, high] = [plane(0), plane(1), plane(2)];
        if ray.is_down(axis) {
            [(middle.0, low.1), (high.0, middle.1)]
        } else {
            [(low.0, middle.1), (middle.0, high.1)]
        }
    });
    // With these bits flipped, every octant comes before all octants that it can hide.
    let down = if tree.front_to_back {
        (0..3).map(|axis| usize::from(ray.is_down(axis)) << axis).sum()
    } else {
        0
    };
    for i in (0..8usize).rev() {
        let octant = i ^ down;
        let child = tree.nodes[node.first as usize + octant];
        if child.count == 0 {
            continue;
        }
        let (mut start, mut end) = (parent.start, parent.end);
        for (axis, halves) in halves.iter().enumerate() {
            let half = halves[octant >> axis & 1];
            // A NaN as the right operand is ignored.
            (start, end) = (start.max(half.0), end.min(half.1));
        }
        if start <= end {
            let cell =
                std::array::from_fn(|axis| parent.cell[axis] * 2 + (octant >> axis & 1) as u32);
            stack.push(Later {
                start,
                end,
                node: node.first + octant as u32,
                level: parent.level + 1,
                cell,
            });
        }
    }
}
