//! The start of a path: the camera sample and the camera ray.

use super::PathState;
use super::carried::Expected;
use super::light_part::LobeShares;
use crate::film::filter::FilterSampler;
use crate::light_sampler::Receiver;
use crate::sampler::Random;
use crate::settings::Settings;
use snell_math::{ColorMode, DVec2, Ray, Vec2};
use snell_scene::{Camera, CameraRay, CameraSample, CameraView};

/// The dimensions of the random numbers of a camera sample.
pub(crate) const FILM: u32 = 0;
pub(crate) const LENS: u32 = 1;
pub(crate) const WAVELENGTH: u32 = 2;
pub(crate) const TIME: u32 = 3;

/// The position of a sample on the film, in the coordinates of [`CameraSample::film`], and the
/// weight of the sample in the filter. Both come from the sample's random numbers of dimension
/// [`FILM`].
#[inline]
pub(crate) fn film_point(
    settings: &Settings,
    filter: &FilterSampler,
    pixel: [u32; 2],
    on_film: Vec2,
) -> (DVec2, f32) {
    let (position, weight) = match settings.pixel_position {
        Some([u, v]) => (DVec2::new(u, v), 1.0),
        None => {
            let (offset, weight) = filter.sample(on_film);
            (offset + 0.5, weight)
        }
    };
    (DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + position, weight)
}

/// The camera ray of a sample, and the state of its path. The path gets a time other than 0 only if
/// `moves` is true.
pub(crate) fn camera_path(
    view: &CameraView,
    settings: &Settings,
    moves: bool,
    random: &Random,
    film: DVec2,
) -> (Ray, PathState) {
    let time = if moves || !settings.later_cameras.is_empty() { random.number(TIME) } else { 0.0 };
    let camera = view.camera();
    let has_lens = camera.has_lens() || settings.later_cameras.iter().any(Camera::has_lens);
    let lens = if has_lens { random.pair(LENS) } else { Vec2::splat(0.5) };
    let sample = CameraSample { film, lens };
    let camera_ray = match &settings.later_cameras[..] {
        [] => view.ray(&sample),
        later => camera_at(camera, later, time).ray(&sample, settings.size),
    };
    let mode = settings.color.mode(|| random.number(WAVELENGTH));
    (camera_ray.ray, path_of(&camera_ray, mode, time))
}

/// The state of a path along a camera ray.
#[inline]
pub(crate) fn path_of(camera_ray: &CameraRay, mode: ColorMode, time: f32) -> PathState {
    PathState {
        throughput: mode.unit() * camera_ray.weight,
        mode,
        bsdf_pdf: 0.0,
        receiver: Receiver::default(),
        eta_scale: 1.0,
        is_specular: true,
        cone_width: camera_ray.width,
        expected: Expected::default(),
        cone_spread: camera_ray.spread,
        stream: 0,
        lobe: LobeShares::UNKNOWN,
        time,
    }
}

/// The camera at a time from 0 to 1, interpolated between `first` and the cameras in `later`.
pub(crate) fn camera_at(first: &Camera, later: &[Camera], time: f32) -> Camera {
    let x = f64::from(time) * later.len() as f64;
    let key = (x as usize).min(later.len() - 1);
    let before = if key == 0 { first } else { &later[key - 1] };
    before.on_its_way(&later[key], x - key as f64)
}
