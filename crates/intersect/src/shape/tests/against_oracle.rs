//! Tests of hits against the oracle, of closed shapes that must not leak, and of rays that must not
//! hit the surface they leave.

use super::oracle;
use super::oracle::Verdict;
use super::rays;
use super::rays::Numbers;
use crate::shape::{AnyShape, Shape, ShapeHit, box_shape, polygon, sphere, triangle};
use rayon::prelude::*;
use snell_math::{DRay, DVec3, robust};

fn rays_per_example() -> u32 {
    std::env::var("SNELL_ORACLE_RAYS").ok().and_then(|n| n.parse().ok()).unwrap_or(100_000)
}

/// Runs `check` on every example [`rays_per_example`] times, each time with its own random numbers,
/// and panics with the first error.
fn for_each_ray(check: impl Fn(&AnyShape, &[DVec3], &mut Numbers) -> Result<(), String> + Sync) {
    for (shape, stream) in AnyShape::examples().iter().zip(0..) {
        let features = rays::features(shape);
        let complaints = (0..rays_per_example()).into_par_iter().filter_map(|i| {
            check(shape, &features, &mut Numbers::new(stream, i)).err().map(|error| (i, error))
        });
        let bad = complaints.collect::<Vec<_>>();
        if let Some((i, error)) = bad.first() {
            panic!("{shape:?}: {} of {} rays; number {i}: {error}", bad.len(), rays_per_example());
        }
    }
}

/// Returns an error with this text unless `fact` holds.
fn ensure(fact: bool, complaint: impl FnOnce() -> String) -> Result<(), String> {
    if fact { Ok(()) } else { Err(complaint()) }
}

/// The additional error of rounding near the axis of a cone: the quadratic there holds only the
/// square of a small radius, so that a relative rounding error of `1e-15` moves the radius by up to
/// its square root.
fn apex_blur(shape: &AnyShape, ray: &DRay, p: DVec3) -> f64 {
    let scale = oracle::scale(shape, ray);
    match shape {
        AnyShape::Cone(_) | AnyShape::Frustum(_) => {
            (1e-15 * scale * scale / p.x.hypot(p.z)).min(3e-8 * scale)
        }
        _ => 0.0,
    }
}

/// Returns an error if the results of the shape and of the oracle differ by more than rounding.
fn compare(shape: &AnyShape, ray: &DRay) -> Result<(), String> {
    let mut hits = Vec::new();
    shape.all(ray, &mut hits);
    if shape.closest(ray) != hits.first().copied() || shape.any(ray) == hits.is_empty() {
        return Err(format!(
            "closest {:?} and any {} differ from all",
            shape.closest(ray),
            shape.any(ray)
        ));
    }
    if !hits.is_sorted_by(|a, b| a.t <= b.t) || hits.iter().any(|h| !ray.contains(h.t)) {
        return Err("all is unordered or leaves the interval".into());
    }
    let length = ray.direction.length();
    let blur = 100.0 * oracle::tolerance(shape, ray);
    for hit in &hits {
        let p = ray.at(hit.t);
        let surface = shape.surface(p, hit.face);
        let off = surface.position.distance(p);
        // Rounding may carry a ray that is nearly edge on past the outline of a flat shape.
        let cos = (ray.direction / length).dot(surface.normal).abs().max(1e-7);
        let slide = if oracle::outside(shape, p).is_none() { 0.1 * blur / cos } else { 0.0 };
        if off > blur + slide + apex_blur(shape, ray, p) {
            return Err(format!("{hit:?} lies {off} off its face, allowed {blur}"));
        }
    }
    let Verdict::Crossings(expected) = oracle::crossings(shape, ray) else { return Ok(()) };
    // True for the same crossing: the points are close in space, or everything between them lies on
    // the surface (a grazing line).
    let same = |s: f64, hit: &ShapeHit| {
        let found = hit.t * length;
        let middle = ray.origin + ray.direction / length * (0.5 * (s + found));
        let between = oracle::outside(shape, middle).map_or(f64::INFINITY, f64::abs);
        let cos = (ray.direction / length).dot(shape.surface(ray.at(hit.t), hit.face).normal).abs();
        let blur = blur + apex_blur(shape, ray, ray.at(hit.t));
        (s - found).abs() <= blur / cos.max(1e-7) || between <= blur
    };
    if let Some(missed) =
        expected.iter().find(|c| !c.doubtful && !hits.iter().any(|h| same(c.s, h)))
    {
        return Err(format!("missed {missed:?}"));
    }
    if let Some(extra) = hits.iter().find(|h| !expected.iter().any(|c| same(c.s, h))) {
        return Err(format!("{extra:?} is not there"));
    }
    let certain = expected.iter().filter(|c| !c.doubtful).count();
    if hits.len() < certain || hits.len() > expected.len() {
        return Err(format!("{} hits", hits.len()));
    }
    Ok(())
}

#[test]
fn all_shapes_agree_with_the_oracle() {
    for_each_ray(|shape, features, numbers| {
        let ray = rays::ray(shape, features, numbers);
        if ray.direction == DVec3::ZERO {
            return ensure(shape.closest(&ray).is_none(), || {
                format!("hit without direction: {ray:?}")
            });
        }
        compare(shape, &ray).map_err(|error| {
            let mut hits = Vec::new();
            shape.all(&ray, &mut hits);
            format!("{ray:?}\n{error}\nhits {hits:?}\noracle {:?}", oracle::crossings(shape, &ray))
        })
    });
}

#[test]
fn a_ray_from_inside_a_closed_shape_leaves_it_exactly_once() {
    for_each_ray(|shape, features, numbers| {
        // All closed shapes that the oracle knows are convex.
        if !shape.is_closed() || !oracle::knows(shape) {
            return Ok(());
        }
        let (p, _) = rays::surface_point(shape, numbers);
        let origin = shape.bounds().center().lerp(p, numbers.uniform().powf(0.2));
        let size = shape.bounds().radius() + origin.length();
        if oracle::outside(shape, origin).is_none_or(|d| d > -1e-15 * size) {
            return Ok(());
        }
        let target = features[numbers.below(features.len())];
        let other = features[numbers.below(features.len())];
        let direction = match numbers.below(4) {
            0 => numbers.direction(),
            1 => target - origin,
            2 => target.lerp(other, numbers.uniform()) - origin,
            _ => DVec3::AXES[numbers.below(3)] * numbers.between(-1.0, 1.0),
        };
        let mut hits = Vec::new();
        shape.all(&DRay::new(origin, direction), &mut hits);
        ensure(hits.len() == 1 || direction == DVec3::ZERO, || {
            format!("from {origin} along {direction}: {hits:?}")
        })
    });
}

#[test]
fn a_single_precision_ray_that_leaves_a_surface_does_not_meet_it_again() {
    for_each_ray(|shape, _, numbers| {
        let (p, n) = rays::surface_point(shape, numbers);
        let direction = numbers.direction().as_vec3();
        let cos = direction.as_dvec3().dot(n);
        if cos.abs() < 1e-5 {
            return Ok(());
        }
        // A renderer has only the point rounded to single precision.
        let rounded = p.as_vec3();
        let error = rounded.abs() * robust::gamma(1);
        let origin = robust::offset_ray_origin(rounded, error, n.as_vec3(), direction);
        let ray = DRay::new(origin.as_dvec3(), direction.as_dvec3());
        let hit = shape.closest(&ray);
        if !oracle::knows(shape) {
            // The shape need not be convex: the ray may hit it again, but not where it started.
            let near = hit.is_some_and(|h| h.t < 1e-6 * shape.bounds().radius());
            return ensure(!near, || format!("{ray:?} left {p} with normal {n}: {hit:?}"));
        }
        let inside = cos < 0.0 && oracle::outside(shape, p).is_some();
        if !inside {
            ensure(hit.is_none(), || format!("{ray:?} left {p} with normal {n}: {hit:?}"))
        } else if shape.is_closed() && oracle::outside(shape, ray.origin).is_some_and(|d| d < 0.0) {
            ensure(hit.is_some(), || format!("{ray:?} entered at {p} and never left"))
        } else {
            Ok(())
        }
    });
}

#[test]
fn broken_rays_miss() {
    let good = DRay::new(DVec3::new(0.1, 0.2, 5.0), DVec3::new(0.0, 0.1, -1.0));
    for shape in AnyShape::examples() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for i in 0..3 {
                let (mut origin, mut direction) = (good, good);
                origin.origin[i] = bad;
                direction.direction[i] = bad;
                assert_eq!(
                    (shape.closest(&origin), shape.closest(&direction)),
                    (None, None),
                    "{shape:?}"
                );
            }
        }
        let still = DRay { direction: DVec3::ZERO, ..good };
        let empty = DRay { t_min: 2.0, t_max: 1.0, ..good };
        let nan = DRay { t_min: f64::NAN, ..good };
        for ray in [still, empty, nan] {
            assert_eq!(shape.closest(&ray), None, "{shape:?} {ray:?}");
        }
        for far in [1e150, 1e300] {
            for i in 0..3 {
                let ray = DRay::new(DVec3::AXES[i] * far, DVec3::AXES[i] * -far);
                assert!(
                    shape.closest(&ray).is_none_or(|hit| hit.t.is_finite()),
                    "{shape:?} {ray:?}"
                );
            }
        }
    }
}

/// The smallest parameter of a pair that lies in the interval of a ray.
fn first(ray: &DRay, pair: Option<(f64, f64)>) -> Option<f64> {
    pair.and_then(|(t0, t1)| [t0, t1].into_iter().find(|&t| ray.contains(t)))
}

#[test]
fn the_methods_of_the_lecture_agree_with_each_other() {
    for_each_ray(|shape, features, numbers| {
        let ray = rays::ray(shape, features, numbers);
        let (length, scale) = (ray.direction.length(), oracle::scale(shape, &ray));
        // The plain formulas are for rays of ordinary length, and the geometric one finds only hits
        // ahead of the origin.
        if ray.t_min < 0.0 || !(1e-12..1e12).contains(&length) {
            return Ok(());
        }
        let answers = match shape {
            AnyShape::Sphere(s) => {
                vec![
                    first(&ray, sphere::intersect_algebraic(s, &ray)),
                    first(&ray, sphere::intersect_geometric(s, &ray)),
                ]
            }
            AnyShape::BoxShape(b) => {
                vec![
                    box_shape::intersect_faces(b, &ray).map(|h| h.t),
                    box_shape::intersect_slabs(b, &ray).map(|h| h.t),
                ]
            }
            AnyShape::Triangle(t) => vec![
                triangle::intersect_algebraic(&t.vertices, &ray),
                triangle::intersect_parametric(&t.vertices, &ray),
                triangle::intersect_watertight(&t.vertices, &ray).map(|h| h.t),
            ],
            AnyShape::Polygon(p) => {
                vec![polygon::intersect_algebraic(p, &ray), polygon::intersect_fan(p, &ray)]
            }
            _ => return Ok(()),
        };
        let Verdict::Crossings(expected) = oracle::crossings(shape, &ray) else { return Ok(()) };
        // The plain formulas lose accuracy: compare only where the crossing is clear by a margin
        // for that.
        let clear = expected.iter().all(|c| !c.doubtful) && is_clear(shape, &ray, scale);
        for pair in answers.windows(2).filter(|_| clear) {
            let same = match (pair[0], pair[1]) {
                (Some(a), Some(b)) => (a - b).abs() * length <= 1e-4 * scale,
                (a, b) => a == b,
            };
            ensure(same, || format!("{ray:?}\n{answers:?}"))?;
        }
        Ok(())
    });
}

/// True if slightly displaced rays have the same number of hits on the same faces.
fn is_clear(shape: &AnyShape, ray: &DRay, scale: f64) -> bool {
    let count = |offset: DVec3| {
        let mut hits = Vec::new();
        shape.all(&DRay { origin: ray.origin + offset, ..*ray }, &mut hits);
        hits.iter().map(|h| h.face).collect::<Vec<_>>()
    };
    let expected = count(DVec3::ZERO);
    DVec3::AXES
        .iter()
        .all(|&a| count(a * 1e-7 * scale) == expected && count(a * -1e-7 * scale) == expected)
}
