//! Batches of vertices of `path` and `direct` on surfaces of any kind
//! ([`crate::integrator::path`]). Lights, random numbers, roulette and rays are processed in
//! vectorised loops. BSDFs are evaluated in batches by material where the material supports it
//! ([`super::bsdf_batch`]), otherwise one by one.

use super::bsdf_batch::{BsdfBatch, Seen};
use super::specular::specular_part;
use crate::batch::direct_light::{DirectLight, VertexOutputs};
use crate::batch::lights::{ALONE, DARK, LightArrivals, LightSamples, Skins, ray_origin};
use crate::batch::paths::Paths;
use crate::batch::plain_surfaces::{Bends, Frames, PlainSurface};
use crate::batch::vertices::{CarriedLanes, OtherPoint, RayColumns, Roulette, VertexLanes};
use crate::batch::{Batch, BatchShader, Shaded};
use crate::integrator::carried::Expected;
use crate::integrator::estimators::{Arrival, lift_of_opaque};
use crate::integrator::guided::GuidedBsdf;
use crate::integrator::light_sample::{DrawnLight, weighted_sample};
use crate::integrator::path::{Scatterer, shining};
use crate::integrator::{Context, Vertex, dimension, outgoing};
use crate::lanes::{
    BLACK, ENDLESS, HitColors, LANES, ZERO, at, at_level_by_color, color_at, put, put_color,
};
use crate::light_sampler::{Receiver, Receivers};
use crate::sampler::Sampler;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::{ColorModel, Frame, SampledSpectrum, Vec2, Vec3};
use snell_scene::Material;
use snell_scene::material::FrameNeeds;

/// Shades vertices on surfaces of any kind.
#[derive(Debug)]
pub struct GeneralShader<'a> {
    /// By material: whether the shader accepts vertices on it.
    accepts: Vec<bool>,
    /// The numbers of paths, with the emission that each has found.
    found: Vec<(u32, SampledSpectrum)>,
    lanes: VertexLanes,
    color: ColorModel,
    /// By geometry: the plain surface, if the geometry is one.
    plain: Vec<Option<PlainSurface<'a>>>,
    /// Lanes whose vertex is on a plain surface, with that surface.
    on_plain: Vec<(usize, PlainSurface<'a>)>,
    /// The scatterers of lanes that are shaded one by one.
    scatterers: Vec<Scatterer<'a>>,
    /// The index of each lane's scatterer; [`NONE`] where a lane has none.
    scatterer_of: [u32; LANES],
    /// The BSDFs of the lanes that are evaluated in batches.
    bsdfs: BsdfBatch<'a>,
    /// The lanes whose shading frames were computed one by one, with these frames.
    turned: Vec<(usize, Frame)>,
    /// True if the frames of some lanes are to be computed together.
    turns: bool,
    bends: Bends,
    frames: Frames,
    /// The shading normals on the side of the paths.
    facing: HitVectors,
    /// Whether each surface transmits light.
    transmits: [bool; LANES],
    /// BSDF values and densities for the directions of the light samples.
    scattered: Scattered,
    bounces: Bounces,
    direct: DirectLight,
    /// Samples of lights that are drawn one by one, for lanes whose BSDFs are evaluated in batches.
    alone: Vec<Alone>,
}

/// A sample of a light that [`LightSamples`] does not handle.
#[derive(Debug)]
struct Alone {
    lane: usize,
    at: Arrival,
    probability: f32,
    light: DrawnLight,
}

/// The columns of [`GuidedBsdf::eval_and_pdf`], by lane.
#[derive(Debug)]
pub struct Scattered {
    /// By channel, the BSDF times the cosine.
    pub value: HitColors,
    pub pdf: HitLanes,
}

/// The next rays of paths, by lane.
#[derive(Debug)]
pub struct Bounces {
    pub wi: HitVectors,
    origin: HitVectors,
    /// 0 for delta lobes.
    pub pdf: HitLanes,
    /// By channel, the factor on the throughput.
    pub weight: HitColors,
    pub eta_scale: HitLanes,
    /// The values of [`GuidedBsdf::survival`], where paths are guided.
    survival: HitLanes,
    pub expected: HitLanes,
    /// 1 for delta lobes, 0 for others.
    pub is_delta: [u32; LANES],
    /// 1 where there is a next ray, 0 where the path ends.
    pub exists: [u32; LANES],
}

/// The scatterer of a lane that has none.
const NONE: u32 = u32::MAX;

impl<'a> GeneralShader<'a> {
    /// Makes the shader; `None` with portable code, or unless the integrator is `path` or `direct`.
    pub fn new(context: &Context<'a>, sampler: &Sampler) -> Option<Self> {
        let (scene, settings) = (context.scene, context.settings);
        let wide = scene.world.simd().wide().filter(|_| settings.integrator.is_path())?;
        // Materials with dispersion are not accepted, because dispersion changes the path's
        // wavelengths.
        let is_spectral = settings.color == ColorModel::Spectral;
        let accepts = |material: &Material| {
            specular_part(context, material).is_none() && !(is_spectral && material.is_dispersive())
        };
        let number = [0.0; LANES];
        let plain = (0..scene.world.geometry_count() as u32)
            .map(|id| PlainSurface::of(context, id))
            .collect();
        Some(Self {
            accepts: scene.materials.iter().map(accepts).collect(),
            found: Vec::with_capacity(LANES),
            lanes: VertexLanes::new(sampler, Some(wide)),
            color: settings.color,
            plain,
            on_plain: Vec::with_capacity(LANES),
            scatterers: Vec::with_capacity(LANES),
            scatterer_of: [NONE; LANES],
            bsdfs: BsdfBatch::new(settings.color),
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
            direct: DirectLight {
                lights: LightSamples::new(settings.color),
                ..DirectLight::default()
            },
            alone: Vec::new(),
        })
    }

    /// Puts the vertices of these paths into the lanes, and records the emission that the paths
    /// find there.
    fn gather(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]) {
        self.lanes.start(batch, paths);
        self.found.clear();
        self.on_plain.clear();
        self.scatterers.clear();
        self.scatterer_of = [NONE; LANES];
        self.bsdfs.clear();
        self.turned.clear();
        self.turns = false;
        self.bends.clear();
        for lane in 0..self.lanes.paths().len() {
            let outside_ior = batch.outside_ior(self.lanes.paths()[lane] as usize);
            if !self.put_plain(batch, lane, outside_ior) {
                self.put_other(batch, lane, outside_ior);
            }
        }
    }

    /// Puts the vertex of a lane into it if it is on a plain surface; [`Self::gather_plain`] must
    /// follow. Otherwise returns false and does nothing. `outside_ior` is the index of refraction
    /// on the outer side of the surface.
    fn put_plain(&mut self, batch: &Batch, lane: usize, outside_ior: f32) -> bool {
        let path = self.lanes.paths()[lane] as usize;
        let hit = &batch.paths.hits[path];
        let surface = self.plain.get(hit.geometry as usize).copied().flatten();
        let Some(surface) = surface.filter(|_| hit.instance == 0 && outside_ior == 1.0) else {
            return false;
        };
        let ray = &batch.paths.rays[path];
        match surface.mesh {
            Some(_) => self.lanes.put_triangle(lane),
            None if self.lanes.gather_shape(batch.context, lane, ray, hit) => {}
            None => return false,
        }
        self.on_plain.push((lane, surface));
        self.expect_frame(lane, surface.needs);
        true
    }

    /// Looks up the triangles of all lanes on plain surfaces.
    fn gather_plain(&mut self, from: &Paths) {
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

    /// Computes the points of all lanes and their scatterers.
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
            // (In RGB the scattering function is put into its lane from where it is, not copied
            // first.)
            let bsdf = match self.color {
                ColorModel::Rgb => {
                    surface.batch.inspect(|bsdf| self.bsdfs.put(lane, bsdf, &bsdf.point()))
                }
                ColorModel::Spectral => {
                    surface.batch_in(self.lanes.modes[lane]).map(|(bsdf, at)| {
                        self.bsdfs.put(lane, bsdf, &at);
                        bsdf
                    })
                }
            };
            if let Some(bsdf) = bsdf {
                self.transmits[lane] = bsdf.transmits();
                continue;
            }
            let scatterer = surface.scatterer(&self.lanes, &self.frames, lane);
            self.note_receiver(lane, &scatterer.receiver);
            self.scatterer_of[lane] = self.scatterers.len() as u32;
            self.scatterers.push(scatterer);
        }
        let VertexLanes { points, wo, lift, wide, .. } = &self.lanes;
        let seen = Seen { frames: &self.frames, flat: &points.geometric_normal, wo, lift };
        self.bsdfs.prepare(&seen, &mut self.facing, *wide);
    }

    /// Schedules the frame of a lane to be computed together with those of other lanes.
    fn expect_frame(&mut self, lane: usize, needs: FrameNeeds) {
        self.frames.expect(lane, needs);
        self.turns = true;
    }

    fn note_receiver(&mut self, lane: usize, receiver: &Receiver) {
        put(&mut self.facing, lane, receiver.normal);
        self.transmits[lane] = receiver.transmits;
    }

    /// Puts a vertex that is not on a plain surface into a lane.
    fn put_other(&mut self, batch: &Batch<'_, 'a>, lane: usize, outside_ior: f32) {
        let (context, number) = (batch.context, self.lanes.paths()[lane]);
        let (scene, path) = (context.scene, number as usize);
        let (state, interaction) = (batch.paths.state(path), batch.paths.interaction(scene, path));
        let surface = &batch.paths.surface(scene, path, &interaction, outside_ior);
        let prepared = scene.prepared(scene.material_id(surface.hit));
        let ray = &batch.paths.rays[path];
        let random = batch.random(path);
        let vertex =
            &Vertex { depth: batch.depth, ray, state: &state, random, surface: None, medium: None };
        let point = surface.point(scene);
        let (radiance, _) = shining(context, vertex, surface, &point);
        self.found.push((number, radiance));
        if batch.is_last() {
            return;
        }
        // With a guiding field, lanes are evaluated one by one.
        let bsdf = prepared.batch_at(surface.material, &point).filter(|_| context.field.is_none());
        if let Some((bsdf, at, needs)) = bsdf {
            let lift = if bsdf.transmits() {
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
            self.bsdfs.put(lane, bsdf, &at);
            self.transmits[lane] = bsdf.transmits();
            return;
        }
        let scatterer = Scatterer::new(context, vertex, surface, prepared, &point);
        self.note_receiver(lane, &scatterer.receiver);
        let lift = scatterer.at.lift();
        self.lanes
            .put_point(lane, OtherPoint::of(surface.interaction, scatterer.receiver.normal, lift));
        self.scatterer_of[lane] = self.scatterers.len() as u32;
        self.scatterers.push(scatterer);
    }

    /// Computes the outputs of the lanes.
    fn shade_lanes(&mut self, context: &Context, depth: u32) {
        self.place(context);
        let (wide, count) = (self.lanes.wide, self.lanes.paths().len());
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
        self.direct.lights.choose(context, &receivers, &self.lanes.randoms, count, wide);
        self.direct.glowing = [None; LANES];
        for (lane, how) in self.direct.lights.how.iter_mut().enumerate().take(count) {
            let scatterer = self.scatterers.get(self.scatterer_of[lane] as usize);
            let may_be_lit = scatterer.is_some_and(|scatterer| !scatterer.shading.is_delta());
            *how = if may_be_lit | self.bsdfs.has(lane) { *how } else { DARK };
        }
        let light = self.direct.lights.numbers(&self.lanes.randoms, count, wide);
        let skins = Skins { points: &self.lanes.points, lift: &self.lanes.lift };
        let to = (&skins, &self.lanes.modes);
        self.direct.lights.arrivals(
            context.scene,
            to,
            &light,
            count,
            wide,
            &mut self.direct.arrivals,
        );
        self.direct.lights.shine(context.scene, &self.direct.arrivals, &self.lanes.modes, count);
        for lane in 0..count {
            if !self.bsdfs.has(lane) {
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
        let (frames, wi) = (&self.frames, self.direct.arrivals.directions());
        self.bsdfs.evaluate(frames, wi, (&choice, &bounce), wide);
        let to = (&mut self.scattered, &mut self.bounces);
        self.bsdfs.write((frames, wi), &self.lanes.carried, to, wide);
        let known = Known {
            carried: &self.lanes.carried,
            skins: Skins { points: &self.lanes.points, lift: &self.lanes.lift },
            transmits: &self.transmits,
            scattered: &self.scattered,
            radiance: &self.direct.lights.radiance,
            is_guided: context.field.is_some(),
            roulette: &roulette,
        };
        at_level_by_color!(
            wide,
            self.color,
            give,
            (
                known: &Known<'_> = &known,
                arrivals: &mut LightArrivals = &mut self.direct.arrivals,
                bounces: &mut Bounces = &mut self.bounces,
                to: &mut VertexOutputs = &mut self.direct.outputs,
            )
        );
        let Self { lanes, scatterers, scatterer_of, direct, .. } = self;
        direct.sample_alone(count, &light, |lane, chosen, u| {
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

    /// Samples the lights that the batch does not handle, for lanes whose BSDFs are evaluated in
    /// batches.
    fn draw_alone(&mut self, context: &Context, u: &[HitLanes; 2], count: usize) {
        self.alone.clear();
        for lane in 0..count {
            if self.direct.lights.how[lane] != ALONE || !self.bsdfs.has(lane) {
                continue;
            }
            let (at, u) = (self.lanes.arrival(lane), Vec2::new(u[0][lane], u[1][lane]));
            let Some(chosen) = self.direct.lights.chosen.get(lane) else { continue };
            let Some(light) = DrawnLight::of(context, &at, &chosen, u) else { continue };
            self.direct.arrivals.aim(lane, light.direction());
            self.alone.push(Alone { lane, at, probability: chosen.probability, light });
        }
    }

    /// Computes the contributions of the light samples of [`Self::draw_alone`], once BSDF values
    /// are available.
    fn bring_alone(&mut self, context: &Context) {
        for Alone { lane, at, probability, light } in self.alone.drain(..) {
            let scattered = (color_at(&self.scattered.value, lane), self.scattered.pdf[lane]);
            let throughput = color_at(&self.lanes.carried.throughput, lane);
            self.direct
                .put_alone(lane, light.weighted(context, throughput, &at, probability, scattered));
        }
    }

    fn is_sound(&self, lane: usize) -> bool {
        self.lanes.points.is_sound[lane] != 0
    }

    /// Evaluates and samples the BSDF of a lane: its value for the light sample, and the next
    /// direction of the path.
    fn scatter(&mut self, context: &Context, lane: usize, u_lobe: f32, u: Vec2, u_quad: f32) {
        let Self { lanes, scatterers, scatterer_of, scattered, bounces, direct, .. } = self;
        bounces.exists[lane] = 0;
        let scatterer = scatterers.get(scatterer_of[lane] as usize);
        let Some(Scatterer { shading, receiver, .. }) = scatterer else { return };
        let (guided, wo) = (GuidedBsdf::new(context.field, shading, receiver), at(&lanes.wo, lane));
        if direct.arrivals.exists[lane] != 0 {
            let (value, pdf) = guided.eval_and_pdf(wo, at(direct.arrivals.directions(), lane));
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

impl<'a> BatchShader<'a> for GeneralShader<'a> {
    fn accepts(&self, batch: &Batch<'_, 'a>, paths: &[u32]) -> usize {
        if !batch.is_simple() || batch.wants_lobes() {
            return 0;
        }
        let accepts = |path: &&u32| {
            self.accepts.get(batch.materials[**path as usize] as usize).is_some_and(|&it| it)
        };
        paths.iter().take(LANES).take_while(accepts).count()
    }

    fn shade(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]) {
        self.gather(batch, paths);
        if batch.is_last() {
            return self.lanes.clear();
        }
        self.gather_plain(batch.paths);
        self.shade_lanes(batch.context, batch.depth);
    }

    fn shaded(&self) -> Shaded<'_> {
        let Self { lanes, direct, bounces, facing, .. } = self;
        Shaded {
            shadow_rays: &[],
            found: &self.found,
            paths: lanes.paths(),
            is_sound: &lanes.points.is_sound,
            light: Some(direct),
            goes_on: &direct.outputs.goes_on,
            next_rays: RayColumns {
                origin: &bounces.origin,
                direction: &bounces.wi,
                end: &ENDLESS,
            },
            carried: direct.carried(lanes, &bounces.eta_scale, &bounces.pdf, facing),
        }
    }
}

/// The inputs of [`give`].
struct Known<'a> {
    carried: &'a CarriedLanes,
    skins: Skins<'a>,
    transmits: &'a [bool; LANES],
    scattered: &'a Scattered,
    radiance: &'a HitColors,
    is_guided: bool,
    roulette: &'a Roulette,
}

/// Computes the outputs of the vertices, except for lights that are sampled one by one.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
fn give<const CHANNELS: usize>(
    known: &Known,
    arrivals: &mut LightArrivals,
    bounces: &mut Bounces,
    to: &mut VertexOutputs,
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
