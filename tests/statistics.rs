//! How to judge noisy pictures: means with standard errors, and z-tests between two renders of what should be one picture.

use crate::colors;
use snell_render::Film;

/// A mean with its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Standard error of the mean.
    pub error: f64,
}

/// Relative rounding of single precision over a whole picture: differences below it are no evidence.
const ROUNDING: f64 = 1e-5;

impl Estimate {
    /// By how many standard errors the mean misses `expected`.
    pub fn z(&self, expected: f64) -> f64 {
        (self.mean - expected) / self.error.hypot(ROUNDING * expected.abs()).max(f64::MIN_POSITIVE)
    }

    /// By how many standard errors two independent means differ.
    pub fn z_against(&self, other: &Self) -> f64 {
        let rounding = ROUNDING * self.mean.abs().max(other.mean.abs());
        (self.mean - other.mean) / self.error.hypot(other.error).hypot(rounding).max(f64::MIN_POSITIVE)
    }
}

/// Mean of a picture per channel.
pub fn image_mean(film: &Film) -> [Estimate; 3] {
    let (values, variances) = (colors(&film.image()), colors(&film.variance()));
    let n = values.len() as f64;
    [0, 1, 2].map(|c| Estimate {
        mean: values.iter().map(|v| v[c]).sum::<f64>() / n,
        error: variances.iter().map(|v| v[c]).sum::<f64>().sqrt() / n,
    })
}

/// How well a picture agrees with another one, or with what it should be.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// z of the mean of the whole picture, of the channel where it is largest.
    pub mean_z: f64,
    /// Mean of z^2 over blocks of pixels and channels: 1 if all differences are noise.
    pub chi2: f64,
}

impl Agreement {
    /// # Panics
    /// If the difference is more than noise.
    pub fn check(&self, what: &str) {
        eprintln!("{what}: z {:+.2}, chi2 {:.2}", self.mean_z, self.chi2);
        assert!(self.mean_z.abs() < 3.0, "{what}: {self:?}");
        assert!(self.chi2 < 1.6, "{what}: {self:?}");
    }
}

/// Pixels along the side of a block.
const BLOCK: usize = 4;

/// Means of the blocks of a picture with their standard errors, per channel.
fn blocks(film: &Film) -> Vec<[Estimate; 3]> {
    let [width, height] = film.crop.size().map(|s| s as usize);
    let (values, variances) = (colors(&film.image()), colors(&film.variance()));
    let mut blocks = Vec::new();
    for y0 in (0..height).step_by(BLOCK) {
        for x0 in (0..width).step_by(BLOCK) {
            let pixels: Vec<usize> = (y0..(y0 + BLOCK).min(height))
                .flat_map(|y| (x0..(x0 + BLOCK).min(width)).map(move |x| y * width + x))
                .collect();
            let n = pixels.len() as f64;
            blocks.push([0, 1, 2].map(|c| Estimate {
                mean: pixels.iter().map(|&p| values[p][c]).sum::<f64>() / n,
                error: pixels.iter().map(|&p| variances[p][c]).sum::<f64>().sqrt() / n,
            }));
        }
    }
    blocks
}

fn agreement(mean_z: [f64; 3], block_z: impl Iterator<Item = f64>) -> Agreement {
    let mean_z = mean_z.into_iter().fold(0.0, |a: f64, z| if z.abs() > a.abs() { z } else { a });
    let (sum, count) = block_z.fold((0.0, 0.0), |(s, n), z| (s + z * z, n + 1.0));
    Agreement { mean_z, chi2: sum / count }
}

/// Compares two independent renders of the same picture.
pub fn compare(a: &Film, b: &Film) -> Agreement {
    let (mean_a, mean_b) = (image_mean(a), image_mean(b));
    let (blocks_a, blocks_b) = (blocks(a), blocks(b));
    let z = blocks_a.iter().zip(&blocks_b).flat_map(|(a, b)| [0, 1, 2].map(|c| a[c].z_against(&b[c])));
    agreement([0, 1, 2].map(|c| mean_a[c].z_against(&mean_b[c])), z)
}

/// Compares a render with what each of its pixels should be.
///
/// # Panics
/// If the numbers of pixels differ.
pub fn compare_exact(film: &Film, expected: &[[f64; 3]]) -> Agreement {
    let (values, variances) = (colors(&film.image()), colors(&film.variance()));
    assert_eq!(values.len(), expected.len());
    let n = values.len() as f64;
    let mean_z = image_mean(film);
    let mean_z = [0, 1, 2].map(|c| mean_z[c].z(expected.iter().map(|e| e[c]).sum::<f64>() / n));
    let z = (0..values.len()).flat_map(|i| {
        [0, 1, 2].map(|c| Estimate { mean: values[i][c], error: variances[i][c].sqrt() }.z(expected[i][c]))
    });
    agreement(mean_z, z)
}
