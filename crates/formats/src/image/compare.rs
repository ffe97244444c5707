//! Compares two pictures: how far is the test picture from the reference?
//!
//! Pure functions over linear RGB. Radiometric errors (MSE, relative MSE, largest difference) are
//! measured on the linear values, perceptual ones (PSNR, FLIP, differing pixels) on sRGB display
//! values.

use super::picture::finite;
use super::{Display, Tonemap, display_value, flip};
use rayon::prelude::*;
use serde::Serialize;
use snell_math::real;
use snell_math::spectrum::srgb_to_linear;
use snell_scene::{Image, Layer, LayeredImage};

/// Linear Rec. 709 RGB, row by row from the top; transparent pictures are composited over black.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// One colour per pixel.
    pub pixels: Vec<[f32; 3]>,
}

impl LinearImage {
    /// Converts the pixels of an image file.
    pub fn from_image(image: &Image) -> Self {
        let pixel = |i: usize| {
            let (x, y) = (i % image.width as usize, i / image.width as usize);
            let [r, g, b, a] = image.rgba(x as u32, y as u32);
            [r * a, g * a, b * a]
        };
        let count = image.width as usize * image.height as usize;
        Self {
            width: image.width,
            height: image.height,
            pixels: (0..count).into_par_iter().map(pixel).collect(),
        }
    }

    /// Converts a layer of `image`: its channels R, G, B, or else its first three. A layer with
    /// fewer than three channels repeats them.
    pub fn from_layer(image: &LayeredImage, layer: &Layer) -> Self {
        let find = |name: &str, otherwise: usize| {
            let last = layer.channels.len().saturating_sub(1);
            layer.channels.iter().position(|c| c == name).unwrap_or(otherwise.min(last))
        };
        let rgb = match layer.channels.len() {
            0..3 => [find("Y", 0); 3],
            _ => [find("R", 0), find("G", 1), find("B", 2)],
        };
        let pixels = layer
            .values
            .par_chunks_exact(layer.channels.len().max(1))
            .map(|p| rgb.map(|c| p[c]))
            .collect();
        Self { width: image.width, height: image.height, pixels }
    }
}

/// Memory that [`compare`] takes beside the pictures, in bytes per pixel: 128 were measured.
pub const BYTES_PER_PIXEL: usize = 140;

/// Options of [`compare`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompareOptions {
    /// How linear values become display values; `None` decides by the pictures
    /// ([`automatic_display`]).
    pub display: Option<Display>,
    /// A pixel counts as different if a channel of its 8-bit display values differs by more than
    /// this many levels.
    pub threshold: u8,
}

impl Default for CompareOptions {
    fn default() -> Self {
        Self { display: None, threshold: 1 }
    }
}

/// The results as numbers. Values that are not finite are replaced as in [`super::read_image`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Width of both pictures in pixels.
    pub width: u32,
    /// Height of both pictures in pixels.
    pub height: u32,
    /// Mean squared error of the linear values, over all pixels and channels.
    pub mse: f64,
    /// Mean of `(test - reference)^2 / (reference^2 + 0.01)` over all pixels and channels, linear
    /// ([`RELATIVE_EPSILON`]).
    pub rel_mse: f64,
    /// Mean squared error of the sRGB display values, which lie between 0 and 1.
    pub mse_srgb: f64,
    /// Peak signal to noise ratio of the display values in decibels; `None` if they are equal.
    pub psnr: Option<f64>,
    /// Mean FLIP error from 0 to 1, at 67 pixels per degree, on the display values.
    pub flip: f64,
    /// Largest difference of a linear channel value.
    pub max_abs: f64,
    /// Column and row of the largest difference, from the top left; the first one in reading order.
    pub max_at: [u32; 2],
    /// Largest difference of an 8-bit display value in levels.
    pub max_levels: u8,
    /// Share of pixels, 0 to 1, that differ by more than the threshold.
    pub different: f64,
    /// The threshold in levels.
    pub threshold: u8,
    /// Pixels of the reference with a value that is not finite.
    pub not_finite_in_reference: u64,
    /// Pixels of the test picture with a value that is not finite.
    pub not_finite_in_test: u64,
    /// True if the display values were tone mapped, because the pictures have a high dynamic range
    /// or on request.
    pub tone_mapped: bool,
    /// Exposure in stops that was used for the display values.
    pub exposure: f64,
}

/// The results as numbers, and the error of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// The measured differences.
    pub comparison: Comparison,
    /// FLIP error of each pixel, 0 to 1.
    pub flip: Vec<f32>,
}

/// The reason why two pictures cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// The sizes of the pictures differ.
    #[error(
        "the sizes differ: the reference has {} x {} pixels, the other picture {} x {}; render or \
            scale one of them to the size of the other",
        reference[0], reference[1], test[0], test[1]
    )]
    Size {
        /// Width and height of the reference.
        reference: [u32; 2],
        /// Width and height of the other picture.
        test: [u32; 2],
    },
    /// A picture has no pixels, or not one colour per pixel.
    #[error(
        "a picture has {pixels} pixels where its size says {expected}; give one colour per pixel \
            and at least one pixel"
    )]
    Pixels {
        /// The number of pixels in the picture.
        pixels: usize,
        /// The expected number: width times height.
        expected: usize,
    },
}

/// The constant added to the square of the reference in the relative error: for references well
/// below 0.1 the error is in effect absolute.
pub const RELATIVE_EPSILON: f64 = 1e-2;

/// Compares `test` with `reference`. Fails if a picture is empty, has the wrong number of pixels,
/// or if their sizes differ.
pub fn compare(
    reference: &LinearImage,
    test: &LinearImage,
    options: &CompareOptions,
) -> Result<Compared, CompareError> {
    check(reference, test)?;
    let not_finite = |image: &LinearImage| {
        image.pixels.iter().filter(|p| !p.iter().all(|v| v.is_finite())).count() as u64
    };
    let (not_finite_in_reference, not_finite_in_test) = (not_finite(reference), not_finite(test));
    let reference = &made_finite(reference);
    let test = &made_finite(test);

    let display = options.display.unwrap_or_else(|| automatic_display(reference, test));
    // The measures are defined on sRGB values, whatever display the caller uses.
    let display = Display { srgb: true, ..display };
    let shown = |image: &LinearImage| -> Vec<[f32; 3]> {
        image.pixels.par_iter().map(|p| display_value(*p, &display)).collect()
    };
    let (shown_reference, shown_test) = (shown(reference), shown(test));
    let width = reference.width as usize;
    let flip = flip::flip(width, &shown_reference, &shown_test);

    let rows = (0..reference.height as usize).into_par_iter().map(|y| {
        let range = y * width..(y + 1) * width;
        let linear = reference.pixels[range.clone()].iter().zip(&test.pixels[range.clone()]);
        let display = shown_reference[range.clone()].iter().zip(&shown_test[range]);
        Sums::of_row(y, linear, display, options.threshold)
    });
    // Rows are added in order, so the sums do not depend on the threads.
    let sums = rows.collect::<Vec<_>>().into_iter().fold(Sums::default(), Sums::add);
    let values = reference.pixels.len() as f64 * 3.0;
    let mse_srgb = sums.squared_display / values;
    let comparison = Comparison {
        width: reference.width,
        height: reference.height,
        mse: sums.squared / values,
        rel_mse: sums.relative / values,
        mse_srgb,
        psnr: (mse_srgb > 0.0).then(|| -10.0 * real::log10(mse_srgb)),
        flip: flip.iter().map(|e| f64::from(*e)).sum::<f64>() / flip.len() as f64,
        max_abs: sums.largest,
        max_at: sums.largest_at,
        max_levels: sums.largest_levels,
        different: sums.different as f64 / reference.pixels.len() as f64,
        threshold: options.threshold,
        not_finite_in_reference,
        not_finite_in_test,
        tone_mapped: display.tonemap != Tonemap::None,
        exposure: display.exposure,
    };
    Ok(Compared { comparison, flip })
}

fn check(reference: &LinearImage, test: &LinearImage) -> Result<(), CompareError> {
    let size = |i: &LinearImage| [i.width, i.height];
    if size(reference) != size(test) {
        return Err(CompareError::Size { reference: size(reference), test: size(test) });
    }
    let expected = reference.width as usize * reference.height as usize;
    match [reference, test].iter().map(|i| i.pixels.len()).find(|n| *n != expected || *n == 0) {
        Some(pixels) => Err(CompareError::Pixels { pixels, expected }),
        None => Ok(()),
    }
}

fn made_finite(image: &LinearImage) -> LinearImage {
    LinearImage { pixels: image.pixels.par_iter().map(|p| p.map(finite)).collect(), ..*image }
}

/// Display values for two pictures. If no value is above 1 they are shown as they are. Otherwise
/// both are tone mapped by ACES with the exposure that brings the log-average luminance of the
/// reference to middle grey, 0.18 (Reinhard, Stark, Shirley, Ferwerda, "Photographic Tone
/// Reproduction for Digital Images", SIGGRAPH 2002, Section 3.1), rounded to whole stops so that
/// small differences between references do not shift it. (HDR-FLIP proper takes the largest error
/// over many exposures; one exposure corresponds to what is seen.)
pub fn automatic_display(reference: &LinearImage, test: &LinearImage) -> Display {
    // Slightly above 1, to allow for rounding.
    let is_high =
        |image: &LinearImage| image.pixels.par_iter().any(|p| p.iter().any(|v| *v > 1.001));
    if !is_high(reference) && !is_high(test) {
        return Display::default();
    }
    let luminance = |p: &[f32; 3]| {
        0.2126 * f64::from(p[0]) + 0.7152 * f64::from(p[1]) + 0.0722 * f64::from(p[2])
    };
    let lit = reference.pixels.iter().map(luminance).filter(|l| l.is_finite() && *l > 0.0);
    let (sum, count) = lit.fold((0.0, 0u64), |(sum, count), l| (sum + real::log2(l), count + 1));
    let exposure = if count == 0 {
        0.0
    } else {
        (real::log2(0.18f64) - sum / count as f64).round().clamp(-32.0, 32.0)
    };
    Display { exposure, tonemap: Tonemap::Aces, srgb: true }
}

/// Sums over some rows.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    squared: f64,
    relative: f64,
    squared_display: f64,
    largest: f64,
    largest_at: [u32; 2],
    largest_levels: u8,
    different: u64,
}

impl Sums {
    fn of_row<'a>(
        y: usize,
        linear: impl Iterator<Item = (&'a [f32; 3], &'a [f32; 3])>,
        display: impl Iterator<Item = (&'a [f32; 3], &'a [f32; 3])>,
        threshold: u8,
    ) -> Self {
        let mut sums = Self::default();
        for (x, (reference, test)) in linear.enumerate() {
            for (r, t) in reference.iter().zip(test) {
                let (r, difference) = (f64::from(*r), f64::from(*t) - f64::from(*r));
                sums.squared += difference * difference;
                sums.relative += difference * difference / (r * r + RELATIVE_EPSILON);
                if difference.abs() > sums.largest {
                    sums.largest = difference.abs();
                    sums.largest_at = [x as u32, y as u32];
                }
            }
        }
        for (reference, test) in display {
            let mut levels = 0;
            for (r, t) in reference.iter().zip(test) {
                let difference = f64::from(*t) - f64::from(*r);
                sums.squared_display += difference * difference;
                levels = levels.max(level(*r).abs_diff(level(*t)));
            }
            sums.largest_levels = sums.largest_levels.max(levels);
            sums.different += u64::from(levels > threshold);
        }
        sums
    }

    fn add(self, next: Self) -> Self {
        let larger = if next.largest > self.largest { next } else { self };
        Self {
            squared: self.squared + next.squared,
            relative: self.relative + next.relative,
            squared_display: self.squared_display + next.squared_display,
            largest: larger.largest,
            largest_at: larger.largest_at,
            largest_levels: self.largest_levels.max(next.largest_levels),
            different: self.different + next.different,
        }
    }
}

fn level(display: f32) -> u8 {
    (display * 255.0).round() as u8
}

/// The FLIP errors as a picture: black where nothing differs, through violet and orange to pale
/// yellow.
pub fn difference_picture(compared: &Compared) -> LayeredImage {
    let values = compared.flip.iter().flat_map(|e| heat(*e)).collect();
    let channels = ["R", "G", "B"].map(String::from).to_vec();
    LayeredImage {
        width: compared.comparison.width,
        height: compared.comparison.height,
        layers: vec![Layer { name: String::new(), channels, values }],
        metadata: Vec::new(),
    }
}

/// Linear RGB of an error from 0 to 1: nine samples of matplotlib's colour map "magma" (van der
/// Walt, Smith; CC0), joined by straight lines.
fn heat(error: f32) -> [f32; 3] {
    const STOPS: [[u8; 3]; 9] = [
        [0, 0, 4],
        [28, 16, 68],
        [79, 18, 123],
        [129, 37, 129],
        [181, 54, 122],
        [229, 80, 100],
        [251, 135, 97],
        [254, 194, 135],
        [252, 253, 191],
    ];
    let position = error.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let low = (position as usize).min(STOPS.len() - 2);
    let t = position - low as f32;
    std::array::from_fn(|i| {
        let (a, b) = (f32::from(STOPS[low][i]), f32::from(STOPS[low + 1][i]));
        srgb_to_linear((a + (b - a) * t) / 255.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Input, ReadOptions};
    use std::path::Path;

    fn grey(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> LinearImage {
        let pixels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| [value(x, y); 3])
            .collect();
        LinearImage { width, height, pixels }
    }

    fn compare_default(reference: &LinearImage, test: &LinearImage) -> Comparison {
        compare(reference, test, &CompareOptions::default()).unwrap().comparison
    }

    #[test]
    fn a_picture_equals_itself() {
        let image = grey(31, 17, |x, y| (x * y) as f32 * 0.01);
        let compared = compare(&image, &image, &CompareOptions::default()).unwrap();
        let c = &compared.comparison;
        assert_eq!(
            (c.mse, c.rel_mse, c.mse_srgb, c.psnr, c.flip, c.max_abs),
            (0.0, 0.0, 0.0, None, 0.0, 0.0)
        );
        assert_eq!((c.different, c.max_levels), (0.0, 0));
        assert!(compared.flip.iter().all(|e| *e == 0.0));
    }

    #[test]
    fn errors_of_known_pictures() {
        let reference = grey(4, 2, |_, _| 0.5);
        let test = grey(4, 2, |x, y| if (x, y) == (2, 1) { 0.7 } else { 0.5 });
        let c = compare_default(&reference, &test);
        assert!((c.mse - 0.04 / 8.0).abs() < 1e-7, "{c:?}");
        assert!((c.rel_mse - 0.04 / 0.26 / 8.0).abs() < 1e-7, "{c:?}");
        assert!((c.max_abs - 0.2).abs() < 1e-6 && c.max_at == [2, 1], "{c:?}");
        assert_eq!(c.different, 0.125);
        // sRGB of 0.5 is level 187.5, of 0.7 level 217.9.
        assert_eq!(c.max_levels, 30);
    }

    #[test]
    fn one_level_does_not_count_as_different_but_two_do() {
        let at = |level: f32| grey(1, 1, |_, _| srgb_to_linear(level / 255.0));
        assert_eq!(compare_default(&at(100.0), &at(101.0)).different, 0.0);
        assert_eq!(compare_default(&at(100.0), &at(102.0)).different, 1.0);
    }

    #[test]
    fn high_dynamic_range_is_tone_mapped_and_differences_above_white_count() {
        let sun = |brightest: f32| grey(16, 16, move |x, _| if x < 8 { 0.1 } else { brightest });
        let c = compare_default(&sun(3.0), &sun(6.0));
        assert!(c.tone_mapped && c.flip > 0.01, "{c:?}");
        assert!(!compare_default(&sun(0.9), &sun(0.8)).tone_mapped);
        // The log-average is 0.54: less than two stops above middle grey.
        assert_eq!(c.exposure, -2.0);
    }

    #[test]
    fn values_that_are_not_finite_are_counted_and_harmless() {
        let reference = grey(3, 3, |_, _| 0.5);
        let test = grey(3, 3, |x, y| [f32::NAN, f32::INFINITY, 0.5][((x + y) % 3) as usize]);
        let c = compare_default(&reference, &test);
        assert_eq!((c.not_finite_in_reference, c.not_finite_in_test), (0, 6));
        assert!([c.mse, c.rel_mse, c.flip, c.max_abs].iter().all(|v| v.is_finite()), "{c:?}");
    }

    #[test]
    fn different_sizes_are_an_error_that_names_both() {
        let error =
            compare(&grey(2, 3, |_, _| 0.0), &grey(3, 2, |_, _| 0.0), &CompareOptions::default())
                .unwrap_err();
        let message = error.to_string();
        assert!(message.contains("2 x 3") && message.contains("3 x 2"), "{message}");
        let empty = LinearImage { width: 0, height: 0, pixels: Vec::new() };
        assert!(compare(&empty, &empty, &CompareOptions::default()).is_err());
    }

    #[test]
    fn the_difference_picture_brightens_with_the_error() {
        let luminance = |e| heat(e).iter().sum::<f32>();
        assert!((0..100).all(|i| luminance((i + 1) as f32 * 0.01) > luminance(i as f32 * 0.01)));
        let compared =
            compare(&grey(5, 4, |_, _| 0.0), &grey(5, 4, |_, _| 1.0), &CompareOptions::default())
                .unwrap();
        assert_eq!(difference_picture(&compared).layers[0].values.len(), 60);
    }

    /// The expected values are those of the packages flip-evaluator 1.7 and scikit-image 0.26.
    #[test]
    fn published_implementations_agree() {
        let folder =
            Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/image-compare"));
        let Ok(table) = std::fs::read_to_string(folder.join("expected.csv")) else {
            eprintln!("skipped: no {}", folder.display());
            return;
        };
        let load = |name: String| {
            let input = Input::open(&folder.join(name), &ReadOptions::default()).unwrap();
            LinearImage::from_image(&crate::image::read_image(&input).unwrap())
        };
        for line in table.lines().skip(1) {
            let columns: Vec<_> = line.split(',').collect();
            let number = |i: usize| columns[i].parse::<f64>().unwrap();
            let reference = load(format!("{}.ref.png", columns[0]));
            let test = load(format!("{}.{}.png", columns[0], columns[1]));
            let c = compare_default(&reference, &test);
            assert!((c.mse_srgb - number(2)).abs() < 1e-6, "{line}: MSE {}", c.mse_srgb);
            assert!((c.psnr.unwrap() - number(3)).abs() < 1e-3, "{line}: PSNR {:?}", c.psnr);
            assert!((c.flip - number(6)).abs() < 1e-4, "{line}: FLIP {}", c.flip);
        }
    }
}
