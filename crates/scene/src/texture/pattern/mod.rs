//! Patterns: textures that are computed. There is one file for each kind, or for a few related
//! kinds.

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
use crate::texture::mapping;
use snell_math::parameters::references;
use snell_math::{DVec3, Rgb};

/// The value of a pattern's colour parameter at a point, as RGB.
fn rgb_at(param: &ColorParam, point: &ShadingPoint) -> Rgb {
    let color = param.at(point);
    color.spectrum.map_or(color.rgb, |spectrum| color.rgb * spectrum.reflectance_rgb())
}

snell_math::kinds! {
    /// Any of the patterns with its parameters. Omitted parameters have the pattern's defaults.
    pub enum Pattern tagged "pattern" by match_pattern! {
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
}

impl Pattern {
    /// The textures that the pattern combines, each as often as it is used.
    pub fn textures(&self) -> Vec<TextureId> {
        references(self, TextureId::TABLE).into_iter().map(TextureId).collect()
    }

    /// True if the pattern depends only on the texture coordinates of the surface, apart from the
    /// textures that it combines. It can then be baked into an image.
    pub fn is_on_surface(&self) -> bool {
        match_pattern!(self, pattern => pattern.is_on_surface())
    }

    /// Moves the pattern by a vector in the world, if it is fixed there.
    pub fn translate(&mut self, by: DVec3) {
        match self {
            Self::Checkerboard(pattern) => pattern.mapping.translate(by),
            Self::Dots(pattern) => pattern.mapping.translate(by),
            Self::Bilerp(pattern) => pattern.mapping.translate(by),
            Self::Projected(pattern) => pattern.mapping.translate(by),
            Self::SolidCheckerboard(pattern) => {
                mapping::translate(&mut pattern.texture_from_world, by);
            }
            Self::Fbm(pattern) => mapping::translate(&mut pattern.texture_from_world, by),
            Self::Wrinkled(pattern) => mapping::translate(&mut pattern.texture_from_world, by),
            Self::Windy(pattern) => mapping::translate(&mut pattern.texture_from_world, by),
            Self::Marble(pattern) => mapping::translate(&mut pattern.texture_from_world, by),
            Self::Scale(_)
            | Self::Mix(_)
            | Self::DirectionMix(_)
            | Self::Power(_)
            | Self::Ramp(_) => {}
        }
    }

    /// Linear RGB of the pattern at a point, which may be non-finite.
    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        match_pattern!(self, pattern => pattern.rgb(point))
    }
}
