//! BSDFs that many directions are asked about at once: the same bits as [`Lobes`] gives one by one, in loops that become vector code.

use super::coat::ManyCoated;
use super::conductor::ManyMetal;
use super::dielectric::ManyGlass;
use super::glossy::ManyGloss;
use super::open_pbr::OnlySlab;
use super::{Bsdf, ConductorBsdf, GlossyBsdf, Lobes};
use snell_math::simd::Wide;
use snell_math::{ColorMode, SampledSpectrum, Vec2, Vec3, at_level};

/// How many are asked together.
pub const MANY: usize = 16;

/// A number for each.
type Numbers = [f32; MANY];
/// A vector for each, or a spectrum of [`snell_math::ColorMode::Rgb`].
type Vectors = [Numbers; 3];

/// What is asked of a BSDF, in its frame.
#[derive(Clone, Copy, Debug)]
pub struct ManyQuestions<'a> {
    /// Reflectance of the body below a gloss, see [`ManyBsdf::body`].
    pub body: [&'a Numbers; 3],
    /// Unit directions to where light is gathered.
    pub wo: [&'a Numbers; 3],
    /// Unit directions of which value and density are asked.
    pub wi: [&'a Numbers; 3],
    /// Numbers in `[0, 1)` for a direction that is drawn, as in [`Lobes::draw_from`].
    pub u_lobe: &'a Numbers,
    /// More of them.
    pub u: [&'a Numbers; 2],
}

/// What a BSDF answers.
#[derive(Clone, Debug, Default)]
pub struct ManyAnswers {
    /// As [`Lobes::value_and_pdf_from`].
    pub value: Vectors,
    /// As [`Lobes::value_and_pdf_from`].
    pub pdf: Numbers,
    /// The direction that was drawn.
    pub drawn: Vectors,
    /// As [`super::BsdfSample::weight`].
    pub weight: Vectors,
    /// As [`super::BsdfSample::pdf`].
    pub drawn_pdf: Numbers,
    /// As [`super::BsdfSample::is_delta`]: 0 if not.
    pub is_delta: [u32; MANY],
    /// As [`super::BsdfSample::is_transmission`]: 0 if not.
    pub is_transmission: [u32; MANY],
    /// As [`Lobes::crossing_scale`] if the direction crosses the surface, 1 if not.
    pub crossing: Numbers,
    /// 0 if no direction was drawn.
    pub exists: [u32; MANY],
}

/// A BSDF in [`snell_math::ColorMode::Rgb`] that can be asked so.
#[derive(Clone, Debug)]
pub struct ManyBsdf(Kind);

#[derive(Clone, Debug)]
enum Kind {
    RoughGloss(ManyGloss<false>),
    SmoothGloss(ManyGloss<true>),
    Measured(ManyMetal<true>),
    Colored(ManyMetal<false>),
    Glass(ManyGlass),
    CoatedGloss(ManyCoated<ManyGloss<false>, false>),
    LacqueredGloss(ManyCoated<ManyGloss<false>, true>),
    CoatedMetal(ManyCoated<ManyMetal<false>, false>),
    LacqueredMetal(ManyCoated<ManyMetal<false>, true>),
}

impl ManyBsdf {
    /// `None` of kinds that can only be asked one by one.
    pub fn of(bsdf: &Bsdf) -> Option<Self> {
        if let Bsdf::Dielectric(glass) = bsdf {
            return ManyGlass::of(glass).map(|glass| Self(Kind::Glass(glass)));
        }
        if bsdf.is_delta() || !bsdf.is_opaque() {
            return None;
        }
        match bsdf {
            Bsdf::Glossy(gloss) => Self::of_gloss(gloss),
            Bsdf::Conductor(metal) => Self::of_metal(metal),
            Bsdf::OpenPbr(layers) => {
                let (slab, coat) = layers.only_slab()?;
                match (slab, coat) {
                    (OnlySlab::Opaque(gloss), None) => Self::of_gloss(gloss),
                    (OnlySlab::Metal(metal), None) => Self::of_metal(metal),
                    (OnlySlab::Opaque(gloss), Some(coat)) => {
                        let (unit, base) = (ColorMode::Rgb.unit(), ManyGloss::of(gloss)?);
                        let rough = ManyCoated::of(coat, unit, base.clone()).map(Kind::CoatedGloss);
                        rough.or_else(|| ManyCoated::of(coat, unit, base).map(Kind::LacqueredGloss)).map(Self)
                    }
                    (OnlySlab::Metal(metal), Some(coat)) => {
                        let (unit, base) = (ColorMode::Rgb.unit(), ManyMetal::of(metal)?);
                        let rough = ManyCoated::of(coat, unit, base.clone()).map(Kind::CoatedMetal);
                        rough.or_else(|| ManyCoated::of(coat, unit, base).map(Kind::LacqueredMetal)).map(Self)
                    }
                }
            }
            _ => None,
        }
    }

    fn of_gloss(gloss: &GlossyBsdf) -> Option<Self> {
        let rough = ManyGloss::of(gloss).map(Kind::RoughGloss);
        rough.or_else(|| ManyGloss::of(gloss).map(Kind::SmoothGloss)).map(Self)
    }

    fn of_metal(metal: &ConductorBsdf) -> Option<Self> {
        let measured = ManyMetal::of(metal).map(Kind::Measured);
        measured.or_else(|| ManyMetal::of(metal).map(Kind::Colored)).map(Self)
    }

    /// Reflectance of what is below a gloss; black for all others.
    pub fn body(&self) -> SampledSpectrum {
        match &self.0 {
            Kind::RoughGloss(gloss) => gloss.reflectance,
            Kind::SmoothGloss(gloss) => gloss.reflectance,
            Kind::CoatedGloss(coated) => coated.base.reflectance,
            Kind::LacqueredGloss(coated) => coated.base.reflectance,
            _ => SampledSpectrum::ZERO,
        }
    }

    /// True if there is a coat, in the frame of what lies below.
    pub fn has_coat(&self) -> bool {
        use Kind::{CoatedGloss, CoatedMetal, LacqueredGloss, LacqueredMetal};
        matches!(self.0, CoatedGloss(_) | LacqueredGloss(_) | CoatedMetal(_) | LacqueredMetal(_))
    }

    /// True if light goes through.
    pub fn transmits(&self) -> bool {
        matches!(self.0, Kind::Glass(_))
    }

    /// True if it may be asked with any [`Self::body`].
    pub fn takes_any_body(&self) -> bool {
        matches!(self.0, Kind::RoughGloss(_))
    }

    /// Answers all questions.
    pub fn answer(&self, asked: &ManyQuestions, answers: &mut ManyAnswers, wide: Option<Wide>) {
        macro_rules! answer_by {
            ($type:ty, $bsdf:expr) => {
                at_level!(
                    wide,
                    answer,
                    (bsdf: &$type = $bsdf, asked: &ManyQuestions<'_> = asked, answers: &mut ManyAnswers = answers)
                )
            };
        }
        match &self.0 {
            Kind::RoughGloss(bsdf) => answer_by!(ManyGloss<false>, bsdf),
            Kind::SmoothGloss(bsdf) => answer_by!(ManyGloss<true>, bsdf),
            Kind::Measured(bsdf) => answer_by!(ManyMetal<true>, bsdf),
            Kind::Colored(bsdf) => answer_by!(ManyMetal<false>, bsdf),
            Kind::Glass(bsdf) => answer_by!(ManyGlass, bsdf),
            Kind::CoatedGloss(bsdf) => answer_by!(ManyCoated<ManyGloss<false>, false>, bsdf),
            Kind::LacqueredGloss(bsdf) => answer_by!(ManyCoated<ManyGloss<false>, true>, bsdf),
            Kind::CoatedMetal(bsdf) => answer_by!(ManyCoated<ManyMetal<false>, false>, bsdf),
            Kind::LacqueredMetal(bsdf) => answer_by!(ManyCoated<ManyMetal<false>, true>, bsdf),
        }
    }
}

/// [`Lobes`] without branches, so that loops over it become vector code.
pub(super) trait ManyLobes {
    /// What is known of `wo`.
    type Seen;

    /// As [`Lobes::seen`], over a body of this reflectance.
    fn seen(&self, wo: Vec3, body: SampledSpectrum) -> Self::Seen;

    fn value_and_pdf_from(&self, seen: &Self::Seen, wi: Vec3) -> (SampledSpectrum, f32);

    fn draw_from(&self, seen: &Self::Seen, u_lobe: f32, u: Vec2) -> ManyDrawn;

    fn albedo_from(&self, seen: &Self::Seen) -> SampledSpectrum;
}

/// A direction that was drawn.
pub(super) struct ManyDrawn {
    pub wi: Vec3,
    pub exists: bool,
    pub is_delta: bool,
    /// The weight of a delta lobe.
    pub delta: SampledSpectrum,
    pub is_transmission: bool,
    /// As [`ManyAnswers::crossing`].
    pub crossing: f32,
}

impl ManyDrawn {
    /// One that is reflected; for some, by a delta lobe of this weight.
    #[inline(always)]
    pub fn reflected(wi: Vec3, exists: bool, delta: Option<(bool, SampledSpectrum)>) -> Self {
        let (is_delta, delta) = delta.unwrap_or((false, SampledSpectrum::ZERO));
        Self { wi, exists, is_delta, delta, is_transmission: false, crossing: 1.0 }
    }
}

#[inline(always)]
fn answer(bsdf: &impl ManyLobes, asked: &ManyQuestions, answers: &mut ManyAnswers) {
    for i in 0..MANY {
        let body = SampledSpectrum([asked.body[0][i], asked.body[1][i], asked.body[2][i], 0.0]);
        let seen = bsdf.seen(at(asked.wo, i), body);
        let (value, pdf) = bsdf.value_and_pdf_from(&seen, at(asked.wi, i));
        put(&mut answers.value, i, value);
        answers.pdf[i] = pdf;
        let drawn = bsdf.draw_from(&seen, asked.u_lobe[i], Vec2::new(asked.u[0][i], asked.u[1][i]));
        let (value, pdf) = bsdf.value_and_pdf_from(&seen, drawn.wi);
        let scattered = value / pdf;
        let pick = |delta: f32, other: f32| if drawn.is_delta { delta } else { other };
        put(&mut answers.weight, i, drawn.delta.zip(scattered, pick));
        (answers.drawn[0][i], answers.drawn[1][i], answers.drawn[2][i]) = (drawn.wi.x, drawn.wi.y, drawn.wi.z);
        answers.drawn_pdf[i] = pick(0.0, pdf);
        answers.is_delta[i] = u32::from(drawn.is_delta);
        answers.is_transmission[i] = u32::from(drawn.is_transmission);
        answers.crossing[i] = drawn.crossing;
        answers.exists[i] = u32::from(drawn.exists & (drawn.is_delta | (pdf > 0.0)));
    }
}

#[inline(always)]
fn at(v: [&Numbers; 3], i: usize) -> Vec3 {
    Vec3::new(v[0][i], v[1][i], v[2][i])
}

#[inline(always)]
fn put(v: &mut Vectors, i: usize, to: SampledSpectrum) {
    (v[0][i], v[1][i], v[2][i]) = (to.0[0], to.0[1], to.0[2]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::tests::bsdf;
    use crate::material::{CoatedDiffuse, Conductor, Dielectric, MaterialKind, OpenPbr};
    use snell_math::simd::Level;
    use snell_math::{Rgb, rng, sampling};

    const ZERO: Vectors = [[0.0; MANY]; 3];

    #[test]
    fn many_at_once_get_the_bits_of_one_by_one() {
        let coated = [0.0, 0.05, 0.3, 1.0].map(|rough| CoatedDiffuse::new(Rgb::new(0.8, 0.3, 0.0), rough).into());
        let glass = [0.05, 0.4, 1.0].map(|rough| Dielectric::rough(1.5, rough).into());
        let coated_slabs = [(0.0, 0.0), (0.0, 0.3), (1.0, 0.0), (1.0, 0.3)].map(|(metal, rough): (f32, f32)| {
            let surface =
                OpenPbr { base_metalness: metal.into(), specular_roughness: 0.4.into(), ..OpenPbr::default() };
            OpenPbr { coat_weight: 0.7.into(), coat_roughness: rough.into(), ..surface }.into()
        });
        let metals = [0.05, 0.4, 1.0].map(|rough| Conductor::copper(rough).into());
        let colors = [0.05, 0.4, 1.0].map(|rough| Conductor::color(Rgb::new(0.9, 0.5, 0.0), rough).into());
        let kinds: [&[MaterialKind]; 6] = [&coated, &coated_slabs, &glass, &metals, &colors, &MaterialKind::examples()];
        let mut asked_of = 0;
        for (number, kind) in kinds.into_iter().flatten().enumerate() {
            let bsdf = bsdf(kind);
            let Some(many) = ManyBsdf::of(&bsdf) else { continue };
            asked_of += 1;
            for round in 0..200 {
                let (mut wos, mut wis, mut u_lobe, mut u) = (ZERO, ZERO, [0.0; MANY], [[0.0; MANY]; 2]);
                for i in 0..MANY {
                    let id = [number as u32, round, i as u32];
                    let number = |use_of: u32| rng::uniform2([id[0], id[1], id[2], use_of]);
                    let [mut wo, mut wi] = [1, 2].map(|use_of| sampling::uniform_sphere(number(use_of)));
                    // Grazing directions, those in the surface, and mirror directions too.
                    match i {
                        0 => wo.z = 0.0,
                        1 => wi.z = 0.0,
                        2 => wo = (wo * Vec3::new(1.0, 1.0, 1e-3)).normalize(),
                        3 => wi = Vec3::new(-wo.x, -wo.y, wo.z),
                        4 => wi = -wo,
                        5 => (wo, wi) = (Vec3::Z, Vec3::Z),
                        _ => {}
                    }
                    for axis in 0..3 {
                        (wos[axis][i], wis[axis][i]) = (wo[axis], wi[axis]);
                    }
                    (u_lobe[i], u[0][i], u[1][i]) = (number(3).x, number(4).x, number(4).y);
                }
                let (wo, wi) = (wos.each_ref(), wis.each_ref());
                let body = many.body();
                let bodies = [0, 1, 2].map(|channel| [body[channel]; MANY]);
                let asked = ManyQuestions { body: bodies.each_ref(), wo, wi, u_lobe: &u_lobe, u: u.each_ref() };
                for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                    let mut answers = ManyAnswers::default();
                    many.answer(&asked, &mut answers, level.wide());
                    for i in 0..MANY {
                        check(&bsdf, &asked, &answers, i, &format!("{kind:?} {level} {round} {i}"));
                    }
                }
            }
        }
        assert!(asked_of >= 21, "{asked_of}");
    }

    fn check(bsdf: &Bsdf, asked: &ManyQuestions, answers: &ManyAnswers, i: usize, what: &str) {
        let bits = |v: [f32; 3], x: f32| [v[0], v[1], v[2], x].map(|x| (x + 0.0).to_bits());
        let seen = bsdf.seen(at(asked.wo, i));
        let (value, pdf) = bsdf.value_and_pdf_from(&seen, at(asked.wi, i));
        let answer = bits(at(answers.value.each_ref(), i).to_array(), answers.pdf[i]);
        assert_eq!(answer, bits([value[0], value[1], value[2]], pdf), "{what}");
        let sample = bsdf.sample_from(&seen, asked.u_lobe[i], Vec2::new(asked.u[0][i], asked.u[1][i]));
        assert_eq!(answers.exists[i] != 0, sample.is_some(), "{what}");
        let Some(sample) = sample else { return };
        let answer = bits(at(answers.weight.each_ref(), i).to_array(), answers.drawn_pdf[i]);
        assert_eq!(answer, bits([sample.weight[0], sample.weight[1], sample.weight[2]], sample.pdf), "{what}");
        assert_eq!(at(answers.drawn.each_ref(), i), sample.wi, "{what}");
        let is = [answers.is_delta[i] != 0, answers.is_transmission[i] != 0];
        assert_eq!(is, [sample.is_delta, sample.is_transmission], "{what}");
        let crossing = if sample.is_transmission { bsdf.crossing_scale(at(asked.wo, i)) } else { 1.0 };
        assert_eq!(answers.crossing[i], crossing, "{what}");
    }
}
