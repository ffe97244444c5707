//! Hair and fur.

use super::{ColorParam, ScalarParam, ShadingPoint, positive_ior};
use crate::bsdf::{Bsdf, HairBsdf, HairFiber};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Rgb, SampledSpectrum};

/// Absorption per fibre radius for a concentration of 1 of each pigment (d'Eon et al., An
/// Energy-Conserving Hair Reflectance Model, 2011).
const EUMELANIN: Rgb = Rgb::new(0.419, 0.697, 1.37);
const PHEOMELANIN: Rgb = Rgb::new(0.187, 0.4, 1.05);

snell_math::declare! {
    /// Hair, fur and other fibres, which reflect light, transmit it, or reflect it inside (Chiang
    /// et al., A Practical and Controllable Hair and Fur Model for Production Path Tracing, 2016;
    /// the model of pbrt's and Mitsuba's `hair`). It is made for curves. On other surfaces `u` must
    /// run along the fibre and `v` from 0 to 1 across it.
    ///
    /// The absorption of the fibre is the sum of the absorption of its pigments, its dye and
    /// `sigma_a`. Without any of them the fibre is clear, like white hair.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Hair {
        /// Concentration of the brown pigment, at least 0: 0.3 in blonde, 1.3 in brown and 8 in
        /// black hair.
        #[range(Range::AMOUNT)]
        pub eumelanin: ScalarParam,
        /// Concentration of the red pigment, at least 0.
        #[range(Range::AMOUNT)]
        pub pheomelanin: ScalarParam,
        /// Colour that the dye gives to a dense volume of hair in white light, `[0, 1]`; multiplied
        /// by the vertex colour. White means no dye.
        #[range(Range::SHARE)]
        pub color: ColorParam,
        /// Further absorption per radius of the fibre, at least 0.
        #[range(Range::AMOUNT)]
        #[unit("per radius")]
        pub sigma_a: ColorParam,
        /// Index of refraction. Positive, otherwise 1.
        #[range(Range::Positive)]
        #[usual(Range::Within(0.2, 6.0))]
        pub ior: f32,
        /// Roughness along the fibre, `[0, 1]` (`beta_m`); at least 0.01 is used.
        #[range(Range::SHARE)]
        pub longitudinal_roughness: ScalarParam,
        /// Roughness around the fibre, `[0, 1]` (`beta_n`); at least 0.01 is used.
        #[range(Range::SHARE)]
        pub azimuthal_roughness: ScalarParam,
        /// Angle by which the scales stand off the fibre towards its tip, degrees. It separates the
        /// highlights.
        #[range(Range::Within(-90.0, 90.0))]
        #[unit("degrees")]
        pub scale_tilt: f32,
    }
}

impl Default for Hair {
    fn default() -> Self {
        Self {
            eumelanin: 0.0.into(),
            pheomelanin: 0.0.into(),
            color: Rgb::WHITE.into(),
            sigma_a: Rgb::BLACK.into(),
            ior: 1.55,
            longitudinal_roughness: 0.3.into(),
            azimuthal_roughness: 0.3.into(),
            scale_tilt: 2.0,
        }
    }
}

impl Hair {
    /// Hair with these concentrations of pigments.
    pub fn pigmented(eumelanin: f32, pheomelanin: f32) -> Self {
        Self { eumelanin: eumelanin.into(), pheomelanin: pheomelanin.into(), ..Self::default() }
    }

    /// Absorption per radius of pigments, dye and [`Self::sigma_a`], without textures.
    pub fn plain_absorption(&self) -> Rgb {
        let rough = self.azimuthal_roughness.factor;
        let Rgb { r, g, b } = self.color.factor;
        let dye = HairBsdf::absorption_of_color(SampledSpectrum([r, g, b, 1.0]), rough);
        let pigments = EUMELANIN * self.eumelanin.factor.max(0.0)
            + PHEOMELANIN * self.pheomelanin.factor.max(0.0);
        pigments + self.sigma_a.factor.map(|a| a.max(0.0)) + Rgb::new(dye[0], dye[1], dye[2])
    }

    /// The approximate colour of a dense volume of this hair in white light. It has the texture or
    /// spectrum of the dye if nothing else absorbs.
    pub fn seen_color(&self) -> ColorParam {
        let without_dye = Self { color: Rgb::WHITE.into(), ..self.clone() };
        let is_dyed = self.color.texture.is_some() || self.color.spectrum.is_some();
        if is_dyed && without_dye.plain_absorption() == Rgb::BLACK {
            return self.color;
        }
        let rough = self.azimuthal_roughness.factor;
        self.plain_absorption().map(|a| HairBsdf::color_of_absorption(a, rough)).into()
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![
            Self::default(),
            Self::pigmented(1.3, 0.2),
            Self { color: Rgb::new(0.8, 0.4, 0.1).into(), scale_tilt: 0.0, ..Self::default() },
            Self {
                longitudinal_roughness: 0.7.into(),
                azimuthal_roughness: 0.9.into(),
                ..Self::pigmented(0.3, 0.0)
            },
            Self { sigma_a: Rgb::new(0.2, 0.5, 3.0).into(), ior: 1.3, ..Self::default() },
        ]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        let azimuthal_roughness = self.azimuthal_roughness.at(point);
        let pigments =
            EUMELANIN * self.eumelanin.at(point) + PHEOMELANIN * self.pheomelanin.at(point);
        let dye = point.reflectance(self.color.at(point) * point.vertex_color());
        let unit = point.mode.unit();
        let absorption = point.coefficient(pigments)
            + point.coefficient(self.sigma_a.at(point))
            + HairBsdf::absorption_of_color(dye, azimuthal_roughness) * unit;
        Bsdf::Hair(HairBsdf::new(&HairFiber {
            offset: offset(point),
            ior: positive_ior(self.ior),
            absorption,
            unit,
            longitudinal_roughness: self.longitudinal_roughness.at(point),
            azimuthal_roughness,
            scale_tilt: if self.scale_tilt.is_finite() {
                self.scale_tilt.to_radians()
            } else {
                0.0
            },
        }))
    }
}

/// The offset of a point across the fibre, if its texture coordinates determine it.
fn offset(point: &ShadingPoint) -> Option<f32> {
    let surface = point.surface;
    if surface.on_curve {
        return None;
    }
    // The local y axis may point in the direction of decreasing v.
    let is_along = surface.shading_normal.cross(surface.dpdu).dot(surface.dpdv) >= 0.0;
    let h = 2.0 * surface.uv[0].y.rem_euclid(1.0) - 1.0;
    Some(if h.is_nan() {
        0.0
    } else if is_along {
        h
    } else {
        -h
    })
}
