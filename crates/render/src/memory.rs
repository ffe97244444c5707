//! Estimates the peak memory of a render before it starts, from its settings, its scene, and what
//! will be done with the picture.
//!
//! The figures come from the sizes of the types, or from measurements for data that is private to a
//! thread or short-lived. The system is not queried: callers compare the estimate with the memory
//! that is available.

use crate::film::filter::FilterSampler;
use crate::film::tile::most_runs;
use crate::film::{BLOCK, FilmSample, TILE};
use crate::integrator::aov::{Aov, AovKind};
use crate::settings::{Crop, Settings};
use snell_intersect::TriangleMesh;
use snell_math::real;
use snell_scene::{Environment, Geometry, Image, NodeId, Pixels, Scene};
use std::collections::HashMap;
use std::sync::Arc;

/// What will be done with a film besides filling it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Uses {
    /// The number of render threads.
    pub threads: usize,
    /// True if variance layers are made of the film.
    pub variance: bool,
    /// True if the picture is denoised.
    pub denoise: bool,
    /// Bytes per pixel that the consumer of the picture, such as an encoder, needs in addition.
    pub beside: u64,
}

/// The memory of a picture: bytes per pixel, and a constant number of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Estimate {
    /// The constant number of bytes.
    pub fixed: u64,
    /// Bytes per pixel.
    pub per_pixel: u64,
    /// Width and height of the rendered area.
    pub size: [u32; 2],
    /// True if the area is only a part of the picture.
    pub is_crop: bool,
}

/// Bytes of a thread's buffers without its samples; measured.
const THREAD: u64 = 2 << 20;

/// Heap overhead of the small allocations of a tile, in bytes per pixel.
const TILE_BYTES: u64 = 6;

/// Bytes of the library and weights of Open Image Denoise. This number and the next three were
/// measured with version 2.5 and one or two threads.
const DENOISER: u64 = 24 << 20;
/// Bytes per pixel while Open Image Denoise processes a whole picture at once.
const DENOISER_PIXEL: u64 = 640;
/// Number of pixels up to which a picture is processed at once; larger ones are processed in parts.
const DENOISER_WHOLE: u64 = 3_000_000;
/// Bytes per pixel beyond [`DENOISER_WHOLE`].
const DENOISER_LATER_PIXEL: u64 = 105;

impl Estimate {
    /// The number of bytes in total.
    pub fn bytes(&self) -> u64 {
        let [width, height] = self.size.map(u64::from);
        self.fixed.saturating_add((width * height).saturating_mul(self.per_pixel))
    }

    /// Adds a number of bytes to the constant part.
    pub fn with(self, more: u64) -> Self {
        Self { fixed: self.fixed.saturating_add(more), ..self }
    }

    /// The largest picture of the same aspect ratio that fits into this many bytes, found in steps
    /// of about 1 %; `None` if none does.
    pub fn largest(&self, available: u64) -> Option<[u32; 2]> {
        let pixels = available.saturating_sub(self.fixed) / self.per_pixel.max(1);
        let [width, height] = self.size.map(f64::from);
        let scale = (pixels as f64 / (width * height)).sqrt().min(1.0);
        let step = |side: f64| (real::powf(10f64, (real::log10(side) - 2.0).floor())).max(1.0);
        let rounded = |side: f64| ((side * scale / step(side)).floor() * step(side)) as u32;
        let size = [rounded(width), rounded(height)];
        (size[0] > 0 && size[1] > 0).then_some(size)
    }

    /// A sentence that names a picture size which fits into this many bytes.
    pub fn advice(&self, available: u64) -> String {
        let what = if self.is_crop { "a part" } else { "a picture" };
        match self.largest(available) {
            Some([width, height]) => format!("{what} of at most {width}x{height} pixels fits"),
            None => "not even a small one fits".into(),
        }
    }
}

/// Memory of the film and the picture for these settings.
pub fn of_picture(settings: &Settings, uses: &Uses) -> Estimate {
    let aovs = &settings.aovs;
    let sampled: u64 = aovs.iter().map(|aov| aov.sampled_channels() as u64).sum();
    let covers = aovs.iter().filter(|aov| aov.kind() == AovKind::Coverage).count() as u64;
    let layers = 4 * picture_channels(settings);
    let is_signed = FilterSampler::of(settings.filter).mean_weight() < 1.0;
    let film = film_bytes(settings, sampled, covers, is_signed);
    let noise_map = if settings.noise.is_some() || aovs.contains(&Aov::Noise) { 80 } else { 0 };
    // Bytes of the names and fractions of what covers a pixel, and of the layers that hold them.
    let coverage = covers * (24 + 56 + 80);
    let variance = if uses.variance { 4 + layers } else { 0 };
    let size = settings.crop.unwrap_or(Crop::full(settings.size)).size();
    let (denoiser_itself, denoiser) = if uses.denoise { denoiser_bytes(size) } else { (0, 0) };
    let after = layers + coverage + noise_map.max(variance + uses.beside).max(denoiser);
    let sample = size_of::<FilmSample>() as u64 + 4 * sampled + 8 * covers;
    let samples = u64::from(TILE * TILE) * u64::from(settings.spp.min(BLOCK));
    let guiding = settings.guiding.map_or(0, |guiding| guiding_bytes(guiding.passes));
    let threads = uses.threads.max(1) as u64 * (THREAD + 3 * samples * sample);
    Estimate {
        fixed: PROGRAM + threads + guiding + denoiser_itself,
        per_pixel: film + after,
        size,
        is_crop: settings.crop.is_some(),
    }
}

/// The memory of a denoiser, including the copies that it is given: the constant number of bytes,
/// and bytes per pixel.
fn denoiser_bytes(size: [u32; 2]) -> (u64, u64) {
    const COPIES: u64 = 5 * 12;
    let [width, height] = size.map(u64::from);
    if width * height <= DENOISER_WHOLE {
        return (DENOISER, COPIES + DENOISER_PIXEL);
    }
    let first = DENOISER_WHOLE * (DENOISER_PIXEL - DENOISER_LATER_PIXEL);
    (DENOISER + first, COPIES + DENOISER_LATER_PIXEL)
}

/// The number of values of each pixel in the picture and its layers, without coverage and variance.
pub fn picture_channels(settings: &Settings) -> u64 {
    let layers = settings.aovs.iter().filter(|aov| aov.kind() != AovKind::Coverage);
    4 + layers.map(|aov| aov.channels().len() as u64).sum::<u64>()
}

/// The film's bytes per pixel.
fn film_bytes(settings: &Settings, sampled: u64, covers: u64, is_signed: bool) -> u64 {
    let channels = 4 + sampled;
    let decided = if settings.noise.is_some() { 16 + 2 * 4 } else { 0 };
    // The list of a pixel that few things cover, with its heap overhead.
    let cover = 24 + 80;
    let sums = 8 * if is_signed { 3 * channels + 1 } else { 2 * channels };
    let run = sums + 4 + 16 + cover * covers;
    run * u64::from(most_runs(settings.spp)) + decided + 4 * sampled + TILE_BYTES
}

/// Bytes of the guiding field and of the records of a batch. They grow with the square root of the
/// number of paths; see [`crate::Guiding`].
fn guiding_bytes(passes: u32) -> u64 {
    (64 << 20) + ((1u64 << 19) * (1 << (passes.min(40) / 2)))
}

/// Peak memory of compiling a scene in bytes, without the scene itself.
pub fn of_scene(scene: &Scene) -> u64 {
    let mut meshes: HashMap<*const TriangleMesh, u64> = HashMap::new();
    let mut bytes = 0u64;
    let mut add = |more: u64| bytes = bytes.saturating_add(more);
    let shapes = |id: NodeId| {
        let surfaces = scene.nodes.get(id.index()).map_or(&[][..], |node| &node.surfaces);
        surfaces.iter().filter(|surface| matches!(surface.geometry, Geometry::Shape(_))).count()
            as u64
    };
    add(NODE + shapes(scene.root) * SHAPE);
    for node in &scene.nodes {
        // Shapes exist once for each occurrence of their node, other surfaces only once.
        node.children.iter().for_each(|&child| add(NODE + shapes(child) * SHAPE));
        for surface in &node.surfaces {
            add(match &surface.geometry {
                Geometry::Shape(_) => 0,
                Geometry::Curves(curves) => curves.segment_count() as u64 * SEGMENT,
                Geometry::Mesh(mesh) => {
                    let uses = meshes.entry(Arc::as_ptr(mesh)).or_insert(0);
                    *uses += 1;
                    if *uses == 1 { mesh.indices.len() as u64 * TRIANGLE } else { NODE }
                }
            });
        }
    }
    let images = scene
        .textures
        .iter()
        .filter_map(|texture| scene.images.get(texture.as_image()?.image.index()));
    images.for_each(|image| add(pyramid_bytes(image)));
    if let Some(Environment::Image { image, .. }) = &scene.environment {
        add(u64::from(image.width) * u64::from(image.height) * ENVIRONMENT);
    }
    bytes
}

/// Bytes per triangle of a mesh in the acceleration structure and in the buffers of its build.
/// Measured for the builders and layouts that need most (`--quality high`, `--bvh-compact`).
const TRIANGLE: u64 = 115;
/// Bytes of the parts of the program that only rendering loads; measured.
const PROGRAM: u64 = 4 << 20;
/// Bytes per segment of a curve; measured.
const SEGMENT: u64 = 400;
/// Bytes per analytic shape with its placement; measured.
const SHAPE: u64 = 700;
/// Bytes per occurrence of a node.
const NODE: u64 = 250;
/// Bytes per pixel of an environment, for its radiance and two sampling tables; measured.
const ENVIRONMENT: u64 = 26;

/// Bytes of the mipmap levels of an image, and of the values that they are computed from.
fn pyramid_bytes(image: &Image) -> u64 {
    let values = u64::from(image.width) * u64::from(image.height) * u64::from(image.channels);
    let stored = if matches!(image.pixels, Pixels::F32(_)) { 4 } else { 2 };
    values / 3 * stored + values / 4 * 5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(change: impl FnOnce(&mut Settings), uses: Uses) -> Estimate {
        let mut settings = Settings { size: [1000, 500], spp: 1, ..Settings::default() };
        change(&mut settings);
        of_picture(&settings, &Uses { threads: 1, ..uses })
    }

    #[test]
    fn what_fits_is_a_picture_of_the_same_shape_that_takes_no_more() {
        let estimate = estimate(|_| {}, Uses::default());
        let available = estimate.bytes() / 2;
        let size = estimate.largest(available).expect("half of it fits");
        assert!(Estimate { size, ..estimate }.bytes() <= available);
        assert!(size[0] > 600 && size[0].abs_diff(2 * size[1]) <= 10, "{size:?}");
        assert_eq!(estimate.largest(u64::MAX), Some([1000, 500]));
        assert_eq!(estimate.largest(1000), None);
        assert!(
            estimate.advice(available).starts_with("a picture of at most 6"),
            "{}",
            estimate.advice(available)
        );
    }

    #[test]
    fn whatever_is_kept_for_each_pixel_counts() {
        let plain = estimate(|_| {}, Uses::default()).per_pixel;
        let layers = estimate(|s| s.aovs = Aov::ALL.to_vec(), Uses::default()).per_pixel;
        let lobes = estimate(|s| s.filter = crate::Filter::Mitchell, Uses::default()).per_pixel;
        let blocks = estimate(|s| s.spp = 50, Uses::default()).per_pixel;
        let variance = estimate(|_| {}, Uses { variance: true, ..Uses::default() }).per_pixel;
        assert!(
            layers > 10 * plain
                && lobes > plain + 30
                && blocks > plain + 70
                && variance > plain + 15
        );
        // With whole blocks only, the film needs a single set of sums.
        assert!(estimate(|s| s.spp = 64, Uses::default()).per_pixel < plain + 20);
        let crop = Some(Crop { min: [10, 10], max: [20, 30] });
        assert_eq!(estimate(|s| s.crop = crop, Uses::default()).size, [10, 20]);
    }
}
