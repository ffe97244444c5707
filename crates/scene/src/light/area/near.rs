//! Rectangles, triangles and spheres that are sampled by solid angle from near points. All is in
//! double precision and without branches, so that many can be sampled at once.

use super::FlatPart;
use super::outline::{LEAST, MOST};
use snell_math::robust::gamma;
use snell_math::simd::max;
use snell_math::spherical::{self, SphericalRectangle};
use snell_math::{DVec2, DVec3, Vec2, Vec3};
use std::f64::consts::PI;

/// A rectangle in the world.
#[derive(Clone, Copy, Debug)]
pub struct NearRectangle {
    /// Centre of the rectangle.
    pub center: DVec3,
    /// Unit vectors along the sides.
    pub axes: [DVec3; 2],
    /// Half of the lengths of the sides.
    pub half: DVec2,
}

/// A triangle in the world.
#[derive(Clone, Copy, Debug)]
pub struct NearTriangle {
    /// A corner of the triangle.
    pub corner: Vec3,
    /// Edges from `corner` to the other corners.
    pub edges: [Vec3; 2],
}

/// A sphere in the world.
#[derive(Clone, Copy, Debug)]
pub struct NearSphere {
    /// Centre of the sphere.
    pub center: DVec3,
    /// Radius of the sphere.
    pub radius: f64,
}

/// A part of an emissive surface that can be sampled by solid angle.
#[derive(Clone, Copy, Debug)]
pub enum NearPart {
    /// A rectangle.
    Rectangle(NearRectangle),
    /// A triangle.
    Triangle(NearTriangle),
    /// A sphere, which is sampled by solid angle from any distance.
    Sphere(NearSphere),
}

/// A sampled point of a part, as seen from a near point. The other fields are meaningful only if
/// [`Self::exists`].
#[derive(Clone, Copy, Debug)]
pub struct NearSample {
    /// The sampled point.
    pub position: Vec3,
    /// Unit direction towards the point.
    pub direction: Vec3,
    /// Density per steradian of the direction.
    pub pdf: f32,
    /// True if the solid angle can be sampled. Otherwise the part is sampled by area.
    pub is_seen: bool,
    /// True if the sample has a direction.
    pub exists: bool,
}

/// A sampled point of a sphere, as seen from another point.
#[derive(Clone, Copy, Debug)]
pub struct RoundSample {
    /// The point as seen from the other point; it exists from everywhere.
    pub seen: NearSample,
    /// Unit normal at the point.
    pub normal: Vec3,
    /// Bound of the absolute error of each coordinate of the point.
    pub error: Vec3,
}

/// Bound of the error of a point on a sphere, relative to the radius. An ellipsoid within this
/// tolerance counts as a sphere.
const ROUNDNESS: f64 = 4e-9;
/// Bound of the error of a point on a sphere, relative to coordinates: the rounding of double
/// precision.
const ROUNDING: f64 = 1e-14;
/// Bound of the error of a viewpoint on a surface, relative to its distance from the origin: some
/// roundings of single precision.
const ROUNDED: f64 = 4e-7;

impl NearSphere {
    /// True if the visible part of a sphere can be sampled from this point, which is rounded to
    /// single precision: not from inside, not from the surface, and not from so near that the cone
    /// around the sphere is nearly a hemisphere.
    #[inline(always)]
    pub(super) fn has_near_side(&self, from: DVec3) -> bool {
        let (d2, r2) = ((self.center - from).length_squared(), self.radius * self.radius);
        // A bound of d² - r² for points of the surface.
        let margin_squared = 4.0 * r2 * from.length_squared() * ROUNDED * ROUNDED;
        let above = d2 * (1.0 - 1e-7) - r2;
        (above > 0.0) & (above * above > margin_squared) & (r2 > d2 * 1e-30)
    }

    /// Samples a point uniformly by solid angle on the visible side, or uniformly by area where
    /// that cannot be sampled.
    #[inline(always)]
    pub fn sample(&self, from: Vec3, u: Vec2) -> RoundSample {
        let (center, u) = (self.center - from.as_dvec3(), u.as_dvec2());
        let (d2, r2) = (center.length_squared(), self.radius * self.radius);
        let has_near_side = self.has_near_side(from.as_dvec3());
        let towards = center * (-1.0 / d2.sqrt());
        // Seen from the centre, any axis will do.
        let one = |x: f64, other: f64| if d2 > 0.0 { x } else { other };
        let axis = DVec3::new(one(towards.x, 0.0), one(towards.y, 0.0), one(towards.z, 1.0));
        let near = spherical::near_side_of_sphere(center, self.radius, u.x);
        let normal =
            spherical::around(axis, if has_near_side { near } else { 1.0 - 2.0 * u.x }, u.y);
        let offset = center + normal * self.radius;
        let squared = offset.length_squared();
        let direction = offset * (1.0 / squared.sqrt());
        let by_area = squared / (direction.dot(normal).abs() * 4.0 * PI * r2);
        let by_angle = 1.0 / spherical::sphere_solid_angle(r2, d2);
        let pdf = (if has_near_side { by_angle } else { by_area }) as f32;
        let position = self.center + normal * self.radius;
        let error = position.abs() * f64::from(gamma(1))
            + self.center.abs() * ROUNDING
            + self.radius * ROUNDNESS;
        let exists =
            (squared > 0.0) & (squared < f64::INFINITY) & (pdf > 0.0) & (pdf < f32::INFINITY);
        RoundSample {
            seen: NearSample {
                position: position.as_vec3(),
                direction: direction.as_vec3(),
                pdf,
                is_seen: true,
                exists,
            },
            normal: normal.as_vec3(),
            error: error.as_vec3(),
        }
    }
}

impl NearRectangle {
    /// The rectangle relative to a viewpoint, and its coordinate along its normal.
    #[inline(always)]
    pub(super) fn seen_from(&self, from: DVec3) -> (SphericalRectangle, f64) {
        let center = self.center - from;
        let middle = DVec2::new(center.dot(self.axes[0]), center.dot(self.axes[1]));
        let z = center.dot(self.normal());
        (SphericalRectangle::new(middle - self.half, middle + self.half, z), z)
    }

    /// Unit normal of one side.
    #[inline(always)]
    pub(super) fn normal(&self) -> DVec3 {
        self.axes[0].cross(self.axes[1])
    }

    /// Samples a point uniformly by solid angle.
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

/// True if a part with this solid angle can be sampled by it.
#[inline(always)]
pub(super) fn is_sampled(solid_angle: f64) -> bool {
    (solid_angle > LEAST) & (solid_angle < MOST)
}

impl NearTriangle {
    /// The triangle that a flat part is.
    pub(super) fn of(flat: &FlatPart) -> Self {
        Self { corner: flat.corner, edges: flat.edges }
    }

    /// Samples a point uniformly by solid angle.
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

/// A triangle as seen from a viewpoint.
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
        let solid_angle =
            spherical::triangle_solid_angle(directions[0], directions[1], directions[2]);
        Self { corner, edges, directions, solid_angle }
    }

    /// The vector from the viewpoint to a point that is uniform by solid angle. The flag is false
    /// if rounding leaves no direction.
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

/// Barycentric coordinates of a point in the plane of a triangle, given its offset from the first
/// corner. They are clamped to the triangle.
#[inline(always)]
pub(super) fn barycentrics(offset: DVec3, [e1, e2]: [DVec3; 2]) -> Vec2 {
    let normal = e1.cross(e2);
    let n2 = normal.length_squared();
    let (x, y) = (offset.cross(e2).dot(normal) / n2, e1.cross(offset).dot(normal) / n2);
    let is_finite = (x.abs() < f64::INFINITY) & (y.abs() < f64::INFINITY);
    let one = |x: f64| if is_finite { max(x, 0.0) } else { 1.0 / 3.0 };
    let (x, y) = (one(x), one(y));
    let sum = max(x + y, 1.0);
    Vec2::new((x / sum) as f32, (y / sum) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::{rng, sampling};

    #[test]
    fn points_of_a_sphere_do_not_see_it_from_outside() {
        // A point on the inner side would be lit by the outer side where it is.
        for (center, radius) in [([2.0, 0.0, 2.0], 1.0), ([0.0; 3], 3e-7), ([5e4, 1.0, -9.0], 0.3)]
        {
            let sphere = NearSphere { center: DVec3::from_array(center), radius };
            for i in 0..2000 {
                let normal = sampling::uniform_sphere(rng::uniform2([i, 0, 0, 0])).as_dvec3();
                let point = (sphere.center + normal * radius).as_vec3();
                assert!(!sphere.has_near_side(point.as_dvec3()), "{center:?} {point}");
            }
        }
        let near = NearSphere { center: DVec3::new(2.0, 0.0, 2.0), radius: 1.0 };
        assert!(near.has_near_side(DVec3::new(2.0, 0.0, 0.999_99)));
    }
}
