//! Beckmann's distribution of microfacets, whose slopes have a Gaussian distribution, with
//! height-correlated masking and shadowing.
//!
//! Its highlights have shorter tails than those of [`super::Ggx`]. All directions here lie above
//! the surface (`z > 0`), and all surfaces are rough. The formulas are those of Walter et al.,
//! Microfacet Models for Refraction through Rough Surfaces (EGSR 2007, section 5.2), with Smith's
//! masking by the exact error function. They are arranged so that nothing is divided by a cosine
//! that may vanish.

use super::{fresnel, unit_or, widths::Widths};
use snell_math::{Vec2, Vec3, exponentials};
use std::f64::consts::{FRAC_2_SQRT_PI, PI};

/// `1 / sqrt(pi)`.
const FRAC_1_SQRT_PI: f64 = 0.5 * FRAC_2_SQRT_PI;

/// Beckmann's distribution with these widths. Each width is the square root of 2 times the standard
/// deviation of slopes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beckmann(Widths);

impl From<Widths> for Beckmann {
    fn from(widths: Widths) -> Self {
        Self(widths)
    }
}

/// A direction in the space in which both widths are 1, not normalised. Masking depends on it
/// alone. Slopes are measured along the direction: facets of positive slope are turned away from
/// the viewer.
#[derive(Clone, Copy, Debug)]
struct Stretched {
    /// Length of the direction's component along the surface.
    spread: f64,
    z: f64,
}

impl Stretched {
    /// The slope of facets that are seen edge-on; infinite along the normal.
    fn steepest(self) -> f64 {
        self.z / self.spread
    }

    /// `z` times Smith's `Lambda`: the area of facets that other facets hide, projected to the
    /// direction.
    fn hidden(self) -> f64 {
        let a = self.steepest();
        (0.5 * exponentials::exp(-a * a)
            * (FRAC_1_SQRT_PI * self.spread - self.z * exponentials::erfcx(a)))
        .max(0.0)
    }

    /// The area of all visible facets, projected to the direction. It is the integral of
    /// [`Self::visible`] over all slopes.
    fn area(self) -> f64 {
        self.z + self.hidden()
    }

    /// The area of visible facets with slopes up to `x`, projected to the direction, and its
    /// derivative with respect to `x`. `x` must be at most the steepest slope.
    fn visible(self, x: f64) -> (f64, f64) {
        let gaussian = exponentials::exp(-x * x);
        let tail = 0.5 * gaussian * exponentials::erfcx(x.abs());
        let below = if x < 0.0 { tail } else { 1.0 - tail };
        let area = self.z * below + 0.5 * FRAC_1_SQRT_PI * self.spread * gaussian;
        (area, FRAC_1_SQRT_PI * gaussian * (self.z - self.spread * x))
    }

    /// The slope below which the fraction `share` of the visible facets lies (Heitz and d'Eon,
    /// Importance Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals, EGSR
    /// 2014), by Newton's method within shrinking bounds.
    fn slope(self, share: f64) -> f64 {
        /// A slope steeper than any that is sampled, and the smallest fraction.
        const WIDEST: f64 = 5.0;
        const LEAST: f64 = 1.0 / (1u64 << 25) as f64;
        let (share, all) = (share.clamp(LEAST, 1.0 - LEAST), self.area());
        let (mut low, mut high) = (-WIDEST, self.steepest().min(WIDEST));
        let mut x = self.roughly(share, all).clamp(low, high);
        for _ in 0..30 {
            let (area, derivative) = self.visible(x);
            let excess = area / all - share;
            *(if excess > 0.0 { &mut high } else { &mut low }) = x;
            let newton = x - excess * all / derivative;
            let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            if (next - x).abs() < 1e-7 {
                return next;
            }
            x = next;
        }
        x
    }

    /// The initial guess of [`Self::slope`]. It lies between a Gaussian distribution, which is seen
    /// along the normal, and a Rayleigh distribution, which is seen at grazing angles. Both have
    /// elementary inverses (the first by Winitzki, A handy approximation for the error function and
    /// its inverse, 2008).
    fn roughly(self, share: f64, all: f64) -> f64 {
        const A: f64 = 0.147;
        let rayleigh = -(-exponentials::ln(share)).sqrt();
        let logarithm = exponentials::ln(4.0 * share * (1.0 - share));
        let half = 2.0 / (PI * A) + 0.5 * logarithm;
        let gaussian =
            ((half * half - logarithm / A).sqrt() - half).max(0.0).sqrt().copysign(share - 0.5);
        let weight = self.z / all;
        weight * gaussian + (1.0 - weight) * rayleigh
    }
}

impl Beckmann {
    /// The widths of the distribution.
    pub fn widths(self) -> Widths {
        self.0
    }

    fn stretched(self, w: Vec3) -> Stretched {
        Stretched { spread: self.0.spread(w).into(), z: w.z.into() }
    }

    /// Density of microfacet normals `m`, per steradian and unit of surface area.
    pub fn density(self, m: Vec3) -> f32 {
        let [x, y, z] = [m.x / self.0.x, m.y / self.0.y, m.z].map(f64::from);
        let (z2, area) = (z * z, f64::from(self.0.x) * f64::from(self.0.y));
        if z > 0.0 {
            (exponentials::exp(-(x * x + y * y) / z2) / (PI * area * z2 * z2)) as f32
        } else {
            0.0
        }
    }

    /// As [`super::Ggx::visible_area`].
    pub(super) fn visible_area(self, wo: Vec3) -> f32 {
        self.stretched(wo).area() as f32
    }

    /// `G2(wo, wi) / (4 wo.z wi.z)`.
    pub(super) fn visibility(self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = (self.stretched(wo), self.stretched(wi));
        (0.25 / (o.z * i.z + i.z * o.hidden() + o.z * i.hidden())) as f32
    }

    /// `G2(wo, wi) / G1(wo)`: the weight of a sample of the visible normals.
    pub fn shadowing(self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = (self.stretched(wo), self.stretched(wi));
        (i.z * o.area() / (i.z * o.area() + o.z * i.hidden())) as f32
    }

    /// Samples a facet normal among those visible from `wo`. `u.y` chooses the slope along the
    /// direction, `u.x` the slope across it.
    pub fn sample_visible_normal(self, wo: Vec3, u: Vec2) -> Vec3 {
        let along = self.stretched(wo).slope(u.y.into()) as f32;
        let across = Stretched { spread: 0.0, z: 1.0 }.slope(u.x.into()) as f32;
        let azimuth = unit_or(Vec3::new(wo.x * self.0.x, wo.y * self.0.y, 0.0), Vec3::X);
        let x = azimuth.x * along - azimuth.y * across;
        let y = azimuth.y * along + azimuth.x * across;
        unit_or(Vec3::new(-x * self.0.x, -y * self.0.y, 1.0), Vec3::Z)
    }

    /// Density of [`Self::sample_visible_normal`] per steradian of normals.
    pub fn visible_normal_pdf(self, wo: Vec3, m: Vec3) -> f32 {
        self.density(m) * wo.dot(m).max(0.0) / self.visible_area(wo)
    }

    /// The facet normal that reflects `wi` to `wo`, the value `f |cos(wi)|` of that reflection by
    /// facets of reflectance 1, and the density of [`Self::drawn_reflection`] per steradian of
    /// `wi`.
    pub fn reflection_and_pdf(self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32, f32)> {
        let m = (wo + wi).try_normalize().filter(|m| m.z > 0.0)?;
        let density = self.density(m);
        let pdf = if wi.z > 0.0 { density * 0.25 / self.visible_area(wo) } else { 0.0 };
        Some((m, density * self.visibility(wo, wi) * wi.z, pdf))
    }

    /// The results of [`Self::reflection_and_pdf`], and true; the flag is false where that returns
    /// `None`.
    pub(super) fn reflected(self, wo: Vec3, wi: Vec3) -> (Vec3, f32, f32, bool) {
        self.reflection_and_pdf(wo, wi)
            .map_or((Vec3::Z, 0.0, 0.0, false), |(m, value, pdf)| (m, value, pdf, true))
    }

    /// Samples a direction into which facets visible from `wo` reflect it. The flag is false if the
    /// sampled direction goes below the surface.
    pub(super) fn drawn_reflection(self, wo: Vec3, u: Vec2) -> (Vec3, bool) {
        let wi = fresnel::reflect(wo, self.sample_visible_normal(wo, u));
        (wi, wi.z > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::{rng::uniform2, sampling::uniform_sphere};

    fn each() -> impl Iterator<Item = Beckmann> {
        let even = [1e-3, 0.1, 0.5, 1.0, 2.0].map(|alpha| Widths::from_alphas(alpha, alpha));
        even.into_iter()
            .chain([Widths::from_alphas(0.2, 0.7), Widths::from_alphas(1.0, 1e-9)])
            .map(Beckmann::from)
    }

    fn above(i: u32) -> Vec3 {
        let w = uniform_sphere(uniform2([i, 1, 0, 9]));
        Vec3::new(w.x, w.y, w.z.abs())
    }

    #[test]
    fn projected_facets_cover_the_surface_once() {
        for alphas in [[0.1, 0.1], [0.5, 0.5], [1.0, 1.0], [0.2, 0.7]] {
            let beckmann = Beckmann::from(Widths::from_alphas(alphas[0], alphas[1]));
            let n = 400_000;
            let sum: f64 = (0..n).map(above).map(|m| f64::from(beckmann.density(m) * m.z)).sum();
            let mean = sum * 2.0 * PI / f64::from(n);
            assert!((mean - 1.0).abs() < 0.03, "{alphas:?}: {mean}");
        }
    }

    #[test]
    fn visible_facets_cover_the_view_of_the_surface() {
        for beckmann in
            [0.3, 1.0, 2.0].map(|alpha| Beckmann::from(Widths::from_alphas(alpha, 0.5 * alpha)))
        {
            for i in 0..8 {
                let (wo, n) = (above(i), 400_000);
                let sum: f64 = (0..n)
                    .map(|i| f64::from(beckmann.visible_normal_pdf(wo, above(i + 100))))
                    .sum();
                let mean = sum * 2.0 * PI / f64::from(n);
                assert!((mean - 1.0).abs() < 0.03, "{beckmann:?} {wo}: {mean}");
            }
        }
    }

    #[test]
    fn masking_is_that_of_the_rational_approximation() {
        // The equation after 27 in Walter et al., with an error below 0.35 %.
        for i in 1..400 {
            let a = f64::from(i) * 0.01;
            let seen = Stretched { spread: 1.0, z: a };
            let rational = if a < 1.6 {
                (3.535 + 2.181 * a) * a / (1.0 + (2.276 + 2.577 * a) * a)
            } else {
                1.0
            };
            let masking = a / seen.area();
            assert!((masking / rational - 1.0).abs() < 4e-3, "{a}: {masking} {rational}");
        }
    }

    #[test]
    fn slopes_have_the_share_that_was_asked_for() {
        for a in [0.0, 1e-9, 1e-3, 0.03, 0.3, 1.0, 3.0, 30.0, 1e3, 1e9, f64::INFINITY] {
            let seen = if a > 1.0 {
                Stretched { spread: 1.0 / a, z: 1.0 }
            } else {
                Stretched { spread: 1.0, z: a }
            };
            for i in 0..=2000 {
                let share = match i {
                    0 => 0.0,
                    1..40 => 0.5f64.powi(i),
                    40..70 => 1.0 - 0.5f64.powi(i - 39),
                    _ => f64::from(i) / 2000.0,
                };
                let x = seen.slope(share);
                assert!(x.abs() <= 5.0 && x <= a, "{a} {share}: {x}");
                let found = seen.visible(x).0 / seen.area();
                assert!((found - share).abs() < 1e-6, "{a} {share}: {found}");
            }
        }
    }

    #[test]
    fn samples_have_the_weight_that_value_and_density_give() {
        for beckmann in each() {
            for i in 0..1000 {
                let wo = above(i);
                let m = beckmann.sample_visible_normal(wo, uniform2([i, 2, 0, 9]));
                assert!(
                    m.is_normalized() && m.z >= 0.0 && wo.dot(m) > -1e-6,
                    "{beckmann:?} {wo}: {m}"
                );
                let wi = fresnel::reflect(wo, m);
                if wi.z <= 0.0 {
                    continue;
                }
                // Narrow lobes at grazing angles are sensitive to the last digits.
                let Some((_, value, pdf)) =
                    beckmann.reflection_and_pdf(wo, wi).filter(|r| r.2 > 1e-20)
                else {
                    continue;
                };
                let (weight, shadowing) = (value / pdf, beckmann.shadowing(wo, wi));
                assert!(
                    (weight - shadowing).abs() < 1e-3,
                    "{beckmann:?} {wo} {wi}: {weight} {shadowing}"
                );
                assert!(weight <= 1.0 + 1e-4);
            }
        }
    }

    #[test]
    fn values_are_sound_at_the_ends_of_everything() {
        let grazing =
            [1.0f32, 1e-3, 1e-7, 1e-20, 1e-38].map(|z| Vec3::new(0.6, 0.8, z).normalize());
        let views: Vec<Vec3> =
            grazing.into_iter().chain([Vec3::Z, Vec3::X]).chain((0..20).map(above)).collect();
        for beckmann in each() {
            for &wo in &views {
                for u in [0.0, 1e-9, 0.3, 0.5, 1.0 - f32::EPSILON] {
                    let m = beckmann.sample_visible_normal(wo, Vec2::new(1.0 - u, u));
                    let known = [beckmann.density(m), beckmann.visible_normal_pdf(wo, m)];
                    assert!(
                        m.is_finite() && known.iter().all(|x| x.is_finite() && *x >= 0.0),
                        "{beckmann:?} {wo} {m}"
                    );
                }
                for wi in views
                    .iter()
                    .flat_map(|&w| [w, Vec3::new(-w.x, -w.y, w.z)])
                    .filter(|w| w.z * wo.z > 0.0)
                {
                    let Some((m, value, pdf)) = beckmann.reflection_and_pdf(wo, wi) else {
                        continue;
                    };
                    let others = [beckmann.shadowing(wo, wi), beckmann.visible_normal_pdf(wo, m)];
                    assert!(
                        [value, pdf].iter().chain(&others).all(|x| x.is_finite() && *x >= 0.0),
                        "{wo} {wi}"
                    );
                }
            }
        }
    }
}
