//! What `path` and `direct` do where media scatter, at many vertices at once: the same as
//! [`super::scattering`], bit for bit, in loops that become vector code.
//!
//! As with [`super::matte`], which vertices come here depends on the scene and the settings alone,
//! and no lane looks at another.

use super::estimators::Arrival;
use super::guided::unknown_survival;
use super::lanes::{
    Arriving, CarriedColumns, CarriedLanes, Columns, ENDLESS, HitColors, LANES, LitColumns,
    RayColumns, Roulette, VertexLanes, ZERO, at, at_level_by_color, color_at, put,
};
use super::lights::{LightArrivals, LightSamples, MediumPoints};
use super::lit::{LitLanes, LitOutputs};
use super::path::weighted_sample;
use super::{Context, IntegratorKind, MediumVertex, dimension};
use crate::light_sampler::Receivers;
use crate::sampler::Sampler;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::max;
use snell_math::{ColorModel, SampledSpectrum, Vec2, Vec3, at_level};
use snell_scene::medium::HenyeyGreenstein;

/// Vertices being worked on. Arrays are by lane; those of lanes that are not in use hold anything.
#[derive(Debug)]
pub struct ScatteredVertices {
    lanes: VertexLanes,
    color: ColorModel,
    phase: [HenyeyGreenstein; LANES],
    lit: LitLanes,
    bounces: Bounces,
}

/// Next directions, and their densities.
#[derive(Debug)]
struct Bounces {
    wi: HitVectors,
    pdf: HitLanes,
}

impl ScatteredVertices {
    /// `None` if vertices in media are to be worked on one by one.
    pub fn new(context: &Context, sampler: &Sampler) -> Option<Self> {
        let (scene, settings) = (context.scene, context.settings);
        let is_for = matches!(settings.integrator, IntegratorKind::Path | IntegratorKind::Direct)
            && scene.volumes.is_some();
        let wide = scene.world.simd().wide().filter(|_| is_for)?;
        Some(Self {
            lanes: VertexLanes::new(sampler, Some(wide)),
            color: settings.color,
            phase: [HenyeyGreenstein::new(0.0); LANES],
            lit: LitLanes { lights: LightSamples::new(settings.color), ..LitLanes::default() },
            bounces: Bounces { wi: ZERO, pdf: [0.0; LANES] },
        })
    }

    /// Puts vertices of this depth into the lanes: those of the paths with these numbers, at most
    /// [`LANES`], of which the dead are left out. `scattered` says of a path where that was.
    pub fn gather(
        &mut self,
        sampler: &Sampler,
        from: &Arriving,
        scattered: &[Option<MediumVertex>],
        paths: &[u32],
        depth: u32,
    ) {
        self.lanes.start(sampler, from, paths, depth);
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

    /// Works out what the lanes give.
    pub fn shade(&mut self, context: &Context, depth: u32) {
        let (wide, count) = (self.lanes.wide, self.lanes.paths().len());
        let bounce = self.lanes.randoms.pairs(dimension::BSDF, wide);
        let roulette = self.lanes.roulette(context, depth);
        // Media receive light from everywhere.
        let receivers = Receivers::opaque(&self.lanes.points.position, &ZERO);
        self.lit.lights.choose(context, &receivers, &self.lanes.randoms, count, wide);
        let light = self.lit.lights.numbers(&self.lanes.randoms, count, wide);
        self.lit.glowing = [None; LANES];
        let points = MediumPoints {
            position: &self.lanes.points.position,
            wo: &self.lanes.wo,
            phase: &self.phase,
        };
        let to = (&points, &self.lanes.modes);
        self.lit.lights.arrivals(context.scene, to, &light, count, wide, &mut self.lit.arrivals);
        self.lit.lights.shine(context.scene, &self.lit.arrivals, &self.lanes.modes, count);
        let Self { lanes, phase, lit, .. } = self;
        let LitLanes { lights, arrivals, outputs: given, .. } = lit;
        at_level_by_color!(
            wide,
            self.color,
            give,
            (
                carried: &CarriedLanes = &lanes.carried,
                radiance: &HitColors = &lights.radiance,
                arrivals: &LightArrivals = arrivals,
                roulette: &Roulette = &roulette,
                to: &mut LitOutputs = given,
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
        lit.sample_alone(count, &light, |lane, chosen, u| {
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

impl Columns for ScatteredVertices {
    fn vertices(&self) -> &VertexLanes {
        &self.lanes
    }

    fn goes_on(&self) -> &[u32; LANES] {
        &self.lit.outputs.goes_on
    }

    fn next_rays(&self) -> RayColumns<'_> {
        RayColumns {
            origin: &self.lanes.points.position,
            direction: &self.bounces.wi,
            end: &ENDLESS,
        }
    }

    fn carried(&self) -> CarriedColumns<'_> {
        self.lit.carried(&self.lanes, &self.lanes.carried.eta_scale, &self.bounces.pdf, &ZERO)
    }
}

impl LitColumns for ScatteredVertices {
    fn light(&self) -> &LitLanes {
        &self.lit
    }
}

/// What vertices give, but for lights that are sampled alone.
#[inline(always)]
fn give<const CHANNELS: usize>(
    carried: &CarriedLanes,
    radiance: &HitColors,
    arrivals: &LightArrivals,
    roulette: &Roulette,
    to: &mut LitOutputs,
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

/// Where paths go on.
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
    use super::super::twins::{assert_alike_at_every_level, every_second_node};
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
                assert_alike_at_every_level(&scene, &Moving::default(), &settings);
                if sampler == SamplerKind::Independent {
                    assert_alike_at_every_level(&scene, &every_second_node(&scene), &settings);
                }
            }
        }
    }
}
