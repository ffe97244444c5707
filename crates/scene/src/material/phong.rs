//! Phong's model as `.scn` and `.mtl` files define it.

use super::{ColorParam, ShadingPoint, positive_ior};
use crate::bsdf::{Bsdf, PhongBsdf, PhongCoefficients};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;
use snell_math::parameters::Range;

snell_math::declare! {
    /// Ambient, diffuse and specular coefficients, with mirror reflection and transmission. The
    /// integrators `raycast` and `whitted` evaluate the classic formula; the path tracer uses an
    /// energy-conserving BSDF with the same coefficients, scaled down where they add up to more
    /// than 1.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Phong {
        /// Reflectance for the scene's ambient light, `ka`.
        #[range(Range::AMOUNT)]
        pub ambient: ColorParam,
        /// Diffuse reflectance, `kd`; multiplied by the vertex colour.
        #[range(Range::AMOUNT)]
        #[usual(Range::SHARE)]
        pub diffuse: ColorParam,
        /// Strength of highlights, `ks`.
        #[range(Range::AMOUNT)]
        #[usual(Range::SHARE)]
        pub specular: ColorParam,
        /// Factor on the radiance of the mirror direction. In `.scn` files it is the same as
        /// `specular`; the path tracer then has the glossy lobe only.
        #[range(Range::AMOUNT)]
        #[usual(Range::SHARE)]
        pub reflection: ColorParam,
        /// Factor on the radiance of the refracted direction, `kt`, without Fresnel's law. It is 0
        /// in total internal reflection.
        #[range(Range::AMOUNT)]
        #[usual(Range::SHARE)]
        pub transmission: ColorParam,
        /// Exponent of the highlight, at least 0.
        #[range(Range::AMOUNT)]
        pub shininess: f32,
        /// Index of refraction inside divided by that outside; 1 does not refract. Positive,
        /// otherwise 1.
        #[range(Range::Positive)]
        pub ior: f32,
    }
}

impl Default for Phong {
    /// A white matte material without ambient reflectance.
    fn default() -> Self {
        Self {
            ambient: Rgb::BLACK.into(),
            diffuse: Rgb::WHITE.into(),
            specular: Rgb::BLACK.into(),
            reflection: Rgb::BLACK.into(),
            transmission: Rgb::BLACK.into(),
            shininess: 10.0,
            ior: 1.0,
        }
    }
}

impl Phong {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let grey = |x| ColorParam::constant(Rgb::splat(x));
        vec![
            Self {
                ambient: grey(0.2),
                diffuse: grey(0.5),
                specular: grey(0.5),
                reflection: grey(0.5),
                ..Self::default()
            },
            Self {
                diffuse: Rgb::new(0.6, 0.1, 0.1).into(),
                specular: grey(0.3),
                shininess: 500.0,
                ..Self::default()
            },
            Self { diffuse: grey(1.0), specular: grey(1.0), shininess: 0.0, ..Self::default() },
            Self { diffuse: grey(0.2), reflection: grey(0.7), shininess: 50.0, ..Self::default() },
            Self {
                diffuse: grey(0.1),
                specular: grey(0.2),
                transmission: grey(0.7),
                ior: 1.5,
                ..Self::default()
            },
            Self { diffuse: grey(0.0), transmission: grey(1.0), ..Self::default() },
        ]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        let at = |p: &ColorParam| point.coefficient(p.at(point));
        Bsdf::Phong(PhongBsdf::new(PhongCoefficients {
            ambient: at(&self.ambient),
            diffuse: point.coefficient(self.diffuse.at(point) * point.vertex_color()),
            specular: at(&self.specular),
            reflection: at(&self.reflection),
            transmission: at(&self.transmission),
            exponent: self.shininess,
            ior: positive_ior(self.ior),
        }))
    }
}
