//! Orthonormal frames: the local shading space, in which `z` is the normal.

use crate::simd::max;
use glam::Vec3;

/// A right-handed orthonormal basis. Local directions have `z` along the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Local x axis (tangent) in the outer space.
    pub x: Vec3,
    /// Local y axis (bitangent) in the outer space.
    pub y: Vec3,
    /// Local z axis (normal) in the outer space.
    pub z: Vec3,
}

impl Frame {
    /// A frame around the unit vector `z`; the tangent is arbitrary but a continuous function of
    /// `z` on each hemisphere (Duff et al., Building an orthonormal basis, revisited, JCGT 2017).
    #[inline(always)]
    pub fn from_z(z: Vec3) -> Self {
        let sign = 1.0_f32.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        Self {
            x: Vec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x),
            y: Vec3::new(b, sign + z.y * z.y * a, -z.y),
            z,
        }
    }

    /// A frame around the unit vector `z` whose x axis is as close to `x` as possible. Falls back
    /// to [`Self::from_z`] if `x` is parallel to `z` or not finite. It has no branches, so that
    /// loops over it are vectorised.
    #[inline(always)]
    pub fn from_z_and_x(z: Vec3, x: Vec3) -> Self {
        // Derivatives of positions may have any length, and the squares of tiny or huge ones would
        // underflow or overflow.
        let x = x / max(max(x.x.abs(), x.y.abs()), x.z.abs());
        let tangent = x - z * z.dot(x);
        let scale = 1.0 / tangent.length();
        let is_other = (scale > 0.0) & (scale < f32::INFINITY) & (tangent.length_squared() > 1e-12);
        let (x, any) = (tangent * scale, Self::from_z(z));
        Self { x, y: z.cross(x), z }.or(&any, is_other)
    }

    /// This frame if `is_this`, otherwise the other one. It has no branches.
    #[inline(always)]
    pub fn or(&self, other: &Self, is_this: bool) -> Self {
        let either = |a: Vec3, b: Vec3| {
            let one = |a: f32, b: f32| if is_this { a } else { b };
            Vec3::new(one(a.x, b.x), one(a.y, b.y), one(a.z, b.z))
        };
        Self { x: either(self.x, other.x), y: either(self.y, other.y), z: either(self.z, other.z) }
    }

    /// Converts a direction from the outer space to local coordinates.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// Converts a local direction to the outer space.
    #[inline]
    pub fn from_local(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_of_the_tangent_does_not_matter() {
        let (z, x) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.3, -2.0, 0.5));
        let expected = Frame::from_z_and_x(z, x);
        for exponent in [-120, -40, -20, 20, 120] {
            assert_eq!(Frame::from_z_and_x(z, x * 2f32.powi(exponent)), expected);
        }
    }

    #[test]
    fn frames_are_orthonormal_and_right_handed_everywhere() {
        for i in 0..1000 {
            let u = crate::rng::uniform2([i, 1, 2, 3]);
            let z = crate::sampling::uniform_sphere(u);
            for frame in [Frame::from_z(z), Frame::from_z_and_x(z, Vec3::X)] {
                assert!((frame.x.cross(frame.y) - z).length() < 2e-6, "{frame:?}");
                assert!((frame.x.length() - 1.0).abs() < 4e-6 && frame.x.dot(z).abs() < 1e-6 * 4.0);
            }
        }
        assert_eq!(Frame::from_z(-Vec3::Z).z, -Vec3::Z);
    }
}
