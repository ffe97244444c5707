//! The loop that makes a picture: camera rays, hits, shading by material, light rays, next rays, depth by depth until no path is
//! left. Batches only; nothing here asks for a single ray.

mod collect;
mod specular;

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
use crate::integrator::aov::{Aov, AovKind};
use crate::integrator::camera_path::{FILM, camera_path, film_point, path_of};
use crate::integrator::carried::{Carried, Rest};
use crate::integrator::lanes::{Arriving, LANES};
use crate::integrator::light_part::{LightSource, LightTag, Scatterings};
use crate::integrator::matte::{self, MatteVertices};
use crate::integrator::matte_surfaces::MatteSurfaces;
use crate::integrator::path::{escaped, plain_sky};
use crate::integrator::{Context, IntegratorKind, Outputs, Vertex, VertexFunction};
use crate::sampler::{ManyRandoms, Random, Sampler};
use crate::settings::Crop;
use snell_intersect::{Grouping, Hit, RayQuery};
use snell_math::{ColorMode, ColorModel, DVec2, SampledSpectrum, Vec2};
use snell_scene::{Background, Camera, CameraView, PinholeRays};
use specular::SpecularBatch;

/// Samples that are taken at once. (Measured from 256 to 4,096: few leave the kernels idle, many leave the caches.)
const MAX_SAMPLES: usize = 1 << 11;

/// Light rays that are traced at once, up to those of one vertex more: ray trees and scenes of many lights have too many to keep.
const MAX_BATCH: usize = 1 << 16;

/// Most rays of one sample's ray tree: those of clear glass would grow without end. A tree of depth 9 is smaller.
const MAX_TREE: u32 = 1024;

/// Renders parts, reusing its buffers.
pub struct PartRenderer<'a> {
    context: Context<'a>,
    camera: &'a Camera,
    view: CameraView<'a>,
    camera_rays: PinholeRays<LANES>,
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
    /// All others, in order, and one material after the other.
    others: Vec<u32>,
    order: Vec<u32>,
    /// The material of what each path has hit, one past the last for nothing, and where the paths of each begin in `order`.
    keys: Vec<u32>,
    starts: Vec<u32>,
    outputs: Outputs,
    /// Lanes of [`Matte`], and some of them.
    lanes: Vec<u32>,
    kept: Vec<u32>,
    samples: Vec<Sample>,
    /// Their numbers.
    randoms: Vec<Random>,
    aovs: Vec<f32>,
    /// Writes down what paths find, while a field learns.
    recorder: Option<Recorder>,
    /// Writes down everything, for explanations.
    pub journal: Option<Journal>,
    /// What covers each sample.
    covering: Vec<u64>,
    light_parts: &'a LightParts,
    /// What media need, where there are any and the integrator knows of them.
    volumes: Option<VolumeBatch<'a>>,
    /// What is shaded many at once.
    matte: Option<Box<Matte<'a>>>,
    specular: Option<Box<SpecularBatch<'a>>>,
}

/// Vertices that are shaded many at once.
struct Matte<'a> {
    vertices: MatteVertices,
    surfaces: MatteSurfaces<'a>,
}

impl<'a> Matte<'a> {
    /// `None` if there are none, or the level is that of portable code: the twin shades one vertex at a time.
    fn new(context: &Context<'a>, sampler: &Sampler) -> Option<Box<Self>> {
        let wide = context.scene.world.simd().wide()?;
        let surfaces = MatteSurfaces::new(context)?;
        Some(Box::new(Self { vertices: MatteVertices::new(sampler, Some(wide)), surfaces }))
    }
}

/// A sample being taken.
#[derive(Clone, Copy)]
struct Sample {
    /// What the lanes of its spectra stand for.
    mode: ColorMode,
    /// Found at vertices.
    radiance: SampledSpectrum,
    /// Brought by light rays. Summed apart, because how the two alternate depends on where a batch of many samples is cut into
    /// pieces, and the bits of a sample must not depend on its neighbours.
    brought: SampledSpectrum,
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
        let volumes = if sees_media { VolumeBatch::new(&context, eye) } else { None };
        let shade = context.settings.integrator.vertex_function();
        let matte = if scene.moves { None } else { Matte::new(&context, sampler) };
        let specular = if scene.moves { None } else { SpecularBatch::new(&context, sampler) };
        let view = camera.view(context.settings.size);
        let settings = context.settings;
        let stands_still = !scene.moves && settings.later_cameras.is_empty();
        let is_plain = settings.color == ColorModel::Rgb && !context.wants_lobes && stands_still;
        Self {
            context,
            camera,
            view,
            camera_rays: PinholeRays::default(),
            sampler,
            filter,
            shade,
            tracer,
            paths: Paths::new(is_plain),
            next: Paths::new(is_plain),
            light_rays: LightRays::default(),
            together: Vec::new(),
            others: Vec::new(),
            order: Vec::new(),
            keys: Vec::new(),
            starts: Vec::new(),
            outputs: Outputs::default(),
            lanes: Vec::new(),
            kept: Vec::new(),
            samples: Vec::new(),
            randoms: Vec::new(),
            aovs: Vec::new(),
            recorder: None,
            journal: None,
            covering: Vec::new(),
            light_parts,
            volumes,
            matte,
            specular,
        }
    }

    /// Takes samples `range` of every pixel of `area`; what a field learns from their paths is added to `records`.
    pub fn record(&mut self, area: Crop, range: [u32; 2], records: &mut Vec<Record>, statistics: &mut Statistics) {
        self.recorder = Some(self.recorder.take().unwrap_or_default());
        self.render(area, None, range, statistics);
        if let Some(recorder) = &mut self.recorder {
            let samples = &self.samples;
            recorder.finish(|sample| samples[sample as usize].collected(), records);
        }
    }

    /// Takes samples `range` of the pixels of `area`: of all, or of those with these numbers (row by row).
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
            self.take_samples(positions, range, statistics);
            self.finish(&mut part, statistics);
        }
        part
    }

    /// Takes samples of some pixels.
    fn take_samples(&mut self, positions: &[[u32; 2]], range: [u32; 2], statistics: &mut Statistics) {
        self.start(positions, range);
        statistics.rays.camera += self.paths.len() as u64;
        // Sixteen rays in a row are of one pixel, or of one row of a tile.
        let mut grouping = if self.camera.has_common_origin()
            && self.context.settings.later_cameras.is_empty()
            && matches!(range[1] - range[0], 1 | 16)
        {
            Grouping::Coherent
        } else {
            Grouping::None
        };
        let mut depth = 0;
        while self.paths.len() > 0 {
            self.note_arrivals();
            self.journal.iter_mut().for_each(|journal| journal.events.push(Event::Depth));
            let is_shown = depth == 0 && self.shows_first_hits();
            if is_shown || !self.volumes.as_ref().is_some_and(VolumeBatch::sees_more) {
                self.tracer.closest(&self.paths.rays, &self.paths.times, grouping, &mut self.paths.hits);
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

    fn start(&mut self, positions: &[[u32; 2]], range: [u32; 2]) {
        self.paths.clear();
        self.samples.clear();
        self.randoms.clear();
        self.aovs.clear();
        self.covering.clear();
        if let Some(recorder) = &mut self.recorder {
            recorder.start(positions.len() * (range[1] - range[0]) as usize);
        }
        let sampler = self.sampler;
        let randoms = |&pixel: &[u32; 2]| sampler.randoms(pixel, range[0]..range[1]).map(move |random| (pixel, random));
        let mut starting = positions.iter().flat_map(randoms);
        let mut together: [([u32; 2], Random); LANES] = [([0; 2], sampler.random([0; 2], 0)); LANES];
        let mut many = ManyRandoms::<LANES>::of_camera(sampler);
        loop {
            let mut count = 0;
            for (to, from) in together.iter_mut().zip(&mut starting) {
                many.set(count, &from.1);
                *to = from;
                count += 1;
            }
            if count == 0 {
                return;
            }
            self.start_samples(&together[..count], &many);
        }
    }

    /// Starts at most [`LANES`] samples of these pixels.
    fn start_samples(&mut self, starting: &[([u32; 2], Random)], randoms: &ManyRandoms<LANES>) {
        let (settings, wide) = (self.context.settings, self.context.scene.world.simd().wide());
        let (mut film, mut weights) = ([[0.0; LANES]; 2], [1.0; LANES]);
        let [x, y] = randoms.pairs(FILM, wide);
        for (i, (pixel, _)) in starting.iter().enumerate() {
            let (point, weight) = film_point(settings, self.filter, *pixel, Vec2::new(x[i], y[i]));
            (film[0][i], film[1][i], weights[i]) = (point.x, point.y, weight);
        }
        let begun = self.samples.len() as u32;
        let Self { paths, samples, view, .. } = self;
        self.randoms.extend(starting.iter().map(|(_, random)| *random));
        let sample = |mode, weight| Sample {
            mode,
            radiance: SampledSpectrum::ZERO,
            brought: SampledSpectrum::ZERO,
            alpha: 1.0,
            weight,
            rays: 0,
        };
        if paths.is_plain() && view.pinhole_rays(&film, wide, &mut self.camera_rays) {
            let rays = &self.camera_rays;
            paths.rays.extend((0..starting.len()).map(|i| rays.get(i).ray));
            let (first, _) = Carried::of(&path_of(&rays.get(0), ColorMode::Rgb, 0.0));
            let carried = |i| Carried { cone_spread: rays.get(i).spread, ..first };
            paths.carried.extend((0..starting.len()).map(carried));
            paths.samples.extend(begun..begun + starting.len() as u32);
            samples.extend(weights[..starting.len()].iter().map(|&weight| sample(ColorMode::Rgb, weight)));
            return;
        }
        for (i, (_, random)) in starting.iter().enumerate() {
            let point = DVec2::new(film[0][i], film[1][i]);
            let (ray, state) = camera_path(view, settings, self.context.scene.moves, random, point);
            samples.push(sample(state.mode, weights[i]));
            paths.push(ray, &state, begun + i as u32);
        }
    }

    /// Through media, if there are any, to the next vertices.
    fn travel(&mut self, depth: u32, grouping: Grouping) {
        let Some(volumes) = &mut self.volumes else { return };
        if depth == 0 {
            volumes.start(&self.paths);
        }
        let (samples, randoms) = (&mut self.samples, &self.randoms);
        let random = |paths: &Paths, path: usize| {
            randoms[paths.samples[path] as usize].at_vertex(paths.carried[path].stream, depth)
        };
        let (light_parts, aovs, journal) = (self.light_parts, &mut self.aovs, &mut self.journal);
        volumes.advance(&mut self.tracer, &mut self.paths, grouping, random, |paths, path, radiance| {
            let sample = paths.samples[path];
            samples[sample as usize].radiance += radiance;
            if let Some(journal) = journal {
                journal.events.push(Event::Glow { path, sample, radiance });
            }
            if !light_parts.is_empty() {
                let (scatterings, group) = (Scatterings::of(depth), light_parts.group(LightSource::Medium));
                let tag = LightTag { lobe: paths.rest(path).lobe, scatterings, group };
                light_parts.add(aovs, sample, radiance, &tag, samples[sample as usize].mode);
            }
        });
        if depth == 0 {
            for (path, _) in volumes.scattered.iter().enumerate().filter(|(_, s)| s.is_some()) {
                samples[self.paths.samples[path] as usize].alpha = 1.0;
            }
        }
    }

    /// Where the camera has no ray, such as outside of a fisheye's circle, nothing is hit.
    fn drop_dead_paths(&mut self) {
        for path in 0..self.paths.len() {
            if self.paths.is_dead(path) {
                self.paths.hits[path] = Hit::MISS;
            }
        }
    }

    /// True if something depends on what the rays of the camera hit first.
    fn shows_first_hits(&self) -> bool {
        self.context.scene.background == Background::Transparent || !self.context.settings.aovs.is_empty()
    }

    /// Alpha and AOVs of the camera rays.
    fn note_first_hits(&mut self) {
        let scene = self.context.scene;
        if scene.background == Background::Transparent {
            for (i, hit) in self.paths.hits.iter().enumerate() {
                self.samples[i].alpha = f32::from(hit.is_hit());
            }
        }
        let aovs: &[Aov] = &self.context.settings.aovs;
        if aovs.is_empty() {
            return;
        }
        let coverages: Vec<Aov> = aovs.iter().filter(|a| a.kind() == AovKind::Coverage).copied().collect();
        let counted = aovs.iter().any(|a| a.needs_counters());
        let filter = self.tracer.filter();
        for i in 0..self.paths.len() {
            let (ray, hit, state) = (self.paths.rays[i], self.paths.hits[i], self.paths.state(i));
            let counters = if counted {
                let (_, counters) =
                    scene.world.closest_counted(RayQuery { time: state.time, ..RayQuery::from(&ray) }, filter);
                [counters.nodes_visited, counters.primitives_tested]
            } else {
                [0; 2]
            };
            let interaction = hit.is_hit().then(|| self.paths.interaction(scene, i));
            let surface = interaction.as_ref().map(|interaction| self.paths.surface(scene, i, interaction, 1.0));
            let random = self.randoms[i].at_vertex(0, 0);
            let vertex = Vertex { depth: 0, ray: &ray, state: &state, random, surface, medium: None };
            self.covering.extend(coverages.iter().map(|aov| aov.key(&self.context, &hit)));
            for aov in aovs {
                aov.extend(&self.context, &vertex, self.camera, counters, &mut self.aovs);
            }
        }
    }

    /// Calls the vertex function on every path, grouped by material, and adds what the light rays bring.
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
            let is_miss = self.keys[first as usize] as usize == self.context.scene.materials.len();
            if is_miss && self.is_simple() {
                // They are last.
                for &path in rest {
                    let is_scattered = self.volumes.as_ref().is_some_and(|v| v.scattered[path as usize].is_some());
                    match is_scattered {
                        true => self.shade_one(depth, path as usize),
                        false => self.shade_miss(depth, path as usize),
                    }
                    if self.light_rays.rays.len() >= MAX_BATCH {
                        self.trace_light_rays(statistics);
                    }
                }
                break;
            }
            let (matte, specular) = (self.matte_beginning(rest), self.specular_beginning(rest));
            match (matte, specular) {
                (0, 0) => self.shade_one(depth, first as usize),
                (0, count) => self.shade_specular(depth, &rest[..count]),
                (count, _) => self.shade_matte(depth, &rest[..count]),
            }
            rest = &rest[matte.max(specular).max(1)..];
            if self.light_rays.rays.len() >= MAX_BATCH {
                self.trace_light_rays(statistics);
            }
        }
        self.trace_light_rays(statistics);
        self.order = order;
    }

    /// How many of the paths at the beginning can be worked on together, at most [`LANES`].
    fn matte_beginning(&self, paths: &[u32]) -> usize {
        let Some(matte) = &self.matte else { return 0 };
        let is_matte = |path: &&u32| matte.surfaces.has(self.context.scene, &self.paths.hits[**path as usize]);
        paths.iter().take(LANES).take_while(is_matte).count()
    }

    /// Shades at most [`LANES`] paths at matte surfaces.
    fn shade_matte(&mut self, depth: u32, paths: &[u32]) {
        let is_classic = matte::is_classic(self.context.settings.integrator);
        if depth >= self.context.max_depth() && !is_classic {
            return;
        }
        let Some(mut matte) = self.matte.take() else { return };
        let Matte { vertices, surfaces } = &mut *matte;
        let Paths { rays, hits, carried, samples, .. } = &self.paths;
        let arriving = Arriving { rays, hits, carried, samples, randoms: &self.randoms };
        vertices.gather(&self.context, self.sampler, surfaces, &arriving, paths, depth);
        match is_classic {
            true => self.finish_classic(depth, vertices),
            false => self.finish_matte(depth, vertices),
        }
        self.matte = Some(matte);
    }

    fn finish_matte(&mut self, depth: u32, vertices: &mut MatteVertices) {
        vertices.shade(&self.context, depth);
        let paths = vertices.paths();
        self.lanes.clear();
        self.lanes.extend(0..paths.len() as u32);
        self.lanes.retain(|&lane| vertices.is_sound(lane as usize));
        if self.lanes.len() < paths.len() {
            for (_, &path) in paths.iter().enumerate().filter(|(lane, _)| !vertices.is_sound(*lane)) {
                self.shade_one(depth, path as usize);
            }
        }
        if self.is_watched() {
            return self.collect_matte(depth, vertices, paths);
        }
        // Column by column, which is twice as fast as path by path.
        let Self { paths: from, light_rays, next, lanes, kept, .. } = self;
        let path = |lane: u32| paths[lane as usize] as usize;
        vertices.lit(lanes, kept);
        light_rays.rays.extend(kept.iter().map(|&lane| vertices.light_ray(lane as usize)));
        light_rays.values.extend(kept.iter().map(|&lane| vertices.brought(lane as usize)));
        match from.is_plain() {
            true => light_rays.times.resize(light_rays.rays.len(), Rest::PLAIN.time),
            false => light_rays.times.extend(kept.iter().map(|&lane| from.rest(path(lane)).time)),
        }
        light_rays.samples.extend(kept.iter().map(|&lane| from.samples[path(lane)]));
        vertices.going_on(lanes, kept);
        next.rays.extend(kept.iter().map(|&lane| vertices.next_ray(lane as usize)));
        next.carried.extend(kept.iter().map(|&lane| vertices.carried(lane as usize)));
        next.samples.extend(kept.iter().map(|&lane| from.samples[path(lane)]));
        next.extend_rest(kept.iter().map(|&lane| from.rest(path(lane))));
        self.note_insides(depth, vertices, paths);
    }

    /// Tells media of the rays that the vertices of [`Self::finish_matte`] send out.
    fn note_insides(&mut self, depth: u32, vertices: &MatteVertices, paths: &[u32]) {
        let scene = self.context.scene;
        for &lane in &self.lanes {
            let (lane, path) = (lane as usize, paths[lane as usize] as usize);
            let random = self.random_at(depth, path);
            let Some(volumes) = &mut self.volumes else { return };
            if vertices.light_source(lane).is_some() {
                let interaction = vertices.passes(lane).then(|| self.paths.interaction(scene, path));
                let surface = interaction.as_ref().map(|interaction| self.paths.surface(scene, path, interaction, 1.0));
                let light = [(vertices.light_ray(lane), vertices.brought(lane))];
                let (arriving, glowing) = (self.paths.rays[path].direction, vertices.glowing(lane));
                volumes.note_outputs(path, arriving, surface.as_ref(), random, &light, glowing, std::iter::empty());
            }
            if vertices.goes_on(lane) {
                volumes.note_next(path);
            }
        }
    }

    /// The numbers of the vertex that a path has come to.
    fn random_at(&self, depth: u32, path: usize) -> Random {
        self.randoms[self.paths.samples[path] as usize].at_vertex(self.paths.carried[path].stream, depth)
    }

    /// Takes what the vertices of [`Self::finish_matte`] gave one by one, because somebody wants to know more of them.
    fn collect_matte(&mut self, depth: u32, vertices: &MatteVertices, paths: &[u32]) {
        self.note_insides(depth, vertices, paths);
        let lanes = std::mem::take(&mut self.lanes);
        for &lane in &lanes {
            let (lane, path) = (lane as usize, paths[lane as usize] as usize);
            let rest = self.paths.rest(path);
            let lobe = if self.context.wants_lobes && depth == 0 { vertices.lobe(lane) } else { rest.lobe };
            let rest = Rest { lobe, ..*rest };
            self.outputs.clear();
            if let Some((source, weight)) = vertices.light_source(lane) {
                self.outputs.weights.light = weight;
                (self.outputs.light_source, self.outputs.light_lobe) = (Some(source), lobe);
                self.outputs.light_rays.push((vertices.light_ray(lane), vertices.brought(lane)));
            }
            if vertices.goes_on(lane) {
                self.outputs.next.push((vertices.next_ray(lane), vertices.carried(lane).with(&rest)));
            }
            self.collect(depth, path);
        }
        self.lanes = lanes;
    }

    fn finish_classic(&mut self, depth: u32, vertices: &mut MatteVertices) {
        vertices.prepare_classic(&self.context);
        for (lane, &path) in vertices.paths().iter().enumerate() {
            let path = path as usize;
            if !vertices.is_sound(lane) {
                self.shade_one(depth, path);
                continue;
            }
            let state = self.paths.state(path);
            let random = self.randoms[self.paths.samples[path] as usize].at_vertex(state.stream, depth);
            self.outputs.clear();
            vertices.shade_classic(&self.context, lane, &state, &random, &mut self.outputs);
            self.collect(depth, path);
        }
    }

    /// True if somebody wants to know more of vertices than the light they bring.
    fn is_watched(&self) -> bool {
        self.context.settings.clamp.is_some()
            || !self.light_parts.is_empty()
            || self.journal.is_some()
            || self.recorder.is_some()
    }

    /// Which paths are shaded together, and in which order the others.
    fn group(&mut self) {
        let count = self.paths.len();
        self.together.clear();
        self.others.clear();
        match &self.matte {
            // Nobody sees in which order they come: each sample has one path.
            Some(matte) if self.is_simple() => {
                self.together.resize(count, 0);
                self.others.resize(count, 0);
                let [mut together, mut others] = [0; 2];
                for (path, hit) in (0..).zip(&self.paths.hits[..count]) {
                    let is_matte = matte.surfaces.has(self.context.scene, hit);
                    (self.together[together], self.others[others]) = (path, path);
                    together += usize::from(is_matte);
                    others += usize::from(!is_matte);
                }
                self.together.truncate(together);
                self.others.truncate(others);
            }
            _ => self.others.extend(0..count as u32),
        }
        self.group_by_material();
    }

    /// Others of one material one after the other; those of one sample stay in order, so that sums have one order.
    fn group_by_material(&mut self) {
        let (scene, others) = (self.context.scene, &self.others);
        // What hits nothing comes last.
        let last = scene.materials.len();
        let key = |hit: &Hit| if hit.is_hit() { scene.material_id(hit).index() } else { last };
        self.keys.resize(self.paths.len(), 0);
        for &path in others {
            self.keys[path as usize] = key(&self.paths.hits[path as usize]) as u32;
        }
        let keys = &self.keys;
        self.order.clear();
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

    /// The same as [`Self::shade_one`] for a path that leaves the scene.
    fn shade_miss(&mut self, depth: u32, path: usize) {
        if self.paths.is_dead(path) {
            return;
        }
        let sample = self.paths.samples[path] as usize;
        let ray = &self.paths.rays[path];
        if let Some(sky) = plain_sky(&self.context, depth) {
            let radiance = sky.radiance(ray.direction, self.paths.rest(path).mode);
            self.samples[sample].radiance += self.paths.carried[path].throughput * radiance;
            return;
        }
        let state = &self.paths.state(path);
        let vertex = Vertex { depth, ray, state, random: self.randoms[sample], surface: None, medium: None };
        self.samples[sample].radiance += escaped(&self.context, &vertex).0;
    }

    fn shade_one(&mut self, depth: u32, path: usize) {
        let scene = self.context.scene;
        if self.paths.is_dead(path) {
            return;
        }
        let (ray, hit, state) = (&self.paths.rays[path], &self.paths.hits[path], self.paths.state(path));
        let interaction = hit.is_hit().then(|| self.paths.interaction(scene, path));
        let outside_ior = self.volumes.as_ref().filter(|_| hit.is_hit()).map_or(1.0, |v| v.outside_ior(path, hit));
        let surface = interaction.as_ref().map(|interaction| self.paths.surface(scene, path, interaction, outside_ior));
        let random = self.random_at(depth, path);
        let medium = self.volumes.as_ref().and_then(|v| v.scattered[path]);
        let vertex = Vertex { depth, ray, state: &state, random, surface, medium };
        self.outputs.clear();
        (self.shade)(&self.context, &vertex, &mut self.outputs);
        if let Some(volumes) = &mut self.volumes {
            let Outputs { light_rays, glowing, next, .. } = &self.outputs;
            let next = next.iter().map(|(ray, _)| ray.direction);
            volumes.note_outputs(path, ray.direction, vertex.surface.as_ref(), random, light_rays, *glowing, next);
        }
        self.collect(depth, path);
    }

    fn trace_light_rays(&mut self, statistics: &mut Statistics) {
        let rays = &mut self.light_rays;
        statistics.rays.shadow += rays.rays.len() as u64;
        match &mut self.volumes {
            Some(volumes) => {
                let samples = &self.samples;
                volumes.trace_light_rays(&mut self.tracer, rays, |sample| samples[sample as usize].mode);
            }
            None => self.tracer.occluded(&rays.rays, &rays.times, &mut rays.blocked),
        }
        if let Some(journal) = &mut self.journal {
            journal.fates.extend(rays.values.iter().copied().zip(rays.blocked.iter().copied()));
        }
        for ((&sample, &value), &blocked) in rays.samples.iter().zip(&rays.values).zip(&rays.blocked) {
            if !blocked {
                self.samples[sample as usize].brought += value;
            }
        }
        let lights = rays.samples.iter().zip(&rays.values).zip(&rays.blocked);
        for (((&sample, &value), blocked), tag) in lights.zip(&rays.tags) {
            if !blocked {
                let mode = self.samples[sample as usize].mode;
                self.light_parts.add(&mut self.aovs, sample, value, tag, mode);
            }
        }
        rays.clear();
    }

    /// Adds what was found to a part.
    fn finish(&mut self, part: &mut FilmPart, statistics: &mut Statistics) {
        part.values.extend(self.samples.iter().map(|sample| {
            let radiance = sample.collected();
            let finite = radiance.is_finite();
            statistics.invalid_samples += u64::from(!finite);
            let radiance = if finite { radiance } else { SampledSpectrum::ZERO };
            FilmSample { color: sample.mode.to_rgb(radiance), alpha: sample.alpha, weight: sample.weight }
        }));
        part.aovs.extend(self.aovs.iter().map(|value| if value.is_finite() { *value } else { 0.0 }));
        part.keys.append(&mut self.covering);
    }
}

#[cfg(test)]
mod tests {
    use crate::integrator::aov::Aov;
    use crate::{CompiledScene, IntegratorKind, Job, Settings};
    use snell_intersect::BuildOptions;
    use snell_scene::builtin::builtin;
    use snell_scene::{Background, Projection};

    #[test]
    fn outside_of_the_circle_of_a_fisheye_is_nothing() {
        let mut scene = builtin("teapot").expect("the scene is built in");
        scene.background = Background::Transparent;
        let mut camera = scene.cameras[0].clone();
        camera.projection = Projection::Fisheye { max_angle: 3.0 };
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        for integrator in [IntegratorKind::Flat, IntegratorKind::Ao, IntegratorKind::Path] {
            let aovs = vec![Aov::Depth, Aov::MaterialId];
            let settings = Settings { size: [30, 20], spp: 2, integrator, aovs, ..Settings::default() };
            let image = Job::new(&compiled, &camera, &settings).run(1, &|_| true).0.image();
            assert_eq!(image.layers[0].values[..4], [0.0; 4], "{integrator:?}");
            assert_eq!((image.layers[1].values[0], image.layers[2].values[0]), (0.0, -1.0), "{integrator:?}");
            let middle = 10 * 30 + 15;
            assert_eq!(image.layers[0].values[middle * 4 + 3], 1.0, "{integrator:?}");
        }
    }
}
