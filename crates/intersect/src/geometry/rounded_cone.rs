//! Balls, and the convex hull of two balls (a truncated cone tangent to two spheres), from which
//! round curves are built.
//!
//! A ray is inside the hull along a single interval. The ends of the interval are the first and the
//! last of the crossings with both spheres and with the cone between the circles where the cone is
//! tangent to the spheres. So there is no seam between sphere and cone that a ray could slip
//! through.

use snell_math::{Bounds3d, DRay, DVec3, DVec4, Vec4, robust};

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub center: DVec3,
    pub radius: f64,
}

impl Ball {
    /// The ball with centre (x, y, z) and radius w; `None` unless all are finite and the radius is
    /// not negative.
    #[inline]
    pub fn new(v: Vec4) -> Option<Self> {
        let ball = Self { center: v.truncate().as_dvec3(), radius: v.w.into() };
        (v.is_finite() && v.w >= 0.0).then_some(ball)
    }

    /// Like [`Self::new`], in double precision.
    #[inline]
    pub fn exact(v: DVec4) -> Option<Self> {
        let ball = Self { center: v.truncate(), radius: v.w };
        (v.is_finite() && v.w >= 0.0).then_some(ball)
    }

    #[inline]
    pub fn bounds(&self) -> Bounds3d {
        Bounds3d { min: self.center - self.radius, max: self.center + self.radius }
    }

    /// The ball interpolated linearly from this one (`s = 0`) to another (`s = 1`).
    #[inline]
    pub fn lerp(&self, other: &Self, s: f64) -> Self {
        Self {
            center: self.center.lerp(other.center, s),
            radius: self.radius + (other.radius - self.radius) * s,
        }
    }
}

/// A ray with a direction of length 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct UnitRay {
    pub origin: DVec3,
    pub direction: DVec3,
    /// Ray parameter per unit of length.
    pub scale: f64,
}

impl UnitRay {
    /// Normalises a ray. `None` if the length of its direction is outside 1e-150 to 1e150, where
    /// the squares are inaccurate; along such rays nothing is hit.
    #[inline]
    pub fn new(ray: &DRay) -> Option<Self> {
        let length2 = ray.direction.length_squared();
        let scale = 1.0 / length2.sqrt();
        let usable = length2 > 1e-300 && length2 < 1e300;
        usable.then_some(Self { origin: ray.origin, direction: ray.direction * scale, scale })
    }

    /// The point of the ray nearest to `point`, relative to `point`, and the length along the ray
    /// up to it. Calculations from there have rounding errors relative to the scale near `point`,
    /// however far away the origin is.
    #[inline]
    fn near(&self, point: DVec3) -> (DVec3, f64) {
        let o = self.origin - point;
        let s = -o.dot(self.direction);
        (o + self.direction * s, s)
    }

    /// The interval of ray parameters inside a ball; `None` if the ray misses it.
    #[inline]
    pub fn ball_span(&self, ball: &Ball) -> Option<[f64; 2]> {
        self.ball_lengths(ball).map(|ends| ends.map(|s| s * self.scale))
    }

    #[inline]
    fn ball_lengths(&self, ball: &Ball) -> Option<[f64; 2]> {
        let (o, s) = self.near(ball.center);
        // Half of the chord, squared. Compared so that NaN misses.
        let half2 = ball.radius * ball.radius - o.length_squared();
        (half2 > 0.0).then(|| [s - half2.sqrt(), s + half2.sqrt()])
    }

    /// Both ends of the interval inside the hull of two balls, each as ray parameter and position
    /// along the hull (0 at the first ball, 1 at the second); `None` if the ray misses it.
    pub fn hull_span(&self, balls: &[Ball; 2]) -> Option<[(f64, f64); 2]> {
        let mut ends: Option<[(f64, f64); 2]> = None;
        let mut add = |s: f64, u: f64| {
            let [first, last] = ends.get_or_insert([(s, u); 2]);
            if s < first.0 {
                *first = (s, u);
            }
            if s > last.0 {
                *last = (s, u);
            }
        };
        for (ball, u) in balls.iter().zip([0.0, 1.0]) {
            if let Some(span) = self.ball_lengths(ball) {
                span.into_iter().for_each(|s| add(s, u));
            }
        }
        for (s, u) in self.cone_crossings(balls).into_iter().flatten() {
            add(s, u);
        }
        ends.map(|ends| ends.map(|(s, u)| (s * self.scale, u)))
    }

    /// The crossings of the ray with the cone, between its circles of tangency with the balls.
    ///
    /// The balls between the two have centres `c + v a` and radii `r - v k`. A point `q` (relative
    /// to `c`) is on their envelope if the minimum over `v` of `|q - v a|^2 - (r - v k)^2` is 0:
    /// `|q|^2 - r^2 = y^2 / g` at `v = y / g`, where `y = q a - r k` and `g = a^2 - k^2`. All is
    /// computed relative to the points where ray and axis are nearest, so that small differences
    /// stay accurate.
    fn cone_crossings(&self, [first, second]: &[Ball; 2]) -> [Option<(f64, f64)>; 2] {
        let (a, k) = (second.center - first.center, first.radius - second.radius);
        let g = a.length_squared() - k * k;
        if g.is_nan() || g <= 0.0 {
            // One ball contains the other.
            return [None; 2];
        }
        let along = a.dot(self.direction);
        let base = self.nearest_on_axis(first.center, a, along);
        let ball = first.lerp(second, base);
        let (o, s) = self.near(ball.center);
        let y = o.dot(a) - ball.radius * k;
        // `o` is perpendicular to the direction.
        let (qa, qb) = (1.0 - along * along / g, -y * along / g);
        let qc = o.length_squared() - ball.radius * ball.radius - y * y / g;
        let Some((s0, s1)) = robust::quadratic(qa, 2.0 * qb, qc) else { return [None; 2] };
        [s0, s1].map(|root| {
            let u = base + (y + root * along) / g;
            (0.0..=1.0).contains(&u).then_some((s + root, u))
        })
    }

    /// The position along the axis, from 0 to 1, nearest to the ray.
    fn nearest_on_axis(&self, start: DVec3, a: DVec3, along: f64) -> f64 {
        let (o, _) = self.near(start);
        let across = a - self.direction * along;
        let v = o.dot(across) / across.length_squared();
        if v.is_nan() { 0.5 } else { v.clamp(0.0, 1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(x: f64, radius: f64) -> Ball {
        Ball { center: DVec3::X * x, radius }
    }

    fn span(ray: &DRay, balls: [Ball; 2]) -> Option<[(f64, f64); 2]> {
        UnitRay::new(ray).and_then(|r| r.hull_span(&balls))
    }

    #[test]
    fn a_hull_of_equal_balls_is_a_capsule() {
        let capsule = [ball(-1.0, 0.5), ball(1.0, 0.5)];
        let down = |x: f64| span(&DRay::new(DVec3::new(x, 0.0, 5.0), DVec3::Z * -2.0), capsule);
        assert_eq!(down(0.0), Some([(2.25, 0.5), (2.75, 0.5)]));
        assert_eq!(down(1.25).map(|s| s.map(|e| e.1)), Some([1.0; 2]));
        assert_eq!(down(1.51), None);
        let lengthwise = span(&DRay::new(DVec3::new(-5.0, 0.3, 0.0), DVec3::X), capsule)
            .expect("through both ends");
        assert!((lengthwise[0].0 - 3.6).abs() < 1e-12 && (lengthwise[1].0 - 6.4).abs() < 1e-12);
    }

    #[test]
    fn a_ball_inside_the_other_adds_nothing() {
        let nested = [ball(0.0, 2.0), ball(0.5, 0.5)];
        let ray = DRay::new(DVec3::new(0.5, 0.1, -9.0), DVec3::Z);
        let alone = UnitRay::new(&ray).and_then(|r| r.ball_span(&nested[0]));
        assert_eq!(span(&ray, nested).map(|s| s.map(|e| e.0)), alone);
    }

    #[test]
    fn a_thin_hull_far_away_is_met_where_it_is() {
        let thin = [ball(-1.0, 1e-6), ball(1.0, 2e-6)];
        let from = DVec3::new(0.0, 0.9e-6, -1e4);
        let ends = span(&DRay::new(from, DVec3::Z), thin).expect("within the radius");
        // In the middle the hull is nearly a tube of radius 1.5e-6.
        let half = (1.5e-6f64.powi(2) - 0.9e-6f64.powi(2)).sqrt();
        assert!(
            (ends[0].0 - (1e4 - half)).abs() < 1e-11 && (ends[1].0 - (1e4 + half)).abs() < 1e-11
        );
    }
}
