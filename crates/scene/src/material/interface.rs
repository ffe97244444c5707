//! The boundary of a medium without a surface.

use super::ShadingPoint;
use crate::bsdf::{BlackBsdf, Bsdf};
use serde::{Deserialize, Serialize};

snell_math::declare! {
    /// An invisible boundary of fog, smoke or clouds, through which light passes unchanged. An
    /// interface that emits is a black lamp.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Interface {}
}

impl Interface {
    /// The only example, for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self {}]
    }

    /// The BSDF at a point: black, since rays never hit an interface, except one that emits.
    pub fn bsdf(&self, _: &ShadingPoint) -> Bsdf {
        Bsdf::Black(BlackBsdf)
    }
}
