//! The sky-dome model of Hosek and Wilkie: a formula with nine coefficients per channel, which are
//! interpolated in published tables by turbidity, albedo of the ground and elevation of the sun.

use snell_math::real;
use std::f64::consts::FRAC_PI_2;

/// The tables of Hosek and Wilkie (version 1.4, RGB): for each channel
/// `[albedo 0, 1][turbidity 1 to 10][control point][coefficient]`, then the mean radiances
/// `[albedo][turbidity][control point]`. Licence: `LICENSE-hosek-wilkie.txt` beside this file.
const TABLES: &[u8] = include_bytes!("hosek_wilkie.bin");
const COEFFICIENTS: usize = 9;
const CONTROL_POINTS: usize = 6;
const TURBIDITIES: usize = 10;
/// The number of coefficients of one channel.
const SHAPES: usize = 2 * TURBIDITIES * CONTROL_POINTS * COEFFICIENTS;
/// The number of values of one channel: its coefficients, then its mean radiances.
const CHANNEL: usize = SHAPES + 2 * TURBIDITIES * CONTROL_POINTS;

/// The model for one position of the sun.
pub(super) struct HosekWilkie {
    coefficients: [[f64; COEFFICIENTS]; 3],
    means: [f64; 3],
}

impl HosekWilkie {
    /// The model for an elevation in radians, in `[0, pi / 2]`, a turbidity in `[1, 10]`, and an
    /// albedo in `[0, 1]`.
    pub fn new(elevation: f64, turbidity: f64, albedo: f64) -> Self {
        let t = real::cbrt(elevation / FRAC_PI_2);
        let value = |channel: usize, start: usize, stride: usize, offset: usize| {
            let at = |albedo: usize, turbidity: usize| {
                let first = channel * CHANNEL
                    + start
                    + (albedo * TURBIDITIES + turbidity) * CONTROL_POINTS * stride;
                bezier(std::array::from_fn(|k| number(first + k * stride + offset)), t)
            };
            let lower = (turbidity as usize - 1).min(TURBIDITIES - 2);
            let part = turbidity - 1.0 - lower as f64;
            let blend =
                |albedo: usize| at(albedo, lower) * (1.0 - part) + at(albedo, lower + 1) * part;
            blend(0) * (1.0 - albedo) + blend(1) * albedo
        };
        Self {
            coefficients: std::array::from_fn(|c| {
                std::array::from_fn(|i| value(c, 0, COEFFICIENTS, i))
            }),
            means: std::array::from_fn(|c| value(c, SHAPES, 1, 0)),
        }
    }

    /// Radiance in red, green and blue, given the cosines of the angles from the zenith and from
    /// the sun (equation 8 of the paper). The unit is that of luminance divided by 683 lm / W.
    pub fn radiance(&self, cos_zenith: f64, cos_sun: f64) -> [f64; 3] {
        let gamma = real::acos(cos_sun);
        let cos_zenith = cos_zenith.max(0.0);
        std::array::from_fn(|channel| {
            let [a, b, c, d, e, f, g, i, h] = self.coefficients[channel];
            let haze = (1.0 + cos_sun * cos_sun) / real::powf(1.0 + h * h - 2.0 * h * cos_sun, 1.5);
            let falloff = 1.0 + a * real::exp(b / (cos_zenith + 0.01));
            let glow = c
                + d * real::exp(e * gamma)
                + f * cos_sun * cos_sun
                + g * haze
                + i * cos_zenith.sqrt();
            let radiance = self.means[channel] * falloff * glow;
            if radiance > 0.0 && radiance.is_finite() { radiance } else { 0.0 }
        })
    }
}

fn number(index: usize) -> f64 {
    let bytes: [u8; 4] = std::array::from_fn(|k| TABLES[index * 4 + k]);
    f32::from_le_bytes(bytes).into()
}

/// The value at `t` of a Bezier curve of degree 5.
fn bezier(p: [f64; CONTROL_POINTS], t: f64) -> f64 {
    let s = 1.0 - t;
    let binomials = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
    (0..)
        .zip(p.iter().zip(binomials))
        .map(|(k, (p, n))| p * n * real::powi(s, 5 - k) * real::powi(t, k))
        .sum()
}
