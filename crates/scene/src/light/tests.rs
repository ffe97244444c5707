use super::*;
use snell_math::rng::uniform2;
use std::f64::consts::{PI, TAU};

fn sample(light: &Light, p: Vec3, u: Vec2) -> Option<LightSample> {
    light.sample(p, u, ColorMode::Rgb)
}

/// Irradiance at `p` on a surface with this normal: the mean over random samples, and its standard
/// error.
fn irradiance(light: &Light, p: Vec3, normal: Vec3, n: u32) -> (f64, f64) {
    let values: Vec<f64> = (0..n)
        .map(|i| {
            sample(light, p, uniform2([i, 11, 12, 13])).map_or(0.0, |s| {
                f64::from(s.radiance[0] / s.pdf * s.direction.dot(normal).max(0.0))
            })
        })
        .collect();
    let mean = values.iter().sum::<f64>() / f64::from(n);
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n - 1);
    (mean, (variance / f64::from(n)).sqrt())
}

/// The average of `2 cos(light) cos(receiver) / d^2` over a flat source, by the midpoint rule.
/// `point` maps the unit square to the source, uniformly by area.
fn quadrature(
    point: impl Fn(f64, f64) -> DVec3,
    light_normal: DVec3,
    p: DVec3,
    normal: DVec3,
) -> f64 {
    let n = 400;
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let to_light = point((i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64) - p;
            let direction = to_light.normalize();
            sum += 2.0 * (-direction.dot(light_normal)).max(0.0) * direction.dot(normal).max(0.0)
                / to_light.length_squared();
        }
    }
    sum / f64::from(n * n)
}

#[test]
fn examples_give_sane_samples_power_and_names_and_survive_json() {
    for light in Light::examples() {
        for i in 0..200 {
            let u = uniform2([i, 1, 1, 1]);
            let p = (Vec3::new(u.x, u.y, 0.3) - 0.5) * 8.0;
            let Some(s) = sample(&light, p, u) else { continue };
            assert!(
                s.direction.is_normalized() && s.distance > 0.0 && s.pdf > 0.0,
                "{light:?} {s:?}"
            );
            assert!(
                s.radiance.is_finite() && s.radiance.0.iter().all(|&x| x >= 0.0),
                "{light:?} {s:?}"
            );
        }
        for radius in [0.0, 1e-6, 1.0, 1e300, f64::INFINITY, f64::NAN] {
            let power = light.power(radius);
            assert!(power.is_finite() && power >= 0.0, "{light:?} {radius} {power}");
        }
        let json = serde_json::to_value(&light).expect("lights serialise");
        assert_eq!(json["light"], light.name());
        assert_eq!(serde_json::from_value::<Light>(json).expect("lights come back"), light);
    }
    for &name in Light::NAMES {
        assert!(Light::examples().iter().any(|l| l.name() == name), "{name} has no example");
    }
}

#[test]
fn every_light_shines_somewhere_and_only_inside_of_its_cone() {
    for light in Light::examples() {
        let mut is_lit = false;
        for i in 0..2000 {
            let u = uniform2([i, 1, 1, 2]);
            let p = (Vec3::new(u.x, u.y, uniform2([i, 1, 1, 3]).x) - 0.5) * 12.0;
            let arrives = sample(&light, p, u).is_some();
            is_lit |= arrives;
            if let Some((position, (axis, angle))) = light.position().zip(light.cone()) {
                let off_axis = (p.as_dvec3() - position).angle_between(axis);
                assert!(!arrives || off_axis <= angle + 1e-6, "{light:?} {p}");
            }
        }
        assert!(is_lit, "{light:?}");
    }
}

#[test]
fn a_light_that_is_moved_and_dimmed_lights_a_moved_point_alike() {
    let turn = DAffine3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
    let by = DAffine3::from_translation(DVec3::new(1.0, -2.0, 0.5)) * turn;
    for light in Light::examples() {
        let mut moved = light.moved(&by);
        *moved.color_mut() = light.color() * 0.5;
        assert_eq!(moved.position(), light.position().map(|p| by.transform_point3(p)), "{light:?}");
        for i in 0..500 {
            let u = uniform2([i, 1, 1, 4]);
            let p = (Vec3::new(u.x, 0.5, u.y) - 0.5) * 4.0;
            // A disk's axes are chosen arbitrarily and do not turn with the disk, so only its
            // middle can be compared.
            let Some(there) = sample(&light, p, Vec2::splat(0.5)) else { continue };
            let to = by.transform_point3(p.as_dvec3()).as_vec3();
            let here = sample(&moved, to, Vec2::splat(0.5)).expect("the moved point is lit");
            let (found, expected) =
                (here.radiance.max_element(), 0.5 * there.radiance.max_element());
            assert!(
                (found - expected).abs() < 2e-3 * expected,
                "{light:?} {p}: {found} {expected}"
            );
            let turned = by.transform_vector3(there.direction.as_dvec3()).as_vec3();
            assert!((here.direction - turned).length() < 1e-4, "{light:?} {p}");
        }
    }
}

/// The light with its directions and matrices this many times as long.
fn stretched(light: &Light, factor: f64) -> Light {
    fn stretch(value: &mut serde_json::Value, factor: f64) {
        if let Some(items) = value.as_array_mut() {
            items.iter_mut().for_each(|item| stretch(item, factor));
        } else if let Some(x) = value.as_f64() {
            *value = (x * factor).into();
        }
    }
    let mut json = serde_json::to_value(light).expect("lights serialise");
    for name in light.directions().chain(["world_from_light"]) {
        if let Some(value) = json.get_mut(name) {
            stretch(value, factor);
        }
    }
    serde_json::from_value(json).expect("a light of other lengths")
}

#[test]
fn the_length_of_a_direction_has_no_meaning() {
    for light in Light::examples() {
        for factor in [5.0, 1e-3] {
            let other = stretched(&light, factor);
            assert_eq!(other.lost_direction(), None);
            for i in 0..200 {
                let u = uniform2([i, 1, 1, 5]);
                let p = (Vec3::new(u.x, u.y, 0.3) - 0.5) * 8.0;
                let [a, b] = [&light, &other].map(|light| sample(light, p, Vec2::splat(0.5)));
                assert_eq!(a.is_some(), b.is_some(), "{light:?} {p}");
                let Some((a, b)) = a.zip(b) else { continue };
                let (found, expected) = (b.radiance[0], a.radiance[0]);
                assert!((found - expected).abs() <= 1e-4 * expected, "{light:?} {p}: {found}");
                assert!((a.direction - b.direction).length() < 1e-5, "{light:?} {p}");
            }
            assert!((other.power(3.0) / light.power(3.0) - 1.0).abs() < 1e-6, "{light:?}");
            let axes = [&light, &other].map(|light| light.bounds().map(|bounds| bounds.axis));
            let apart = axes[0].zip(axes[1]).map_or(0.0, |(a, b)| (a - b).length());
            assert!(apart < 1e-5, "{light:?}: {axes:?}");
        }
        if light.directions().next().is_some() {
            let lost = stretched(&light, 0.0);
            let flaw = lost.lost_direction().expect("a zero vector is a flaw");
            assert!(flaw.contains("expected a direction, not all zeros"), "{flaw}");
            assert_eq!(sample(&lost, Vec3::ZERO, Vec2::splat(0.5)), None, "{lost:?}");
        }
    }
}

#[test]
fn a_point_light_follows_the_inverse_square() {
    let light = &Light::examples()[1];
    let s =
        sample(light, Vec3::new(0.5, 1.0, 1.0), Vec2::ZERO).expect("the light shines everywhere");
    assert_eq!((s.distance, s.direction, s.radiance[0]), (2.0, Vec3::Y, 2.5));
    assert!((light.power(5.0) - 40.0 * PI).abs() < 1e-4);
}

#[test]
fn a_shadow_ray_to_a_lamp_with_a_body_ends_where_it_first_meets_the_body() {
    let intensity = Rgb::WHITE;
    let light = Point {
        position: DVec3::ZERO,
        intensity,
        attenuation: Attenuation::NONE,
        body_radius: 2.0,
    }
    .into();
    let distance = |x: f32| sample(&light, Vec3::new(x, 0.0, 0.0), Vec2::ZERO).map(|s| s.distance);
    assert_eq!(distance(5.0), Some(3.0));
    assert_eq!(distance(-1.5), Some(3.5));
    // On the body itself, within rounding, the far side counts.
    assert_eq!(distance(2.0), Some(4.0));
    assert!((distance(2.0f32.next_up()).expect("lit") - 4.0).abs() < 1e-6);
    assert_eq!(distance(0.0), None);
}

#[test]
fn a_spot_light_is_full_on_its_axis_and_dark_outside() {
    for light in &Light::examples()[3..6] {
        let on_axis = sample(light, Vec3::new(0.5, 1.0, 1.0), Vec2::ZERO).expect("the axis is lit");
        assert_eq!(on_axis.radiance[0], 2.5);
        assert_eq!(sample(light, Vec3::new(4.5, 1.0, 1.0), Vec2::ZERO), None);
        assert_eq!(sample(light, Vec3::new(0.5, 5.0, 1.0), Vec2::ZERO), None);
    }
}

#[test]
fn the_irradiance_under_a_disk_matches_quadrature() {
    let (position, direction, radius) =
        (DVec3::new(0.0, 2.0, 0.0), DVec3::new(0.6, -0.8, 0.0), 1.0);
    let attenuation = Attenuation::INVERSE_SQUARE;
    let light = Disk { position, direction, radius, emission: Rgb::WHITE, attenuation }.into();
    let (a, b) = direction.any_orthonormal_pair();
    let point = |u: f64, v: f64| {
        let (s, c) = (TAU * v).sin_cos();
        position + (a * c + b * s) * (u.sqrt() * radius)
    };
    for p in [DVec3::ZERO, DVec3::new(1.5, 0.0, 0.7), DVec3::new(0.9, 1.0, 0.0)] {
        let expected = quadrature(point, direction, p, DVec3::Y);
        let (mean, error) = irradiance(&light, p.as_vec3(), Vec3::Y, 40_000);
        assert!(
            (mean - expected).abs() < 3.0 * error + 1e-4 * expected,
            "{p}: {mean} +- {error}, expected {expected}"
        );
    }
}

#[test]
fn the_irradiance_under_a_rectangle_matches_quadrature() {
    let center = DVec3::new(0.0, 1.0, 0.0);
    let (axes, lengths) = ([DVec3::Z, DVec3::X], [3.0, 1.0]);
    let attenuation = Attenuation::INVERSE_SQUARE;
    let light = Rectangle { center, axes, lengths, emission: Rgb::WHITE, attenuation }.into();
    let point = |u: f64, v: f64| {
        center + axes[0] * ((u - 0.5) * lengths[0]) + axes[1] * ((v - 0.5) * lengths[1])
    };
    // z cross x is +y, so this panel shines upwards and only points above it receive light.
    assert_eq!(sample(&light, Vec3::ZERO, Vec2::splat(0.3)), None);
    for p in [DVec3::new(0.0, 2.0, 0.0), DVec3::new(1.0, 3.0, -2.0)] {
        let expected = quadrature(point, DVec3::Y, p, DVec3::NEG_Y);
        let (mean, error) = irradiance(&light, p.as_vec3(), Vec3::NEG_Y, 40_000);
        assert!(
            (mean - expected).abs() < 3.0 * error + 1e-4 * expected,
            "{p}: {mean} +- {error}, expected {expected}"
        );
    }
}

#[test]
fn a_far_disk_is_twice_a_point_light_along_its_normal() {
    let attenuation = Attenuation::INVERSE_SQUARE;
    let disk = Disk {
        position: DVec3::ZERO,
        direction: DVec3::NEG_Y,
        radius: 1e-3,
        emission: Rgb::WHITE,
        attenuation,
    }
    .into();
    let s = sample(&disk, Vec3::new(0.0, -10.0, 0.0), Vec2::splat(0.25)).expect("below the disk");
    assert!((s.radiance[0] - 0.02).abs() < 1e-6);
    assert!((disk.power(3.0) - TAU).abs() < 1e-5);
}

#[test]
fn broken_lights_give_nothing_instead_of_nan() {
    let nan = DVec3::splat(f64::NAN);
    let (intensity, attenuation) = (Rgb::splat(f32::NAN), Attenuation([f32::NAN; 3]));
    let lights = [
        Directional { direction: nan, irradiance: Rgb::WHITE }.into(),
        Point { position: nan, intensity: Rgb::WHITE, attenuation, body_radius: f64::NAN }.into(),
        Point { position: DVec3::Y, intensity, attenuation, body_radius: 0.0 }.into(),
        Disk {
            position: DVec3::Y,
            direction: nan,
            radius: f64::NAN,
            emission: Rgb::WHITE,
            attenuation,
        }
        .into(),
    ];
    for light in lights {
        assert_eq!(sample(&light, Vec3::ZERO, Vec2::splat(0.5)), None, "{light:?}");
        assert!(light.power(1.0) >= 0.0);
    }
}
