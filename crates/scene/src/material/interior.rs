//! The interior of a closed surface.

use super::{Material, MaterialKind, ShadingPoint};
use crate::graph::MediumId;
use crate::medium::MediumProperties;
use serde::{Deserialize, Serialize};

snell_math::declare! {
    /// The interior of a closed surface, for light transport.
    ///
    /// Interiors may overlap. Where they do, the one with the highest priority counts and the
    /// others are ignored: a glass with a drink is glass of priority 1 and a drink of priority 0
    /// that reaches slightly into the glass (Schmidt and Budge, Simple Nested Dielectrics in Ray
    /// Traced Images, JGT 2002). Among equal priorities, the interior that a path entered last
    /// counts, so nested objects need no priorities.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Interior {
        /// The medium inside; none if it is empty, or filled by the material's own medium.
        pub medium: Option<MediumId>,
        /// Priority where interiors overlap; the highest counts.
        #[serde(default)]
        pub priority: i32,
    }
}

impl Material {
    /// The interior that a closed surface of this material bounds; `None` if it bounds none, as for
    /// opaque materials and thin sheets.
    pub fn bounded_interior(&self) -> Option<Interior> {
        let has_inside = match &self.kind {
            MaterialKind::Dielectric(_) => true,
            MaterialKind::OpenPbr(surface) => surface.has_inside(),
            _ => false,
        };
        self.interior.or_else(|| has_inside.then(Interior::default))
    }

    /// Index of refraction of the interior, which is 1 for most materials.
    pub fn ior(&self) -> f32 {
        match &self.kind {
            MaterialKind::Dielectric(dielectric) => super::positive_ior(dielectric.ior.at_line_d()),
            MaterialKind::OpenPbr(surface) => surface.inside_ior(),
            _ => 1.0,
        }
    }

    /// True if light passes the surface unchanged, so that the surface is only the boundary of a
    /// medium.
    pub fn is_interface(&self) -> bool {
        matches!(self.kind, MaterialKind::Interface(_)) && !self.is_emissive()
    }

    /// True if [`Self::own_medium`] may return a medium.
    pub fn has_own_medium(&self) -> bool {
        matches!(&self.kind, MaterialKind::OpenPbr(surface) if surface.has_medium())
    }

    /// The homogeneous medium with which the material fills its interior, for a path that enters at
    /// `point`. It is used if [`Interior::medium`] is `None`.
    pub fn own_medium(&self, point: &ShadingPoint) -> Option<MediumProperties> {
        match &self.kind {
            MaterialKind::OpenPbr(surface) => surface.medium(point),
            _ => None,
        }
    }
}
