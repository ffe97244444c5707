//! The surface of OpenPBR Surface 1.1.

use super::prepared::anywhere;
use super::{ColorParam, FrameNeeds, Material, NormalMap, ScalarParam, ShadingPoint, positive_ior};
use crate::bsdf::{
    BatchBsdf, BatchPoint, Body, Bsdf, Coat, ConductorBsdf, DielectricBsdf, DiffuseBsdf, F82,
    FacetReflectance, Fuzz, FuzzModel, Ggx, Gloss, GlossyBsdf, Interface, LobeSpectra, OpenPbrBsdf,
    SheetBsdf, Slabs, ThinFilm, Translucent, Widths, bounded, fresnel,
};
use crate::graph::TextureId;
use crate::medium::{HenyeyGreenstein, MediumProperties};
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::spectrum::{LINE_D, RefractiveIndex};
use snell_math::{Rgb, SampledSpectrum, real};

snell_math::declare! {
    /// The surface that the specification OpenPBR Surface 1.1 (Academy Software Foundation)
    /// describes, with its names and defaults: fuzz over coat over a mixture of metal, clear and
    /// opaque dielectric. Each parameter is a factor, multiplied by a texture if there is one.
    ///
    /// Parameters that all materials have are moved to these when the material is made:
    /// `emission_luminance` times `emission_color` to `emission` (one nit as one W/(m² sr), as for
    /// glTF), `geometry_opacity` to `alpha`, `geometry_normal` to `normal_map`.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct OpenPbr {
        /// Factor on `base_color`, `[0, 1]`.
        #[range(Range::SHARE)]
        pub base_weight: ScalarParam,
        /// Colour of the diffuse base, and reflectance of the metal at normal incidence, `[0, 1]`;
        /// multiplied by the vertex colour.
        #[range(Range::SHARE)]
        pub base_color: ColorParam,
        /// Roughness of the diffuse base, `[0, 1]`: 0 is Lambertian, 1 looks flat.
        #[range(Range::SHARE)]
        pub base_diffuse_roughness: ScalarParam,
        /// Fraction of metal: 0 is a dielectric, 1 a metal.
        #[range(Range::SHARE)]
        pub base_metalness: ScalarParam,
        /// Factor on the reflectance at normal incidence. For dielectrics it may exceed 1, as long
        /// as the reflectance does not.
        #[range(Range::AMOUNT)]
        pub specular_weight: ScalarParam,
        /// Tint of the dielectric's reflection, and factor on the metal's reflectance at 82
        /// degrees, `[0, 1]`.
        #[range(Range::SHARE)]
        pub specular_color: ColorParam,
        /// Roughness of metal and dielectric, `[0, 1]`; `alpha` of the distribution is its square.
        #[range(Range::SHARE)]
        pub specular_roughness: ScalarParam,
        /// Anisotropy: stretching of highlights along the tangent, `[0, 1]`.
        #[range(Range::SHARE)]
        pub specular_roughness_anisotropy: ScalarParam,
        /// Index of refraction of the dielectric, positive.
        #[range(Range::Positive)]
        pub specular_ior: ScalarParam,
        /// Fraction of the dielectric that is clear, `[0, 1]`.
        #[range(Range::SHARE)]
        pub transmission_weight: ScalarParam,
        /// Transmittance over `transmission_depth`, `[0, 1]`. For a depth of 0 it is a factor on
        /// transmitted light.
        #[range(Range::SHARE)]
        pub transmission_color: ColorParam,
        /// Distance over which light has the transmittance `transmission_color`, in units of the
        /// scene.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        pub transmission_depth: ScalarParam,
        /// Scattering coefficient of the clear dielectric, multiplied by `transmission_depth`.
        #[range(Range::AMOUNT)]
        pub transmission_scatter: ColorParam,
        /// Mean cosine of scattering in the clear dielectric, `(-1, 1)`.
        #[range(Range::Within(-1.0, 1.0))]
        pub transmission_scatter_anisotropy: ScalarParam,
        /// Factor on dispersion, `[0, 1]`.
        #[range(Range::SHARE)]
        pub transmission_dispersion_scale: ScalarParam,
        /// Abbe number of the clear dielectric, positive: 20 spreads colours widely, 60 is glass.
        #[range(Range::Positive)]
        pub transmission_dispersion_abbe_number: ScalarParam,
        /// Further factor on light that goes through the surface. It is not in the specification;
        /// glTF's base colour of glass needs it.
        #[range(Range::SHARE)]
        pub transmission_tint: ColorParam,
        /// Fraction of the opaque dielectric that scatters light under the surface, `[0, 1]`.
        #[range(Range::SHARE)]
        pub subsurface_weight: ScalarParam,
        /// Colour that scattering under the surface gives, `[0, 1]`.
        #[range(Range::SHARE)]
        pub subsurface_color: ColorParam,
        /// Mean free path there, in units of the scene. For 0 light comes out where it went in: the
        /// surface is matte.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        pub subsurface_radius: ScalarParam,
        /// Factor on the mean free path, per channel.
        #[range(Range::AMOUNT)]
        pub subsurface_radius_scale: ColorParam,
        /// Mean cosine of scattering under the surface, `(-1, 1)`. For thin walls, -1 reflects and
        /// 1 transmits.
        #[range(Range::Within(-1.0, 1.0))]
        pub subsurface_scatter_anisotropy: ScalarParam,
        /// Fraction of the surface that is coated, `[0, 1]`.
        #[range(Range::SHARE)]
        pub coat_weight: ScalarParam,
        /// Transmittance of the coat for light that crosses it twice, `[0, 1]`.
        #[range(Range::SHARE)]
        pub coat_color: ColorParam,
        /// Roughness of the coat, `[0, 1]`.
        #[range(Range::SHARE)]
        pub coat_roughness: ScalarParam,
        /// Anisotropy of the coat: stretching of its highlights along the tangent, `[0, 1]`.
        #[range(Range::SHARE)]
        pub coat_roughness_anisotropy: ScalarParam,
        /// Index of refraction of the coat, positive.
        #[range(Range::Positive)]
        pub coat_ior: ScalarParam,
        /// Strength of the darkening by reflections inside the coat, `[0, 1]`.
        #[range(Range::SHARE)]
        pub coat_darkening: ScalarParam,
        /// Fraction of the surface that is fuzzy, `[0, 1]`.
        #[range(Range::SHARE)]
        pub fuzz_weight: ScalarParam,
        /// Colour of the fuzz, `[0, 1]`.
        #[range(Range::SHARE)]
        pub fuzz_color: ColorParam,
        /// Roughness of the fuzz: 0 for thin straight fibres, 1 for dust.
        #[range(Range::SHARE)]
        pub fuzz_roughness: ScalarParam,
        /// Law of the fuzz's reflection, in addition to what the specification has.
        pub fuzz_model: FuzzModel,
        /// Share of the base that a thin film covers, `[0, 1]`.
        #[range(Range::SHARE)]
        pub thin_film_weight: ScalarParam,
        /// Thickness of the film in micrometres.
        #[range(Range::AMOUNT)]
        #[unit("micrometres")]
        pub thin_film_thickness: ScalarParam,
        /// Index of refraction of the film, positive.
        #[range(Range::Positive)]
        pub thin_film_ior: ScalarParam,
        /// Luminance of the surface in cd/m².
        #[range(LIGHT)]
        #[unit("cd / m^2")]
        pub emission_luminance: ScalarParam,
        /// Factor on the luminance, `[0, 1]`.
        #[range(Range::SHARE)]
        pub emission_color: ColorParam,
        /// Opacity, the fraction of the surface that is present, `[0, 1]`.
        #[range(Range::SHARE)]
        pub geometry_opacity: ScalarParam,
        /// True for sheets without an inside: windows, leaves, paper.
        pub geometry_thin_walled: bool,
        /// Normal map of the base.
        pub geometry_normal: Option<NormalMap>,
        /// Normal map of the coat, which does not follow that of the base.
        pub geometry_coat_normal: Option<NormalMap>,
        /// Map that rotates the tangent of the base.
        pub geometry_tangent: Option<TangentMap>,
        /// Map that rotates the tangent of the coat. It has no effect unless the coat has its own
        /// normal.
        pub geometry_coat_tangent: Option<TangentMap>,
    }
}

snell_math::declare! {
    /// Direction in which highlights are stretched.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct TangentMap {
        /// Angle in radians, counter-clockwise from the tangent of the surface.
        #[unit("radians")]
        pub rotation: f32,
        /// Linear texture in which `2 rg - 1` is a direction, which the angle rotates further.
        pub texture: Option<TextureId>,
    }
}

impl TangentMap {
    /// The angle at a point, radians counter-clockwise from the tangent of the surface.
    fn angle(&self, point: &ShadingPoint) -> f32 {
        let turned = self.texture.map_or(0.0, |id| {
            let [r, g, ..] = point.textures.lookup(id, point.surface, point.footprint);
            let (x, y) = (2.0 * r - 1.0, 2.0 * g - 1.0);
            if x == 0.0 && y == 0.0 { 0.0 } else { real::atan2(y, x) }
        });
        if self.rotation.is_finite() { self.rotation + turned } else { turned }
    }
}

impl Default for OpenPbr {
    /// The specification's defaults.
    fn default() -> Self {
        let (one, none): (ScalarParam, ScalarParam) = (1.0.into(), 0.0.into());
        let (white, grey) = (ColorParam::from(Rgb::WHITE), ColorParam::from(Rgb::splat(0.8)));
        Self {
            base_weight: one,
            base_color: grey,
            base_diffuse_roughness: none,
            base_metalness: none,
            specular_weight: one,
            specular_color: white,
            specular_roughness: 0.3.into(),
            specular_roughness_anisotropy: none,
            specular_ior: 1.5.into(),
            transmission_weight: none,
            transmission_color: white,
            transmission_depth: none,
            transmission_scatter: Rgb::BLACK.into(),
            transmission_scatter_anisotropy: none,
            transmission_dispersion_scale: none,
            transmission_dispersion_abbe_number: 20.0.into(),
            transmission_tint: white,
            subsurface_weight: none,
            subsurface_color: grey,
            subsurface_radius: one,
            subsurface_radius_scale: Rgb::new(1.0, 0.5, 0.25).into(),
            subsurface_scatter_anisotropy: none,
            coat_weight: none,
            coat_color: white,
            coat_roughness: none,
            coat_roughness_anisotropy: none,
            coat_ior: 1.6.into(),
            coat_darkening: one,
            fuzz_weight: none,
            fuzz_color: white,
            fuzz_roughness: 0.5.into(),
            fuzz_model: FuzzModel::Flakes,
            thin_film_weight: none,
            thin_film_thickness: 0.5.into(),
            thin_film_ior: 1.4.into(),
            emission_luminance: none,
            emission_color: white,
            geometry_opacity: one,
            geometry_thin_walled: false,
            geometry_normal: None,
            geometry_coat_normal: None,
            geometry_tangent: None,
            geometry_coat_tangent: None,
        }
    }
}

/// The dielectric index of refraction whose reflectance at normal incidence is that of `eta`
/// multiplied by `weight` (OpenPBR Surface 1.1, "Dielectric base").
fn modulated_ior(eta: f32, weight: f32) -> f32 {
    let epsilon = (weight * fresnel::f0_from_ior(eta)).clamp(0.0, 0.98).sqrt();
    let epsilon = if eta < 1.0 { -epsilon } else { epsilon };
    (1.0 + epsilon) / (1.0 - epsilon)
}

/// The roughness of the base under a rough coat (OpenPBR Surface 1.1, "Roughening").
fn roughened(base: f32, coat: f32, weight: f32) -> f32 {
    let together = (real::powi(base, 4) + 2.0 * real::powi(coat, 4)).min(1.0).sqrt().sqrt();
    base + (together - base) * weight
}

/// The single-scattering albedo for which multiple scattering has this colour in diffuse light (van
/// de Hulst's approximation, as OpenPBR Surface 1.1 gives it).
fn scattering_albedo(color: f32, g: f32) -> f32 {
    let c = color.clamp(0.0, 1.0);
    let s = 4.09712 + 4.20863 * c - (9.59217 + 41.6808 * c + 17.7126 * c * c).sqrt();
    let s2 = (s * s).clamp(0.0, 1.0);
    ((1.0 - s2) / (1.0 - g * s2)).clamp(0.0, 1.0)
}

/// The scalar parameters at a point that several lobes use.
struct Common {
    metalness: f32,
    transmission: f32,
    subsurface: f32,
    coat: f32,
    /// Roughness of the base, as it is under the coat.
    ggx: Ggx,
    specular_weight: f32,
    ior: f32,
}

impl OpenPbr {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let plain = Self::default;
        let orange = || ColorParam::from(Rgb::new(0.9, 0.4, 0.05));
        vec![
            plain(),
            Self { subsurface_weight: 0.7.into(), subsurface_color: orange(), ..plain() },
            Self {
                base_metalness: 1.0.into(),
                base_color: orange(),
                specular_color: Rgb::new(0.5, 0.8, 0.9).into(),
                specular_roughness: 0.4.into(),
                specular_roughness_anisotropy: 0.6.into(),
                ..plain()
            },
            Self { transmission_weight: 1.0.into(), specular_roughness: 0.35.into(), ..plain() },
            Self {
                transmission_weight: 0.7.into(),
                transmission_color: orange(),
                geometry_thin_walled: true,
                specular_roughness: 0.0.into(),
                ..plain()
            },
            Self {
                coat_weight: 1.0.into(),
                coat_roughness: 0.2.into(),
                coat_color: orange(),
                base_metalness: 0.5.into(),
                specular_roughness: 0.5.into(),
                ..plain()
            },
            Self {
                fuzz_weight: 1.0.into(),
                fuzz_color: orange(),
                base_diffuse_roughness: 1.0.into(),
                coat_weight: 0.5.into(),
                specular_roughness: 0.6.into(),
                ..plain()
            },
            Self {
                thin_film_weight: 1.0.into(),
                base_metalness: 0.3.into(),
                specular_roughness: 0.3.into(),
                ..plain()
            },
            Self {
                subsurface_weight: 1.0.into(),
                subsurface_color: orange(),
                subsurface_scatter_anisotropy: 0.4.into(),
                geometry_thin_walled: true,
                ..plain()
            },
            Self { specular_weight: 0.0.into(), specular_roughness: 0.5.into(), ..plain() },
            Self {
                fuzz_weight: 0.8.into(),
                fuzz_roughness: 0.4.into(),
                fuzz_model: FuzzModel::Charlie,
                ..plain()
            },
        ]
    }

    fn common(&self, point: &ShadingPoint) -> Common {
        let share = |p: &ScalarParam| bounded(p.at(point), 1.0);
        let coat = share(&self.coat_weight);
        let [metalness, roughness] = self.metalness_and_roughness(point);
        let roughness = roughened(roughness, share(&self.coat_roughness), coat);
        Common {
            metalness,
            transmission: share(&self.transmission_weight),
            subsurface: share(&self.subsurface_weight),
            coat,
            ggx: Ggx::from_anisotropy(roughness, share(&self.specular_roughness_anisotropy)),
            specular_weight: bounded(self.specular_weight.at(point), 1e3),
            ior: positive_ior(positive_ior(self.specular_ior.at(point)) / point.outside_ior),
        }
    }

    /// Metalness and roughness of the base at a point, without the effect of a coat.
    fn metalness_and_roughness(&self, point: &ShadingPoint) -> [f32; 2] {
        let [metalness, roughness] =
            ScalarParam::both_at(&self.base_metalness, &self.specular_roughness, point);
        [bounded(metalness, 1.0), bounded(roughness, 1.0)]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        self.bsdf_like(None, point)
    }

    /// The BSDF at a point. It reuses the tables of `other`, the BSDF of another point, if both
    /// have the same parameters.
    pub(super) fn bsdf_like(&self, other: Option<&OpenPbrBsdf>, point: &ShadingPoint) -> Bsdf {
        let common = self.common(point);
        let coat = self.coat(point, &common);
        let fuzz = self.fuzz(point);
        let slabs = self.slabs(other, point, &common, coat.as_ref());
        // With dispersion, the hero wavelength represents all of them.
        let unit = if self.is_dispersive() { point.mode.hero_factor() } else { point.mode.unit() };
        Bsdf::OpenPbr(Box::new(OpenPbrBsdf::new(slabs, coat, fuzz, unit)))
    }

    fn film(&self, point: &ShadingPoint) -> Option<ThinFilm> {
        let weight = bounded(self.thin_film_weight.at(point), 1.0);
        let thickness = 1000.0 * bounded(self.thin_film_thickness.at(point), 1e3);
        let ior = positive_ior(self.thin_film_ior.at(point));
        (weight > 0.0 && thickness > 0.0).then_some(ThinFilm {
            weight,
            thickness,
            ior,
            mode: point.mode,
        })
    }

    fn coat(&self, point: &ShadingPoint, common: &Common) -> Option<Coat> {
        if common.coat == 0.0 {
            return None;
        }
        let share = |p: &ScalarParam| bounded(p.at(point), 1.0);
        let base = share(&self.specular_roughness);
        let f0 = fresnel::f0_from_ior(common.ior) * common.specular_weight;
        let dielectric = 1.0 + (base - 1.0) * f0.min(1.0);
        Some(Coat {
            weight: common.coat,
            ggx: Ggx::from_anisotropy(
                share(&self.coat_roughness),
                share(&self.coat_roughness_anisotropy),
            ),
            ior: positive_ior(self.coat_ior.at(point)),
            color: point.reflectance(self.coat_color.at(point)),
            darkening: share(&self.coat_darkening),
            base_roughness: dielectric + (base - dielectric) * common.metalness,
        })
    }

    fn slabs(
        &self,
        other: Option<&OpenPbrBsdf>,
        point: &ShadingPoint,
        common: &Common,
        coat: Option<&Coat>,
    ) -> Slabs {
        let Common { metalness, transmission, subsurface, .. } = *common;
        let film = self.film(point);
        let tint = point.reflectance(self.specular_color.at(point));
        let base = self.base(point);
        let clear = (1.0 - metalness) * transmission;
        let opaque = (1.0 - metalness) * (1.0 - transmission);
        let metal = || {
            let facets = FacetReflectance::F82(F82 { f0: base, edge: tint });
            let unit = point.mode.unit() * common.specular_weight.min(1.0);
            ConductorBsdf::new(facets, unit, common.ggx).with_film(film)
        };
        // The coat takes the place of the air above the base. There is no total internal reflection
        // if the coat is denser than the base.
        let ratio = coat.map_or(common.ior, |coat| {
            let below = common.ior / coat.ior;
            common.ior + (below.max(1.0 / below) - common.ior) * common.coat
        });
        let gloss = Gloss {
            ior: modulated_ior(ratio, common.specular_weight),
            tint,
            microfacets: common.ggx.into(),
            film,
        };
        let opaque_slab = || {
            let other = other.and_then(OpenPbrBsdf::opaque);
            GlossyBsdf::like(other, gloss, self.body(point, base, subsurface))
        };
        let has_inside = !self.geometry_thin_walled;
        Slabs {
            metal: (metalness > 0.0).then(|| (metalness, metal())),
            opaque: (opaque > 0.0).then(|| (opaque, opaque_slab())),
            translucent: (clear > 0.0).then(|| {
                let like = other.and_then(OpenPbrBsdf::solid);
                (clear, self.translucent(point, common, tint, film, like))
            }),
            subsurface: if has_inside { subsurface } else { 0.0 },
        }
    }

    /// The share of light that passes the fuzz and the coat on the way out, towards a direction of
    /// these cosines to the normals of base and coat.
    pub(super) fn passed_by_layers(
        &self,
        point: &ShadingPoint,
        cos_base: f32,
        cos_coat: f32,
    ) -> SampledSpectrum {
        let coat = self.coat(point, &self.common(point));
        let under_coat = coat.map_or(SampledSpectrum::ONE, |coat| coat.passed_once(cos_coat));
        let under_fuzz = self.fuzz(point).map_or(1.0, |fuzz| fuzz.passed(cos_base));
        under_coat * under_fuzz
    }

    fn fuzz(&self, point: &ShadingPoint) -> Option<Fuzz> {
        let weight = bounded(self.fuzz_weight.at(point), 1.0);
        (weight > 0.0).then(|| Fuzz {
            weight,
            color: point.reflectance(self.fuzz_color.at(point)),
            roughness: bounded(self.fuzz_roughness.at(point), 1.0),
            model: self.fuzz_model,
        })
    }

    /// Reflectance of the base at a point.
    pub(super) fn base(&self, point: &ShadingPoint) -> SampledSpectrum {
        let color = self.base_color.at(point) * point.vertex_color();
        point.reflectance(color) * bounded(self.base_weight.at(point), 1.0)
    }

    /// True if no parameter but the colour of the base depends on textures.
    pub(super) fn varies_in_color_alone(&self) -> bool {
        let base_color = ColorParam { texture: None, ..self.base_color };
        let other = Material::new("", Self { base_color, ..self.clone() });
        self.base_color.texture.is_some() && other.textures().is_empty()
    }

    /// The batch form of a mixture of rough metal and gloss, which varies over the surface only in
    /// the parameters of [`BatchPoint`].
    pub(super) fn batch_mixture(&self) -> Option<BatchBsdf> {
        let half = Self {
            base_color: ColorParam { texture: None, ..self.base_color },
            base_weight: 1.0.into(),
            base_metalness: 0.5.into(),
            specular_roughness: 0.5.into(),
            ..self.clone()
        };
        let (bsdf, looks_up) = anywhere(&half.into());
        BatchBsdf::of(&bsdf).filter(|batch| !looks_up && batch.takes_any_point())
    }

    /// The parameters of [`Self::batch_mixture`] at a point, with what its BSDF needs of the frame;
    /// `None` where the surface is not rough.
    pub(super) fn mixed_at(&self, point: &ShadingPoint) -> Option<(BatchPoint, FrameNeeds)> {
        let [metalness, roughness] = self.metalness_and_roughness(point);
        let widths = Widths::from_roughness(roughness);
        let at = BatchPoint {
            alpha: widths.alpha(),
            metalness,
            ..BatchPoint::with_body(self.base(point))
        };
        let needs = FrameNeeds { mirrors: metalness == 1.0, has_tangent: false };
        (!widths.is_smooth()).then_some((at, needs))
    }

    /// The spectra of the metal or opaque base at a point; `None` if layers above have spectra too.
    pub(super) fn spectra(&self, point: &ShadingPoint) -> Option<LobeSpectra> {
        let has_coat = bounded(self.coat_weight.at(point), 1.0) > 0.0;
        let is_clear =
            !has_coat || point.reflectance(self.coat_color.at(point)).0.iter().all(|&c| c >= 1.0);
        let unit = point.mode.unit() * bounded(self.specular_weight.at(point), 1e3).min(1.0);
        is_clear.then(|| LobeSpectra {
            base: self.base(point),
            specular: point.reflectance(self.specular_color.at(point)),
            other: unit,
        })
    }

    fn body(&self, point: &ShadingPoint, base: SampledSpectrum, subsurface: f32) -> Body {
        let roughness = bounded(self.base_diffuse_roughness.at(point), 1.0);
        if subsurface == 0.0 {
            return Body::matte(DiffuseBsdf::new(base, roughness));
        }
        let color = point.reflectance(self.subsurface_color.at(point) * point.vertex_color());
        // The diffuse base and what scatters below are one matte lobe, of their mean colour.
        let diffuse = |scattering: SampledSpectrum| {
            let share = scattering + SampledSpectrum::splat(1.0 - subsurface);
            let mean = (base * (1.0 - subsurface) + color * scattering)
                .zip(share, |color, share| if share > 0.0 { color / share } else { 0.0 });
            DiffuseBsdf::new(mean, roughness).scaled(share)
        };
        if self.geometry_thin_walled {
            let forward = bounded(0.5 * (1.0 + self.subsurface_scatter_anisotropy.at(point)), 1.0);
            return Body {
                diffuse: diffuse(SampledSpectrum::splat(subsurface * (1.0 - forward))),
                through: color * (subsurface * forward),
                walk: SampledSpectrum::ZERO,
            };
        }
        // Channels without a walk are at its limit, a matte body of the same colour.
        let walk = self
            .subsurface_paths(point)
            .zip(point.mode.unit(), |path, unit| if path > 0.0 { unit * subsurface } else { 0.0 });
        let matte = walk.map(|walk| if walk > 0.0 { 0.0 } else { subsurface });
        Body { diffuse: diffuse(matte), through: SampledSpectrum::ZERO, walk }
    }

    fn translucent(
        &self,
        point: &ShadingPoint,
        common: &Common,
        tint: SampledSpectrum,
        film: Option<ThinFilm>,
        like: Option<&DielectricBsdf>,
    ) -> Translucent {
        let ior = modulated_ior(common.ior, common.specular_weight);
        let unit = point.mode.unit();
        let color = || point.reflectance(self.transmission_color.at(point));
        let extra = point.reflectance(self.transmission_tint.at(point));
        if self.geometry_thin_walled {
            return Translucent::Sheet(SheetBsdf::new(
                ior,
                tint * unit,
                color() * extra,
                unit,
                common.ggx,
                film,
            ));
        }
        let ior = self.dispersed(ior, point);
        let crossing = if self.transmission_depth.at(point) > 0.0 { unit } else { color() };
        let interface = Interface {
            ior,
            tint: crossing * extra,
            reflection_tint: tint,
            unit,
            film,
            microfacets: common.ggx.into(),
            arriving: SampledSpectrum::ONE,
        };
        Translucent::Solid(DielectricBsdf::like(like, interface))
    }

    /// True if transmitted light disperses.
    pub(super) fn is_dispersive(&self) -> bool {
        let is_clear = self.transmission_weight.factor > 0.0 && !self.geometry_thin_walled;
        is_clear && self.transmission_dispersion_scale.factor > 0.0
    }

    /// The index of refraction at the wavelength of the path.
    fn dispersed(&self, ior: f32, point: &ShadingPoint) -> f32 {
        if !self.is_dispersive() {
            return ior;
        }
        let scale = bounded(self.transmission_dispersion_scale.at(point), 1.0);
        let abbe = self.transmission_dispersion_abbe_number.at(point) / scale;
        positive_ior(RefractiveIndex::from_abbe(ior, abbe).at(point.mode.hero(LINE_D)))
    }

    /// True if [`Self::medium`] may return a medium.
    pub(super) fn has_medium(&self) -> bool {
        let clear = self.transmission_weight.factor > 0.0 && self.transmission_depth.factor > 0.0;
        !self.geometry_thin_walled && (clear || self.subsurface_weight.factor > 0.0)
    }

    /// True if the surface bounds an interior that light can enter.
    pub(super) fn has_inside(&self) -> bool {
        !self.geometry_thin_walled
            && (self.transmission_weight.factor > 0.0 || self.subsurface_weight.factor > 0.0)
    }

    /// Index of refraction of the interior; 1 if light enters it by scattering only.
    pub(super) fn inside_ior(&self) -> f32 {
        let is_clear = self.transmission_weight.factor > 0.0 && !self.geometry_thin_walled;
        if is_clear { positive_ior(self.specular_ior.factor) } else { 1.0 }
    }

    /// Angle by which the tangent of the base is rotated at a point, in radians.
    pub(super) fn tangent_angle(&self, point: &ShadingPoint) -> f32 {
        self.geometry_tangent.map_or(0.0, |t| t.angle(point))
    }

    /// Angle by which the tangent of the coat is rotated at a point, in radians.
    pub(super) fn coat_tangent_angle(&self, point: &ShadingPoint) -> f32 {
        self.geometry_coat_tangent.map_or(0.0, |t| t.angle(point))
    }

    /// The medium inside, for a path that enters at a point: that of the clear dielectric, or that
    /// of subsurface scattering.
    pub(super) fn medium(&self, point: &ShadingPoint) -> Option<MediumProperties> {
        let common = self.common(point);
        let depth = self.transmission_depth.at(point);
        let clear = common.transmission;
        if self.has_medium() && clear >= (1.0 - clear) * common.subsurface {
            return (depth > 0.0).then(|| self.clear_medium(point, depth));
        }
        (self.has_medium() && common.subsurface > 0.0).then(|| self.subsurface_medium(point))
    }

    fn clear_medium(&self, point: &ShadingPoint, depth: f32) -> MediumProperties {
        /// Replaces black, whose logarithm is infinite.
        const DARKEST: f32 = 1e-6;
        let color = point.reflectance(self.transmission_color.at(point));
        let sigma_t = color.map(|c| -real::ln(c.clamp(DARKEST, 1.0)) / depth);
        let sigma_s = point.coefficient(self.transmission_scatter.at(point)) * (1.0 / depth);
        let sigma_a = sigma_t - sigma_s;
        let least = sigma_a
            .0
            .into_iter()
            .zip(point.mode.unit().0)
            .filter(|(_, u)| *u > 0.0)
            .map(|(a, _)| a)
            .fold(0.0, f32::min);
        let sigma_a = sigma_a.map(|a| (a - least).max(0.0));
        medium(sigma_a, sigma_s, bounded_cosine(self.transmission_scatter_anisotropy.at(point)))
    }

    /// The mean free paths under the surface, in units of the scene.
    fn subsurface_paths(&self, point: &ShadingPoint) -> SampledSpectrum {
        let scale = point.coefficient(self.subsurface_radius_scale.at(point));
        scale * bounded(self.subsurface_radius.at(point), f32::MAX)
    }

    fn subsurface_medium(&self, point: &ShadingPoint) -> MediumProperties {
        let g = bounded_cosine(self.subsurface_scatter_anisotropy.at(point));
        let color = point.reflectance(self.subsurface_color.at(point) * point.vertex_color());
        // Paths that are not longer than the error of the point at which they start could not be
        // resolved: of this length they look the same.
        let least = (16.0 * point.surface.position_error.max_element()).max(f32::MIN_POSITIVE);
        let sigma_t = (self.subsurface_paths(point))
            .map(|path| if path > 0.0 { 1.0 / path.max(least) } else { 0.0 });
        let albedo = color.map(|c| scattering_albedo(c, g));
        medium(sigma_t * (SampledSpectrum::ONE - albedo), sigma_t * albedo, g)
    }
}

/// A mean cosine, clamped to the range of the phase function.
fn bounded_cosine(g: f32) -> f32 {
    if g.is_finite() { g.clamp(-0.98, 0.98) } else { 0.0 }
}

fn medium(sigma_a: SampledSpectrum, sigma_s: SampledSpectrum, g: f32) -> MediumProperties {
    MediumProperties {
        sigma_a,
        sigma_s,
        emission: SampledSpectrum::ZERO,
        phase: HenyeyGreenstein::new(g),
    }
}
