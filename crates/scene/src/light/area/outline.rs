//! The solid angle of a part of an emissive surface as seen from a point, and sampling of points
//! uniform in it.

use super::near::{NearRectangle, NearSphere, TriangleSeen};
use snell_intersect::{AnyShape, Shape};
use snell_math::spherical::{self, SphericalRectangle};
use snell_math::{DVec2, DVec3, Transform};

/// The shape of a part in the world, for sampling by solid angle.
#[derive(Clone, Copy, Debug)]
pub(super) enum Outline {
    Triangle {
        corner: DVec3,
        edges: [DVec3; 2],
    },
    Rectangle(NearRectangle),
    /// A disk or ring. From near points the square around it is sampled.
    Disk {
        center: DVec3,
        axes: [DVec3; 2],
        radius: f64,
        inner: f64,
    },
    Sphere(NearSphere),
    /// Any other part, which is sampled by area.
    Other,
}

/// Parts with a smaller solid angle are sampled by area: the density over small parts is nearly
/// constant, and differences of angles lose digits.
pub(super) const LEAST: f64 = 1e-4;
/// Parts with a larger solid angle are sampled by area too: the viewpoint lies on the surface,
/// within rounding, and angles of nearly half a turn lose digits.
pub(super) const MOST: f64 = 6.22;
/// The least solid angle at which the square around a disk is sampled. The corners of the square
/// are wasted, which pays only if the distances to points of the disk differ much.
const LEAST_OF_DISK: f64 = 0.5;

impl Outline {
    /// The outline of a shape.
    pub(super) fn of(shape: &dyn Shape, place: &Transform) -> Self {
        let matrix = place.matrix().matrix3;
        let (x, y, z) = (matrix.x_axis, matrix.y_axis, matrix.z_axis);
        let nearly_equal = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
        let square = |a: DVec3, b: DVec3| a.dot(b).abs() <= 1e-9 * a.length() * b.length();
        let center = place.point(DVec3::ZERO);
        let axes = [x.normalize_or_zero(), y.normalize_or_zero()];
        match shape.to_any() {
            Some(AnyShape::Triangle(t)) => {
                let [a, b, c] = t.vertices.map(|p| place.point(p));
                Self::Triangle { corner: a, edges: [b - a, c - a] }
            }
            Some(AnyShape::Rectangle(r)) if square(x, y) => {
                let half = r.half_size * DVec2::new(x.length(), y.length());
                Self::Rectangle(NearRectangle { center, axes, half })
            }
            Some(AnyShape::Disk(d)) if square(x, y) && nearly_equal(x.length(), y.length()) => {
                Self::Disk {
                    center,
                    axes,
                    radius: d.radius * x.length(),
                    inner: d.inner_radius * x.length(),
                }
            }
            Some(AnyShape::Sphere(s))
                if square(x, y)
                    && square(y, z)
                    && square(z, x)
                    && nearly_equal(x.length(), y.length())
                    && nearly_equal(x.length(), z.length()) =>
            {
                Self::Sphere(NearSphere { center, radius: s.radius * x.length() })
            }
            _ => Self::Other,
        }
    }

    /// True if a point lies on the part: false for points of the square around a disk that are
    /// outside of the disk.
    pub(super) fn holds(&self, p: DVec3) -> bool {
        match self {
            Self::Disk { center, radius, inner, .. } => {
                let d2 = (p - *center).length_squared();
                d2 <= radius * radius && d2 >= inner * inner
            }
            _ => true,
        }
    }

    /// The part as seen from a point; `None` if it should be sampled by area.
    pub(super) fn seen_from(&self, from: DVec3) -> Option<Seen> {
        let (seen, least) = match *self {
            Self::Triangle { corner, edges } => (Seen::triangle(corner - from, edges), LEAST),
            Self::Rectangle(rectangle) => (Seen::rectangle(&rectangle, from), LEAST),
            Self::Disk { center, axes, radius, .. } => {
                let square = NearRectangle { center, axes, half: DVec2::splat(radius) };
                (Seen::rectangle(&square, from), LEAST_OF_DISK)
            }
            Self::Sphere(sphere) => return Seen::sphere(&sphere, from),
            Self::Other => return None,
        };
        (seen.solid_angle > least && seen.solid_angle < MOST).then_some(seen)
    }
}

/// A part as seen from a viewpoint, prepared for sampling.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    solid_angle: f64,
    kind: SeenKind,
}

#[derive(Clone, Copy, Debug)]
enum SeenKind {
    Triangle(TriangleSeen),
    Rectangle { axes: [DVec3; 3], z: f64, rectangle: SphericalRectangle },
    Sphere { center: DVec3, radius: f64 },
}

impl Seen {
    fn triangle(corner: DVec3, edges: [DVec3; 2]) -> Self {
        let seen = TriangleSeen::new(corner, edges);
        Self { solid_angle: seen.solid_angle, kind: SeenKind::Triangle(seen) }
    }

    fn rectangle(rectangle: &NearRectangle, from: DVec3) -> Self {
        let ([x, y], (seen, z)) = (rectangle.axes, rectangle.seen_from(from));
        let kind = SeenKind::Rectangle { axes: [x, y, rectangle.normal()], z, rectangle: seen };
        Self { solid_angle: seen.solid_angle, kind }
    }

    /// Prepares a sphere. `None` unless [`NearSphere::has_near_side`].
    fn sphere(sphere: &NearSphere, from: DVec3) -> Option<Self> {
        let (center, radius) = (sphere.center - from, sphere.radius);
        let solid_angle = spherical::sphere_solid_angle(radius * radius, center.length_squared());
        let kind = SeenKind::Sphere { center, radius };
        sphere.has_near_side(from).then_some(Self { solid_angle, kind })
    }

    pub(super) fn is_sphere(&self) -> bool {
        matches!(self.kind, SeenKind::Sphere { .. })
    }

    /// Density of sampled directions per steradian.
    pub(super) fn pdf(&self) -> f32 {
        (1.0 / self.solid_angle).min(f64::from(f32::MAX)) as f32
    }

    /// Samples the vector from the viewpoint to a point of the part. `None` if rounding leaves no
    /// direction.
    pub(super) fn sample(&self, u: DVec2) -> Option<DVec3> {
        let offset = match &self.kind {
            SeenKind::Triangle(seen) => {
                let (offset, exists) = seen.sample(u);
                exists.then_some(offset)?
            }
            SeenKind::Rectangle { axes, z, rectangle } => {
                let p = rectangle.sample(u);
                axes[0] * p.x + axes[1] * p.y + axes[2] * *z
            }
            SeenKind::Sphere { center, radius } => spherical::sample_sphere(*center, *radius, u),
        };
        (offset.is_finite() && offset != DVec3::ZERO).then_some(offset)
    }
}
