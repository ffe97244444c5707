//! Glass, water, and other clear things.

use super::{ColorParam, ScalarParam, ShadingPoint, positive_ior};
use crate::bsdf::{Bsdf, DielectricBsdf, Ggx};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;

/// The interface between air (outer side) and a clear medium: reflects and refracts by Fresnel's and Snell's laws. For closed
/// surfaces; a single sheet bends light once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dielectric {
    /// Index of refraction of the inside over the outside: 1.33 for water, 1.5 for glass. Positive, otherwise 1.
    pub ior: f32,
    /// Roughness, `[0, 1]`; the distribution's `alpha` is its square. Below 0.032 the interface is perfectly smooth.
    pub roughness: ScalarParam,
    /// Factor on light at each crossing, `[0, 1]`.
    pub tint: ColorParam,
}

impl Dielectric {
    /// Clear and smooth.
    pub fn smooth(ior: f32) -> Self {
        Self { ior, roughness: 0.0.into(), tint: Rgb::WHITE.into() }
    }

    /// Frosted.
    pub fn rough(ior: f32, roughness: f32) -> Self {
        Self { roughness: roughness.into(), ..Self::smooth(ior) }
    }

    /// Dielectrics for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![
            Self::smooth(1.5),
            Self { tint: Rgb::new(0.2, 0.9, 0.4).into(), ..Self::smooth(1.33) },
            Self::smooth(1.0),
            Self::rough(1.5, 0.2),
            Self::rough(1.5, 0.7),
            Self { tint: Rgb::new(1.0, 0.5, 0.0).into(), ..Self::rough(2.4, 0.4) },
            Self::rough(0.75, 0.5),
        ]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        Bsdf::Dielectric(DielectricBsdf {
            ior: positive_ior(self.ior),
            tint: point.reflectance(self.tint.at(point)),
            unit: point.mode.unit(),
            ggx: Ggx::from_roughness(self.roughness.at(point)),
        })
    }
}
