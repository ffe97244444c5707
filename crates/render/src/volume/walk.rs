//! Steps of paths and light rays from surface to surface.

use super::insides::{Filling, Inside};
use super::{Insides, Numbers, OwnMedia};
use crate::compile::{Boundary, CompiledLight, CompiledScene, VolumeTable};
use crate::integrator::estimators::light_pdf_of_glow;
use crate::integrator::path::weight_of_found_light;
use crate::integrator::{Context, MediumVertex, PathState};
use crate::light_sampler::LightSampler;
use crate::settings::LightStrategy;
use snell_intersect::{Hit, HitFilter, RayQuery, SurfaceInteraction, SurfacePoint};
use snell_math::{ColorMode, Ray, SampledSpectrum, Vec3};
use snell_scene::medium::{Beacon, Glow, MediumProperties, Segment, Travel};
use snell_scene::{MaterialId, MediumId};

/// Walks through the media of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Walker<'a> {
    scene: &'a CompiledScene,
    table: &'a VolumeTable,
    lights: &'a LightSampler,
    strategy: LightStrategy,
}

/// What became of a path that was sent along a ray.
#[derive(Clone, Copy, Debug)]
pub enum PathStep {
    /// It is at the hit, or out of the scene.
    Arrived,
    /// A medium scattered it.
    Scattered(MediumVertex),
    /// It passed a surface and goes on along its new ray.
    Passed,
}

/// What became of a light ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightStep {
    /// It is at the light.
    Arrived,
    /// Nothing of it is left.
    Blocked,
    /// It passed a surface and goes on along its new ray.
    Passed,
}

/// Rays meet interfaces too, which nobody sees but who walks through media.
impl HitFilter for Walker<'_> {
    fn accept(&self, ray: &Ray, hit: &Hit) -> bool {
        self.accept_at(ray, 0.0, hit)
    }

    fn accept_at(&self, ray: &Ray, time: f32, hit: &Hit) -> bool {
        self.scene.material(self.scene.material_id(hit)).is_interface() || self.scene.accept_at(ray, time, hit)
    }
}

impl<'a> Walker<'a> {
    /// `None` if the scene has no media.
    pub fn new(context: &Context<'a>) -> Option<Self> {
        let &Context { scene, lights, settings, .. } = context;
        scene.volumes.as_ref().map(|table| Self { scene, table, lights, strategy: settings.light_strategy })
    }

    /// True if rays may have to be traced on from surfaces that they pass.
    pub fn has_passable(&self) -> bool {
        self.table.has_passable
    }

    /// True if a surface that blocks other rays may be passed by one.
    pub fn has_priorities(&self) -> bool {
        self.table.has_priorities
    }

    /// True if it costs more to ask first whether anything blocks a light ray than to follow it to where it ends.
    pub fn follows_light_rays(&self) -> bool {
        self.has_passable() && self.table.is_in_closed_form()
    }

    /// Sends a path along its ray up to a hit. Emission on the way is added to `radiance`.
    pub fn step(
        &self,
        own: &mut OwnMedia,
        ray: &mut Ray,
        state: &mut PathState,
        insides: &mut Insides,
        hit: &Hit,
        numbers: &mut Numbers,
        radiance: &mut SampledSpectrum,
    ) -> PathStep {
        let segment = segment_to(ray, hit);
        let travel = self.travel(own, insides, &segment, state, numbers);
        state.throughput = travel.throughput;
        *radiance += travel.emitted;
        if let Some(scattered) = travel.scattered {
            let footprint = state.cone_width + state.cone_spread * scattered.distance;
            let position = segment.at(scattered.distance);
            return PathStep::Scattered(MediumVertex { position, phase: scattered.phase, footprint });
        }
        if !hit.is_hit() || travel.throughput.is_black() || !self.is_passed(insides, hit) {
            return PathStep::Arrived;
        }
        state.cone_width += state.cone_spread * segment.length;
        let origin = self.pass(own, insides, ray, state.time, hit, state.mode);
        *ray = Ray::new(origin, ray.direction);
        PathStep::Passed
    }

    /// Sends a light ray up to a hit; its value loses what media take.
    pub fn light_step(
        &self,
        own: &mut OwnMedia,
        ray: &mut Ray,
        time: f32,
        value: &mut SampledSpectrum,
        mode: ColorMode,
        insides: &mut Insides,
        hit: &Hit,
        numbers: &mut Numbers,
    ) -> LightStep {
        let is_passed = hit.is_hit() && self.is_passed(insides, hit);
        if hit.is_hit() && !is_passed {
            return LightStep::Blocked;
        }
        *value = self.attenuate(own, insides, &segment_to(ray, hit), *value, mode, numbers);
        if value.is_black() {
            return LightStep::Blocked;
        }
        if !is_passed {
            return LightStep::Arrived;
        }
        let origin = self.pass(own, insides, ray, time, hit, mode);
        let left = ray.t_max - hit.t;
        *ray = Ray::new(origin, ray.direction).with_t_max(left);
        if left > 0.0 { LightStep::Passed } else { LightStep::Arrived }
    }

    /// Takes a ray through the surface that it has hit, and tells where it goes on.
    fn pass(
        &self,
        own: &mut OwnMedia,
        insides: &mut Insides,
        ray: &Ray,
        time: f32,
        hit: &Hit,
        mode: ColorMode,
    ) -> Vec3 {
        let query = RayQuery { time, ..RayQuery::from(ray) };
        let point = self.scene.world.point(query, hit);
        let surface = || self.scene.interaction(ray, time, hit);
        *insides = self.through(own, insides, &point, hit, ray.direction, mode, surface);
        point.ray_origin(ray.direction)
    }

    fn travel(
        &self,
        own: &OwnMedia,
        insides: &Insides,
        segment: &Segment,
        state: &PathState,
        numbers: &mut Numbers,
    ) -> Travel {
        let (throughput, mode) = (state.throughput, state.mode);
        let id = match self.filling(insides) {
            Filling::Empty => return Travel::unchanged(throughput),
            Filling::Own(i) => return self.travel_alike(&own[i as usize], segment, state, numbers),
            Filling::Medium(id) => id,
        };
        let medium = self.table.medium(id);
        if let Some(everywhere) = medium.everywhere(mode) {
            return self.travel_alike(&everywhere, segment, state, numbers);
        }
        let Some((light, glow)) = self.glow(id).filter(|_| state.bsdf_pdf > 0.0) else {
            return medium.travel(segment, throughput, mode, &mut || numbers.next());
        };
        let weight = |distance| {
            let light_pdf = || light_pdf_of_glow(self.lights, &state.receiver, light, glow, segment.at(distance));
            weight_of_found_light(self.strategy, state.bsdf_pdf, light_pdf)
        };
        medium.travel_weighted(segment, throughput, mode, weight, &mut || numbers.next())
    }

    /// Travel through a medium that is the same everywhere.
    fn travel_alike(
        &self,
        medium: &MediumProperties,
        segment: &Segment,
        state: &PathState,
        numbers: &mut Numbers,
    ) -> Travel {
        let u = numbers.next();
        match self.beacon(state, numbers) {
            Some(beacon) => medium.travel_near(&beacon, segment, state.throughput, u),
            None => medium.travel(segment, state.throughput, u),
        }
    }

    /// Where media are to scatter a path more. Only one that was not scattered before: after that, most light comes from all around.
    fn beacon(&self, state: &PathState, numbers: &mut Numbers) -> Option<Beacon> {
        let beacons = self.table.beacons.as_ref()?;
        let is_wanted = state.is_specular && self.strategy != LightStrategy::Bsdf;
        if is_wanted { beacons.sample(|| numbers.next().x) } else { None }
    }

    /// The light that a medium is.
    fn glow(&self, medium: MediumId) -> Option<(usize, &'a Glow)> {
        let light = self.scene.light_of_medium(medium)?;
        match &self.scene.lights()[light] {
            CompiledLight::Medium(_, glow) => Some((light, glow)),
            _ => None,
        }
    }

    /// True if a light ray that ends in these insides has come to the medium that it is meant to come from.
    pub fn is_in(&self, insides: &Insides, glowing: Option<MediumId>) -> bool {
        glowing.is_none_or(|medium| self.filling(insides) == Filling::Medium(medium))
    }

    fn attenuate(
        &self,
        own: &OwnMedia,
        insides: &Insides,
        segment: &Segment,
        value: SampledSpectrum,
        mode: ColorMode,
        numbers: &mut Numbers,
    ) -> SampledSpectrum {
        match self.filling(insides) {
            Filling::Empty => value,
            Filling::Own(i) => own[i as usize].attenuate(segment, value),
            Filling::Medium(id) => self.table.medium(id).attenuate(segment, value, mode, &mut || numbers.next()),
        }
    }

    fn filling(&self, insides: &Insides) -> Filling {
        match insides.innermost() {
            Some(inside) => inside.filling,
            None => self.table.everywhere.map_or(Filling::Empty, Filling::Medium),
        }
    }

    /// True if a ray goes on through the surface: an interface, or one that an inside of higher priority hides.
    fn is_passed(&self, insides: &Insides, hit: &Hit) -> bool {
        let material = self.scene.material_id(hit);
        let is_hidden = |boundary: &Boundary| {
            let other = insides.innermost_but(material);
            other.is_some_and(|other| other.priority > boundary.interior.priority)
        };
        self.table.boundary(material).is_some_and(|b| b.is_interface || is_hidden(b))
    }

    /// Index of refraction on the outer side of a surface.
    pub fn outside_ior(&self, insides: &Insides, hit: &Hit) -> f32 {
        let outside = insides.innermost_but(self.scene.material_id(hit));
        outside.and_then(|inside| self.table.boundary(inside.material)).map_or(1.0, |b| b.ior)
    }

    /// The insides of a ray that goes on from a surface to the other side.
    pub fn beyond(
        &self,
        own: &mut OwnMedia,
        insides: &Insides,
        surface: &SurfaceInteraction,
        hit: &Hit,
        direction: Vec3,
        mode: ColorMode,
    ) -> Insides {
        self.through(own, insides, &SurfacePoint::from(surface), hit, direction, mode, || *surface)
    }

    /// [`Self::beyond`], which asks for the whole surface only where the medium inside depends on it.
    fn through(
        &self,
        own: &mut OwnMedia,
        insides: &Insides,
        point: &SurfacePoint,
        hit: &Hit,
        direction: Vec3,
        mode: ColorMode,
        surface: impl FnOnce() -> SurfaceInteraction,
    ) -> Insides {
        let mut insides = *insides;
        // Curves are met from outside only: what goes in would never come out.
        if point.on_curve {
            return insides;
        }
        let material = self.scene.material_id(hit);
        let Some(boundary) = self.table.boundary(material) else { return insides };
        if point.is_front_facing(direction) {
            insides.enter(self.inside(own, material, boundary, surface, mode));
        } else {
            insides.leave(material);
        }
        insides
    }

    fn inside(
        &self,
        own: &mut OwnMedia,
        id: MaterialId,
        boundary: &Boundary,
        surface: impl FnOnce() -> SurfaceInteraction,
        mode: ColorMode,
    ) -> Inside {
        let material = self.scene.material(id);
        let brought = || {
            material.own_medium(&self.scene.shading_point(&surface(), 0.0, mode)).map(|medium| {
                own.push(medium);
                Filling::Own(own.len() as u32 - 1)
            })
        };
        let filling = match boundary.interior.medium {
            Some(medium) => Filling::Medium(medium),
            None => brought().unwrap_or_default(),
        };
        Inside { material: id, priority: boundary.interior.priority, filling }
    }

    /// The surfaces whose insides a point is in, outermost first: those that most of three rays first meet from within.
    pub fn surfaces_around(&self, point: Vec3) -> Vec<(MaterialId, SurfaceInteraction)> {
        /// Most surfaces that a ray passes.
        const MOST_SURFACES: usize = 1000;
        /// In no special direction.
        const DIRECTIONS: [Vec3; 3] =
            [Vec3::new(0.267, 0.802, 0.535), Vec3::new(-0.873, 0.218, 0.436), Vec3::new(0.371, -0.557, -0.743)];
        let mut from_within: Vec<(MaterialId, SurfaceInteraction)> = Vec::new();
        for direction in DIRECTIONS {
            let mut met = Vec::new();
            let mut ray = Ray::new(point, direction);
            for _ in 0..MOST_SURFACES {
                let hit = self.scene.world.closest_one(&ray, self);
                if !hit.is_hit() {
                    break;
                }
                let surface = self.scene.world.interaction(&ray, &hit);
                let id = self.scene.material_id(&hit);
                if self.table.boundary(id).is_some() && !met.contains(&id) {
                    met.push(id);
                    if !surface.is_front_facing(direction) {
                        from_within.push((id, surface));
                    }
                }
                ray = Ray::new(surface.ray_origin(direction), direction);
            }
        }
        let mut around: Vec<(MaterialId, SurfaceInteraction)> = Vec::new();
        for (id, surface) in &from_within {
            let is_most = from_within.iter().filter(|other| other.0 == *id).count() >= 2;
            if is_most && around.iter().all(|other| other.0 != *id) {
                around.push((*id, *surface));
            }
        }
        // The farther one leaves it, the earlier one entered it.
        around.sort_by(|a, b| (b.1.position - point).length().total_cmp(&(a.1.position - point).length()));
        around
    }

    /// The insides of these surfaces, for a path of this colour mode.
    pub fn insides_of(
        &self,
        own: &mut OwnMedia,
        surfaces: &[(MaterialId, SurfaceInteraction)],
        mode: ColorMode,
    ) -> Insides {
        let mut insides = Insides::default();
        for (id, surface) in surfaces {
            if let Some(boundary) = self.table.boundary(*id) {
                insides.enter(self.inside(own, *id, boundary, || *surface, mode));
            }
        }
        insides
    }
}

/// The way to a hit, or to the end of the ray.
fn segment_to(ray: &Ray, hit: &Hit) -> Segment {
    let scale = ray.direction.length();
    let end = if hit.is_hit() { hit.t } else { ray.t_max };
    Segment { origin: ray.origin, direction: ray.direction / scale, length: end * scale }
}
