//! Points of photons in media: what light that comes from casters brings to a medium that scatters
//! it.
//!
//! On each stretch of its way through such a medium a photon leaves points, each with the photon's
//! power there times the length for which it stands. Their density in space is that of the fluence,
//! so a path that the medium scatters gathers those nearby with the phase function. The number of
//! points does not depend on how dense the medium is: thin fog has as many as thick.
//!
//! The way goes on behind the surfaces at its ends, by about the radius within which points are
//! gathered: at a wall, half of the ball around a point would be empty otherwise, and the medium
//! dark. Points know their medium, so what is behind the wall does not gather them.

use super::map::Landed;
use super::shoot::{Photon, Shooter};
use crate::volume::{Insides, Numbers, ScatteringMedium, Walker, length_to};
use snell_intersect::Hit;

/// The points on a stretch of a photon's way, and the largest number of all of a photon that are
/// kept.
const POINTS: u32 = 2;
const MOST_POINTS: usize = 2;
/// The least cosine with a surface by which ways go on behind it.
const LEAST_COS: f32 = 0.5;
/// The length over which points have about the same density, where there is no mean free path, in
/// radii of the scene.
const EVEN: f32 = 2.0;

/// The cosines of a way with the surfaces at its ends; `None` where there is none.
#[derive(Clone, Copy, Debug)]
pub struct Ends {
    pub begin: Option<f32>,
    pub end: Option<f32>,
}

impl Shooter<'_> {
    /// Leaves points of a photon on its way up to a hit through a medium. `u` places them.
    pub(super) fn leave_points(
        &self,
        walker: &Walker,
        medium: ScatteringMedium,
        (photon, insides, hit, ends): (&Photon, &Insides, &Hit, Ends),
        u: f32,
        numbers: &mut Numbers,
        points: &mut Vec<Landed>,
    ) {
        let state = &photon.state;
        let beyond = |cos: Option<f32>| cos.map_or(0.0, |cos| self.reach / cos.max(LEAST_COS));
        let (before, length) = (beyond(ends.begin), length_to(&photon.ray, hit));
        let most = EVEN * self.caustics.scene.radius;
        let even = medium.extinction.map_or(most, |extinction| most.min(1.0 / extinction));
        for i in 0..POINTS {
            let u = (i as f32 + u) / POINTS as f32;
            let (place, density) = place_on(before + length + beyond(ends.end), even, u);
            let distance = place - before;
            let ray = photon.ray.with_t_max(distance.clamp(0.0, length));
            let left = walker.attenuate(
                &self.own,
                insides,
                &ray,
                &Hit::MISS,
                state.throughput,
                state.mode,
                || numbers.next(),
            );
            let flux = left * (1.0 / (density * POINTS as f32));
            let position = photon.ray.at(distance);
            if flux.is_black() || !flux.is_finite() || !position.is_finite() {
                continue;
            }
            points.push(Landed {
                position,
                direction: -photon.ray.direction,
                bounces: photon.bounces,
                flux,
                hue: photon.hue,
                time: state.time,
                source: photon.source,
                medium: medium.tag,
            });
        }
    }
}

/// A place on a way, which may be infinitely long, and its density per length. It is about even
/// over the length `even` and falls with the square of the distance afterwards; times the
/// transmittance of a medium of that mean free path, its inverse is at most 1.5 times as large as
/// at the begin.
fn place_on(length: f32, even: f32, u: f32) -> (f32, f32) {
    let share = if length.is_finite() { length / (even + length) } else { 1.0 };
    let part = u * share;
    let place = (even * part / (1.0 - part)).min(length);
    let sum = even + place;
    (place, even / (sum * sum * share))
}

/// Chooses from the points from index `first` on, those of one photon, if there are more than are
/// kept. Those that stay stand for all.
pub fn choose(points: &mut Vec<Landed>, first: usize, u: f32) {
    let count = points.len() - first;
    if count <= MOST_POINTS {
        return;
    }
    let stretch = count as f32 / MOST_POINTS as f32;
    for i in 0..MOST_POINTS {
        // (No point before this index is read again.)
        let from = (((i as f32 + u) * stretch) as usize).min(count - 1);
        points[first + i] = points[first + from];
        points[first + i].flux *= stretch;
    }
    points.truncate(first + MOST_POINTS);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_have_the_density_that_they_say() {
        const N: u32 = 100_000;
        for (length, even) in [(3.0, 1e3), (3.0, 0.5), (f32::INFINITY, 2.0), (1e-3, 1.0)] {
            // The length of the way up to each of some ends, by places divided by their density.
            for end in [0.1, 0.5, 1.0].map(|x| x * length.min(10.0)) {
                let each = |i: u32| place_on(length, even, (i as f32 + 0.5) / N as f32);
                let sum: f64 = (0..N)
                    .map(each)
                    .filter(|(place, _)| *place <= end)
                    .map(|(_, density)| 1.0 / f64::from(density))
                    .sum();
                let found = sum / f64::from(N) / f64::from(end);
                assert!((found - 1.0).abs() < 2e-3, "{length} {even} {end}: {found}");
            }
        }
    }

    #[test]
    fn chosen_points_stand_for_all() {
        use crate::integrator::light_part::LightSource;
        use snell_math::{SampledSpectrum, Vec3};
        let point = |i: usize| Landed {
            position: Vec3::splat(i as f32),
            direction: Vec3::Z,
            bounces: 1,
            flux: SampledSpectrum::ONE,
            hue: 0.0,
            time: 0.0,
            source: LightSource::Medium,
            medium: 0,
        };
        for count in 1..9 {
            const N: u32 = 1000;
            let mut mean = vec![0.0; count];
            for i in 0..N {
                let mut points: Vec<Landed> = (0..count + 3).map(point).collect();
                choose(&mut points, 3, (i as f32 + 0.5) / N as f32);
                assert_eq!(points.len(), 3 + count.min(MOST_POINTS));
                for point in &points[3..] {
                    mean[point.position.x as usize - 3] += point.flux[0] / N as f32;
                }
            }
            assert!(mean.iter().all(|mean| (mean - 1.0).abs() < 0.01), "{mean:?}");
        }
    }
}
