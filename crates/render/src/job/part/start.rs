//! The start of paths: samples, their random numbers and camera rays.

use super::{PartRenderer, Sample, SampleFacts};
use crate::integrator::camera_path::{
    FILM, LENS, TIME, WAVELENGTH, camera_path, film_point, path_of,
};
use crate::integrator::carried::{Carried, Rest};
use crate::lanes::LANES;
use crate::sampler::{BatchRandoms, SampleKey};
use snell_math::simd::Wide;
use snell_math::{
    ColorMode, ColorModel, DVec2, SampledSpectrum, SampledWavelengths, Vec2, at_level,
};

impl PartRenderer<'_> {
    pub(super) fn start(&mut self, positions: &[[u32; 2]], range: [u32; 2]) {
        self.paths.clear();
        self.samples.clear();
        self.facts.clear();
        self.keys.clear();
        self.aovs.clear();
        self.covering.clear();
        if let Some(recorder) = &mut self.recorder {
            recorder.start(positions.len() * (range[1] - range[0]) as usize);
        }
        let sampler = self.sampler;
        let mut pixels = Vec::with_capacity(positions.len() * (range[1] - range[0]) as usize);
        for &pixel in positions {
            self.keys.extend(sampler.keys(pixel, range[0]..range[1]));
            pixels.resize(self.keys.len(), pixel);
        }
        let keys = std::mem::take(&mut self.keys);
        for (pixels, keys) in pixels.chunks(LANES).zip(keys.chunks(LANES)) {
            self.start_samples(pixels, keys);
        }
        self.keys = keys;
    }

    /// Starts at most [`LANES`] samples, given their pixels and the keys of their random numbers.
    fn start_samples(&mut self, pixels: &[[u32; 2]], keys: &[SampleKey]) {
        let (settings, wide) = (self.context.settings, self.context.scene.world.simd().wide());
        let (mut film, mut weights) = ([[0.0; LANES]; 2], [1.0; LANES]);
        let mut randoms = BatchRandoms::<LANES>::of_camera(self.sampler);
        keys.iter().enumerate().for_each(|(i, &key)| randoms.set(i, key));
        let [x, y] = randoms.pairs(FILM, wide);
        for (i, pixel) in pixels.iter().enumerate() {
            let (point, weight) = film_point(settings, self.filter, *pixel, Vec2::new(x[i], y[i]));
            (film[0][i], film[1][i], weights[i]) = (point.x, point.y, weight);
        }
        let first_sample = self.samples.len() as u32;
        let nothing = Sample { radiance: SampledSpectrum::ZERO, brought: SampledSpectrum::ZERO };
        self.samples.resize(self.samples.len() + keys.len(), nothing);
        let Self { paths, facts, view, .. } = self;
        let known = |mode, weight| SampleFacts { mode, alpha: 1.0, weight, rays: 0 };
        let has_lens = self.stands_still && view.camera().has_lens();
        let lens = if has_lens { randoms.pairs(LENS, wide) } else { [[0.5; LANES]; 2] };
        if self.stands_still && view.many_rays(&film, &lens, wide, &mut self.camera_rays) {
            let rays = &self.camera_rays;
            let modes = modes_of(settings.color, &randoms, wide);
            let times =
                if self.context.scene.moves { randoms.numbers(TIME, wide) } else { [0.0; LANES] };
            paths.rays.extend((0..keys.len()).map(|i| rays.get(i).ray));
            let (first, rest) = Carried::of(&path_of(&rays.get(0), modes[0], 0.0));
            let rests: [Rest; LANES] =
                std::array::from_fn(|i| Rest { mode: modes[i], time: times[i], ..rest });
            paths.extend_rest(rests[..keys.len()].iter().copied());
            let carried = |i| Carried { cone_spread: rays.get(i).spread, ..first };
            paths.carried.extend((0..keys.len()).map(carried));
            paths.samples.extend(first_sample..first_sample + keys.len() as u32);
            facts.extend(
                modes
                    .iter()
                    .zip(&weights[..keys.len()])
                    .map(|(&mode, &weight)| known(mode, weight)),
            );
            return;
        }
        for (i, &key) in keys.iter().enumerate() {
            let point = DVec2::new(film[0][i], film[1][i]);
            let (ray, state) = camera_path(
                view,
                settings,
                self.context.scene.moves,
                &self.sampler.numbers_of(key),
                point,
            );
            facts.push(known(state.mode, weights[i]));
            paths.push(ray, &state, first_sample + i as u32);
        }
    }
}

/// What the lanes of the samples' spectra stand for: colour channels or wavelengths.
fn modes_of(
    color: ColorModel,
    randoms: &BatchRandoms<LANES>,
    wide: Option<Wide>,
) -> [ColorMode; LANES] {
    let mut modes = [ColorMode::Rgb; LANES];
    if color == ColorModel::Spectral {
        let u = randoms.numbers(WAVELENGTH, wide);
        at_level!(
            wide,
            draw_wavelengths,
            (u: &[f32; LANES] = &u, to: &mut [ColorMode; LANES] = &mut modes)
        );
    }
    modes
}

#[inline(always)]
fn draw_wavelengths(u: &[f32; LANES], to: &mut [ColorMode; LANES]) {
    for (to, &u) in to.iter_mut().zip(u) {
        *to = ColorMode::Spectral(SampledWavelengths::sample(u));
    }
}
