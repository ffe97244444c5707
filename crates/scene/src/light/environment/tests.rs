use super::*;
use snell_math::DAffine3;
use snell_math::DVec3;
use snell_math::rng::uniform2;
use snell_math::statistics::{chi_squared_deviation, sidak_deviation};
use std::f32::consts::{PI, TAU};
use std::f64::consts::PI as PI64;

fn light(
    width: u32,
    height: u32,
    rgb: impl Fn(u32, u32) -> [f32; 3],
    rotated: f64,
) -> EnvironmentLight {
    let values =
        (0..height).flat_map(|y| (0..width).flat_map(|x| rgb(x, y)).collect::<Vec<_>>()).collect();
    let world_from_environment =
        DAffine3::from_rotation_x(rotated) * DAffine3::from_rotation_y(0.4 * rotated);
    EnvironmentLight::new(&Environment::Image {
        image: Arc::new(Image::from_f32(width, height, 3, values)),
        scale: Rgb::WHITE,
        world_from_environment,
    })
}

fn gradient() -> EnvironmentLight {
    light(
        32,
        16,
        |x, y| {
            [(x % 7) as f32, if y < 3 { 5.0 } else { 0.2 }, f32::from(x == 20 && y == 5) * 900.0]
        },
        0.9,
    )
}

/// The integral over the sphere, on a fine grid in longitude and height of the world.
fn integrate(f: impl Fn(Vec3) -> f64) -> f64 {
    let (n, m) = (1200, 600);
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..m {
            let phi = (f64::from(i) + 0.5) / f64::from(n) * 2.0 * PI64;
            let z = 1.0 - 2.0 * (f64::from(j) + 0.5) / f64::from(m);
            let r = (1.0 - z * z).sqrt();
            sum += f(DVec3::new(r * phi.cos(), r * phi.sin(), z).as_vec3());
        }
    }
    sum * 4.0 * PI64 / f64::from(n * m)
}

fn red(light: &EnvironmentLight, d: Vec3) -> f64 {
    light.radiance(d, ColorMode::Rgb)[0].into()
}

#[test]
fn the_picture_is_oriented_as_documented() {
    // The columns: the left quarter is -x, the middle -z, the right quarter +x, the edges +z. Row 0
    // is the zenith.
    let l = light(64, 32, |x, y| [x as f32, y as f32, 0.0], 0.0);
    let at = |d| l.radiance(d, ColorMode::Rgb);
    assert!((at(Vec3::NEG_Z)[0] - 31.5).abs() < 1e-3 && (at(Vec3::NEG_Z)[1] - 15.5).abs() < 1e-3);
    assert!((at(Vec3::X)[0] - 47.5).abs() < 1e-3 && (at(Vec3::NEG_X)[0] - 15.5).abs() < 1e-3);
    assert_eq!((at(Vec3::Y)[1], at(Vec3::NEG_Y)[1]), (0.0, 31.0));
    // The picture continues across the seam.
    assert!((at(Vec3::Z)[0] - 31.5).abs() < 1e-3);
}

#[test]
fn the_rotation_turns_the_picture_into_the_world() {
    let world_from_environment = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let mut values = vec![0.0; 8 * 4 * 3];
    values[..24].fill(1.0);
    let image = Arc::new(Image::from_f32(8, 4, 3, values));
    let l = EnvironmentLight::new(&Environment::Image {
        image,
        scale: Rgb::splat(2.0),
        world_from_environment,
    });
    // The rotation maps +y to +z.
    assert_eq!((red(&l, Vec3::Z), red(&l, Vec3::NEG_Z)), (2.0, 0.0));
}

#[test]
fn the_density_integrates_to_one() {
    for l in [gradient(), light(5, 3, |x, _| [x as f32; 3], 0.3), light(1, 1, |_, _| [1.0; 3], 0.0)]
    {
        let integral = integrate(|d| l.pdf(d).into());
        assert!((integral - 1.0).abs() < 2e-3, "{integral}");
    }
}

#[test]
fn the_compensated_density_integrates_to_one_and_lies_where_light_exceeds_the_mean() {
    for l in [gradient(), light(64, 32, |x, _| [x as f32; 3], 0.3)] {
        let integral = integrate(|d| l.pdf_compensated(d).into());
        assert!((integral - 1.0).abs() < 3e-3, "{integral}");
        let excess = integrate(|d| {
            let luminance =
                f64::from(ColorMode::Rgb.to_rgb(l.radiance(d, ColorMode::Rgb)).luminance());
            (luminance - l.mean_luminance()).max(0.0)
        });
        assert!((excess / (4.0 * PI64) / l.mean_luminance() / l.excess() - 1.0).abs() < 0.2);
        let mut different = 0;
        for i in 0..5000 {
            let SkySample { direction: d, pdf, .. } =
                l.sample_compensated(uniform2([i, 3, 1, 2])).expect("some exceeds the mean");
            assert!(d.is_normalized() && pdf > 0.0 && pdf.is_finite());
            different += u32::from(l.pdf_compensated(d) != pdf);
        }
        assert!(different <= 5, "{different}");
    }
}

#[test]
fn an_image_of_one_colour_is_left_to_other_samples() {
    let l = light(64, 32, |_, _| [0.3, 0.5, 0.7], 0.1);
    assert!(l.excess() == 0.0 && l.sample_compensated(Vec2::splat(0.5)).is_none());
}

/// Chi-squared test for several rotated pictures with both tables: counts in coarse cells of the
/// world, against the integral of the density over each cell.
#[test]
fn samples_fall_into_cells_with_their_density() {
    let horizon =
        |rotated| light(24, 12, |x, y| [x as f32, if y < 6 { 3.0 } else { 0.1 }, 0.3], rotated);
    let lights = [
        gradient(),
        horizon(0.0),
        horizon(2.0),
        light(5, 3, |x, y| [f32::from(x == 2 && y == 1), 0.1, 0.0], 0.5),
    ];
    const COLUMNS: usize = 12;
    let cell = |d: Vec3| {
        let (x, y) = ((d.y.atan2(d.x) + PI) / TAU * COLUMNS as f32, (d.z + 1.0) * 3.0);
        (x as usize).min(COLUMNS - 1) + COLUMNS * (y as usize).min(5)
    };
    let samples = 40_000;
    for (key, l) in (0..).zip(&lights) {
        type Pdf<'a> = &'a dyn Fn(Vec3) -> f32;
        type Sample<'a> = &'a dyn Fn(Vec2) -> Option<SkySample>;
        let ways: [(Sample, Pdf); 2] = [
            (&|u| Some(l.sample(u)), &|d| l.pdf(d)),
            (&|u| l.sample_compensated(u), &|d| l.pdf_compensated(d)),
        ];
        for (way, (sample, pdf)) in (0..).zip(ways) {
            let mut expected = [0.0f64; 6 * COLUMNS];
            let (n, m) = (2400, 1200);
            for i in 0..n {
                let phi = (f64::from(i) + 0.5) / f64::from(n) * 2.0 * PI64;
                for j in 0..m {
                    let z = 1.0 - 2.0 * (f64::from(j) + 0.5) / f64::from(m);
                    let r = (1.0 - z * z).sqrt();
                    let d = DVec3::new(r * phi.cos(), r * phi.sin(), z).as_vec3();
                    expected[cell(d)] += f64::from(pdf(d)) * 4.0 * PI64 / f64::from(n * m);
                }
            }
            let total: f64 = expected.iter().sum();
            assert!((total - 1.0).abs() < 3e-3, "light {key}, table {way}: {total}");
            let mut counts = [0u32; 6 * COLUMNS];
            for i in 0..samples {
                let SkySample { direction: d, pdf, place } =
                    sample(uniform2([i, 9, way, key])).expect("light to find");
                assert!(d.is_normalized() && pdf > 0.0 && pdf.is_finite());
                // The sample's place must be that of its direction, where both sides of the image
                // are the same, and so is each pole.
                let other = l.place(d);
                let (across, sin) = ((place.x - other.x).abs(), (PI * place.y).sin());
                assert!(
                    across.min(1.0 - across) * sin < 1e-6 && (place.y - other.y).abs() < 1e-6,
                    "{place} {other}"
                );
                counts[cell(d)] += 1;
            }
            expected.iter_mut().for_each(|e| *e *= f64::from(samples) / total);
            let deviation = chi_squared_deviation(&counts, &expected);
            assert!(deviation < sidak_deviation(0.01, 8), "light {key}, table {way}: {deviation}");
        }
    }
}

#[test]
fn the_density_of_a_sample_is_that_of_its_direction() {
    let l = gradient();
    let n = 20_000;
    let mut different = 0;
    for i in 0..n {
        let SkySample { direction: d, pdf, .. } = l.sample(uniform2([i, 1, 2, 3]));
        different += u32::from(l.pdf(d) != pdf);
    }
    // Only directions on the edge of a cell may be rounded into the next cell.
    assert!(different <= n / 2000, "{different}");
}

#[test]
fn the_irradiance_estimated_by_samples_matches_quadrature() {
    let l = gradient();
    let normal = Vec3::new(0.6, 0.64, 0.48);
    let expected = integrate(|d| red(&l, d) * f64::from(d.dot(normal).max(0.0)));
    let n = 100_000;
    let values: Vec<f64> = (0..n)
        .map(|i| {
            let SkySample { direction: d, pdf, .. } = l.sample(uniform2([i, 4, 4, 4]));
            red(&l, d) * f64::from(d.dot(normal).max(0.0)) / f64::from(pdf)
        })
        .collect();
    let mean = values.iter().sum::<f64>() / f64::from(n);
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n);
    let error = (variance / f64::from(n)).sqrt();
    assert!(
        (mean - expected).abs() < 3.0 * error + 1e-3 * expected,
        "{mean} +- {error}, expected {expected}"
    );
}

#[test]
fn light_anywhere_has_positive_density_even_beside_a_sun() {
    let l = light(
        512,
        256,
        |x, y| [if (x, y) == (100, 40) { 1e7 } else { f32::from(y < 200) * 0.05 }; 3],
        0.0,
    );
    for i in 0..20_000 {
        let d = sampling::uniform_sphere(uniform2([i, 0, 0, 1]));
        assert!(red(&l, d) == 0.0 || l.pdf(d) > 0.0, "{d}");
    }
    let quadrature = integrate(|d| red(&l, d)) / (4.0 * PI64);
    assert!(
        (l.mean_luminance() / quadrature - 1.0).abs() < 0.2,
        "{} {quadrature}",
        l.mean_luminance()
    );
}

#[test]
fn the_mean_luminance_is_the_mean_over_the_sphere() {
    let l = light(64, 32, |x, y| [x as f32 * 0.1, y as f32, 0.5], 0.7);
    let expected = integrate(|d| {
        let s = l.radiance(d, ColorMode::Rgb);
        ColorMode::Rgb.to_rgb(s).luminance().into()
    }) / (4.0 * PI64);
    assert!(
        (l.mean_luminance() / expected - 1.0).abs() < 2e-3,
        "{} {expected}",
        l.mean_luminance()
    );
}

#[test]
fn broken_pixels_and_black_pictures_do_no_harm() {
    let broken = light(
        8,
        4,
        |x, y| [[f32::NAN, f32::INFINITY, -1.0, 1.0][(x % 4) as usize], y as f32, f32::MAX],
        0.0,
    );
    let black = light(4, 2, |_, _| [0.0; 3], 0.0);
    for l in [broken, black] {
        assert!(l.mean_luminance().is_finite() && l.mean_luminance() >= 0.0);
        for i in 0..2000 {
            let SkySample { direction: d, pdf, .. } = l.sample(uniform2([i, 0, 7, 0]));
            assert!(
                d.is_normalized()
                    && pdf.is_finite()
                    && pdf > 0.0
                    && l.radiance(d, ColorMode::Rgb).is_finite()
            );
        }
    }
    let l = gradient();
    for d in [Vec3::Y, Vec3::NEG_Y, Vec3::ZERO, Vec3::splat(f32::NAN)] {
        assert!(l.pdf(d).is_finite() && l.radiance(d, ColorMode::Rgb).is_finite());
    }
}

#[test]
fn a_table_smaller_than_the_image_still_covers_all_light() {
    let one = Table((0..7 * 5).map(|i| f32::from(i == 17)).collect());
    assert!(Cells::in_table(one, [7, 5], [4, 3]).means.iter().any(|&mean| mean > 0.0));
    assert_eq!(Cells::in_table(Table(vec![3.0; 35]), [7, 5], [4, 3]).means[11], 3.0);
}

/// An image of seven numbers per row.
struct Table(Vec<f32>);

impl Rows for Table {
    fn row(&mut self, y: usize) -> Vec<f32> {
        self.0[y * 7..][..7].to_vec()
    }
}

#[test]
fn luminance_is_smoothed_row_by_row_as_it_is_all_at_once() {
    let grey: Vec<f32> = (0..35).map(|i| uniform2([i, 1, 2, 3]).x).collect();
    let texels: Vec<Rgb> = grey.iter().map(|&v| Rgb::splat(v)).collect();
    let plain: Vec<f32> = texels.iter().map(|t| t.luminance()).collect();
    let across = |x: usize, y: usize| {
        filter(plain[y * 7 + (x + 6) % 7], plain[y * 7 + x], plain[y * 7 + (x + 1) % 7])
    };
    let mut rows = Smoothed::of(&texels, 7);
    for y in [0usize, 1, 1, 2, 3, 2, 4, 4, 0] {
        let expected = (0..7).map(|x| {
            filter(across(x, y.saturating_sub(1)), across(x, y), across(x, (y + 1).min(4)))
        });
        assert_eq!(rows.row(y), expected.collect::<Vec<_>>());
    }
}

#[test]
fn a_constant_environment_is_the_same_everywhere() {
    let l = EnvironmentLight::new(&Environment::Constant(Rgb::new(1.0, 2.0, 3.0)));
    assert!(l.excess() == 0.0 && l.sample_compensated(Vec2::splat(0.5)).is_none());
    assert_eq!(l.pdf_compensated(Vec3::X), 0.0);
    assert_eq!(l.radiance(Vec3::X, ColorMode::Rgb).0, [1.0, 2.0, 3.0, 0.0]);
    assert_eq!(l.pdf(Vec3::X), sampling::UNIFORM_SPHERE_PDF);
    assert!((l.mean_luminance() - 1.8596).abs() < 1e-4);
}
