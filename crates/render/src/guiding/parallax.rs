//! Parallax: the direction to a light depends on the position in a region. A lamp, or its image in
//! a lens, is at one point of space, so directions are stored as seen from one point of the region
//! and reprojected for all other points (Ruppert, Herholz and Lensch, Robust fitting of
//! parallax-aware mixtures for path guiding, 2020). That paper takes the distance from the first
//! hit. Behind glass the light is farther away than the first hit, and an image may even lie behind
//! the viewer. This module therefore estimates the distance from the directions themselves.

use super::directional::square_from_direction;
use super::record::Record;
use snell_math::Vec3;
use snell_math::real;
use snell_math::simd::max;

/// The largest length of a shift of a unit direction.
const MOST: f32 = 0.8;
/// Cells along each side of the square of directions.
const SIDE: usize = 64;
/// The number of distances that are tried on either side of the surface, each larger than the last
/// by a factor of the square root of 2.
const DISTANCES: i32 = 10;
/// The smallest number of records for an estimate, and the largest number that is used.
const RECORDS: std::ops::RangeInclusive<usize> = 32..=1024;
/// A distance is accepted only if its [`togetherness`](Parallax::togetherness) is more than this
/// many times that of infinite distance, plus [`NOISE`].
const LEAST_GAIN: f32 = 1.2;
/// The margin added to that threshold so that chance does not pass it, in units of the sum of the
/// squared light of all records.
const NOISE: f32 = 0.1;

/// How the directions to the light change within a region.
#[derive(Clone, Copy, Debug, Default)]
pub struct Parallax {
    /// The point from which the stored directions are seen.
    anchor: Vec3,
    /// The reciprocal of the distance of the light; negative for images behind the lit surface.
    nearness: f32,
}

impl Parallax {
    /// The parallax that concentrates the recorded directions most. Without parallax, if there are
    /// too few records or no distance concentrates the directions enough.
    pub fn of(records: &[Record]) -> Self {
        if records.len() < *RECORDS.start() {
            return Self::default();
        }
        let step = records.len().div_ceil(*RECORDS.end());
        let records: Vec<Record> = records.iter().step_by(step).copied().collect();
        let anchor = records.iter().map(|r| r.position).sum::<Vec3>() / records.len() as f32;
        let extent = records.iter().map(|r| r.position.distance(anchor)).fold(0.0, f32::max);
        let most_near = MOST / extent;
        if !most_near.is_finite() {
            return Self::default();
        }
        let none = Self { anchor, nearness: 0.0 };
        let alone: f32 = records.iter().map(|r| r.light * r.light).sum();
        let (mut best, mut most) = (none, LEAST_GAIN * none.togetherness(&records) + NOISE * alone);
        for step in 0..DISTANCES {
            for side in [1.0, -1.0] {
                let tried = Self {
                    nearness: side * most_near * real::powf(0.5f32, step as f32 * 0.5),
                    ..none
                };
                let found = tried.togetherness(&records);
                if found > most {
                    (best, most) = (tried, found);
                }
            }
        }
        best
    }

    /// The anchor, from which the stored directions are seen, and the reciprocal of the distance.
    #[inline(always)]
    pub fn parts(self) -> (Vec3, f32) {
        (self.anchor, self.nearness)
    }

    /// The parallax with these [parts](Self::parts).
    #[inline(always)]
    pub fn from_parts(anchor: Vec3, nearness: f32) -> Self {
        Self { anchor, nearness }
    }

    /// How concentrated directions are: the sum of the products of light over all pairs of records
    /// in the same cell of the square.
    fn togetherness(self, records: &[Record]) -> f32 {
        let mut cells = vec![0.0f32; SIDE * SIDE];
        let mut alone = 0.0;
        for &Record { position, direction, light, .. } in records {
            let square =
                square_from_direction(from_anchor(direction, self.shift(position)).0) * SIDE as f32;
            cells[square.y as usize * SIDE + square.x as usize] += light;
            alone += light * light;
        }
        cells.iter().map(|light| light * light).sum::<f32>() - alone
    }

    /// The shift that turns unit directions seen from `position` into directions seen from the
    /// anchor, for [`from_anchor`] and [`to_place`].
    #[inline(always)]
    pub fn shift(self, position: Vec3) -> Vec3 {
        let shift = (position - self.anchor) * self.nearness;
        shift * (MOST / max(shift.length(), MOST))
    }
}

/// The unit direction as seen from the anchor, and the ratio of the solid angle there to the solid
/// angle at the point.
#[inline(always)]
pub fn from_anchor(direction: Vec3, shift: Vec3) -> (Vec3, f32) {
    let moved = direction + shift;
    let inverse = 1.0 / moved.length();
    (moved * inverse, direction.dot(moved) * (inverse * inverse * inverse))
}

/// The inverse of [`from_anchor`]: the unit direction as seen from the point.
#[inline(always)]
pub fn to_place(direction: Vec3, shift: Vec3) -> Vec3 {
    let along = direction.dot(shift);
    let length = along + (along * along + (1.0 - shift.length_squared())).sqrt();
    let back = direction * length - shift;
    back * (1.0 / back.length())
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng::uniform2;
    use snell_math::sampling::uniform_sphere;

    fn cube(i: u32, key: u32) -> Vec3 {
        let [a, b] = [0, 1].map(|k| uniform2([i, key, k, 5]));
        Vec3::new(a.x, a.y, b.x) * 2.0 - 1.0
    }

    #[test]
    fn directions_are_turned_and_turned_back() {
        for i in 0..10_000 {
            let parallax = Parallax {
                anchor: Vec3::new(1.0, 2.0, 3.0),
                nearness: if i % 2 == 0 { 0.4 } else { -0.9 },
            };
            let shift = parallax.shift(cube(i, 1));
            let direction = uniform_sphere(uniform2([i, 2, 3, 4]));
            let (seen, _) = from_anchor(direction, shift);
            assert!((seen.length() - 1.0).abs() < 1e-6);
            assert!((to_place(seen, shift) - direction).length() < 1e-6, "{direction} {shift}");
        }
    }

    /// Compares the ratio of solid angles with that of a small square.
    #[test]
    fn solid_angles_grow_as_stated() {
        const SIDE: f32 = 0.01;
        for i in 0..1000 {
            let shift = cube(i, 6) * 0.45;
            let direction = uniform_sphere(uniform2([i, 7, 8, 9]));
            let (x, y) = direction.any_orthonormal_pair();
            let seen = |x: Vec3| from_anchor(x.normalize(), shift).0;
            let side = |axis: Vec3| {
                seen(direction + axis * (SIDE / 2.0)) - seen(direction - axis * (SIDE / 2.0))
            };
            let found = side(x).cross(side(y)).length() / (SIDE * SIDE);
            let (_, larger) = from_anchor(direction, shift);
            assert!((found / larger - 1.0).abs() < 0.005, "{found} {larger}");
        }
    }

    fn arrived(position: Vec3, direction: Vec3) -> Record {
        Record { position, normal: Vec3::Z, direction, light: 1.0, found: 0.0, bsdf_share: 0.0 }
    }

    /// The distance of a small lamp must be found, also of an image behind the surface; light from
    /// everywhere must give no parallax.
    #[test]
    fn the_distance_of_a_light_is_found() {
        for distance in [2.0f32, 5.0, -3.0] {
            let axis = Vec3::new(0.2, 0.3, 0.93).normalize();
            let image = axis * distance;
            let records: Vec<Record> = (0..400)
                .map(|i| {
                    let position = cube(i, 3) * Vec3::new(0.5, 0.5, 0.0);
                    let toward = (image - position) * distance.signum();
                    let direction = match i % 3 {
                        0 => uniform_sphere(uniform2([i, 4, 4, 4])),
                        _ => toward.normalize(),
                    };
                    arrived(position, direction)
                })
                .collect();
            let found = 1.0 / Parallax::of(&records).nearness;
            assert!((found / distance - 1.0).abs() < 0.3, "{found} instead of {distance}");
        }
        let everywhere: Vec<Record> =
            (0..400).map(|i| arrived(cube(i, 3), uniform_sphere(uniform2([i, 4, 4, 4])))).collect();
        assert_eq!(Parallax::of(&everywhere).nearness, 0.0);
        assert_eq!(Parallax::of(&[]).nearness, 0.0);
    }
}
