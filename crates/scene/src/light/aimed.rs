//! Common code of lights that emit from a point, with an intensity that depends on the direction in
//! the light's own coordinates, and with the inverse square law.

use super::bounds::mean_intensity;
use super::{Attenuation, Incident, LightBounds, towards, unit};
use snell_math::{DMat3, DVec3, Rgb};

/// The light that arrives at `p`. `intensity` is called with a unit direction in the light's
/// coordinates.
pub(super) fn arriving(
    p: DVec3,
    position: DVec3,
    world_from_light: &DMat3,
    intensity: impl FnOnce(DVec3) -> Rgb,
) -> Option<Incident> {
    let (direction, distance) = towards(p, position)?;
    let intensity = intensity(rotation(world_from_light).transpose() * -direction);
    let irradiance = intensity * Attenuation::INVERSE_SQUARE.at(distance as f32);
    Some(Incident { direction, distance, irradiance })
}

/// The matrix with axes of unit length.
fn rotation(world_from_light: &DMat3) -> DMat3 {
    let DMat3 { x_axis, y_axis, z_axis } = *world_from_light;
    DMat3::from_cols(unit(x_axis), unit(y_axis), unit(z_axis))
}

/// The bounds of light that stays within `widest` radians of the `+z` axis.
pub(super) fn bounds(
    position: DVec3,
    world_from_light: &DMat3,
    widest: f64,
    power: f64,
) -> Option<LightBounds> {
    let axis = rotation(world_from_light).z_axis;
    LightBounds::of_cone(position, axis, widest, mean_intensity(power, widest))
}
