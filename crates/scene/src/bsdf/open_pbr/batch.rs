//! A mixture of metal and a gloss over a matte body, whose shares and roughness vary over the
//! surface, for batches of directions.
//!
//! The lobes are those of [`super::OpenPbrBsdf`]. Only their mixing is written again: there any
//! part may be missing and is left out, here both are computed in all lanes.
//!
//! Values that depend on the roughness only are looked up point by point, and only where needed;
//! the rest is computed in lanes. So there are several passes over the lanes: a direction must be
//! drawn before its values can be looked up.

use super::super::batch::{BatchLobes, BatchPoint, LobeSpectra};
use super::super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::super::energy::{
    BouncedLobe, DielectricReflection, DielectricReflectionBy, FacetLoss, FacetLossBy, Near,
    first_node,
};
use super::super::microfacets::Rough;
use super::super::{
    BATCH, BatchInputs, BatchOutputs, Choice, ConductorBsdf, Ggx, GlossyBsdf, Microfacets, Widths,
    lift,
};
use super::super::{F82, conductor::BatchMetal, glossy::BatchGloss};
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// A mixture of rough metal by colours and a rough gloss over a matte body, both with isotropic
/// [`Ggx`].
#[derive(Clone, Debug)]
pub struct BatchMixed {
    metal: BatchMetal<F82>,
    gloss: BatchGloss<Rough>,
    /// The BSDF that the gloss was made from.
    dielectric: GlossyBsdf,
    /// Its parameters where nothing varies.
    pub point: BatchPoint,
}

/// The mixture at a point, for directions between certain nodes.
struct Mixture {
    metalness: f32,
    metal: BatchMetal<F82, Near>,
    gloss: BatchGloss<Rough, Near>,
}

/// As [`super::OpenPbrSeen`].
struct Seen<M, G> {
    metal: M,
    gloss: G,
    choice: Choice<2>,
}

/// Values that depend on the roughness, by lane: of metal and of gloss only where they are needed.
struct ByRoughness {
    loss: [FacetLoss; BATCH],
    /// Its mean.
    lost: [f32; BATCH],
    lobe: [BouncedLobe; BATCH],
    albedo: [DielectricReflection; BATCH],
    /// Its mean.
    reflected: [f32; BATCH],
}

/// Values that depend on the direction, by lane: as [`FacetLoss::near`] and
/// [`DielectricReflection::near`].
type Around = [[Near; BATCH]; 2];

impl BatchMixed {
    /// The mixture with the share of each part; `None` for other surfaces.
    pub fn of(
        (metalness, metal): &(f32, ConductorBsdf),
        (_, gloss): &(f32, GlossyBsdf),
    ) -> Option<Self> {
        let (metal, of_gloss) = (BatchMetal::of(metal)?, BatchGloss::of(gloss)?);
        let widths = metal.widths();
        let is_such =
            !widths.has_tangent() && gloss.microfacets() == Microfacets::Ggx(widths.into());
        let point = BatchPoint {
            alpha: widths.alpha(),
            metalness: *metalness,
            ..BatchPoint::with_body(of_gloss.body())
        };
        is_such.then_some(Self { metal, gloss: of_gloss, dielectric: *gloss, point })
    }

    /// Evaluates and samples it for all lanes.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
    pub fn evaluate<const CHANNELS: usize>(
        &self,
        inputs: &BatchInputs,
        outputs: &mut BatchOutputs,
    ) {
        let rough = ByRoughness::of(inputs, &self.dielectric);
        let (around_wo, around_wi) =
            (rough.around(inputs, inputs.wo), rough.around(inputs, inputs.wi));
        let mut exists = [false; BATCH];
        for i in 0..BATCH {
            let mixture = self.at(inputs, &rough, &around_wo, i);
            let colors = self.colors::<CHANNELS>(&mixture, inputs, i);
            let seen = mixture.seen(&colors, inputs.wo(i));
            let drawn = mixture.draw_from(&colors, &seen, inputs.u_lobe[i], inputs.u(i));
            (outputs.drawn[0][i], outputs.drawn[1][i], outputs.drawn[2][i]) =
                (drawn.wi.x, drawn.wi.y, drawn.wi.z);
            exists[i] = drawn.exists;
            let mixture = self.at(inputs, &rough, &around_wi, i);
            outputs.take_value::<CHANNELS>(
                i,
                mixture.value_and_pdf_from(&colors, &seen, inputs.wi(i)),
            );
        }
        let around_drawn = rough.around(inputs, outputs.drawn.each_ref());
        for i in 0..BATCH {
            let mixture = self.at(inputs, &rough, &around_wo, i);
            let colors = self.colors::<CHANNELS>(&mixture, inputs, i);
            let seen = mixture.seen(&colors, inputs.wo(i));
            let wi = Vec3::new(outputs.drawn[0][i], outputs.drawn[1][i], outputs.drawn[2][i]);
            let found =
                self.at(inputs, &rough, &around_drawn, i).value_and_pdf_from(&colors, &seen, wi);
            outputs.take_drawn::<CHANNELS>(
                i,
                &BranchlessDrawn::reflected(wi, exists[i], None),
                found,
            );
        }
    }

    /// The mixture in a lane, for directions with these values.
    #[inline(always)]
    fn at(
        &self,
        inputs: &BatchInputs,
        rough: &ByRoughness,
        [loss, reflected]: &Around,
        i: usize,
    ) -> Mixture {
        let widths = Widths::both(inputs.alpha[i]);
        let loss = FacetLossBy { widths, loss: loss[i] };
        let albedo =
            DielectricReflectionBy { widths, ior: self.gloss.ior(), reflected: reflected[i] };
        Mixture {
            metalness: inputs.metalness[i],
            metal: self.metal.with(loss, rough.lobe[i], rough.lost[i]),
            gloss: self.gloss.with(albedo, rough.reflected[i]),
        }
    }
}

impl BatchMixed {
    /// The spectra of a lane.
    #[inline(always)]
    fn colors<const CHANNELS: usize>(
        &self,
        mixture: &Mixture,
        inputs: &BatchInputs,
        i: usize,
    ) -> <Mixture as BranchlessLobes>::Colors {
        match CHANNELS {
            4 => mixture.colors_of(&inputs.spectra(i)),
            _ => mixture.own_colors(inputs.body(i)),
        }
    }
}

/// True if a lane needs the metal, and if it needs the gloss.
#[inline(always)]
fn is_active(inputs: &BatchInputs, i: usize) -> [bool; 2] {
    let (is_active, metalness) = (inputs.is_active[i] != 0, inputs.metalness[i]);
    [is_active && metalness > 0.0, is_active && metalness < 1.0]
}

impl ByRoughness {
    #[inline(always)]
    fn of(inputs: &BatchInputs, dielectric: &GlossyBsdf) -> Self {
        let roughest = Widths::both(1.0);
        let facets = Ggx::from(roughest).into();
        let mut rough = Self {
            loss: [FacetLoss::new(facets); BATCH],
            lost: [0.0; BATCH],
            lobe: [BouncedLobe::new(roughest); BATCH],
            albedo: [dielectric.albedo_at(facets); BATCH],
            reflected: [0.0; BATCH],
        };
        for i in 0..BATCH {
            let (widths, [is_metal, is_gloss]) =
                (Widths::both(inputs.alpha[i]), is_active(inputs, i));
            let facets = Ggx::from(widths).into();
            if is_metal {
                rough.loss[i] = FacetLoss::new(facets);
                rough.lost[i] = rough.loss[i].average();
                rough.lobe[i] = BouncedLobe::new(widths);
            }
            if is_gloss {
                rough.albedo[i] = dielectric.albedo_at(facets);
                rough.reflected[i] = rough.albedo[i].average();
            }
        }
        rough
    }

    /// Looks up the values that depend on the direction.
    #[inline(always)]
    fn around(&self, inputs: &BatchInputs, w: [&[f32; BATCH]; 3]) -> Around {
        let (mut first, mut around) = ([0; BATCH], [[Near::default(); BATCH]; 2]);
        for i in 0..BATCH {
            first[i] = first_node(
                Widths::both(inputs.alpha[i]),
                lift(Vec3::new(w[0][i], w[1][i], w[2][i])),
            );
        }
        for i in 0..BATCH {
            let [is_metal, is_gloss] = is_active(inputs, i);
            if is_metal {
                around[0][i] = self.loss[i].near(first[i]);
            }
            if is_gloss {
                around[1][i] = self.albedo[i].near(first[i]);
            }
        }
        around
    }
}

impl BranchlessLobes for Mixture {
    type Seen = Seen<
        <BatchMetal<F82, Near> as BranchlessLobes>::Seen,
        <BatchGloss<Rough, Near> as BranchlessLobes>::Seen,
    >;
    type Colors = (
        <BatchMetal<F82, Near> as BranchlessLobes>::Colors,
        <BatchGloss<Rough, Near> as BranchlessLobes>::Colors,
    );

    #[inline(always)]
    fn seen(&self, colors: &Self::Colors, wo: Vec3) -> Self::Seen {
        let (metal, gloss) = (self.metal.seen(&colors.0, wo), self.gloss.seen(&colors.1, wo));
        let [of_metal, of_gloss] = self.shares(
            self.metal.albedo_from(&colors.0, &metal),
            self.gloss.albedo_from(&colors.1, &gloss),
        );
        Seen { metal, gloss, choice: Choice::new([of_metal, of_gloss]) }
    }

    #[inline(always)]
    fn value_and_pdf_from(
        &self,
        colors: &Self::Colors,
        seen: &Self::Seen,
        wi: Vec3,
    ) -> (SampledSpectrum, f32) {
        let (metal, metal_pdf) = self.metal.value_and_pdf_from(&colors.0, &seen.metal, wi);
        let (gloss, gloss_pdf) = self.gloss.value_and_pdf_from(&colors.1, &seen.gloss, wi);
        let ([metal, gloss], [p, q]) = (self.shares(metal, gloss), seen.choice.probabilities);
        let share = |p: f32, pdf: f32| if p > 0.0 { p * pdf } else { 0.0 };
        (metal + gloss, share(p, metal_pdf) + share(q, gloss_pdf))
    }

    #[inline(always)]
    fn draw_from(
        &self,
        colors: &Self::Colors,
        seen: &Self::Seen,
        u_lobe: f32,
        u: Vec2,
    ) -> BranchlessDrawn {
        let (is_metal, exists, rest) = seen.choice.picked(u_lobe);
        let (metal, gloss) = (
            self.metal.draw_from(&colors.0, &seen.metal, rest, u),
            self.gloss.draw_from(&colors.1, &seen.gloss, rest, u),
        );
        let is_sound = if is_metal { metal.exists } else { gloss.exists };
        BranchlessDrawn::reflected(select(is_metal, metal.wi, gloss.wi), exists & is_sound, None)
    }

    #[inline(always)]
    fn albedo_from(&self, colors: &Self::Colors, seen: &Self::Seen) -> SampledSpectrum {
        let [metal, gloss] = self.shares(
            self.metal.albedo_from(&colors.0, &seen.metal),
            self.gloss.albedo_from(&colors.1, &seen.gloss),
        );
        metal + gloss
    }
}

impl BatchLobes for Mixture {
    #[inline(always)]
    fn own_colors(&self, body: SampledSpectrum) -> Self::Colors {
        (self.metal.colors_of(&self.metal.spectra(body)), self.gloss.own_colors(body))
    }

    #[inline(always)]
    fn colors_of(&self, spectra: &LobeSpectra) -> Self::Colors {
        (self.metal.colors_of(spectra), self.gloss.colors_of(spectra))
    }
}

impl Mixture {
    /// The sum of metal and gloss by their shares; an absent part, whose values are undefined, adds
    /// nothing.
    #[inline(always)]
    fn shares(&self, metal: SampledSpectrum, gloss: SampledSpectrum) -> [SampledSpectrum; 2] {
        let (first, second) = (self.metalness, 1.0 - self.metalness);
        [
            metal.map(|x| if first > 0.0 { x * first } else { 0.0 }),
            gloss.map(|x| if second > 0.0 { x * second } else { 0.0 }),
        ]
    }
}
