//! The report on a pixel. All colours are linear Rec. 709.

use serde::Serialize;

/// The explanation of a pixel's colour.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Report {
    /// The scene's name.
    pub scene: String,
    /// Column and row of the pixel, from the upper left corner.
    pub pixel: [u32; 2],
    /// Width and height of the picture.
    pub size: [u32; 2],
    /// The integrator.
    pub integrator: String,
    /// The pixel in the picture: red, green, blue, alpha.
    pub value: [f32; 4],
    /// Standard errors of red, green and blue.
    pub error: [f32; 3],
    /// Number of samples of the pixel.
    pub spp: u32,
    /// The mean after increasing numbers of samples.
    pub convergence: Vec<Point>,
    /// The light of the pixel by path class, the brightest first.
    pub classes: Vec<PathClass>,
    /// The colours of the samples, by number.
    pub samples: Vec<[f32; 3]>,
    /// One of the samples, in full detail.
    pub tree: SampleReport,
    /// The traversal of that sample's camera ray through acceleration structures.
    pub traces: Vec<TraceReport>,
    /// Minimum and maximum corner of the scene's bounding box.
    pub bounds: [[f32; 3]; 2],
    /// Some points that the camera sees.
    pub cloud: Vec<[f32; 3]>,
}

/// The pixel after a number of samples.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Point {
    /// Number of samples.
    pub samples: u32,
    /// The mean of these samples.
    pub value: [f32; 3],
    /// Standard error of the mean; 0 while unknown.
    pub error: [f32; 3],
}

/// Light of one path class.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct PathClass {
    /// The path in Heckbert's letters, from the eye to the light: E, then D (diffuse), G (glossy),
    /// S (mirror), T (transmitted), V (medium), L.
    pub way: String,
    /// Contribution of the class to the pixel.
    pub value: [f32; 3],
    /// Share of the class in the pixel's luminance, 0 to 1.
    pub share: f32,
}

/// One sample of a pixel.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SampleReport {
    /// Number of the sample, from 0.
    pub number: u32,
    /// Colour of the sample.
    pub color: [f32; 3],
    /// The sum of all contributions of the path vertices, in the renderer's order: equal to the
    /// colour.
    pub sum: [f32; 3],
    /// Weight of the sample in the pixel's filter.
    pub weight: f32,
    /// The path vertices, parents first.
    pub vertices: Vec<VertexReport>,
}

/// A path vertex: the end of a ray.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct VertexReport {
    /// The previous vertex of the path; `None` for the end of the camera ray.
    pub parent: Option<u32>,
    /// Number of bounces before this vertex.
    pub depth: u32,
    /// What the ray met: `surface`, `medium`, `escaped` or `absorbed`.
    pub what: String,
    /// Names of the nodes from the root to the surface.
    pub object: String,
    /// The name of the surface's material.
    pub material: String,
    /// Number of the triangle or face.
    pub primitive: Option<u32>,
    /// The origin of the ray.
    pub origin: [f32; 3],
    /// The direction of the ray.
    pub direction: [f32; 3],
    /// The point where the ray ended.
    pub position: Option<[f32; 3]>,
    /// Shading normal.
    pub normal: Option<[f32; 3]>,
    /// Distance that the ray travelled.
    pub distance: Option<f32>,
    /// Throughput of the path on arrival.
    pub throughput: [f32; 3],
    /// The lobe that was sampled for the ray; `None` for the camera ray.
    pub lobe: Option<String>,
    /// Probability density of the ray's direction per steradian; `None` for mirrors and clear
    /// glass.
    pub pdf: Option<f32>,
    /// Emission of media along the ray, times throughput.
    pub glow: [f32; 3],
    /// Light that photons bring, times throughput.
    pub by_photons: [f32; 3],
    /// The number of these photons.
    pub photons: u32,
    /// Emission found at the vertex, times throughput and weight.
    pub found: [f32; 3],
    /// Weight of the emission found, in multiple importance sampling.
    pub found_weight: f32,
    /// Light samples taken at the vertex.
    pub lights: Vec<LightReport>,
}

/// A light sample.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct LightReport {
    /// The name of the light.
    pub source: String,
    /// The lobe that scatters the light.
    pub lobe: String,
    /// Start of the shadow ray.
    pub origin: [f32; 3],
    /// Direction of the shadow ray.
    pub direction: [f32; 3],
    /// End of the shadow ray; `None` for lights at infinity.
    pub end: Option<[f32; 3]>,
    /// Contribution of the light sample if it were unoccluded.
    pub value: [f32; 3],
    /// Actual contribution of the light sample.
    pub brought: [f32; 3],
    /// True if the light sample is occluded.
    pub is_blocked: bool,
    /// Weight of the light sample in multiple importance sampling, which is included in the values.
    pub weight: f32,
}

/// The traversal of an acceleration structure by a ray.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct TraceReport {
    /// The name of the structure.
    pub accelerator: String,
    /// Number of nodes visited.
    pub nodes: u32,
    /// Number of cells visited.
    pub cells: u32,
    /// Number of primitives tested.
    pub primitives: u32,
    /// Total number of nodes and cells of the structure.
    #[cfg_attr(test, ts(type = "number"))]
    pub built_nodes: u64,
    /// Distance of the hit; `None` for a miss.
    pub distance: Option<f32>,
    /// The traversal steps, in order.
    pub steps: Vec<StepReport>,
    /// Number of steps left out.
    #[cfg_attr(test, ts(type = "number"))]
    pub left_out: u64,
}

/// A region that the traversal visited.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct StepReport {
    /// `box`, `ball`, `plane` or `stretch` (an interval of the ray).
    pub kind: String,
    /// The centre of the region.
    pub center: [f32; 3],
    /// Vectors from the centre to the sides of the region.
    pub axes: [[f32; 3]; 3],
    /// True if the region holds primitives.
    pub is_leaf: bool,
    /// Nesting depth of instances.
    pub level: u32,
    /// Number of primitives tested in the region.
    pub tested: u32,
    /// Distance of a hit that was found in the region.
    pub found: Option<f32>,
}
