//! Many vertices at once: what most of a picture is shaded by.
//!
//! A [`BatchShader`] does what the vertex function ([`crate::integrator`]) does, bit for bit, at up
//! to [`LANES`] vertices, in loops over arrays that the compiler turns into vector code. Which
//! vertices it accepts depends on the scene and the settings alone, and no lane looks at another,
//! so a path does not depend on what shares its batch. All are made of the same parts: the vertices
//! and what their paths carry ([`vertices`]), light samples ([`lights`]) and what comes of them
//! ([`direct_light`]).
//!
//! The renderer of parts ([`crate::job`]) traces the rays, asks the [list](shaders) of shaders in
//! turn, and calls the vertex function where none accepts.

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
use snell_math::SampledSpectrum;
use std::rc::Rc;
use vertices::{CarriedColumns, RayColumns, UNMARKED};

/// Shades many vertices at once.
pub trait BatchShader<'a> {
    /// How many of the first of these paths it can shade together, at most [`LANES`]; 0 if the
    /// first is for another shader.
    fn accepts(&self, batch: &Batch<'_, 'a>, paths: &[u32]) -> usize;

    /// Shades these paths, all of which it has accepted.
    fn shade(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]);

    /// What came of the last call of [`Self::shade`].
    fn shaded(&self) -> Shaded<'_>;

    /// True if [`Self::outputs`] must be asked lane by lane, because the columns of
    /// [`Self::shaded`] do not hold all.
    fn is_lane_by_lane(&self, _batch: &Batch<'_, 'a>) -> bool {
        false
    }

    /// Writes what the vertex function would write for the vertex of a sound lane.
    fn outputs(&self, _batch: &Batch<'_, 'a>, _lane: usize, _out: &mut Outputs) {}

    /// The lobe that scatters light at the vertex of a lane. Only where [`Batch::wants_lobes`].
    fn lobe(&self, _lane: usize) -> LobeShares {
        LobeShares::UNKNOWN
    }

    /// Whether the light ray and the next ray of a lane may start on the other side of its surface
    /// than the side that the path has come from.
    fn may_cross(&self, _lane: usize) -> [bool; 2] {
        [true, true]
    }
}

/// All batch shaders of a render, the first that accepts a path shades it. There are none at the
/// level of portable code, but for what leaves the scene.
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

/// Paths that have come to vertices of one depth.
#[derive(Clone, Copy)]
pub struct Batch<'b, 'a> {
    /// The scene and the settings.
    pub context: &'b Context<'a>,
    /// Gives the numbers of samples.
    pub sampler: &'b Sampler,
    /// Bounces before these vertices.
    pub depth: u32,
    /// The paths and what their rays have hit.
    pub paths: &'b Paths,
    /// Random numbers, by sample.
    pub keys: &'b [SampleKey],
    /// The number of the material that each path has hit, or the number of materials where it has
    /// hit nothing; not of paths that [`order::Order`] has put first.
    pub materials: &'b [u32],
    /// How many of the next paths are known to be on matte surfaces, by [`order::Order`].
    pub matte_next: usize,
    /// The media around the paths, if there are any.
    pub media: Option<Surroundings<'b>>,
    /// True if the outputs of each vertex are recorded: by a field that learns, or by a journal.
    pub is_watched: bool,
    /// True if a journal records everything.
    pub has_journal: bool,
}

impl Batch<'_, '_> {
    /// True if light that `path` and `direct` find and gather is all that matters of a vertex.
    pub fn is_simple(&self) -> bool {
        self.context.settings.integrator.is_path() && !self.is_watched
    }

    /// True if these are first vertices, and layers need the lobes that scatter there.
    pub fn wants_lobes(&self) -> bool {
        self.context.wants_lobes && self.depth == 0
    }

    /// True if no path goes on from here.
    pub fn is_last(&self) -> bool {
        self.depth >= self.context.max_depth()
    }

    /// Index of refraction on the outer side of the surface that a path has hit.
    pub fn outside_ior(&self, path: usize) -> f32 {
        self.media.as_ref().map_or(1.0, |media| media.outside_ior(path, &self.paths.hits[path]))
    }

    /// The numbers of the vertex that a path has come to.
    pub fn random(&self, path: usize) -> Random {
        let key = self.keys[self.paths.samples[path] as usize];
        self.sampler.numbers_of(key).at_vertex(self.paths.carried[path].stream, self.depth)
    }
}

/// What a [`BatchShader`] gives, by lane. Values are already multiplied by the paths' throughputs.
#[derive(Clone, Copy, Debug)]
pub struct Shaded<'s> {
    /// Paths and the light that each has found at its vertex.
    pub found: &'s [(u32, SampledSpectrum)],
    /// Numbers of the paths of the lanes in use.
    pub paths: &'s [u32],
    /// 0 where the vertex function must shade the vertex after all.
    pub is_sound: &'s [u32; LANES],
    /// Light samples, where the shader takes any.
    pub light: Option<&'s DirectLight>,
    /// 0 where the path ends.
    pub goes_on: &'s [u32; LANES],
    /// The rays along which the paths go on.
    pub next_rays: RayColumns<'s>,
    /// What the paths carry on.
    pub carried: CarriedColumns<'s>,
}

impl Shaded<'_> {
    /// Nothing.
    pub const NONE: Self = Self {
        found: &[],
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

    /// True if a lane sends a light ray.
    pub fn has_light_ray(&self, lane: usize) -> bool {
        self.light.is_some_and(|light| light.outputs.has_light_ray[lane] != 0)
    }
}
