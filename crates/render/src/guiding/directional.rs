//! Densities on the sphere that are learnt from weighted directions: quadtrees over the equal-area cylindrical map (Müller, Gross
//! and Novák, Practical Path Guiding for Efficient Light-Transport Simulation, 2017, section 3.2).

use snell_math::rng::ONE_MINUS_EPSILON;
use snell_math::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// A quad with more than this share of the light is divided.
const SHARE: f32 = 0.01;
/// Divisions of the square along each side are at most 2 to this power.
const MAX_DEPTH: u32 = 16;
/// No more nodes than this in one tree.
const MAX_NODES: usize = 256;

/// The point of the unit square that stands for a unit direction. Equal areas stand for equal solid angles.
pub fn square_from_direction(d: Vec3) -> Vec2 {
    let turn = d.y.atan2(d.x) / TAU;
    let x = if turn < 0.0 { turn + 1.0 } else { turn };
    Vec2::new(x, (d.z + 1.0) * 0.5).clamp(Vec2::ZERO, Vec2::splat(ONE_MINUS_EPSILON))
}

/// The unit direction of a point of the unit square.
pub fn direction_from_square(p: Vec2) -> Vec3 {
    let z = p.y * 2.0 - 1.0;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (p.x * TAU).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// Density per steradian of a density of 1 on the square.
const SQUARE_TO_SPHERE: f32 = 1.0 / (4.0 * PI);

/// Steps into the quadrant of `p`: its number (x first, then y), with `p` scaled to it.
fn quadrant(p: &mut Vec2) -> usize {
    let doubled = *p * 2.0;
    let (right, upper) = (doubled.x >= 1.0, doubled.y >= 1.0);
    *p = doubled - Vec2::new(f32::from(right), f32::from(upper));
    usize::from(right) + 2 * usize::from(upper)
}

/// Four quadrants, each of which may have a node of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Node {
    /// Light in each quadrant; in a [`Density`] shares of the node's, times 4.
    light: [f32; 4],
    /// The node of each quadrant; 0 if it is not divided.
    children: [u32; 4],
}

/// A piecewise constant density on the sphere, to sample from.
#[derive(Clone, Debug, PartialEq)]
pub struct Density {
    nodes: Vec<Node>,
}

impl Density {
    /// Draws a unit direction; gives it with its density per steradian.
    pub fn sample(&self, mut u: Vec2) -> (Vec3, f32) {
        let (mut corner, mut size, mut pdf, mut node) = (Vec2::ZERO, 1.0, SQUARE_TO_SPHERE, 0);
        loop {
            let Node { light: [a, b, c, d], children } = self.nodes[node];
            let right = choose(&mut u.x, a + c, b + d);
            let upper = if right { choose(&mut u.y, b, d) } else { choose(&mut u.y, a, c) };
            let chosen = usize::from(right) + 2 * usize::from(upper);
            size *= 0.5;
            corner += Vec2::new(f32::from(right), f32::from(upper)) * size;
            pdf *= [a, b, c, d][chosen];
            if children[chosen] == 0 {
                return (direction_from_square(corner + u * size), pdf);
            }
            node = children[chosen] as usize;
        }
    }

    /// Density per steradian of a unit direction.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let (mut p, mut pdf, mut node) = (square_from_direction(direction), SQUARE_TO_SPHERE, 0);
        loop {
            let quadrant = quadrant(&mut p);
            pdf *= self.nodes[node].light[quadrant];
            match self.nodes[node].children[quadrant] {
                0 => return pdf,
                child => node = child as usize,
            }
        }
    }

    /// Bytes in memory.
    pub fn memory_bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>()
    }
}

/// Chooses between two weights by `u`, which becomes a fresh number. True for the second.
fn choose(u: &mut f32, first: f32, second: f32) -> bool {
    let share = first / (first + second);
    let is_second = second > 0.0 && *u >= share;
    let fresh = if is_second { (*u - share) / (1.0 - share) } else { *u / share };
    *u = fresh.clamp(0.0, ONE_MINUS_EPSILON);
    is_second
}

/// What is gathered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// Light: the density becomes proportional to it.
    First,
    /// Squares of light: the density of a quad becomes proportional to the square root of their mean, which is best for the variance
    /// where light is noisy or finer than quads (Rath et al., Variance-aware path guiding, 2020, section 4).
    Second,
}

/// What gathers light by direction. Its quads are those that the light found so far asked for.
#[derive(Clone, Debug)]
pub struct Gatherer {
    nodes: Vec<Node>,
    /// What was known before: the share of all light in each undivided quad. Empty if nothing was.
    known: Vec<[f32; 4]>,
}

impl Default for Gatherer {
    fn default() -> Self {
        Self { nodes: vec![Node::default()], known: Vec::new() }
    }
}

impl Gatherer {
    /// Adds light from a direction. The direction is first moved by up to half of the width of its quad, as `u` says: what is
    /// found in one quad tells something of its neighbours.
    pub fn add(&mut self, direction: Vec3, light: f32, u: Vec2) {
        let point = square_from_direction(direction);
        let (_, _, size) = self.find(point);
        let moved = point + (u - 0.5) * size;
        // Around the cylinder, and not beyond its ends.
        let y = if moved.y < 0.0 {
            -moved.y
        } else if moved.y >= 1.0 {
            2.0 - moved.y
        } else {
            moved.y
        };
        let moved = Vec2::new(moved.x - moved.x.floor(), y).clamp(Vec2::ZERO, Vec2::splat(ONE_MINUS_EPSILON));
        let (node, quadrant, _) = self.find(moved);
        self.nodes[node].light[quadrant] += light;
    }

    /// The undivided quad of a point: node, quadrant, width.
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

    /// The density of what was gathered, and of what was known before with weight `trust` in `[0, 1]`; `None` if both are nothing, or
    /// not finite.
    pub fn density(&self, moment: Moment, trust: f32) -> Option<Density> {
        let mut nodes = self.nodes.clone();
        if moment == Moment::Second {
            take_roots(&mut nodes);
        }
        let gathered: f32 = nodes.iter().flat_map(|n| n.light).sum();
        if !self.known.is_empty() {
            let (old, new) = if gathered > 0.0 { (trust, (1.0 - trust) / gathered) } else { (1.0, 0.0) };
            for (node, known) in nodes.iter_mut().zip(&self.known) {
                node.light = std::array::from_fn(|q| node.light[q] * new + known[q] * old);
            }
        }
        // Children come after their parents.
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
            // Nodes without light are never entered; their density must still be a number.
            node.light = node.light.map(|x| if sum > 0.0 { 4.0 * (x / sum) } else { 1.0 });
        }
        Some(Density { nodes })
    }

    /// An empty gatherer whose quads suit a density: those with much light divided, those with little joined.
    pub fn suited_to(density: &Density) -> Self {
        // Node to make from: the old one if there is one; its share of all light.
        let (mut nodes, mut known) = (vec![Node::default()], vec![[0.0; 4]]);
        let mut queue = std::collections::VecDeque::from([(0, Some(0), 1.0, 1)]);
        while let Some((new, old, share, depth)) = queue.pop_front() {
            for q in 0..4 {
                let (quad_share, child) = match old {
                    None => (share * 0.25, 0),
                    Some(old) => {
                        let Node { light, children } = density.nodes[old];
                        (share * 0.25 * light[q], children[q] as usize)
                    }
                };
                if quad_share > SHARE && depth < MAX_DEPTH && nodes.len() < MAX_NODES {
                    nodes[new].children[q] = nodes.len() as u32;
                    queue.push_back((nodes.len(), (child != 0).then_some(child), quad_share, depth + 1));
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

/// From sums of squares over undivided quads to what their light counts for.
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
    use snell_math::statistics::{chi_squared_deviation, sidak_deviation};

    /// Light from one corner of the sky and a little from everywhere, gathered in rounds.
    fn learnt(rounds: u32) -> Density {
        let sun = Vec3::new(0.3, -0.4, 0.866).normalize();
        let mut gatherer = Gatherer::default();
        let mut density = None;
        for round in 0..rounds {
            for i in 0..4000 {
                let [u, jitter] = [0, 1].map(|k| uniform2([i, round, k, 9]));
                let direction = snell_math::sampling::uniform_sphere(u);
                let light = 0.01 + 50.0 * f32::from(direction.dot(sun) > 0.995);
                gatherer.add(direction, light, jitter);
            }
            density = gatherer.density(Moment::First, 0.0);
            gatherer = Gatherer::suited_to(density.as_ref().expect("there is light"));
        }
        density.expect("there was a round")
    }

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
            assert!((direction_from_square(square_from_direction(axis)) - axis).length() < 2e-3, "{axis}");
        }
    }

    #[test]
    fn samples_have_the_density_that_is_stated() {
        let density = learnt(5);
        for i in 0..20_000 {
            let (direction, pdf) = density.sample(uniform2([i, 5, 5, 5]));
            let stated = density.pdf(direction);
            // A direction on the border of a quad may round into the next.
            if (pdf - stated).abs() > 1e-3 * pdf {
                let moved = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z]
                    .map(|a| density.pdf((direction + a * 1e-5).normalize()));
                assert!(moved.iter().any(|m| (m - pdf).abs() < 1e-3 * pdf), "{pdf} {stated}");
            }
        }
    }

    /// The integral of a density over cells of the square: quads lie within cells, or cover whole ones.
    fn shares(density: &Density, rows: usize, columns: usize) -> Vec<f64> {
        let mut shares = vec![0.0; rows * columns];
        let mut open = vec![(0_usize, [0.0_f64; 2], 1.0_f64, 1.0_f64)];
        while let Some((node, corner, size, share)) = open.pop() {
            let size = size * 0.5;
            for q in 0..4 {
                let corner = [corner[0] + size * (q % 2) as f64, corner[1] + size * (q / 2) as f64];
                let share = share * f64::from(density.nodes[node].light[q]) * 0.25;
                match density.nodes[node].children[q] {
                    0 => spread(&mut shares, rows, columns, corner, size, share),
                    child => open.push((child as usize, corner, size, share)),
                }
            }
        }
        shares
    }

    fn spread(shares: &mut [f64], rows: usize, columns: usize, corner: [f64; 2], size: f64, share: f64) {
        let covered = |at: f64, cells: usize| {
            let first = (at * cells as f64) as usize;
            first..first + ((size * cells as f64) as usize).max(1)
        };
        let (x, y) = (covered(corner[0], columns), covered(corner[1], rows));
        let each = share / (x.len() * y.len()) as f64;
        for row in y {
            x.clone().for_each(|column| shares[row * columns + column] += each);
        }
    }

    /// Counts against the integral of the density over cells of the sphere, with a bound that holds for all cells together.
    #[test]
    fn samples_are_distributed_as_the_density_says_by_chi_squared() {
        let (rows, columns, n) = (16usize, 32usize, 400_000u32);
        for rounds in [1, 3, 6] {
            let density = learnt(rounds);
            let mut counts = vec![0u32; rows * columns];
            for i in 0..n {
                let (direction, _) = density.sample(uniform2([i, rounds, 5, 7]));
                let p = square_from_direction(direction);
                counts[(p.y * rows as f32) as usize * columns + (p.x * columns as f32) as usize] += 1;
            }
            let expected: Vec<f64> =
                shares(&density, rows, columns).into_iter().map(|share| share * f64::from(n)).collect();
            let deviation = chi_squared_deviation(&counts, &expected);
            assert!(deviation < sidak_deviation(0.01, 3), "{rounds} rounds: {deviation} standard deviations");
        }
    }

    #[test]
    fn a_small_sun_is_found() {
        let sun = Vec3::new(0.3, -0.4, 0.866).normalize();
        let density = learnt(7);
        // The sun has 97 % of the light, on 0.25 % of the sphere.
        let toward = (0..1000).filter(|&i| density.sample(uniform2([i, 1, 1, 1])).0.dot(sun) > 0.98).count();
        assert!(toward > 800, "{toward}");
    }

    #[test]
    fn nothing_gathered_is_no_density() {
        assert!(Gatherer::default().density(Moment::First, 0.5).is_none());
        let mut spoilt = Gatherer::default();
        spoilt.add(Vec3::X, f32::NAN, Vec2::splat(0.5));
        assert!(spoilt.density(Moment::First, 0.5).is_none());
    }
}
