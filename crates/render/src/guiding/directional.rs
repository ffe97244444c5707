//! The distribution of light by direction, learnt from weighted directions: quadtrees over the
//! equal-area cylindrical map (Müller, Gross and Novák, Practical Path Guiding for Efficient
//! Light-Transport Simulation, 2017, section 3.2).

use super::density::Density;
use snell_math::rng::ONE_MINUS_EPSILON;
use snell_math::simd::{max, min};
use snell_math::{Vec2, Vec3, angles};
use std::f32::consts::TAU;

/// A quad with more than this fraction of the light is divided.
const SHARE: f32 = 0.01;
/// The number of levels of a tree: the smallest quads have sides of `2^-MAX_DEPTH`.
const MAX_DEPTH: u32 = 16;
/// The largest number of nodes of a tree.
const MAX_NODES: usize = 256;

/// The point of the unit square that stands for a unit direction. Equal areas correspond to equal
/// solid angles.
#[inline(always)]
pub fn square_from_direction(d: Vec3) -> Vec2 {
    let turn = angles::atan2(d.y, d.x) * (1.0 / TAU);
    let x = if turn < 0.0 { turn + 1.0 } else { turn };
    let inside = |x: f32| min(max(x, 0.0), ONE_MINUS_EPSILON);
    Vec2::new(inside(x), inside((d.z + 1.0) * 0.5))
}

/// The unit direction that a point of the unit square stands for.
#[inline(always)]
pub fn direction_from_square(p: Vec2) -> Vec3 {
    let z = p.y * 2.0 - 1.0;
    let r = max(1.0 - z * z, 0.0).sqrt();
    let (sin, cos) = angles::sin_cos(f64::from(p.x * TAU));
    Vec3::new(r * cos as f32, r * sin as f32, z)
}

/// Steps into the quadrant of `p`: returns the quadrant's number (x is the lowest bit, then y) and
/// maps `p` from the quadrant to the unit square.
fn quadrant(p: &mut Vec2) -> usize {
    let doubled = *p * 2.0;
    let (right, upper) = (doubled.x >= 1.0, doubled.y >= 1.0);
    *p = doubled - Vec2::new(f32::from(right), f32::from(upper));
    usize::from(right) + 2 * usize::from(upper)
}

/// A node of a quadtree, with four quadrants that may be divided further.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Node {
    /// Light in each quadrant.
    pub light: [f32; 4],
    /// The node of each quadrant; 0 if it is not divided.
    pub children: [u32; 4],
}

/// The distribution of light over directions, as fractions in a quadtree.
#[derive(Clone, Debug, PartialEq)]
pub struct Shares {
    /// The nodes; `light` holds the fraction of the node's light in each quadrant, times 4.
    nodes: Vec<Node>,
}

impl Shares {
    /// The density of directions that is proportional to the light.
    pub fn density(&self) -> Density {
        Density::new(&self.nodes)
    }
}

/// The quantity that is gathered in each quad.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// Light. The density becomes proportional to it.
    First,
    /// The square of light. The density of a quad becomes proportional to the square root of the
    /// mean square, which minimises the variance where light is noisy or finer than quads (Rath et
    /// al., Variance-aware path guiding, 2020, section 4).
    Second,
}

/// Gathers light by direction, in quads that are adapted to the light of earlier passes.
#[derive(Clone, Debug)]
pub struct Gatherer {
    nodes: Vec<Node>,
    /// The previous distribution: the fraction of light in each undivided quad; empty if there is
    /// no previous distribution.
    known: Vec<[f32; 4]>,
}

impl Default for Gatherer {
    fn default() -> Self {
        Self { nodes: vec![Node::default()], known: Vec::new() }
    }
}

impl Gatherer {
    /// Adds light from a direction. The point of the direction is first moved by up to half of the
    /// width of its quad, according to `u`, which smooths between neighbouring quads.
    pub fn add(&mut self, direction: Vec3, light: f32, u: Vec2) {
        let point = square_from_direction(direction);
        let (_, _, size) = self.find(point);
        let moved = point + (u - 0.5) * size;
        // A moved point wraps around the cylinder, and is reflected at the cylinder's ends.
        let y = if moved.y < 0.0 {
            -moved.y
        } else if moved.y >= 1.0 {
            2.0 - moved.y
        } else {
            moved.y
        };
        let moved = Vec2::new(moved.x - moved.x.floor(), y)
            .clamp(Vec2::ZERO, Vec2::splat(ONE_MINUS_EPSILON));
        let (node, quadrant, _) = self.find(moved);
        self.nodes[node].light[quadrant] += light;
    }

    /// The undivided quad of a point: its node, its quadrant in the node, and its width.
    fn find(&self, mut point: Vec2) -> (usize, usize, f32) {
        let (mut node, mut size) = (0, 0.5);
        loop {
            let quadrant = quadrant(&mut point);
            match self.nodes[node].children[quadrant] {
                0 => return (node, quadrant, size),
                child => node = child as usize,
            }
            size *= 0.5;
        }
    }

    /// The distribution of the gathered light and, with weight `trust` in `[0, 1]`, of the previous
    /// distribution; `None` if the sum is zero or not finite.
    pub fn shares(&self, moment: Moment, trust: f32) -> Option<Shares> {
        let mut nodes = self.nodes.clone();
        if moment == Moment::Second {
            take_roots(&mut nodes);
        }
        let gathered: f32 = nodes.iter().flat_map(|n| n.light).sum();
        if !self.known.is_empty() {
            let (old, new) =
                if gathered > 0.0 { (trust, (1.0 - trust) / gathered) } else { (1.0, 0.0) };
            for (node, known) in nodes.iter_mut().zip(&self.known) {
                node.light = std::array::from_fn(|q| node.light[q] * new + known[q] * old);
            }
        }
        // Children come after their parents, so their sums are complete first.
        for i in (0..nodes.len()).rev() {
            for q in 0..4 {
                if nodes[i].children[q] != 0 {
                    nodes[i].light[q] = nodes[nodes[i].children[q] as usize].light.iter().sum();
                }
            }
        }
        let total: f32 = nodes[0].light.iter().sum();
        if !(total.is_finite() && total > 0.0) {
            return None;
        }
        for node in &mut nodes {
            let sum: f32 = node.light.iter().sum();
            // Nodes without light are never chosen, but their density must still be a number.
            node.light = node.light.map(|x| if sum > 0.0 { 4.0 * (x / sum) } else { 1.0 });
        }
        Some(Shares { nodes })
    }

    /// An empty gatherer whose quads are adapted to the distribution: quads with much light are
    /// divided, and those with little light are merged.
    pub fn suited_to(shares: &Shares) -> Self {
        // Each entry of the queue is a new node, the old node in its place if there is one, its
        // fraction of all light, and its depth.
        let (mut nodes, mut known) = (vec![Node::default()], vec![[0.0; 4]]);
        let mut queue = std::collections::VecDeque::from([(0, Some(0), 1.0, 1)]);
        while let Some((new, old, share, depth)) = queue.pop_front() {
            for q in 0..4 {
                let (quad_share, child) = match old {
                    None => (share * 0.25, 0),
                    Some(old) => {
                        let Node { light, children } = shares.nodes[old];
                        (share * 0.25 * light[q], children[q] as usize)
                    }
                };
                if quad_share > SHARE && depth < MAX_DEPTH && nodes.len() < MAX_NODES {
                    nodes[new].children[q] = nodes.len() as u32;
                    queue.push_back((
                        nodes.len(),
                        (child != 0).then_some(child),
                        quad_share,
                        depth + 1,
                    ));
                    nodes.push(Node::default());
                    known.push([0.0; 4]);
                } else {
                    known[new][q] = quad_share;
                }
            }
        }
        Self { nodes, known }
    }
}

/// Replaces the sum of squares in each undivided quad by the root that counts as the quad's light.
fn take_roots(nodes: &mut [Node]) {
    let mut area = vec![0.25; nodes.len()];
    for i in 0..nodes.len() {
        for q in 0..4 {
            match nodes[i].children[q] {
                0 => nodes[i].light[q] = (nodes[i].light[q] * area[i]).sqrt(),
                child => area[child as usize] = area[i] * 0.25,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng::uniform2;

    #[test]
    fn the_map_of_the_sphere_and_back_is_the_identity() {
        for i in 0..10_000 {
            let p = uniform2([i, 1, 2, 3]);
            let direction = direction_from_square(p);
            assert!((direction.length() - 1.0).abs() < 1e-6);
            let back = square_from_direction(direction);
            let pole = direction.truncate().length() < 1e-3;
            assert!(pole || (back - p).abs().max_element() < 1e-4, "{p} {back}");
        }
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            assert!(
                (direction_from_square(square_from_direction(axis)) - axis).length() < 2e-3,
                "{axis}"
            );
        }
    }

    #[test]
    fn nothing_gathered_is_no_density() {
        assert!(Gatherer::default().shares(Moment::First, 0.5).is_none());
        let mut spoilt = Gatherer::default();
        spoilt.add(Vec3::X, f32::NAN, Vec2::splat(0.5));
        assert!(spoilt.shares(Moment::First, 0.5).is_none());
    }
}
