//! What is shown of the hits of the rays of the camera: alpha and AOVs.

use super::PartRenderer;
use crate::integrator::Vertex;
use crate::integrator::aov::{Aov, AovKind};
use snell_intersect::{Hit, RayQuery};
use snell_scene::Background;

impl PartRenderer<'_> {
    /// Where the camera has no ray, such as outside of a fisheye's circle, nothing is hit.
    pub(super) fn drop_dead_paths(&mut self) {
        for path in 0..self.paths.len() {
            if self.paths.is_dead(path) {
                self.paths.hits[path] = Hit::MISS;
            }
        }
    }

    /// True if something depends on what the rays of the camera hit first.
    pub(super) fn shows_first_hits(&self) -> bool {
        self.context.scene.background == Background::Transparent || !self.context.settings.aovs.is_empty()
    }

    /// Alpha and AOVs of the camera rays.
    pub(super) fn note_first_hits(&mut self) {
        let scene = self.context.scene;
        if scene.background == Background::Transparent {
            for (i, hit) in self.paths.hits.iter().enumerate() {
                self.facts[i].alpha = f32::from(hit.is_hit());
            }
        }
        let aovs: &[Aov] = &self.context.settings.aovs;
        if aovs.is_empty() {
            return;
        }
        let coverages: Vec<Aov> = aovs.iter().filter(|a| a.kind() == AovKind::Coverage).copied().collect();
        let counted = aovs.iter().any(|a| a.needs_counters());
        let needs_surface = aovs.iter().any(|aov| aov.needs_surface(&self.context));
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
            let interaction = (needs_surface && hit.is_hit()).then(|| self.paths.interaction(scene, i));
            let surface = interaction.as_ref().map(|interaction| self.paths.surface(scene, i, interaction, 1.0));
            let random = self.sampler.numbers_of(self.keys[i]).at_vertex(0, 0);
            let vertex = Vertex { depth: 0, ray: &ray, state: &state, random, surface, medium: None };
            self.covering.extend(coverages.iter().map(|aov| aov.key(&self.context, &hit)));
            for aov in aovs {
                aov.extend(&self.context, (&vertex, &hit), self.camera, counters, &mut self.aovs);
            }
        }
    }
}
