//! Where paths begin: samples, their numbers and the rays of the camera.

use super::{PartRenderer, Sample};
use crate::integrator::camera_path::{FILM, camera_path, film_point, path_of};
use crate::integrator::carried::Carried;
use crate::integrator::lanes::LANES;
use crate::sampler::{ManyRandoms, Random};
use snell_math::{ColorMode, DVec2, SampledSpectrum, Vec2};

impl PartRenderer<'_> {
    pub(super) fn start(&mut self, positions: &[[u32; 2]], range: [u32; 2]) {
        self.paths.clear();
        self.samples.clear();
        self.randoms.clear();
        self.aovs.clear();
        self.covering.clear();
        if let Some(recorder) = &mut self.recorder {
            recorder.start(positions.len() * (range[1] - range[0]) as usize);
        }
        let sampler = self.sampler;
        let randoms = |&pixel: &[u32; 2]| sampler.randoms(pixel, range[0]..range[1]).map(move |random| (pixel, random));
        let mut starting = positions.iter().flat_map(randoms);
        let mut together: [([u32; 2], Random); LANES] = [([0; 2], sampler.random([0; 2], 0)); LANES];
        let mut many = ManyRandoms::<LANES>::of_camera(sampler);
        loop {
            let mut count = 0;
            for (to, from) in together.iter_mut().zip(&mut starting) {
                many.set(count, &from.1);
                *to = from;
                count += 1;
            }
            if count == 0 {
                return;
            }
            self.start_samples(&together[..count], &many);
        }
    }

    /// Starts at most [`LANES`] samples of these pixels.
    fn start_samples(&mut self, starting: &[([u32; 2], Random)], randoms: &ManyRandoms<LANES>) {
        let (settings, wide) = (self.context.settings, self.context.scene.world.simd().wide());
        let (mut film, mut weights) = ([[0.0; LANES]; 2], [1.0; LANES]);
        let [x, y] = randoms.pairs(FILM, wide);
        for (i, (pixel, _)) in starting.iter().enumerate() {
            let (point, weight) = film_point(settings, self.filter, *pixel, Vec2::new(x[i], y[i]));
            (film[0][i], film[1][i], weights[i]) = (point.x, point.y, weight);
        }
        let begun = self.samples.len() as u32;
        let Self { paths, samples, view, .. } = self;
        self.randoms.extend(starting.iter().map(|(_, random)| *random));
        let sample = |mode, weight| Sample {
            mode,
            radiance: SampledSpectrum::ZERO,
            brought: SampledSpectrum::ZERO,
            alpha: 1.0,
            weight,
            rays: 0,
        };
        if paths.is_plain() && view.pinhole_rays(&film, wide, &mut self.camera_rays) {
            let rays = &self.camera_rays;
            paths.rays.extend((0..starting.len()).map(|i| rays.get(i).ray));
            let (first, _) = Carried::of(&path_of(&rays.get(0), ColorMode::Rgb, 0.0));
            let carried = |i| Carried { cone_spread: rays.get(i).spread, ..first };
            paths.carried.extend((0..starting.len()).map(carried));
            paths.samples.extend(begun..begun + starting.len() as u32);
            samples.extend(weights[..starting.len()].iter().map(|&weight| sample(ColorMode::Rgb, weight)));
            return;
        }
        for (i, (_, random)) in starting.iter().enumerate() {
            let point = DVec2::new(film[0][i], film[1][i]);
            let (ray, state) = camera_path(view, settings, self.context.scene.moves, random, point);
            samples.push(sample(state.mode, weights[i]));
            paths.push(ray, &state, begun + i as u32);
        }
    }
}
