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
    /// The results of the light rays of all vertices, in order: the value that media transmit, and
    /// whether the ray was occluded.
    pub fates: Vec<(SampledSpectrum, bool)>,
}

/// An entry of the journal.
#[derive(Clone, Debug)]
pub enum Event {
    /// All paths have advanced by one ray.
    Depth,
    /// A medium has added radiance on the way to a vertex.
    Glow {
        /// Number of the path among the live paths.
        path: usize,
        /// The sample of the path, counted from the first of the part.
        sample: u32,
        /// The added radiance.
        radiance: SampledSpectrum,
    },
    /// Photons have brought light to a vertex.
    Photons {
        /// Number of the path among the live paths.
        path: usize,
        /// The sample of the path, counted from the first of the part.
        sample: u32,
        /// The added radiance.
        radiance: SampledSpectrum,
        /// The number of photons.
        photons: u32,
    },
    /// A vertex was shaded.
    Vertex(Box<Shaded>),
}

/// A vertex that was shaded, with the output of the vertex function.
#[derive(Clone, Debug)]
pub struct Shaded {
    /// Number of the path among the live paths.
    pub path: usize,
    /// The sample of the path, counted from the first of the part.
    pub sample: u32,
    /// The ray that arrived at the vertex.
    pub ray: Ray,
    /// The hit of that ray.
    pub hit: Hit,
    /// The state of the path on arrival.
    pub state: PathState,
    /// The point at which a medium scattered the path, if one did.
    pub medium: Option<MediumVertex>,
    /// Index of refraction on the outer side of the surface.
    pub outside_ior: f32,
    /// Radiance found at the vertex.
    pub radiance: SampledSpectrum,
    /// The MIS weights.
    pub weights: Weights,
    /// Light rays, with what each contributes if it is unoccluded.
    pub light_rays: Vec<(Ray, SampledSpectrum)>,
    /// The source of the light along the light rays, if all have the same.
    pub source: Option<LightSource>,
    /// The next rays of the path.
    pub next: Vec<(Ray, PathState)>,
}
