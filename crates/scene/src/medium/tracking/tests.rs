//! Tests of collisions against closed forms, and against the same medium without a grid.

use super::*;
use crate::medium::{ColorGrid, Homogeneous, Medium, PreparedMedium, ScalarGrid};
use snell_math::{Rgb, rng};

const UNIT: SampledSpectrum = SampledSpectrum([1.0, 1.0, 1.0, 0.0]);

fn numbers(path: u32) -> impl FnMut() -> Vec2 {
    let mut step = 0;
    move || {
        step += 1;
        rng::uniform2([path, step, 77, 3])
    }
}

fn through(length: f32) -> Segment {
    let direction = Vec3::new(0.6, 0.48, 0.64);
    Segment { origin: Vec3::splat(0.05), direction, length }
}

/// The mean of each lane, and its standard error.
fn mean(n: u32, mut f: impl FnMut(u32) -> SampledSpectrum) -> [(f64, f64); 3] {
    let (mut sum, mut squares) = ([0.0f64; 3], [0.0f64; 3]);
    for i in 0..n {
        let value = f(i);
        for c in 0..3 {
            sum[c] += f64::from(value[c]);
            squares[c] += f64::from(value[c]).powi(2);
        }
    }
    std::array::from_fn(|c| {
        let mean = sum[c] / f64::from(n);
        (mean, ((squares[c] / f64::from(n) - mean * mean).max(0.0) / f64::from(n)).sqrt())
    })
}

#[track_caller]
fn assert_agree(estimate: [(f64, f64); 3], expected: [f64; 3]) {
    for ((mean, error), expected) in estimate.into_iter().zip(expected) {
        assert!(
            (mean - expected).abs() <= 4.0 * error + 1e-5,
            "{mean} +- {error} is not {expected}"
        );
    }
}

/// A ramp along x, whose optical depth has a closed form, and the integral of its density from 0 to
/// `x`.
fn ramp() -> (ScalarGrid, fn(f64) -> f64) {
    let n = 8;
    let value = |i: usize| (i % n) as f32 / 7.0;
    let grid = ScalarGrid::new([n, n, n], (0..n * n * n).map(value).collect())
        .expect("as many values as cells");
    // The density is zero up to the first centre, then linear, then one.
    (grid, |x| {
        let (first, last) = (1.0 / 16.0, 15.0 / 16.0);
        let slope = 1.0 / (last - first);
        let inner = x.clamp(first, last) - first;
        0.5 * slope * inner * inner + (x - last).max(0.0)
    })
}

#[test]
fn light_rays_through_a_ramp_lose_what_the_integral_says() {
    let (density, integral) = ramp();
    let grid = Grid::new(
        Rgb::new(1.0, 0.2, 0.0),
        Rgb::new(2.0, 1.0, 5.0),
        0.0,
        density,
        DAffine3::IDENTITY,
    );
    let tracked = TrackedGrid::new(&grid);
    let segment = through(1.2);
    let columns = (integral(0.05 + 0.6 * 1.2) - integral(0.05)) / 0.6;
    let expected = [3.0, 1.2, 5.0].map(|sigma: f64| (-sigma * columns).exp());
    assert_agree(
        mean(60_000, |i| tracked.attenuate(&segment, UNIT, ColorMode::Rgb, &mut numbers(i))),
        expected,
    );
    let passed = |i| {
        let travel = tracked.travel(&segment, UNIT, ColorMode::Rgb, |_| 1.0, &mut numbers(i));
        assert!(
            travel.throughput.0.iter().sum::<f32>() <= 3.0 * 1.001 * 4.0,
            "{:?}",
            travel.throughput
        );
        if travel.scattered.is_some() { SampledSpectrum::ZERO } else { travel.throughput }
    };
    assert_agree(mean(60_000, passed), expected);
}

#[test]
fn a_constant_grid_is_a_homogeneous_medium() {
    let (sigma_a, sigma_s) = (Rgb::new(0.5, 0.1, 0.0), Rgb::new(0.5, 2.0, 1.0));
    let emission = Rgb::new(1.0, 0.5, 2.0);
    let density = ScalarGrid::new([3, 5, 2], vec![2.0; 30]).expect("thirty values");
    let half = |c: Rgb| c * 0.5;
    let grid = Grid {
        emission: half(emission),
        ..Grid::new(
            half(sigma_a),
            half(sigma_s),
            0.3,
            density,
            DAffine3::from_scale(snell_math::DVec3::splat(4.0)),
        )
    };
    let grid = PreparedMedium::new(&Medium::from(grid));
    let plain =
        PreparedMedium::new(&Medium::from(Homogeneous { sigma_a, sigma_s, emission, g: 0.3 }));
    let segment = through(1.5);
    let of = |medium: &PreparedMedium, what: u32| {
        mean(40_000, |i| {
            let travel = medium.travel(&segment, UNIT, ColorMode::Rgb, &mut numbers(i));
            match (what, travel.scattered) {
                (0, None) => travel.throughput,
                // The first moment depends on the distance at which the path was scattered.
                (1, Some(s)) => travel.throughput * s.distance,
                (2, Some(_)) => travel.throughput,
                (3, _) => travel.emitted,
                _ => SampledSpectrum::ZERO,
            }
        })
    };
    for what in 0..4 {
        for ((a, ea), (b, eb)) in of(&grid, what).into_iter().zip(of(&plain, what)) {
            assert!((a - b).abs() <= 4.0 * ea.hypot(eb) + 1e-5, "{what}: {a} +- {ea}, {b} +- {eb}");
        }
    }
}

/// A different ramp for each colour: red increases along x, green decreases, blue is constant.
fn ramps() -> (Arc<ColorGrid>, impl Fn(f64) -> [f64; 3]) {
    let (rising, integral) = ramp();
    let colors = rising.values().iter().map(|v| Rgb::new(*v, 1.0 - v, 0.5)).collect();
    let tint = ColorGrid::new(rising.size(), colors).expect("as many values as cells");
    (Arc::new(tint), move |x| [integral(x), x - integral(x), 0.5 * x])
}

#[test]
fn light_rays_through_ramps_of_colours_lose_what_the_integrals_say() {
    let (tint, integrals) = ramps();
    let one = || ScalarGrid::new([1; 3], vec![1.0]).expect("one value");
    let plain =
        Grid::new(Rgb::new(1.0, 3.0, 2.0), Rgb::new(2.0, 1.0, 0.5), 0.0, one(), DAffine3::IDENTITY);
    let (from, to) = (integrals(0.05), integrals(0.05 + 0.6 * 1.2));
    let column = |c: usize| (to[c] - from[c]) / 0.6;
    let segment = through(1.2);
    for which in 0..3 {
        let grid = Grid {
            sigma_a_tint: (which != 1).then(|| tint.clone()),
            sigma_s_tint: (which != 0).then(|| tint.clone()),
            ..plain.clone()
        };
        let thickness = |c: usize| {
            let [a, s] = [plain.sigma_a, plain.sigma_s].map(|sigma| f64::from(sigma.to_array()[c]));
            let of = |sigma: f64, is_tinted: bool| sigma * if is_tinted { column(c) } else { 1.2 };
            of(a, which != 1) + of(s, which != 0)
        };
        let expected = [0, 1, 2].map(|c| (-thickness(c)).exp());
        let tracked = TrackedGrid::new(&grid);
        assert_agree(
            mean(60_000, |i| tracked.attenuate(&segment, UNIT, ColorMode::Rgb, &mut numbers(i))),
            expected,
        );
        let passed = |i| {
            let travel = tracked.travel(&segment, UNIT, ColorMode::Rgb, |_| 1.0, &mut numbers(i));
            if travel.scattered.is_some() { SampledSpectrum::ZERO } else { travel.throughput }
        };
        assert_agree(mean(60_000, passed), expected);
    }
}

#[test]
fn tints_that_are_constant_are_factors() {
    let density = || ScalarGrid::new([3, 5, 2], vec![2.0; 30]).expect("thirty values");
    let place = DAffine3::from_scale(snell_math::DVec3::splat(4.0));
    let [absorbing, scattering, shining] =
        [Rgb::new(0.5, 0.1, 0.0), Rgb::new(0.2, 2.0, 1.0), Rgb::new(1.0, 0.3, 0.0)];
    let one = |color: Rgb| ColorGrid::new([1; 3], vec![color]).map(Arc::new);
    let grid = Grid {
        emission: Rgb::splat(0.5),
        ..Grid::new(Rgb::splat(0.4), Rgb::splat(0.7), 0.3, density(), place)
    };
    let tinted = Grid {
        sigma_a_tint: one(absorbing),
        sigma_s_tint: one(scattering),
        emission_tint: one(shining),
        ..grid.clone()
    };
    let colored = Grid {
        sigma_a: grid.sigma_a * absorbing,
        sigma_s: grid.sigma_s * scattering,
        emission: grid.emission * shining,
        ..grid
    };
    for mode in [ColorMode::Rgb, ColorMode::Spectral(snell_math::SampledWavelengths::sample(0.3))] {
        let [a, b] = [&tinted, &colored].map(|grid| grid.properties(Vec3::splat(2.0), mode));
        for (a, b) in [(a.sigma_a, b.sigma_a), (a.sigma_s, b.sigma_s), (a.emission, b.emission)] {
            assert!((0..4).all(|c| (a[c] - b[c]).abs() <= 1e-5 * b[c].abs()), "{a:?} is not {b:?}");
        }
        let of = |grid: &Grid, what: u32| {
            let tracked = TrackedGrid::new(grid);
            mean(40_000, |i| {
                let travel = tracked.travel(&through(1.5), UNIT, mode, |_| 1.0, &mut numbers(i));
                match (what, travel.scattered) {
                    (0, None) => travel.throughput,
                    (1, Some(s)) => travel.throughput * s.distance,
                    (2, _) => travel.emitted,
                    (3, _) => tracked.attenuate(&through(1.5), UNIT, mode, &mut numbers(i)),
                    _ => SampledSpectrum::ZERO,
                }
            })
        };
        for what in 0..4 {
            for ((a, ea), (b, eb)) in of(&tinted, what).into_iter().zip(of(&colored, what)) {
                assert!(
                    (a - b).abs() <= 4.0 * ea.hypot(eb) + 1e-5,
                    "{what}: {a} +- {ea}, {b} +- {eb}"
                );
            }
        }
    }
}

#[test]
fn fire_without_smoke_glows() {
    let empty = ScalarGrid::new([4; 3], vec![0.0; 64]).expect("as many values as cells");
    let (glow, integral) = ramp();
    let grid = Grid {
        emission: Rgb::new(3.0, 1.0, 0.0),
        emission_scale: Some(Arc::new(glow)),
        ..Grid::new(Rgb::WHITE, Rgb::WHITE, 0.0, empty, DAffine3::IDENTITY)
    };
    let tracked = TrackedGrid::new(&grid);
    let columns = (integral(0.05 + 0.6 * 1.2) - integral(0.05)) / 0.6;
    let glow = mean(20_000, |i| {
        tracked.travel(&through(1.2), UNIT, ColorMode::Rgb, |_| 1.0, &mut numbers(i)).emitted
    });
    assert_agree(glow, [3.0 * columns, columns, 0.0]);
}

#[test]
fn gas_of_one_temperature_glows_as_a_black_body() {
    let full =
        |value: f32| ScalarGrid::new([3; 3], vec![value; 27]).expect("as many values as cells");
    let grid = Grid {
        emission: Rgb::splat(2.0),
        temperature: Some(Arc::new(full(1800.0))),
        ..Grid::new(Rgb::BLACK, Rgb::BLACK, 0.0, full(0.5), DAffine3::IDENTITY)
    };
    let tracked = TrackedGrid::new(&grid);
    let glow = mean(20_000, |i| {
        tracked.travel(&through(1.0), UNIT, ColorMode::Rgb, |_| 1.0, &mut numbers(i)).emitted
    });
    let color = crate::medium::blackbody(1800.0, ColorMode::Rgb);
    // The emission is that of twice a density of one half along a distance of one.
    assert_agree(glow, [0, 1, 2].map(|c| f64::from(color[c])));
}

#[test]
fn hostile_grids_end_soon_and_stay_finite() {
    let wild = [f32::NAN, f32::INFINITY, -1.0, 1e30, 0.0, 1e-30, 1.0, f32::MAX];
    let density = || ScalarGrid::new([2, 2, 2], wild.to_vec()).expect("eight values");
    let huge = Rgb::splat(f32::INFINITY);
    let scale = |x: f64| DAffine3::from_scale(snell_math::DVec3::splat(x));
    let maps = [1.0, 0.0, 1e-30, 1e30, f64::NAN, f64::INFINITY, -1.0].map(scale);
    for map in maps {
        for sigma in [huge, Rgb::BLACK, Rgb::new(f32::NAN, 1.0, -1.0)] {
            let plain =
                Grid { emission: huge, ..Grid::new(sigma, sigma, f32::NAN, density(), map) };
            let colors = wild.map(|x| Rgb::new(x, 1.0, -x)).to_vec();
            let tint = Arc::new(ColorGrid::new([2, 2, 2], colors).expect("eight values"));
            let tinted = Grid {
                sigma_s_tint: Some(tint.clone()),
                emission_tint: Some(tint),
                ..plain.clone()
            };
            for (grid, length) in [&plain, &tinted]
                .into_iter()
                .flat_map(|g| [0.0, 1.0, f32::INFINITY, f32::NAN].map(|length| (g, length)))
            {
                let tracked = TrackedGrid::new(grid);
                let travel = tracked.travel(
                    &through(length),
                    UNIT,
                    ColorMode::Rgb,
                    |_| 1.0,
                    &mut numbers(1),
                );
                assert!(travel.throughput.is_finite(), "{map:?} {sigma:?} {length}");
                let left =
                    tracked.attenuate(&through(length), UNIT, ColorMode::Rgb, &mut numbers(2));
                assert!(left.is_finite(), "{map:?} {sigma:?} {length}");
            }
        }
    }
}
