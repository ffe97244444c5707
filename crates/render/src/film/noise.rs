//! The error of a pixel's value, and the decision when the pixel has enough samples.
//!
//! **The error of a pixel.** Its *intensity* I is the mean of its linear red, green and blue.
//! Samples come in blocks of [`BLOCK`], and each block gives an independent estimate of I
//! ([`crate::sampler::Sampler::in_blocks`]). Student's t thus gives a 95 % confidence interval I ±
//! h from the mean and the spread of the blocks. The error is h in *tone-mapped units*, which are
//! those of the curve T(I) = ln(1 + I / f). The slope of that curve turns h into
//!
//! ```text
//! error = h / (I + f)
//! ```
//!
//! For intensities well above the floor f this is the relative error. In the dark it is an absolute
//! error, because relative errors are invisible there. f is 0.1 divided by the exposure; middle
//! grey is 0.18. An error of 0.02 means a half-width of 2.2 % of the intensity at white, of 3.1 %
//! at middle grey, and of 0.002 times white at black.
//!
//! **When a pixel stops.** It is checked after 128 samples and whenever the number of samples has
//! grown by a quarter. It stops when its error is small enough, and would also be small enough with
//! the mean deviation of the blocks of the 3 x 3 pixels around it, and with the mean variance of
//! those of 9 x 9 pixels, in tone-mapped units: the few blocks of one pixel may agree by chance, or
//! all miss rare light that the pixels around have seen. (That pixels decide together is the idea
//! of Dammertz et al., A Hierarchical Automatic Stopping Condition for Monte Carlo Global
//! Illumination, 2010.) Since variances are shared, not their maximum, a picture takes at most
//! about twice the samples that its pixels would need alone if their variances were known.
//!
//! Checking repeatedly whether an interval has shrunk to a given width is the sequential procedure
//! of Chow and Robbins (On the asymptotic theory of fixed-width sequential confidence intervals,
//! 1965). As the width goes to zero, the interval covers with the stated probability and the mean
//! converges to the true value, for any finite variance. At a finite width, pixels whose blocks
//! agree by chance stop first, so the deviation of a pixel alone is a little too small. The
//! reported interval uses a deviation a quarter of the way from the pixel's own to the mean of the
//! 3 x 3 pixels when it stopped.

use super::{BLOCK, Film};
use crate::settings::Crop;
use snell_math::real;

/// The number of samples before a pixel may stop.
pub const LEAST_SAMPLES: u32 = 8 * BLOCK;

/// The distance in pixels to which the window reaches that shares its variance.
const REACH: usize = 4;

/// Where the deviation of the reported interval lies between that of the pixel alone (0) and
/// [`NoiseMap::cautious_deviation`] (1). The value was found by experiments on pixels of the
/// Cornell box and on random numbers from normal to log-normal ones.
const CAUTION: f64 = 0.25;

/// The intensity of each pixel of a film, row by row, with its confidence interval.
#[derive(Clone, Debug)]
pub struct NoiseMap {
    size: [usize; 2],
    pixels: Vec<Pixel>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Pixel {
    intensity: f64,
    /// The number of whole blocks.
    blocks: u32,
    /// Standard deviation of the intensity of one block.
    deviation: f64,
    /// [`NoiseMap::cautious_deviation`] when the pixel stopped.
    decided: Option<f64>,
}

impl Pixel {
    /// Half of the width of the 95 % confidence interval, for a given standard deviation of blocks.
    fn half_width(&self, deviation: f64) -> f64 {
        match self.blocks {
            0 | 1 => f64::INFINITY,
            n => student_t(n - 1) * deviation / f64::from(n).sqrt(),
        }
    }

    /// A difference of intensities in tone-mapped units.
    fn relative(&self, difference: f64, floor: f64) -> f64 {
        difference / (self.intensity.max(0.0) + floor)
    }
}

impl NoiseMap {
    /// The noise map of a film.
    pub fn new(film: &Film) -> Self {
        let size = film.crop.size().map(|s| s as usize);
        let mut pixels = vec![Pixel::default(); size[0] * size[1]];
        for tile in &film.tiles {
            for (number, [x, y]) in positions(&tile.area).enumerate() {
                let [column, row] =
                    [x - film.crop.min[0], y - film.crop.min[1]].map(|p| p as usize);
                let intensity = (0..3).map(|channel| tile.mean(number, channel)).sum::<f64>() / 3.0;
                let blocks = tile.taken(number) / BLOCK;
                let (n, [sum, square]) = (f64::from(blocks.max(2)), tile.blocks_of(number));
                let deviation = ((square - sum * sum / n).max(0.0) / (n - 1.0)).sqrt();
                let decided = tile.decided.get(number).copied().flatten();
                pixels[row * size[0] + column] = Pixel { intensity, blocks, deviation, decided };
            }
        }
        Self { size, pixels }
    }

    /// The estimate of a pixel's intensity.
    pub fn intensity(&self, pixel: usize) -> f64 {
        self.pixels[pixel].intensity
    }

    /// Half of the width of the 95 % confidence interval of a pixel's intensity; infinite with
    /// fewer than two blocks of samples.
    pub fn half_width(&self, pixel: usize) -> f64 {
        let own = &self.pixels[pixel];
        own.half_width(own.deviation + (self.cautious_deviation(pixel) - own.deviation) * CAUTION)
    }

    /// The error of a pixel in tone-mapped units; infinite with fewer than two blocks of samples.
    pub fn error(&self, pixel: usize, floor: f64) -> f64 {
        self.half_width(pixel) / (self.pixels[pixel].intensity.max(0.0) + floor)
    }

    /// For each pixel, the root mean square over the window around it of the deviations of blocks
    /// in tone-mapped units.
    fn shared_deviations(&self, floor: f64) -> Vec<f64> {
        let variances = self.pixels.iter().map(|p| real::powi(p.relative(p.deviation, floor), 2));
        let sums = self.sums_around(&variances.collect::<Vec<_>>());
        let counts = self.sums_around(&vec![1.0; self.pixels.len()]);
        sums.iter().zip(counts).map(|(sum, count)| (sum / count).sqrt()).collect()
    }

    /// The sum over the window around each pixel.
    fn sums_around(&self, values: &[f64]) -> Vec<f64> {
        let [width, height] = self.size;
        let window = |p: usize, end: usize| p.saturating_sub(REACH)..(p + REACH + 1).min(end);
        let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        let rows: Vec<f64> =
            pixels().map(|[x, y]| values[y * width..][window(x, width)].iter().sum()).collect();
        pixels().map(|[x, y]| window(y, height).map(|y| rows[y * width + x]).sum()).collect()
    }

    /// The larger of a pixel's deviation and the mean over its 3 x 3 neighbourhood. For a pixel
    /// that has stopped, the value at which it stopped.
    fn cautious_deviation(&self, pixel: usize) -> f64 {
        if let Some(deviation) = self.pixels[pixel].decided {
            return deviation;
        }
        let [width, height] = self.size;
        let (column, row) = (pixel % width, pixel / width);
        let around = |p: usize, end: usize| p.saturating_sub(1)..(p + 2).min(end);
        let window =
            || around(row, height).flat_map(|y| around(column, width).map(move |x| y * width + x));
        let mean =
            window().map(|p| self.pixels[p].deviation).sum::<f64>() / window().count() as f64;
        self.pixels[pixel].deviation.max(mean)
    }
}

/// The positions of the pixels of an area, row by row.
pub fn positions(area: &Crop) -> impl Iterator<Item = [u32; 2]> + use<> {
    let Crop { min, max } = *area;
    (min[1]..max[1]).flat_map(move |y| (min[0]..max[0]).map(move |x| [x, y]))
}

/// Finds, among the active pixels of each tile (`None` means all), those whose error is still above
/// `noise`. The others stop.
pub fn unconverged(
    film: &mut Film,
    active: &[Option<Vec<u32>>],
    noise: f64,
    floor: f64,
) -> Vec<Option<Vec<u32>>> {
    let map = NoiseMap::new(film);
    let shared = map.shared_deviations(floor);
    let mut noisy = Vec::new();
    for (tile, active) in film.tiles.iter_mut().zip(active) {
        let mut pixels = Vec::new();
        for (position, number) in positions(&tile.area).zip(0..) {
            if active.as_ref().is_some_and(|a| a.binary_search(&number).is_err()) {
                continue;
            }
            let [column, row] = [0, 1].map(|axis| (position[axis] - film.crop.min[axis]) as usize);
            let pixel = row * map.size[0] + column;
            let own = &map.pixels[pixel];
            let of_window = shared[pixel] / own.relative(1.0, floor);
            let around = map.cautious_deviation(pixel);
            let deviation = around.max(of_window);
            if own.relative(own.half_width(deviation), floor) <= noise {
                tile.decided.resize(tile.pixels(), None);
                tile.decided[number as usize] = Some(around);
            } else {
                pixels.push(number);
            }
        }
        noisy.push(Some(pixels));
    }
    noisy
}

/// The number of samples at which a pixel is checked next, given the number at the last check.
pub fn next_look(samples: u32) -> u32 {
    match samples {
        0 => LEAST_SAMPLES,
        _ => samples.saturating_add((samples / 4).max(BLOCK)) / BLOCK * BLOCK,
    }
}

/// The 0.975 quantile of Student's distribution (Abramowitz and Stegun, Handbook of Mathematical
/// Functions, 26.7.5, and the exact values for one and two degrees of freedom).
fn student_t(degrees: u32) -> f64 {
    const Z: f64 = 1.959_963_984_540_054;
    let z = |p: i32| real::powi(Z, p);
    let v = f64::from(degrees);
    match degrees {
        0 => f64::INFINITY,
        1 => 12.706_204_736,
        2 => 4.302_652_730,
        _ => {
            Z + (z(3) + Z) / (4.0 * v)
                + (5.0 * z(5) + 16.0 * z(3) + 3.0 * Z) / (96.0 * real::powi(v, 2))
                + (3.0 * z(7) + 19.0 * z(5) + 17.0 * z(3) - 15.0 * Z) / (384.0 * real::powi(v, 3))
                + (79.0 * z(9) + 776.0 * z(7) + 1482.0 * z(5) - 1920.0 * z(3) - 945.0 * Z)
                    / (92160.0 * real::powi(v, 4))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{FilmPart, FilmSample, TILE};
    use super::*;
    use snell_math::{Rgb, rng};

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (degrees, quantile) in
            [(1, 12.706), (2, 4.303), (3, 3.182), (7, 2.365), (30, 2.042), (1000, 1.962)]
        {
            assert!(
                (student_t(degrees) - quantile).abs() < 5e-3,
                "{degrees}: {}",
                student_t(degrees)
            );
        }
    }

    #[test]
    fn rare_light_that_few_pixels_see_at_first_is_not_lost() {
        const SIZE: u32 = 32;
        const PROBABILITY: f32 = 3e-4;
        let sample = |pixel: u32, sample: u32| {
            let [even, rare] = rng::uniform2([pixel, sample, 3, 5]).to_array();
            let rare = if rare < PROBABILITY { 0.15 / PROBABILITY } else { 0.0 };
            FilmSample { color: Rgb::splat(0.35 + 0.3 * even + rare), alpha: 1.0, weight: 1.0 }
        };
        let mut film = Film::new(Crop::full([SIZE; 2]), &[]);
        let mut active = vec![None; film.tiles.len()];
        let (mut start, mut end) = (0, next_look(0));
        while end < 8000
            && active.iter().any(|a| a.as_ref().is_none_or(|a: &Vec<u32>| !a.is_empty()))
        {
            for (number, (tile, active)) in (0..).zip(film.tiles.iter_mut().zip(&active)) {
                let all = || (0..TILE * TILE).collect();
                let pixels: Vec<u32> = active.clone().unwrap_or_else(all);
                let values = pixels.iter().flat_map(|pixel| {
                    (start..end).map(move |s| sample(number * TILE * TILE + pixel, s))
                });
                let values = values.collect();
                let (area, samples, pixels) = (tile.area, [start, end], Some(pixels));
                let (aovs, keys) = (Vec::new(), Vec::new());
                tile.fold(&FilmPart { area, samples, pixels, values, aovs, keys });
            }
            active = unconverged(&mut film, &active, 0.05, 0.1);
            (start, end) = (end, next_look(end));
        }
        let map = NoiseMap::new(&film);
        let mean = (0..map.pixels.len()).map(|p| map.intensity(p)).sum::<f64>() / 1024.0;
        // If pixels decide by the 3 x 3 pixels around them, 37 % of the rare light is lost.
        assert!((mean - 0.65).abs() < 0.1 * 0.15, "{mean}");
    }

    #[test]
    fn looks_are_at_ends_of_blocks_and_never_stop() {
        let looks: Vec<u32> =
            std::iter::successors(Some(0), |&n| Some(next_look(n))).take(12).collect();
        assert_eq!(looks[..4], [0, 128, 160, 192]);
        assert!(looks.windows(2).all(|w| w[0] < w[1] && w[1] % BLOCK == 0));
    }
}
