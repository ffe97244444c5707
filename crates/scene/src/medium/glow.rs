//! The emission of a grid medium as a light, whose points are sampled in proportion to what they
//! emit.

use super::tracking::TrackedGrid;
use snell_math::distribution::Distribution2D;
use snell_math::{Bounds3d, ColorMode, DAffine3, SampledSpectrum, Vec2, Vec3, rng};

/// Maximum number of cells of the table along each axis.
const MOST_CELLS: usize = 32;
/// Number of points along each axis of a cell at which the emission is looked up.
const POINTS: usize = 3;

/// A table of the emission of a grid medium.
#[derive(Debug)]
pub struct Glow {
    grid: TrackedGrid,
    grid_from_world: DAffine3,
    size: [usize; 3],
    /// The distribution of points: rows of the table by z, columns by x and y.
    table: Distribution2D,
    /// Volume of the whole grid in the world, in cubic scene units.
    volume: f64,
    /// Luminance of the radiant intensity of the whole medium, without absorption, W / sr. It is
    /// the same in all directions.
    intensity: f64,
    /// A typical length of a ray in the emissive part, in scene units.
    chord: f32,
    bounds: Bounds3d,
}

impl Glow {
    /// Builds the table; `None` if nothing emits.
    pub(super) fn new(grid: &TrackedGrid) -> Option<Self> {
        let grid_from_world = *grid.grid_from_world()?;
        if !grid.emits() {
            return None;
        }
        let world_from_grid = grid_from_world.inverse();
        let size = grid.cells().map(|n| n.clamp(1, MOST_CELLS));
        let mut weights = Vec::with_capacity(size.iter().product());
        let mut lit = Bounds3d::EMPTY;
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let weight = mean_in_cell(grid, size, [x, y, z]);
                    if weight > 0.0 {
                        let low = Vec3::new(x as f32, y as f32, z as f32);
                        let side = Vec3::from_array(size.map(|n| n as f32));
                        let corner = |k: usize| {
                            low + Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32)
                        };
                        let corners = (0..8).map(|k| {
                            world_from_grid.transform_point3((corner(k) / side).as_dvec3())
                        });
                        lit = lit.union(&Bounds3d::of(corners));
                    }
                    weights.push(weight);
                }
            }
        }
        let cell_count = weights.len() as f64;
        let mean = weights.iter().map(|&w| f64::from(w)).sum::<f64>() / cell_count;
        let volume = world_from_grid.matrix3.determinant().abs();
        let usable =
            mean > 0.0 && mean.is_finite() && volume > 0.0 && volume.is_finite() && lit.is_finite();
        let extent = lit.max - lit.min;
        let surface = 2.0 * (extent.x * extent.y + extent.y * extent.z + extent.z * extent.x);
        // The mean chord of a convex body is four times its volume divided by its surface.
        let chord = (4.0 * extent.x * extent.y * extent.z / surface) as f32;
        (usable && chord > 0.0).then(|| Self {
            grid: grid.clone(),
            grid_from_world,
            size,
            table: Distribution2D::new(&weights, size[0] * size[1]),
            volume,
            intensity: mean * volume,
            chord,
            bounds: lit,
        })
    }

    /// Bounds of the emissive part in the world.
    pub fn bounds(&self) -> Bounds3d {
        self.bounds
    }

    /// Luminance of the radiant intensity of the whole medium, without absorption, W / sr. It is
    /// the same in all directions.
    pub fn intensity(&self) -> f64 {
        self.intensity
    }

    /// A typical length of a ray in the emissive part, in scene units. It relates a density of
    /// points to a density of directions.
    pub fn chord(&self) -> f32 {
        self.chord
    }

    /// Samples a point of the world in proportion to the emission there. Returns the point and its
    /// density per unit of volume.
    pub fn sample(&self, u: Vec2) -> (Vec3, f32) {
        let (p, pdf) = self.table.sample(u);
        let across = p.x * (self.size[0] * self.size[1]) as f32;
        let cell = (across as usize).min(self.size[0] * self.size[1] - 1);
        let (x, y) = (cell % self.size[0], cell / self.size[0]);
        // The two numbers have chosen the cell and two of three coordinates, so the third
        // coordinate needs another number.
        let third = rng::uniform2([u.x.to_bits(), u.y.to_bits(), 71, 3]).x;
        let inside = (across - cell as f32).clamp(0.0, rng::ONE_MINUS_EPSILON);
        let local = Vec3::new(
            (x as f32 + inside) / self.size[0] as f32,
            (y as f32 + third) / self.size[1] as f32,
            p.y,
        );
        let world = self.grid_from_world.inverse().transform_point3(local.as_dvec3()).as_vec3();
        (world, (f64::from(pdf) / self.volume) as f32)
    }

    /// Density per unit of volume with which [`Self::sample`] samples a point of the world.
    pub fn pdf(&self, p: Vec3) -> f32 {
        let local = self.grid_from_world.transform_point3(p.as_dvec3()).as_vec3();
        if !(local.cmpge(Vec3::ZERO).all() && local.cmplt(Vec3::ONE).all()) {
            return 0.0;
        }
        let cell = |axis: usize| {
            ((local[axis] * self.size[axis] as f32) as usize).min(self.size[axis] - 1)
        };
        let column = cell(1) * self.size[0] + cell(0);
        let at = Vec2::new((column as f32 + 0.5) / (self.size[0] * self.size[1]) as f32, local.z);
        (f64::from(self.table.pdf(at)) / self.volume) as f32
    }

    /// Radiance emitted per scene unit of length at a point of the world.
    pub fn emission(&self, p: Vec3, mode: ColorMode) -> SampledSpectrum {
        let local = self.grid_from_world.transform_point3(p.as_dvec3()).as_vec3();
        self.grid.emission(local, mode)
    }
}

/// Mean luminance of the emission in a cell of the table.
fn mean_in_cell(grid: &TrackedGrid, size: [usize; 3], cell: [usize; 3]) -> f32 {
    let mut sum = 0.0;
    for k in 0..POINTS * POINTS * POINTS {
        let offset = [k % POINTS, k / POINTS % POINTS, k / POINTS / POINTS];
        let at = |axis: usize| {
            (cell[axis] as f32 + (offset[axis] as f32 + 0.5) / POINTS as f32) / size[axis] as f32
        };
        let luminance = ColorMode::Rgb
            .to_rgb(grid.emission(Vec3::new(at(0), at(1), at(2)), ColorMode::Rgb))
            .luminance();
        if luminance > 0.0 && luminance.is_finite() {
            sum += luminance;
        }
    }
    sum / (POINTS * POINTS * POINTS) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::{Grid, ScalarGrid};
    use snell_math::{DVec3, Rgb};

    fn flame() -> Glow {
        let n = 12;
        let value = |i: usize| if i % n > 7 && i / n % n < 4 { (i % 5) as f32 } else { 0.0 };
        let density =
            ScalarGrid::new([n; 3], (0..n * n * n).map(value).collect()).expect("as many as cells");
        let place = DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0))
            * DAffine3::from_rotation_y(0.4)
            * DAffine3::from_scale(DVec3::new(2.0, 1.0, 0.5));
        let grid = Grid {
            emission: Rgb::new(3.0, 1.0, 0.2),
            ..Grid::new(Rgb::WHITE, Rgb::BLACK, 0.0, density, place)
        };
        Glow::new(&TrackedGrid::new(&grid)).expect("it glows")
    }

    #[test]
    fn samples_have_the_stated_density_and_find_all_that_glows() {
        let glow = flame();
        let n = 1u32 << 14;
        let (mut volume, mut light) = (0.0, 0.0);
        for i in 0..n {
            let (p, pdf) = glow.sample(rng::uniform2([i, 5, 5, 5]));
            assert!((glow.pdf(p) / pdf - 1.0).abs() < 0.02, "{p}: {pdf} but {}", glow.pdf(p));
            assert!(glow.bounds().max.as_vec3().cmpge(p - 1e-4).all(), "{p}");
            volume += 1.0 / f64::from(pdf);
            light += f64::from(
                ColorMode::Rgb.to_rgb(glow.emission(p, ColorMode::Rgb)).luminance() / pdf,
            );
        }
        let light = light / f64::from(n);
        assert!((light / glow.intensity() - 1.0).abs() < 0.1, "{light} but {}", glow.intensity());
        assert!(volume / f64::from(n) <= glow.volume * 1.05);
    }

    /// Chi-squared test over blocks of the grid, against the integral of the density over each
    /// block.
    #[test]
    fn points_are_distributed_by_their_density() {
        use snell_math::statistics::{chi_squared_deviation, sidak_deviation};
        let glow = flame();
        let [columns, rows, layers] = [4usize, 7, 6];
        let cell = |p: Vec3| {
            let local = glow.grid_from_world.transform_point3(p.as_dvec3());
            let at = |x: f64, n: usize| ((x.max(0.0) * n as f64) as usize).min(n - 1);
            (at(local.z, layers) * rows + at(local.y, rows)) * columns + at(local.x, columns)
        };
        let (mut expected, mut found) =
            (vec![0.0; columns * rows * layers], vec![0u32; columns * rows * layers]);
        // This number of points divides evenly into blocks, and into cells of the table.
        let side = 84;
        let world_from_grid = glow.grid_from_world.inverse();
        let at = |i: usize| (i as f64 + 0.5) / side as f64;
        for i in 0..side * side * side {
            let local =
                snell_math::DVec3::new(at(i % side), at(i / side % side), at(i / side / side));
            let p = world_from_grid.transform_point3(local).as_vec3();
            expected[cell(p)] += f64::from(glow.pdf(p)) * glow.volume / (side * side * side) as f64;
        }
        let total: f64 = expected.iter().sum();
        assert!((total - 1.0).abs() < 2e-3, "{total}");
        let n = 40_000;
        for i in 0..n {
            found[cell(glow.sample(rng::uniform2([i, 5, 6, 5])).0)] += 1;
        }
        expected.iter_mut().for_each(|e| *e *= f64::from(n) / total);
        let z = chi_squared_deviation(&found, &expected);
        assert!(z < sidak_deviation(0.01, 1), "{z} standard deviations");
    }

    #[test]
    fn what_does_not_glow_is_no_light() {
        let dark = Grid::new(
            Rgb::WHITE,
            Rgb::WHITE,
            0.0,
            ScalarGrid::new([1; 3], vec![1.0]).expect("one"),
            DAffine3::IDENTITY,
        );
        assert!(Glow::new(&TrackedGrid::new(&dark)).is_none());
    }
}
