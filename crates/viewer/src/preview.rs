//! Pictures while something moves, each made from the ones before.
//!
//! What the pixels see is found anew for every picture. The light that arrives there is that of the
//! last picture at rest, which is the same from everywhere on matte surfaces; elsewhere that of the
//! moving pictures before, corrected by paths from a quarter of the pixels with all of their
//! bounces, so that moving pictures are as bright as those at rest (see [`crate::light`]). Mirrors
//! and glass are ray-traced. Four pictures make one of four times the pixels (see
//! [`crate::temporal`]).

use crate::light::{CHANGED, Known, Lit, Quarter, Samples, passes};
use crate::surfaces::{Color, PIXELS, Point, Surfaces, scatter};
use crate::temporal::{self, Fresh, History};
use rayon::prelude::*;
use snell_math::rng;
use snell_render::{
    Aov, CausticsMode, CompiledScene, Filter, IntegratorKind, Job, Settings, picture,
};
use snell_scene::{Background, Camera, LayeredImage, Material};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Maximum number of lights that are all evaluated at every mirror.
const FEW_LIGHTS: usize = 8;
/// Bounces of mirrors and glass that show other objects.
const MIRROR_DEPTH: u32 = 6;
/// Bounces of paths.
const PATH_DEPTH: u32 = 24;
/// The samples that light of moving pictures rests on, at most.
const LONGEST: f32 = 24.0;

/// How the colour of a pixel is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// It is that of the background, or of a surface that only emits.
    Plain,
    /// Light arrives and is scattered in all directions alike.
    Matte,
    /// Light arrives, and the direction matters.
    Glossy,
    /// It shows other objects.
    Sharp,
}

/// The looks of a scene's materials.
pub struct Looks {
    of_material: Vec<Look>,
    of_nothing: Look,
}

impl Looks {
    /// The looks in a scene.
    pub fn new(compiled: &CompiledScene) -> Self {
        let is_clear = !compiled.has_media();
        let of = |material: &Material| match material.kind.name() {
            _ if !is_clear => Look::Glossy,
            "diffuse" => Look::Matte,
            "black" => Look::Plain,
            "mirror" | "dielectric" | "conductor" => Look::Sharp,
            _ => Look::Glossy,
        };
        let is_empty = is_clear && !matches!(compiled.background, Background::ShadowCatcher(_));
        let of_nothing = if is_empty { Look::Plain } else { Look::Glossy };
        Self { of_material: compiled.materials.iter().map(of).collect(), of_nothing }
    }

    /// The look of a point.
    pub fn of(&self, point: &Point) -> Look {
        match usize::try_from(point.material) {
            Ok(material) => self.of_material.get(material).copied().unwrap_or(Look::Glossy),
            Err(_) => self.of_nothing,
        }
    }
}

/// What is shown, and how.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The scene.
    pub compiled: &'a CompiledScene,
    /// The camera.
    pub camera: &'a Camera,
    /// The settings at rest.
    pub settings: &'a Settings,
    /// Generations of the scene, of its geometry, and of what shines in it.
    pub generation: [u32; 3],
    /// The number of threads.
    pub threads: usize,
}

/// What light depends on: the generations, the integrator and the bounces.
type Origin = ([u32; 3], IntegratorKind, u32);

impl View<'_> {
    /// True if light is transported, so that it can be kept.
    pub fn is_lit(&self) -> bool {
        matches!(self.settings.integrator, IntegratorKind::Path | IntegratorKind::Direct)
    }

    fn origin(&self) -> Origin {
        (self.generation, self.settings.integrator, self.settings.max_depth)
    }

    /// The settings of a single sample in each pixel of a picture of this size.
    pub fn plain(&self, size: [u32; 2]) -> Settings {
        Settings {
            size,
            crop: None,
            spp: 1,
            noise: None,
            guiding: None,
            caustics: CausticsMode::Off,
            filter: Filter::Box,
            progressive: false,
            light_groups: Vec::new(),
            aovs: Vec::new(),
            later_cameras: Vec::new(),
            ..self.settings.clone()
        }
    }
}

/// The samples of a picture.
#[derive(Default)]
struct Made {
    /// Their colours.
    colors: Vec<Color>,
    /// The light at their points; empty if none is transported.
    known: Vec<Known>,
    /// Which colours are noisy; empty if none is.
    noisy: Vec<bool>,
}

/// The moving pictures so far, as far as the next one needs them.
#[derive(Default)]
pub struct Moving {
    frame: u32,
    origin: Option<Origin>,
    /// The light of the last picture at rest.
    rest: Option<Lit>,
    /// The light of the last moving picture.
    last: Option<Lit>,
    history: Option<History>,
    /// For each material that shows other objects: the light in pictures at rest and in moving
    /// ones, over some time.
    reflected: BTreeMap<i32, [Color; 2]>,
}

impl Moving {
    /// The next picture, made of `size` samples, both sides even: its size, and its linear RGB
    /// values.
    pub fn next(&mut self, view: &View, size: [u32; 2]) -> ([u32; 2], Vec<f32>) {
        self.keep(view);
        self.frame = self.frame.wrapping_add(1);
        let offset = temporal::offset(self.frame);
        let settings = Settings { pixel_position: Some(offset), ..view.plain(size) };
        let surfaces = Surfaces::seen(view.compiled, view.camera, &settings, offset, view.threads);
        let made = match view.is_lit() {
            true => self.lit(view, &surfaces, &settings),
            false => Made { colors: whole(view, &settings), ..Made::default() },
        };
        let has_lens = view.camera.has_lens();
        let is_noisy = |pixel: usize| has_lens || made.noisy.get(pixel) == Some(&true);
        let fresh = Fresh { surfaces: &surfaces, colors: &made.colors, is_noisy: &is_noisy };
        let history = History::next(self.history.as_ref(), &fresh);
        let shown = (history.size(), history.rgb());
        self.history = Some(history);
        self.last = view.is_lit().then(|| Lit { surfaces: Arc::new(surfaces), known: made.known });
        shown
    }

    /// Keeps the light of a picture at rest.
    pub fn rest(&mut self, view: &View, lit: Lit) {
        self.keep(view);
        // It begins as what the last moving picture knows, and is better.
        (self.rest, self.last) = (Some(lit), None);
    }

    /// What is known of the light at points.
    pub fn known(&self, surfaces: &Surfaces) -> Vec<Known> {
        let find = |point: &Point| {
            let at_rest = self.rest.as_ref().map(|lit| lit.at(point)).unwrap_or_default();
            if at_rest.trust == f32::INFINITY {
                return at_rest;
            }
            let last = self.last.as_ref().map(|lit| lit.at(point)).unwrap_or_default();
            let found = if last.trust > 0.0 { last } else { at_rest };
            Known { trust: found.trust.min(LONGEST), ..found }
        };
        surfaces.points.par_iter().with_min_len(PIXELS / 8).map(find).collect()
    }

    /// The last moving picture, if it shows this view.
    pub fn shown(&self, view: &View) -> Option<&History> {
        self.history.as_ref().filter(|history| history.is_of(view.camera))
    }

    /// Forgets what is not true any more: everything if the geometry or a light is another one, and
    /// most of it after another change, which light that falls on surfaces outlasts.
    fn keep(&mut self, view: &View) {
        let origin = view.origin();
        let Some(before) = self.origin.replace(origin).filter(|before| *before != origin) else {
            return;
        };
        if before.0[1..] != origin.0[1..] {
            *self = Self { origin: Some(origin), frame: self.frame, ..Self::default() };
            return;
        }
        let lit = self.rest.iter_mut().chain(&mut self.last);
        lit.flat_map(|lit| &mut lit.known).for_each(|known| known.trust = known.trust.min(CHANGED));
        (self.history, self.reflected) = (None, BTreeMap::new());
    }

    /// A picture with light.
    fn lit(&mut self, view: &View, surfaces: &Surfaces, settings: &Settings) -> Made {
        let looks = Looks::new(view.compiled);
        let mut looks = surfaces.points.iter().map(|p| looks.of(p)).collect::<Vec<_>>();
        // Without light that arrives, all is emitted.
        if view.settings.max_depth == 0 {
            looks.fill(Look::Plain);
        }
        let mut known = self.known(surfaces);
        let first = [self.frame >> 2 & 1, self.frame >> 3 & 1].map(|side| side as usize);
        let quarter = Quarter::new(surfaces.size, first);
        let radiance = self.sample(view, settings, surfaces, &quarter, &|i| {
            looks[i] == Look::Sharp || looks[i] != Look::Plain && known[i].trust != f32::INFINITY
        });
        let light = |(&i, radiance): (&usize, &Option<Color>)| {
            let point = &surfaces.points[i];
            radiance.filter(|_| looks[i] != Look::Sharp).map(|radiance| point.light(radiance))
        };
        let samples: Samples = quarter.numbers.iter().zip(&radiance).map(light).collect();
        let passes = passes(u32::MAX, view.compiled.has_media());
        quarter.update(surfaces, &mut known, &samples, passes);
        let colors = surfaces.points.iter().zip(&looks).zip(&known);
        let mut colors: Vec<Color> = colors
            .map(|((point, look), known)| match look {
                Look::Matte | Look::Glossy => point.radiance(known.light),
                Look::Plain | Look::Sharp => point.glow,
            })
            .collect();
        let mut noisy = Vec::new();
        if looks.contains(&Look::Sharp) {
            let is_sharp = |i: usize| looks[i] == Look::Sharp;
            noisy = self.reflect(view, settings, surfaces, &is_sharp, &mut colors);
            self.brighten(surfaces, &is_sharp, &quarter, &radiance, &mut colors);
        }
        Made { colors, known, noisy }
    }

    /// The radiance of paths from the pixels of a quarter that need it.
    fn sample(
        &self,
        view: &View,
        settings: &Settings,
        surfaces: &Surfaces,
        quarter: &Quarter,
        is_needed: &(dyn Fn(usize) -> bool + Sync),
    ) -> Vec<Option<Color>> {
        let settings = Settings {
            size: quarter.size.map(|side| side as u32),
            pixel_position: Some(quarter.offset(surfaces.offset)),
            seed: rng::hash_combine(settings.seed, self.frame),
            max_depth: settings.max_depth.min(PATH_DEPTH),
            ..settings.clone()
        };
        let width = quarter.size[0];
        let is_wanted =
            |[x, y]: [u32; 2]| is_needed(quarter.numbers[y as usize * width + x as usize]);
        let parts =
            Job::new(view.compiled, view.camera, &settings).glance(view.threads, &is_wanted);
        let mut radiance = vec![None; quarter.numbers.len()];
        scatter(&parts, width, |pixel, color, _| radiance[pixel] = Some(color));
        radiance
    }

    /// Ray-traces what mirrors and glass show. With many lights or an environment, one path each is
    /// followed instead; the result tells the pixels where that was done, which are noisy.
    fn reflect(
        &self,
        view: &View,
        settings: &Settings,
        surfaces: &Surfaces,
        is_sharp: &(dyn Fn(usize) -> bool + Sync),
        colors: &mut [Color],
    ) -> Vec<bool> {
        let compiled = view.compiled;
        let by_chance =
            compiled.lights().len() > FEW_LIGHTS || compiled.environment_light().is_some();
        let (integrator, deepest) = match by_chance {
            true => (settings.integrator, PATH_DEPTH),
            false => (IntegratorKind::Whitted, MIRROR_DEPTH),
        };
        let settings = Settings {
            integrator,
            max_depth: settings.max_depth.min(deepest),
            seed: rng::hash_combine(settings.seed, self.frame),
            ..settings.clone()
        };
        let width = surfaces.size[0];
        let is_wanted = |[x, y]: [u32; 2]| is_sharp(y as usize * width + x as usize);
        let parts = Job::new(compiled, view.camera, &settings).glance(view.threads, &is_wanted);
        scatter(&parts, width, |pixel, color, _| colors[pixel] = color);
        match by_chance {
            true => (0..surfaces.count()).map(is_sharp).collect(),
            false => Vec::new(),
        }
    }

    /// Makes what mirrors and glass show as bright as paths find it, material by material: light
    /// that reaches mirrored surfaces by several bounces is missing there.
    fn brighten(
        &mut self,
        surfaces: &Surfaces,
        is_sharp: &dyn Fn(usize) -> bool,
        quarter: &Quarter,
        radiance: &[Option<Color>],
        colors: &mut [Color],
    ) {
        for [truth, seen] in self.reflected.values_mut() {
            (0..3).for_each(|c| (truth[c], seen[c]) = (truth[c] * 0.9, seen[c] * 0.9));
        }
        for (&i, sample) in quarter.numbers.iter().zip(radiance) {
            let Some(sample) = sample.filter(|_| is_sharp(i)) else { continue };
            let [truth, seen] = self.reflected.entry(surfaces.points[i].material).or_default();
            for c in 0..3 {
                // Bright lamps and highlights are no measure of other light.
                truth[c] += sample[c].min(2.0);
                seen[c] += colors[i][c].min(2.0);
            }
        }
        for (i, color) in colors.iter_mut().enumerate().filter(|(i, _)| is_sharp(*i)) {
            let Some([truth, seen]) = self.reflected.get(&surfaces.points[i].material) else {
                continue;
            };
            for c in 0..3 {
                color[c] *= ((truth[c] + 1e-3) / (seen[c] + 1e-3)).clamp(0.25, 4.0);
            }
        }
    }
}

/// The colours of a picture of another integrator.
fn whole(view: &View, settings: &Settings) -> Vec<Color> {
    let aovs = match settings.integrator {
        IntegratorKind::Aov => view.settings.aovs.clone(),
        _ => Vec::<Aov>::new(),
    };
    let max_depth = settings.max_depth.min(MIRROR_DEPTH);
    let settings = Settings { aovs, max_depth, ..settings.clone() };
    let (film, _) = Job::new(view.compiled, view.camera, &settings).run(view.threads, &|_| true);
    let image = picture(&film, &settings, view.compiled);
    rgb_of(&image).chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
}

/// Red, green, blue of the first layer.
pub fn rgb_of(image: &LayeredImage) -> Vec<f32> {
    let layer = &image.layers[0];
    let mut rgb = Vec::with_capacity((image.width * image.height * 3) as usize);
    layer.values.chunks_exact(layer.channels.len()).for_each(|p| rgb.extend_from_slice(&p[..3]));
    rgb
}

#[cfg(test)]
mod tests;
