//! Metal mixed with a gloss over a matte body, in shares and of a roughness that differ from point
//! to point, for many directions at once.
//!
//! What depends on the roughness alone is looked up point by point, only where it is asked for; all
//! else is worked out in lanes. So the work goes through the lanes several times: what is drawn
//! must be known before it can be looked up.

use super::super::energy::{
    BouncedLobe, DielectricReflection, DielectricReflectionBy, FacetLoss, FacetLossBy, Near,
    first_node,
};
use super::super::many::{ManyDrawn, ManyLobes, ManyPoint, Palette};
use super::super::{
    Choice, ConductorBsdf, Ggx, GlossyBsdf, MANY, ManyAnswers, ManyQuestions, Microfacets, Widths,
    lift,
};
use super::super::{conductor::ManyMetal, glossy::ManyGloss};
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// A mixture of rough metal by colours and a rough gloss over a matte body, both of [`Ggx`] that is
/// the same in all directions.
#[derive(Clone, Debug)]
pub struct ManyMixed {
    metal: ManyMetal<false>,
    gloss: ManyGloss<false>,
    /// As it was made.
    dielectric: GlossyBsdf,
    /// What it is where nothing differs.
    pub point: ManyPoint,
}

/// The mixture at a point, asked about directions between certain nodes.
struct Mixture {
    metalness: f32,
    metal: ManyMetal<false, Near>,
    gloss: ManyGloss<false, Near>,
}

/// As [`super::OpenPbrSeen`].
struct Seen<M, G> {
    metal: M,
    gloss: G,
    choice: Choice<2>,
}

/// What is known of roughnesses, by lane: of metal and of gloss only where they are asked about.
struct Rough {
    loss: [FacetLoss; MANY],
    /// Mean of that.
    lost: [f32; MANY],
    lobe: [BouncedLobe; MANY],
    albedo: [DielectricReflection; MANY],
    /// Mean of that.
    reflected: [f32; MANY],
}

/// What is known of directions, by lane: as [`FacetLoss::near`] and [`DielectricReflection::near`].
type Around = [[Near; MANY]; 2];

impl ManyMixed {
    /// `None` if it is no such mixture. With the share of each.
    pub fn of(
        (metalness, metal): &(f32, ConductorBsdf),
        (_, gloss): &(f32, GlossyBsdf),
    ) -> Option<Self> {
        let (metal, of_gloss) = (ManyMetal::of(metal)?, ManyGloss::of(gloss)?);
        let widths = metal.widths();
        let is_such =
            !widths.has_tangent() && gloss.microfacets() == Microfacets::Ggx(widths.into());
        let point = ManyPoint {
            alpha: widths.alpha(),
            metalness: *metalness,
            ..ManyPoint::with_body(of_gloss.own.body)
        };
        is_such.then_some(Self { metal, gloss: of_gloss, dielectric: *gloss, point })
    }

    /// Answers all questions.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
    pub fn answer<const CHANNELS: usize>(&self, asked: &ManyQuestions, answers: &mut ManyAnswers) {
        let rough = Rough::of(asked, &self.dielectric);
        let (around_wo, around_wi) = (rough.around(asked, asked.wo), rough.around(asked, asked.wi));
        let mut exists = [false; MANY];
        for i in 0..MANY {
            let mixture = self.at(asked, &rough, &around_wo, i);
            let seen = mixture.seen(asked.wo(i), self.colors::<CHANNELS>(&mixture, asked, i));
            let drawn = mixture.draw_from(&seen, asked.u_lobe[i], asked.u(i));
            (answers.drawn[0][i], answers.drawn[1][i], answers.drawn[2][i]) =
                (drawn.wi.x, drawn.wi.y, drawn.wi.z);
            exists[i] = drawn.exists;
            let mixture = self.at(asked, &rough, &around_wi, i);
            answers.take_value::<CHANNELS>(i, mixture.value_and_pdf_from(&seen, asked.wi(i)));
        }
        let around_drawn = rough.around(asked, answers.drawn.each_ref());
        for i in 0..MANY {
            let mixture = self.at(asked, &rough, &around_wo, i);
            let seen = mixture.seen(asked.wo(i), self.colors::<CHANNELS>(&mixture, asked, i));
            let wi = Vec3::new(answers.drawn[0][i], answers.drawn[1][i], answers.drawn[2][i]);
            let found = self.at(asked, &rough, &around_drawn, i).value_and_pdf_from(&seen, wi);
            answers.take_drawn::<CHANNELS>(i, &ManyDrawn::reflected(wi, exists[i], None), found);
        }
    }

    /// The mixture in a lane, for questions about directions of which this is known.
    #[inline(always)]
    fn at(
        &self,
        asked: &ManyQuestions,
        rough: &Rough,
        [loss, reflected]: &Around,
        i: usize,
    ) -> Mixture {
        let widths = Widths::both(asked.alpha[i]);
        let loss = FacetLossBy { widths, loss: loss[i] };
        let albedo =
            DielectricReflectionBy { widths, ior: self.gloss.ior(), reflected: reflected[i] };
        Mixture {
            metalness: asked.metalness[i],
            metal: self.metal.with(loss, rough.lobe[i], rough.lost[i]),
            gloss: self.gloss.with(albedo, rough.reflected[i]),
        }
    }
}

impl ManyMixed {
    /// The spectra of a lane.
    #[inline(always)]
    fn colors<const CHANNELS: usize>(
        &self,
        mixture: &Mixture,
        asked: &ManyQuestions,
        i: usize,
    ) -> <Mixture as ManyLobes>::Colors {
        match CHANNELS {
            4 => mixture.colors_of(&asked.palette(i)),
            _ => mixture.own_colors(asked.body(i)),
        }
    }
}

/// True if metal is asked about in a lane, and if gloss is.
#[inline(always)]
fn is_asked(asked: &ManyQuestions, i: usize) -> [bool; 2] {
    let (is_asked, metalness) = (asked.is_asked[i] != 0, asked.metalness[i]);
    [is_asked && metalness > 0.0, is_asked && metalness < 1.0]
}

impl Rough {
    #[inline(always)]
    fn of(asked: &ManyQuestions, dielectric: &GlossyBsdf) -> Self {
        let roughest = Widths::both(1.0);
        let facets = Ggx::from(roughest).into();
        let mut rough = Self {
            loss: [FacetLoss::new(facets); MANY],
            lost: [0.0; MANY],
            lobe: [BouncedLobe::new(roughest); MANY],
            albedo: [dielectric.albedo_at(facets); MANY],
            reflected: [0.0; MANY],
        };
        for i in 0..MANY {
            let (widths, [is_metal, is_gloss]) = (Widths::both(asked.alpha[i]), is_asked(asked, i));
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

    /// What is asked about directions.
    #[inline(always)]
    fn around(&self, asked: &ManyQuestions, w: [&[f32; MANY]; 3]) -> Around {
        let (mut first, mut around) = ([0; MANY], [[Near::default(); MANY]; 2]);
        for i in 0..MANY {
            first[i] = first_node(
                Widths::both(asked.alpha[i]),
                lift(Vec3::new(w[0][i], w[1][i], w[2][i])),
            );
        }
        for i in 0..MANY {
            let [is_metal, is_gloss] = is_asked(asked, i);
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

impl ManyLobes for Mixture {
    type Seen = Seen<
        <ManyMetal<false, Near> as ManyLobes>::Seen,
        <ManyGloss<false, Near> as ManyLobes>::Seen,
    >;
    type Colors = (
        <ManyMetal<false, Near> as ManyLobes>::Colors,
        <ManyGloss<false, Near> as ManyLobes>::Colors,
    );

    #[inline(always)]
    fn own_colors(&self, body: SampledSpectrum) -> Self::Colors {
        (self.metal.colors_of(&self.metal.palette(body)), self.gloss.own_colors(body))
    }

    #[inline(always)]
    fn colors_of(&self, palette: &Palette) -> Self::Colors {
        (self.metal.colors_of(palette), self.gloss.colors_of(palette))
    }

    #[inline(always)]
    fn seen(&self, wo: Vec3, (metal, gloss): Self::Colors) -> Self::Seen {
        let (metal, gloss) = (self.metal.seen(wo, metal), self.gloss.seen(wo, gloss));
        let [of_metal, of_gloss] =
            self.shares(self.metal.albedo_from(&metal), self.gloss.albedo_from(&gloss));
        Seen { metal, gloss, choice: Choice::new([of_metal, of_gloss]) }
    }

    #[inline(always)]
    fn value_and_pdf_from(&self, seen: &Self::Seen, wi: Vec3) -> (SampledSpectrum, f32) {
        let (metal, metal_pdf) = self.metal.value_and_pdf_from(&seen.metal, wi);
        let (gloss, gloss_pdf) = self.gloss.value_and_pdf_from(&seen.gloss, wi);
        let ([metal, gloss], [p, q]) = (self.shares(metal, gloss), seen.choice.probabilities);
        let share = |p: f32, pdf: f32| if p > 0.0 { p * pdf } else { 0.0 };
        (metal + gloss, share(p, metal_pdf) + share(q, gloss_pdf))
    }

    #[inline(always)]
    fn draw_from(&self, seen: &Self::Seen, u_lobe: f32, u: Vec2) -> ManyDrawn {
        let (is_metal, exists, rest) = seen.choice.picked(u_lobe);
        let (metal, gloss) = (
            self.metal.draw_from(&seen.metal, rest, u),
            self.gloss.draw_from(&seen.gloss, rest, u),
        );
        let is_sound = if is_metal { metal.exists } else { gloss.exists };
        ManyDrawn::reflected(select(is_metal, metal.wi, gloss.wi), exists & is_sound, None)
    }

    #[inline(always)]
    fn albedo_from(&self, seen: &Self::Seen) -> SampledSpectrum {
        let [metal, gloss] =
            self.shares(self.metal.albedo_from(&seen.metal), self.gloss.albedo_from(&seen.gloss));
        metal + gloss
    }
}

impl Mixture {
    /// What metal and gloss give by their shares: nothing, where one is not there and so not known.
    #[inline(always)]
    fn shares(&self, metal: SampledSpectrum, gloss: SampledSpectrum) -> [SampledSpectrum; 2] {
        let (first, second) = (self.metalness, 1.0 - self.metalness);
        [
            metal.map(|x| if first > 0.0 { x * first } else { 0.0 }),
            gloss.map(|x| if second > 0.0 { x * second } else { 0.0 }),
        ]
    }
}
