//! BSDFs for a batch of directions, with the same bits as [`Lobes`], in loops that become vector
//! code.

use super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::coat::BatchCoated;
use super::conductor::{BatchMetal, ComplexIor, F82};
use super::dielectric::BatchGlass;
use super::glossy::BatchGloss;
use super::microfacets::{Rough, Smooth};
use super::open_pbr::{BatchMixed, OnlySlab};
use super::{Bsdf, ConductorBsdf, GlossyBsdf, Lobes};
use snell_math::simd::Wide;
use snell_math::{ColorMode, ColorModel, SampledSpectrum, Vec2, Vec3, at_level};

/// The number of directions in a batch.
pub const BATCH: usize = 16;

/// A number for each direction of a batch.
type Numbers = [f32; BATCH];
/// A vector for each direction of a batch, by axis.
type Vectors = [Numbers; 3];
/// A spectrum for each direction of a batch, by channel.
type Spectra = [Numbers; 4];

/// Spectra of a BSDF by their role, which differs from kind to kind. A mixture of metal and gloss
/// uses `base` and `specular` for both.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeSpectra<T = SampledSpectrum> {
    /// For a gloss the reflectance of the body below it; for a metal the reflectance at normal
    /// incidence, or the real part of the index of refraction; for glass the tint of light that
    /// crosses it.
    pub base: T,
    /// For a gloss its tint; for a metal the factor at the edge ([`super::FacetReflectance`]), or
    /// the imaginary part of the index of refraction; for glass the tint of reflections on the
    /// outer side.
    pub specular: T,
    /// For a metal a factor on its reflectance; for glass the tint of reflections on the inner
    /// side.
    pub other: T,
}

impl<T> LobeSpectra<T> {
    /// Applies a function to each spectrum.
    #[inline(always)]
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> LobeSpectra<U> {
        LobeSpectra { base: f(self.base), specular: f(self.specular), other: f(self.other) }
    }

    /// References to the spectra.
    #[inline(always)]
    pub fn each_ref(&self) -> LobeSpectra<&T> {
        LobeSpectra { base: &self.base, specular: &self.specular, other: &self.other }
    }
}

/// The inputs of an evaluation, in the frame of the BSDF.
#[derive(Clone, Copy, Debug)]
pub struct BatchInputs<'a> {
    /// 1 for lanes that are evaluated, 0 for others, whose outputs are arbitrary.
    pub is_active: &'a [u32; BATCH],
    /// See [`BatchPoint::spectra`]. In [`snell_math::ColorMode::Rgb`] only the first three channels
    /// of `base` are used.
    pub spectra: LobeSpectra<[&'a Numbers; 4]>,
    /// The colour model: what the channels of spectra stand for.
    pub color: ColorModel,
    /// See [`BatchPoint::alpha`].
    pub alpha: &'a Numbers,
    /// See [`BatchPoint::metalness`].
    pub metalness: &'a Numbers,
    /// Unit directions towards the viewer.
    pub wo: [&'a Numbers; 3],
    /// Unit directions towards the light, for which value and density are computed.
    pub wi: [&'a Numbers; 3],
    /// Numbers in `[0, 1)` that choose the lobe of a sampled direction; see [`Lobes::draw_from`].
    pub u_lobe: &'a Numbers,
    /// Further numbers in `[0, 1)` for the sampled direction.
    pub u: [&'a Numbers; 2],
}

/// Parameters of a BSDF that may vary over a surface. A BSDF uses only those that it has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchPoint {
    /// The spectra. In [`snell_math::ColorMode::Rgb`] only `base` is used: the reflectance of
    /// the body below a gloss. If metal is mixed with the gloss, `base` is also the metal's
    /// reflectance at normal incidence. In spectral mode all three are used.
    pub spectra: LobeSpectra,
    /// Width of the facet distribution of a mixture of metal and gloss, see [`super::Widths`].
    pub alpha: f32,
    /// Fraction of metal in such a mixture.
    pub metalness: f32,
}

impl BatchPoint {
    /// A point at which the reflectance of the body is the only parameter that varies.
    pub fn with_body(body: SampledSpectrum) -> Self {
        Self {
            spectra: LobeSpectra { base: body, ..LobeSpectra::default() },
            alpha: 0.0,
            metalness: 0.0,
        }
    }
}

/// The outputs of an evaluation.
#[derive(Clone, Debug, Default)]
pub struct BatchOutputs {
    /// The value of [`Lobes::value_and_pdf_from`] for `wi`.
    pub value: Spectra,
    /// The density of [`Lobes::value_and_pdf_from`] for `wi`.
    pub pdf: Numbers,
    /// The sampled unit direction.
    pub drawn: Vectors,
    /// See [`super::BsdfSample::weight`].
    pub weight: Spectra,
    /// See [`super::BsdfSample::pdf`].
    pub drawn_pdf: Numbers,
    /// 1 if [`super::BsdfSample::is_delta`], 0 if not.
    pub is_delta: [u32; BATCH],
    /// 1 if [`super::BsdfSample::is_transmission`], 0 if not.
    pub is_transmission: [u32; BATCH],
    /// [`Lobes::crossing_scale`] if the sampled direction crosses the surface, otherwise 1.
    pub crossing: Numbers,
    /// 1 if a direction was sampled, 0 if not.
    pub exists: [u32; BATCH],
}

/// A BSDF that can be evaluated in batches. It holds the spectra of [`snell_math::ColorMode::Rgb`];
/// in spectral mode each lane brings its [`LobeSpectra`].
#[derive(Clone, Debug)]
pub struct BatchBsdf(Kind);

#[derive(Clone, Debug)]
enum Kind {
    RoughGloss(BatchGloss<Rough>),
    SmoothGloss(BatchGloss<Smooth>),
    Measured(BatchMetal<ComplexIor>),
    Colored(BatchMetal<F82>),
    Glass(BatchGlass),
    RoughCoatedGloss(BatchCoated<BatchGloss<Rough>, Rough>),
    SmoothCoatedGloss(BatchCoated<BatchGloss<Rough>, Smooth>),
    RoughCoatedMetal(BatchCoated<BatchMetal<F82>, Rough>),
    SmoothCoatedMetal(BatchCoated<BatchMetal<F82>, Smooth>),
    Mixed(Box<BatchMixed>),
}

impl BatchBsdf {
    /// `None` of kinds that have no batch form. Anisotropic surfaces have none: their losses depend
    /// on the azimuth of a direction, too.
    pub fn of(bsdf: &Bsdf) -> Option<Self> {
        if bsdf.has_tangent() {
            return None;
        }
        if let Bsdf::Dielectric(glass) = bsdf {
            return BatchGlass::of(glass).map(|glass| Self(Kind::Glass(glass)));
        }
        if bsdf.is_delta() || !bsdf.is_opaque() {
            return None;
        }
        match bsdf {
            Bsdf::Glossy(gloss) => Self::of_gloss(gloss),
            Bsdf::Conductor(metal) => Self::of_metal(metal),
            Bsdf::OpenPbr(layers) => {
                if let Some((metal, gloss)) = layers.only_mixture() {
                    return BatchMixed::of(metal, gloss)
                        .map(|mixed| Self(Kind::Mixed(Box::new(mixed))));
                }
                let (slab, coat) = layers.only_slab()?;
                match (slab, coat) {
                    (OnlySlab::Opaque(gloss), None) => Self::of_gloss(gloss),
                    (OnlySlab::Metal(metal), None) => Self::of_metal(metal),
                    (OnlySlab::Opaque(gloss), Some(coat)) => {
                        let (unit, base) = (ColorMode::Rgb.unit(), BatchGloss::of(gloss)?);
                        let rough = BatchCoated::of(coat, unit, base).map(Kind::RoughCoatedGloss);
                        rough
                            .or_else(|| {
                                BatchCoated::of(coat, unit, base).map(Kind::SmoothCoatedGloss)
                            })
                            .map(Self)
                    }
                    (OnlySlab::Metal(metal), Some(coat)) => {
                        let (unit, base) = (ColorMode::Rgb.unit(), BatchMetal::of(metal)?);
                        let rough = BatchCoated::of(coat, unit, base).map(Kind::RoughCoatedMetal);
                        rough
                            .or_else(|| {
                                BatchCoated::of(coat, unit, base).map(Kind::SmoothCoatedMetal)
                            })
                            .map(Self)
                    }
                }
            }
            _ => None,
        }
    }

    fn of_gloss(gloss: &GlossyBsdf) -> Option<Self> {
        let rough = BatchGloss::of(gloss).map(Kind::RoughGloss);
        rough.or_else(|| BatchGloss::of(gloss).map(Kind::SmoothGloss)).map(Self)
    }

    fn of_metal(metal: &ConductorBsdf) -> Option<Self> {
        let measured = BatchMetal::of(metal).map(Kind::Measured);
        measured.or_else(|| BatchMetal::of(metal).map(Kind::Colored)).map(Self)
    }

    /// The BSDF's own parameters, for surfaces over which they do not vary.
    pub fn point(&self) -> BatchPoint {
        BatchPoint::with_body(match &self.0 {
            Kind::RoughGloss(gloss) => gloss.body(),
            Kind::SmoothGloss(gloss) => gloss.body(),
            Kind::RoughCoatedGloss(coated) => coated.base.body(),
            Kind::SmoothCoatedGloss(coated) => coated.base.body(),
            Kind::Mixed(mixed) => return mixed.point,
            _ => SampledSpectrum::ZERO,
        })
    }

    /// The spectra of `bsdf`, which may be in any colour mode; `None` if its kind has no batch
    /// form.
    pub fn spectra_of(bsdf: &Bsdf) -> Option<LobeSpectra> {
        match bsdf {
            Bsdf::Glossy(gloss) => Some(gloss.spectra()),
            Bsdf::Conductor(metal) => Some(metal.spectra()),
            Bsdf::Dielectric(glass) => Some(glass.spectra()),
            Bsdf::OpenPbr(layers) => layers.spectra(),
            _ => None,
        }
    }

    /// True if the BSDF has a coat in the frame of its base.
    pub fn has_coat(&self) -> bool {
        use Kind::{RoughCoatedGloss, RoughCoatedMetal, SmoothCoatedGloss, SmoothCoatedMetal};
        matches!(
            self.0,
            RoughCoatedGloss(_) | SmoothCoatedGloss(_) | RoughCoatedMetal(_) | SmoothCoatedMetal(_)
        )
    }

    /// True if the BSDF transmits light.
    pub fn transmits(&self) -> bool {
        matches!(self.0, Kind::Glass(_))
    }

    /// True if the BSDF can be evaluated with any [`BatchPoint::with_body`].
    pub fn takes_any_body(&self) -> bool {
        matches!(self.0, Kind::RoughGloss(_) | Kind::Mixed(_))
    }

    /// True if the BSDF can be evaluated with any rough [`BatchPoint`].
    pub fn takes_any_point(&self) -> bool {
        matches!(self.0, Kind::Mixed(_))
    }

    /// Evaluates the BSDF for all active lanes, and samples a direction for each.
    pub fn evaluate(&self, inputs: &BatchInputs, outputs: &mut BatchOutputs, wide: Option<Wide>) {
        macro_rules! evaluate_by {
            ($type:ty, $bsdf:expr) => {
                match inputs.color {
                    ColorModel::Rgb => evaluate_by!($type, $bsdf, evaluate::<3, $type>),
                    ColorModel::Spectral => evaluate_by!($type, $bsdf, evaluate::<4, $type>),
                }
            };
            ($type:ty, $bsdf:expr, $evaluate:path) => {
                at_level!(
                    wide,
                    $evaluate,
                    (
                        bsdf: &$type = $bsdf,
                        inputs: &BatchInputs<'_> = inputs,
                        outputs: &mut BatchOutputs = outputs
                    )
                )
            };
        }
        match &self.0 {
            Kind::RoughGloss(bsdf) => evaluate_by!(BatchGloss<Rough>, bsdf),
            Kind::SmoothGloss(bsdf) => evaluate_by!(BatchGloss<Smooth>, bsdf),
            Kind::Measured(bsdf) => evaluate_by!(BatchMetal<ComplexIor>, bsdf),
            Kind::Colored(bsdf) => evaluate_by!(BatchMetal<F82>, bsdf),
            Kind::Glass(bsdf) => evaluate_by!(BatchGlass, bsdf),
            Kind::RoughCoatedGloss(bsdf) => {
                evaluate_by!(BatchCoated<BatchGloss<Rough>, Rough>, bsdf)
            }
            Kind::SmoothCoatedGloss(bsdf) => {
                evaluate_by!(BatchCoated<BatchGloss<Rough>, Smooth>, bsdf)
            }
            Kind::RoughCoatedMetal(bsdf) => {
                evaluate_by!(BatchCoated<BatchMetal<F82>, Rough>, bsdf)
            }
            Kind::SmoothCoatedMetal(bsdf) => {
                evaluate_by!(BatchCoated<BatchMetal<F82>, Smooth>, bsdf)
            }
            Kind::Mixed(bsdf) => match inputs.color {
                ColorModel::Rgb => evaluate_by!(BatchMixed, bsdf, BatchMixed::evaluate::<3>),
                ColorModel::Spectral => evaluate_by!(BatchMixed, bsdf, BatchMixed::evaluate::<4>),
            },
        }
    }
}

/// Lobes for lanes that differ in their spectra.
pub(super) trait BatchLobes: BranchlessLobes {
    /// The BSDF's own spectra, where all lanes share them. `body` is the reflectance of the layer
    /// below a gloss and of the metal in a mixture; other lobes ignore it.
    fn own_colors(&self, body: SampledSpectrum) -> Self::Colors;

    /// The spectra of a lane.
    fn colors_of(&self, spectra: &LobeSpectra) -> Self::Colors;
}

#[inline(always)]
fn evaluate<const CHANNELS: usize, B: BatchLobes>(
    bsdf: &B,
    inputs: &BatchInputs,
    outputs: &mut BatchOutputs,
) {
    for i in 0..BATCH {
        let colors = match CHANNELS {
            4 => bsdf.colors_of(&inputs.spectra(i)),
            _ => bsdf.own_colors(inputs.body(i)),
        };
        let seen = bsdf.seen(&colors, inputs.wo(i));
        outputs.take_value::<CHANNELS>(i, bsdf.value_and_pdf_from(&colors, &seen, inputs.wi(i)));
        let drawn = bsdf.draw_from(&colors, &seen, inputs.u_lobe[i], inputs.u(i));
        let found = bsdf.value_and_pdf_from(&colors, &seen, drawn.wi);
        outputs.take_drawn::<CHANNELS>(i, &drawn, found);
    }
}

impl BatchInputs<'_> {
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
        let [r, g, b, _] = self.spectra.base;
        SampledSpectrum([r[i], g[i], b[i], 0.0])
    }

    #[inline(always)]
    pub(super) fn spectra(&self, i: usize) -> LobeSpectra {
        self.spectra.map(|channels| SampledSpectrum(channels.map(|channel| channel[i])))
    }

    #[inline(always)]
    pub(super) fn u(&self, i: usize) -> Vec2 {
        Vec2::new(self.u[0][i], self.u[1][i])
    }
}

impl BatchOutputs {
    /// Value and density of a direction of the inputs.
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
        drawn: &BranchlessDrawn,
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

    const ZERO: Vectors = [[0.0; BATCH]; 3];

    #[test]
    fn batches_get_the_bits_of_one_by_one() {
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
        let mut checked = 0;
        for (number, kind) in kinds.into_iter().flatten().enumerate() {
            let bsdf = bsdf(kind);
            let Some(batch) = BatchBsdf::of(&bsdf) else { continue };
            checked += 1;
            let points = [batch.point(); BATCH];
            for round in 0..200 {
                let inputs = Inputs::new([number as u32, round], &points);
                for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                    let mut outputs = BatchOutputs::default();
                    batch.evaluate(&inputs.inputs(ColorModel::Rgb), &mut outputs, level.wide());
                    for i in 0..BATCH {
                        check(
                            &bsdf,
                            &inputs.inputs(ColorModel::Rgb),
                            &outputs,
                            i,
                            &format!("{kind:?} {level} {round} {i}"),
                        );
                    }
                }
            }
        }
        assert!(checked >= 21, "{checked}");
    }

    #[test]
    fn batches_of_different_wavelengths_get_the_bits_of_one_by_one() {
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
        let mut checked = 0;
        for (number, kind) in kinds.into_iter().flatten().enumerate() {
            let Some(batch) = BatchBsdf::of(&bsdf(kind)) else { continue };
            let modes: [_; BATCH] = std::array::from_fn(|i| {
                ColorModel::Spectral.mode(|| rng::uniform2([number as u32, i as u32, 1, 9]).x)
            });
            let bsdfs = modes.map(|mode| bsdf_in(mode, kind));
            if Material::new("", kind.clone()).is_dispersive() {
                continue;
            }
            let Some(spectra) = bsdfs.iter().map(BatchBsdf::spectra_of).collect::<Option<Vec<_>>>()
            else {
                continue;
            };
            checked += 1;
            let points: [_; BATCH] =
                std::array::from_fn(|i| BatchPoint { spectra: spectra[i], ..batch.point() });
            for round in 0..100 {
                let inputs = Inputs::new([number as u32, round], &points);
                for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                    let mut outputs = BatchOutputs::default();
                    batch.evaluate(
                        &inputs.inputs(ColorModel::Spectral),
                        &mut outputs,
                        level.wide(),
                    );
                    for (i, bsdf) in bsdfs.iter().enumerate() {
                        let what = format!("{kind:?} {level} {round} {i}");
                        check(bsdf, &inputs.inputs(ColorModel::Spectral), &outputs, i, &what);
                    }
                }
            }
        }
        assert!(checked >= 20, "{checked}");
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
        let batch = BatchBsdf::of(&bsdf(&mixture(0.5, 0.5, Rgb::WHITE))).expect("a mixture of two");
        assert!(batch.takes_any_point());
        for round in 0..400 {
            let kinds: [_; BATCH] = std::array::from_fn(|i| {
                let [a, b] = [5, 6].map(|use_of| rng::uniform2([round, i as u32, 0, use_of]));
                let (metal, rough) = ((2.0 * a.x - 0.5).clamp(0.0, 1.0), 0.032 + 0.968 * a.y);
                (metal, rough, Rgb::new(b.x, b.y, if i == 7 { 0.0 } else { b.x * b.y }))
            });
            let points = kinds.map(|(metalness, rough, color)| BatchPoint {
                alpha: rough * rough,
                metalness,
                ..BatchPoint::with_body(ColorMode::Rgb.reflectance(color))
            });
            let inputs = Inputs::new([100, round], &points);
            for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                let mut outputs = BatchOutputs::default();
                batch.evaluate(&inputs.inputs(ColorModel::Rgb), &mut outputs, level.wide());
                for (i, &(metal, rough, color)) in kinds.iter().enumerate() {
                    let kind = mixture(metal, rough, color);
                    check(
                        &bsdf(&kind),
                        &inputs.inputs(ColorModel::Rgb),
                        &outputs,
                        i,
                        &format!("{kind:?} {level} {round} {i}"),
                    );
                }
            }
        }
    }

    /// Inputs for the evaluation of BSDFs of each kind.
    struct Inputs {
        spectra: LobeSpectra<Spectra>,
        alpha: Numbers,
        metalness: Numbers,
        wo: Vectors,
        wi: Vectors,
        u_lobe: Numbers,
        u: [Numbers; 2],
    }

    impl Inputs {
        fn new(seed: [u32; 2], points: &[BatchPoint; BATCH]) -> Self {
            let (mut wos, mut wis, mut u_lobe, mut u) =
                (ZERO, ZERO, [0.0; BATCH], [[0.0; BATCH]; 2]);
            for i in 0..BATCH {
                let number = |use_of: u32| rng::uniform2([seed[0], seed[1], i as u32, use_of]);
                let [mut wo, mut wi] =
                    [1, 2].map(|use_of| sampling::uniform_sphere(number(use_of)));
                // Grazing directions, directions in the surface, and mirror directions are tested
                // too.
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
                spectra: {
                    let of = |get: fn(&BatchPoint) -> SampledSpectrum| {
                        [0, 1, 2, 3]
                            .map(|channel| points.each_ref().map(|point| get(point)[channel]))
                    };
                    LobeSpectra {
                        base: of(|point| point.spectra.base),
                        specular: of(|point| point.spectra.specular),
                        other: of(|point| point.spectra.other),
                    }
                },
                alpha: points.map(|point| point.alpha),
                metalness: points.map(|point| point.metalness),
                wo: wos,
                wi: wis,
                u_lobe,
                u,
            }
        }

        fn inputs(&self, color: ColorModel) -> BatchInputs<'_> {
            BatchInputs {
                is_active: &[1; BATCH],
                spectra: self.spectra.each_ref().map(|channels| channels.each_ref()),
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

    fn check(bsdf: &Bsdf, inputs: &BatchInputs, outputs: &BatchOutputs, i: usize, what: &str) {
        let lanes = if inputs.color == ColorModel::Rgb { 3 } else { 4 };
        let bits = |v: [f32; 4], x: f32| (v.map(|x| (x + 0.0).to_bits()), x.to_bits());
        let spectrum = |v: &Spectra| std::array::from_fn(|k| if k < lanes { v[k][i] } else { 0.0 });
        let seen = bsdf.seen(at(inputs.wo, i));
        let (value, pdf) = bsdf.value_and_pdf_from(&seen, at(inputs.wi, i));
        assert_eq!(bits(spectrum(&outputs.value), outputs.pdf[i]), bits(value.0, pdf), "{what}");
        let sample =
            bsdf.sample_from(&seen, inputs.u_lobe[i], Vec2::new(inputs.u[0][i], inputs.u[1][i]));
        assert_eq!(outputs.exists[i] != 0, sample.is_some(), "{what}");
        let Some(sample) = sample else { return };
        assert_eq!(
            bits(spectrum(&outputs.weight), outputs.drawn_pdf[i]),
            bits(sample.weight.0, sample.pdf),
            "{what}"
        );
        assert_eq!(at(outputs.drawn.each_ref(), i), sample.wi, "{what}");
        let is = [outputs.is_delta[i] != 0, outputs.is_transmission[i] != 0];
        assert_eq!(is, [sample.is_delta, sample.is_transmission], "{what}");
        let crossing =
            if sample.is_transmission { bsdf.crossing_scale(at(inputs.wo, i)) } else { 1.0 };
        assert_eq!(outputs.crossing[i], crossing, "{what}");
    }
}
