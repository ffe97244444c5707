//! Steps that integrators share: light samples, and light that arrives from outside of the scene.

use super::light_part::LightSource;
use super::{Context, PathState, SurfaceVertex, Vertex};
use crate::compile::{CompiledLight, PlainEmission};
use crate::light_sampler::{ChosenLight, LightSampler, Receiver};
use crate::settings::{LightStrategy, Terminator};
use snell_intersect::SurfaceInteraction;
use snell_intersect::smooth::lifted_ray_origin;
use snell_math::robust::offset_ray_origin;
use snell_math::{ColorMode, Ray, SampledSpectrum, Vec2, Vec3};
use snell_scene::light::area::{AreaLight, AreaSample, DirectedPoint, DirectedSample, PartSample};
use snell_scene::light::environment::SkySample;
use snell_scene::material::ShadingBsdf;
use snell_scene::medium::Glow;
use snell_scene::{Background, Material, MediumId, ShadowCatcher};

/// A shadow ray to a point ends at this fraction of the distance, just short of the light itself.
pub(crate) const SHADOW_END: f32 = 1.0 - 1e-4;

/// The environment's radiance along the ray of a vertex; black without an environment.
pub fn environment(context: &Context, vertex: &Vertex) -> SampledSpectrum {
    let Ray { origin, direction, .. } = *vertex.ray;
    let environment = context.scene.environment.as_ref();
    environment
        .filter(|sky| sky.is_seen(origin, direction))
        .map_or(SampledSpectrum::ZERO, |sky| sky.radiance(direction, vertex.state.mode))
}

/// The background along a ray that leaves the scene, or `None` if the ray carries the environment's
/// light instead.
///
/// The background is meant for camera rays. In scenes without an environment, mirrors and glass
/// show it too.
pub fn background(context: &Context, depth: u32, state: &PathState) -> Option<SampledSpectrum> {
    let shows = depth == 0 || (state.is_specular && context.scene.environment.is_none());
    match context.scene.background {
        Background::Color(color) | Background::ShadowCatcher(ShadowCatcher { color, .. })
            if shows =>
        {
            Some(state.mode.illuminant(color))
        }
        Background::Transparent if depth == 0 => Some(SampledSpectrum::ZERO),
        _ => None,
    }
}

/// A light sample of any kind, before shadow rays are traced.
#[derive(Clone, Copy, Debug)]
pub struct IncidentLight {
    /// Unit direction to the light.
    pub direction: Vec3,
    /// Incident radiance, or irradiance for delta lights.
    pub radiance: SampledSpectrum,
    /// Density per steradian; 1 for lights without a surface.
    pub pdf: f32,
    /// True if no BSDF sample can find this light.
    pub is_delta: bool,
    /// The source of the light.
    pub source: LightSource,
    /// The shadow ray.
    pub shadow_ray: Ray,
    /// The emissive medium that must be at the end of the ray; `None` for all other light.
    pub glowing: Option<MediumId>,
}

/// The receiver of light, at which shadow rays start.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// The point that receives light.
    pub position: Vec3,
    /// The surface at the point; `None` for a point in a medium.
    pub surface: Option<Skin>,
    /// What the lanes of spectra stand for on the path.
    pub mode: ColorMode,
    /// The time of the path's rays, from 0 to 1.
    pub time: f32,
}

/// What a surface adds to the origins of rays that leave it.
#[derive(Clone, Copy, Debug)]
pub struct Skin {
    /// Bound of the absolute error of each coordinate of the position.
    pub position_error: Vec3,
    /// Unit geometric normal.
    pub geometric_normal: Vec3,
    /// The offset from the point to the smooth surface that the vertex normals imply. It is zero
    /// where there is no such surface, or where it makes no difference.
    pub lift: Vec3,
}

/// True if points on a surface of this material may be lifted ([`snell_intersect::smooth`]).
/// Boundaries of media are not lifted, so that inside and outside stay unambiguous.
pub fn may_be_lifted(context: &Context, material: &Material) -> bool {
    context.settings.terminator == Terminator::Smooth && material.bounded_interior().is_none()
}

impl Arrival {
    /// The vertex on a surface with this BSDF as a receiver of light. Where the point is lifted,
    /// light arrives from all directions above the horizon of the shading normal, and shadow rays
    /// decide about occlusion.
    pub fn at_surface(
        context: &Context,
        vertex: &Vertex,
        surface: &SurfaceVertex,
        shading: &mut ShadingBsdf,
    ) -> Self {
        let &SurfaceInteraction { position, position_error, geometric_normal, .. } =
            surface.interaction;
        let is_matte = shading.is_opaque() && !shading.is_delta();
        let lift = if is_matte { lift_of_opaque(context, vertex, surface) } else { Vec3::ZERO };
        if lift != Vec3::ZERO {
            shading.geometric_normal = shading.frame.z;
        }
        Self {
            position,
            surface: Some(Skin { position_error, geometric_normal, lift }),
            mode: surface.mode,
            time: vertex.state.time,
        }
    }

    /// The lift of the point; see [`Skin::lift`].
    pub fn lift(&self) -> Vec3 {
        self.surface.map_or(Vec3::ZERO, |skin| skin.lift)
    }

    /// The origin of a ray that leaves the point in this direction.
    pub fn ray_origin(&self, direction: Vec3) -> Vec3 {
        self.surface.map_or(self.position, |Skin { position_error, geometric_normal, lift }| {
            lifted_ray_origin(self.position, position_error, geometric_normal, lift, direction)
        })
    }
}

/// The [lift](Skin::lift) of a point on an opaque surface that is not a pure mirror.
pub fn lift_of_opaque(context: &Context, vertex: &Vertex, surface: &SurfaceVertex) -> Vec3 {
    match may_be_lifted(context, surface.material) {
        true => context.scene.lift(vertex.ray, vertex.state.time, surface.interaction),
        false => Vec3::ZERO,
    }
}

/// Light from a point of light number `light`. For a shape the point is uniform by area, and
/// `u = (0.5, 0.5)` gives its middle. It serves integrators without multiple importance sampling.
pub fn sample_whole_light(
    context: &Context,
    at: &Arrival,
    light: usize,
    u: Vec2,
) -> Option<IncidentLight> {
    match &context.scene.lights()[light] {
        CompiledLight::Light(_) => {
            sample_light(context, at, &ChosenLight { light, part: None, probability: 1.0 }, u)
        }
        CompiledLight::Environment => {
            let sky = context.scene.environment.as_ref()?;
            let sample = match sky.has_portals() {
                true => sky.sample_from(at.position, u)?,
                false => sky.sample(u),
            };
            from_environment(context, at, &sample)
        }
        CompiledLight::Medium(..) => None,
        CompiledLight::Area(area) => from_area(context, at, area.sample(u)?),
        CompiledLight::Moving(light) => from_area(context, at, light.sample(at.time, u)?),
    }
}

/// Light from a point of an emissive surface that was sampled by area.
fn from_area(context: &Context, at: &Arrival, sample: AreaSample) -> Option<IncidentLight> {
    let to_light = sample.surface.position - at.position;
    let direction = to_light.try_normalize()?;
    let cos = direction.dot(sample.surface.geometric_normal).abs();
    let pdf = sample.pdf_area * to_light.length_squared() / cos;
    from_surface(context, at, DirectedSample { surface: sample.surface, direction, pdf })
}

/// Light from a point of the chosen light. Its `pdf` does not include the probability of choosing
/// the light.
pub fn sample_light(
    context: &Context,
    at: &Arrival,
    chosen: &ChosenLight,
    u: Vec2,
) -> Option<IncidentLight> {
    let scene = context.scene;
    match &scene.lights()[chosen.light] {
        CompiledLight::Light(light) => {
            let sample = light.sample(at.position, u, at.mode)?;
            let origin = at.ray_origin(sample.direction);
            let shadow_ray = if sample.distance.is_finite() {
                // The ray is aimed from the offset origin at the same point of the light.
                let target = at.position + sample.direction * sample.distance;
                Ray::new(origin, target - origin).with_t_max(SHADOW_END)
            } else {
                Ray::new(origin, sample.direction)
            };
            Some(IncidentLight {
                direction: sample.direction,
                radiance: sample.radiance,
                pdf: sample.pdf,
                is_delta: sample.is_delta,
                source: LightSource::Light(chosen.light as u32),
                shadow_ray,
                glowing: None,
            })
        }
        CompiledLight::Area(area) => {
            let (part, probability, u) = part_of_choice(area, chosen, u);
            let plain = scene.plain_emission(chosen.light);
            if let Some((plain, sample)) = plain.zip(area.sample_simple(part, at.position, u)) {
                return from_part(at, plain, sample, probability);
            }
            if let Some(plain) = plain {
                let sample = area.sample_point_from(part, at.position, u)?;
                return from_plain(
                    at,
                    plain,
                    DirectedPoint { pdf: sample.pdf * probability, ..sample },
                );
            }
            let sample = area.sample_from(part, at.position, u)?;
            from_surface(context, at, DirectedSample { pdf: sample.pdf * probability, ..sample })
        }
        CompiledLight::Moving(light) => {
            let (part, probability, u) = part_of_choice(&light.first, chosen, u);
            let mut sample = light.sample_from(part, at.time, at.position, u)?;
            sample.pdf *= probability;
            from_surface(context, at, sample)
        }
        CompiledLight::Medium(medium, glow) => from_glow(at, *medium, glow, u),
        CompiledLight::Environment => {
            from_environment(context, at, &environment_direction(context, at.position, u)?)
        }
    }
}

/// The part of a chosen light, the probability of the part (1 if the light sampler has chosen it),
/// and the random numbers that remain.
fn part_of_choice(light: &AreaLight, chosen: &ChosenLight, u: Vec2) -> (u32, f32, Vec2) {
    match chosen.part {
        Some(part) => (part, 1.0, u),
        None => {
            let (part, probability, rest) = light.choose_part(u.x);
            (part, probability, Vec2::new(rest, u.y))
        }
    }
}

/// Samples a direction to the environment from a point.
pub(crate) fn environment_direction(context: &Context, from: Vec3, u: Vec2) -> Option<SkySample> {
    let sky = context.scene.environment.as_ref()?;
    match context.settings.light_strategy {
        _ if sky.has_portals() => sky.sample_from(from, u),
        LightStrategy::Mis => sky.sample_compensated(u),
        LightStrategy::Light | LightStrategy::Bsdf => Some(sky.sample(u)),
    }
}

/// Light from a direction of the environment. [`super::lights`] computes the same in batches.
pub(crate) fn from_environment(
    context: &Context,
    at: &Arrival,
    sample: &SkySample,
) -> Option<IncidentLight> {
    let sky = context.scene.environment.as_ref()?;
    let &SkySample { direction, pdf, place } = sample;
    if !sky.is_seen(at.position, direction) {
        return None;
    }
    let radiance = sky.radiance_at(place, at.mode);
    let shadow_ray = Ray::new(at.ray_origin(direction), direction);
    let arrives = !radiance.is_black() && pdf > 0.0;
    let source = LightSource::Environment;
    arrives.then_some(IncidentLight {
        direction,
        radiance,
        pdf,
        is_delta: false,
        source,
        shadow_ray,
        glowing: None,
    })
}

/// Light from a point of an emissive medium.
///
/// Points are sampled by volume, whereas paths find emission along their whole segment in the
/// medium. To make the two densities comparable, that of a point is the density of its direction
/// multiplied by a typical length of segments in the medium.
fn from_glow(at: &Arrival, medium: MediumId, glow: &Glow, u: Vec2) -> Option<IncidentLight> {
    let (target, pdf) = glow.sample(u);
    let to_light = target - at.position;
    let direction = to_light.try_normalize()?;
    let pdf = pdf * to_light.length_squared() * glow.chord();
    let radiance = glow.emission(target, at.mode) * glow.chord();
    if radiance.is_black() || !pdf.is_finite() || pdf <= 0.0 {
        return None;
    }
    let origin = at.ray_origin(direction);
    let shadow_ray = Ray::new(origin, target - origin).with_t_max(SHADOW_END);
    let (source, glowing) = (LightSource::Medium, Some(medium));
    Some(IncidentLight { direction, radiance, pdf, is_delta: false, source, shadow_ray, glowing })
}

/// The density with which [`from_glow`] samples a point of an emissive medium that a path has
/// found, including the probability of choosing the light.
pub fn light_pdf_of_glow(
    lights: &LightSampler,
    receiver: &Receiver,
    light: usize,
    glow: &Glow,
    point: Vec3,
) -> f32 {
    let pdf = glow.pdf(point) * (point - receiver.position).length_squared() * glow.chord();
    if pdf > 0.0 && pdf.is_finite() {
        pdf * lights.probability(receiver, light, (0, 1.0))
    } else {
        0.0
    }
}

/// Light from a point of a simple surface of uniform emission. [`super::lights`] computes the same
/// in batches.
fn from_part(
    at: &Arrival,
    plain: &PlainEmission,
    sample: PartSample,
    probability: f32,
) -> Option<IncidentLight> {
    let PartSample { direction, pdf, end, is_front, exists } = sample;
    let radiance = plain.radiance_in(at.mode);
    if !exists || !(is_front || plain.on_both_sides) || radiance.is_black() {
        return None;
    }
    let origin = at.ray_origin(direction);
    let shadow_ray = Ray::new(origin, end - origin).with_t_max(SHADOW_END);
    let (source, pdf) = (LightSource::Material(plain.material), pdf * probability);
    Some(IncidentLight {
        direction,
        radiance,
        pdf,
        is_delta: false,
        source,
        shadow_ray,
        glowing: None,
    })
}

/// Light from a point of a surface of uniform emission.
fn from_plain(at: &Arrival, plain: &PlainEmission, sample: DirectedPoint) -> Option<IncidentLight> {
    let DirectedPoint { point, direction, pdf } = sample;
    let radiance = plain.radiance_in(at.mode);
    let is_lit = plain.on_both_sides || direction.dot(point.normal) < 0.0;
    if !is_lit || radiance.is_black() || !pdf.is_finite() || pdf <= 0.0 {
        return None;
    }
    let origin = at.ray_origin(direction);
    let target = offset_ray_origin(point.position, point.position_error, point.normal, -direction);
    let shadow_ray = Ray::new(origin, target - origin).with_t_max(SHADOW_END);
    let source = LightSource::Material(plain.material);
    Some(IncidentLight {
        direction,
        radiance,
        pdf,
        is_delta: false,
        source,
        shadow_ray,
        glowing: None,
    })
}

/// Light from a point of an emissive surface.
fn from_surface(context: &Context, at: &Arrival, sample: DirectedSample) -> Option<IncidentLight> {
    let (scene, direction, pdf) = (context.scene, sample.direction, sample.pdf);
    let material_id = scene.material_id(&hit_of(&sample.surface));
    let material = scene.material(material_id);
    let point = scene.shading_point(&sample.surface, 0.0, at.mode);
    // A ray hits a partly transparent lamp only with this probability, and the shadow ray ends
    // before it.
    let share = material.emitting_share(direction, &point);
    let radiance = material.emitted(&point, -direction) * share;
    if radiance.is_black() || !pdf.is_finite() || pdf <= 0.0 {
        return None;
    }
    let origin = at.ray_origin(direction);
    let target = sample.surface.ray_origin(-direction);
    let shadow_ray = Ray::new(origin, target - origin).with_t_max(SHADOW_END);
    let source = LightSource::Material(material_id);
    Some(IncidentLight {
        direction,
        radiance,
        pdf,
        is_delta: !material.visible,
        source,
        shadow_ray,
        glowing: None,
    })
}

/// The hit from which the interaction was made.
fn hit_of(surface: &SurfaceInteraction) -> snell_intersect::Hit {
    snell_intersect::Hit {
        t: surface.t,
        uv: surface.primitive_uv,
        instance: surface.instance,
        geometry: surface.geometry,
        primitive: surface.primitive,
    }
}

/// Density per steradian with which light samples find the emissive point that a path has hit,
/// including the probability of choosing the light; 0 if no light sample can find it.
pub fn light_pdf_of_hit(context: &Context, vertex: &Vertex, surface: &SurfaceVertex) -> f32 {
    let scene = context.scene;
    let Some(light) = scene.light_of(surface.hit.instance, surface.hit.geometry) else {
        return 0.0;
    };
    let area = match &scene.lights()[light] {
        CompiledLight::Area(area) => area,
        CompiledLight::Moving(moving) => &moving.first,
        CompiledLight::Light(_) | CompiledLight::Medium(..) | CompiledLight::Environment => {
            return 0.0;
        }
    };
    let Some(part) = area.part_of(surface.hit.primitive) else { return 0.0 };
    let (receiver, direction) = (&vertex.state.receiver, vertex.ray.direction);
    let pdf = match &scene.lights()[light] {
        CompiledLight::Moving(moving) => moving.pdf_from(
            part,
            vertex.state.time,
            receiver.position,
            surface.interaction,
            direction,
        ),
        _ => area.pdf_from(part, receiver.position, surface.interaction, direction),
    };
    pdf * context.lights.probability(receiver, light, (part, area.part_probability(part)))
}

/// Density of a direction to the environment, multiplied by the probability of choosing the
/// environment.
pub fn environment_choice(context: &Context, receiver: &Receiver, pdf: f32) -> f32 {
    match context.scene.environment_light() {
        Some(light) if pdf > 0.0 => pdf * context.lights.probability(receiver, light, (0, 1.0)),
        _ => 0.0,
    }
}

/// The state of a path after a bounce.
pub fn continued(
    vertex: &Vertex,
    surface: &SurfaceVertex,
    throughput: SampledSpectrum,
) -> PathState {
    let mode = vertex.state.mode;
    let mode = if surface.material.is_dispersive() { mode.hero_only() } else { mode };
    PathState { throughput, mode, cone_width: surface.footprint, ..*vertex.state }
}
