//! Affine maps between two spaces, with their inverses, in double precision.

use crate::{Bounds3d, DRay};
use glam::{DAffine3, DMat3, DMat4, DVec3};

/// An invertible affine map together with its inverse. Variables are named `to_from`, such as
/// `world_from_object`.
///
/// The whole map applies to points, its linear part to directions (unnormalised, so that a ray
/// keeps its `t`), and the inverse transpose of the linear part to normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    forward: DAffine3,
    inverse: DAffine3,
}

impl Default for Transform {
    #[inline]
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Transform {
    /// The identity map.
    pub const IDENTITY: Self = Self { forward: DAffine3::IDENTITY, inverse: DAffine3::IDENTITY };

    /// The map with this matrix. `None` if it is singular or not finite.
    #[inline]
    pub fn new(forward: DAffine3) -> Option<Self> {
        let determinant = forward.matrix3.determinant();
        if !forward.is_finite() || determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        let inverse = forward.inverse();
        inverse.is_finite().then_some(Self { forward, inverse })
    }

    /// The map with this 4x4 matrix (column vectors). `None` if it is singular, not finite, or not
    /// affine: the last row must be `0 0 0 w` with `w != 0` (the matrix is divided by `w`).
    #[inline]
    pub fn from_matrix(matrix: DMat4) -> Option<Self> {
        let row = matrix.row(3);
        if row.x != 0.0 || row.y != 0.0 || row.z != 0.0 || row.w == 0.0 || !row.w.is_finite() {
            return None;
        }
        Self::new(DAffine3::from_mat4(matrix * (1.0 / row.w)))
    }

    /// Translation by `offset`.
    #[inline]
    pub fn translation(offset: DVec3) -> Self {
        Self {
            forward: DAffine3::from_translation(offset),
            inverse: DAffine3::from_translation(-offset),
        }
    }

    /// The affine matrix of the map.
    #[inline]
    pub fn matrix(&self) -> &DAffine3 {
        &self.forward
    }

    /// The affine matrix of the inverse map.
    #[inline]
    pub fn inverse_matrix(&self) -> &DAffine3 {
        &self.inverse
    }

    /// The inverse map.
    #[inline]
    pub fn inverse(&self) -> Self {
        Self { forward: self.inverse, inverse: self.forward }
    }

    /// `self` after `other`: `a_from_b.compose(&b_from_c)` is `a_from_c`.
    #[inline]
    pub fn compose(&self, other: &Self) -> Self {
        Self { forward: self.forward * other.forward, inverse: other.inverse * self.inverse }
    }

    /// True if the map is exactly the identity.
    #[inline]
    pub fn is_identity(&self) -> bool {
        self.forward == DAffine3::IDENTITY
    }

    /// True if the map turns a right-handed frame into a left-handed one.
    #[inline]
    pub fn is_mirrored(&self) -> bool {
        self.forward.matrix3.determinant() < 0.0
    }

    /// Determinant of the linear part: the factor by which volumes grow (negative if mirrored).
    #[inline]
    pub fn determinant(&self) -> f64 {
        self.forward.matrix3.determinant()
    }

    /// Maps a point.
    #[inline]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.forward.transform_point3(p)
    }

    /// Maps a direction or difference of points; the length changes with the map.
    #[inline]
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.forward.transform_vector3(v)
    }

    /// Maps a surface normal by the inverse transpose. The result is not normalised. For a mirrored
    /// map it stays on the outward side of closed surfaces.
    #[inline]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        let m: DMat3 = self.inverse.matrix3;
        m.transpose() * n
    }

    /// Maps a ray; `t` has the same meaning in both spaces.
    #[inline]
    pub fn ray(&self, ray: &DRay) -> DRay {
        DRay {
            origin: self.point(ray.origin),
            direction: self.vector(ray.direction),
            t_min: ray.t_min,
            t_max: ray.t_max,
        }
    }

    /// The bounds of the mapped box. An empty box stays empty; an infinite extent stays infinite
    /// along the axes that it maps to.
    #[inline]
    pub fn bounds(&self, b: &Bounds3d) -> Bounds3d {
        if b.is_empty() {
            return Bounds3d::EMPTY;
        }
        // The method is that of Arvo, Transforming axis-aligned bounding boxes (Graphics Gems,
        // 1990), where 0 times infinity is 0.
        let times = |m: f64, x: f64| if m == 0.0 { 0.0 } else { m * x };
        let mut result = Bounds3d { min: self.forward.translation, max: self.forward.translation };
        for column in 0..3 {
            let axis = self.forward.matrix3.col(column);
            for row in 0..3 {
                let a = times(axis[row], b.min[column]);
                let c = times(axis[row], b.max[column]);
                result.min[row] += a.min(c);
                result.max[row] += a.max(c);
            }
        }
        result
    }

    /// The factor by which the map scales the area of a small surface patch with unit normal `n`:
    /// `|det M| |M^-T n|`.
    #[inline]
    pub fn area_scale(&self, n: DVec3) -> f64 {
        self.determinant().abs() * self.normal(n).length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skewed() -> Transform {
        Transform::from_matrix(DMat4::from_cols_array(&[
            1.0, 0.5, 0.0, 0.0, 0.0, -2.0, 0.3, 0.0, 0.2, 0.0, 3.0, 0.0, 4.0, 5.0, 6.0, 1.0,
        ]))
        .expect("the matrix is invertible")
    }

    #[test]
    fn a_normal_stays_perpendicular_to_mapped_tangents() {
        let m = skewed();
        let (a, b) = (DVec3::new(1.0, 2.0, 0.5), DVec3::new(-1.0, 0.3, 2.0));
        let n = m.normal(a.cross(b));
        assert!(n.dot(m.vector(a)).abs() < 1e-12 && n.dot(m.vector(b)).abs() < 1e-12);
    }

    #[test]
    fn a_mapped_ray_keeps_its_parameter() {
        let m = skewed();
        let ray = DRay::new(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.1, -0.4, 2.0));
        assert!((m.ray(&ray).at(1.7) - m.point(ray.at(1.7))).length() < 1e-12);
    }

    #[test]
    fn bounds_hold_all_mapped_corners() {
        let m = skewed();
        let b = Bounds3d { min: DVec3::new(-1.0, 0.0, 2.0), max: DVec3::new(1.0, 4.0, 3.0) };
        let image = m.bounds(&b);
        for i in 0..8 {
            let corner = DVec3::new(
                if i & 1 == 0 { b.min.x } else { b.max.x },
                if i & 2 == 0 { b.min.y } else { b.max.y },
                if i & 4 == 0 { b.min.z } else { b.max.z },
            );
            let p = m.point(corner);
            assert!(image.min.cmple(p + 1e-12).all() && image.max.cmpge(p - 1e-12).all());
        }
    }

    #[test]
    fn area_scale_matches_a_mapped_parallelogram() {
        let m = skewed();
        let (a, b) = (DVec3::new(1.0, 0.2, 0.0), DVec3::new(0.0, 1.0, 0.7));
        let direct = m.vector(a).cross(m.vector(b)).length() / a.cross(b).length();
        assert!((direct - m.area_scale(a.cross(b).normalize())).abs() < 1e-12);
    }

    #[test]
    fn singular_and_projective_matrices_are_refused() {
        assert!(Transform::from_matrix(DMat4::ZERO).is_none());
        assert!(
            Transform::from_matrix(DMat4::from_cols_array(&[
                1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.1, 0.0,
            ]))
            .is_none()
        );
    }
}
