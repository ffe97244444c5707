//! Travel in closed form through media whose density along a ray is constant or exponential.
//!
//! Distances are sampled for one lane, which is chosen in proportion to the path's throughput in
//! the lane, and weighted by the density of all lanes together. This is the balance heuristic over
//! lanes (Miller, Georgiev and Jarosz, A Null-Scattering Path Integral Formulation of Light
//! Transport, SIGGRAPH 2019, section 5.2), with the history of the path in the choice (Wilkie et
//! al., Hero Wavelength Spectral Sampling, EGSR 2014). The sum of the throughput's lanes then never
//! grows.

use super::equiangular::{Equiangular, EquiangularLight};
use super::{MediumProperties, Scattering, Segment, Travel};
use snell_math::exponentials::{exp, ln};
use snell_math::{SampledSpectrum, Vec2, real};

/// Density along a segment: `density * exp(-slope * distance)`. It is a factor on the medium's
/// coefficients.
#[derive(Clone, Copy, Debug)]
pub struct Profile {
    /// The density at the start of the segment.
    pub density: f64,
    /// Relative decrease of the density per scene unit; negative if the density grows.
    pub slope: f64,
}

impl Profile {
    /// A constant density of 1.
    pub const CONSTANT: Self = Self { density: 1.0, slope: 0.0 };

    /// The column of a distance: the integral of the density from the start of the segment up to
    /// it.
    fn column(&self, distance: f64) -> f64 {
        let x = self.slope * distance;
        if self.density == 0.0 {
            0.0
        } else if x.abs() < 1e-9 || x.is_nan() {
            self.density * distance
        } else {
            self.density * -real::exp_m1(-x) / self.slope
        }
    }

    /// The distance with this column. Some distance must have a larger column.
    fn distance(&self, column: f64) -> f64 {
        let plain = column / self.density;
        let x = self.slope * plain;
        if x.abs() < 1e-9 { plain } else { -real::ln_1p(-x) / self.slope }
    }
}

/// `exp(-sigma * column)`, also for zero extinction over an infinite distance.
#[inline(always)]
pub fn transmittance_of(sigma: f32, column: f64) -> f32 {
    let through = exp(-f64::from(sigma) * column) as f32;
    if sigma == 0.0 { 1.0 } else { through }
}

/// The transmittance of a column in each lane.
fn transmittance(sigma_t: SampledSpectrum, column: f64) -> SampledSpectrum {
    // Most media have the same extinction in all lanes.
    let (first, of_first) = (sigma_t[0], transmittance_of(sigma_t[0], column));
    sigma_t.map(|sigma| if sigma == first { of_first } else { transmittance_of(sigma, column) })
}

/// The integral of the transmittance over the column, which is what an emission of 1 per unit of
/// length adds up to. 0 for an infinite distance without extinction, where the integral would be
/// infinite.
fn integrated_transmittance(sigma_t: SampledSpectrum, column: f64) -> SampledSpectrum {
    sigma_t.map(|sigma| {
        let sigma = f64::from(sigma);
        let depth = sigma * column;
        let sum = if depth < 1e-6 || sigma == 0.0 { column } else { -real::exp_m1(-depth) / sigma };
        if sum.is_finite() { sum as f32 } else { 0.0 }
    })
}

/// The value of a light ray at the end of a segment of this length.
pub fn attenuate(
    medium: &MediumProperties,
    profile: Profile,
    length: f32,
    value: SampledSpectrum,
) -> SampledSpectrum {
    value * transmittance(medium.sigma_t(), profile.column(f64::from(length)))
}

/// Moves a path along a segment. `u` is in `[0, 1)^2`: `x` chooses the distance, `y` the lane.
pub fn travel(
    medium: &MediumProperties,
    profile: Profile,
    segment: &Segment,
    throughput: SampledSpectrum,
    u: Vec2,
) -> Travel {
    let sigma_t = medium.sigma_t();
    let whole = profile.column(f64::from(segment.length));
    let emitted = if medium.emission.is_black() {
        SampledSpectrum::ZERO
    } else {
        throughput * medium.emission * integrated_transmittance(sigma_t, whole)
    };
    let passed = |by_lane: SampledSpectrum| Travel {
        throughput: throughput * by_lane,
        emitted,
        scattered: None,
    };
    let sum: f32 = throughput.0.iter().sum();
    if medium.sigma_s.is_black() || !(sum > 0.0 && sum.is_finite()) {
        return passed(transmittance(sigma_t, whole));
    }
    let sigma = f64::from(sigma_t[chosen_lane(throughput, sum, u.y)]);
    let column = -ln(1.0 - f64::from(u.x)) / sigma;
    // The mean over the lanes, weighted by the throughput.
    let mean = |by_lane: SampledSpectrum| (throughput * by_lane).0.iter().sum::<f32>() / sum;
    // This case comes first, because in a clear lane 0 / 0 may be undefined.
    if column.is_nan() || column >= whole {
        let through = transmittance(sigma_t, whole);
        return passed(through * (1.0 / mean(through)));
    }
    let through = transmittance(sigma_t, column);
    let distance = (profile.distance(column) as f32).min(segment.length);
    let weight = medium.sigma_s * through * (1.0 / mean(sigma_t * through));
    let scattered = Some(Scattering { distance, phase: medium.phase });
    Travel { throughput: throughput * weight, emitted, scattered }
}

/// Does what [`travel`] does through a homogeneous medium, with the same probability of scattering,
/// but samples half of the distances near a light. The density is that of both strategies together
/// (balance heuristic), so no weight is more than doubled.
pub fn travel_near(
    medium: &MediumProperties,
    equiangular_light: &EquiangularLight,
    segment: &Segment,
    throughput: SampledSpectrum,
    u: Vec2,
) -> Travel {
    let alone = travel(medium, Profile::CONSTANT, segment, throughput, u);
    if alone.scattered.is_none() {
        return alone;
    }
    let sigma_t = medium.sigma_t();
    let (length, sum) = (f64::from(segment.length), throughput.0.iter().sum::<f32>());
    let thinnest = sigma_t.0.into_iter().filter(|&sigma| sigma > 0.0).fold(f32::INFINITY, f32::min);
    let Some(near) = Equiangular::new(segment, equiangular_light, thinnest.into()) else {
        return alone;
    };
    let scattered_share =
        |sigma: f32| if sigma == 0.0 { 0.0 } else { -real::exp_m1(-f64::from(sigma) * length) };
    let sigma = sigma_t[chosen_lane(throughput, sum, u.y)];
    // What remains of the number that has decided on scattering.
    let left = (2.0 * f64::from(u.x) / scattered_share(sigma)).min(2.0);
    let distance = match left < 1.0 {
        true => near.sample(left),
        false => -real::ln_1p(-(left - 1.0) * scattered_share(sigma)) / f64::from(sigma),
    };
    let distance = distance.min(length);
    let through = transmittance(sigma_t, distance);
    let mean = |by_lane: SampledSpectrum| (throughput * by_lane).0.iter().sum::<f32>() / sum;
    let near_pdf =
        near.pdf(distance) as f32 * mean(sigma_t.map(|sigma| scattered_share(sigma) as f32));
    let weight = medium.sigma_s * through * (2.0 / (mean(sigma_t * through) + near_pdf));
    let scattered = Some(Scattering { distance: distance as f32, phase: medium.phase });
    Travel { throughput: throughput * weight, scattered, ..alone }
}

/// A lane, chosen in proportion to the throughput. A lane without throughput is never chosen.
fn chosen_lane(throughput: SampledSpectrum, sum: f32, u: f32) -> usize {
    let mut rest = u * sum;
    let mut chosen = 0;
    for (lane, &share) in throughput.0.iter().enumerate() {
        if share > 0.0 {
            chosen = lane;
            if rest < share {
                break;
            }
            rest -= share;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::HenyeyGreenstein;
    use snell_math::{Vec3, rng};

    fn medium(sigma_a: [f32; 3], sigma_s: [f32; 3]) -> MediumProperties {
        let lanes = |[r, g, b]: [f32; 3]| SampledSpectrum([r, g, b, 0.0]);
        let emission = SampledSpectrum([1.0, 2.0, 3.0, 0.0]);
        MediumProperties {
            sigma_a: lanes(sigma_a),
            sigma_s: lanes(sigma_s),
            emission,
            phase: HenyeyGreenstein::new(0.0),
        }
    }

    const UNIT: SampledSpectrum = SampledSpectrum([1.0, 1.0, 1.0, 0.0]);

    fn segment(length: f32) -> Segment {
        Segment { origin: Vec3::ZERO, direction: Vec3::Z, length }
    }

    #[test]
    fn absorption_is_that_of_lambert_and_beer_without_noise() {
        let medium = medium([0.5, 1.0, 0.0], [0.0; 3]);
        let travel = travel(&medium, Profile::CONSTANT, &segment(2.0), UNIT, Vec2::splat(0.7));
        let expected = [(-1.0f32).exp(), (-2.0f32).exp(), 1.0, 0.0];
        assert!(travel.scattered.is_none());
        for (a, b) in travel.throughput.0.into_iter().zip(expected) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        // In a clear lane emission adds up along the segment, elsewhere to (1 - T) / sigma.
        assert!(
            (travel.emitted[2] - 6.0).abs() < 1e-5
                && (travel.emitted[1] - 2.0 * (1.0 - (-2.0f32).exp())).abs() < 1e-5
        );
    }

    #[test]
    fn chromatic_paths_have_the_right_mean_and_their_weight_never_grows() {
        let profiles = [
            Profile::CONSTANT,
            Profile { density: 0.7, slope: 0.4 },
            Profile { density: 0.3, slope: -0.5 },
        ];
        for (key, profile) in profiles.into_iter().enumerate() {
            let medium = medium([0.1, 0.0, 0.6], [0.3, 2.0, 0.2]);
            let beta = SampledSpectrum([1.0, 0.2, 0.6, 0.0]);
            let n = 40_000;
            let (mut passed, mut scattered) = ([0.0f64; 3], [0.0f64; 3]);
            for i in 0..n {
                let u = rng::uniform2([i, key as u32, 0, 5]);
                let travel = travel(&medium, profile, &segment(1.5), beta, u);
                assert!(
                    travel.throughput.0.iter().sum::<f32>() <= 1.8 * 1.0001,
                    "{:?}",
                    travel.throughput
                );
                let sums = if travel.scattered.is_some() { &mut scattered } else { &mut passed };
                (0..3).for_each(|c| sums[c] += f64::from(travel.throughput[c]) / f64::from(n));
            }
            for c in 0..3 {
                let sigma_t = f64::from(medium.sigma_t()[c]);
                let left = (-sigma_t * profile.column(1.5)).exp();
                let (b, albedo) = (f64::from(beta[c]), f64::from(medium.sigma_s[c]) / sigma_t);
                assert!(
                    (passed[c] - b * left).abs() < 0.015,
                    "lane {c}: {} {}",
                    passed[c],
                    b * left
                );
                let expected = b * albedo * (1.0 - left);
                assert!(
                    (scattered[c] - expected).abs() < 0.015,
                    "lane {c}: {} {expected}",
                    scattered[c]
                );
            }
        }
    }

    #[test]
    fn distances_near_a_light_have_the_same_mean_and_less_noise() {
        let medium = medium([0.1, 0.0, 0.6], [0.3, 0.2, 0.1]);
        let beta = SampledSpectrum([1.0, 0.2, 0.6, 0.0]);
        for (key, (along, across)) in
            [(2.0, 0.05), (0.5, 0.3), (-0.5, 0.2), (6.0, 0.5)].into_iter().enumerate()
        {
            let equiangular_light =
                EquiangularLight { center: Vec3::new(across, 0.0, along), radius: 0.0 };
            for length in [4.0, f32::INFINITY] {
                // The contribution of a light at the end, and the transmitted part.
                let brought = |travel: Travel| {
                    let light = travel.scattered.map(|s| {
                        1.0 / (segment(length).at(s.distance) - equiangular_light.center)
                            .length_squared()
                    });
                    travel.throughput.0.map(|beta| f64::from(beta * light.unwrap_or(1e-3)))
                };
                let n = 100_000;
                let statistics = |travel: &dyn Fn(Vec2) -> Travel| {
                    let mut sums = [[0.0; 2]; 3];
                    for i in 0..n {
                        let brought = brought(travel(rng::uniform2([i, key as u32, 0, 5])));
                        (0..3).for_each(|c| {
                            (0..2).for_each(|k| sums[c][k] += brought[c].powi(k as i32 + 1))
                        });
                    }
                    sums.map(|[sum, squares]| {
                        let mean = sum / f64::from(n);
                        (mean, squares / f64::from(n) - mean * mean)
                    })
                };
                let alone =
                    statistics(&|u| travel(&medium, Profile::CONSTANT, &segment(length), beta, u));
                let near = statistics(&|u| {
                    travel_near(&medium, &equiangular_light, &segment(length), beta, u)
                });
                for c in 0..3 {
                    let ((a, noise_a), (b, noise_b)) = (alone[c], near[c]);
                    let error = ((noise_a + noise_b) / f64::from(n)).sqrt();
                    assert!(
                        (a - b).abs() < 4.0 * error + 1e-6,
                        "{along} {length}, lane {c}: {a} {b} +- {error}"
                    );
                    let gain = if key == 0 { 5.0 } else { 0.45 };
                    assert!(
                        noise_b * gain < noise_a,
                        "{along} {length}, lane {c}: {noise_a} {noise_b}"
                    );
                }
            }
        }
    }

    #[test]
    fn weights_near_a_light_are_at_most_doubled_and_what_passes_is_the_same() {
        let medium = medium([0.1, 0.0, 0.6], [0.3, 2.0, 0.2]);
        let equiangular_light = EquiangularLight { center: Vec3::new(0.1, 0.2, 0.7), radius: 0.05 };
        let beta = SampledSpectrum([1.0, 0.2, 0.6, 0.0]);
        for i in 0..5000 {
            let u = rng::uniform2([i, 3, 0, 5]);
            let near = travel_near(&medium, &equiangular_light, &segment(1.5), beta, u);
            assert!(
                near.throughput.0.iter().sum::<f32>() <= 2.0 * 1.8 * 1.0001,
                "{:?}",
                near.throughput
            );
            let alone = travel(&medium, Profile::CONSTANT, &segment(1.5), beta, u);
            assert_eq!(
                (near.emitted, near.scattered.is_some()),
                (alone.emitted, alone.scattered.is_some())
            );
            if near.scattered.is_none() {
                assert_eq!(near.throughput, alone.throughput);
            }
        }
    }

    #[test]
    fn columns_and_distances_are_inverse() {
        for slope in [-3.0, -1e-4, 0.0, 1e-12, 0.2, 5.0] {
            let profile = Profile { density: 2.0, slope };
            for distance in [1e-6, 0.1, 1.0, 4.0] {
                let back = profile.distance(profile.column(distance));
                assert!(
                    (back - distance).abs() < 1e-6 * distance.max(1e-3),
                    "slope {slope}: {distance} {back}"
                );
            }
        }
    }

    #[test]
    fn infinite_ways_and_clear_lanes_stay_finite() {
        for length in [0.0, 1e-30, 1e30, f32::INFINITY] {
            for (sigma_a, sigma_s) in [
                ([0.0; 3], [0.0; 3]),
                ([1e9, 0.0, 0.0], [0.0, 1e9, 0.0]),
                ([0.0; 3], [1e-30, 0.0, 1.0]),
            ] {
                for u in [0.0, 0.5, rng::ONE_MINUS_EPSILON] {
                    let travel = travel(
                        &medium(sigma_a, sigma_s),
                        Profile::CONSTANT,
                        &segment(length),
                        UNIT,
                        Vec2::splat(u),
                    );
                    assert!(
                        travel.throughput.is_finite() && travel.emitted.is_finite(),
                        "{length} {sigma_s:?} {travel:?}"
                    );
                    assert!(
                        travel
                            .scattered
                            .is_none_or(|s| s.distance <= length && s.distance.is_finite())
                    );
                }
            }
        }
    }
}
