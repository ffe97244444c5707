//! The albedos of anisotropic facets, by both widths and the azimuth of the direction.
//!
//! An isotropic table at one width for each direction would not do: at the width along the
//! direction, or at that with the same loss of white facets, the share of light that glass loses
//! is off by 0.1 and more. So these tables, integrated by `generate.rs` into `anisotropic.bin`,
//! have all dimensions, on a coarser grid with cubics between the nodes: 2.6 MB, and some 1000
//! numbers for each direction. (The other published ways cost more here: walks over the facets,
//! Heitz et al. 2016, have values that are random.) White metals keep light within 0.4 %, what
//! else is off is in `furnace.rs`.
//!
//! Only [`super::super::Ggx`] has tables for dielectrics: no anisotropic dielectric has
//! [`super::super::Beckmann`]'s facets.

use super::{
    DEEPEST, FACETS, LOST, MOST, REFLECTED, Table, cubic, cubic_through, mean_reference, nodes,
    position,
};
use super::{MOST_ROOT_F0, MicrofacetShape, Microfacets, Widths};
use snell_math::Vec3;
use snell_math::real;
use std::f32::consts::SQRT_2;
use std::sync::LazyLock;

/// Nodes in the root of the larger width, which is at most [`SQRT_2`] in all materials.
pub(super) const WIDTHS: usize = 13;
/// Nodes in the root of the smaller width over the larger one.
pub(super) const RATIOS: usize = 8;
/// Nodes along the azimuth.
pub(super) const AZIMUTHS: usize = 11;
/// Nodes along the direction, as in [`super::STEEPNESSES`].
pub(super) const STEEPNESSES: usize = 28;
/// Nodes in the index of refraction.
pub(super) const INDICES: usize = 13;
/// Numbers for one pair of widths: albedos and their mean.
pub(super) const CELL: usize = AZIMUTHS * STEEPNESSES + 1;
/// The root of the larger width at the nodes, over that at the last. They are denser for narrow
/// lobes, whose mean losses grow with the square of the width.
const ROOTS: [f32; WIDTHS] = [0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
/// The least ratio of the widths in the tables.
const LEAST_RATIO: f32 = 5e-4;

/// Numbers in a table for one index of refraction.
const PLANE: usize = WIDTHS * RATIOS * CELL;

/// Numbers of all tables.
const COUNT: usize = PLANE * (2 + 3 * INDICES);

/// The tables, packed: see [`pack`].
static PACKED: &[u8; 2 * COUNT] = include_bytes!("anisotropic.bin");

/// Numbers of 16 bits, as in [`super::NUMBERS`]: the loss of facets that reflect everything, of
/// both distributions, and the three tables of dielectrics.
static NUMBERS: LazyLock<Vec<u16>> = LazyLock::new(|| unpack(PACKED));

/// Calls a function for each row of numbers that [`pack`] stores as differences, with the distance
/// of its neighbours: along the indices, the directions, and the azimuths.
fn for_rows(numbers: &mut [u16], function: fn(&mut [u16], usize)) {
    let (facets, dielectrics) = numbers.split_at_mut(2 * PLANE);
    for (tables, indices) in [(facets, 1), (dielectrics, INDICES)] {
        for cell in tables.chunks_exact_mut(CELL * indices) {
            let (albedos, mean) = cell.split_at_mut((CELL - 1) * indices);
            function(mean, 1);
            albedos.chunks_exact_mut(indices).for_each(|row| function(row, 1));
            let rows = albedos.chunks_exact_mut(STEEPNESSES * indices);
            rows.for_each(|row| function(row, indices));
            function(albedos, STEEPNESSES * indices);
        }
    }
}

/// The bytes of `anisotropic.bin`, which compress to half of what the numbers do: differences of
/// neighbours, their signs as the last bits, and the low bytes of all before the high ones.
#[cfg(test)]
pub(super) fn pack(mut numbers: Vec<u16>) -> Vec<u8> {
    for_rows(&mut numbers, |row, stride| {
        for i in (stride..row.len()).rev() {
            row[i] = row[i].wrapping_sub(row[i - stride]);
        }
    });
    let zigzag = |x: &u16| (x << 1) ^ ((*x as i16) >> 15) as u16;
    let low = numbers.iter().map(|x| zigzag(x) as u8);
    low.chain(numbers.iter().map(|x| (zigzag(x) >> 8) as u8)).collect()
}

/// The inverse of [`pack`].
fn unpack(bytes: &[u8]) -> Vec<u16> {
    let (low, high) = bytes.split_at(bytes.len() / 2);
    let zigzag = low.iter().zip(high).map(|(&low, &high)| u16::from_le_bytes([low, high]));
    let mut numbers: Vec<_> = zigzag.map(|x| (x >> 1) ^ (x & 1).wrapping_neg()).collect();
    for_rows(&mut numbers, |row, stride| {
        for i in stride..row.len() {
            row[i] = row[i].wrapping_add(row[i - stride]);
        }
    });
    numbers
}

/// The larger width at a node.
#[cfg(test)]
pub(super) fn width_at(node: usize) -> f32 {
    SQRT_2 * ROOTS[node] * ROOTS[node]
}

/// The ratio of the widths at a node.
#[cfg(test)]
pub(super) fn ratio_at(node: usize) -> f32 {
    let least = LEAST_RATIO.sqrt();
    real::powi(least + (1.0 - least) * node as f32 / (RATIOS - 1) as f32, 2)
}

/// The position of an index of refraction on its nodes.
fn index_position(ior: f32) -> f64 {
    let s = f64::from((ior - 1.0) / (ior + 1.0));
    real::powf((s / MOST_ROOT_F0).clamp(0.0, 1.0), 1.0 / 2.5) * (INDICES - 1) as f64
}

/// The position along the azimuths, by the square of the azimuth's cosine: 0 across the larger
/// width, 1 along it. It is the root of the width along the direction, over its range: albedos
/// change fast where that is small.
#[inline(always)]
pub(super) fn azimuth_position(widths: Widths, along2: f32) -> f32 {
    let Widths { x, y } = widths;
    let width = (x * x * along2 + y * y * (1.0 - along2)).max(0.0).sqrt();
    ((x + y) * along2 / (width + y)).sqrt()
}

/// The first of four nodes around a position, and their weights in a cubic.
#[inline(always)]
pub(super) fn four_nodes(x: f32, n: usize) -> (usize, [f32; 4]) {
    let (node, t) = nodes(x, n);
    let first = node.saturating_sub(1).min(n - 4);
    (first, cubic((node - first) as f32 + t))
}

/// One quantity for one anisotropic surface: a function of direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anisotropic {
    /// The larger width along `x`.
    widths: Widths,
    /// True if the larger width is that along the bitangent.
    is_across: bool,
    /// The start of the first cell, and numbers for each index of refraction in it.
    start: usize,
    indices: usize,
    /// Weights of the cells and of the indices, in a cubic.
    by_width: [f32; 4],
    by_ratio: [f32; 4],
    by_index: [f32; 4],
    /// As in [`super::Albedo`].
    reference: f32,
    /// Factor on all numbers.
    scale: f32,
}

impl Anisotropic {
    /// The start of a table, and numbers for each index of refraction in it.
    fn place(table: Table, shape: MicrofacetShape) -> Option<(usize, usize)> {
        let of_dielectric = |number: usize| (PLANE * (2 + number * INDICES), INDICES);
        let is_table = |other: Table| table.start == other.start;
        match shape {
            MicrofacetShape::Ggx if is_table(FACETS) => Some((0, 1)),
            MicrofacetShape::Beckmann if is_table(FACETS) => Some((PLANE, 1)),
            MicrofacetShape::Beckmann => None,
            MicrofacetShape::Ggx if is_table(REFLECTED) => Some(of_dielectric(0)),
            MicrofacetShape::Ggx if is_table(LOST[0]) => Some(of_dielectric(1)),
            MicrofacetShape::Ggx => Some(of_dielectric(2)),
        }
    }

    fn new(facets: Microfacets, table: Table, ior: f32) -> Option<Self> {
        let widths = facets.widths();
        if !widths.has_tangent() {
            return None;
        }
        let (start, indices) = Self::place(table, facets.shape())?;
        let is_across = widths.y > widths.x;
        let widths = if is_across { Widths { x: widths.y, y: widths.x } } else { widths };
        let least = LEAST_RATIO.sqrt();
        let ratio = ((widths.y / widths.x).sqrt() - least) / (1.0 - least);
        let root = (widths.x / SQRT_2).sqrt().min(1.0);
        let width = ROOTS.partition_point(|&node| node <= root).saturating_sub(2).min(WIDTHS - 4);
        let by_width = cubic_through(std::array::from_fn(|i| ROOTS[width + i]), root);
        let (ratio, by_ratio) = four_nodes(ratio, RATIOS);
        let (index, by_index) = if indices == 1 {
            (0, [1.0, 0.0, 0.0, 0.0])
        } else {
            let x = index_position(ior);
            let first = (x as usize).saturating_sub(1).min(INDICES - 4);
            (first, cubic((x - first as f64) as f32))
        };
        Some(Self {
            widths,
            is_across,
            start: start + (width * RATIOS + ratio) * CELL * indices + index,
            indices,
            by_width,
            by_ratio,
            by_index,
            reference: 1.0,
            scale: 1.0,
        })
    }

    /// A loss, as [`super::Albedo::loss`]; `None` for isotropic surfaces.
    pub(super) fn loss(facets: Microfacets, table: Table, ior: f32) -> Option<Self> {
        Self::new(facets, table, ior)
            .map(|made| Self { reference: mean_reference(made.widths.x), ..made })
    }

    /// An albedo, as [`super::Albedo::reflected`]; `None` for isotropic surfaces.
    pub(super) fn reflected(facets: Microfacets, ior: f32) -> Option<Self> {
        Self::new(facets, REFLECTED, ior).map(|made| Self { scale: MOST, ..made })
    }

    /// Applies the cubic through the cells and indices to a number of each cell, which a function
    /// decodes.
    #[inline(always)]
    fn number(&self, number: usize, decode: impl Fn(f32) -> f32) -> f32 {
        let at = self.start + number * self.indices;
        let used = self.indices.min(4);
        let numbers = &**NUMBERS;
        let share = |at: usize| f32::from(numbers[at]) * (1.0 / 65535.0);
        let mut sum = 0.0;
        for (i, by_width) in self.by_width.iter().enumerate() {
            for (k, by_ratio) in self.by_ratio.iter().enumerate() {
                let at = at + (i * RATIOS + k) * CELL * self.indices;
                let over_indices: f32 = (self.by_index[..used].iter().enumerate())
                    .map(|(k, by_index)| by_index * decode(share(at + k)))
                    .sum();
                sum += by_width * by_ratio * over_indices;
            }
        }
        sum.max(0.0)
    }

    /// The value for a direction above.
    pub(super) fn directional(&self, w: Vec3) -> f32 {
        let w = if self.is_across { Vec3::new(w.y, w.x, w.z) } else { w };
        let length2 = w.x * w.x + w.y * w.y;
        let along2 = if length2 > 0.0 { w.x * w.x / length2 } else { 0.5 };
        let (azimuth, by_azimuth) = four_nodes(azimuth_position(self.widths, along2), AZIMUTHS);
        let (node, by_steepness) = four_nodes(position(self.widths, w), STEEPNESSES);
        let mut sum = 0.0;
        for (i, by_azimuth) in by_azimuth.iter().enumerate() {
            for (k, by_steepness) in by_steepness.iter().enumerate() {
                let at = (azimuth + i) * STEEPNESSES + node + k;
                sum += by_azimuth * by_steepness * self.number(at, |x| x);
            }
        }
        (self.scale * sum).max(0.0)
    }

    /// The mean over directions weighted by the cosine.
    pub(super) fn average(&self) -> f32 {
        self.reference * self.number(CELL - 1, |x| real::exp(x * DEEPEST))
    }
}

#[cfg(test)]
mod tests {
    use super::{COUNT, pack, unpack};
    use snell_math::rng::hash32;

    #[test]
    fn unpacking_undoes_packing() {
        let numbers: Vec<_> = (0..COUNT as u32).map(|i| hash32(i) as u16).collect();
        assert_eq!(unpack(&pack(numbers.clone())), numbers);
    }
}
