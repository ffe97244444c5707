//! Pencils: a ray, and a matrix that describes its neighbours.

use snell_math::glam::{DMat2, DMat4};
use snell_math::{DMat3, DRay, DVec2, DVec3, DVec4};

/// An axial ray on its path through mirrors and glass, with the 4 by 4 *system matrix* of its
/// paraxial rays (Shinya, Takahashi and Naito 1987, section 3). The matrix maps their offsets from
/// the axis and their slopes at the start to offsets and slopes at the current point, to first
/// order. (Igehy, Tracing Ray Differentials, SIGGRAPH 1999, keeps the same data for two of the four
/// dimensions.)
///
/// A paraxial ray is `(x, y, slope of x, slope of y)` in the axes `right` and `up`, which are
/// perpendicular to the axis.
#[derive(Clone, Copy, Debug)]
pub struct Pencil {
    origin: DVec3,
    direction: DVec3,
    right: DVec3,
    up: DVec3,
    system: DMat4,
}

/// A surface near a point, to second order.
#[derive(Clone, Copy, Debug)]
pub struct CurvedSurface {
    /// Unit normal, on either side.
    pub normal: DVec3,
    /// The derivative of the normal by the point on the surface: 0 for a plane.
    pub curvature: DMat3,
}

impl CurvedSurface {
    /// A plane.
    pub fn plane(normal: DVec3) -> Self {
        Self { normal, curvature: DMat3::ZERO }
    }

    /// The surface of a ball, at a point of it in the direction `normal` from the centre.
    pub fn ball(normal: DVec3, radius: f64) -> Self {
        let along = DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        Self { normal, curvature: (DMat3::IDENTITY - along) * (1.0 / radius) }
    }

    /// A triangle with a normal at each corner, at the barycentrics `[b1, b2]`, by which the normal
    /// is interpolated. `None` if it is degenerate.
    pub fn triangle(corners: [DVec3; 3], normals: [DVec3; 3], [b1, b2]: [f64; 2]) -> Option<Self> {
        let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
        let sum = normals[0] * (1.0 - b1 - b2) + normals[1] * b1 + normals[2] * b2;
        let normal = sum.try_normalize()?;
        let gradients = barycentric_gradients(e1, e2)?;
        // Derivatives of the interpolated vector by the barycentrics, without their component along
        // that vector.
        let by = |k: usize| {
            let d = normals[k + 1] - normals[0];
            (d - normal * normal.dot(d)) / sum.length()
        };
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        Some(Self { normal, curvature: outer(by(0), gradients[0]) + outer(by(1), gradients[1]) })
    }
}

/// The gradients of the barycentrics `b1` and `b2` in the plane of a triangle with these edges.
pub(super) fn barycentric_gradients(e1: DVec3, e2: DVec3) -> Option<[DVec3; 2]> {
    let metric =
        DMat2::from_cols(DVec2::new(e1.dot(e1), e1.dot(e2)), DVec2::new(e1.dot(e2), e2.dot(e2)));
    let inverse = metric.inverse();
    let gradients = [
        e1 * inverse.x_axis.x + e2 * inverse.x_axis.y,
        e1 * inverse.y_axis.x + e2 * inverse.y_axis.y,
    ];
    gradients.iter().all(|g| g.is_finite()).then_some(gradients)
}

impl Pencil {
    /// The pencil around a ray; the direction need not be of unit length.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        let direction = direction.normalize_or(DVec3::Z);
        let (right, up) = direction.any_orthonormal_pair();
        Self { origin, direction, right, up, system: DMat4::IDENTITY }
    }

    /// The current point on the axis.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Unit vector along the axis.
    pub fn direction(&self) -> DVec3 {
        self.direction
    }

    /// The system matrix, which maps paraxial rays at the start to those at the current point.
    pub fn system(&self) -> DMat4 {
        self.system
    }

    /// The ray with this direction from the same origin, as a paraxial ray; `None` if it points
    /// backwards.
    pub fn paraxial(&self, direction: DVec3) -> Option<DVec4> {
        let along = direction.dot(self.direction);
        (along > 0.0).then(|| {
            DVec4::new(0.0, 0.0, direction.dot(self.right) / along, direction.dot(self.up) / along)
        })
    }

    /// The current ray for a paraxial ray at the start; its direction is 1 along the axis.
    pub fn ray(&self, start: DVec4) -> DRay {
        let (offset, slope) = self.now(start);
        DRay::new(self.origin + offset, self.direction + slope)
    }

    /// Moves the current point along the axis. (This is exact also for rays far from the axis.)
    pub fn transfer(&mut self, distance: f64) {
        self.origin += self.direction * distance;
        let step = DMat4::from_cols(
            DVec4::X,
            DVec4::Y,
            DVec4::X * distance + DVec4::Z,
            DVec4::Y * distance + DVec4::W,
        );
        self.system = step * self.system;
    }

    /// The offset from the current origin at which a paraxial ray, given at the start, hits a
    /// surface at that origin.
    pub fn offset_on(&self, normal: DVec3, start: DVec4) -> DVec3 {
        self.slid(self.now(start).0, normal)
    }

    /// Reflects the pencil at a surface at the current origin.
    pub fn reflect(&mut self, surface: &CurvedSurface) {
        let (n, e) = (surface.normal, self.direction);
        let direction = e - n * (2.0 * e.dot(n));
        self.turn(surface, direction, |slope, dn| {
            slope - (n * (slope.dot(n) + e.dot(dn)) + dn * e.dot(n)) * 2.0
        });
    }

    /// Refracts the pencil at a surface at the current origin. `ratio` is the index of refraction
    /// in front of the surface divided by the index behind it. Returns false, and does nothing, if
    /// the axis is totally reflected.
    pub fn refract(&mut self, surface: &CurvedSurface, ratio: f64) -> bool {
        let against = if self.direction.dot(surface.normal) > 0.0 { -1.0 } else { 1.0 };
        let surface = CurvedSurface {
            normal: surface.normal * against,
            curvature: surface.curvature * against,
        };
        let (n, e) = (surface.normal, self.direction);
        let arriving = -e.dot(n);
        let squared = 1.0 - ratio * ratio * (1.0 - arriving * arriving);
        if squared <= 0.0 {
            return false;
        }
        let leaving = squared.sqrt();
        let direction = (e * ratio + n * (ratio * arriving - leaving)).normalize();
        self.turn(&surface, direction, |slope, dn| {
            let arriving_change = -(slope.dot(n) + e.dot(dn));
            let leaving_change = ratio * ratio * arriving * arriving_change / leaving;
            slope * ratio
                + n * (ratio * arriving_change - leaving_change)
                + dn * (ratio * arriving - leaving)
        });
        true
    }

    /// Changes the direction of the axis at a surface. `change` maps the change of the incoming
    /// direction and that of the normal to the change of the outgoing direction.
    fn turn(
        &mut self,
        surface: &CurvedSurface,
        direction: DVec3,
        change: impl Fn(DVec3, DVec3) -> DVec3,
    ) {
        let (right, up) = direction.any_orthonormal_pair();
        let column = |start: DVec4| {
            let (offset, slope) = (self.across(start.x, start.y), self.across(start.z, start.w));
            let on_surface = self.slid(offset, surface.normal);
            let turned = change(slope, surface.curvature * on_surface);
            DVec4::new(on_surface.dot(right), on_surface.dot(up), turned.dot(right), turned.dot(up))
        };
        let step = DMat4::from_cols(
            column(DVec4::X),
            column(DVec4::Y),
            column(DVec4::Z),
            column(DVec4::W),
        );
        *self = Self { origin: self.origin, direction, right, up, system: step * self.system };
    }

    /// The current offset and slope of a paraxial ray, given at the start.
    fn now(&self, start: DVec4) -> (DVec3, DVec3) {
        let now = self.system * start;
        (self.across(now.x, now.y), self.across(now.z, now.w))
    }

    fn across(&self, x: f64, y: f64) -> DVec3 {
        self.right * x + self.up * y
    }

    /// The projection of an offset along the axis onto the plane perpendicular to a normal.
    fn slid(&self, offset: DVec3, normal: DVec3) -> DVec3 {
        offset - self.direction * (offset.dot(normal) / self.direction.dot(normal))
    }
}

/// Bounds the distance between the true hits of rays from a common origin on a plane and the hits
/// that their pencil predicts, given the distance of the plane along the axis, the maximum slope of
/// a ray, and the tangent of the angle between the axis and the plane's normal.
///
/// With `q` the slope of the ray towards the plane, the ray hits the plane at `distance / (1 + q)`
/// and the pencil predicts `distance (1 - q)`; the difference is of second order.
pub(super) fn plane_error(distance: f64, slope: f64, tangent: f64) -> f64 {
    let q = slope * tangent;
    if q >= 0.5 {
        return f64::INFINITY;
    }
    distance * (q * q / (1.0 - q) * (1.0 + slope * slope).sqrt() + q * slope)
}
