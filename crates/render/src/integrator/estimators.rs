//! Steps that integrators share: light that arrives from outside the scene, and light samples.

use super::{Context, PathState, SurfaceVertex, Vertex};
use crate::compile::CompiledLight;
use snell_intersect::SurfaceInteraction;
use snell_math::{Ray, SampledSpectrum, Vec2, Vec3};
use snell_scene::Background;

/// How far along a shadow ray to a point occluders count: just short of the light itself.
const SHADOW_END: f32 = 1.0 - 1e-4;

/// The environment's radiance along the ray that came to a vertex; black without one.
pub fn environment(context: &Context, vertex: &Vertex) -> SampledSpectrum {
    let environment = context.scene.environment.as_ref();
    environment.map_or(SampledSpectrum::ZERO, |e| e.radiance(vertex.ray.direction, vertex.state.mode))
}

/// What a ray that leaves the scene shows, or `None` if it carries the environment's light and not the background.
///
/// The background is for the camera. Where there is no environment, mirrors and glass show it too.
pub fn background(context: &Context, vertex: &Vertex) -> Option<SampledSpectrum> {
    let shows = vertex.depth == 0 || (vertex.state.is_specular && context.scene.environment.is_none());
    match context.scene.background {
        Background::Color(color) if shows => Some(vertex.state.mode.illuminant(color)),
        Background::Transparent if vertex.depth == 0 => Some(SampledSpectrum::ZERO),
        _ => None,
    }
}

/// A light sample of whatever kind, before occlusion.
#[derive(Clone, Copy, Debug)]
pub struct IncidentLight {
    /// Unit direction to the light.
    pub direction: Vec3,
    /// Incident radiance, or irradiance for delta lights.
    pub radiance: SampledSpectrum,
    /// Density per steradian; 1 for delta lights.
    pub pdf: f32,
    /// No BSDF sample can find this light.
    pub is_delta: bool,
    /// The ray whose interval must be free.
    pub shadow_ray: Ray,
}

/// Light arriving at a surface point from light number `light`.
pub fn sample_light(context: &Context, vertex: &SurfaceVertex, light: usize, u: Vec2) -> Option<IncidentLight> {
    let (scene, surface, mode) = (context.scene, vertex.interaction, vertex.mode);
    match &scene.lights()[light] {
        CompiledLight::Light(light) => {
            let sample = light.sample(surface.position, u, mode)?;
            let origin = surface.ray_origin(sample.direction);
            let shadow_ray = if sample.distance.is_finite() {
                // Aim from the moved origin at the same point of the light.
                let target = surface.position + sample.direction * sample.distance;
                Ray::new(origin, target - origin).with_t_max(SHADOW_END)
            } else {
                Ray::new(origin, sample.direction)
            };
            Some(IncidentLight {
                direction: sample.direction,
                radiance: sample.radiance,
                pdf: sample.pdf,
                is_delta: sample.is_delta,
                shadow_ray,
            })
        }
        CompiledLight::Area(area) => {
            let sample = area.sample(u)?;
            let to_light = sample.surface.position - surface.position;
            let distance_squared = to_light.length_squared();
            let direction = to_light.try_normalize()?;
            let cos = direction.dot(sample.surface.geometric_normal).abs();
            let pdf = sample.pdf_area * distance_squared / cos;
            let material = scene.material(scene.material_id(&hit_of(&sample.surface)));
            let point = scene.shading_point(&sample.surface, 0.0, mode);
            // A ray meets a cut-out or blended lamp only with this probability, and the shadow ray ends before it.
            let presence = material.presence(direction, &point);
            let radiance = material.emitted(&point, -direction) * presence;
            if radiance.is_black() || !pdf.is_finite() || pdf <= 0.0 {
                return None;
            }
            let origin = surface.ray_origin(direction);
            let target = sample.surface.ray_origin(-direction);
            let shadow_ray = Ray::new(origin, target - origin).with_t_max(SHADOW_END);
            Some(IncidentLight { direction, radiance, pdf, is_delta: false, shadow_ray })
        }
        CompiledLight::Environment => {
            let environment = scene.environment.as_ref()?;
            let (direction, pdf) = environment.sample(u);
            let radiance = environment.radiance(direction, mode);
            if radiance.is_black() || pdf <= 0.0 {
                return None;
            }
            let shadow_ray = Ray::new(surface.ray_origin(direction), direction);
            Some(IncidentLight { direction, radiance, pdf, is_delta: false, shadow_ray })
        }
    }
}

/// The hit that an interaction describes.
fn hit_of(surface: &SurfaceInteraction) -> snell_intersect::Hit {
    snell_intersect::Hit {
        t: surface.t,
        uv: surface.primitive_uv,
        instance: surface.instance,
        geometry: surface.geometry,
        primitive: surface.primitive,
    }
}

/// Density per steradian with which light samples give the emissive point that a path ran into: choice of the light included. 0 if
/// no light sample can.
pub fn light_pdf_of_hit(context: &Context, vertex: &Vertex, surface: &SurfaceVertex) -> f32 {
    let scene = context.scene;
    let Some(light) = scene.light_of(surface.hit.instance, surface.hit.geometry) else { return 0.0 };
    let CompiledLight::Area(area) = &scene.lights()[light] else { return 0.0 };
    let cos = vertex.ray.direction.dot(surface.interaction.geometric_normal).abs();
    // The distance of this segment: directions are unit vectors.
    let distance = surface.interaction.t;
    let pdf = area.pdf_area(surface.interaction) * distance * distance / cos;
    if pdf.is_finite() { pdf * context.lights.probability(light) } else { 0.0 }
}

/// Density per steradian with which light samples give a direction to the environment.
pub fn light_pdf_of_environment(context: &Context, direction: Vec3) -> f32 {
    let scene = context.scene;
    match (&scene.environment, scene.environment_light()) {
        (Some(environment), Some(light)) => environment.pdf(direction) * context.lights.probability(light),
        _ => 0.0,
    }
}

/// The state after a bounce.
pub fn continued(vertex: &Vertex, surface: &SurfaceVertex, throughput: SampledSpectrum) -> PathState {
    PathState { throughput, cone_width: surface.footprint, ..*vertex.state }
}
