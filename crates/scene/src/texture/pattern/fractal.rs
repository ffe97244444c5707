//! Patterns that are sums of octaves of noise.

use crate::material::ShadingPoint;
use crate::noise::Octaves;
use crate::texture::mapping::{IDENTITY, Rows, SpacePoint};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Rgb, Vec3, real};

/// Declares patterns that are a sum of octaves, each by the method that computes the sum.
macro_rules! sums {
    ($($(#[doc = $meaning:literal])* $kind:ident => $sum:ident,)*) => {$(
        snell_math::declare! {
            $(#[doc = $meaning])*
            #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
            #[serde(default, deny_unknown_fields)]
            pub struct $kind {
                /// Maximum number of octaves, each of about twice the frequency of the previous
                /// one; at most 32 are used.
                pub octaves: u32,
                /// Ratio of the amplitudes of successive octaves, `[0, 4]`; a larger ratio is
                /// rougher.
                #[range(Range::Within(0.0, 4.0))]
                pub roughness: f32,
                /// Rows of the affine map from the world to the space of the noise, in which the
                /// longest wavelength is about 1.
                pub texture_from_world: Rows,
            }
        }

        impl Default for $kind {
            fn default() -> Self {
                Self { octaves: 8, roughness: 0.5, texture_from_world: IDENTITY }
            }
        }

        impl $kind {
            /// Examples for tests and galleries: a smooth one and a rough one.
            pub fn examples() -> Vec<Self> {
                vec![Self::default(), Self { octaves: 3, roughness: 0.8, ..Self::default() }]
            }

            pub(super) fn is_on_surface(&self) -> bool {
                false
            }

            pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
                let SpacePoint { p, width } = SpacePoint::new(point, &self.texture_from_world);
                let octaves = Octaves { count: self.octaves, omega: self.roughness };
                Rgb::splat(octaves.$sum(p, width.max_element()))
            }
        }
    )*};
}

sums! {
    /// Fractional Brownian motion: bumps of all sizes around 0. Octaves that are too fine for the
    /// filter footprint fade out.
    Fbm => fbm,
    /// Turbulence: creases as in crumpled paper, from 0 upwards. Octaves that are too fine for the
    /// filter footprint are replaced by their mean.
    Wrinkled => turbulence,
}

snell_math::declare! {
    /// Waves on water under gusts of wind, around 0 (Pharr, Jakob, Humphreys, Physically Based
    /// Rendering, 3rd edition, section 10.6.5).
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Windy {
        /// Rows of the affine map from the world to the space of the waves, in which the longest
        /// wavelength is about 1 and gusts are ten times as large.
        pub texture_from_world: Rows,
    }
}

impl Default for Windy {
    fn default() -> Self {
        Self { texture_from_world: IDENTITY }
    }
}

impl Windy {
    /// The only example, for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self::default()]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        false
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let SpacePoint { p, width } = SpacePoint::new(point, &self.texture_from_world);
        let width = width.max_element();
        let wind = Octaves { count: 3, omega: 0.5 }.fbm(p * 0.1, width * 0.1);
        Rgb::splat(wind.abs() * Octaves { count: 6, omega: 0.5 }.fbm(p, width))
    }
}

snell_math::declare! {
    /// Marble: veins across the y axis, disturbed by noise (Pharr, Jakob, Humphreys, Physically
    /// Based Rendering, 3rd edition, section 10.6.6).
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Marble {
        /// Maximum number of octaves that disturb the veins; at most 32 are used.
        pub octaves: u32,
        /// Ratio of the amplitudes of successive octaves, `[0, 4]`.
        #[range(Range::Within(0.0, 4.0))]
        pub roughness: f32,
        /// Factor on the coordinates, applied first. The period of the veins is 2 pi divided by it.
        pub scale: f32,
        /// Strength with which the noise displaces the veins.
        pub variation: f32,
        /// Rows of the affine map from the world to the space of the marble block.
        pub texture_from_world: Rows,
    }
}

/// The colours from a vein to the middle between two veins, as control points of the spline.
const STONE: [Rgb; 9] = {
    let (grey, light, warm) =
        (Rgb::new(0.5, 0.5, 0.5), Rgb::new(0.58, 0.58, 0.6), Rgb::new(0.6, 0.59, 0.58));
    [light, light, light, grey, warm, light, light, Rgb::new(0.2, 0.2, 0.33), light]
};

/// The mean of the colours over all phases.
const MEAN_STONE: Rgb = Rgb::new(0.8046, 0.8030, 0.8398);

impl Default for Marble {
    fn default() -> Self {
        Self {
            octaves: 8,
            roughness: 0.5,
            scale: 1.0,
            variation: 0.2,
            texture_from_world: IDENTITY,
        }
    }
}

impl Marble {
    /// Examples for tests and galleries: quiet and lively stone.
    pub fn examples() -> Vec<Self> {
        vec![Self::default(), Self { scale: 4.0, variation: 2.0, ..Self::default() }]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        false
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let SpacePoint { p, width } = SpacePoint::new(point, &self.texture_from_world);
        let p: Vec3 = p * self.scale;
        let octaves = Octaves { count: self.octaves, omega: self.roughness };
        let width = width.max_element() * self.scale.abs();
        let phase = p.y + self.variation * octaves.fbm(p, width);
        let phase = if phase.is_finite() { phase } else { 0.0 };
        // Veins finer than the filter footprint blur to their mean, like a sine to second order.
        let share = real::exp(-width * width / 24.0);
        spline(0.5 + 0.5 * real::sin(phase)) * 1.5 * share + MEAN_STONE * (1.0 - share)
    }
}

/// The colour at `t` in `[0, 1]`. A Bezier segment spans four of the colours, and each segment
/// starts one colour after the previous one.
fn spline(t: f32) -> Rgb {
    let segments = STONE.len() - 3;
    let place = t.clamp(0.0, 1.0) * segments as f32;
    let first = (place as usize).min(segments - 1);
    let t = place - first as f32;
    let [a, b, c, d] = [0, 1, 2, 3].map(|i| STONE[first + i]);
    let lerp = |a: Rgb, b: Rgb| a * (1.0 - t) + b * t;
    let (ab, bc, cd) = (lerp(a, b), lerp(b, c), lerp(c, d));
    lerp(lerp(ab, bc), lerp(bc, cd))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_stone_is_stated() {
        let n = 10_000;
        let phases = (0..n).map(|i| i as f32 * std::f32::consts::TAU / n as f32);
        let mean = phases.fold(Rgb::BLACK, |sum, phase| {
            sum + spline(0.5 + 0.5 * phase.sin()) * (1.5 / n as f32)
        });
        let difference = mean + MEAN_STONE * -1.0;
        assert!(difference.to_array().iter().all(|x| x.abs() < 1e-3), "{mean:?}");
    }
}
