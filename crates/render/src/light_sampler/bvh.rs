//! A light BVH: a tree over all lights that have a place and over all triangles of emissive
//! surfaces. It is descended with one random number, by the importance of each branch, an estimate
//! of what it contributes to the receiver (Conty Estevez and Kulla, Importance Sampling of Many
//! Lights with Adaptive Tree Splitting, 2018; the importance is that of Pharr, Jakob and Humphreys,
//! 4th edition, section 12.6.3).
//!
//! Nodes have up to eight children, whose importance is computed at once. Positions are bounded by
//! spheres, directions by cones. Lights without a place (the environment, the sun) are in a table
//! beside the tree.

use super::batch::{BATCH, ChosenLights, Receivers, sample_batch};
use super::build;
use super::cone::{cos_of_difference, sin_from_cos, sin_of_difference};
use super::table::LightTable;
use super::{ChosenLight, LightSummary, Receiver};
use snell_math::rng::ONE_MINUS_EPSILON;
use snell_math::simd::{Wide, max, min};
use snell_math::{Vec3, at_level};

/// The number of children of a node.
pub const WIDTH: usize = 8;
/// Stands for no child, light or part.
pub const NONE: u32 = u32::MAX;
/// The bit of a child that is an emitter and not a node.
pub const EMITTER: u32 = 1 << 31;
/// The largest coordinate of receivers in units of the tree. Receivers farther away are moved
/// there.
const FAR: f32 = 1e12;
/// Margin for rounding, in cosines, before a branch counts as dark.
const SLACK: f32 = 1e-4;

/// A node, with its children in lanes. Lengths are in units of the tree.
#[derive(Clone, Debug)]
pub struct Node {
    /// Centre of the sphere around each child.
    pub center: [[f32; WIDTH]; 3],
    /// Radius of the sphere around each child.
    pub radius: [f32; WIDTH],
    /// Axis of the cone of each child's main directions.
    pub axis: [[f32; WIDTH]; 3],
    /// Cosine of that cone's half-angle.
    pub cos_spread: [f32; WIDTH],
    /// Sine of that cone's half-angle.
    pub sin_spread: [f32; WIDTH],
    /// Cosine of the angle from the cone up to which light is emitted.
    pub cos_emission: [f32; WIDTH],
    /// -1 if the opposite direction counts too, otherwise 1.
    pub side: [f32; WIDTH],
    /// Radiant intensity relative to the strongest emitter; 0 where there is no child.
    pub intensity: [f32; WIDTH],
    /// The number of a node, the number of an emitter with the bit [`EMITTER`], or [`NONE`].
    pub child: [u32; WIDTH],
    /// The node above this one; [`NONE`] for the root.
    pub parent: u32,
    /// The lane of this node in its parent; [`NONE`] for the root.
    pub slot: u32,
}

/// The tree, with the table of lights beside it.
#[derive(Debug)]
pub struct LightBvh {
    pub(super) nodes: Vec<Node>,
    /// The light and part of each emitter.
    pub(super) emitters: Vec<(u32, u32)>,
    /// The place of each emitter in the tree: `node * WIDTH + slot`.
    places: Vec<u32>,
    /// The number of the first emitter of each light; [`NONE`] for lights beside the tree.
    first: Vec<u32>,
    /// The lights beside the tree.
    pub(super) beside: Vec<u32>,
    /// The table that chooses among the lights beside the tree.
    table: LightTable,
    /// The position in `beside` of each light; [`NONE`] for lights in the tree.
    entry: Vec<u32>,
    /// The probability of choosing the tree where both the tree and the lights beside it may
    /// contribute.
    tree_share: f32,
    /// The instructions for [`Node::importance`].
    wide: Option<Wide>,
    /// The origin of the tree's units: positions have it subtracted before they are scaled.
    origin: Vec3,
    /// Factor from world distances to units of the tree.
    scale: f32,
}

impl LightBvh {
    /// Builds the tree and the table.
    pub fn new(lights: &[LightSummary], wide: Option<Wide>) -> Self {
        let (mut emitters, mut first) = (Vec::new(), vec![NONE; lights.len()]);
        let (mut beside, mut entry) = (Vec::new(), vec![NONE; lights.len()]);
        for (number, light) in lights.iter().enumerate().filter(|(_, light)| light.is_sampled) {
            if light.parts.is_empty() {
                entry[number] = beside.len() as u32;
                beside.push(number as u32);
            } else {
                first[number] = emitters.len() as u32;
                emitters.extend((0..light.parts.len() as u32).map(|part| (number as u32, part)));
            }
        }
        let parts = lights.iter().filter(|light| light.is_sampled).flat_map(|light| &light.parts);
        let (normalized, origin, scale) = build::normalized(parts);
        let nodes = build::build(normalized);
        let in_tree = |i: &usize| first[*i] != NONE && !nodes.is_empty();
        let tree_power =
            (0..lights.len()).filter(in_tree).map(|i| lights[i].power).sum::<f64>().min(f64::MAX);
        let weights = mixed(
            std::iter::once(tree_power)
                .chain(beside.iter().map(|&i| lights[i as usize].power))
                .collect(),
        );
        let table = LightTable::new(&weights[1..]);
        let places = vec![NONE; emitters.len()];
        let tree_share = weights[0] as f32;
        let mut tree = Self {
            nodes,
            emitters,
            places,
            first,
            beside,
            table,
            entry,
            tree_share,
            wide,
            origin,
            scale,
        };
        tree.note_places();
        tree
    }

    fn note_places(&mut self) {
        for (n, node) in self.nodes.iter().enumerate() {
            for (slot, &child) in node.child.iter().enumerate() {
                if child != NONE && child & EMITTER != 0 {
                    self.places[(child & !EMITTER) as usize] = (n * WIDTH + slot) as u32;
                }
            }
        }
    }

    /// False if no random number is needed, because there is at most one light.
    pub fn has_choice(&self) -> bool {
        self.emitters.len() + self.beside.len() > 1
    }

    /// Samples a light. `u` returns a uniform number and is called only if there is a choice.
    pub fn sample(&self, receiver: &Receiver, u: impl FnOnce() -> f32) -> Option<ChosenLight> {
        let u = if self.has_choice() { u() } else { 0.0 };
        at_level!(
            self.wide,
            sample,
            (
                tree: &LightBvh = self,
                receiver: &Receiver = receiver,
                u: f32 = u
            ) -> Option<ChosenLight>
        )
    }

    /// Samples a light for each of the first `count` receivers.
    pub fn sample_batch(
        &self,
        receivers: &Receivers,
        u: &[f32; BATCH],
        count: usize,
        chosen: &mut ChosenLights,
    ) {
        at_level!(
            self.wide,
            sample_batch,
            (
                tree: &LightBvh = self,
                receivers: &Receivers = receivers,
                u: &[f32; BATCH] = u,
                count: usize = count,
                chosen: &mut ChosenLights = chosen,
            )
        );
    }

    /// The probability with which [`Self::sample`] chooses a part of a light.
    pub fn probability(&self, receiver: &Receiver, light: usize, part: u32) -> f32 {
        let Some(&first) = self.first.get(light) else { return 0.0 };
        let local = self.local(receiver);
        let of_tree = self.probability_of_tree(&local);
        if first == NONE {
            let entry = self.entry[light];
            return if entry == NONE {
                0.0
            } else {
                self.table.probability(entry as usize) * (1.0 - of_tree)
            };
        }
        let Some(&place) = self.places.get((first + part) as usize) else { return 0.0 };
        if place == NONE {
            return 0.0;
        }
        let mut probability = of_tree;
        let (mut node, mut slot) = (place as usize / WIDTH, place as usize % WIDTH);
        loop {
            let n = &self.nodes[node];
            probability *= share(&n.importance(&local, self.wide), slot);
            if n.parent == NONE || probability == 0.0 {
                return probability;
            }
            (node, slot) = (n.parent as usize, n.slot as usize);
        }
    }

    /// The probability of choosing the tree rather than a light beside it; 0 where no emitter can
    /// contribute.
    fn probability_of_tree(&self, local: &Receiver) -> f32 {
        match self.nodes.first() {
            None => 0.0,
            Some(_) if self.beside.is_empty() => 1.0,
            Some(root) => self.share_of_tree(&root.importance(local, self.wide)),
        }
    }

    /// [`Self::probability_of_tree`] if there are lights beside the tree, given the importance of
    /// the root's children.
    #[inline(always)]
    pub(super) fn share_of_tree(&self, weights: &[f32; WIDTH]) -> f32 {
        if weights.iter().any(|&w| w > 0.0) { self.tree_share } else { 0.0 }
    }

    /// Chooses a light beside the tree. `u` is a uniform number that is at least `of_tree`, the
    /// probability of choosing the tree.
    pub(super) fn choose_beside(&self, u: f32, of_tree: f32) -> Option<ChosenLight> {
        let rest = ((u - of_tree) / (1.0 - of_tree)).clamp(0.0, ONE_MINUS_EPSILON);
        let chosen = self.table.sample(|| rest)?;
        let light = self.beside[chosen.light] as usize;
        Some(ChosenLight { light, part: None, probability: chosen.probability * (1.0 - of_tree) })
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.emitters.len() * 8 + self.places.len() * 4
    }

    /// The receiver in units of the tree.
    #[inline(always)]
    pub(super) fn local(&self, receiver: &Receiver) -> Receiver {
        let position = (receiver.position - self.origin) * self.scale;
        Receiver { position: position.clamp(Vec3::splat(-FAR), Vec3::splat(FAR)), ..*receiver }
    }
}

/// Probabilities that are half uniform and half in proportion to power. In proportion to power
/// alone, a lamp indoors would hardly be sampled beside the sun.
fn mixed(powers: Vec<f64>) -> Vec<f64> {
    let count = powers.len() as f64;
    let strongest = powers.iter().copied().fold(0.0, f64::max);
    let total: f64 = powers.iter().map(|p| p / strongest).sum();
    let share = |p: f64| if strongest > 0.0 { p / strongest / total } else { 1.0 / count };
    powers.into_iter().map(|p| 0.5 / count + 0.5 * share(p)).collect()
}

impl Node {
    /// A node without children.
    pub fn new(parent: u32, slot: u32) -> Self {
        Self {
            center: [[0.0; WIDTH]; 3],
            radius: [0.0; WIDTH],
            axis: [[0.0; WIDTH]; 3],
            cos_spread: [-1.0; WIDTH],
            sin_spread: [0.0; WIDTH],
            cos_emission: [0.0; WIDTH],
            side: [1.0; WIDTH],
            intensity: [0.0; WIDTH],
            child: [NONE; WIDTH],
            parent,
            slot,
        }
    }

    #[inline(always)]
    pub(super) fn lane(&self, i: usize) -> Lane {
        Lane {
            center: [self.center[0][i], self.center[1][i], self.center[2][i]],
            radius: self.radius[i],
            axis: [self.axis[0][i], self.axis[1][i], self.axis[2][i]],
            cos_spread: self.cos_spread[i],
            sin_spread: self.sin_spread[i],
            cos_emission: self.cos_emission[i],
            side: self.side[i],
            intensity: self.intensity[i],
        }
    }

    /// The importance of each child for the receiver, in arbitrary units; 0 if the child certainly
    /// contributes nothing.
    ///
    /// It is the intensity, multiplied by the cosine of the least angle between a main direction
    /// and the direction to the receiver, divided by the squared distance, and multiplied by the
    /// cosine of the least angle of incidence.
    fn importance(&self, receiver: &Receiver, wide: Option<Wide>) -> [f32; WIDTH] {
        at_level!(
            wide,
            importance,
            (node: &Node = self, receiver: &Receiver = receiver) -> [f32; WIDTH]
        )
    }
}

/// The body of [`LightBvh::sample`], compiled for each SIMD level.
#[inline(always)]
fn sample(tree: &LightBvh, receiver: &Receiver, u: f32) -> Option<ChosenLight> {
    let local = tree.local(receiver);
    let of_tree = tree.probability_of_tree(&local);
    let mut probability = of_tree;
    if u >= of_tree {
        return tree.choose_beside(u, of_tree);
    }
    let mut u = (u / of_tree).min(ONE_MINUS_EPSILON);
    let mut node = tree.nodes.first()?;
    loop {
        let weights = importance(node, &local);
        let (slot, of_slot, rest) = choose(&weights, u);
        if of_slot.is_nan() {
            return None;
        }
        probability *= of_slot;
        u = rest;
        let child = node.child[slot];
        if child & EMITTER == 0 {
            node = &tree.nodes[child as usize];
            continue;
        }
        let (light, part) = tree.emitters[(child & !EMITTER) as usize];
        return Some(ChosenLight { light: light as usize, part: Some(part), probability });
    }
}

/// One child of a node, with the fields of [`Node`].
pub(super) struct Lane {
    center: [f32; 3],
    radius: f32,
    axis: [f32; 3],
    cos_spread: f32,
    sin_spread: f32,
    cos_emission: f32,
    side: f32,
    intensity: f32,
}

/// Compiled for each SIMD level; see [`Node::importance`]. The loop has no branches, so it becomes
/// a few instructions for all lanes.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
pub(super) fn importance(node: &Node, receiver: &Receiver) -> [f32; WIDTH] {
    let mut importances = [0.0; WIDTH];
    for i in 0..WIDTH {
        importances[i] = node.lane(i).importance(receiver);
    }
    importances
}

impl Lane {
    /// The importance of this child; see [`Node::importance`].
    #[inline(always)]
    pub(super) fn importance(&self, receiver: &Receiver) -> f32 {
        let Receiver { position: p, normal: n, transmits } = *receiver;
        let in_medium = n == Vec3::ZERO;
        // The code uses that |x| is max(x, -x), and x is max(x, x).
        let incident_side = if transmits { -1.0 } else { 1.0 };
        let d = [p.x - self.center[0], p.y - self.center[1], p.z - self.center[2]];
        let squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let inverse = 1.0 / max(squared, 1e-30).sqrt();
        // The angle of the sphere around the child, as seen from the receiver.
        let r2 = self.radius * self.radius;
        let is_inside = squared <= r2 * 1.0001;
        let sin = self.radius * inverse;
        let cos = sin_from_cos(sin);
        let sin_b = if is_inside { 0.0 } else { sin };
        let cos_b = if is_inside { -1.0 } else { cos };
        // The angle between the cone of main directions and the direction to the receiver.
        let w = (self.axis[0] * d[0] + self.axis[1] * d[1] + self.axis[2] * d[2]) * inverse;
        let cos_w = min(max(w, w * self.side), 1.0);
        let sin_w = sin_from_cos(cos_w);
        let cos_x = cos_of_difference(sin_w, cos_w, self.sin_spread, self.cos_spread);
        let sin_x = sin_of_difference(sin_w, cos_w, self.sin_spread, self.cos_spread);
        let cos_e = cos_of_difference(sin_x, cos_x, sin_b, cos_b);
        let emits = if cos_e + SLACK >= self.cos_emission { max(cos_e, SLACK) } else { 0.0 };
        // The angle of incidence at the receiver.
        let c = -(n.x * d[0] + n.y * d[1] + n.z * d[2]) * inverse;
        let cos_n = min(max(max(c, c * incident_side), -1.0), 1.0);
        let cos_i = cos_of_difference(sin_from_cos(cos_n), cos_n, sin_b, cos_b) + SLACK;
        let incident = if in_medium { 1.0 } else { cos_i };
        let importance = self.intensity * emits * incident / max(max(squared, r2), 1e-30);
        if importance > 0.0 { importance } else { 0.0 }
    }
}

/// Chooses a child in proportion to its weight. Returns the child, its probability, and a new
/// uniform number made from `u`. The probability is NaN if all weights are 0. The function has no
/// branches, because the chosen child cannot be predicted.
#[inline(always)]
pub(super) fn choose(weights: &[f32; WIDTH], u: f32) -> (usize, f32, f32) {
    let mut sums = [0.0; WIDTH + 1];
    for i in 0..WIDTH {
        sums[i + 1] = sums[i] + weights[i];
    }
    let total = sums[WIDTH];
    let target = u * total;
    // The child is the first whose sum exceeds the target. If rounding leaves none, it is the last
    // with a weight.
    let (mut passed, mut last) = (0, 0);
    for sum in &sums[1..] {
        passed += usize::from(*sum <= target);
        last += usize::from(*sum < total);
    }
    let i = passed.min(last) % WIDTH;
    let rest = min(max((target - sums[i]) / weights[i], 0.0), ONE_MINUS_EPSILON);
    (i, weights[i] / total, rest)
}

/// The probability with which [`choose`] chooses a child.
fn share(weights: &[f32; WIDTH], slot: usize) -> f32 {
    if weights[slot] > 0.0 { weights[slot] / weights.iter().sum::<f32>() } else { 0.0 }
}
