//! Dots at random positions.

use super::rgb_at;
use crate::material::{ColorParam, ShadingPoint};
use crate::noise::perlin_noise;
use crate::texture::mapping::{Mapping, PlanePoint};
use serde::{Deserialize, Serialize};
use snell_math::{Rgb, Vec2, Vec3, real};

snell_math::declare! {
    /// Polka dots: about two of five squares with sides of 1 in `(s, t)` contain a dot of radius
    /// 0.35 at a random position (Pharr, Jakob, Humphreys, Physically Based Rendering, 3rd edition,
    /// section 10.5.2).
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Dots {
        /// Texture inside of the dots.
        pub inside: ColorParam,
        /// Texture between the dots.
        pub outside: ColorParam,
        /// Mapping of the squares.
        pub mapping: Mapping,
    }
}

const RADIUS: f32 = 0.35;
/// The fraction of the plane that dots cover. The first factor is the fraction of squares with a
/// dot.
const COVERED: f32 = 0.3955 * std::f32::consts::PI * RADIUS * RADIUS;

impl Default for Dots {
    fn default() -> Self {
        Self { inside: Rgb::WHITE.into(), outside: Rgb::BLACK.into(), mapping: Mapping::default() }
    }
}

impl Dots {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![
            Self::default(),
            Self { mapping: Mapping::upright([8.0, 8.0], [0.0, 0.0]), ..Self::default() },
        ]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        self.mapping.is_on_surface()
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let share = share_in_dots(self.mapping.at(point));
        if share == 0.0 {
            rgb_at(&self.outside, point)
        } else if share == 1.0 {
            rgb_at(&self.inside, point)
        } else {
            rgb_at(&self.inside, point) * share + rgb_at(&self.outside, point) * (1.0 - share)
        }
    }
}

/// The fraction of the filter footprint that lies in dots: for a small footprint that of the dot
/// nearby, for a large one that of all dots.
fn share_in_dots(PlanePoint { st, width }: PlanePoint) -> f32 {
    let width = width.max_element();
    let near = dot(st).map_or(0.0, |center| {
        let depth = RADIUS - (st - center).length();
        // The soft rim, as wide as the footprint, enlarges the dot; `gain` corrects for that.
        let gain = 1.0 + real::powi(width / RADIUS, 2) / 12.0;
        if width > 0.0 {
            (depth / width + 0.5).clamp(0.0, 1.0) / gain
        } else {
            f32::from(u8::from(depth > 0.0))
        }
    });
    // Wider rims would not fit in the square, so the mean over the plane takes over.
    near + (COVERED - near) * ((width - 0.3) / 0.4).clamp(0.0, 1.0)
}

/// The centre of the dot in the square that contains a point, if the square has a dot.
fn dot(st: Vec2) -> Option<Vec2> {
    let square = (st + 0.5).floor();
    let noise = |x: f32, y: f32| perlin_noise(Vec3::new(square.x + x, square.y + y, 0.5));
    let most = 0.5 - RADIUS;
    (noise(0.5, 0.5) > 0.0).then(|| square + Vec2::new(noise(1.5, 2.8), noise(4.5, 9.8)) * most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dots_lie_in_their_squares_and_cover_their_share() {
        let at = |i: u32, width: f32| {
            let place = snell_math::rng::uniform2([i, 3, 0, 0]) * 256.0 - 128.0;
            share_in_dots(PlanePoint { st: place, width: Vec2::splat(width) })
        };
        let mean = |width: f32| (0..100_000).map(|i| at(i, width)).sum::<f32>() / 1e5;
        for width in [0.0, 0.1, 0.5, 1.0, 5.0] {
            assert!((mean(width) - COVERED).abs() < 0.015, "{width}: {} {COVERED}", mean(width));
        }
        for x in -20..20 {
            let square = Vec2::new(x as f32, 3.0);
            if let Some(center) = dot(square) {
                assert!((center - square).abs().max_element() + RADIUS <= 0.5 + 1e-6);
            }
        }
    }
}
