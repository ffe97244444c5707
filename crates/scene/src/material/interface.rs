//! The boundary of a medium without a surface.

use super::ShadingPoint;
use crate::bsdf::{BlackBsdf, Bsdf};
use serde::{Deserialize, Serialize};

snell_math::declare! {
    /// An invisible boundary: light passes unchanged. For the boundaries of fog, smoke and clouds.
    /// (One that emits is a black lamp.)
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Interface {}
}

impl Interface {
    /// The only example.
    pub fn examples() -> Vec<Self> {
        vec![Self {}]
    }

    /// Rays never hit an interface, except one that emits.
    pub fn bsdf(&self, _: &ShadingPoint) -> Bsdf {
        Bsdf::Black(BlackBsdf)
    }
}
