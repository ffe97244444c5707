//! Smooth random numbers over space, for things that have no shape.

use snell_math::{Vec3, rng};

/// Gradient noise (Perlin, Improving Noise, SIGGRAPH 2002) with hashed gradients: 0 at whole coordinates, smooth, within about
/// `[-1, 1]`.
pub fn gradient_noise(p: Vec3, seed: u32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let [x, y, z] = cell.to_array().map(|c| c as i32);
    let corner = |i: i32, j: i32, k: i32| {
        let [a, b, c, _] =
            rng::pcg4d([x.wrapping_add(i) as u32, y.wrapping_add(j) as u32, z.wrapping_add(k) as u32, seed]);
        let gradient = Vec3::from_array([a, b, c].map(|bits| 2.0 * rng::to_unit(bits) - 1.0));
        gradient.dot(f - Vec3::new(i as f32, j as f32, k as f32))
    };
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let row = |j, k| lerp(corner(0, j, k), corner(1, j, k), fade.x);
    let plane = |k| lerp(row(0, k), row(1, k), fade.y);
    lerp(plane(0), plane(1), fade.z) * 1.2
}

/// Fractal noise: `octaves` of gradient noise, each of twice the frequency and half the height of the one before.
pub fn fractal_noise(p: Vec3, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut scale, mut height) = (0.0, 1.0, 1.0);
    for octave in 0..octaves {
        sum += height * gradient_noise(p * scale, rng::hash_combine(seed, octave));
        scale *= 2.0;
        height *= 0.5;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
