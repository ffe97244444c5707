//! Alpha and AOVs of the first hits of camera rays.

use super::PartRenderer;
use crate::compile::CameraFilter;
use crate::integrator::aov::{Aov, AovKind, FirstHit};
use crate::integrator::first_surface::FirstSurface;
use crate::lanes::LANES;
use snell_intersect::{Hit, RayQuery};
use snell_scene::Background;

impl PartRenderer<'_> {
    /// Gives rays a miss where the camera has none, such as outside of a fisheye's circle.
    pub(super) fn drop_dead_paths(&mut self) {
        for path in 0..self.paths.len() {
            if self.paths.is_dead(path) {
                self.paths.hits[path] = Hit::MISS;
            }
        }
    }

    /// True if some output depends on the first hits of camera rays.
    pub(super) fn needs_first_hits(&self) -> bool {
        self.context.scene.background == Background::Transparent
            || !self.context.settings.aovs.is_empty()
    }

    /// Records alpha and AOVs of the camera rays.
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
        let coverages: Vec<Aov> =
            aovs.iter().filter(|a| a.kind() == AovKind::Coverage).copied().collect();
        let counted = aovs.iter().any(|a| a.needs_counters());
        let filter = CameraFilter::new(scene, self.tracer.filter());
        for i in 0..self.paths.len() {
            let lane = i % LANES;
            if let Some(surfaces) = self.first_surfaces.as_mut().filter(|_| lane == 0) {
                surfaces.look_up(&self.context, &self.paths.rays[i..], &self.paths.hits[i..]);
            }
            let surface = self.first_surface(lane, i);
            let (ray, hit, time) =
                (&self.paths.rays[i], &self.paths.hits[i], self.paths.rest(i).time);
            let counters = if counted {
                let (_, counters) = scene
                    .world
                    .closest_counted(RayQuery { time, ..RayQuery::from(ray) }, filter.at(0));
                [counters.nodes_visited, counters.primitives_tested]
            } else {
                [0; 2]
            };
            self.covering.extend(coverages.iter().map(|aov| aov.key(&self.context, hit)));
            let first = FirstHit { ray, hit, time, surface, counters };
            for aov in aovs {
                aov.extend(&self.context, &first, self.camera, &mut self.aovs);
            }
        }
    }

    /// The surface that a camera ray has hit, if an AOV needs it. Plain surfaces must have been
    /// looked up before.
    fn first_surface(&self, lane: usize, path: usize) -> Option<FirstSurface> {
        let (scene, paths) = (self.context.scene, &self.paths);
        let surfaces = self.first_surfaces.as_ref().filter(|_| paths.hits[path].is_hit())?;
        let ray = &paths.rays[path];
        surfaces.at(lane, ray, paths.rest(path).mode).or_else(|| {
            let interaction = paths.interaction(scene, path);
            let surface = paths.surface(scene, path, &interaction, 1.0);
            Some(FirstSurface::of(&self.context, ray, &surface, surfaces.needs()))
        })
    }
}
