//! What is shown while a picture at rest is refined: first a denoised one, which begins as the
//! moving picture before it and fades into the true samples.

use crate::denoise::Guide;
use crate::learned::Clean;
use crate::light::{Known, Lit, limit, passes};
use crate::preview::{Look, Looks, Moving, View};
use crate::surfaces::{Color, PIXELS, Surfaces};
use rayon::prelude::*;
use std::sync::Arc;

/// The samples for which the light of moving pictures counts, at most. It counts less the more
/// samples there are, because it may be wrong.
const BEFORE: f32 = 12.0;
/// The samples for which the moving picture counts at mirrors, glass and edges, if it has as many
/// pixels. A smaller one counts less, because its pixels would be seen.
const BESIDE: f32 = 4.0;
/// Light that rests on fewer samples is corrected by moving pictures.
const ENOUGH: f32 = 8.0;
/// Noise below which only the true samples are shown, and noise above which they fade in by their
/// number alone.
const QUIET: [f32; 2] = [0.01, 0.03];

/// Pictures with more pixels are shown as they are: denoising them would take too long, and too
/// much memory.
const MOST_PIXELS: u64 = 1 << 22;

/// True if pictures of this size are denoised while they are refined.
pub fn is_denoised(size: [u32; 2]) -> bool {
    size.into_iter().map(u64::from).product::<u64>() <= MOST_PIXELS
}

/// A picture at rest that is being refined.
pub struct Resting {
    /// What its pixels see.
    pub surfaces: Arc<Surfaces>,
    looks: Vec<Look>,
    /// Whether each pixel shows one surface.
    inner: Vec<bool>,
    /// The light of the pictures before.
    before: Vec<Known>,
    /// The colours of the moving picture before; empty if there was none.
    moving: Vec<Color>,
    /// The samples for which those count where no light is known.
    beside: f32,
    has_media: bool,
}

/// A denoised picture.
pub struct Denoised {
    /// Linear colours.
    pub colors: Vec<Color>,
    /// The light in it.
    pub lit: Lit,
}

impl Resting {
    /// Begins with what moving pictures know.
    pub fn new(view: &View, moving: &Moving) -> Self {
        let surfaces = Surfaces::seen(
            view.compiled,
            view.camera,
            &view.plain(view.settings.size),
            [0.5; 2],
            view.threads,
        );
        let looks = Looks::new(view.compiled);
        let looks = surfaces.points.iter().map(|point| looks.of(point)).collect();
        let (inner, before) = (surfaces.inner(), moving.known(&surfaces));
        let shown = moving.shown(view).map(|picture| {
            let [width, _] = surfaces.size;
            let color = |i: usize| picture.color([i % width, i / width], surfaces.size);
            let all = (0..surfaces.count()).into_par_iter().with_min_len(PIXELS);
            all.map(color).collect()
        });
        let pixels = |[width, height]: [u32; 2]| f64::from(width) * f64::from(height);
        let scale = moving.shown(view).map_or(0.0, |picture| {
            (pixels(picture.size()) / pixels(view.settings.size).max(1.0)).min(1.0)
        });
        Self {
            looks,
            inner,
            before,
            moving: shown.unwrap_or_default(),
            beside: BESIDE * scale as f32,
            has_media: view.compiled.has_media(),
            surfaces: Arc::new(surfaces),
        }
    }

    /// Denoises the picture, given as linear RGB values with this mean number of samples.
    pub fn denoised(&self, rgb: &[f32], samples: f32) -> Denoised {
        let Self { surfaces, looks, inner, before, moving, beside, .. } = self;
        let radiance = |i: usize| [0, 1, 2].map(|c| rgb[i * 3 + c]);
        let is_lit = |i: usize| matches!(looks[i], Look::Matte | Look::Glossy);
        let count = surfaces.count();
        let mut weights: Vec<f32> = (0..count).map(|i| f32::from(is_lit(i) && inner[i])).collect();
        let mut lights: Vec<Color> =
            (0..count).map(|i| surfaces.points[i].light(radiance(i))).collect();
        limit(&mut lights, &weights, surfaces.size[0], |i| before[i].light);
        // Less noise needs less smoothing, which keeps more of the shadows.
        let most = match samples {
            0.0..4.0 => 5,
            4.0..16.0 => 4,
            16.0..64.0 => 3,
            64.0..256.0 => 2,
            _ => 1,
        };
        let all: Vec<usize> = (0..count).collect();
        Guide::new(surfaces, surfaces.size[0], &all).smooth(
            &mut lights,
            &mut weights,
            passes(most, self.has_media),
        );
        let known = |i: usize| {
            let (before, now) = (before[i], if weights[i] > 0.0 { samples } else { 0.0 });
            if !is_lit(i) || before.trust + now == 0.0 {
                return Known::default();
            }
            let old = before.trust.min(BEFORE) * BEFORE / (BEFORE + samples);
            let share = now / (old + now);
            let light = |c| before.light[c] + share * (lights[i][c] - before.light[c]);
            let is_firm = looks[i] == Look::Matte && old + now >= ENOUGH;
            let trust = if is_firm { f32::INFINITY } else { old + now };
            Known { light: [0, 1, 2].map(light), trust }
        };
        let pixels = || (0..count).into_par_iter().with_min_len(PIXELS);
        let known: Vec<Known> = pixels().map(known).collect();
        let color = |i: usize| {
            let raw = radiance(i);
            let smooth = match known[i].trust > 0.0 {
                true => Some(surfaces.points[i].radiance(known[i].light)),
                false => moving.get(i).copied(),
            };
            let is_smooth = known[i].trust > 0.0 && inner[i];
            match (looks[i], smooth) {
                (Look::Plain, _) | (_, None) => raw,
                (_, Some(smooth)) if is_smooth => smooth,
                (_, Some(smooth)) => {
                    let is_small = known[i].trust == 0.0;
                    let share = samples / (samples + if is_small { *beside } else { BESIDE });
                    [0, 1, 2].map(|c| smooth[c] + share * (raw[c] - smooth[c]))
                }
            }
        };
        let colors = pixels().map(color).collect();
        Denoised { colors, lit: Lit { surfaces: surfaces.clone(), known } }
    }

    /// The light in a picture that was denoised elsewhere.
    pub fn light_of(&self, clean: &Clean) -> Lit {
        let light = |(i, color): (usize, &Color)| match self.looks[i] {
            _ if !self.inner[i] => Known::default(),
            Look::Plain | Look::Sharp => Known::default(),
            Look::Matte => {
                Known { light: self.surfaces.points[i].light(*color), trust: f32::INFINITY }
            }
            Look::Glossy => {
                Known { light: self.surfaces.points[i].light(*color), trust: clean.samples }
            }
        };
        let known = clean.colors.par_iter().enumerate().with_min_len(PIXELS).map(light).collect();
        Lit { surfaces: self.surfaces.clone(), known }
    }
}

/// The share of the denoised picture in what is shown, given the samples so far of those wanted,
/// and the noise of the true picture, if it is known.
pub fn denoised_share(samples: f32, wanted: f32, noise: f32) -> f32 {
    let taken = (samples / wanted.max(1.0)).clamp(0.0, 1.0);
    let quiet = ((QUIET[1] - noise) / (QUIET[1] - QUIET[0])).clamp(0.0, 1.0);
    // Nothing is known of the noise of the first samples.
    let quiet = if noise.is_finite() { quiet } else { 0.0 };
    1.0 - quiet.max(taken * taken)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_render::{CompiledScene, Job, Settings};
    use snell_scene::builtin::builtin;

    #[test]
    fn the_denoised_picture_fades_into_the_true_samples() {
        assert_eq!(denoised_share(1.0, 64.0, f32::NAN), 1.0 - 1.0 / 4096.0);
        assert_eq!(denoised_share(16.0, 1000.0, 0.005), 0.0);
        assert_eq!(denoised_share(64.0, 64.0, 0.2), 0.0);
        assert_eq!(denoised_share(1.0, 1.0, f32::NAN), 0.0);
    }

    #[test]
    fn a_denoised_picture_is_nearer_to_the_truth_than_its_samples() {
        let scene = builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &Default::default()).expect("a valid scene");
        let settings = |spp| Settings { size: [96, 72], spp, ..Settings::default() };
        let picture = |settings: &Settings| {
            let job = Job::new(&compiled, &scene.cameras[0], settings);
            crate::preview::rgb_of(&job.run(2, &|_| true).0.image())
        };
        let truth = picture(&settings(512));
        let settings = settings(2);
        let (camera, generation) = (&scene.cameras[0], [0; 3]);
        let view =
            View { compiled: &compiled, camera, settings: &settings, generation, threads: 2 };
        let mut moving = Moving::default();
        // The moving picture at half the size knows the light too.
        let moved = (0..16).map(|_| moving.next(&view, [48, 36])).last().expect("a picture");
        let noisy = picture(&settings);
        let denoised = Resting::new(&view, &moving).denoised(&noisy, 2.0);
        let level = |v: f32| 255.0 * v.clamp(0.0, 1.0).powf(1.0 / 2.2);
        let error = |rgb: &[f32]| {
            let sum: f32 = rgb.iter().zip(&truth).map(|(a, b)| (level(*a) - level(*b)).abs()).sum();
            sum / truth.len() as f32
        };
        let smooth: Vec<f32> = denoised.colors.iter().flatten().copied().collect();
        let errors = [error(&moved.1), error(&smooth), error(&noisy)];
        assert!(moved.0 == [96, 72] && errors[0] < 12.0, "{errors:?}");
        assert!(errors[1] < errors[0] && errors[1] < 0.6 * errors[2], "{errors:?}");
    }
}
