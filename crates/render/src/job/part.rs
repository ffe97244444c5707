//! The loop that makes a picture: camera rays, hits, shading by material, light rays, next rays,
//! depth by depth until no path is left. Batches only; nothing here asks for a single ray.

mod collect;
mod first_hits;
mod matte;
mod scattered;
mod specular;
mod start;
mod surfaces;

use super::Statistics;
use super::journal::{Event, Journal};
use super::light_parts::LightParts;
use super::paths::{LightRays, Paths};
use super::tracer::Tracer;
use super::volumes::VolumeBatch;
use crate::film::filter::FilterSampler;
use crate::film::noise::positions;
use crate::film::{FilmPart, FilmSample};
use crate::guiding::{Record, Recorder};
use crate::integrator::lanes::{Arriving, LANES};
use crate::integrator::light_part::{LightSource, LightTag, Scatterings};
use crate::integrator::path::{escaped_to, plain_sky};
use crate::integrator::scattered::ScatteredVertices;
use crate::integrator::shown::PlainShown;
use crate::integrator::sky_samples::{NO_PLACES, places_of};
use crate::integrator::surfaces::SurfaceVertices;
use crate::integrator::{Context, IntegratorKind, Outputs, Vertex, VertexFunction};
use crate::sampler::{Random, SampleKey, Sampler};
use crate::settings::Crop;
use matte::Matte;
use snell_intersect::{Grouping, Hit, SurfacePoint};
use snell_math::spectrum::RgbSpectrum;
use snell_math::{ColorMode, ColorModel, SampledSpectrum, Vec2};
use snell_scene::light::environment::EnvironmentLight;
use snell_scene::{Camera, CameraRays, CameraView};
use specular::SpecularBatch;

/// Samples that are taken at once. (Measured from 256 to 4,096: few leave the kernels idle, many
/// leave the caches.)
const MAX_SAMPLES: usize = 1 << 11;

/// Light rays that are traced at once, up to those of one vertex more: ray trees and scenes of many
/// lights have too many to keep.
const MAX_BATCH: usize = 1 << 16;

/// Most rays of one sample's ray tree: those of clear glass would grow without end. A tree of depth
/// 9 is smaller.
const MAX_TREE: u32 = 1024;

/// Renders parts, reusing its buffers.
pub struct PartRenderer<'a> {
    context: Context<'a>,
    camera: &'a Camera,
    view: CameraView<'a>,
    camera_rays: CameraRays<LANES>,
    /// The camera does not move.
    stands_still: bool,
    sampler: &'a Sampler,
    filter: &'a FilterSampler,
    shade: VertexFunction,
    /// Everything that is asked of the world, but for counting.
    pub tracer: Tracer<'a>,
    paths: Paths,
    next: Paths,
    light_rays: LightRays,
    /// Paths that are shaded many at once, in order.
    together: Vec<u32>,
    /// Those that have left the scene or were scattered by media, if that
    /// [is all there is to them](Self::is_simple).
    missed: Vec<u32>,
    /// All others, in order, and one material after the other.
    others: Vec<u32>,
    order: Vec<u32>,
    /// The material of what each path of `others` has hit, one past the last for nothing, and where
    /// those of each begin in `order`.
    materials: Vec<u32>,
    starts: Vec<u32>,
    outputs: Outputs,
    /// Lanes of [`Matte`], and some of them.
    lanes: Vec<u32>,
    kept: Vec<u32>,
    samples: Vec<Sample>,
    facts: Vec<SampleFacts>,
    /// What tells their numbers.
    keys: Vec<SampleKey>,
    aovs: Vec<f32>,
    /// Writes down what paths find, while a field learns.
    recorder: Option<Recorder>,
    /// Writes down everything, for explanations.
    pub journal: Option<Journal>,
    /// What covers each sample.
    covering: Vec<u64>,
    /// What layers show of surfaces, if they show any.
    shown: Option<Box<PlainShown<'a>>>,
    light_parts: &'a LightParts,
    /// What media need, where there are any and the integrator knows of them.
    volumes: Option<VolumeBatch<'a>>,
    /// What is shaded many at once.
    matte: Option<Box<Matte<'a>>>,
    specular: Option<Box<SpecularBatch<'a>>>,
    scattered: Option<Box<ScatteredVertices>>,
    surfaces: Option<Box<SurfaceVertices<'a>>>,
}

/// What a sample has collected.
#[derive(Clone, Copy)]
struct Sample {
    /// Found at vertices.
    radiance: SampledSpectrum,
    /// Brought by light rays. Summed apart, because how the two alternate depends on where a batch
    /// of many samples is cut into pieces, and the bits of a sample must not depend on its
    /// neighbours.
    brought: SampledSpectrum,
}

/// What else is known of a sample.
#[derive(Clone, Copy)]
struct SampleFacts {
    /// What the lanes of its spectra stand for.
    mode: ColorMode,
    alpha: f32,
    weight: f32,
    /// Rays sent on so far.
    rays: u32,
}

impl Sample {
    /// All radiance so far.
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
        let sees_media = context.settings.integrator.sees_media();
        let volumes = if sees_media { VolumeBatch::new(&context, sampler, eye) } else { None };
        let shade = context.settings.integrator.vertex_function();
        let matte = Matte::new(&context, sampler);
        let specular = SpecularBatch::new(&context, sampler);
        let scattered = ScatteredVertices::new(&context, sampler).map(Box::new);
        let surfaces = SurfaceVertices::new(&context, sampler).map(Box::new);
        let shown = PlainShown::for_layers(&context).map(Box::new);
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
            together: Vec::new(),
            missed: Vec::new(),
            others: Vec::new(),
            order: Vec::new(),
            materials: Vec::new(),
            starts: Vec::new(),
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
            shown,
            light_parts,
            volumes,
            matte,
            specular,
            scattered,
            surfaces,
        }
    }

    /// Takes samples `range` of every pixel of `area`; what a field learns from their paths is
    /// added to `records`.
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

    /// Takes samples `range` of the pixels of `area`: of all, or of those with these numbers (row
    /// by row). If it is [cancelled](Tracer::is_cancelled), the part is of no use.
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
        // What is written down is of the whole part.
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

    /// Takes samples of some pixels.
    fn take_samples(
        &mut self,
        positions: &[[u32; 2]],
        range: [u32; 2],
        statistics: &mut Statistics,
    ) {
        self.start(positions, range);
        statistics.rays.camera += self.paths.len() as u64;
        // Sixteen rays in a row are of one pixel, or of one row of a tile.
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
            let is_shown = depth == 0 && self.shows_first_hits();
            if is_shown || !self.volumes.as_ref().is_some_and(VolumeBatch::sees_more) {
                self.tracer.closest(
                    &self.paths.rays,
                    &self.paths.times,
                    grouping,
                    &mut self.paths.hits,
                );
            }
            if depth == 0 {
                self.drop_dead_paths();
            }
            if is_shown {
                self.note_first_hits();
            }
            self.travel(depth, grouping);
            self.next.clear();
            self.shade_batch(depth, statistics);
            std::mem::swap(&mut self.paths, &mut self.next);
            self.volumes.iter_mut().for_each(VolumeBatch::swap);
            statistics.rays.indirect += self.paths.len() as u64;
            depth += 1;
            grouping = Grouping::None;
        }
    }

    /// Tells the recorder, if there is one, what paths have brought before what they find next.
    fn note_arrivals(&mut self) {
        let Some(recorder) = &mut self.recorder else { return };
        for &sample in &self.paths.samples {
            recorder.arrive(sample, self.samples[sample as usize].collected());
        }
    }

    /// Through media, if there are any, to the next vertices.
    fn travel(&mut self, depth: u32, grouping: Grouping) {
        let Some(volumes) = &mut self.volumes else { return };
        if depth == 0 {
            volumes.start(&self.paths);
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

    /// Calls the vertex function on every path, grouped by material, and adds what the light rays
    /// bring.
    fn shade_batch(&mut self, depth: u32, statistics: &mut Statistics) {
        if self.context.settings.integrator == IntegratorKind::Aov {
            return;
        }
        self.group();
        let together = std::mem::take(&mut self.together);
        for paths in together.chunks(LANES) {
            self.shade_matte(depth, paths);
            if self.light_rays.rays.len() >= MAX_BATCH {
                self.trace_light_rays(statistics);
            }
        }
        self.together = together;
        let order = std::mem::take(&mut self.order);
        let mut rest = order.as_slice();
        while let Some(&first) = rest.first() {
            let count = match (self.matte_beginning(rest), self.specular_beginning(depth, rest)) {
                (0, 0) => {
                    let count = self.surfaces_beginning(depth, rest);
                    match count {
                        0 => self.shade_one(depth, first as usize),
                        _ => self.shade_surfaces(depth, &rest[..count]),
                    }
                    count
                }
                (0, count) => {
                    self.shade_specular(depth, &rest[..count]);
                    count
                }
                (count, _) => {
                    self.shade_matte(depth, &rest[..count]);
                    count
                }
            };
            rest = &rest[count.max(1)..];
            if self.light_rays.rays.len() >= MAX_BATCH {
                self.trace_light_rays(statistics);
            }
        }
        self.order = order;
        let missed = std::mem::take(&mut self.missed);
        self.shade_nothing_hit(depth, &missed, statistics);
        self.missed = missed;
        self.trace_light_rays(statistics);
    }

    /// The numbers of the vertex that a path has come to.
    fn random_at(&self, depth: u32, path: usize) -> Random {
        let key = self.keys[self.paths.samples[path] as usize];
        self.sampler.numbers_of(key).at_vertex(self.paths.carried[path].stream, depth)
    }

    /// True if somebody wants to know more of vertices than the light they bring.
    fn is_watched(&self) -> bool {
        self.journal.is_some() || self.recorder.is_some()
    }

    /// The paths as they come to vertices.
    fn arriving(&self) -> Arriving<'_> {
        let Paths { rays, hits, carried, samples, .. } = &self.paths;
        Arriving { rays, hits, carried, samples, keys: &self.keys, rest: self.paths.rests() }
    }

    /// True if light is dimmed or parts of it are layers of their own.
    fn is_told_apart(&self) -> bool {
        self.context.settings.clamp.is_some() || !self.light_parts.is_empty()
    }

    /// Which paths are shaded together, and in which order the others.
    fn group(&mut self) {
        let (count, is_simple) = (self.paths.len(), self.is_simple());
        let lists = [&mut self.together, &mut self.missed, &mut self.others];
        if !is_simple {
            lists.into_iter().for_each(Vec::clear);
            self.others.extend(0..count as u32);
            return self.group_by_material();
        }
        // Nobody sees in which order they come: each sample has one path.
        let [together, missed, others] = lists.map(|list| {
            list.resize(count, 0);
            &mut list[..count]
        });
        let mut counts = [0; 3];
        for (path, hit) in (0..).zip(&self.paths.hits[..count]) {
            let is_matte = self
                .matte
                .as_ref()
                .is_some_and(|matte| matte.surfaces.has(self.context.scene, hit));
            let is_missed = !hit.is_hit();
            // (Written to all three: what is known of hits is no good for branches.)
            (together[counts[0]], missed[counts[1]], others[counts[2]]) = (path, path, path);
            counts[0] += usize::from(is_matte);
            counts[1] += usize::from(is_missed);
            counts[2] += usize::from(!is_matte & !is_missed);
        }
        self.together.truncate(counts[0]);
        self.missed.truncate(counts[1]);
        self.others.truncate(counts[2]);
        self.group_by_material();
    }

    /// Others of one material one after the other; those of one sample stay in order, so that sums
    /// have one order.
    fn group_by_material(&mut self) {
        let (scene, others) = (self.context.scene, &self.others);
        self.order.clear();
        if others.is_empty() {
            return;
        }
        // What hits nothing comes last.
        let last = scene.materials.len();
        let key = |hit: &Hit| if hit.is_hit() { scene.material_id(hit).index() } else { last };
        self.materials.resize(self.paths.len(), 0);
        for &path in others {
            self.materials[path as usize] = key(&self.paths.hits[path as usize]) as u32;
        }
        let keys = &self.materials;
        self.order.extend(others);
        if last > others.len() {
            self.order.sort_by_key(|&path| keys[path as usize]);
            return;
        }
        // By counting: first how many there are of each, then where those of each begin.
        self.starts.clear();
        self.starts.resize(last + 2, 0);
        others.iter().for_each(|&path| self.starts[keys[path as usize] as usize + 1] += 1);
        (0..=last).for_each(|key| self.starts[key + 1] += self.starts[key]);
        for &path in others {
            let at = &mut self.starts[keys[path as usize] as usize];
            self.order[*at as usize] = path;
            *at += 1;
        }
    }

    /// True if what `path` and `direct` find outside of the scene is all that matters of it.
    fn is_simple(&self) -> bool {
        let integrator = self.context.settings.integrator;
        matches!(integrator, IntegratorKind::Path | IntegratorKind::Direct) && !self.is_watched()
    }

    /// True if vertices that are worked on many at once must tell by what light is scattered there.
    fn wants_lobes(&self, depth: u32) -> bool {
        self.context.wants_lobes && depth == 0
    }

    /// The same as [`Self::shade_one`] for paths that hit nothing: that leave the scene, or that
    /// media have scattered.
    fn shade_nothing_hit(&mut self, depth: u32, paths: &[u32], statistics: &mut Statistics) {
        let Some(volumes) = &self.volumes else { return self.shade_misses(depth, paths) };
        let is_scattered = |path: &&u32| volumes.scattered[**path as usize].is_some();
        let (scattered, leaving): (Vec<u32>, Vec<u32>) = paths.iter().partition(is_scattered);
        self.shade_misses(depth, &leaving);
        for paths in scattered.chunks(LANES) {
            self.shade_scattered(depth, paths);
            if self.light_rays.rays.len() >= MAX_BATCH {
                self.trace_light_rays(statistics);
            }
        }
    }

    /// The same as [`Self::shade_one`] for paths that leave the scene.
    fn shade_misses(&mut self, depth: u32, paths: &[u32]) {
        if self.context.scene.is_dark_outside() {
            return;
        }
        let sky = plain_sky(&self.context, depth);
        let color = sky.and_then(EnvironmentLight::constant);
        let constant = color
            .filter(|_| self.paths.is_plain())
            .map(|color| ColorMode::Rgb.rgb_illuminant(color));
        let is_spectral = self.context.settings.color == ColorModel::Spectral;
        let spectrum = color.filter(|_| is_spectral).map(RgbSpectrum::of_light);
        for paths in paths.chunks(LANES) {
            self.shade_misses_of(depth, paths, (sky, constant), spectrum.as_ref());
        }
    }

    /// The same for at most [`LANES`] paths.
    fn shade_misses_of(
        &mut self,
        depth: u32,
        paths: &[u32],
        (sky, constant): (Option<&EnvironmentLight>, Option<SampledSpectrum>),
        spectrum: Option<&RgbSpectrum>,
    ) {
        let (scene, rays) = (self.context.scene, &self.paths.rays);
        let image = scene.environment.as_ref().filter(|sky| sky.constant().is_none());
        let places = image.map_or(NO_PLACES, |sky| {
            let directions = paths.iter().map(|&path| rays[path as usize].direction);
            places_of(sky, directions, scene.world.simd().wide())
        });
        for (lane, &path) in paths.iter().enumerate() {
            let path = path as usize;
            let place = Vec2::new(places[0][lane], places[1][lane]);
            let (ray, carried, sample) = (
                &self.paths.rays[path],
                &self.paths.carried[path],
                self.paths.samples[path] as usize,
            );
            let radiance = if carried.throughput.is_black() {
                continue;
            } else if let Some(radiance) = constant {
                carried.throughput * radiance
            } else if let (Some(spectrum), ColorMode::Spectral(wavelengths)) =
                (spectrum, self.paths.rest(path).mode)
            {
                carried.throughput * ColorMode::light_at(&wavelengths, spectrum)
            } else if let Some(sky) = sky {
                carried.throughput * sky.radiance_at(place, self.paths.rest(path).mode)
            } else {
                let state = &self.paths.state(path);
                let vertex = Vertex {
                    depth,
                    ray,
                    state,
                    random: self.sampler.numbers_of(self.keys[sample]),
                    surface: None,
                    medium: None,
                };
                escaped_to(&self.context, &vertex, |_| place).0
            };
            self.take_found(path, depth, radiance);
        }
    }

    fn shade_one(&mut self, depth: u32, path: usize) {
        let scene = self.context.scene;
        if self.paths.is_dead(path) {
            return;
        }
        let (ray, hit, state) =
            (&self.paths.rays[path], &self.paths.hits[path], self.paths.state(path));
        let interaction = hit.is_hit().then(|| self.paths.interaction(scene, path));
        let outside_ior = self
            .volumes
            .as_ref()
            .filter(|_| hit.is_hit())
            .map_or(1.0, |v| v.outside_ior(path, hit));
        let surface = interaction
            .as_ref()
            .map(|interaction| self.paths.surface(scene, path, interaction, outside_ior));
        let random = self.random_at(depth, path);
        let medium = self.volumes.as_ref().and_then(|v| v.scattered[path]);
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

    /// Adds what was found to a part.
    fn finish(&mut self, part: &mut FilmPart, statistics: &mut Statistics) {
        part.values.extend(self.samples.iter().zip(&self.facts).map(|(sample, facts)| {
            let radiance = sample.collected();
            let finite = radiance.is_finite();
            statistics.invalid_samples += u64::from(!finite);
            let radiance = if finite { radiance } else { SampledSpectrum::ZERO };
            FilmSample {
                color: facts.mode.to_rgb(radiance),
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
