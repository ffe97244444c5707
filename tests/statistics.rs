//! Statistics of noisy pictures: means with standard errors, and z-tests between two renders that
//! should agree.

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

/// Relative rounding error of single precision over a whole picture: smaller differences do not
/// count.
const ROUNDING: f64 = 1e-5;

impl Estimate {
    /// The difference of the mean from `expected`, in standard errors.
    pub fn z(&self, expected: f64) -> f64 {
        (self.mean - expected) / self.error.hypot(ROUNDING * expected.abs()).max(f64::MIN_POSITIVE)
    }

    /// The difference of two independent means, in standard errors.
    pub fn z_against(&self, other: &Self) -> f64 {
        let rounding = ROUNDING * self.mean.abs().max(other.mean.abs());
        (self.mean - other.mean)
            / self.error.hypot(other.error).hypot(rounding).max(f64::MIN_POSITIVE)
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

/// How well a picture agrees with another one, or with expected values.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// z of the mean of the whole picture, in the channel where it is largest.
    pub mean_z: f64,
    /// Mean of z^2 over blocks of pixels and channels: 1 if all differences are noise.
    pub chi2: f64,
    /// Number of blocks.
    pub blocks: usize,
}

impl Agreement {
    /// Prints the agreement, and asserts that the differences are noise.
    ///
    /// # Panics
    /// If the mean is off by more than 3 standard errors, or the blocks together by more than 4.
    /// (The channels may be equal, so they do not count as independent.)
    pub fn check(&self, what: &str) {
        eprintln!("{what}: z {:+.2}, chi2 {:.2} of {} blocks", self.mean_z, self.chi2, self.blocks);
        assert!(self.mean_z.abs() < 3.0, "{what}: {self:?}");
        assert!(self.chi2 < 1.0 + 4.0 * (2.0 / self.blocks as f64).sqrt(), "{what}: {self:?}");
    }
}

/// Pixels along the side of a block.
const BLOCK: usize = 4;

/// The pixels of each block of a picture.
fn block_pixels([width, height]: [u32; 2]) -> Vec<Vec<usize>> {
    let [width, height] = [width as usize, height as usize];
    let block = |x0: usize, y0: usize| {
        let rows = y0..(y0 + BLOCK).min(height);
        rows.flat_map(|y| (x0..(x0 + BLOCK).min(width)).map(move |x| y * width + x)).collect()
    };
    (0..height)
        .step_by(BLOCK)
        .flat_map(|y| (0..width).step_by(BLOCK).map(move |x| block(x, y)))
        .collect()
}

/// Means of the blocks of a picture with their standard errors, per channel.
fn block_means(film: &Film) -> Vec<[Estimate; 3]> {
    let (values, variances) = (colors(&film.image()), colors(&film.variance()));
    let mean = |pixels: Vec<usize>| {
        let n = pixels.len() as f64;
        [0, 1, 2].map(|c| Estimate {
            mean: pixels.iter().map(|&p| values[p][c]).sum::<f64>() / n,
            error: pixels.iter().map(|&p| variances[p][c]).sum::<f64>().sqrt() / n,
        })
    };
    block_pixels(film.crop.size()).into_iter().map(mean).collect()
}

/// The differences of all pixels and channels of two independent renders, in standard errors.
pub fn pixel_z(a: &Film, b: &Film) -> Vec<f64> {
    let estimates = |film: &Film| -> Vec<Estimate> {
        let pixels = colors(&film.image()).into_iter().zip(colors(&film.variance()));
        pixels
            .flat_map(|(mean, variance)| {
                [0, 1, 2].map(|c| Estimate { mean: mean[c], error: variance[c].sqrt() })
            })
            .collect()
    };
    estimates(a).iter().zip(estimates(b)).map(|(a, b)| a.z_against(&b)).collect()
}

fn agreement(mean_z: [f64; 3], block_z: &[[f64; 3]]) -> Agreement {
    let mean_z = mean_z.into_iter().fold(0.0, |a: f64, z| if z.abs() > a.abs() { z } else { a });
    let sum: f64 = block_z.iter().flatten().map(|z| z * z).sum();
    Agreement { mean_z, chi2: sum / (3 * block_z.len()) as f64, blocks: block_z.len() }
}

/// Compares two independent renders of the same picture.
pub fn compare(a: &Film, b: &Film) -> Agreement {
    let against =
        |(a, b): (&[Estimate; 3], &[Estimate; 3])| [0, 1, 2].map(|c| a[c].z_against(&b[c]));
    let block_z: Vec<_> = block_means(a).iter().zip(&block_means(b)).map(against).collect();
    agreement(against((&image_mean(a), &image_mean(b))), &block_z)
}

/// Compares a render with the expected value of each pixel.
///
/// # Panics
/// If the numbers of pixels differ.
pub fn compare_exact(film: &Film, expected: &[[f64; 3]]) -> Agreement {
    let pixels = block_pixels(film.crop.size());
    assert_eq!(pixels.iter().map(Vec::len).sum::<usize>(), expected.len());
    let mean = |pixels: &[usize], c: usize| {
        pixels.iter().map(|&p| expected[p][c]).sum::<f64>() / pixels.len() as f64
    };
    let block_z: Vec<_> = (block_means(film).iter().zip(&pixels))
        .map(|(block, pixels)| [0, 1, 2].map(|c| block[c].z(mean(pixels, c))))
        .collect();
    let all: Vec<usize> = (0..expected.len()).collect();
    let whole = image_mean(film);
    agreement([0, 1, 2].map(|c| whole[c].z(mean(&all, c))), &block_z)
}
