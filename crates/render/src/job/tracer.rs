//! The renderer's ray queries. Every batch of rays is traced and timed here, and recorded if
//! requested.

use crate::compile::{CameraFilter, CompiledScene};
use snell_intersect::{AcceptAll, Grouping, Hit, HitFilter, Rays};
use snell_math::Ray;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Traces batches of rays.
pub struct Tracer<'a> {
    scene: &'a CompiledScene,
    /// Total time of the queries so far.
    pub spent: Duration,
    /// The recorded batches, if recording is requested.
    pub recording: Option<Recording>,
    /// A flag that ends queries early when it is set.
    cancel: Option<&'a AtomicBool>,
}

/// The batches of rays that a render has traced.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// The batches of [`snell_intersect::World::closest`].
    pub closest: Vec<(Grouping, Vec<Ray>)>,
    /// The batches of [`snell_intersect::World::occluded`].
    pub occluded: Vec<Vec<Ray>>,
}

impl Recording {
    /// Adds the batches that another thread has recorded.
    pub fn append(&mut self, mut other: Self) {
        self.closest.append(&mut other.closest);
        self.occluded.append(&mut other.occluded);
    }
}

impl<'a> Tracer<'a> {
    pub fn new(
        scene: &'a CompiledScene,
        recording: Option<Recording>,
        cancel: Option<&'a AtomicBool>,
    ) -> Self {
        Self { scene, spent: Duration::ZERO, recording, cancel }
    }

    /// True if the render was cancelled, so that later results are invalid.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// The filter of hits on cut-out and blended surfaces.
    pub fn filter(&self) -> &'a dyn HitFilter {
        hit_filter(self.scene)
    }

    /// Finds the nearest hit of each ray. The times matter only if the scene moves.
    pub fn closest(
        &mut self,
        rays: &[Ray],
        times: &[f32],
        grouping: Grouping,
        hits: &mut Vec<Hit>,
    ) {
        self.closest_by(self.filter(), rays, times, grouping, hits);
    }

    /// Finds the nearest hit of each ray that `filter` accepts.
    pub fn closest_by(
        &mut self,
        filter: &dyn HitFilter,
        rays: &[Ray],
        times: &[f32],
        grouping: Grouping,
        hits: &mut Vec<Hit>,
    ) {
        if let Some(recording) = &mut self.recording {
            recording.closest.push((grouping, rays.to_vec()));
        }
        hits.clear();
        hits.resize(rays.len(), Hit::MISS);
        let start = Instant::now();
        self.scene.world.closest(self.timed(rays, times), grouping, filter, hits);
        self.spent += start.elapsed();
    }

    fn timed<'r>(&self, rays: &'r [Ray], times: &'r [f32]) -> Rays<'r>
    where
        'a: 'r,
    {
        let rays =
            if self.scene.moves { Rays::new(rays).with_times(times) } else { Rays::new(rays) };
        self.cancel.map_or(rays, |cancel| rays.with_cancel(cancel))
    }

    /// Finds out for each ray whether it is occluded.
    pub fn occluded(&mut self, rays: &[Ray], times: &[f32], blocked: &mut Vec<bool>) {
        if let Some(recording) = &mut self.recording {
            recording.occluded.push(rays.to_vec());
        }
        blocked.clear();
        blocked.resize(rays.len(), false);
        let start = Instant::now();
        self.scene.world.occluded(self.timed(rays, times), Grouping::None, self.filter(), blocked);
        self.spent += start.elapsed();
    }
}

/// The filter of camera rays of a scene, at depth 0: what is hidden from the camera is not hit.
pub fn camera_filter(scene: &CompiledScene) -> CameraFilter<'_> {
    CameraFilter::new(scene, hit_filter(scene))
}

/// The filter that decides about hits on cut-out and blended surfaces of a scene. Scenes without
/// such surfaces accept every hit, which is faster.
pub fn hit_filter(scene: &CompiledScene) -> &dyn HitFilter {
    if scene.has_filter() { scene } else { &AcceptAll }
}
