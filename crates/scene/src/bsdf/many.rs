//! BSDFs that many directions are asked about at once: the same bits as [`Lobes`] gives one by one,
//! in loops that become vector code.

use super::coat::ManyCoated;
use super::conductor::ManyMetal;
use super::dielectric::ManyGlass;
use super::glossy::ManyGloss;
use super::open_pbr::{ManyMixed, OnlySlab};
use super::{Bsdf, ConductorBsdf, GlossyBsdf, Lobes};
use snell_math::simd::Wide;
use snell_math::{ColorMode, ColorModel, SampledSpectrum, Vec2, Vec3, at_level};

/// How many are asked together.
pub const MANY: usize = 16;

/// A number for each.
type Numbers = [f32; MANY];
/// A vector for each.
type Vectors = [Numbers; 3];
/// A spectrum for each.
type Spectra = [Numbers; 4];

/// Spectra that a BSDF asks for: of a gloss, the reflectance of the body and the tint; of a metal,
/// as in [`super::FacetReflectance`] and a factor on all of it (a mixture of both has the first two
/// in common); of glass, the tint, and factors on what is reflected on the outer and the inner
/// side.
pub type Palette = [SampledSpectrum; 3];

/// What is asked of a BSDF, in its frame.
#[derive(Clone, Copy, Debug)]
pub struct ManyQuestions<'a> {
    /// 0 for those of which nothing is asked: what is answered for them means nothing.
    pub is_asked: &'a [u32; MANY],
    /// As [`ManyPoint::palette`]: in [`snell_math::ColorMode::Rgb`] only the first three channels
    /// of the first are looked at.
    pub palette: [[&'a Numbers; 4]; 3],
    /// Whether spectra are colours.
    pub color: ColorModel,
    /// As [`ManyPoint::alpha`].
    pub alpha: &'a Numbers,
    /// As [`ManyPoint::metalness`].
    pub metalness: &'a Numbers,
    /// Unit directions to where light is gathered.
    pub wo: [&'a Numbers; 3],
    /// Unit directions of which value and density are asked.
    pub wi: [&'a Numbers; 3],
    /// Numbers in `[0, 1)` for a direction that is drawn, as in [`Lobes::draw_from`].
    pub u_lobe: &'a Numbers,
    /// More of them.
    pub u: [&'a Numbers; 2],
}

/// What may differ from point to point of a surface. A BSDF looks only at what it has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ManyPoint {
    /// In [`snell_math::ColorMode::Rgb`] only the first of them, where that is the reflectance of a
    /// body below a gloss, and at normal incidence of the metal that is mixed with it. In spectral
    /// colour all.
    pub palette: Palette,
    /// How wide the facets of such a mixture are distributed, see [`super::Widths`].
    pub alpha: f32,
    /// Share of the metal.
    pub metalness: f32,
}

impl ManyPoint {
    /// With a body of this reflectance, where nothing else counts.
    pub fn with_body(body: SampledSpectrum) -> Self {
        Self {
            palette: [body, SampledSpectrum::ZERO, SampledSpectrum::ZERO],
            alpha: 0.0,
            metalness: 0.0,
        }
    }
}

/// What a BSDF answers.
#[derive(Clone, Debug, Default)]
pub struct ManyAnswers {
    /// As [`Lobes::value_and_pdf_from`].
    pub value: Spectra,
    /// As [`Lobes::value_and_pdf_from`].
    pub pdf: Numbers,
    /// The direction that was drawn.
    pub drawn: Vectors,
    /// As [`super::BsdfSample::weight`].
    pub weight: Spectra,
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

/// A BSDF that can be asked so, as it is in [`snell_math::ColorMode::Rgb`]; in spectral colour by
/// the [`Palette`] of each lane.
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
    Mixed(Box<ManyMixed>),
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
                if let Some((metal, gloss)) = layers.only_mixture() {
                    return ManyMixed::of(metal, gloss)
                        .map(|mixed| Self(Kind::Mixed(Box::new(mixed))));
                }
                let (slab, coat) = layers.only_slab()?;
                match (slab, coat) {
                    (OnlySlab::Opaque(gloss), None) => Self::of_gloss(gloss),
                    (OnlySlab::Metal(metal), None) => Self::of_metal(metal),
                    (OnlySlab::Opaque(gloss), Some(coat)) => {
                        let (unit, base) = (ColorMode::Rgb.unit(), ManyGloss::of(gloss)?);
                        let rough = ManyCoated::of(coat, unit, base.clone()).map(Kind::CoatedGloss);
                        rough
                            .or_else(|| ManyCoated::of(coat, unit, base).map(Kind::LacqueredGloss))
                            .map(Self)
                    }
                    (OnlySlab::Metal(metal), Some(coat)) => {
                        let (unit, base) = (ColorMode::Rgb.unit(), ManyMetal::of(metal)?);
                        let rough = ManyCoated::of(coat, unit, base.clone()).map(Kind::CoatedMetal);
                        rough
                            .or_else(|| ManyCoated::of(coat, unit, base).map(Kind::LacqueredMetal))
                            .map(Self)
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

    /// What it is where it does not differ from point to point.
    pub fn point(&self) -> ManyPoint {
        ManyPoint::with_body(match &self.0 {
            Kind::RoughGloss(gloss) => gloss.own.body,
            Kind::SmoothGloss(gloss) => gloss.own.body,
            Kind::CoatedGloss(coated) => coated.base.own.body,
            Kind::LacqueredGloss(coated) => coated.base.own.body,
            Kind::Mixed(mixed) => return mixed.point,
            _ => SampledSpectrum::ZERO,
        })
    }

    /// The spectra of this BSDF in another mode of colour; `None` if it can only be asked one by
    /// one there.
    pub fn palette_of(bsdf: &Bsdf) -> Option<Palette> {
        match bsdf {
            Bsdf::Glossy(gloss) => Some(gloss.palette()),
            Bsdf::Conductor(metal) => Some(metal.palette()),
            Bsdf::Dielectric(glass) => Some(glass.palette()),
            Bsdf::OpenPbr(layers) => layers.palette(),
            _ => None,
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

    /// True if it may be asked with any [`ManyPoint::with_body`].
    pub fn takes_any_body(&self) -> bool {
        matches!(self.0, Kind::RoughGloss(_) | Kind::Mixed(_))
    }

    /// True if it may be asked with any [`ManyPoint`] that is rough.
    pub fn takes_any_point(&self) -> bool {
        matches!(self.0, Kind::Mixed(_))
    }

    /// Answers all questions.
    pub fn answer(&self, asked: &ManyQuestions, answers: &mut ManyAnswers, wide: Option<Wide>) {
        macro_rules! answer_by {
            ($type:ty, $bsdf:expr) => {
                match asked.color {
                    ColorModel::Rgb => answer_by!($type, $bsdf, answer::<3, $type>),
                    ColorModel::Spectral => answer_by!($type, $bsdf, answer::<4, $type>),
                }
            };
            ($type:ty, $bsdf:expr, $answer:path) => {
                at_level!(
                    wide,
                    $answer,
                    (
                        bsdf: &$type = $bsdf,
                        asked: &ManyQuestions<'_> = asked,
                        answers: &mut ManyAnswers = answers
                    )
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
            Kind::Mixed(bsdf) => match asked.color {
                ColorModel::Rgb => answer_by!(ManyMixed, bsdf, ManyMixed::answer::<3>),
                ColorModel::Spectral => answer_by!(ManyMixed, bsdf, ManyMixed::answer::<4>),
            },
        }
    }
}

/// [`Lobes`] without branches, so that loops over it become vector code.
pub(super) trait ManyLobes {
    /// What is known of `wo`.
    type Seen;
    /// Spectra and what follows from them.
    type Colors: Copy;

    /// Those of this BSDF, over a body of this reflectance.
    fn own_colors(&self, body: SampledSpectrum) -> Self::Colors;

    /// Those of a lane.
    fn colors_of(&self, palette: &Palette) -> Self::Colors;

    /// As [`Lobes::seen`], in these colours.
    fn seen(&self, wo: Vec3, colors: Self::Colors) -> Self::Seen;

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
fn answer<const CHANNELS: usize, B: ManyLobes>(
    bsdf: &B,
    asked: &ManyQuestions,
    answers: &mut ManyAnswers,
) {
    for i in 0..MANY {
        let colors = match CHANNELS {
            4 => bsdf.colors_of(&asked.palette(i)),
            _ => bsdf.own_colors(asked.body(i)),
        };
        let seen = bsdf.seen(asked.wo(i), colors);
        answers.take_value::<CHANNELS>(i, bsdf.value_and_pdf_from(&seen, asked.wi(i)));
        let drawn = bsdf.draw_from(&seen, asked.u_lobe[i], asked.u(i));
        let found = bsdf.value_and_pdf_from(&seen, drawn.wi);
        answers.take_drawn::<CHANNELS>(i, &drawn, found);
    }
}

impl ManyQuestions<'_> {
    #[inline(always)]
    pub(super) fn wo(&self, i: usize) -> Vec3 {
        at(self.wo, i)
    }

    #[inline(always)]
    pub(super) fn wi(&self, i: usize) -> Vec3 {
        at(self.wi, i)
    }

    #[inline(always)]
    pub(super) fn body(&self, i: usize) -> SampledSpectrum {
        let [r, g, b, _] = self.palette[0];
        SampledSpectrum([r[i], g[i], b[i], 0.0])
    }

    #[inline(always)]
    pub(super) fn palette(&self, i: usize) -> Palette {
        self.palette.map(|channels| SampledSpectrum(channels.map(|channel| channel[i])))
    }

    #[inline(always)]
    pub(super) fn u(&self, i: usize) -> Vec2 {
        Vec2::new(self.u[0][i], self.u[1][i])
    }
}

impl ManyAnswers {
    /// Value and density of the direction that was asked about.
    #[inline(always)]
    pub(super) fn take_value<const CHANNELS: usize>(
        &mut self,
        i: usize,
        (value, pdf): (SampledSpectrum, f32),
    ) {
        put::<CHANNELS>(&mut self.value, i, value);
        self.pdf[i] = pdf;
    }

    /// A direction that was drawn, with value and density.
    #[inline(always)]
    pub(super) fn take_drawn<const CHANNELS: usize>(
        &mut self,
        i: usize,
        drawn: &ManyDrawn,
        (value, pdf): (SampledSpectrum, f32),
    ) {
        let scattered = value / pdf;
        let pick = |delta: f32, other: f32| if drawn.is_delta { delta } else { other };
        put::<CHANNELS>(&mut self.weight, i, drawn.delta.zip(scattered, pick));
        (self.drawn[0][i], self.drawn[1][i], self.drawn[2][i]) =
            (drawn.wi.x, drawn.wi.y, drawn.wi.z);
        self.drawn_pdf[i] = pick(0.0, pdf);
        self.is_delta[i] = u32::from(drawn.is_delta);
        self.is_transmission[i] = u32::from(drawn.is_transmission);
        self.crossing[i] = drawn.crossing;
        self.exists[i] = u32::from(drawn.exists & (drawn.is_delta | (pdf > 0.0)));
    }
}

#[inline(always)]
fn at(v: [&Numbers; 3], i: usize) -> Vec3 {
    Vec3::new(v[0][i], v[1][i], v[2][i])
}

#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
fn put<const CHANNELS: usize>(v: &mut Spectra, i: usize, to: SampledSpectrum) {
    for channel in 0..CHANNELS {
        v[channel][i] = to.0[channel];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::tests::{bsdf, bsdf_in};
    use crate::material::{CoatedDiffuse, Conductor, Dielectric, Material, MaterialKind, OpenPbr};
    use snell_math::simd::Level;
    use snell_math::{Rgb, rng, sampling};

    const ZERO: Vectors = [[0.0; MANY]; 3];

    #[test]
    fn many_at_once_get_the_bits_of_one_by_one() {
        let coated = [0.0, 0.05, 0.3, 1.0]
            .map(|rough| CoatedDiffuse::new(Rgb::new(0.8, 0.3, 0.0), rough).into());
        let glass = [0.05, 0.4, 1.0].map(|rough| Dielectric::rough(1.5, rough).into());
        let coated_slabs =
            [(0.0, 0.0), (0.0, 0.3), (1.0, 0.0), (1.0, 0.3)].map(|(metal, rough): (f32, f32)| {
                let surface = OpenPbr {
                    base_metalness: metal.into(),
                    specular_roughness: 0.4.into(),
                    ..OpenPbr::default()
                };
                OpenPbr { coat_weight: 0.7.into(), coat_roughness: rough.into(), ..surface }.into()
            });
        let metals = [0.05, 0.4, 1.0].map(|rough| Conductor::copper(rough).into());
        let colors =
            [0.05, 0.4, 1.0].map(|rough| Conductor::color(Rgb::new(0.9, 0.5, 0.0), rough).into());
        let kinds: [&[MaterialKind]; 6] =
            [&coated, &coated_slabs, &glass, &metals, &colors, &MaterialKind::examples()];
        let mut asked_of = 0;
        for (number, kind) in kinds.into_iter().flatten().enumerate() {
            let bsdf = bsdf(kind);
            let Some(many) = ManyBsdf::of(&bsdf) else { continue };
            asked_of += 1;
            let points = [many.point(); MANY];
            for round in 0..200 {
                let asked = Asked::new([number as u32, round], &points);
                for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                    let mut answers = ManyAnswers::default();
                    many.answer(&asked.questions(ColorModel::Rgb), &mut answers, level.wide());
                    for i in 0..MANY {
                        check(
                            &bsdf,
                            &asked.questions(ColorModel::Rgb),
                            &answers,
                            i,
                            &format!("{kind:?} {level} {round} {i}"),
                        );
                    }
                }
            }
        }
        assert!(asked_of >= 21, "{asked_of}");
    }

    #[test]
    fn many_of_different_wavelengths_get_the_bits_of_one_by_one() {
        let coated =
            [0.0, 0.3].map(|rough| CoatedDiffuse::new(Rgb::new(0.8, 0.3, 0.0), rough).into());
        let metals = [0.05, 0.4].map(|rough| Conductor::copper(rough).into());
        let surface = |metal: f32, rough: f32, coat: f32| -> MaterialKind {
            let (base, tint) = (Rgb::new(0.9, 0.2, 0.0).into(), Rgb::new(0.9, 0.7, 0.5).into());
            let surface = OpenPbr { base_color: base, specular_color: tint, ..OpenPbr::default() };
            let surface = OpenPbr {
                base_metalness: metal.into(),
                specular_roughness: rough.into(),
                ..surface
            };
            OpenPbr { coat_weight: coat.into(), specular_weight: 0.6.into(), ..surface }.into()
        };
        let layers =
            [(0.0, 0.4, 0.0), (0.0, 0.0, 0.7), (1.0, 0.4, 0.7), (0.3, 0.4, 0.0), (1.0, 0.5, 0.0)];
        let layers = layers.map(|(metal, rough, coat)| surface(metal, rough, coat));
        let kinds: [&[MaterialKind]; 4] = [&coated, &metals, &layers, &MaterialKind::examples()];
        let mut asked_of = 0;
        for (number, kind) in kinds.into_iter().flatten().enumerate() {
            let Some(many) = ManyBsdf::of(&bsdf(kind)) else { continue };
            let modes: [_; MANY] = std::array::from_fn(|i| {
                ColorModel::Spectral.mode(|| rng::uniform2([number as u32, i as u32, 1, 9]).x)
            });
            let bsdfs = modes.map(|mode| bsdf_in(mode, kind));
            if Material::new("", kind.clone()).is_dispersive() {
                continue;
            }
            let Some(palettes) = bsdfs.iter().map(ManyBsdf::palette_of).collect::<Option<Vec<_>>>()
            else {
                continue;
            };
            asked_of += 1;
            let points: [_; MANY] =
                std::array::from_fn(|i| ManyPoint { palette: palettes[i], ..many.point() });
            for round in 0..100 {
                let asked = Asked::new([number as u32, round], &points);
                for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                    let mut answers = ManyAnswers::default();
                    many.answer(&asked.questions(ColorModel::Spectral), &mut answers, level.wide());
                    for (i, bsdf) in bsdfs.iter().enumerate() {
                        let what = format!("{kind:?} {level} {round} {i}");
                        check(bsdf, &asked.questions(ColorModel::Spectral), &answers, i, &what);
                    }
                }
            }
        }
        assert!(asked_of >= 20, "{asked_of}");
    }

    #[test]
    fn mixtures_that_differ_from_point_to_point_give_the_bits_of_each() {
        let mixture = |metal: f32, rough: f32, color: Rgb| -> MaterialKind {
            let tint = Rgb::new(0.9, 0.7, 0.5).into();
            let surface =
                OpenPbr { base_color: color.into(), specular_color: tint, ..OpenPbr::default() };
            OpenPbr { base_metalness: metal.into(), specular_roughness: rough.into(), ..surface }
                .into()
        };
        let many = ManyBsdf::of(&bsdf(&mixture(0.5, 0.5, Rgb::WHITE))).expect("a mixture of two");
        assert!(many.takes_any_point());
        for round in 0..400 {
            let kinds: [_; MANY] = std::array::from_fn(|i| {
                let [a, b] = [5, 6].map(|use_of| rng::uniform2([round, i as u32, 0, use_of]));
                let (metal, rough) = ((2.0 * a.x - 0.5).clamp(0.0, 1.0), 0.032 + 0.968 * a.y);
                (metal, rough, Rgb::new(b.x, b.y, if i == 7 { 0.0 } else { b.x * b.y }))
            });
            let points = kinds.map(|(metalness, rough, color)| ManyPoint {
                alpha: rough * rough,
                metalness,
                ..ManyPoint::with_body(ColorMode::Rgb.reflectance(color))
            });
            let asked = Asked::new([100, round], &points);
            for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                let mut answers = ManyAnswers::default();
                many.answer(&asked.questions(ColorModel::Rgb), &mut answers, level.wide());
                for (i, &(metal, rough, color)) in kinds.iter().enumerate() {
                    let kind = mixture(metal, rough, color);
                    check(
                        &bsdf(&kind),
                        &asked.questions(ColorModel::Rgb),
                        &answers,
                        i,
                        &format!("{kind:?} {level} {round} {i}"),
                    );
                }
            }
        }
    }

    /// Questions of each kind.
    struct Asked {
        palette: [Spectra; 3],
        alpha: Numbers,
        metalness: Numbers,
        wo: Vectors,
        wi: Vectors,
        u_lobe: Numbers,
        u: [Numbers; 2],
    }

    impl Asked {
        fn new(seed: [u32; 2], points: &[ManyPoint; MANY]) -> Self {
            let (mut wos, mut wis, mut u_lobe, mut u) = (ZERO, ZERO, [0.0; MANY], [[0.0; MANY]; 2]);
            for i in 0..MANY {
                let number = |use_of: u32| rng::uniform2([seed[0], seed[1], i as u32, use_of]);
                let [mut wo, mut wi] =
                    [1, 2].map(|use_of| sampling::uniform_sphere(number(use_of)));
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
            Self {
                palette: [0, 1, 2].map(|i| {
                    [0, 1, 2, 3].map(|channel| points.map(|point| point.palette[i][channel]))
                }),
                alpha: points.map(|point| point.alpha),
                metalness: points.map(|point| point.metalness),
                wo: wos,
                wi: wis,
                u_lobe,
                u,
            }
        }

        fn questions(&self, color: ColorModel) -> ManyQuestions<'_> {
            ManyQuestions {
                is_asked: &[1; MANY],
                palette: self.palette.each_ref().map(|channels| channels.each_ref()),
                color,
                alpha: &self.alpha,
                metalness: &self.metalness,
                wo: self.wo.each_ref(),
                wi: self.wi.each_ref(),
                u_lobe: &self.u_lobe,
                u: self.u.each_ref(),
            }
        }
    }

    fn check(bsdf: &Bsdf, asked: &ManyQuestions, answers: &ManyAnswers, i: usize, what: &str) {
        let lanes = if asked.color == ColorModel::Rgb { 3 } else { 4 };
        let bits = |v: [f32; 4], x: f32| (v.map(|x| (x + 0.0).to_bits()), x.to_bits());
        let spectrum = |v: &Spectra| std::array::from_fn(|k| if k < lanes { v[k][i] } else { 0.0 });
        let seen = bsdf.seen(at(asked.wo, i));
        let (value, pdf) = bsdf.value_and_pdf_from(&seen, at(asked.wi, i));
        assert_eq!(bits(spectrum(&answers.value), answers.pdf[i]), bits(value.0, pdf), "{what}");
        let sample =
            bsdf.sample_from(&seen, asked.u_lobe[i], Vec2::new(asked.u[0][i], asked.u[1][i]));
        assert_eq!(answers.exists[i] != 0, sample.is_some(), "{what}");
        let Some(sample) = sample else { return };
        assert_eq!(
            bits(spectrum(&answers.weight), answers.drawn_pdf[i]),
            bits(sample.weight.0, sample.pdf),
            "{what}"
        );
        assert_eq!(at(answers.drawn.each_ref(), i), sample.wi, "{what}");
        let is = [answers.is_delta[i] != 0, answers.is_transmission[i] != 0];
        assert_eq!(is, [sample.is_delta, sample.is_transmission], "{what}");
        let crossing =
            if sample.is_transmission { bsdf.crossing_scale(at(asked.wo, i)) } else { 1.0 };
        assert_eq!(answers.crossing[i], crossing, "{what}");
    }
}
