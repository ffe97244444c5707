//! Shared helpers of the cross-crate tests: concise scenes, rendering, and comparisons of noisy
//! pictures.

#![expect(clippy::disallowed_methods, reason = "tests need no certain bits")]

pub mod meshes;
pub mod random_worlds;
pub mod scenes;
pub mod statistics;

use snell_render::{CompiledScene, Film, Filter, Job, SamplerKind, Settings};
use snell_scene::{Camera, LayeredImage, Scene};
use std::path::PathBuf;

/// Settings of a small square picture with independent samples through the pixel centres, which
/// keep statistics simple.
pub fn settings(size: u32, spp: u32) -> Settings {
    Settings {
        size: [size, size],
        spp,
        sampler: SamplerKind::Independent,
        filter: Filter::Box,
        pixel_position: Some([0.5, 0.5]),
        ..Settings::default()
    }
}

/// Renders a scene with two threads.
///
/// # Panics
/// If the scene does not compile, or a sample is not finite.
pub fn render(scene: &Scene, camera: &Camera, settings: &Settings) -> Film {
    render_compiled(
        &CompiledScene::new(scene, &settings.build).expect("the scene compiles"),
        camera,
        settings,
        2,
    )
}

/// Renders a compiled scene.
///
/// # Panics
/// If a sample is not finite.
pub fn render_compiled(
    scene: &CompiledScene,
    camera: &Camera,
    settings: &Settings,
    threads: usize,
) -> Film {
    let (film, statistics) = Job::new(scene, camera, settings).run(threads, &|_| true);
    assert!(statistics.is_complete, "nothing stopped the render");
    assert_eq!(statistics.invalid_samples, 0, "every sample is finite");
    film
}

/// The colour of each pixel of a picture, row by row.
pub fn colors(image: &LayeredImage) -> Vec<[f64; 3]> {
    let layer = &image.layers[0];
    layer.values.chunks(layer.channels.len()).map(|p| [p[0], p[1], p[2]].map(f64::from)).collect()
}

/// The bits of all values of all layers: equal if and only if the pictures are the same.
pub fn bits(image: &LayeredImage) -> Vec<u32> {
    image.layers.iter().flat_map(|l| &l.values).map(|v| v.to_bits()).collect()
}

/// A file of the shared test data, which is beside the repository; `None` (with a note) if it is
/// absent.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is absent", path.display());
    None
}
