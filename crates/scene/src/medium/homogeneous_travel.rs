//! Travel through homogeneous media that do not emit, in linear RGB. The results have the same bits
//! as those of [`super::MediumProperties::travel`], but the code has no branches, so that loops
//! over it are vectorised.

use super::analytic::transmittance_of;
use snell_math::Vec2;
use snell_math::exponentials::ln;
use snell_math::simd::min;

/// What happened to a path along a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomogeneousTravel {
    /// See [`super::Travel::throughput`].
    pub throughput: [f32; 3],
    /// The distance at which the path was scattered; undefined if it was not.
    pub distance: f32,
    /// True if the path was scattered before the end of the segment.
    pub is_scattered: bool,
}

/// Moves a path along a segment of this length, through a medium with this extinction and
/// scattering. `u` is that of [`super::MediumProperties::travel`].
#[inline(always)]
pub fn travel_homogeneous(
    sigma_t: [f32; 3],
    sigma_s: [f32; 3],
    length: f32,
    throughput: [f32; 3],
    u: Vec2,
) -> HomogeneousTravel {
    let sum = throughput[0] + throughput[1] + throughput[2];
    // The channel is chosen in proportion to the throughput.
    let (mut rest, mut sigma, mut is_chosen) = (u.y * sum, sigma_t[0], false);
    for channel in 0..3 {
        let share = throughput[channel];
        let may_be = (share > 0.0) & !is_chosen;
        sigma = if may_be { sigma_t[channel] } else { sigma };
        is_chosen |= may_be & (rest < share);
        rest = if may_be & !is_chosen { rest - share } else { rest };
    }
    let whole = f64::from(length);
    let column = -ln(1.0 - f64::from(u.x)) / f64::from(sigma);
    let scatters = (sigma_s[0] != 0.0) | (sigma_s[1] != 0.0) | (sigma_s[2] != 0.0);
    let is_weighted = scatters & (sum > 0.0) & (sum < f32::INFINITY);
    let is_scattered = is_weighted & (column < whole);
    let end = if is_scattered { column } else { whole };
    let (mut through, mut seen) = ([0.0; 3], [0.0; 3]);
    for channel in 0..3 {
        through[channel] = transmittance_of(sigma_t[channel], end);
        let density = sigma_t[channel] * through[channel];
        seen[channel] = throughput[channel] * if is_scattered { density } else { through[channel] };
    }
    let mean = (seen[0] + seen[1] + seen[2]) / sum;
    let scale = if is_weighted { 1.0 / mean } else { 1.0 };
    let mut left = [0.0; 3];
    for channel in 0..3 {
        let scattered = sigma_s[channel] * through[channel];
        left[channel] = throughput[channel]
            * ((if is_scattered { scattered } else { through[channel] }) * scale);
    }
    HomogeneousTravel { throughput: left, distance: min(column as f32, length), is_scattered }
}

/// The value of a light ray after a segment of this length through a medium with this extinction.
#[inline(always)]
pub fn attenuate_homogeneous(sigma_t: [f32; 3], length: f32, value: [f32; 3]) -> [f32; 3] {
    let mut left = [0.0; 3];
    for channel in 0..3 {
        left[channel] = value[channel] * transmittance_of(sigma_t[channel], f64::from(length));
    }
    left
}

#[cfg(test)]
mod tests {
    use super::super::{HenyeyGreenstein, MediumProperties, Segment};
    use super::*;
    use snell_math::{SampledSpectrum, Vec3, rng};

    #[test]
    fn travel_without_branches_gives_the_same_bits() {
        let lanes = |[r, g, b]: [f32; 3]| SampledSpectrum([r, g, b, 0.0]);
        for i in 0..30_000 {
            let number = |k: u32| rng::uniform2([i, k, 2, 7]).x;
            let some = |k: u32| if number(k + 20) < 0.2 { 0.0 } else { number(k) * 3.0 };
            let colors = |k: u32| [some(k), some(k + 1), some(k + 2)];
            let (sigma_a, sigma_s, throughput) = (colors(0), colors(3), colors(6));
            let length = if i % 20 == 0 { f32::INFINITY } else { number(9) * 2.0 };
            let medium = MediumProperties {
                sigma_a: lanes(sigma_a),
                sigma_s: lanes(sigma_s),
                emission: SampledSpectrum::ZERO,
                phase: HenyeyGreenstein::new(0.0),
            };
            let [r, g, b, _] = medium.sigma_t().0;
            let u = rng::uniform2([i, 8, 8, 8]);
            let segment = Segment { origin: Vec3::ZERO, direction: Vec3::Z, length };
            let one = medium.travel(&segment, lanes(throughput), u);
            let travel = travel_homogeneous([r, g, b], sigma_s, length, throughput, u);
            assert_eq!(
                lanes(travel.throughput),
                one.throughput,
                "{i} {medium:?} {length} {throughput:?}"
            );
            assert_eq!(
                travel.is_scattered.then_some(travel.distance),
                one.scattered.map(|s| s.distance)
            );
            let left = attenuate_homogeneous([r, g, b], length, throughput);
            assert_eq!(lanes(left), medium.attenuate(length, lanes(throughput)));
        }
    }
}
