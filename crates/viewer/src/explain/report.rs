//! What is told about a pixel. All colours are linear Rec. 709.

use serde::Serialize;

/// Why a pixel looks as it does.
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
    /// The pixel as the samples come in.
    pub convergence: Vec<Point>,
    /// Its light, by the way that it took; the brightest first.
    pub classes: Vec<PathClass>,
    /// The colours of the samples, by number.
    pub samples: Vec<[f32; 3]>,
    /// One sample in all detail.
    pub tree: SampleReport,
    /// The way of that sample's camera ray through acceleration structures.
    pub journeys: Vec<JourneyReport>,
    /// Corners of the box around the scene.
    pub bounds: [[f32; 3]; 2],
    /// Some points that the camera sees.
    pub cloud: Vec<[f32; 3]>,
}

/// The pixel after some samples.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Point {
    /// How many.
    pub samples: u32,
    /// Their mean.
    pub value: [f32; 3],
    /// Its standard error; 0 while unknown.
    pub error: [f32; 3],
}

/// Light that took the same kind of way.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct PathClass {
    /// In Heckbert's letters, from the eye to the light: E, then D (diffuse), G (glossy), S
    /// (mirror), T (through), V (medium), L.
    pub way: String,
    /// What it adds to the pixel.
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
    /// The sum of all contributions of its vertices, in the renderer's order: the same.
    pub sum: [f32; 3],
    /// The filter's weight.
    pub weight: f32,
    /// Where its rays ended, parents first.
    pub vertices: Vec<VertexReport>,
}

/// Where a ray ended.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct VertexReport {
    /// The vertex that the ray came from; none for the camera.
    pub parent: Option<u32>,
    /// Bounces before.
    pub depth: u32,
    /// `surface`, `medium`, `escaped` or `absorbed`.
    pub what: String,
    /// Names of the nodes down to the surface.
    pub object: String,
    /// The material's name.
    pub material: String,
    /// Triangle or face.
    pub primitive: Option<u32>,
    /// Where the ray begins.
    pub origin: [f32; 3],
    /// Its direction.
    pub direction: [f32; 3],
    /// Where it ended.
    pub position: Option<[f32; 3]>,
    /// Shading normal.
    pub normal: Option<[f32; 3]>,
    /// Length of the ray.
    pub distance: Option<f32>,
    /// What the path carried on arrival.
    pub throughput: [f32; 3],
    /// The lobe that sent the ray; none for the camera's.
    pub lobe: Option<String>,
    /// Density per steradian with which it was sent; none for mirrors and clear glass.
    pub pdf: Option<f32>,
    /// Light of media on the way, times throughput.
    pub glow: [f32; 3],
    /// Light found here, times throughput and weight.
    pub found: [f32; 3],
    /// Weight of what was found, by multiple importance sampling.
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
    /// What scatters its light.
    pub lobe: String,
    /// Where the ray to it begins.
    pub origin: [f32; 3],
    /// Its direction.
    pub direction: [f32; 3],
    /// Where it ends; none for lights at infinity.
    pub end: Option<[f32; 3]>,
    /// What it would bring.
    pub value: [f32; 3],
    /// What it brings.
    pub brought: [f32; 3],
    /// True if something is in the way.
    pub is_blocked: bool,
    /// Its weight by multiple importance sampling; it is in the values.
    pub weight: f32,
}

/// The way of a ray through an acceleration structure.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct JourneyReport {
    /// The structure.
    pub accelerator: String,
    /// Nodes visited.
    pub nodes: u32,
    /// Cells gone through.
    pub cells: u32,
    /// Primitives tested.
    pub primitives: u32,
    /// Nodes and cells that there are.
    #[cfg_attr(test, ts(type = "number"))]
    pub built_nodes: u64,
    /// How far the hit is; none if there is none.
    pub distance: Option<f32>,
    /// Where it looked, in order.
    pub stops: Vec<StopReport>,
    /// Stops that are not told.
    #[cfg_attr(test, ts(type = "number"))]
    pub left_out: u64,
}

/// A place where a structure looked.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct StopReport {
    /// `box`, `ball`, `plane` or `stretch` (of the ray itself).
    pub kind: String,
    /// Its middle.
    pub center: [f32; 3],
    /// From the middle to its sides.
    pub axes: [[f32; 3]; 3],
    /// True if it holds primitives.
    pub is_leaf: bool,
    /// How many instances it is within.
    pub level: u32,
    /// Primitives tested there.
    pub tested: u32,
    /// Distance of a hit that was found there.
    pub found: Option<f32>,
}
