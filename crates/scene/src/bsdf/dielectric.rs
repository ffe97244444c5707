//! Glass, water: reflection and refraction at one interface.
//!
//! Refraction changes the solid angle of a beam, so the radiance a camera path sees through the interface is scaled by the squared
//! ratio of the indices, as in Physically Based Rendering, section 9.5.2 ("non-symmetric scattering"): a path that enters glass from
//! air gets the factor `1 / ior^2`, and gets it back when it leaves. Throughput inside glass is therefore small without being
//! unimportant: Russian roulette compensates for it ([`Lobes::crossing_scale`]).

use super::ggx::Ggx;
use super::mirror::mirror_branch;
use super::{BsdfSample, Lobes, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// An interface between the outside (`z > 0`, index 1) and a medium. Rough interfaces follow Walter et al., Microfacet Models for
/// Refraction through Rough Surfaces (EGSR 2007), with visible normals.
#[derive(Clone, Copy, Debug)]
pub struct DielectricBsdf {
    /// Index of refraction inside over outside, positive.
    pub ior: f32,
    /// Factor on light that crosses the interface.
    pub tint: SampledSpectrum,
    /// 1 in every lane in use, 0 elsewhere.
    pub unit: SampledSpectrum,
    /// Roughness.
    pub ggx: Ggx,
    /// Share of light that the medium lets through on the way from the last point to this one, for rays that come from the inside.
    /// It is no property of the interface, but there a path knows how far it went.
    pub arriving: SampledSpectrum,
}

/// A pair of directions seen from the side of `wo`, which is above.
struct Facet {
    wo: Vec3,
    wi: Vec3,
    /// Normal of the facet, above.
    m: Vec3,
    reflectance: f32,
}

impl DielectricBsdf {
    /// Index behind the surface over the index on the side of `wo`.
    fn relative_ior(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.ior } else { 1.0 / self.ior }
    }

    fn is_smooth(&self) -> bool {
        // With equal indices nothing bends, however rough the interface.
        self.ggx.is_smooth() || (self.ior - 1.0).abs() < 1e-4
    }

    /// Factor on radiance that crosses: tint and change of solid angle.
    fn crossing(&self, eta: f32) -> SampledSpectrum {
        self.tint * (1.0 / (eta * eta))
    }

    /// Factor for what the medium absorbed before a ray from `wo` arrived.
    fn absorbed(&self, wo: Vec3) -> SampledSpectrum {
        if wo.z < 0.0 { self.arriving } else { SampledSpectrum::ONE }
    }

    fn branches(&self, wo: Vec3) -> (f32, [Option<SpecularBranch>; 2]) {
        let (up, eta) = (lift(wo), self.relative_ior(wo));
        let reflectance = fresnel::dielectric(up.z, eta);
        let absorbed = self.absorbed(wo);
        let reflection = (reflectance > 0.0).then(|| mirror_branch(wo, self.unit * absorbed * reflectance));
        let transmission = fresnel::refract(up, Vec3::Z, eta).map(|wi| SpecularBranch {
            wi: lower_like(wi, wo),
            weight: self.crossing(eta) * absorbed * (1.0 - reflectance),
            is_transmission: true,
        });
        (reflectance, [reflection, transmission])
    }

    /// The facet that takes `wi` to `wo` by reflection or refraction.
    fn facet(&self, wo: Vec3, wi: Vec3, eta: f32) -> Option<Facet> {
        let (wo, wi) = (lift(wo), lower_like(wi, wo));
        let eta_i = if wi.z > 0.0 { 1.0 } else { eta };
        let m = (wo + wi * eta_i).try_normalize()?;
        let m = if m.z < 0.0 { -m } else { m };
        // Facets seen from behind do not count.
        if m.z <= 0.0 || wo.dot(m) <= 0.0 || wi.dot(m) * wi.z <= 0.0 {
            return None;
        }
        Some(Facet { wo, wi, m, reflectance: fresnel::dielectric(wo.dot(m), eta) })
    }

    /// Density of refracted directions per density of facet normals (Walter et al., equation 17).
    fn refraction_jacobian(f: &Facet, eta: f32) -> f32 {
        let denominator = f.wi.dot(f.m) + f.wo.dot(f.m) / eta;
        if denominator == 0.0 { 0.0 } else { f.wi.dot(f.m).abs() / (denominator * denominator) }
    }

    fn facet_pdf(&self, f: &Facet, eta: f32) -> f32 {
        if f.wi.z > 0.0 {
            self.ggx.reflection_pdf(f.wo, f.wi) * f.reflectance
        } else {
            self.ggx.visible_normal_pdf(f.wo, f.m) * Self::refraction_jacobian(f, eta) * (1.0 - f.reflectance)
        }
    }
}

impl Lobes for DielectricBsdf {
    fn crossing_scale(&self, wo: Vec3) -> f32 {
        let eta = self.relative_ior(wo);
        eta * eta
    }

    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if self.is_smooth() || wo.z * wi.z == 0.0 {
            return SampledSpectrum::ZERO;
        }
        let eta = self.relative_ior(wo);
        let Some(f) = self.facet(wo, wi, eta) else { return SampledSpectrum::ZERO };
        let value = if f.wi.z > 0.0 {
            let value = self.ggx.reflection(f.wo, f.wi).map_or(0.0, |(_, value)| value);
            self.unit * (value * f.reflectance)
        } else {
            let flux = self.ggx.refraction_flux(f.wo, lift(f.wi), f.m);
            self.crossing(eta) * (flux * Self::refraction_jacobian(&f, eta) * (1.0 - f.reflectance))
        };
        value * self.absorbed(wo)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.is_smooth() || wo.z * wi.z == 0.0 {
            return 0.0;
        }
        let eta = self.relative_ior(wo);
        self.facet(wo, wi, eta).map_or(0.0, |f| self.facet_pdf(&f, eta))
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        if self.is_smooth() {
            let (reflectance, [reflection, transmission]) = self.branches(wo);
            return if u_lobe < reflectance {
                reflection.map(|b| b.sample(reflectance))
            } else {
                transmission.map(|b| b.sample(1.0 - reflectance))
            };
        }
        let (up, eta) = (lift(wo), self.relative_ior(wo));
        let m = self.ggx.sample_visible_normal(up, u);
        let reflectance = fresnel::dielectric(up.dot(m), eta);
        let is_transmission = u_lobe >= reflectance;
        let (wi, factor) = if is_transmission {
            (fresnel::refract(up, m, eta)?, self.crossing(eta))
        } else {
            (fresnel::reflect(up, m), self.unit)
        };
        if (wi.z < 0.0) != is_transmission || wi.z == 0.0 {
            return None;
        }
        let pdf = self.facet_pdf(&Facet { wo: up, wi, m, reflectance }, eta);
        (pdf > 0.0).then(|| BsdfSample {
            wi: lower_like(wi, wo),
            weight: factor * self.absorbed(wo) * self.ggx.shadowing(up, lift(wi)),
            pdf,
            is_delta: false,
            is_transmission,
        })
    }

    fn is_delta(&self) -> bool {
        self.is_smooth()
    }

    fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        let reflectance = fresnel::dielectric(wo.z.abs(), self.relative_ior(wo));
        self.unit * reflectance + self.tint * (1.0 - reflectance)
    }

    fn ambient(&self, _wo: Vec3) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        if self.is_smooth() { self.branches(wo).1 } else { [None, None] }
    }
}
