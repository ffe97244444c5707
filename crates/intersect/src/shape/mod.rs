//! Analytic shapes: one file per shape, with its parameters, all its operations, examples and
//! tests.
//!
//! A shape is defined in its own coordinates. Single-precision rays are intersected with it in
//! double precision, so that a ray that starts one rounding step off the surface is found to start
//! off it. Placing a shape in a scene is the task of [`crate::World`].
//!
//! To add a shape, write a new file here and add its two lines to the list below. Tests, area
//! lights and documentation iterate over that list.

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
use snell_math::{Bounds3d, DRay, DVec2, DVec3, real};

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
    /// Texture coordinates in `[0, 1]^2` with `v` downwards, as documented by each shape (unbounded
    /// on an infinite plane).
    pub uv: DVec2,
    /// Derivative of the position by `uv.x`. Never zero: at poles and apexes it is an arbitrary
    /// tangent.
    pub dpdu: DVec3,
    /// Derivative of the position by `uv.y`; `dpdu x dpdv` need not point outward.
    pub dpdv: DVec3,
}

/// A point of the surface, sampled uniformly by area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeSample {
    /// The point.
    pub position: DVec3,
    /// Unit normal on the outer side.
    pub normal: DVec3,
    /// Texture coordinates, see [`ShapeSurface::uv`].
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

/// The error for a parameter of a shape that is out of range. Operations on such a shape never
/// panic, but their results are meaningless.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{shape}: {parameter} is {found}, expected {expected}")]
pub struct ShapeError {
    /// Name of the shape.
    pub shape: &'static str,
    /// Name of the parameter.
    pub parameter: &'static str,
    /// The value found.
    pub found: f64,
    /// A description of the values that the parameter may have.
    pub expected: &'static str,
}

impl ShapeError {
    /// Returns an error unless the parameter is finite and `accepts` returns true for it.
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

/// The angle from the x axis of the plane towards its y axis, as a fraction of a full turn in
/// `[0, 1)`.
fn turn(d: DVec2) -> f64 {
    let turns = real::atan2(d.y, d.x) / std::f64::consts::TAU;
    // A tiny negative angle would round to a full turn.
    if turns < 0.0 { (turns + 1.0).min(1.0_f64.next_down()) } else { turns }
}

/// The operations of an analytic shape, in its own coordinates.
pub trait Shape: Send + Sync + std::fmt::Debug {
    /// Returns an error if a parameter is out of range. File readers call this.
    fn validate(&self) -> Result<(), ShapeError> {
        Ok(())
    }

    /// The smallest box around the shape. Its sides may be infinite.
    fn bounds(&self) -> Bounds3d;

    /// The nearest intersection in the open interval of the ray, from either side of the surface.
    /// The direction may have any length. A ray with a NaN misses.
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

    /// Position and normal as returned by [`Self::surface`], which may be much cheaper to compute
    /// alone.
    fn normal(&self, position: DVec3, face: u32) -> (DVec3, DVec3) {
        let ShapeSurface { position, normal, .. } = self.surface(position, face);
        (position, normal)
    }

    /// The point of the surface nearest to `point`, with lengths measured by `metric`; among
    /// equally near points, the one on the face with the lowest number. `None` if there is no
    /// result, as for points that are not finite.
    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint>;

    /// The winding number of the surface around `point`, after the map of `metric`: the signed
    /// solid angle over `4 pi`, positive where the surface is seen from behind. For a closed shape
    /// it is 1 inside, 0 outside, and either of these on the surface. For an open shape it is a
    /// fraction, and 0 in the plane of a flat one.
    fn winding_number(&self, point: DVec3, metric: &Metric) -> f64;

    /// True if a point is inside a closed shape or on its surface; false for open shapes.
    fn contains(&self, point: DVec3) -> bool {
        self.is_closed() && self.winding_number(point, &Metric::EUCLIDEAN) > 0.5
    }

    /// Area of the surface; infinite for unbounded shapes, which cannot be sampled.
    fn area(&self) -> f64;

    /// Maps `u` in `[0, 1)^2` to a point of the surface, uniformly by area (density `1 / area`).
    /// `None` for unbounded shapes.
    fn sample(&self, u: DVec2) -> Option<ShapeSample>;

    /// True for closed shapes, whose normals point outside; false for open surfaces (disk,
    /// rectangle, plane, triangle, polygon).
    fn is_closed(&self) -> bool;

    /// The parts of the surface from which [`Self::tessellate`] makes triangles; none for unbounded
    /// shapes.
    fn patches(&self) -> Vec<Patch>;

    /// A triangle mesh of the shape with normals and texture coordinates, oriented outwards, with
    /// `around` segments (at least 3) around each circle. The corners lie on the surface to single
    /// precision; a closed shape gives a closed mesh. `None` for unbounded shapes.
    fn tessellate(&self, around: u32) -> Option<TriangleMesh> {
        patch::tessellate(self, around)
    }

    /// The shape as an [`AnyShape`], for code that treats some shapes specially, as light sampling
    /// treats spheres. `None` for user-defined shapes.
    fn to_any(&self) -> Option<AnyShape> {
        None
    }

    /// The shape if it is a sphere, otherwise `None`; spheres are intersected in batches.
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

    fn contains(&self, point: DVec3) -> bool {
        match_shape!(self, shape => shape.contains(point))
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
