//! A cone around the y axis.

use super::frustum::{Frustum, shape_as_frustum};
use super::{Metric, Patch, Shape, ShapeError, ShapeHit, ShapePoint, ShapeSample, ShapeSurface};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Bounds3d, DRay, DVec2, DVec3};

snell_math::declare! {
    /// A cone around the y axis, centred: closed base at `-height / 2`, apex at `+height / 2`.
    /// Faces: 0 side, 1 base. `uv` is that of `frustum`.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Cone {
        /// Radius of the base, positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub radius: f64,
        /// Height, positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub height: f64,
    }
}

impl Cone {
    /// Cones for tests and galleries: plain, needle, flat.
    pub fn examples() -> Vec<Self> {
        [(1.0, 2.0), (1e-2, 10.0), (30.0, 0.1)]
            .map(|(radius, height)| Self { radius, height })
            .to_vec()
    }

    fn as_frustum(&self) -> Frustum {
        Frustum { bottom_radius: self.radius, top_radius: 0.0, height: self.height, caps: true }
    }
}

shape_as_frustum!(Cone, |s| {
    ShapeError::unless_positive("cone", "radius", s.radius)?;
    ShapeError::unless_positive("cone", "height", s.height)
});
