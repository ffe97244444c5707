//! The main loop of rendering. Camera rays, hits, shading by material, light rays and next rays
//! follow each other, depth by depth, until no path is left. All queries are batches.

mod caustics;
mod collect;
mod collect_shaded;
mod first_hits;
mod start;

use super::Statistics;
use super::journal::{Event, Journal};
use super::light_parts::LightParts;
use super::tracer::Tracer;
use super::volumes::VolumeBatch;
use crate::batch::first_surfaces::FirstSurfaces;
use crate::batch::materials::matte_surfaces::MatteSurfaces;
use crate::batch::order::Order;
use crate::batch::paths::{LightRays, Paths};
use crate::batch::{self, Batch, BatchShader};
use crate::compile::CameraFilter;
use crate::film::filter::FilterSampler;
use crate::film::noise::positions;
use crate::film::{FilmPart, FilmSample};
use crate::guiding::{Record, Recorder};
use crate::integrator::light_part::{LightSource, LightTag, Scatterings};
use crate::integrator::{Context, IntegratorKind, Outputs, Vertex, VertexFunction};
use crate::lanes::LANES;
use crate::sampler::{SampleKey, Sampler};
use crate::settings::Crop;
use snell_intersect::{Grouping, SurfacePoint};
use snell_math::{ColorMode, ColorModel, SampledSpectrum};
use snell_scene::{Camera, CameraRays, CameraView};
use std::mem::take;

pub use caustics::Gathering;

/// The number of samples that are taken at once. Measured from 256 to 4,096: fewer leave the
/// kernels idle, and more exceed the caches.
const MAX_SAMPLES: usize = 1 << 11;

/// The number of light rays that are traced at once, because ray trees and scenes with many lights
/// have too many to store. The light rays of one vertex may exceed it.
const MAX_BATCH: usize = 1 << 16;

/// The largest number of rays of one sample's ray tree, since trees in clear glass grow
/// exponentially. Trees of depth 9 stay below it.
const MAX_TREE: u32 = 1024;

/// Renders parts, and reuses its buffers from part to part.
pub struct PartRenderer<'a> {
    context: Context<'a>,
    camera: &'a Camera,
    view: CameraView<'a>,
    camera_rays: CameraRays<LANES>,
    /// True if the camera does not move.
    stands_still: bool,
    sampler: &'a Sampler,
    filter: &'a FilterSampler,
    shade: VertexFunction,
    /// Makes all ray queries, except those that count traversal steps.
    pub tracer: Tracer<'a>,
    paths: Paths,
    next: Paths,
    light_rays: LightRays,
    /// The order in which paths are shaded.
    order: Order<'a>,
    /// The batch shaders, which are asked before the vertex function.
    shaders: Vec<Box<dyn BatchShader<'a> + 'a>>,
    outputs: Outputs,
    /// The lanes that a shader has shaded.
    lanes: Vec<u32>,
    /// The lanes of a subset, such as those with a light ray.
    kept: Vec<u32>,
    samples: Vec<Sample>,
    facts: Vec<SampleFacts>,
    /// The keys of the samples' random numbers.
    keys: Vec<SampleKey>,
    aovs: Vec<f32>,
    /// Records what paths find, for training the guiding field.
    recorder: Option<Recorder>,
    /// Records every event, for explanations.
    pub journal: Option<Journal>,
    /// The coverage keys of each sample.
    covering: Vec<u64>,
    /// The surfaces that AOVs need, if they need any.
    first_surfaces: Option<Box<FirstSurfaces<'a>>>,
    light_parts: &'a LightParts,
    /// The state of media, if the scene has any and the integrator supports them.
    volumes: Option<VolumeBatch<'a>>,
    /// The photons, if caustics are found by photons.
    pub caustics: Option<Gathering<'a>>,
}

/// The light that a sample has collected.
#[derive(Clone, Copy)]
struct Sample {
    /// Radiance found at vertices.
    radiance: SampledSpectrum,
    /// Contributions of light rays. They are summed separately, because the order in which light
    /// rays and vertices contribute depends on how a batch is divided, and the bits of a sample
    /// must not depend on its neighbours.
    brought: SampledSpectrum,
}

/// Further data of a sample.
#[derive(Clone, Copy)]
struct SampleFacts {
    /// What the lanes of the sample's spectra stand for.
    mode: ColorMode,
    alpha: f32,
    weight: f32,
    /// The number of next rays so far, to limit ray trees.
    rays: u32,
}

impl Sample {
    /// All radiance that was collected so far.
    fn collected(&self) -> SampledSpectrum {
        self.radiance + self.brought
    }
}

impl<'a> PartRenderer<'a> {
    pub fn new(
        context: Context<'a>,
        camera: &'a Camera,
        sampler: &'a Sampler,
        filter: &'a FilterSampler,
        light_parts: &'a LightParts,
        tracer: Tracer<'a>,
    ) -> Self {
        let (scene, eye) = (context.scene, camera.eye.as_vec3());
        let volumes = match context.settings.integrator.is_path() {
            true => VolumeBatch::new(&context, sampler, eye),
            false => None,
        };
        let shade = context.settings.integrator.vertex_function();
        let matte = MatteSurfaces::new(&context);
        let shaders = batch::shaders(&context, sampler, matte.as_ref());
        let first_surfaces = FirstSurfaces::for_aovs(&context).map(Box::new);
        let view = camera.view(context.settings.size);
        let settings = context.settings;
        let stands_still = settings.later_cameras.is_empty();
        let is_plain = settings.color == ColorModel::Rgb
            && stands_still
            && !scene.moves
            && !context.wants_lobes;
        Self {
            context,
            camera,
            view,
            camera_rays: CameraRays::default(),
            stands_still,
            sampler,
            filter,
            shade,
            tracer,
            paths: Paths::new(is_plain),
            next: Paths::new(is_plain),
            light_rays: LightRays::default(),
            order: Order::new(matte),
            shaders,
            outputs: Outputs::default(),
            lanes: Vec::new(),
            kept: Vec::new(),
            samples: Vec::new(),
            facts: Vec::new(),
            keys: Vec::new(),
            aovs: Vec::new(),
            recorder: None,
            journal: None,
            covering: Vec::new(),
            first_surfaces,
            light_parts,
            volumes,
            caustics: None,
        }
    }

    /// The same renderer with photons.
    pub fn with_caustics(self, caustics: Option<Gathering<'a>>) -> Self {
        Self { caustics, ..self }
    }

    /// Takes the samples `range` of every pixel of `area`, and adds the training records of their
    /// paths to `records`.
    pub fn record(
        &mut self,
        area: Crop,
        range: [u32; 2],
        records: &mut Vec<Record>,
        statistics: &mut Statistics,
    ) {
        self.recorder = Some(self.recorder.take().unwrap_or_default());
        self.render(area, None, range, statistics);
        if let Some(recorder) = &mut self.recorder {
            let samples = &self.samples;
            recorder.finish(|sample| samples[sample as usize].collected(), records);
        }
    }

    /// Takes the samples `range` of the pixels of `area`: of all pixels, or of those with the given
    /// row-major indices. The part is invalid if the render was [cancelled](Tracer::is_cancelled)
    /// meanwhile.
    pub fn render(
        &mut self,
        area: Crop,
        pixels: Option<&[u32]>,
        range: [u32; 2],
        statistics: &mut Statistics,
    ) -> FilmPart {
        let positions: Vec<[u32; 2]> = match pixels {
            None => positions(&area).collect(),
            Some(pixels) => {
                let width = area.size()[0];
                pixels.iter().map(|i| [area.min[0] + i % width, area.min[1] + i / width]).collect()
            }
        };
        let mut part = FilmPart {
            area,
            samples: range,
            pixels: pixels.map(<[u32]>::to_vec),
            values: vec![],
            aovs: vec![],
            keys: vec![],
        };
        self.take_map(range[0]);
        // A journal or a recorder covers the whole part at once.
        let at_once = match self.recorder.is_some() || self.journal.is_some() {
            true => positions.len(),
            false => MAX_SAMPLES / (range[1] - range[0]).max(1) as usize,
        };
        for positions in positions.chunks(at_once.max(1)) {
            if self.tracer.is_cancelled() {
                break;
            }
            self.take_samples(positions, range, statistics);
            self.finish(&mut part, statistics);
        }
        part
    }

    /// Takes the samples `range` of the pixels at these positions.
    fn take_samples(
        &mut self,
        positions: &[[u32; 2]],
        range: [u32; 2],
        statistics: &mut Statistics,
    ) {
        self.start(positions, range);
        statistics.rays.camera += self.paths.len() as u64;
        // Rays are coherent if sixteen consecutive ones belong to one pixel, or to one row of a
        // tile.
        let mut grouping = if self.camera.has_common_origin()
            && self.stands_still
            && matches!(range[1] - range[0], 1 | 16)
        {
            Grouping::Coherent
        } else {
            Grouping::None
        };
        let mut depth = 0;
        while self.paths.len() > 0 && !self.tracer.is_cancelled() {
            self.note_arrivals();
            self.journal.iter_mut().for_each(|journal| journal.events.push(Event::Depth));
            let needs_first_hits = depth == 0 && self.needs_first_hits();
            if needs_first_hits || !self.volumes.as_ref().is_some_and(VolumeBatch::sees_more) {
                let filter = self.tracer.filter();
                self.tracer.closest_by(
                    CameraFilter::new(self.context.scene, filter).at(depth),
                    &self.paths.rays,
                    &self.paths.times,
                    grouping,
                    &mut self.paths.hits,
                );
            }
            if depth == 0 {
                self.drop_dead_paths();
            }
            if needs_first_hits {
                self.note_first_hits();
            }
            self.travel(depth, grouping);
            if depth == self.context.settings.max_depth {
                statistics.cut_paths += self.unfinished();
            }
            self.next.clear();
            self.gather(depth);
            self.shade_batch(depth, statistics);
            std::mem::swap(&mut self.paths, &mut self.next);
            self.volumes.iter_mut().for_each(VolumeBatch::swap);
            statistics.rays.indirect += self.paths.len() as u64;
            depth += 1;
            grouping = Grouping::None;
        }
    }

    /// The number of paths that have met a surface or have been scattered by a medium, for the
    /// integrator `path`; 0 for the others, which are short by design.
    fn unfinished(&self) -> u64 {
        if self.context.settings.integrator != IntegratorKind::Path {
            return 0;
        }
        let scattered = self.volumes.as_ref().map_or(&[][..], |volumes| &volumes.scattered[..]);
        let is_scattered = |path: usize| scattered.get(path).is_some_and(Option::is_some);
        let hits = self.paths.hits.iter().enumerate();
        hits.filter(|&(path, hit)| hit.is_hit() || is_scattered(path)).count() as u64
    }

    /// Passes the light that each path has collected so far to the recorder, if there is one.
    fn note_arrivals(&mut self) {
        let Some(recorder) = &mut self.recorder else { return };
        for &sample in &self.paths.samples {
            recorder.arrive(sample, self.samples[sample as usize].collected());
        }
    }

    /// Moves paths through media, if the scene has any, to their next vertices.
    fn travel(&mut self, depth: u32, grouping: Grouping) {
        let Some(volumes) = &mut self.volumes else { return };
        if depth == 0 {
            volumes.start(&mut self.paths);
        }
        let (samples, facts) = (&mut self.samples, &mut self.facts);
        let (keys, sampler) = (&self.keys, self.sampler);
        let random = |paths: &Paths, path: usize| {
            let key = keys[paths.samples[path] as usize];
            sampler.numbers_of(key).at_vertex(paths.carried[path].stream, depth)
        };
        let (light_parts, aovs, journal) = (self.light_parts, &mut self.aovs, &mut self.journal);
        volumes.advance(
            &mut self.tracer,
            &mut self.paths,
            grouping,
            depth,
            random,
            |paths, path, radiance| {
                let sample = paths.samples[path];
                samples[sample as usize].radiance += radiance;
                if let Some(journal) = journal {
                    journal.events.push(Event::Glow { path, sample, radiance });
                }
                if !light_parts.is_empty() {
                    let (scatterings, group) =
                        (Scatterings::of(depth), light_parts.group(LightSource::Medium));
                    let tag = LightTag { lobe: paths.rest(path).lobe, scatterings, group };
                    light_parts.add(aovs, sample, radiance, &tag, facts[sample as usize].mode);
                }
            },
        );
        if depth == 0 {
            for (path, _) in volumes.scattered.iter().enumerate().filter(|(_, s)| s.is_some()) {
                facts[self.paths.samples[path] as usize].alpha = 1.0;
            }
        }
    }

    /// Shades the current vertices, each by the first shader that accepts its path or by the vertex
    /// function, and adds the contributions of their light rays.
    fn shade_batch(&mut self, depth: u32, statistics: &mut Statistics) {
        if self.context.settings.integrator == IntegratorKind::Aov {
            return;
        }
        self.sort();
        let (order, mut shaders) = (take(&mut self.order.paths), take(&mut self.shaders));
        let mut rest = &order[..];
        while let Some(&first) = rest.first() {
            let matte_next = (self.order.matte_count + rest.len()).saturating_sub(order.len());
            let batch = Batch { matte_next, ..self.batch(depth) };
            let accepting = shaders.iter_mut().find_map(|shader| {
                let count = shader.accepts(&batch, rest);
                (count > 0).then_some((shader, count))
            });
            let (now, later) = rest.split_at(accepting.as_ref().map_or(1, |&(_, count)| count));
            match accepting {
                Some((shader, _)) => {
                    shader.shade(&batch, now);
                    self.collect_shaded(depth, &**shader);
                }
                None => self.shade_one(depth, first as usize),
            }
            rest = later;
            if self.light_rays.rays.len() >= MAX_BATCH {
                self.trace_light_rays(statistics);
            }
        }
        (self.order.paths, self.shaders) = (order, shaders);
        self.trace_light_rays(statistics);
    }

    /// Sorts paths by material, so that batch shaders get full batches.
    fn sort(&mut self) {
        let (scene, hits) = (self.context.scene, &self.paths.hits[..self.paths.len()]);
        match self.context.settings.integrator.is_path() && !self.is_watched() {
            true => {
                let media = self.volumes.as_ref().map(VolumeBatch::surroundings);
                self.order.matte_first(scene, hits, media.as_ref());
            }
            false => self.order.by_material(scene, hits),
        }
    }

    /// The current vertices as the input of batch shaders.
    fn batch(&self, depth: u32) -> Batch<'_, 'a> {
        Batch {
            context: &self.context,
            sampler: self.sampler,
            depth,
            paths: &self.paths,
            keys: &self.keys,
            materials: &self.order.materials,
            matte_next: 0,
            media: self.volumes.as_ref().map(VolumeBatch::surroundings),
            is_watched: self.is_watched(),
            has_journal: self.journal.is_some(),
        }
    }

    /// True if a recorder or journal needs more data of vertices than their light.
    fn is_watched(&self) -> bool {
        self.journal.is_some() || self.recorder.is_some()
    }

    /// Shades one vertex by the vertex function.
    fn shade_one(&mut self, depth: u32, path: usize) {
        let scene = self.context.scene;
        if self.paths.is_dead(path) {
            return;
        }
        let (ray, hit, state) =
            (&self.paths.rays[path], &self.paths.hits[path], self.paths.state(path));
        let interaction = hit.is_hit().then(|| self.paths.interaction(scene, path));
        let batch = self.batch(depth);
        let outside_ior = if hit.is_hit() { batch.outside_ior(path) } else { 1.0 };
        let surface = interaction
            .as_ref()
            .map(|interaction| self.paths.surface(scene, path, interaction, outside_ior));
        let random = batch.random(path);
        let medium = batch.media.and_then(|media| media.scattered[path]);
        let vertex = Vertex { depth, ray, state: &state, random, surface, medium };
        self.outputs.clear();
        (self.shade)(&self.context, &vertex, &mut self.outputs);
        if let Some(volumes) = &mut self.volumes {
            let Outputs { light_rays, glowing, next, .. } = &self.outputs;
            let next = next.iter().map(|(ray, _)| ray.direction);
            let surface = interaction.as_ref().map(|whole| (SurfacePoint::from(whole), whole));
            let surface = surface.as_ref().map(|(point, whole)| (point, || **whole));
            let of = (hit, state.mode);
            volumes.note_outputs(
                path,
                ray.direction,
                surface,
                of,
                random,
                light_rays,
                *glowing,
                next,
            );
        }
        self.collect(depth, path);
    }

    fn trace_light_rays(&mut self, statistics: &mut Statistics) {
        let rays = &mut self.light_rays;
        statistics.rays.shadow += rays.rays.len() as u64;
        match &mut self.volumes {
            Some(volumes) => {
                let facts = &self.facts;
                volumes
                    .trace_light_rays(&mut self.tracer, rays, |sample| facts[sample as usize].mode);
            }
            None => self.tracer.occluded(&rays.rays, &rays.times, &mut rays.blocked),
        }
        if let Some(journal) = &mut self.journal {
            journal.fates.extend(rays.values.iter().copied().zip(rays.blocked.iter().copied()));
        }
        for ((&sample, &value), &blocked) in
            rays.samples.iter().zip(&rays.values).zip(&rays.blocked)
        {
            if !blocked {
                self.samples[sample as usize].brought += value;
            }
        }
        let lights = rays.samples.iter().zip(&rays.values).zip(&rays.blocked);
        for (((&sample, &value), blocked), tag) in lights.zip(&rays.tags) {
            if !blocked {
                let mode = self.facts[sample as usize].mode;
                self.light_parts.add(&mut self.aovs, sample, value, tag, mode);
            }
        }
        rays.clear();
    }

    /// Adds the samples, with the light that they have collected, to a part.
    fn finish(&mut self, part: &mut FilmPart, statistics: &mut Statistics) {
        let sensor = self.context.settings.sensor;
        part.values.extend(self.samples.iter().zip(&self.facts).map(|(sample, facts)| {
            let radiance = sample.collected();
            let finite = radiance.is_finite();
            statistics.invalid_samples += u64::from(!finite);
            let radiance = if finite { radiance } else { SampledSpectrum::ZERO };
            let light = facts.mode.to_rgb(radiance);
            FilmSample {
                color: sensor.map_or(light, |sensor| sensor.response(light)),
                alpha: facts.alpha,
                weight: facts.weight,
            }
        }));
        part.aovs
            .extend(self.aovs.iter().map(|value| if value.is_finite() { *value } else { 0.0 }));
        part.keys.append(&mut self.covering);
    }
}

#[cfg(test)]
mod tests {
    use crate::integrator::aov::Aov;
    use crate::{CompiledScene, IntegratorKind, Job, Settings, reference};
    use snell_intersect::BuildOptions;
    use snell_math::ColorModel;
    use snell_scene::builtin::builtin;
    use snell_scene::{Background, Camera, Projection};

    #[test]
    fn rays_through_a_lens_are_those_of_single_paths() {
        let scene = builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        let sharp = scene.cameras[0].clone();
        let blurred = Camera { aperture_radius: 0.02 * sharp.focus_distance, ..sharp.clone() };
        for color in ColorModel::ALL {
            let settings =
                Settings { size: [40, 30], spp: 4, max_depth: 3, color, ..Settings::default() };
            let picture = |camera: &Camera| {
                Job::new(&compiled, camera, &settings).run(1, &|_| true).0.image()
            };
            let (found, other) = (picture(&blurred), picture(&sharp));
            assert_ne!(found.layers[0].values, other.layers[0].values);
            let expected = reference::ray_cast(&compiled, &blurred, &settings);
            for (found, expected) in found.layers[0].values.as_chunks::<4>().0.iter().zip(&expected)
            {
                assert!(
                    (found[1] - expected.g).abs() <= 1e-5 * expected.g.abs().max(1.0),
                    "{color:?}"
                );
            }
        }
    }

    #[test]
    fn outside_of_the_circle_of_a_fisheye_is_nothing() {
        let mut scene = builtin("teapot").expect("the scene is built in");
        scene.background = Background::Transparent;
        let mut camera = scene.cameras[0].clone();
        camera.projection = Projection::Fisheye { max_angle: 3.0 };
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        for integrator in [IntegratorKind::Flat, IntegratorKind::Ao, IntegratorKind::Path] {
            let aovs = vec![Aov::Depth, Aov::MaterialId];
            let settings =
                Settings { size: [30, 20], spp: 2, integrator, aovs, ..Settings::default() };
            let image = Job::new(&compiled, &camera, &settings).run(1, &|_| true).0.image();
            assert_eq!(image.layers[0].values[..4], [0.0; 4], "{integrator:?}");
            assert_eq!(
                (image.layers[1].values[0], image.layers[2].values[0]),
                (0.0, -1.0),
                "{integrator:?}"
            );
            let middle = 10 * 30 + 15;
            assert_eq!(image.layers[0].values[middle * 4 + 3], 1.0, "{integrator:?}");
        }
    }
}
