//! Vertices on matte surfaces, many at once.

use super::PartRenderer;
use crate::integrator::Context;
use crate::integrator::carried::Rest;
use crate::integrator::lanes::{Columns, LANES, LitColumns};
use crate::integrator::light_part::LobeShares;
use crate::integrator::matte::{MatteVertices, is_classic};
use crate::integrator::matte_surfaces::MatteSurfaces;
use crate::sampler::Sampler;
use snell_intersect::RayQuery;
use snell_math::{Ray, SampledSpectrum, Vec3};
use snell_scene::MediumId;

/// Vertices that are shaded many at once.
pub(super) struct Matte<'a> {
    vertices: MatteVertices,
    pub(super) surfaces: MatteSurfaces<'a>,
}

impl<'a> Matte<'a> {
    /// `None` if there are none, or the level is that of portable code: the twin shades one vertex
    /// at a time.
    pub(super) fn new(context: &Context<'a>, sampler: &Sampler) -> Option<Box<Self>> {
        let wide = context.scene.world.simd().wide()?;
        let surfaces = MatteSurfaces::new(context)?;
        Some(Box::new(Self {
            vertices: MatteVertices::new(context.settings.color, sampler, Some(wide)),
            surfaces,
        }))
    }
}

impl PartRenderer<'_> {
    /// How many of the paths at the beginning can be worked on together, at most [`LANES`].
    pub(super) fn matte_beginning(&self, paths: &[u32]) -> usize {
        let Some(matte) = &self.matte else { return 0 };
        let is_matte =
            |path: &&u32| matte.surfaces.has(self.context.scene, &self.paths.hits[**path as usize]);
        paths.iter().take(LANES).take_while(is_matte).count()
    }

    /// Shades at most [`LANES`] paths at matte surfaces.
    pub(super) fn shade_matte(&mut self, depth: u32, paths: &[u32]) {
        let is_classic = is_classic(self.context.settings.integrator);
        if depth >= self.context.max_depth() && !is_classic {
            return;
        }
        let Some(mut matte) = self.matte.take() else { return };
        let Matte { vertices, surfaces } = &mut *matte;
        let arriving = self.arriving();
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
        if self.is_watched() {
            return self.collect_matte(depth, vertices, paths);
        }
        self.use_lanes(depth, paths, |lane| vertices.is_sound(lane));
        let wants_lobes = self.wants_lobes(depth);
        self.collect_columns(depth, vertices, |lane| wants_lobes.then(|| vertices.lobe(lane)));
        self.note_insides(depth, vertices, paths);
    }

    /// Decides which lanes are in use: those that are sound. The vertices of the others are worked
    /// on alone.
    pub(super) fn use_lanes(
        &mut self,
        depth: u32,
        paths: &[u32],
        is_sound: impl Fn(usize) -> bool,
    ) {
        self.lanes.clear();
        for (lane, &path) in (0..).zip(paths) {
            match is_sound(lane as usize) {
                true => self.lanes.push(lane),
                false => self.shade_one(depth, path as usize),
            }
        }
    }

    /// Takes the light rays of the lanes that are in use, and where their paths go on. `lobe` tells
    /// what scatters light there, where that is a path's first scattering and somebody wants to
    /// know.
    pub(super) fn collect_columns(
        &mut self,
        depth: u32,
        vertices: &impl LitColumns,
        lobe: impl Fn(usize) -> Option<LobeShares>,
    ) {
        let paths = vertices.paths();
        // Column by column, which is twice as fast as path by path. (Columns turned into rows in
        // registers, eight by eight, were no faster, perhaps because it is the stores to what is
        // not in the first cache that take the time.)
        let Self { paths: from, light_rays, lanes, kept, .. } = self;
        let first = light_rays.values.len();
        let path = |lane: u32| paths[lane as usize] as usize;
        vertices.lit(lanes, kept);
        let rays = vertices.light_rays();
        light_rays.rays.extend(kept.iter().map(|&lane| rays.at(lane as usize)));
        light_rays.values.extend(kept.iter().map(|&lane| vertices.brought(lane as usize)));
        match from.is_plain() {
            true => light_rays.times.resize(light_rays.rays.len(), Rest::PLAIN.time),
            false => light_rays.times.extend(kept.iter().map(|&lane| from.rest(path(lane)).time)),
        }
        light_rays.samples.extend(kept.iter().map(|&lane| from.samples[path(lane)]));
        if self.is_told_apart() {
            self.tell_light_apart(depth, first, vertices, &lobe);
        }
        self.collect_next(vertices, lobe);
    }

    /// Dims light and says what it is, of the light rays of the lanes that are `kept`: those from
    /// the first of this number on.
    #[cold]
    fn tell_light_apart(
        &mut self,
        depth: u32,
        first: usize,
        vertices: &impl LitColumns,
        lobe: &impl Fn(usize) -> Option<LobeShares>,
    ) {
        for (i, lane) in (first..).zip(self.kept.iter().map(|&lane| lane as usize)) {
            self.light_rays.values[i] = self.dimmed(depth > 0, self.light_rays.values[i]);
            if !self.light_parts.is_empty() {
                let before = self.paths.rest(vertices.paths()[lane] as usize).lobe;
                let tag = self.tag(
                    lobe(lane).unwrap_or(before),
                    depth + 1,
                    vertices.light().lights.source[lane],
                );
                self.light_rays.tags.push(tag);
            }
        }
    }

    /// Takes where the paths of the lanes that are in use go on: these are `kept`. `lobe` as in
    /// [`Self::collect_columns`].
    pub(super) fn collect_next(
        &mut self,
        vertices: &impl Columns,
        lobe: impl Fn(usize) -> Option<LobeShares>,
    ) {
        let paths = vertices.paths();
        let Self { paths: from, next, lanes, kept, .. } = self;
        let path = |lane: u32| paths[lane as usize] as usize;
        vertices.going_on(lanes, kept);
        let (rays, carried) = (vertices.next_rays(), vertices.carried());
        next.rays.extend(kept.iter().map(|&lane| rays.at(lane as usize)));
        next.carried.extend(kept.iter().map(|&lane| carried.at(lane as usize)));
        next.samples.extend(kept.iter().map(|&lane| from.samples[path(lane)]));
        next.extend_rest(kept.iter().map(|&lane| {
            let rest = from.rest(path(lane));
            lobe(lane as usize).map_or(*rest, |lobe| Rest { lobe, ..*rest })
        }));
    }

    /// Tells media of the rays that the vertices of [`Self::finish_matte`] send out.
    fn note_insides(&mut self, depth: u32, vertices: &MatteVertices, paths: &[u32]) {
        if self.volumes.is_none() {
            return;
        }
        for i in 0..self.lanes.len() {
            let lane = self.lanes[i] as usize;
            self.note_insides_of(depth, vertices, lane, paths[lane] as usize);
        }
    }

    fn note_insides_of(&mut self, depth: u32, vertices: &MatteVertices, lane: usize, path: usize) {
        let random = || self.random_at(depth, path);
        let (is_lit, glowing) = (vertices.light_source(lane).is_some(), vertices.glowing(lane));
        if is_lit && vertices.passes(lane) {
            let light = [(vertices.light_rays().at(lane), vertices.brought(lane))];
            self.note_insides_at(depth, path, &light, glowing, None);
        } else if is_lit {
            let random = random();
            let Some(volumes) = &mut self.volumes else { return };
            volumes.note_light_ray(path, || random, glowing);
        }
        let Some(volumes) = &mut self.volumes else { return };
        if vertices.goes_on(lane) {
            volumes.note_next(path);
        }
    }

    /// Tells media of the rays that the vertex of a path on a surface sends out, to whichever side.
    pub(super) fn note_insides_at(
        &mut self,
        depth: u32,
        path: usize,
        light: &[(Ray, SampledSpectrum)],
        glowing: Option<MediumId>,
        next: Option<Vec3>,
    ) {
        let (random, scene) = (self.random_at(depth, path), self.context.scene);
        let Some(volumes) = &mut self.volumes else { return };
        let (ray, hit, Rest { time, mode, .. }) =
            (&self.paths.rays[path], &self.paths.hits[path], *self.paths.rest(path));
        let point = scene.world.point(RayQuery { time, ..RayQuery::from(ray) }, hit);
        let surface = (&point, || self.paths.interaction(scene, path));
        volumes.note_outputs(
            path,
            ray.direction,
            Some(surface),
            (hit, mode),
            random,
            light,
            glowing,
            next.into_iter(),
        );
    }

    /// Takes what the vertices of [`Self::finish_matte`] gave one by one and in order, because
    /// somebody wants to know more of them.
    fn collect_matte(&mut self, depth: u32, vertices: &MatteVertices, paths: &[u32]) {
        for (lane, &path) in paths.iter().enumerate() {
            let path = path as usize;
            if !vertices.is_sound(lane) {
                self.shade_one(depth, path);
                continue;
            }
            if self.volumes.is_some() {
                self.note_insides_of(depth, vertices, lane, path);
            }
            let rest = self.paths.rest(path);
            let lobe = if self.context.wants_lobes && depth == 0 {
                vertices.lobe(lane)
            } else {
                rest.lobe
            };
            let rest = Rest { lobe, ..*rest };
            self.outputs.clear();
            if let Some((source, weight)) = vertices.light_source(lane) {
                self.outputs.weights.light = weight;
                (self.outputs.light_source, self.outputs.light_lobe) = (Some(source), lobe);
                self.outputs
                    .light_rays
                    .push((vertices.light_rays().at(lane), vertices.brought(lane)));
            }
            if vertices.goes_on(lane) {
                self.outputs
                    .next
                    .push((vertices.next_rays().at(lane), vertices.carried().at(lane).with(&rest)));
                self.outputs.choice = vertices.choice(&self.context, depth, lane);
            }
            self.collect(depth, path);
        }
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
            let random = self.random_at(depth, path);
            self.outputs.clear();
            vertices.shade_classic(&self.context, lane, &state, &random, &mut self.outputs);
            self.collect(depth, path);
        }
    }
}
