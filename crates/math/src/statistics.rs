//! Chi-squared tests of whether samples have the claimed density, for the tests of all sampling
//! code.

use crate::{Frame, Vec3, real};
use std::f64::consts::TAU;

/// Minimum expected number of samples in a cell that is judged by itself. Cells with fewer are
/// pooled.
const FEWEST: f64 = 8.0;

/// The number of standard deviations by which Pearson's statistic of these counts exceeds its
/// expectation (Wilson and Hilferty's approximation, The distribution of chi-square, 1931). Both
/// slices must have the same sum, the number of samples, so that there is one degree of freedom
/// less than there are cells.
///
/// # Panics
/// If the slices differ in length.
pub fn chi_squared_deviation(found: &[u32], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len(), "a count for each cell");
    let (mut statistic, mut cells, mut pool) = (0.0, 0.0, (0.0, 0.0));
    for (&f, &e) in found.iter().zip(expected) {
        if e >= FEWEST {
            statistic += real::powi(f64::from(f) - e, 2) / e;
            cells += 1.0;
        } else {
            pool = (pool.0 + f64::from(f), pool.1 + e);
        }
    }
    if pool.1 >= FEWEST {
        statistic += real::powi(pool.0 - pool.1, 2) / pool.1;
        cells += 1.0;
    } else {
        // The pool is too small for the statistic, so that only a large excess counts.
        statistic += real::powi((pool.0 - pool.1 - 2.0 * FEWEST).max(0.0), 2) / FEWEST;
    }
    let degrees: f64 = f64::max(cells - 1.0, 1.0);
    let v = 2.0 / (9.0 * degrees);
    (real::cbrt(statistic / degrees) - (1.0 - v)) / v.sqrt()
}

/// The deviation that any of `tests` independent tests exceeds with probability `significance` if
/// all hypotheses are true (Sidak, Rectangular confidence regions, 1967).
pub fn sidak_deviation(significance: f64, tests: u32) -> f64 {
    let tail = -real::ln_1p(-significance) / f64::from(tests.max(1));
    // The significance of each single test is 1 - (1 - significance)^(1 / tests), computed without
    // cancellation.
    let tail = -real::exp_m1(-tail);
    let (mut low, mut high) = (-8.0, 9.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if normal_tail(middle) > tail { low = middle } else { high = middle }
    }
    high
}

/// The probability that a standard normal variable exceeds `z`, to 7 digits: for `z` below 3 by
/// Abramowitz and Stegun, 26.2.17, and above by the asymptotic series as a continued fraction.
fn normal_tail(z: f64) -> f64 {
    if z < 0.0 {
        return 1.0 - normal_tail(-z);
    }
    let density = real::exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt();
    if z < 3.0 {
        let t = 1.0 / (1.0 + 0.231_641_9 * z);
        let c = [0.319_381_530, -0.356_563_782, 1.781_477_937, -1.821_255_978, 1.330_274_429];
        return density * t * (c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * c[4]))));
    }
    let fraction = (1..=40).rev().fold(z, |rest, k| z + f64::from(k) / rest);
    density / fraction
}

/// Cells of one hemisphere, `z > 0` or `z < 0`, in polar coordinates about an axis in that
/// hemisphere. The angles of their rings grow with the cube of the ring's number, so that sharp
/// lobes about the axis are resolved, and the last ring ends exactly at the hemisphere's border.
#[derive(Clone, Copy, Debug)]
pub struct HemisphereCells {
    frame: Frame,
    /// The sign of z in the hemisphere: 1 or -1.
    sign: f64,
    rings: usize,
    sectors: usize,
}

/// Gauss-Legendre nodes and weights for four values on `[0, 1]`.
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// A piece is no longer halved when its integral changes by less than this.
const TOLERANCE: f64 = 1e-5;
/// The maximum number of halvings, which ends the recursion.
const MOST_HALVINGS: u32 = 8;
/// The minimum number of halvings, which keeps narrow ridges from being missed.
const LEAST_HALVINGS: u32 = 1;

impl HemisphereCells {
    /// Divides the hemisphere that holds the unit vector `axis` into `rings` times `sectors` cells.
    /// The axis must not lie on the hemisphere's border.
    pub fn new(axis: Vec3, rings: usize, sectors: usize) -> Self {
        Self { frame: Frame::from_z(axis), sign: f64::from(axis.z).signum(), rings, sectors }
    }

    /// The angle from the axis to the border of the hemisphere in this azimuth.
    fn border(&self, phi: f64) -> f64 {
        let slope =
            f64::from(self.frame.x.z) * real::cos(phi) + f64::from(self.frame.y.z) * real::sin(phi);
        real::atan2(self.sign * f64::from(self.frame.z.z), -self.sign * slope)
    }

    /// The index of the cell of a unit vector in this hemisphere, below rings times sectors.
    pub fn index(&self, w: Vec3) -> usize {
        let l = self.frame.to_local(w).as_dvec3();
        let (theta, phi) = (real::atan2(l.truncate().length(), l.z), real::atan2(l.y, l.x));
        let t = real::cbrt(theta / self.border(phi)) * self.rings as f64;
        let p = (phi / TAU + 0.5) * self.sectors as f64;
        (t as usize).min(self.rings - 1) * self.sectors + (p as usize).min(self.sectors - 1)
    }

    /// The integral of a density per steradian over each cell, with an error of about 1e-4 of the
    /// whole: pieces are halved until the result no longer changes.
    pub fn integrate(&self, density: impl Fn(Vec3) -> f32) -> Vec<f64> {
        let at = |t: f64, p: f64| {
            let phi = TAU * (p - 0.5);
            let border = self.border(phi);
            let theta = border * t * t * t;
            let (sin, cos) = real::sin_cos(theta);
            let w = self.frame.from_local(Vec3::new(
                (sin * real::cos(phi)) as f32,
                (sin * real::sin(phi)) as f32,
                cos as f32,
            ));
            // A point that rounding moved across the border counts as on it.
            if f64::from(w.z) * self.sign > 0.0 {
                f64::from(density(w)) * sin * border * 3.0 * t * t * TAU
            } else {
                0.0
            }
        };
        let size = [1.0 / self.rings as f64, 1.0 / self.sectors as f64];
        let corner = |cell: usize| {
            [(cell / self.sectors) as f64 * size[0], (cell % self.sectors) as f64 * size[1]]
        };
        let cells = 0..self.rings * self.sectors;
        cells
            .map(|cell| refined(&at, corner(cell), size, rule(&at, corner(cell), size), 0))
            .collect()
    }
}

/// Gauss-Legendre quadrature on a rectangle.
fn rule(f: &impl Fn(f64, f64) -> f64, corner: [f64; 2], size: [f64; 2]) -> f64 {
    let row = |(x, u): (f64, f64)| -> f64 {
        GAUSS
            .iter()
            .map(|&(y, v)| u * v * f(corner[0] + size[0] * x, corner[1] + size[1] * y))
            .sum()
    };
    GAUSS.into_iter().map(row).sum::<f64>() * size[0] * size[1]
}

/// The integral over a rectangle whose quadrature is `first`, after `depth` halvings.
fn refined(
    f: &impl Fn(f64, f64) -> f64,
    corner: [f64; 2],
    size: [f64; 2],
    first: f64,
    halvings: u32,
) -> f64 {
    let half = size.map(|s| 0.5 * s);
    let corners = [[0.0, 0.0], [0.0, half[1]], [half[0], 0.0], half]
        .map(|[x, y]| [corner[0] + x, corner[1] + y]);
    let quarters = corners.map(|corner| rule(f, corner, half));
    let sum: f64 = quarters.iter().sum();
    let settled = (sum - first).abs() <= TOLERANCE && halvings >= LEAST_HALVINGS;
    if settled || halvings == MOST_HALVINGS {
        return sum;
    }
    corners
        .into_iter()
        .zip(quarters)
        .map(|(corner, first)| refined(f, corner, half, first, halvings + 1))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn cells_cover_their_half_once() {
        let axes = [(0.0f32, 0.0f32), (0.7, 2.0), (1.5, -1.0), (1.65, 0.3), (2.5, 3.0)];
        for (theta, phi) in axes {
            let axis = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            let cells = HemisphereCells::new(axis, 6, 4);
            let total = |f: &dyn Fn(Vec3) -> f32| cells.integrate(f).iter().sum::<f64>();
            assert!((total(&|_| 1.0) / TAU - 1.0).abs() < 1e-4, "{axis}");
            assert!((total(&|w| w.z.abs()) / PI - 1.0).abs() < 1e-4, "{axis}");
            // The lobe is a thousandth of a radian wide.
            let lobe = |w: Vec3| 1e6 / PI as f32 * (-(w - axis).length_squared() * 1e6).exp();
            assert!((total(&lobe) - 1.0).abs() < 2e-4, "{axis}: {}", total(&lobe));
        }
    }

    #[test]
    fn directions_are_counted_in_the_cell_over_which_is_integrated() {
        let cells = HemisphereCells::new(Vec3::new(0.6, 0.0, -0.8), 5, 6);
        let shares = cells.integrate(|_| 1.0 / TAU as f32);
        let n = 20_000;
        let mut found = vec![0; shares.len()];
        for i in 0..n {
            let w = crate::sampling::uniform_sphere(crate::rng::uniform2([i, 2, 1, 4]));
            found[cells.index(Vec3::new(w.x, w.y, -w.z.abs()))] += 1;
        }
        let expected: Vec<_> = shares.iter().map(|s| s * f64::from(n)).collect();
        assert!(chi_squared_deviation(&found, &expected) < 3.0, "{found:?} {expected:?}");
    }

    #[test]
    fn deviations_are_those_of_tables() {
        // For one test, the deviations are quantiles of the normal distribution.
        for (significance, z) in [
            (0.5, 0.0),
            (0.05, 1.644_854),
            (0.01, 2.326_348),
            (0.001, 3.090_232),
            (1e-6, 4.753_424),
        ] {
            assert!((sidak_deviation(significance, 1) - z).abs() < 1e-4, "{significance}");
        }
        assert!((sidak_deviation(0.01, 100) - 3.718).abs() < 2e-3);
        assert!(sidak_deviation(0.01, 2000) > sidak_deviation(0.01, 100));
    }

    #[test]
    fn a_wrong_density_is_found_out_and_a_right_one_passes() {
        assert!(
            chi_squared_deviation(&[10_000; 4], &[10_400.0, 9_600.0, 10_000.0, 10_000.0]) > 4.3
        );
        assert!(chi_squared_deviation(&[10_050, 9_950, 9_980, 10_020], &[10_000.0; 4]) < 2.0);
        // Samples were found where none are expected.
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
            deviations
                .push(chi_squared_deviation(&found, &[f64::from(samples) / cells as f64; 12]));
        }
        let above = |z: f64| deviations.iter().filter(|&&d| d > z).count();
        // The expected counts are 63.5, 9.1 and 0.5 of 400.
        assert!(
            (40..90).contains(&above(1.0)) && (2..20).contains(&above(2.0)) && above(3.0) < 4,
            "{deviations:?}"
        );
    }
}
