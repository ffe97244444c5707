//! The journal of a part: the events of its samples, in order. Only [`crate::explain`] uses one.

use crate::integrator::light_part::LightSource;
use crate::integrator::{MediumVertex, PathState, Weights};
use snell_intersect::Hit;
use snell_math::{Ray, SampledSpectrum};

/// The events, in the order in which radiance was added to the samples.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    /// Vertices, and emission of media on the way to them.
    pub events: Vec<Event>,
    /// The results of the light rays of all vertices, in order: their transmitted value, and
    /// whether they were occluded.
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
        /// The radiance.
        radiance: SampledSpectrum,
    },
    /// A vertex was shaded.
    Vertex(Box<Shaded>),
}

/// A vertex that was shaded, with the output of the vertex function.
#[derive(Clone, Debug)]
pub struct Shaded {
    /// Number of the path among those in flight.
    pub path: usize,
    /// Its sample, counted in the part.
    pub sample: u32,
    /// The ray that arrived here.
    pub ray: Ray,
    /// Its hit.
    pub hit: Hit,
    /// The state of the path.
    pub state: PathState,
    /// Where a medium scattered the path, if one did.
    pub medium: Option<MediumVertex>,
    /// Index of refraction on the outer side of the surface.
    pub outside_ior: f32,
    /// Radiance found there.
    pub radiance: SampledSpectrum,
    /// Weights of multiple importance sampling.
    pub weights: Weights,
    /// Light rays with their contributions if unoccluded.
    pub light_rays: Vec<(Ray, SampledSpectrum)>,
    /// The source of their light, if it is a single one.
    pub source: Option<LightSource>,
    /// The next rays of the path.
    pub next: Vec<(Ray, PathState)>,
}
