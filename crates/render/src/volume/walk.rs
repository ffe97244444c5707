//! Moves paths and light rays from surface to surface through media.

use super::insides::{Filling, Inside};
use super::interface_crossings::InterfaceCrossing;
use super::known::{Crossed, KnownInsides};
use super::{Insides, Numbers, OwnMedia};
use crate::compile::{Boundary, CameraFilter, CompiledLight, CompiledScene, VolumeTable};
use crate::integrator::carried::{Carried, Rest};
use crate::integrator::estimators::light_pdf_of_glow;
use crate::integrator::path::weight_of_found_light;
use crate::integrator::{Context, MediumVertex};
use crate::light_sampler::LightSampler;
use crate::settings::LightStrategy;
use snell_intersect::{AcceptAll, Hit, HitFilter, RayQuery, SurfaceInteraction, SurfacePoint};
use snell_math::{ColorMode, Ray, SampledSpectrum, Vec2, Vec3};
use snell_scene::medium::{EquiangularLight, Glow, MediumProperties, Scattering, Segment, Travel};
use snell_scene::{MaterialId, MediumId};

/// Moves rays through the media of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Walker<'a> {
    scene: &'a CompiledScene,
    table: &'a VolumeTable,
    lights: &'a LightSampler,
    strategy: LightStrategy,
}

/// What happened to a path along a ray.
#[derive(Clone, Copy, Debug)]
pub enum PathStep {
    /// The path arrived at the hit, or left the scene.
    Arrived,
    /// A medium scattered the path at this vertex.
    Scattered(MediumVertex),
    /// The path passed an interface and continues along its new ray.
    Passed,
}

/// A medium that scatters light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatteringMedium {
    /// See [`Walker::medium_tag`].
    pub tag: u16,
    /// The mean extinction per scene unit; `None` if it is not the same everywhere.
    pub extinction: Option<f32>,
}

/// What happened to a light ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightStep {
    /// The light ray arrived at the light.
    Arrived,
    /// The light ray was absorbed or blocked.
    Blocked,
    /// The light ray passed an interface and continues along its new ray.
    Passed,
}

/// Accepts what the scene's filter accepts, and interfaces too, which matter to rays through media
/// only.
impl HitFilter for Walker<'_> {
    fn accept(&self, ray: &Ray, hit: &Hit) -> bool {
        self.accept_at(ray, 0.0, hit)
    }

    fn accept_at(&self, ray: &Ray, time: f32, hit: &Hit) -> bool {
        self.scene.material(self.scene.material_id(hit)).is_interface()
            || self.scene.accept_at(ray, time, hit)
    }
}

impl<'a> Walker<'a> {
    /// Makes the walker; `None` if the scene has no media.
    pub fn new(context: &Context<'a>) -> Option<Self> {
        let &Context { scene, lights, settings, .. } = context;
        scene.volumes.as_ref().map(|table| Self {
            scene,
            table,
            lights,
            strategy: settings.light_strategy,
        })
    }

    /// The surface at a hit of a ray.
    pub fn interaction(&self, ray: &Ray, time: f32, hit: &Hit) -> SurfaceInteraction {
        self.scene.interaction(ray, time, hit)
    }

    /// True if rays may pass some surfaces, and must be traced on from there.
    pub fn has_passable(&self) -> bool {
        self.table.has_passable
    }

    /// True if priorities let some rays pass a surface that blocks other rays.
    pub fn has_priorities(&self) -> bool {
        self.table.has_priorities
    }

    /// True if following light rays through media to their end is cheaper than testing them for
    /// occlusion first.
    pub fn follows_light_rays(&self) -> bool {
        self.has_passable() && self.table.is_in_closed_form()
    }

    /// The filter of hits of camera rays, and of those at later depths.
    pub fn camera_filter(&self) -> CameraFilter<'_> {
        CameraFilter::new(self.scene, self.filter())
    }

    /// The filter of hits, which accepts every hit if the scene allows it.
    pub fn filter(&self) -> &dyn HitFilter {
        if self.table.sees_all { &AcceptAll } else { self }
    }

    /// True if the transmittance of light rays needs no random numbers.
    pub fn is_in_closed_form(&self) -> bool {
        self.table.is_in_closed_form()
    }

    /// Moves a path along its ray up to a hit. Emission on the way is added to `radiance`.
    pub fn step(
        &self,
        own: &mut OwnMedia,
        ray: &mut Ray,
        (carried, rest): (&mut Carried, &Rest),
        insides: &mut Insides,
        hit: &Hit,
        numbers: &mut Numbers,
        radiance: &mut SampledSpectrum,
    ) -> PathStep {
        if let Some(vertex) =
            self.travel(own, insides, ray, hit, (carried, rest), numbers, radiance)
        {
            return PathStep::Scattered(vertex);
        }
        if self.path_passes(insides, carried, hit).is_none() {
            return PathStep::Arrived;
        }
        let origin = self.pass(own, insides, ray, rest.time, hit, rest.mode);
        *ray = Ray::new(origin, ray.direction);
        PathStep::Passed
    }

    /// Moves a path through its current medium up to a hit, or to the point where the medium
    /// scatters it. Returns that point.
    pub fn travel(
        &self,
        own: &OwnMedia,
        insides: &Insides,
        ray: &Ray,
        hit: &Hit,
        (carried, rest): (&mut Carried, &Rest),
        numbers: &mut Numbers,
        radiance: &mut SampledSpectrum,
    ) -> Option<MediumVertex> {
        let segment =
            Segment { origin: ray.origin, direction: ray.direction, length: end_of(ray, hit) };
        let travel = self.travel_along(own, insides, &segment, (carried, rest), numbers);
        carried.throughput = travel.throughput;
        *radiance += travel.emitted;
        travel.scattered.map(|scattered| Self::vertex(ray, carried, &scattered))
    }

    /// The vertex at which a medium scattered the path of a ray.
    pub fn vertex(
        ray: &Ray,
        carried: &Carried,
        &Scattering { distance, phase }: &Scattering,
    ) -> MediumVertex {
        let footprint = carried.cone_width + carried.cone_spread * distance;
        MediumVertex { position: ray.at(distance), phase, footprint }
    }

    /// If a path goes through the surface that it hit, widens its cone up to there and returns the
    /// surface's material. `None`, with nothing changed, if the path has ended or stops there.
    pub fn path_passes(
        &self,
        insides: &Insides,
        carried: &mut Carried,
        hit: &Hit,
    ) -> Option<MaterialId> {
        if !hit.is_hit() || carried.throughput.is_black() {
            return None;
        }
        let material = self.passed(insides, hit)?;
        carried.cone_width += carried.cone_spread * hit.t;
        Some(material)
    }

    /// Moves a light ray up to a hit, and multiplies its value by the transmittance.
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
        let passed = match self.light_passes(insides, hit) {
            Some(passed) => passed,
            None => return LightStep::Blocked,
        };
        *value = self.attenuate(own, insides, ray, hit, *value, mode, || numbers.next());
        if value.is_black() {
            return LightStep::Blocked;
        }
        if passed.is_none() {
            return LightStep::Arrived;
        }
        let origin = self.pass(own, insides, ray, time, hit, mode);
        let left = ray.t_max - hit.t;
        *ray = Ray::new(origin, ray.direction).with_t_max(left);
        if left > 0.0 { LightStep::Passed } else { LightStep::Arrived }
    }

    /// Returns `None` if a surface blocks the light ray at its hit, otherwise the material of the
    /// surface that it passes; that is `None` without a hit.
    pub fn light_passes(&self, insides: &Insides, hit: &Hit) -> Option<Option<MaterialId>> {
        if hit.is_hit() { self.passed(insides, hit).map(Some) } else { Some(None) }
    }

    /// Moves a ray through the surface that it hit. Updates the objects that it is inside, and
    /// returns the origin of the continued ray.
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

    fn travel_along(
        &self,
        own: &OwnMedia,
        insides: &Insides,
        segment: &Segment,
        (carried, rest): (&Carried, &Rest),
        numbers: &mut Numbers,
    ) -> Travel {
        let (throughput, mode) = (carried.throughput, rest.mode);
        let id = match self.filling(insides) {
            Filling::Empty => return Travel::unchanged(throughput),
            Filling::Own(i) => {
                return self.travel_homogeneous(&own[i as usize], segment, carried, numbers);
            }
            Filling::Medium(id) => id,
        };
        let medium = self.table.medium(id);
        if let Some(everywhere) = medium.everywhere(mode) {
            return self.travel_homogeneous(&everywhere, segment, carried, numbers);
        }
        let Some((light, glow)) = self.glow(id).filter(|_| carried.bsdf_pdf > 0.0) else {
            return medium.travel(segment, throughput, mode, &mut || numbers.next());
        };
        let weight = |distance| {
            let light_pdf = || {
                light_pdf_of_glow(
                    self.lights,
                    &carried.receiver(),
                    light,
                    glow,
                    segment.at(distance),
                )
            };
            weight_of_found_light(self.strategy, carried.bsdf_pdf, light_pdf)
        };
        medium.travel_weighted(segment, throughput, mode, weight, &mut || numbers.next())
    }

    /// Moves a path through a homogeneous medium.
    fn travel_homogeneous(
        &self,
        medium: &MediumProperties,
        segment: &Segment,
        carried: &Carried,
        numbers: &mut Numbers,
    ) -> Travel {
        let u = numbers.next();
        match self.equiangular_light(carried, numbers) {
            Some(equiangular_light) => {
                medium.travel_near(&equiangular_light, segment, carried.throughput, u)
            }
            None => medium.travel(segment, carried.throughput, u),
        }
    }

    /// The light near which the path is scattered more often (equiangular sampling). Only paths
    /// that were not scattered before have one: after that, most light comes from all directions.
    fn equiangular_light(
        &self,
        carried: &Carried,
        numbers: &mut Numbers,
    ) -> Option<EquiangularLight> {
        let equiangular_lights = self
            .table
            .equiangular_lights
            .as_ref()
            .filter(|_| self.seeks_equiangular_lights(carried))?;
        equiangular_lights.sample(|| numbers.next().x)
    }

    /// The number of a medium among the lights, and its emission, if it can be sampled.
    fn glow(&self, medium: MediumId) -> Option<(usize, &'a Glow)> {
        let light = self.scene.light_of_medium(medium)?;
        match &self.scene.lights()[light] {
            CompiledLight::Medium(_, glow) => Some((light, glow)),
            _ => None,
        }
    }

    /// True if a light ray that ends inside these objects is in the medium whose light it carries,
    /// or carries no light of a medium.
    pub fn is_in(&self, insides: &Insides, glowing: Option<MediumId>) -> bool {
        glowing.is_none_or(|medium| self.filling(insides) == Filling::Medium(medium))
    }

    /// The value of a light ray after a hit or its end: multiplied by the transmittance up to
    /// there.
    pub fn attenuate(
        &self,
        own: &OwnMedia,
        insides: &Insides,
        ray: &Ray,
        hit: &Hit,
        value: SampledSpectrum,
        mode: ColorMode,
        mut numbers: impl FnMut() -> Vec2,
    ) -> SampledSpectrum {
        let id = match self.filling(insides) {
            Filling::Empty => return value,
            Filling::Own(i) => return own[i as usize].attenuate(length_to(ray, hit), value),
            Filling::Medium(id) => id,
        };
        let medium = self.table.medium(id);
        match medium.everywhere(mode) {
            Some(everywhere) => everywhere.attenuate(length_to(ray, hit), value),
            None => medium.attenuate(&segment_to(ray, hit), value, mode, &mut numbers),
        }
    }

    /// What fills the space outside of all objects.
    pub fn everywhere(&self) -> Filling {
        self.table.everywhere.map_or(Filling::Empty, Filling::Medium)
    }

    /// The values in [`ColorMode::Rgb`] of the medium that fills an object, if it is homogeneous
    /// and emits no light.
    pub fn homogeneous_in_rgb<'m>(
        &'m self,
        own: &'m OwnMedia,
        filling: Filling,
    ) -> Option<&'m MediumProperties> {
        let medium = match filling {
            Filling::Empty => None,
            Filling::Own(i) => Some(&own[i as usize]),
            Filling::Medium(id) => self.table.medium(id).everywhere_in_rgb(),
        };
        medium.filter(|medium| medium.emission.is_black())
    }

    /// True if media scatter the path [more often](Self::equiangular_light) near lights.
    pub fn seeks_equiangular_lights(&self, carried: &Carried) -> bool {
        self.table.equiangular_lights.is_some()
            && carried.marks.is_specular()
            && self.strategy != LightStrategy::Bsdf
    }

    /// The medium inside these objects, if it scatters light.
    pub fn scattering_medium(
        &self,
        own: &OwnMedia,
        insides: &Insides,
        mode: ColorMode,
    ) -> Option<ScatteringMedium> {
        let everywhere = match self.filling(insides) {
            Filling::Own(i) => {
                Some(own[i as usize]).filter(|own| !own.sigma_s.is_black()).map(Some)?
            }
            Filling::Medium(id) if self.table.scatters(id) => {
                self.table.medium(id).everywhere(mode)
            }
            Filling::Empty | Filling::Medium(_) => return None,
        };
        let extinction = everywhere.map(|medium| medium.sigma_t().average());
        Some(ScatteringMedium { tag: self.medium_tag(insides), extinction })
    }

    /// A number that tells the media inside these objects apart, all but a few in scenes with more
    /// than thousands.
    pub fn medium_tag(&self, insides: &Insides) -> u16 {
        /// The bit of media that materials define.
        const OWN: u16 = 1 << 15;
        match self.filling(insides) {
            Filling::Empty => 0,
            Filling::Medium(id) => id.0 as u16 & !OWN,
            Filling::Own(_) => {
                insides.innermost().map_or(0, |inside| inside.material.0 as u16) | OWN
            }
        }
    }

    fn filling(&self, insides: &Insides) -> Filling {
        insides.filling(self.everywhere())
    }

    /// The material of the surface that was hit, if a ray passes it. The surface is then an
    /// interface, or hidden by an object of higher priority.
    fn passed(&self, insides: &Insides, hit: &Hit) -> Option<MaterialId> {
        let material = self.scene.material_id(hit);
        let is_hidden = |boundary: &Boundary| {
            let other = insides.innermost_but(material);
            other.is_some_and(|other| other.priority > boundary.interior.priority)
        };
        self.table.boundary(material).filter(|b| b.is_interface || is_hidden(b)).map(|_| material)
    }

    /// Index of refraction on the outer side of the surface that was hit.
    pub fn outside_ior(&self, insides: &Insides, hit: &Hit) -> f32 {
        let outside = insides.innermost_but(self.scene.material_id(hit));
        outside.and_then(|inside| self.table.boundary(inside.material)).map_or(1.0, |b| b.ior)
    }

    /// The objects that a ray in this direction is inside after it passes a surface.
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

    /// [`Self::beyond`] with a part of the surface. `surface` computes the whole of it, and is
    /// called only where the medium inside depends on it.
    #[inline]
    pub fn through(
        &self,
        own: &mut OwnMedia,
        insides: &Insides,
        point: &SurfacePoint,
        hit: &Hit,
        direction: Vec3,
        mode: ColorMode,
        surface: impl FnOnce() -> SurfaceInteraction,
    ) -> Insides {
        let material = self.scene.material_id(hit);
        // Curves are hit from outside only, so a ray that enters one would never leave.
        let Some(boundary) = self.table.boundary(material).filter(|_| !point.on_curve) else {
            return *insides;
        };
        let enters = point.is_front_facing(direction);
        self.changed(own, insides, material, boundary, enters, mode, surface)
    }

    fn changed(
        &self,
        own: &mut OwnMedia,
        insides: &Insides,
        material: MaterialId,
        boundary: &Boundary,
        enters: bool,
        mode: ColorMode,
        surface: impl FnOnce() -> SurfaceInteraction,
    ) -> Insides {
        let mut insides = *insides;
        match enters {
            true => insides.enter(self.inside(own, material, boundary, surface, mode)),
            false => insides.leave(material),
        }
        insides
    }

    /// The number of the set of objects after a ray passes a surface of this material, given the
    /// number before.
    pub fn crossed(
        &self,
        known: &mut KnownInsides,
        from: u32,
        crossing: &InterfaceCrossing,
        material: MaterialId,
        mode: ColorMode,
        surface: impl FnOnce() -> SurfaceInteraction,
    ) -> u32 {
        let Some(boundary) = self.table.boundary(material).filter(|_| !crossing.on_curve) else {
            return from;
        };
        let enters = crossing.enters;
        known.crossed(Crossed { from, material, enters }, |insides, own| {
            let is_certain = !enters
                || boundary.interior.medium.is_some()
                || !self.scene.material(material).has_own_medium();
            (self.changed(own, insides, material, boundary, enters, mode, surface), is_certain)
        })
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

    /// The objects that a point is inside, outermost first. An object counts if at least two of
    /// three rays from the point first hit its surface from inside.
    pub fn surfaces_around(&self, point: Vec3) -> Vec<(MaterialId, SurfaceInteraction)> {
        /// The largest number of surfaces that a ray may pass.
        const MOST_SURFACES: usize = 1000;
        /// Three arbitrary directions.
        const DIRECTIONS: [Vec3; 3] = [
            Vec3::new(0.267, 0.802, 0.535),
            Vec3::new(-0.873, 0.218, 0.436),
            Vec3::new(0.371, -0.557, -0.743),
        ];
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
        // The farther away a ray leaves an object, the earlier that object counts as entered.
        around.sort_by(|a, b| {
            (b.1.position - point).length().total_cmp(&(a.1.position - point).length())
        });
        around
    }

    /// The set of these objects, for a path of this colour mode.
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

/// The parameter `t` of the hit, or of the end of the ray.
pub fn end_of(ray: &Ray, hit: &Hit) -> f32 {
    if hit.is_hit() { hit.t } else { ray.t_max }
}

/// The distance to a hit, or to the end of the ray.
pub fn length_to(ray: &Ray, hit: &Hit) -> f32 {
    end_of(ray, hit) * ray.direction.length()
}

/// The segment of the ray up to a hit, or to its end.
fn segment_to(ray: &Ray, hit: &Hit) -> Segment {
    let direction = ray.direction / ray.direction.length();
    Segment { origin: ray.origin, direction, length: length_to(ray, hit) }
}
