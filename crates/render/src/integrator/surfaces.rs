//! What `path` and `direct` do at surfaces of any kind, at many vertices at once: the same as [`super::path`], bit for bit. Lights, random numbers, roulette
//! and rays are worked on in loops that become vector code; how the surface scatters is asked together where many are of one material of a
//! kind that can ([`super::together`]), else one by one.
//!
//! As with [`super::matte`], which vertices come here depends on the scene and the settings alone, and no lane looks at another.

use super::carried::{Carried, Expected};
use super::estimators::may_be_lifted;
use super::guided::GuidedBsdf;
use super::lanes::{
    Arriving, CarriedLanes, Columns, LANES, LitColumns, OtherPoint, Roulette, VertexLanes, ZERO, at, color_at, put,
    put_color,
};
use super::lights::{DARK, FlatArrivals, Skins, horizon, ray_origin};
use super::lit::{LitLanes, LitOutputs};
use super::path::{SCATTERED_SPREAD, Scatterer, shining, weighted_sample};
use super::together::{Seen, Together};
use super::{Context, IntegratorKind, SurfaceVertex, Vertex, dimension};
use crate::light_sampler::{Receiver, Receivers};
use crate::sampler::Sampler;
use snell_intersect::triangles::{HitLanes, HitVectors, PlainMesh};
use snell_intersect::{GeometryId, TrianglePoints};
use snell_math::simd::most;
use snell_math::{ColorMode, ColorModel, Frame, Ray, SampledSpectrum, Vec2, Vec3, at_level};
use snell_scene::bsdf::{Bsdf, Lobes, ManyBsdf};
use snell_scene::material::{FrameNeeds, Prepared, ShadingBsdf};
use std::borrow::Cow;

/// Vertices being worked on. Arrays are by lane; those of lanes that are not in use hold anything.
#[derive(Debug)]
pub struct SurfaceVertices<'a> {
    lanes: VertexLanes,
    /// By geometry.
    plain: Vec<Option<PlainSurface<'a>>>,
    /// Lanes on these.
    on_plain: Vec<(usize, PlainSurface<'a>)>,
    /// How many lanes are told what they are on.
    told: usize,
    /// What scatters, and which of these it is in each lane: [`NONE`] where none is known.
    scatterers: Vec<Scatterer<'a>>,
    scatterer_of: [u32; LANES],
    /// Lanes that are worked on by material.
    together: Together<'a>,
    frames: Frames,
    /// The normal on the side where the path comes from.
    facing: HitVectors,
    /// Whether the surface lets light through.
    transmits: [bool; LANES],
    /// As [`Carried::is_specular`], so far.
    is_specular: [bool; LANES],
    /// How the surfaces scatter light from where it comes from.
    scattered: Scattered,
    bounces: Bounces,
    lit: LitLanes,
}

/// A mesh or shape that does not shine, of one BSDF that is the same everywhere.
#[derive(Clone, Copy, Debug)]
struct PlainSurface<'a> {
    /// `None` for other shapes, whose points [`VertexLanes::gather_shape`] knows.
    mesh: Option<PlainMesh<'a>>,
    bsdf: &'a Bsdf,
    many: Option<&'a ManyBsdf>,
    needs: FrameNeeds,
    is_opaque: bool,
    /// It may stand for a smooth surface.
    is_lifted: bool,
}

impl<'a> PlainSurface<'a> {
    /// A geometry, if it is one.
    fn of(context: &Context<'a>, geometry: u32) -> Option<Self> {
        let scene = context.scene;
        let mesh = scene.world.plain_mesh(GeometryId(geometry));
        let id = scene.only_material(geometry).filter(|&id| !scene.material(id).is_emissive())?;
        let material = scene.material(id);
        let bsdf = scene.prepared(id).plain(material)?;
        // (What a field has learnt is asked one by one.)
        let many = scene.prepared(id).plain_many(material).filter(|_| context.field.is_none());
        let is_opaque = bsdf.is_opaque();
        let is_lifted = is_opaque && !bsdf.is_delta() && may_be_lifted(context, material);
        let needs = FrameNeeds::of(bsdf);
        (mesh.is_some() || !needs.has_tangent).then_some(Self { mesh, bsdf, many, needs, is_opaque, is_lifted })
    }
}

/// Frames of lanes on plain surfaces.
#[derive(Debug)]
pub(super) struct Frames {
    /// What is known of the tangents.
    dpdu: HitVectors,
    /// As [`FrameNeeds`].
    mirrors: [bool; LANES],
    has_tangent: [bool; LANES],
    x: HitVectors,
    y: HitVectors,
    z: HitVectors,
}

impl Frames {
    /// Of a lane.
    #[inline(always)]
    pub fn at(&self, lane: usize) -> Frame {
        Frame { x: at(&self.x, lane), y: at(&self.y, lane), z: at(&self.z, lane) }
    }
}

/// See [`GuidedBsdf::eval_and_pdf`].
#[derive(Debug)]
pub(super) struct Scattered {
    /// By channel.
    pub value: HitVectors,
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
    pub weight: HitVectors,
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
        let is_for = matches!(settings.integrator, IntegratorKind::Path | IntegratorKind::Direct)
            && settings.color == ColorModel::Rgb
            && !context.wants_lobes
            && !scene.moves;
        let wide = scene.world.simd().wide().filter(|_| is_for)?;
        let number = [0.0; LANES];
        Some(Self {
            lanes: VertexLanes::new(sampler, Some(wide)),
            plain: (0..scene.world.geometry_count() as u32).map(|id| PlainSurface::of(context, id)).collect(),
            on_plain: Vec::with_capacity(LANES),
            told: 0,
            scatterers: Vec::with_capacity(LANES),
            scatterer_of: [NONE; LANES],
            together: Together::default(),
            frames: Frames {
                dpdu: ZERO,
                mirrors: [false; LANES],
                has_tangent: [false; LANES],
                x: ZERO,
                y: ZERO,
                z: ZERO,
            },
            facing: ZERO,
            transmits: [false; LANES],
            is_specular: [false; LANES],
            scattered: Scattered { value: ZERO, pdf: number },
            bounces: Bounces {
                wi: ZERO,
                origin: ZERO,
                pdf: number,
                weight: ZERO,
                eta_scale: number,
                survival: number,
                expected: number,
                is_delta: [0; LANES],
                exists: [0; LANES],
            },
            lit: LitLanes::default(),
        })
    }

    /// Takes the paths with these numbers ([`VertexLanes::start`]). What they have hit must follow for each lane.
    pub fn start(&mut self, sampler: &Sampler, from: &Arriving, paths: &[u32], depth: u32) {
        self.lanes.start(sampler, from, paths, depth);
        self.on_plain.clear();
        self.told = 0;
        self.scatterers.clear();
        self.scatterer_of = [NONE; LANES];
        self.together.clear();
    }

    /// Says what the path of the next lane has hit, if it is a plain surface: then [`Self::gather_plain`] must follow, once all lanes are
    /// told. `outside_ior` is the index of refraction on its outer side.
    pub fn is_plain(&mut self, context: &Context, from: &Arriving, outside_ior: f32) -> bool {
        let lane = self.told;
        let path = self.lanes.paths()[lane] as usize;
        let hit = &from.hits[path];
        let surface = self.plain.get(hit.geometry as usize).copied().flatten();
        let Some(surface) = surface.filter(|_| hit.instance == 0 && outside_ior == 1.0) else { return false };
        match surface.mesh {
            Some(_) => self.lanes.put_triangle(lane),
            None if self.lanes.gather_shape(context, lane, &from.rays[path], hit) => {}
            None => return false,
        }
        self.is_specular[lane] = from.carried[path].is_specular;
        self.on_plain.push((lane, surface));
        self.told += 1;
        true
    }

    /// Looks up the triangles of all lanes on plain surfaces.
    pub fn gather_plain(&mut self, from: &Arriving) {
        let plain = &self.plain;
        self.lanes.gather_triangles(from, |hit| {
            plain[hit.geometry as usize].as_ref().and_then(|surface| surface.mesh.as_ref())
        });
        self.lanes.gather_uvs(self.on_plain.iter().filter_map(|(lane, surface)| Some((*lane, surface.mesh.as_ref()?))));
    }

    /// The points of all lanes, and what scatters there.
    fn place(&mut self, context: &Context) {
        self.lanes.place();
        self.lanes.place_lifts(context);
        if self.on_plain.is_empty() {
            return;
        }
        self.lanes.tangents(&mut self.frames.dpdu);
        for &(lane, PlainSurface { needs, .. }) in &self.on_plain {
            (self.frames.mirrors[lane], self.frames.has_tangent[lane]) = (needs.mirrors, needs.has_tangent);
        }
        at_level!(
            self.lanes.wide,
            turn,
            (
                points: &TrianglePoints = &self.lanes.points,
                wo: &HitVectors = &self.lanes.wo,
                frames: &mut Frames = &mut self.frames,
            )
        );
        for i in 0..self.on_plain.len() {
            let (lane, ref surface) = self.on_plain[i];
            if !self.is_sound(lane) {
                continue;
            }
            if !surface.is_lifted {
                put(&mut self.lanes.lift, lane, Vec3::ZERO);
            }
            if let Some(many) = surface.many {
                self.together.put(lane, many);
                self.transmits[lane] = false;
                continue;
            }
            let scatterer = plain_scatterer(&self.lanes, &self.frames, lane, surface);
            self.note_receiver(lane, &scatterer.receiver);
            self.scatterer_of[lane] = self.scatterers.len() as u32;
            self.scatterers.push(scatterer);
        }
        let VertexLanes { points, wo, lift, wide, .. } = &self.lanes;
        let seen = Seen { frames: &self.frames, flat: &points.geometric_normal, wo, lift };
        self.together.look(&seen, &mut self.facing, *wide);
    }

    fn note_receiver(&mut self, lane: usize, receiver: &Receiver) {
        put(&mut self.facing, lane, receiver.normal);
        self.transmits[lane] = receiver.transmits;
    }

    /// Says what the path of the next lane has hit, if it is no plain surface, and gives the light that it finds there. `prepared` is [`SurfaceVertex::prepared`].
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
        let scatterer = Scatterer::new(context, vertex, surface, prepared, &point);
        self.note_receiver(lane, &scatterer.receiver);
        let lift = scatterer.at.lift();
        self.lanes.put_point(lane, OtherPoint::of(surface.interaction, scatterer.receiver.normal, lift));
        self.is_specular[lane] = vertex.state.is_specular;
        self.scatterer_of[lane] = self.scatterers.len() as u32;
        self.scatterers.push(scatterer);
        self.told += 1;
        found
    }

    /// Works out what the lanes give.
    pub fn shade(&mut self, context: &Context, depth: u32) {
        self.place(context);
        let (wide, count) = (self.lanes.wide, self.told);
        let numbers = |dimension| self.lanes.randoms.numbers(dimension, wide);
        let (choice, light) = (numbers(dimension::LOBE), self.lanes.randoms.pairs(dimension::LIGHT, wide));
        let bounce = self.lanes.randoms.pairs(dimension::BSDF, wide);
        let quad = context.field.map_or([0.0; LANES], |_| numbers(dimension::GUIDE));
        let roulette = self.lanes.roulette(context, depth);
        let receivers =
            Receivers { position: &self.lanes.points.position, normal: &self.facing, transmits: &self.transmits };
        self.lit.lights.choose(context, &receivers, &self.lanes.randoms, count, wide);
        self.lit.glowing = [None; LANES];
        for (lane, how) in self.lit.lights.how.iter_mut().enumerate().take(count) {
            let scatterer = self.scatterers.get(self.scatterer_of[lane] as usize);
            let may_be_lit = scatterer.is_some_and(|scatterer| !scatterer.shading.is_delta());
            *how = if may_be_lit | self.together.has(lane) { *how } else { DARK };
        }
        let skins = Skins { points: &self.lanes.points, lift: &self.lanes.lift };
        self.lit.lights.arrivals(context.scene, &skins, &light, count, wide, &mut self.lit.arrivals);
        for lane in 0..count {
            if !self.together.has(lane) {
                self.scatter(context, lane, choice[lane], Vec2::new(bounce[0][lane], bounce[1][lane]), quad[lane]);
            }
        }
        let (frames, wi) = (&self.frames, self.lit.arrivals.directions());
        self.together.scatter(frames, wi, (&choice, &bounce), wide);
        self.together.tell((frames, wi), &self.lanes.carried, &mut self.scattered, &mut self.bounces, wide);
        at_level!(
            wide,
            outputs,
            (
                carried: &CarriedLanes = &self.lanes.carried,
                skins: &Skins<'_> = &Skins { points: &self.lanes.points, lift: &self.lanes.lift },
                scattered: &Scattered = &self.scattered,
                radiance: &HitVectors = &self.lit.lights.radiance,
                arrivals: &mut FlatArrivals = &mut self.lit.arrivals,
                bounces: &mut Bounces = &mut self.bounces,
                is_guided: bool = context.field.is_some(),
                roulette: &Roulette = &roulette,
                to: &mut LitOutputs = &mut self.lit.outputs,
            )
        );
        let Self { lanes, on_plain, scatterers, scatterer_of, frames, lit, .. } = self;
        lit.sample_alone(count, &light, |lane, chosen, u| {
            let alone;
            let Scatterer { shading, at: arrival, receiver } = match scatterers.get(scatterer_of[lane] as usize) {
                Some(scatterer) => scatterer,
                None => {
                    let (_, surface) = on_plain.iter().find(|(other, _)| *other == lane)?;
                    alone = plain_scatterer(lanes, frames, lane, surface);
                    &alone
                }
            };
            let (guided, wo) = (GuidedBsdf::new(context.field, shading, receiver), at(&lanes.wo, lane));
            let throughput = color_at(&lanes.carried.throughput, lane);
            weighted_sample(context, throughput, arrival, chosen, u, |wi| guided.eval_and_pdf(wo, wi))
        });
    }

    /// False for a vertex that must be worked on alone after all.
    pub fn is_sound(&self, lane: usize) -> bool {
        self.lanes.points.is_sound[lane] != 0
    }

    /// Asks the surface of a lane how it scatters the light that arrives, and where the path goes on.
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
        let before = (color_at(&carried.throughput, lane), Expected::of(carried.expected[lane]));
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

    #[inline(always)]
    fn next_ray(&self, lane: usize) -> Ray {
        let lane = lane % LANES;
        Ray::new(at(&self.bounces.origin, lane), at(&self.bounces.wi, lane))
    }

    #[inline(always)]
    fn carried(&self, lane: usize) -> Carried {
        let lane = lane % LANES;
        let (before, bounces) = (&self.lanes.carried, &self.bounces);
        let is_delta = bounces.is_delta[lane] != 0;
        let spread = before.cone_spread[lane];
        Carried {
            throughput: color_at(&self.lit.outputs.throughput, lane),
            position: at(&self.lanes.points.position, lane),
            normal: at(&self.facing, lane),
            bsdf_pdf: bounces.pdf[lane],
            eta_scale: bounces.eta_scale[lane],
            cone_width: before.cone_width[lane],
            cone_spread: if is_delta { spread } else { most(spread, SCATTERED_SPREAD) },
            stream: 0,
            expected: Expected::of(bounces.expected[lane]),
            transmits: self.transmits[lane],
            is_specular: is_delta && self.is_specular[lane],
        }
    }
}

impl LitColumns for SurfaceVertices<'_> {
    fn light(&self) -> &LitLanes {
        &self.lit
    }
}

/// What scatters in a lane on a plain surface.
fn plain_scatterer<'a>(lanes: &VertexLanes, frames: &Frames, lane: usize, surface: &PlainSurface<'a>) -> Scatterer<'a> {
    let (wo, frame, lift) = (at(&lanes.wo, lane), frames.at(lane), at(&lanes.lift, lane));
    let arrival = lanes.arrival(lane, ColorMode::Rgb, 0.0);
    let flat = at(&lanes.points.geometric_normal, lane);
    let shading = ShadingBsdf::seen_from(wo, Cow::Borrowed(surface.bsdf), frame, horizon(flat, frame.z, lift));
    let receiver = Receiver {
        position: arrival.position,
        normal: if frame.z.dot(wo) < 0.0 { -frame.z } else { frame.z },
        transmits: !surface.is_opaque,
    };
    Scatterer { shading, at: arrival, receiver }
}

/// Frames as they are seen.
#[inline(always)]
fn turn(points: &TrianglePoints, wo: &HitVectors, frames: &mut Frames) {
    for i in 0..LANES {
        let (n, flat) = (at(&points.shading_normal, i), at(&points.geometric_normal, i));
        let plain = Frame::from_z_and_x(n, at(&frames.dpdu, i));
        let needs = FrameNeeds { mirrors: frames.mirrors[i], has_tangent: frames.has_tangent[i] };
        let frame = needs.frame(&plain, flat, at(wo, i));
        for axis in 0..3 {
            frames.x[axis][i] = frame.x[axis];
            frames.y[axis][i] = frame.y[axis];
            frames.z[axis][i] = frame.z[axis];
        }
    }
}

/// What vertices give, where their lights are flat.
#[inline(always)]
fn outputs(
    carried: &CarriedLanes,
    skins: &Skins,
    scattered: &Scattered,
    radiance: &HitVectors,
    arrivals: &mut FlatArrivals,
    bounces: &mut Bounces,
    is_guided: bool,
    roulette: &Roulette,
    to: &mut LitOutputs,
) {
    let survival = is_guided.then_some(&bounces.survival);
    for i in 0..LANES {
        arrivals.weigh(i, scattered.pdf[i]);
        let value = [scattered.value[0][i], scattered.value[1][i], scattered.value[2][i]];
        to.bring(i, carried, value, radiance, arrivals);
        let next = (&bounces.weight, &bounces.eta_scale);
        to.go_on(i, carried, next, survival, roulette, bounces.exists[i] != 0);
        let origin = ray_origin(skins.points, skins.lift, i, at(&bounces.wi, i));
        for axis in 0..3 {
            bounces.origin[axis][i] = origin[axis];
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::sampler::SamplerKind;
    use crate::{CompiledScene, Guiding, IntegratorKind, Job, LightStrategy, Settings};
    use snell_intersect::BuildOptions;
    use snell_math::simd::Level;
    use snell_scene::Texture;
    use snell_scene::builtin::builtin;
    use snell_scene::material::{AlphaMode, MaterialKind, NormalMap};
    use snell_scene::texture::Pattern;

    #[test]
    fn many_vertices_at_once_give_the_bits_of_one_at_a_time() {
        let guiding = Some(Guiding { passes: 2, photons: 1 << 13 });
        let kinds = MaterialKind::examples();
        let mut first = 0;
        for name in ["cornell-box", "teapot", "spheres", "night-town", "fog", "drink", "hair", "smoke"] {
            let mut scene = builtin(name).expect("the scene is built in");
            let bumps = Pattern::examples().into_iter().find(|p| p.textures().is_empty()).expect("there is one");
            let texture = scene.add_texture(Texture::Pattern(bumps));
            // A lamp that is not black, among others.
            if let Some(lamp) = scene.materials.iter_mut().find(|m| m.is_emissive()) {
                lamp.kind = kinds[first % kinds.len()].clone();
            }
            let ways = [
                (IntegratorKind::Path, SamplerKind::ZSobol, LightStrategy::Mis, None),
                (IntegratorKind::Path, SamplerKind::Independent, LightStrategy::Mis, None),
                (IntegratorKind::Path, SamplerKind::Independent, LightStrategy::Mis, guiding),
                (IntegratorKind::Path, SamplerKind::ZSobol, LightStrategy::Light, None),
                (IntegratorKind::Direct, SamplerKind::Stratified, LightStrategy::Bsdf, None),
            ];
            for (way, (integrator, sampler, light_strategy, guiding)) in ways.into_iter().enumerate() {
                let materials = scene.materials.iter_mut().filter(|m| !m.is_emissive() && m.interior.is_none());
                for (i, material) in materials.enumerate().take(if name == "night-town" { 12 } else { 4 }) {
                    let number = first + i;
                    material.kind = kinds[number % kinds.len()].clone();
                    let is_bent = number % 3 == 0;
                    material.normal_map = is_bent.then_some(NormalMap { texture, scale: 0.3 });
                    material.alpha_mode = if number % 5 == 0 { AlphaMode::Blend } else { AlphaMode::Opaque };
                    material.alpha = 0.7.into();
                }
                first += 4;
                let picture = |simd: Level| {
                    let options = BuildOptions { simd, ..BuildOptions::default() };
                    let compiled = CompiledScene::new(&scene, &options).expect("a valid scene");
                    let how = Settings { max_depth: 7, sampler, integrator, light_strategy, ..Settings::default() };
                    let settings = Settings { size: [32, 24], spp: 4, guiding, ..how };
                    let image = Job::new(&compiled, &scene.cameras[0], &settings).run(1, &|_| true).0.image();
                    image.layers[0].values.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
                };
                let one_by_one = picture(Level::Scalar);
                assert!(one_by_one.iter().any(|&x| f32::from_bits(x) != 0.0) || way > 2, "{name}");
                for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                    let is_alike = picture(level) == one_by_one;
                    assert!(is_alike, "{name} {integrator:?} {sampler:?} {light_strategy:?} {guiding:?} {level}");
                }
            }
        }
    }
}
