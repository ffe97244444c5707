//! Patterns: textures that are computed. One file for each kind, or for a few of one kind.

mod bilerp;
mod checkerboard;
mod combine;
mod dots;
mod fractal;
#[cfg(test)]
mod tests;

pub use bilerp::Bilerp;
pub use checkerboard::{Checkerboard, SolidCheckerboard};
pub use combine::{DirectionMix, Mix, Power, Projected, Ramp, Scale};
pub use dots::Dots;
pub use fractal::{Fbm, Marble, Windy, Wrinkled};

use crate::TextureId;
use crate::material::{ColorParam, ShadingPoint};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;

/// The value of a parameter of a pattern.
fn rgb_at(param: &ColorParam, point: &ShadingPoint) -> Rgb {
    let color = param.at(point);
    color.spectrum.map_or(color.rgb, |spectrum| color.rgb * spectrum.reflectance_rgb())
}

/// The textures among parameters.
fn uses_of(params: &[ColorParam]) -> Vec<TextureId> {
    params.iter().filter_map(|param| param.texture).collect()
}

macro_rules! patterns {
    ($($name:literal => $kind:ident,)*) => {
        /// Any of the patterns. Parameters that are left out are those of the pattern's default.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "pattern")]
        pub enum Pattern {
            $(#[doc = concat!("See [`", stringify!($kind), "`].")] #[serde(rename = $name)] $kind($kind),)*
        }

        impl Pattern {
            /// The names of all patterns.
            pub const NAMES: &[&str] = &[$($name),*];

            /// The name of this kind.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$kind(_) => $name,)* }
            }

            /// A few of each kind: what tests run over.
            pub fn examples() -> Vec<Self> {
                let mut all = Vec::new();
                $(all.extend($kind::examples().into_iter().map(Self::$kind));)*
                all
            }

            /// The textures that it is made of, each as often as it is used.
            pub fn textures(&self) -> Vec<TextureId> {
                match self { $(Self::$kind(pattern) => pattern.textures(),)* }
            }

            /// True if it looks at the coordinates of the surface alone, apart from the textures that it is made of: then a picture
            /// can show it.
            pub fn is_on_surface(&self) -> bool {
                match self { $(Self::$kind(pattern) => pattern.is_on_surface(),)* }
            }

            /// Linear RGB at a point, as it comes: not always finite.
            pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
                match self { $(Self::$kind(pattern) => pattern.rgb(point),)* }
            }
        }

        $(impl From<$kind> for Pattern {
            fn from(kind: $kind) -> Self { Self::$kind(kind) }
        })*
    };
}

patterns! {
    "checkerboard" => Checkerboard,
    "solid-checkerboard" => SolidCheckerboard,
    "dots" => Dots,
    "bilerp" => Bilerp,
    "fbm" => Fbm,
    "wrinkled" => Wrinkled,
    "windy" => Windy,
    "marble" => Marble,
    "scale" => Scale,
    "mix" => Mix,
    "direction-mix" => DirectionMix,
    "power" => Power,
    "ramp" => Ramp,
    "projected" => Projected,
}
