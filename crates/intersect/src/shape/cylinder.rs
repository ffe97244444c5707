//! A cylinder around the y axis.

use super::frustum::{Frustum, closed, shape_as_frustum};
use super::{Metric, Patch, Shape, ShapeError, ShapeHit, ShapePoint, ShapeSample, ShapeSurface};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Bounds3d, DRay, DVec2, DVec3};

snell_math::declare! {
    /// A cylinder around the y axis, centred: from `-height / 2` to `+height / 2`. Faces and `uv`
    /// are those of `frustum`.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Cylinder {
        /// Radius, positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub radius: f64,
        /// Height, positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub height: f64,
        /// Whether the ends are closed by disks (the default).
        #[serde(default = "closed")]
        pub caps: bool,
    }
}

impl Cylinder {
    /// Cylinders for tests and galleries: plain, open, wire, coin.
    pub fn examples() -> Vec<Self> {
        [(1.0, 2.0, true), (1.0, 2.0, false), (1e-3, 50.0, true), (20.0, 1e-2, true)]
            .map(|(radius, height, caps)| Self { radius, height, caps })
            .to_vec()
    }

    fn as_frustum(&self) -> Frustum {
        Frustum {
            bottom_radius: self.radius,
            top_radius: self.radius,
            height: self.height,
            caps: self.caps,
        }
    }
}

shape_as_frustum!(Cylinder, |s| {
    ShapeError::unless_positive("cylinder", "radius", s.radius)?;
    ShapeError::unless_positive("cylinder", "height", s.height)
});
