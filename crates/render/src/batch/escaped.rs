//! Paths of `path` and `direct` that leave the scene and find the environment's radiance.

use super::lights::sky::{NO_PLACES, places_of};
use super::{Batch, BatchShader, Shaded};
use crate::integrator::Context;
use crate::integrator::dimension::LIGHT;
use crate::integrator::path::{caught_shadow, escaped_to, plain_sky};
use crate::lanes::LANES;
use snell_math::spectrum::RgbSpectrum;
use snell_math::{ColorMode, ColorModel, Ray, SampledSpectrum, Vec2};
use snell_scene::light::environment::EnvironmentLight;

/// Shades paths that hit nothing.
pub struct EscapedShader {
    found: Vec<(u32, SampledSpectrum)>,
    shadow_rays: Vec<(u32, Ray, SampledSpectrum)>,
    /// The radiance of a constant environment in RGB mode.
    constant: Option<SampledSpectrum>,
    /// The spectrum of that radiance, in spectral mode.
    spectrum: Option<RgbSpectrum>,
}

impl EscapedShader {
    /// Makes the shader; `None` unless the integrator is `path` or `direct`.
    pub fn new(context: &Context) -> Option<Self> {
        let is_spectral = context.settings.color == ColorModel::Spectral;
        let color = context.scene.environment.as_deref().and_then(EnvironmentLight::constant);
        context.settings.integrator.is_path().then(|| Self {
            found: Vec::with_capacity(LANES),
            shadow_rays: Vec::new(),
            constant: color.map(|color| ColorMode::Rgb.rgb_illuminant(color)),
            spectrum: color.filter(|_| is_spectral).map(RgbSpectrum::of_light),
        })
    }
}

impl<'a> BatchShader<'a> for EscapedShader {
    fn accepts(&self, batch: &Batch<'_, 'a>, paths: &[u32]) -> usize {
        let may_catch_shadows = batch.depth == 0 && batch.context.scene.floor.is_some();
        if !batch.is_simple() || may_catch_shadows && batch.media.is_some() {
            return 0;
        }
        let has_left = |path: &&u32| {
            let path = **path as usize;
            !batch.paths.hits[path].is_hit()
                && batch.media.as_ref().is_none_or(|media| media.scattered[path].is_none())
        };
        paths.iter().take(LANES).take_while(has_left).count()
    }

    fn shade(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]) {
        self.found.clear();
        self.shadow_rays.clear();
        let (context, scene) = (batch.context, batch.context.scene);
        if scene.is_dark_outside() {
            return;
        }
        let may_catch_shadows = batch.depth == 0 && scene.floor.is_some();
        let plain = plain_sky(context, batch.depth);
        let constant = self.constant.filter(|_| plain.is_some() && batch.paths.is_plain());
        let spectrum = self.spectrum.as_ref().filter(|_| plain.is_some());
        let image = scene.environment.as_ref().filter(|sky| sky.constant().is_none());
        let places = image.map_or(NO_PLACES, |sky| {
            let directions = paths.iter().map(|&path| batch.paths.rays[path as usize].direction);
            places_of(sky, directions, scene.world.simd().wide())
        });
        for (lane, &number) in paths.iter().enumerate() {
            let path = number as usize;
            let place = Vec2::new(places[0][lane], places[1][lane]);
            let carried = &batch.paths.carried[path];
            let mode = || batch.paths.rest(path).mode;
            if may_catch_shadows {
                let (ray, u) = (&batch.paths.rays[path], || batch.random(path).pair(LIGHT));
                let caught = caught_shadow(context, 0, ray, carried.throughput, mode(), u);
                if let Some((received, light)) = caught {
                    let [part, certain] = received.parts(light);
                    self.found.push((number, certain));
                    let rays = received.uncertain().iter();
                    self.shadow_rays.extend(rays.map(|&ray| (number, ray, part)));
                    continue;
                }
            }
            let radiance = if carried.throughput.is_black() {
                continue;
            } else if let Some(radiance) = constant {
                carried.throughput * radiance
            } else if let (Some(spectrum), ColorMode::Spectral(wavelengths)) = (spectrum, mode()) {
                carried.throughput * ColorMode::light_at(&wavelengths, spectrum)
            } else if let Some(sky) = plain {
                carried.throughput * sky.radiance_at(place, mode())
            } else {
                let (ray, state) = (&batch.paths.rays[path], batch.paths.state(path));
                escaped_to(context, batch.depth, ray, &state, |_| place).0
            };
            self.found.push((number, radiance));
        }
    }

    fn shaded(&self) -> Shaded<'_> {
        Shaded { found: &self.found, shadow_rays: &self.shadow_rays, ..Shaded::NONE }
    }
}
