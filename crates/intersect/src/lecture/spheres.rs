//! A binary hierarchy of bounding spheres: cheaper to test than boxes, but less tight (lecture:
//! "Sphere has simple/efficient intersection code. Bounding box is generally 'tighter'").
//!
//! Sets are divided by the surface area heuristic over bins, with the areas of spheres. The sphere
//! of a set is first centred in its box and then moves towards the farthest of its primitives, by a
//! smaller share each time (Bădoiu and Clarkson, Smaller core-sets for balls, SODA 2003). The
//! result is a few percent larger than the smallest sphere.

use super::box_ray::BoxRay;
use super::primitives::{Item, PARALLEL, Primitives, bounds_of};
use super::{Accelerator, AcceleratorOptions, Later, Size, Visitor, Work, walk_with_stack};
use crate::search::region::Region;
use snell_math::{Bounds3, DVec3, Vec3, real};

/// The largest number of primitives in a leaf.
const LEAF: usize = 4;

/// The number of steps towards the smallest sphere.
const STEPS: usize = 6;

/// The number of bins on each axis.
const BINS: usize = 16;

/// The depth from which on sets are halved, so that no tree is deeper than about 70 nodes.
const MAX_COST_DEPTH: usize = 40;

#[derive(Clone, Copy, Debug)]
struct Node {
    center: Vec3,
    radius: f32,
    /// For an inner node the index of its second child (the first child follows the node directly),
    /// for a leaf the index of its first reference.
    at: u32,
    /// The number of primitives in a leaf; 0 for an inner node.
    count: u32,
}

#[derive(Debug, Default)]
struct Spheres {
    nodes: Vec<Node>,
    references: Vec<u32>,
    depth: u32,
    front_to_back: bool,
}

/// Builds the hierarchy of spheres of a group.
pub(crate) fn build(primitives: &Primitives, options: &AcceleratorOptions) -> Box<dyn Accelerator> {
    let mut items = primitives.items.clone();
    let mut tree = Spheres::default();
    if !items.is_empty() {
        tree.add(&mut items, 0);
    }
    tree.front_to_back = options.front_to_back;
    Box::new(tree)
}

impl Spheres {
    /// Adds the subtree of a set, depth first.
    fn add(&mut self, items: &mut [Item], depth: usize) {
        let bounds = bounds_of(items);
        let (center, radius) = sphere(items, &bounds);
        self.depth = self.depth.max(depth as u32 + 1);
        if items.len() <= LEAF {
            let at = self.references.len() as u32;
            self.nodes.push(Node { center, radius, at, count: items.len() as u32 });
            self.references.extend(items.iter().map(|i| i.id));
            return;
        }
        let node = self.nodes.len();
        self.nodes.push(Node { center, radius, at: 0, count: 0 });
        let at = if depth < MAX_COST_DEPTH { split(items) } else { items.len() / 2 };
        let is_large = items.len() > PARALLEL;
        let (a, b) = items.split_at_mut(at);
        if is_large {
            let tree = |items: &mut [Item]| {
                let mut tree = Self::default();
                tree.add(items, depth + 1);
                tree
            };
            let (first, second) = rayon::join(|| tree(a), || tree(b));
            self.append(first);
            self.nodes[node].at = self.nodes.len() as u32;
            self.append(second);
        } else {
            self.add(a, depth + 1);
            self.nodes[node].at = self.nodes.len() as u32;
            self.add(b, depth + 1);
        }
    }

    /// Adds a finished subtree.
    fn append(&mut self, other: Self) {
        let (nodes, references) = (self.nodes.len() as u32, self.references.len() as u32);
        let moved =
            |n: Node| Node { at: n.at + if n.count == 0 { nodes } else { references }, ..n };
        self.nodes.extend(other.nodes.into_iter().map(moved));
        self.references.extend(other.references);
        self.depth = self.depth.max(other.depth);
    }
}

/// A sphere around items: centre, and radius rounded up.
fn sphere(items: &[Item], bounds: &Bounds3) -> (Vec3, f32) {
    let mut center = bounds.center();
    let mut best = (center, f64::INFINITY);
    for step in 0..=STEPS {
        let (radius, farthest) = items
            .iter()
            .map(|i| {
                // The corner farthest from the centre, chosen in `f64`, because rounding
                // differences to `f32` may choose a wrong one.
                let center = center.as_dvec3();
                let (up, down) = (i.max.as_dvec3() - center, center - i.min.as_dvec3());
                let corner =
                    std::array::from_fn(|a| if up[a] >= down[a] { i.max[a] } else { i.min[a] });
                (up.max(down).length_squared(), Vec3::from_array(corner))
            })
            .fold((-1.0, center), |a, b| if b.0 > a.0 { b } else { a });
        if radius < best.1 {
            best = (center, radius);
        }
        center += (farthest - center) / (step + 2) as f32;
    }
    (best.0, ((best.1.sqrt() * (1.0 + 1e-9)) as f32).next_up())
}

/// Reorders items into two parts, each with at least one item. Returns the size of the first part.
fn split(items: &mut [Item]) -> usize {
    let centers = Bounds3::of(items.iter().map(Item::center));
    let scale = (Vec3::splat(BINS as f32 * 0.9999) / centers.size()).min(Vec3::splat(f32::MAX));
    let bin =
        |i: &Item, axis: usize| (((i.center() - centers.min) * scale)[axis] as usize).min(BINS - 1);
    let mut best = (f64::INFINITY, 0, 0);
    for axis in 0..3 {
        let mut bins = [(Bounds3::EMPTY, 0); BINS];
        for item in items.iter() {
            let (bounds, count) = &mut bins[bin(item, axis)];
            *bounds = bounds.union(&item.bounds());
            *count += 1;
        }
        let cost = |(bounds, count): &(Bounds3, usize)| {
            real::powi(f64::from(bounds.radius()), 2) * *count as f64
        };
        let join = |a: (Bounds3, usize), b: &(Bounds3, usize)| (a.0.union(&b.0), a.1 + b.1);
        let mut right = [0.0; BINS];
        let mut sum = (Bounds3::EMPTY, 0);
        for i in (1..BINS).rev() {
            sum = join(sum, &bins[i]);
            right[i] = cost(&sum);
        }
        let mut left = (Bounds3::EMPTY, 0);
        for i in 1..BINS {
            left = join(left, &bins[i - 1]);
            let total = cost(&left) + right[i];
            if left.1 > 0 && left.1 < items.len() && total < best.0 {
                best = (total, axis, i);
            }
        }
    }
    let (cost, axis, first_right) = best;
    let mut low = 0;
    if cost.is_finite() {
        for i in 0..items.len() {
            if bin(&items[i], axis) < first_right {
                items.swap(low, i);
                low += 1;
            }
        }
    }
    if low == 0 || low == items.len() { items.len() / 2 } else { low }
}

impl Spheres {
    /// The interval of the ray inside the sphere of a node, from the distance of the centre from
    /// the line; `None` if the ray misses it. NaN, which arises from overflow, never excludes a
    /// node.
    #[inline(always)]
    fn span(&self, node: u32, ray: &ThickRay) -> Option<(f64, f64)> {
        let node = &self.nodes[node as usize];
        let to_center = node.center.as_dvec3() - ray.origin;
        let middle = to_center.dot(ray.direction) * ray.inverse_length_squared;
        let aside = to_center - ray.direction * middle;
        let radius = f64::from(node.radius) + ray.width;
        let half_squared = (radius * radius - aside.length_squared()) * ray.inverse_length_squared;
        if half_squared < 0.0 {
            return None;
        }
        let half = half_squared.sqrt();
        let (start, end) = ((middle - half).max(ray.t_min), middle + half);
        if start > end { None } else { Some((start, end)) }
    }

    fn search(
        &self,
        ray: &BoxRay,
        visitor: &mut dyn Visitor,
        stack: &mut Vec<Later>,
        work: &mut Work,
    ) -> bool {
        let ray = ThickRay::new(ray);
        if let Some((start, end)) = self.span(0, &ray) {
            stack.push(Later::node(0, start, end));
        }
        while let Some(later) = stack.pop() {
            if later.start > visitor.cull() {
                continue;
            }
            let node = &self.nodes[later.node as usize];
            let place = || Region::ball(node.center.as_dvec3(), node.radius.into());
            if node.count > 0 {
                work.look(visitor, true, place);
                let first = node.at as usize;
                if visitor.test(&self.references[first..first + node.count as usize]) {
                    return true;
                }
                continue;
            }
            work.node(visitor, place);
            let child =
                |at: u32| self.span(at, &ray).map(|(start, end)| Later::node(at, start, end));
            let (first, second) = (child(later.node + 1), child(node.at));
            let swap = match (&first, &second) {
                (Some(a), Some(b)) => self.front_to_back && b.start < a.start,
                _ => false,
            };
            let (near, far) = if swap { (second, first) } else { (first, second) };
            stack.extend(far);
            stack.extend(near);
        }
        false
    }
}

/// A ray with a thickness, in the form for sphere tests.
struct ThickRay {
    origin: DVec3,
    direction: DVec3,
    inverse_length_squared: f64,
    width: f64,
    t_min: f64,
}

impl ThickRay {
    fn new(ray: &BoxRay) -> Self {
        let direction = DVec3::from_array(ray.direction);
        Self {
            origin: DVec3::from_array(ray.origin),
            direction,
            inverse_length_squared: 1.0 / direction.length_squared(),
            // The half diagonal of a cube whose half side is the ray's width.
            width: ray.width * 1.7321,
            t_min: ray.t_min,
        }
    }
}

impl Accelerator for Spheres {
    fn walk(&self, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        walk_with_stack(visitor, |visitor, stack, work| self.search(ray, visitor, stack, work))
    }

    fn repeats(&self) -> bool {
        false
    }

    fn size(&self) -> Size {
        Size::of_tree(&self.nodes, &self.references, self.depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sphere_of_a_set_holds_it_and_is_tighter_than_that_of_its_box() {
        // Three distant vertices of a triangle: the sphere around its box is half as large again.
        let at = |p: Vec3, id: u32| Item { min: p, id, max: p };
        let items =
            [at(Vec3::ZERO, 0), at(Vec3::new(1.0, 1.0, 0.0), 1), at(Vec3::new(1.0, 0.0, 1.0), 2)];
        let bounds = bounds_of(&items);
        let (center, radius) = sphere(&items, &bounds);
        assert!(items.iter().all(|i| i.min.distance(center) <= radius));
        assert!((0.8164..0.85).contains(&radius), "{radius}");
        assert!(bounds.radius() > 0.86);
    }
}
