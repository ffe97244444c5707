//! Samples a [`LightBvh`] for batches of receivers, with the same bits as for single ones.

use super::bvh::{EMITTER, LightBvh, NONE, Node, WIDTH, choose, importance};
use super::{ChosenLight, Receiver};
use snell_math::Vec3;
use snell_math::rng::ONE_MINUS_EPSILON;
use snell_math::simd::{mask_select, min};

/// The number of receivers of a batch.
pub const BATCH: usize = 64;

/// The lights chosen for the receivers of a batch.
#[derive(Clone, Debug)]
pub struct ChosenLights {
    /// [`ChosenLight::light`]; [`NONE`] if no light was chosen, and then the other fields are
    /// arbitrary.
    pub light: [u32; BATCH],
    /// [`ChosenLight::part`]; [`NONE`] if no part was chosen.
    pub part: [u32; BATCH],
    /// [`ChosenLight::probability`].
    pub probability: [f32; BATCH],
}

impl Default for ChosenLights {
    fn default() -> Self {
        Self { light: [NONE; BATCH], part: [NONE; BATCH], probability: [0.0; BATCH] }
    }
}

impl ChosenLights {
    /// The choice for receiver `i`.
    pub fn get(&self, i: usize) -> Option<ChosenLight> {
        let (light, part, probability) = (self.light[i], self.part[i], self.probability[i]);
        let part = (part != NONE).then_some(part);
        (light != NONE).then_some(ChosenLight { light: light as usize, part, probability })
    }

    #[inline(always)]
    pub(super) fn put(&mut self, i: usize, chosen: Option<ChosenLight>) {
        let Some(ChosenLight { light, part, probability }) = chosen else {
            self.light[i] = NONE;
            return;
        };
        (self.light[i], self.part[i], self.probability[i]) =
            (light as u32, part.unwrap_or(NONE), probability);
    }
}

/// The receivers of a batch; vectors are stored by axis.
#[derive(Clone, Copy, Debug)]
pub struct Receivers<'a> {
    /// See [`Receiver::position`].
    pub position: &'a [[f32; BATCH]; 3],
    /// See [`Receiver::normal`].
    pub normal: &'a [[f32; BATCH]; 3],
    /// See [`Receiver::transmits`].
    pub transmits: &'a [bool; BATCH],
}

impl<'a> Receivers<'a> {
    /// Receivers that do not transmit light.
    pub fn opaque(position: &'a [[f32; BATCH]; 3], normal: &'a [[f32; BATCH]; 3]) -> Self {
        Self { position, normal, transmits: &[false; BATCH] }
    }

    /// Receiver `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Receiver {
        let at = |v: &[[f32; BATCH]; 3]| Vec3::new(v[0][i], v[1][i], v[2][i]);
        Receiver {
            position: at(self.position),
            normal: at(self.normal),
            transmits: self.transmits[i],
        }
    }
}

/// The body of [`LightBvh::sample_batch`], compiled for each SIMD level.
#[inline(always)]
pub(super) fn sample_batch(
    tree: &LightBvh,
    receivers: &Receivers,
    u: &[f32; BATCH],
    count: usize,
    chosen: &mut ChosenLights,
) {
    match tree.nodes.as_slice() {
        [root] if tree.beside.is_empty() => sample_few(tree, root, receivers, u, chosen),
        [] => {
            for (i, &u) in u.iter().enumerate().take(count) {
                chosen.put(i, tree.choose_beside(u, 0.0));
            }
        }
        [root, ..] => descend(tree, root, receivers, u, count.min(BATCH), chosen),
    }
}

/// Chooses lights for receivers that descend the tree level by level. At each level the importance
/// of the children is computed for all receivers before children are chosen, so that no receiver
/// waits for its own results.
#[inline(always)]
fn descend(
    tree: &LightBvh,
    root: &Node,
    receivers: &Receivers,
    u: &[f32; BATCH],
    count: usize,
    chosen: &mut ChosenLights,
) {
    let mut local =
        [Receiver { position: Vec3::ZERO, normal: Vec3::ZERO, transmits: false }; BATCH];
    let mut weights = [[0.0; WIDTH]; BATCH];
    // The numbers of the receivers that are at a node, and the node of each receiver.
    let (mut under_way, mut node) = ([0; BATCH], [0; BATCH]);
    let (mut u, mut probability) = (*u, [1.0; BATCH]);
    // The child that each receiver has chosen last.
    let mut child = [NONE; BATCH];
    for i in 0..count {
        local[i] = tree.local(&receivers.get(i));
        weights[i] = importance(root, &local[i]);
    }
    let mut left = 0;
    for i in 0..count {
        if !tree.beside.is_empty() {
            probability[i] = tree.share_of_tree(&weights[i]);
        }
        if u[i] >= probability[i] {
            chosen.put(i, tree.choose_beside(u[i], probability[i]));
            continue;
        }
        u[i] = min(u[i] / probability[i], ONE_MINUS_EPSILON);
        weights[left] = weights[i];
        under_way[left] = i;
        left += 1;
    }
    let in_tree = (under_way, left);
    loop {
        let mut kept = 0;
        for at in 0..left {
            let i = under_way[at] % BATCH;
            let (slot, of_slot, rest) = choose(&weights[at], u[i]);
            let next = if of_slot.is_nan() { NONE } else { tree.nodes[node[i]].child[slot] };
            (probability[i], u[i], child[i]) = (probability[i] * of_slot, rest, next);
            let is_node = next & EMITTER == 0;
            node[i] = if is_node { next as usize } else { 0 };
            under_way[kept % BATCH] = i;
            kept += usize::from(is_node);
        }
        left = kept;
        if left == 0 {
            break;
        }
        for at in 0..left {
            let i = under_way[at] % BATCH;
            weights[at] = importance(&tree.nodes[node[i]], &local[i]);
        }
    }
    for &i in &in_tree.0[..in_tree.1] {
        if child[i] == NONE {
            chosen.light[i] = NONE;
            continue;
        }
        (chosen.light[i], chosen.part[i]) = tree.emitters[(child[i] & !EMITTER) as usize];
        chosen.probability[i] = probability[i];
    }
}

/// [`sample_batch`] for trees whose lights are all children of the root: the lanes are receivers
/// instead of children.
#[inline(always)]
fn sample_few(
    tree: &LightBvh,
    root: &Node,
    receivers: &Receivers,
    u: &[f32; BATCH],
    chosen: &mut ChosenLights,
) {
    let mut weights = [[0.0; BATCH]; WIDTH];
    let mut total = [0.0; BATCH];
    for (child, weights) in
        weights.iter_mut().enumerate().filter(|(child, _)| root.child[*child] != NONE)
    {
        let lane = root.lane(child);
        for i in 0..BATCH {
            weights[i] = lane.importance(&tree.local(&receivers.get(i)));
            total[i] += weights[i];
        }
    }
    let (mut found, mut before, mut over) = ([0.0; BATCH], [0.0; BATCH], [0; BATCH]);
    let mut next = [0; BATCH];
    chosen.light = [NONE; BATCH];
    for (child, weights) in root.child.iter().zip(&weights).filter(|(child, _)| **child != NONE) {
        let (light, part) = tree.emitters[(child & !EMITTER) as usize];
        for i in 0..BATCH {
            let weight = weights[i];
            let is_next = (weight > 0.0) & (over[i] == 0);
            next[i] = u32::from(is_next);
            over[i] |=
                u32::from(is_next & (min(u[i], ONE_MINUS_EPSILON) * total[i] < before[i] + weight));
            before[i] += if is_next { weight } else { 0.0 };
        }
        for i in 0..BATCH {
            chosen.light[i] = mask_select(next[i], light, chosen.light[i]);
            chosen.part[i] = mask_select(next[i], part, chosen.part[i]);
            found[i] = mask_select(next[i], weights[i], found[i]);
        }
    }
    for i in 0..BATCH {
        chosen.probability[i] = found[i] / total[i];
    }
}
