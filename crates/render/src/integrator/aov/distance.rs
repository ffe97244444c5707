//! AOVs of the distance of the hit.

use super::colors::value;
use super::{AovKind, Declared, Needs};
use snell_math::Rgb;

/// The AOV of the distance along the view direction.
pub const DEPTH: Declared = Declared {
    name: "depth",
    channels: &["Z"],
    kind: AovKind::Averaged,
    needs: Needs::Hit,
    values: |_, first, camera, values| {
        let along = first.ray.direction.normalize().dot(camera.towards.as_vec3());
        values.push(first.hit.t * first.ray.direction.length() * along);
    },
    preview: near_is_bright,
};

/// The AOV of the distance along the ray.
pub const DISTANCE: Declared = Declared {
    name: "distance",
    channels: &["V"],
    kind: AovKind::Averaged,
    needs: Needs::Hit,
    values: |_, first, _, values| values.push(first.hit.t * first.ray.direction.length()),
    preview: near_is_bright,
};

fn near_is_bright(values: &[f32], scene_radius: f32) -> Rgb {
    let distance = value(values, 0);
    let d = distance / (4.0 * scene_radius);
    Rgb::splat(if distance > 0.0 { 1.0 / (1.0 + d * 2.0) } else { 0.0 })
}
