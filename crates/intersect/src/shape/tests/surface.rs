//! Bounds, areas, samples, texture coordinates and derivatives of every example.

use super::oracle;
use super::rays::{Numbers, features};
use crate::shape::{AnyShape, Shape, ShapeError, Sphere};
use snell_math::{DRay, DVec3};

const SAMPLES: u32 = 20_000;

fn bounded() -> impl Iterator<Item = (u32, AnyShape)> {
    (0..).zip(AnyShape::examples().into_iter().filter(|s| s.area().is_finite()))
}

#[test]
fn samples_lie_on_the_surface_and_in_the_bounds() {
    for (e, shape) in bounded() {
        let b = shape.bounds();
        let blur = 1e-14 * (b.radius() + b.center().length());
        for i in 0..SAMPLES {
            let sample = shape.sample(Numbers::new(e, i).square()).expect("finite area");
            let p = sample.position;
            assert!(
                p.cmpge(b.min - blur).all() && p.cmple(b.max + blur).all(),
                "{shape:?} {sample:?}"
            );
            assert!(
                oracle::outside(&shape, p).is_none_or(|d| d.abs() <= 4.0 * blur),
                "{shape:?} {sample:?}"
            );
            let surface = shape.surface(p, sample.face);
            assert!(surface.position.distance(p) <= 4.0 * blur, "{shape:?} {sample:?} {surface:?}");
            assert!(
                surface.normal.dot(sample.normal) > 0.999_999,
                "{shape:?} {sample:?} {surface:?}"
            );
        }
        for u in [0.0, 1.0_f64.next_down()] {
            for v in [0.0, 0.5, 1.0_f64.next_down()] {
                let sample = shape.sample((u, v).into()).expect("finite area");
                assert!(
                    sample.position.is_finite() && sample.normal.is_normalized(),
                    "{shape:?} {sample:?}"
                );
            }
        }
    }
}

#[test]
fn bounds_are_tight() {
    for (e, shape) in bounded() {
        let b = shape.bounds();
        let samples = (0..SAMPLES)
            .filter_map(|i| shape.sample(Numbers::new(e, i).square()))
            .map(|s| s.position);
        let found = snell_math::Bounds3d::of(samples.chain(features(&shape)));
        let slack = 0.02 * b.size() + 1e-15 * b.radius();
        assert!(
            (found.min - b.min).cmple(slack).all() && (b.max - found.max).cmple(slack).all(),
            "{shape:?}"
        );
    }
}

#[test]
fn normals_are_unit_outward_and_perpendicular_to_the_derivatives() {
    for (e, shape) in (0u32..).zip(AnyShape::examples()) {
        let features = features(&shape);
        for i in 0..SAMPLES {
            let mut numbers = Numbers::new(e, i);
            let face = numbers.below(6) as u32;
            let p = super::rays::surface_point(&shape, &mut numbers).0;
            // On any face, and also at corners, rims and poles.
            let at = if i % 8 == 0 { features[i as usize % features.len()] } else { p };
            let s = shape.surface(at, face);
            assert!((s.normal.length() - 1.0).abs() < 1e-14, "{shape:?} {s:?}");
            assert_eq!(shape.normal(at, face), (s.position, s.normal), "{shape:?}");
            for d in [s.dpdu, s.dpdv] {
                assert!(d.is_finite() && d != DVec3::ZERO, "{shape:?} {s:?}");
                assert!(d.normalize().dot(s.normal).abs() < 1e-12, "{shape:?} {s:?}");
            }
            assert!(
                s.dpdu.normalize().cross(s.dpdv.normalize()).length() > 1e-6,
                "{shape:?} {s:?}"
            );
            let unlimited = matches!(shape, AnyShape::Plane(_));
            assert!(
                unlimited || (s.uv.min_element() >= 0.0 && s.uv.max_element() <= 1.0),
                "{shape:?} {s:?}"
            );
        }
        for (p, n) in (0..1000).map(|i| super::rays::surface_point(&shape, &mut Numbers::new(e, i)))
        {
            let step = 1e-9 * shape.bounds().radius();
            if let (Some(out), Some(inside)) =
                (oracle::outside(&shape, p + n * step), oracle::outside(&shape, p - n * step))
            {
                assert!(out > 0.0 && inside < 0.0, "{shape:?} {p} {n}");
            }
        }
    }
}

#[test]
fn derivatives_match_finite_differences() {
    for (e, shape) in (0u32..).zip(AnyShape::examples()) {
        let mut compared = 0;
        for i in 0..2000 {
            let mut numbers = Numbers::new(e, i);
            let u = numbers.square();
            let Some(sample) = shape.sample(u) else { continue };
            let s = shape.surface(sample.position, sample.face);
            for d in [s.dpdu, s.dpdv] {
                let step = 1e-6;
                let moved = shape.surface(s.position + d * step, sample.face);
                let duv = moved.uv - s.uv;
                let predicted = s.dpdu * duv.x + s.dpdv * duv.y;
                // The step must not cross the seam of the longitude or the edge of the face.
                let stayed = moved.position.distance(s.position) > 0.9 * d.length() * step;
                if duv.abs().max_element() < 0.5 && stayed {
                    let off = (moved.position - s.position - predicted).length();
                    assert!(
                        off <= 1e-4 * d.length() * step + 1e-15 * s.position.length(),
                        "{shape:?} {s:?} {moved:?}"
                    );
                    compared += 1;
                }
            }
        }
        assert!(compared > 2000 || shape.area().is_infinite(), "{shape:?} {compared}");
    }
}

/// Uniformly distributed lines intersect every part of a surface in proportion to its area
/// (Crofton, 1868; Santaló, Integral Geometry and Geometric Probability, 1976). `visit` gets a ray
/// and the area of the window in which it was sampled.
fn uniform_lines(stream: u32, shape: &AnyShape, count: u32, mut visit: impl FnMut(&DRay, f64)) {
    let b = shape.bounds();
    let half = b.size() * 0.5;
    let longest = DVec3::AXES[half.max_position()];
    for i in 0..count {
        let mut numbers = Numbers::new(stream, i);
        let d = numbers.direction();
        // The window is perpendicular to the direction, with one axis along the longest side of the
        // bounds.
        let x = (longest - d * d.dot(longest)).normalize();
        let y = d.cross(x);
        let extent = |axis: DVec3| axis.abs().dot(half);
        let offset =
            x * extent(x) * numbers.between(-1.0, 1.0) + y * extent(y) * numbers.between(-1.0, 1.0);
        let mut ray = DRay::new(b.center() + offset, d);
        ray.t_min = f64::NEG_INFINITY;
        visit(&ray, 4.0 * extent(x) * extent(y));
    }
}

#[test]
fn areas_are_what_random_lines_measure_and_samples_are_spread_like_their_hits() {
    const LINES: u32 = 100_000;
    for (e, shape) in bounded() {
        let (mut sum, mut sum2) = (0.0, 0.0);
        let mut weighted: Vec<(f64, [f64; 9])> = Vec::new();
        let mut hits = Vec::new();
        uniform_lines(1000 + e, &shape, LINES, |ray, window| {
            hits.clear();
            shape.all(ray, &mut hits);
            let estimate = 2.0 * window * hits.len() as f64;
            sum += estimate;
            sum2 += estimate * estimate;
            weighted.extend(hits.iter().map(|h| {
                let s = shape.surface(ray.at(h.t), h.face);
                (window, traits(s.position - shape.bounds().center(), s.normal))
            }));
        });
        let n = f64::from(LINES);
        let mean = sum / n;
        let deviation = ((sum2 / n - mean * mean) / n).sqrt();
        let area = shape.area();
        assert!(
            (mean - area).abs() < 4.5 * deviation,
            "{shape:?}: area {area}, lines say {mean} +- {deviation}"
        );
        assert!(deviation < 0.05 * area, "{shape:?}: {deviation} of {area} says little");

        let samples: Vec<[f64; 9]> = (0..100_000)
            .filter_map(|i| shape.sample(Numbers::new(2000 + e, i).square()))
            .map(|s| traits(s.position - shape.bounds().center(), s.normal))
            .collect();
        for k in 0..9 {
            let (m0, v0) = moments(samples.iter().map(|t| (1.0, t[k])));
            let (m1, v1) = moments(weighted.iter().map(|(w, t)| (*w, t[k])));
            let allowed = 5.0 * (v0 + v1).sqrt() + 1e-9 * m0.abs();
            assert!(
                (m0 - m1).abs() <= allowed,
                "{shape:?}: trait {k} is {m0} of samples, {m1} of hits, allowed {allowed}"
            );
        }
    }
}

/// Statistics whose means distinguish distributions on a surface.
fn traits(p: DVec3, n: DVec3) -> [f64; 9] {
    [p.x, p.y, p.z, p.x * p.x, p.y * p.y, p.z * p.z, n.x.abs(), n.y.abs(), n.z]
}

/// Weighted mean, and the variance of that mean.
fn moments(values: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let total: f64 = values.clone().map(|(w, _)| w).sum();
    let mean = values.clone().map(|(w, x)| w * x).sum::<f64>() / total;
    let spread: f64 = values.map(|(w, x)| (w * (x - mean)).powi(2)).sum();
    (mean, spread / (total * total))
}

#[test]
fn examples_are_valid_and_survive_being_stored() {
    let names: Vec<_> = AnyShape::examples().iter().map(AnyShape::name).collect();
    assert!(AnyShape::NAMES.iter().all(|n| names.contains(n)));
    for shape in AnyShape::examples() {
        assert_eq!(shape.validate(), Ok(()), "{shape:?}");
        let text = serde_json::to_string(&shape).expect("finite numbers");
        assert!(text.contains(&format!(r#""shape":"{}""#, shape.name())), "{text}");
        assert_eq!(serde_json::from_str::<AnyShape>(&text).expect("what was written"), shape);
    }
    let cylinder = r#"{"shape":"cylinder","radius":1,"height":2}"#;
    assert!(serde_json::from_str::<AnyShape>(cylinder).expect("caps default").is_closed());
    let line = r#"{"shape":"polygon","vertices":[[0,0,0],[1,0,0],[2,0,0]]}"#;
    let error = serde_json::from_str::<AnyShape>(line).expect_err("no area").to_string();
    assert!(error.contains("no area"), "{error}");
}

#[test]
fn senseless_parameters_are_named() {
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error: ShapeError = Sphere { radius }.validate().expect_err("not a radius");
        assert_eq!(
            error.to_string(),
            format!("sphere: radius is {radius}, expected a positive number")
        );
        let ray = DRay::new(DVec3::new(0.3, 0.2, -3.0), DVec3::Z);
        assert!(Sphere { radius }.closest(&ray).is_none_or(|hit| hit.t.is_finite()));
    }
}
