//! Placements, and animated transforms whose parts are interpolated.

use snell_math::glam::DQuat;
use snell_math::{DAffine3, DMat3, DVec3, rotation};

/// A transform to the coordinates of the parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Scale, then rotation, then translation.
    Parts {
        /// Translation.
        translation: DVec3,
        /// Rotation, a unit quaternion.
        rotation: DQuat,
        /// Scale along each axis.
        scale: DVec3,
    },
    /// Any affine map.
    Matrix(DAffine3),
}

impl Default for Placement {
    fn default() -> Self {
        Self::Parts { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl Placement {
    /// The affine map to the parent's coordinates.
    pub fn matrix(&self) -> DAffine3 {
        match *self {
            Self::Parts { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(matrix) => matrix,
        }
    }

    /// Translation, rotation and scale; for a matrix, those that glam extracts, which reproduce the
    /// matrix only if it has no shear.
    pub(super) fn parts(&self) -> (DVec3, DQuat, DVec3) {
        match *self {
            Self::Parts { translation, rotation, scale } => (translation, rotation, scale),
            Self::Matrix(matrix) => {
                let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
                (translation, rotation, scale)
            }
        }
    }
}

/// A transform that is given at some times. Between these, translations are interpolated linearly,
/// rotations spherically, and the rest of the maps (scale and shear) linearly: the decomposition of
/// Shoemake and Duff, *Matrix Animation and Polar Decomposition*, 1992, as in pbrt. The transform
/// is constant before the first time and after the last.
#[derive(Clone, Debug)]
pub struct AnimatedTransform {
    keys: Vec<Key>,
}

#[derive(Clone, Debug)]
struct Key {
    time: f64,
    map: DAffine3,
    rotation: DQuat,
    stretch: DMat3,
}

impl AnimatedTransform {
    /// The transform with these values at these times, which need not be sorted. Keys whose time is
    /// not finite are ignored, and of several keys with the same time the first counts. Without any
    /// keys the transform is the identity.
    pub fn new(keys: impl IntoIterator<Item = (f64, DAffine3)>) -> Self {
        let mut keys: Vec<Key> =
            keys.into_iter().filter(|(time, _)| time.is_finite()).map(Key::new).collect();
        keys.sort_by(|a, b| a.time.total_cmp(&b.time));
        keys.dedup_by(|later, earlier| later.time == earlier.time);
        Self { keys }
    }

    /// The times in seconds, ascending, and the transforms at them.
    pub fn keys(&self) -> impl Iterator<Item = (f64, DAffine3)> + '_ {
        self.keys.iter().map(|key| (key.time, key.map))
    }

    /// The times of the first and the last key, in seconds.
    pub fn span(&self) -> [f64; 2] {
        match (self.keys.first(), self.keys.last()) {
            (Some(first), Some(last)) => [first.time, last.time],
            _ => [0.0; 2],
        }
    }

    /// False if the transform is constant.
    pub fn moves(&self) -> bool {
        self.keys.windows(2).any(|pair| pair[0].map != pair[1].map)
    }

    /// The map at a time in seconds.
    pub fn at(&self, time: f64) -> DAffine3 {
        let after = self.keys.partition_point(|key| key.time <= time);
        let before = self.keys.get(after.saturating_sub(1));
        let (Some(a), Some(b)) = (before, self.keys.get(after).or(before)) else {
            return DAffine3::IDENTITY;
        };
        let s = if b.time > a.time {
            ((time - a.time) / (b.time - a.time)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        if s == 0.0 || a.map == b.map {
            return a.map;
        }
        let stretch = a.stretch * (1.0 - s) + b.stretch * s;
        let matrix3 = DMat3::from_quat(rotation::slerp(a.rotation, b.rotation, s)) * stretch;
        DAffine3 { matrix3, translation: a.map.translation.lerp(b.map.translation, s) }
    }
}

impl Key {
    fn new((time, map): (f64, DAffine3)) -> Self {
        let (rotation, stretch) = polar(map.matrix3);
        Self { time, map, rotation, stretch }
    }
}

/// Polar decomposition into a rotation after a stretch. Mirroring is part of the stretch. For a
/// singular matrix the rotation is the identity.
fn polar(matrix: DMat3) -> (DQuat, DMat3) {
    const STEPS: usize = 100;
    let none = (DQuat::IDENTITY, matrix);
    if !matrix.is_finite() || matrix.determinant() == 0.0 {
        return none;
    }
    let mut orthogonal = matrix;
    for _ in 0..STEPS {
        let next = (orthogonal + orthogonal.inverse().transpose()) * 0.5;
        let change =
            (next - orthogonal).to_cols_array().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        orthogonal = next;
        if change.is_nan() {
            return none;
        }
        if change < 1e-14 {
            break;
        }
    }
    if orthogonal.determinant() < 0.0 {
        orthogonal *= -1.0;
    }
    (DQuat::from_mat3(&orthogonal).normalize(), orthogonal.transpose() * matrix)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    fn assert_near(a: DAffine3, b: DAffine3) {
        assert!(a.abs_diff_eq(b, 1e-9), "{a} and {b}");
    }

    #[test]
    fn rotations_stay_rigid_on_their_way() {
        let moved = DAffine3::from_translation(DVec3::new(4.0, 0.0, 0.0));
        let turned = moved
            * DAffine3::from_rotation_z(FRAC_PI_2)
            * DAffine3::from_scale(DVec3::new(1.0, 3.0, 1.0));
        let transform = AnimatedTransform::new([(1.0, turned), (0.0, DAffine3::IDENTITY)]);
        assert_near(transform.at(-1.0), DAffine3::IDENTITY);
        assert_near(transform.at(2.0), turned);
        let half = DAffine3::from_translation(DVec3::new(2.0, 0.0, 0.0))
            * DAffine3::from_rotation_z(FRAC_PI_4)
            * DAffine3::from_scale(DVec3::new(1.0, 2.0, 1.0));
        assert_near(transform.at(0.5), half);
        assert!(transform.moves() && transform.span() == [0.0, 1.0]);
    }

    #[test]
    fn mirrored_flat_and_missing_maps_are_taken_as_they_are() {
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        let transform =
            AnimatedTransform::new([(0.0, mirror), (1.0, mirror), (2.0, flat), (f64::NAN, flat)]);
        assert_eq!((transform.at(0.5), transform.at(2.0)), (mirror, flat));
        assert!(transform.at(1.5).is_finite());
        assert_eq!(AnimatedTransform::new([]).at(1.0), DAffine3::IDENTITY);
        assert!(!AnimatedTransform::new([(0.0, mirror), (1.0, mirror)]).moves());
    }
}
