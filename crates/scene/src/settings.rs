//! What a scene file may ask of the renderer. Options on the command line override all of it.

use serde::{Deserialize, Serialize};
use snell_math::DVec3;

/// Hints of the scene file; `None` where it says nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// Width and height in pixels.
    pub size: Option<[u32; 2]>,
    /// Which way is up for the default camera and sky.
    pub up: Option<DVec3>,
    /// Integrator by name.
    pub integrator: Option<String>,
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// How many times a path may bounce after the camera ray's hit.
    pub max_depth: Option<u32>,
    /// Sampler by name.
    pub sampler: Option<String>,
    /// Reconstruction filter by name.
    pub filter: Option<String>,
    /// If set, every sample of a pixel is taken at exactly this position in it (`[0, 0]` is its
    /// upper left corner), instead of being spread by the filter.
    pub pixel_position: Option<[f64; 2]>,
    /// Tone map by name.
    pub tonemap: Option<String>,
    /// Exposure in stops.
    pub exposure: Option<f64>,
    /// When the shutter opens and closes, in seconds from the time of the picture. What moves in
    /// between is blurred.
    pub shutter: Option<[f64; 2]>,
    /// Display values are the linear ones clamped to `[0, 1]`, without the sRGB curve, as old
    /// programs wrote them.
    pub raw_display: bool,
}
