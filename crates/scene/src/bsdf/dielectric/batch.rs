//! Rough glass, for batches of directions.

use super::super::batch::{BatchLobes, LobeSpectra};
use super::super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::super::energy::{BouncedLobe, DielectricLossLines};
use super::super::{Ggx, fresnel, lift, lower_like};
use super::{DielectricBsdf, Split};
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// A rough interface of [`Ggx`] without a film, to a medium that absorbs nothing.
#[derive(Clone, Debug)]
pub struct BatchGlass {
    ggx: Ggx,
    lobe: BouncedLobe,
    /// Values of the following fields, as seen from the outer side and from the inner one.
    losses: DielectricLossLines,
    eta: [f32; 2],
    average: [f32; 2],
    transmitted: [f32; 2],
    /// The spectra where they are the same everywhere.
    own: Colors,
}

/// Spectra of a lane.
#[derive(Clone, Copy, Debug)]
pub struct Colors {
    tint: SampledSpectrum,
    mirror_tint: [SampledSpectrum; 2],
    crossing: [SampledSpectrum; 2],
}

impl Colors {
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
}

/// As [`super::DielectricSeen`].
pub struct Seen {
    wo: Vec3,
    /// The side of the direction.
    is_inside: bool,
    eta: f32,
    lost: f32,
    transmitted: f32,
}

impl BatchGlass {
    /// `None` for other interfaces.
    pub fn of(bsdf: &DielectricBsdf) -> Option<Self> {
        let (losses, ggx) = (bsdf.losses.as_ref()?, bsdf.microfacets.ggx()?);
        let is_such = bsdf.film.is_none() && bsdf.arriving == SampledSpectrum::ONE;
        let eta = [bsdf.ior, 1.0 / bsdf.ior];
        let [outer, inner] = &losses.sides;
        is_such.then(|| Self {
            ggx,
            lobe: losses.lobe,
            losses: DielectricLossLines::new(&outer.loss, &inner.loss),
            eta,
            own: Colors::new(&bsdf.spectra(), eta),
            average: [outer.average, inner.average],
            transmitted: [outer.transmitted, inner.transmitted],
        })
    }

    /// As [`DielectricBsdf::facet`] and what follows from it: value and density, `wo` above and
    /// `wi` mirrored likewise.
    #[inline(always)]
    fn facets(&self, colors: &Colors, seen: &Seen, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        let (eta, is_transmission) = (seen.eta, wi.z < 0.0);
        let half = wo + wi * if is_transmission { eta } else { 1.0 };
        let scale = 1.0 / half.length();
        let m = half * scale;
        let m = select(m.z < 0.0, -m, m);
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        let is_sound = (scale > 0.0) & (scale < f32::INFINITY);
        let exists = is_sound & (m.z > 0.0) & (cos_o > 0.0) & (cos_i * wi.z > 0.0);
        let reflectance = fresnel::dielectric(cos_o, eta);
        let up = lift(wi);
        let (density, visibility) = (self.ggx.density(m), self.ggx.visibility(wo, up));
        let denominator = cos_i + cos_o / eta;
        let jacobian =
            if denominator == 0.0 { 0.0 } else { cos_i.abs() / (denominator * denominator) };
        let flux = density * 4.0 * visibility * up.z * cos_o.abs() * jacobian;
        let around = wo.z + self.ggx.root(wo);
        let reflected_pdf = density * 0.5 / around * reflectance;
        let refracted_pdf =
            density * cos_o.max(0.0) * 2.0 / around * jacobian * (1.0 - reflectance);
        let mirror_tint = of_side(&colors.mirror_tint, seen);
        let crossing = of_side(&colors.crossing, seen);
        let reflected = mirror_tint * reflectance * (density * visibility * up.z);
        let refracted = crossing * (1.0 - reflectance) * flux;
        let value = reflected.zip(refracted, |reflected, refracted| {
            let value = if is_transmission { refracted } else { reflected };
            if exists { value } else { 0.0 }
        });
        let pdf = if is_transmission { refracted_pdf } else { reflected_pdf };
        (value, if exists { pdf } else { 0.0 })
    }
}

#[inline(always)]
fn of_side(of: &[SampledSpectrum; 2], seen: &Seen) -> SampledSpectrum {
    of[0].zip(of[1], |outer, inner| if seen.is_inside { inner } else { outer })
}

impl BranchlessLobes for BatchGlass {
    type Seen = Seen;
    type Colors = Colors;

    #[inline(always)]
    fn seen(&self, _colors: &Colors, wo: Vec3) -> Seen {
        let is_inside = wo.z <= 0.0;
        let pick = |[outer, inner]: [f32; 2]| if is_inside { inner } else { outer };
        let lost = self.losses.towards(is_inside, lift(wo));
        Seen { wo, is_inside, eta: pick(self.eta), lost, transmitted: pick(self.transmitted) }
    }

    #[inline(always)]
    fn value_and_pdf_from(&self, colors: &Colors, seen: &Seen, wi: Vec3) -> (SampledSpectrum, f32) {
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
        let has_bounced = average > 0.0;
        let value = facets.zip(bounced, |facets, bounced| {
            let value = if has_bounced { facets + bounced } else { facets };
            if is_seen { value } else { 0.0 }
        });
        let pdf = (1.0 - seen.lost) * facet_pdf + seen.lost * side * self.lobe.pdf(wi.z.abs());
        (value, if is_seen { pdf } else { 0.0 })
    }

    #[inline(always)]
    fn draw_from(&self, _colors: &Colors, seen: &Seen, u_lobe: f32, u: Vec2) -> BranchlessDrawn {
        let &Seen { wo, eta, lost, transmitted, .. } = seen;
        let up = lift(wo);
        let is_bounced = u_lobe < lost;
        let bounced = self.lobe.sample(u);
        let bounced = Vec3::new(
            bounced.x,
            bounced.y,
            if u_lobe < lost * transmitted { -bounced.z } else { bounced.z },
        );
        let m = self.ggx.visible_normal(up, u);
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
    fn albedo_from(&self, colors: &Colors, seen: &Seen) -> SampledSpectrum {
        let reflectance = fresnel::dielectric(seen.wo.z.abs(), seen.eta);
        of_side(&colors.mirror_tint, seen) * reflectance + colors.tint * (1.0 - reflectance)
    }
}

impl BatchLobes for BatchGlass {
    #[inline(always)]
    fn own_colors(&self, _body: SampledSpectrum) -> Colors {
        self.own
    }

    #[inline(always)]
    fn colors_of(&self, spectra: &LobeSpectra) -> Colors {
        Colors::new(spectra, self.eta)
    }
}
