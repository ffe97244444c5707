//! Builds a light BVH from the top. A node's range of emitters is split into up to eight parts: the
//! most expensive part is split again and again, at the best place by the surface area orientation
//! heuristic (Conty Estevez and Kulla, section 4.4; Pharr, Jakob and Humphreys, section 12.6.3).
//! Candidates are compared by cones around a box of axes, which are cheap to compute; nodes get
//! tight cones.

use super::bvh::{EMITTER, NONE, Node, WIDTH};
use super::cone::sin_from_cos;
use rayon::prelude::*;
use snell_math::{Bounds3, Bounds3d, Vec3, real};
use snell_scene::light::LightBounds;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

const BUCKETS: usize = 12;
/// Ranges of more emitters are built in parallel, on the threads of the current rayon pool. The
/// tree does not depend on the threads.
const PARALLEL: usize = 4096;

/// An emitter in the units of the tree.
#[derive(Clone, Copy, Debug)]
pub struct Emitter {
    center: Vec3,
    radius: f32,
    axis: Vec3,
    cos_spread: f32,
    cos_emission: f32,
    is_two_sided: bool,
    intensity: f32,
    number: u32,
}

/// The emitters that have some intensity, scaled so that positions are around 0, the extent is
/// about 1, and intensities are at most 1. Also returns the origin and the scale of the positions.
pub fn normalized<'a>(
    lights: impl Iterator<Item = &'a LightBounds> + Clone,
) -> (Vec<Emitter>, Vec3, f32) {
    let usable =
        |l: &LightBounds| l.intensity > 0.0 && l.bounds.is_finite() && !l.bounds.is_empty();
    let all = lights.clone().filter(|l| usable(l)).fold(Bounds3d::EMPTY, |b, l| b.union(&l.bounds));
    let strongest = lights.clone().filter(|l| usable(l)).map(|l| l.intensity).fold(0.0, f64::max);
    let origin = if all.is_empty() { Vec3::ZERO } else { all.center().as_vec3() };
    let extent = all.radius();
    let scale = if extent > 1e-30 && extent < 1e30 { (1.0 / extent) as f32 } else { 1.0 };
    let emitter = |(number, light): (usize, &LightBounds)| {
        let local = |p: snell_math::DVec3| ((p - origin.as_dvec3()) * f64::from(scale)).as_vec3();
        let bounds = Bounds3 { min: local(light.bounds.min), max: local(light.bounds.max) };
        Emitter {
            center: bounds.center(),
            radius: bounds.radius(),
            axis: light.axis,
            cos_spread: light.cos_spread,
            cos_emission: light.cos_emission,
            is_two_sided: light.is_two_sided,
            // With these limits, sums over many emitters stay finite, and the weakest stay above 0.
            intensity: ((light.intensity / strongest) as f32).max(1e-20),
            number: number as u32,
        }
    };
    let emitters = lights.enumerate().filter(|(_, l)| usable(l)).map(emitter);
    (emitters.collect(), origin, scale)
}

impl Emitter {
    /// The box around the emitter's sphere.
    fn bounds(&self) -> Bounds3 {
        Bounds3 { min: self.center - self.radius, max: self.center + self.radius }
    }
}

/// The nodes of the tree, the root first; empty without emitters.
pub fn build(mut emitters: Vec<Emitter>) -> Vec<Node> {
    if emitters.is_empty() { Vec::new() } else { subtree(&mut emitters) }
}

/// The nodes of the tree over some emitters, numbered from 0.
fn subtree(emitters: &mut [Emitter]) -> Vec<Node> {
    if emitters.len() <= PARALLEL {
        return small_subtree(emitters);
    }
    let mut rest = &mut *emitters;
    let mut parts = Vec::new();
    for length in split_wide(rest) {
        let (part, others) = rest.split_at_mut(length);
        parts.push(part);
        rest = others;
    }
    let mut root = Node::new(NONE, 0);
    (0..).zip(&parts).for_each(|(lane, part)| set_child(&mut root, lane, part));
    let below: Vec<Vec<Node>> = parts
        .into_par_iter()
        .map(|part| if part.len() > 1 { subtree(part) } else { Vec::new() })
        .collect();
    let mut nodes = vec![root];
    for (lane, below) in below.into_iter().enumerate().filter(|(_, nodes)| !nodes.is_empty()) {
        let offset = nodes.len() as u32;
        nodes[0].child[lane] = offset;
        nodes.extend(below.into_iter().map(|mut node| {
            let is_node = |c: u32| c != NONE && c & EMITTER == 0;
            node.child = node.child.map(|c| if is_node(c) { c + offset } else { c });
            (node.parent, node.slot) = if node.parent == NONE {
                (0, lane as u32)
            } else {
                (node.parent + offset, node.slot)
            };
            node
        }));
    }
    nodes
}

/// [`subtree`] for few emitters. It has a stack of its own, because many lights in one place may
/// nest deeply.
fn small_subtree(emitters: &mut [Emitter]) -> Vec<Node> {
    let mut nodes: Vec<Node> = Vec::new();
    let mut todo = vec![(0, emitters.len(), NONE, 0)];
    while let Some((start, end, parent, slot)) = todo.pop() {
        let number = nodes.len() as u32;
        if parent != NONE {
            nodes[parent as usize].child[slot as usize] = number;
        }
        let mut node = Node::new(parent, slot);
        let mut first = start;
        for (lane, length) in (0..).zip(split_wide(&mut emitters[start..end])) {
            set_child(&mut node, lane as usize, &emitters[first..first + length]);
            if length > 1 {
                todo.push((first, first + length, number, lane));
            }
            first += length;
        }
        nodes.push(node);
    }
    nodes
}

/// Sorts emitters into up to eight parts, one after the other, and returns their lengths.
fn split_wide(emitters: &mut [Emitter]) -> Vec<usize> {
    // Start, length and cost of each part.
    let mut parts = vec![(0, emitters.len(), f32::INFINITY)];
    while parts.len() < WIDTH {
        let splittable = parts.iter().enumerate().filter(|(_, part)| part.1 > 1);
        let Some((worst, &(start, length, _))) = splittable.max_by(|a, b| a.1.2.total_cmp(&b.1.2))
        else {
            break;
        };
        let (middle, costs) = split(&mut emitters[start..start + length]);
        parts[worst] = (start, middle, costs[0]);
        parts.insert(worst + 1, (start + middle, length - middle, costs[1]));
    }
    parts.into_iter().map(|part| part.1).collect()
}

/// Bounds of the emitters in a candidate part of a split.
#[derive(Clone, Copy)]
struct Bucket {
    bounds: Bounds3,
    axes: Bounds3,
    /// The smallest cosines, which belong to the largest angles.
    cos_spread: f32,
    cos_emission: f32,
    intensity: f32,
    count: usize,
}

impl Bucket {
    const EMPTY: Self = Self {
        bounds: Bounds3::EMPTY,
        axes: Bounds3::EMPTY,
        cos_spread: 1.0,
        cos_emission: 1.0,
        intensity: 0.0,
        count: 0,
    };

    fn add(&mut self, e: &Emitter) {
        self.bounds = self.bounds.union(&e.bounds());
        self.axes = self.axes.with_point(e.axis);
        self.cos_spread = self.cos_spread.min(e.cos_spread);
        self.cos_emission = self.cos_emission.min(e.cos_emission);
        self.intensity += e.intensity;
        self.count += 1;
    }

    fn union(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            axes: self.axes.union(&other.axes),
            cos_spread: self.cos_spread.min(other.cos_spread),
            cos_emission: self.cos_emission.min(other.cos_emission),
            intensity: self.intensity + other.intensity,
            count: self.count + other.count,
        }
    }

    /// The surface area orientation heuristic: the intensity, multiplied by the measure of
    /// directions and by the surface of the box.
    fn cost(&self) -> f32 {
        if self.count == 0 {
            return 0.0;
        }
        let spread = (angle(self.cos_spread) + angle(cos_around(&self.axes))).min(PI);
        let widest = (spread + angle(self.cos_emission)).min(PI);
        let (sin, cos) = real::sin_cos(spread);
        let directions = TAU * (1.0 - cos)
            + FRAC_PI_2
                * (2.0 * widest * sin - real::cos(spread - 2.0 * widest) - 2.0 * spread * sin
                    + cos);
        // Boxes of points and lines have no surface, but their size matters too.
        let size = self.bounds.size();
        self.intensity * directions * (self.bounds.half_area() + 1e-3 * size.length_squared())
    }
}

fn angle(cos: f32) -> f32 {
    real::acos(cos.clamp(-1.0, 1.0))
}

/// Cosine of an angle around the direction of a box's centre that contains all unit vectors in the
/// box.
fn cos_around(axes: &Bounds3) -> f32 {
    let (center, radius) = (axes.center(), axes.radius());
    let length = center.length();
    // The law of cosines, for vectors of length 1 within `radius` of the centre.
    ((1.0 + length * length - radius * radius) / (2.0 * length).max(1e-6)).clamp(-1.0, 1.0)
}

/// Sorts emitters into two parts that are not empty. Returns the length of the first part and the
/// cost of each.
fn split(emitters: &mut [Emitter]) -> (usize, [f32; 2]) {
    let centers = Bounds3::of(emitters.iter().map(|e| e.center));
    let size = centers.size();
    let mut best: Option<(f32, usize, usize, [f32; 2])> = None;
    if emitters.len() > 2 {
        let buckets = sort_into_buckets(emitters, &centers);
        for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
            let stretch = size.max_element() / size[axis];
            let Some((bucket, costs)) = best_boundary(&buckets[axis]) else { continue };
            let cost = (costs[0] + costs[1]) * stretch;
            if best.is_none_or(|b| cost < b.0) {
                best = Some((cost, axis, bucket, costs));
            }
        }
    }
    if let Some((_, axis, bucket, costs)) = best {
        return (partition(emitters, |e| bucket_of(e, &centers, axis) <= bucket), costs);
    }
    let middle = emitters.len() / 2;
    let cost = |part: &[Emitter]| {
        let mut all = Bucket::EMPTY;
        part.iter().for_each(|e| all.add(e));
        all.cost()
    };
    (middle, [cost(&emitters[..middle]), cost(&emitters[middle..])])
}

fn bucket_of(e: &Emitter, centers: &Bounds3, axis: usize) -> usize {
    let relative = (e.center[axis] - centers.min[axis]) / (centers.max[axis] - centers.min[axis]);
    ((relative * BUCKETS as f32) as usize).min(BUCKETS - 1)
}

/// Sorts emitters into buckets along each axis.
fn sort_into_buckets(emitters: &[Emitter], centers: &Bounds3) -> [[Bucket; BUCKETS]; 3] {
    let mut buckets = [[Bucket::EMPTY; BUCKETS]; 3];
    for e in emitters {
        for (axis, buckets) in buckets.iter_mut().enumerate() {
            buckets[bucket_of(e, centers, axis)].add(e);
        }
    }
    buckets
}

/// The bucket after which to split, and the cost of the two parts; `None` if one part would be
/// empty.
fn best_boundary(buckets: &[Bucket; BUCKETS]) -> Option<(usize, [f32; 2])> {
    let mut above = [Bucket::EMPTY; BUCKETS + 1];
    for i in (0..BUCKETS).rev() {
        above[i] = above[i + 1].union(&buckets[i]);
    }
    let (mut below, mut best): (_, Option<(usize, [f32; 2])>) = (Bucket::EMPTY, None);
    for i in 0..BUCKETS - 1 {
        below = below.union(&buckets[i]);
        let above = &above[i + 1];
        let costs = [below.cost(), above.cost()];
        let is_split = below.count > 0 && above.count > 0;
        if is_split && best.is_none_or(|b| costs[0] + costs[1] < b.1[0] + b.1[1]) {
            best = Some((i, costs));
        }
    }
    best
}

/// Moves the emitters of the first part to the front, and returns their number.
fn partition(emitters: &mut [Emitter], is_first: impl Fn(&Emitter) -> bool) -> usize {
    let mut first = 0;
    for i in 0..emitters.len() {
        if is_first(&emitters[i]) {
            emitters.swap(first, i);
            first += 1;
        }
    }
    first
}

/// Sets tight bounds of a child.
fn set_child(node: &mut Node, lane: usize, emitters: &[Emitter]) {
    if let [only] = emitters {
        node.child[lane] = only.number | EMITTER;
    }
    let bounds = emitters.iter().fold(Bounds3::EMPTY, |b, e| b.union(&e.bounds()));
    let center = bounds.center();
    let radius =
        emitters.iter().map(|e| (e.center - center).length() + e.radius).fold(0.0, f32::max);
    let is_two_sided = emitters.iter().any(|e| e.is_two_sided);
    let sum = emitters.iter().fold(Vec3::ZERO, |sum, e| sum + e.axis * e.intensity);
    let axis = sum.try_normalize().unwrap_or(emitters[0].axis);
    // Unit vectors are rounded, so the cosine gets a margin.
    let least = emitters.iter().map(|e| e.axis.dot(axis)).fold(1.0, f32::min)
        - if emitters.len() > 1 { 1e-6 } else { 0.0 };
    let widest = emitters.iter().map(|e| e.cos_spread).fold(1.0, f32::min);
    let cos_spread = if widest == 1.0 {
        least.max(-1.0)
    } else {
        real::cos((angle(least) + angle(widest)).min(PI))
    };
    for k in 0..3 {
        node.center[k][lane] = center[k];
        node.axis[k][lane] = axis[k];
    }
    node.radius[lane] = radius * (1.0 + 1e-6);
    node.cos_spread[lane] = cos_spread;
    node.sin_spread[lane] = sin_from_cos(cos_spread);
    node.cos_emission[lane] = emitters.iter().map(|e| e.cos_emission).fold(1.0, f32::min);
    node.side[lane] = if is_two_sided { -1.0 } else { 1.0 };
    node.intensity[lane] = emitters.iter().map(|e| e.intensity).sum();
}
