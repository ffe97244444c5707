//! Sums and differences of angles below 180 degrees, computed from their cosines and sines.

use snell_math::simd::max;

/// Cosine of `max(0, a - b)`.
#[inline(always)]
pub fn cos_of_difference(sin_a: f32, cos_a: f32, sin_b: f32, cos_b: f32) -> f32 {
    if cos_a > cos_b { 1.0 } else { cos_a * cos_b + sin_a * sin_b }
}

/// Sine of `max(0, a - b)`.
#[inline(always)]
pub fn sin_of_difference(sin_a: f32, cos_a: f32, sin_b: f32, cos_b: f32) -> f32 {
    if cos_a > cos_b { 0.0 } else { sin_a * cos_b - cos_a * sin_b }
}

/// Sine of an angle below 180 degrees with this cosine.
#[inline(always)]
pub fn sin_from_cos(cos: f32) -> f32 {
    max(1.0 - cos * cos, 0.0).sqrt()
}
