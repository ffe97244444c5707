//! Glass, water: reflection and refraction at one interface.
//!
//! Refraction changes the solid angle of a beam, so the radiance a camera path sees through the
//! interface is scaled by the squared ratio of the indices, as in Physically Based Rendering,
//! section 9.5.2 ("non-symmetric scattering"): a path that enters glass from air gets the factor
//! `1 / ior^2`, and gets it back when it leaves. Throughput inside glass is therefore small without
//! being unimportant: Russian roulette compensates for it ([`Lobes::crossing_scale`]).

mod batch;

use super::batch::LobeSpectra;
use super::energy::{BouncedLobe, DielectricLoss};
use super::film::ThinFilm;
use super::mirror::mirror_branch;
use super::{Drawn, Lobes, Microfacets, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{SampledSpectrum, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

pub(super) use batch::BatchGlass;

/// An interface between the outside (`z > 0`, index 1) and a medium. Rough interfaces follow Walter
/// et al., Microfacet Models for Refraction through Rough Surfaces (EGSR 2007), with visible
/// normals. Diffuse lobes on both sides add the light that bounces between facets, so that a clear
/// interface loses nothing at any roughness.
#[derive(Clone, Copy, Debug)]
pub struct DielectricBsdf {
    /// Index of refraction inside over outside, positive.
    pub ior: f32,
    /// Factor on light that crosses the interface.
    pub tint: SampledSpectrum,
    /// Factor on light that is reflected on the outer side; 1 for a real interface.
    pub reflection_tint: SampledSpectrum,
    /// 1 in every lane in use, 0 elsewhere.
    pub unit: SampledSpectrum,
    /// A film on the interface.
    pub film: Option<ThinFilm>,
    /// Roughness.
    pub microfacets: Microfacets,
    /// The loss of a rough interface; `None` for a smooth one. See [`Self::losses`].
    pub losses: Option<RoughLosses>,
    /// Transmittance of the medium from the last point to this one, for rays from inside. It is no
    /// property of the interface, but the path length is known here.
    pub arriving: SampledSpectrum,
}

/// Reflection and refraction of light from one direction at a smooth interface without a film.
#[derive(Clone, Copy, Debug)]
pub struct Split {
    /// Index of refraction behind the surface over the index on the side of the direction.
    pub eta: f32,
    /// Share that is reflected.
    pub reflectance: f32,
    /// The refracted direction, if [`Self::is_partial`].
    pub refracted: Vec3,
    /// False if all is reflected.
    pub is_partial: bool,
}

impl Split {
    /// Computes it for light seen from `wo`, at an interface with this index of refraction inside
    /// over outside. Without branches, so that loops over it become vector code.
    #[inline(always)]
    pub fn at(wo: Vec3, ior: f32) -> Self {
        let (up, eta) = (lift(wo), relative_ior(wo, ior));
        let (wi, is_partial) = fresnel::refracted(up, Vec3::Z, eta);
        Self {
            eta,
            reflectance: fresnel::dielectric(up.z, eta),
            refracted: lower_like(wi, wo),
            is_partial,
        }
    }

    /// Factor on radiance that crosses, by the change of solid angle.
    #[inline(always)]
    pub fn compression(eta: f32) -> f32 {
        1.0 / (eta * eta)
    }
}

/// Index behind the surface over the index on the side of `wo`.
#[inline(always)]
fn relative_ior(wo: Vec3, ior: f32) -> f32 {
    if wo.z > 0.0 { ior } else { 1.0 / ior }
}

/// An interface seen from a direction.
#[derive(Clone, Debug)]
pub struct DielectricSeen {
    wo: Vec3,
    /// Index of refraction behind the surface over the index on the side of the direction.
    eta: f32,
    /// The loss of a rough interface for the direction.
    lost: f32,
}

/// Diffuse lobes in place of light that bounces between facets of a rough interface: the same for
/// all directions.
#[derive(Clone, Copy, Debug)]
pub struct RoughLosses {
    microfacets: Microfacets,
    ior: f32,
    lobe: BouncedLobe,
    /// Seen from the outer side, from the inner one.
    sides: [SideLoss; 2],
}

/// The loss on one side of a rough interface.
#[derive(Clone, Copy, Debug)]
struct SideLoss {
    loss: DielectricLoss,
    average: f32,
    /// Share of the loss that is transmitted.
    transmitted: f32,
}

impl RoughLosses {
    fn new(microfacets: Microfacets, ior: f32) -> Self {
        let losses =
            [DielectricLoss::new(microfacets, ior), DielectricLoss::new(microfacets, 1.0 / ior)];
        let [outer, inner] = [losses[0].average(), losses[1].average()];
        // This share of diffuse light from the side of lower index is transmitted. Both directions
        // of the crossing must then carry the same light per squared index, which limits it.
        let through = 1.0 - fresnel::dielectric_average(ior.max(1.0 / ior));
        let transmitted = |eta: f32, near: f32, far: f32| {
            if near > 0.0 { through * (eta * eta * far / near).min(1.0) } else { 0.0 }
        };
        let sides = [
            SideLoss {
                loss: losses[0],
                average: outer,
                transmitted: transmitted(ior, outer, inner),
            },
            SideLoss {
                loss: losses[1],
                average: inner,
                transmitted: transmitted(1.0 / ior, inner, outer),
            },
        ];
        Self { microfacets, ior, lobe: BouncedLobe::new(microfacets.widths()), sides }
    }

    /// The side that a direction is on.
    fn side(&self, w: Vec3) -> &SideLoss {
        &self.sides[usize::from(w.z <= 0.0)]
    }
}

/// A pair of directions seen from the side of `wo`, which is above.
struct Facet {
    wo: Vec3,
    wi: Vec3,
    /// Normal of the facet, above.
    m: Vec3,
}

impl DielectricBsdf {
    /// As [`Microfacets::has_tangent`].
    pub(crate) fn has_tangent(&self) -> bool {
        self.microfacets.has_tangent()
    }

    fn relative_ior(&self, wo: Vec3) -> f32 {
        relative_ior(wo, self.ior)
    }

    fn is_smooth(&self) -> bool {
        self.losses.is_none()
    }

    /// The losses of an interface. They are expensive for a rough one, so those of `other` are
    /// reused if it has the same roughness and index.
    pub fn losses(
        microfacets: Microfacets,
        ior: f32,
        like: Option<&RoughLosses>,
    ) -> Option<RoughLosses> {
        // With equal indices nothing is refracted at any roughness.
        if microfacets.is_smooth() || (ior - 1.0).abs() < 1e-4 {
            return None;
        }
        let known = like.filter(|known| known.microfacets == microfacets && known.ior == ior);
        Some(known.copied().unwrap_or_else(|| RoughLosses::new(microfacets, ior)))
    }

    /// Reflectance of a facet without a film, and with one if there is one.
    fn fresnel(&self, cos: f32, eta: f32) -> (f32, SampledSpectrum) {
        let plain = fresnel::dielectric(cos, eta);
        let f = SampledSpectrum::splat(plain);
        let Some(film) = self.film.filter(|_| plain < 1.0) else { return (plain, f) };
        // The film knows the angle on the outer side only.
        let outside = eta == self.ior;
        let cos =
            if outside { cos } else { (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt() };
        (plain, film.reflectance(cos, SampledSpectrum::splat(fresnel::f0_from_ior(self.ior)), f))
    }

    /// Its spectra, as [`BatchGlass`] needs them.
    pub(super) fn spectra(&self) -> LobeSpectra {
        LobeSpectra { base: self.tint, specular: self.mirror_tint(self.ior), other: self.unit }
    }

    /// Factor on reflected light on the side with this relative index.
    fn mirror_tint(&self, eta: f32) -> SampledSpectrum {
        if eta == self.ior { self.reflection_tint * self.unit } else { self.unit }
    }

    /// Factor on radiance that crosses: tint and change of solid angle.
    fn crossing(&self, eta: f32) -> SampledSpectrum {
        self.tint * Split::compression(eta)
    }

    /// Factor for the absorption of the medium before a ray from `wo` arrived.
    fn absorbed(&self, wo: Vec3) -> SampledSpectrum {
        if wo.z < 0.0 { self.arriving } else { SampledSpectrum::ONE }
    }

    fn branches(&self, wo: Vec3) -> (f32, [Option<SpecularBranch>; 2]) {
        let Split { eta, refracted, is_partial, .. } = Split::at(wo, self.ior);
        let (plain, reflectance) = self.fresnel(wo.z.abs(), eta);
        let absorbed = self.absorbed(wo);
        let mirrored = self.mirror_tint(eta) * absorbed * reflectance;
        let reflection = (plain > 0.0 || self.film.is_some()).then(|| mirror_branch(wo, mirrored));
        let transmission = is_partial.then(|| SpecularBranch {
            wi: refracted,
            weight: self.crossing(eta) * absorbed * (SampledSpectrum::ONE - reflectance),
            is_transmission: true,
        });
        let share = if self.film.is_some() {
            plain.max(reflectance.max_element()).min(0.5 + 0.5 * plain)
        } else {
            plain
        };
        (share, [reflection, transmission])
    }

    /// The facet that takes `wi` to `wo` by reflection or refraction; `wo` above.
    fn facet(&self, wo: Vec3, wi: Vec3, eta: f32) -> Option<Facet> {
        let eta_i = if wi.z > 0.0 { 1.0 } else { eta };
        let m = (wo + wi * eta_i).try_normalize()?;
        let m = if m.z < 0.0 { -m } else { m };
        // Facets seen from behind do not count.
        if m.z <= 0.0 || wo.dot(m) <= 0.0 || wi.dot(m) * wi.z <= 0.0 {
            return None;
        }
        Some(Facet { wo, wi, m })
    }

    /// Density of refracted directions per density of facet normals (Walter et al., equation 17).
    fn refraction_jacobian(f: &Facet, eta: f32) -> f32 {
        let denominator = f.wi.dot(f.m) + f.wo.dot(f.m) / eta;
        if denominator == 0.0 { 0.0 } else { f.wi.dot(f.m).abs() / (denominator * denominator) }
    }

    /// Density of the facets only.
    fn facet_pdf(&self, f: &Facet, eta: f32) -> f32 {
        let reflectance = fresnel::dielectric(f.wo.dot(f.m), eta);
        if f.wi.z > 0.0 {
            self.microfacets.visible_reflection_pdf(f.wo, f.wi) * reflectance
        } else {
            self.microfacets.visible_normal_pdf(f.wo, f.m)
                * Self::refraction_jacobian(f, eta)
                * (1.0 - reflectance)
        }
    }

    /// Value of the facets only, for `wo` above.
    fn facet_value(&self, f: &Facet, eta: f32) -> SampledSpectrum {
        let reflectance = self.fresnel(f.wo.dot(f.m), eta).1;
        if f.wi.z > 0.0 {
            let value = self.microfacets.reflection(f.wo, f.wi).map_or(0.0, |(_, value)| value);
            self.mirror_tint(eta) * reflectance * value
        } else {
            let flux = self.microfacets.refraction_flux(f.wo, lift(f.wi), f.m)
                * Self::refraction_jacobian(f, eta);
            self.crossing(eta) * (SampledSpectrum::ONE - reflectance) * flux
        }
    }

    /// `f |cos(wi)|` with facets and diffuse lobes, for `wo` above; `wi` mirrored likewise.
    fn value(
        &self,
        facet: Option<&Facet>,
        wi: Vec3,
        seen: &DielectricSeen,
        losses: &RoughLosses,
    ) -> SampledSpectrum {
        let (eta, transmitted) = (seen.eta, losses.side(seen.wo).transmitted);
        let facets = facet.map_or(SampledSpectrum::ZERO, |f| self.facet_value(f, eta));
        let to = losses.side(lower_like(wi, seen.wo));
        if to.average <= 0.0 {
            return facets;
        }
        let diffuse = seen.lost * to.loss.towards(lift(wi)) / to.average * wi.z.abs() * FRAC_1_PI;
        facets
            + if wi.z < 0.0 {
                self.crossing(eta) * (diffuse * transmitted)
            } else {
                self.mirror_tint(eta) * (diffuse * (1.0 - transmitted))
            }
    }

    /// The density, likewise.
    fn mixture_pdf(
        &self,
        facet: Option<&Facet>,
        wi: Vec3,
        seen: &DielectricSeen,
        losses: &RoughLosses,
    ) -> f32 {
        let facets = facet.map_or(0.0, |f| self.facet_pdf(f, seen.eta));
        let transmitted = losses.side(seen.wo).transmitted;
        let side = if wi.z < 0.0 { transmitted } else { 1.0 - transmitted };
        (1.0 - seen.lost) * facets + seen.lost * side * losses.lobe.pdf(wi.z.abs())
    }

    /// A direction for `wo` above.
    fn sample_rough(
        &self,
        seen: &DielectricSeen,
        losses: &RoughLosses,
        u_lobe: f32,
        u: Vec2,
    ) -> Option<Vec3> {
        let &DielectricSeen { wo, eta, lost } = seen;
        let up = lift(wo);
        if u_lobe < lost {
            let wi = losses.lobe.sample(u);
            let is_transmission = u_lobe < lost * losses.side(wo).transmitted;
            return Some(if is_transmission { Vec3::new(wi.x, wi.y, -wi.z) } else { wi });
        }
        let m = self.microfacets.sample_visible_normal(up, u);
        let is_transmission = (u_lobe - lost) / (1.0 - lost) >= fresnel::dielectric(up.dot(m), eta);
        let wi =
            if is_transmission { fresnel::refract(up, m, eta)? } else { fresnel::reflect(up, m) };
        (wi.z != 0.0 && (wi.z < 0.0) == is_transmission).then_some(wi)
    }
}

impl Lobes for DielectricBsdf {
    type Seen = DielectricSeen;

    fn seen(&self, wo: Vec3) -> DielectricSeen {
        let eta = self.relative_ior(wo);
        let lost =
            self.losses.as_ref().map_or(0.0, |losses| losses.side(wo).loss.towards(lift(wo)));
        DielectricSeen { wo, eta, lost }
    }

    fn crossing_scale(&self, wo: Vec3) -> f32 {
        let eta = self.relative_ior(wo);
        eta * eta
    }

    fn value_and_pdf_from(&self, seen: &DielectricSeen, wi: Vec3) -> (SampledSpectrum, f32) {
        let &DielectricSeen { wo, eta, .. } = seen;
        let Some(losses) = self.losses.as_ref().filter(|_| wo.z * wi.z != 0.0) else {
            return (SampledSpectrum::ZERO, 0.0);
        };
        let wi = lower_like(wi, wo);
        let facet = self.facet(lift(wo), wi, eta);
        let value = self.value(facet.as_ref(), wi, seen, losses) * self.absorbed(wo);
        (value, self.mixture_pdf(facet.as_ref(), wi, seen, losses))
    }

    fn draw_from(&self, seen: &DielectricSeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let wo = seen.wo;
        if wo.z == 0.0 {
            return None;
        }
        let Some(losses) = &self.losses else {
            let (share, [reflection, transmission]) = self.branches(wo);
            return if u_lobe < share {
                reflection.map(|b| b.drawn(share))
            } else {
                transmission.map(|b| b.drawn(1.0 - share))
            };
        };
        let wi = self.sample_rough(seen, losses, u_lobe, u)?;
        Some(Drawn::Direction { wi: lower_like(wi, wo), is_transmission: wi.z < 0.0 })
    }

    fn albedo_from(&self, seen: &DielectricSeen) -> SampledSpectrum {
        self.albedo(seen.wo)
    }

    fn is_delta(&self) -> bool {
        self.is_smooth()
    }

    fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        let eta = self.relative_ior(wo);
        let reflectance = self.fresnel(wo.z.abs(), eta).1;
        self.mirror_tint(eta) * reflectance + self.tint * (SampledSpectrum::ONE - reflectance)
    }

    fn ambient(&self, _wo: Vec3) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        if self.is_smooth() { self.branches(wo).1 } else { [None, None] }
    }
}
