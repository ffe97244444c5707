//! Caustics by photons: light that lamps send through glass, water and off polished metal, which
//! paths find by chance or not at all.
//!
//! Photons fly from lamps through *casters* ([`crate::compile::casters`]) and land on the first
//! other surface; in media that scatter light, they leave points on the way there. Paths gather
//! them wherever they are scattered. In exchange, a path that goes on from there through casters
//! alone to a lamp that sends photons does not count its light: each light path is found in exactly
//! one way. The gathering is progressive
//! photon mapping with a pass of its own for each block of samples (Knaus and Zwicker, Progressive
//! photon mapping: a probabilistic approach, 2011; Jensen, Global illumination using photon maps,
//! 1996).
//!
//! The map of a pass is a function of scene, settings and the number of the pass alone. Threads
//! shoot its photons together; whoever renders a part of a block needs the whole map of the block.

mod lamps;
mod map;
mod media;
mod shoot;

pub use lamps::Lamps;
pub use map::PhotonMap;

use super::tracer::Tracer;
use super::{facts, lock};
use crate::compile::CompiledScene;
use crate::integrator::IntegratorKind;
use crate::light_sampler::LightSampler;
use crate::sampler::{Sampler, SamplerKind};
use crate::settings::{CausticsMode, Settings};
use map::{Kept, Landed};
use shoot::{Shooter, Shot};
use snell_math::{ColorModel, Vec3, real, rng};
use snell_scene::{Camera, CameraSample};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The number of photons of a pass that are shot for each pixel of the picture unless the user says
/// how many, and the limits of all.
const OF_PIXEL: u64 = 2;
const PHOTONS: [u64; 2] = [1 << 17, 1 << 22];
/// Photons that are shot at a time by one thread.
const BATCH: u32 = 1 << 12;
/// Photons of the first look at a scene.
const SCOUTS: u32 = 1 << 14;
/// The number of the pass that these are.
const FIRST_LOOK: u32 = u32::MAX;
/// Photons within the first radius, where there are as many as at most landed photons.
const NEIGHBORS: f32 = 12.0;
/// Neighbours by which the density of the scouts is measured, and the number of scouts for which
/// this is done.
const MEASURED: usize = 8;
const PROBES: usize = 256;
/// How fast the radius falls: the `alpha` of Knaus and Zwicker. In media, where noise grows with
/// the third power of its inverse, it falls more slowly.
const ALPHA: f64 = 2.0 / 3.0;
const ALPHA_IN_MEDIA: f64 = 4.0 / 7.0;
/// The least first radius, in pixels.
const LEAST_PIXELS: f32 = 0.7;
/// The largest first radius, in radii of the scene.
const LARGEST: f32 = 0.05;
/// The least share of scouts that land or that media scatter, and the least share of the power of
/// all lamps that they carry, for which [`CausticsMode::Auto`] takes photons.
const LEAST_LANDED: f32 = 0.002;
const LEAST_POWER: f64 = 2e-4;
/// The width of the window of wavelengths, as a share of the way from one wavelength of a path to
/// the next on either side, if casters disperse light; otherwise they have all photons.
const WINDOW: f32 = 0.25;
/// The half-width of the window of times.
const MOMENT: f32 = 0.1;
/// The number of maps that are kept.
const KEPT_MAPS: usize = 3;
/// Numbers that are combined with the seed.
const SEED: u32 = 0x6361_7573;

/// The photons of a render.
pub struct Caustics<'a> {
    pub scene: &'a CompiledScene,
    settings: &'a Settings,
    light_sampler: Arc<LightSampler>,
    stock: Arc<Stock>,
}

/// What does not borrow from the render. It is kept with the scene, so that a render in many steps,
/// each a job of its own, does not shoot its photons anew at each.
struct Stock {
    lamps: Lamps,
    /// The radii of the first pass, on surfaces and in media.
    first_radii: [f32; 2],
    /// Photons of a pass.
    count: u32,
    kept: Kept,
    maps: Mutex<Vec<Arc<Pass>>>,
    tally: Mutex<PhotonCounts>,
}

/// Figures of the photons of a render. They grow while it runs, and count what this process does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhotonCounts {
    /// Photons that are shot in a pass.
    pub of_pass: u32,
    /// The number of passes whose photons were shot.
    pub passes: u32,
    /// The number of photons that have landed, in all passes.
    pub landed: u64,
    /// The number of points that photons have left in media, in all passes.
    pub in_media: u64,
    /// The largest memory of the maps of a pass in bytes.
    pub map_bytes: u64,
    /// The radius of the first pass, in scene units.
    pub first_radius: f32,
    /// The same of points in media.
    pub first_radius_in_media: f32,
    /// The time that threads took to shoot photons, and to make maps of them.
    pub time: Duration,
}

/// The photons of a pass, while threads shoot them and afterwards.
struct Pass {
    number: u32,
    next: AtomicUsize,
    left: AtomicUsize,
    batches: Vec<Mutex<Shot>>,
    maps: Mutex<Option<Arc<PhotonMaps>>>,
    is_ready: Condvar,
}

/// The maps of a pass.
#[derive(Debug)]
pub struct PhotonMaps {
    /// The photons that have landed on surfaces.
    pub on_surfaces: PhotonMap,
    /// The points that photons have left in media.
    pub in_media: PhotonMap,
}

/// How wide the windows are through which photons are gathered in a pass.
#[derive(Clone, Copy, Debug)]
pub struct Windows {
    /// The half-width of that of wavelengths, of which all have 1/8.
    pub hue: f32,
    /// The half-width of that of times.
    pub time: f32,
}

impl<'a> Caustics<'a> {
    /// The photons of a render; `None` if it is to have none, or if the scene gives no reason to
    /// have any.
    pub fn new(
        scene: &'a CompiledScene,
        camera: &Camera,
        settings: &'a Settings,
        light_sampler: &Arc<LightSampler>,
    ) -> Option<Self> {
        let mode = settings.caustics;
        if mode == CausticsMode::Off || settings.integrator != IntegratorKind::Path {
            return None;
        }
        if !scene.casters().exist() || settings.max_depth < 2 {
            return None;
        }
        let of = |stock| Self { scene, settings, light_sampler: light_sampler.clone(), stock };
        let key = format!("{:?}, {camera:?}", facts(settings));
        let mut shelf = lock(&scene.kept);
        if let Some((known, stock)) = &*shelf
            && *known == key
            && let Ok(stock) = stock.clone().downcast::<Option<Arc<Stock>>>()
        {
            return (*stock).clone().map(of);
        }
        let stock = Self::stock(scene, camera, settings, light_sampler);
        *shelf = Some((key, Arc::new(stock.clone())));
        stock.map(of)
    }

    /// Lamps, radius and counts of a render, without maps; `None` if no photons are worth it.
    fn stock(
        scene: &'a CompiledScene,
        camera: &Camera,
        settings: &'a Settings,
        light_sampler: &Arc<LightSampler>,
    ) -> Option<Arc<Stock>> {
        let (mode, light_sampler) = (settings.caustics, light_sampler.clone());
        let lamps = Lamps::new(scene, &scene.casters().targets, mode);
        if !lamps.exist() {
            return None;
        }
        let pixels = settings.size.iter().map(|&side| u64::from(side)).product::<u64>();
        let usual = (OF_PIXEL * pixels).clamp(PHOTONS[0], PHOTONS[1]) as u32;
        let count = settings.photons.unwrap_or(usual).max(1);
        let kept = Kept {
            hues: settings.color == ColorModel::Spectral,
            times: scene.moves,
            sources: !settings.aovs.is_empty(),
            media: false,
        };
        let (maps, tally, first_radii) = (Mutex::default(), Mutex::default(), [0.0; 2]);
        let stock = Arc::new(Stock { lamps, first_radii, count, kept, maps, tally });
        let looking = Self { scene, settings, light_sampler, stock };
        let scouts = looking.scouts();
        if mode == CausticsMode::Auto && !looking.is_worth_it(&scouts) {
            return None;
        }
        let first_radii = [
            looking.radius_for(&scouts.landed, camera, 2),
            looking.radius_for(&scouts.in_media, camera, 3),
        ];
        let mut stock = Arc::into_inner(looking.stock)?;
        stock.first_radii = first_radii;
        let [first_radius, in_media] = first_radii;
        *lock(&stock.tally) = PhotonCounts {
            of_pass: count,
            first_radius,
            first_radius_in_media: if scouts.in_media.is_empty() { 0.0 } else { in_media },
            ..PhotonCounts::default()
        };
        Some(Arc::new(stock))
    }

    /// The lamps that send photons.
    pub fn lamps(&self) -> &Lamps {
        &self.stock.lamps
    }

    /// A few photons, for a first look.
    fn scouts(&self) -> Shot {
        let (mut shot, sampler) = (Shot::default(), self.sampler(FIRST_LOOK, SCOUTS));
        let mut tracer = Tracer::new(self.scene, None, None);
        let mut shooter = Shooter::new(self, 0.0);
        for first in (0..SCOUTS).step_by(BATCH as usize) {
            shooter.shoot(&sampler, first..first + BATCH, SCOUTS, &mut tracer, &mut shot);
        }
        shot
    }

    /// True if enough of the light lands, or is scattered by media.
    fn is_worth_it(&self, Shot { landed, scattered, .. }: &Shot) -> bool {
        let power: f64 = (0..self.scene.lights().len()).map(|i| self.scene.light_power(i)).sum();
        let on_surfaces: f64 = landed.iter().map(|photon| f64::from(photon.flux.average())).sum();
        let count = landed.len() as u32 + scattered.0;
        count as f32 > LEAST_LANDED * SCOUTS as f32
            && on_surfaces + scattered.1 > LEAST_POWER * power
    }

    /// The radius of the first pass, from the density of what scouts have left: the median of the
    /// distances to some neighbours in a space of two or three dimensions. It is not much less than
    /// a pixel is wide there.
    fn radius_for(&self, scouts: &[Landed], camera: &Camera, dimensions: u8) -> f32 {
        let most = LARGEST * self.scene.radius;
        let step = (scouts.len() / PROBES).max(1);
        let probes = scouts.iter().step_by(step);
        let mut distances: Vec<f32> = probes
            .filter_map(|probe| {
                let distance = |other: &Landed| other.position.distance_squared(probe.position);
                let mut all: Vec<f32> = scouts.iter().map(distance).collect();
                (all.len() > MEASURED)
                    .then(|| all.select_nth_unstable_by(MEASURED, f32::total_cmp).1.sqrt())
            })
            .collect();
        if distances.is_empty() {
            return 0.01 * self.scene.radius;
        }
        let middle = distances.len() / 2;
        let median = *distances.select_nth_unstable_by(middle, f32::total_cmp).1;
        let share = NEIGHBORS / MEASURED as f32 * SCOUTS as f32 / self.stock.count as f32;
        let wide = median * if dimensions == 2 { share.sqrt() } else { real::cbrt(share) };
        let least = LEAST_PIXELS * self.pixel_width(scouts, camera);
        wide.max(least).min(most).max(1e-6 * self.scene.radius)
    }

    /// The median width of a pixel where photons have landed.
    fn pixel_width(&self, scouts: &[Landed], camera: &Camera) -> f32 {
        let middle = self.settings.size.map(|side| f64::from(side) * 0.5);
        let sample = CameraSample { film: middle.into(), lens: snell_math::Vec2::splat(0.5) };
        let ray = camera.ray(&sample, self.settings.size);
        let eye: Vec3 = camera.eye.as_vec3();
        let mut widths: Vec<f32> = scouts
            .iter()
            .map(|photon| ray.width + ray.spread * photon.position.distance(eye))
            .filter(|width| width.is_finite())
            .collect();
        if widths.is_empty() {
            return 0.0;
        }
        let middle = widths.len() / 2;
        *widths.select_nth_unstable_by(middle, f32::total_cmp).1
    }

    fn sampler(&self, pass: u32, count: u32) -> Sampler {
        let seed = rng::hash_combine(rng::hash_combine(self.settings.seed, SEED), pass);
        Sampler::new(SamplerKind::Sobol, seed, count)
    }

    /// The radii of a pass, on surfaces and in media.
    fn radii(&self, pass: u32) -> [f32; 2] {
        // The product of `(i + alpha) / (i + 1)` for `i` from 1 is about a power.
        let shrunk = |exponent| real::powf(f64::from(pass) + 1.0, exponent) as f32;
        let [on_surfaces, in_media] = self.stock.first_radii;
        let exponents = [(ALPHA - 1.0) / 2.0, (ALPHA_IN_MEDIA - 1.0) / 3.0];
        [on_surfaces * shrunk(exponents[0]), in_media * shrunk(exponents[1])]
    }

    /// The windows of a pass.
    pub fn windows(&self, pass: u32) -> Windows {
        let shrunk = real::powf(f64::from(pass) + 1.0, (ALPHA - 1.0) * 0.5) as f32;
        let hue = if self.scene.casters().disperses { WINDOW } else { 1.0 };
        Windows { hue: 0.125 * hue * shrunk, time: MOMENT * shrunk }
    }

    /// Figures of the photons so far.
    pub fn counts(&self) -> PhotonCounts {
        *lock(&self.stock.tally)
    }

    /// The maps of a pass, which are made first if need be, together with other threads that ask
    /// for them. `None` if the render is cancelled.
    pub fn maps(&self, pass: u32, tracer: &mut Tracer) -> Option<Arc<PhotonMaps>> {
        let slot = self.slot(pass);
        if let Some(maps) = &*lock(&slot.maps) {
            return Some(maps.clone());
        }
        let begin = Instant::now();
        let [_, reach] = self.radii(pass);
        let sampler = self.sampler(pass, self.stock.count);
        let mut shooter = Shooter::new(self, reach);
        loop {
            let batch = slot.next.fetch_add(1, Ordering::Relaxed);
            let Some(shot) = slot.batches.get(batch) else { break };
            let first = batch as u32 * BATCH;
            let end = first.saturating_add(BATCH).min(self.stock.count);
            shooter.shoot(&sampler, first..end, self.stock.count, tracer, &mut lock(shot));
            if slot.left.fetch_sub(1, Ordering::AcqRel) == 1 {
                self.finish(&slot);
            }
        }
        lock(&self.stock.tally).time += begin.elapsed();
        let mut maps = lock(&slot.maps);
        loop {
            if tracer.is_cancelled() {
                // What was shot may be incomplete.
                lock(&self.stock.maps).retain(|kept| kept.number != pass);
                return None;
            }
            if let Some(maps) = &*maps {
                return Some(maps.clone());
            }
            let pause = Duration::from_millis(50);
            let waited = slot.is_ready.wait_timeout(maps, pause);
            maps = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// The place of a pass. The oldest is given up for a new one.
    fn slot(&self, number: u32) -> Arc<Pass> {
        let mut maps = lock(&self.stock.maps);
        if let Some(known) = maps.iter().find(|pass| pass.number == number) {
            return known.clone();
        }
        let batches = self.stock.count.div_ceil(BATCH) as usize;
        let pass = Arc::new(Pass {
            number,
            next: AtomicUsize::new(0),
            left: AtomicUsize::new(batches),
            batches: (0..batches).map(|_| Mutex::default()).collect(),
            maps: Mutex::default(),
            is_ready: Condvar::new(),
        });
        if maps.len() >= KEPT_MAPS {
            maps.remove(0);
        }
        maps.push(pass.clone());
        pass
    }

    /// Makes the maps of a pass whose photons have all been shot.
    fn finish(&self, pass: &Pass) {
        let (mut landed, mut points) = (Vec::new(), Vec::new());
        for batch in &pass.batches {
            let shot = std::mem::take(&mut *lock(batch));
            landed.extend(shot.landed);
            points.extend(shot.in_media);
        }
        let ([radius, radius_in_media], kept) = (self.radii(pass.number), self.stock.kept);
        let on_surfaces = PhotonMap::new(&landed, radius, kept);
        let in_media = PhotonMap::new(&points, radius_in_media, Kept { media: true, ..kept });
        let mut tally = lock(&self.stock.tally);
        tally.passes += 1;
        tally.landed += on_surfaces.len() as u64;
        tally.in_media += in_media.len() as u64;
        let bytes = on_surfaces.memory_bytes() + in_media.memory_bytes();
        tally.map_bytes = tally.map_bytes.max(bytes as u64);
        drop(tally);
        *lock(&pass.maps) = Some(Arc::new(PhotonMaps { on_surfaces, in_media }));
        pass.is_ready.notify_all();
    }
}
