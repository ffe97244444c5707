//! What most integrators do at Lambertian surfaces, at many vertices at once: the same as
//! [`super::path`] and [`super::classic`], bit for bit, in loops that become vector code. Such
//! surfaces are most of many scenes, and cost little else.
//!
//! Which vertices come here depends on the scene and the settings alone, and no lane looks at
//! another, so that a path does not depend on what shares its batch.

use super::carried::Expected;
use super::estimators::{Arrival, may_be_lifted};
use super::guided_lanes::{Directions, GuidedLanes};
use super::lanes::{
    Arriving, BLACK, CarriedColumns, CarriedLanes, Columns, ENDLESS, HitColors, LANES, LitColumns,
    OtherPoint, RayColumns, Roulette, VertexLanes, ZERO, at, at_level_by_color, color_at,
    put_color,
};
use super::light_part::{LightSource, LobeShares};
use super::lights::{LightArrivals, LightSamples, Surfaces, horizon};
use super::lit::{LitLanes, LitOutputs};
use super::matte_surfaces::MatteSurfaces;
use super::path::weighted_sample;
use super::{Context, IntegratorKind, Outputs, PathState, classic, dimension};
use crate::guiding::Choice;
use crate::light_sampler::Receivers;
use crate::sampler::{Random, Sampler};
use snell_intersect::smooth::lifted_ray_origin;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_intersect::{Hit, TrianglePoints};
use snell_math::simd::Wide;
use snell_math::{ColorModel, Frame, Ray, SampledSpectrum, Vec2, Vec3, at_level, sampling};
use snell_scene::material::visible_normal;
use std::f32::consts::{FRAC_1_PI, PI};

/// Vertices being worked on. Arrays are by lane; those of lanes that are not in use hold anything.
#[derive(Debug)]
pub struct MatteVertices {
    lanes: VertexLanes,
    color: ColorModel,
    /// By channel.
    reflectance: HitColors,
    /// Shading normal, and the same on the side where the path comes from.
    normal: HitVectors,
    facing: HitVectors,
    bounces: Bounces,
    /// What a field knows, if there is one.
    guided: Box<GuidedLanes>,
    lit: LitLanes,
}

/// Where paths go on.
#[derive(Debug)]
struct Bounces {
    wi: HitVectors,
    origin: HitVectors,
    pdf: HitLanes,
    /// By channel, what the throughput is multiplied with.
    weight: HitColors,
    /// 0 where the path ends.
    exists: [u32; LANES],
}

/// A surface as the light sees it.
struct Seen {
    arrival: Arrival,
    normal: Vec3,
    horizon: Vec3,
    /// Cosines of where the path comes from with the normals.
    cos_o: f32,
    side: f32,
    reflectance: SampledSpectrum,
}

impl Seen {
    /// The surface of a lane that has this shading normal and reflectance.
    fn at(lanes: &VertexLanes, normal: &HitVectors, reflectance: &HitColors, lane: usize) -> Self {
        let (wo, normal, reflectance) =
            (at(&lanes.wo, lane), at(normal, lane), color_at(reflectance, lane));
        let (geometric_normal, lift) =
            (at(&lanes.points.geometric_normal, lane), at(&lanes.lift, lane));
        let horizon = horizon(geometric_normal, normal, lift);
        let arrival = lanes.arrival(lane);
        Self { arrival, normal, horizon, cos_o: normal.dot(wo), side: horizon.dot(wo), reflectance }
    }

    /// The BSDF times the cosine, and the density of sampling, of a direction.
    fn reflected(&self, wi: Vec3) -> (SampledSpectrum, f32) {
        let cos_i = self.normal.dot(wi);
        let is_seen = self.cos_o * cos_i > 0.0 && self.side * self.horizon.dot(wi) > 0.0;
        let pdf = if is_seen { cos_i.abs() * FRAC_1_PI } else { 0.0 };
        (self.reflectance * pdf, pdf)
    }
}

/// True for integrators of which vertices are shaded by [`MatteVertices::shade_classic`].
pub fn is_classic(integrator: IntegratorKind) -> bool {
    matches!(integrator, IntegratorKind::Raycast | IntegratorKind::Whitted)
}

impl MatteVertices {
    /// For vertices of one depth.
    pub fn new(color: ColorModel, sampler: &Sampler, wide: Option<Wide>) -> Self {
        Self {
            lanes: VertexLanes::new(sampler, wide),
            color,
            reflectance: BLACK,
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
            lit: LitLanes { lights: LightSamples::new(color), ..LitLanes::default() },
        }
    }

    /// Puts vertices of this depth on [`MatteSurfaces`] into the lanes: those of the paths with
    /// these numbers, at most [`LANES`], of which the dead are left out.
    pub fn gather(
        &mut self,
        context: &Context,
        sampler: &Sampler,
        surfaces: &MatteSurfaces,
        from: &Arriving,
        paths: &[u32],
        depth: u32,
    ) {
        self.lanes.start(sampler, from, paths, depth);
        for lane in 0..self.lanes.paths().len() {
            let path = self.lanes.paths()[lane] as usize;
            let (ray, hit) = (&from.rays[path], &from.hits[path]);
            match surfaces.plain(hit) {
                Some(surface) => {
                    put_color(
                        &mut self.reflectance,
                        lane,
                        surface.reflectance_in(self.lanes.modes[lane]),
                    );
                    self.lanes.put_triangle(lane);
                }
                None => self.gather_other(context, lane, ray, hit),
            }
        }
        self.lanes.gather_triangles(from, |hit| surfaces.plain(hit).map(|surface| &surface.mesh));
    }

    /// What is on no plain triangle.
    #[inline(never)]
    fn gather_other(&mut self, context: &Context, lane: usize, ray: &Ray, hit: &Hit) {
        let scene = context.scene;
        let material = scene.material(scene.material_id(hit));
        if let Some(rgb) = material.as_matte().and_then(|matte| matte.uniform())
            && !material.is_bent()
            && self.lanes.gather_shape(context, lane, ray, hit)
        {
            put_color(&mut self.reflectance, lane, self.lanes.modes[lane].reflectance(rgb));
            return;
        }
        let time = self.lanes.times[lane];
        let surface = scene.interaction(ray, time, hit);
        let point = scene.shading_point(
            &surface,
            self.lanes.carried.cone_width[lane],
            self.lanes.modes[lane],
        );
        let Some((reflectance, shading_normal)) = material.matte_at(&point) else { return };
        put_color(&mut self.reflectance, lane, reflectance);
        let lift = match may_be_lifted(context, material) {
            true => scene.lift(ray, time, &surface),
            false => Vec3::ZERO,
        };
        self.lanes.put_point(lane, OtherPoint::of(&surface, shading_normal, lift));
    }

    /// The points of all lanes.
    fn place(&mut self, context: &Context) {
        self.lanes.place();
        self.lanes.place_lifts(context);
    }

    /// Works out what the lanes give.
    pub fn shade(&mut self, context: &Context, depth: u32) {
        self.place(context);
        let wide = self.lanes.wide;
        let bsdf = self.lanes.randoms.pairs(dimension::BSDF, wide);
        let roulette = self.lanes.roulette(context, depth);
        at_level!(
            self.lanes.wide,
            bounce,
            (
                points: &TrianglePoints = &self.lanes.points,
                sides: (&HitVectors, &HitVectors) = (&self.lanes.wo, &self.lanes.lift),
                reflectance: &HitColors = &self.reflectance,
                u: &[HitLanes; 2] = &bsdf,
                normals: [&mut HitVectors; 2] = [&mut self.normal, &mut self.facing],
                to: &mut Bounces = &mut self.bounces,
            )
        );
        let receivers = Receivers::opaque(&self.lanes.points.position, &self.facing);
        let count = self.lanes.paths().len();
        self.lit.lights.choose(context, &receivers, &self.lanes.randoms, count, wide);
        let light = self.lit.lights.numbers(&self.lanes.randoms, count, wide);
        self.lit.glowing = [None; LANES];
        let surfaces = Surfaces {
            points: &self.lanes.points,
            normal: &self.normal,
            wo: &self.lanes.wo,
            lift: &self.lanes.lift,
        };
        let to = (&surfaces, &self.lanes.modes);
        self.lit.lights.arrivals(context.scene, to, &light, count, wide, &mut self.lit.arrivals);
        self.lit.lights.shine(context.scene, &self.lit.arrivals, &self.lanes.modes, count);
        if let Some(field) = context.field {
            self.guided.find(field, &receivers, count, wide);
            let numbers = |dimension| self.lanes.randoms.numbers(dimension, wide);
            let (choice, quad) = (numbers(dimension::LOBE), numbers(dimension::GUIDE));
            let Bounces { wi, origin, pdf, weight, exists } = &mut self.bounces;
            let mut directions = Directions { wi, origin, pdf, exists, weight };
            self.guided.mix(field, &surfaces, (&choice, &quad, &bsdf), &mut directions, wide);
            self.guided.weigh_lights(field, &mut self.lit.arrivals, wide);
            self.guided.play(&self.lanes.carried, &self.reflectance, wide);
        }
        let Self { lanes, normal, reflectance, bounces, guided, lit, .. } = self;
        let known = Known {
            carried: &lanes.carried,
            reflectance,
            radiance: &lit.lights.radiance,
            arrivals: &lit.arrivals,
            bounces,
            guided: context.field.map(|_| &**guided),
            roulette: &roulette,
        };
        at_level_by_color!(
            wide,
            self.color,
            give,
            (known: &Known<'_> = &known, to: &mut LitOutputs = &mut lit.outputs)
        );
        lit.sample_alone(count, &light, |lane, chosen, u| {
            let seen = Seen::at(lanes, normal, reflectance, lane);
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

    /// Works out what [`Self::shade_classic`] needs.
    pub fn prepare_classic(&mut self, context: &Context) {
        self.place(context);
        at_level!(
            self.lanes.wide,
            normals,
            (
                points: &TrianglePoints = &self.lanes.points,
                wo: &HitVectors = &self.lanes.wo,
                normal: &mut HitVectors = &mut self.normal,
            )
        );
    }

    /// What a vertex of `raycast` or `whitted` gives: ambient light, and a light ray for each
    /// light.
    pub fn shade_classic(
        &self,
        context: &Context,
        lane: usize,
        state: &PathState,
        random: &Random,
        out: &mut Outputs,
    ) {
        let seen = self.seen(lane);
        let ambient =
            seen.reflectance * state.mode.illuminant(context.scene.ambient + context.settings.fill);
        out.radiance = state.throughput * ambient;
        let local = |wi| seen.reflected(wi).0 * PI;
        classic::add_lights(context, state.throughput, random, &seen.arrival, local, out);
    }

    /// What a lane knows of its surface.
    fn seen(&self, lane: usize) -> Seen {
        Seen::at(&self.lanes, &self.normal, &self.reflectance, lane)
    }

    /// False for a vertex that must be worked on alone after all.
    pub fn is_sound(&self, lane: usize) -> bool {
        self.lanes.points.is_sound[lane] != 0
    }

    /// True if the path of a lane goes on.
    pub fn goes_on(&self, lane: usize) -> bool {
        self.lit.outputs.goes_on[lane] != 0
    }

    /// True if the light ray of a lane starts through the surface, by rounding.
    pub fn passes(&self, lane: usize) -> bool {
        let normal = at(&self.lanes.points.geometric_normal, lane);
        self.lit.arrivals.shadow_rays().at(lane).direction.dot(normal)
            * -at(&self.lanes.wo, lane).dot(normal)
            > 0.0
    }

    /// The source of the light ray of a lane, if it sends one, and its weight by multiple
    /// importance sampling.
    pub fn light_source(&self, lane: usize) -> Option<(LightSource, f32)> {
        (self.lit.outputs.is_lit[lane] != 0)
            .then(|| (self.lit.lights.source[lane], self.lit.arrivals.weight[lane]))
    }

    /// As [`super::Outputs::choice`], in a lane of which the path goes on.
    pub fn choice(&self, context: &Context, depth: u32, lane: usize) -> Option<Choice> {
        let field = context.field.filter(|field| field.is_learning())?;
        let (direction, pdf) = (at(&self.bounces.wi, lane), self.bounces.pdf[lane]);
        let bsdf_share = match self.guided.known(lane) {
            Some(known) => {
                field.brief(known).bsdf_share * self.seen(lane).reflected(direction).1 / pdf
            }
            None => 1.0,
        };
        let survival =
            context.roulette(depth).map_or(1.0, |most| self.guided.survival[lane].min(most));
        let (position, normal) = (at(&self.lanes.points.position, lane), at(&self.facing, lane));
        Some(Choice { position, normal, direction, pdf: pdf * survival, bsdf_share })
    }

    /// As [`super::Outputs::light_lobe`].
    pub fn lobe(&self, lane: usize) -> LobeShares {
        LobeShares::of_matte(color_at(&self.reflectance, lane))
    }
}

impl Columns for MatteVertices {
    fn vertices(&self) -> &VertexLanes {
        &self.lanes
    }

    fn goes_on(&self) -> &[u32; LANES] {
        &self.lit.outputs.goes_on
    }

    fn next_rays(&self) -> RayColumns<'_> {
        RayColumns { origin: &self.bounces.origin, direction: &self.bounces.wi, end: &ENDLESS }
    }

    fn carried(&self) -> CarriedColumns<'_> {
        self.lit.carried(
            &self.lanes,
            &self.lanes.carried.eta_scale,
            &self.bounces.pdf,
            &self.facing,
        )
    }
}

impl LitColumns for MatteVertices {
    fn light(&self) -> &LitLanes {
        &self.lit
    }
}

/// What is known of vertices before it is worked out what they give.
struct Known<'a> {
    carried: &'a CarriedLanes,
    reflectance: &'a HitColors,
    radiance: &'a HitColors,
    arrivals: &'a LightArrivals,
    bounces: &'a Bounces,
    /// What a field says, if there is one.
    guided: Option<&'a GuidedLanes>,
    roulette: &'a Roulette,
}

/// What vertices give, but for lights that are sampled alone.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
fn give<const CHANNELS: usize>(known: &Known, to: &mut LitOutputs) {
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

/// Normals as they are seen.
#[inline(always)]
fn normals(points: &TrianglePoints, wo: &HitVectors, normal: &mut HitVectors) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let n = visible_normal(
            vector(&points.shading_normal),
            vector(&points.geometric_normal),
            vector(wo),
        );
        (0..3).for_each(|axis| normal[axis][i] = n[axis]);
    }
}

/// Normals as they are seen, and cosine-distributed directions.
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
        // (One factor for both uses: two conditions alike become two branches with masked stores,
        // which some processors take twenty cycles for.)
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
    use super::super::twins::{assert_alike_at_every_level, every_second_node};
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
                assert_alike_at_every_level(&scene, &Moving::default(), &settings);
                if sampler == SamplerKind::Independent || integrator == IntegratorKind::Whitted {
                    assert_alike_at_every_level(&scene, &every_second_node(&scene), &settings);
                }
            }
        }
    }
}
