//! Batches of vertices of `path` and `direct` on Lambertian surfaces ([`crate::integrator::path`]),
//! which are the most common ones in many scenes.

use super::guided::{Directions, GuidedLanes};
use super::matte_surfaces::{MatteSurfaces, MatteVertices};
use crate::batch::direct_light::{DirectLight, VertexOutputs};
use crate::batch::lights::{LightArrivals, LightSamples, Surfaces, horizon};
use crate::batch::vertices::{CarriedLanes, RayColumns, Roulette};
use crate::batch::{Batch, BatchShader, Shaded};
use crate::guiding::Choice;
use crate::integrator::carried::{Expected, Rest};
use crate::integrator::light_part::{LightSource, LobeShares};
use crate::integrator::light_sample::weighted_sample;
use crate::integrator::{Context, Outputs, dimension};
use crate::lanes::{BLACK, ENDLESS, HitColors, LANES, ZERO, at, at_level_by_color, color_at};
use crate::light_sampler::Receivers;
use crate::sampler::Sampler;
use snell_intersect::TrianglePoints;
use snell_intersect::smooth::lifted_ray_origin;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::{ColorModel, Frame, Vec2, Vec3, at_level, sampling};
use snell_scene::material::visible_normal;
use std::f32::consts::FRAC_1_PI;
use std::rc::Rc;

/// Shades vertices on matte surfaces.
#[derive(Debug)]
pub struct MatteShader<'a> {
    vertices: MatteVertices<'a>,
    color: ColorModel,
    /// Shading normals.
    normal: HitVectors,
    /// Shading normals on the side of the paths.
    facing: HitVectors,
    bounces: Bounces,
    /// The data of the guiding field, if the render has one.
    guided: Box<GuidedLanes>,
    direct: DirectLight,
}

/// The next rays of paths, by lane.
#[derive(Debug)]
struct Bounces {
    wi: HitVectors,
    origin: HitVectors,
    pdf: HitLanes,
    /// By channel, the factor on the throughput.
    weight: HitColors,
    /// 1 where there is a next ray, 0 where the path ends.
    exists: [u32; LANES],
}

impl<'a> MatteShader<'a> {
    /// Makes the shader for these surfaces; `None` if there are none, or unless the integrator is
    /// `path` or `direct`.
    pub fn new(
        context: &Context,
        sampler: &Sampler,
        surfaces: Option<&Rc<MatteSurfaces<'a>>>,
    ) -> Option<Self> {
        let settings = context.settings;
        let surfaces = surfaces.filter(|_| settings.integrator.is_path())?;
        let wide = context.scene.world.simd().wide()?;
        Some(Self {
            vertices: MatteVertices::new(surfaces, sampler, wide),
            color: settings.color,
            normal: ZERO,
            facing: ZERO,
            bounces: Bounces {
                wi: ZERO,
                origin: ZERO,
                pdf: [0.0; LANES],
                weight: BLACK,
                exists: [0; LANES],
            },
            guided: Box::default(),
            direct: DirectLight {
                lights: LightSamples::new(settings.color),
                ..DirectLight::default()
            },
        })
    }

    /// Computes the outputs of the lanes.
    fn shade_lanes(&mut self, context: &Context, depth: u32) {
        self.vertices.place(context);
        let vertices = &self.vertices;
        let MatteVertices { lanes, reflectance, .. } = vertices;
        let wide = lanes.wide;
        let bsdf = lanes.randoms.pairs(dimension::BSDF, wide);
        let roulette = lanes.roulette(context, depth);
        at_level!(
            lanes.wide,
            bounce,
            (
                points: &TrianglePoints = &lanes.points,
                sides: (&HitVectors, &HitVectors) = (&lanes.wo, &lanes.lift),
                reflectance: &HitColors = reflectance,
                u: &[HitLanes; 2] = &bsdf,
                normals: [&mut HitVectors; 2] = [&mut self.normal, &mut self.facing],
                to: &mut Bounces = &mut self.bounces,
            )
        );
        let receivers = Receivers::opaque(&lanes.points.position, &self.facing);
        let count = lanes.paths().len();
        self.direct.lights.choose(context, &receivers, &lanes.randoms, count, wide);
        let light = self.direct.lights.numbers(&lanes.randoms, count, wide);
        self.direct.glowing = [None; LANES];
        let surfaces = Surfaces {
            points: &lanes.points,
            normal: &self.normal,
            wo: &lanes.wo,
            lift: &lanes.lift,
        };
        let to = (&surfaces, &lanes.modes);
        self.direct.lights.arrivals(
            context.scene,
            to,
            &light,
            count,
            wide,
            &mut self.direct.arrivals,
        );
        self.direct.lights.shine(context.scene, &self.direct.arrivals, &lanes.modes, count);
        if let Some(field) = context.field {
            self.guided.find(field, &receivers, count, wide);
            let numbers = |dimension| lanes.randoms.numbers(dimension, wide);
            let (choice, quad) = (numbers(dimension::LOBE), numbers(dimension::GUIDE));
            let Bounces { wi, origin, pdf, weight, exists } = &mut self.bounces;
            let mut directions = Directions { wi, origin, pdf, exists, weight };
            self.guided.mix(field, &surfaces, (&choice, &quad, &bsdf), &mut directions, wide);
            self.guided.weigh_lights(field, &mut self.direct.arrivals, wide);
            self.guided.play(&lanes.carried, reflectance, wide);
        }
        let Self { normal, bounces, guided, direct, .. } = self;
        let known = Known {
            carried: &lanes.carried,
            reflectance,
            radiance: &direct.lights.radiance,
            arrivals: &direct.arrivals,
            bounces,
            guided: context.field.map(|_| &**guided),
            roulette: &roulette,
        };
        at_level_by_color!(
            wide,
            self.color,
            give,
            (known: &Known<'_> = &known, to: &mut VertexOutputs = &mut direct.outputs)
        );
        direct.sample_alone(count, &light, |lane, chosen, u| {
            let seen = vertices.seen(normal, lane);
            let throughput = color_at(&lanes.carried.throughput, lane);
            weighted_sample(context, throughput, &seen.arrival, chosen, u, |wi| {
                let (value, pdf) = seen.reflected(wi);
                (
                    value,
                    guided.mixed_pdf(
                        context.field,
                        lane,
                        at(&lanes.points.position, lane),
                        wi,
                        pdf,
                    ),
                )
            })
        });
    }

    /// The source of the light ray of a lane and its MIS weight; `None` if the lane has no light
    /// ray.
    fn light_source(&self, lane: usize) -> Option<(LightSource, f32)> {
        (self.direct.outputs.has_light_ray[lane] != 0)
            .then(|| (self.direct.lights.source[lane], self.direct.arrivals.weight[lane]))
    }

    /// The value of [`Outputs::choice`] for a lane whose path continues.
    fn choice(&self, context: &Context, depth: u32, lane: usize) -> Option<Choice> {
        let field = context.field.filter(|field| field.is_learning())?;
        let (direction, pdf) = (at(&self.bounces.wi, lane), self.bounces.pdf[lane]);
        let bsdf_share = match self.guided.known(lane) {
            Some(known) => {
                let seen = self.vertices.seen(&self.normal, lane);
                field.brief(known).bsdf_share * seen.reflected(direction).1 / pdf
            }
            None => 1.0,
        };
        let survival =
            context.roulette(depth).map_or(1.0, |most| self.guided.survival[lane].min(most));
        let position = at(&self.vertices.lanes.points.position, lane);
        let normal = at(&self.facing, lane);
        Some(Choice { position, normal, direction, pdf: pdf * survival, bsdf_share })
    }
}

impl<'a> BatchShader<'a> for MatteShader<'a> {
    fn accepts(&self, batch: &Batch<'_, 'a>, paths: &[u32]) -> usize {
        self.vertices.accepts(batch, paths)
    }

    fn shade(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]) {
        // Matte surfaces do not emit light, so the last vertex of a path adds nothing.
        if batch.is_last() {
            return self.vertices.lanes.clear();
        }
        self.vertices.gather(batch, paths);
        self.shade_lanes(batch.context, batch.depth);
    }

    fn shaded(&self) -> Shaded<'_> {
        let Self { vertices: MatteVertices { lanes, .. }, bounces, facing, direct, .. } = self;
        Shaded {
            shadow_rays: &[],
            found: &[],
            paths: lanes.paths(),
            is_sound: &lanes.points.is_sound,
            light: Some(direct),
            goes_on: &direct.outputs.goes_on,
            next_rays: RayColumns {
                origin: &bounces.origin,
                direction: &bounces.wi,
                end: &ENDLESS,
            },
            carried: direct.carried(lanes, &lanes.carried.eta_scale, &bounces.pdf, facing),
        }
    }

    fn is_lane_by_lane(&self, batch: &Batch<'_, 'a>) -> bool {
        batch.is_watched
    }

    fn outputs(&self, batch: &Batch<'_, 'a>, lane: usize, out: &mut Outputs) {
        let shaded = self.shaded();
        let rest = batch.paths.rest(shaded.paths[lane] as usize);
        let lobe = if batch.wants_lobes() { self.lobe(lane) } else { rest.lobe };
        if let Some((source, weight)) = self.light_source(lane) {
            out.weights.light = weight;
            (out.light_source, out.light_lobe) = (Some(source), lobe);
            out.light_rays.push((self.direct.light_rays().at(lane), self.direct.brought(lane)));
        }
        if shaded.goes_on[lane] != 0 {
            let state = shaded.carried.at(lane).with(&Rest { lobe, ..*rest });
            out.next.push((shaded.next_rays.at(lane), state));
            out.choice = self.choice(batch.context, batch.depth, lane);
        }
    }

    fn lobe(&self, lane: usize) -> LobeShares {
        LobeShares::of_matte(color_at(&self.vertices.reflectance, lane))
    }

    /// A light ray can cross a matte surface by rounding only.
    fn may_cross(&self, lane: usize) -> [bool; 2] {
        let lanes = &self.vertices.lanes;
        let normal = at(&lanes.points.geometric_normal, lane);
        let light = self.direct.light_rays().at(lane).direction;
        [light.dot(normal) * -at(&lanes.wo, lane).dot(normal) > 0.0, false]
    }
}

/// The inputs of [`give`].
struct Known<'a> {
    carried: &'a CarriedLanes,
    reflectance: &'a HitColors,
    radiance: &'a HitColors,
    arrivals: &'a LightArrivals,
    bounces: &'a Bounces,
    /// The guiding data, if the render has a guiding field.
    guided: Option<&'a GuidedLanes>,
    roulette: &'a Roulette,
}

/// Computes the outputs of the vertices, except for lights that are sampled one by one.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
fn give<const CHANNELS: usize>(known: &Known, to: &mut VertexOutputs) {
    let Known { carried, reflectance, radiance, arrivals, bounces, guided, roulette } = *known;
    let survival = guided.map(|guided| &guided.survival);
    for i in 0..LANES {
        let cosine = arrivals.share[i];
        let scattered = std::array::from_fn(|channel| reflectance[channel][i] * cosine);
        let weight: [f32; CHANNELS] = std::array::from_fn(|channel| bounces.weight[channel][i]);
        to.bring::<CHANNELS>(i, carried, scattered, radiance, arrivals);
        to.go_on(
            i,
            carried,
            (weight, &carried.eta_scale),
            survival,
            roulette,
            bounces.exists[i] != 0,
        );
        let expected =
            guided.map_or(Expected::default(), |guided| Expected::of(guided.expected[i]));
        to.mark(i, carried, expected, false, false);
    }
}

/// Computes the normals on the side of the paths and cosine-distributed directions.
#[inline(always)]
fn bounce(
    points: &TrianglePoints,
    (wo, lift): (&HitVectors, &HitVectors),
    reflectance: &HitColors,
    u: &[HitLanes; 2],
    normals: [&mut HitVectors; 2],
    to: &mut Bounces,
) {
    let [normal, facing] = normals;
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let (wo, lift, flat) = (vector(wo), vector(lift), vector(&points.geometric_normal));
        let n = visible_normal(vector(&points.shading_normal), flat, wo);
        let horizon = horizon(flat, n, lift);
        let frame = Frame::from_z(n);
        let up = sampling::cosine_hemisphere(Vec2::new(u[0][i], u[1][i]));
        let pdf = up.z * FRAC_1_PI;
        let cos_o = n.dot(wo);
        // One factor serves both uses: two equal conditions would become two branches with masked
        // stores, which take twenty cycles on some processors.
        let side = if cos_o < 0.0 { -1.0 } else { 1.0 };
        let local = Vec3::new(up.x, up.y, side * up.z);
        let direction = frame.from_local(local);
        let scale = 1.0 / direction.length();
        let wi = direction * scale;
        let is_seen = horizon.dot(wo) * horizon.dot(wi) > 0.0;
        let exists =
            is_seen & (pdf > 0.0) & (cos_o != 0.0) & (scale > 0.0) & (scale < f32::INFINITY);
        let origin = lifted_ray_origin(
            vector(&points.position),
            vector(&points.position_error),
            flat,
            lift,
            wi,
        );
        for axis in 0..3 {
            normal[axis][i] = n[axis];
            facing[axis][i] = side * n[axis];
            to.wi[axis][i] = wi[axis];
            to.origin[axis][i] = origin[axis];
        }
        for (to, reflectance) in to.weight.iter_mut().zip(reflectance) {
            to[i] = reflectance[i];
        }
        to.pdf[i] = pdf;
        to.exists[i] = u32::from(exists);
    }
}

#[cfg(test)]
mod tests {
    use crate::batch::twins::{assert_same_at_every_level, every_second_node};
    use crate::compile::Moving;
    use crate::sampler::SamplerKind;
    use crate::settings::Shadows;
    use crate::{Guiding, IntegratorKind, Settings};
    use snell_math::{ColorModel, Rgb};
    use snell_scene::builtin::builtin;
    use snell_scene::material::Diffuse;

    #[test]
    fn many_vertices_at_once_give_the_bits_of_one_at_a_time() {
        let guiding = Guiding { passes: 2, photons: 1 << 13 };
        for name in ["cornell-box", "teapot", "spheres", "caustic", "night-town", "fog", "smoke"] {
            let mut scene = builtin(name).expect("the scene is built in");
            for (i, material) in
                scene.materials.iter_mut().enumerate().filter(|(_, m)| !m.is_emissive())
            {
                material.kind = Diffuse::new(Rgb::new(0.9, 0.6, 0.1 * (i % 8) as f32)).into();
            }
            let kinds = [
                (IntegratorKind::Path, SamplerKind::ZSobol, Shadows::Hard, None, ColorModel::Rgb),
                (
                    IntegratorKind::Path,
                    SamplerKind::Independent,
                    Shadows::Hard,
                    None,
                    ColorModel::Rgb,
                ),
                (
                    IntegratorKind::Path,
                    SamplerKind::ZSobol,
                    Shadows::Hard,
                    Some(guiding),
                    ColorModel::Rgb,
                ),
                (
                    IntegratorKind::Raycast,
                    SamplerKind::ZSobol,
                    Shadows::Hard,
                    None,
                    ColorModel::Rgb,
                ),
                (
                    IntegratorKind::Whitted,
                    SamplerKind::ZSobol,
                    Shadows::Soft,
                    None,
                    ColorModel::Rgb,
                ),
                (
                    IntegratorKind::Path,
                    SamplerKind::ZSobol,
                    Shadows::Hard,
                    None,
                    ColorModel::Spectral,
                ),
                (
                    IntegratorKind::Path,
                    SamplerKind::ZSobol,
                    Shadows::Hard,
                    Some(guiding),
                    ColorModel::Spectral,
                ),
                (
                    IntegratorKind::Whitted,
                    SamplerKind::ZSobol,
                    Shadows::Soft,
                    None,
                    ColorModel::Spectral,
                ),
            ];
            for (integrator, sampler, shadows, guiding, color) in kinds {
                let (max_depth, fill) = (9, Rgb::new(0.1, 0.2, 0.3));
                let how = Settings {
                    max_depth,
                    sampler,
                    integrator,
                    shadows,
                    fill,
                    color,
                    ..Settings::default()
                };
                let settings = Settings { size: [36, 24], spp: 4, guiding, ..how };
                assert_same_at_every_level(&scene, &Moving::default(), &settings);
                if sampler == SamplerKind::Independent || integrator == IntegratorKind::Whitted {
                    assert_same_at_every_level(&scene, &every_second_node(&scene), &settings);
                }
            }
        }
    }
}
