//! Builds grids from primitives: a counting sort of the primitives into cells, then a grid for each
//! crowded cell.

use super::{Cell, Grids, Level, MAX_LEVELS, PADDING};
use crate::lecture::AcceleratorOptions;
use crate::lecture::primitives::{Item, PARALLEL, Primitives, bounds_of};
use rayon::prelude::*;
use snell_math::{Bounds3d, DVec3, real};

/// The number of cells per primitive of the outermost grid.
const DENSITY: f64 = 3.0;
/// The number of cells per primitive of inner grids.
const INNER_DENSITY: f64 = 1.0;

/// The largest number of cells along an axis.
const MAX_CELLS: u32 = 1024;
/// The largest number of cells of a whole grid.
const MAX_VOLUME: u64 = 1 << 26;

/// The largest number of primitives in a cell that does not become a grid.
const CROWDED: usize = 24;

/// The largest number of references in an inner grid, relative to the number of its primitives. A
/// grid that would need more separates too little and is not made.
const GROWTH: usize = 6;
/// The largest number of references in the outermost grid, relative to the number of its
/// primitives. A grid that would need more gets fewer cells.
const OUTER_GROWTH: u64 = 16;

/// Builds the grids.
pub(super) fn grids(primitives: &Primitives, options: &AcceleratorOptions) -> Grids {
    let mut grids =
        Grids { levels: Vec::new(), cells: Vec::new(), references: Vec::new(), depth: 0 };
    if !primitives.items.is_empty() {
        let builder = Builder { primitives, nested: options.nested_grids };
        let bounds = primitives.bounds.into();
        let cells = match options.grid_resolution {
            Some(n) => along_longest(&bounds, n),
            None => by_density(&bounds, primitives.items.len(), DENSITY),
        };
        let level = builder.fitting(level(&bounds, cells));
        builder.add(&primitives.items, level, 1, &mut grids);
    }
    grids
}

/// Resolution with `n` cells along the longest side, as nearly cubic as possible.
fn along_longest(bounds: &Bounds3d, n: u32) -> [u32; 3] {
    let size = bounds.size();
    let per_length = f64::from(n.clamp(1, MAX_CELLS)) / size.max_element();
    size.to_array().map(|s| cells_of(s * per_length))
}

/// Resolution with a given number of cells per primitive, as nearly cubic as possible. Flat sides
/// get one layer of cells and do not count.
fn by_density(bounds: &Bounds3d, count: usize, density: f64) -> [u32; 3] {
    let size = bounds.size();
    let longest = size.max_element();
    let sides: Vec<f64> = size.to_array().into_iter().filter(|&s| s > longest * 1e-3).collect();
    let volume: f64 = sides.iter().map(|s| s / longest).product();
    let per_length =
        real::powf(density * count as f64 / volume, 1.0 / sides.len().max(1) as f64) / longest;
    size.to_array().map(|s| cells_of(s * per_length))
}

fn cells_of(x: f64) -> u32 {
    // NaN becomes 1.
    (x.round().max(1.0) as u32).min(MAX_CELLS)
}

/// A grid of cells that fills a box.
fn level(bounds: &Bounds3d, cells: [u32; 3]) -> Level {
    let n = DVec3::from_array(cells.map(f64::from));
    let size = bounds.size() / n;
    let shortest = size.to_array().into_iter().filter(|&s| s > 0.0).fold(f64::INFINITY, f64::min);
    Level {
        low: bounds.min.to_array(),
        high: bounds.max.to_array(),
        size: size.to_array(),
        // A flat side has a single layer.
        inverse_size: size.to_array().map(|s| if s > 0.0 { 1.0 / s } else { 0.0 }),
        cells,
        first: 0,
        // The padding also exceeds the rounding of planes of boxes between here and the largest
        // coordinates.
        padding: if shortest.is_finite() {
            shortest * PADDING + bounds.size().max_element() * 1e-12
        } else {
            0.0
        },
    }
}

struct Builder<'a> {
    primitives: &'a Primitives<'a>,
    nested: bool,
}

/// A cell number and a primitive in that cell.
type Entry = (u32, Item);

impl Builder<'_> {
    /// Reduces the number of cells of the outermost grid until large primitives do not fill too
    /// many of them.
    fn fitting(&self, mut grid: Level) -> Level {
        let items = &self.primitives.items;
        // Small scenes may have as many cells as they want.
        let limit = items.len() as u64 * OUTER_GROWTH + (1 << 20);
        let touched = |grid: &Level| {
            let of = |item: &Item| {
                let [low, high] = touched_cells(item, grid);
                (0..3).map(|a| u64::from(high[a] - low[a] + 1)).product::<u64>()
            };
            items.par_iter().with_min_len(PARALLEL).map(of).sum::<u64>()
        };
        let volume = |grid: &Level| grid.cells.iter().map(|&n| u64::from(n)).product::<u64>();
        while grid.cells != [1; 3] && (volume(&grid) > MAX_VOLUME || touched(&grid) > limit) {
            let bounds = Bounds3d { min: grid.low.into(), max: grid.high.into() };
            grid = level(&bounds, grid.cells.map(|n| (n * 4 / 5).max(1)));
        }
        grid
    }

    /// Adds a grid and its inner grids. `depth` counts from 1.
    fn add(&self, items: &[Item], level: Level, depth: u32, grids: &mut Grids) {
        let entries = self.entries(items, &level);
        self.add_entries(entries, level, depth, grids);
    }

    /// The primitives, sorted by cell.
    fn entries(&self, items: &[Item], level: &Level) -> Vec<Entry> {
        let one = |item: &Item| {
            let mut entries = Vec::new();
            self.each_cell(item, level, |cell, part| entries.push((cell, part)));
            entries
        };
        if items.len() < PARALLEL {
            items.iter().flat_map(one).collect()
        } else {
            items.par_iter().with_min_len(PARALLEL).flat_map_iter(one).collect()
        }
    }

    /// Calls `call` for every cell that a primitive lies in, with its part there.
    fn each_cell(&self, item: &Item, level: &Level, mut call: impl FnMut(u32, Item)) {
        let [low, high] = touched_cells(item, level);
        let is_single = low == high;
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let place = [x, y, z];
                    let cell = (level.index(place) - level.first as usize) as u32;
                    if is_single {
                        call(cell, *item);
                    } else if let Some(part) =
                        self.primitives.clipped(item, &cell_box(level, place))
                    {
                        call(cell, part);
                    }
                }
            }
        }
    }

    fn add_entries(&self, entries: Vec<Entry>, level: Level, depth: u32, grids: &mut Grids) {
        grids.depth = grids.depth.max(depth);
        let [x, y, z] = level.cells;
        let first = grids.cells.len();
        grids.levels.push(Level { first: first as u32, ..level });
        let mut counts = vec![0u32; x as usize * y as usize * z as usize];
        entries.iter().for_each(|e| counts[e.0 as usize] += 1);
        grids.cells.extend(counts.iter().map(|&count| Cell { first: 0, count }));
        // The index at which each cell begins.
        let mut sum = 0;
        for count in &mut counts {
            (*count, sum) = (sum, sum + *count);
        }
        let mut sorted =
            vec![Item { min: Default::default(), id: 0, max: Default::default() }; entries.len()];
        for (cell, item) in entries {
            let at = &mut counts[cell as usize];
            sorted[*at as usize] = item;
            *at += 1;
        }
        let mut start = 0;
        let mut crowded = Vec::new();
        for (number, end) in counts.into_iter().enumerate() {
            let items = &sorted[start..end as usize];
            start = end as usize;
            if self.nested && items.len() > CROWDED && depth < MAX_LEVELS {
                crowded.push((number, items));
            } else {
                grids.cells[first + number] = add_references(items, grids);
            }
        }
        // A crowded cell becomes a grid if that separates its primitives.
        let inner = |&(number, items): &(usize, &[Item])| {
            self.inner(items, &level, number as u32, depth + 1)
        };
        let inner: Vec<Option<Grids>> = if sorted.len() < PARALLEL {
            crowded.iter().map(inner).collect()
        } else {
            crowded.par_iter().map(inner).collect()
        };
        for ((number, items), inner) in crowded.into_iter().zip(inner) {
            grids.cells[first + number] = match inner {
                Some(inner) => append(grids, inner),
                None => add_references(items, grids),
            };
        }
    }

    /// The grid over the contents of a cell; `None` if it would separate too little.
    fn inner(&self, items: &[Item], outer: &Level, number: u32, depth: u32) -> Option<Grids> {
        let [x, y] = [outer.cells[0], outer.cells[1]];
        let cell = cell_box(outer, [number % x, number / x % y, number / (x * y)]);
        let bounds = Bounds3d::from(bounds_of(items)).intersection(&cell);
        if bounds.is_empty() {
            return None;
        }
        let level = level(&bounds, by_density(&bounds, items.len(), INNER_DENSITY));
        if level.cells == [1; 3] {
            return None;
        }
        let entries = self.entries(items, &level);
        if entries.len() > items.len() * GROWTH {
            return None;
        }
        let mut grids =
            Grids { levels: Vec::new(), cells: Vec::new(), references: Vec::new(), depth };
        self.add_entries(entries, level, depth, &mut grids);
        Some(grids)
    }
}

/// The first and the last cell on each axis that the padded box of an item touches.
fn touched_cells(item: &Item, level: &Level) -> [[u32; 3]; 2] {
    let low = std::array::from_fn(|a| level.place(a, f64::from(item.min[a]) - level.padding));
    let high = std::array::from_fn(|a| level.place(a, f64::from(item.max[a]) + level.padding));
    [low, high]
}

/// The box of a cell, enlarged by the padding.
fn cell_box(level: &Level, place: [u32; 3]) -> Bounds3d {
    let padding = DVec3::splat(level.padding);
    let side = |up: u32| DVec3::from_array(std::array::from_fn(|a| level.plane(a, place[a] + up)));
    Bounds3d { min: side(0) - padding, max: side(1) + padding }
}

fn add_references(items: &[Item], grids: &mut Grids) -> Cell {
    if items.is_empty() {
        return Cell::EMPTY;
    }
    let first = grids.references.len() as u32;
    grids.references.extend(items.iter().map(|i| i.id));
    Cell { first, count: items.len() as u32 }
}

/// Adds finished grids. Returns the cell that leads to them.
fn append(grids: &mut Grids, inner: Grids) -> Cell {
    let (levels, cells, references) =
        (grids.levels.len() as u32, grids.cells.len() as u32, grids.references.len() as u32);
    let moved = |c: Cell| Cell {
        first: c.first + if c.count == Cell::GRID { levels } else { references },
        ..c
    };
    grids.levels.extend(inner.levels.into_iter().map(|l| Level { first: l.first + cells, ..l }));
    grids.cells.extend(inner.cells.into_iter().map(moved));
    grids.references.extend(inner.references);
    grids.depth = grids.depth.max(inner.depth);
    Cell { first: levels, count: Cell::GRID }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_and_degenerate_boxes_get_layers_of_cells() {
        let of = |x, y, z, n| {
            by_density(&Bounds3d { min: DVec3::ZERO, max: DVec3::new(x, y, z) }, n, 1.0)
        };
        assert_eq!(of(1.0, 1.0, 1.0, 1000), [10, 10, 10]);
        assert_eq!(of(1.0, 1.0, 0.0, 100), [10, 10, 1]);
        assert_eq!(of(4.0, 0.0, 0.0, 100), [100, 1, 1]);
        assert_eq!(of(0.0, 0.0, 0.0, 100), [1, 1, 1]);
    }
}
