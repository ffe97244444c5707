//! Vertices in media, many at once.

use super::PartRenderer;
use crate::integrator::lanes::{Columns, LitColumns};
use crate::integrator::light_part::LobeShares;

impl PartRenderer<'_> {
    /// Shades at most [`LANES`](crate::integrator::lanes::LANES) paths that media have scattered.
    pub(super) fn shade_scattered(&mut self, depth: u32, paths: &[u32]) {
        let (Some(mut vertices), Some(volumes)) = (self.scattered.take(), &self.volumes) else {
            paths.iter().for_each(|&path| self.shade_one(depth, path as usize));
            return;
        };
        if depth < self.context.max_depth() {
            let arriving = self.arriving();
            vertices.gather(self.sampler, &arriving, &volumes.scattered, paths, depth);
            vertices.shade(&self.context, depth);
            self.lanes.clear();
            self.lanes.extend(0..vertices.paths().len() as u32);
            let lobe = self.wants_lobes(depth).then_some(LobeShares::VOLUME);
            self.collect_columns(depth, &*vertices, |_| lobe);
            self.note_insides_here(depth, &*vertices);
        }
        self.scattered = Some(vertices);
    }

    /// Tells media of the rays of the lanes that are in use, all of which start where their paths
    /// are.
    fn note_insides_here(&mut self, depth: u32, vertices: &impl LitColumns) {
        let Self { volumes, lanes, kept, paths, keys, sampler, .. } = self;
        let Some(volumes) = volumes else { return };
        let path = |lane: u32| vertices.paths()[lane as usize] as usize;
        vertices.lit(lanes, kept);
        for &lane in &*kept {
            let path = path(lane);
            let random = || {
                let key = keys[paths.samples[path] as usize];
                sampler.numbers_of(key).at_vertex(paths.carried[path].stream, depth)
            };
            volumes.note_light_ray(path, random, vertices.glowing(lane as usize));
        }
        vertices.going_on(lanes, kept);
        kept.iter().for_each(|&lane| volumes.note_next(path(lane)));
    }
}
