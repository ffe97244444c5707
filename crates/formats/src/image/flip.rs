//! FLIP: the error that a viewer sees when two display images alternate.
//!
//! Source: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, "FLIP: A Difference
//! Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020. Section
//! numbers below are the paper's. Two pipelines: colour (filter by the eye's contrast sensitivity,
//! then distance in a perceptual space) and features (edges and points in the luminance); feature
//! differences amplify colour differences.
//!
//! All filters are separable. Pixels beyond the border repeat those at the border.

use rayon::prelude::*;
use snell_math::real;
use snell_math::spectrum::srgb_to_linear;

/// Pixels per degree of visual angle: a 0.7 m wide monitor of 3840 pixels, seen from 0.7 m.
const PIXELS_PER_DEGREE: f32 = 3840.0 * std::f32::consts::PI / 180.0;

/// The FLIP error of each pixel, from 0 (equal) to 1, for images of sRGB display values.
pub fn flip(width: usize, reference: &[[f32; 3]], test: &[[f32; 3]]) -> Vec<f32> {
    let reference = Appearance::of(width, reference);
    let test = Appearance::of(width, test);
    let range = ColourRange::new();
    (0..reference.colour.len())
        .into_par_iter()
        .map(|i| {
            let colour = range.error(hyab(reference.colour[i], test.colour[i]));
            let feature = feature_error(reference.features[i], test.features[i]);
            real::powf(colour, 1.0 - feature)
        })
        .collect()
}

/// The perceived colours and features of an image: the input of both distances.
struct Appearance {
    /// Filtered colour in L*a*b*, with a* and b* scaled by lightness.
    colour: Vec<[f32; 3]>,
    /// Strengths of the edge and of the point feature at each pixel.
    features: Vec<[f32; 2]>,
}

impl Appearance {
    fn of(width: usize, display: &[[f32; 3]]) -> Self {
        let opponent: Vec<[f32; 3]> = display
            .par_iter()
            .map(|p| opponent_from_xyz(xyz_from_rgb(p.map(srgb_to_linear))))
            .collect();
        Self { colour: perceived_colour(width, &opponent), features: features(width, &opponent) }
    }
}

// Colour pipeline.

/// Contrast sensitivity as sums of two Gaussians: a1, b1, a2, b2 (Section 4.1.1, Table 1).
const SENSITIVITY: [[f32; 4]; 3] = [
    [1.0, 0.0047, 0.0, 1e-5],  // achromatic
    [1.0, 0.0053, 0.0, 1e-5],  // red-green
    [34.1, 0.04, 13.5, 0.025], // blue-yellow
];

/// Filters by contrast sensitivity, clamps to the display's gamut, converts to L*a*b* with the Hunt
/// effect (Sections 4.1.1, 4.1.2).
fn perceived_colour(width: usize, opponent: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let widest = SENSITIVITY.iter().flat_map(|s| [s[1], s[3]]).fold(0.0, f32::max);
    let radius =
        (3.0 * (widest / (2.0 * real::powi(std::f32::consts::PI, 2))).sqrt() * PIXELS_PER_DEGREE)
            .ceil() as i32;
    let kernel = |b: f32| -> Vec<f32> {
        let at = |i: i32| {
            real::exp(-real::powi(std::f32::consts::PI * i as f32 / PIXELS_PER_DEGREE, 2) / b)
        };
        (-radius..=radius).map(at).collect()
    };
    // Four planes: one Gaussian for each of the first two channels, two for the third.
    let [achromatic, red_green, blue_yellow] = SENSITIVITY;
    let kernels = [
        kernel(achromatic[1]),
        kernel(red_green[1]),
        kernel(blue_yellow[1]),
        kernel(blue_yellow[3]),
    ];
    let sums = kernels.each_ref().map(|k| k.iter().sum::<f32>());
    let kernels: [Vec<f32>; 4] =
        std::array::from_fn(|i| kernels[i].iter().map(|v| v / sums[i]).collect());
    // Weights of the two Gaussians of the third channel in the normalised sum.
    let volume = |a: f32, b: f32, sum: f32| a * (std::f32::consts::PI / b).sqrt() * sum * sum;
    let first = volume(blue_yellow[0], blue_yellow[1], sums[2]);
    let second = volume(blue_yellow[2], blue_yellow[3], sums[3]);
    let share = first / (first + second);

    let rows = filter_rows(width, opponent, |p| [p[0], p[1], p[2], p[2]], &kernels);
    let both = filter_columns(width, &rows, &kernels);
    both.into_par_iter()
        .map(|[y, cx, cz1, cz2]| {
            let rgb = rgb_from_xyz(xyz_from_opponent([y, cx, cz1 * share + cz2 * (1.0 - share)]));
            hunt(lab_from_xyz(xyz_from_rgb(rgb.map(|v| v.clamp(0.0, 1.0)))))
        })
        .collect()
}

/// Colourfulness grows with lightness.
fn hunt([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// The distance of two colours when differences may be large (Section 4.1.2).
fn hyab(p: [f32; 3], q: [f32; 3]) -> f32 {
    (p[0] - q[0]).abs() + real::hypot(p[1] - q[1], p[2] - q[2])
}

/// Maps colour distances to errors from 0 to 1 (Section 4.1.3).
struct ColourRange {
    /// The largest distance, between green and blue, raised to [`ColourRange::EXPONENT`].
    largest: f32,
}

impl ColourRange {
    const EXPONENT: f32 = 0.7;
    /// Share of the largest distance below which errors grow linearly to [`Self::ERROR_AT_KNEE`].
    const KNEE: f32 = 0.4;
    /// The error at the knee.
    const ERROR_AT_KNEE: f32 = 0.95;

    fn new() -> Self {
        let perceived = |rgb| hunt(lab_from_xyz(xyz_from_rgb(rgb)));
        Self {
            largest: real::powf(
                hyab(perceived([0.0, 1.0, 0.0]), perceived([0.0, 0.0, 1.0])),
                Self::EXPONENT,
            ),
        }
    }

    fn error(&self, distance: f32) -> f32 {
        let d = real::powf(distance, Self::EXPONENT);
        let knee = Self::KNEE * self.largest;
        let error = if d < knee {
            Self::ERROR_AT_KNEE / knee * d
        } else {
            Self::ERROR_AT_KNEE + (d - knee) / (self.largest - knee) * (1.0 - Self::ERROR_AT_KNEE)
        };
        error.clamp(0.0, 1.0)
    }
}

// Feature pipeline.

/// Width in degrees of the features looked for (Section 4.2).
const FEATURE_WIDTH: f32 = 0.082;

/// Strengths of edges and points: lengths of the first and second derivatives of the
/// Gaussian-filtered luminance.
fn features(width: usize, opponent: &[[f32; 3]]) -> Vec<[f32; 2]> {
    let sigma = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as i32;
    let kernel = |weight: fn(f32, f32) -> f32| -> Vec<f32> {
        let at =
            |i: i32| weight(i as f32, sigma) * real::exp(-real::powi(i as f32 / sigma, 2) / 2.0);
        normalised((-radius..=radius).map(at).collect())
    };
    let smooth = kernel(|_, _| 1.0);
    let edge = kernel(|x, _| -x);
    let point = kernel(|x, s| real::powi(x / s, 2) - 1.0);

    // Planes: edge in x, point in x, edge in y, point in y.
    let luminance = |p: &[f32; 3]| [(p[0] + 16.0) / 116.0; 4];
    let rows = filter_rows(
        width,
        opponent,
        luminance,
        &[edge.clone(), point.clone(), smooth.clone(), smooth.clone()],
    );
    let both = filter_columns(width, &rows, &[smooth.clone(), smooth, edge, point]);
    both.into_par_iter()
        .map(|[ex, px, ey, py]| [real::hypot(ex, ey), real::hypot(px, py)])
        .collect()
}

/// Scales positive and negative weights so that each sum to one (in magnitude).
fn normalised(kernel: Vec<f32>) -> Vec<f32> {
    let positive: f32 = kernel.iter().filter(|v| **v > 0.0).sum();
    let negative: f32 = -kernel.iter().filter(|v| **v < 0.0).sum::<f32>();
    kernel.into_iter().map(|v| if v < 0.0 { v / negative } else { v / positive }).collect()
}

/// The larger of the differences in edges and in points, from 0 to 1.
fn feature_error(p: [f32; 2], q: [f32; 2]) -> f32 {
    let difference = (p[0] - q[0]).abs().max((p[1] - q[1]).abs());
    (difference / std::f32::consts::SQRT_2).sqrt().clamp(0.0, 1.0)
}

// Filters: four planes at once, each with its own kernel, all of one length.

/// Filters along rows, after turning each pixel into four values.
fn filter_rows(
    width: usize,
    pixels: &[[f32; 3]],
    planes: impl Fn(&[f32; 3]) -> [f32; 4] + Sync,
    kernels: &[Vec<f32>; 4],
) -> Vec<[f32; 4]> {
    let weights = interleaved(kernels);
    let radius = weights.len() / 2;
    let mut result = vec![[0.0; 4]; pixels.len()];
    result.par_chunks_exact_mut(width).zip(pixels.par_chunks_exact(width)).for_each(
        |(out, row)| {
            let padded: Vec<[f32; 4]> = (0..width + 2 * radius)
                .map(|i| planes(&row[i.saturating_sub(radius).min(width - 1)]))
                .collect();
            for (out, window) in out.iter_mut().zip(padded.windows(weights.len())) {
                *out = window
                    .iter()
                    .zip(&weights)
                    .fold([0.0; 4], |sum, (v, w)| add_product(sum, *v, *w));
            }
        },
    );
    result
}

/// Filters along columns: row by row, so that memory is read in order.
fn filter_columns(width: usize, pixels: &[[f32; 4]], kernels: &[Vec<f32>; 4]) -> Vec<[f32; 4]> {
    let weights = interleaved(kernels);
    let radius = weights.len() / 2;
    let height = pixels.len() / width;
    let mut result = vec![[0.0; 4]; pixels.len()];
    result.par_chunks_exact_mut(width).enumerate().for_each(|(y, out)| {
        for (k, w) in weights.iter().enumerate() {
            let row = (y + k).saturating_sub(radius).min(height - 1);
            for (sum, v) in out.iter_mut().zip(&pixels[row * width..][..width]) {
                *sum = add_product(*sum, *v, *w);
            }
        }
    });
    result
}

fn interleaved(kernels: &[Vec<f32>; 4]) -> Vec<[f32; 4]> {
    (0..kernels[0].len()).map(|i| std::array::from_fn(|k| kernels[k][i])).collect()
}

fn add_product(sum: [f32; 4], v: [f32; 4], w: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|i| sum[i] + v[i] * w[i])
}

// Colour spaces, all relative to the white of the display.

/// Linear sRGB to XYZ; rows sum to [`WHITE`].
const XYZ_FROM_RGB: [[f32; 3]; 3] = [
    [0.412_390_8, 0.357_584_34, 0.180_480_79],
    [0.212_639, 0.715_168_7, 0.072_192_32],
    [0.019_330_818, 0.119_194_78, 0.950_532_15],
];

const RGB_FROM_XYZ: [[f32; 3]; 3] = [
    [3.240_97, -1.537_383_2, -0.498_610_76],
    [-0.969_243_6, 1.875_967_5, 0.041_555_06],
    [0.055_630_08, -0.203_976_96, 1.056_971_5],
];

/// The white of the display, linear sRGB (1, 1, 1), in XYZ.
const WHITE: [f32; 3] = [0.950_455_93, 1.0, 1.089_057_75];

fn multiply(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn xyz_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    multiply(&XYZ_FROM_RGB, rgb)
}

fn rgb_from_xyz(xyz: [f32; 3]) -> [f32; 3] {
    multiply(&RGB_FROM_XYZ, xyz)
}

/// The opponent space in which contrast sensitivity was measured: luminance, red-green,
/// blue-yellow; linear in XYZ (YCxCz).
fn opponent_from_xyz(xyz: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = std::array::from_fn(|i| xyz[i] / WHITE[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn xyz_from_opponent([luminance, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (luminance + 16.0) / 116.0;
    let relative = [y + cx / 500.0, y, y - cz / 200.0];
    std::array::from_fn(|i| relative[i] * WHITE[i])
}

/// Converts CIE XYZ to CIE 1976 L*a*b*.
fn lab_from_xyz(xyz: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |t: f32| {
        if t > real::powi(DELTA, 3) {
            real::cbrt(t)
        } else {
            t / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    };
    let [x, y, z] = std::array::from_fn(|i| f(xyz[i] / WHITE[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opponent_space_and_back_is_the_identity() {
        for rgb in [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.9, 0.1, 0.3]] {
            let back = rgb_from_xyz(xyz_from_opponent(opponent_from_xyz(xyz_from_rgb(rgb))));
            assert!((0..3).all(|i| (back[i] - rgb[i]).abs() < 1e-4), "{rgb:?} {back:?}");
        }
    }

    #[test]
    fn white_is_the_sum_of_the_rows() {
        let white = xyz_from_rgb([1.0; 3]);
        assert!((0..3).all(|i| (white[i] - WHITE[i]).abs() < 1e-5), "{white:?}");
        let lab = lab_from_xyz(white);
        assert!(
            (lab[0] - 100.0).abs() < 1e-3 && lab[1].abs() < 1e-2 && lab[2].abs() < 1e-2,
            "{lab:?}"
        );
    }

    #[test]
    fn black_against_white_has_the_error_that_its_distance_gives() {
        // There are no features, and the HyAB distance is 100. (The largest distance, green against
        // blue, follows from the space.)
        let range = ColourRange::new();
        let expected = range.error(100.0);
        let errors = flip(4, &[[0.0; 3]; 12], &[[1.0; 3]; 12]);
        assert!(expected > 0.9 && expected < 1.0, "{expected}");
        assert!(errors.iter().all(|e| (e - expected).abs() < 1e-3), "{errors:?} {expected}");
    }

    #[test]
    fn kernels_keep_constants_and_ignore_them_in_derivatives() {
        assert!((normalised(vec![1.0, 2.0, 1.0]).iter().sum::<f32>() - 1.0).abs() < 1e-6);
        assert!(normalised(vec![1.0, 0.0, -3.0]).iter().sum::<f32>().abs() < 1e-6);
        let flat = features(5, &[[50.0, 0.0, 0.0]; 25]);
        assert!(flat.iter().flatten().all(|v| v.abs() < 1e-5), "{flat:?}");
    }

    #[test]
    fn one_pixel_images_work() {
        assert_eq!(flip(1, &[[0.5; 3]], &[[0.5; 3]]), [0.0]);
    }
}
