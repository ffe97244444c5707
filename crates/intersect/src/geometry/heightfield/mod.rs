//! Heightfields: surfaces given by heights on a grid, such as terrain rasters.

mod triangles;
mod walk;

pub use triangles::HeightfieldMesh;

use crate::mesh::{TriangleMesh, first_uv_set};
use rayon::prelude::*;
use snell_math::{Bounds3d, DAffine3, DMat3, DVec2, DVec3};

/// The number of cells along each side of a block, the unit of the tree.
const BLOCK: usize = 8;

/// Padding of the box of a block relative to the size of its largest triangle, as that of triangles
/// ([`crate::mesh::padded_bounds`]).
const PADDING: f64 = 1.1e-6;

/// Heights of the nodes of a grid, row after row. NaN is a node without data.
#[derive(Clone, Debug, PartialEq)]
pub enum Heights {
    /// In single precision: 4 bytes each.
    Single(Vec<f32>),
    /// In double precision: 8 bytes each.
    Double(Vec<f64>),
}

impl Heights {
    /// Heights in double precision, kept in single precision if that changes none of them.
    pub fn of_doubles(heights: Vec<f64>) -> Self {
        let is_exact = |&z: &f64| z.is_nan() || f64::from(z as f32) == z;
        if heights.par_iter().with_min_len(1 << 14).all(is_exact) {
            Self::Single(heights.into_par_iter().map(|z| z as f32).collect())
        } else {
            Self::Double(heights)
        }
    }

    /// The number of nodes.
    pub fn len(&self) -> usize {
        match self {
            Self::Single(all) => all.len(),
            Self::Double(all) => all.len(),
        }
    }

    /// True if there are no nodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The height of a node.
    #[inline(always)]
    pub fn get(&self, node: usize) -> f64 {
        match self {
            Self::Single(all) => f64::from(all[node]),
            Self::Double(all) => all[node],
        }
    }
}

/// Errors of [`Heightfield::new`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HeightfieldError {
    /// There are fewer than two rows or columns.
    #[error(
        "there are {rows} rows and {columns} columns, expected at least 2 of each: the surface is \
            between the heights"
    )]
    TooSmall {
        /// The number of rows.
        rows: usize,
        /// The number of columns.
        columns: usize,
    },
    /// The number of heights is not that of rows and columns.
    #[error("there are {found} heights, expected {rows} rows of {columns}")]
    WrongCount {
        /// The number of rows.
        rows: usize,
        /// The number of columns.
        columns: usize,
        /// The number of heights.
        found: usize,
    },
    /// The triangles do not have numbers of 32 bits.
    #[error("there are {0} cells, expected at most 2147483647: split the raster")]
    TooLarge(usize),
    /// A height is infinite.
    #[error("the height in row {row}, column {column} is {value}, expected a finite number or NaN")]
    Infinite {
        /// The row of the height.
        row: usize,
        /// Its column.
        column: usize,
        /// The height.
        value: f64,
    },
    /// A coordinate is beyond the range of `f32`.
    #[error("coordinates of the surface reach 3.4e38, expected smaller ones")]
    TooFar,
    /// The transform has no inverse, or is not finite.
    #[error("the transform is singular or not finite, expected one with an inverse")]
    Singular,
}

/// A surface given by heights at the nodes of a grid of rows and columns.
///
/// The node in a row and column is at the image of `(column + 0.5, row + 0.5, height)`. A *cell*
/// lies between four nodes: cell `row * (columns - 1) + column` has the nodes in this row and
/// column and in the next ones. It consists of two triangles, which share the diagonal from the
/// first to the last node: triangle `2 * cell` is on the side of the next row, triangle
/// `2 * cell + 1` on that of the next column. [`crate::Hit::primitive`] is the number of the
/// triangle. A cell with a node without data is a hole; its triangles are never hit, but keep their
/// numbers.
///
/// Rays hit the very triangles, bit for bit as they hit those of [`Self::to_mesh`], whose vertices
/// are the nodes computed in `f64`. [`crate::Hit::uv`] are the barycentrics. Seen from above, from
/// where heights grow to, the corners of all triangles go around counterclockwise, whatever the
/// transform.
///
/// Only the heights are stored, and two numbers for each block of 8 by 8 cells. A ray finds the
/// blocks by the tree, and walks through the cells of a block that are below it.
#[derive(Clone, Debug)]
pub struct Heightfield {
    rows: usize,
    columns: usize,
    heights: Heights,
    group_from_grid: DAffine3,
    /// The position of the first node at height 0.
    origin: DVec3,
    /// The map of vectors to columns, rows and heights.
    grid_from_group: DMat3,
    /// The most that each of columns, rows and heights changes over a unit of any axis.
    reach: DVec3,
    /// The largest extent of a flat cell along an axis.
    cell_size: f64,
    /// The largest change of a coordinate over a unit of height.
    height_scale: f64,
    /// The box of the surface.
    bounds: Bounds3d,
    /// The largest magnitude of a coordinate.
    largest: f64,
    /// True if the border belongs to the surface.
    is_closed: bool,
    /// True if rows and columns run such that triangles from node to node go around clockwise.
    is_mirrored: bool,
    /// The least and largest height of each block, rounded outwards. The least is infinite if all
    /// cells of the block are holes.
    ranges: Vec<[f32; 2]>,
    /// The number of cells that are not holes.
    cells: usize,
}

impl PartialEq for Heightfield {
    fn eq(&self, other: &Self) -> bool {
        (self.rows, self.columns, self.group_from_grid, self.is_closed)
            == (other.rows, other.columns, other.group_from_grid, other.is_closed)
            && self.heights == other.heights
    }
}

impl Heightfield {
    /// Makes a surface from the heights of `rows` rows of `columns` nodes, and the map from
    /// `(column + 0.5, row + 0.5, height)` to the coordinates of the group.
    ///
    /// # Errors
    /// If there are fewer than two rows or columns, or more than 2147483647 cells; if the number of
    /// heights is wrong, or one is infinite; and if the map has no inverse.
    pub fn new(
        rows: usize,
        columns: usize,
        heights: Heights,
        group_from_grid: DAffine3,
    ) -> Result<Self, HeightfieldError> {
        if rows < 2 || columns < 2 {
            return Err(HeightfieldError::TooSmall { rows, columns });
        }
        let cells = (rows - 1).saturating_mul(columns - 1);
        if cells > (u32::MAX / 2) as usize {
            return Err(HeightfieldError::TooLarge(cells));
        }
        if heights.len() != rows.saturating_mul(columns) {
            return Err(HeightfieldError::WrongCount { rows, columns, found: heights.len() });
        }
        let map = group_from_grid.matrix3;
        let grid_from_group = map.inverse();
        let is_regular = group_from_grid.is_finite()
            && map.determinant() != 0.0
            && grid_from_group.is_finite()
            && group_from_grid.translation.is_finite();
        if !is_regular {
            return Err(HeightfieldError::Singular);
        }
        let mut field = Self {
            rows,
            columns,
            heights,
            group_from_grid,
            origin: group_from_grid.transform_point3(DVec3::new(0.5, 0.5, 0.0)),
            grid_from_group,
            reach: grid_from_group.x_axis.abs()
                + grid_from_group.y_axis.abs()
                + grid_from_group.z_axis.abs(),
            cell_size: (map.x_axis.abs() + map.y_axis.abs()).max_element(),
            height_scale: map.z_axis.abs().max_element(),
            bounds: Bounds3d::EMPTY,
            largest: 0.0,
            is_closed: false,
            is_mirrored: map.determinant() < 0.0,
            ranges: Vec::new(),
            cells: 0,
        };
        field.measure()?;
        Ok(field)
    }

    /// The same grid with other heights.
    ///
    /// # Errors
    /// If the number of heights is another one, or one is infinite.
    pub fn with_heights(&self, heights: Heights) -> Result<Self, HeightfieldError> {
        let made = Self::new(self.rows, self.columns, heights, self.group_from_grid)?;
        Ok(made.with_closed_border(self.is_closed))
    }

    /// The surface with a border that belongs to it, or not (the default). A ray that passes
    /// exactly through the border, at the outermost nodes or at a hole, hits a closed one; through
    /// an open one, it hits on some sides only, as at the border of a mesh. (At a node of a closed
    /// border, two triangles may be hit.)
    pub fn with_closed_border(self, is_closed: bool) -> Self {
        Self { is_closed, ..self }
    }

    /// True if the border belongs to the surface.
    pub fn has_closed_border(&self) -> bool {
        self.is_closed
    }

    /// The edges of the triangles of a cell beyond which there is no cell; see
    /// [`walk::Cell::closed`].
    #[cold]
    fn border(&self, row: usize, column: usize) -> [u32; 2] {
        let is_hole = |row: Option<usize>, column: Option<usize>| match (row, column) {
            (Some(row), Some(column)) => self.cell_heights(row, column).is_none(),
            _ => true,
        };
        let (here, beside) = (Some(row), Some(column));
        let is_border = |nodes: [usize; 2]| match nodes {
            [0, 1] | [1, 0] => is_hole(row.checked_sub(1), beside),
            [2, 3] | [3, 2] => is_hole(Some(row + 1), beside),
            [0, 2] | [2, 0] => is_hole(here, column.checked_sub(1)),
            [1, 3] | [3, 1] => is_hole(here, Some(column + 1)),
            _ => false,
        };
        [0, 1].map(|half| {
            let nodes = self.half(half);
            let edges = (0..3).filter(|&i| is_border([nodes[(i + 1) % 3], nodes[(i + 2) % 3]]));
            edges.fold(0, |bits, edge| bits | 1 << edge)
        })
    }

    /// Computes the ranges of blocks and the number of cells.
    fn measure(&mut self) -> Result<(), HeightfieldError> {
        let field = &*self;
        let blocks = field.block_rows() * field.block_columns();
        let measured: Vec<([f32; 2], u32, bool)> =
            (0..blocks).into_par_iter().with_min_len(64).map(|b| field.measure_block(b)).collect();
        if measured.iter().any(|block| block.2) {
            return Err(self.infinite());
        }
        self.cells = measured.iter().map(|block| block.1 as usize).sum();
        self.ranges = measured.into_iter().map(|block| block.0).collect();
        self.bounds = self.compute_bounds();
        let bounds = self.bounds;
        if !bounds.is_empty() {
            self.largest = bounds.min.abs().max(bounds.max.abs()).max_element();
        }
        if self.largest <= f64::from(f32::MAX) { Ok(()) } else { Err(HeightfieldError::TooFar) }
    }

    /// The range of a block, the number of its cells that are not holes, and whether a height is
    /// infinite.
    fn measure_block(&self, block: usize) -> ([f32; 2], u32, bool) {
        let [rows, columns] = self.cells_of(block);
        let (mut low, mut high, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0);
        let mut is_infinite = false;
        for row in rows.start..=rows.end {
            for column in columns.start..=columns.end {
                let z = self.heights.get(row * self.columns + column);
                is_infinite |= z.is_infinite();
                // A comparison with NaN is false.
                let is_cell = row < rows.end && column < columns.end;
                let Some(z) = self.cell_heights(row, column).filter(|_| is_cell) else { continue };
                count += 1;
                for z in z {
                    low = if z < low { z } else { low };
                    high = if z > high { z } else { high };
                }
            }
        }
        ([below(low), -below(-high)], count, is_infinite)
    }

    /// The error of the first infinite height.
    #[cold]
    fn infinite(&self) -> HeightfieldError {
        let node = (0..self.heights.len()).find(|&i| self.heights.get(i).is_infinite());
        let node = node.unwrap_or_default();
        let (row, column, value) =
            (node / self.columns, node % self.columns, self.heights.get(node));
        HeightfieldError::Infinite { row, column, value }
    }

    /// The number of rows of nodes.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns of nodes.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The heights of the nodes, row after row.
    pub fn heights(&self) -> &Heights {
        &self.heights
    }

    /// The map from `(column + 0.5, row + 0.5, height)` to the coordinates of the group.
    pub fn group_from_grid(&self) -> &DAffine3 {
        &self.group_from_grid
    }

    /// The number of triangles that can be hit.
    pub fn triangle_count(&self) -> usize {
        2 * self.cells
    }

    /// The number of cells, including holes.
    pub fn cell_count(&self) -> usize {
        (self.rows - 1) * (self.columns - 1)
    }

    /// Memory in bytes.
    pub fn memory_bytes(&self) -> usize {
        let heights = match &self.heights {
            Heights::Single(all) => size_of_val(all.as_slice()),
            Heights::Double(all) => size_of_val(all.as_slice()),
        };
        heights + size_of_val(self.ranges.as_slice())
    }

    /// The position of a node; not finite if it has no data.
    #[inline(always)]
    pub fn node(&self, row: usize, column: usize) -> DVec3 {
        self.place(row, column, self.heights.get(row * self.columns + column))
    }

    #[inline(always)]
    fn place(&self, row: usize, column: usize, height: f64) -> DVec3 {
        let node = DVec3::new(column as f64 + 0.5, row as f64 + 0.5, height);
        self.group_from_grid.transform_point3(node)
    }

    /// The heights of the nodes of a cell: in its row and column, in the next column, in the next
    /// row, and in both. `None` for a hole, and beyond the last cell.
    #[inline(always)]
    fn cell_heights(&self, row: usize, column: usize) -> Option<[f64; 4]> {
        if row + 1 >= self.rows || column + 1 >= self.columns {
            return None;
        }
        let node = row * self.columns + column;
        let below = node + self.columns;
        let z = match &self.heights {
            Heights::Single(all) => {
                [all[node], all[node + 1], all[below], all[below + 1]].map(f64::from)
            }
            Heights::Double(all) => [all[node], all[node + 1], all[below], all[below + 1]],
        };
        (!(z[0] + z[1] + z[2] + z[3]).is_nan()).then_some(z)
    }

    /// The positions of the nodes of a cell with these heights.
    #[inline(always)]
    fn cell_nodes(&self, row: usize, column: usize, z: &[f64; 4]) -> [DVec3; 4] {
        [
            self.place(row, column, z[0]),
            self.place(row, column + 1, z[1]),
            self.place(row + 1, column, z[2]),
            self.place(row + 1, column + 1, z[3]),
        ]
    }

    /// The nodes of a half of a cell, as positions in the arrays of [`Self::cell_heights`].
    #[inline(always)]
    pub(crate) fn half(&self, half: usize) -> [usize; 3] {
        match (self.is_mirrored, half) {
            (true, 0) => [0, 2, 3],
            (true, _) => [0, 3, 1],
            (false, 0) => [0, 3, 2],
            (false, _) => [0, 1, 3],
        }
    }

    /// The row and column of the cell of a triangle.
    fn cell_of(&self, triangle: usize) -> [usize; 2] {
        let cell = triangle / 2;
        [cell / (self.columns - 1), cell % (self.columns - 1)]
    }

    /// The corners of a triangle; `None` if it is in a hole or there is no such triangle.
    pub fn corners(&self, triangle: usize) -> Option<[DVec3; 3]> {
        let [row, column] = self.cell_of(triangle);
        let nodes = self.cell_nodes(row, column, &self.cell_heights(row, column)?);
        Some(self.half(triangle % 2).map(|node| nodes[node]))
    }

    /// The rows and columns of the nodes of a triangle.
    pub fn nodes(&self, triangle: usize) -> [[usize; 2]; 3] {
        let [row, column] = self.cell_of(triangle);
        self.half(triangle % 2).map(|node| [row + node / 2, column + node % 2])
    }

    /// The texture coordinates of a node, such that an image whose pixels are the nodes lies on
    /// them: (0, 0) is the corner of the image's first pixel, so nodes are half a pixel inside.
    pub fn uv(&self, row: usize, column: usize) -> DVec2 {
        DVec2::new(
            (column as f64 + 0.5) / self.columns as f64,
            (row as f64 + 0.5) / self.rows as f64,
        )
    }

    /// The normal of the surface at a node, upwards, from the differences of the heights beside it;
    /// on the border and beside nodes without data, from those that there are. Zero for a node
    /// without data.
    pub fn node_normal(&self, row: usize, column: usize) -> DVec3 {
        let here = self.heights.get(row * self.columns + column);
        if here.is_nan() {
            return DVec3::ZERO;
        }
        let slope = |before: Option<f64>, after: Option<f64>| {
            let [before, after] = [before, after].map(|z| z.filter(|z| !z.is_nan()));
            let steps = usize::from(before.is_some()) + usize::from(after.is_some());
            (after.unwrap_or(here) - before.unwrap_or(here)) / steps.max(1) as f64
        };
        let at = |row: Option<usize>, column: Option<usize>| {
            let (row, column) = (row?, column?);
            let is_inside = row < self.rows && column < self.columns;
            is_inside.then(|| self.heights.get(row * self.columns + column))
        };
        let across = slope(at(Some(row), column.checked_sub(1)), at(Some(row), Some(column + 1)));
        let down = slope(at(row.checked_sub(1), Some(column)), at(Some(row + 1), Some(column)));
        let map = &self.group_from_grid.matrix3;
        let normal = (map.x_axis + map.z_axis * across).cross(map.y_axis + map.z_axis * down);
        let upwards = if self.is_mirrored { -normal } else { normal };
        upwards.normalize_or_zero()
    }

    /// A triangle as a mesh of its own, in single precision.
    pub(crate) fn triangle_alone(&self, triangle: usize) -> TriangleMesh {
        let corners = self.corners(triangle).unwrap_or([DVec3::ZERO; 3]);
        let uvs = self.nodes(triangle).map(|[row, column]| self.uv(row, column).as_vec2());
        TriangleMesh {
            positions: corners.map(|p| p.as_vec3()).to_vec(),
            indices: vec![[0, 1, 2]],
            uvs: first_uv_set(uvs.to_vec()),
            ..TriangleMesh::default()
        }
    }

    fn block_columns(&self) -> usize {
        (self.columns - 1).div_ceil(BLOCK)
    }

    fn block_rows(&self) -> usize {
        (self.rows - 1).div_ceil(BLOCK)
    }

    /// The number of blocks.
    pub(crate) fn block_count(&self) -> usize {
        self.ranges.len()
    }

    /// The rows and columns of the cells of a block.
    #[inline(always)]
    fn cells_of(&self, block: usize) -> [std::ops::Range<usize>; 2] {
        let (row, column) = (block / self.block_columns(), block % self.block_columns());
        let along =
            |first: usize, nodes: usize| first * BLOCK..((first + 1) * BLOCK).min(nodes - 1);
        [along(row, self.rows), along(column, self.columns)]
    }

    /// Calls `each` with the number and the corners of the triangles of a block in cells whose box
    /// it `wants`. `place` is applied to the nodes first.
    pub(crate) fn visit_block<S>(
        &self,
        block: usize,
        state: &mut S,
        place: impl Fn(DVec3) -> DVec3,
        wants: impl Fn(&S, &Bounds3d) -> bool,
        mut each: impl FnMut(&mut S, u32, [DVec3; 3]),
    ) {
        let [rows, columns] = self.cells_of(block);
        for row in rows {
            for column in columns.clone() {
                let Some(z) = self.cell_heights(row, column) else { continue };
                let nodes = self.cell_nodes(row, column, &z).map(&place);
                if !wants(state, &Bounds3d::of(nodes)) {
                    continue;
                }
                let first = 2 * (row * (self.columns - 1) + column) as u32;
                for half in 0..2 {
                    each(state, first + half, self.half(half as usize).map(|node| nodes[node]));
                }
            }
        }
    }

    /// The box of a block, padded like the boxes of triangles, around its nodes in double precision
    /// and rounded to single precision. Empty if all cells are holes.
    pub(crate) fn block_bounds(&self, block: usize) -> Bounds3d {
        let exact = self.bounds_around(block);
        if exact.is_empty() {
            return exact;
        }
        // Rounding is monotonic, so the rounded box is around the rounded nodes.
        let rounded = |p: DVec3| p.as_vec3().as_dvec3();
        let [low, high] = self.ranges[block].map(f64::from);
        let triangle = self.cell_size + self.height_scale * (high - low);
        let margin = triangle * PADDING + f64::from(f32::MIN_POSITIVE);
        Bounds3d {
            min: exact.min.min(rounded(exact.min)) - margin,
            max: exact.max.max(rounded(exact.max)) + margin,
        }
    }

    /// A box around the nodes of a block; empty if all its cells are holes.
    fn bounds_around(&self, block: usize) -> Bounds3d {
        let [low, high] = self.ranges[block].map(f64::from);
        if low > high {
            return Bounds3d::EMPTY;
        }
        let [rows, columns] = self.cells_of(block);
        let corners = [rows.start, rows.end].into_iter().flat_map(|row| {
            [columns.start, columns.end]
                .into_iter()
                .flat_map(move |column| [low, high].map(|z| (row, column, z)))
        });
        Bounds3d::of(corners.map(|(row, column, z)| self.place(row, column, z)))
    }

    /// The box of the surface. Empty if all cells are holes.
    pub fn bounds(&self) -> Bounds3d {
        self.bounds
    }

    /// Computes [`Self::bounds`]. The nodes of a block are looked at only if the box around its
    /// corners and range is not inside what is known.
    fn compute_bounds(&self) -> Bounds3d {
        (0..self.block_count()).fold(Bounds3d::EMPTY, |mut all, block| {
            let around = self.bounds_around(block);
            if !around.is_empty() && all.union(&around) != all {
                let [rows, columns] = self.cells_of(block);
                let cells = rows.flat_map(|r| columns.clone().map(move |c| (r, c)));
                for (row, column) in cells {
                    if let Some(z) = self.cell_heights(row, column) {
                        all = all.union(&Bounds3d::of(self.cell_nodes(row, column, &z)));
                    }
                }
            }
            all
        })
    }
}

/// The largest `f32` that is not greater than `x`.
fn below(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) > x { rounded.next_down() } else { rounded }
}
