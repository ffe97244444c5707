//! Rotations made from angles, and angles of rotations, with the same bits on every machine: those
//! of `glam` use the platform's trigonometric functions.

use crate::real;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// The unit vector at an angle in radians from the x axis.
#[inline]
pub fn unit_vector(angle: f64) -> DVec2 {
    let (sin, cos) = real::sin_cos(angle);
    DVec2::new(cos, sin)
}

/// The rotation by an angle in radians about a unit vector (Rodrigues' formula).
pub fn about(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = real::sin_cos(angle);
    let DVec3 { x, y, z } = axis * sin;
    let across = axis * (1.0 - cos);
    DMat3::from_cols(
        axis * across.x + DVec3::new(cos, z, -y),
        axis * across.y + DVec3::new(-z, cos, x),
        axis * across.z + DVec3::new(y, -x, cos),
    )
}

/// The angle in radians between two vectors that are not zero, in `[0, pi]`.
pub fn angle_between(a: DVec3, b: DVec3) -> f64 {
    real::acos((a.dot(b) / (a.length_squared() * b.length_squared()).sqrt()).clamp(-1.0, 1.0))
}

/// The axis and the angle in radians, in `[0, 2 pi]`, of a unit quaternion. Without a rotation the
/// axis is that of x.
pub fn axis_and_angle(rotation: DQuat) -> (DVec3, f64) {
    let across = rotation.xyz();
    let angle = 2.0 * real::atan2(across.length(), rotation.w);
    (across.try_normalize().unwrap_or(DVec3::X), angle)
}

/// The rotation at the part `s` of the shortest way from one unit quaternion to another
/// (Shoemake, 1985).
pub fn slerp(from: DQuat, to: DQuat, s: f64) -> DQuat {
    let cos = from.dot(to);
    let (to, cos) = if cos < 0.0 { (-to, -cos) } else { (to, cos) };
    if cos > 1.0 - 1e-12 {
        return (from * (1.0 - s) + to * s).normalize();
    }
    let angle = real::acos(cos);
    (from * real::sin(angle * (1.0 - s)) + to * real::sin(angle * s)) * (1.0 / real::sin(angle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    /// A unit vector from two numbers in `[0, 1]`.
    fn direction([u, v]: [f64; 2]) -> DVec3 {
        let z = 2.0 * u - 1.0;
        (unit_vector(TAU * v) * (1.0 - z * z).sqrt()).extend(z).normalize()
    }

    proptest! {
        #[test]
        fn rotations_are_those_of_glam(
            u in prop::array::uniform2(0.0..1.0f64),
            v in prop::array::uniform2(0.0..1.0f64),
            angle in -6.2..6.2f64,
            s in 0.0..1.0f64,
        ) {
            let (axis, other) = (direction(u), direction(v));
            let turn = DMat3::from_axis_angle(axis, angle);
            prop_assert!(about(axis, angle).abs_diff_eq(turn, 1e-14));
            prop_assert!(unit_vector(angle).abs_diff_eq(DVec2::from_angle(angle), 1e-15));
            prop_assert!((angle_between(axis, other) - axis.angle_between(other)).abs() < 1e-14);
            let (from, to) = (
                DQuat::from_axis_angle(axis, angle),
                DQuat::from_axis_angle(other, 0.4 * angle),
            );
            prop_assert!(slerp(from, to, s).abs_diff_eq(from.slerp(to, s), 1e-9));
            prop_assert!(slerp(from, from, s).abs_diff_eq(from, 1e-14));
            let (back, turn) = axis_and_angle(from);
            prop_assert!(about(back, turn).abs_diff_eq(about(axis, angle), 1e-9));
        }
    }

    #[test]
    fn no_rotation_has_an_axis() {
        assert_eq!(axis_and_angle(DQuat::IDENTITY), (DVec3::X, 0.0));
    }
}
