//! Densities of directions to sample from. Quadtrees are stored as tables, so that neither sampling
//! a direction nor looking up its density walks a tree level by level.

use super::directional::{Node, direction_from_square, square_from_direction};
use serde::{Deserialize, Serialize};
use snell_math::{Vec2, Vec3};
use std::f32::consts::PI;

/// The number of bits of the random numbers that choose a quad. Probabilities are multiples of
/// `2^-DIGITS`, so that a quad is chosen exactly as often as its density states.
pub(super) const DIGITS: u32 = 24;
/// `2^DIGITS`, the number of different random numbers.
pub(super) const ONE: f32 = (1 << DIGITS) as f32;

/// The number of bits of coordinates on the square. The look-up of a quad uses two bits for each
/// table on the way.
pub(super) const COORDINATE_DIGITS: u32 = 16;

/// Marks an entry of a table as the number of a quad, not of a table.
const QUAD: u16 = 1 << 15;

/// A square of the map that is not divided further.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Quad {
    corner: [f32; 2],
    /// Length of the sides.
    size: f32,
    /// Density per steradian.
    pdf: f32,
}

/// A piecewise constant density on the sphere, to sample from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Density {
    quads: Vec<Quad>,
    /// The probability of the quads up to and including each, in units of `2^-DIGITS`.
    ends: Vec<u32>,
    /// `[0, 1)` is divided into equal parts, whose number is a power of two. For each part, this is
    /// the quad in which the part begins.
    starts: Vec<u16>,
    /// What lies in each of 4 x 4 squares, row by row: the number of a quad (marked with [`QUAD`])
    /// or of a further table.
    tables: Vec<[u16; 16]>,
}

impl Density {
    /// The density of a tree. The `light` of each node must hold the fractions of the node's light
    /// in the quadrants, times 4.
    pub(super) fn new(nodes: &[Node]) -> Self {
        let mut density =
            Self { quads: Vec::new(), ends: Vec::new(), starts: Vec::new(), tables: Vec::new() };
        let mut shares = Vec::new();
        density.add_table(nodes, 0, [0.0; 2], 1.0, 1.0, &mut shares);
        density.set_probabilities(&shares);
        density
    }

    /// Adds the table of a node, and the tables below it. Returns the table's number.
    fn add_table(
        &mut self,
        nodes: &[Node],
        node: usize,
        corner: [f32; 2],
        size: f32,
        share: f64,
        shares: &mut Vec<f64>,
    ) -> u16 {
        let number = self.tables.len();
        self.tables.push([0; 16]);
        for (outer, corner, child, share) in quadrants(&nodes[node], corner, size * 0.5, share) {
            let (x, y) = (outer % 2 * 2, outer / 2 * 2);
            if child == 0 {
                let quad = self.add_quad(corner, size * 0.5, share, shares);
                for cell in [0, 1, 4, 5] {
                    self.tables[number][y * 4 + x + cell] = quad;
                }
                continue;
            }
            for (inner, corner, child, share) in
                quadrants(&nodes[child], corner, size * 0.25, share)
            {
                let cell = (y + inner / 2) * 4 + x + inner % 2;
                self.tables[number][cell] = match child {
                    0 => self.add_quad(corner, size * 0.25, share, shares),
                    child => self.add_table(nodes, child, corner, size * 0.25, share, shares),
                };
            }
        }
        number as u16
    }

    /// True if a density that was read from a file can be sampled.
    pub(super) fn is_valid(&self) -> bool {
        let count = self.quads.len();
        let is_quad = |quad: &Quad| {
            let [x, y] = quad.corner;
            [x, y, quad.size].iter().all(|value| (0.0..=1.0).contains(value))
                && (0.0..=f32::MAX).contains(&quad.pdf)
        };
        let has_probabilities = self.ends.len() == count
            && self.ends.is_sorted()
            && self.ends.last() == Some(&(1 << DIGITS))
            && self.starts.len() == count.next_power_of_two()
            && self.starts.iter().all(|&quad| usize::from(quad) < count);
        let mut depths = vec![0; self.tables.len()];
        let mut are_tables = true;
        for (number, table) in self.tables.iter().enumerate() {
            for &entry in table {
                let at = usize::from(entry & !QUAD);
                match entry & QUAD {
                    0 if at > number && at < self.tables.len() => {
                        depths[at] = depths[number].max(depths[at] - 1) + 1;
                        are_tables &= depths[at] < COORDINATE_DIGITS as i32 / 2;
                    }
                    0 => are_tables = false,
                    _ => are_tables &= at < count,
                }
            }
        }
        !self.tables.is_empty() && are_tables && has_probabilities && self.quads.iter().all(is_quad)
    }

    fn add_quad(&mut self, corner: [f32; 2], size: f32, share: f64, shares: &mut Vec<f64>) -> u16 {
        self.quads.push(Quad { corner, size, pdf: 0.0 });
        shares.push(share);
        (self.quads.len() - 1) as u16 | QUAD
    }

    fn set_probabilities(&mut self, shares: &[f64]) {
        let total: f64 = shares.iter().sum();
        let (mut sum, mut end) = (0.0, 0);
        for (quad, share) in self.quads.iter_mut().zip(shares) {
            sum += share;
            let start = end;
            end = (sum / total * f64::from(ONE)).round() as u32;
            quad.pdf = (end - start) as f32 / ONE / (quad.size * quad.size * 4.0 * PI);
            self.ends.push(end);
        }
        let parts = self.quads.len().next_power_of_two();
        let mut quad = 0;
        for part in 0..parts {
            let start = ((part << DIGITS) / parts) as u32;
            while self.ends[quad] <= start {
                quad += 1;
            }
            self.starts.push(quad as u16);
        }
    }

    /// Samples a point of the [square](direction_from_square) that stands for the sampled
    /// direction. `choice` and `u` are three independent uniform numbers.
    #[inline]
    pub fn point(&self, choice: f32, u: Vec2) -> Vec2 {
        let Quad { corner, size, .. } = self.quads[self.quad(choice)];
        Vec2::from(corner) + u * size
    }

    /// Chooses a quad with its probability.
    #[inline]
    fn quad(&self, choice: f32) -> usize {
        let number = (choice * ONE) as u32;
        let part = (number as usize * self.starts.len()) >> DIGITS;
        let mut quad = usize::from(self.starts[part]);
        while self.ends[quad] <= number {
            quad += 1;
        }
        quad
    }

    /// Samples a unit direction. `choice` and `u` are three independent uniform numbers.
    pub fn sample(&self, choice: f32, u: Vec2) -> Vec3 {
        direction_from_square(self.point(choice, u))
    }

    /// Density per steradian of a unit direction.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        self.pdf_at(coordinates(square_from_direction(direction)))
    }

    /// Density per steradian of the direction with these [coordinates] in the square.
    #[inline]
    pub fn pdf_at(&self, [x, y]: [u32; 2]) -> f32 {
        let (mut table, mut digits) = (0, COORDINATE_DIGITS);
        loop {
            digits -= 2;
            let cell = (y >> digits & 3) * 4 + (x >> digits & 3);
            let found = self.tables[table][cell as usize];
            if found & QUAD != 0 {
                return self.quads[usize::from(found & !QUAD)].pdf;
            }
            table = usize::from(found);
        }
    }

    /// The tables with other entries: `quad` gives the entry for a quad of some density, and
    /// `table` the entry for the number of a table.
    pub(super) fn tables(
        &self,
        quad: impl Fn(f32) -> u32,
        table: impl Fn(u32) -> u32,
    ) -> impl Iterator<Item = [u32; 16]> {
        let entry = move |found: u16| match found & QUAD {
            0 => table(u32::from(found)),
            _ => quad(self.quads[usize::from(found & !QUAD)].pdf),
        };
        self.tables.iter().map(move |cells| cells.map(&entry))
    }

    /// The corner and size of each quad.
    pub(super) fn squares(&self) -> impl Iterator<Item = [f32; 3]> {
        self.quads.iter().map(|&Quad { corner: [x, y], size, .. }| [x, y, size])
    }

    /// For each part of `[0, 1)`, the quad in which it begins.
    pub(super) fn starts(&self) -> &[u16] {
        &self.starts
    }

    /// The cumulative probabilities of the quads, in units of `2^-DIGITS`.
    pub(super) fn ends(&self) -> &[u32] {
        &self.ends
    }

    /// Memory use in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.quads[..])
            + size_of_val(&self.ends[..])
            + size_of_val(&self.starts[..])
            + size_of_val(&self.tables[..])
    }
}

/// The four quadrants of a node: number, corner, child (0 if there is none) and fraction of all
/// light.
fn quadrants(
    node: &Node,
    corner: [f32; 2],
    size: f32,
    share: f64,
) -> impl Iterator<Item = (usize, [f32; 2], usize, f64)> {
    let Node { light, children } = *node;
    (0..4).map(move |q| {
        let at = [corner[0] + size * (q % 2) as f32, corner[1] + size * (q / 2) as f32];
        (q, at, children[q] as usize, share * 0.25 * f64::from(light[q]))
    })
}

/// The coordinates of a point of the square, for [`Density::pdf_at`].
#[inline(always)]
pub fn coordinates(point: Vec2) -> [u32; 2] {
    const SIDE: f32 = (1u32 << COORDINATE_DIGITS) as f32;
    // The conversion goes through signed integers, which wide registers support. Points lie in the
    // square, so the numbers are not negative.
    [(point.x * SIDE) as i32 as u32, (point.y * SIDE) as i32 as u32]
}

#[cfg(test)]
mod tests {
    use super::super::directional::{Gatherer, Moment};
    use super::*;
    use snell_math::rng::{to_unit, uniform2};
    use snell_math::statistics::{chi_squared_deviation, sidak_deviation};

    /// A density learnt in rounds from light in one corner of the sky and a little light from
    /// everywhere.
    fn learnt(rounds: u32) -> Density {
        let sun = Vec3::new(0.3, -0.4, 0.866).normalize();
        let mut gatherer = Gatherer::default();
        let mut shares = None;
        for round in 0..rounds {
            for i in 0..4000 {
                let [u, jitter] = [0, 1].map(|k| uniform2([i, round, k, 9]));
                let direction = snell_math::sampling::uniform_sphere(u);
                let light = 0.01 + 50.0 * f32::from(direction.dot(sun) > 0.995);
                gatherer.add(direction, light, jitter);
            }
            shares = gatherer.shares(Moment::First, 0.0);
            gatherer = Gatherer::suited_to(shares.as_ref().expect("there is light"));
        }
        shares.expect("there was a round").density()
    }

    fn sample(density: &Density, i: u32, seed: u32) -> Vec3 {
        density.sample(uniform2([i, seed, 5, 6]).x, uniform2([i, seed, 5, 7]))
    }

    #[test]
    fn quads_cover_the_square_and_are_found_again() {
        for rounds in [1, 3, 6] {
            let density = learnt(rounds);
            let area: f64 = density.quads.iter().map(|q| f64::from(q.size).powi(2)).sum();
            assert!((area - 1.0).abs() < 1e-9, "{area}");
            let integral: f64 =
                density.quads.iter().map(|q| f64::from(q.size).powi(2) * f64::from(q.pdf)).sum();
            assert!((integral * 4.0 * std::f64::consts::PI - 1.0).abs() < 1e-6, "{integral}");
            for quad in &density.quads {
                for u in [Vec2::ZERO, Vec2::splat(0.5), Vec2::splat(0.999)] {
                    let at = coordinates(Vec2::from(quad.corner) + u * quad.size);
                    assert_eq!(density.pdf_at(at), quad.pdf, "{quad:?}");
                }
            }
        }
    }

    /// Every number that can choose a quad is used once. The frequencies must then equal the stated
    /// probabilities to the last bit.
    #[test]
    fn quads_are_drawn_exactly_as_often_as_is_stated() {
        let density = learnt(6);
        let mut counts = vec![0u32; density.quads.len()];
        for number in 0..1u32 << DIGITS {
            counts[density.quad(to_unit(number << (32 - DIGITS)))] += 1;
        }
        for (quad, count) in density.quads.iter().zip(counts) {
            let stated =
                f64::from(quad.pdf) * f64::from(quad.size).powi(2) * 4.0 * std::f64::consts::PI;
            assert!(
                (stated * f64::from(ONE) - f64::from(count)).abs() < 1e-6 * f64::from(count) + 1e-6,
                "{quad:?} {count}"
            );
        }
    }

    /// The integral of a density over the cells of a grid on the square. Quads lie within cells or
    /// cover whole cells.
    fn shares(density: &Density, rows: usize, columns: usize) -> Vec<f64> {
        let mut shares = vec![0.0; rows * columns];
        for quad in &density.quads {
            let covered = |at: f32, cells: usize| {
                let first = (at * cells as f32) as usize;
                first..first + ((quad.size * cells as f32) as usize).max(1)
            };
            let (x, y) = (covered(quad.corner[0], columns), covered(quad.corner[1], rows));
            let share =
                f64::from(quad.pdf) * f64::from(quad.size).powi(2) * 4.0 * std::f64::consts::PI;
            let each = share / (x.len() * y.len()) as f64;
            for row in y {
                x.clone().for_each(|column| shares[row * columns + column] += each);
            }
        }
        shares
    }

    /// Compares counts with the integral of the density over cells of the sphere, with a bound that
    /// holds for all cells together.
    #[test]
    fn samples_are_distributed_as_the_density_says_by_chi_squared() {
        let (rows, columns, n) = (16usize, 32usize, 400_000u32);
        for rounds in [1, 3, 6] {
            let density = learnt(rounds);
            let expected: Vec<f64> = shares(&density, rows, columns)
                .into_iter()
                .map(|share| share * f64::from(n))
                .collect();
            let mut counts = vec![0u32; rows * columns];
            for i in 0..n {
                let p = square_from_direction(sample(&density, i, rounds));
                counts[(p.y * rows as f32) as usize * columns + (p.x * columns as f32) as usize] +=
                    1;
            }
            let deviation = chi_squared_deviation(&counts, &expected);
            assert!(
                deviation < sidak_deviation(0.01, 3),
                "{rounds} rounds: {deviation} standard deviations"
            );
        }
    }

    #[test]
    fn a_small_sun_is_found() {
        let sun = Vec3::new(0.3, -0.4, 0.866).normalize();
        let density = learnt(7);
        // The sun has 97 % of the light, on 0.25 % of the sphere.
        let toward = (0..1000).filter(|&i| sample(&density, i, 1).dot(sun) > 0.98).count();
        assert!(toward > 800, "{toward}");
    }
}
