//! Batches of light samples, with the bits of [`crate::integrator::estimators::sample_light`]. The
//! lights are environments, lights without a surface, and surfaces of uniform emission: flat and
//! far ones, and near rectangles, triangles and spheres.

mod delta;
pub mod near;
pub mod sky;

use crate::batch::vertices::RayColumns;
use crate::compile::{BareLight, CompiledLight, CompiledScene, LightSpectrum, PlainEmission};
use crate::integrator::estimators::SHADOW_END;
use crate::integrator::light_part::LightSource;
use crate::integrator::{Context, dimension};
use crate::lanes::{BLACK, HitColors, ZERO, at, put, put_color};
use crate::light_sampler::{ChosenLights, NONE, Receivers};
use crate::sampler::BatchRandoms;
use crate::settings::LightStrategy;
use delta::{DeltaSamples, arrive_from_delta};
use near::{NearLights, NearParts, RECTANGLE, SPHERE, TRIANGLE};
use sky::{NO_PLACES, SkyPlaces, SkySamples, arrive_from_sky};
use snell_intersect::TrianglePoints;
use snell_intersect::smooth::lifted_ray_origin;
use snell_intersect::triangles::{HitLanes, HitVectors, TRIANGLE_HITS as LANES};
use snell_math::simd::Wide;
use snell_math::{ColorMode, ColorModel, Ray, Vec2, Vec3, at_level, sampling};
use snell_scene::light::area::{AreaLight, FlatPart, PartSample};
use snell_scene::medium::HenyeyGreenstein;
use std::f32::consts::FRAC_1_PI;

/// The lights of the lanes. Lanes without a light hold arbitrary values.
#[derive(Debug)]
pub struct LightSamples {
    /// The chosen light.
    pub chosen: ChosenLights,
    /// The part of the light that a lane already holds, which is often the next one.
    light: [u32; LANES],
    part: [u32; LANES],
    /// How each is sampled.
    pub how: [u32; LANES],
    /// How each is sampled from near points, and spheres from all points; [`ALONE`] for all others.
    how_near: [u32; LANES],
    /// The source of the light of each.
    pub source: [LightSource; LANES],
    /// Emitted radiance, by channel.
    pub radiance: HitColors,
    /// The same for all wavelengths, where these are not the same for all paths.
    spectra: Vec<LightSpectrum>,
    corner: HitVectors,
    edges: [HitVectors; 2],
    /// Of spheres, normals and errors of points.
    normal: HitVectors,
    error: HitVectors,
    middle: HitVectors,
    /// Infinite for lights that are not flat.
    far: HitLanes,
    /// Density per unit of area.
    pdf: HitLanes,
    kind: [u32; LANES],
    /// 1 if both sides emit.
    on_both_sides: [u32; LANES],
    near: NearLights,
    /// Lanes that sample the environment.
    sky_lanes: Vec<u32>,
    sky: SkySamples,
    sky_places: SkyPlaces,
    /// Lanes that sample a light without a surface.
    delta_lanes: Vec<u32>,
    delta: DeltaSamples,
}

/// There is no light.
pub const DARK: u32 = 0;
/// By area.
const FAR: u32 = 1;
/// By solid angle.
const NEAR: u32 = 2;
/// The environment.
const SKY: u32 = 3;
/// A light without a surface.
const DELTA: u32 = 4;
/// The light is not one of these.
pub const ALONE: u32 = 5;

/// Light samples as they arrive at vertices.
#[derive(Debug)]
pub struct LightArrivals {
    pub origin: HitVectors,
    /// Direction and end of the light ray.
    pub way: HitVectors,
    pub end: HitLanes,
    /// Direction from the vertex, and the density with which it was chosen.
    pub direction: HitVectors,
    pub density: HitLanes,
    /// Density with which an unguided path samples this direction: at Lambertian surfaces the
    /// cosine of incidence over pi.
    pub share: HitLanes,
    /// Weight by multiple importance sampling.
    pub weight: HitLanes,
    /// The weight over the density of the sample.
    pub scale: HitLanes,
    /// 1 if the light has no surface, so that BSDF samples cannot find it; else 0.
    pub is_delta: [u32; LANES],
    /// 0 where there is no light.
    pub exists: [u32; LANES],
}

/// The surface on the side of the paths.
#[derive(Clone, Copy, Debug)]
pub struct Surfaces<'a> {
    pub points: &'a TrianglePoints,
    /// Shading normals.
    pub normal: &'a HitVectors,
    /// Directions towards the origins of the rays.
    pub wo: &'a HitVectors,
    /// See [`crate::integrator::estimators::Skin::lift`].
    pub lift: &'a HitVectors,
}

/// The receivers of light samples: surfaces, or points of media.
pub trait Scatterers {
    fn position(&self) -> &HitVectors;

    /// The density with which the path of a lane samples a direction, and whether light from there
    /// counts.
    fn share(&self, lane: usize, direction: Vec3) -> (f32, bool);

    /// The origin of a ray of this direction that leaves the vertex of a lane.
    fn ray_origin(&self, lane: usize, direction: Vec3) -> Vec3;
}

impl Scatterers for Surfaces<'_> {
    fn position(&self) -> &HitVectors {
        &self.points.position
    }

    #[inline(always)]
    fn share(&self, lane: usize, direction: Vec3) -> (f32, bool) {
        let (n, flat, wo) =
            (at(self.normal, lane), at(&self.points.geometric_normal, lane), at(self.wo, lane));
        let (cos_i, horizon) = (n.dot(direction), horizon(flat, n, at(self.lift, lane)));
        let is_seen = (n.dot(wo) * cos_i > 0.0) & (horizon.dot(wo) * horizon.dot(direction) > 0.0);
        (if is_seen { cos_i.abs() * FRAC_1_PI } else { 0.0 }, is_seen)
    }

    #[inline(always)]
    fn ray_origin(&self, lane: usize, direction: Vec3) -> Vec3 {
        ray_origin(self.points, self.lift, lane, direction)
    }
}

/// Surfaces of which only the geometry is known: their BSDFs are evaluated one by one, and the
/// density of BSDF samples is applied later ([`LightArrivals::weigh`]).
#[derive(Clone, Copy, Debug)]
pub struct Skins<'a> {
    pub points: &'a TrianglePoints,
    /// See [`crate::integrator::estimators::Skin::lift`].
    pub lift: &'a HitVectors,
}

impl Scatterers for Skins<'_> {
    fn position(&self) -> &HitVectors {
        &self.points.position
    }

    #[inline(always)]
    fn share(&self, _: usize, _: Vec3) -> (f32, bool) {
        (0.0, true)
    }

    #[inline(always)]
    fn ray_origin(&self, lane: usize, direction: Vec3) -> Vec3 {
        ray_origin(self.points, self.lift, lane, direction)
    }
}

/// The origin of a ray of this direction that leaves the surface of a lane.
#[inline(always)]
pub fn ray_origin(
    points: &TrianglePoints,
    lift: &HitVectors,
    lane: usize,
    direction: Vec3,
) -> Vec3 {
    let (position, error) = (at(&points.position, lane), at(&points.position_error, lane));
    lifted_ray_origin(
        position,
        error,
        at(&points.geometric_normal, lane),
        at(lift, lane),
        direction,
    )
}

/// Points of media.
#[derive(Clone, Copy, Debug)]
pub struct MediumPoints<'a> {
    pub position: &'a HitVectors,
    /// Directions towards the origins of the rays.
    pub wo: &'a HitVectors,
    /// Of the phase functions.
    pub phase: &'a [HenyeyGreenstein; LANES],
}

impl Scatterers for MediumPoints<'_> {
    fn position(&self) -> &HitVectors {
        self.position
    }

    #[inline(always)]
    fn share(&self, lane: usize, direction: Vec3) -> (f32, bool) {
        (self.phase[lane].pdf(-at(self.wo, lane), direction), true)
    }

    #[inline(always)]
    fn ray_origin(&self, lane: usize, _: Vec3) -> Vec3 {
        at(self.position, lane)
    }
}

impl Default for LightSamples {
    fn default() -> Self {
        Self {
            chosen: ChosenLights::default(),
            light: [NONE; LANES],
            part: [NONE; LANES],
            how: [DARK; LANES],
            how_near: [DARK; LANES],
            source: [LightSource::Medium; LANES],
            radiance: BLACK,
            spectra: Vec::new(),
            corner: ZERO,
            edges: [ZERO; 2],
            normal: ZERO,
            error: ZERO,
            middle: ZERO,
            far: [f32::INFINITY; LANES],
            pdf: [0.0; LANES],
            kind: [RECTANGLE; LANES],
            on_both_sides: [0; LANES],
            near: NearLights::default(),
            sky_lanes: Vec::new(),
            sky: SkySamples::default(),
            sky_places: NO_PLACES,
            delta_lanes: Vec::new(),
            delta: DeltaSamples::default(),
        }
    }
}

impl Default for LightArrivals {
    fn default() -> Self {
        let (zero, exists) = ([0.0; LANES], [0; LANES]);
        let (origin, way, direction) = (ZERO, ZERO, ZERO);
        let [end, density, share, weight, scale] = [zero; 5];
        Self {
            origin,
            way,
            end,
            direction,
            density,
            share,
            weight,
            scale,
            is_delta: exists,
            exists,
        }
    }
}

/// A chosen light that [`LightSamples`] holds.
#[derive(Clone, Copy)]
enum Held<'a> {
    Part(LightPart<'a>),
    Sky,
    Bare(&'a BareLight),
}

impl<'a> Held<'a> {
    /// The part of a light, if it can be sampled here.
    fn of(scene: &'a CompiledScene, light: u32, part: u32) -> Option<Self> {
        match scene.lights().get(light as usize)? {
            CompiledLight::Area(_) => LightPart::of(scene, light, part).map(Self::Part),
            CompiledLight::Environment => Some(Self::Sky),
            CompiledLight::Light(light) => Some(Self::Bare(light)),
            CompiledLight::Moving(_) | CompiledLight::Medium(..) => None,
        }
    }
}

/// A part of an emissive surface, for far points at least.
#[derive(Clone, Copy)]
struct LightPart<'a> {
    /// `None` for a sphere.
    flat: Option<&'a FlatPart>,
    is_near: bool,
    plain: &'a PlainEmission,
}

impl<'a> LightPart<'a> {
    /// The part of a light, if it is one.
    fn of(scene: &'a CompiledScene, light: u32, part: u32) -> Option<Self> {
        if part == NONE {
            return None;
        }
        let plain = scene.plain_emission(light as usize).filter(|plain| !plain.rgb.is_black())?;
        let area = area_light(scene, light)?;
        let (flat, is_near) = (area.flat(part), area.near(part).is_some());
        (flat.is_some() || is_near).then_some(Self { flat, is_near, plain })
    }
}

fn area_light(scene: &CompiledScene, light: u32) -> Option<&AreaLight> {
    match &scene.lights()[light as usize] {
        CompiledLight::Area(area) => Some(area),
        _ => None,
    }
}

fn bare_light(scene: &CompiledScene, light: u32) -> Option<&BareLight> {
    match &scene.lights()[light as usize] {
        CompiledLight::Light(bare) => Some(bare),
        _ => None,
    }
}

impl LightSamples {
    /// Light samples for paths of this colour mode.
    pub fn new(color: ColorModel) -> Self {
        let spectra = match color {
            ColorModel::Rgb => Vec::new(),
            ColorModel::Spectral => vec![LightSpectrum::default(); LANES],
        };
        Self { spectra, ..Self::default() }
    }

    /// Computes the radiance that is still missing, for the given number of first lanes: at the
    /// wavelengths of their paths, and that of an environment in its sampled direction.
    pub fn shine(
        &mut self,
        scene: &CompiledScene,
        arrivals: &LightArrivals,
        modes: &[ColorMode; LANES],
        count: usize,
    ) {
        if let Some(sky) = &scene.environment {
            for &lane in &self.sky_lanes {
                let lane = lane as usize % LANES;
                if arrivals.exists[lane] != 0 {
                    let place = Vec2::new(self.sky_places[0][lane], self.sky_places[1][lane]);
                    put_color(&mut self.radiance, lane, sky.radiance_at(place, modes[lane]));
                }
            }
        }
        for (lane, spectrum) in self.spectra.iter().enumerate().take(count) {
            let factor = match self.how[lane] {
                FAR | NEAR => Some(1.0),
                DELTA => self.delta.factor(lane),
                _ => None,
            };
            if let Some(factor) = factor {
                put_color(&mut self.radiance, lane, spectrum.at(modes[lane]) * factor);
            }
        }
    }

    /// Chooses lights for the given number of first receivers, and decides how each is sampled.
    pub fn choose(
        &mut self,
        context: &Context,
        receivers: &Receivers,
        randoms: &BatchRandoms<LANES>,
        count: usize,
        wide: Option<Wide>,
    ) {
        let choices = match context.lights.has_choice() {
            true => randoms.numbers(dimension::LIGHT_CHOICE, wide),
            false => [0.0; LANES],
        };
        context.lights.sample_batch(receivers, &choices, count, &mut self.chosen);
        self.look_up(context.scene, receivers.position, count, wide);
        if context.settings.light_strategy != LightStrategy::Mis {
            self.how.iter_mut().filter(|how| **how != DARK).for_each(|how| *how = ALONE);
        }
    }

    /// Looks up the lights that were chosen for the given number of first points, and decides how
    /// each is sampled.
    fn look_up(
        &mut self,
        scene: &CompiledScene,
        positions: &HitVectors,
        count: usize,
        wide: Option<Wide>,
    ) {
        let (mut changed, mut changes) = ([0; LANES], 0);
        for lane in 0..count.min(LANES) {
            let is_same = (self.light[lane] == self.chosen.light[lane])
                & (self.part[lane] == self.chosen.part[lane]);
            changed[changes % LANES] = lane;
            changes += usize::from(!is_same);
        }
        // (All are found before any is copied: so several are under way from memory.)
        let mut found = [None; LANES];
        for &lane in &changed[..changes] {
            found[lane] = Held::of(scene, self.chosen.light[lane], self.chosen.part[lane]);
        }
        for &lane in &changed[..changes] {
            self.put(lane, found[lane]);
        }
        at_level!(
            wide,
            tell_far,
            (lights: &mut LightSamples = self, positions: &HitVectors = positions)
        );
    }

    /// Puts the light that was chosen for a lane into it, if it `found` one of those that are held
    /// here.
    fn put(&mut self, lane: usize, found: Option<Held>) {
        let (light, part) = (self.chosen.light[lane], self.chosen.part[lane]);
        (self.light[lane], self.part[lane]) = (light, part);
        // (Nothing is as far as that.)
        self.far[lane] = f32::INFINITY;
        self.how_near[lane] = if light == NONE { DARK } else { ALONE };
        let LightPart { flat, is_near, plain } = match found {
            Some(Held::Part(part)) => part,
            Some(Held::Sky) => {
                (self.how_near[lane], self.source[lane]) = (SKY, LightSource::Environment);
                return;
            }
            Some(Held::Bare(bare)) => {
                self.delta.put(lane, bare.punctual.as_ref());
                if let Some((spectrum, punctual)) =
                    self.spectra.get_mut(lane).zip(bare.punctual.as_ref())
                {
                    *spectrum = bare.spectrum(punctual);
                }
                (self.how_near[lane], self.source[lane]) = (DELTA, LightSource::Light(light));
                return;
            }
            None => return,
        };
        if is_near {
            self.how_near[lane] = NEAR;
        }
        put_color(&mut self.radiance, lane, plain.rgb);
        if let Some(spectrum) = self.spectra.get_mut(lane) {
            *spectrum = plain.spectrum();
        }
        self.on_both_sides[lane] = u32::from(plain.on_both_sides);
        self.source[lane] = LightSource::Material(plain.material);
        let Some(flat) = flat else {
            self.kind[lane] = SPHERE;
            return;
        };
        for axis in 0..3 {
            self.corner[axis][lane] = flat.corner[axis];
            self.edges[0][axis][lane] = flat.edges[0][axis];
            self.edges[1][axis][lane] = flat.edges[1][axis];
            self.normal[axis][lane] = flat.normal[axis];
            self.error[axis][lane] = flat.error[axis];
            self.middle[axis][lane] = flat.middle[axis];
        }
        self.far[lane] = flat.far;
        self.pdf[lane] = flat.pdf;
        self.kind[lane] = if flat.is_triangle { TRIANGLE } else { RECTANGLE };
    }

    /// Notes what gave the light of a lane that was sampled alone.
    pub fn note_alone(&mut self, lane: usize, source: LightSource) {
        (self.light[lane], self.source[lane]) = (NONE - 1, source);
    }

    /// True if there is no light in the given number of first lanes.
    fn are_dark(&self, count: usize) -> bool {
        self.how[..count].iter().all(|&how| how == DARK)
    }

    /// Random numbers for the light samples of the given number of first lanes.
    pub fn numbers(
        &self,
        randoms: &BatchRandoms<LANES>,
        count: usize,
        wide: Option<Wide>,
    ) -> [HitLanes; 2] {
        if self.are_dark(count) { [[0.0; LANES]; 2] } else { randoms.pairs(dimension::LIGHT, wide) }
    }

    /// Samples the lights of the given number of first lanes, for paths of these modes, weighted by
    /// multiple importance sampling with the BSDF samples of the paths.
    pub fn arrivals<S: Scatterers>(
        &mut self,
        scene: &CompiledScene,
        (to, modes): (&S, &[ColorMode; LANES]),
        u: &[HitLanes; 2],
        count: usize,
        wide: Option<Wide>,
        arrivals: &mut LightArrivals,
    ) {
        self.sky_lanes.clear();
        arrivals.is_delta = [0; LANES];
        if self.are_dark(count) {
            arrivals.exists = [0; LANES];
            return;
        }
        let how = &self.how[..count];
        let lanes = |which: u32| {
            (0..).zip(how).filter(move |(_, how)| **how == which).map(|(lane, _)| lane)
        };
        self.near.lanes.clear();
        self.near.lanes.extend(lanes(NEAR));
        self.sky_lanes.extend(lanes(SKY));
        self.delta_lanes.clear();
        self.delta_lanes.extend(lanes(DELTA));
        let are_parts = how.iter().any(|&how| (how == FAR) | (how == NEAR));
        let with_near = !self.near.lanes.is_empty();
        if with_near {
            let Self { near, light, part, kind, corner, edges, normal, error, .. } = self;
            let near_part = |lane: usize| area_light(scene, light[lane])?.near(part[lane]);
            let parts = NearParts { positions: to.position(), u, kind, corner, edges };
            near.sample(&parts, near_part, [normal, error], wide);
        }
        match (are_parts, with_near) {
            (true, true) => at_level!(
                wide,
                <S: Scatterers> arrive::<true, S>,
                (
                    lights: &LightSamples = self,
                    to: &S = to,
                    u: &[HitLanes; 2] = u,
                    all: &mut LightArrivals = arrivals
                )
            ),
            (true, false) => at_level!(
                wide,
                <S: Scatterers> arrive::<false, S>,
                (
                    lights: &LightSamples = self,
                    to: &S = to,
                    u: &[HitLanes; 2] = u,
                    all: &mut LightArrivals = arrivals
                )
            ),
            (false, _) => arrivals.exists = [0; LANES],
        }
        if let Some(sky) = scene.environment.as_ref().filter(|_| !self.sky_lanes.is_empty()) {
            self.sky.draw(sky, &self.sky_lanes, u);
            at_level!(
                wide,
                <S: Scatterers> arrive_from_sky::<S>,
                (
                    sky: &SkySamples = &self.sky,
                    probability: &HitLanes = &self.chosen.probability,
                    to: &S = to,
                    places: &mut SkyPlaces = &mut self.sky_places,
                    all: &mut LightArrivals = arrivals,
                )
            );
        }
        if !self.delta_lanes.is_empty() {
            let Self { delta, delta_lanes, light, radiance, .. } = self;
            delta.sample(
                delta_lanes,
                |lane| bare_light(scene, light[lane]),
                (to.position(), modes),
                u,
                radiance,
                wide,
            );
            at_level!(
                wide,
                <S: Scatterers> arrive_from_delta::<S>,
                (
                    delta: &DeltaSamples = &self.delta,
                    probability: &HitLanes = &self.chosen.probability,
                    to: &S = to,
                    all: &mut LightArrivals = arrivals,
                )
            );
        }
    }
}

impl LightArrivals {
    /// The shadow rays.
    pub fn shadow_rays(&self) -> RayColumns<'_> {
        RayColumns { origin: &self.origin, direction: &self.way, end: &self.end }
    }

    /// Directions from vertices to the lights.
    pub fn directions(&self) -> &HitVectors {
        &self.direction
    }

    /// Sets the direction to a light that is sampled elsewhere for a lane.
    pub fn aim(&mut self, lane: usize, direction: Vec3) {
        put(&mut self.direction, lane, direction);
    }

    /// Weights the sample of a lane, given the density of BSDF samples in its direction.
    #[inline(always)]
    pub fn weigh(&mut self, lane: usize, pdf: f32) {
        let weight = if self.is_delta[lane] != 0 {
            1.0
        } else {
            sampling::power_heuristic(self.density[lane], pdf)
        };
        (self.weight[lane], self.scale[lane]) = (weight, weight / self.density[lane]);
    }

    /// Puts a sample of another light into a lane.
    pub fn put(&mut self, lane: usize, shadow_ray: &Ray, weight: f32) {
        for axis in 0..3 {
            self.origin[axis][lane] = shadow_ray.origin[axis];
            self.way[axis][lane] = shadow_ray.direction[axis];
        }
        (self.end[lane], self.weight[lane]) = (shadow_ray.t_max, weight);
    }
}

/// The normal of the plane below which nothing is reflected: the geometric normal, or where the
/// point is lifted the shading normal.
#[inline(always)]
pub fn horizon(flat: Vec3, normal: Vec3, lift: Vec3) -> Vec3 {
    let is_lifted = lift != Vec3::ZERO;
    let pick = |flat: f32, normal: f32| if is_lifted { normal } else { flat };
    Vec3::new(pick(flat.x, normal.x), pick(flat.y, normal.y), pick(flat.z, normal.z))
}

#[inline(always)]
fn tell_far(lights: &mut LightSamples, positions: &HitVectors) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        // As `FlatPart::is_far`.
        let is_far = (vector(&lights.middle) - vector(positions)).length_squared() > lights.far[i];
        lights.how[i] = if is_far { FAR } else { lights.how_near[i] };
    }
}

/// `WITH_NEAR` if there are samples of near lights.
#[inline(always)]
fn arrive<const WITH_NEAR: bool, S: Scatterers>(
    lights: &LightSamples,
    to: &S,
    u: &[HitLanes; 2],
    arrivals: &mut LightArrivals,
) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let position = vector(to.position());
        let part = FlatPart {
            corner: vector(&lights.corner),
            edges: [vector(&lights.edges[0]), vector(&lights.edges[1])],
            normal: vector(&lights.normal),
            error: vector(&lights.error),
            pdf: lights.pdf[i],
            is_triangle: lights.kind[i] == TRIANGLE,
            middle: Vec3::ZERO,
            far: 0.0,
        };
        let u = Vec2::new(u[0][i], u[1][i]);
        let sample = if WITH_NEAR {
            part.near_or_by_area(lights.near.samples.get(i), position, u)
        } else {
            part.sample(position, u)
        };
        let PartSample { direction, pdf, end, is_front, exists } = sample;
        let (share, is_seen) = to.share(i, direction);
        let density = pdf * lights.chosen.probability[i];
        let weight = sampling::power_heuristic(density, share);
        let origin = to.ray_origin(i, direction);
        let is_lit = is_front | (lights.on_both_sides[i] != 0);
        let is_here = (lights.how[i] == FAR) | (lights.how[i] == NEAR);
        for axis in 0..3 {
            arrivals.origin[axis][i] = origin[axis];
            arrivals.way[axis][i] = end[axis] - origin[axis];
            arrivals.direction[axis][i] = direction[axis];
        }
        arrivals.density[i] = density;
        arrivals.end[i] = SHADOW_END;
        arrivals.share[i] = share;
        arrivals.weight[i] = weight;
        arrivals.scale[i] = weight / density;
        arrivals.exists[i] = u32::from(exists & is_lit & is_seen & is_here);
    }
}
