//! Flat parts of emissive surfaces as seen from far away. Their points are sampled by area, in
//! single precision and without branches, so that many parts can be sampled at once.

use super::NearSample;
use snell_intersect::{AnyShape, Shape};
use snell_math::robust::{gamma, offset_ray_origin};
use snell_math::simd::max;
use snell_math::{DVec2, DVec3, Transform, Vec2, Vec3, sampling};

/// Parts whose extent is below this fraction of their distance are sampled by area: the density by
/// solid angle is nearly constant over them, and computing angles is expensive.
const FAR: f64 = 0.4;

/// A triangle or rectangle in the world, which is a part of an emissive surface.
#[derive(Clone, Copy, Debug)]
pub struct FlatPart {
    /// A corner of the part.
    pub corner: Vec3,
    /// Edges from `corner` to two other corners.
    pub edges: [Vec3; 2],
    /// Unit normal of the front.
    pub normal: Vec3,
    /// Bound of the absolute error of each coordinate of a sampled point.
    pub error: Vec3,
    /// Density of sampled points per unit of area; 0 without area.
    pub pdf: f32,
    /// True for a triangle, whose points are the corner plus fractions of the edges with a sum of
    /// at most 1.
    pub is_triangle: bool,
    /// Centroid of the part.
    pub middle: Vec3,
    /// Squared distance from `middle` beyond which the part is [far](Self::is_far).
    pub far: f32,
}

/// A sampled point of a part, as seen from another point. The other fields are meaningful only if
/// [`Self::exists`].
#[derive(Clone, Copy, Debug)]
pub struct PartSample {
    /// Unit direction towards the sampled point.
    pub direction: Vec3,
    /// Density per steradian of the direction.
    pub pdf: f32,
    /// The end of a shadow ray towards the sampled point, on the viewpoint's side of the part.
    pub end: Vec3,
    /// True if the front of the part is visible.
    pub is_front: bool,
    /// True if the sample has a direction and a density.
    pub exists: bool,
}

impl FlatPart {
    fn new(corners: [DVec3; 3], normal: Vec3, is_triangle: bool) -> Self {
        let [corner, a, b] = corners;
        let (a, b) = (a - corner, b - corner);
        let whole = a.cross(b).length() * if is_triangle { 0.5 } else { 1.0 };
        let (to_middle, last) =
            if is_triangle { ((a + b) / 3.0, b) } else { ((a + b) / 2.0, a + b) };
        let radius = [DVec3::ZERO, a, b, last]
            .map(|p| (p - to_middle).length_squared())
            .into_iter()
            .fold(0.0, f64::max);
        // Corners and edges are rounded once and then blended; a hit is computed with a few more
        // roundings.
        let reach = [corner, corner + a, corner + b, corner + last]
            .into_iter()
            .fold(DVec3::ZERO, |m, p| m.max(p.abs()));
        let pdf = if whole > 0.0 && whole.is_finite() {
            (1.0 / whole).min(f64::from(f32::MAX)) as f32
        } else {
            0.0
        };
        Self {
            corner: corner.as_vec3(),
            edges: [a.as_vec3(), b.as_vec3()],
            normal,
            error: (reach * f64::from(gamma(8))).as_vec3(),
            pdf,
            is_triangle,
            middle: (corner + to_middle).as_vec3(),
            far: (radius / (FAR * FAR)) as f32,
        }
    }

    /// A triangle with this unit normal.
    pub(super) fn triangle(corners: [DVec3; 3], normal: Vec3) -> Self {
        Self::new(corners, normal, true)
    }

    /// The triangle or rectangle that a shape with this transform is; `None` for other shapes.
    pub(super) fn of(shape: &dyn Shape, place: &Transform) -> Option<Self> {
        let (corners, is_triangle) = match shape.to_any()? {
            AnyShape::Triangle(triangle) => (triangle.vertices, true),
            AnyShape::Rectangle(rectangle) => {
                let DVec2 { x, y } = rectangle.half_size;
                let corner = |x, y| DVec3::new(x, y, 0.0);
                ([corner(-x, -y), corner(x, -y), corner(-x, y)], false)
            }
            _ => return None,
        };
        let [a, b, c] = corners;
        let normal = place.normal((b - a).cross(c - a)).try_normalize()?.as_vec3();
        Some(Self::new(corners.map(|p| place.point(p)), normal, is_triangle))
    }

    /// The area of the part.
    pub fn area(&self) -> f64 {
        let area = self.edges[0].as_dvec3().cross(self.edges[1].as_dvec3()).length();
        let area = if self.is_triangle { area * 0.5 } else { area };
        if area.is_finite() { area } else { 0.0 }
    }

    /// True if points are sampled by area when seen from `from`.
    #[inline(always)]
    pub fn is_far(&self, from: Vec3) -> bool {
        (self.middle - from).length_squared() > self.far
    }

    /// Samples a point by area, as seen from a far point.
    #[inline(always)]
    pub fn sample(&self, from: Vec3, u: Vec2) -> PartSample {
        PartSample::of(self.by_area(from, u), self.normal, self.error)
    }

    /// Samples a point by area.
    #[inline(always)]
    fn by_area(&self, from: Vec3, u: Vec2) -> NearSample {
        let folded = sampling::uniform_triangle(u);
        let (x, y) = if self.is_triangle { (folded.x, folded.y) } else { (u.x, u.y) };
        let position = self.corner + self.edges[0] * x + self.edges[1] * y;
        let to_light = position - from;
        let squared = to_light.length_squared();
        let scale = 1.0 / squared.sqrt();
        let direction = to_light * scale;
        let cos = direction.dot(self.normal);
        let pdf = self.pdf * squared / max(cos, -cos);
        let exists = (scale > 0.0) & (scale < f32::INFINITY) & (pdf > 0.0) & (pdf < f32::INFINITY);
        NearSample { position, direction, pdf, is_seen: false, exists }
    }

    /// The sample `near` by solid angle, or a sample by area if that one is not possible.
    #[inline(always)]
    pub fn near_or_by_area(&self, near: NearSample, from: Vec3, u: Vec2) -> PartSample {
        let by_area = self.by_area(from, u);
        let is_seen = near.is_seen;
        let either = |a: Vec3, b: Vec3| {
            let one = |a: f32, b: f32| if is_seen { a } else { b };
            Vec3::new(one(a.x, b.x), one(a.y, b.y), one(a.z, b.z))
        };
        let point = NearSample {
            position: either(near.position, by_area.position),
            direction: either(near.direction, by_area.direction),
            pdf: if is_seen { near.pdf } else { by_area.pdf },
            is_seen,
            exists: (is_seen & near.exists) | (!is_seen & by_area.exists),
        };
        PartSample::of(point, self.normal, self.error)
    }
}

impl PartSample {
    /// The sample of a point, given the surface's normal and a bound of the error of each
    /// coordinate.
    #[inline(always)]
    pub(super) fn of(point: NearSample, normal: Vec3, error: Vec3) -> Self {
        let NearSample { position, direction, pdf, exists, .. } = point;
        let end = offset_ray_origin(position, error, normal, -direction);
        Self { end, direction, pdf, is_front: direction.dot(normal) < 0.0, exists }
    }
}
