//! Nested uniform grids: a cell that holds many primitives is itself a grid (hierarchical grids:
//! Jevans and Wyvill, Adaptive voxel subdivision for ray tracing, 1989; Kalojanov, Billeter and
//! Slusallek, Two-level grids for ray tracing on GPUs, 2011).
//!
//! The resolution follows from the number of primitives: cells are as nearly cubic as possible, and
//! their number is a small multiple of the number of primitives (Ize, Shirley and Parker, Grid
//! creation strategies for efficient ray tracing, 2007).

mod build;
mod walk;

use super::box_ray::BoxRay;
use super::primitives::Primitives;
use super::{Accelerator, AcceleratorOptions, Size, Visitor, Work};

/// The largest nesting depth of grids.
const MAX_LEVELS: u32 = 4;

/// The distance from their boxes within which primitives are stored in cells, relative to the
/// shortest side of a cell.
const PADDING: f64 = 0.05;

/// A cell: its references, or the grid that it is divided into.
#[derive(Clone, Copy, Debug)]
struct Cell {
    first: u32,
    /// The number of references, or [`Self::GRID`].
    count: u32,
}

impl Cell {
    const GRID: u32 = u32::MAX;
    const EMPTY: Self = Self { first: 0, count: 0 };
}

/// The region and resolution of one grid.
#[derive(Clone, Copy, Debug)]
struct Level {
    low: [f64; 3],
    high: [f64; 3],
    /// The size of a cell.
    size: [f64; 3],
    inverse_size: [f64; 3],
    /// The number of cells along each axis.
    cells: [u32; 3],
    /// The index of the grid's first cell in [`Grids::cells`]; x runs fastest.
    first: u32,
    /// The width up to which rays can be followed from cell to cell.
    padding: f64,
}

impl Level {
    /// The coordinate of the plane between cells with this number.
    #[inline(always)]
    fn plane(&self, axis: usize, number: u32) -> f64 {
        self.low[axis] + self.size[axis] * f64::from(number)
    }

    /// The cell along an axis that contains a coordinate; the nearest cell if none does.
    #[inline(always)]
    fn place(&self, axis: usize, x: f64) -> u32 {
        let place = (x - self.low[axis]) * self.inverse_size[axis];
        // NaN becomes 0.
        (place.max(0.0) as u32).min(self.cells[axis] - 1)
    }

    #[inline(always)]
    fn index(&self, place: [u32; 3]) -> usize {
        let [x, y, z] = place.map(|p| p as usize);
        self.first as usize + (z * self.cells[1] as usize + y) * self.cells[0] as usize + x
    }
}

/// All grids of a group; grid 0 is the outermost.
#[derive(Debug)]
struct Grids {
    levels: Vec<Level>,
    cells: Vec<Cell>,
    references: Vec<u32>,
    depth: u32,
}

/// Builds the grids of a group.
pub(crate) fn build(primitives: &Primitives, options: &AcceleratorOptions) -> Box<dyn Accelerator> {
    Box::new(build::grids(primitives, options))
}

impl Accelerator for Grids {
    fn walk(&self, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool {
        if self.levels.is_empty() {
            return false;
        }
        let mut work = Work::of(visitor);
        let finished = walk::walk(self, 0, ray, visitor, &mut work);
        visitor.count(work);
        finished
    }

    fn repeats(&self) -> bool {
        true
    }

    fn size(&self) -> Size {
        let bytes = size_of_val(self.levels.as_slice())
            + size_of_val(self.cells.as_slice())
            + size_of_val(self.references.as_slice());
        Size {
            nodes: self.cells.len() as u64,
            references: self.references.len() as u64,
            depth: self.depth,
            bytes: bytes as u64,
        }
    }
}
