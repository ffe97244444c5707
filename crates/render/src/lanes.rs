//! Values in structure-of-arrays layout: arrays with one entry per lane, for loops that the
//! compiler vectorises.

use snell_intersect::triangles::{HitLanes, HitVectors, TRIANGLE_HITS};
use snell_math::{SampledSpectrum, Vec3};

/// The largest number of vertices in a batch.
pub const LANES: usize = TRIANGLE_HITS;

/// A vector of zero in every lane.
pub const ZERO: HitVectors = [[0.0; LANES]; 3];

/// A spectrum for each lane, by channel: the fourth is zero in [`ColorMode::Rgb`].
pub type HitColors = [HitLanes; SPECTRUM];
const SPECTRUM: usize = snell_math::spectrum::LANES;

/// Zero in every lane.
pub const BLACK: HitColors = [[0.0; LANES]; SPECTRUM];

/// [`snell_math::at_level`] of a function that is generic over the number of channels of the colour
/// mode.
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

/// Zero for each lane.
pub const NOUGHTS: HitLanes = [0.0; LANES];

/// Rays without an upper limit.
pub const ENDLESS: HitLanes = [f32::INFINITY; LANES];

/// The vector of a lane.
#[inline(always)]
pub fn at(v: &HitVectors, lane: usize) -> Vec3 {
    Vec3::new(v[0][lane], v[1][lane], v[2][lane])
}

/// Puts a vector into a lane.
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

/// Puts a spectrum into a lane, for the channels that there are.
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
