//! The render settings of a scene file. Command-line options override all of them.

use serde::{Deserialize, Serialize};
use snell_math::DVec3;

/// The settings that a scene file makes. `None` stands for a setting that the file does not make.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// Width and height of the picture in pixels.
    pub size: Option<[u32; 2]>,
    /// The up direction for the default camera and sky.
    pub up: Option<DVec3>,
    /// Name of the integrator.
    pub integrator: Option<String>,
    /// Name of the way to find caustics.
    pub caustics: Option<String>,
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// Maximum number of bounces after the camera ray's hit.
    pub max_depth: Option<u32>,
    /// Name of the shadows of `raycast` and `whitted`.
    pub shadows: Option<String>,
    /// Name of the sampler.
    pub sampler: Option<String>,
    /// Name of the reconstruction filter.
    pub filter: Option<String>,
    /// If set, every sample of a pixel is taken at exactly this position in the pixel (`[0, 0]` is
    /// its upper left corner), instead of being distributed by the filter.
    pub pixel_position: Option<[f64; 2]>,
    /// Factor by which the film multiplies light, in pictures of all formats: in pbrt, the exposure
    /// time in seconds times the ISO sensitivity / 100. Values count as at least 0 and at most
    /// 1e10; the default is 1.
    pub imaging_ratio: Option<f64>,
    /// Temperature in kelvin of the daylight that is white in the picture. Values count as at least
    /// 1000 and at most 25000; by default, D65 is white.
    pub white_balance: Option<f64>,
    /// Name of the tone map.
    pub tonemap: Option<String>,
    /// Exposure in stops.
    pub exposure: Option<f64>,
    /// Times at which the shutter opens and closes, in seconds from the time of the picture. Motion
    /// between them is blurred.
    pub shutter: Option<[f64; 2]>,
    /// True if display values are the linear values clamped to `[0, 1]`, without the sRGB curve, as
    /// old programs wrote them.
    pub raw_display: bool,
}
