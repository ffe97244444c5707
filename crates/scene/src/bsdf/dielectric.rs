//! Glass, water: reflection and refraction at one interface.
//!
//! Refraction changes the solid angle of a beam, so the radiance a camera path sees through the
//! interface is scaled by the squared ratio of the indices, as in Physically Based Rendering,
//! section 9.5.2 ("non-symmetric scattering"): a path that enters glass from air gets the factor
//! `1 / ior^2`, and gets it back when it leaves. Throughput inside glass is therefore small without
//! being unimportant: Russian roulette compensates for it ([`Lobes::crossing_scale`]).

use super::batch::{BatchLobes, LobeSpectra};
use super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::energy::{BouncedLobe, DielectricLoss, DielectricLossLines};
use super::film::{NoFilm, ThinFilm};
use super::microfacets::{Facets, KnownFacets, Rough};
use super::mirror::mirror_branch;
use super::{Drawn, Lobes, Microfacets, SpecularBranch, fresnel, lift, lower_like};
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// The parameters of an interface between the outside (`z > 0`, index 1) and a medium.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
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

/// Reflectance of a facet without a film, and with one if there is one, at an interface with this
/// index of refraction inside over outside. `cos` is the cosine on the side from which the relative
/// index is `eta`.
#[inline(always)]
fn reflectance(film: Option<ThinFilm>, ior: f32, cos: f32, eta: f32) -> (f32, SampledSpectrum) {
    let plain = fresnel::dielectric(cos, eta);
    let f = SampledSpectrum::splat(plain);
    let Some(film) = film.filter(|_| plain < 1.0) else { return (plain, f) };
    // The film knows the angle on the outer side only.
    let is_outside = eta == ior;
    let cos =
        if is_outside { cos } else { (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt() };
    (plain, film.reflectance(cos, SampledSpectrum::splat(fresnel::f0_from_ior(ior)), f))
}

/// Facets of a rough interface that reflect and refract (Walter et al., Microfacet Models for
/// Refraction through Rough Surfaces, EGSR 2007, with visible normals), and a diffuse lobe on both
/// sides for the light that bounces between facets, so that a clear interface loses nothing at any
/// roughness.
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricLobe<M, L, F, C> {
    microfacets: M,
    film: F,
    bounced_lobe: BouncedLobe,
    /// The loss by single facets. This and the following fields have values as seen from the outer
    /// side and from the inner one.
    losses: L,
    /// Loss of diffuse light.
    average: [f32; 2],
    /// Share of the loss that is transmitted.
    transmitted: [f32; 2],
    /// Index of refraction behind the surface over the index in front of it.
    eta: [f32; 2],
    /// The spectra where they are the same everywhere.
    own: C,
}

/// The loss by single facets of a rough interface.
pub(super) trait SideLosses {
    /// The share lost towards (equally: from) a direction above as seen from a side.
    fn towards(&self, is_inside: bool, w: Vec3) -> f32;
}

impl SideLosses for [DielectricLoss; 2] {
    fn towards(&self, is_inside: bool, w: Vec3) -> f32 {
        self[usize::from(is_inside)].towards(w)
    }
}

impl SideLosses for DielectricLossLines {
    #[inline(always)]
    fn towards(&self, is_inside: bool, w: Vec3) -> f32 {
        self.towards(is_inside, w)
    }
}

/// The spectra of an interface.
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricColors {
    tint: SampledSpectrum,
    /// Factor on reflected light on the outer side and on the inner one.
    mirror_tint: [SampledSpectrum; 2],
    /// Factor on radiance that crosses, as seen from both sides: tint and change of solid angle.
    crossing: [SampledSpectrum; 2],
}

impl DielectricColors {
    #[inline(always)]
    fn new(spectra: &LobeSpectra, eta: [f32; 2]) -> Self {
        let &LobeSpectra { base: tint, specular: outer, other: inner } = spectra;
        // (Where nothing is refracted, both sides are the outer one.)
        let inner = outer.zip(inner, |outer, inner| if eta[1] == eta[0] { outer } else { inner });
        Self {
            tint,
            mirror_tint: [outer, inner],
            crossing: eta.map(|eta| tint * Split::compression(eta)),
        }
    }

    /// Share of light that is reflected or transmitted.
    #[inline(always)]
    fn albedo(&self, seen: &DielectricSeen, reflectance: SampledSpectrum) -> SampledSpectrum {
        of_side(&self.mirror_tint, seen) * reflectance
            + self.tint * (SampledSpectrum::ONE - reflectance)
    }
}

#[inline(always)]
fn of_side(of: &[SampledSpectrum; 2], seen: &DielectricSeen) -> SampledSpectrum {
    of[0].zip(of[1], |outer, inner| if seen.is_inside { inner } else { outer })
}

/// An interface seen from a direction.
#[derive(Clone, Debug)]
pub struct DielectricSeen {
    wo: Vec3,
    /// The side of the direction.
    is_inside: bool,
    /// Index of refraction behind the surface over the index on the side of the direction.
    eta: f32,
    /// The loss of a rough interface for the direction, in the lane with the largest one, and the
    /// share of it that is transmitted.
    lost: f32,
    transmitted: f32,
    /// The loss of each lane over the largest one; not used without a film.
    lost_by_lane: SampledSpectrum,
}

impl<M: Facets, L: SideLosses, F: Into<Option<ThinFilm>> + Copy, C> DielectricLobe<M, L, F, C> {
    /// The loss of the interface under a film for a direction above, from which the relative index
    /// is `eta`: in the lane with the largest one, and that of each lane over it. `plain` is the
    /// loss without the film, which changes how much each facet reflects instead of transmitting,
    /// and thereby what other facets shadow.
    ///
    /// The lost light leaves the surface as if there was no film. So all of it is seen from any
    /// direction, but the lobe is reciprocal only up to what the film changes of the loss.
    fn lost_under(&self, film: ThinFilm, wo: Vec3, eta: f32, plain: f32) -> (f32, SampledSpectrum) {
        let facets = self.microfacets.get();
        let kept = facets.mean_over_facets::<96>(wo, |wo, u| {
            let m = facets.sample_visible_normal(wo, u);
            let cos = wo.dot(m);
            let (without, with) = reflectance(Some(film), self.eta[0], cos, eta);
            if without >= 1.0 {
                return SampledSpectrum::ZERO;
            }
            let shadowing = |wi: Vec3| if wi.z > 0.0 { facets.shadowing(wo, wi) } else { 0.0 };
            let (refracted, _) = fresnel::refracted(wo, m, eta);
            let more = shadowing(fresnel::reflect(wo, m)) - shadowing(-refracted);
            (with - SampledSpectrum::splat(without)) * more
        });
        let lost = (SampledSpectrum::splat(plain) - kept).clamp(0.0, 1.0);
        let largest = lost.max_element();
        (largest, if largest > 0.0 { lost * (1.0 / largest) } else { SampledSpectrum::ONE })
    }

    /// Value and density of the facet that takes `wi` to `wo` by reflection or refraction; `wo`
    /// above and `wi` mirrored likewise.
    #[inline(always)]
    fn facets(
        &self,
        colors: &DielectricColors,
        seen: &DielectricSeen,
        wo: Vec3,
        wi: Vec3,
    ) -> (SampledSpectrum, f32) {
        let (eta, is_transmission) = (seen.eta, wi.z < 0.0);
        let half = wo + wi * if is_transmission { eta } else { 1.0 };
        let scale = 1.0 / half.length();
        let m = half * scale;
        let m = select(m.z < 0.0, -m, m);
        // Facets seen from behind do not count.
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        let is_sound = (scale > 0.0) & (scale < f32::INFINITY);
        let exists = is_sound & (m.z > 0.0) & (cos_o > 0.0) & (cos_i * wi.z > 0.0);
        let (plain, reflectance) = reflectance(self.film.into(), self.eta[0], cos_o, eta);
        let up = lift(wi);
        let facets = self.microfacets.get();
        let (density, visibility) = (facets.density(m), facets.visibility(wo, up));
        // Density of refracted directions per density of facet normals (Walter et al., equation
        // 17).
        let denominator = cos_i + cos_o / eta;
        let jacobian =
            if denominator == 0.0 { 0.0 } else { cos_i.abs() / (denominator * denominator) };
        let flux = density * 4.0 * visibility * up.z * cos_o.abs() * jacobian;
        let area = facets.visible_area(wo);
        let reflected_pdf = density * 0.25 / area * plain;
        let refracted_pdf = density * cos_o.max(0.0) / area * jacobian * (1.0 - plain);
        let mirror_tint = of_side(&colors.mirror_tint, seen);
        let crossing = of_side(&colors.crossing, seen);
        let reflected = mirror_tint * reflectance * (density * visibility * up.z);
        let refracted = crossing * (SampledSpectrum::ONE - reflectance) * flux;
        let value = reflected.zip(refracted, |reflected, refracted| {
            let value = if is_transmission { refracted } else { reflected };
            if exists { value } else { 0.0 }
        });
        let pdf = if is_transmission { refracted_pdf } else { reflected_pdf };
        (value, if exists { pdf } else { 0.0 })
    }
}

impl<M: Facets, L: SideLosses, F: Into<Option<ThinFilm>> + Copy, C> BranchlessLobes
    for DielectricLobe<M, L, F, C>
{
    type Seen = DielectricSeen;
    type Colors = DielectricColors;

    #[inline(always)]
    fn seen(&self, _colors: &DielectricColors, wo: Vec3) -> DielectricSeen {
        let is_inside = wo.z <= 0.0;
        let pick = |[outer, inner]: [f32; 2]| if is_inside { inner } else { outer };
        let (up, eta) = (lift(wo), pick(self.eta));
        let plain = self.losses.towards(is_inside, up);
        let (lost, lost_by_lane) = match self.film.into() {
            None => (plain, SampledSpectrum::ONE),
            Some(film) => self.lost_under(film, up, eta, plain),
        };
        let transmitted = pick(self.transmitted);
        DielectricSeen { wo, is_inside, eta, lost, transmitted, lost_by_lane }
    }

    #[inline(always)]
    fn value_and_pdf_from(
        &self,
        colors: &DielectricColors,
        seen: &DielectricSeen,
        wi: Vec3,
    ) -> (SampledSpectrum, f32) {
        let is_seen = seen.wo.z * wi.z != 0.0;
        let (wo, wi) = (lift(seen.wo), lower_like(wi, seen.wo));
        let (facets, facet_pdf) = self.facets(colors, seen, wo, wi);
        let is_transmission = wi.z < 0.0;
        let to_inside = seen.is_inside != is_transmission;
        let average = if to_inside { self.average[1] } else { self.average[0] };
        let loss = self.losses.towards(to_inside, lift(wi));
        let diffuse = seen.lost * loss / average * wi.z.abs() * FRAC_1_PI;
        let (mirror_tint, crossing) =
            (of_side(&colors.mirror_tint, seen), of_side(&colors.crossing, seen));
        let side = if is_transmission { seen.transmitted } else { 1.0 - seen.transmitted };
        let tint = mirror_tint
            .zip(crossing, |mirror, crossing| if is_transmission { crossing } else { mirror });
        let bounced = tint * (diffuse * side);
        let film: Option<ThinFilm> = self.film.into();
        let bounced = if film.is_some() { bounced * seen.lost_by_lane } else { bounced };
        let has_bounced = average > 0.0;
        let value = facets.zip(bounced, |facets, bounced| {
            let value = if has_bounced { facets + bounced } else { facets };
            if is_seen { value } else { 0.0 }
        });
        let bounced_pdf = self.bounced_lobe.pdf(wi.z.abs());
        let pdf = (1.0 - seen.lost) * facet_pdf + seen.lost * side * bounced_pdf;
        (value, if is_seen { pdf } else { 0.0 })
    }

    #[inline(always)]
    fn draw_from(
        &self,
        _colors: &DielectricColors,
        seen: &DielectricSeen,
        u_lobe: f32,
        u: Vec2,
    ) -> BranchlessDrawn {
        let &DielectricSeen { wo, eta, lost, transmitted, .. } = seen;
        let up = lift(wo);
        let is_bounced = u_lobe < lost;
        let bounced = self.bounced_lobe.sample(u);
        let bounced = Vec3::new(
            bounced.x,
            bounced.y,
            if u_lobe < lost * transmitted { -bounced.z } else { bounced.z },
        );
        let m = if M::IS_KNOWN || !is_bounced {
            self.microfacets.get().sample_visible_normal(up, u)
        } else {
            Vec3::Z
        };
        let is_refracted = (u_lobe - lost) / (1.0 - lost) >= fresnel::dielectric(up.dot(m), eta);
        let (refracted, is_partial) = fresnel::refracted(up, m, eta);
        let facet = select(is_refracted, refracted, fresnel::reflect(up, m));
        let is_sound =
            (is_partial | !is_refracted) & (facet.z != 0.0) & ((facet.z < 0.0) == is_refracted);
        let wi = select(is_bounced, bounced, facet);
        let is_transmission = wi.z < 0.0;
        BranchlessDrawn {
            wi: lower_like(wi, wo),
            exists: (is_bounced | is_sound) & (wo.z != 0.0),
            is_delta: false,
            delta: SampledSpectrum::ZERO,
            is_transmission,
            crossing: if is_transmission { eta * eta } else { 1.0 },
        }
    }

    #[inline(always)]
    fn albedo_from(&self, colors: &DielectricColors, seen: &DielectricSeen) -> SampledSpectrum {
        let (_, f) = reflectance(self.film.into(), self.eta[0], seen.wo.z.abs(), seen.eta);
        colors.albedo(seen, f)
    }
}

/// The [`DielectricLobe`] of any interface. It is expensive to make, so points that differ only in
/// their spectra share one.
type RoughLobe = DielectricLobe<Microfacets, [DielectricLoss; 2], Option<ThinFilm>, ()>;

impl RoughLobe {
    /// The lobe of a rough interface; `None` if it is smooth or the indices are equal.
    fn new(interface: &Interface) -> Option<Self> {
        let &Interface { ior, microfacets, film, .. } = interface;
        // With equal indices nothing is refracted at any roughness.
        if microfacets.is_smooth() || (ior - 1.0).abs() < 1e-4 {
            return None;
        }
        let eta = [ior, 1.0 / ior];
        let losses = eta.map(|eta| DielectricLoss::new(microfacets, eta));
        let average @ [outer, inner] = losses.each_ref().map(DielectricLoss::average);
        // This share of diffuse light from the side of lower index is transmitted. Both directions
        // of the crossing must then carry the same light per squared index, which limits it.
        let through = 1.0 - fresnel::dielectric_average(ior.max(1.0 / ior));
        let transmitted = |eta: f32, near: f32, far: f32| {
            if near > 0.0 { through * (eta * eta * far / near).min(1.0) } else { 0.0 }
        };
        Some(Self {
            microfacets,
            film,
            bounced_lobe: BouncedLobe::new(microfacets.widths()),
            losses,
            average,
            transmitted: [transmitted(eta[0], outer, inner), transmitted(eta[1], inner, outer)],
            eta,
            own: (),
        })
    }

    /// The lobe if an interface has the same roughness and index, with the film of that one.
    fn again(&self, &Interface { ior, microfacets, film, .. }: &Interface) -> Option<Self> {
        (self.microfacets == microfacets && self.eta[0] == ior).then_some(Self { film, ..*self })
    }
}

/// An [`Interface`]: a [`DielectricLobe`] if it is rough, delta lobes if it is smooth. Make it with
/// [`DielectricBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct DielectricBsdf {
    interface: Interface,
    colors: DielectricColors,
    rough: Option<RoughLobe>,
}

impl DielectricBsdf {
    /// The BSDF of an interface.
    pub fn new(interface: Interface) -> Self {
        Self::like(None, interface)
    }

    /// The same as [`Self::new`], but tables of `other` are reused if it has the same roughness and
    /// index of refraction.
    pub(crate) fn like(other: Option<&Self>, interface: Interface) -> Self {
        let known = other.and_then(|other| other.rough?.again(&interface));
        let colors =
            DielectricColors::new(&interface.spectra(), [interface.ior, 1.0 / interface.ior]);
        Self { interface, colors, rough: known.or_else(|| RoughLobe::new(&interface)) }
    }

    /// The parameters of the interface.
    pub fn interface(&self) -> &Interface {
        &self.interface
    }

    /// True if the interface depends on tangents; see [`Microfacets::has_tangent`].
    pub(crate) fn has_tangent(&self) -> bool {
        self.interface.microfacets.has_tangent()
    }

    /// The spectra of the interface by their role in [`BatchGlass`].
    pub(super) fn spectra(&self) -> LobeSpectra {
        self.interface.spectra()
    }

    /// Factor for the absorption of the medium before a ray from `wo` arrived.
    fn absorbed(&self, wo: Vec3) -> SampledSpectrum {
        if wo.z < 0.0 { self.interface.arriving } else { SampledSpectrum::ONE }
    }

    /// Reflectance of a facet without the film, and with it.
    fn reflectance(&self, wo: Vec3, eta: f32) -> (f32, SampledSpectrum) {
        reflectance(self.interface.film, self.interface.ior, wo.z.abs(), eta)
    }

    /// Reflection and refraction at a smooth interface, and the probability of the first.
    fn branches(&self, seen: &DielectricSeen) -> (f32, [Option<SpecularBranch>; 2]) {
        let wo = seen.wo;
        let Split { eta, refracted, is_partial, .. } = Split::at(wo, self.interface.ior);
        let (plain, reflectance) = self.reflectance(wo, eta);
        let (absorbed, has_film) = (self.absorbed(wo), self.interface.film.is_some());
        let mirrored = of_side(&self.colors.mirror_tint, seen) * absorbed * reflectance;
        let reflection = (plain > 0.0 || has_film).then(|| mirror_branch(wo, mirrored));
        let crossing = of_side(&self.colors.crossing, seen);
        let transmission = is_partial.then(|| SpecularBranch {
            wi: refracted,
            weight: crossing * absorbed * (SampledSpectrum::ONE - reflectance),
            is_transmission: true,
        });
        let share = if has_film {
            plain.max(reflectance.max_element()).min(0.5 + 0.5 * plain)
        } else {
            plain
        };
        (share, [reflection, transmission])
    }
}

impl Interface {
    /// The spectra by their role in [`BatchGlass`].
    fn spectra(&self) -> LobeSpectra {
        let specular = self.reflection_tint * self.unit;
        LobeSpectra { base: self.tint, specular, other: self.unit }
    }
}

impl Lobes for DielectricBsdf {
    type Seen = DielectricSeen;

    fn seen(&self, wo: Vec3) -> DielectricSeen {
        match &self.rough {
            Some(lobe) => lobe.seen(&self.colors, wo),
            None => DielectricSeen {
                wo,
                is_inside: wo.z <= 0.0,
                eta: relative_ior(wo, self.interface.ior),
                lost: 0.0,
                transmitted: 0.0,
                lost_by_lane: SampledSpectrum::ONE,
            },
        }
    }

    fn crossing_scale(&self, wo: Vec3) -> f32 {
        let eta = relative_ior(wo, self.interface.ior);
        eta * eta
    }

    fn value_and_pdf_from(&self, seen: &DielectricSeen, wi: Vec3) -> (SampledSpectrum, f32) {
        let Some(lobe) = &self.rough else { return (SampledSpectrum::ZERO, 0.0) };
        let (value, pdf) = lobe.value_and_pdf_from(&self.colors, seen, wi);
        (value * self.absorbed(seen.wo), pdf)
    }

    fn draw_from(&self, seen: &DielectricSeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        if let Some(lobe) = &self.rough {
            return lobe.draw_from(&self.colors, seen, u_lobe, u).drawn();
        }
        if seen.wo.z == 0.0 {
            return None;
        }
        let (share, [reflection, transmission]) = self.branches(seen);
        if u_lobe < share {
            reflection.map(|b| b.drawn(share))
        } else {
            transmission.map(|b| b.drawn(1.0 - share))
        }
    }

    fn albedo_from(&self, seen: &DielectricSeen) -> SampledSpectrum {
        self.colors.albedo(seen, self.reflectance(seen.wo, seen.eta).1)
    }

    fn is_delta(&self) -> bool {
        self.rough.is_none()
    }

    fn ambient(&self, _wo: Vec3) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        if self.is_delta() { self.branches(&self.seen(wo)).1 } else { [None, None] }
    }
}

/// A rough interface of [`super::Ggx`] without a film, to a medium that absorbs nothing, for
/// batches of directions.
pub(super) type BatchGlass = DielectricLobe<Rough, DielectricLossLines, NoFilm, DielectricColors>;

impl BatchGlass {
    /// The lobe of such an interface; `None` for other ones.
    pub fn of(bsdf: &DielectricBsdf) -> Option<Self> {
        let Interface { film, arriving, .. } = bsdf.interface;
        if film.is_some() || arriving != SampledSpectrum::ONE {
            return None;
        }
        let lobe = bsdf.rough.as_ref()?;
        let [outer, inner] = &lobe.losses;
        Some(Self {
            microfacets: Rough::of(lobe.microfacets)?,
            film: NoFilm,
            bounced_lobe: lobe.bounced_lobe,
            losses: DielectricLossLines::new(outer, inner),
            average: lobe.average,
            transmitted: lobe.transmitted,
            eta: lobe.eta,
            own: bsdf.colors,
        })
    }
}

impl BatchLobes for BatchGlass {
    #[inline(always)]
    fn own_colors(&self, _body: SampledSpectrum) -> DielectricColors {
        self.own
    }

    #[inline(always)]
    fn colors_of(&self, spectra: &LobeSpectra) -> DielectricColors {
        DielectricColors::new(spectra, self.eta)
    }
}
