//! Builds a BSP tree from primitives.
//!
//! The polygon of a triangle is the part of its plane within its box (enlarged by the margin of
//! [`crate::lecture::primitives`]), because hits on the triangle can only be there. Shapes,
//! instances and small triangles, for which the box is as good, are represented by their box.

use super::polygon::{parts_of_box, plane_in_box};
use super::{ChildRef, Node};
use crate::lecture::primitives::{Item, PARALLEL, Primitives};
use snell_math::plane::{Plane, Side, Vertices};
use snell_math::{Bounds3d, DVec3, real};

/// Sets of up to this size are not divided.
const LEAF: usize = 2;

/// Sets larger than this are divided even if the sample shows no gain: the sample is often wrong,
/// and divisions below may pay.
const MANY: usize = 8;

/// Cost of testing a primitive, in units of steps from node to node.
const TEST_COST: f64 = 2.0;

/// The largest number of references in all nodes and leaves, relative to the number of primitives.
const GROWTH: usize = 8;

/// The number of polygons whose planes are tried.
const CANDIDATES: usize = 3;
/// The number of polygons on which each plane is tried.
const SAMPLE: usize = 24;

/// The factor by which a plane that cuts off empty space is cheaper.
const EMPTY_BONUS: f64 = 0.8;

/// The largest part of a cell that may remain when its empty part is cut off.
const MOST: f64 = 0.95;

/// Distances from a plane below this, relative to the size of the group, count as zero.
const TOLERANCE: f64 = 1e-7;

/// The part of a primitive in a set.
#[derive(Clone, Copy, Debug)]
struct Fragment {
    id: u32,
    /// The index of the fragment's first vertex in [`Set::vertices`].
    first: u32,
    /// The number of vertices; 0 for a fragment that is represented by its box.
    count: u32,
    bounds: Bounds3d,
}

/// The contents of a cell of space.
#[derive(Default)]
struct Set {
    fragments: Vec<Fragment>,
    vertices: Vertices,
}

impl Set {
    fn polygon(&self, f: &Fragment) -> &[DVec3] {
        &self.vertices[f.first as usize..(f.first + f.count) as usize]
    }

    /// Adds a whole fragment of another set.
    fn copy(&mut self, from: &Self, f: &Fragment) {
        let first = self.vertices.len() as u32;
        self.vertices.extend_from_slice(from.polygon(f));
        self.fragments.push(Fragment { first, ..*f });
    }

    /// Adds the part of a fragment on one side of a plane.
    fn cut(&mut self, from: &Self, f: &Fragment, plane: &Plane, sign: f64) {
        let first = self.vertices.len();
        let mut bounds = f.bounds;
        if f.count > 0 {
            plane.cut(from.polygon(f), sign, &mut self.vertices);
            bounds = bounds_of(&self.vertices[first..]);
        } else if let Some(axis) = (0..3).find(|&a| plane.normal[a] == 1.0) {
            let side = if sign > 0.0 { &mut bounds.min } else { &mut bounds.max };
            side[axis] = plane.offset;
        }
        let count = (self.vertices.len() - first) as u32;
        self.fragments.push(Fragment { first: first as u32, count, bounds, ..*f });
    }
}

fn bounds_of(points: &[DVec3]) -> Bounds3d {
    points.iter().fold(Bounds3d::EMPTY, |b, &p| b.with_point(p))
}

/// A subtree.
#[derive(Default)]
pub(super) struct Part {
    pub nodes: Vec<Node>,
    pub leaves: Vec<[u32; 2]>,
    pub references: Vec<u32>,
    pub depth: u32,
}

impl Part {
    fn refer(&mut self, ids: impl Iterator<Item = u32>) -> [u32; 2] {
        let first = self.references.len() as u32;
        self.references.extend(ids);
        [first, self.references.len() as u32]
    }

    /// Adds another subtree. Returns its root with indices valid in this one.
    fn append(&mut self, other: Self, root: ChildRef) -> ChildRef {
        let (nodes, leaves, references) =
            (self.nodes.len() as u32, self.leaves.len() as u32, self.references.len() as u32);
        let moved = |c: ChildRef| ChildRef(c.0 + if c.is_leaf() { leaves } else { nodes });
        let shifted = |range: [u32; 2]| range.map(|x| x + references);
        let node = |n: Node| Node { on: shifted(n.on), children: n.children.map(moved), ..n };
        self.nodes.extend(other.nodes.into_iter().map(node));
        self.leaves.extend(other.leaves.into_iter().map(shifted));
        self.references.extend(other.references);
        self.depth = self.depth.max(other.depth);
        moved(root)
    }
}

/// Builds the tree. Returns it with its root and the origin of its planes.
pub(super) fn tree(primitives: &Primitives) -> (Part, ChildRef, DVec3) {
    let n = primitives.items.len();
    let bounds: Bounds3d = if n == 0 { Bounds3d::default() } else { primitives.bounds.into() };
    let center = if n == 0 { DVec3::ZERO } else { bounds.center() };
    let size = if n == 0 { 0.0 } else { bounds.size().max_element() };
    let builder = Builder {
        primitives,
        center,
        tolerance: size * TOLERANCE,
        max_depth: 12 + (2.0 * real::log2(n.max(1) as f64)) as u32,
    };
    let mut part = Part::default();
    let cell = Bounds3d { min: bounds.min - center, max: bounds.max - center };
    let root = builder.subtree(builder.whole(), &cell, 0, n.saturating_mul(GROWTH), &mut part);
    (part, root, center)
}

struct Builder<'a> {
    primitives: &'a Primitives<'a>,
    center: DVec3,
    tolerance: f64,
    max_depth: u32,
}

/// The result of trying a plane on a sample.
struct Score {
    plane: Plane,
    cost: f64,
}

impl Builder<'_> {
    /// The set of all primitives.
    fn whole(&self) -> Set {
        let mut set = Set::default();
        for item in &self.primitives.items {
            let box_ = self.item_box(item);
            let first = set.vertices.len();
            if let Some((plane, point)) = self.plane_of(item.id) {
                plane_in_box(&plane, point, &box_, &mut set.vertices);
                if set.vertices.len() - first < 3 {
                    set.vertices.truncate(first);
                }
            }
            let count = (set.vertices.len() - first) as u32;
            let bounds = if count > 0 { bounds_of(&set.vertices[first..]) } else { box_ };
            set.fragments.push(Fragment { id: item.id, first: first as u32, count, bounds });
        }
        set
    }

    /// The box of an item relative to the centre, enlarged by the margin.
    fn item_box(&self, item: &Item) -> Bounds3d {
        let margin = DVec3::splat(self.primitives.margin);
        Bounds3d {
            min: item.min.as_dvec3() - self.center - margin,
            max: item.max.as_dvec3() - self.center + margin,
        }
    }

    /// The plane of a triangle and a point on it.
    fn plane_of(&self, id: u32) -> Option<(Plane, DVec3)> {
        let [a, b, c] = self.primitives.corners(id)?.map(|v| v.as_dvec3() - self.center);
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some((Plane { normal, offset: normal.dot(a) }, a))
    }

    fn subtree(
        &self,
        set: Set,
        cell: &Bounds3d,
        depth: u32,
        allowance: usize,
        part: &mut Part,
    ) -> ChildRef {
        part.depth = part.depth.max(depth + 1);
        let n = set.fragments.len();
        let divided = if n > LEAF && depth < self.max_depth {
            self.divide(&set, cell, allowance)
        } else {
            None
        };
        let Some(Divided { plane, on, sides: [back, front] }) = divided else {
            let range = part.refer(set.fragments.iter().map(|f| f.id));
            part.leaves.push(range);
            return ChildRef((part.leaves.len() - 1) as u32 | ChildRef::LEAF);
        };
        drop(set);
        let total = (back.fragments.len() + front.fragments.len()).max(1);
        let rest = allowance.saturating_sub(on.len());
        let share =
            |set: &Set| (rest as u128 * set.fragments.len() as u128 / total as u128) as usize;
        let (share_back, share_front) = (share(&back), share(&front));
        let node = part.nodes.len();
        let on = part.refer(on.into_iter());
        let cells = parts_of_box(&plane, cell).map(|part| part.bounds);
        let nothing = ChildRef(ChildRef::LEAF);
        part.nodes.push(Node { plane, on, children: [nothing; 2] });
        let children = if n > PARALLEL {
            let tree = |set: Set, cell: &Bounds3d, share: usize| {
                let mut part = Part::default();
                let root = self.subtree(set, cell, depth + 1, share, &mut part);
                (part, root)
            };
            let (a, b) = rayon::join(
                || tree(back, &cells[0], share_back),
                || tree(front, &cells[1], share_front),
            );
            [part.append(a.0, a.1), part.append(b.0, b.1)]
        } else {
            [
                self.subtree(back, &cells[0], depth + 1, share_back, part),
                self.subtree(front, &cells[1], depth + 1, share_front, part),
            ]
        };
        part.nodes[node].children = children;
        ChildRef(node as u32)
    }

    /// Divides a set by the best plane; `None` if a leaf is better, or if the parts would need more
    /// references than allowed.
    fn divide(&self, set: &Set, cell: &Bounds3d, allowance: usize) -> Option<Divided> {
        let plane = self.best_plane(set, cell)?;
        let mut divided =
            Divided { plane, on: Vec::new(), sides: [Set::default(), Set::default()] };
        for f in &set.fragments {
            let [back, front] = &mut divided.sides;
            match self.side(set, f, &plane) {
                Side::On => divided.on.push(f.id),
                Side::Back => back.copy(set, f),
                Side::Front => front.copy(set, f),
                Side::Across => {
                    back.cut(set, f, &plane, -1.0);
                    front.cut(set, f, &plane, 1.0);
                }
            }
        }
        let counts = divided.sides.each_ref().map(|s| s.fragments.len());
        let n = set.fragments.len();
        let separates = counts[0] < n || counts[1] < n;
        (separates && divided.on.len() + counts[0] + counts[1] <= allowance).then_some(divided)
    }

    fn side(&self, set: &Set, f: &Fragment, plane: &Plane) -> Side {
        if f.count > 0 {
            plane.side(set.polygon(f), self.tolerance)
        } else {
            plane.side_of_box(&f.bounds, self.tolerance)
        }
    }

    /// The plane of least expected cost on a sample; `None` if a leaf is expected to be better than
    /// any plane.
    fn best_plane(&self, set: &Set, cell: &Bounds3d) -> Option<Plane> {
        let n = set.fragments.len();
        let step = |wanted: usize| n.div_ceil(wanted.min(n));
        let sample: Vec<&Fragment> = set.fragments.iter().step_by(step(SAMPLE)).collect();
        let mut best: Option<Score> = None;
        let mut consider = |plane: Plane| {
            let cost = self.cost(set, &sample, cell, &plane);
            if best.as_ref().is_none_or(|b| cost < b.cost) {
                best = Some(Score { plane, cost });
            }
        };
        for f in sample.iter().step_by(sample.len().div_ceil(CANDIDATES)) {
            if let Some((plane, _)) = self.plane_of(f.id) {
                consider(plane);
            }
            for (axis, normal) in DVec3::AXES.into_iter().enumerate() {
                for offset in [f.bounds.min[axis], f.bounds.max[axis]] {
                    consider(Plane { normal, offset });
                }
            }
        }
        // The sample represents the whole set.
        let scale = n as f64 / sample.len() as f64;
        let best = best?;
        (n > MANY || 1.0 + best.cost * scale < TEST_COST * n as f64).then_some(best.plane)
    }

    /// The expected cost of the two parts of a cell, by the surface area heuristic.
    fn cost(&self, set: &Set, sample: &[&Fragment], cell: &Bounds3d, plane: &Plane) -> f64 {
        let (mut on, mut counts) = (0, [0; 2]);
        for f in sample {
            match self.side(set, f, plane) {
                Side::On => on += 1,
                Side::Back => counts[0] += 1,
                Side::Front => counts[1] += 1,
                Side::Across => counts = counts.map(|n| n + 1),
            }
        }
        let inverse = 1.0 / cell.half_area();
        let parts = parts_of_box(plane, cell);
        let side = |i: usize| parts[i].half_area * inverse * f64::from(counts[i]);
        // Nearly every ray through the cell crosses the plane in it, if the plane divides the cell
        // well.
        let tests = f64::EPSILON + side(0) + side(1) + 0.5 * f64::from(on);
        let bonus = match counts {
            // A plane along the border of the cell cuts off nothing.
            [0, _] if parts[1].half_area * inverse > MOST => f64::INFINITY,
            [_, 0] if parts[0].half_area * inverse > MOST => f64::INFINITY,
            [0, _] | [_, 0] => EMPTY_BONUS,
            _ => 1.0,
        };
        TEST_COST * tests * bonus
    }
}

/// A divided set.
struct Divided {
    plane: Plane,
    on: Vec<u32>,
    /// The sets behind and in front of the plane.
    sides: [Set; 2],
}
