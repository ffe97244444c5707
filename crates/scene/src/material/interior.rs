//! What a surface bounds: the medium inside of a closed surface.

use super::{Material, MaterialKind, ShadingPoint};
use crate::graph::MediumId;
use crate::medium::MediumProperties;
use serde::{Deserialize, Serialize};

snell_math::declare! {
    /// The inside of a closed surface, as far as light transport goes.
    ///
    /// Insides may overlap. Where they do, the one of the highest priority is there, and the others
    /// are not: glass with a drink in it is glass of priority 1 and a drink of priority 0 that
    /// reaches a little into the glass (Schmidt and Budge, Simple Nested Dielectrics in Ray Traced
    /// Images, JGT 2002). Among equal priorities, the last one that a path entered is there: things
    /// in things need none.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Interior {
        /// The medium inside; `None` if it is empty, or filled by what the material itself brings
        /// ([`Material::own_medium`]).
        pub medium: Option<MediumId>,
        /// Who is there where insides overlap: the highest.
        #[serde(default)]
        pub priority: i32,
    }
}

impl Material {
    /// The inside that a closed surface of this material has; `None` if it bounds nothing, as
    /// opaque things and leaves do not.
    pub fn bounded_interior(&self) -> Option<Interior> {
        let has_inside = match &self.kind {
            MaterialKind::Dielectric(_) => true,
            MaterialKind::OpenPbr(surface) => surface.has_inside(),
            _ => false,
        };
        self.interior.or_else(|| has_inside.then(Interior::default))
    }

    /// Index of refraction of the inside; 1 where nothing says otherwise.
    pub fn ior(&self) -> f32 {
        match &self.kind {
            MaterialKind::Dielectric(dielectric) => super::positive_ior(dielectric.ior.at_line_d()),
            MaterialKind::OpenPbr(surface) => surface.inside_ior(),
            _ => 1.0,
        }
    }

    /// True if light passes the surface as if it were not there, so that it is only the boundary of
    /// a medium.
    pub fn is_interface(&self) -> bool {
        matches!(self.kind, MaterialKind::Interface(_)) && !self.is_emissive()
    }

    /// True if [`Self::own_medium`] may be something.
    pub fn has_own_medium(&self) -> bool {
        matches!(&self.kind, MaterialKind::OpenPbr(surface) if surface.has_medium())
    }

    /// The homogeneous medium that the kind of material itself fills its inside with, as it is for
    /// a path that enters at `point`. Counts if [`Interior::medium`] is `None`.
    pub fn own_medium(&self, point: &ShadingPoint) -> Option<MediumProperties> {
        match &self.kind {
            MaterialKind::OpenPbr(surface) => surface.medium(point),
            _ => None,
        }
    }
}
