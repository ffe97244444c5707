//! Collects the output of a vertex function, and passes it to the recorder and the journal.

use super::{MAX_TREE, PartRenderer};
use crate::integrator::light_part::{LightSource, LightTag, LobeShares, Scatterings};
use crate::job::journal::{Event, Shaded};
use crate::job::volumes::VolumeBatch;
use snell_math::SampledSpectrum;

impl PartRenderer<'_> {
    /// Collects the output of the vertex function.
    pub(super) fn collect(&mut self, depth: u32, path: usize) {
        let (carried, sample) = (&self.paths.carried[path], self.paths.samples[path]);
        let (is_branched, throughput, time) =
            (carried.stream != 0, carried.throughput, self.paths.rest(path).time);
        if self.caustics.is_some() {
            self.leave_to_photons(path);
        }
        self.outputs.radiance = self.clamped(depth > 1, self.outputs.radiance);
        self.take_clamped(path, depth, self.outputs.radiance);
        for i in 0..self.outputs.light_rays.len() {
            self.outputs.light_rays[i].1 = self.clamped(depth > 0, self.outputs.light_rays[i].1);
        }
        if !self.light_parts.is_empty() {
            let source = self.outputs.light_source.unwrap_or_else(|| self.source_found(path));
            let tag = self.tag(self.outputs.light_lobe, depth + 1, source);
            self.light_rays.tags.extend(self.outputs.light_rays.iter().map(|_| tag));
        }
        if is_branched && self.facts[sample as usize].rays > MAX_TREE {
            self.outputs.next.clear();
        }
        self.note_in_journal(path);
        for (ray, value) in self.outputs.light_rays.drain(..) {
            self.light_rays.push(ray, time, value, sample);
        }
        if let (Some(recorder), Some(choice), Some((_, next))) =
            (&mut self.recorder, self.outputs.choice, self.outputs.next.first())
        {
            recorder.leave(sample, depth, choice, throughput, next.throughput);
        }
        self.facts[sample as usize].rays += self.outputs.next.len() as u32;
        let first = self.next.len();
        for (ray, state) in self.outputs.next.drain(..) {
            self.next.push(ray, &state, sample);
        }
        if self.caustics.is_some() {
            for next in first..self.next.len() {
                self.mark_chain(path, next);
            }
        }
    }

    /// Takes from the output of the vertex function what photons bring.
    #[cold]
    fn leave_to_photons(&mut self, path: usize) {
        self.outputs.radiance *= self.left_to_path(path);
        for i in 0..self.outputs.light_rays.len() {
            let direction = self.outputs.light_rays[i].0.direction;
            let left = self.left_to_light_ray(path, self.outputs.light_source, direction);
            self.outputs.light_rays[i].1 *= left;
        }
    }

    /// Marks a next path with what it has met since photons were gathered.
    pub(super) fn mark_chain(&mut self, path: usize, next: usize) {
        let chain = self.chain_after(path, self.next.carried[next].bsdf_pdf);
        let marks = &mut self.next.carried[next].marks;
        *marks = marks.with_chain(chain);
    }

    /// Records the output of a vertex in the journal, if there is one.
    fn note_in_journal(&mut self, path: usize) {
        let Some(journal) = &mut self.journal else { return };
        let hit = self.paths.hits[path];
        let media = self.volumes.as_ref().map(VolumeBatch::surroundings);
        let outside_ior =
            media.filter(|_| hit.is_hit()).map_or(1.0, |media| media.outside_ior(path, &hit));
        journal.events.push(Event::Vertex(Box::new(Shaded {
            path,
            sample: self.paths.samples[path],
            ray: self.paths.rays[path],
            hit,
            state: self.paths.state(path),
            medium: media.and_then(|media| media.scattered[path]),
            outside_ior,
            radiance: self.outputs.radiance,
            weights: self.outputs.weights,
            light_rays: self.outputs.light_rays.clone(),
            source: self.outputs.light_source,
            next: self.outputs.next.clone(),
        })));
    }

    /// Adds light that a path has found to its sample, and to the sample's layers.
    #[inline]
    pub(super) fn take_found(&mut self, path: usize, depth: u32, radiance: SampledSpectrum) {
        let radiance = match self.caustics {
            Some(_) => radiance * self.left_to_path(path),
            None => radiance,
        };
        self.take_clamped(path, depth, self.clamped(depth > 1, radiance));
    }

    fn take_clamped(&mut self, path: usize, depth: u32, radiance: SampledSpectrum) {
        let sample = self.paths.samples[path];
        self.samples[sample as usize].radiance += radiance;
        if !self.light_parts.is_empty() {
            let tag = self.tag(self.paths.rest(path).lobe, depth, self.source_found(path));
            let mode = self.facts[sample as usize].mode;
            self.light_parts.add(&mut self.aovs, sample, radiance, &tag, mode);
        }
    }

    /// Clamps light that was scattered more than once, if the settings request clamping.
    #[inline]
    pub(super) fn clamped(
        &self,
        was_scattered_again: bool,
        light: SampledSpectrum,
    ) -> SampledSpectrum {
        let Some(most) = self.context.settings.clamp.filter(|_| was_scattered_again) else {
            return light;
        };
        let brightest = light.max_element();
        if brightest > most { light * (most / brightest) } else { light }
    }

    /// The source of the light that a path finds at its current vertex.
    fn source_found(&self, path: usize) -> LightSource {
        let (scene, hit) = (self.context.scene, &self.paths.hits[path]);
        if hit.is_hit() {
            LightSource::Material(scene.material_id(hit))
        } else {
            LightSource::Environment
        }
    }

    /// The classification of light of a path, given the number of scatterings and the first lobe.
    pub(super) fn tag(&self, lobe: LobeShares, scatterings: u32, source: LightSource) -> LightTag {
        LightTag {
            lobe,
            scatterings: Scatterings::of(scatterings),
            group: self.light_parts.group(source),
        }
    }
}
