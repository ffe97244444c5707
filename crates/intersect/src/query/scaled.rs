//! Rays with very long or very short directions, in double precision.
//!
//! Trees are in single precision, and have no use for distances that it cannot represent: such rays
//! would visit the whole tree. So their directions are scaled by powers of two, and the distances
//! of their hits are scaled back, which changes no other bit. (Filters get the ray as it is
//! searched, with a hit at the same place.)

use super::all::AllHits;
use crate::hit::DHit;
use crate::precision::Double;
use crate::search::rays::Rays;
use crate::world::double::DWorld;
use snell_math::DRay;
use snell_math::real;

/// Exponents of ordinary speeds: extents of the world per unit of the ray's parameter.
const ORDINARY: std::ops::Range<i32> = -40..40;

/// The rays of a batch, of which some were scaled.
pub(super) struct Scaled {
    pub rays: Vec<DRay>,
    factors: Vec<f64>,
}

impl DWorld {
    /// The batch with ordinary directions; `None` if it has none but these.
    #[inline]
    pub(super) fn scaled(&self, rays: &Rays<'_, Double>) -> Option<Scaled> {
        let all = rays.rays();
        all.iter().any(|ray| self.is_extreme(ray)).then(|| self.scale(all))
    }

    #[inline(always)]
    fn is_extreme(&self, ray: &DRay) -> bool {
        let [speed, scale] = self.exponents(ray);
        !ORDINARY.contains(&(speed + scale))
    }

    /// The exponents of the largest component of the direction, and of the scale of the world.
    #[inline(always)]
    fn exponents(&self, ray: &DRay) -> [i32; 2] {
        let speed = ray.direction.abs().max_element();
        [speed, self.data.frames[0].scale].map(|x| (x.to_bits() >> 52) as i32 - 1023)
    }

    /// The ray with an ordinary direction, and the factor of the direction; `None` if it is
    /// ordinary.
    #[inline]
    pub(super) fn scaled_one(&self, ray: &DRay) -> Option<(DRay, f64)> {
        self.is_extreme(ray).then(|| self.scale_one(ray))
    }

    #[cold]
    fn scale_one(&self, ray: &DRay) -> (DRay, f64) {
        let [speed, scale] = self.exponents(ray);
        let is_searched = ray.direction.is_finite() && self.is_extreme(ray);
        let exponent = if is_searched { -(speed + scale) } else { 0 };
        let factor = real::powi(2f64, exponent.clamp(-1000, 1000));
        let direction = ray.direction * factor;
        let [t_min, t_max] = [ray.t_min, ray.t_max].map(|t| t / factor);
        (DRay { direction, t_min, t_max, ..*ray }, factor)
    }

    #[cold]
    fn scale(&self, rays: &[DRay]) -> Scaled {
        let (rays, factors) = rays.iter().map(|ray| self.scale_one(ray)).unzip();
        Scaled { rays, factors }
    }
}

/// The hit of a ray whose direction was scaled by a factor.
pub(super) fn restored(hit: DHit, factor: f64) -> DHit {
    // Hits stay nearer than misses.
    let t = if hit.t.is_finite() { (hit.t * factor).clamp(f64::MIN, f64::MAX) } else { hit.t };
    DHit { t, ..hit }
}

impl Scaled {
    /// The scaled rays in place of those of the batch.
    pub fn of<'a>(&'a self, rays: Rays<'a, Double>) -> Rays<'a, Double> {
        rays.with_rays(&self.rays)
    }

    /// Scales the distance of the hit of each ray back.
    pub fn restore(&self, hits: &mut [DHit]) {
        for (hit, factor) in hits.iter_mut().zip(&self.factors) {
            *hit = restored(*hit, *factor);
        }
    }

    /// Scales the distances of all hits of each ray back.
    pub fn restore_all(&self, mut all: AllHits<Double>) -> AllHits<Double> {
        let AllHits { ray_splits, hits } = &mut all;
        for (range, factor) in ray_splits.windows(2).zip(&self.factors) {
            for hit in &mut hits[range[0]..range[1]] {
                *hit = restored(*hit, *factor);
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use crate::search::{AcceptAll, Grouping};
    use crate::{BuildOptions, DHit, DTriangleMesh, DWorld, DWorldBuilder};
    use snell_math::{DRay, DVec3};
    use std::sync::Arc;

    /// A wavy sheet of 8,192 triangles over the square from -1 to 1.
    fn sheet(size: f64) -> DWorld {
        const SIDE: u32 = 64;
        let place = |i: u32| f64::from(i) / f64::from(SIDE) * 2.0 - 1.0;
        let positions = (0..=SIDE).flat_map(|i| (0..=SIDE).map(move |j| [place(i), place(j)]));
        let positions =
            positions.map(|[x, y]| DVec3::new(x, y, (7.0 * x).sin() * y * 0.1) * size).collect();
        let indices = (0..SIDE * SIDE).flat_map(|cell| {
            let a = cell / SIDE * (SIDE + 1) + cell % SIDE;
            [[a, a + 1, a + SIDE + 1], [a + 1, a + SIDE + 2, a + SIDE + 1]]
        });
        let mesh = DTriangleMesh { positions, indices: indices.collect() };
        let mut builder = DWorldBuilder::default();
        builder.add_mesh(DWorldBuilder::ROOT, Arc::new(mesh));
        builder.build(&BuildOptions::default()).expect("a world")
    }

    fn rays(size: f64, length: f64) -> Vec<DRay> {
        let number = |i: u32, k: f64| (f64::from(i) * k).sin();
        let ray = |i: u32| DRay {
            origin: DVec3::new(number(i, 1.3), number(i, 2.7), 2.0) * size,
            direction: DVec3::new(number(i, 3.1) * 0.2, number(i, 4.9) * 0.2, -1.0) * length,
            t_min: 0.5 * size / length,
            t_max: if i.is_multiple_of(5) { size / length } else { f64::INFINITY },
        };
        (0..200).map(ray).collect()
    }

    #[test]
    fn directions_of_any_length_find_the_same_hits_as_fast() {
        // Powers of two, with which every digit of a ray is scaled exactly.
        for (size, length) in [
            (1.0, 2f64.powi(70)),
            (1.0, 2f64.powi(-70)),
            (1.0, 2f64.powi(-400)),
            (2f64.powi(-90), 1.0),
            (2f64.powi(90), 1.0),
            (2f64.powi(-60), 2f64.powi(60)),
        ] {
            let (plain, world) = (sheet(1.0), sheet(size));
            let (unit, far) = (rays(1.0, 1.0), rays(size, length));
            let factor = size / length;
            let scaled = |hit: &DHit| DHit { t: hit.t * factor, ..*hit };
            let all = [Grouping::None, Grouping::Coherent];
            for grouping in all {
                let [mut expected, mut found] = [[DHit::MISS; 200]; 2];
                plain.closest(&unit, grouping, &AcceptAll, &mut expected);
                world.closest(&far, grouping, &AcceptAll, &mut found);
                assert_eq!(found, expected.map(|hit| scaled(&hit)), "{size} {length}");
                assert!(expected.iter().any(|h| h.t < 9.0) && expected.iter().any(|h| h.t > 9.0));
                let [mut shaded, mut blocked] = [[false; 200]; 2];
                plain.occluded(&unit, grouping, &AcceptAll, &mut shaded);
                world.occluded(&far, grouping, &AcceptAll, &mut blocked);
                assert_eq!(shaded, blocked);
            }
            let expected = plain.all(&unit, &AcceptAll);
            let found = world.all(&far, &AcceptAll);
            assert_eq!(found.ray_splits, expected.ray_splits);
            assert_eq!(found.hits, expected.hits.iter().map(scaled).collect::<Vec<_>>());
            assert_eq!(
                world.first(&far, &AcceptAll, 1).hits,
                plain.first(&unit, &AcceptAll, 1).hits.iter().map(scaled).collect::<Vec<_>>()
            );
            let mut total = 0;
            for (ray, expected) in far.iter().zip(&unit) {
                let (hit, counters) = world.closest_counted(ray, &AcceptAll);
                assert_eq!(hit, scaled(&plain.closest_one(expected, &AcceptAll)));
                assert_eq!(hit, world.closest_one(ray, &AcceptAll));
                assert_eq!(
                    world.occluded_one(ray, &AcceptAll),
                    plain.occluded_one(expected, &AcceptAll)
                );
                total += counters.primitives_tested;
            }
            assert!(total < 200 * 100, "{total} triangles of 200 rays");
        }
    }
}
