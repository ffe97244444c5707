//! What becomes of the outputs of a vertex function, and who else wants to know of them.

use super::{MAX_TREE, PartRenderer};
use crate::integrator::light_part::{LightSource, LightTag, Scatterings};
use crate::job::journal::{Event, Shaded};
use snell_math::SampledSpectrum;

impl PartRenderer<'_> {
    /// Takes what the vertex function gave.
    pub(super) fn collect(&mut self, depth: u32, path: usize) {
        let (carried, sample) = (&self.paths.carried[path], self.paths.samples[path]);
        let (is_branched, throughput, time) = (carried.stream != 0, carried.throughput, self.paths.rest(path).time);
        self.clamp(depth);
        self.samples[sample as usize].radiance += self.outputs.radiance;
        if !self.light_parts.is_empty() {
            self.note_light_parts(depth, path, sample);
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
        for (ray, state) in self.outputs.next.drain(..) {
            self.next.push(ray, &state, sample);
        }
    }

    /// Writes down what a vertex gave, if that is wanted.
    fn note_in_journal(&mut self, path: usize) {
        let Some(journal) = &mut self.journal else { return };
        let (hit, volumes) = (self.paths.hits[path], self.volumes.as_ref());
        let outside_ior = volumes.filter(|_| hit.is_hit()).map_or(1.0, |v| v.outside_ior(path, &hit));
        journal.events.push(Event::Vertex(Box::new(Shaded {
            path,
            sample: self.paths.samples[path],
            ray: self.paths.rays[path],
            hit,
            state: self.paths.state(path),
            medium: volumes.and_then(|v| v.scattered[path]),
            outside_ior,
            radiance: self.outputs.radiance,
            weights: self.outputs.weights,
            light_rays: self.outputs.light_rays.clone(),
            source: self.outputs.light_source,
            next: self.outputs.next.clone(),
        })));
    }

    /// Dims light that was scattered more than once, if that is asked for.
    fn clamp(&mut self, depth: u32) {
        let Some(most) = self.context.settings.clamp else { return };
        let dimmed = |light: SampledSpectrum| {
            let brightest = light.max_element();
            if brightest > most { light * (most / brightest) } else { light }
        };
        if depth > 1 {
            self.outputs.radiance = dimmed(self.outputs.radiance);
        }
        if depth > 0 {
            self.outputs.light_rays.iter_mut().for_each(|(_, value)| *value = dimmed(*value));
        }
    }

    /// Adds what was found to its layers, and keeps what must be known of the light rays.
    fn note_light_parts(&mut self, depth: u32, path: usize, sample: u32) {
        let (scene, hit) = (self.context.scene, &self.paths.hits[path]);
        let source =
            if hit.is_hit() { LightSource::Material(scene.material_id(hit)) } else { LightSource::Environment };
        let tag = |lobe, count, source| LightTag {
            lobe,
            scatterings: Scatterings::of(count),
            group: self.light_parts.group(source),
        };
        let found = tag(self.paths.rest(path).lobe, depth, source);
        let brought = tag(self.outputs.light_lobe, depth + 1, self.outputs.light_source.unwrap_or(source));
        let mode = self.facts[sample as usize].mode;
        self.light_parts.add(&mut self.aovs, sample, self.outputs.radiance, &found, mode);
        self.light_rays.tags.extend(self.outputs.light_rays.iter().map(|_| brought));
    }
}
