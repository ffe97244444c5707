//! Builds a k-d tree from primitives.

use super::Node;
use crate::lecture::primitives::{Item, PARALLEL, Primitives, half_area};
use snell_math::Bounds3;
use snell_math::real;

/// Cost of testing a primitive, in units of steps from node to node.
const TEST_COST: f64 = 2.0;

/// The factor by which a plane that cuts off empty space is cheaper.
const EMPTY_BONUS: f64 = 0.8;

/// The number of planes per axis, plus one.
const BINS: usize = 32;

/// Sets of up to this size are divided at the best of all planes along sides of boxes.
const EXACT: usize = 64;

/// The largest number of references in all leaves, relative to the number of primitives.
const GROWTH: usize = 8;

/// The largest number of successive divisions that may cost more than a leaf, in the hope that
/// divisions below them pay.
const MAX_BAD: u32 = 3;

/// A subtree with a separate list of references.
#[derive(Default)]
pub(super) struct Part {
    pub nodes: Vec<Node>,
    pub references: Vec<u32>,
    pub depth: u32,
}

impl Part {
    fn append(&mut self, other: Self) {
        let (nodes, references) = (self.nodes.len() as u32, self.references.len() as u32);
        let moved = |n: Node| {
            if n.is_leaf() {
                Node { word: n.word + references, ..n }
            } else {
                Node { data: n.data + (nodes << 2), ..n }
            }
        };
        self.nodes.extend(other.nodes.into_iter().map(moved));
        self.references.extend(other.references);
        self.depth = self.depth.max(other.depth);
    }
}

/// Builds the tree; node 0 is the root.
pub(super) fn tree(primitives: &Primitives) -> Part {
    let n = primitives.items.len();
    let max_depth = 8 + (1.3 * real::log2(n.max(1) as f64)) as u32;
    let mut part = Part::default();
    let cell =
        Cell { bounds: primitives.bounds, depth: 0, bad: 0, allowance: n.saturating_mul(GROWTH) };
    Builder { primitives, max_depth }.add(primitives.items.clone(), cell, &mut part);
    part
}

struct Builder<'a> {
    primitives: &'a Primitives<'a>,
    max_depth: u32,
}

/// A node to be built.
#[derive(Clone, Copy)]
struct Cell {
    bounds: Bounds3,
    depth: u32,
    /// The number of successive divisions above that cost more than a leaf.
    bad: u32,
    /// The number of references that the subtree may use.
    allowance: usize,
}

/// A plane perpendicular to an axis.
#[derive(Clone, Copy)]
struct Plane {
    axis: usize,
    at: f32,
    cost: f64,
}

impl Builder<'_> {
    fn add(&self, items: Vec<Item>, cell: Cell, part: &mut Part) {
        part.depth = part.depth.max(cell.depth + 1);
        let Some((plane, [low, high], cells)) = self.divide(&items, cell) else {
            part.nodes.push(Node::leaf(part.references.len(), items.len()));
            part.references.extend(items.iter().map(|i| i.id));
            return;
        };
        let is_large = items.len() > PARALLEL;
        drop(items);
        let node = part.nodes.len();
        part.nodes.push(Node::leaf(0, 0));
        if is_large {
            let tree = |items: Vec<Item>, cell: Cell| {
                let mut part = Part::default();
                self.add(items, cell, &mut part);
                part
            };
            let (first, second) = rayon::join(|| tree(low, cells[0]), || tree(high, cells[1]));
            part.append(first);
            part.nodes[node] = Node::inner(plane.axis, plane.at, part.nodes.len());
            part.append(second);
        } else {
            self.add(low, cells[0], part);
            part.nodes[node] = Node::inner(plane.axis, plane.at, part.nodes.len());
            self.add(high, cells[1], part);
        }
    }

    /// The best plane and the contents of both sides of it; `None` if a leaf is better.
    fn divide(&self, items: &[Item], cell: Cell) -> Option<(Plane, [Vec<Item>; 2], [Cell; 2])> {
        if items.len() < 2 || cell.depth >= self.max_depth {
            return None;
        }
        let plane = if items.len() > EXACT {
            binned(items, &cell.bounds)
        } else {
            swept(items, &cell.bounds)
        }?;
        let leaf_cost = TEST_COST * items.len() as f64;
        let is_bad = plane.cost >= leaf_cost;
        let bad = if is_bad { cell.bad + 1 } else { 0 };
        if bad > MAX_BAD || (is_bad && items.len() < 16) {
            return None;
        }
        let bounds = [
            Bounds3 { max: with(cell.bounds.max, plane.axis, plane.at), ..cell.bounds },
            Bounds3 { min: with(cell.bounds.min, plane.axis, plane.at), ..cell.bounds },
        ];
        let sides = self.sides(items, plane, bounds);
        let total = sides[0].len() + sides[1].len();
        if total > cell.allowance
            || (sides[0].len() == items.len() && sides[1].len() == items.len())
        {
            return None;
        }
        let child = |i: usize| Cell {
            bounds: bounds[i],
            depth: cell.depth + 1,
            bad,
            allowance: (cell.allowance as u128 * sides[i].len() as u128 / total.max(1) as u128)
                as usize,
        };
        let cells = [child(0), child(1)];
        Some((plane, sides, cells))
    }

    /// The contents of both sides of the plane.
    fn sides(&self, items: &[Item], plane: Plane, bounds: [Bounds3; 2]) -> [Vec<Item>; 2] {
        let Plane { axis, at, .. } = plane;
        let bounds = bounds.map(Into::into);
        let mut sides = [Vec::new(), Vec::new()];
        for item in items {
            // A primitive in the plane belongs to the first side.
            let low = item.min[axis] < at || item.max[axis] <= at;
            let high = item.max[axis] > at;
            if low && high {
                let parts = bounds.map(|b| self.primitives.clipped(item, &b));
                let is_nowhere = parts.iter().all(Option::is_none);
                for (side, part) in sides.iter_mut().zip(parts) {
                    // Only after overflow is an item in neither part.
                    side.extend(if is_nowhere { Some(*item) } else { part });
                }
            } else {
                sides[usize::from(high)].push(*item);
            }
        }
        sides
    }
}

fn with(mut v: snell_math::Vec3, axis: usize, x: f32) -> snell_math::Vec3 {
    v[axis] = x;
    v
}

/// The areas of the two parts of a cell, relative to the area of the cell, as functions of the
/// position of the plane.
struct Areas {
    inverse: f64,
    /// Area of a side perpendicular to the axis.
    across: f64,
    /// Growth of half of the part's area per length along the axis.
    around: f64,
    low: f64,
    high: f64,
}

impl Areas {
    fn new(cell: &Bounds3, axis: usize) -> Self {
        let size = cell.max.as_dvec3() - cell.min.as_dvec3();
        let (y, z) = (size[(axis + 1) % 3], size[(axis + 2) % 3]);
        Self {
            inverse: 1.0 / half_area(cell),
            across: y * z,
            around: y + z,
            low: cell.min[axis].into(),
            high: cell.max[axis].into(),
        }
    }

    /// The cost of a division at `at`, given the numbers of primitives on both sides.
    fn cost(&self, at: f32, low: usize, high: usize) -> f64 {
        let at = f64::from(at);
        let area = |length: f64| (self.across + self.around * length) * self.inverse;
        let tests = area(at - self.low) * low as f64 + area(self.high - at) * high as f64;
        let bonus = if low == 0 || high == 0 { EMPTY_BONUS } else { 1.0 };
        (1.0 + TEST_COST * tests) * bonus
    }
}

/// The cheapest plane between bins.
fn binned(items: &[Item], cell: &Bounds3) -> Option<Plane> {
    let size = cell.size();
    let mut best: Option<Plane> = None;
    for axis in 0..3 {
        let scale = BINS as f32 / size[axis];
        if !(size[axis] > 0.0 && scale.is_finite()) {
            continue;
        }
        let bin = |x: f32| (((x - cell.min[axis]) * scale) as usize).min(BINS - 1);
        let (mut starts, mut ends) = ([0usize; BINS], [0usize; BINS]);
        for item in items {
            starts[bin(item.min[axis])] += 1;
            ends[bin(item.max[axis])] += 1;
        }
        let areas = Areas::new(cell, axis);
        let (mut low, mut high) = (0, items.len());
        for i in 1..BINS {
            low += starts[i - 1];
            high -= ends[i - 1];
            let at = cell.min[axis] + size[axis] * (i as f32 / BINS as f32);
            let cost = areas.cost(at, low, high);
            if at > cell.min[axis] && at < cell.max[axis] && best.is_none_or(|b| cost < b.cost) {
                best = Some(Plane { axis, at, cost });
            }
        }
    }
    best
}

/// The cheapest plane at a side of a box.
fn swept(items: &[Item], cell: &Bounds3) -> Option<Plane> {
    let mut best: Option<Plane> = None;
    let n = items.len();
    let (mut starts, mut ends) = ([0.0f32; EXACT], [0.0f32; EXACT]);
    for axis in 0..3 {
        let areas = Areas::new(cell, axis);
        for (i, item) in items.iter().enumerate() {
            (starts[i], ends[i]) = (item.min[axis], item.max[axis]);
        }
        let (starts, ends) = (&mut starts[..n], &mut ends[..n]);
        starts.sort_unstable_by(f32::total_cmp);
        ends.sort_unstable_by(f32::total_cmp);
        let (mut low, mut ended, mut i, mut j) = (0, 0, 0, 0);
        while i < n || j < n {
            let at = match (starts.get(i), ends.get(j)) {
                (Some(&a), Some(&b)) => a.min(b),
                (Some(&x), None) | (None, Some(&x)) => x,
                (None, None) => break,
            };
            // Primitives that end here are below the plane, those that start here are above it.
            while ends.get(j).is_some_and(|&x| x <= at) {
                (j, ended) = (j + 1, ended + 1);
            }
            let cost = areas.cost(at, low.max(ended), n - ended);
            if at > cell.min[axis] && at < cell.max[axis] && best.is_none_or(|b| cost < b.cost) {
                best = Some(Plane { axis, at, cost });
            }
            while starts.get(i).is_some_and(|&x| x <= at) {
                (i, low) = (i + 1, low + 1);
            }
        }
    }
    best
}
