//! Tests the nearest point of every example against points sampled all over its surface.

use super::oracle;
use super::rays::{Numbers, features, surface_point};
use crate::shape::{AnyShape, Metric, Shape};
use snell_math::{DMat3, DVec3};

/// Metrics of the identity, and of maps that rotate and scale, stretch, shear and flatten.
fn metrics(numbers: &mut Numbers) -> Vec<Metric> {
    let turn = DMat3::from_axis_angle(numbers.direction(), numbers.between(0.0, 6.0));
    let stretch = DMat3::from_diagonal(DVec3::new(1.0, 3.0, 0.4));
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.7, 1.0, 0.0), DVec3::new(-0.4, 2.0, 0.5));
    let flat = DMat3::from_diagonal(DVec3::new(1.0, 0.01, 1.0));
    [DMat3::IDENTITY, turn * 2.0, turn * stretch, shear, flat * turn, turn * flat]
        .map(Metric::new)
        .to_vec()
}

#[test]
fn no_point_of_the_surface_is_nearer_and_the_nearest_lies_on_the_face() {
    for (e, shape) in (0u32..).zip(AnyShape::examples()) {
        // Open shapes have one face: no caps.
        let on_face = |p: DVec3| if shape.is_closed() { p } else { shape.surface(p, 0).position };
        let features: Vec<DVec3> = features(&shape).into_iter().map(on_face).collect();
        let surface: Vec<DVec3> = (0..3000)
            .map(|i| surface_point(&shape, &mut Numbers::new(e, i)).0)
            .chain(features.iter().copied())
            .collect();
        let b = shape.bounds();
        let (center, size) =
            if b.is_finite() { (b.center(), b.size().max_element()) } else { (DVec3::ZERO, 4.0) };
        for i in 0..60 {
            let mut numbers = Numbers::new(1000 + e, i);
            let reach = size * 10.0_f64.powf(numbers.between(-2.0, 2.0));
            let point = match i % 4 {
                0 => center,
                1 => features[numbers.below(features.len())] + numbers.direction() * (reach * 0.01),
                _ => center + numbers.direction() * reach,
            };
            for metric in metrics(&mut numbers) {
                let found = shape.nearest_point(point, &metric).expect("a point");
                let p = found.position;
                let blur = 1e-12 * (size + point.length() + center.length());
                assert!(
                    shape.surface(p, found.face).position.distance(p) <= blur,
                    "{shape:?} {point} {found:?}"
                );
                assert!(
                    oracle::outside(&shape, p).is_none_or(|d| d.abs() <= blur),
                    "{shape:?} {point} {found:?}"
                );
                let squared = metric.length_squared(p - point);
                let least = surface
                    .iter()
                    .map(|&s| metric.length_squared(s - point))
                    .fold(f64::INFINITY, f64::min);
                assert!(
                    squared.sqrt() <= least.sqrt() + blur,
                    "{shape:?} {metric:?} {point} {found:?}: {squared} {least}"
                );
            }
        }
    }
}

#[test]
fn axis_weights_are_a_lower_bound_and_exact_for_scales_along_the_axes() {
    let mut numbers = Numbers::new(5, 5);
    for metric in metrics(&mut numbers) {
        let weights = metric.axis_weights();
        assert!(weights.min_element() > 0.0, "{metric:?}");
        for _ in 0..1000 {
            let v = numbers.direction();
            assert!(weights.dot(v * v) <= metric.length_squared(v), "{metric:?} {v}");
        }
    }
    let turn = DMat3::from_axis_angle(numbers.direction(), 2.0);
    let weights =
        Metric::new(turn * DMat3::from_diagonal(DVec3::new(1.0, 3.0, 0.4))).axis_weights();
    assert!((weights - DVec3::new(1.0, 9.0, 0.16)).abs().max_element() < 1e-8, "{weights}");
}

#[test]
fn points_that_are_not_finite_have_no_nearest_point() {
    for shape in AnyShape::examples() {
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(
                shape.nearest_point(DVec3::new(0.0, bad, 0.0), &Metric::EUCLIDEAN),
                None,
                "{shape:?}"
            );
        }
    }
}
