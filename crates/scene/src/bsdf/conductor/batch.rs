//! Rough metals, for batches of directions.

use super::super::batch::{BatchDrawn, BatchLobes, LobeSpectra};
use super::super::energy::{BouncedLobe, FacetLossBy, Line, Nodes};
use super::super::{Choice, Ggx, Widths, lift, lower_like};
use super::{ConductorBsdf, FacetReflectance, bounced, complex, complex_average, f82, f82_average};
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// A metal of [`Ggx`] without a film: by its complex index of refraction, or by colours.
#[derive(Clone, Debug)]
pub struct BatchMetal<const COMPLEX: bool, N = Line> {
    ggx: Ggx,
    loss: FacetLossBy<N>,
    lobe: BouncedLobe,
    mean_loss: f32,
    /// The spectra where they are the same everywhere.
    own: Colors,
}

/// Spectra of a lane.
#[derive(Clone, Copy, Debug)]
pub struct Colors {
    /// As in [`FacetReflectance`].
    facets: [SampledSpectrum; 2],
    /// As in [`ConductorBsdf`].
    unit: SampledSpectrum,
    bounced: SampledSpectrum,
}

impl Colors {
    #[inline(always)]
    fn new<const COMPLEX: bool>(
        facets: [SampledSpectrum; 2],
        unit: SampledSpectrum,
        mean_loss: f32,
    ) -> Self {
        let [a, b] = facets;
        let average = if COMPLEX { complex_average(a, b) } else { f82_average(a, b) };
        Self { facets, unit, bounced: bounced(average, unit, mean_loss) }
    }
}

/// As [`super::ConductorSeen`].
pub struct Seen {
    wo: Vec3,
    colors: Colors,
    lost: f32,
    albedos: [SampledSpectrum; 2],
    choice: Choice<2>,
}

impl<const COMPLEX: bool> BatchMetal<COMPLEX> {
    /// `None` for other metals.
    pub fn of(bsdf: &ConductorBsdf) -> Option<Self> {
        let &ConductorBsdf { facets, unit, microfacets, ref loss, lobe, mean_loss, film, .. } =
            bsdf;
        let ggx = microfacets.ggx()?;
        let (facets, is_complex) = match facets {
            FacetReflectance::Complex { eta, k } => ([eta, k], true),
            FacetReflectance::F82 { f0, edge } => ([f0, edge], false),
        };
        let is_such = is_complex == COMPLEX && film.is_none() && !ggx.is_smooth();
        let own = Colors::new::<COMPLEX>(facets, unit, mean_loss);
        is_such.then(|| Self { ggx, loss: loss.line(), lobe, mean_loss, own })
    }
}

impl BatchMetal<false> {
    /// The same metal with another roughness and the loss of that roughness. The spectra must be
    /// computed anew.
    #[inline(always)]
    pub fn with<N>(
        &self,
        loss: FacetLossBy<N>,
        lobe: BouncedLobe,
        mean_loss: f32,
    ) -> BatchMetal<false, N> {
        BatchMetal { ggx: loss.widths.into(), loss, lobe, mean_loss, own: self.own }
    }

    /// Width of the facet distribution.
    pub fn widths(&self) -> Widths {
        self.ggx.widths()
    }
}

impl<const COMPLEX: bool, N> BatchMetal<COMPLEX, N> {
    /// Its own spectra, with this reflectance at normal incidence.
    #[inline(always)]
    pub fn spectra(&self, f0: SampledSpectrum) -> LobeSpectra {
        LobeSpectra { base: f0, specular: self.own.facets[1], other: self.own.unit }
    }

    #[inline(always)]
    fn reflectance(colors: &Colors, cos: f32) -> SampledSpectrum {
        let [a, b] = colors.facets;
        colors.unit * if COMPLEX { complex(cos, a, b) } else { f82(cos, a, b) }
    }
}

impl<const COMPLEX: bool, N: Nodes> BatchLobes for BatchMetal<COMPLEX, N> {
    type Seen = Seen;
    type Colors = Colors;

    #[inline(always)]
    fn own_colors(&self, _body: SampledSpectrum) -> Colors {
        self.own
    }

    #[inline(always)]
    fn colors_of(&self, &LobeSpectra { base, specular, other }: &LobeSpectra) -> Colors {
        Colors::new::<COMPLEX>([base, specular], other, self.mean_loss)
    }

    #[inline(always)]
    fn seen(&self, wo: Vec3, colors: Colors) -> Seen {
        let up = lift(wo);
        let (reflectance, lost) = (Self::reflectance(&colors, up.z), self.loss.towards(up));
        let albedos = [reflectance * (1.0 - lost), colors.bounced * self.mean_loss * lost];
        Seen { wo, colors, lost, albedos, choice: Choice::new(albedos) }
    }

    #[inline(always)]
    fn value_and_pdf_from(&self, seen: &Seen, wi: Vec3) -> (SampledSpectrum, f32) {
        let is_seen = seen.wo.z * wi.z > 0.0;
        let (wo, wi) = (lift(seen.wo), lift(wi));
        let [facets, diffuse] = seen.choice.probabilities;
        let (m, value, pdf, exists) = self.ggx.reflected(wo, wi);
        let once = (Self::reflectance(&seen.colors, wo.dot(m)) * value)
            .map(|x| if exists { x } else { 0.0 });
        let value =
            once + seen.colors.bounced * (seen.lost * self.loss.towards(wi) * wi.z * FRAC_1_PI);
        let pdf = facets * if exists { pdf } else { 0.0 } + diffuse * self.lobe.pdf(wi.z);
        (value.map(|x| if is_seen { x } else { 0.0 }), if is_seen { pdf } else { 0.0 })
    }

    #[inline(always)]
    fn draw_from(&self, seen: &Seen, u_lobe: f32, u: Vec2) -> BatchDrawn {
        let wo = seen.wo;
        let (is_once, exists) = seen.choice.picks_first(u_lobe);
        let (facet, is_above) = self.ggx.drawn_reflection(lift(wo), u);
        let wi = lower_like(select(is_once, facet, self.lobe.sample(u)), wo);
        let exists = exists & (is_above | !is_once) & (wo.z != 0.0);
        BatchDrawn::reflected(wi, exists, None)
    }

    #[inline(always)]
    fn albedo_from(&self, seen: &Seen) -> SampledSpectrum {
        let [facets, bounced] = seen.albedos;
        facets + bounced
    }
}
