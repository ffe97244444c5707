//! Authored colours: linear Rec. 709 with a D65 white, and the sRGB transfer curve.

use crate::real;
use serde::{Deserialize, Serialize};
use std::ops::{Add, Mul, Sub};

/// A colour in linear Rec. 709, which has the primaries of sRGB but no transfer curve. Channels
/// have no upper bound: lights may be far above 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f32; 3]", into = "[f32; 3]")]
pub struct Rgb {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Rgb {
    /// Black.
    pub const BLACK: Self = Self::splat(0.0);
    /// White, 1 in each channel.
    pub const WHITE: Self = Self::splat(1.0);

    /// The colour with these linear channels.
    #[inline]
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Self { r, g, b }
    }

    /// Grey of value `x`.
    #[inline]
    pub const fn splat(x: f32) -> Self {
        Self { r: x, g: x, b: x }
    }

    /// The linear colour of three sRGB-encoded values in `[0, 1]`.
    #[inline]
    pub fn from_srgb(r: f32, g: f32, b: f32) -> Self {
        Self::new(srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b))
    }

    /// Relative luminance (CIE Y of Rec. 709 primaries).
    #[inline]
    pub fn luminance(self) -> f32 {
        0.2126 * self.r + 0.7152 * self.g + 0.0722 * self.b
    }

    /// The largest channel.
    #[inline]
    pub fn max_element(self) -> f32 {
        self.r.max(self.g).max(self.b)
    }

    /// True if every channel is 0.
    #[inline]
    pub fn is_black(self) -> bool {
        self.r == 0.0 && self.g == 0.0 && self.b == 0.0
    }

    /// True if no channel is NaN or infinite.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.r.is_finite() && self.g.is_finite() && self.b.is_finite()
    }

    /// Applies a function to each channel.
    #[inline]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self::new(f(self.r), f(self.g), f(self.b))
    }

    /// The channels in order.
    #[inline]
    pub const fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }
}

impl From<[f32; 3]> for Rgb {
    #[inline]
    fn from([r, g, b]: [f32; 3]) -> Self {
        Self { r, g, b }
    }
}

impl From<Rgb> for [f32; 3] {
    #[inline]
    fn from(c: Rgb) -> Self {
        c.to_array()
    }
}

impl Add for Rgb {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self::new(self.r + o.r, self.g + o.g, self.b + o.b)
    }
}

impl Sub for Rgb {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::new(self.r - o.r, self.g - o.g, self.b - o.b)
    }
}

impl Mul for Rgb {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self::new(self.r * o.r, self.g * o.g, self.b * o.b)
    }
}

impl Mul<f32> for Rgb {
    type Output = Self;
    #[inline]
    fn mul(self, x: f32) -> Self {
        Self::new(self.r * x, self.g * x, self.b * x)
    }
}

/// The inverse of the sRGB transfer curve (IEC 61966-2-1): from an encoded value to a linear one.
#[inline]
pub fn srgb_to_linear(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { real::powf((x + 0.055) / 1.055, 2.4) }
}

/// The sRGB transfer curve (IEC 61966-2-1): from a linear value to an encoded one. Values outside
/// `[0, 1]` are not clamped.
#[inline]
pub fn linear_to_srgb(x: f32) -> f32 {
    if x <= 0.003_130_8 { x * 12.92 } else { 1.055 * real::powf(x, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_srgb_curve_inverts() {
        for i in 0..=255 {
            let x = i as f32 / 255.0;
            assert!((linear_to_srgb(srgb_to_linear(x)) - x).abs() < 1e-5);
        }
        assert!((srgb_to_linear(0.5) - 0.214_041).abs() < 1e-5);
    }
}
