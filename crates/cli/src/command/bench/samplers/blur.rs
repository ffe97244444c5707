//! A blur that approximates viewing from some distance.

/// Weights of a binomial kernel, near a Gaussian with a standard deviation of one pixel.
const KERNEL: [f64; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

/// The factor by which the blur along both axes changes the standard deviation of white noise: the
/// sum of the squares of the weights.
pub const OF_WHITE_NOISE: f64 = 70.0 / 256.0;

/// Blurs a square picture along both axes; its borders wrap around.
pub fn blurred(picture: &[f64], side: usize) -> Vec<f64> {
    let along = |picture: &[f64], step: [usize; 2]| -> Vec<f64> {
        let at = |x: usize, y: usize, k: usize| {
            let shifted = |p: usize, step: usize| (p + side + k * step - 2 * step) % side;
            picture[shifted(y, step[1]) * side + shifted(x, step[0])]
        };
        let value =
            |i: usize| KERNEL.iter().enumerate().map(|(k, w)| w * at(i % side, i / side, k)).sum();
        (0..picture.len()).map(value).collect()
    };
    along(&along(picture, [1, 0]), [0, 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_noise_loses_what_is_said() {
        let side = 128;
        let noise: Vec<f64> = (0..side * side)
            .map(|i| f64::from(snell_math::rng::to_unit(snell_math::rng::hash32(i as u32))) - 0.5)
            .collect();
        let rms = |p: &[f64]| (p.iter().map(|x| x * x).sum::<f64>() / p.len() as f64).sqrt();
        let left = rms(&blurred(&noise, side)) / rms(&noise);
        assert!((left / OF_WHITE_NOISE - 1.0).abs() < 0.03, "{left}");
    }
}
