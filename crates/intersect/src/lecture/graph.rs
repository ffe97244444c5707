//! The bounding boxes of the scene graph itself, as in the lecture: each mesh, shape and instance
//! of a group has a box, and its contents are tested if the ray enters the box before the nearest
//! hit so far, nearest boxes first. All triangles of a mesh are tested.

use super::box_ray::BoxRay;
use super::primitives::{Item, Primitives, bounds_of};
use super::{Accelerator, AcceleratorOptions, Later, Size, Visitor, Work};
use crate::search::region::Region;
use snell_math::Bounds3;

/// The children of a group in the order of the graph.
#[derive(Debug)]
struct Graph {
    children: Vec<Child>,
    /// Ranges of primitives that can be hit, as first and end.
    ranges: Vec<(u32, u32)>,
    front_to_back: bool,
}

#[derive(Debug)]
struct Child {
    bounds: Bounds3,
    /// The child's range of indices in `ranges` of [`Graph`], as first and end.
    ranges: (u32, u32),
}

/// Builds the structure of a group.
pub(crate) fn build(primitives: &Primitives, options: &AcceleratorOptions) -> Box<dyn Accelerator> {
    let mut graph =
        Graph { children: Vec::new(), ranges: Vec::new(), front_to_back: options.front_to_back };
    let mut items = primitives.items.as_slice();
    for (_, end) in primitives.geometries() {
        let (own, rest) = items.split_at(items.partition_point(|i| i.id < end));
        items = rest;
        if !own.is_empty() {
            let first = graph.ranges.len() as u32;
            add_ranges(own, &mut graph.ranges);
            graph
                .children
                .push(Child { bounds: bounds_of(own), ranges: (first, graph.ranges.len() as u32) });
        }
    }
    Box::new(graph)
}

/// Adds the numbers of the items as ranges. The gaps between ranges are triangles that can never be
/// hit.
fn add_ranges(items: &[Item], ranges: &mut Vec<(u32, u32)>) {
    let first = ranges.len();
    for item in items {
        match ranges[first..].last_mut() {
            Some((_, end)) if *end == item.id => *end += 1,
            _ => ranges.push((item.id, item.id + 1)),
        }
    }
}

impl Graph {
    /// Tests the contents of a child. Returns true if the search is over.
    fn visit(&self, child: &Child, visitor: &mut dyn Visitor, work: &Work) -> bool {
        let (first, end) = child.ranges;
        work.look(visitor, true, || Region::of_bounds(&child.bounds));
        self.ranges[first as usize..end as usize]
            .iter()
            .any(|&(first, end)| visitor.test_range(first, end))
    }

    /// Visits the children in the order of the graph.
    fn walk_unsorted(&self, ray: &BoxRay, visitor: &mut dyn Visitor, work: &Work) -> bool {
        self.children.iter().any(|child| {
            let (start, end) = ray.span_of(&child.bounds);
            let is_met = start <= end && start <= visitor.cull();
            is_met && self.visit(child, visitor, work)
        })
    }

    /// Visits the children in the order in which the ray enters their boxes.
    fn walk_sorted(&self, ray: &BoxRay, visitor: &mut dyn Visitor, work: &Work) -> bool {
        let mut met = visitor.take_stack();
        let cull = visitor.cull();
        for (i, child) in self.children.iter().enumerate() {
            let (start, end) = ray.span_of(&child.bounds);
            if start <= end && start <= cull {
                met.push(Later::node(i as u32, start, end));
            }
        }
        met.sort_by(|a, b| a.start.total_cmp(&b.start));
        let mut finished = false;
        for later in &met {
            if finished || later.start > visitor.cull() {
                break;
            }
            finished = self.visit(&self.children[later.node as usize], visitor, work);
        }
        visitor.give_stack(met);
        finished
    }
}

impl Accelerator for Graph {
    fn walk(&self, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool {
        let work = Work { nodes: self.children.len() as u32, ..Work::of(visitor) };
        visitor.count(work);
        if self.front_to_back {
            self.walk_sorted(ray, visitor, &work)
        } else {
            self.walk_unsorted(ray, visitor, &work)
        }
    }

    fn repeats(&self) -> bool {
        false
    }

    fn size(&self) -> Size {
        Size {
            nodes: self.children.len() as u64,
            references: self.ranges.iter().map(|r| u64::from(r.1 - r.0)).sum(),
            depth: u32::from(!self.children.is_empty()),
            bytes: (size_of_val(self.children.as_slice()) + size_of_val(self.ranges.as_slice()))
                as u64,
        }
    }
}
