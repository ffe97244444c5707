//! A density over all directions that is constant over cells of longitude and latitude.

use snell_math::distribution::Distribution1D;
use snell_math::simd::max;
use snell_math::{DVec3, Vec2, Vec3, angles, real};
use std::f32::consts::{FRAC_1_PI, TAU};
use std::f64::consts::PI as PI64;

/// A direction sampled from the table, in the table's coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub struct DrawnDirection {
    /// Cosine of the angle from the zenith.
    pub height: f64,
    /// Longitude as a fraction of a full turn.
    pub turn: f64,
    /// Density per steradian.
    pub pdf: f32,
}

impl DrawnDirection {
    /// The unit vector (`+y` is the zenith, `-z` the middle of the image), and longitude and
    /// latitude as a point of the unit square. It has no branches, so that loops over it become
    /// vector code.
    #[inline(always)]
    pub fn to_vector(self) -> (Vec3, Vec2) {
        let Self { height, turn, .. } = self;
        let sin = max((1.0 - height) * (1.0 + height), 0.0).sqrt();
        let (sin_phi, cos_phi) = angles::sin_cos((turn - 0.5) * (2.0 * PI64));
        let latitude = angles::atan2(sin as f32, height as f32) * FRAC_1_PI;
        (
            DVec3::new(sin * sin_phi, height, -sin * cos_phi).as_vec3(),
            Vec2::new(turn as f32, latitude),
        )
    }
}

/// Chooses a row of cells, then a cell in the row, then a direction uniform by solid angle in the
/// cell.
#[derive(Debug)]
pub(super) struct DirectionTable {
    rows: Distribution1D,
    columns: Vec<Distribution1D>,
    /// Cosines of the polar angles of the edges between rows.
    edges: Vec<f64>,
}

/// Maximum size of the table; larger images are downsampled.
const MAX_TABLE: [usize; 2] = [2048, 1024];
/// The least probability, relative to the mean, of each cell with any light and of each row.
/// Otherwise dim cells beside a sun would vanish in the rounding of the tables.
const FLOOR: f32 = 1e-3;

impl DirectionTable {
    /// The density in proportion to the excess of the cells' luminance over `taken_off`, and the
    /// mean of that excess over the sphere.
    pub fn new(luminance: &Cells, taken_off: f64) -> (Self, f64) {
        let [columns, rows] = luminance.size;
        let mut table = Vec::with_capacity(rows);
        let mut sums = Vec::with_capacity(rows);
        let mut all = 0.0;
        for row in 0..rows {
            let cell = |column: usize| luminance.means[row * columns + column] - taken_off as f32;
            let cells: Vec<f32> = (0..columns).map(|column| cell(column).max(0.0)).collect();
            let mean = cells.iter().map(|&c| f64::from(c)).sum::<f64>() / columns as f64;
            let floor = mean as f32 * FLOOR;
            table.push(Distribution1D::new(
                &cells
                    .iter()
                    .map(|&c| if c > 0.0 { c.max(floor) } else { 0.0 })
                    .collect::<Vec<_>>(),
            ));
            // The fraction of the sphere that the row covers.
            let share = (row_cos(row, rows) - row_cos(row + 1, rows)) * 0.5;
            all += mean * share;
            sums.push((mean * share) as f32);
        }
        let floor = FLOOR * (all / rows as f64) as f32;
        let sums: Vec<f32> =
            sums.iter().map(|&s| if s > 0.0 { s.max(floor) } else { 0.0 }).collect();
        let edges = (0..=rows).map(|row| row_cos(row, rows)).collect();
        (Self { rows: Distribution1D::new(&sums), columns: table, edges }, all)
    }

    /// Samples a direction with this density.
    #[inline]
    pub fn sample(&self, u: Vec2) -> DrawnDirection {
        let (row, v) = self.rows.sample(u.y);
        let (column, s) = self.columns[row].sample(u.x);
        let (top, bottom) = (self.edges[row], self.edges[row + 1]);
        DrawnDirection {
            height: top + (bottom - top) * f64::from(v),
            turn: (column as f64 + f64::from(s)) / self.columns[row].len() as f64,
            pdf: self.cell_pdf(row, column),
        }
    }

    /// Density per steradian in a direction, which is given by longitude and latitude as a point of
    /// the unit square.
    pub fn pdf(&self, p: Vec2) -> f32 {
        let index = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        let row = index(p.y, self.columns.len());
        self.cell_pdf(row, index(p.x, self.columns[row].len()))
    }

    fn cell_pdf(&self, row: usize, column: usize) -> f32 {
        let height = (self.edges[row] - self.edges[row + 1]) as f32;
        let solid_angle = TAU / self.columns[row].len() as f32 * height;
        self.rows.probability(row) * self.columns[row].probability(column) / solid_angle
    }
}

/// Cosine of the polar angle at the upper edge of a row.
fn row_cos(row: usize, rows: usize) -> f64 {
    // The sine of the angle from the horizon is exact at the poles and symmetric.
    real::sin(PI64 * (0.5 - row as f64 / rows as f64))
}

/// An image with one number per pixel, available row by row.
pub(super) trait Rows {
    /// The row with this number, from 0. Rows must be requested in ascending order, but the last
    /// three rows may be requested again.
    fn row(&mut self, y: usize) -> Vec<f32>;
}

/// Means over the cells of a table, which has the size of an image or is smaller.
pub(super) struct Cells {
    /// The number of columns and rows.
    pub size: [usize; 2],
    /// The means, row by row.
    pub means: Vec<f32>,
}

impl Cells {
    /// The values for an image of this size, in a table of at most [`MAX_TABLE`]: for each cell,
    /// the mean of all texels that it touches.
    pub fn of(image: impl Rows, [w, h]: [usize; 2]) -> Self {
        Self::in_table(image, [w, h], [w.min(MAX_TABLE[0]), h.min(MAX_TABLE[1])])
    }

    /// The values for a table of this size.
    pub fn in_table(mut image: impl Rows, [w, h]: [usize; 2], size: [usize; 2]) -> Self {
        let range = |i: usize, cells: usize, texels: usize| {
            i * texels / cells..((i + 1) * texels).div_ceil(cells)
        };
        let mut means = Vec::with_capacity(size[0] * size[1]);
        for row in 0..size[1] {
            let lines = range(row, size[1], h);
            let mut sums = vec![0.0; size[0]];
            for y in lines.clone() {
                let line = image.row(y);
                for (column, sum) in sums.iter_mut().enumerate() {
                    line[range(column, size[0], w)].iter().for_each(|&v| *sum += f64::from(v));
                }
            }
            let count = |column| range(column, size[0], w).len() * lines.len();
            means.extend(
                sums.iter().enumerate().map(|(column, sum)| (sum / count(column) as f64) as f32),
            );
        }
        Self { size, means }
    }
}
