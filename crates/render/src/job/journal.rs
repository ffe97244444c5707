//! What happens to the samples of a part, written down in order: for [`crate::explain`]. Nobody
//! else keeps one.

use crate::integrator::light_part::LightSource;
use crate::integrator::{MediumVertex, PathState, Weights};
use snell_intersect::Hit;
use snell_math::{Ray, SampledSpectrum};

/// What happened, in the order in which radiance was added to the samples.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    /// Vertices, and media that glow on the way to them.
    pub events: Vec<Event>,
    /// What became of the light rays of all vertices, one after the other: what they brought to the
    /// light's end, and whether something was in their way.
    pub fates: Vec<(SampledSpectrum, bool)>,
}

/// One entry.
#[derive(Clone, Debug)]
pub enum Event {
    /// All paths have advanced by one ray.
    Depth,
    /// A medium has added radiance on the way to a vertex.
    Glow {
        /// Number of the path among those in flight.
        path: usize,
        /// Its sample, counted in the part.
        sample: u32,
        /// How much.
        radiance: SampledSpectrum,
    },
    /// A vertex was shaded.
    Vertex(Box<Shaded>),
}

/// A vertex that was shaded, with what the vertex function gave back.
#[derive(Clone, Debug)]
pub struct Shaded {
    /// Number of the path among those in flight.
    pub path: usize,
    /// Its sample, counted in the part.
    pub sample: u32,
    /// The ray that came here.
    pub ray: Ray,
    /// What it hit.
    pub hit: Hit,
    /// What the path carried.
    pub state: PathState,
    /// Where a medium scattered the path, if one did.
    pub medium: Option<MediumVertex>,
    /// Index of refraction on the outer side of the surface.
    pub outside_ior: f32,
    /// Radiance found there.
    pub radiance: SampledSpectrum,
    /// Weights of multiple importance sampling.
    pub weights: Weights,
    /// Light rays with what they bring if nothing is in the way.
    pub light_rays: Vec<(Ray, SampledSpectrum)>,
    /// Where their light comes from, if that is one source.
    pub source: Option<LightSource>,
    /// Where the path goes on.
    pub next: Vec<(Ray, PathState)>,
}
