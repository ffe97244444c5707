//! The training passes of the guiding field, before the picture is rendered.

use super::light_parts::LightParts;
use super::part::{Gathering, PartRenderer};
use super::tracer::Tracer;
use super::{Job, Progress, Statistics, Training, lock};
use crate::film::{Film, TILE};
use crate::guiding::directional::Moment;
use crate::guiding::{Field, Guiding, Record};
use crate::integrator::{Context, IntegratorKind};
use crate::sampler::Sampler;
use crate::settings::{Crop, Settings};
use crate::threads::on_threads;
use snell_math::rng;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The number of paths whose records are kept before the field reads them. It bounds the memory of
/// training.
const PATHS_OF_BATCH: u64 = 1 << 17;

/// The largest number of samples of a part.
const MAX_RANGE: u32 = 16;

/// A number that is combined with the seed for training, so that its random numbers are independent
/// of the picture's.
const SEED: u32 = 0x7261_696e;

/// A number that is combined with the seed for photons.
const PHOTONS: u32 = 0x7068_6f74;

/// The tiles and ranges of samples of a pass.
struct Pass {
    parts: Vec<(Crop, [u32; 2])>,
    samples: u32,
}

impl Pass {
    /// The parts of pass number `pass`: tiles from all over the picture if one sample in each pixel
    /// would be too many, otherwise all tiles.
    fn new(tiles: &[Crop], pass: u32, seed: u32) -> Self {
        let pixels: u64 = tiles.iter().map(super::pixels).sum();
        let paths = Guiding::FIRST_PASS << pass;
        let mut order: Vec<usize> = (0..tiles.len()).collect();
        order.sort_by_key(|&t| rng::hash_combine(seed, t as u32));
        if paths < pixels {
            let count = (tiles.len() as u64 * paths).div_ceil(pixels) as usize;
            let parts = order[..count].iter().map(|&t| (tiles[t], [0, 1])).collect();
            return Self { parts, samples: 1 };
        }
        let samples = (paths / pixels.max(1)).min(u64::from(u32::MAX)) as u32;
        let starts = (0..samples).step_by(MAX_RANGE as usize);
        let ranges = starts.map(|start| [start, (start + MAX_RANGE).min(samples)]);
        let parts =
            ranges.flat_map(|range| order.iter().map(move |&t| (tiles[t], range))).collect();
        Self { parts, samples }
    }
}

impl Job<'_> {
    /// Trains a guiding field; `None` if the settings request no guiding. A pass that `keep_going`
    /// interrupts is discarded. The number of complete passes is written to `statistics`.
    pub(super) fn train(
        &self,
        passes: Option<u32>,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
        statistics: &mut Statistics,
    ) -> Option<Field> {
        let guiding =
            self.settings.guiding.filter(|_| self.settings.integrator == IntegratorKind::Path)?;
        // Training covers the whole picture even if only a crop is rendered, because separately
        // rendered crops must fit together.
        let tiles: Vec<Crop> =
            Film::new(Crop::full(self.settings.size), &[]).tiles.iter().map(|t| t.area).collect();
        let mut field = Field::new(self.scene.center, self.scene.radius);
        if guiding.photons > 0 {
            self.learn_from_photons(
                &mut field,
                guiding.photons,
                rng::hash_combine(self.settings.seed, PHOTONS),
                threads,
            );
        }
        let passes = passes.unwrap_or(Guiding::MAX_PASSES).min(guiding.passes);
        for pass in 0..passes.min(Guiding::MAX_PASSES) {
            let seed = rng::hash_combine(rng::hash_combine(self.settings.seed, SEED), pass);
            let plan = Pass::new(&tiles, pass, seed);
            if !self.train_pass(&mut field, pass, seed, &plan, threads, keep_going, statistics) {
                field.forget_pass();
                break;
            }
            field.learn(Moment::Second, Guiding::most_records(pass), threads);
            statistics.training_passes += 1;
        }
        field.finish();
        statistics.guiding_regions = field.known_regions() as u64;
        statistics.guiding_bytes = field.memory_bytes() as u64;
        Some(field)
    }

    /// Runs one pass. Returns false if it was interrupted.
    fn train_pass(
        &self,
        field: &mut Field,
        pass: u32,
        seed: u32,
        plan: &Pass,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
        statistics: &mut Statistics,
    ) -> bool {
        let settings = Settings { aovs: Vec::new(), crop: None, ..self.settings.clone() };
        let sampler = Sampler::of(&Settings { seed, spp: plan.samples, ..settings.clone() });
        let light_parts = LightParts::new(self.scene, &settings);
        let stopped = AtomicBool::new(false);
        let paths_of_part = u64::from(TILE * TILE * plan.samples.min(MAX_RANGE));
        let parts_of_batch = (PATHS_OF_BATCH / paths_of_part) as usize;
        for (batch, parts) in plan.parts.chunks(parts_of_batch).enumerate() {
            let records: Vec<Mutex<Vec<Record>>> = parts.iter().map(|_| Mutex::default()).collect();
            let (next, all) = (AtomicUsize::new(0), Mutex::new(Statistics::default()));
            let work = || {
                let context = Context {
                    scene: self.scene,
                    settings: &settings,
                    lights: &self.lights,
                    field: Some(field),
                    wants_lobes: false,
                };
                let tracer = Tracer::new(self.scene, None, self.cancel);
                let mut renderer = PartRenderer::new(
                    context,
                    self.camera,
                    &sampler,
                    self.filter,
                    &light_parts,
                    tracer,
                )
                .with_caustics(self.caustics().map(Gathering::of_training));
                let mut mine = Statistics::default();
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&(area, range)) = parts.get(index) else { break };
                    let begun = batch * parts_of_batch + index;
                    let training = Some(Training { pass, begun, parts: plan.parts.len() });
                    let progress = Progress { training, ..Progress::default() };
                    if stopped.load(Ordering::Relaxed) || !keep_going(&progress) {
                        stopped.store(true, Ordering::Relaxed);
                        break;
                    }
                    renderer.record(area, range, &mut lock(&records[index]), &mut mine);
                }
                let mut all = lock(&all);
                all.rays += mine.rays;
                all.tracing += renderer.tracer.spent;
            };
            on_threads(threads, work);
            let all = super::into_inner(all);
            statistics.rays += all.rays;
            statistics.tracing += all.tracing;
            if stopped.load(Ordering::Relaxed) {
                return false;
            }
            let records: Vec<Record> = records.into_iter().flat_map(super::into_inner).collect();
            field.add(&records, rng::hash_combine(seed, batch as u32), threads);
        }
        true
    }
}
