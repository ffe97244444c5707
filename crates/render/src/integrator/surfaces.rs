//! What `path` and `direct` do at surfaces of any kind, at many vertices at once: the same as
//! [`super::path`], bit for bit. Lights, random numbers, roulette and rays are worked on in loops
//! that become vector code; how the surface scatters is asked together where many are of one
//! material of a kind that can ([`super::together`]), else one by one.
//!
//! As with [`super::matte`], which vertices come here depends on the scene and the settings alone,
//! and no lane looks at another.

use super::carried::Expected;
use super::estimators::{Arrival, lift_of_opaque};
use super::guided::GuidedBsdf;
use super::lanes::{
    Arriving, BLACK, CarriedColumns, CarriedLanes, Columns, ENDLESS, HitColors, LANES, LitColumns,
    OtherPoint, RayColumns, Roulette, VertexLanes, ZERO, at, at_level_by_color, color_at, put,
    put_color,
};
use super::lights::{ALONE, DARK, LightArrivals, LightSamples, Skins, ray_origin};
use super::lit::{LitLanes, LitOutputs};
use super::path::{DrawnLight, Scatterer, shining, weighted_sample};
use super::plain_surfaces::{Bends, Frames, PlainSurface};
use super::together::{Seen, Together};
use super::{Context, IntegratorKind, SurfaceVertex, Vertex, dimension, outgoing};
use crate::light_sampler::{Receiver, Receivers};
use crate::sampler::Sampler;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::{ColorModel, Frame, SampledSpectrum, Vec2, Vec3};
use snell_scene::material::{FrameNeeds, Prepared};

/// Vertices being worked on. Arrays are by lane; those of lanes that are not in use hold anything.
#[derive(Debug)]
pub struct SurfaceVertices<'a> {
    lanes: VertexLanes,
    color: ColorModel,
    /// By geometry.
    plain: Vec<Option<PlainSurface<'a>>>,
    /// Lanes on these.
    on_plain: Vec<(usize, PlainSurface<'a>)>,
    /// How many lanes are told what they are on.
    told: usize,
    /// What scatters, and which of these it is in each lane: [`NONE`] where none is known.
    scatterers: Vec<Scatterer<'a>>,
    scatterer_of: [u32; LANES],
    /// Lanes that are worked on by material, and their frames where these are known.
    together: Together<'a>,
    turned: Vec<(usize, Frame)>,
    /// True if frames are to be worked out together.
    turns: bool,
    bends: Bends,
    frames: Frames,
    /// The normal on the side where the path comes from.
    facing: HitVectors,
    /// Whether the surface lets light through.
    transmits: [bool; LANES],
    /// How the surfaces scatter light from where it comes from.
    scattered: Scattered,
    bounces: Bounces,
    lit: LitLanes,
    /// Light samples of lanes that are worked on together.
    alone: Vec<Alone>,
}

/// A sample of a light that is not flat.
#[derive(Debug)]
struct Alone {
    lane: usize,
    at: Arrival,
    probability: f32,
    light: DrawnLight,
}

/// See [`GuidedBsdf::eval_and_pdf`].
#[derive(Debug)]
pub(super) struct Scattered {
    /// By channel.
    pub value: HitColors,
    pub pdf: HitLanes,
}

/// Where paths go on.
#[derive(Debug)]
pub(super) struct Bounces {
    pub wi: HitVectors,
    origin: HitVectors,
    /// 0 for delta lobes.
    pub pdf: HitLanes,
    /// By channel, what the throughput is multiplied with.
    pub weight: HitColors,
    pub eta_scale: HitLanes,
    /// As [`GuidedBsdf::survival`] gives it, where paths are guided.
    survival: HitLanes,
    pub expected: HitLanes,
    /// 0 if not.
    pub is_delta: [u32; LANES],
    /// 0 where the path ends.
    pub exists: [u32; LANES],
}

/// No scatterer.
const NONE: u32 = u32::MAX;

impl<'a> SurfaceVertices<'a> {
    /// `None` if vertices on surfaces are to be worked on one by one.
    pub fn new(context: &Context<'a>, sampler: &Sampler) -> Option<Self> {
        let (scene, settings) = (context.scene, context.settings);
        let is_for = matches!(settings.integrator, IntegratorKind::Path | IntegratorKind::Direct);
        let wide = scene.world.simd().wide().filter(|_| is_for)?;
        let number = [0.0; LANES];
        let plain = (0..scene.world.geometry_count() as u32)
            .map(|id| PlainSurface::of(context, id))
            .collect();
        Some(Self {
            lanes: VertexLanes::new(sampler, Some(wide)),
            color: settings.color,
            plain,
            on_plain: Vec::with_capacity(LANES),
            told: 0,
            scatterers: Vec::with_capacity(LANES),
            scatterer_of: [NONE; LANES],
            together: Together::new(settings.color),
            turned: Vec::with_capacity(LANES),
            turns: false,
            bends: Bends::default(),
            frames: Frames::default(),
            facing: ZERO,
            transmits: [false; LANES],
            scattered: Scattered { value: BLACK, pdf: number },
            bounces: Bounces {
                wi: ZERO,
                origin: ZERO,
                pdf: number,
                weight: BLACK,
                eta_scale: number,
                survival: number,
                expected: number,
                is_delta: [0; LANES],
                exists: [0; LANES],
            },
            lit: LitLanes { lights: LightSamples::new(settings.color), ..LitLanes::default() },
            alone: Vec::new(),
        })
    }

    /// Takes the paths with these numbers ([`VertexLanes::start`]). What they have hit must follow
    /// for each lane.
    pub fn start(&mut self, sampler: &Sampler, from: &Arriving, paths: &[u32], depth: u32) {
        self.lanes.start(sampler, from, paths, depth);
        self.on_plain.clear();
        self.told = 0;
        self.scatterers.clear();
        self.scatterer_of = [NONE; LANES];
        self.together.clear();
        self.turned.clear();
        self.turns = false;
        self.bends.clear();
    }

    /// Says what the path of the next lane has hit, if it is a plain surface: then
    /// [`Self::gather_plain`] must follow, once all lanes are told. `outside_ior` is the index of
    /// refraction on its outer side.
    pub fn is_plain(&mut self, context: &Context, from: &Arriving, outside_ior: f32) -> bool {
        let lane = self.told;
        let path = self.lanes.paths()[lane] as usize;
        let hit = &from.hits[path];
        let surface = self.plain.get(hit.geometry as usize).copied().flatten();
        let Some(surface) = surface.filter(|_| hit.instance == 0 && outside_ior == 1.0) else {
            return false;
        };
        match surface.mesh {
            Some(_) => self.lanes.put_triangle(lane),
            None if self.lanes.gather_shape(context, lane, &from.rays[path], hit) => {}
            None => return false,
        }
        self.on_plain.push((lane, surface));
        self.expect_frame(lane, surface.needs);
        self.told += 1;
        true
    }

    /// Looks up the triangles of all lanes on plain surfaces.
    pub fn gather_plain(&mut self, from: &Arriving) {
        let plain = &self.plain;
        self.lanes.gather_triangles(from, |hit| {
            plain[hit.geometry as usize].as_ref().and_then(|surface| surface.mesh.as_ref())
        });
        self.lanes.gather_uvs(
            self.on_plain
                .iter()
                .filter_map(|(lane, surface)| Some((*lane, surface.mesh.as_ref()?))),
        );
    }

    /// The points of all lanes, and what scatters there.
    fn place(&mut self, context: &Context) {
        self.lanes.place();
        self.lanes.place_lifts(context);
        self.bends.bend(&mut self.lanes);
        if self.turns {
            self.frames.turn(&self.lanes);
        }
        for (lane, frame) in &self.turned {
            self.frames.put(*lane, frame);
        }
        for i in 0..self.on_plain.len() {
            let (lane, ref surface) = self.on_plain[i];
            if !self.is_sound(lane) {
                continue;
            }
            if !surface.is_lifted {
                put(&mut self.lanes.lift, lane, Vec3::ZERO);
            }
            // (What it is does not go through memory in RGB: that took 3 % of a render of rough
            // materials.)
            let many = match self.color {
                ColorModel::Rgb => {
                    surface.many.inspect(|many| self.together.put(lane, many, &many.point()))
                }
                ColorModel::Spectral => {
                    surface.many_in(self.lanes.modes[lane]).map(|(many, at)| {
                        self.together.put(lane, many, &at);
                        many
                    })
                }
            };
            if let Some(many) = many {
                self.transmits[lane] = many.transmits();
                continue;
            }
            let scatterer = surface.scatterer(&self.lanes, &self.frames, lane);
            self.note_receiver(lane, &scatterer.receiver);
            self.scatterer_of[lane] = self.scatterers.len() as u32;
            self.scatterers.push(scatterer);
        }
        let VertexLanes { points, wo, lift, wide, .. } = &self.lanes;
        let seen = Seen { frames: &self.frames, flat: &points.geometric_normal, wo, lift };
        self.together.look(&seen, &mut self.facing, *wide);
    }

    /// Has the frame of a lane worked out with the others.
    fn expect_frame(&mut self, lane: usize, needs: FrameNeeds) {
        self.frames.expect(lane, needs);
        self.turns = true;
    }

    fn note_receiver(&mut self, lane: usize, receiver: &Receiver) {
        put(&mut self.facing, lane, receiver.normal);
        self.transmits[lane] = receiver.transmits;
    }

    /// Says what the path of the next lane has hit, if it is no plain surface, and gives the light
    /// that it finds there. `prepared` is [`SurfaceVertex::prepared`].
    pub fn gather(
        &mut self,
        context: &Context,
        vertex: &Vertex,
        surface: &SurfaceVertex,
        prepared: &'a Prepared,
    ) -> SampledSpectrum {
        let point = surface.point(context.scene);
        let (found, _) = shining(context, vertex, surface, &point);
        if vertex.depth >= context.max_depth() {
            return found;
        }
        let lane = self.told;
        self.told += 1;
        // (What a field has learnt is asked one by one.)
        let many = prepared.many_at(surface.material, &point).filter(|_| context.field.is_none());
        if let Some((many, at, needs)) = many {
            let lift = if many.transmits() {
                Vec3::ZERO
            } else {
                lift_of_opaque(context, vertex, surface)
            };
            self.lanes.put_point(
                lane,
                OtherPoint::of(surface.interaction, surface.interaction.shading_normal, lift),
            );
            match needs.has_tangent {
                true => self.turned.push((
                    lane,
                    surface.material.frame_towards(needs, &point, outgoing(vertex.ray)),
                )),
                false => {
                    self.expect_frame(lane, needs);
                    self.bends.put(lane, surface.material.bend(&point));
                }
            }
            self.together.put(lane, many, &at);
            self.transmits[lane] = many.transmits();
            return found;
        }
        let scatterer = Scatterer::new(context, vertex, surface, prepared, &point);
        self.note_receiver(lane, &scatterer.receiver);
        let lift = scatterer.at.lift();
        self.lanes
            .put_point(lane, OtherPoint::of(surface.interaction, scatterer.receiver.normal, lift));
        self.scatterer_of[lane] = self.scatterers.len() as u32;
        self.scatterers.push(scatterer);
        found
    }

    /// Works out what the lanes give.
    pub fn shade(&mut self, context: &Context, depth: u32) {
        self.place(context);
        let (wide, count) = (self.lanes.wide, self.told);
        let numbers = |dimension| self.lanes.randoms.numbers(dimension, wide);
        let choice = numbers(dimension::LOBE);
        let bounce = self.lanes.randoms.pairs(dimension::BSDF, wide);
        let quad = context.field.map_or([0.0; LANES], |_| numbers(dimension::GUIDE));
        let roulette = self.lanes.roulette(context, depth);
        let receivers = Receivers {
            position: &self.lanes.points.position,
            normal: &self.facing,
            transmits: &self.transmits,
        };
        self.lit.lights.choose(context, &receivers, &self.lanes.randoms, count, wide);
        self.lit.glowing = [None; LANES];
        for (lane, how) in self.lit.lights.how.iter_mut().enumerate().take(count) {
            let scatterer = self.scatterers.get(self.scatterer_of[lane] as usize);
            let may_be_lit = scatterer.is_some_and(|scatterer| !scatterer.shading.is_delta());
            *how = if may_be_lit | self.together.has(lane) { *how } else { DARK };
        }
        let light = self.lit.lights.numbers(&self.lanes.randoms, count, wide);
        let skins = Skins { points: &self.lanes.points, lift: &self.lanes.lift };
        let to = (&skins, &self.lanes.modes);
        self.lit.lights.arrivals(context.scene, to, &light, count, wide, &mut self.lit.arrivals);
        self.lit.lights.shine(context.scene, &self.lit.arrivals, &self.lanes.modes, count);
        for lane in 0..count {
            if !self.together.has(lane) {
                self.scatter(
                    context,
                    lane,
                    choice[lane],
                    Vec2::new(bounce[0][lane], bounce[1][lane]),
                    quad[lane],
                );
            }
        }
        self.draw_alone(context, &light, count);
        let (frames, wi) = (&self.frames, self.lit.arrivals.directions());
        self.together.scatter(frames, wi, (&choice, &bounce), wide);
        let to = (&mut self.scattered, &mut self.bounces);
        self.together.tell((frames, wi), &self.lanes.carried, to, wide);
        let known = Known {
            carried: &self.lanes.carried,
            skins: Skins { points: &self.lanes.points, lift: &self.lanes.lift },
            transmits: &self.transmits,
            scattered: &self.scattered,
            radiance: &self.lit.lights.radiance,
            is_guided: context.field.is_some(),
            roulette: &roulette,
        };
        at_level_by_color!(
            wide,
            self.color,
            give,
            (
                known: &Known<'_> = &known,
                arrivals: &mut LightArrivals = &mut self.lit.arrivals,
                bounces: &mut Bounces = &mut self.bounces,
                to: &mut LitOutputs = &mut self.lit.outputs,
            )
        );
        let Self { lanes, scatterers, scatterer_of, lit, .. } = self;
        lit.sample_alone(count, &light, |lane, chosen, u| {
            let Scatterer { shading, at: arrival, receiver } =
                scatterers.get(scatterer_of[lane] as usize)?;
            let (guided, wo) =
                (GuidedBsdf::new(context.field, shading, receiver), at(&lanes.wo, lane));
            let throughput = color_at(&lanes.carried.throughput, lane);
            weighted_sample(context, throughput, arrival, chosen, u, |wi| {
                guided.eval_and_pdf(wo, wi)
            })
        });
        self.bring_alone(context);
    }

    /// Draws from the lights that are not flat, for lanes that are worked on together.
    fn draw_alone(&mut self, context: &Context, u: &[HitLanes; 2], count: usize) {
        self.alone.clear();
        for lane in 0..count {
            if self.lit.lights.how[lane] != ALONE || !self.together.has(lane) {
                continue;
            }
            let (at, u) = (self.lanes.arrival(lane), Vec2::new(u[0][lane], u[1][lane]));
            let Some(chosen) = self.lit.lights.chosen.get(lane) else { continue };
            let Some(light) = DrawnLight::of(context, &at, &chosen, u) else { continue };
            self.lit.arrivals.aim(lane, light.direction());
            self.alone.push(Alone { lane, at, probability: chosen.probability, light });
        }
    }

    /// Works out what these lights bring, once it is known how their light is scattered.
    fn bring_alone(&mut self, context: &Context) {
        for Alone { lane, at, probability, light } in self.alone.drain(..) {
            let scattered = (color_at(&self.scattered.value, lane), self.scattered.pdf[lane]);
            let throughput = color_at(&self.lanes.carried.throughput, lane);
            self.lit
                .put_alone(lane, light.weighted(context, throughput, &at, probability, scattered));
        }
    }

    /// False for a vertex that must be worked on alone after all.
    pub fn is_sound(&self, lane: usize) -> bool {
        self.lanes.points.is_sound[lane] != 0
    }

    /// Asks the surface of a lane how it scatters the light that arrives, and where the path goes
    /// on.
    fn scatter(&mut self, context: &Context, lane: usize, u_lobe: f32, u: Vec2, u_quad: f32) {
        let Self { lanes, scatterers, scatterer_of, scattered, bounces, lit, .. } = self;
        bounces.exists[lane] = 0;
        let scatterer = scatterers.get(scatterer_of[lane] as usize);
        let Some(Scatterer { shading, receiver, .. }) = scatterer else { return };
        let (guided, wo) = (GuidedBsdf::new(context.field, shading, receiver), at(&lanes.wo, lane));
        if lit.arrivals.exists[lane] != 0 {
            let (value, pdf) = guided.eval_and_pdf(wo, at(lit.arrivals.directions(), lane));
            put_color(&mut scattered.value, lane, value);
            scattered.pdf[lane] = pdf;
        }
        let Some(sample) = guided.sample(wo, u_lobe, u, || u_quad) else { return };
        bounces.exists[lane] = 1;
        let carried = &lanes.carried;
        let crossing = if sample.is_transmission { shading.crossing_scale(wo) } else { 1.0 };
        let before = (color_at(&carried.throughput, lane), carried.marks[lane].expected());
        let (survival, expected) = guided.survival(wo, &sample, crossing, before, 0.0);
        put(&mut bounces.wi, lane, sample.wi);
        put_color(&mut bounces.weight, lane, sample.weight);
        bounces.pdf[lane] = if sample.is_delta { 0.0 } else { sample.pdf };
        bounces.eta_scale[lane] = carried.eta_scale[lane] * crossing;
        (bounces.survival[lane], bounces.expected[lane]) = (survival, expected.get());
        bounces.is_delta[lane] = u32::from(sample.is_delta);
    }
}

impl Columns for SurfaceVertices<'_> {
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
        self.lit.carried(&self.lanes, &self.bounces.eta_scale, &self.bounces.pdf, &self.facing)
    }
}

impl LitColumns for SurfaceVertices<'_> {
    fn light(&self) -> &LitLanes {
        &self.lit
    }
}

/// What is known of vertices before it is worked out what they give.
struct Known<'a> {
    carried: &'a CarriedLanes,
    skins: Skins<'a>,
    transmits: &'a [bool; LANES],
    scattered: &'a Scattered,
    radiance: &'a HitColors,
    is_guided: bool,
    roulette: &'a Roulette,
}

/// What vertices give, but for lights that are sampled alone.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
fn give<const CHANNELS: usize>(
    known: &Known,
    arrivals: &mut LightArrivals,
    bounces: &mut Bounces,
    to: &mut LitOutputs,
) {
    let Known { carried, skins, transmits, scattered, radiance, is_guided, roulette } = *known;
    let survival = is_guided.then_some(&bounces.survival);
    for i in 0..LANES {
        arrivals.weigh(i, scattered.pdf[i]);
        let (mut value, mut weight) = ([0.0; CHANNELS], [0.0; CHANNELS]);
        for channel in 0..CHANNELS {
            (value[channel], weight[channel]) =
                (scattered.value[channel][i], bounces.weight[channel][i]);
        }
        to.bring(i, carried, value, radiance, arrivals);
        let next = (weight, &bounces.eta_scale);
        to.go_on(i, carried, next, survival, roulette, bounces.exists[i] != 0);
        to.mark(
            i,
            carried,
            Expected::of(bounces.expected[i]),
            transmits[i],
            bounces.is_delta[i] != 0,
        );
        let origin = ray_origin(skins.points, skins.lift, i, at(&bounces.wi, i));
        for axis in 0..3 {
            bounces.origin[axis][i] = origin[axis];
        }
    }
}

#[cfg(test)]
mod tests;
