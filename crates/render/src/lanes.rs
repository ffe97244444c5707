//! Values in structure-of-arrays layout: each array has one entry per lane. The compiler vectorises
//! loops over such arrays.

use snell_intersect::triangles::{HitLanes, HitVectors, TRIANGLE_HITS};
use snell_math::{SampledSpectrum, Vec3};

/// The largest number of vertices in a batch.
pub const LANES: usize = TRIANGLE_HITS;

/// A vector of zero in every lane.
pub const ZERO: HitVectors = [[0.0; LANES]; 3];

/// A spectrum for each lane, by channel. The fourth channel is zero in [`ColorMode::Rgb`].
pub type HitColors = [HitLanes; SPECTRUM];
const SPECTRUM: usize = snell_math::spectrum::LANES;

/// The zero spectrum in every lane.
pub const BLACK: HitColors = [[0.0; LANES]; SPECTRUM];

/// [`snell_math::at_level`] for a function that is generic over the number of channels. The number
/// is chosen by the colour model.
macro_rules! at_level_by_color {
    ($wide:expr, $color:expr, $function:ident, ($($arguments:tt)*)) => {
        match $color {
            snell_math::ColorModel::Rgb => {
                snell_math::at_level!($wide, $function::<3>, ($($arguments)*))
            }
            snell_math::ColorModel::Spectral => {
                snell_math::at_level!($wide, $function::<4>, ($($arguments)*))
            }
        }
    };
}
pub(crate) use at_level_by_color;

/// Zero in every lane.
pub const NOUGHTS: HitLanes = [0.0; LANES];

/// Infinity in every lane, as the ends of rays without an upper limit.
pub const ENDLESS: HitLanes = [f32::INFINITY; LANES];

/// The vector of a lane.
#[inline(always)]
pub fn at(v: &HitVectors, lane: usize) -> Vec3 {
    Vec3::new(v[0][lane], v[1][lane], v[2][lane])
}

/// Stores a vector in a lane.
#[inline(always)]
pub fn put(v: &mut HitVectors, lane: usize, to: Vec3) {
    (v[0][lane], v[1][lane], v[2][lane]) = (to.x, to.y, to.z);
}

/// The spectrum of a lane; missing channels are zero.
#[inline(always)]
pub fn color_at<const CHANNELS: usize>(v: &[HitLanes; CHANNELS], lane: usize) -> SampledSpectrum {
    let mut color = SampledSpectrum::ZERO;
    for (to, channel) in color.0.iter_mut().zip(v) {
        *to = channel[lane];
    }
    color
}

/// Stores a spectrum in a lane, for the channels that `v` has.
#[inline(always)]
pub fn put_color<const CHANNELS: usize>(
    v: &mut [HitLanes; CHANNELS],
    lane: usize,
    to: SampledSpectrum,
) {
    for (channel, x) in v.iter_mut().zip(to.0) {
        channel[lane] = x;
    }
}
