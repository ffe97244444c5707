//! Scattering by a hair, a rough dielectric cylinder with scales, as a single event.

use super::{Choice, Drawn, Lobes, fresnel};
use snell_math::{SampledSpectrum, Vec2, Vec3, real};
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// The number of paths through the fibre that have lobes of their own: reflection (R), straight
/// transmission (TT), and one inner reflection (TRT). A fourth lobe stands for all longer paths.
const WAYS: usize = 3;

/// The hair model of Chiang, Bitterli, Tappan and Burley (A Practical and Controllable Hair and Fur
/// Model for Production Path Tracing, 2016), in the form of pbrt, 4th edition, section 9.9.
///
/// The local `x` axis is along the fibre, towards its tip, and `z` is the normal. *Longitudinal*
/// angles are inclinations to the plane across the fibre, *azimuthal* angles lie in that plane. The
/// *offset* is the position at which a direction hits the width of the fibre, from -1 to 1. The
/// value has no cosine: the fibre receives light from all sides.
///
/// Every lobe conserves energy, so hair without pigment absorbs nothing. The model is not
/// reciprocal: it uses the offset and the attenuation of `wo` only.
#[derive(Clone, Copy, Debug)]
pub struct HairBsdf {
    offset: Option<f32>,
    ior: f32,
    absorption: SampledSpectrum,
    unit: SampledSpectrum,
    /// Longitudinal variance of each lobe, in square radians.
    variances: [f32; WAYS + 1],
    /// Scale of the azimuthal logistic distribution, in radians.
    scale: f32,
    /// Sine and cosine of the angle by which the scales tilt each lobe.
    tilts: [[f32; 2]; WAYS + 1],
}

/// The parameters of [`HairBsdf`].
#[derive(Clone, Copy, Debug)]
pub struct HairFiber {
    /// Offset across the fibre, from -1 to 1, positive towards the local `y` axis. `None` on a
    /// round fibre, whose offset follows from `wo` and the normal.
    pub offset: Option<f32>,
    /// Index of refraction.
    pub ior: f32,
    /// Absorption for a path as long as the fibre's radius, at least 0.
    pub absorption: SampledSpectrum,
    /// 1 in every lane of [`Self::absorption`] that is in use, 0 in others.
    pub unit: SampledSpectrum,
    /// Roughness along the fibre, `[0.01, 1]`: `beta_m` in the papers.
    pub longitudinal_roughness: f32,
    /// Roughness around the fibre, `[0.01, 1]`: `beta_n` in the papers.
    pub azimuthal_roughness: f32,
    /// Angle of the scales, radians.
    pub scale_tilt: f32,
}

/// A fibre seen from a direction. It looks the same from below, so angles are those of the
/// direction mirrored to the upper side.
#[derive(Clone, Debug)]
pub struct HairSeen {
    /// The direction, which may be below.
    wo: Vec3,
    /// Sine and cosine of the inclination of `wo`.
    inclination: [f32; 2],
    azimuth: f32,
    /// The angle from the normal to `wo` in the plane across the fibre, and the refracted angle.
    gammas: [f32; 2],
    /// Fraction of the light that takes each path.
    attenuations: [SampledSpectrum; WAYS + 1],
    choice: Choice<{ WAYS + 1 }>,
}

impl HairBsdf {
    /// The BSDF of a fibre at a point.
    pub fn new(fiber: &HairFiber) -> Self {
        let [m, n] = [fiber.longitudinal_roughness, fiber.azimuthal_roughness]
            .map(|r| super::bounded(r, 1.0).max(0.01));
        let variance = real::powi(0.726 * m + 0.812 * m * m + 3.7 * real::powi(m, 20), 2);
        let tilt = |angle: f32| real::sin_cos(angle).into();
        let alpha = fiber.scale_tilt;
        Self {
            offset: fiber.offset.map(|h| h.clamp(-1.0, 1.0)),
            ior: fiber.ior,
            absorption: fiber.absorption,
            unit: fiber.unit,
            variances: [variance, 0.25 * variance, 4.0 * variance, 4.0 * variance],
            scale: (PI / 8.0).sqrt() * (0.265 * n + 1.194 * n * n + 5.372 * real::powi(n, 22)),
            tilts: [tilt(-2.0 * alpha), tilt(alpha), tilt(4.0 * alpha), tilt(0.0)],
        }
    }

    /// The absorption per radius for which white light has about this colour, in `[0, 1]`, after
    /// many hairs: the fit of Chiang et al., section 4.2.
    pub fn absorption_of_color(
        color: SampledSpectrum,
        azimuthal_roughness: f32,
    ) -> SampledSpectrum {
        let scale = Self::color_scale(azimuthal_roughness);
        // Black would need infinite absorption, so the colour is bounded from below.
        color.map(|c| real::powi(real::ln(c.clamp(1e-4, 1.0)) / scale, 2))
    }

    /// The colour that much hair of this absorption per radius, at least 0, has in white light. It
    /// is the inverse of [`Self::absorption_of_color`].
    pub fn color_of_absorption(absorption: f32, azimuthal_roughness: f32) -> f32 {
        real::exp(-absorption.max(0.0).sqrt() * Self::color_scale(azimuthal_roughness))
    }

    fn color_scale(azimuthal_roughness: f32) -> f32 {
        let n = super::bounded(azimuthal_roughness, 1.0);
        let fit = [5.969, -0.215, 2.532, -10.73, 5.574, 0.245];
        fit.iter().rev().fold(0.0, |sum, c| sum * n + c)
    }

    /// The fraction of the light that takes each path, given the cosine of the angle of incidence
    /// and the transmittance of one passage through the fibre.
    fn attenuations(&self, cos: f32, through: SampledSpectrum) -> [SampledSpectrum; WAYS + 1] {
        let f = fresnel::dielectric(cos, self.ior);
        let first = through * ((1.0 - f) * (1.0 - f));
        let second = first * through * f;
        let rest = through * f;
        // The longer paths form a geometric series. No light enters where all of it is reflected.
        let all = if f < 1.0 {
            second * rest / (SampledSpectrum::ONE - rest)
        } else {
            SampledSpectrum::ZERO
        };
        [SampledSpectrum::splat(f), first, second, all].map(|share| share * self.unit)
    }

    /// Sine and cosine of the inclination of `wo` after the scales have tilted it for a lobe.
    fn tilted(&self, lobe: usize, [sin, cos]: [f32; 2]) -> [f32; 2] {
        let [sin_tilt, cos_tilt] = self.tilts[lobe];
        [sin * cos_tilt + cos * sin_tilt, (cos * cos_tilt - sin * sin_tilt).abs()]
    }

    /// The azimuth by which a smooth fibre deflects light on a path, in radians.
    fn turn(way: usize, [gamma, refracted]: [f32; 2]) -> f32 {
        let p = way as f32;
        2.0 * p * refracted - 2.0 * gamma + p * PI
    }

    /// Density of each lobe per steradian.
    fn lobes(&self, seen: &HairSeen, wi: Vec3) -> [f32; WAYS + 1] {
        let sin = wi.x.clamp(-1.0, 1.0);
        let inclination = [sin, (1.0 - sin * sin).max(0.0).sqrt()];
        let turn = real::atan2(wi.z, wi.y) - seen.azimuth;
        std::array::from_fn(|lobe| {
            let along = longitudinal(
                inclination,
                self.tilted(lobe, seen.inclination),
                self.variances[lobe],
            );
            let around = match lobe {
                WAYS => 0.5 * FRAC_1_PI,
                _ => trimmed_logistic(wrapped(turn - Self::turn(lobe, seen.gammas)), self.scale),
            };
            along * around
        })
    }
}

/// Density of an inclination around the mirror image of the (tilted) inclination of `wo`, smeared
/// over the sphere and averaged over azimuths (d'Eon et al., An Energy-Conserving Hair Reflectance
/// Model, 2011). Its integral over inclinations, weighted by the cosine, is 1.
fn longitudinal([sin, cos]: [f32; 2], [sin_o, cos_o]: [f32; 2], variance: f32) -> f32 {
    // The paper's exponents cancel for small variances, so their difference is computed directly.
    let distance2 = real::powi(cos - cos_o, 2) + real::powi(sin + sin_o, 2);
    let norm = variance * (1.0 - real::exp(-2.0 / variance));
    real::exp(-0.5 * distance2 / variance) * scaled_bessel(cos * cos_o / variance) / norm
}

/// The modified Bessel function of order 0, times `exp(-x)`, for `x >= 0` (Abramowitz and Stegun,
/// 9.8.1 and 9.8.2; error below 1e-6).
fn scaled_bessel(x: f32) -> f32 {
    let sum =
        |coefficients: &[f32], t: f32| coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c);
    if x < 3.75 {
        let t = real::powi(x / 3.75, 2);
        sum(&[1.0, 3.515_622_9, 3.089_942_4, 1.206_749_2, 0.265_973_2, 0.036_076_8, 0.004_581_3], t)
            * real::exp(-x)
    } else {
        let coefficients = [
            0.398_942_28,
            0.013_285_92,
            0.002_253_19,
            -0.001_575_65,
            0.009_162_81,
            -0.020_577_06,
            0.026_355_37,
            -0.016_476_33,
            0.003_923_77,
        ];
        sum(&coefficients, 3.75 / x) / x.sqrt()
    }
}

/// The angle, wrapped to `[-pi, pi]`.
fn wrapped(angle: f32) -> f32 {
    angle - TAU * (angle / TAU).round()
}

/// The cumulative distribution function of the logistic distribution.
fn logistic_cdf(x: f32, scale: f32) -> f32 {
    1.0 / (1.0 + real::exp(-x / scale))
}

/// Density of the logistic distribution cut to `[-pi, pi]`.
fn trimmed_logistic(x: f32, scale: f32) -> f32 {
    let e = real::exp(-x.abs() / scale);
    // The fraction of the distribution within the interval; the distribution is symmetric.
    let left = 1.0 - 2.0 * logistic_cdf(-PI, scale);
    e / (scale * (1.0 + e) * (1.0 + e) * left)
}

/// Samples the logistic distribution cut to `[-pi, pi]`.
fn sample_trimmed_logistic(u: f32, scale: f32) -> f32 {
    let below = logistic_cdf(-PI, scale);
    let share = below + u * (1.0 - 2.0 * below);
    let x = -scale * real::ln(1.0 / share - 1.0);
    x.clamp(-PI, PI)
}

impl Lobes for HairBsdf {
    type Seen = HairSeen;

    fn seen(&self, below_or_above: Vec3) -> HairSeen {
        let wo = super::lift(below_or_above);
        let sin = wo.x.clamp(-1.0, 1.0);
        let across = real::hypot(wo.y, wo.z);
        let h = match self.offset {
            Some(h) => h,
            None if across > 0.0 => (-wo.y / across).clamp(-1.0, 1.0),
            None => 0.0,
        };
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        // The effective index of refraction in the plane across the fibre (Marschner et al., Light
        // Scattering from Human Hair Fibers, 2003).
        let projected = (self.ior * self.ior - sin * sin).max(0.0).sqrt();
        let sin_refracted =
            if projected > 0.0 { (h * cos / projected).clamp(-1.0, 1.0) } else { 0.0 };
        let cos_refracted = (1.0 - sin_refracted * sin_refracted).max(0.0).sqrt();
        let sin_within = (sin / self.ior).clamp(-1.0, 1.0);
        let cos_within = (1.0 - sin_within * sin_within).max(1e-8).sqrt();
        let through = (self.absorption * (-2.0 * cos_refracted / cos_within)).exp();
        let attenuations = self.attenuations(cos * (1.0 - h * h).max(0.0).sqrt(), through);
        HairSeen {
            wo: below_or_above,
            inclination: [sin, cos],
            azimuth: real::atan2(wo.z, wo.y),
            gammas: [real::asin(h), real::asin(sin_refracted)],
            attenuations,
            choice: Choice::new(attenuations),
        }
    }

    fn value_and_pdf_from(&self, seen: &HairSeen, wi: Vec3) -> (SampledSpectrum, f32) {
        let lobes = self.lobes(seen, super::lower_like(wi, seen.wo));
        let mut both = (SampledSpectrum::ZERO, 0.0);
        for (lobe, density) in lobes.into_iter().enumerate() {
            both.0 += seen.attenuations[lobe] * density;
            both.1 += seen.choice.probabilities[lobe] * density;
        }
        both
    }

    fn draw_from(&self, seen: &HairSeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let (lobe, rest) = seen.choice.pick(u_lobe)?;
        let [sin_o, cos_o] = self.tilted(lobe, seen.inclination);
        let variance = self.variances[lobe];
        // An inclination around that of `wo`, tilted by the scales and mirrored in the plane across
        // the fibre.
        let cos_away =
            1.0 + variance * real::ln(u.x.max(1e-7) + (1.0 - u.x) * real::exp(-2.0 / variance));
        let sin_away = (1.0 - cos_away * cos_away).max(0.0).sqrt();
        let sin = (-cos_away * sin_o + sin_away * real::cos(TAU * u.y) * cos_o).clamp(-1.0, 1.0);
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        let turn = match lobe {
            WAYS => TAU * rest,
            _ => Self::turn(lobe, seen.gammas) + sample_trimmed_logistic(rest, self.scale),
        };
        let (up, along_y) = real::sin_cos(seen.azimuth + turn);
        let wi = Vec3::new(sin, cos * along_y, cos * up).try_normalize()?;
        Some(Drawn::Direction { wi: super::lower_like(wi, seen.wo), is_transmission: wi.z < 0.0 })
    }

    fn is_delta(&self) -> bool {
        false
    }

    fn albedo_from(&self, seen: &HairSeen) -> SampledSpectrum {
        seen.attenuations.into_iter().fold(SampledSpectrum::ZERO, |sum, share| sum + share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::{rng, sampling};

    const ROUGHNESSES: [f32; 5] = [0.1, 0.25, 0.5, 0.75, 1.0];

    fn fiber(offset: Option<f32>, m: f32, n: f32) -> HairFiber {
        HairFiber {
            offset,
            ior: 1.55,
            absorption: SampledSpectrum::ZERO,
            unit: SampledSpectrum::ONE,
            longitudinal_roughness: m,
            azimuthal_roughness: n,
            scale_tilt: 2f32.to_radians(),
        }
    }

    fn views() -> Vec<Vec3> {
        (0..6)
            .map(|i| super::super::lift(sampling::uniform_sphere(rng::uniform2([i, 3, 7, 1]))))
            .collect()
    }

    /// The integral over the sphere, by the midpoint rule in inclination and azimuth.
    fn integral(f: impl Fn(Vec3) -> f32) -> f64 {
        const STEPS: [usize; 2] = [600, 600];
        let mut sum = 0.0;
        for i in 0..STEPS[0] {
            let x = (2.0 * i as f32 + 1.0) / STEPS[0] as f32 - 1.0;
            let across = (1.0 - x * x).sqrt();
            for j in 0..STEPS[1] {
                let (sin, cos) = ((j as f32 + 0.5) / STEPS[1] as f32 * TAU).sin_cos();
                sum += f64::from(f(Vec3::new(x, across * cos, across * sin)));
            }
        }
        sum * 4.0 * std::f64::consts::PI / (STEPS[0] * STEPS[1]) as f64
    }

    #[test]
    fn clear_hair_loses_nothing_at_any_roughness() {
        let mut worst = 0.0f64;
        for m in ROUGHNESSES {
            for n in ROUGHNESSES {
                for (i, wo) in views().into_iter().enumerate() {
                    let offset = [None, Some(-0.95), Some(0.3)][i % 3];
                    let hair = HairBsdf::new(&fiber(offset, m, n));
                    let [value, pdf] =
                        [integral(|wi| hair.eval(wo, wi)[0]), integral(|wi| hair.pdf(wo, wi))];
                    assert!(
                        (value - 1.0).abs() < 1e-3 && (pdf - 1.0).abs() < 1e-3,
                        "{m} {n} {wo} {offset:?}: {value} {pdf}"
                    );
                    assert!((hair.albedo(wo)[0] - 1.0).abs() < 1e-5);
                    worst = worst.max((value - 1.0).abs());
                }
            }
        }
        eprintln!("clear hair: off by {worst:.1e} at most");
    }

    #[test]
    fn the_albedo_is_the_integral_of_coloured_hair() {
        let absorption = SampledSpectrum([0.1, 0.5, 2.0, 0.0]);
        let hair = HairBsdf::new(&HairFiber { absorption, ..fiber(None, 0.3, 0.4) });
        for wo in views() {
            for lane in 0..3 {
                let found = integral(|wi| hair.eval(wo, wi)[lane]);
                assert!((found - f64::from(hair.albedo(wo)[lane])).abs() < 1e-3, "{wo}: {found}");
            }
        }
    }

    /// Traces rays in a real cylinder of radius 1 around x. Returns, for each of the first paths,
    /// the direction, the fraction of the light, and the length of the way inside.
    fn traced(h: f32, wo: Vec3, ior: f32) -> Vec<(Vec3, f32, f32)> {
        // A viewer at z sees positive offsets towards y.
        let start = Vec3::new(0.0, h, (1.0 - h * h).sqrt());
        let mut normal = start;
        let f = fresnel::dielectric(wo.dot(normal), ior);
        let mut ways = vec![(fresnel::reflect(wo, normal), f, 0.0)];
        let mut d = fresnel::refract(wo, normal, ior).expect("into the denser medium");
        let (mut p, mut share, mut length) = (start, 1.0 - f, 0.0);
        for _ in 1..WAYS {
            let across = Vec3::new(0.0, d.y, d.z);
            let t = -2.0 * p.dot(across) / across.length_squared();
            (p, length) = (p + d * t, length + t);
            normal = Vec3::new(0.0, p.y, p.z).normalize();
            let inner = fresnel::dielectric(d.dot(normal), 1.0 / ior);
            let out = fresnel::refract(-d, -normal, 1.0 / ior).expect("as it came in");
            ways.push((out, share * (1.0 - inner), length));
            share *= inner;
            d = fresnel::reflect(-d, -normal);
        }
        ways
    }

    #[test]
    fn smooth_fibres_send_light_where_a_real_cylinder_does() {
        let absorption = SampledSpectrum::splat(0.3);
        for (i, h) in [-0.9f32, -0.5, 0.0, 0.2, 0.7, 0.97].into_iter().enumerate() {
            let inclination = (i as f32 - 2.5) * 0.25;
            let wo = Vec3::new(inclination.sin(), 0.0, inclination.cos());
            let plain = HairFiber { absorption, scale_tilt: 0.0, ..fiber(Some(h), 0.1, 0.1) };
            let seen = HairBsdf::new(&plain).seen(wo);
            // On a round fibre the offset follows from the normal at the same point.
            let normal = Vec3::new(0.0, h, (1.0 - h * h).sqrt());
            let local = Vec3::new(wo.x, wo.dot(normal.cross(Vec3::X)), wo.dot(normal));
            let round = HairBsdf::new(&HairFiber { offset: None, ..plain }).seen(local);
            for (way, (wi, share, length)) in traced(h, wo, 1.55).into_iter().enumerate() {
                let azimuth = seen.azimuth + HairBsdf::turn(way, seen.gammas);
                assert!(
                    wrapped(azimuth - wi.z.atan2(wi.y)).abs() < 2e-3,
                    "way {way} at {h}: {azimuth} for {wi}"
                );
                assert!((wi.x + wo.x).abs() < 1e-4, "inclinations are mirrored: {wi}");
                let expected = share * (-0.3 * length).exp();
                assert!(
                    (seen.attenuations[way][0] - expected).abs() < 1e-3 * expected + 1e-5,
                    "way {way} at {h}"
                );
                assert!(
                    (round.attenuations[way][0] - expected).abs() < 1e-3 * expected + 1e-5,
                    "way {way} at {h}"
                );
                assert!((round.gammas[0] - seen.gammas[0]).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn over_the_width_of_a_fibre_without_scales_directions_of_equal_inclination_are_exchangeable() {
        let hairs: Vec<_> = (0..400)
            .map(|i| {
                HairBsdf::new(&HairFiber {
                    scale_tilt: 0.0,
                    ..fiber(Some((i as f32 + 0.5) / 200.0 - 1.0), 0.3, 0.3)
                })
            })
            .collect();
        let direction =
            |azimuth: f32, x: f32| Vec3::new(x, azimuth.cos() * 0.8, azimuth.sin() * 0.8);
        for i in 0..20 {
            let (a, b) =
                (direction(0.3 + 0.13 * i as f32, 0.6), direction(2.0 - 0.05 * i as f32, -0.6));
            let mean = |o, i| {
                hairs.iter().map(|hair| hair.eval(o, i)[0]).sum::<f32>() / hairs.len() as f32
            };
            let (there, back) = (mean(a, b), mean(b, a));
            assert!((there - back).abs() < 2e-3 * there, "{there}, back {back}");
        }
    }

    #[test]
    fn colours_come_back_as_the_paper_has_them() {
        // White absorbs nothing, and darker colours absorb more.
        let at = |c: f32| HairBsdf::absorption_of_color(SampledSpectrum::splat(c), 0.3)[0];
        assert_eq!(at(1.0), 0.0);
        assert!((HairBsdf::color_of_absorption(at(0.37), 0.3) - 0.37).abs() < 1e-5);
        assert!(at(0.1) > at(0.5) && at(0.0).is_finite());
        // ln(0.5) / (5.969 - 0.0645 + 0.22788 - 0.28971 + 0.0451494 + 0.00059535), squared.
        assert!((at(0.5) - (0.5f32.ln() / 5.888_414).powi(2)).abs() < 1e-6);
    }

    #[test]
    fn the_bessel_function_has_its_tabled_values() {
        for (x, value) in [
            (0.0, 1.0),
            (1.0, 0.465_759_6),
            (3.0, 0.243_000_35),
            (5.0, 0.183_540_8),
            (20.0, 0.089_780_31),
        ] {
            assert!((scaled_bessel(x) - value).abs() < 1e-6, "{x}: {}", scaled_bessel(x));
        }
    }

    #[test]
    fn extremes_are_harmless() {
        for (m, n) in [(0.0, 0.0), (1.0, 1.0), (f32::NAN, f32::INFINITY), (1e-9, 1e9)] {
            for absorption in [0.0, 1e6] {
                for ior in [1.0, 0.5, 1.55, 900.0] {
                    let absorption = SampledSpectrum::splat(absorption);
                    let hair = HairBsdf::new(&HairFiber {
                        absorption,
                        ior,
                        scale_tilt: 30.0,
                        ..fiber(None, m, n)
                    });
                    for i in 0..200u32 {
                        let u = |k| rng::uniform2([i, k, 5, 2]);
                        let wo = match i % 5 {
                            0 => Vec3::X,
                            1 => Vec3::Y,
                            _ => sampling::uniform_sphere(u(0)),
                        };
                        let value = hair.eval(wo, sampling::uniform_sphere(u(1)));
                        assert!(
                            value.is_finite() && value.0.iter().all(|&v| v >= 0.0),
                            "{m} {n} {ior} {wo}: {value:?}"
                        );
                        let ends = [Vec2::ZERO, Vec2::splat(1.0 - f32::EPSILON)];
                        let u2 = if i < 20 { ends[i as usize % 2] } else { u(2) };
                        if let Some(s) = hair.sample(wo, u(3).x, u2) {
                            assert!(
                                s.wi.is_normalized() && s.weight.is_finite() && s.pdf.is_finite(),
                                "{wo}: {s:?}"
                            );
                        }
                    }
                }
            }
        }
    }
}
