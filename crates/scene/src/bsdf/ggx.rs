//! The GGX (Trowbridge-Reitz) distribution of microfacets, with height-correlated masking and
//! shadowing.
//!
//! All directions here lie above the surface (`z > 0`); BSDFs mirror directions from below before
//! they call these methods. The formulas are those of Heitz, Understanding the Masking-Shadowing
//! Function (JCGT 2014), arranged so that nothing is divided by a cosine that may vanish.

use super::unit_or;
use super::widths::Widths;
use snell_math::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// The GGX distribution with these widths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx(Widths);

impl From<Widths> for Ggx {
    #[inline(always)]
    fn from(widths: Widths) -> Self {
        Self(widths)
    }
}

impl Ggx {
    /// The distribution with the widths of [`Widths::from_roughness`].
    pub fn from_roughness(roughness: f32) -> Self {
        Self(Widths::from_roughness(roughness))
    }

    /// The distribution with the widths of [`Widths::from_anisotropy`].
    pub fn from_anisotropy(roughness: f32, anisotropy: f32) -> Self {
        Self(Widths::from_anisotropy(roughness, anisotropy))
    }

    /// The widths of the distribution.
    #[inline(always)]
    pub fn widths(self) -> Widths {
        self.0
    }

    /// True if the distribution depends on tangents; see [`Widths::has_tangent`].
    pub fn has_tangent(self) -> bool {
        self.0.has_tangent()
    }

    /// True if the surface counts as perfectly smooth; see [`Widths::is_smooth`].
    #[inline(always)]
    pub fn is_smooth(self) -> bool {
        self.0.is_smooth()
    }

    /// [`Widths::root`], the only square root in the masking functions.
    #[inline(always)]
    fn root(self, w: Vec3) -> f32 {
        self.0.root(w)
    }

    /// Density of microfacet normals `m`, per steradian and unit of surface area.
    #[inline(always)]
    pub fn density(self, m: Vec3) -> f32 {
        let area = self.0.x * self.0.y;
        let (x, y, z) = (m.x * self.0.y, m.y * self.0.x, m.z * area);
        let e = x * x + y * y + z * z;
        let ratio = area / e;
        ratio * ratio * area * FRAC_1_PI
    }

    /// `G1(w)`: the fraction of the facets that face `w` which is visible from there.
    pub fn masking(self, w: Vec3) -> f32 {
        2.0 * w.z / (w.z + self.root(w))
    }

    /// Area of the facets that are visible from `wo`, projected to it, per unit of surface.
    #[inline(always)]
    pub(super) fn visible_area(self, wo: Vec3) -> f32 {
        0.5 * (wo.z + self.root(wo))
    }

    /// `G2(wo, wi) / (4 wo.z wi.z)`.
    #[inline(always)]
    pub(super) fn visibility(self, wo: Vec3, wi: Vec3) -> f32 {
        0.5 / (wo.z * self.root(wi) + wi.z * self.root(wo))
    }

    /// `G2(wo, wi) / G1(wo)`: the weight of a sample of the visible normals.
    pub fn shadowing(self, wo: Vec3, wi: Vec3) -> f32 {
        let (ro, ri) = (self.root(wo), self.root(wi));
        wi.z * (wo.z + ro) / (wo.z * ri + wi.z * ro)
    }

    /// The facet normal halfway between a direction of the stretched hemisphere and another one,
    /// which is given by its height and azimuth.
    #[inline(always)]
    fn half_vector(self, stretched: Vec3, z: f32, azimuth: f32) -> Vec3 {
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = super::turn(azimuth);
        let half = Vec3::new(r * cos, r * sin, z) + stretched;
        unit_or(Vec3::new(half.x * self.0.x, half.y * self.0.y, half.z.max(0.0)), Vec3::Z)
    }

    #[inline(always)]
    fn stretch(self, w: Vec3) -> Vec3 {
        unit_or(Vec3::new(w.x * self.0.x, w.y * self.0.y, w.z), Vec3::Z)
    }

    /// Samples a facet normal among those visible from `wo` (Dupuy and Benyoub, Sampling Visible
    /// GGX Normals with Spherical Caps, HPG 2023).
    #[inline(always)]
    pub fn sample_visible_normal(self, wo: Vec3, u: Vec2) -> Vec3 {
        let stretched = self.stretch(wo);
        self.half_vector(stretched, (1.0 - u.y) * (1.0 + stretched.z) - stretched.z, u.x)
    }

    /// Density of [`Self::sample_visible_normal`] per steradian of normals.
    pub fn visible_normal_pdf(self, wo: Vec3, m: Vec3) -> f32 {
        self.density(m) * wo.dot(m).max(0.0) * 2.0 / (wo.z + self.root(wo))
    }

    /// The facet normal that reflects `wi` to `wo`, and the value `f |cos(wi)|` of that reflection
    /// by facets of reflectance 1. `None` if no facet does.
    pub fn reflection(self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
        self.reflection_and_pdf(wo, wi).map(|(m, value, _)| (m, value))
    }

    /// The results of [`Self::reflection`], with [`Self::reflection_pdf`].
    #[inline]
    pub fn reflection_and_pdf(self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32, f32)> {
        let (m, value, pdf, exists) = self.reflected(wo, wi);
        exists.then_some((m, value, pdf))
    }

    /// [`Self::reflection_and_pdf`] without branches, so that loops over it become vector code. The
    /// flag is false where no facet reflects `wi` to `wo`.
    #[inline(always)]
    pub(super) fn reflected(self, wo: Vec3, wi: Vec3) -> (Vec3, f32, f32, bool) {
        let half = wo + wi;
        let scale = 1.0 / half.length();
        let m = half * scale;
        let density = self.density(m);
        let pdf = density * 0.5 / (self.cap(wo) * wo.z + self.root(wo));
        let pdf = if wi.z > 0.0 { pdf } else { 0.0 };
        let exists = (scale > 0.0) & (scale < f32::INFINITY) & (m.z > 0.0);
        (m, density * self.visibility(wo, wi) * wi.z, pdf, exists)
    }

    /// Factor on the lower bound of the spherical cap that leaves out most reflections below the
    /// surface (Eto and Tokuyoshi, Bounded VNDF Sampling for Smith-GGX Reflections, SIGGRAPH Asia
    /// 2023, equations 5 and 6).
    #[inline(always)]
    fn cap(self, wo: Vec3) -> f32 {
        let a = self.0.x.min(self.0.y).min(1.0);
        let s = 1.0 + (wo.x * wo.x + wo.y * wo.y).sqrt();
        let (a2, s2) = (a * a, s * s);
        (1.0 - a2) * s2 / (s2 + a2 * wo.z * wo.z)
    }

    /// Samples a direction into which facets visible from `wo` reflect it. Most facets that would
    /// reflect below the surface are left out (Eto and Tokuyoshi); `None` if the sampled direction
    /// is still below.
    pub fn sample_reflection(self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let (wi, exists) = self.drawn_reflection(wo, u);
        exists.then_some(wi)
    }

    /// [`Self::sample_reflection`] without branches, so that loops over it become vector code. The
    /// flag is false where that returns `None`.
    #[inline(always)]
    pub(super) fn drawn_reflection(self, wo: Vec3, u: Vec2) -> (Vec3, bool) {
        let stretched = self.stretch(wo);
        let lowest = self.cap(wo) * stretched.z;
        let m = self.half_vector(stretched, (1.0 - u.y) * (1.0 + lowest) - lowest, u.x);
        let wi = super::fresnel::reflect(wo, m);
        (wi, wi.z > 0.0)
    }

    /// Density of [`Self::sample_reflection`] per steradian of `wi`.
    pub fn reflection_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        self.reflection_and_pdf(wo, wi).map_or(0.0, |(.., pdf)| pdf)
    }

    /// Density per steradian of `wi` when `wo` is reflected at a normal sampled by
    /// [`Self::sample_visible_normal`].
    pub fn visible_reflection_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        match (wo + wi).try_normalize() {
            Some(m) if m.z > 0.0 => self.density(m) * 0.5 / (wo.z + self.root(wo)),
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::{rng::uniform2, sampling::uniform_sphere};
    use std::f32::consts::PI;

    #[test]
    fn projected_facets_cover_the_surface_once() {
        for ggx in [0.3, 0.6, 1.0]
            .map(Ggx::from_roughness)
            .into_iter()
            .chain([Ggx::from_anisotropy(0.7, 0.6)])
        {
            let n = 400_000;
            let mut sum = 0.0f64;
            for i in 0..n {
                let mut m = uniform_sphere(uniform2([i, 1, 0, 9]));
                m.z = m.z.abs();
                sum += f64::from(ggx.density(m) * m.z * 2.0 * PI);
            }
            let mean = sum / f64::from(n);
            assert!((mean - 1.0).abs() < 0.03, "{ggx:?}: {mean}");
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
            let weight = value / ggx.visible_reflection_pdf(wo, wi);
            assert!((weight - ggx.shadowing(wo, wi)).abs() < 1e-3, "{weight}");
            assert!(weight <= 1.0 + 1e-4);
        }
    }

    #[test]
    fn the_bound_loses_fewer_samples_and_none_of_the_light() {
        for ggx in
            [Ggx::from_roughness(1.0), Ggx::from_roughness(0.6), Ggx::from_anisotropy(0.8, 0.7)]
        {
            for wo in [Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.1, 0.98, 0.15)] {
                let (wo, n) = (wo.normalize(), 40_000);
                let (mut kept, mut visible, mut sums) = (0, 0, [0.0f64; 2]);
                for i in 0..n {
                    let u = uniform2([i, 3, 0, 9]);
                    if let Some(wi) = ggx.sample_reflection(wo, u) {
                        kept += 1;
                        let value = ggx.reflection(wo, wi).map_or(0.0, |r| r.1);
                        sums[0] += f64::from(value / ggx.reflection_pdf(wo, wi));
                    }
                    let wi = super::super::fresnel::reflect(wo, ggx.sample_visible_normal(wo, u));
                    if wi.z > 0.0 {
                        visible += 1;
                        sums[1] += f64::from(ggx.shadowing(wo, wi));
                    }
                }
                assert!(kept > visible, "{ggx:?} {wo}: {kept} of {visible}");
                let [bounded, plain] = sums.map(|s| s / f64::from(n));
                assert!((bounded - plain).abs() < 0.01, "{ggx:?} {wo}: {bounded} {plain}");
            }
        }
    }
}
