//! Collects the output of a batch shader: light rays, next rays, and the media in which these rays
//! start.

use super::PartRenderer;
use crate::batch::{BatchShader, Shaded};
use crate::integrator::carried::Rest;
use crate::integrator::light_part::{LightSource, LobeShares};
use crate::lanes::LANES;
use snell_intersect::RayQuery;
use snell_math::{Ray, SampledSpectrum, Vec3};
use snell_scene::MediumId;

impl<'a> PartRenderer<'a> {
    /// Collects the output of a shader for the paths that it has shaded last. Vertices that the
    /// shader marks as not shaded are shaded by the vertex function.
    pub(super) fn collect_shaded(&mut self, depth: u32, shader: &dyn BatchShader<'a>) {
        let shaded = shader.shaded();
        for &(path, radiance) in shaded.found {
            self.take_found(path as usize, depth, radiance);
        }
        for &(path, ray, value) in shaded.shadow_rays {
            self.take_shadow_ray(path as usize, depth, ray, value);
        }
        if shader.is_lane_by_lane(&self.batch(depth)) {
            return self.collect_lanes(depth, shader);
        }
        self.lanes.clear();
        for (lane, &path) in (0..).zip(shaded.paths) {
            match shaded.is_sound[lane as usize] {
                0 => self.shade_one(depth, path as usize),
                _ => self.lanes.push(lane),
            }
        }
        self.collect_light_rays(depth, shader, &shaded);
        self.collect_next(depth, shader, &shaded);
        if self.volumes.is_some() {
            for i in 0..self.lanes.len() {
                self.note_media(depth, shader, &shaded, self.lanes[i] as usize);
            }
        }
    }

    /// Collects a light ray from the floor of the background.
    fn take_shadow_ray(&mut self, path: usize, depth: u32, ray: Ray, value: SampledSpectrum) {
        if !self.light_parts.is_empty() {
            let tag = self.tag(LobeShares::MATTE, depth + 1, LightSource::Environment);
            self.light_rays.tags.push(tag);
        }
        let (time, sample) = (self.paths.rest(path).time, self.paths.samples[path]);
        self.light_rays.push(ray, time, value, sample);
    }

    /// Collects the output of a shader lane by lane, in order.
    fn collect_lanes(&mut self, depth: u32, shader: &dyn BatchShader<'a>) {
        let shaded = shader.shaded();
        for (lane, &path) in shaded.paths.iter().enumerate() {
            let path = path as usize;
            if shaded.is_sound[lane] == 0 {
                self.shade_one(depth, path);
                continue;
            }
            if self.volumes.is_some() {
                self.note_media(depth, shader, &shaded, lane);
            }
            let mut outputs = std::mem::take(&mut self.outputs);
            outputs.clear();
            shader.outputs(&self.batch(depth), lane, &mut outputs);
            self.outputs = outputs;
            self.collect(depth, path);
        }
    }

    /// Collects the light rays of the shaded lanes.
    fn collect_light_rays(
        &mut self,
        depth: u32,
        shader: &dyn BatchShader<'a>,
        shaded: &Shaded<'_>,
    ) {
        let Some(light) = shaded.light else { return };
        // (Column by column, which is twice as fast as path by path.)
        let Self { paths: from, light_rays, lanes, kept, .. } = self;
        let first = light_rays.values.len();
        let path = |lane: u32| shaded.paths[lane as usize] as usize;
        keep(lanes, &light.outputs.has_light_ray, kept);
        let rays = light.light_rays();
        light_rays.rays.extend(kept.iter().map(|&lane| rays.at(lane as usize)));
        light_rays.values.extend(kept.iter().map(|&lane| light.brought(lane as usize)));
        match from.is_plain() {
            true => light_rays.times.resize(light_rays.rays.len(), Rest::PLAIN.time),
            false => light_rays.times.extend(kept.iter().map(|&lane| from.rest(path(lane)).time)),
        }
        light_rays.samples.extend(kept.iter().map(|&lane| from.samples[path(lane)]));
        if self.caustics.is_some() {
            self.leave_light_to_photons(first, shaded);
        }
        if self.context.settings.clamp.is_some() || !self.light_parts.is_empty() {
            self.clamp_and_tag_light_rays(depth, first, shader, shaded);
        }
    }

    /// Takes from the light rays from index `first` on, which belong to the lanes `kept`, what
    /// photons bring.
    #[cold]
    fn leave_light_to_photons(&mut self, first: usize, shaded: &Shaded<'_>) {
        let Some(light) = shaded.light else { return };
        for (i, lane) in (first..).zip(self.kept.iter().map(|&lane| lane as usize)) {
            let (path, source) = (shaded.paths[lane] as usize, light.lights.source[lane]);
            // (A ray to a point is not of unit length.)
            let direction = self.light_rays.rays[i].direction;
            let left = self.left_to_light_ray(path, Some(source), direction);
            self.light_rays.values[i] *= left;
        }
    }

    /// Clamps the contributions of the light rays from index `first` on, which belong to the lanes
    /// `kept`, and records their layers.
    #[cold]
    fn clamp_and_tag_light_rays(
        &mut self,
        depth: u32,
        first: usize,
        shader: &dyn BatchShader<'a>,
        shaded: &Shaded<'_>,
    ) {
        let wants_lobes = self.batch(depth).wants_lobes();
        for (i, lane) in (first..).zip(self.kept.iter().map(|&lane| lane as usize)) {
            self.light_rays.values[i] = self.clamped(depth > 0, self.light_rays.values[i]);
            if let Some(light) = shaded.light
                && !self.light_parts.is_empty()
            {
                let before = self.paths.rest(shaded.paths[lane] as usize).lobe;
                let lobe = if wants_lobes { shader.lobe(lane) } else { before };
                let tag = self.tag(lobe, depth + 1, light.lights.source[lane]);
                self.light_rays.tags.push(tag);
            }
        }
    }

    /// Collects the next rays of the shaded lanes.
    fn collect_next(&mut self, depth: u32, shader: &dyn BatchShader<'a>, shaded: &Shaded<'_>) {
        let wants_lobes = self.batch(depth).wants_lobes();
        let first = self.next.len();
        let Self { paths: from, next, lanes, kept, .. } = self;
        let path = |lane: u32| shaded.paths[lane as usize] as usize;
        keep(lanes, shaded.goes_on, kept);
        let (rays, carried) = (shaded.next_rays, shaded.carried);
        next.rays.extend(kept.iter().map(|&lane| rays.at(lane as usize)));
        next.carried.extend(kept.iter().map(|&lane| carried.at(lane as usize)));
        next.samples.extend(kept.iter().map(|&lane| from.samples[path(lane)]));
        next.extend_rest(kept.iter().map(|&lane| {
            let rest = from.rest(path(lane));
            match wants_lobes {
                true => Rest { lobe: shader.lobe(lane as usize), ..*rest },
                false => *rest,
            }
        }));
        if self.caustics.is_some() {
            for i in 0..self.kept.len() {
                let path = shaded.paths[self.kept[i] as usize] as usize;
                self.mark_chain(path, first + i);
            }
        }
    }

    /// Records the media in which the light ray and the next ray of a lane start.
    fn note_media(
        &mut self,
        depth: u32,
        shader: &dyn BatchShader<'a>,
        shaded: &Shaded<'_>,
        lane: usize,
    ) {
        let path = shaded.paths[lane] as usize;
        let light = shaded.light.filter(|_| shaded.has_light_ray(lane));
        let goes_on = shaded.goes_on[lane] != 0;
        if light.is_none() && !goes_on {
            return;
        }
        let glowing = light.and_then(|light| light.glowing[lane]);
        let [light_may_cross, next_may_cross] = shader.may_cross(lane);
        let crossing =
            light.filter(|_| light_may_cross).map(|l| (l.light_rays().at(lane), l.brought(lane)));
        let next = (goes_on & next_may_cross).then(|| shaded.next_rays.at(lane).direction);
        if crossing.is_some() || next.is_some() {
            self.note_media_beyond(depth, path, crossing.as_slice(), glowing, next);
        }
        let Self { volumes: Some(volumes), paths, keys, sampler, .. } = self else { return };
        if light.is_some() && crossing.is_none() {
            let random = || {
                let key = keys[paths.samples[path] as usize];
                sampler.numbers_of(key).at_vertex(paths.carried[path].stream, depth)
            };
            volumes.note_light_ray(path, random, glowing);
        }
        if goes_on && next.is_none() {
            volumes.note_next(path);
        }
    }

    /// Records the media in which rays start that may leave a surface on either side.
    fn note_media_beyond(
        &mut self,
        depth: u32,
        path: usize,
        light: &[(Ray, SampledSpectrum)],
        glowing: Option<MediumId>,
        next: Option<Vec3>,
    ) {
        let (random, scene) = (self.batch(depth).random(path), self.context.scene);
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
}

/// Writes to `to` those of `lanes` whose mark is not 0.
fn keep(lanes: &[u32], marks: &[u32; LANES], to: &mut Vec<u32>) {
    to.clear();
    to.resize(lanes.len(), 0);
    let mut count = 0;
    for &lane in lanes {
        to[count] = lane;
        count += usize::from(marks[lane as usize % LANES] != 0);
    }
    to.truncate(count);
}
