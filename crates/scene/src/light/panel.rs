//! Flat one-sided sources without a visible body, as `.scn` files have them: a disk and a rectangle.
//!
//! Such a source lights a facing surface at distance `d` with the average over its area of
//! `emission * attenuation(d) * 2 cos(angle at the light)`, and with nothing behind its plane.

use super::Attenuation;
use snell_math::{DVec2, DVec3, Rgb, Vec2, sampling};

/// A point chosen uniformly on the unit disk around `center`, scaled by `radius`, in the plane perpendicular to `normal`.
pub(super) fn disk_point(center: DVec3, normal: DVec3, radius: f64, u: Vec2) -> DVec3 {
    let (x, y) = normal.any_orthonormal_pair();
    let p = sampling::concentric_disk(u).as_dvec2() * radius;
    center + x * p.x + y * p.y
}

/// A point chosen uniformly on the rectangle around `center`.
pub(super) fn rectangle_point(center: DVec3, axes: [DVec3; 2], lengths: [f64; 2], u: Vec2) -> DVec3 {
    let p = (u.as_dvec2() - 0.5) * DVec2::from(lengths);
    center + axes[0] * p.x + axes[1] * p.y
}

/// Direction and distance from `p` to a point of the source, and the irradiance that it stands for. `None` behind the source, in
/// its plane, and at the point itself.
pub(super) fn arriving(
    p: DVec3,
    point: DVec3,
    normal: DVec3,
    emission: Rgb,
    attenuation: &Attenuation,
) -> Option<(DVec3, f64, Rgb)> {
    let to_light = point - p;
    let distance = to_light.length();
    let direction = to_light / distance;
    let cos = -direction.dot(normal);
    (cos > 0.0).then(|| (direction, distance, emission * (attenuation.at(distance as f32) * 2.0 * cos as f32)))
}
