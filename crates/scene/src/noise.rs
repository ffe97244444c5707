//! Noise functions over space, for clouds and for patterns of stone, waves and wrinkles.

use snell_math::{Vec3, real, rng};

/// Gradient noise (Perlin, Improving Noise, SIGGRAPH 2002) with hashed gradients. It is 0 at
/// integer coordinates, smooth, and within about `[-1, 1]`.
pub fn gradient_noise(p: Vec3, seed: u32) -> f32 {
    let whole = |c: f32| c as i32;
    let gradient = |[x, y, z]: [i32; 3], f: Vec3| {
        let [a, b, c, _] = rng::pcg4d([x as u32, y as u32, z as u32, seed]);
        Vec3::from_array([a, b, c].map(|bits| 2.0 * rng::to_unit(bits) - 1.0)).dot(f)
    };
    lattice(p, whole, gradient) * 1.2
}

/// Interpolates between the eight corners of a cell of the integer lattice. `gradient` returns the
/// value of a corner's linear function at an offset from the corner; `whole` converts a coordinate
/// of a corner to an integer.
fn lattice(p: Vec3, whole: impl Fn(f32) -> i32, gradient: impl Fn([i32; 3], Vec3) -> f32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let [x, y, z] = cell.to_array().map(whole);
    let corner = |i: i32, j: i32, k: i32| {
        let at = [x.wrapping_add(i), y.wrapping_add(j), z.wrapping_add(k)];
        gradient(at, f - Vec3::new(i as f32, j as f32, k as f32))
    };
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let row = |j, k| lerp(corner(0, j, k), corner(1, j, k), fade.x);
    let plane = |k| lerp(row(0, k), row(1, k), fade.y);
    lerp(plane(0), plane(1), fade.z)
}

/// Fractal noise: `octaves` of gradient noise, each with twice the frequency and half the amplitude
/// of the previous one.
pub fn fractal_noise(p: Vec3, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut scale, mut height) = (0.0, 1.0, 1.0);
    for octave in 0..octaves {
        sum += height * gradient_noise(p * scale, rng::hash_combine(seed, octave));
        scale *= 2.0;
        height *= 0.5;
    }
    sum
}

/// Perlin's permutation of the numbers from 0 to 255 (Improving Noise, SIGGRAPH 2002). Renderers
/// that use it compute the same noise.
#[rustfmt::skip]
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69,
    142, 8, 99, 37, 240, 21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219,
    203, 117, 35, 11, 32, 57, 177, 33, 88, 237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175,
    74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83, 111, 229, 122, 60, 211, 133, 230,
    220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216, 80, 73, 209, 76,
    132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186,
    3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206, 59,
    227, 47, 16, 58, 17, 182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163, 70,
    221, 153, 101, 155, 167, 43, 172, 9, 129, 22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178,
    185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238, 210, 144, 12, 191, 179, 162, 241, 81,
    51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184, 84, 204, 176, 115,
    121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195,
    78, 66, 215, 61, 156, 180,
];

/// Perlin's improved noise with his own permutation, which repeats every 256 units. It is 0 at
/// integer coordinates, and within about `[-1, 1]`. If the coordinates are not finite, the result
/// is 0.
///
/// The gradients are the twelve directions to the midpoints of a cube's edges. Four of them occur
/// twice, which makes sixteen. They follow pbrt (3rd edition of the book, section 10.6.1) and
/// differ from Perlin's in two entries.
pub fn perlin_noise(p: Vec3) -> f32 {
    if !p.is_finite() {
        return 0.0;
    }
    let permuted = |i: i32| i32::from(PERMUTATION[(i & 255) as usize]);
    lattice(
        p,
        |c| c as i32,
        |[x, y, z], f| {
            let hash = permuted(permuted(permuted(x).wrapping_add(y)).wrapping_add(z)) & 15;
            let (u, v) = match hash {
                0..4 | 12 | 13 => (f.x, f.y),
                4..8 => (f.x, f.z),
                _ => (f.y, f.z),
            };
            (if hash & 1 == 0 { u } else { -u }) + (if hash & 2 == 0 { v } else { -v })
        },
    )
}

/// Parameters of a sum of octaves of [`perlin_noise`], for fractional Brownian motion and
/// turbulence (Pharr, Jakob, Humphreys, Physically Based Rendering, 3rd edition, section 10.6.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Octaves {
    /// Number of octaves, at most 32, since more would be finer than the precision.
    pub count: u32,
    /// Ratio of the amplitudes of successive octaves, in `[0, 4]`; other values are clamped, and
    /// NaN counts as 0.
    pub omega: f32,
}

/// Ratio of the frequencies of successive octaves. It is not quite 2, because the zeros of all
/// lattices would coincide then.
const LACUNARITY: f32 = 1.99;
/// The mean of the absolute value of [`perlin_noise`], measured.
const MEAN_ABSOLUTE: f32 = 0.217;

impl Octaves {
    /// Fractional Brownian motion, which is the sum of the octaves. `width` is the filter width;
    /// octaves that are too fine for it fade out, because their mean is 0. A width of 0 keeps all
    /// octaves.
    pub fn fbm(self, p: Vec3, width: f32) -> f32 {
        self.sum(p, width, 0.0, |noise| noise)
    }

    /// Turbulence, which is the sum of the absolute values of the octaves. Octaves that are too
    /// fine for `width` are replaced by their mean.
    pub fn turbulence(self, p: Vec3, width: f32) -> f32 {
        self.sum(p, width, MEAN_ABSOLUTE, f32::abs)
    }

    /// The sum of the function `value` of the octaves; octaves that are too fine are replaced by
    /// `mean`.
    fn sum(self, p: Vec3, width: f32, mean: f32, value: impl Fn(f32) -> f32) -> f32 {
        let count = self.count.min(32);
        let omega = crate::bsdf::bounded(self.omega, 4.0);
        // By Nyquist's theorem, an octave is fully resolved up to half a period per width.
        let seen = crate::bsdf::bounded(-1.0 - real::log2(width.max(0.0)), count as f32);
        let (mut sum, mut frequency, mut height) = (0.0, 1.0, 1.0);
        for octave in 0..count {
            let t = ((seen - octave as f32 - 0.3) / 0.4).clamp(0.0, 1.0);
            let share = if seen >= (octave + 1) as f32 { 1.0 } else { t * t * (3.0 - 2.0 * t) };
            let shown = if share > 0.0 { value(perlin_noise(p * frequency)) } else { mean };
            sum += height * (mean + (shown - mean) * share);
            frequency *= LACUNARITY;
            height *= omega;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(n: u32) -> impl Iterator<Item = Vec3> {
        (0..n).map(|i| {
            let (a, b) = (rng::uniform2([i, 1, 2, 3]), rng::uniform2([i, 4, 5, 6]));
            Vec3::new(a.x, a.y, b.x) * 200.0 - 100.0
        })
    }

    #[test]
    fn noise_is_continuous_has_no_mean_and_depends_on_its_seed() {
        let (mut mean, mut largest, mut different) = (0.0f32, 0.0f32, 0);
        for i in 0..4000 {
            let (a, b) = (rng::uniform2([i, 1, 2, 3]), rng::uniform2([i, 4, 5, 6]));
            let p = Vec3::new(a.x, a.y, b.x) * 40.0 - 20.0;
            let value = gradient_noise(p, 7);
            mean += value / 4000.0;
            largest = largest.max(value.abs());
            assert!((value - gradient_noise(p + 1e-4, 7)).abs() < 1e-2, "{p}");
            different += u32::from((value - gradient_noise(p, 8)).abs() > 1e-3);
        }
        assert!(
            mean.abs() < 0.02 && largest > 0.5 && largest < 1.8 && different > 3900,
            "{mean} {largest} {different}"
        );
        assert_eq!(gradient_noise(Vec3::new(3.0, -2.0, 8.0), 1), 0.0);
    }

    /// A second implementation in double precision, in which each corner's gradient comes from a
    /// list of the sixteen directions.
    fn perlin_by_list(p: [f64; 3]) -> f64 {
        const DIRECTIONS: [[f64; 3]; 16] = [
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
            [1.0, -1.0, 0.0],
            [-1.0, -1.0, 0.0],
            [1.0, 0.0, 1.0],
            [-1.0, 0.0, 1.0],
            [1.0, 0.0, -1.0],
            [-1.0, 0.0, -1.0],
            [0.0, 1.0, 1.0],
            [0.0, -1.0, 1.0],
            [0.0, 1.0, -1.0],
            [0.0, -1.0, -1.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
            [0.0, 1.0, -1.0],
            [0.0, -1.0, -1.0],
        ];
        let at = |i: i64| i64::from(PERMUTATION[i.rem_euclid(256) as usize]);
        let mut sum = 0.0;
        for corner in 0..8 {
            let offset = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
            let lattice: [i64; 3] = std::array::from_fn(|i| p[i].floor() as i64 + offset[i]);
            let from: [f64; 3] = std::array::from_fn(|i| p[i] - lattice[i] as f64);
            let weight: f64 = from
                .iter()
                .map(|d| 1.0 - d.abs().powi(3) * (d.abs() * (d.abs() * 6.0 - 15.0) + 10.0))
                .product();
            let direction =
                DIRECTIONS[(at(at(at(lattice[0]) + lattice[1]) + lattice[2]) & 15) as usize];
            sum += weight * (0..3).map(|i| direction[i] * from[i]).sum::<f64>();
        }
        sum
    }

    #[test]
    fn perlins_noise_is_the_published_one() {
        // Each number must occur once.
        let mut seen = PERMUTATION;
        seen.sort_unstable();
        assert!(seen.iter().enumerate().all(|(i, &p)| i == usize::from(p)));
        for p in points(3000) {
            let wanted = perlin_by_list(p.to_array().map(f64::from));
            assert!(
                (f64::from(perlin_noise(p)) - wanted).abs() < 1e-5,
                "{p}: {} {wanted}",
                perlin_noise(p)
            );
            assert_eq!(perlin_noise(p.floor()), 0.0);
            assert!((perlin_noise(p) - perlin_noise(p + 256.0)).abs() < 1e-3, "the period is 256");
        }
        // The value of the reference implementation at a point that is often quoted.
        assert!((perlin_noise(Vec3::new(314.0 / 100.0, 42.0, 7.0)) - 0.13691995).abs() < 1e-5);
    }

    #[test]
    fn noise_has_a_value_everywhere() {
        for x in [f32::NAN, f32::INFINITY, -f32::INFINITY, f32::MAX, -1e30, 1e-40, -1e-40] {
            for omega in [f32::NAN, f32::INFINITY, -1.0, 0.5] {
                for width in [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e-40, 1.0] {
                    let octaves = Octaves { count: u32::MAX, omega };
                    let p = Vec3::new(x, 1.5, 0.25);
                    assert!(octaves.fbm(p, width).is_finite(), "{x} {omega} {width}");
                    assert!(octaves.turbulence(p, width).is_finite(), "{x} {omega} {width}");
                }
            }
        }
    }

    #[test]
    fn octaves_too_fine_for_what_is_seen_leave_their_mean() {
        let octaves = Octaves { count: 8, omega: 0.5 };
        let mean = |f: &dyn Fn(Vec3) -> f32| {
            points(20_000).map(|p| f64::from(f(p))).sum::<f64>() / 20_000.0
        };
        let variance = |f: &dyn Fn(Vec3) -> f32| {
            points(20_000).map(|p| f64::from(f(p)).powi(2)).sum::<f64>() / 20_000.0
        };
        let (fine, coarse) =
            (mean(&|p| octaves.turbulence(p, 0.0)), mean(&|p| octaves.turbulence(p, 0.1)));
        assert!(
            (fine - coarse).abs() < 0.02
                && (octaves.turbulence(Vec3::ONE, 9.0) - fine as f32).abs() < 0.1,
            "{fine} {coarse}"
        );
        assert!(
            mean(&|p| octaves.fbm(p, 0.0)).abs() < 0.01
                && octaves.fbm(Vec3::splat(0.3), 9.0) == 0.0
        );
        // The octaves are independent, so the variance of their sum is the geometric sum of the
        // variance of one.
        let one = variance(&perlin_noise);
        let all = one * (1.0 - 0.25f64.powi(8)) / (1.0 - 0.25);
        let found = variance(&|p| octaves.fbm(p, 0.0));
        assert!((found / all - 1.0).abs() < 0.03, "{found} {all}");
        let halved = variance(&|p| octaves.fbm(p, 0.25));
        assert!(halved < found && halved > 0.9 * one, "{halved}");
        // The visible pattern must fade continuously.
        for i in 1..200 {
            let [a, b] = [i, i + 1]
                .map(|i| octaves.fbm(Vec3::new(0.3, 1.7, 2.2), 0.5f32.powf(i as f32 / 20.0)));
            assert!((a - b).abs() < 0.12, "{i}: {a} {b}");
        }
    }
}
