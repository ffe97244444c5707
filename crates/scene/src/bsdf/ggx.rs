//! The GGX (Trowbridge-Reitz) distribution of microfacets, with height-correlated masking and shadowing.
//!
//! All directions here lie above the surface (`z > 0`); BSDFs mirror directions from below before they come here. The formulas are
//! those of Heitz, Understanding the Masking-Shadowing Function (JCGT 2014), arranged so that nothing is divided by a cosine that
//! may vanish.

use snell_math::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, PI};

/// Isotropic roughness of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    alpha: f32,
}

impl Ggx {
    /// The distribution of a perceptual roughness in `[0, 1]`: `alpha = roughness^2`, as in glTF. Clamps; NaN counts as 0.
    pub fn from_roughness(roughness: f32) -> Self {
        let roughness = super::bounded(roughness, 1.0);
        Self { alpha: roughness * roughness }
    }

    /// Width of the distribution: the root mean square slope is about `alpha`.
    pub fn alpha(self) -> f32 {
        self.alpha
    }

    /// True if the surface is to be treated as perfectly smooth, with delta lobes: below `alpha = 0.001` lobes are too narrow for
    /// single precision.
    pub fn is_smooth(self) -> bool {
        self.alpha < 1e-3
    }

    /// Density of microfacet normals `m` (per steradian and unit of surface).
    pub fn density(self, m: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        let e = m.x * m.x + m.y * m.y + a2 * m.z * m.z;
        a2 * FRAC_1_PI / (e * e)
    }

    /// `z sqrt(1 + (alpha tan)^2)`: the one root in the masking functions.
    fn root(self, w: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        (a2 * (w.x * w.x + w.y * w.y) + w.z * w.z).sqrt()
    }

    /// Share of the facets that face `w` and are visible from it.
    pub fn masking(self, w: Vec3) -> f32 {
        2.0 * w.z / (w.z + self.root(w))
    }

    /// `G2(wo, wi) / (4 wo.z wi.z)`.
    fn visibility(self, wo: Vec3, wi: Vec3) -> f32 {
        0.5 / (wo.z * self.root(wi) + wi.z * self.root(wo))
    }

    /// `G2(wo, wi) / G1(wo)`: the weight of a sample drawn from the visible normals.
    pub fn shadowing(self, wo: Vec3, wi: Vec3) -> f32 {
        let (ro, ri) = (self.root(wo), self.root(wi));
        wi.z * (wo.z + ro) / (wo.z * ri + wi.z * ro)
    }

    /// Draws a facet normal among those visible from `wo` (Dupuy and Benyoub, Sampling Visible GGX Normals with Spherical Caps,
    /// HPG 2023).
    pub fn sample_visible_normal(self, wo: Vec3, u: Vec2) -> Vec3 {
        let stretched = Vec3::new(wo.x * self.alpha, wo.y * self.alpha, wo.z).normalize_or(Vec3::Z);
        let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (2.0 * PI * u.x).sin_cos();
        let half = Vec3::new(r * cos, r * sin, z) + stretched;
        Vec3::new(half.x * self.alpha, half.y * self.alpha, half.z.max(0.0)).normalize_or(Vec3::Z)
    }

    /// Density of [`Self::sample_visible_normal`] per steradian of normals.
    pub fn visible_normal_pdf(self, wo: Vec3, m: Vec3) -> f32 {
        self.density(m) * wo.dot(m).max(0.0) * 2.0 / (wo.z + self.root(wo))
    }

    /// Facet normal that reflects `wi` to `wo`, and `f |cos(wi)|` of that reflection by facets of reflectance 1.
    pub fn reflection(self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
        let m = (wo + wi).try_normalize().filter(|m| m.z > 0.0)?;
        Some((m, self.density(m) * self.visibility(wo, wi) * wi.z))
    }

    /// Density per steradian of `wi` when `wo` is reflected at a normal drawn from the visible ones.
    pub fn reflection_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        match (wo + wi).try_normalize() {
            Some(m) if m.z > 0.0 => self.density(m) * 0.5 / (wo.z + self.root(wo)),
            _ => 0.0,
        }
    }

    /// `f |cos(wi)|` of refraction into `wi` (mirrored to the upper side) at facets with normal `m` and transmittance 1, without
    /// the density and the Jacobian: `D G2 (wo . m) / wo.z`.
    pub fn refraction_flux(self, wo: Vec3, wi: Vec3, m: Vec3) -> f32 {
        self.density(m) * 4.0 * self.visibility(wo, wi) * wi.z * wo.dot(m).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::{rng::uniform2, sampling::uniform_sphere};

    #[test]
    fn projected_facets_cover_the_surface_once() {
        for roughness in [0.3, 0.6, 1.0] {
            let ggx = Ggx::from_roughness(roughness);
            let n = 400_000;
            let mut sum = 0.0f64;
            for i in 0..n {
                let mut m = uniform_sphere(uniform2([i, 1, 0, 9]));
                m.z = m.z.abs();
                sum += f64::from(ggx.density(m) * m.z * 2.0 * PI);
            }
            let mean = sum / f64::from(n);
            assert!((mean - 1.0).abs() < 0.03, "roughness {roughness}: {mean}");
        }
    }

    #[test]
    fn samples_have_the_weight_that_value_and_density_give() {
        let ggx = Ggx::from_roughness(0.5);
        for i in 0..1000 {
            let mut wo = uniform_sphere(uniform2([i, 1, 0, 9]));
            wo.z = wo.z.abs();
            let m = ggx.sample_visible_normal(wo, uniform2([i, 2, 0, 9]));
            let wi = super::super::fresnel::reflect(wo, m);
            if wi.z <= 0.0 {
                continue;
            }
            let (_, value) = ggx.reflection(wo, wi).expect("both above");
            let weight = value / ggx.reflection_pdf(wo, wi);
            assert!((weight - ggx.shadowing(wo, wi)).abs() < 1e-3, "{weight}");
            assert!(weight <= 1.0 + 1e-4);
        }
    }
}
