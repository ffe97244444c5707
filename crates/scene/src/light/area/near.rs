//! Rectangles and triangles as near points see them: sampled by solid angle, in double precision and without branches, so that many can
//! be sampled at once.

use super::FlatPart;
use super::outline::{LEAST, MOST};
use snell_math::simd::most;
use snell_math::spherical::{self, SphericalRectangle};
use snell_math::{DVec2, DVec3, Vec2, Vec3};

/// A rectangle in the world.
#[derive(Clone, Copy, Debug)]
pub struct NearRectangle {
    /// Its middle.
    pub center: DVec3,
    /// Unit vectors along its sides.
    pub axes: [DVec3; 2],
    /// Half of the lengths of the sides.
    pub half: DVec2,
}

/// A triangle in the world.
#[derive(Clone, Copy, Debug)]
pub struct NearTriangle {
    /// A corner.
    pub corner: Vec3,
    /// From there to the others.
    pub edges: [Vec3; 2],
}

/// Either.
#[derive(Clone, Copy, Debug)]
pub enum NearPart {
    /// A rectangle.
    Rectangle(NearRectangle),
    /// A triangle.
    Triangle(NearTriangle),
}

/// A point of one of them as a near point sees it. Only what [`Self::exists`] has a meaning.
#[derive(Clone, Copy, Debug)]
pub struct NearSample {
    /// The point.
    pub position: Vec3,
    /// Unit direction towards it.
    pub direction: Vec3,
    /// Density per steradian of the direction.
    pub pdf: f32,
    /// The solid angle is one that can be sampled: what is not is sampled by area.
    pub is_seen: bool,
    /// There is a direction.
    pub exists: bool,
}

impl NearPart {
    /// A point uniform by solid angle.
    #[inline]
    pub fn sample(&self, from: Vec3, u: Vec2) -> NearSample {
        match self {
            Self::Rectangle(rectangle) => rectangle.sample(from, u),
            Self::Triangle(triangle) => triangle.sample(from, u),
        }
    }
}

impl NearRectangle {
    /// The rectangle around a point, and its coordinate along the normal.
    #[inline(always)]
    pub(super) fn seen_from(&self, from: DVec3) -> (SphericalRectangle, f64) {
        let center = self.center - from;
        let middle = DVec2::new(center.dot(self.axes[0]), center.dot(self.axes[1]));
        let z = center.dot(self.normal());
        (SphericalRectangle::new(middle - self.half, middle + self.half, z), z)
    }

    /// Unit normal: either.
    #[inline(always)]
    pub(super) fn normal(&self) -> DVec3 {
        self.axes[0].cross(self.axes[1])
    }

    /// A point uniform by solid angle.
    #[inline(always)]
    pub fn sample(&self, from: Vec3, u: Vec2) -> NearSample {
        let from = from.as_dvec3();
        let (seen, z) = self.seen_from(from);
        let p = seen.sample(u.as_dvec2());
        let offset = self.axes[0] * p.x + self.axes[1] * p.y + self.normal() * z;
        let scale = 1.0 / offset.length_squared().sqrt();
        let exists = is_sampled(seen.solid_angle) & (scale > 0.0) & (scale < f64::INFINITY);
        NearSample {
            position: (from + offset).as_vec3(),
            direction: (offset * scale).as_vec3(),
            pdf: (1.0 / seen.solid_angle) as f32,
            is_seen: exists,
            exists,
        }
    }
}

/// True for solid angles that can be sampled.
#[inline(always)]
pub(super) fn is_sampled(solid_angle: f64) -> bool {
    (solid_angle > LEAST) & (solid_angle < MOST)
}

impl NearTriangle {
    /// A part that is a triangle.
    pub(super) fn of(flat: &FlatPart) -> Self {
        Self { corner: flat.corner, edges: flat.edges }
    }

    /// A point uniform by solid angle.
    #[inline(always)]
    pub fn sample(&self, from: Vec3, u: Vec2) -> NearSample {
        let (from, corner) = (from.as_dvec3(), self.corner.as_dvec3());
        let edges = [self.edges[0].as_dvec3(), self.edges[1].as_dvec3()];
        let seen = TriangleSeen::new(corner - from, edges);
        let (offset, exists) = seen.sample(u.as_dvec2());
        let b = barycentrics(from + offset - corner, edges);
        NearSample {
            position: self.corner + self.edges[0] * b.x + self.edges[1] * b.y,
            direction: (offset * (1.0 / offset.length())).as_vec3(),
            pdf: (1.0 / seen.solid_angle) as f32,
            is_seen: is_sampled(seen.solid_angle),
            exists,
        }
    }
}

/// A triangle around the viewpoint.
#[derive(Clone, Copy, Debug)]
pub(super) struct TriangleSeen {
    corner: DVec3,
    edges: [DVec3; 2],
    directions: [DVec3; 3],
    pub solid_angle: f64,
}

impl TriangleSeen {
    #[inline(always)]
    pub(super) fn new(corner: DVec3, edges: [DVec3; 2]) -> Self {
        let unit = |v: DVec3| {
            let scale = 1.0 / v.length();
            let exists = (scale > 0.0) & (scale < f64::INFINITY);
            let one = |x: f64| if exists { x * scale } else { 0.0 };
            DVec3::new(one(v.x), one(v.y), one(v.z))
        };
        let directions = [unit(corner), unit(corner + edges[0]), unit(corner + edges[1])];
        let solid_angle = spherical::triangle_solid_angle(directions[0], directions[1], directions[2]);
        Self { corner, edges, directions, solid_angle }
    }

    /// The way from the viewpoint to a point uniform by solid angle; false if rounding leaves no direction.
    #[inline(always)]
    pub(super) fn sample(&self, u: DVec2) -> (DVec3, bool) {
        let Self { corner, edges, directions, solid_angle } = *self;
        let (w, exists) = spherical::sample_triangle(directions, solid_angle, u);
        let normal = edges[0].cross(edges[1]);
        let b = barycentrics(w * (corner.dot(normal) / w.dot(normal)) - corner, edges).as_dvec2();
        let offset = corner + edges[0] * b.x + edges[1] * b.y;
        let squared = offset.length_squared();
        (offset, exists & (squared > 0.0) & (squared < f64::INFINITY))
    }
}

/// Barycentric coordinates of the point of a triangle's plane at this offset from its first corner, moved into the triangle.
#[inline(always)]
pub(super) fn barycentrics(offset: DVec3, [e1, e2]: [DVec3; 2]) -> Vec2 {
    let normal = e1.cross(e2);
    let n2 = normal.length_squared();
    let (x, y) = (offset.cross(e2).dot(normal) / n2, e1.cross(offset).dot(normal) / n2);
    let is_finite = (x.abs() < f64::INFINITY) & (y.abs() < f64::INFINITY);
    let one = |x: f64| if is_finite { most(x, 0.0) } else { 1.0 / 3.0 };
    let (x, y) = (one(x), one(y));
    let sum = most(x + y, 1.0);
    Vec2::new((x / sum) as f32, (y / sum) as f32)
}
