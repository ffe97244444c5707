//! Radiometric quantities along a path: four lanes whose meaning depends on the mode.
//!
//! In RGB mode (linear Rec. 709) the lanes hold red, green, blue and 0; in spectral mode they hold
//! four wavelengths. Light transport treats all four lanes equally and never asks for the mode,
//! which matters only where colours enter ([`ColorMode::reflectance`], [`ColorMode::illuminant`])
//! and leave ([`ColorMode::to_rgb`]).

mod authored;
pub mod cie;
mod glass;
mod metal;
mod mode;
pub mod response;
mod rgb;
mod table;
pub mod uplift;
mod wavelengths;
mod white_balance;

use crate::real;
pub use authored::{Color, Spectrum};
pub use glass::{Glass, LINE_D, RefractiveIndex};
pub use metal::Metal;
pub use mode::{ColorMode, ColorModel};
pub use rgb::{Rgb, linear_to_srgb, srgb_to_linear};
pub use uplift::RgbSpectrum;
pub use wavelengths::SampledWavelengths;
pub use white_balance::{WHITE_TEMPERATURES, adaptation, white_balance};

use std::ops::{Add, AddAssign, Div, Index, Mul, MulAssign, Sub};

/// Number of lanes of a [`SampledSpectrum`].
pub const LANES: usize = 4;

/// Four values of radiance, reflectance, throughput or density. Radiance is in W / (m^2 sr) per
/// lane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct SampledSpectrum(pub [f32; LANES]);

impl SampledSpectrum {
    /// All lanes 0.
    pub const ZERO: Self = Self([0.0; LANES]);
    /// All lanes 1.
    pub const ONE: Self = Self([1.0; LANES]);

    /// All lanes `x`.
    #[inline]
    pub const fn splat(x: f32) -> Self {
        Self([x; LANES])
    }

    /// Applies a function to each lane.
    #[inline(always)]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        let [a, b, c, d] = self.0;
        Self([f(a), f(b), f(c), f(d)])
    }

    /// Applies a function to each lane together with the same lane of `other`.
    #[inline(always)]
    pub fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let ([a, b, c, d], [e, g, h, i]) = (self.0, other.0);
        Self([f(a, e), f(b, g), f(c, h), f(d, i)])
    }

    /// The largest lane.
    #[inline]
    pub fn max_element(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }

    /// The mean of the lanes.
    #[inline]
    pub fn average(self) -> f32 {
        (self.0[0] + self.0[1] + self.0[2] + self.0[3]) * 0.25
    }

    /// True if every lane is 0 (or negative zero).
    #[inline]
    pub fn is_black(self) -> bool {
        // Single `&`s compile to code without branches.
        let [a, b, c, d] = self.0;
        (a == 0.0) & (b == 0.0) & (c == 0.0) & (d == 0.0)
    }

    /// True if no lane is NaN or infinite.
    #[inline]
    pub fn is_finite(self) -> bool {
        let [a, b, c, d] = self.0;
        a.is_finite() & b.is_finite() & c.is_finite() & d.is_finite()
    }

    /// The square root of each lane; negative lanes count as 0.
    #[inline]
    pub fn sqrt(self) -> Self {
        self.map(|x| x.max(0.0).sqrt())
    }

    /// The exponential of each lane.
    #[inline]
    pub fn exp(self) -> Self {
        self.map(real::exp)
    }

    /// Each lane clamped to `[lo, hi]`.
    #[inline(always)]
    pub fn clamp(self, lo: f32, hi: f32) -> Self {
        self.map(|x| x.clamp(lo, hi))
    }

    /// `self * (1 - t) + other * t`, for each lane.
    #[inline(always)]
    pub fn lerp(self, other: Self, t: f32) -> Self {
        self * (1.0 - t) + other * t
    }
}

macro_rules! lane_operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for SampledSpectrum {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $op b)
            }
        }
        impl $trait<f32> for SampledSpectrum {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                self.map(|a| a $op other)
            }
        }
    };
}

lane_operator!(Add, add, +);
lane_operator!(Sub, sub, -);
lane_operator!(Mul, mul, *);
lane_operator!(Div, div, /);

impl AddAssign for SampledSpectrum {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl MulAssign for SampledSpectrum {
    #[inline]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl MulAssign<f32> for SampledSpectrum {
    #[inline]
    fn mul_assign(&mut self, other: f32) {
        *self = *self * other;
    }
}

impl std::iter::Sum for SampledSpectrum {
    #[inline]
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self::ZERO, |a, b| a + b)
    }
}

impl Index<usize> for SampledSpectrum {
    type Output = f32;
    #[inline]
    fn index(&self, lane: usize) -> &f32 {
        &self.0[lane]
    }
}
