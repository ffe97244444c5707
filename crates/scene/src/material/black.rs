//! A surface that reflects nothing.

use super::ShadingPoint;
use crate::bsdf::{BlackBsdf, Bsdf};
use serde::{Deserialize, Serialize};

snell_math::declare! {
    /// Absorbs all light. It is meant for surfaces that are visible only by their emission: light
    /// sources and unlit materials.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Black {}
}

impl Black {
    /// The only example, for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self {}]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, _point: &ShadingPoint) -> Bsdf {
        Bsdf::Black(BlackBsdf)
    }
}
