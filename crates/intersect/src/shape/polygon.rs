//! A convex planar polygon, with both intersection tests of the lecture.

use super::frustum::choose;
use super::nearest::on_triangle;
use super::plane::intersect_plane;
use super::triangle::{RaySpace, sample_barycentrics};
use super::winding;
use super::{Metric, Patch, Shape, ShapeHit, ShapePoint, ShapeSample, ShapeSurface};
use serde::{Deserialize, Serialize};
use snell_math::parameters::{Declared, Kind, Parameter, Range, Value, Visitor};
use snell_math::{Bounds3d, DRay, DVec2, DVec3, real, rotation};
use std::f64::consts::TAU;

/// A convex planar polygon. The right-hand rule on its vertices gives the normal; it is hit from
/// both sides.
///
/// `uv` spans the rectangle around the polygon whose `u` axis runs along the first edge; `v` grows
/// downwards when the polygon is seen from its front with that edge pointing right.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vertices", into = "Vertices")]
pub struct Polygon {
    vertices: Vec<DVec3>,
    /// The vertices without repeated ones. Those off the common plane by more than rounding are
    /// moved onto it.
    corners: Vec<DVec3>,
    normal: DVec3,
    /// The corner where `uv` is 0.
    origin: DVec3,
    /// The derivative of the position by `u`.
    dpdu: DVec3,
    /// The derivative of the position by `v`.
    dpdv: DVec3,
}

/// The serialized form of a polygon.
#[derive(Clone, Serialize, Deserialize)]
struct Vertices {
    vertices: Vec<DVec3>,
}

impl Declared for Polygon {
    const ABOUT: &'static str = "A convex planar polygon. The right-hand rule on its vertices \
        gives the normal; it is hit from both sides.";
    const PARAMETERS: &'static [Parameter] = &[Parameter {
        name: "vertices",
        kind: Kind::List(&Kind::Vector(3)),
        range: Range::Any,
        usual: Range::Any,
        unit: "scene units",
        doc: "Three or more vertices in a plane, in their order around it.",
    }];
}

impl Value for Polygon {
    const KIND: Kind = Kind::Group(Self::PARAMETERS);

    fn visit(&self, visitor: &mut Visitor<'_>) {
        visitor.parameter(&Self::PARAMETERS[0], &self.vertices);
    }
}

/// Errors of vertices that do not form a polygon.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PolygonError {
    /// Fewer than three vertices that differ from their predecessor; how many there are.
    #[error("a polygon needs at least 3 different vertices, found {0}")]
    TooFew(usize),
    /// A coordinate is infinite or NaN; the number of the vertex.
    #[error("vertex {0} of the polygon is not finite")]
    NotFinite(usize),
    /// All vertices lie on a line, or too near to each other to define a plane.
    #[error("the vertices of the polygon lie on a line or nearly in a point: it has no area")]
    NoArea,
    /// A vertex lies off the plane by more than the tolerance.
    #[error(
        "vertex {vertex} lies {distance} off the plane of the polygon, allowed are {allowed}; \
            split it into triangles"
    )]
    NotPlanar {
        /// The number of the vertex.
        vertex: usize,
        /// The distance of the vertex from the plane.
        distance: f64,
        /// The largest distance allowed: [`Polygon::TOLERANCE`] times the extent of the polygon.
        allowed: f64,
    },
    /// The corner with this number turns the other way, or the edges go around more than once.
    #[error("the polygon is not convex at vertex {0}; split it into triangles")]
    NotConvex(usize),
}

impl TryFrom<Vertices> for Polygon {
    type Error = PolygonError;

    fn try_from(stored: Vertices) -> Result<Self, PolygonError> {
        Self::new(stored.vertices)
    }
}

impl From<Polygon> for Vertices {
    fn from(polygon: Polygon) -> Self {
        Self { vertices: polygon.vertices }
    }
}

/// The ray parameter of the hit by the ray-plane test followed by a point-in-polygon test (lecture:
/// "same as triangle"): the point is inside if it is on the same side of all edges, whichever side
/// that is.
pub fn intersect_algebraic(polygon: &Polygon, ray: &DRay) -> Option<f64> {
    let t = intersect_plane(ray, polygon.corners[0], polygon.normal)?;
    let p = ray.at(t);
    let side = |[a, b]: [DVec3; 2]| polygon.normal.dot((a - p).cross(b - p));
    let inside = polygon.edges().all(|e| side(e) >= 0.0) || polygon.edges().all(|e| side(e) <= 0.0);
    inside.then_some(t)
}

/// The nearest hit on the triangles of a fan around the first vertex (lecture: "decompose into
/// triangles, and check all of them"). The watertight triangle test leaves no gap along the
/// diagonals.
pub fn intersect_fan(polygon: &Polygon, ray: &DRay) -> Option<f64> {
    let space = RaySpace::new(ray)?;
    polygon.fan().find_map(|triangle| space.intersect(&triangle)).map(|hit| hit.t)
}

impl Polygon {
    /// The largest distance of a vertex from the plane and of a corner from convexity, as a
    /// fraction of the extent. It allows for the rounding of decimal numbers in files.
    pub const TOLERANCE: f64 = 1e-5;

    /// The polygon with these vertices. Vertices that repeat their predecessor are ignored, and
    /// corners may be straight.
    pub fn new(vertices: Vec<DVec3>) -> Result<Self, PolygonError> {
        if let Some(bad) = vertices.iter().position(|v| !v.is_finite()) {
            return Err(PolygonError::NotFinite(bad));
        }
        let mut corners = vertices.clone();
        corners.dedup();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        if corners.len() < 3 {
            return Err(PolygonError::TooFew(corners.len()));
        }
        let center = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let extent = 2.0 * corners.iter().map(|&v| v.distance(center)).fold(0.0, f64::max);
        let normal = newell_normal(&corners, center, extent).ok_or(PolygonError::NoArea)?;
        flatten(&mut corners, center, normal, extent)?;
        check_convex(&corners, normal, extent)?;

        let right = (corners[1] - corners[0]).try_normalize().ok_or(PolygonError::NoArea)?;
        let down = right.cross(normal);
        let range = |axis: DVec3| {
            let along = corners.iter().map(|&c| (c - center).dot(axis));
            let low = along.clone().fold(f64::INFINITY, f64::min);
            (low, along.fold(f64::NEG_INFINITY, f64::max) - low)
        };
        let ((u0, width), (v0, height)) = (range(right), range(down));
        let origin = center + right * u0 + down * v0;
        Ok(Self { vertices, corners, normal, origin, dpdu: right * width, dpdv: down * height })
    }

    /// The vertices that were given to [`Self::new`].
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Polygons for tests and galleries: triangle, square, oblique with many corners, a straight
    /// corner, thin.
    pub fn examples() -> Vec<Self> {
        let v = DVec3::new;
        let tilted = |i: i32| {
            let p = rotation::unit_vector(TAU * f64::from(i) / 17.0) * DVec2::new(3.0, 1.0);
            v(1.0, 2.0, 3.0) + v(0.6, 0.0, 0.8) * p.x + v(0.64, 0.6, -0.48) * p.y
        };
        let sets = [
            vec![v(0.0, 0.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 1.0)],
            vec![v(-1.0, 0.5, -1.0), v(-1.0, 0.5, 1.0), v(1.0, 0.5, 1.0), v(1.0, 0.5, -1.0)],
            (0..17).map(tilted).collect(),
            vec![
                v(0.0, 0.0, 1.0),
                v(1.0, 0.0, 1.0),
                v(2.0, 0.0, 1.0),
                v(2.0, 3.0, 1.0),
                v(0.0, 1.0, 1.0),
            ],
            vec![v(-50.0, 0.0, 0.0), v(50.0, 0.0, 0.0), v(50.0, 0.0, 0.01), v(-40.0, 0.0, 0.01)],
        ];
        sets.into_iter().filter_map(|s| Self::new(s).ok()).collect()
    }

    fn edges(&self) -> impl Iterator<Item = [DVec3; 2]> {
        edges(&self.corners)
    }

    fn fan(&self) -> impl Iterator<Item = [DVec3; 3]> {
        self.corners[1..].windows(2).map(|e| [self.corners[0], e[0], e[1]])
    }
}

fn edges(corners: &[DVec3]) -> impl Iterator<Item = [DVec3; 2]> {
    (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]])
}

/// Unit normal from the vector area (Newell's method; Sutherland et al., A characterization of ten
/// hidden-surface algorithms, 1974). `None` for a polygon without area.
fn newell_normal(corners: &[DVec3], center: DVec3, extent: f64) -> Option<DVec3> {
    let area: DVec3 =
        edges(corners).map(|[a, b]| ((a - center) / extent).cross((b - center) / extent)).sum();
    if area.length() > 1e-12 { area.try_normalize() } else { None }
}

/// Moves corners onto the plane through `center`, so that a ray that leaves the surface cannot hit
/// a part that sticks out. Corners that are off the plane by no more than rounding keep their bits,
/// which neighbouring polygons may share.
fn flatten(
    corners: &mut [DVec3],
    center: DVec3,
    normal: DVec3,
    extent: f64,
) -> Result<(), PolygonError> {
    let allowed = Polygon::TOLERANCE * extent;
    for (vertex, corner) in corners.iter_mut().enumerate() {
        let distance = (*corner - center).dot(normal);
        if distance.abs() > allowed {
            return Err(PolygonError::NotPlanar { vertex, distance: distance.abs(), allowed });
        }
        if distance.abs() > 1e-12 * extent {
            *corner -= normal * distance;
        }
    }
    Ok(())
}

/// Returns an error unless no corner turns right and all turns together make one full turn.
fn check_convex(corners: &[DVec3], normal: DVec3, extent: f64) -> Result<(), PolygonError> {
    let n = corners.len();
    let mut turned = 0.0;
    for i in 0..n {
        let (before, after) =
            (corners[i] - corners[(i + n - 1) % n], corners[(i + 1) % n] - corners[i]);
        let (sin, cos) = (before.cross(after).dot(normal), before.dot(after));
        // How far the corner lies inside the line between its neighbours.
        let dent = -sin / (before + after).length().max(f64::MIN_POSITIVE);
        turned += real::atan2(sin, cos);
        if dent > Polygon::TOLERANCE * extent || (sin <= 0.0 && cos < 0.0) || turned > TAU + 0.1 {
            return Err(PolygonError::NotConvex(i));
        }
    }
    Ok(())
}

impl Shape for Polygon {
    fn bounds(&self) -> Bounds3d {
        Bounds3d::of(self.corners.iter().copied())
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        intersect_fan(self, ray).map(|t| ShapeHit { t, face: 0 })
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        [self.closest(ray), None]
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.closest(ray));
    }

    fn surface(&self, position: DVec3, _face: u32) -> ShapeSurface {
        let position = position - self.normal * (position - self.corners[0]).dot(self.normal);
        let along = |axis: DVec3| {
            ((position - self.origin).dot(axis) / axis.length_squared()).clamp(0.0, 1.0)
        };
        let uv = DVec2::new(along(self.dpdu), along(self.dpdv));
        ShapeSurface { position, normal: self.normal, uv, dpdu: self.dpdu, dpdv: self.dpdv }
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        let points =
            self.fan().map(|t| ShapePoint { position: on_triangle(metric, point, &t).0, face: 0 });
        metric.nearest(point, points)
    }

    fn winding_number(&self, point: DVec3, metric: &Metric) -> f64 {
        winding::of_triangles(metric, point, self.fan())
    }

    fn area(&self) -> f64 {
        self.fan().map(area).sum()
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        let areas: Vec<f64> = self.fan().map(area).collect();
        let (i, x) = choose(&areas, u.x);
        let [a, b, c] = self.fan().nth(i)?;
        let w = sample_barycentrics(DVec2::new(x, u.y));
        Some(ShapeSample::at(self, a + (b - a) * w.x + (c - a) * w.y, 0))
    }

    fn is_closed(&self) -> bool {
        false
    }

    fn patches(&self) -> Vec<Patch> {
        vec![Patch::flat(0, self.vertices())]
    }
}

fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_z0(points: &[(f64, f64)]) -> Result<Polygon, PolygonError> {
        Polygon::new(points.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect())
    }

    #[test]
    fn all_examples_are_accepted() {
        assert_eq!(Polygon::examples().len(), 5);
    }

    #[test]
    fn what_is_not_a_convex_planar_polygon_is_refused_with_the_reason() {
        assert_eq!(
            in_z0(&[(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 0.0)]),
            Err(PolygonError::TooFew(2))
        );
        assert_eq!(
            in_z0(&[(0.0, 0.0), (1.0, f64::NAN), (1.0, 1.0)]),
            Err(PolygonError::NotFinite(1))
        );
        assert_eq!(in_z0(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]), Err(PolygonError::NoArea));
        assert_eq!(
            in_z0(&[(0.0, 0.0), (4.0, 0.0), (1.0, 1.0), (0.0, 4.0)]),
            Err(PolygonError::NotConvex(2))
        );
        let star: Vec<(f64, f64)> = (0..5).map(|i| (TAU * 0.4 * f64::from(i)).sin_cos()).collect();
        assert!(matches!(in_z0(&star), Err(PolygonError::NotConvex(_))));
        let bent = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.1), DVec3::Y];
        assert!(matches!(Polygon::new(bent.to_vec()), Err(PolygonError::NotPlanar { .. })));
    }

    #[test]
    fn slightly_bent_polygons_are_flattened() {
        let bent = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 1e-6), DVec3::Y];
        let polygon = Polygon::new(bent.to_vec()).expect("within the tolerance");
        assert_eq!(polygon.vertices(), bent);
        for c in &polygon.corners {
            assert!((*c - polygon.corners[0]).dot(polygon.normal).abs() < 1e-15);
        }
    }
}
