//! Spheres in bulk: point clouds and particles.

use super::nearest::on_ball;
use super::rounded_cone::{Ball, UnitRay};
use super::{PrimitiveHit, PrimitiveSet};
use crate::prefetch::fetch;
use crate::shape::{Metric, Shape, ShapeSurface, Sphere};
use snell_math::{Bounds3d, DRay, DVec3, DVec4, Vec2, Vec4};

/// Many spheres, 16 bytes each. A sphere whose centre is not finite or whose radius is not positive
/// and finite is never hit.
///
/// Hits are decided in double precision. A ray that only
/// touches a sphere misses it. Texture coordinates are those of [`Sphere`], with y up;
/// [`crate::Hit::uv`] is zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spheres {
    /// Centre (x, y, z) and radius (w).
    pub spheres: Vec<Vec4>,
    /// Linear RGB and alpha, one per sphere; missing ones are white.
    pub colors: Vec<[f32; 4]>,
    /// Centre and radius in double precision, of which `spheres` are rounded copies; empty if those
    /// are all that is known.
    pub exact: Vec<DVec4>,
}

impl Spheres {
    fn ball(&self, primitive: usize) -> Option<Ball> {
        let ball = match self.exact.get(primitive) {
            Some(exact) => Ball::exact(*exact),
            None => Ball::new(self.spheres[primitive]),
        };
        ball.filter(|ball| ball.radius > 0.0)
    }

    /// Centre and radius of a sphere in the best precision that is known.
    pub fn exact_sphere(&self, primitive: usize) -> DVec4 {
        self.exact.get(primitive).copied().unwrap_or_else(|| self.spheres[primitive].as_dvec4())
    }
}

impl PrimitiveSet for Spheres {
    fn len(&self) -> usize {
        self.spheres.len()
    }

    fn bounds(&self, primitive: usize) -> Bounds3d {
        self.ball(primitive).map_or(Bounds3d::EMPTY, |ball| ball.bounds())
    }

    fn closest(&self, primitive: usize, ray: &DRay, _time: f32) -> Option<PrimitiveHit> {
        let t = UnitRay::new(ray)?
            .ball_span(&self.ball(primitive)?)?
            .into_iter()
            .find(|&t| ray.contains(t))?;
        Some(PrimitiveHit { t, uv: Vec2::ZERO })
    }

    fn fetch(&self, primitive: usize) {
        fetch(&raw const self.spheres[primitive]);
    }

    fn surface(&self, primitive: usize, position: DVec3, _uv: Vec2, _time: f32) -> ShapeSurface {
        let exact = self.exact_sphere(primitive);
        let (center, sphere) = (exact.truncate(), Sphere { radius: exact.w });
        let surface = sphere.surface(position - center, 0);
        ShapeSurface { position: center + surface.position, ..surface }
    }

    fn color(&self, primitive: usize, _uv: Vec2) -> [f32; 4] {
        self.colors.get(primitive).copied().unwrap_or([1.0; 4])
    }

    fn nearest_point(
        &self,
        primitive: usize,
        point: DVec3,
        metric: &Metric,
    ) -> Option<(DVec3, Vec2)> {
        Some((on_ball(metric, point, &self.ball(primitive)?).0, Vec2::ZERO))
    }

    fn contains(&self, primitive: usize, point: DVec3) -> bool {
        self.ball(primitive).is_some_and(|ball| point.distance(ball.center) <= ball.radius)
    }
}
