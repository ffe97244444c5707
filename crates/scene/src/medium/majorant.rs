//! Upper bounds (majorants) of a density, and the walk of a ray through them.

use super::grid::CellValue;
use super::{CellGrid, ScalarGrid};
use crate::texture::Wrap;
use snell_math::Vec3;

/// Number of cells of the density grid per cell of the bounds, along each axis.
const CELLS_PER_BOUND: usize = 4;

/// Upper bounds of the interpolated values of a grid, on a coarser grid over the same unit cube.
#[derive(Clone, Debug)]
pub struct MajorantGrid {
    size: [usize; 3],
    bounds: Vec<f32>,
}

/// A part of a ray in one cell of the bounds. Positions are in units of the ray's direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundedPart {
    pub start: f32,
    pub end: f32,
    /// The number of the cell of the bounds.
    pub cell: usize,
}

impl MajorantGrid {
    /// The bounds of a grid, on `size` cells. [`Self::size_for`] gives a suitable size.
    pub fn new(grid: &ScalarGrid, size: [usize; 3]) -> Self {
        Self::of(grid, grid.values().iter().copied(), size)
    }

    /// The bounds of values in the cells of a grid, which are derived from the grid's own; x
    /// changes fastest.
    pub fn of<T: CellValue>(
        grid: &CellGrid<T>,
        mut values: impl Iterator<Item = f32>,
        size: [usize; 3],
    ) -> Self {
        let [nx, ny, nz] = grid.size();
        let mut bounds = vec![0.0f32; size.iter().product()];
        // For each cell, the bounds that it affects. They extend one cell farther on each side than
        // interpolation needs, because of rounding.
        let reach = |i: usize, n: usize, m: usize| {
            let first = i.saturating_sub(2) * m / n;
            first..=((i + 3) * m).div_ceil(n).min(m) - 1
        };
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let value = values.next().unwrap_or(0.0);
                    if value == 0.0 {
                        continue;
                    }
                    for k in reach(z, nz, size[2]) {
                        for j in reach(y, ny, size[1]) {
                            for i in reach(x, nx, size[0]) {
                                let bound = &mut bounds[(k * size[1] + j) * size[0] + i];
                                *bound = bound.max(value);
                            }
                        }
                    }
                }
            }
        }
        let bounds = Self { size, bounds };
        if grid.wrap() == Wrap::Repeat { bounds.joined() } else { bounds }
    }

    /// The bounds where the values at opposite sides of the cube are interpolated.
    fn joined(mut self) -> Self {
        let mut stride = 1;
        for n in self.size {
            let span = (n - 1) * stride;
            for first in (0..self.bounds.len()).filter(|i| i / stride % n == 0) {
                let joined = self.bounds[first].max(self.bounds[first + span]);
                (self.bounds[first], self.bounds[first + span]) = (joined, joined);
            }
            stride *= n;
        }
        self
    }

    /// Bounds on `size` cells, each computed from the cell's number.
    pub fn made(size: [usize; 3], bound: impl Fn(usize) -> f32) -> Self {
        Self { size, bounds: (0..size.iter().product()).map(bound).collect() }
    }

    /// A suitable size for the bounds of a grid with this many cells along each axis.
    pub fn size_for(cells: [usize; 3]) -> [usize; 3] {
        cells.map(|n| n.div_ceil(CELLS_PER_BOUND).max(1))
    }

    /// The number of cells of the bounds along each axis.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// The bound of a cell.
    pub fn bound(&self, cell: usize) -> f32 {
        self.bounds[cell]
    }

    /// Visits the parts of a ray in the unit cube, in order, by a three-dimensional DDA (Amanatides
    /// and Woo, A Fast Voxel Traversal Algorithm for Ray Tracing, Eurographics 1987). `visit`
    /// returns false to stop.
    pub fn walk(
        &self,
        origin: Vec3,
        direction: Vec3,
        length: f32,
        mut visit: impl FnMut(BoundedPart) -> bool,
    ) {
        let Some((mut start, end)) = unit_cube(origin, direction, length) else { return };
        let size = Vec3::from_array(self.size.map(|n| n as f32));
        let p = (origin + direction * start) * size;
        let mut cell = [0i64; 3];
        let (mut next, mut delta, mut step) = ([f32::INFINITY; 3], [f32::INFINITY; 3], [0i64; 3]);
        for axis in 0..3 {
            cell[axis] = (p[axis].floor() as i64).clamp(0, self.size[axis] as i64 - 1);
            let d = direction[axis];
            if d != 0.0 {
                step[axis] = if d > 0.0 { 1 } else { -1 };
                let border = (cell[axis] + i64::from(d > 0.0)) as f32 / size[axis];
                next[axis] = (border - origin[axis]) / d;
                delta[axis] = 1.0 / (size[axis] * d.abs());
            }
        }
        // Each step crosses one plane between cells, and no plane is crossed twice.
        for _ in 0..self.size.iter().sum::<usize>() + 3 {
            let axis = if next[0] <= next[1] && next[0] <= next[2] {
                0
            } else if next[1] <= next[2] {
                1
            } else {
                2
            };
            let stop = next[axis].min(end).max(start);
            let [x, y, z] = cell.map(|c| c as usize);
            let index = (z * self.size[1] + y) * self.size[0] + x;
            if stop > start && !visit(BoundedPart { start, end: stop, cell: index }) {
                return;
            }
            if next[axis].is_nan() || next[axis] >= end {
                return;
            }
            start = stop;
            cell[axis] += step[axis];
            if cell[axis] < 0 || cell[axis] >= self.size[axis] as i64 {
                return;
            }
            next[axis] += delta[axis];
        }
    }
}

/// The start and end of the part of `[0, length]` along a ray that is in the unit cube; `None` if
/// the ray misses the cube.
fn unit_cube(origin: Vec3, direction: Vec3, length: f32) -> Option<(f32, f32)> {
    let (mut start, mut end) = (0.0f32, length);
    for axis in 0..3 {
        let (o, d) = (origin[axis], direction[axis]);
        if d == 0.0 {
            if !(0.0..=1.0).contains(&o) {
                return None;
            }
            continue;
        }
        let (a, b) = ((0.0 - o) / d, (1.0 - o) / d);
        start = start.max(a.min(b));
        end = end.min(a.max(b));
    }
    (start < end && end.is_finite()).then_some((start, end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng;

    fn random_grid(size: [usize; 3], key: u32) -> ScalarGrid {
        let n = size.iter().product::<usize>() as u32;
        let value = |i| {
            let u = rng::uniform2([i, key, 1, 2]);
            if u.x < 0.7 { 0.0 } else { u.y }
        };
        ScalarGrid::new(size, (0..n).map(value).collect()).expect("as many values as cells")
    }

    #[test]
    fn bounds_hold_along_random_rays_and_parts_join() {
        for (key, size) in [[9, 4, 17], [1, 1, 1], [5, 30, 2], [8, 8, 8]].into_iter().enumerate() {
            let wrap = [Wrap::Clamp, Wrap::Repeat, Wrap::Black, Wrap::Repeat][key];
            let grid = random_grid(size, key as u32).wrapped(wrap);
            let majorants = MajorantGrid::new(&grid, MajorantGrid::size_for(grid.size()));
            for i in 0..300 {
                let r = |k| rng::uniform2([i, key as u32, k, 9]);
                let (a, b, c) = (r(0), r(1), r(2));
                let origin = Vec3::new(a.x, a.y, b.x) * 3.0 - 1.0;
                let direction = Vec3::new(b.y, c.x, c.y) * 2.0 - 1.0;
                let direction =
                    if i % 5 == 0 { Vec3::new(0.0, direction.y, 0.0) } else { direction };
                let Some((start, end)) = unit_cube(origin, direction, 2.0) else { continue };
                let (mut at, mut count) = (start, 0);
                majorants.walk(origin, direction, 2.0, |part| {
                    assert!((part.start - at).abs() < 1e-5, "gap at {at}: {part:?}");
                    at = part.end;
                    for s in 0..=8 {
                        let t = part.start + (part.end - part.start) * s as f32 / 8.0;
                        let value = grid.lookup(origin + direction * t);
                        assert!(
                            value <= majorants.bound(part.cell) * 1.00001,
                            "{value} at {t} of {part:?}"
                        );
                    }
                    count += 1;
                    true
                });
                assert!((at - end).abs() < 1e-4, "ray {i} ends at {at}, not {end}");
                assert!(count >= 1);
            }
        }
    }

    #[test]
    fn rays_that_miss_or_make_no_sense_visit_nothing() {
        let grid = random_grid([8, 8, 8], 3);
        let majorants = MajorantGrid::new(&grid, [2, 2, 2]);
        for (origin, direction, length) in [
            (Vec3::splat(2.0), Vec3::X, 9.0),
            (Vec3::splat(0.5), Vec3::ZERO, f32::INFINITY),
            (Vec3::NAN, Vec3::X, 9.0),
            (Vec3::splat(0.5), Vec3::NAN, 9.0),
            (Vec3::splat(0.5), Vec3::X, 0.0),
            (Vec3::splat(0.5), Vec3::X, f32::NAN),
        ] {
            let mut parts = 0;
            majorants.walk(origin, direction, length, |_| {
                parts += 1;
                true
            });
            assert!(parts <= 8, "{origin} {direction} {length}: {parts}");
        }
    }
}
