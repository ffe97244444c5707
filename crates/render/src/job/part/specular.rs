//! Vertices on smooth glass and mirrors, many at once.

use super::PartRenderer;
use crate::integrator::Context;
use crate::integrator::lanes::{Columns, LANES};
use crate::integrator::specular::{SpecularVertices, specular_part};
use crate::sampler::Sampler;
use snell_intersect::triangles::PlainMesh;
use snell_intersect::{GeometryId, Hit};
use snell_scene::material::Specular;

/// Vertices that are shaded together.
pub(super) struct SpecularBatch<'a> {
    vertices: SpecularVertices,
    /// By geometry, where they are plain.
    meshes: Vec<Option<PlainMesh<'a>>>,
    /// By material: what it does, if it is specular.
    materials: Vec<Option<Specular>>,
}

impl<'a> SpecularBatch<'a> {
    /// `None` if there are none, or the level is that of portable code: the twin shades one vertex
    /// at a time.
    pub(super) fn new(context: &Context<'a>, sampler: &Sampler) -> Option<Box<Self>> {
        let scene = context.scene;
        let wide = scene.world.simd().wide()?;
        let materials: Vec<_> =
            scene.materials.iter().map(|material| specular_part(context, material)).collect();
        let plain = |geometry: usize| scene.world.plain_mesh(GeometryId(geometry as u32));
        let meshes = (0..scene.world.geometry_count()).map(plain).collect();
        let vertices = SpecularVertices::new(context.settings.color, sampler, Some(wide));
        materials
            .iter()
            .any(Option::is_some)
            .then(|| Box::new(Self { vertices, meshes, materials }))
    }
}

impl PartRenderer<'_> {
    /// How many of the paths at the beginning can be worked on together, at most [`LANES`].
    pub(super) fn specular_beginning(&self, depth: u32, paths: &[u32]) -> usize {
        if self.journal.is_some() || self.wants_lobes(depth) {
            return 0;
        }
        paths.iter().take(LANES).take_while(|path| self.is_specular(**path)).count()
    }

    /// True if a path has come to a specular surface.
    pub(super) fn is_specular(&self, path: u32) -> bool {
        let material = self.materials[path as usize] as usize;
        self.specular
            .as_ref()
            .is_some_and(|specular| matches!(specular.materials.get(material), Some(Some(_))))
    }

    /// Shades at most [`LANES`] paths at specular surfaces.
    pub(super) fn shade_specular(&mut self, depth: u32, paths: &[u32]) {
        if depth >= self.context.max_depth() {
            return;
        }
        let Some(mut specular) = self.specular.take() else { return };
        let SpecularBatch { vertices, meshes, materials } = &mut *specular;
        let lobe = |material: u32| materials[material as usize].as_ref();
        let mesh = |hit: &Hit| meshes[hit.geometry as usize].as_ref().filter(|_| hit.instance == 0);
        let arriving = self.arriving();
        vertices.start(self.sampler, &arriving, paths, depth);
        for lane in 0..vertices.paths().len() {
            let path = vertices.paths()[lane] as usize;
            let (hit, key) = (&self.paths.hits[path], self.materials[path]);
            let Some(lobe) = lobe(key) else { continue };
            let outside_ior =
                self.volumes.as_ref().map_or(1.0, |volumes| volumes.outside_ior(path, hit));
            let surface = (&self.context.scene.materials[key as usize], lobe);
            vertices.gather(
                &self.context,
                lane,
                &arriving,
                surface,
                outside_ior,
                mesh(hit).is_some(),
            );
        }
        vertices.gather_triangles(&arriving, mesh);
        let keys = &self.materials;
        vertices.shade(&self.context, depth, |path| lobe(keys[path as usize]));
        self.finish_specular(depth, vertices);
        self.specular = Some(specular);
    }

    fn finish_specular(&mut self, depth: u32, vertices: &SpecularVertices) {
        self.use_lanes(depth, vertices.paths(), |lane| vertices.is_sound(lane));
        self.collect_next(vertices, |_| None);
        self.note_insides_beyond(depth, vertices);
    }

    /// Tells media of the rays that the vertices of [`Self::finish_specular`] send out.
    fn note_insides_beyond(&mut self, depth: u32, vertices: &SpecularVertices) {
        if self.volumes.is_none() {
            return;
        }
        for i in 0..self.kept.len() {
            let lane = self.kept[i] as usize;
            let next = vertices.next_rays().at(lane).direction;
            self.note_insides_at(depth, vertices.paths()[lane] as usize, &[], None, Some(next));
        }
    }
}
