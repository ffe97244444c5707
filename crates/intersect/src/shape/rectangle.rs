//! A rectangle in the plane z = 0.

use super::nearest::on_triangle;
use super::plane::closest_in_z0;
use super::winding;
use super::{
    AnyShape, Metric, Patch, Shape, ShapeError, ShapeHit, ShapePoint, ShapeSample, ShapeSurface,
};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Bounds3d, DRay, DVec2, DVec3};

snell_math::declare! {
    /// A rectangle in the plane z = 0 around the origin, sides parallel to x and y, with normal +z.
    ///
    /// `uv` is (0, 0) at the corner (-x, +y) and (1, 1) at (+x, -y): a picture is upright when seen
    /// from +z with y up.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Rectangle {
        /// Half the extent along x and y, both positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub half_size: DVec2,
    }
}

impl Rectangle {
    /// Rectangles for tests and galleries: square, long, tiny.
    pub fn examples() -> Vec<Self> {
        [(1.0, 1.0), (300.0, 0.01), (1e-3, 2e-3)]
            .map(|(x, y)| Self { half_size: DVec2::new(x, y) })
            .to_vec()
    }

    /// The two triangles that make up the rectangle.
    pub(crate) fn triangles(&self) -> [[DVec3; 3]; 2] {
        let h = self.half_size;
        let corner = |x: f64, y: f64| DVec3::new(x * h.x, y * h.y, 0.0);
        let (a, b, c, d) =
            (corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0));
        [[a, b, c], [a, c, d]]
    }
}

impl Shape for Rectangle {
    fn validate(&self) -> Result<(), ShapeError> {
        ShapeError::unless_positive("rectangle", "half_size.x", self.half_size.x)?;
        ShapeError::unless_positive("rectangle", "half_size.y", self.half_size.y)
    }

    fn bounds(&self) -> Bounds3d {
        Bounds3d { min: -self.half_size.extend(0.0), max: self.half_size.extend(0.0) }
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        closest_in_z0(ray, |p| p.abs().cmple(self.half_size).all())
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        [self.closest(ray), None]
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.closest(ray));
    }

    fn surface(&self, position: DVec3, _face: u32) -> ShapeSurface {
        let h = self.half_size;
        let p = position.truncate().max(-h).min(h);
        ShapeSurface {
            position: p.extend(0.0),
            normal: DVec3::Z,
            uv: DVec2::new((p.x + h.x) / (2.0 * h.x), (h.y - p.y) / (2.0 * h.y)),
            dpdu: DVec3::X * (2.0 * h.x),
            dpdv: DVec3::NEG_Y * (2.0 * h.y),
        }
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        let on = |corners| ShapePoint { position: on_triangle(metric, point, &corners).0, face: 0 };
        metric.nearest(point, self.triangles().map(on))
    }

    fn winding_number(&self, point: DVec3, metric: &Metric) -> f64 {
        winding::of_triangles(metric, point, self.triangles())
    }

    fn area(&self) -> f64 {
        4.0 * self.half_size.x * self.half_size.y
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        let p = self.half_size * (u * 2.0 - 1.0);
        Some(ShapeSample::at(self, p.extend(0.0), 0))
    }

    fn is_closed(&self) -> bool {
        false
    }

    fn patches(&self) -> Vec<Patch> {
        let [x, y] = self.half_size.to_array();
        let corners = [[-x, -y], [x, -y], [x, y], [-x, y]].map(|[x, y]| DVec3::new(x, y, 0.0));
        vec![Patch::flat(0, corners)]
    }

    fn to_any(&self) -> Option<AnyShape> {
        Some((*self).into())
    }
}
