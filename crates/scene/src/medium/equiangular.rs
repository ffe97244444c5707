//! Equiangular sampling of distances along a segment: equal angles, as seen from a light, are
//! equally probable (Kulla and Fajardo, Importance Sampling Techniques for Path Tracing in
//! Participating Media, EGSR 2012, section 4). This cancels the inverse square of the distance in
//! the light that a medium scatters.

use super::Segment;
use snell_math::Vec3;
use snell_math::real;

/// Optical depth beyond which nothing is sampled.
const DEEP: f64 = 30.0;
/// Maximum optical depth between a segment and a light. For lights farther away, the medium
/// attenuates more than distance does.
const NEAR: f64 = 2.0;

/// A light for equiangular sampling, reduced to a sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EquiangularLight {
    /// The middle of the light.
    pub center: Vec3,
    /// Approximate radius of the light, at least 0. Closer than that, light no longer grows with
    /// the inverse square of the distance.
    pub radius: f32,
}

/// A distribution of distances with a density proportional to the inverse squared distance to a
/// light.
#[derive(Clone, Copy, Debug)]
pub struct Equiangular {
    /// The distance along the segment of the foot of the perpendicular from the light.
    foot: f64,
    /// Length of that perpendicular.
    height: f64,
    /// The angle that is sampled uniformly, in radians.
    angle: f64,
    /// The largest distance that is sampled.
    end: f64,
}

impl Equiangular {
    /// The distribution for a segment through a medium with at least this extinction; `None` if the
    /// segment is empty or the light is far away.
    pub fn new(segment: &Segment, light: &EquiangularLight, sigma: f64) -> Option<Self> {
        let (direction, to_light) =
            (segment.direction.as_dvec3(), (light.center - segment.origin).as_dvec3());
        let foot = to_light.dot(direction);
        let height = real::hypot((to_light - direction * foot).length(), light.radius.into());
        let end = f64::from(segment.length).min(DEEP / sigma);
        // The difference of two arc tangents, precise even if they are nearly equal.
        let angle = real::atan2(height * end, height * height - foot * (end - foot));
        let nearest = real::hypot(height, foot - foot.clamp(0.0, end));
        let is_sound =
            height > 1e-6 * to_light.length() && angle > 1e-9 && end < f64::from(f32::MAX);
        (is_sound && nearest * sigma < NEAR && height.is_finite() && angle.is_finite())
            .then_some(Self { foot, height, angle, end })
    }

    /// The distance for a uniform number `u` in `[0, 1)`.
    pub fn sample(&self, u: f64) -> f64 {
        let Self { foot, height, angle, end } = *self;
        let (sin, cos) = real::sin_cos(u * angle);
        // The difference of the tangents of two angles, times the height.
        let distance = (height * height + foot * foot) * sin / (height * cos + foot * sin);
        if distance >= 0.0 { distance.min(end) } else { end }
    }

    /// Density of a distance per unit of length.
    pub fn pdf(&self, distance: f64) -> f64 {
        let along = distance - self.foot;
        let pdf = self.height / (self.angle * (self.height * self.height + along * along));
        if (0.0..=self.end).contains(&distance) { pdf } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_spread_by_their_density() {
        let segments = [0.5, 3.0, 1e3, f32::INFINITY];
        let equiangular_lights = [(0.0, 1.0), (1.5, 0.01), (-2.0, 0.3), (5.0, 2.0)];
        for length in segments {
            for (along, across) in equiangular_lights {
                let segment = Segment { origin: Vec3::ZERO, direction: Vec3::Z, length };
                let equiangular_light =
                    EquiangularLight { center: Vec3::new(across, 0.0, along), radius: 0.0 };
                let spread =
                    Equiangular::new(&segment, &equiangular_light, 0.3).expect("there is an angle");
                // The integral of the density up to a sampled distance must be the uniform number.
                let mut sum = 0.0;
                let mut before = 0.0;
                for i in 1..=2000 {
                    let u = f64::from(i) / 2000.0;
                    let distance = spread.sample(u);
                    assert!(
                        distance >= before && distance <= f64::from(length),
                        "{length} {along}: {distance}"
                    );
                    let middle = spread.sample(u - 0.5 / 2000.0);
                    let densities =
                        spread.pdf(before) + 4.0 * spread.pdf(middle) + spread.pdf(distance);
                    sum += densities / 6.0 * (distance - before);
                    assert!((sum - u).abs() < 0.02, "{length} {along} {across}: {sum} of {u}");
                    before = distance;
                }
                assert_eq!((spread.pdf(-0.1), spread.pdf(101.0)), (0.0, 0.0));
            }
        }
    }

    #[test]
    fn nothing_is_shared_out_where_there_is_no_angle() {
        let segment = |length| Segment { origin: Vec3::ZERO, direction: Vec3::Z, length };
        let equiangular_light = |center, radius| EquiangularLight { center, radius };
        assert!(
            Equiangular::new(&segment(1.0), &equiangular_light(Vec3::Z * 0.5, 0.0), 1.0).is_none()
        );
        assert!(Equiangular::new(&segment(0.0), &equiangular_light(Vec3::X, 0.0), 1.0).is_none());
        assert!(
            Equiangular::new(
                &segment(1.0),
                &equiangular_light(Vec3::splat(f32::INFINITY), 0.0),
                1.0
            )
            .is_none()
        );
        assert!(
            Equiangular::new(&segment(f32::INFINITY), &equiangular_light(Vec3::X, 0.0), 0.0)
                .is_none()
        );
        assert!(
            Equiangular::new(&segment(1.0), &equiangular_light(Vec3::Z * 0.5, 0.1), 1.0).is_some()
        );
        assert!(
            Equiangular::new(&segment(1.0), &equiangular_light(Vec3::X * 3.0, 0.1), 1.0).is_none()
        );
    }
}
