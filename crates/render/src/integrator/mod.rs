//! Integrators: what light does. Each is a *vertex function*: a hit and a path's state in;
//! radiance, weighted light rays and weighted next rays out. It holds no loop, no recursion and no
//! queue, and sees nothing of what shares its batch: the driver ([`crate::job`]) owns batches,
//! tracing, order and film.

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

/// What a vertex function may look at.
#[derive(Debug)]
pub struct Context<'a> {
    /// The scene.
    pub scene: &'a CompiledScene,
    /// The settings.
    pub settings: &'a Settings,
    /// Chooses a light.
    pub lights: &'a LightSampler,
    /// What is known of where light comes from, if paths are guided.
    pub field: Option<&'a Field>,
    /// True if somebody wants to know which lobes scatter: [`PathState::lobe`] and
    /// [`Outputs::light_lobe`].
    pub wants_lobes: bool,
}

impl Context<'_> {
    /// Bounces that `path` and `direct` follow.
    pub(crate) fn max_depth(&self) -> u32 {
        match self.settings.integrator {
            IntegratorKind::Direct => 1,
            _ => self.settings.max_depth,
        }
    }

    /// The largest probability of going on, if Russian roulette plays at this depth. (Measured by
    /// variance times time: early roulette is 1.2 to 1.3 times better where lights must be found;
    /// under an even sky, where nearly all noise is then its own, it is twice as bad.)
    pub(crate) fn roulette(&self, depth: u32) -> Option<f32> {
        let begins_late = self.field.is_none() && self.scene.is_evenly_lit();
        match depth {
            0 => None,
            1..LATE_ROULETTE => (!begins_late).then_some(1.0),
            _ => Some(MAX_SURVIVAL),
        }
    }
}

/// From here on Russian roulette plays with every path, so that it ends.
const LATE_ROULETTE: u32 = 4;
const MAX_SURVIVAL: f32 = 0.98;

/// What a path carries from vertex to vertex. All of it is a function of (pixel, sample, seed)
/// alone.
#[derive(Clone, Copy, Debug)]
pub struct PathState {
    /// Factor on all radiance found from here on.
    pub throughput: SampledSpectrum,
    /// What the lanes of the throughput stand for.
    pub mode: ColorMode,
    /// Density per steradian of the last BSDF sample; 0 after the camera and after delta lobes: no
    /// light sample competes.
    pub bsdf_pdf: f32,
    /// The vertex where [`Self::bsdf_pdf`] was sampled: light samples there compete.
    pub receiver: Receiver,
    /// Factor that undoes what refraction did to the throughput, for Russian roulette.
    pub eta_scale: f32,
    /// True while every bounce so far was a delta lobe.
    pub is_specular: bool,
    /// For Russian roulette of guided paths: what the path was expected to bring at the first
    /// vertex of which a field knows something; 0 before that.
    pub expected: Expected,
    /// Width of the ray's cone at its origin.
    pub cone_width: f32,
    /// Growth of the cone per unit of distance.
    pub cone_spread: f32,
    /// Distinguishes the branches of a ray tree in random numbers; 0 on an unbranched path.
    pub stream: u32,
    /// The first scattering, where [`Context::wants_lobes`].
    pub lobe: LobeShares,
    /// When all rays of the path are traced: from 0 (the shutter opens) to 1 (it closes).
    pub time: f32,
}

/// A vertex: where a path's ray ended.
#[derive(Debug)]
pub struct Vertex<'a> {
    /// How many bounces came before.
    pub depth: u32,
    /// The ray that came here; unit direction.
    pub ray: &'a Ray,
    /// The path so far.
    pub state: &'a PathState,
    /// Numbers for this vertex.
    pub random: Random,
    /// What was hit; `None` if the ray left the scene, or a medium scattered the path.
    pub surface: Option<SurfaceVertex<'a>>,
    /// Where a medium scattered the path, if one did. Only `path` and `direct` know of media.
    pub medium: Option<MediumVertex>,
}

/// The surface at a vertex.
#[derive(Debug)]
pub struct SurfaceVertex<'a> {
    /// The hit.
    pub hit: &'a Hit,
    /// Geometry at the point.
    pub interaction: &'a SurfaceInteraction,
    /// Material at the point.
    pub material: &'a Material,
    /// What is known of its BSDF.
    pub prepared: &'a Prepared,
    /// Width of the ray's cone at the point.
    pub footprint: f32,
    /// What spectra mean to the path.
    pub mode: ColorMode,
    /// Index of refraction on the outer side of the surface.
    pub outside_ior: f32,
}

/// Where a medium scattered a path. What it absorbed is taken off the path's throughput already.
#[derive(Clone, Copy, Debug)]
pub struct MediumVertex {
    /// The point.
    pub position: Vec3,
    /// How light is spread over directions there.
    pub phase: HenyeyGreenstein,
    /// Width of the ray's cone at the point.
    pub footprint: f32,
}

impl<'a> SurfaceVertex<'a> {
    /// The point as the material sees it.
    pub fn point(&self, scene: &'a CompiledScene) -> ShadingPoint<'a> {
        let point = scene.shading_point(self.interaction, self.footprint, self.mode);
        ShadingPoint { outside_ior: self.outside_ior, ..point }
    }
}

/// What a vertex function gives back. Values are already multiplied by the path's throughput.
#[derive(Debug)]
pub struct Outputs {
    /// Radiance found at the vertex.
    pub radiance: SampledSpectrum,
    /// Radiance that counts if nothing lies on the ray.
    pub light_rays: Vec<(Ray, SampledSpectrum)>,
    /// Where the light of the light rays comes from, if one source is meant.
    pub light_source: Option<LightSource>,
    /// The medium that must glow at the end of the light rays for them to count; `None` for all
    /// other light.
    pub glowing: Option<MediumId>,
    /// By multiple importance sampling.
    pub weights: Weights,
    /// What scatters the light of the light rays, at the first vertex and where
    /// [`Context::wants_lobes`].
    pub light_lobe: LobeShares,
    /// Where the path goes on (several ways for a ray tree).
    pub next: Vec<(Ray, PathState)>,
    /// How the direction of the only next ray was chosen, if a field could learn from it.
    pub choice: Option<Choice>,
}

/// What multiple importance sampling gives two ways of finding the same light: 1 where only one
/// can. For people to look at; the values are multiplied already.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Of the radiance found at the vertex: by following the path.
    pub found: f32,
    /// Of the light ray: by choosing a light.
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
    /// Empties all lists.
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

/// What numbers of a vertex are for.
pub(crate) mod dimension {
    pub const LOBE: u32 = 0;
    pub const BSDF: u32 = 1;
    pub const LIGHT_CHOICE: u32 = 2;
    pub const LIGHT: u32 = 3;
    pub const ROULETTE: u32 = 4;
    pub const MEDIUM: u32 = 5;
    pub const GUIDE: u32 = 6;
    /// For integrators that sample every light: this and the following.
    pub const LIGHTS: u32 = 8;
}

/// Direction to where the ray came from.
pub(crate) fn outgoing(ray: &Ray) -> Vec3 {
    -ray.direction
}
