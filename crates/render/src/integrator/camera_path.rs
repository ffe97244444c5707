//! How a path starts: at a point of the film, through the lens.

use super::PathState;
use super::light_part::LobeShares;
use crate::film::filter::FilterSampler;
use crate::light_sampler::Receiver;
use crate::sampler::Random;
use crate::settings::Settings;
use snell_math::{DVec2, Ray};
use snell_scene::{Camera, CameraSample};

/// Dimensions of the camera sample.
const FILM: u32 = 0;
const LENS: u32 = 1;
const WAVELENGTH: u32 = 2;

/// A sample's first ray, what the path carries, and the filter's weight.
pub(crate) fn camera_path(
    camera: &Camera,
    settings: &Settings,
    filter: &FilterSampler,
    pixel: [u32; 2],
    random: &Random,
) -> (Ray, PathState, f32) {
    let (position, weight) = match settings.pixel_position {
        Some([u, v]) => (DVec2::new(u, v), 1.0),
        None => {
            let (offset, weight) = filter.sample(random.pair(FILM));
            (offset + 0.5, weight)
        }
    };
    let film = DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + position;
    let camera_ray = camera.ray(&CameraSample { film, lens: random.pair(LENS) }, settings.size);
    let mode = settings.color.mode(|| random.number(WAVELENGTH));
    let state = PathState {
        throughput: mode.unit() * camera_ray.weight,
        mode,
        bsdf_pdf: 0.0,
        receiver: Receiver::default(),
        eta_scale: 1.0,
        is_specular: true,
        cone_width: camera_ray.width,
        cone_spread: camera_ray.spread,
        stream: 0,
        lobe: LobeShares::UNKNOWN,
    };
    (camera_ray.ray, state, weight)
}
