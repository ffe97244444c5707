//! The film: sums for every pixel and AOV. Blocks of samples are added in a fixed tree (see
//! [`tile`]), so that the bits of the picture do not depend on threads, tile order, or how the
//! samples are split over runs and machines. Memory does not grow with the number of samples.

pub mod filter;
pub mod noise;
pub mod sensor;
mod sums;
pub mod tile;

pub use tile::FilmTile;

use crate::integrator::aov::{Aov, AovKind};
use crate::settings::{Crop, Settings};
use noise::NoiseMap;
use rayon::prelude::*;
use snell_math::Rgb;
use snell_scene::{Layer, LayeredImage};
use std::ops::Range;

/// The number of samples of a pixel that are summed before the sum is added to the pixel. A render
/// is split at multiples of it.
pub const BLOCK: u32 = 16;

/// The value of the layer `noise` in pixels with too few samples for an estimate: the largest
/// number in half precision.
const UNKNOWN: f64 = 65504.0;

/// One sample of one pixel, as the film sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmSample {
    /// Sensor response: linear Rec. 709.
    pub color: Rgb,
    /// 1 if the camera ray hit something, 0 if it left into a transparent background.
    pub alpha: f32,
    /// Filter weight, 1 or -1.
    pub weight: f32,
}

/// The smallest number of tiles per thread when pixel values are computed. Waking a thread for
/// fewer takes longer than the work.
const MANY_TILES: usize = 64;

/// Pixels along the side of a tile. Tiles lie on a fixed grid over the whole picture, so a crop
/// consists of parts of the same tiles.
pub const TILE: u32 = 16;

/// The samples of one tile in one range of sample numbers, ordered by pixel, then by sample.
#[derive(Clone, Debug)]
pub struct FilmPart {
    /// The pixels of the tile, in coordinates of the whole picture.
    pub area: Crop,
    /// The first sample number, and one past the last.
    pub samples: [u32; 2],
    /// The pixels of `area` that have samples, as ascending row-major indices; `None` if all have.
    pub pixels: Option<Vec<u32>>,
    /// The samples: all of the first pixel, then all of the next.
    pub values: Vec<FilmSample>,
    /// AOV values in the order of `values`, all channels of a sample together.
    pub aovs: Vec<f32>,
    /// For each AOV of kind [`AovKind::Coverage`], the key that covers each sample, in the order of
    /// `values`.
    pub keys: Vec<u64>,
}

/// The film of one render.
#[derive(Clone, Debug)]
pub struct Film {
    /// The part of the picture that is rendered.
    pub crop: Crop,
    /// The floor of the error in dark pixels; see [`crate::Settings::noise_floor`].
    pub noise_floor: f64,
    aovs: Vec<Aov>,
    /// Tiles, row by row.
    pub tiles: Vec<FilmTile>,
}

impl Film {
    /// An empty film for `crop`, with layers for these AOVs, for samples of weight 1.
    pub fn new(crop: Crop, aovs: &[Aov]) -> Self {
        Self::with_mean_weight(crop, aovs, 1.0)
    }

    /// An empty film for samples of a filter with this [mean
    /// weight](filter::FilterSampler::mean_weight).
    pub fn with_mean_weight(crop: Crop, aovs: &[Aov], mean_weight: f64) -> Self {
        let aov_channels = aovs.iter().map(|a| a.sampled_channels()).sum::<usize>();
        let coverages = aovs.iter().filter(|a| a.kind() == AovKind::Coverage).count();
        let range = |axis: usize| crop.min[axis] / TILE..crop.max[axis].div_ceil(TILE);
        let mut tiles = Vec::new();
        for y in range(1) {
            for x in range(0) {
                let min = [(x * TILE).max(crop.min[0]), (y * TILE).max(crop.min[1])];
                let max = [((x + 1) * TILE).min(crop.max[0]), ((y + 1) * TILE).min(crop.max[1])];
                tiles.push(FilmTile::new(Crop { min, max }, aov_channels, coverages, mean_weight));
            }
        }
        Self { crop, noise_floor: Settings::NOISE_FLOOR, aovs: aovs.to_vec(), tiles }
    }

    /// These tiles of the film, without samples, as a film of their own; `None` if there are no
    /// such tiles.
    pub fn part(&self, tiles: Range<usize>) -> Option<Self> {
        let tiles = self.tiles.get(tiles)?.iter().map(FilmTile::emptied).collect();
        Some(Self { tiles, aovs: self.aovs.clone(), ..*self })
    }

    /// The AOVs that have layers.
    pub fn aovs(&self) -> &[Aov] {
        &self.aovs
    }

    /// The smallest number of samples that any pixel has.
    pub fn least_samples(&self) -> u32 {
        self.taken().min().unwrap_or(0)
    }

    /// Largest number of samples that any pixel has.
    pub fn most_samples(&self) -> u32 {
        self.taken().max().unwrap_or(0)
    }

    /// Mean number of samples of a pixel.
    pub fn mean_samples(&self) -> f64 {
        self.taken().map(f64::from).sum::<f64>() / self.taken().count().max(1) as f64
    }

    fn taken(&self) -> impl Iterator<Item = u32> {
        self.tiles.iter().flat_map(FilmTile::all_taken)
    }

    /// The picture in linear Rec. 709: first the layer of colour and alpha (premultiplied), then
    /// one layer for each AOV.
    pub fn image(&self) -> LayeredImage {
        self.layers(false)
    }

    /// For each pixel, row by row, the keys of [`Aov::key`] that cover it, with the number of
    /// samples of each, and the number of all samples of the pixel. Empty if the AOV was not
    /// requested.
    pub fn coverage(&self, aov: Aov) -> Vec<(Vec<(u64, u32)>, u32)> {
        let mut kinds = self.aovs.iter().filter(|a| a.kind() == AovKind::Coverage);
        let Some(kind) = kinds.position(|&a| a == aov) else { return Vec::new() };
        let [width, height] = self.crop.size().map(|s| s as usize);
        let mut pixels = vec![(Vec::new(), 0); width * height];
        for tile in &self.tiles {
            for (number, [x, y]) in noise::positions(&tile.area).enumerate() {
                let [column, row] =
                    [x - self.crop.min[0], y - self.crop.min[1]].map(|p| p as usize);
                pixels[row * width + column] = (tile.coverage(number, kind), tile.taken(number));
            }
        }
        pixels
    }

    /// The variance of each value of [`Self::image`] as an estimate: the variance of the mean, not
    /// that of one sample. It is 0 for values that are not averaged.
    pub fn variance(&self) -> LayeredImage {
        self.layers(true)
    }

    fn layers(&self, variance: bool) -> LayeredImage {
        let map = self.aovs.contains(&Aov::Noise).then(|| NoiseMap::new(self));
        let [width, height] = self.crop.size();
        let aovs = self.aovs.iter().filter(|a| a.kind() != AovKind::Coverage);
        let mut layers = Vec::new();
        let mut first_channel = 0;
        for aov in std::iter::once(None).chain(aovs.map(Some)) {
            let (name, channels) =
                aov.map_or(("", &["R", "G", "B", "A"][..]), |a| (a.name(), a.channels()));
            let kind = aov.map_or(AovKind::Averaged, |a| a.kind());
            let value = |tile: &FilmTile,
                         pixel: usize,
                         [column, row]: [usize; 2],
                         channel: usize| match kind {
                AovKind::Averaged => {
                    let channel = first_channel + channel;
                    // The square of a large number may exceed the range of `f32`.
                    let value = if variance {
                        tile.variance(pixel, channel)
                    } else {
                        tile.mean(pixel, channel)
                    };
                    value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
                }
                _ if variance => 0.0,
                AovKind::Coverage => 0.0,
                AovKind::First => tile.first(pixel, first_channel + channel - 4),
                AovKind::OfFilm => match &map {
                    Some(map) if aov == Some(&Aov::Noise) => {
                        map.error(row * width as usize + column, self.noise_floor).min(UNKNOWN)
                            as f32
                    }
                    _ => tile.taken(pixel) as f32,
                },
            };
            let count = channels.len();
            let channels = channels.iter().map(|s| s.to_string()).collect();
            layers.push(Layer {
                name: name.to_string(),
                channels,
                values: self.gathered(count, value),
            });
            first_channel += if kind == AovKind::OfFilm { 0 } else { count };
        }
        LayeredImage { width, height, layers, metadata: Vec::new() }
    }

    /// A number of values for each pixel, row by row. `value` is called with the tile, the index of
    /// the pixel in it, the pixel's position in the picture, and the index of the value.
    fn gathered(
        &self,
        count: usize,
        value: impl Fn(&FilmTile, usize, [usize; 2], usize) -> f32 + Sync,
    ) -> Vec<f32> {
        let place =
            |[x, y]: [u32; 2]| [(x - self.crop.min[0]) as usize, (y - self.crop.min[1]) as usize];
        let [width, height] = self.crop.size().map(|side| side as usize);
        let mut values = vec![0.0; width * height * count];
        // Tiles are grouped into rows, each with the rows of pixels that it fills.
        let (mut bands, mut rest) = (Vec::new(), values.as_mut_slice());
        for tiles in self.tiles.chunk_by(|a, b| a.area.min[1] == b.area.min[1]) {
            let length = tiles[0].area.size()[1] as usize * width * count;
            let (band, after) = rest.split_at_mut(length);
            bands.push((tiles, band));
            rest = after;
        }
        let least = MANY_TILES.div_ceil(bands.first().map_or(1, |(tiles, _)| tiles.len()));
        bands.into_par_iter().with_min_len(least).for_each(|(tiles, band)| {
            let first_row = place(tiles[0].area.min)[1];
            for tile in tiles {
                for (pixel, at) in noise::positions(&tile.area).map(place).enumerate() {
                    let start = ((at[1] - first_row) * width + at[0]) * count;
                    for (number, slot) in band[start..start + count].iter_mut().enumerate() {
                        *slot = value(tile, pixel, at, number);
                    }
                }
            }
        });
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng;

    fn part(samples: [u32; 2]) -> FilmPart {
        let values = (samples[0]..samples[1]).map(|s| {
            let value = rng::to_unit(rng::hash32(s)) * 1000.0;
            FilmSample { color: Rgb::splat(value), alpha: 1.0, weight: 1.0 }
        });
        let values = values.collect();
        FilmPart {
            area: Crop::full([1, 1]),
            samples,
            pixels: None,
            values,
            aovs: Vec::new(),
            keys: Vec::new(),
        }
    }

    fn film(splits: &[u32]) -> Film {
        let mut film = Film::new(Crop::full([1, 1]), &[]);
        for pair in splits.windows(2) {
            film.tiles[0].fold(&part([pair[0], pair[1]]));
        }
        film
    }

    #[test]
    fn any_splitting_of_the_samples_gives_the_same_bits() {
        let whole = film(&[0, 16, 32, 48, 50]).image();
        for splits in [&[0, 50][..], &[0, 1, 4, 16, 33, 50], &[0, 7, 8, 9, 31, 32, 50]] {
            assert_eq!(film(splits).image(), whole, "{splits:?}");
        }
    }

    #[test]
    fn the_variance_is_that_of_the_mean() {
        let film = film(&[0, 4000]);
        let variance = film.variance().layers[0].values[0];
        // Uniform numbers up to 1000 have variance 1e6 / 12.
        assert!((variance / (1e6 / 12.0 / 4000.0) - 1.0).abs() < 0.05, "{variance}");
    }

    /// A film of one pixel, for a filter whose samples have weight -1 with probability 1/4.
    fn signed_film(seed: u32, samples: u32, value: impl Fn(f32) -> f32) -> Film {
        let mut film = Film::with_mean_weight(Crop::full([1, 1]), &[], 0.5);
        let values = (0..samples).map(|s| {
            let u = rng::to_unit(rng::hash_combine(seed, s));
            let weight = if u < 0.25 { -1.0 } else { 1.0 };
            FilmSample { color: Rgb::splat(value(u)), alpha: 1.0, weight }
        });
        let (area, values) = (Crop::full([1, 1]), values.collect());
        film.tiles[0].fold(&FilmPart {
            area,
            samples: [0, samples],
            pixels: None,
            values,
            aovs: Vec::new(),
            keys: Vec::new(),
        });
        film
    }

    #[test]
    fn negative_weights_leave_a_constant_as_it_is() {
        for samples in 1..20 {
            for seed in 0..50 {
                let film = signed_film(seed, samples, |_| 3.0);
                assert_eq!(
                    film.image().layers[0].values,
                    [3.0, 3.0, 3.0, 1.0],
                    "{samples} samples"
                );
                assert_eq!(film.variance().layers[0].values, [0.0; 4], "{samples} samples");
            }
        }
    }

    #[test]
    fn negative_weights_count_and_the_variance_is_that_of_the_mean() {
        let films: Vec<Film> =
            (0..2000).map(|seed| signed_film(seed, 64, |u| u * u + 1.0)).collect();
        let values: Vec<f64> =
            films.iter().map(|f| f64::from(f.image().layers[0].values[0])).collect();
        let mean = values.iter().sum::<f64>() / 2000.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 2000.0;
        let estimated =
            films.iter().map(|f| f64::from(f.variance().layers[0].values[0])).sum::<f64>() / 2000.0;
        // The integral of u^2 over [1/4, 1] minus that over [0, 1/4], divided by 1/2, plus the
        // constant 1.
        let expected = (1.0 - 2.0 / 64.0) / 3.0 / 0.5 + 1.0;
        // The unweighted mean depends on the samples that it is computed from, which causes a bias
        // of order 1 / n.
        assert!((mean - expected).abs() < 0.01, "{mean} {expected}");
        assert!((estimated / variance - 1.0).abs() < 0.1, "{estimated} {variance}");
    }
}
