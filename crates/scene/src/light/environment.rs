//! Light from all directions, importance sampled.
//!
//! An image is looked up with bilinear interpolation. A direction is drawn in two steps: a cell of a latitude-longitude table with
//! probability proportional to the interpolated luminance in it times its solid angle, then a direction uniform in the solid angle
//! of the cell (a rectangle in longitude and height). So the density is constant over each cell and finite at the poles.

use crate::graph::Environment;
use crate::image::Image;
use snell_math::distribution::Distribution1D;
use snell_math::{ColorMode, DMat3, DVec3, Mat3, Rgb, SampledSpectrum, Vec2, Vec3, sampling};
use std::f32::consts::{FRAC_1_PI, TAU};
use std::f64::consts::PI as PI64;
use std::sync::Arc;

/// An environment prepared for lookups and sampling.
#[derive(Debug)]
pub struct EnvironmentLight {
    kind: Kind,
    mean_luminance: f64,
}

#[derive(Debug)]
enum Kind {
    Constant(Rgb),
    Image(Box<ImageLight>),
}

#[derive(Debug)]
struct ImageLight {
    width: usize,
    height: usize,
    /// Scaled radiance, row by row from the zenith.
    texels: Vec<Rgb>,
    world_from_environment: Mat3,
    /// Choice of a row of the table, then of a column in it.
    rows: Distribution1D,
    columns: Vec<Distribution1D>,
    /// Cosines of the polar angles of the edges of the rows.
    edges: Vec<f64>,
}

impl EnvironmentLight {
    /// Prepares an environment (builds the sampling tables of an image). Values that are negative or not finite count as 0, and
    /// the alpha of an image is ignored. Of the transform only the rotation (and mirroring) is used.
    pub fn new(environment: &Environment) -> Self {
        match environment {
            Environment::Constant(color) => {
                let color = color.map(sane);
                Self { kind: Kind::Constant(color), mean_luminance: color.luminance().into() }
            }
            Environment::Image { image, scale, world_from_environment } => {
                let light = ImageLight::new(image, scale.map(sane), world_from_environment.matrix3);
                Self { mean_luminance: light.1, kind: Kind::Image(Box::new(light.0)) }
            }
        }
    }

    /// Radiance arriving along a ray that leaves the scene in this unit direction.
    pub fn radiance(&self, direction: Vec3, mode: ColorMode) -> SampledSpectrum {
        mode.illuminant(match &self.kind {
            Kind::Constant(color) => *color,
            Kind::Image(light) => light.radiance(direction),
        })
    }

    /// A unit direction from which light comes, and its density per steradian. The density is positive, and 0 nowhere where there
    /// is light.
    pub fn sample(&self, u: Vec2) -> (Vec3, f32) {
        match &self.kind {
            Kind::Constant(_) => (sampling::uniform_sphere(u), sampling::UNIFORM_SPHERE_PDF),
            Kind::Image(light) => light.sample(u),
        }
    }

    /// Density per steradian with which [`Self::sample`] gives this unit direction.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        match &self.kind {
            Kind::Constant(_) => sampling::UNIFORM_SPHERE_PDF,
            Kind::Image(light) => light.pdf(direction),
        }
    }

    /// True if the radiance is the same from everywhere: on diffuse surfaces sampling the BSDF is then the better choice.
    pub fn is_constant(&self) -> bool {
        matches!(self.kind, Kind::Constant(_))
    }

    /// Mean radiance over the sphere (luminance). Finite and not negative.
    pub fn mean_luminance(&self) -> f64 {
        self.mean_luminance
    }
}

/// Largest radiance that counts, so that sums over a whole image stay finite.
const MAX_RADIANCE: f32 = 1e30;
/// Largest table; larger images are summed up.
const MAX_TABLE: [usize; 2] = [2048, 1024];
/// Each cell with any light, and each row, is drawn at least this often relative to the mean. Otherwise what is dim beside a sun
/// would vanish in the rounding of the tables.
const FLOOR: f32 = 1e-3;

fn sane(x: f32) -> f32 {
    if x > 0.0 && x.is_finite() { x.min(MAX_RADIANCE) } else { 0.0 }
}

impl ImageLight {
    /// The light and its mean luminance.
    fn new(image: &Arc<Image>, scale: Rgb, matrix: DMat3) -> (Self, f64) {
        let texels = texels(image, scale);
        let (w, h) = (image.width as usize, image.height as usize);
        let luminance = smoothed_luminance(&texels, w, h);
        let [columns, rows] = [w.min(MAX_TABLE[0]), h.min(MAX_TABLE[1])];
        let mut table = Vec::with_capacity(rows);
        let mut sums = Vec::with_capacity(rows);
        let mut mean_luminance = 0.0;
        for row in 0..rows {
            let cells: Vec<f32> =
                (0..columns).map(|column| block_mean(&luminance, [w, h], [column, row], [columns, rows])).collect();
            let mean = cells.iter().map(|&c| f64::from(c)).sum::<f64>() / columns as f64;
            let floor = mean as f32 * FLOOR;
            table.push(Distribution1D::new(
                &cells.iter().map(|&c| if c > 0.0 { c.max(floor) } else { 0.0 }).collect::<Vec<_>>(),
            ));
            // The share of the row in the sphere.
            let share = (row_cos(row, rows) - row_cos(row + 1, rows)) * 0.5;
            mean_luminance += mean * share;
            sums.push((mean * share) as f32);
        }
        let floor = FLOOR * (mean_luminance / rows as f64) as f32;
        let sums: Vec<f32> = sums.iter().map(|&s| if s > 0.0 { s.max(floor) } else { 0.0 }).collect();
        let world_from_environment = rotation(matrix);
        let edges = (0..=rows).map(|row| row_cos(row, rows)).collect();
        let rows = Distribution1D::new(&sums);
        (Self { width: w, height: h, texels, world_from_environment, rows, columns: table, edges }, mean_luminance)
    }

    /// Longitude and latitude of a direction as a point of the unit square.
    fn to_square(&self, direction: Vec3) -> Vec2 {
        let d = self.world_from_environment.transpose() * direction;
        let phi = d.x.atan2(-d.z);
        let theta = d.x.hypot(d.z).atan2(d.y);
        let p = Vec2::new(0.5 + phi * (0.5 * FRAC_1_PI), theta * FRAC_1_PI);
        if p.is_nan() { Vec2::splat(0.5) } else { p }
    }

    fn radiance(&self, direction: Vec3) -> Rgb {
        let p = self.to_square(direction);
        let x = p.x * self.width as f32 - 0.5;
        let y = p.y * self.height as f32 - 0.5;
        let (fx, fy) = (x - x.floor(), y - y.floor());
        // Around the sides, and clamped at the poles.
        let around = |x: f32| if x < 0.0 { self.width - 1 } else { x as usize % self.width };
        let columns = [around(x.floor()), around(x.floor() + 1.0)];
        let row = |y: f32| (y.max(0.0) as usize).min(self.height - 1) * self.width;
        let blend = |row: usize| self.texels[row + columns[0]] * (1.0 - fx) + self.texels[row + columns[1]] * fx;
        blend(row(y.floor())) * (1.0 - fy) + blend(row(y.floor() + 1.0)) * fy
    }

    fn sample(&self, u: Vec2) -> (Vec3, f32) {
        let (row, v) = self.rows.sample(u.y);
        let (column, s) = self.columns[row].sample(u.x);
        let (top, bottom) = (self.edges[row], self.edges[row + 1]);
        let cos = top + (bottom - top) * f64::from(v);
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let phi = ((column as f64 + f64::from(s)) / self.columns[row].len() as f64 - 0.5) * (2.0 * PI64);
        let (sin_phi, cos_phi) = phi.sin_cos();
        let direction = DVec3::new(sin * sin_phi, cos, -sin * cos_phi).as_vec3();
        (self.world_from_environment * direction, self.cell_pdf(row, column))
    }

    fn pdf(&self, direction: Vec3) -> f32 {
        let p = self.to_square(direction);
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
    // The sine of the angle from the horizon: exact at the poles and symmetric.
    (PI64 * (0.5 - row as f64 / rows as f64)).sin()
}

/// The nearest rotation (or rotation with mirroring) that keeps the first axis' direction; the identity if there is none.
fn rotation(m: DMat3) -> Mat3 {
    let unit = |v: DVec3| v.try_normalize().filter(|v| v.is_finite());
    let orthonormal = || {
        let y = unit(m.y_axis)?;
        let z = unit(m.z_axis - y * y.dot(m.z_axis))?;
        let x = y.cross(z);
        Some(DMat3::from_cols(if x.dot(m.x_axis) < 0.0 { -x } else { x }, y, z))
    };
    orthonormal().unwrap_or(DMat3::IDENTITY).as_mat3()
}

/// Scaled radiance of every texel.
fn texels(image: &Image, scale: Rgb) -> Vec<Rgb> {
    let texel = |x, y| {
        let [r, g, b, _] = image.rgba(x, y);
        (Rgb::new(sane(r), sane(g), sane(b)) * scale).map(sane)
    };
    (0..image.height).flat_map(|y| (0..image.width).map(move |x| texel(x, y))).collect()
}

/// Mean luminance over each texel's square of the bilinear interpolation: the image filtered by `[1 6 1] / 8` both ways. It is
/// positive wherever any of the interpolated radiance is.
fn smoothed_luminance(texels: &[Rgb], w: usize, h: usize) -> Vec<f32> {
    let plain: Vec<f32> = texels.iter().map(|t| sane(t.luminance())).collect();
    let filter = |a: f32, b: f32, c: f32| (a + c) * 0.125 + b * 0.75;
    let mut across = Vec::with_capacity(w * h);
    for row in plain.chunks_exact(w) {
        across.extend((0..w).map(|x| filter(row[(x + w - 1) % w], row[x], row[(x + 1) % w])));
    }
    let at = |x: usize, y: usize| across[y * w + x];
    let mut both = Vec::with_capacity(w * h);
    for y in 0..h {
        both.extend((0..w).map(|x| filter(at(x, y.saturating_sub(1)), at(x, y), at(x, (y + 1).min(h - 1)))));
    }
    both
}

/// Mean of all texels that a cell of a smaller (or equal) table touches.
fn block_mean(values: &[f32], [w, h]: [usize; 2], [column, row]: [usize; 2], [columns, rows]: [usize; 2]) -> f32 {
    let range = |i: usize, cells: usize, texels: usize| (i * texels / cells, ((i + 1) * texels).div_ceil(cells));
    let ((x0, x1), (y0, y1)) = (range(column, columns, w), range(row, rows, h));
    let sum: f64 = (y0..y1).flat_map(|y| &values[y * w + x0..y * w + x1]).map(|&v| f64::from(v)).sum();
    (sum / ((x1 - x0) * (y1 - y0)) as f64) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::DAffine3;
    use snell_math::rng::uniform2;
    use std::f32::consts::PI;

    fn light(width: u32, height: u32, rgb: impl Fn(u32, u32) -> [f32; 3], rotated: f64) -> EnvironmentLight {
        let values = (0..height).flat_map(|y| (0..width).flat_map(|x| rgb(x, y)).collect::<Vec<_>>()).collect();
        let world_from_environment = DAffine3::from_rotation_x(rotated) * DAffine3::from_rotation_y(0.4 * rotated);
        EnvironmentLight::new(&Environment::Image {
            image: Arc::new(Image::from_f32(width, height, 3, values)),
            scale: Rgb::WHITE,
            world_from_environment,
        })
    }

    fn gradient() -> EnvironmentLight {
        light(32, 16, |x, y| [(x % 7) as f32, if y < 3 { 5.0 } else { 0.2 }, f32::from(x == 20 && y == 5) * 900.0], 0.9)
    }

    /// Integral over the sphere by a fine grid in world longitude and height.
    fn integrate(f: impl Fn(Vec3) -> f64) -> f64 {
        let (n, m) = (1200, 600);
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..m {
                let phi = (f64::from(i) + 0.5) / f64::from(n) * 2.0 * PI64;
                let z = 1.0 - 2.0 * (f64::from(j) + 0.5) / f64::from(m);
                let r = (1.0 - z * z).sqrt();
                sum += f(DVec3::new(r * phi.cos(), r * phi.sin(), z).as_vec3());
            }
        }
        sum * 4.0 * PI64 / f64::from(n * m)
    }

    fn red(light: &EnvironmentLight, d: Vec3) -> f64 {
        light.radiance(d, ColorMode::Rgb)[0].into()
    }

    #[test]
    fn the_picture_is_oriented_as_documented() {
        // Columns: left quarter is -x, middle -z, right quarter +x, edges +z. Row 0 is the zenith.
        let l = light(64, 32, |x, y| [x as f32, y as f32, 0.0], 0.0);
        let at = |d| l.radiance(d, ColorMode::Rgb);
        assert!((at(Vec3::NEG_Z)[0] - 31.5).abs() < 1e-3 && (at(Vec3::NEG_Z)[1] - 15.5).abs() < 1e-3);
        assert!((at(Vec3::X)[0] - 47.5).abs() < 1e-3 && (at(Vec3::NEG_X)[0] - 15.5).abs() < 1e-3);
        assert_eq!((at(Vec3::Y)[1], at(Vec3::NEG_Y)[1]), (0.0, 31.0));
        // Across the seam the picture continues.
        assert!((at(Vec3::Z)[0] - 31.5).abs() < 1e-3);
    }

    #[test]
    fn the_rotation_turns_the_picture_into_the_world() {
        let world_from_environment = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let mut values = vec![0.0; 8 * 4 * 3];
        values[..24].fill(1.0);
        let image = Arc::new(Image::from_f32(8, 4, 3, values));
        let l = EnvironmentLight::new(&Environment::Image { image, scale: Rgb::splat(2.0), world_from_environment });
        // +y goes to +z.
        assert_eq!((red(&l, Vec3::Z), red(&l, Vec3::NEG_Z)), (2.0, 0.0));
    }

    #[test]
    fn the_density_integrates_to_one() {
        for l in [gradient(), light(5, 3, |x, _| [x as f32; 3], 0.3), light(1, 1, |_, _| [1.0; 3], 0.0)] {
            let integral = integrate(|d| l.pdf(d).into());
            assert!((integral - 1.0).abs() < 2e-3, "{integral}");
        }
    }

    #[test]
    fn samples_fall_into_cells_with_their_density() {
        let l = gradient();
        // Coarse cells of the environment: chi squared against the integral of the density over each.
        let cell = |d: Vec3| {
            let x = (d.y.atan2(d.x) + PI) / TAU * 12.0;
            let y = (d.z + 1.0) * 3.0;
            (x as usize).min(11) + 12 * (y as usize).min(5)
        };
        let mut expected = [0.0f64; 72];
        let (n, m) = (1200, 600);
        for i in 0..n {
            for j in 0..m {
                let phi = (f64::from(i) + 0.5) / f64::from(n) * 2.0 * PI64;
                let z = 1.0 - 2.0 * (f64::from(j) + 0.5) / f64::from(m);
                let r = (1.0 - z * z).sqrt();
                let d = DVec3::new(r * phi.cos(), r * phi.sin(), z).as_vec3();
                expected[cell(d)] += f64::from(l.pdf(d)) * 4.0 * PI64 / f64::from(n * m);
            }
        }
        let mut counts = [0u32; 72];
        let samples = 200_000;
        for i in 0..samples {
            let (d, pdf) = l.sample(uniform2([i, 9, 8, 7]));
            assert!(d.is_normalized() && pdf > 0.0 && pdf.is_finite());
            counts[cell(d)] += 1;
        }
        let chi2: f64 = (0..72)
            .filter(|&k| expected[k] > 1e-6)
            .map(|k| {
                (f64::from(counts[k]) - expected[k] * f64::from(samples)).powi(2) / (expected[k] * f64::from(samples))
            })
            .sum();
        // 71 degrees of freedom; the quadrature of the bright cell adds a little. 99.99 % lie below 123.
        assert!(chi2 < 123.0, "{chi2}");
    }

    #[test]
    fn the_density_of_a_sample_is_that_of_its_direction() {
        let l = gradient();
        let n = 20_000;
        let mut different = 0;
        for i in 0..n {
            let (d, pdf) = l.sample(uniform2([i, 1, 2, 3]));
            different += u32::from(l.pdf(d) != pdf);
        }
        // Only directions on the edge of a cell may round into the next.
        assert!(different <= n / 2000, "{different}");
    }

    #[test]
    fn the_irradiance_estimated_by_samples_matches_quadrature() {
        let l = gradient();
        let normal = Vec3::new(0.6, 0.64, 0.48);
        let expected = integrate(|d| red(&l, d) * f64::from(d.dot(normal).max(0.0)));
        let n = 100_000;
        let values: Vec<f64> = (0..n)
            .map(|i| {
                let (d, pdf) = l.sample(uniform2([i, 4, 4, 4]));
                red(&l, d) * f64::from(d.dot(normal).max(0.0)) / f64::from(pdf)
            })
            .collect();
        let mean = values.iter().sum::<f64>() / f64::from(n);
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n);
        let error = (variance / f64::from(n)).sqrt();
        assert!((mean - expected).abs() < 3.0 * error + 1e-3 * expected, "{mean} +- {error}, expected {expected}");
    }

    #[test]
    fn light_anywhere_has_positive_density_even_beside_a_sun() {
        let l = light(512, 256, |x, y| [if (x, y) == (100, 40) { 1e7 } else { f32::from(y < 200) * 0.05 }; 3], 0.0);
        for i in 0..20_000 {
            let d = sampling::uniform_sphere(uniform2([i, 0, 0, 1]));
            assert!(red(&l, d) == 0.0 || l.pdf(d) > 0.0, "{d}");
        }
        let quadrature = integrate(|d| red(&l, d)) / (4.0 * PI64);
        assert!((l.mean_luminance() / quadrature - 1.0).abs() < 0.2, "{} {quadrature}", l.mean_luminance());
    }

    #[test]
    fn the_mean_luminance_is_the_mean_over_the_sphere() {
        let l = light(64, 32, |x, y| [x as f32 * 0.1, y as f32, 0.5], 0.7);
        let expected = integrate(|d| {
            let s = l.radiance(d, ColorMode::Rgb);
            ColorMode::Rgb.to_rgb(s).luminance().into()
        }) / (4.0 * PI64);
        assert!((l.mean_luminance() / expected - 1.0).abs() < 2e-3, "{} {expected}", l.mean_luminance());
    }

    #[test]
    fn broken_pixels_and_black_pictures_do_no_harm() {
        let broken =
            light(8, 4, |x, y| [[f32::NAN, f32::INFINITY, -1.0, 1.0][(x % 4) as usize], y as f32, f32::MAX], 0.0);
        let black = light(4, 2, |_, _| [0.0; 3], 0.0);
        for l in [broken, black] {
            assert!(l.mean_luminance().is_finite() && l.mean_luminance() >= 0.0);
            for i in 0..2000 {
                let (d, pdf) = l.sample(uniform2([i, 0, 7, 0]));
                assert!(d.is_normalized() && pdf.is_finite() && pdf > 0.0 && l.radiance(d, ColorMode::Rgb).is_finite());
            }
        }
        let l = gradient();
        for d in [Vec3::Y, Vec3::NEG_Y, Vec3::ZERO, Vec3::splat(f32::NAN)] {
            assert!(l.pdf(d).is_finite() && l.radiance(d, ColorMode::Rgb).is_finite());
        }
    }

    #[test]
    fn a_table_smaller_than_the_image_still_covers_all_light() {
        let luminance: Vec<f32> = (0..7 * 5).map(|i| f32::from(i == 17)).collect();
        let touched = (0..3)
            .flat_map(|r| (0..4).map(move |c| (c, r)))
            .filter(|&(c, r)| block_mean(&luminance, [7, 5], [c, r], [4, 3]) > 0.0)
            .count();
        assert!(touched >= 1);
        assert_eq!(block_mean(&[3.0; 35], [7, 5], [3, 2], [4, 3]), 3.0);
    }

    #[test]
    fn a_constant_environment_is_the_same_everywhere() {
        let l = EnvironmentLight::new(&Environment::Constant(Rgb::new(1.0, 2.0, 3.0)));
        assert!(l.is_constant());
        assert_eq!(l.radiance(Vec3::X, ColorMode::Rgb).0, [1.0, 2.0, 3.0, 0.0]);
        assert_eq!(l.pdf(Vec3::X), sampling::UNIFORM_SPHERE_PDF);
        assert!((l.mean_luminance() - 1.8596).abs() < 1e-4);
    }
}
