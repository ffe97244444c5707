//! Reflection and refraction at a smooth interface.

use snell_math::simd::max;
use snell_math::{SampledSpectrum, Vec3, real};

/// The mirror direction of `w` about the unit vector `n`.
#[inline(always)]
pub fn reflect(w: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * w.dot(n)) - w
}

/// The direction into which light from `w` is refracted by an interface with unit normal `n`, by
/// Snell's law. `w` lies on the side of `n`; `eta` is the index of refraction on the far side
/// divided by that on the side of `w`. `None` for total internal reflection.
pub fn refract(w: Vec3, n: Vec3, eta: f32) -> Option<Vec3> {
    let (wi, exists) = refracted(w, n, eta);
    exists.then_some(wi)
}

/// [`refract`] without branches, so that loops over it become vector code. The flag is false for
/// total internal reflection.
#[inline(always)]
pub fn refracted(w: Vec3, n: Vec3, eta: f32) -> (Vec3, bool) {
    let cos_i = w.dot(n);
    let sin2_t = max(1.0 - cos_i * cos_i, 0.0) / (eta * eta);
    let cos_t = (1.0 - sin2_t).sqrt();
    let wi = n * (cos_i / eta - cos_t) - w / eta;
    let scale = 1.0 / wi.length();
    (wi * scale, (sin2_t < 1.0) & (scale > 0.0) & (scale < f32::INFINITY))
}

/// Reflectance of an interface between dielectrics for unpolarised light. `cos_i >= 0` is the
/// cosine on the side from which light comes, and `eta` is that of [`refract`]. Exactly 0 for
/// `eta = 1`. The function has no branches, so that loops over it become vector code.
#[inline(always)]
pub fn dielectric(cos_i: f32, eta: f32) -> f32 {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let partial = (parallel * parallel + perpendicular * perpendicular) * 0.5;
    let reflectance = if sin2_t >= 1.0 { 1.0 } else { partial };
    if eta == 1.0 { 0.0 } else { reflectance }
}

/// Reflectance of an interface between dielectrics for diffuse light from the side of lower index,
/// with `eta >= 1` as in [`refract`]. The closed form is that of Walsh (1926), as given by Judd,
/// Fresnel reflection of diffusely incident light (1942).
pub fn dielectric_average(eta: f32) -> f32 {
    if eta < 1.002 {
        // The terms of the closed form cancel here; the limit is linear.
        return (eta - 1.0).max(0.0) * 0.33;
    }
    if eta > 100.0 {
        return (eta - 1.0) / (4.08567 + 1.00071 * eta);
    }
    let n = f64::from(eta);
    let (n2, n4) = (n * n, n * n * n * n);
    let rational = 0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * real::powi(n + 1.0, 2));
    let parallel =
        n2 * real::powi(n2 - 1.0, 2) / real::powi(n2 + 1.0, 3) * real::ln((n - 1.0) / (n + 1.0));
    let mixed = 2.0 * n2 * n * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0));
    let last = 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * real::powi(n4 - 1.0, 2)) * real::ln(n);
    (rational + parallel - mixed + last) as f32
}

/// Reflectance of a conductor with index of refraction `eta + i k`, relative to the outside, for
/// unpolarised light, by the closed form in real numbers (Born and Wolf, Principles of Optics,
/// section 14.2).
#[inline(always)]
pub fn conductor(cos_i: f32, eta: f32, k: f32) -> f32 {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let (cos2, eta2, k2) = (cos_i * cos_i, eta * eta, k * k);
    let sin2 = 1.0 - cos2;
    let t0 = eta2 - k2 - sin2;
    // |a + i b|^2, where (a + i b)^2 = (eta + i k)^2 - sin^2.
    let a2_plus_b2 = (t0 * t0 + 4.0 * eta2 * k2).sqrt();
    let a = (0.5 * (a2_plus_b2 + t0)).max(0.0).sqrt();
    let (t1, t2) = (a2_plus_b2 + cos2, 2.0 * cos_i * a);
    let (t3, t4) = (cos2 * a2_plus_b2 + sin2 * sin2, t2 * sin2);
    let perpendicular = (t1 - t2) / (t1 + t2);
    let parallel =
        if t3 + t4 > 0.0 { perpendicular * (t3 - t4) / (t3 + t4) } else { perpendicular };
    let reflectance = 0.5 * (perpendicular + parallel);
    // Huge indices overflow. Such a surface is a mirror.
    if reflectance.is_finite() { reflectance.clamp(0.0, 1.0) } else { 1.0 }
}

/// Schlick's weight of grazing reflection, `(1 - cos)^5` (An inexpensive BRDF model for
/// physically-based rendering, 1994).
#[inline(always)]
pub fn schlick_weight(cos_i: f32) -> f32 {
    let m = (1.0 - cos_i).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// Schlick's reflectance, from `f0` at normal incidence to `f90` at grazing incidence.
#[inline(always)]
pub fn schlick(cos_i: f32, f0: SampledSpectrum, f90: SampledSpectrum) -> SampledSpectrum {
    f0.lerp(f90, schlick_weight(cos_i))
}

/// Reflectance at normal incidence of a dielectric with this index of refraction.
pub fn f0_from_ior(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dielectric_reflectance_has_its_textbook_values() {
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((dielectric(0.0, 1.5) - 1.0).abs() < 1e-6);
        // At Brewster's angle, light polarised parallel to the plane of incidence is not reflected,
        // and the other polarisation is reflected by ((eta^2 - 1) / (eta^2 + 1))^2.
        let brewster = 1.5f32.atan().cos();
        assert!((dielectric(brewster, 1.5) - 0.5 * (1.25f32 / 3.25).powi(2)).abs() < 1e-6);
        // An angle beyond the critical angle from glass to air, 41.8 degrees.
        assert_eq!(dielectric(45f32.to_radians().cos(), 1.0 / 1.5), 1.0);
        assert_eq!(dielectric(0.3, 1.0), 0.0);
    }

    #[test]
    fn the_mean_reflectance_is_the_integral() {
        for eta in [1.001f32, 1.0021, 1.01, 1.1, 1.5, 2.5, 20.0, 101.0] {
            let steps = 100_000;
            let term = |i: i32| {
                let mu = (f64::from(i) + 0.5) / f64::from(steps);
                2.0 * mu * f64::from(dielectric(mu as f32, eta)) / f64::from(steps)
            };
            let mean: f64 = (0..steps).map(term).sum();
            let found = f64::from(dielectric_average(eta));
            assert!((found - mean).abs() < 2e-3 * mean + 2e-5, "{eta}: {found} for {mean}");
        }
    }

    #[test]
    fn reflectance_is_the_same_from_both_sides() {
        for i in 1..20 {
            let w = Vec3::new((i as f32 / 20.0).sin(), 0.0, (i as f32 / 20.0).cos());
            let t = refract(w, Vec3::Z, 1.5).expect("no total reflection from outside");
            assert!((dielectric(w.z, 1.5) - dielectric(-t.z, 1.0 / 1.5)).abs() < 1e-5);
            assert!((w.x + 1.5 * t.x).abs() < 1e-6, "Snell's law");
            assert!(
                (refract(-t, Vec3::Z, 1.0 / 1.5).expect("reversible") + w).length() < 1e-5
                    || t.z < 0.0
            );
        }
    }

    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        for i in 0..=20 {
            let cos = i as f32 / 20.0;
            assert!((conductor(cos, 1.5, 0.0) - dielectric(cos, 1.5)).abs() < 1e-5, "{cos}");
        }
        // At normal incidence: ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
        let (n, k) = (0.2f32, 3.9f32);
        let expected = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
        assert!((conductor(1.0, n, k) - expected).abs() < 1e-6);
        for (n, k) in [(0.0, 0.0), (1e30, 1e30), (0.0, 5.0)] {
            for cos in [0.0, 0.5, 1.0] {
                assert!((0.0..=1.0).contains(&conductor(cos, n, k)));
            }
        }
    }
}
