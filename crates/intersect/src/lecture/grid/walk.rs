//! Traversal of a grid from cell to cell along the ray (Amanatides and Woo, A fast voxel traversal
//! algorithm for ray tracing, 1987).
//!
//! The traversal follows the line itself; primitives are stored in all cells within a padding. For
//! a ray from far away that is thicker than the padding, each step also visits the cells beside the
//! piece of the line in the current cell, within the thickness of the ray.

use super::{Cell, Grids, Level, PADDING};
use crate::lecture::box_ray::BoxRay;
use crate::lecture::{Visitor, Work};
use crate::search::region::Region;
use snell_math::Bounds3d;

/// Traverses a grid and its inner grids. Returns true if the search is over.
pub(super) fn walk(
    grids: &Grids,
    number: u32,
    ray: &BoxRay,
    visitor: &mut dyn Visitor,
    work: &mut Work,
) -> bool {
    let level = &grids.levels[number as usize];
    work.node(visitor, || {
        Region::of_box(&Bounds3d { min: level.low.into(), max: level.high.into() })
    });
    let (start, end) = ray.span(level.low, level.high);
    if start > end {
        return false;
    }
    // The ray is as thick as a cell, or endless, so stepping from cell to cell is useless.
    if ray.width * PADDING > level.padding || !start.is_finite() || !end.is_finite() {
        let [low, high] = around(level, ray, start, end);
        return visit_range(grids, level, low, high, ray, visitor, work);
    }
    let is_thick = ray.width > level.padding;
    let mut steps = Steps::new(level, ray, start);
    loop {
        // The axis and parameter at which the ray leaves the cell.
        let (axis, next) = steps.next();
        let finished = if is_thick {
            let [low, high] = around(level, ray, steps.start, next.min(end));
            visit_range(grids, level, low, high, ray, visitor, work)
        } else {
            visit(grids, level, steps.place, ray, visitor, work)
        };
        if finished {
            return true;
        }
        if next >= end || next > ray.cull(visitor) {
            return false;
        }
        steps.step(axis, next);
    }
}

/// Tests the contents of a cell, or traverses the grid that it is divided into.
#[inline(always)]
fn visit(
    grids: &Grids,
    level: &Level,
    place: [u32; 3],
    ray: &BoxRay,
    visitor: &mut dyn Visitor,
    work: &mut Work,
) -> bool {
    let cell = grids.cells[level.index(place)];
    work.cell(visitor, || {
        let side =
            |up: u32| std::array::from_fn::<_, 3, _>(|axis| level.plane(axis, place[axis] + up));
        Region::of_box(&Bounds3d { min: side(0).into(), max: side(1).into() })
    });
    match cell.count {
        0 => false,
        Cell::GRID => walk(grids, cell.first, ray, visitor, work),
        count => {
            visitor.test(&grids.references[cell.first as usize..(cell.first + count) as usize])
        }
    }
}

/// Visits all cells of a range.
fn visit_range(
    grids: &Grids,
    level: &Level,
    low: [u32; 3],
    high: [u32; 3],
    ray: &BoxRay,
    visitor: &mut dyn Visitor,
    work: &mut Work,
) -> bool {
    (low[2]..=high[2]).any(|z| {
        (low[1]..=high[1])
            .any(|y| (low[0]..=high[0]).any(|x| visit(grids, level, [x, y, z], ray, visitor, work)))
    })
}

/// The range of cells within the width of the ray between two of its points; all cells if one of
/// the points is infinitely far away.
fn around(level: &Level, ray: &BoxRay, start: f64, end: f64) -> [[u32; 3]; 2] {
    if !(start.is_finite() && end.is_finite()) {
        return [[0; 3], level.cells.map(|n| n - 1)];
    }
    let at = |axis: usize, t: f64| ray.origin[axis] + ray.direction[axis] * t;
    let low = |axis| level.place(axis, at(axis, start).min(at(axis, end)) - ray.width);
    let high = |axis| level.place(axis, at(axis, start).max(at(axis, end)) + ray.width);
    [std::array::from_fn(low), std::array::from_fn(high)]
}

/// The state of a traversal.
struct Steps {
    /// The current cell.
    place: [u32; 3],
    /// The parameter at which the ray entered the current cell.
    start: f64,
    /// The parameter at which the ray crosses the next plane of each axis; infinite at the end of
    /// the grid.
    next: [f64; 3],
    /// The difference of the parameter between consecutive planes of each axis.
    delta: [f64; 3],
    /// The number of remaining cells along each axis.
    left: [u32; 3],
    is_down: [bool; 3],
}

impl Steps {
    #[inline(always)]
    fn new(level: &Level, ray: &BoxRay, start: f64) -> Self {
        let mut steps = Self {
            place: [0; 3],
            start,
            next: [f64::INFINITY; 3],
            delta: [f64::INFINITY; 3],
            left: [0; 3],
            is_down: [false; 3],
        };
        for axis in 0..3 {
            let place = level.place(axis, ray.origin[axis] + ray.direction[axis] * start);
            let is_down = ray.is_down(axis);
            steps.place[axis] = place;
            steps.is_down[axis] = is_down;
            steps.left[axis] = if is_down { place } else { level.cells[axis] - 1 - place };
            if ray.direction[axis] != 0.0 && steps.left[axis] > 0 {
                let plane = level.plane(axis, place + u32::from(!is_down));
                steps.next[axis] = (plane - ray.origin[axis]) * ray.inverse[axis];
                steps.delta[axis] = level.size[axis] * ray.inverse[axis].abs();
            }
        }
        steps
    }

    /// The axis along which the ray leaves the cell, and the parameter there.
    #[inline(always)]
    fn next(&self) -> (usize, f64) {
        let [x, y, z] = self.next;
        if x <= y && x <= z {
            (0, x)
        } else if y <= z {
            (1, y)
        } else {
            (2, z)
        }
    }

    #[inline(always)]
    fn step(&mut self, axis: usize, at: f64) {
        self.start = at.max(self.start);
        self.left[axis] -= 1;
        self.place[axis] =
            if self.is_down[axis] { self.place[axis] - 1 } else { self.place[axis] + 1 };
        self.next[axis] = if self.left[axis] > 0 { at + self.delta[axis] } else { f64::INFINITY };
    }
}
