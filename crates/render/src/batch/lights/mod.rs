//! Batches of light samples, with the same bits as [`crate::integrator::estimators::sample_light`].
//! The lights are environments, lights without a surface, and surfaces of uniform emission: flat
//! ones that are far away, and near rectangles, triangles and spheres.

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

/// The lights of the lanes and their samples. Lanes without a light hold arbitrary values.
#[derive(Debug)]
pub struct LightSamples {
    /// The light that each lane has chosen.
    pub chosen: ChosenLights,
    /// The number of the light whose data a lane holds already. The next vertex often chooses the
    /// same light and part again.
    light: [u32; LANES],
    /// The part of that light.
    part: [u32; LANES],
    /// How each lane samples its light: [`DARK`] to [`ALONE`].
    pub how: [u32; LANES],
    /// What `how` is for points near the light, and for spheres at any distance; [`ALONE`] for
    /// lights that are sampled elsewhere.
    how_near: [u32; LANES],
    /// The source of each lane's light.
    pub source: [LightSource; LANES],
    /// By channel, the emitted radiance.
    pub radiance: HitColors,
    /// The spectrum of the radiance of each lane, in spectral mode; empty in RGB mode.
    spectra: Vec<LightSpectrum>,
    corner: HitVectors,
    edges: [HitVectors; 2],
    /// Unit normal of the surface; for spheres, the normal at the sampled point.
    normal: HitVectors,
    /// Error bound of points on the surface; for spheres, of the sampled point.
    error: HitVectors,
    middle: HitVectors,
    /// The squared distance from `middle` beyond which the part counts as far; infinite if it is
    /// not flat.
    far: HitLanes,
    /// Density of the samples per unit of area.
    pdf: HitLanes,
    kind: [u32; LANES],
    /// 1 if both sides emit, 0 if only the front does.
    on_both_sides: [u32; LANES],
    near: NearLights,
    /// The lanes that sample the environment.
    sky_lanes: Vec<u32>,
    sky: SkySamples,
    sky_places: SkyPlaces,
    /// The lanes that sample a light without a surface.
    delta_lanes: Vec<u32>,
    delta: DeltaSamples,
}

/// `how` of a lane without a light.
pub const DARK: u32 = 0;
/// `how` of a flat part of a light that is sampled by area.
const FAR: u32 = 1;
/// `how` of a part of a light that is sampled by solid angle.
const NEAR: u32 = 2;
/// `how` of the environment.
const SKY: u32 = 3;
/// `how` of a light without a surface.
const DELTA: u32 = 4;
/// `how` of a light that [`LightSamples`] does not handle.
pub const ALONE: u32 = 5;

/// Light samples as they arrive at the vertices, by lane.
#[derive(Debug)]
pub struct LightArrivals {
    pub origin: HitVectors,
    /// Direction (not normalised) and end of the light ray.
    pub way: HitVectors,
    pub end: HitLanes,
    /// Unit direction from the vertex to the light, and the density per steradian with which it was
    /// chosen.
    pub direction: HitVectors,
    pub density: HitLanes,
    /// Density with which an unguided path samples this direction: at Lambertian surfaces, the
    /// cosine of incidence over pi.
    pub share: HitLanes,
    /// The weight of multiple importance sampling.
    pub weight: HitLanes,
    /// The weight divided by the density of the sample.
    pub scale: HitLanes,
    /// 1 if the light has no surface, so that BSDF samples cannot find it; otherwise 0.
    pub is_delta: [u32; LANES],
    /// 1 where light arrives, 0 where none does.
    pub exists: [u32; LANES],
}

/// Surfaces as receivers of light samples.
#[derive(Clone, Copy, Debug)]
pub struct Surfaces<'a> {
    pub points: &'a TrianglePoints,
    /// Shading normals, on the side of the path.
    pub normal: &'a HitVectors,
    /// Directions towards the origins of the rays.
    pub wo: &'a HitVectors,
    /// See [`crate::integrator::estimators::Skin::lift`].
    pub lift: &'a HitVectors,
}

/// The vertices that receive light samples: points on surfaces or in media.
pub trait Scatterers {
    fn position(&self) -> &HitVectors;

    /// The density per steradian with which the path of a lane samples a direction, and whether
    /// light from that direction can be scattered along the path.
    fn share(&self, lane: usize, direction: Vec3) -> (f32, bool);

    /// The origin of a ray that leaves the vertex of a lane in this direction.
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

/// Surfaces whose geometry alone is available here. Their BSDFs are evaluated one by one, and the
/// density of BSDF samples is applied later by [`LightArrivals::weigh`].
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

/// The origin of a ray that leaves the surface of a lane in this direction.
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

/// Points in media as receivers of light samples.
#[derive(Clone, Copy, Debug)]
pub struct MediumPoints<'a> {
    pub position: &'a HitVectors,
    /// Directions towards the origins of the rays.
    pub wo: &'a HitVectors,
    /// The phase functions at the points.
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

/// A chosen light that [`LightSamples`] handles.
#[derive(Clone, Copy)]
enum Held<'a> {
    Part(LightPart<'a>),
    Sky,
    Bare(&'a BareLight),
}

impl<'a> Held<'a> {
    /// The light, or its part, if [`LightSamples`] handles it; otherwise `None`.
    fn of(scene: &'a CompiledScene, light: u32, part: u32) -> Option<Self> {
        match scene.lights().get(light as usize)? {
            CompiledLight::Area(_) => LightPart::of(scene, light, part).map(Self::Part),
            CompiledLight::Environment => {
                let has_portals = scene.environment.as_ref().is_some_and(|sky| sky.has_portals());
                (!has_portals).then_some(Self::Sky)
            }
            CompiledLight::Light(light) => Some(Self::Bare(light)),
            CompiledLight::Moving(_) | CompiledLight::Medium(..) => None,
        }
    }
}

/// A part of an emissive surface that can be sampled in batches, at least from far points.
#[derive(Clone, Copy)]
struct LightPart<'a> {
    /// The flat part; `None` for a sphere.
    flat: Option<&'a FlatPart>,
    is_near: bool,
    plain: &'a PlainEmission,
}

impl<'a> LightPart<'a> {
    /// The part of an emissive surface, if `light` is one and the part can be sampled in batches.
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
    /// Light samples for paths of this colour model.
    pub fn new(color: ColorModel) -> Self {
        let spectra = match color {
            ColorModel::Rgb => Vec::new(),
            ColorModel::Spectral => vec![LightSpectrum::default(); LANES],
        };
        Self { spectra, ..Self::default() }
    }

    /// Computes the radiance that is still missing in the first `count` lanes: that of the
    /// environment in its sampled direction, and values at the wavelengths of the paths.
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

    /// Chooses lights for the first `count` receivers, and decides how each lane samples its light.
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

    /// Looks up the lights that were chosen for the first `count` points, and decides how each lane
    /// samples its light.
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
        // All are found before any is copied, so that several loads from memory overlap.
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

    /// Puts the data of the light that was chosen for a lane into the lane. `found` is `None` for a
    /// light that is not handled here.
    fn put(&mut self, lane: usize, found: Option<Held>) {
        let (light, part) = (self.chosen.light[lane], self.chosen.part[lane]);
        (self.light[lane], self.part[lane]) = (light, part);
        // No point is as far as that.
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

    /// Records the source of the light of a lane that was sampled alone, and that the lane holds
    /// the data of no light.
    pub fn note_alone(&mut self, lane: usize, source: LightSource) {
        (self.light[lane], self.source[lane]) = (NONE - 1, source);
    }

    /// True if none of the first `count` lanes has a light.
    fn are_dark(&self, count: usize) -> bool {
        self.how[..count].iter().all(|&how| how == DARK)
    }

    /// Random numbers for the light samples of the first `count` lanes.
    pub fn numbers(
        &self,
        randoms: &BatchRandoms<LANES>,
        count: usize,
        wide: Option<Wide>,
    ) -> [HitLanes; 2] {
        if self.are_dark(count) { [[0.0; LANES]; 2] } else { randoms.pairs(dimension::LIGHT, wide) }
    }

    /// Samples the lights of the first `count` lanes for paths in these modes. The samples are
    /// weighted by multiple importance sampling with the BSDF samples of the paths.
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
    /// The shadow rays from the vertices to the lights.
    pub fn shadow_rays(&self) -> RayColumns<'_> {
        RayColumns { origin: &self.origin, direction: &self.way, end: &self.end }
    }

    /// Unit directions from the vertices to the lights.
    pub fn directions(&self) -> &HitVectors {
        &self.direction
    }

    /// Sets the direction to the light of a lane that is sampled elsewhere.
    pub fn aim(&mut self, lane: usize, direction: Vec3) {
        put(&mut self.direction, lane, direction);
    }

    /// Computes the MIS weight of the light sample of a lane, given the density with which the BSDF
    /// samples its direction.
    #[inline(always)]
    pub fn weigh(&mut self, lane: usize, pdf: f32) {
        let weight = if self.is_delta[lane] != 0 {
            1.0
        } else {
            sampling::power_heuristic(self.density[lane], pdf)
        };
        (self.weight[lane], self.scale[lane]) = (weight, weight / self.density[lane]);
    }

    /// Puts the sample of a light that is handled elsewhere into a lane.
    pub fn put(&mut self, lane: usize, shadow_ray: &Ray, weight: f32) {
        for axis in 0..3 {
            self.origin[axis][lane] = shadow_ray.origin[axis];
            self.way[axis][lane] = shadow_ray.direction[axis];
        }
        (self.end[lane], self.weight[lane]) = (shadow_ray.t_max, weight);
    }
}

/// The normal of the plane below which nothing is reflected: the geometric normal, or the shading
/// normal where the point is lifted.
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
        // This is the test of `FlatPart::is_far`.
        let is_far = (vector(&lights.middle) - vector(positions)).length_squared() > lights.far[i];
        lights.how[i] = if is_far { FAR } else { lights.how_near[i] };
    }
}

/// Writes the arrivals of flat parts and spheres. `WITH_NEAR` is true if some lanes have samples of
/// near lights.
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
