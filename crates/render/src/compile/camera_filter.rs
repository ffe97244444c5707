//! Hits of camera rays: they pass through surfaces that are hidden from the camera.

use super::CompiledScene;
use snell_intersect::{Hit, HitFilter};
use snell_math::Ray;

/// The filter of camera rays.
pub struct CameraFilter<'a> {
    scene: &'a CompiledScene,
    others: &'a dyn HitFilter,
}

impl<'a> CameraFilter<'a> {
    /// The filter of a scene's camera rays, given that of its other rays.
    pub fn new(scene: &'a CompiledScene, others: &'a dyn HitFilter) -> Self {
        Self { scene, others }
    }

    /// The filter of rays at this depth; those of depth 0 come from the camera.
    pub fn at(&self, depth: u32) -> &dyn HitFilter {
        if depth == 0 && self.scene.hides_from_camera { self } else { self.others }
    }
}

impl HitFilter for CameraFilter<'_> {
    fn accept(&self, ray: &Ray, hit: &Hit) -> bool {
        self.accept_at(ray, 0.0, hit)
    }

    fn accept_at(&self, ray: &Ray, time: f32, hit: &Hit) -> bool {
        self.scene.material(self.scene.material_id(hit)).visible_to_camera
            && self.others.accept_at(ray, time, hit)
    }
}
