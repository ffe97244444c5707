//! Batches of the vertices of `path` and `direct` at which media scatter
//! ([`crate::integrator::scattering`]).

use super::direct_light::{DirectLight, VertexOutputs};
use super::lights::{LightArrivals, LightSamples, MediumPoints};
use super::vertices::{CarriedLanes, RayColumns, Roulette, VertexLanes};
use super::{Batch, BatchShader, Shaded};
use crate::integrator::estimators::Arrival;
use crate::integrator::light_part::LobeShares;
use crate::integrator::light_sample::weighted_sample;
use crate::integrator::roulette::unknown_survival;
use crate::integrator::{Context, MediumVertex, dimension};
use crate::lanes::{ENDLESS, HitColors, LANES, ZERO, at, at_level_by_color, color_at, put};
use crate::light_sampler::Receivers;
use crate::sampler::Sampler;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::max;
use snell_math::{ColorModel, SampledSpectrum, Vec2, Vec3, at_level};
use snell_scene::medium::HenyeyGreenstein;

/// Shades vertices at which media scatter.
#[derive(Debug)]
pub struct MediumShader {
    lanes: VertexLanes,
    color: ColorModel,
    phase: [HenyeyGreenstein; LANES],
    direct: DirectLight,
    bounces: Bounces,
}

/// The next directions of paths.
#[derive(Debug)]
struct Bounces {
    wi: HitVectors,
    /// Density per steradian of each direction.
    pdf: HitLanes,
}

impl MediumShader {
    /// Makes the shader; `None` if the scene has no media, or the integrator does not support them.
    pub fn new(context: &Context, sampler: &Sampler) -> Option<Self> {
        let (scene, settings) = (context.scene, context.settings);
        let is_for = settings.integrator.is_path() && scene.volumes.is_some();
        let wide = scene.world.simd().wide().filter(|_| is_for)?;
        Some(Self {
            lanes: VertexLanes::new(sampler, Some(wide)),
            color: settings.color,
            phase: [HenyeyGreenstein::new(0.0); LANES],
            direct: DirectLight {
                lights: LightSamples::new(settings.color),
                ..DirectLight::default()
            },
            bounces: Bounces { wi: ZERO, pdf: [0.0; LANES] },
        })
    }

    /// Puts the vertices of these paths into the lanes.
    fn gather(&mut self, batch: &Batch, scattered: &[Option<MediumVertex>], paths: &[u32]) {
        self.lanes.start(batch, paths);
        for lane in 0..self.lanes.paths().len() {
            let path = self.lanes.paths()[lane] as usize;
            let Some(MediumVertex { position, phase, footprint }) = scattered[path] else {
                continue;
            };
            put(&mut self.lanes.points.position, lane, position);
            self.phase[lane] = phase;
            self.lanes.carried.cone_width[lane] = footprint;
        }
    }

    /// Computes the outputs of the lanes.
    fn shade_lanes(&mut self, context: &Context, depth: u32) {
        let (wide, count) = (self.lanes.wide, self.lanes.paths().len());
        let bounce = self.lanes.randoms.pairs(dimension::BSDF, wide);
        let roulette = self.lanes.roulette(context, depth);
        // Points in media receive light from everywhere, so no normal is needed.
        let receivers = Receivers::opaque(&self.lanes.points.position, &ZERO);
        self.direct.lights.choose(context, &receivers, &self.lanes.randoms, count, wide);
        let light = self.direct.lights.numbers(&self.lanes.randoms, count, wide);
        self.direct.glowing = [None; LANES];
        let points = MediumPoints {
            position: &self.lanes.points.position,
            wo: &self.lanes.wo,
            phase: &self.phase,
        };
        let to = (&points, &self.lanes.modes);
        self.direct.lights.arrivals(
            context.scene,
            to,
            &light,
            count,
            wide,
            &mut self.direct.arrivals,
        );
        self.direct.lights.shine(context.scene, &self.direct.arrivals, &self.lanes.modes, count);
        let Self { lanes, phase, direct, .. } = self;
        let DirectLight { lights, arrivals, outputs: given, .. } = direct;
        at_level_by_color!(
            wide,
            self.color,
            give,
            (
                carried: &CarriedLanes = &lanes.carried,
                radiance: &HitColors = &lights.radiance,
                arrivals: &LightArrivals = arrivals,
                roulette: &Roulette = &roulette,
                to: &mut VertexOutputs = given,
            )
        );
        at_level!(
            wide,
            bounce_off,
            (
                wo: &HitVectors = &lanes.wo,
                phase: &[HenyeyGreenstein; LANES] = phase,
                u: &[HitLanes; 2] = &bounce,
                bounces: &mut Bounces = &mut self.bounces,
            )
        );
        direct.sample_alone(count, &light, |lane, chosen, u| {
            let position = at(&lanes.points.position, lane);
            let arrival = Arrival {
                position,
                surface: None,
                mode: lanes.modes[lane],
                time: lanes.times[lane],
            };
            let throughput = color_at(&lanes.carried.throughput, lane);
            let (phase, forward) = (phase[lane], -at(&lanes.wo, lane));
            let scattered = |wi| {
                let pdf = phase.pdf(forward, wi);
                (SampledSpectrum::splat(pdf), pdf)
            };
            weighted_sample(context, throughput, &arrival, chosen, u, scattered)
        });
    }
}

impl<'a> BatchShader<'a> for MediumShader {
    fn accepts(&self, batch: &Batch<'_, 'a>, paths: &[u32]) -> usize {
        let Some(media) = batch.media.as_ref().filter(|_| batch.is_simple()) else { return 0 };
        let is_scattered = |path: &&u32| media.scattered[**path as usize].is_some();
        paths.iter().take(LANES).take_while(is_scattered).count()
    }

    fn shade(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]) {
        self.lanes.clear();
        if let Some(media) = batch.media.as_ref().filter(|_| !batch.is_last()) {
            self.gather(batch, media.scattered, paths);
            self.shade_lanes(batch.context, batch.depth);
        }
    }

    fn shaded(&self) -> Shaded<'_> {
        let Self { lanes, direct, bounces, .. } = self;
        Shaded {
            paths: lanes.paths(),
            light: Some(direct),
            goes_on: &direct.outputs.goes_on,
            next_rays: RayColumns {
                origin: &lanes.points.position,
                direction: &bounces.wi,
                end: &ENDLESS,
            },
            carried: direct.carried(lanes, &lanes.carried.eta_scale, &bounces.pdf, &ZERO),
            ..Shaded::NONE
        }
    }

    fn lobe(&self, _lane: usize) -> LobeShares {
        LobeShares::VOLUME
    }

    fn may_cross(&self, _lane: usize) -> [bool; 2] {
        [false, false]
    }
}

/// Computes the outputs of the vertices, except for lights that are sampled one by one.
#[inline(always)]
fn give<const CHANNELS: usize>(
    carried: &CarriedLanes,
    radiance: &HitColors,
    arrivals: &LightArrivals,
    roulette: &Roulette,
    to: &mut VertexOutputs,
) {
    for i in 0..LANES {
        to.bring(i, carried, [arrivals.share[i]; CHANNELS], radiance, arrivals);
        let mut largest = 0.0;
        for channel in 0..CHANNELS {
            largest = max(largest, carried.throughput[channel][i]);
        }
        let (scale, survives) =
            roulette.survival(i, unknown_survival(largest * carried.eta_scale[i]));
        for channel in 0..CHANNELS {
            to.throughput[channel][i] = carried.throughput[channel][i] * scale;
        }
        to.goes_on[i] = u32::from(survives);
        to.mark(i, carried, carried.marks[i].expected(), true, false);
    }
}

/// Computes the next rays of the paths.
#[inline(always)]
fn bounce_off(
    wo: &HitVectors,
    phase: &[HenyeyGreenstein; LANES],
    u: &[HitLanes; 2],
    bounces: &mut Bounces,
) {
    for i in 0..LANES {
        let forward = Vec3::new(-wo[0][i], -wo[1][i], -wo[2][i]);
        let (wi, pdf) = phase[i].sample(forward, Vec2::new(u[0][i], u[1][i]));
        for axis in 0..3 {
            bounces.wi[axis][i] = wi[axis];
        }
        bounces.pdf[i] = pdf;
    }
}

#[cfg(test)]
mod tests {
    use crate::batch::twins::{assert_same_at_every_level, every_second_node};
    use crate::compile::Moving;
    use crate::sampler::SamplerKind;
    use crate::{IntegratorKind, LightStrategy, Settings};
    use snell_math::{ColorModel, DVec3, Rgb};
    use snell_scene::builtin::builtin;
    use snell_scene::light::{Attenuation, Point};
    use snell_scene::medium::Homogeneous;

    #[test]
    fn many_vertices_at_once_give_the_bits_of_one_at_a_time() {
        for (name, lamps) in
            [("cornell-box", 0), ("cornell-box", 3), ("night-town", 0), ("fog", 0), ("smoke", 0)]
        {
            let mut scene = builtin(name).expect("the scene is built in");
            if name != "fog" {
                let size = if name == "cornell-box" { 500.0 } else { 20.0 };
                let colors = (Rgb::new(0.5, 0.7, 1.0) * (1.0 / size), Rgb::new(0.9, 0.8, 1.0));
                scene.medium =
                    Some(scene.add_medium(Homogeneous::scattering(colors.0, colors.1, 0.4)));
            }
            for i in 0..lamps {
                let position = DVec3::new(100.0 * f64::from(i), 200.0, 100.0);
                let (intensity, attenuation) = (Rgb::splat(1e4), Attenuation::NONE);
                scene.add_light(Point { position, intensity, attenuation, body_radius: 0.0 });
            }
            let ways = [
                (IntegratorKind::Path, SamplerKind::ZSobol, LightStrategy::Mis, ColorModel::Rgb),
                (
                    IntegratorKind::Path,
                    SamplerKind::Independent,
                    LightStrategy::Mis,
                    ColorModel::Rgb,
                ),
                (
                    IntegratorKind::Path,
                    SamplerKind::Independent,
                    LightStrategy::Bsdf,
                    ColorModel::Rgb,
                ),
                (
                    IntegratorKind::Direct,
                    SamplerKind::Stratified,
                    LightStrategy::Mis,
                    ColorModel::Rgb,
                ),
                (
                    IntegratorKind::Path,
                    SamplerKind::ZSobol,
                    LightStrategy::Mis,
                    ColorModel::Spectral,
                ),
            ];
            for (integrator, sampler, light_strategy, color) in ways {
                let how = Settings {
                    max_depth: 9,
                    sampler,
                    integrator,
                    light_strategy,
                    ..Settings::default()
                };
                let settings = Settings { size: [36, 24], spp: 4, color, ..how };
                assert_same_at_every_level(&scene, &Moving::default(), &settings);
                if sampler == SamplerKind::Independent {
                    assert_same_at_every_level(&scene, &every_second_node(&scene), &settings);
                }
            }
        }
    }
}
