//! Spectral upsampling: smooth reflectances that have a given colour in white light (Jakob and
//! Hanika, A Low-Dimensional Function Space for Efficient Spectral Upsampling, Eurographics 2019).
//!
//! A reflectance is `S(c0 t^2 + c1 t + c2)` with the sigmoid `S(x) = 1/2 + x / (2 sqrt(1 + x^2))`,
//! where `t` goes from 0 to 1 over the visible range. It is between 0 and 1 for any coefficients.
//! When the first colour is requested, the coefficients are found by Newton's method on a grid of
//! colours; other colours are interpolated.
//!
//! Only colours whose largest channel is at least one half need a place in the grid. The spectrum
//! of a darker colour is a scaled spectrum of a brighter one, which is as smooth and reproduces the
//! colour as exactly. Lights, which have no upper bound, are scaled in the same way.

use super::cie::{LAMBDA_MAX, LAMBDA_MIN};
use super::response::{rgb_response, white_light};
use super::{LANES, Rgb, SampledSpectrum, SampledWavelengths};
use glam::{DMat3, DVec3};
use std::cell::Cell;
use std::sync::LazyLock;

/// Number of grid nodes in each ratio of one of the two other channels to the largest.
const RATIOS: usize = 40;
/// Number of grid nodes in the value of the largest channel, from [`DARKEST`] to 1.
const VALUES: usize = 20;
/// The largest channel of the darkest colours of the grid.
const DARKEST: f32 = 0.5;
/// The smallest channel of the palest colours in the grid. Paler colours are mixed with white.
const PALEST: f32 = 0.75;
/// How much denser the nodes are near the ratios 0 and 1 than in the middle, in `[0, 1]`.
const CROWDING: f32 = 0.7;

/// The spectrum for a colour: a scaled smooth reflectance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RgbSpectrum {
    coefficients: [f32; 3],
    scale: f32,
    offset: f32,
}

impl RgbSpectrum {
    /// The zero spectrum.
    const BLACK: Self = Self { coefficients: [0.0; 3], scale: 0.0, offset: 0.0 };

    /// The spectrum of a reflectance or other factor. Colours within `[0, 1]` give spectra within
    /// `[0, 1]`, and greys give constant spectra. Channels below 0 count as 0; channels above 1
    /// scale the spectrum.
    pub fn of_factor(color: Rgb) -> Self {
        let bits = color.to_array().map(f32::to_bits);
        let place = bits.iter().fold(0u32, |hash, bits| (hash ^ bits).wrapping_mul(0x9e37_79b1))
            >> (32 - RECENT_BITS);
        RECENT.with(|recent| {
            let recent = &recent[place as usize];
            let (known, spectrum) = recent.get();
            if known == bits {
                return spectrum;
            }
            let spectrum = Self::new(color, color.max_element().clamp(DARKEST, 1.0));
            recent.set((bits, spectrum));
            spectrum
        })
    }

    /// The factor that turns the spectrum of white light into light of this colour, at any
    /// brightness.
    pub fn of_light(color: Rgb) -> Self {
        Self::new(color, DARKEST)
    }

    /// The spectrum of a colour: that of the colour scaled to a largest channel of `value`, scaled
    /// back.
    fn new(color: Rgb, value: f32) -> Self {
        let [r, g, b] = color.to_array().map(|x| if x > 0.0 { x } else { 0.0 });
        let largest = r.max(g).max(b);
        if largest == 0.0 || !largest.is_finite() {
            return Self::BLACK;
        }
        let scale = largest / value;
        if r == g && g == b {
            return Self { coefficients: [0.0; 3], scale: 0.0, offset: largest };
        }
        // Near white the coefficients diverge, so a pale colour is mixed from white and a colour
        // farther away from white.
        let smallest = r.min(g).min(b) / scale;
        let white = ((smallest - PALEST) / (1.0 - PALEST)).max(0.0);
        let color = [r, g, b].map(|x| (x / scale - white) / (1.0 - white));
        Self {
            coefficients: GRID.lookup(color),
            scale: scale * (1.0 - white),
            offset: scale * white,
        }
    }

    /// The values at the wavelengths of a path.
    #[inline]
    pub fn at(&self, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        let lambda = wavelengths.lambda();
        let mut values = [0.0; LANES];
        for lane in 0..LANES {
            values[lane] = self.at_wavelength(lambda[lane]);
        }
        SampledSpectrum(values)
    }

    /// The value at a wavelength in nm.
    #[inline]
    pub fn at_wavelength(&self, lambda: f32) -> f32 {
        let [c0, c1, c2] = self.coefficients;
        let t = (lambda - LAMBDA_MIN) * (1.0 / (LAMBDA_MAX - LAMBDA_MIN));
        self.offset + self.scale * sigmoid((c0 * t + c1) * t + c2)
    }
}

#[inline]
fn sigmoid(x: f32) -> f32 {
    0.5 + 0.5 * x / (1.0 + x * x).sqrt()
}

/// Coefficients of colours on a grid. Its axes are the index of the largest channel, the value of
/// that channel, and the ratios of the next two channels (in the order red, green, blue, red) to
/// it.
struct Grid {
    ratios: [f32; RATIOS],
    nodes: Vec<[f32; 3]>,
}

static GRID: LazyLock<Grid> = LazyLock::new(Grid::new);

/// Binary logarithm of the number of cached factors. A scene has few different factors, and they
/// are requested at every vertex.
const RECENT_BITS: u32 = 6;

thread_local! {
    /// A cache of the latest factors, indexed by a hash of the bits of their colours. Initially
    /// every entry is black.
    static RECENT: [Cell<([u32; 3], RgbSpectrum)>; 1 << RECENT_BITS] =
        const { [const { Cell::new(([0; 3], RgbSpectrum::BLACK)) }; 1 << RECENT_BITS] };
}

/// The value of the largest channel at a node, from [`DARKEST`] to 1, denser towards 1.
fn node_value(i: usize) -> f32 {
    let s = 1.0 - i as f32 / (VALUES - 1) as f32;
    1.0 - (1.0 - DARKEST) * s * s
}

/// The node at or below a value, and the fraction of the way to the next node.
fn value_place(value: f32) -> (usize, f32) {
    let x = (1.0 - ((1.0 - value) / (1.0 - DARKEST)).max(0.0).sqrt()) * (VALUES - 1) as f32;
    let i = (x as usize).min(VALUES - 2);
    (i, x - i as f32)
}

/// The ratio at a node, from 0 to 1, denser towards both ends.
fn node_ratio(i: usize) -> f32 {
    let s = i as f32 / (RATIOS - 1) as f32;
    s + CROWDING * (s * s * (3.0 - 2.0 * s) - s)
}

fn index(channel: usize, value: usize, second: usize, third: usize) -> usize {
    ((channel * VALUES + value) * RATIOS + third) * RATIOS + second
}

impl Grid {
    fn new() -> Self {
        let solver = Solver::new();
        let mut nodes = vec![[0.0; 3]; 3 * VALUES * RATIOS * RATIOS];
        for channel in 0..3 {
            for third in (0..RATIOS).rev() {
                for second in (0..RATIOS).rev() {
                    // Newton's method starts at the solution of a neighbour that was solved before;
                    // the first one starts at grey.
                    let mut start = match (second + 1 < RATIOS, third + 1 < RATIOS) {
                        (true, _) => nodes[index(channel, 0, second + 1, third)],
                        (false, true) => nodes[index(channel, 0, second, third + 1)],
                        (false, false) => [0.0; 3],
                    };
                    for value in 0..VALUES {
                        let mut color = [0.0; 3];
                        color[channel] = node_value(value);
                        color[(channel + 1) % 3] = node_value(value) * node_ratio(second);
                        color[(channel + 2) % 3] = node_value(value) * node_ratio(third);
                        let found = solver.solve(color, start);
                        nodes[index(channel, value, second, third)] = found;
                        // The start is extrapolated: the next solution is about as far from this
                        // one as this one is from the previous one.
                        let last = if value == 0 {
                            found
                        } else {
                            nodes[index(channel, value - 1, second, third)]
                        };
                        let change: [f32; 3] = std::array::from_fn(|i| found[i] - last[i]);
                        start = std::array::from_fn(|i| found[i] + change[i]);
                    }
                }
            }
        }
        Self { ratios: std::array::from_fn(node_ratio), nodes }
    }

    /// The node at or below a ratio, and the fraction of the way to the next node.
    fn ratio_place(&self, ratio: f32) -> (usize, f32) {
        let nodes = &self.ratios;
        let i = nodes[1..RATIOS - 1].partition_point(|&node| node <= ratio);
        (i, (ratio - nodes[i]) / (nodes[i + 1] - nodes[i]))
    }

    /// Coefficients of a colour whose largest channel is between [`DARKEST`] and 1.
    fn lookup(&self, color: [f32; 3]) -> [f32; 3] {
        let largest = color[0].max(color[1]).max(color[2]);
        let channel = if color[0] == largest {
            0
        } else if color[1] == largest {
            1
        } else {
            2
        };
        let (v, tv) = value_place(largest);
        let (a, ta) = self.ratio_place(color[(channel + 1) % 3] / largest);
        let (b, tb) = self.ratio_place(color[(channel + 2) % 3] / largest);
        let corner =
            |dv: usize, da: usize, db: usize| &self.nodes[index(channel, v + dv, a + da, b + db)];
        let mut sum = [0.0; 3];
        for (dv, wv) in [(0, 1.0 - tv), (1, tv)] {
            for (db, wb) in [(0, 1.0 - tb), (1, tb)] {
                for (da, wa) in [(0, 1.0 - ta), (1, ta)] {
                    let weight = wv * wb * wa;
                    sum.iter_mut().zip(corner(dv, da, db)).for_each(|(sum, c)| *sum += weight * c);
                }
            }
        }
        sum
    }
}

/// Spacing of the quadrature nodes in nm.
const STEP: usize = 5;
/// Number of quadrature nodes.
const NODES: usize = (LAMBDA_MAX - LAMBDA_MIN) as usize / STEP + 1;
/// Number of nodes that are summed in parallel.
const SIDE_BY_SIDE: usize = 8;
/// Number of groups of [`SIDE_BY_SIDE`] nodes; the last is padded with nodes of weight 0.
const BUNDLES: usize = NODES.div_ceil(SIDE_BY_SIDE);

/// Values at nodes that are summed in parallel.
type Bundle = [f32; SIDE_BY_SIDE];

/// Finds the coefficients of a colour.
struct Solver {
    /// What a reflectance of 1 at each node contributes to red, green and blue in white light.
    weights: Vec<[Bundle; 3]>,
}

impl Solver {
    fn new() -> Self {
        // The quadrature is exact for reflectances that are linear between the nodes: the response
        // at each nm is shared among the two nodes around it.
        let mut sums = [[0.0; 3]; NODES];
        for i in 0..=(NODES - 1) * STEP {
            let lambda = LAMBDA_MIN + i as f32;
            let (node, t) = (i / STEP, (i % STEP) as f64 / STEP as f64);
            let half = if i == 0 || i == (NODES - 1) * STEP { 0.5 } else { 1.0 };
            for (c, response) in rgb_response(lambda).into_iter().enumerate() {
                let weight = f64::from(response) * f64::from(white_light(lambda)) * half;
                sums[node][c] += weight * (1.0 - t);
                if t > 0.0 {
                    sums[node + 1][c] += weight * t;
                }
            }
        }
        let mut weights = vec![[[0.0; SIDE_BY_SIDE]; 3]; BUNDLES];
        for (node, sum) in sums.iter().enumerate() {
            for c in 0..3 {
                weights[node / SIDE_BY_SIDE][c][node % SIDE_BY_SIDE] = sum[c] as f32;
            }
        }
        Self { weights }
    }

    /// The colour of the reflectance with coefficients `c`, and its derivatives with respect to
    /// them.
    fn evaluate(&self, c: [f32; 3]) -> ([f32; 3], [[f32; 3]; 3]) {
        let mut colors = [[0.0; SIDE_BY_SIDE]; 3];
        let mut slopes = [[[0.0; SIDE_BY_SIDE]; 3]; 3];
        for (bundle, weights) in self.weights.iter().enumerate() {
            for lane in 0..SIDE_BY_SIDE {
                let t = (bundle * SIDE_BY_SIDE + lane) as f32 / (NODES - 1) as f32;
                let x = (c[0] * t + c[1]) * t + c[2];
                let r = 1.0 / (1.0 + x * x).sqrt();
                let (value, slope) = (0.5 + 0.5 * x * r, 0.5 * r * r * r);
                for k in 0..3 {
                    colors[k][lane] += weights[k][lane] * value;
                    let d = weights[k][lane] * slope;
                    slopes[k][2][lane] += d;
                    slopes[k][1][lane] += d * t;
                    slopes[k][0][lane] += d * t * t;
                }
            }
        }
        let sum = |lanes: Bundle| lanes.iter().sum::<f32>();
        (colors.map(sum), slopes.map(|row| row.map(sum)))
    }

    /// The coefficients whose colour is closest to `target`, by the Levenberg-Marquardt method from
    /// `start`.
    fn solve(&self, target: [f32; 3], start: [f32; 3]) -> [f32; 3] {
        let error =
            |color: &[f32; 3]| -> [f32; 3] { std::array::from_fn(|k| target[k] - color[k]) };
        let square = |e: &[f32; 3]| e.iter().map(|x| x * x).sum::<f32>();
        let mut c = start;
        let (color, mut derivatives) = self.evaluate(c);
        let mut residual = error(&color);
        let mut damping = 1e-6;
        for _ in 0..200 {
            if square(&residual) < 1e-10 {
                break;
            }
            let step = damped_step(&derivatives, &residual, damping);
            let next: [f32; 3] = std::array::from_fn(|i| c[i] + step[i]);
            let (color, next_derivatives) = self.evaluate(next);
            let next_residual = error(&color);
            if square(&next_residual) < square(&residual) {
                (c, derivatives, residual) = (next, next_derivatives, next_residual);
                damping = (damping * 0.1).max(1e-15);
            } else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        c
    }
}

/// The solution `x` of `(J^T J + damping diag(J^T J)) x = J^T residual`.
fn damped_step(jacobian: &[[f32; 3]; 3], residual: &[f32; 3], damping: f64) -> [f32; 3] {
    let mut m = DMat3::ZERO;
    let mut v = DVec3::ZERO;
    for (row, e) in jacobian.iter().zip(residual) {
        let row = DVec3::from_array(row.map(f64::from));
        m += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        v += row * f64::from(*e);
    }
    for i in 0..3 {
        m.col_mut(i)[i] *= 1.0 + damping;
    }
    let x = m.inverse() * v;
    if x.is_finite() { x.to_array().map(|x| x as f32) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::super::response::rgb_of_reflectance;
    use super::*;
    use crate::rng;

    /// The largest difference of a channel between `color` and the colour of `spectrum`.
    fn error(color: Rgb, spectrum: RgbSpectrum) -> f32 {
        let seen = rgb_of_reflectance(|l| f64::from(spectrum.at_wavelength(l)));
        (0..3).map(|c| (seen.to_array()[c] - color.to_array()[c]).abs()).fold(0.0, f32::max)
    }

    fn colors() -> impl Iterator<Item = Rgb> {
        let n = 16;
        let at = move |i: u32| i as f32 / (n - 1) as f32;
        let grid = (0..n * n * n).map(move |i| Rgb::new(at(i % n), at(i / n % n), at(i / n / n)));
        let random = (0..3000).map(|i| {
            let [r, g, b, _] = rng::pcg4d([i, 1, 2, 3]).map(rng::to_unit);
            Rgb::new(r, g, b)
        });
        // These colours lie near the edges and corners of the cube, where spectra are steepest.
        let extreme = (0..3000).map(|i| {
            let [r, g, b, k] = rng::pcg4d([i, 4, 5, 6]).map(rng::to_unit);
            Rgb::new(r, g, b).map(|x| ((x - 0.5) * (1.0 + 20.0 * k) + 0.5).clamp(0.0, 1.0))
        });
        grid.chain(random).chain(extreme)
    }

    #[test]
    fn spectra_look_like_their_colours() {
        for color in colors() {
            let e = error(color, RgbSpectrum::of_factor(color));
            assert!(e < 0.002, "{color:?}: {e}");
        }
    }

    #[test]
    fn reflectances_neither_gain_energy_nor_are_negative() {
        for color in colors() {
            let spectrum = RgbSpectrum::of_factor(color);
            for i in 0..=94 {
                let value = spectrum.at_wavelength(LAMBDA_MIN + 5.0 * i as f32);
                assert!((0.0..=1.000_001).contains(&value), "{color:?}: {value}");
            }
        }
    }

    #[test]
    fn greys_are_constant_black_is_nothing_and_white_everything() {
        for i in 0..=100 {
            let grey = i as f32 / 100.0;
            for lambda in [360.0, 451.3, 600.0, 830.0] {
                let value = RgbSpectrum::of_factor(Rgb::splat(grey)).at_wavelength(lambda);
                assert!((value - grey).abs() < 1e-6, "{grey}: {value}");
            }
        }
        assert_eq!(RgbSpectrum::of_factor(Rgb::BLACK).at_wavelength(500.0), 0.0);
        assert_eq!(RgbSpectrum::of_light(Rgb::splat(8.0)).at_wavelength(500.0), 8.0);
    }

    #[test]
    fn lights_and_factors_above_one_keep_their_colour_at_any_brightness() {
        for color in colors().step_by(7) {
            for scale in [1e-3, 1.0, 40.0, 1e6] {
                let bright = color * scale;
                for spectrum in [RgbSpectrum::of_light(bright), RgbSpectrum::of_factor(bright)] {
                    let e = error(bright, spectrum);
                    assert!(e < 0.004 * scale, "{bright:?}: {e}");
                }
            }
        }
    }

    #[test]
    fn nonsense_is_dark_and_a_small_change_of_colour_is_one_of_the_spectrum() {
        for bad in [
            Rgb::splat(f32::NAN),
            Rgb::splat(-1.0),
            Rgb::splat(f32::INFINITY),
            Rgb::new(f32::NAN, -2.0, 0.0),
        ] {
            assert_eq!(RgbSpectrum::of_factor(bad).at_wavelength(550.0), 0.0, "{bad:?}");
        }
        assert!(
            RgbSpectrum::of_factor(Rgb::new(f32::NAN, 0.5, -1.0)).at_wavelength(550.0).is_finite()
        );
        for color in colors().step_by(11) {
            let other = color.map(|x| (x + 1e-4).min(1.0));
            for lambda in [420.0, 480.0, 530.0, 580.0, 640.0] {
                let [a, b] =
                    [color, other].map(|c| RgbSpectrum::of_factor(c).at_wavelength(lambda));
                assert!((a - b).abs() < 0.02, "{color:?} {lambda}: {a} {b}");
            }
        }
    }
}
