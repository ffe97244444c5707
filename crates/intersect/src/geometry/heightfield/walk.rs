//! The way of a ray through the cells of a block.
//!
//! The ray is mapped to columns, rows and heights. For each row that it crosses, the columns
//! between its entry and exit are visited, nearest first; cells above or below the ray are skipped.
//! All intervals are padded by more than the rounding of the map and of the test of triangles, so
//! that what is skipped could not be hit.

use super::Heightfield;
use snell_math::{DRay, DVec3};
use std::ops::Range;

/// Bound on the rounding of vertices, of the ray and of projected vertices, in units of the
/// precision times the largest coordinate: half a unit for the vertex, one each for its difference
/// to the origin, its product with the shear, the shear itself and the last difference, and some to
/// spare.
const ROUNDINGS: f64 = 8.0;

/// The padding of hits beyond the box of a triangle, relative to its size; more than that of the
/// test of triangles.
const BEYOND: f64 = 2e-6;

/// A cell that a ray may hit.
pub(crate) struct Cell {
    /// The number of its first triangle.
    pub first: u32,
    /// Its nodes; see [`Heightfield::half`].
    pub nodes: [DVec3; 4],
    /// Whether its triangles may be hit.
    pub halves: [bool; 2],
    /// The edges that belong to each triangle, as bits: bit `i` is the edge opposite of corner `i`.
    pub closed: [u32; 2],
}

impl Heightfield {
    /// Calls `visit` with the cells of a block that a ray may hit between two parameters, roughly
    /// nearest first. `visit` returns the new end of the ray, or `None` if the search is over; then
    /// this function returns true. `precision` is that of the tests of triangles.
    #[inline(always)]
    pub(crate) fn walk(
        &self,
        block: usize,
        ray: &DRay,
        precision: f64,
        mut visit: impl FnMut(&Cell) -> Option<f64>,
    ) -> bool {
        let [low, high] = self.ranges[block].map(f64::from);
        if low > high {
            return false;
        }
        let o = self.grid_from_group * (ray.origin - self.origin);
        let d = self.grid_from_group * ray.direction;
        let rounding = ROUNDINGS * precision * (ray.origin.abs().max_element() + self.largest);
        let triangle = self.cell_size + self.height_scale * (high - low);
        let pad = self.reach * (rounding + BEYOND * triangle);
        let inverse = d.recip();
        let clip = |axis: usize, low: f64, high: f64, span: Span| {
            span.clipped(o[axis], inverse[axis], low - pad[axis], high + pad[axis])
        };
        let [rows, columns] = self.cells_of(block);
        let mut limit = ray.t_max;
        let span = Span { start: ray.t_min, end: limit };
        let span = clip(1, rows.start as f64, rows.end as f64, span);
        let span = clip(0, columns.start as f64, columns.end as f64, span);
        let span = clip(2, low, high, span);
        if span.is_empty() {
            return false;
        }
        let at = |axis: usize, t: f64| if d[axis] == 0.0 { o[axis] } else { o[axis] + d[axis] * t };
        let between = |axis: usize, all: &Range<usize>, span: Span| {
            steps(all, at(axis, span.start), at(axis, span.end), pad[axis])
        };
        let in_order = |range: Range<usize>, axis: usize| {
            let is_descending = d[axis] < 0.0;
            let (first, last) = (range.start, range.end.wrapping_sub(1));
            (0..range.len()).map(move |i| if is_descending { last - i } else { first + i })
        };
        for row in in_order(between(1, &rows, span), 1) {
            let in_row = clip(1, row as f64, (row + 1) as f64, span);
            if in_row.is_empty() || in_row.start > limit {
                continue;
            }
            for column in in_order(between(0, &columns, in_row), 0) {
                let Some(z) = self.cell_heights(row, column) else { continue };
                let inside = clip(0, column as f64, (column + 1) as f64, in_row);
                if inside.is_empty() || inside.start > limit {
                    continue;
                }
                let (a, b) = (at(2, inside.start), at(2, inside.end));
                let least = lesser(lesser(z[0], z[1]), lesser(z[2], z[3]));
                let most = greater(greater(z[0], z[1]), greater(z[2], z[3]));
                if greater(a, b) + pad.z < least || lesser(a, b) - pad.z > most {
                    continue;
                }
                let (x, y) = (column as f64, row as f64);
                let ends = [(inside.start, a), (inside.end, b)];
                let ends = ends.map(|(t, height)| DVec3::new(at(0, t) - x, at(1, t) - y, height));
                let halves = crossed(&z, &ends, &pad);
                if halves == [false; 2] {
                    continue;
                }
                let cell = Cell {
                    first: 2 * (row * (self.columns - 1) + column) as u32,
                    nodes: self.cell_nodes(row, column, &z),
                    halves,
                    closed: if self.is_closed { self.border(row, column) } else { [0; 2] },
                };
                match visit(&cell) {
                    Some(end) => limit = end,
                    None => return true,
                }
            }
        }
        false
    }
}

/// Whether the part of a ray between two points of a cell may cross the planes of its triangles:
/// not if it is on one side, by more than the padding.
#[inline(always)]
fn crossed(&[z00, z01, z10, z11]: &[f64; 4], ends: &[DVec3; 2], pad: &DVec3) -> [bool; 2] {
    // The slopes along columns and rows of the plane of each triangle, which are both through the
    // first node.
    [(z11 - z10, z10 - z00), (z01 - z00, z11 - z01)].map(|(across, down)| {
        let margin = pad.z + across.abs() * pad.x + down.abs() * pad.y;
        let [a, b] = ends.map(|p| p.z - z00 - (across * p.x + down * p.y));
        // Comparisons with NaN are false.
        let is_aside = (a > margin && b > margin) || (a < -margin && b < -margin);
        !is_aside
    })
}

/// An interval of a ray.
#[derive(Clone, Copy)]
struct Span {
    start: f64,
    end: f64,
}

impl Span {
    /// The part of the interval in which a coordinate, `origin + t / inverse`, is between two
    /// values.
    #[inline(always)]
    fn clipped(self, origin: f64, inverse: f64, low: f64, high: f64) -> Self {
        if !inverse.is_finite() {
            // The coordinate does not change, or so slowly that its change has no effect.
            let is_inside = origin >= low && origin <= high;
            return if is_inside { self } else { Self { start: 1.0, end: 0.0 } };
        }
        let (a, b) = ((low - origin) * inverse, (high - origin) * inverse);
        Self { start: greater(self.start, lesser(a, b)), end: lesser(self.end, greater(a, b)) }
    }

    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.start > self.end
    }
}

/// The lesser of two numbers that are not NaN, in one instruction.
#[inline(always)]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers that are not NaN, in one instruction.
#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The cells along an axis between two coordinates, padded. All of them if a coordinate is NaN.
#[inline(always)]
fn steps(all: &Range<usize>, a: f64, b: f64, pad: f64) -> Range<usize> {
    if a.is_nan() || b.is_nan() {
        return all.clone();
    }
    let (low, high) = (lesser(a, b) - pad, greater(a, b) + pad);
    // Conversions to integers are clamped, and round numbers that are not negative down.
    let first = (greater(low, 0.0) as usize).clamp(all.start, all.end - 1);
    let last = (greater(high, 0.0) as usize).clamp(all.start, all.end - 1);
    first..last + 1
}
