//! Analytic shapes: one file per shape, with its parameters, all its operations, examples and
//! tests.
//!
//! A shape is defined in its own coordinates and is intersected in double precision with
//! single-precision rays, so that a ray that starts one rounding step off the surface is known to
//! start off it. Placing it in a scene is the world's job ([`crate::World`]).
//!
//! To add a shape: a new file here, and its two lines in the list below. Tests, area lights and
//! documentation iterate the list.

pub mod box_shape;
pub mod cone;
pub mod cylinder;
pub mod disk;
pub mod frustum;
pub mod nearest;
pub mod patch;
pub mod plane;
pub mod polygon;
pub mod rectangle;
mod span;
pub mod sphere;
#[cfg(test)]
mod tests;
pub mod triangle;
pub(crate) mod winding;

pub use box_shape::BoxShape;
pub use cone::Cone;
pub use cylinder::Cylinder;
pub use disk::Disk;
pub use frustum::Frustum;
pub use nearest::{Metric, ShapePoint};
pub use patch::Patch;
pub use plane::Plane;
pub use polygon::{Polygon, PolygonError};
pub use rectangle::Rectangle;
pub use sphere::Sphere;
pub use triangle::Triangle;

use crate::mesh::TriangleMesh;
use snell_math::{Bounds3d, DRay, DVec2, DVec3};

/// A point where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter.
    pub t: f64,
    /// The face that was hit, in the shape's own numbering; 0 if the shape has a single face.
    pub face: u32,
}

/// The surface of a shape at a point, in the shape's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeSurface {
    /// The point, moved onto the surface to double precision.
    pub position: DVec3,
    /// Unit normal on the outer side.
    pub normal: DVec3,
    /// Texture coordinates in `[0, 1]^2`, `v` downwards (documented by each shape; on an infinite
    /// plane they are unbounded).
    pub uv: DVec2,
    /// Derivative of the position by `uv.x`. Never zero: at poles and apexes it is an arbitrary
    /// tangent.
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

impl ShapeSample {
    /// The sample at `position` on a face of `shape`.
    fn at(shape: &impl Shape, position: DVec3, face: u32) -> Self {
        let ShapeSurface { position, normal, uv, .. } = shape.surface(position, face);
        Self { position, normal, uv, face }
    }
}

/// A parameter of a shape is out of range. Operations on such a shape never panic, but their
/// results are meaningless.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{shape}: {parameter} is {found}, expected {expected}")]
pub struct ShapeError {
    /// Name of the shape.
    pub shape: &'static str,
    /// Name of the parameter.
    pub parameter: &'static str,
    /// Its value.
    pub found: f64,
    /// The values that it may have.
    pub expected: &'static str,
}

impl ShapeError {
    /// Returns an error unless the parameter is finite and `accepts` it.
    fn unless(
        shape: &'static str,
        parameter: &'static str,
        found: f64,
        expected: &'static str,
        accepts: impl FnOnce(f64) -> bool,
    ) -> Result<(), Self> {
        if found.is_finite() && accepts(found) {
            Ok(())
        } else {
            Err(Self { shape, parameter, found, expected })
        }
    }

    fn unless_positive(
        shape: &'static str,
        parameter: &'static str,
        found: f64,
    ) -> Result<(), Self> {
        Self::unless(shape, parameter, found, "a positive number", |x| x > 0.0)
    }
}

/// The angle of a direction from its x towards its y axis as a fraction of a full turn, in `[0,
/// 1)`.
fn turn(d: DVec2) -> f64 {
    let turns = d.y.atan2(d.x) / std::f64::consts::TAU;
    // A tiny negative angle would round to a full turn.
    if turns < 0.0 { (turns + 1.0).min(1.0_f64.next_down()) } else { turns }
}

/// The operations of an analytic shape, in its own coordinates.
pub trait Shape: Send + Sync + std::fmt::Debug {
    /// Returns an error if a parameter is out of range. File readers call this.
    fn validate(&self) -> Result<(), ShapeError> {
        Ok(())
    }

    /// The smallest box around the shape. May have infinite sides.
    fn bounds(&self) -> Bounds3d;

    /// The nearest intersection in the open interval of the ray, from either side. Directions may
    /// have any length. Rays with NaN miss.
    fn closest(&self, ray: &DRay) -> Option<ShapeHit>;

    /// The nearest intersection and the next one, equal to two calls of [`Self::closest`]. Most
    /// shapes compute both at once.
    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        let first = self.closest(ray);
        [first, first.and_then(|hit| self.closest(&DRay { t_min: hit.t, ..*ray }))]
    }

    /// True if any point of the shape lies in the open interval of the ray.
    fn any(&self, ray: &DRay) -> bool {
        self.closest(ray).is_some()
    }

    /// Every crossing of the surface in the open interval of the ray, ascending by `t`. A tangent
    /// point may count twice or not at all.
    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>);

    /// The surface at `position`, a point on (or within rounding of) `face`.
    fn surface(&self, position: DVec3, face: u32) -> ShapeSurface;

    /// Position and normal of [`Self::surface`], which may be much cheaper to compute.
    fn normal(&self, position: DVec3, face: u32) -> (DVec3, DVec3) {
        let ShapeSurface { position, normal, .. } = self.surface(position, face);
        (position, normal)
    }

    /// The point of the surface nearest to `point`, where lengths are measured by `metric`; among
    /// equally near points, that of the lowest face. `None` if there is no answer, as for points
    /// that are not finite.
    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint>;

    /// The winding number of the surface around `point`, after the map of `metric`: the signed
    /// solid angle over `4 pi`, positive where the surface is seen from behind. It is 1 inside and
    /// 0 outside of a closed shape (either on its surface), a fraction around an open shape, and 0
    /// in the plane of a flat one.
    fn winding_number(&self, point: DVec3, metric: &Metric) -> f64;

    /// Area; infinite for unbounded shapes, which cannot be sampled.
    fn area(&self) -> f64;

    /// A point distributed uniformly by area (density `1 / area`), from `u` in `[0, 1)^2`. `None`
    /// for unbounded shapes.
    fn sample(&self, u: DVec2) -> Option<ShapeSample>;

    /// True for closed shapes, whose normals point outside; false for open surfaces (disk,
    /// rectangle, plane, triangle, polygon).
    fn is_closed(&self) -> bool;

    /// The parts of the surface from which [`Self::tessellate`] makes triangles; none for unbounded
    /// shapes.
    fn patches(&self) -> Vec<Patch>;

    /// Triangles with the normals and texture coordinates of the shape, oriented outwards, with
    /// `around` segments around each circle, at least 3. The corners lie on the surface to single
    /// precision; a closed shape gives a closed mesh. `None` for unbounded shapes.
    fn tessellate(&self, around: u32) -> Option<TriangleMesh> {
        patch::tessellate(self, around)
    }

    /// The shape as an [`AnyShape`], for code that treats some shapes specially, as light sampling
    /// does spheres. `None` for user-defined shapes.
    fn to_any(&self) -> Option<AnyShape> {
        None
    }

    /// The shape, if it is a sphere: spheres are intersected in batches.
    fn as_sphere(&self) -> Option<&Sphere> {
        None
    }
}

snell_math::kinds! {
    /// Any of the built-in shapes, as scenes store them.
    pub enum AnyShape tagged "shape" by match_shape! {
        "sphere" => Sphere,
        "box" => BoxShape,
        "cylinder" => Cylinder,
        "cone" => Cone,
        "frustum" => Frustum,
        "disk" => Disk,
        "rectangle" => Rectangle,
        "plane" => Plane,
        "triangle" => Triangle,
        "polygon" => Polygon,
    }
}

impl Shape for AnyShape {
    fn validate(&self) -> Result<(), ShapeError> {
        match_shape!(self, shape => shape.validate())
    }

    fn bounds(&self) -> Bounds3d {
        match_shape!(self, shape => shape.bounds())
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        match_shape!(self, shape => shape.closest(ray))
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        match_shape!(self, shape => shape.nearest_two(ray))
    }

    fn any(&self, ray: &DRay) -> bool {
        match_shape!(self, shape => shape.any(ray))
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        match_shape!(self, shape => shape.all(ray, hits))
    }

    fn surface(&self, position: DVec3, face: u32) -> ShapeSurface {
        match_shape!(self, shape => shape.surface(position, face))
    }

    fn normal(&self, position: DVec3, face: u32) -> (DVec3, DVec3) {
        match_shape!(self, shape => shape.normal(position, face))
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        match_shape!(self, shape => shape.nearest_point(point, metric))
    }

    fn winding_number(&self, point: DVec3, metric: &Metric) -> f64 {
        match_shape!(self, shape => shape.winding_number(point, metric))
    }

    fn area(&self) -> f64 {
        match_shape!(self, shape => shape.area())
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        match_shape!(self, shape => shape.sample(u))
    }

    fn is_closed(&self) -> bool {
        match_shape!(self, shape => shape.is_closed())
    }

    fn patches(&self) -> Vec<Patch> {
        match_shape!(self, shape => shape.patches())
    }

    fn to_any(&self) -> Option<AnyShape> {
        Some(self.clone())
    }

    fn as_sphere(&self) -> Option<&Sphere> {
        match_shape!(self, shape => shape.as_sphere())
    }
}
