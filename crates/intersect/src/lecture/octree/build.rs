//! Builds an octree from primitives.

use super::{MAX_LEVEL, Node, Octree, PADDING, Space};
use crate::lecture::AcceleratorOptions;
use crate::lecture::primitives::{Item, PARALLEL, Primitives};
use rayon::prelude::*;
use snell_math::{Bounds3d, DVec3};

/// The largest number of primitives in a cell that is not divided.
const LEAF: usize = 6;

/// The largest number of references in all leaves, relative to the number of primitives.
const GROWTH: usize = 8;

/// A subtree, whose root is stored separately.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    references: Vec<u32>,
    depth: u32,
}

impl Part {
    /// Adds another subtree. Returns its root with indices valid in this one.
    fn append(&mut self, other: Self, root: Node) -> Node {
        let (nodes, references) = (self.nodes.len() as u32, self.references.len() as u32);
        let moved =
            |n: Node| Node { first: n.first + if n.is_leaf() { references } else { nodes }, ..n };
        self.nodes.extend(other.nodes.into_iter().map(moved));
        self.references.extend(other.references);
        self.depth = self.depth.max(other.depth);
        moved(root)
    }
}

/// Builds the tree.
pub(super) fn octree(primitives: &Primitives, options: &AcceleratorOptions) -> Octree {
    let n = primitives.items.len();
    let bounds: Bounds3d = if n == 0 { Bounds3d::default() } else { primitives.bounds.into() };
    let padding = bounds.size().max_element() * PADDING;
    let around = DVec3::splat(padding * 2.0);
    let (low, high) = (bounds.min - around, bounds.max + around);
    let space = Space { low: low.to_array(), size: (high - low).to_array(), depth: 0 };
    let mut part = Part { nodes: vec![Node::EMPTY], ..Part::default() };
    if n > 0 {
        let cell = Cell { place: [0; 3], level: 0, allowance: n.saturating_mul(GROWTH) };
        part.nodes[0] = Builder { primitives, space, padding }.subtree(
            primitives.items.clone(),
            cell,
            &mut part,
        );
    }
    Octree {
        space: Space { depth: part.depth, ..space },
        nodes: part.nodes,
        references: part.references,
        padding,
        front_to_back: options.front_to_back,
    }
}

struct Builder<'a> {
    primitives: &'a Primitives<'a>,
    space: Space,
    padding: f64,
}

/// A node to be built.
#[derive(Clone, Copy)]
struct Cell {
    place: [u32; 3],
    level: u32,
    /// The number of references that the subtree may use.
    allowance: usize,
}

impl Cell {
    fn child(&self, octant: usize) -> Self {
        let place = std::array::from_fn(|axis| self.place[axis] * 2 + (octant >> axis & 1) as u32);
        Self { place, level: self.level + 1, allowance: 0 }
    }
}

impl Builder<'_> {
    fn subtree(&self, items: Vec<Item>, cell: Cell, part: &mut Part) -> Node {
        let divided = if items.len() > LEAF && cell.level < MAX_LEVEL {
            self.divide(&items, cell)
        } else {
            None
        };
        let Some(children) = divided else {
            part.depth = part.depth.max(cell.level);
            let first = part.references.len() as u32;
            part.references.extend(items.iter().map(|i| i.id));
            return Node { first, count: items.len() as u32 };
        };
        let is_large = items.len() > PARALLEL;
        drop(items);
        let first = part.nodes.len();
        part.nodes.extend([Node::EMPTY; 8]);
        if is_large {
            let build = |(items, cell): (Vec<Item>, Cell)| {
                let mut piece = Part::default();
                let root = self.subtree(items, cell, &mut piece);
                (piece, root)
            };
            let built: Vec<_> = children.into_par_iter().map(build).collect();
            for (i, (piece, root)) in built.into_iter().enumerate() {
                part.nodes[first + i] = part.append(piece, root);
            }
        } else {
            for (i, (items, cell)) in children.into_iter().enumerate() {
                part.nodes[first + i] = self.subtree(items, cell, part);
            }
        }
        Node { first: first as u32, count: Node::INNER }
    }

    /// The contents of each octant; `None` if a division separates nothing, or takes more
    /// references than allowed.
    fn divide(&self, items: &[Item], cell: Cell) -> Option<[(Vec<Item>, Cell); 8]> {
        let around = DVec3::splat(self.padding);
        let cells: [Cell; 8] = std::array::from_fn(|octant| cell.child(octant));
        let boxes = cells.map(|c| {
            let b = self.space.cell(c.place, c.level);
            Bounds3d { min: b.min - around, max: b.max + around }
        });
        let mut children: [Vec<Item>; 8] = Default::default();
        for item in items {
            for octant in halves(item, &boxes) {
                // A part may be empty because the plane of the triangle misses the octant.
                children[octant].extend(self.primitives.clipped(item, &boxes[octant]));
            }
        }
        let total: usize = children.iter().map(Vec::len).sum();
        // More than three children would hold all primitives, for example because the primitives
        // meet in a point; smaller cells would not separate them.
        if total > cell.allowance || children.iter().filter(|c| c.len() == items.len()).count() > 3
        {
            return None;
        }
        let mut octant = 0;
        Some(children.map(|items| {
            let allowance =
                (cell.allowance as u128 * items.len() as u128 / total.max(1) as u128) as usize;
            octant += 1;
            (items, Cell { allowance, ..cells[octant - 1] })
        }))
    }
}

/// The octants that the box of an item touches.
fn halves(item: &Item, boxes: &[Bounds3d; 8]) -> impl Iterator<Item = usize> {
    let (low, high) = (item.min.as_dvec3(), item.max.as_dvec3());
    let in_low = low.cmple(boxes[0].max);
    let in_high = high.cmpge(boxes[7].min);
    let [low, high] = [in_low.bitmask() as usize, in_high.bitmask() as usize];
    // Bit i of an octant is the half along axis i.
    (0..8).filter(move |octant| octant & !high == 0 && !octant & 7 & !low == 0)
}
