//! Analytic shapes: one file per shape, with its parameters, all its operations, examples and tests.
//!
//! A shape lives in its own coordinates and answers in double precision for single-precision rays, so that a ray that starts a
//! rounding step off the surface is seen to do so. Placing it in a scene is the world's job ([`crate::World`]).
//!
//! To add a shape: a new file here, and its two lines in the list below. Tests, area lights and documentation iterate the list.

mod sphere;

pub use sphere::Sphere;

use serde::{Deserialize, Serialize};
use snell_math::{Bounds3d, DRay, DVec2, DVec3};

/// A point where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter.
    pub t: f64,
    /// Which face: the shape's own numbering, 0 if it has one face only.
    pub face: u32,
}

/// The surface of a shape at a point, in the shape's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeSurface {
    /// The point, moved onto the surface to double precision.
    pub position: DVec3,
    /// Unit normal on the outer side.
    pub normal: DVec3,
    /// Texture coordinates in `[0, 1]^2` (documented by each shape).
    pub uv: DVec2,
    /// Derivative of the position by `uv.x`. Not zero, except that poles and apexes may have any tangent instead.
    pub dpdu: DVec3,
    /// Derivative of the position by `uv.y`; `dpdu x dpdv` need not point outward.
    pub dpdv: DVec3,
}

/// A point chosen uniformly by area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeSample {
    /// The point.
    pub position: DVec3,
    /// Unit normal on the outer side.
    pub normal: DVec3,
    /// Texture coordinates, as [`ShapeSurface::uv`].
    pub uv: DVec2,
    /// The face the point lies on.
    pub face: u32,
}

/// What every analytic shape can do, in its own coordinates.
pub trait Shape: Send + Sync + std::fmt::Debug {
    /// The smallest box around the shape. May have infinite sides.
    fn bounds(&self) -> Bounds3d;

    /// The nearest point in the open interval of the ray, from either side. Directions have any length. Rays with NaN miss.
    fn closest(&self, ray: &DRay) -> Option<ShapeHit>;

    /// True if any point of the shape lies in the open interval of the ray.
    fn any(&self, ray: &DRay) -> bool {
        self.closest(ray).is_some()
    }

    /// Every crossing of the surface in the open interval of the ray, ascending by `t`. A tangent point may count twice or not
    /// at all.
    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>);

    /// The surface at `position`, a point on (or within rounding of) `face`.
    fn surface(&self, position: DVec3, face: u32) -> ShapeSurface;

    /// Area; infinite for unbounded shapes, which cannot be sampled.
    fn area(&self) -> f64;

    /// A point distributed uniformly by area (density `1 / area`), from `u` in `[0, 1)^2`. `None` for unbounded shapes.
    fn sample(&self, u: DVec2) -> Option<ShapeSample>;

    /// The outside is the side the normal points to; false for open surfaces (disk, rectangle, plane, triangle, polygon), which
    /// have no inside.
    fn is_closed(&self) -> bool;
}

/// Makes [`AnyShape`] from the list of shapes: the enum, its names, its dispatch.
macro_rules! shapes {
    ($($name:literal => $kind:ident,)*) => {
        /// Any of the shapes, as scenes hold them.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "shape", rename_all = "kebab-case")]
        pub enum AnyShape {
            $(#[doc = concat!("See [`", stringify!($kind), "`].")] $kind($kind),)*
        }

        impl AnyShape {
            /// The names of all shapes.
            pub const NAMES: &[&str] = &[$($name),*];

            /// The name of this shape.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$kind(_) => $name,)* }
            }

            /// A few of each shape, extremes included: what tests and galleries run over.
            pub fn examples() -> Vec<Self> {
                let mut all = Vec::new();
                $(all.extend($kind::examples().into_iter().map(Self::$kind));)*
                all
            }
        }

        impl Shape for AnyShape {
            fn bounds(&self) -> Bounds3d { match self { $(Self::$kind(s) => s.bounds(),)* } }
            fn closest(&self, ray: &DRay) -> Option<ShapeHit> { match self { $(Self::$kind(s) => s.closest(ray),)* } }
            fn any(&self, ray: &DRay) -> bool { match self { $(Self::$kind(s) => s.any(ray),)* } }
            fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) { match self { $(Self::$kind(s) => s.all(ray, hits),)* } }
            fn surface(&self, position: DVec3, face: u32) -> ShapeSurface { match self { $(Self::$kind(s) => s.surface(position, face),)* } }
            fn area(&self) -> f64 { match self { $(Self::$kind(s) => s.area(),)* } }
            fn sample(&self, u: DVec2) -> Option<ShapeSample> { match self { $(Self::$kind(s) => s.sample(u),)* } }
            fn is_closed(&self) -> bool { match self { $(Self::$kind(s) => s.is_closed(),)* } }
        }

        $(impl From<$kind> for AnyShape {
            fn from(shape: $kind) -> Self { Self::$kind(shape) }
        })*
    };
}

shapes! {
    "sphere" => Sphere,
}
