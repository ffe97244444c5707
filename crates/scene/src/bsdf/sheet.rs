//! A thin sheet of glass: a window, a soap bubble.
//!
//! Light bounces between the two faces of the sheet. The sum over all bounces is reflected or goes
//! straight on. Roughness spreads transmitted light as much as reflected light.

use super::energy::{BouncedLobe, Directional, FacetLoss};
use super::film::ThinFilm;
use super::ggx::Ggx;
use super::mirror::mirror_branch;
use super::{Choice, Drawn, Lobes, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{SampledSpectrum, Vec2, Vec3, real};
use std::f32::consts::FRAC_1_PI;

/// A sheet at one point. Make it with [`SheetBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct SheetBsdf {
    ior: f32,
    tint: SampledSpectrum,
    /// Transmittance of the sheet at normal incidence.
    transmittance: SampledSpectrum,
    unit: SampledSpectrum,
    ggx: Ggx,
    film: Option<ThinFilm>,
    f0: SampledSpectrum,
    loss: FacetLoss,
    mean_loss: f32,
    /// Reflected and transmitted fractions of light that bounced off several facets, divided by the
    /// mean loss.
    bounced: [SampledSpectrum; 2],
}

/// A sheet as seen from a direction.
#[derive(Clone, Debug)]
pub struct SheetSeen {
    wo: Vec3,
    /// Reflected and transmitted fractions of light on facets that lie along the surface.
    shares: [SampledSpectrum; 2],
    /// Fraction of light that single facets lose.
    lost: f32,
    choice: Choice<4>,
}

impl SheetBsdf {
    /// True if the sheet depends on tangents; see [`Ggx::has_tangent`].
    pub(crate) fn has_tangent(&self) -> bool {
        self.ggx.has_tangent()
    }

    /// A sheet with this index of refraction, divided by that of the outside. `tint` is a factor on
    /// the reflection; `unit` is 1 in every lane in use.
    pub fn new(
        ior: f32,
        tint: SampledSpectrum,
        transmittance: SampledSpectrum,
        unit: SampledSpectrum,
        ggx: Ggx,
        film: Option<ThinFilm>,
    ) -> Self {
        let loss = FacetLoss::new(ggx.into());
        let f0 = SampledSpectrum::splat(fresnel::f0_from_ior(ior));
        let bounced = [SampledSpectrum::ZERO; 2];
        let lost = loss.average();
        let mut sheet =
            Self { ior, tint, transmittance, unit, ggx, film, f0, loss, mean_loss: lost, bounced };
        if lost > 0.0 {
            // The fractions are those at the mean angle of diffuse light.
            sheet.bounced = sheet.shares(2.0 / 3.0).map(|s| s * (1.0 / lost));
        }
        sheet
    }

    /// Reflected and transmitted fractions of light on facets seen at this cosine.
    fn shares(&self, cos: f32) -> [SampledSpectrum; 2] {
        let f = SampledSpectrum::splat(fresnel::dielectric(cos, self.ior));
        let f = self.film.map_or(f, |film| film.reflectance(cos, self.f0, f));
        let sin2 = (1.0 - cos * cos).max(0.0) / (self.ior * self.ior);
        let inside = (1.0 - sin2).max(1e-4).sqrt();
        let left = self
            .transmittance
            .map(|t| if t >= 1.0 { 1.0 } else { real::powf(t.max(0.0), 1.0 / inside) });
        let pass = SampledSpectrum::ONE - f;
        let ladder = SampledSpectrum::ONE - f * f * left * left;
        let over = |x: SampledSpectrum| x.zip(ladder, |x, l| if l > 1e-6 { x / l } else { 0.0 });
        let reflected = f + over(pass * pass * f * left * left);
        [reflected * self.tint, over(pass * pass * left) * self.unit]
    }

    fn branches(wo: Vec3, [r, t]: [SampledSpectrum; 2]) -> [SpecularBranch; 2] {
        [mirror_branch(wo, r), SpecularBranch { wi: -wo, weight: t, is_transmission: true }]
    }
}

impl Lobes for SheetBsdf {
    type Seen = SheetSeen;

    fn seen(&self, wo: Vec3) -> SheetSeen {
        let up = lift(wo);
        let (shares @ [r, t], lost) = (self.shares(up.z), self.loss.towards(up));
        let [br, bt] = self.bounced.map(|b| b * (self.mean_loss * lost));
        let choice = Choice::new([r * (1.0 - lost), t * (1.0 - lost), br, bt]);
        SheetSeen { wo, shares, lost, choice }
    }

    fn value_and_pdf_from(&self, seen: &SheetSeen, wi: Vec3) -> (SampledSpectrum, f32) {
        let side = usize::from(seen.wo.z * wi.z < 0.0);
        if seen.wo.z * wi.z == 0.0 || self.ggx.is_smooth() {
            return (SampledSpectrum::ZERO, 0.0);
        }
        let (wo, wi) = (lift(seen.wo), lift(wi));
        let (once, pdf) = match self.ggx.reflection_and_pdf(wo, wi) {
            Some((m, value, pdf)) => (self.shares(wo.dot(m))[side] * value, pdf),
            None => (SampledSpectrum::ZERO, 0.0),
        };
        let value =
            once + self.bounced[side] * (seen.lost * self.loss.towards(wi) * wi.z * FRAC_1_PI);
        let p = seen.choice.probabilities;
        (value, p[side] * pdf + p[2 + side] * BouncedLobe::new(self.ggx.widths()).pdf(wi.z))
    }

    fn draw_from(&self, seen: &SheetSeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let wo = seen.wo;
        if wo.z == 0.0 {
            return None;
        }
        let lobe = seen.choice.pick(u_lobe)?.0;
        let side = lobe % 2;
        if self.ggx.is_smooth() {
            return Some(
                Self::branches(wo, seen.shares)[side].drawn(seen.choice.probabilities[lobe]),
            );
        }
        let wi = if lobe < 2 {
            self.ggx.sample_reflection(lift(wo), u)?
        } else {
            BouncedLobe::new(self.ggx.widths()).sample(u)
        };
        let Vec3 { x, y, z } = lower_like(wi, wo);
        let is_transmission = side == 1;
        Some(Drawn::Direction {
            wi: Vec3::new(x, y, if is_transmission { -z } else { z }),
            is_transmission,
        })
    }

    fn is_delta(&self) -> bool {
        self.ggx.is_smooth()
    }

    fn albedo_from(&self, seen: &SheetSeen) -> SampledSpectrum {
        let [r, t] = seen.shares;
        r + t
    }

    fn ambient(&self, _wo: Vec3) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        if self.is_delta() {
            Self::branches(wo, self.shares(wo.z.abs())).map(Some)
        } else {
            [None, None]
        }
    }
}
