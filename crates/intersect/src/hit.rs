//! The results of ray queries: the compact [`Hit`], and the [`SurfaceInteraction`] computed from
//! it.

use crate::mesh::UV_SETS;
use snell_math::{DVec2, DVec3, Vec2, Vec3, robust};

/// The result of a closest-hit query for one ray. 24 bytes, plain data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter of the hit, in units of the ray's direction; infinite for a miss.
    pub t: f32,
    /// Primitive parameters: barycentrics `(b1, b2)` of a triangle; for other primitives, a value
    /// that the shape or set defines.
    pub uv: Vec2,
    /// Occurrence number of the group that holds the geometry (depth first from the root, which is
    /// 0); see [`crate::World::instance_path`].
    pub instance: u32,
    /// The geometry, as numbered by [`crate::WorldBuilder`]; [`Hit::NONE`] for a miss.
    pub geometry: u32,
    /// Triangle of a mesh, face of a shape, or primitive of a set.
    pub primitive: u32,
}

impl Hit {
    /// The id that means "no geometry".
    pub const NONE: u32 = u32::MAX;

    /// A miss.
    pub const MISS: Self = Self {
        t: f32::INFINITY,
        uv: Vec2::ZERO,
        instance: Self::NONE,
        geometry: Self::NONE,
        primitive: Self::NONE,
    };

    /// True unless this is a miss.
    pub fn is_hit(&self) -> bool {
        self.geometry != Self::NONE
    }

    /// True if this hit is reported rather than `other`: this hit is nearer, or at equal `t` it has
    /// the lower (instance, geometry, primitive), and for two hits on one primitive (a quad that is
    /// folded over) the lower `uv`. Any hit is before a miss. (A ray may cross a primitive of a set
    /// twice at the same rounded `t`; then the first crossing counts, whatever its `uv`.)
    pub fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.rank() < other.rank())
    }

    /// The key that breaks ties between hits at equal distance.
    pub(crate) fn rank(&self) -> [u32; 5] {
        [self.instance, self.geometry, self.primitive, self.uv.x.to_bits(), self.uv.y.to_bits()]
    }
}

/// The result of a closest-hit query for one ray in double precision; see [`Hit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DHit {
    /// Ray parameter of the hit, in units of the ray's direction; infinite for a miss. On a
    /// triangle, `t` differs by at most one unit in the last place from the exact intersection of
    /// the ray's line with the plane of the three vertices, both taken in the coordinates of the
    /// mesh. (If rounding reports a hit on a triangle that the ray just misses, `t` is clamped to
    /// the interval in which the ray is inside the triangle's box.)
    pub t: f64,
    /// Primitive parameters; see [`Hit::uv`].
    pub uv: DVec2,
    /// Occurrence number of the group that holds the geometry; see [`Hit::instance`].
    pub instance: u32,
    /// The number of the geometry; see [`Hit::geometry`].
    pub geometry: u32,
    /// The number of the primitive in the geometry; see [`Hit::primitive`].
    pub primitive: u32,
}

impl DHit {
    /// A miss.
    pub const MISS: Self = Self {
        t: f64::INFINITY,
        uv: DVec2::ZERO,
        instance: Hit::NONE,
        geometry: Hit::NONE,
        primitive: Hit::NONE,
    };

    /// True unless this is a miss.
    pub fn is_hit(&self) -> bool {
        self.geometry != Hit::NONE
    }
}

impl Default for DHit {
    fn default() -> Self {
        Self::MISS
    }
}

impl Default for Hit {
    fn default() -> Self {
        Self::MISS
    }
}

/// The local geometry at a point on a surface, in world space, as in pbrt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceInteraction {
    /// The point on the surface.
    pub position: Vec3,
    /// Bound on the absolute error of each coordinate of `position`, including all transformations.
    pub position_error: Vec3,
    /// Geometric normal, of unit length, on the outer side of the shape (for a triangle: right-hand
    /// rule on its vertices).
    pub geometric_normal: Vec3,
    /// Unit shading normal (interpolated vertex normals where a mesh has them), on the same side as
    /// the geometric normal.
    pub shading_normal: Vec3,
    /// Texture coordinates of all sets; zero where the geometry has none.
    pub uv: [Vec2; UV_SETS],
    /// Derivative of the position by the first coordinate of `uv[0]`: a tangent, neither normalised
    /// nor exactly perpendicular to the shading normal. Never zero: without texture coordinates,
    /// `dpdu` and `dpdv` are tangents of an arbitrary frame.
    pub dpdu: Vec3,
    /// Derivative of the position by the second coordinate of `uv[0]`; see `dpdu`.
    pub dpdv: Vec3,
    /// Unit tangent of a mesh that stores tangents, and the sign of the bitangent (glTF's `w`):
    /// `bitangent = sign * n x tangent`.
    pub tangent: Option<(Vec3, f32)>,
    /// Interpolated vertex colour (linear RGB and alpha); white where there is none.
    pub color: [f32; 4],
    /// True on a curve ([`crate::Curves`]): the point is on the outside of a fibre, and `dpdu` runs
    /// along the fibre.
    pub on_curve: bool,
    /// Ray parameter of the hit, in units of the ray's direction.
    pub t: f32,
    /// Primitive parameters, barycentrics for triangles; see [`Hit::uv`].
    pub primitive_uv: Vec2,
    /// Occurrence number of the group that holds the geometry; see [`Hit::instance`].
    pub instance: u32,
    /// The number of the geometry; see [`Hit::geometry`].
    pub geometry: u32,
    /// The number of the primitive in the geometry; see [`Hit::primitive`].
    pub primitive: u32,
}

/// The part of a [`SurfaceInteraction`] that is needed to spawn a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point on the surface, in world space.
    pub position: Vec3,
    /// Bound on the absolute error of each coordinate of `position`.
    pub position_error: Vec3,
    /// Unit geometric normal, on the outer side of the shape.
    pub geometric_normal: Vec3,
    /// True on a curve; see [`SurfaceInteraction::on_curve`].
    pub on_curve: bool,
}

/// A [`SurfacePoint`] in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DSurfacePoint {
    /// The point on the surface, in world space.
    pub position: DVec3,
    /// Bound on the absolute error of each coordinate of `position`, including all transformations.
    pub position_error: DVec3,
    /// Unit geometric normal, on the outer side of the shape.
    pub geometric_normal: DVec3,
}

impl From<&SurfacePoint> for DSurfacePoint {
    fn from(point: &SurfacePoint) -> Self {
        Self {
            position: point.position.as_dvec3(),
            position_error: point.position_error.as_dvec3(),
            geometric_normal: point.geometric_normal.as_dvec3(),
        }
    }
}

impl From<&SurfaceInteraction> for SurfacePoint {
    #[inline(always)]
    fn from(surface: &SurfaceInteraction) -> Self {
        let SurfaceInteraction { position, position_error, geometric_normal, on_curve, .. } =
            *surface;
        Self { position, position_error, geometric_normal, on_curve }
    }
}

impl SurfacePoint {
    /// Returns the same origin as [`SurfaceInteraction::ray_origin`].
    pub fn ray_origin(&self, direction: Vec3) -> Vec3 {
        robust::offset_ray_origin(
            self.position,
            self.position_error,
            self.geometric_normal,
            direction,
        )
    }

    /// True if a ray of this direction arrives from the outer side; see
    /// [`SurfaceInteraction::is_front_facing`].
    pub fn is_front_facing(&self, ray_direction: Vec3) -> bool {
        ray_direction.dot(self.geometric_normal) < 0.0
    }
}

impl SurfaceInteraction {
    /// A point that belongs to no geometry: without error bounds, white, without texture
    /// coordinates, and in an arbitrary frame around `normal`.
    #[inline]
    pub fn plain(position: Vec3, normal: Vec3) -> Self {
        Self {
            position,
            position_error: Vec3::ZERO,
            geometric_normal: normal,
            shading_normal: normal,
            uv: [Vec2::ZERO; UV_SETS],
            dpdu: Vec3::X,
            dpdv: Vec3::Y,
            tangent: None,
            color: [1.0; 4],
            on_curve: false,
            t: 0.0,
            primitive_uv: Vec2::ZERO,
            instance: Hit::NONE,
            geometry: Hit::NONE,
            primitive: Hit::NONE,
        }
    }

    /// The origin of a ray that leaves the surface along `direction`, offset so that rounding
    /// cannot put it on the wrong side of the surface.
    pub fn ray_origin(&self, direction: Vec3) -> Vec3 {
        robust::offset_ray_origin(
            self.position,
            self.position_error,
            self.geometric_normal,
            direction,
        )
    }

    /// True if a ray of this direction arrives from the outer side.
    pub fn is_front_facing(&self, ray_direction: Vec3) -> bool {
        ray_direction.dot(self.geometric_normal) < 0.0
    }
}

/// The result of a nearest-point query for one point. 36 bytes, plain data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// Distance in world units, not negative; infinite if no surface is within the maximum
    /// distance.
    pub distance: f32,
    /// The nearest point of the surface, in world space; zero if none is found.
    pub position: Vec3,
    /// Barycentrics `(b1, b2)` on a triangle, zero on a shape.
    pub uv: Vec2,
    /// Occurrence number of the group that holds the geometry; see [`Hit::instance`].
    pub instance: u32,
    /// The number of the geometry; [`Hit::NONE`] if no surface is within the maximum distance.
    pub geometry: u32,
    /// The number of the primitive in the geometry; see [`Hit::primitive`].
    pub primitive: u32,
}

impl NearestPoint {
    /// The result when no surface is within the maximum distance.
    pub const NONE: Self = Self {
        distance: f32::INFINITY,
        position: Vec3::ZERO,
        uv: Vec2::ZERO,
        instance: Hit::NONE,
        geometry: Hit::NONE,
        primitive: Hit::NONE,
    };

    /// True if a nearest point was found.
    pub fn is_found(&self) -> bool {
        self.geometry != Hit::NONE
    }
}

/// The result of a nearest-point query for one point in double precision; see [`NearestPoint`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DNearestPoint {
    /// Distance in world units, not negative; infinite if no surface is within the maximum
    /// distance.
    pub distance: f64,
    /// The nearest point of the surface, in world space; zero if none is found.
    pub position: DVec3,
    /// Barycentrics `(b1, b2)` on a triangle, zero on a shape.
    pub uv: DVec2,
    /// Occurrence number of the group that holds the geometry; see [`Hit::instance`].
    pub instance: u32,
    /// The number of the geometry; [`Hit::NONE`] if no surface is within the maximum distance.
    pub geometry: u32,
    /// The number of the primitive in the geometry; see [`Hit::primitive`].
    pub primitive: u32,
}

impl DNearestPoint {
    /// The result when no surface is within the maximum distance.
    pub const NONE: Self = Self {
        distance: f64::INFINITY,
        position: DVec3::ZERO,
        uv: DVec2::ZERO,
        instance: Hit::NONE,
        geometry: Hit::NONE,
        primitive: Hit::NONE,
    };

    /// True if a nearest point was found.
    pub fn is_found(&self) -> bool {
        self.geometry != Hit::NONE
    }
}

impl Default for DNearestPoint {
    fn default() -> Self {
        Self::NONE
    }
}

impl Default for NearestPoint {
    fn default() -> Self {
        Self::NONE
    }
}
