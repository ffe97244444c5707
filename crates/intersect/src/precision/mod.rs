//! Single and double precision: the types of rays and hits in worlds of `f32` and `f64`
//! coordinates.
//!
//! Trees, boxes and kernels are the same for both, in `f32`, since boxes and filters only cull. Two
//! things differ: the transformation of a ray into the coordinates of a tree, and the exact test of
//! a triangle. Each module that depends on them has a small trait for it.

mod double;
pub(crate) mod frame;
mod real;

pub(crate) use double::DoubleData;
pub(crate) use real::Real;

use crate::geometry::quads::{quad_hit, quad_hit_double};
use crate::hit::{DHit, DNearestPoint, Hit, NearestPoint};
use snell_math::{DRay, DVec2, DVec3, Ray, Vec2, Vec3};
use std::fmt::Debug;

/// The precision of a world's coordinates and rays: [`Single`] or [`Double`].
pub trait Precision:
    sealed::Sealed + Copy + Debug + Default + PartialEq + Send + Sync + 'static
{
    /// The type of rays.
    type Ray: Copy + Debug + Sync;
    /// The type of the hits that queries return.
    type Hit: Copy + Debug + Default + PartialEq + Send + Sync;
    /// The type of points in point queries.
    type Point: Copy + Debug + PartialEq + Into<DVec3> + Send + Sync;
    /// The type of distances in point queries.
    type Distance: Copy + Debug + PartialEq + Into<f64> + Send + Sync;
    /// The type of results of nearest-point queries.
    type Nearest: Copy + Debug + Default + PartialEq + Send + Sync;
}

/// Single precision, `f32`: [`Ray`] and [`Hit`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Single;

/// Double precision, `f64`: [`DRay`] and [`DHit`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Double;

impl Precision for Single {
    type Ray = Ray;
    type Hit = Hit;
    type Point = Vec3;
    type Distance = f32;
    type Nearest = NearestPoint;
}

impl Precision for Double {
    type Ray = DRay;
    type Hit = DHit;
    type Point = DVec3;
    type Distance = f64;
    type Nearest = DNearestPoint;
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for crate::precision::Single {}
    impl Sealed for crate::precision::Double {}
}

/// The operations of a precision that searches need.
pub(crate) trait Facts: Precision {
    /// The type of distances.
    type Real: Real;

    /// The data that searches need besides the trees.
    type Data: Sync;

    /// The hit that stands for a miss.
    const MISS: Self::Hit;

    /// The start and end of a ray's interval.
    fn interval(ray: &Self::Ray) -> [Self::Real; 2];

    /// True if the ray is valid, so that it can hit anything.
    fn is_valid(ray: &Self::Ray) -> bool;

    /// The ray in `f64`.
    fn exact(ray: &Self::Ray) -> DRay;

    /// The origin of the ray, rounded.
    fn origin(ray: &Self::Ray) -> Vec3;

    /// Makes a hit from its distance (which is rounded), parameters, and instance, geometry and
    /// primitive.
    fn hit(t: f64, uv: Vec2, ids: [u32; 3]) -> Self::Hit;

    /// Makes a hit from distance, parameters and ids that are already in this precision.
    fn found(t: Self::Real, uv: [Self::Real; 2], ids: [u32; 3]) -> Self::Hit;

    /// The distance of a hit.
    fn t(hit: &Self::Hit) -> Self::Real;

    /// Instance, geometry and primitive of a hit.
    fn ids(hit: &Self::Hit) -> [u32; 3];

    /// The key that breaks ties between hits at equal distance: first the ids, then the bits of the
    /// parameters.
    fn rank(hit: &Self::Hit) -> [u64; 5];

    /// Converts a hit on one of a quad's triangles to a hit on the quad
    /// ([`crate::geometry::quads`]).
    fn quad_hit(hit: &Self::Hit) -> Self::Hit;

    /// True if `hit` is reported rather than `other`: it is nearer, or at equal distance it has the
    /// lower (instance, geometry, primitive).
    #[inline(always)]
    fn is_before(hit: &Self::Hit, other: &Self::Hit) -> bool {
        let (a, b) = (Self::t(hit), Self::t(other));
        a < b || (a == b && Self::rank(hit) < Self::rank(other))
    }
}

impl Facts for Single {
    type Real = f32;
    type Data = ();
    const MISS: Hit = Hit::MISS;

    #[inline(always)]
    fn interval(ray: &Ray) -> [f32; 2] {
        [ray.t_min, ray.t_max]
    }

    #[inline(always)]
    fn is_valid(ray: &Ray) -> bool {
        ray.is_valid()
    }

    #[inline(always)]
    fn exact(ray: &Ray) -> DRay {
        ray.into()
    }

    #[inline(always)]
    fn origin(ray: &Ray) -> Vec3 {
        ray.origin
    }

    #[inline(always)]
    fn hit(t: f64, uv: Vec2, [instance, geometry, primitive]: [u32; 3]) -> Hit {
        // Adding 0 turns -0 into +0.
        Hit { t: t as f32 + 0.0, uv, instance, geometry, primitive }
    }

    #[inline(always)]
    fn found(t: f32, [b1, b2]: [f32; 2], [instance, geometry, primitive]: [u32; 3]) -> Hit {
        Hit { t, uv: Vec2::new(b1, b2), instance, geometry, primitive }
    }

    #[inline(always)]
    fn t(hit: &Hit) -> f32 {
        hit.t
    }

    #[inline(always)]
    fn ids(hit: &Hit) -> [u32; 3] {
        [hit.instance, hit.geometry, hit.primitive]
    }

    #[inline(always)]
    fn rank(hit: &Hit) -> [u64; 5] {
        hit.rank().map(u64::from)
    }

    #[inline(always)]
    fn quad_hit(hit: &Hit) -> Hit {
        quad_hit(hit)
    }
}

impl Facts for Double {
    type Real = f64;
    type Data = DoubleData;
    const MISS: DHit = DHit::MISS;

    #[inline(always)]
    fn interval(ray: &DRay) -> [f64; 2] {
        [ray.t_min, ray.t_max]
    }

    #[inline(always)]
    fn is_valid(ray: &DRay) -> bool {
        ray.is_valid()
    }

    #[inline(always)]
    fn exact(ray: &DRay) -> DRay {
        *ray
    }

    #[inline(always)]
    fn origin(ray: &DRay) -> Vec3 {
        ray.origin.as_vec3()
    }

    #[inline(always)]
    fn hit(t: f64, uv: Vec2, [instance, geometry, primitive]: [u32; 3]) -> DHit {
        DHit { t, uv: uv.as_dvec2(), instance, geometry, primitive }
    }

    #[inline(always)]
    fn found(t: f64, [b1, b2]: [f64; 2], [instance, geometry, primitive]: [u32; 3]) -> DHit {
        DHit { t, uv: DVec2::new(b1, b2), instance, geometry, primitive }
    }

    #[inline(always)]
    fn t(hit: &DHit) -> f64 {
        hit.t
    }

    #[inline(always)]
    fn ids(hit: &DHit) -> [u32; 3] {
        [hit.instance, hit.geometry, hit.primitive]
    }

    #[inline(always)]
    fn rank(hit: &DHit) -> [u64; 5] {
        let [instance, geometry, primitive] = Self::ids(hit).map(u64::from);
        [instance, geometry, primitive, hit.uv.x.to_bits(), hit.uv.y.to_bits()]
    }

    #[inline(always)]
    fn quad_hit(hit: &DHit) -> DHit {
        quad_hit_double(hit)
    }
}
