//! Checkerboards in the plane and in space.

use super::rgb_at;
use crate::material::{ColorParam, ShadingPoint};
use crate::texture::mapping::{IDENTITY, Mapping, Rows, SpacePoint};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;

snell_math::declare! {
    /// Squares with sides of 1 in `(s, t)`, alternating between two textures and averaged over the
    /// filter footprint.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Checkerboard {
        /// Texture of the square from (0, 0) to (1, 1), and of all squares whose coordinates have
        /// an even sum.
        pub even: ColorParam,
        /// Texture of the other squares.
        pub odd: ColorParam,
        /// Mapping of the squares.
        pub mapping: Mapping,
    }
}

impl Default for Checkerboard {
    fn default() -> Self {
        Self { even: Rgb::WHITE.into(), odd: Rgb::BLACK.into(), mapping: Mapping::default() }
    }
}

impl Checkerboard {
    /// Examples for tests and galleries, one for each mapping.
    pub fn examples() -> Vec<Self> {
        Mapping::examples().into_iter().map(|mapping| Self { mapping, ..Self::default() }).collect()
    }

    pub(super) fn is_on_surface(&self) -> bool {
        self.mapping.is_on_surface()
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let at = self.mapping.at(point);
        let contrast = square_wave(at.st.x, at.width.x) * square_wave(at.st.y, at.width.y);
        shades(&self.even, &self.odd, contrast, point)
    }
}

snell_math::declare! {
    /// Cubes with sides of 1 in space, alternating between two textures, as if the object were cut
    /// from a block of such cubes; averaged over the filter footprint.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct SolidCheckerboard {
        /// Texture of the cube from (0, 0, 0) to (1, 1, 1), and of all cubes whose coordinates have
        /// an even sum.
        pub even: ColorParam,
        /// Texture of the other cubes.
        pub odd: ColorParam,
        /// Rows of the affine map from the world to the space of the cubes.
        pub texture_from_world: Rows,
    }
}

impl Default for SolidCheckerboard {
    fn default() -> Self {
        Self { even: Rgb::WHITE.into(), odd: Rgb::BLACK.into(), texture_from_world: IDENTITY }
    }
}

impl SolidCheckerboard {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self::default()]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        false
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let SpacePoint { p, width } = SpacePoint::new(point, &self.texture_from_world);
        let contrast =
            square_wave(p.x, width.x) * square_wave(p.y, width.y) * square_wave(p.z, width.z);
        shades(&self.even, &self.odd, contrast, point)
    }
}

/// The mixture of both textures: the first for a contrast of 1, the second for -1.
fn shades(even: &ColorParam, odd: &ColorParam, contrast: f32, point: &ShadingPoint) -> Rgb {
    if contrast == 1.0 {
        rgb_at(even, point)
    } else if contrast == -1.0 {
        rgb_at(odd, point)
    } else {
        rgb_at(even, point) * (0.5 + 0.5 * contrast) + rgb_at(odd, point) * (0.5 - 0.5 * contrast)
    }
}

/// The mean, over an interval of this width around `x`, of a square wave that is 1 from each even
/// number to the next odd one and -1 elsewhere.
fn square_wave(x: f32, width: f32) -> f32 {
    let (low, high) = (x - 0.5 * width, x + 0.5 * width);
    if low.floor() == high.floor() {
        return if x.floor().rem_euclid(2.0) == 0.0 { 1.0 } else { -1.0 };
    }
    // The integral of the wave rises from 0 at even numbers to 1 at odd ones.
    let integral = |x: f32| 1.0 - (x.rem_euclid(2.0) - 1.0).abs();
    let mean = (integral(high) - integral(low)) / (high - low);
    if mean.is_finite() { mean.clamp(-1.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_a_square_wave_is_that_of_its_points() {
        for i in 0..200 {
            let (x, width) = (i as f32 * 0.137 - 9.0, 0.01 + i as f32 * 0.031);
            let n = 20_000;
            let points =
                (0..n).map(|k| square_wave(x + width * ((k as f32 + 0.5) / n as f32 - 0.5), 0.0));
            let mean = points.sum::<f32>() / n as f32;
            assert!(
                (square_wave(x, width) - mean).abs() < 3e-3,
                "{x} {width}: {} {mean}",
                square_wave(x, width)
            );
        }
        for width in [1e6, 1e30, f32::INFINITY, f32::NAN] {
            assert!(square_wave(0.3, width).abs() <= 1.0, "{width}");
        }
        assert!(square_wave(0.3, 1e6).abs() < 1e-5);
    }
}
