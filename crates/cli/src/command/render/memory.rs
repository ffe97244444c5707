//! Checks that there is memory for a picture, before work begins.

use super::options::Options;
use crate::failure::Failure;
use crate::resources::memory_bytes;
use snell_formats::image::encoder_bytes;
use snell_formats::memory::Available;
use snell_render::Settings;
use snell_render::memory::{Estimate, Uses, of_picture, of_scene, picture_channels};
use snell_scene::Scene;

/// The memory that a render with these settings will take in addition to that in use already.
fn estimate(options: &Options, settings: &Settings, scene: &Scene) -> Estimate {
    let output = options.output.as_deref().and_then(|path| path.extension());
    let extension = output.map_or("png".into(), |e| e.to_string_lossy().to_lowercase());
    let values = picture_channels(settings) * if options.variance { 2 } else { 1 };
    let uses = Uses {
        threads: options.threads(),
        variance: options.variance,
        denoise: options.request.denoise.is_some(),
        beside: encoder_bytes(&extension, values, options.bits),
    };
    of_picture(settings, &uses).with(of_scene(scene))
}

/// Refuses a picture for which there is too little memory; the error says what would fit. Returns
/// the estimated peak memory of the process, in bytes.
pub fn check(options: &Options, settings: &Settings, scene: &Scene) -> Result<u64, Failure> {
    let estimate = estimate(options, settings, scene);
    let available = Available::now().for_threads(options.threads());
    let [width, height] = estimate.size;
    let what = format!("a picture of {width}x{height} pixels");
    available.admit(&what, estimate.bytes()).map_err(|problem| {
        let fits = estimate.advice(available.bytes);
        let remedy = match estimate.largest(available.bytes) {
            Some(_) => "make it smaller with --size, or render parts of it with --crop",
            None => "most of it is for the scene; make that simpler, or give it more memory",
        };
        Failure::Usage(format!("{problem}; {fits}: {remedy}"))
    })?;
    Ok(memory_bytes().unwrap_or(0) + estimate.bytes())
}
