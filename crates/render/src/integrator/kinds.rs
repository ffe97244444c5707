//! The list of integrators. Each is declared in the file of its vertex function and has a line
//! here; all other code reads this list.

use super::{VertexFunction, ao, aov, classic, flat, path};

/// The declaration of an integrator.
pub(crate) struct Integrator {
    /// The name on the command line.
    pub name: &'static str,
    /// The vertex function.
    pub shade: VertexFunction,
    /// The family of the integrator.
    pub family: Family,
    /// The default of the largest number of bounces.
    pub max_depth: u32,
    /// The default number of samples per pixel.
    pub spp: u32,
}

/// Families of integrators, which differ in their batch shaders and their support of media.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    /// Integrators that support media, and parts of the light as layers.
    Path,
    /// Integrators of local illumination.
    Classic,
    /// All others.
    Other,
}

macro_rules! integrators {
    ($($(#[doc = $doc:literal])* $kind:ident $(= $default:ident)?: $declared:path,)*) => {
        /// The integrator of a render.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub enum IntegratorKind {
            $($(#[doc = $doc])* $(#[$default])? $kind,)*
        }

        impl IntegratorKind {
            /// All integrators.
            pub const ALL: [Self; [$(stringify!($kind)),*].len()] = [$(Self::$kind),*];

            /// The documentation, in one line.
            pub fn text(self) -> &'static str {
                match self {
                    $(Self::$kind => concat!($($doc),*).trim(),)*
                }
            }

            fn declared(self) -> &'static Integrator {
                match self {
                    $(Self::$kind => &$declared,)*
                }
            }
        }
    };
}

integrators! {
    /// Surface colours without illumination.
    Flat: flat::FLAT,
    /// The lecture's ray casting: local illumination at the first hit.
    Raycast: classic::RAYCAST,
    /// Local illumination with recursive mirror reflection and refraction (Whitted, 1980).
    Whitted: classic::WHITTED,
    /// Light that reaches the first hit directly from lights.
    Direct: path::DIRECT,
    /// Ambient occlusion: the cosine-weighted fraction of the hemisphere that is free of near
    /// occluders.
    Ao: ao::AO,
    /// Path tracing with next-event estimation, multiple importance sampling and Russian roulette
    /// (Kajiya, 1986; Veach, 1997).
    Path = default: path::PATH,
    /// No light is transported: the picture shows the first of the chosen AOVs.
    Aov: aov::AOV,
}

impl IntegratorKind {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        self.declared().name
    }

    /// The default of the largest number of bounces.
    pub fn default_max_depth(self) -> u32 {
        self.declared().max_depth
    }

    /// The default number of samples per pixel.
    pub fn default_spp(self) -> u32 {
        self.declared().spp
    }

    /// True for `path` and `direct`, which support media and parts of the light as layers.
    pub fn is_path(self) -> bool {
        self.declared().family == Family::Path
    }

    /// True for `raycast` and `whitted`.
    pub(crate) fn is_classic(self) -> bool {
        self.declared().family == Family::Classic
    }

    /// The vertex function.
    pub(crate) fn vertex_function(self) -> VertexFunction {
        self.declared().shade
    }
}
