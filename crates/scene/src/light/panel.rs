//! Common code of flat one-sided sources without a visible body, as in `.scn` files.
//!
//! A surface that faces such a source at distance `d` receives the average over the source's area
//! of `emission * attenuation(d) * 2 cos(angle at the light)`. Points behind the source's plane
//! receive nothing.

use super::{Attenuation, Incident, luminance};
use snell_math::{DVec3, Rgb};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Half-angle of the cone around the normal that contains all of the light, in radians.
pub(super) const WIDEST: f64 = FRAC_PI_2;

/// The light that a point of the source sends to `p`. `None` behind the source, in its plane, and
/// at the point itself.
pub(super) fn arriving(
    p: DVec3,
    point: DVec3,
    normal: DVec3,
    emission: Rgb,
    attenuation: &Attenuation,
) -> Option<Incident> {
    let to_light = point - p;
    let distance = to_light.length();
    let direction = to_light / distance;
    let cos = -direction.dot(normal);
    let irradiance = emission * (attenuation.at(distance as f32) * 2.0 * cos as f32);
    (cos > 0.0).then_some(Incident { direction, distance, irradiance })
}

/// Power in W. The integral of `2 cos` over the hemisphere is `2 pi`.
pub(super) fn power(emission: Rgb, attenuation: &Attenuation, scene_radius: f64) -> f64 {
    TAU * luminance(emission) * attenuation.over_sphere(scene_radius)
}
