//! Vertices on surfaces of any kind, many at once.

use super::PartRenderer;
use crate::integrator::Vertex;
use crate::integrator::lanes::{Columns, LANES, LitColumns};
use snell_math::ColorModel;

impl PartRenderer<'_> {
    /// How many of the paths at the beginning can be worked on together, at most [`LANES`].
    pub(super) fn surfaces_beginning(&self, depth: u32, paths: &[u32]) -> usize {
        if self.surfaces.is_none() || !self.is_simple() || self.wants_lobes(depth) {
            return 0;
        }
        let nothing = self.context.scene.materials.len();
        // What parts wavelengths changes what else a path carries.
        let is_spectral = self.context.settings.color == ColorModel::Spectral;
        let materials = &self.context.scene.materials;
        let is_any = |&path: &u32| {
            let material = self.materials[path as usize] as usize;
            material < nothing
                && !self.is_specular(path)
                && !(is_spectral && materials[material].is_dispersive())
        };
        paths.iter().take(LANES).take_while(|path| is_any(path)).count()
    }

    /// Shades at most [`LANES`] paths at surfaces.
    pub(super) fn shade_surfaces(&mut self, depth: u32, paths: &[u32]) {
        let Some(mut vertices) = self.surfaces.take() else { return };
        let scene = self.context.scene;
        vertices.start(self.sampler, &self.arriving(), paths, depth);
        for lane in 0..vertices.paths().len() {
            let path = vertices.paths()[lane] as usize;
            let (ray, hit) = (&self.paths.rays[path], &self.paths.hits[path]);
            let outside_ior =
                self.volumes.as_ref().map_or(1.0, |volumes| volumes.outside_ior(path, hit));
            if vertices.is_plain(&self.context, &self.arriving(), outside_ior) {
                continue;
            }
            let (state, interaction) =
                (self.paths.state(path), self.paths.interaction(scene, path));
            let surface = self.paths.surface(scene, path, &interaction, outside_ior);
            let prepared = scene.prepared(scene.material_id(hit));
            let random = self.sampler.numbers_of(self.keys[self.paths.samples[path] as usize]);
            let vertex = Vertex { depth, ray, state: &state, random, surface: None, medium: None };
            let found = vertices.gather(&self.context, &vertex, &surface, prepared);
            self.take_found(path, depth, found);
        }
        if depth < self.context.max_depth() {
            vertices.gather_plain(&self.arriving());
            vertices.shade(&self.context, depth);
            self.use_lanes(depth, vertices.paths(), |lane| vertices.is_sound(lane));
            self.collect_columns(depth, &*vertices, |_| None);
            self.note_insides_around(depth, &*vertices);
        }
        self.surfaces = Some(vertices);
    }

    /// Tells media of the rays that the lanes in use send out.
    fn note_insides_around(&mut self, depth: u32, vertices: &impl LitColumns) {
        if self.volumes.is_none() {
            return;
        }
        for i in 0..self.lanes.len() {
            let lane = self.lanes[i] as usize;
            let light = vertices
                .is_lit(lane)
                .then(|| (vertices.light_rays().at(lane), vertices.brought(lane)));
            let next =
                (vertices.goes_on()[lane] != 0).then(|| vertices.next_rays().at(lane).direction);
            let path = vertices.paths()[lane] as usize;
            self.note_insides_at(depth, path, light.as_slice(), vertices.glowing(lane), next);
        }
    }
}
