//! One sample for each of some pixels, without a film: for pictures that change many times a
//! second, the sums of a film would take longer than the camera rays.

use super::part::PartRenderer;
use super::tracer::Tracer;
use super::{Job, Statistics};
use crate::film::FilmPart;
use crate::film::noise::positions;
use crate::integrator::Context;
use crate::threads::on_threads;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

impl Job<'_> {
    /// The first sample of each pixel that `is_wanted` accepts: for each tile that has some, a
    /// part, in no particular order. The samples are those of [`Self::run`], unless the settings
    /// ask for guiding, which is not trained here, or for photons, which are not shot.
    pub fn glance(
        &self,
        threads: usize,
        is_wanted: &(dyn Fn([u32; 2]) -> bool + Sync),
    ) -> Vec<FilmPart> {
        let areas: Vec<_> = self.empty_film().tiles.into_iter().map(|tile| tile.area).collect();
        let (next, parts) = (AtomicUsize::new(0), Mutex::new(Vec::with_capacity(areas.len())));
        let wants_lobes = self.light_parts.want_lobes();
        let work = || {
            let context = Context {
                scene: self.scene,
                settings: self.settings,
                lights: &self.lights,
                field: None,
                wants_lobes,
            };
            let mut renderer = PartRenderer::new(
                context,
                self.camera,
                &self.sampler,
                self.filter,
                &self.light_parts,
                Tracer::new(self.scene, None, self.cancel),
            );
            let (mut mine, mut statistics) = (Vec::new(), Statistics::default());
            while let Some(&area) = areas.get(next.fetch_add(1, Ordering::Relaxed)) {
                let numbers = positions(&area).zip(0..);
                let pixels: Vec<u32> =
                    numbers.filter(|(at, _)| is_wanted(*at)).map(|(_, number)| number).collect();
                if pixels.is_empty() {
                    continue;
                }
                let count = area.size().iter().product::<u32>() as usize;
                let some = (pixels.len() < count).then_some(&pixels[..]);
                mine.push(renderer.render(area, some, [0, 1], &mut statistics));
            }
            super::lock(&parts).append(&mut mine);
        };
        on_threads(threads, work);
        super::into_inner(parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::aov::Aov;
    use crate::{CompiledScene, Settings};
    use snell_scene::builtin::builtin;

    #[test]
    fn what_is_seen_at_a_glance_is_the_first_sample() {
        let scene = builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &Default::default()).expect("a valid scene");
        let aovs = vec![Aov::Depth];
        let settings = Settings { size: [40, 20], spp: 1, aovs, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let image = job.run(1, &|_| true).0.image();
        let is_wanted = |[x, y]: [u32; 2]| x % 3 == 0 && y > 2;
        let parts = job.glance(2, &is_wanted);
        let mut seen = 0;
        for part in &parts {
            let all: Vec<_> = positions(&part.area).collect();
            let numbers = part.pixels.clone().unwrap_or_else(|| (0..all.len() as u32).collect());
            assert_eq!(numbers.len(), part.values.len());
            for ((number, sample), depth) in numbers.iter().zip(&part.values).zip(&part.aovs) {
                let [x, y] = all[*number as usize];
                assert!(is_wanted([x, y]));
                let pixel = (y * 40 + x) as usize;
                let color = &image.layers[0].values[pixel * 4..][..3];
                assert!(sample.weight < 0.0 || color == sample.color.to_array());
                assert_eq!(image.layers[1].values[pixel], *depth);
                seen += 1;
            }
        }
        assert_eq!(seen, 14 * 17);
    }
}
