//! Batch shading. Most vertices of a picture are shaded here.
//!
//! A [`BatchShader`] shades up to [`LANES`] vertices with the same bits as the vertex function
//! ([`crate::integrator`]), in loops over arrays that the compiler vectorises. Which vertices it
//! accepts depends on the scene and the settings alone, and lanes are independent, so a path does
//! not depend on the others in its batch. All shaders consist of the same parts: the vertices and
//! the state of their paths ([`vertices`]), light samples ([`lights`]) and their contributions
//! ([`direct_light`]).
//!
//! The renderer of parts ([`crate::job`]) traces the rays, tries the [list](shaders) of shaders in
//! order, and calls the vertex function for a path that no shader accepts.

pub mod direct_light;
pub mod escaped;
pub mod first_surfaces;
pub mod lights;
pub mod materials;
pub mod media;
pub mod order;
pub mod paths;
pub mod plain_surfaces;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twins;
pub mod vertices;

use crate::integrator::light_part::LobeShares;
use crate::integrator::{Context, Outputs};
use crate::lanes::{BLACK, ENDLESS, LANES, NOUGHTS, ZERO};
use crate::sampler::{Random, SampleKey, Sampler};
use crate::volume::Surroundings;
use direct_light::DirectLight;
use escaped::EscapedShader;
use materials::classic_matte::ClassicMatteShader;
use materials::general::GeneralShader;
use materials::matte::MatteShader;
use materials::matte_surfaces::MatteSurfaces;
use materials::specular::SpecularShader;
use media::MediumShader;
use paths::Paths;
use snell_math::{Ray, SampledSpectrum};
use std::rc::Rc;
use vertices::{CarriedColumns, RayColumns, UNMARKED};

/// Shades many vertices at once. A lane is the place of one vertex in a batch.
pub trait BatchShader<'a> {
    /// The number of paths at the front of `paths` that this shader can shade together, at most
    /// [`LANES`]. 0 leaves the first path to the next shader.
    fn accepts(&self, batch: &Batch<'_, 'a>, paths: &[u32]) -> usize;

    /// Shades these paths, which must be those that [`Self::accepts`] has counted.
    fn shade(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]);

    /// The output of the last call of [`Self::shade`].
    fn shaded(&self) -> Shaded<'_>;

    /// True if [`Self::outputs`] must be called lane by lane, because the columns of
    /// [`Self::shaded`] are incomplete.
    fn is_lane_by_lane(&self, _batch: &Batch<'_, 'a>) -> bool {
        false
    }

    /// Writes what the vertex function would write for a lane in use.
    fn outputs(&self, _batch: &Batch<'_, 'a>, _lane: usize, _out: &mut Outputs) {}

    /// The lobe that scatters light at the vertex of a lane. It is called only where
    /// [`Batch::wants_lobes`] is true.
    fn lobe(&self, _lane: usize) -> LobeShares {
        LobeShares::UNKNOWN
    }

    /// Whether the light ray and the next ray of a lane may start on the opposite side of the
    /// surface from the one on which the path arrived.
    fn may_cross(&self, _lane: usize) -> [bool; 2] {
        [true, true]
    }
}

/// All batch shaders of a render, in the order in which they are asked: the first that accepts a
/// path shades it. With portable code, the only one is the shader of paths that leave the scene.
pub fn shaders<'a>(
    context: &Context<'a>,
    sampler: &Sampler,
    matte: Option<&Rc<MatteSurfaces<'a>>>,
) -> Vec<Box<dyn BatchShader<'a> + 'a>> {
    fn boxed<'a>(shader: impl BatchShader<'a> + 'a) -> Box<dyn BatchShader<'a> + 'a> {
        Box::new(shader)
    }
    [
        ClassicMatteShader::new(context, sampler, matte).map(boxed),
        MatteShader::new(context, sampler, matte).map(boxed),
        SpecularShader::new(context, sampler).map(boxed),
        GeneralShader::new(context, sampler).map(boxed),
        MediumShader::new(context, sampler).map(boxed),
        EscapedShader::new(context).map(boxed),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Paths at vertices of the same depth.
#[derive(Clone, Copy)]
pub struct Batch<'b, 'a> {
    /// The scene and the settings of the render.
    pub context: &'b Context<'a>,
    /// The sampler of random numbers.
    pub sampler: &'b Sampler,
    /// The number of bounces before these vertices.
    pub depth: u32,
    /// The paths, with the hits of their rays.
    pub paths: &'b Paths,
    /// The key of each sample's random numbers.
    pub keys: &'b [SampleKey],
    /// The number of the material that each path hit, or the number of materials for a miss.
    /// Entries of the first [`Self::matte_next`] paths are arbitrary.
    pub materials: &'b [u32],
    /// The number of paths at the front of the list that [`order::Order`] has found to be on matte
    /// surfaces.
    pub matte_next: usize,
    /// The media around the paths, if the scene has any.
    pub media: Option<Surroundings<'b>>,
    /// True if the outputs of each vertex are recorded, for training or in a journal.
    pub is_watched: bool,
    /// True if a journal records everything.
    pub has_journal: bool,
}

impl Batch<'_, '_> {
    /// True if only the emitted light and the direct light of vertices are needed.
    pub fn is_simple(&self) -> bool {
        self.context.settings.integrator.is_path() && !self.is_watched
    }

    /// True if these are the first vertices of paths, and layers need the lobes that scatter there.
    pub fn wants_lobes(&self) -> bool {
        self.context.wants_lobes && self.depth == 0
    }

    /// True if every path ends here.
    pub fn is_last(&self) -> bool {
        self.depth >= self.context.max_depth()
    }

    /// Index of refraction on the outer side of the surface that a path has hit.
    pub fn outside_ior(&self, path: usize) -> f32 {
        self.media.as_ref().map_or(1.0, |media| media.outside_ior(path, &self.paths.hits[path]))
    }

    /// The random numbers of the vertex of a path.
    pub fn random(&self, path: usize) -> Random {
        let key = self.keys[self.paths.samples[path] as usize];
        self.sampler.numbers_of(key).at_vertex(self.paths.carried[path].stream, self.depth)
    }
}

/// The output of a [`BatchShader`], by lane. Values are already multiplied by the throughputs of
/// the paths.
#[derive(Clone, Copy, Debug)]
pub struct Shaded<'s> {
    /// Numbers of paths, with the light that each has found at its vertex.
    pub found: &'s [(u32, SampledSpectrum)],
    /// Light rays from the floor of the background, with the numbers of their paths and what each
    /// brings.
    pub shadow_rays: &'s [(u32, Ray, SampledSpectrum)],
    /// Numbers of the paths of the lanes in use.
    pub paths: &'s [u32],
    /// 1 for lanes that were shaded, 0 where the vertex function must shade the vertex after all.
    pub is_sound: &'s [u32; LANES],
    /// Light samples, if the shader takes any.
    pub light: Option<&'s DirectLight>,
    /// 1 where the path continues, 0 where it ends.
    pub goes_on: &'s [u32; LANES],
    /// The next rays of the paths.
    pub next_rays: RayColumns<'s>,
    /// What the paths carry along their next rays.
    pub carried: CarriedColumns<'s>,
}

impl Shaded<'_> {
    /// The output for no paths.
    pub const NONE: Self = Self {
        found: &[],
        shadow_rays: &[],
        paths: &[],
        is_sound: &[1; LANES],
        light: None,
        goes_on: &[0; LANES],
        next_rays: RayColumns { origin: &ZERO, direction: &ZERO, end: &ENDLESS },
        carried: CarriedColumns {
            throughput: &BLACK,
            eta_scale: &NOUGHTS,
            cone_width: &NOUGHTS,
            cone_spread: &NOUGHTS,
            marks: &UNMARKED,
            position: &ZERO,
            bsdf_pdf: &NOUGHTS,
            normal: &ZERO,
        },
    };

    /// True if a lane has a light ray.
    pub fn has_light_ray(&self, lane: usize) -> bool {
        self.light.is_some_and(|light| light.outputs.has_light_ray[lane] != 0)
    }
}
