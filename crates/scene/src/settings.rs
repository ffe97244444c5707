//! The render settings of a scene file. Options on the command line override all of them.

use serde::{Deserialize, Serialize};
use snell_math::DVec3;

/// Settings of the scene file; `None` if it does not set them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// Width and height in pixels.
    pub size: Option<[u32; 2]>,
    /// The up direction for the default camera and sky.
    pub up: Option<DVec3>,
    /// Integrator by name.
    pub integrator: Option<String>,
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// Maximum number of bounces after the camera ray's hit.
    pub max_depth: Option<u32>,
    /// Sampler by name.
    pub sampler: Option<String>,
    /// Reconstruction filter by name.
    pub filter: Option<String>,
    /// If set, every sample of a pixel is taken at exactly this position in it (`[0, 0]` is its
    /// upper left corner), instead of being distributed by the filter.
    pub pixel_position: Option<[f64; 2]>,
    /// Tone map by name.
    pub tonemap: Option<String>,
    /// Exposure in stops.
    pub exposure: Option<f64>,
    /// Times at which the shutter opens and closes, in seconds from the time of the picture. Motion
    /// in between is blurred.
    pub shutter: Option<[f64; 2]>,
    /// True if display values are the linear ones clamped to `[0, 1]`, without the sRGB curve, as
    /// old programs wrote them.
    pub raw_display: bool,
}
