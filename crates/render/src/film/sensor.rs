//! The sensor of the camera: what it makes of the light that arrives.

use snell_math::spectrum::white_balance;
use snell_math::{DMat3, Mat3, Rgb, Vec3};
use snell_scene::SceneSettings;

/// A linear map from the colour of light that arrives to that of the pixel, both linear Rec. 709.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor(Mat3);

impl Sensor {
    /// The largest imaging ratio. Larger ones count as this one.
    const LARGEST: f64 = 1e10;

    /// The sensor that a scene asks for; `None` if the picture is the light itself.
    pub fn new(settings: &SceneSettings) -> Option<Self> {
        let ratio = settings.imaging_ratio.filter(|ratio| !ratio.is_nan());
        let white = settings.white_balance.filter(|kelvin| !kelvin.is_nan());
        (ratio.is_some_and(|ratio| ratio != 1.0) || white.is_some()).then(|| {
            let balance = white.map_or(DMat3::IDENTITY, white_balance);
            Self((balance * ratio.unwrap_or(1.0).clamp(0.0, Self::LARGEST)).as_mat3())
        })
    }

    /// The colour of the pixel in light of this colour. It may have negative channels.
    pub fn response(&self, light: Rgb) -> Rgb {
        (self.0 * Vec3::from(light.to_array())).to_array().into()
    }
}

/// Shows the matrix, column by column.
impl std::fmt::Display for Sensor {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(&self.0.to_cols_array().map(|x| x.to_string()).join(","))
    }
}
