//! Integrators, which define how light is transported. Each is a *vertex function*: a hit and a
//! path's state go in; radiance, weighted light rays and weighted next rays come out. A vertex
//! function contains no loop over bounces, no recursion and no queue, and does not see the other
//! paths of its batch. The driver ([`crate::job`]) owns batches, tracing, order and film.

pub mod albedos;
mod ao;
pub mod aov;
pub(crate) mod camera_path;
pub(crate) mod carried;
pub(crate) mod classic;
pub(crate) mod estimators;
pub mod first_surface;
mod flat;
pub(crate) mod guided;
mod kinds;
pub mod light_part;
pub(crate) mod light_sample;
pub(crate) mod path;
pub(crate) mod roulette;
pub(crate) mod scattering;
#[cfg(test)]
mod tests;

use crate::compile::CompiledScene;
use crate::guiding::{Choice, Field};
use crate::light_sampler::{LightSampler, Receiver};
use crate::sampler::Random;
use crate::settings::Settings;
use carried::Expected;
pub use kinds::IntegratorKind;
pub(crate) use kinds::{Family, Integrator};
use light_part::{LightSource, LobeShares};
use snell_intersect::{Hit, SurfaceInteraction};
use snell_math::{ColorMode, Ray, SampledSpectrum, Vec3};
use snell_scene::material::{Prepared, ShadingPoint};
use snell_scene::medium::HenyeyGreenstein;
use snell_scene::{Material, MediumId};

/// The input of vertex functions that is the same for all paths.
#[derive(Debug)]
pub struct Context<'a> {
    /// The compiled scene.
    pub scene: &'a CompiledScene,
    /// The settings of the render.
    pub settings: &'a Settings,
    /// The light sampler of the render.
    pub lights: &'a LightSampler,
    /// The trained guiding field, if paths are guided.
    pub field: Option<&'a Field>,
    /// True if the scattering lobes are to be recorded: [`PathState::lobe`] and
    /// [`Outputs::light_lobe`].
    pub wants_lobes: bool,
}

impl Context<'_> {
    /// The largest number of bounces of `path` and `direct`.
    pub(crate) fn max_depth(&self) -> u32 {
        match self.settings.integrator {
            IntegratorKind::Direct => 1,
            _ => self.settings.max_depth,
        }
    }

    /// The largest survival probability of Russian roulette at this depth; `None` without roulette.
    /// (Measured by variance times time: early roulette is 1.2 to 1.3 times better where lights are
    /// hard to find; under a uniform sky, where it causes nearly all noise, it is twice as bad.)
    pub(crate) fn roulette(&self, depth: u32) -> Option<f32> {
        let begins_late = self.field.is_none() && self.scene.is_evenly_lit();
        let usual = if begins_late { roulette::LATE } else { roulette::EARLY };
        roulette::most_survival(self.settings.roulette_depth.unwrap_or(usual), depth)
    }
}

/// The state of a path between vertices. It depends on (pixel, sample, seed) alone.
#[derive(Clone, Copy, Debug)]
pub struct PathState {
    /// Path throughput: the factor on all radiance that the path finds from here on.
    pub throughput: SampledSpectrum,
    /// What the lanes of spectra stand for: colour channels or wavelengths.
    pub mode: ColorMode,
    /// Density per steradian of the last BSDF sample. It is 0 after the camera and after delta
    /// lobes, because no light sample could have found the same light.
    pub bsdf_pdf: f32,
    /// The vertex at which [`Self::bsdf_pdf`] was sampled. The density of light samples is computed
    /// for that vertex.
    pub receiver: Receiver,
    /// The factor that undoes the radiance scaling of refraction, for Russian roulette (pbrt's
    /// `etaScale`).
    pub eta_scale: f32,
    /// True if every bounce so far was a delta lobe.
    pub is_specular: bool,
    /// For Russian roulette of guided paths: the contribution that was expected of the path at the
    /// first vertex in a trained region; 0 before that vertex.
    pub expected: Expected,
    /// Width of the ray cone at its origin.
    pub cone_width: f32,
    /// Growth of the cone per unit of distance.
    pub cone_spread: f32,
    /// The branch of a ray tree, which selects random numbers; 0 on a path without branches.
    pub stream: u32,
    /// The first scattering of the path, if [`Context::wants_lobes`] is set.
    pub lobe: LobeShares,
    /// The time of all rays of the path, from 0 (the shutter opens) to 1 (it closes).
    pub time: f32,
}

/// A vertex: the point at which a path's ray ended.
#[derive(Debug)]
pub struct Vertex<'a> {
    /// The number of bounces before the vertex.
    pub depth: u32,
    /// The ray that arrived here; its direction has unit length.
    pub ray: &'a Ray,
    /// The state of the path on arrival.
    pub state: &'a PathState,
    /// Random numbers of this vertex.
    pub random: Random,
    /// The surface that was hit; `None` if the ray left the scene, or a medium scattered the path.
    pub surface: Option<SurfaceVertex<'a>>,
    /// The point at which a medium scattered the path, if one did. Only `path` and `direct` support
    /// media.
    pub medium: Option<MediumVertex>,
}

/// The surface at a vertex.
#[derive(Debug)]
pub struct SurfaceVertex<'a> {
    /// The hit of the path's ray.
    pub hit: &'a Hit,
    /// Geometry at the point.
    pub interaction: &'a SurfaceInteraction,
    /// Material at the point.
    pub material: &'a Material,
    /// Precomputed data of the material's BSDF.
    pub prepared: &'a Prepared,
    /// Width of the ray cone at the point.
    pub footprint: f32,
    /// What the lanes of spectra stand for on this path.
    pub mode: ColorMode,
    /// Index of refraction on the outer side of the surface.
    pub outside_ior: f32,
}

/// A point at which a medium scattered a path. The path's throughput already includes the
/// transmittance up to the point.
#[derive(Clone, Copy, Debug)]
pub struct MediumVertex {
    /// The scattering point.
    pub position: Vec3,
    /// The phase function at the point.
    pub phase: HenyeyGreenstein,
    /// Width of the ray cone at the point.
    pub footprint: f32,
}

impl<'a> SurfaceVertex<'a> {
    /// The point as the input of the material.
    pub fn point(&self, scene: &'a CompiledScene) -> ShadingPoint<'a> {
        let point = scene.shading_point(self.interaction, self.footprint, self.mode);
        ShadingPoint { outside_ior: self.outside_ior, ..point }
    }
}

/// The output of a vertex function. Values are already multiplied by the path's throughput.
#[derive(Debug)]
pub struct Outputs {
    /// Radiance found at the vertex.
    pub radiance: SampledSpectrum,
    /// Light rays, with the radiance that each contributes if it is unoccluded.
    pub light_rays: Vec<(Ray, SampledSpectrum)>,
    /// The source of the light along the light rays, if all have the same.
    pub light_source: Option<LightSource>,
    /// The emissive medium that must be at the end of the light rays for them to contribute; `None`
    /// for all other light.
    pub glowing: Option<MediumId>,
    /// The MIS weights.
    pub weights: Weights,
    /// The lobes that scatter the light of the light rays. Set only at the first vertex and if
    /// [`Context::wants_lobes`] is true.
    pub light_lobe: LobeShares,
    /// The next rays of the path (several for a ray tree).
    pub next: Vec<(Ray, PathState)>,
    /// How the direction of the next ray was sampled. Set if there is a single next ray with which
    /// a guiding field can be trained.
    pub choice: Option<Choice>,
}

/// The weights of multiple importance sampling; 1 where only one strategy can find the light. They
/// serve for display only, because the values already include them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// The weight of the radiance that BSDF sampling found at the vertex.
    pub found: f32,
    /// The weight of the light ray, which light sampling found.
    pub light: f32,
}

impl Default for Weights {
    fn default() -> Self {
        Self { found: 1.0, light: 1.0 }
    }
}

impl Default for Outputs {
    fn default() -> Self {
        Self {
            radiance: SampledSpectrum::ZERO,
            light_rays: Vec::new(),
            light_source: None,
            glowing: None,
            weights: Weights::default(),
            light_lobe: LobeShares::UNKNOWN,
            next: Vec::new(),
            choice: None,
        }
    }
}

impl Outputs {
    /// Empties all lists and resets the values.
    pub fn clear(&mut self) {
        self.radiance = SampledSpectrum::ZERO;
        (self.light_source, self.light_lobe, self.glowing) = (None, LobeShares::UNKNOWN, None);
        self.weights = Weights::default();
        self.light_rays.clear();
        self.next.clear();
        self.choice = None;
    }
}

/// A vertex function.
pub(crate) type VertexFunction = fn(&Context, &Vertex, &mut Outputs);

/// The dimensions of the random numbers of a vertex, by use.
pub(crate) mod dimension {
    pub const LOBE: u32 = 0;
    pub const BSDF: u32 = 1;
    pub const LIGHT_CHOICE: u32 = 2;
    pub const LIGHT: u32 = 3;
    pub const ROULETTE: u32 = 4;
    pub const MEDIUM: u32 = 5;
    pub const GUIDE: u32 = 6;
    /// The first dimension for integrators that sample every light. Each further light has the next
    /// one; after 200 lights the dimensions repeat.
    pub const LIGHTS: u32 = 8;
}

/// The unit direction towards the ray's origin.
pub(crate) fn outgoing(ray: &Ray) -> Vec3 {
    -ray.direction
}
