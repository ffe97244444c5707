//! What is shown while something moves: one sample in the middle of each pixel, and no light that needs many.
//!
//! Scenes with few lights are ray-cast, with a constant in the place of indirect light that is measured when the view rests: edges
//! and shadows are sharp and nothing flickers. Many lights or an environment would cost too much or need chance; there, one light
//! sample a pixel is smoothed (see [`crate::denoise`]).

use snell_math::Rgb;
use snell_render::{Aov, CompiledScene, IntegratorKind, Job, LightStrategy, Settings};
use snell_scene::{Camera, LayeredImage};

/// Most lights that are all asked at every pixel.
const FEW_LIGHTS: usize = 8;

/// How a moving picture is made.
pub struct Preview {
    /// For the render.
    pub settings: Settings,
    /// True if the picture is to be smoothed; it has the layers that smoothing needs.
    pub is_noisy: bool,
}

/// How pictures of this size are made while something moves.
pub fn plan(settings: &Settings, compiled: &CompiledScene, size: [u32; 2], fill: Rgb) -> Preview {
    let is_lit = matches!(settings.integrator, IntegratorKind::Path | IntegratorKind::Direct);
    let by_chance = compiled.lights().len() > FEW_LIGHTS || compiled.environment_light().is_some();
    let is_noisy = is_lit && by_chance;
    let integrator = match settings.integrator {
        _ if is_noisy => IntegratorKind::Path,
        IntegratorKind::Path | IntegratorKind::Direct => IntegratorKind::Raycast,
        other => other,
    };
    let max_depth = if is_noisy { settings.max_depth.min(2) } else { settings.max_depth.min(4) };
    let settings = Settings {
        size,
        crop: None,
        spp: 1,
        integrator,
        max_depth,
        fill,
        light_strategy: LightStrategy::Mis,
        noise: None,
        guiding: None,
        pixel_position: Some([0.5, 0.5]),
        progressive: false,
        aovs: if is_noisy {
            vec![Aov::Albedo, Aov::Normal, Aov::Depth, Aov::MaterialId]
        } else {
            settings.aovs.clone()
        },
        ..settings.clone()
    };
    Preview { settings, is_noisy }
}

/// Width of the pictures that a first guess is made from.
const GUESS_WIDTH: u32 = 48;
/// Samples of their pixels.
const GUESS_SPP: u32 = 4;

/// A first [`fill`] of a scene that has not rested yet, from two tiny pictures. Black where none is needed.
pub fn first_fill(settings: &Settings, camera: &Camera, compiled: &CompiledScene, threads: usize) -> Rgb {
    let [width, height] = settings.size;
    let small = [GUESS_WIDTH.min(width), (GUESS_WIDTH * height / width.max(1)).clamp(1, height.max(1))];
    let Preview { settings: quick, is_noisy } = plan(settings, compiled, small, Rgb::BLACK);
    if is_noisy || quick.integrator != IntegratorKind::Raycast || settings.integrator != IntegratorKind::Path {
        return Rgb::BLACK;
    }
    let whole = Settings { integrator: IntegratorKind::Path, spp: GUESS_SPP, max_depth: 5, ..quick.clone() };
    let picture = |settings| Job::new(compiled, camera, settings).run(threads, &|_| true).0.image();
    fill(&picture(&whole), &picture(&quick), Rgb::BLACK)
}

/// The constant that makes a ray-cast picture as bright as the one at rest: what it lacks, over the share that surfaces reflect.
pub fn fill(rest: &LayeredImage, preview: &LayeredImage, before: Rgb) -> Rgb {
    let (rest, preview, before) = (mean(rest), mean(preview), before.to_array());
    // Most surfaces reflect about half; bright spots of the picture at rest must not flood everything.
    let [r, g, b] = [0, 1, 2].map(|c| {
        let wanted = before[c] + 2.0 * (rest[c] - preview[c]);
        if wanted.is_finite() { wanted.clamp(0.0, 2.0) } else { 0.0 }
    });
    Rgb::new(r, g, b)
}

/// The mean of a picture with each value cut at 1: what lamps and highlights add beyond is no measure of indirect light.
fn mean(image: &LayeredImage) -> [f32; 3] {
    let layer = &image.layers[0];
    let stride = layer.channels.len();
    let mut sums = [0.0_f64; 3];
    for pixel in layer.values.chunks_exact(stride) {
        for (sum, value) in sums.iter_mut().zip(pixel) {
            *sum += f64::from(value.clamp(0.0, 1.0));
        }
    }
    let count = (layer.values.len() / stride).max(1) as f64;
    sums.map(|sum| (sum / count) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_scene::Layer;

    fn picture(value: f32) -> LayeredImage {
        let channels = ["R", "G", "B"].map(String::from).to_vec();
        let layers = vec![Layer { name: String::new(), channels, values: vec![value; 12] }];
        LayeredImage { width: 2, height: 2, layers, metadata: Vec::new() }
    }

    #[test]
    fn a_scene_that_has_not_rested_is_not_dark() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &Default::default()).expect("a valid scene");
        let settings = Settings { size: [640, 480], ..Settings::default() };
        let fill = first_fill(&settings, &scene.cameras[0], &compiled, 2);
        assert!(fill.r > 0.03 && fill.g > 0.02 && fill.max_element() < 1.0, "{fill:?}");
        let flat = Settings { integrator: IntegratorKind::Flat, ..settings };
        assert_eq!(first_fill(&flat, &scene.cameras[0], &compiled, 2), Rgb::BLACK);
    }

    #[test]
    fn the_fill_makes_up_for_what_is_lacking() {
        assert_eq!(fill(&picture(0.5), &picture(0.25), Rgb::BLACK), Rgb::splat(0.5));
        assert_eq!(fill(&picture(0.2), &picture(0.5), Rgb::splat(0.1)), Rgb::BLACK);
        assert_eq!(fill(&picture(f32::NAN), &picture(0.5), Rgb::BLACK), Rgb::BLACK);
    }
}
