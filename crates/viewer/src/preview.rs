//! Renders pictures while something moves: one sample in the centre of each pixel, without light
//! that needs many samples.
//!
//! Scenes with few lights are ray-cast, or ray-traced if mirrors and glass show other objects;
//! edges and shadows are sharp and nothing flickers. Many lights or an environment would cost too
//! much or need random samples; there, one light sample per pixel is denoised (see
//! [`crate::denoise`]). A constant, measured while the view rests, replaces indirect light.

use crate::denoise::{denoise, is_sharp};
use crate::temporal::{self, Fresh, History};
use snell_math::Rgb;
use snell_render::{
    Aov, CompiledScene, Filter, IntegratorKind, Job, LightStrategy, Settings, picture,
};
use snell_scene::{Camera, LayeredImage};

/// Maximum number of lights that are all evaluated at every pixel.
const FEW_LIGHTS: usize = 8;
/// Bounces if mirrors and glass show other objects.
const MIRROR_DEPTH: u32 = 4;

/// Random bounces in scenes with glass: enough to go into a bowl and its inside, out again, and to
/// the surface behind.
const GLASS_DEPTH: u32 = 5;

/// The settings of moving pictures.
pub struct Preview {
    settings: Settings,
    /// True if the picture is to be denoised; then it has the layers that the filter needs.
    is_noisy: bool,
    /// True if a constant replaces light that only the picture at rest has.
    pub has_fill: bool,
    /// The quarter of each pixel that is sampled, if the picture has the layers for [`History`].
    phase: Option<[usize; 2]>,
}

impl Preview {
    /// Prepares pictures of this size for a scene that is rendered with `settings` at rest.
    pub fn new(settings: &Settings, compiled: &CompiledScene, size: [u32; 2], fill: Rgb) -> Self {
        let is_lit = matches!(settings.integrator, IntegratorKind::Path | IntegratorKind::Direct);
        let by_chance =
            compiled.lights().len() > FEW_LIGHTS || compiled.environment_light().is_some();
        let has_mirrors = compiled.materials.iter().any(|m| is_sharp(m) && !m.is_emissive());
        let is_noisy = is_lit && by_chance;
        let integrator = match settings.integrator {
            _ if is_noisy => IntegratorKind::Path,
            IntegratorKind::Path if has_mirrors => IntegratorKind::Whitted,
            IntegratorKind::Path | IntegratorKind::Direct => IntegratorKind::Raycast,
            other => other,
        };
        let most = match (is_noisy, has_mirrors) {
            (false, _) => MIRROR_DEPTH,
            (true, false) => 1,
            (true, true) if compiled.materials.iter().any(|m| m.kind.name() == "dielectric") => {
                GLASS_DEPTH
            }
            (true, true) => 2,
        };
        let settings = Settings {
            size,
            crop: None,
            spp: 1,
            integrator,
            max_depth: settings.max_depth.min(most),
            fill,
            light_strategy: LightStrategy::Mis,
            noise: None,
            guiding: None,
            pixel_position: Some([0.5, 0.5]),
            filter: Filter::Box,
            progressive: false,
            aovs: if is_noisy {
                vec![Aov::Albedo, Aov::Normal, Aov::Depth, Aov::MaterialId]
            } else {
                settings.aovs.clone()
            },
            ..settings.clone()
        };
        Self { settings, is_noisy, has_fill: is_lit, phase: None }
    }

    /// Moves the samples to another position in each pixel, for pictures that are combined from
    /// several.
    pub fn at_phase(mut self, phase: [usize; 2]) -> Self {
        self.phase = Some(phase);
        self.settings.pixel_position = Some(temporal::pixel_position(phase));
        if !self.is_noisy {
            self.settings.aovs = vec![Aov::MaterialId];
        }
        self.settings.aovs.push(Aov::Position);
        self
    }

    /// Renders linear RGB values, three per pixel.
    pub fn render(&self, camera: &Camera, compiled: &CompiledScene, threads: usize) -> Vec<f32> {
        self.image(camera, compiled, threads).1
    }

    /// Renders the picture that follows `before`, whose samples it reuses.
    pub fn follow(
        &self,
        before: Option<&History>,
        camera: &Camera,
        compiled: &CompiledScene,
        threads: usize,
    ) -> Option<History> {
        let (image, rgb) = self.image(camera, compiled, threads);
        let layer = |aov: Aov| {
            image.layers.iter().find(|layer| layer.name == aov.name()).map(|l| &l.values[..])
        };
        let (positions, ids) = (layer(Aov::Position)?, layer(Aov::MaterialId)?);
        let (size, is_noisy) = (self.settings.size, self.is_noisy || camera.has_lens());
        Some(History::next(
            before,
            &Fresh { camera, size, phase: self.phase?, rgb: &rgb, positions, ids, is_noisy },
        ))
    }

    fn image(
        &self,
        camera: &Camera,
        compiled: &CompiledScene,
        threads: usize,
    ) -> (LayeredImage, Vec<f32>) {
        let (film, _) = Job::new(compiled, camera, &self.settings).run(threads, &|_| true);
        let image = picture(&film, &self.settings, compiled);
        let mut rgb = rgb_of(&image);
        if self.is_noisy {
            denoise(&image, &compiled.materials, self.settings.fill, &mut rgb);
        }
        (image, rgb)
    }
}

/// Red, green, blue of the first layer.
pub fn rgb_of(image: &LayeredImage) -> Vec<f32> {
    let layer = &image.layers[0];
    let mut rgb = Vec::with_capacity((image.width * image.height * 3) as usize);
    layer.values.chunks_exact(layer.channels.len()).for_each(|p| rgb.extend_from_slice(&p[..3]));
    rgb
}

/// Width of the pictures for a first estimate.
const GUESS_WIDTH: u32 = 48;
/// Samples per pixel of these pictures.
const GUESS_SPP: u32 = 4;
/// Number of bounces in these pictures.
const GUESS_DEPTH: u32 = 5;

/// Estimates the [`fill`] for a scene that has not been at rest yet, from two tiny pictures. Black
/// if none is needed.
pub fn first_fill(
    settings: &Settings,
    camera: &Camera,
    compiled: &CompiledScene,
    threads: usize,
) -> Rgb {
    let [width, height] = settings.size;
    let small =
        [GUESS_WIDTH.min(width), (GUESS_WIDTH * height / width.max(1)).clamp(1, height.max(1))];
    let quick = Preview::new(settings, compiled, small, Rgb::BLACK);
    if !quick.has_fill || settings.integrator != IntegratorKind::Path {
        return Rgb::BLACK;
    }
    let (integrator, max_depth) = (IntegratorKind::Path, settings.max_depth.min(GUESS_DEPTH));
    let whole = Settings {
        integrator,
        max_depth,
        spp: GUESS_SPP,
        aovs: Vec::new(),
        ..quick.settings.clone()
    };
    let whole = rgb_of(&Job::new(compiled, camera, &whole).run(threads, &|_| true).0.image());
    fill(&whole, &quick.render(camera, compiled, threads), Rgb::BLACK)
}

/// The constant that makes a moving picture as bright as the one at rest: the missing light divided
/// by the mean reflectance, plus the constant `before` that the moving picture had. Pictures are
/// linear RGB values.
pub fn fill(rest: &[f32], preview: &[f32], before: Rgb) -> Rgb {
    let (rest, preview, before) = (mean(rest), mean(preview), before.to_array());
    // Most surfaces reflect about half; bright spots of the picture at rest must not brighten
    // everything.
    let [r, g, b] = [0, 1, 2].map(|c| {
        let wanted = before[c] + 2.0 * (rest[c] - preview[c]);
        if wanted.is_finite() { wanted.clamp(0.0, 2.0) } else { 0.0 }
    });
    Rgb::new(r, g, b)
}

/// The mean of a picture with each value clamped to 1: brighter lamps and highlights are no measure
/// of indirect light.
fn mean(rgb: &[f32]) -> [f32; 3] {
    let mut sums = [0.0_f64; 3];
    for pixel in rgb.chunks_exact(3) {
        for (sum, value) in sums.iter_mut().zip(pixel) {
            *sum += f64::from(value.clamp(0.0, 1.0));
        }
    }
    let count = (rgb.len() / 3).max(1) as f64;
    sums.map(|sum| (sum / count) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(value: f32) -> Vec<f32> {
        vec![value; 12]
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
