//! The report on a pixel. All colours are linear Rec. 709.

use serde::Serialize;

/// The explanation of a pixel's colour.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Report {
    /// The scene's name.
    pub scene: String,
    /// The pixel, from the upper left corner.
    pub pixel: [u32; 2],
    /// Width and height of the picture.
    pub size: [u32; 2],
    /// The integrator.
    pub integrator: String,
    /// The pixel in the picture: red, green, blue, alpha.
    pub value: [f32; 4],
    /// Standard error of red, green, blue.
    pub error: [f32; 3],
    /// Samples of the pixel.
    pub spp: u32,
    /// The mean after increasing numbers of samples.
    pub convergence: Vec<Point>,
    /// Its light by path class, the brightest first.
    pub classes: Vec<PathClass>,
    /// The colours of the samples, by number.
    pub samples: Vec<[f32; 3]>,
    /// One sample in full detail.
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
    /// Their mean.
    pub value: [f32; 3],
    /// Its standard error; 0 while unknown.
    pub error: [f32; 3],
}

/// Light of one path class.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct PathClass {
    /// The path in Heckbert's letters, from the eye to the light: E, then D (diffuse), G (glossy),
    /// S (mirror), T (transmitted), V (medium), L.
    pub way: String,
    /// Its contribution to the pixel.
    pub value: [f32; 3],
    /// Its share of the pixel's luminance.
    pub share: f32,
}

/// One sample.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SampleReport {
    /// Its number.
    pub number: u32,
    /// Its colour.
    pub color: [f32; 3],
    /// The sum of all contributions of its vertices, in the renderer's order: equal to the colour.
    pub sum: [f32; 3],
    /// The filter's weight.
    pub weight: f32,
    /// Its path vertices, parents first.
    pub vertices: Vec<VertexReport>,
}

/// A path vertex: the end of a ray.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct VertexReport {
    /// The previous vertex of the path; `None` for the camera's.
    pub parent: Option<u32>,
    /// Number of bounces before.
    pub depth: u32,
    /// `surface`, `medium`, `escaped` or `absorbed`.
    pub what: String,
    /// Names of the nodes from the root to the surface.
    pub object: String,
    /// The material's name.
    pub material: String,
    /// Triangle or face.
    pub primitive: Option<u32>,
    /// Where the ray begins.
    pub origin: [f32; 3],
    /// The ray's direction.
    pub direction: [f32; 3],
    /// Where the ray ended.
    pub position: Option<[f32; 3]>,
    /// Shading normal.
    pub normal: Option<[f32; 3]>,
    /// Length of the ray.
    pub distance: Option<f32>,
    /// Throughput of the path on arrival.
    pub throughput: [f32; 3],
    /// The lobe that was sampled for the ray; `None` for the camera's.
    pub lobe: Option<String>,
    /// Probability density of its direction per steradian; `None` for mirrors and clear glass.
    pub pdf: Option<f32>,
    /// Emission of media along the ray, times throughput.
    pub glow: [f32; 3],
    /// Emission found here, times throughput and weight.
    pub found: [f32; 3],
    /// Its weight in multiple importance sampling.
    pub found_weight: f32,
    /// Light samples.
    pub lights: Vec<LightReport>,
}

/// A light sample.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct LightReport {
    /// The light.
    pub source: String,
    /// The lobe that scatters its light.
    pub lobe: String,
    /// Start of the shadow ray.
    pub origin: [f32; 3],
    /// Its direction.
    pub direction: [f32; 3],
    /// End of the shadow ray; `None` for lights at infinity.
    pub end: Option<[f32; 3]>,
    /// Its contribution if it is unoccluded.
    pub value: [f32; 3],
    /// Its actual contribution.
    pub brought: [f32; 3],
    /// True if it is occluded.
    pub is_blocked: bool,
    /// Its weight in multiple importance sampling, which is included in the values.
    pub weight: f32,
}

/// The traversal of an acceleration structure by a ray.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct TraceReport {
    /// The structure.
    pub accelerator: String,
    /// Nodes visited.
    pub nodes: u32,
    /// Cells visited.
    pub cells: u32,
    /// Primitives tested.
    pub primitives: u32,
    /// Total number of nodes and cells.
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
    /// Its centre.
    pub center: [f32; 3],
    /// Vectors from the centre to its sides.
    pub axes: [[f32; 3]; 3],
    /// True if it holds primitives.
    pub is_leaf: bool,
    /// Nesting depth of instances.
    pub level: u32,
    /// Primitives tested there.
    pub tested: u32,
    /// Distance of a hit that was found there.
    pub found: Option<f32>,
}
