//! Chi-squared tests: do samples have the density that is claimed? For the tests of everything that is sampled.

/// Fewest expected samples of a cell that is judged by itself; those of fewer are pooled.
const FEWEST: f64 = 8.0;

/// How many standard deviations Pearson's statistic of these counts is too large against the expected ones (Wilson and Hilferty's
/// approximation, The distribution of chi-square, 1931). Both must add up to the number of samples, so that there is one degree of
/// freedom less than there are cells.
///
/// # Panics
/// If there are not as many counts as expected counts.
pub fn chi_squared_deviation(found: &[u32], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len(), "a count for each cell");
    let (mut statistic, mut cells, mut pool) = (0.0, 0.0, (0.0, 0.0));
    for (&f, &e) in found.iter().zip(expected) {
        if e >= FEWEST {
            statistic += (f64::from(f) - e).powi(2) / e;
            cells += 1.0;
        } else {
            pool = (pool.0 + f64::from(f), pool.1 + e);
        }
    }
    if pool.1 >= FEWEST {
        statistic += (pool.0 - pool.1).powi(2) / pool.1;
        cells += 1.0;
    } else {
        // Too few to be judged by the statistic: only many more than expected count.
        statistic += (pool.0 - pool.1 - 2.0 * FEWEST).max(0.0).powi(2) / FEWEST;
    }
    let degrees: f64 = f64::max(cells - 1.0, 1.0);
    let v = 2.0 / (9.0 * degrees);
    ((statistic / degrees).cbrt() - (1.0 - v)) / v.sqrt()
}

/// The deviation that one of `tests` independent tests exceeds with probability `significance` if nothing is wrong with any of them
/// (Sidak, Rectangular confidence regions, 1967).
pub fn sidak_deviation(significance: f64, tests: u32) -> f64 {
    let tail = -f64::ln_1p(-significance) / f64::from(tests.max(1));
    // The share of each, without the cancellation of 1 - (1 - significance)^(1 / tests).
    let tail = -f64::exp_m1(-tail);
    let (mut low, mut high) = (-8.0, 9.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if normal_tail(middle) > tail { low = middle } else { high = middle }
    }
    high
}

/// The probability that a standard normal variable exceeds `z`, to 7 digits (Abramowitz and Stegun, 26.2.17, below 3; above, the
/// asymptotic series as a continued fraction).
fn normal_tail(z: f64) -> f64 {
    if z < 0.0 {
        return 1.0 - normal_tail(-z);
    }
    let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
    if z < 3.0 {
        let t = 1.0 / (1.0 + 0.231_641_9 * z);
        let c = [0.319_381_530, -0.356_563_782, 1.781_477_937, -1.821_255_978, 1.330_274_429];
        return density * t * (c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * c[4]))));
    }
    let fraction = (1..=40).rev().fold(z, |rest, k| z + f64::from(k) / rest);
    density / fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_those_of_tables() {
        // One test: the quantiles of the normal distribution.
        for (significance, z) in
            [(0.5, 0.0), (0.05, 1.644_854), (0.01, 2.326_348), (0.001, 3.090_232), (1e-6, 4.753_424)]
        {
            assert!((sidak_deviation(significance, 1) - z).abs() < 1e-4, "{significance}");
        }
        assert!((sidak_deviation(0.01, 100) - 3.718).abs() < 2e-3);
        assert!(sidak_deviation(0.01, 2000) > sidak_deviation(0.01, 100));
    }

    #[test]
    fn a_wrong_density_is_found_out_and_a_right_one_passes() {
        assert!(chi_squared_deviation(&[10_000; 4], &[10_400.0, 9_600.0, 10_000.0, 10_000.0]) > 4.3);
        assert!(chi_squared_deviation(&[10_050, 9_950, 9_980, 10_020], &[10_000.0; 4]) < 2.0);
        // What is expected nowhere, and found often.
        assert!(chi_squared_deviation(&[10_000, 60], &[10_060.0, 0.0]) > 5.0);
    }

    #[test]
    fn deviations_of_true_counts_are_standard_normal() {
        let (cells, samples, trials) = (12, 2400, 400);
        let mut deviations = Vec::new();
        for trial in 0..trials {
            let mut found = vec![0; cells];
            for i in 0..samples {
                let u = crate::rng::uniform2([i, trial, 1, 4]).x;
                found[((u * cells as f32) as usize).min(cells - 1)] += 1;
            }
            deviations.push(chi_squared_deviation(&found, &[f64::from(samples) / cells as f64; 12]));
        }
        let above = |z: f64| deviations.iter().filter(|&&d| d > z).count();
        // Expected 63.5, 9.1 and 0.5 of 400.
        assert!((40..90).contains(&above(1.0)) && (2..20).contains(&above(2.0)) && above(3.0) < 4, "{deviations:?}");
    }
}
