//! Axis-aligned bounding boxes, in `f32` for tracing and in `f64` for composing scenes.

use glam::{DVec3, Vec3};

/// An axis-aligned box in single precision. Empty if any `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds3 {
    /// Minimum corner.
    pub min: Vec3,
    /// Maximum corner.
    pub max: Vec3,
}

/// An axis-aligned box in double precision. Empty if any `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds3d {
    /// Minimum corner.
    pub min: DVec3,
    /// Maximum corner.
    pub max: DVec3,
}

macro_rules! bounds {
    ($name:ident, $vec:ty, $float:ty) => {
        impl Default for $name {
            #[inline]
            fn default() -> Self {
                Self::EMPTY
            }
        }

        impl $name {
            /// The empty box: the neutral element of [`Self::union`].
            pub const EMPTY: Self = Self {
                min: <$vec>::splat(<$float>::INFINITY),
                max: <$vec>::splat(<$float>::NEG_INFINITY),
            };

            /// The box that holds everything.
            pub const INFINITE: Self = Self {
                min: <$vec>::splat(<$float>::NEG_INFINITY),
                max: <$vec>::splat(<$float>::INFINITY),
            };

            /// The smallest box around `points`. Points with a NaN coordinate are ignored.
            #[inline]
            pub fn of(points: impl IntoIterator<Item = $vec>) -> Self {
                points
                    .into_iter()
                    .fold(Self::EMPTY, |b, p| if p.is_nan() { b } else { b.with_point(p) })
            }

            /// The box grown to hold `p`.
            #[inline]
            pub fn with_point(&self, p: $vec) -> Self {
                Self { min: self.min.min(p), max: self.max.max(p) }
            }

            /// The smallest box around both boxes.
            #[inline]
            pub fn union(&self, other: &Self) -> Self {
                Self { min: self.min.min(other.min), max: self.max.max(other.max) }
            }

            /// The common part of both boxes, which may be empty.
            #[inline]
            pub fn intersection(&self, other: &Self) -> Self {
                Self { min: self.min.max(other.min), max: self.max.min(other.max) }
            }

            /// True if the box holds no point.
            #[inline]
            pub fn is_empty(&self) -> bool {
                !self.min.cmple(self.max).all()
            }

            /// True if all six sides are finite numbers.
            #[inline]
            pub fn is_finite(&self) -> bool {
                self.min.is_finite() && self.max.is_finite()
            }

            /// Extent along each axis.
            #[inline]
            pub fn size(&self) -> $vec {
                self.max - self.min
            }

            /// Midpoint.
            #[inline]
            pub fn center(&self) -> $vec {
                self.min * 0.5 + self.max * 0.5
            }

            /// Half the length of the diagonal: the radius of the sphere around the box.
            #[inline]
            pub fn radius(&self) -> $float {
                if self.is_empty() { 0.0 } else { self.size().length() * 0.5 }
            }

            /// Half of the surface area; 0 if empty.
            #[inline]
            pub fn half_area(&self) -> $float {
                if self.is_empty() {
                    return 0.0;
                }
                let d = self.size();
                d.x * d.y + d.y * d.z + d.z * d.x
            }

            /// True if `p` lies in the closed box.
            #[inline]
            pub fn contains(&self, p: $vec) -> bool {
                p.cmpge(self.min).all() && p.cmple(self.max).all()
            }
        }
    };
}

bounds!(Bounds3, Vec3, f32);
bounds!(Bounds3d, DVec3, f64);

impl Bounds3d {
    /// The smallest single-precision box that holds this one: rounded outward.
    #[inline]
    pub fn outward_f32(&self) -> Bounds3 {
        let down = |x: f64| {
            let y = x as f32;
            if f64::from(y) > x { y.next_down() } else { y }
        };
        let up = |x: f64| {
            let y = x as f32;
            if f64::from(y) < x { y.next_up() } else { y }
        };
        Bounds3 {
            min: Vec3::new(down(self.min.x), down(self.min.y), down(self.min.z)),
            max: Vec3::new(up(self.max.x), up(self.max.y), up(self.max.z)),
        }
    }
}

impl From<Bounds3> for Bounds3d {
    #[inline]
    fn from(b: Bounds3) -> Self {
        Self { min: b.min.as_dvec3(), max: b.max.as_dvec3() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outward_rounding_never_loses_a_point() {
        let b = Bounds3d { min: DVec3::splat(0.1), max: DVec3::splat(0.3) };
        let outer: Bounds3d = b.outward_f32().into();
        assert!(outer.contains(b.min) && outer.contains(b.max));
    }

    #[test]
    fn empty_is_neutral() {
        let b = Bounds3 { min: Vec3::ZERO, max: Vec3::ONE };
        assert_eq!(b.union(&Bounds3::EMPTY), b);
        assert!(Bounds3::EMPTY.is_empty() && Bounds3::EMPTY.half_area() == 0.0);
    }
}
