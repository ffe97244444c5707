//! Round cubic curves in the Bézier, B-spline, Catmull-Rom and Hermite bases.

use super::nearest::on_sweep;
use super::rounded_cone::Ball;
use super::sweep::{Sweep, tube_surface};
use super::{PrimitiveHit, PrimitiveSet};
use crate::shape::{Metric, ShapeSurface};
use snell_math::{Bounds3d, DRay, DVec3, DVec4, Vec2, Vec4};

const SIXTH: f64 = 1.0 / 6.0;

/// The basis of a cubic curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CurveBasis {
    /// Bézier: four points, the first and last of which are the ends of the segment; the two
    /// between attract it. Consecutive segments share a point.
    #[default]
    Bezier,
    /// Uniform B-spline: four points that the segment approximates. The next segment starts one
    /// point later.
    BSpline,
    /// Catmull-Rom: the segment runs from the second to the third of four points. The next segment
    /// starts one point later.
    CatmullRom,
    /// Hermite: two points, and the derivative at each ([`CubicCurves::tangents`]).
    Hermite,
}

/// Cubic curves of round cross-section: each segment is the space swept by a ball whose centre and
/// radius are cubic functions. The ends are round, so consecutive segments leave no crack. Each
/// segment is a separate solid.
///
/// The curve is divided in halves until it is straight to a thousandth of its largest radius (at
/// most 4096 pieces). The crossings of the pieces' hulls are then refined to the true surface where
/// the iteration converges, to about 1e-12 of the size of the segment. Errors remain at
/// silhouettes: a ray within a thousandth of the radius of the silhouette may be classified
/// wrongly. Where a curve bends more tightly than its radius, the surface is still that of the
/// swept space.
///
/// A segment is never hit if a point is out of range or not finite, if a radius is negative, or if
/// all radii are 0. Where the basis makes the radius negative between points, it is clamped to 0.
///
/// [`crate::Hit::uv`] is `(u, 0)` with `u` from 0 to 1 along the segment. The texture coordinates
/// are `(u, v)` with `v` the angle around the curve, from 0 to 1 for a full turn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CubicCurves {
    /// The basis of all segments.
    pub basis: CurveBasis,
    /// Position (x, y, z) and radius (w).
    pub points: Vec<Vec4>,
    /// For Hermite curves, the derivatives of position and radius at the points by the parameter of
    /// the segment.
    pub tangents: Vec<Vec4>,
    /// For each segment the index of its first point.
    pub segments: Vec<u32>,
    /// Positions and radii in double precision, of which `points` are rounded copies; empty if
    /// those are all that is known.
    pub exact: Vec<DVec4>,
}

impl CubicCurves {
    /// The Bézier control points of a segment, with the radius in `w`; `None` if the segment is
    /// never hit.
    pub fn bezier(&self, segment: usize) -> Option<[DVec4; 4]> {
        let first = self.segments[segment] as usize;
        let get = |all: &[Vec4], i: usize| all.get(first.checked_add(i)?).map(|v| v.as_dvec4());
        let point = |i: usize| match self.exact.get(first.checked_add(i)?) {
            Some(exact) => Some(*exact),
            None => get(&self.points, i),
        };
        let mut controls = if self.basis == CurveBasis::Hermite {
            let ends = [point(0)?, point(1)?];
            let [a, b] = ends;
            let (da, db) = (get(&self.tangents, 0)?, get(&self.tangents, 1)?);
            if ends.iter().any(|p| p.w < 0.0) {
                return None;
            }
            [a, a + da / 3.0, b - db / 3.0, b]
        } else {
            let points = [point(0)?, point(1)?, point(2)?, point(3)?];
            if points.iter().any(|p| p.w < 0.0) {
                return None;
            }
            let [a, b, c, d] = points;
            match self.basis {
                CurveBasis::BSpline => {
                    let third = 1.0 / 3.0;
                    [
                        (a + b * 4.0 + c) * SIXTH,
                        (b * 2.0 + c) * third,
                        (b + c * 2.0) * third,
                        (b + c * 4.0 + d) * SIXTH,
                    ]
                }
                CurveBasis::CatmullRom => [b, b + (c - a) * SIXTH, c - (d - b) * SIXTH, c],
                CurveBasis::Bezier | CurveBasis::Hermite => [a, b, c, d],
            }
        };
        if !controls.iter().all(|c| c.is_finite()) {
            return None;
        }
        controls.iter_mut().for_each(|c| c.w = c.w.max(0.0));
        controls.iter().any(|c| c.w > 0.0).then_some(controls)
    }
}

/// The number of balls of a segment that the search for its nearest point compares before refining.
const SAMPLES: usize = 48;

/// A cubic Bézier curve, with the radius in `w`, as the solid that a ball sweeps along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube(pub [DVec4; 4]);

impl Tube {
    /// The ball that sweeps the curve, at `u`.
    fn ball(&self, u: f64) -> Ball {
        let c = super::sweep::derivatives(&self.0, u)[0];
        Ball { center: c.truncate(), radius: c.w }
    }

    pub fn bounds(&self) -> Bounds3d {
        // The curve is a weighted mean of its control points, and so are the balls along it.
        let balls = self.0.map(|c| Ball { center: c.truncate(), radius: c.w }.bounds());
        balls.into_iter().fold(Bounds3d::EMPTY, |all, b| all.union(&b))
    }

    /// The entries and exits of a ray's line in ascending order.
    pub fn crossings(&self, ray: &DRay) -> Option<impl Iterator<Item = PrimitiveHit> + use<>> {
        let sweep = Sweep::new(&self.0, ray)?;
        Some(sweep.crossings().map(|(t, u)| PrimitiveHit { t, uv: Vec2::new(u as f32, 0.0) }))
    }

    /// The surface at a point that was hit with this `u`. `chord` is a direction common to a whole
    /// curve, from which the angle of the texture coordinates is measured.
    pub fn surface(&self, position: DVec3, u: f32, chord: DVec3) -> ShapeSurface {
        let u = super::sweep::foot(&self.0, position, u.into());
        let [c, d, _] = super::sweep::derivatives(&self.0, u);
        tube_surface(
            &Ball { center: c.truncate(), radius: c.w },
            u,
            (d.truncate(), d.w),
            chord,
            position,
        )
    }

    pub fn nearest_point(&self, point: DVec3, metric: &Metric) -> (DVec3, Vec2) {
        let (position, _, u) = on_sweep(metric, point, SAMPLES, |u| self.ball(u));
        (position, Vec2::new(u as f32, 0.0))
    }

    pub fn contains(&self, point: DVec3) -> bool {
        on_sweep(&Metric::EUCLIDEAN, point, SAMPLES, |u| self.ball(u)).1 <= 0.0
    }
}

impl PrimitiveSet for CubicCurves {
    fn len(&self) -> usize {
        self.segments.len()
    }

    fn bounds(&self, segment: usize) -> Bounds3d {
        self.bezier(segment).map_or(Bounds3d::EMPTY, |controls| Tube(controls).bounds())
    }

    fn closest(&self, segment: usize, ray: &DRay, _time: f32) -> Option<PrimitiveHit> {
        Tube(self.bezier(segment)?).crossings(ray)?.find(|hit| ray.contains(hit.t))
    }

    fn surface(&self, segment: usize, position: DVec3, uv: Vec2, _time: f32) -> ShapeSurface {
        let controls = self.bezier(segment).unwrap_or([position.extend(0.0); 4]);
        Tube(controls).surface(position, uv.x, (controls[3] - controls[0]).truncate())
    }

    fn nearest_point(
        &self,
        segment: usize,
        point: DVec3,
        metric: &Metric,
    ) -> Option<(DVec3, Vec2)> {
        Some(Tube(self.bezier(segment)?).nearest_point(point, metric))
    }

    fn contains(&self, segment: usize, point: DVec3) -> bool {
        self.bezier(segment).is_some_and(|controls| Tube(controls).contains(point))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sweep::derivatives;

    fn points() -> Vec<Vec4> {
        let p = |x: f32, y: f32, r: f32| Vec4::new(x, y, 0.5 * x * y, r);
        vec![
            p(0.0, 1.0, 0.1),
            p(1.0, -1.0, 0.2),
            p(2.0, 2.0, 0.3),
            p(3.0, 0.0, 0.1),
            p(4.0, 1.0, 0.2),
        ]
    }

    #[test]
    fn segments_that_follow_each_other_meet_in_the_same_ball() {
        for basis in [CurveBasis::BSpline, CurveBasis::CatmullRom, CurveBasis::Hermite] {
            let curves = CubicCurves {
                basis,
                points: points(),
                tangents: points(),
                segments: vec![0, 1],
                exact: Vec::new(),
            };
            let [a, b] = [0, 1].map(|s| curves.bezier(s).expect("a curve"));
            assert_eq!(a[3], b[0], "{basis:?}");
        }
    }

    #[test]
    fn the_bases_do_what_they_are_known_for() {
        let curve = |basis| {
            CubicCurves {
                basis,
                points: points(),
                tangents: points(),
                segments: vec![0],
                exact: Vec::new(),
            }
            .bezier(0)
            .expect("a curve")
        };
        let p = points().iter().map(|p| p.as_dvec4()).collect::<Vec<_>>();
        let near = |a: DVec4, b: DVec4| (a - b).abs().max_element() < 1e-6;
        // Catmull-Rom passes through the inner points, along the line between their neighbours.
        let [c, d, _] = derivatives(&curve(CurveBasis::CatmullRom), 0.0);
        assert!(near(c, p[1]) && near(d, (p[2] - p[0]) * 0.5));
        // Hermite has the given points and derivatives.
        let [c, d, _] = derivatives(&curve(CurveBasis::Hermite), 1.0);
        assert!(near(c, p[1]) && near(d, p[1]));
        // A B-spline has the weights 1, 4, 1 at the joints, and its second derivative there is p0 -
        // 2 p1 + p2.
        let [c, _, dd] = derivatives(&curve(CurveBasis::BSpline), 0.0);
        assert!(near(c, (p[0] + p[1] * 4.0 + p[2]) / 6.0) && near(dd, p[0] - p[1] * 2.0 + p[2]));
    }
}
