//! Phase functions, the directional distributions of scattered light.

use serde::{Deserialize, Serialize};
use snell_math::simd::{max, min};
use snell_math::{Frame, Vec2, Vec3, angles};
use std::f64::consts::PI;

/// Maximum magnitude of the asymmetry. Beyond it, light is hardly deflected at all.
const MAX_ASYMMETRY: f32 = 0.999;

/// The phase function of Henyey and Greenstein (Diffuse Radiation in the Galaxy, 1941). Samples
/// follow it exactly, so its value is also their density.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HenyeyGreenstein {
    g: f32,
}

impl HenyeyGreenstein {
    /// The phase function with mean cosine `g` of the scattering angle, which is limited to 0.999
    /// in magnitude; NaN counts as 0.
    pub fn new(g: f32) -> Self {
        Self { g: if g.is_nan() { 0.0 } else { g.clamp(-MAX_ASYMMETRY, MAX_ASYMMETRY) } }
    }

    /// The mean cosine of the scattering angle.
    pub fn g(&self) -> f32 {
        self.g
    }

    /// The fraction of light per steradian that is scattered from `forward` (the direction of
    /// travel) to `wi`, both unit vectors. Its integral over all `wi` is 1. It is symmetric, so
    /// either vector may be the light's direction.
    #[inline(always)]
    pub fn pdf(&self, forward: Vec3, wi: Vec3) -> f32 {
        let g = f64::from(self.g);
        let cos = min(max(f64::from(forward.dot(wi)), -1.0), 1.0);
        let denominator = 1.0 + g * g - 2.0 * g * cos;
        ((1.0 - g * g) / (4.0 * PI * denominator * denominator.sqrt())) as f32
    }

    /// Samples a direction for `u` in `[0, 1)^2`. Returns the unit direction and its density per
    /// steradian. It has no branches, so that loops over it are vectorised.
    #[inline(always)]
    pub fn sample(&self, forward: Vec3, u: Vec2) -> (Vec3, f32) {
        let g = f64::from(self.g);
        let x = f64::from(u.x);
        // The inversion is in double precision, because it has cancellation for small `g`.
        let root = (1.0 - g * g) / (1.0 + g - 2.0 * g * x);
        let deflected = min(max((1.0 + g * g - root * root) / (2.0 * g), -1.0), 1.0);
        let cos = if g.abs() < 1e-4 { 1.0 - 2.0 * x } else { deflected };
        let sin = max(1.0 - cos * cos, 0.0).sqrt();
        let (sin_phi, cos_phi) = angles::sin_cos(2.0 * PI * f64::from(u.y));
        let local = Vec3::new((sin * cos_phi) as f32, (sin * sin_phi) as f32, cos as f32);
        let direction = Frame::from_z(forward).from_local(local);
        let scale = 1.0 / direction.length();
        let is_sound = (scale > 0.0) & (scale < f32::INFINITY);
        let pick =
            |of_sound: f32, otherwise: f32| if is_sound { of_sound * scale } else { otherwise };
        let wi = Vec3::new(
            pick(direction.x, forward.x),
            pick(direction.y, forward.y),
            pick(direction.z, forward.z),
        );
        (wi, self.pdf(forward, wi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng;
    use snell_math::statistics::{chi_squared_deviation, sidak_deviation};

    const ASYMMETRIES: [f32; 9] = [-0.99, -0.7, -0.3, -1e-5, 0.0, 1e-3, 0.5, 0.9, 0.99];

    /// The fraction of light that is scattered by an angle whose cosine is at most `cos`, in closed
    /// form.
    fn cumulative(g: f64, cos: f64) -> f64 {
        if g.abs() < 1e-4 {
            return 0.5 * (1.0 + cos);
        }
        (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 + g * g - 2.0 * g * cos).sqrt() - 1.0 / (1.0 + g))
    }

    #[test]
    fn samples_are_distributed_by_their_density() {
        let (rows, columns, n) = (16, 8, 64_000);
        let forward = Vec3::new(0.3, -0.8, 0.5).normalize();
        let frame = Frame::from_z(forward);
        for (key, g) in ASYMMETRIES.into_iter().enumerate() {
            let phase = HenyeyGreenstein::new(g);
            // Rows are chosen so that each receives the same fraction of the light, and no cell is
            // empty.
            let mut counts = vec![0u32; rows * columns];
            for i in 0..n {
                let (wi, pdf) = phase.sample(forward, rng::uniform2([i, key as u32, 3, 1]));
                assert!((pdf - phase.pdf(forward, wi)).abs() <= 1e-5 * pdf, "g {g}");
                let local = frame.to_local(wi);
                let row =
                    (cumulative(f64::from(g), f64::from(local.z).min(1.0)) * rows as f64) as usize;
                let phi = f64::from(local.y).atan2(f64::from(local.x)) / (2.0 * PI) + 0.5;
                counts[row.min(rows - 1) * columns
                    + ((phi * columns as f64) as usize).min(columns - 1)] += 1;
            }
            let expected = vec![f64::from(n) / counts.len() as f64; counts.len()];
            let z = chi_squared_deviation(&counts, &expected);
            assert!(
                z < sidak_deviation(0.01, ASYMMETRIES.len() as u32),
                "g {g}: {z} standard deviations"
            );
        }
    }

    #[test]
    fn the_density_integrates_to_one_and_its_mean_cosine_is_g() {
        for g in ASYMMETRIES {
            let phase = HenyeyGreenstein::new(g);
            let (mut sum, mut mean) = (0.0, 0.0);
            let n = 200_000;
            for i in 0..n {
                let cos = -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(n);
                let wi = Vec3::new((1.0 - cos * cos).max(0.0).sqrt() as f32, 0.0, cos as f32);
                let share = f64::from(phase.pdf(Vec3::Z, wi)) * 4.0 * PI / f64::from(n);
                sum += share;
                mean += share * cos;
            }
            assert!(
                (sum - 1.0).abs() < 2e-3 && (mean - f64::from(g)).abs() < 2e-3,
                "g {g}: {sum} {mean}"
            );
        }
    }

    #[test]
    fn wild_parameters_give_unit_directions_and_finite_densities() {
        for g in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.0, -1.0, 1e-30, 5.0] {
            let phase = HenyeyGreenstein::new(g);
            for u in [Vec2::ZERO, Vec2::splat(rng::ONE_MINUS_EPSILON), Vec2::splat(0.5)] {
                let (wi, pdf) = phase.sample(Vec3::Z, u);
                assert!(
                    (wi.length() - 1.0).abs() < 1e-4 && pdf.is_finite() && pdf > 0.0,
                    "g {g}: {wi} {pdf}"
                );
            }
        }
    }
}
