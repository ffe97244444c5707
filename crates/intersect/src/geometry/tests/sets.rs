//! Tests every kind of set against an oracle that uses only centres and radii, and in worlds, where
//! all structures must agree.

use super::{Random, agree, worlds};
use crate::geometry::{CubicCurves, CurveBasis, LinearCurves, PrimitiveHit, PrimitiveSet, Spheres};
use crate::search::AcceptAll;
use crate::shape::ShapeSurface;
use crate::world::{BuildOptions, WorldBuilder};
use snell_math::rng::{pcg4d, to_unit};
use snell_math::{Bounds3d, DAffine3, DMat3, DRay, DVec2, DVec3, Ray, Transform, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// A set, and a function that gives the ball that sweeps a primitive at a parameter from 0 to 1.
struct Example {
    name: &'static str,
    set: Arc<dyn PrimitiveSet>,
    ball: Box<dyn Fn(usize, f64) -> (DVec3, f64)>,
    /// The largest distance of hits from the surface, relative to the largest radius: everywhere,
    /// and everywhere except at silhouettes.
    accuracy: [f64; 2],
}

fn parts(v: Vec4) -> (DVec3, f64) {
    (v.truncate().as_dvec3(), v.w.into())
}

fn examples() -> Vec<Example> {
    let mut random = Random(4);
    let mut knot =
        |size: f32, radius: f32| random.point(size).extend(random.range(0.2, 1.0) * radius);
    let mut all = Vec::new();
    let spheres: Vec<_> = (0..40).map(|_| knot(2.0, 0.5)).collect();
    let copy = spheres.clone();
    all.push(Example {
        name: "spheres",
        set: Arc::new(Spheres { spheres, ..Spheres::default() }),
        ball: Box::new(move |i, _| parts(copy[i])),
        accuracy: [1e-12; 2],
    });
    let mut points: Vec<_> = (0..40).map(|_| knot(2.0, 0.4)).collect();
    // A ball within its neighbour, a cone with a point, a segment without length.
    points[5] = (points[4].truncate() * 1.01).extend(points[4].w * 0.5);
    points[10].w = 0.0;
    points[15] = points[14];
    let curves = LinearCurves::chain(points.clone());
    all.push(Example {
        name: "linear",
        set: Arc::new(curves),
        ball: Box::new(move |i, u| {
            let (a, b) = (parts(points[i]), parts(points[i + 1]));
            (a.0 * (1.0 - u) + b.0 * u, a.1 * (1.0 - u) + b.1 * u)
        }),
        accuracy: [1e-11; 2],
    });
    for (name, basis, radius) in [
        ("bezier", CurveBasis::Bezier, 0.2),
        ("thin bezier", CurveBasis::Bezier, 0.003),
        ("b-spline", CurveBasis::BSpline, 0.1),
        ("catmull-rom", CurveBasis::CatmullRom, 0.15),
        ("hermite", CurveBasis::Hermite, 0.1),
    ] {
        let points: Vec<_> = (0..40).map(|_| knot(1.5, radius)).collect();
        let tangents: Vec<_> = (0..40).map(|_| knot(3.0, radius * 0.1)).collect();
        let step = if basis == CurveBasis::Bezier { 3 } else { 1 };
        let segments: Vec<u32> = (0..12).map(|i| i * step).collect();
        let (p, t) = (points.clone(), tangents.clone());
        all.push(Example {
            name,
            set: Arc::new(CubicCurves { basis, points, tangents, segments, exact: Vec::new() }),
            // The polynomials as textbooks write them.
            ball: Box::new(move |i, u| {
                let at = i * step as usize;
                let (u2, u3) = (u * u, u * u * u);
                let weights = match basis {
                    CurveBasis::Bezier => {
                        let v = 1.0 - u;
                        [v * v * v, 3.0 * u * v * v, 3.0 * u2 * v, u3]
                    }
                    CurveBasis::BSpline => {
                        let v = 1.0 - u;
                        let middle = |a: f64| (3.0 * a * a * a - 6.0 * a * a + 4.0) / 6.0;
                        [v * v * v / 6.0, middle(u), middle(v), u3 / 6.0]
                    }
                    CurveBasis::CatmullRom => [
                        (-u3 + 2.0 * u2 - u) / 2.0,
                        (3.0 * u3 - 5.0 * u2 + 2.0) / 2.0,
                        (-3.0 * u3 + 4.0 * u2 + u) / 2.0,
                        (u3 - u2) / 2.0,
                    ],
                    CurveBasis::Hermite => [
                        2.0 * u3 - 3.0 * u2 + 1.0,
                        u3 - 2.0 * u2 + u,
                        -2.0 * u3 + 3.0 * u2,
                        u3 - u2,
                    ],
                };
                let points = if basis == CurveBasis::Hermite {
                    [p[at], t[at], p[at + 1], t[at + 1]]
                } else {
                    [p[at], p[at + 1], p[at + 2], p[at + 3]]
                };
                let mean = points
                    .iter()
                    .zip(weights)
                    .map(|(p, w)| p.as_dvec4() * w)
                    .sum::<snell_math::DVec4>();
                (mean.truncate(), mean.w)
            }),
            accuracy: [2.5e-3, 1e-9],
        });
    }
    all
}

impl Example {
    /// Distance of a point from the surface of the primitive; negative inside.
    fn distance(&self, primitive: usize, p: DVec3) -> f64 {
        let at = |u: f64| {
            let (c, r) = (self.ball)(primitive, u);
            (p - c).length() - r
        };
        const STEPS: usize = 400;
        let best = (0..=STEPS)
            .map(|i| at(i as f64 / STEPS as f64))
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let (best, _) = best.expect("many");
        let (mut low, mut high) = (
            best.saturating_sub(1) as f64 / STEPS as f64,
            (best + 1).min(STEPS) as f64 / STEPS as f64,
        );
        for _ in 0..90 {
            let (a, b) = (low + (high - low) * 0.382, low + (high - low) * 0.618);
            if at(a) < at(b) { high = b } else { low = a }
        }
        at(0.5 * (low + high)).min(at(low)).min(at(high))
    }

    fn largest_radius(&self, primitive: usize) -> f64 {
        (0..=100).map(|i| (self.ball)(primitive, f64::from(i) / 100.0).1).fold(0.0, f64::max)
    }

    fn crossings(&self, primitive: usize, ray: &DRay) -> Vec<PrimitiveHit> {
        let mut all = Vec::new();
        let mut ray = *ray;
        while let Some(hit) = self.set.closest(primitive, &ray, 0.0) {
            assert!(hit.t > ray.t_min && hit.t < ray.t_max);
            ray.t_min = hit.t;
            all.push(hit);
            assert!(all.len() < 30, "too many");
        }
        all
    }
}

/// A ray that passes near a primitive.
fn ray_near(example: &Example, primitive: usize, random: &mut Random) -> DRay {
    let (c, r) = (example.ball)(primitive, random.unit().into());
    let target = c + random.direction().as_dvec3() * r * f64::from(random.range(0.0, 1.3));
    let d = random.direction().as_dvec3();
    DRay {
        t_min: -1e9,
        ..DRay::new(
            target - d * f64::from(random.range(-3.0, 9.0)),
            d * f64::from(random.range(0.1, 7.0)),
        )
    }
}

#[test]
fn hits_lie_on_the_surface_and_between_them_the_ray_is_in_and_out_by_turns() {
    for example in examples() {
        let mut random = Random(3);
        let (mut crossings, mut doubtful) = (0, 0);
        for primitive in (0..example.set.len()).cycle().take(500) {
            let radius = example.largest_radius(primitive);
            let ray = ray_near(&example, primitive, &mut random);
            let hits = example.crossings(primitive, &ray);
            assert!(hits.len().is_multiple_of(2), "{}: {hits:?}", example.name);
            for hit in &hits {
                let off = example.distance(primitive, ray.at(hit.t)).abs() / radius;
                assert!(
                    off <= example.accuracy[0],
                    "{} {primitive}: off by {off}, {ray:?} {hit:?}",
                    example.name
                );
                doubtful += usize::from(off > example.accuracy[1]);
                crossings += 1;
            }
            for (i, pair) in hits.windows(2).enumerate() {
                let middle =
                    example.distance(primitive, ray.at(0.5 * (pair[0].t + pair[1].t))) / radius;
                let outside = i % 2 == 1;
                assert!(
                    if outside { middle > -2e-3 } else { middle < 2e-3 },
                    "{}: {i} {middle}",
                    example.name
                );
            }
        }
        println!("{}: {crossings} crossings, {doubtful} less exact", example.name);
        assert!(crossings > 500, "{}: {crossings}", example.name);
        assert!(
            doubtful * 50 <= crossings,
            "{}: {doubtful} of {crossings} are not exact",
            example.name
        );
    }
}

#[test]
fn a_ray_through_the_inside_is_never_missed() {
    for example in examples() {
        let mut random = Random(8);
        for primitive in (0..example.set.len()).cycle().take(2000) {
            let (c, r) = (example.ball)(primitive, random.unit().into());
            // Rays are excluded that are as close to silhouettes as the accuracy there.
            let depth = f64::from(random.range(0.0, 1.0)).sqrt().min(0.99);
            let inside = c + random.direction().as_dvec3() * r * depth;
            if r < 0.3 * example.largest_radius(primitive) {
                continue;
            }
            let d = random.direction().as_dvec3();
            let ray = DRay { t_min: -1e9, ..DRay::new(inside, d) };
            let hits = example.crossings(primitive, &ray);
            let before = hits.iter().filter(|h| h.t < 0.0).count();
            assert!(
                before % 2 == 1,
                "{} {primitive}: {before} of {} before the inside",
                example.name,
                hits.len()
            );
        }
    }
}

#[test]
fn bounds_hold_every_ball() {
    for example in examples() {
        for primitive in 0..example.set.len() {
            let bounds = example.set.bounds(primitive);
            for i in 0..=200 {
                let (c, r) = (example.ball)(primitive, f64::from(i) / 200.0);
                let r = (r - 1e-12).max(0.0);
                assert!(
                    bounds.contains(c - r) && bounds.contains(c + r),
                    "{} {primitive} {i}",
                    example.name
                );
            }
        }
    }
}

#[test]
fn the_surface_has_its_point_normal_and_tangents_where_the_ray_hit() {
    for example in examples() {
        let mut random = Random(12);
        for primitive in (0..example.set.len()).cycle().take(300) {
            let radius = example.largest_radius(primitive);
            let ray = ray_near(&example, primitive, &mut random);
            for hit in example.crossings(primitive, &ray) {
                let p = ray.at(hit.t);
                let s = example.set.surface(primitive, p, hit.uv, 0.0);
                let off = example.distance(primitive, s.position).abs() / radius;
                assert!(
                    off < 1e-9 || (example.accuracy[0] > 1e-4 && off < 5e-3),
                    "{}: {off}",
                    example.name
                );
                assert!((s.position - p).length() < 1e-2 * radius, "{}", example.name);
                assert!((s.normal.length() - 1.0).abs() < 1e-12);
                assert!(s.uv.cmpge(DVec2::ZERO).all() && s.uv.cmple(DVec2::ONE).all());
                assert!(
                    s.dpdu.dot(s.normal).abs() < 1e-9 * s.dpdu.length()
                        && s.dpdv.dot(s.normal).abs() < 1e-9
                );
                assert!(s.dpdu.cross(s.dpdv).length() > 0.0, "{}", example.name);
                // The normal points outwards: the distance grows along it, except at inner edges
                // where two normals meet.
                let h = 1e-3 * radius;
                let grows = example.distance(primitive, s.position + s.normal * h);
                assert!(grows > -1e-3 * h, "{} {primitive}: {}", example.name, grows / h);
            }
        }
    }
}

#[test]
fn texture_derivatives_are_those_of_the_surface() {
    // Moving the point along dpdu changes u at the rate 1; moving it along dpdv changes v.
    for example in examples().iter().skip(1) {
        let mut random = Random(9);
        let (mut checked, mut good) = (0, 0);
        for primitive in (0..example.set.len()).cycle().take(200) {
            let ray = ray_near(example, primitive, &mut random);
            let Some(hit) = example.set.closest(primitive, &ray, 0.0) else { continue };
            let s = example.set.surface(primitive, ray.at(hit.t), hit.uv, 0.0);
            if hit.uv.x <= 0.01 || hit.uv.x >= 0.99 {
                continue;
            }
            let h = 1e-5;
            let moved = example.set.surface(primitive, s.position + s.dpdv * h, hit.uv, 0.0).uv;
            let turn = (moved.y - s.uv.y).rem_euclid(1.0);
            checked += 1;
            good += usize::from((turn / h - 1.0).abs() < 0.05);
        }
        assert!(checked > 30 && good * 10 >= checked * 9, "{}: {good} of {checked}", example.name);
    }
}

/// A user-defined set that breaks every rule of the interface.
#[derive(Debug)]
struct Rogue(u32);

impl PrimitiveSet for Rogue {
    fn len(&self) -> usize {
        24
    }

    fn bounds(&self, i: usize) -> Bounds3d {
        let center = DVec3::new((i % 5) as f64, (i % 3) as f64, (i % 7) as f64) - 1.0;
        match i {
            20 => Bounds3d::EMPTY,
            21 => Bounds3d { min: DVec3::NAN, max: DVec3::NAN },
            22 => Bounds3d::INFINITE,
            _ => Bounds3d { min: center - 0.3, max: center + 0.3 },
        }
    }

    fn closest(&self, i: usize, ray: &DRay, time: f32) -> Option<PrimitiveHit> {
        // The distances go from before the interval to far outside the bounds, and are not even a
        // function of the interval.
        let bits = (ray.origin + ray.direction).to_array().map(|x| x.to_bits() as u32);
        let t = f64::from(to_unit(pcg4d([bits[0], bits[1] ^ bits[2], i as u32, self.0])[0])) * 8.0
            - 1.0;
        let t = [t, f64::NAN, f64::INFINITY, ray.t_min, t][(i + bits[0] as usize) % 5];
        Some(PrimitiveHit { t, uv: Vec2::splat(time) })
    }

    fn surface(&self, _: usize, position: DVec3, _: Vec2, _: f32) -> ShapeSurface {
        ShapeSurface { position, normal: DVec3::Z, uv: DVec2::ZERO, dpdu: DVec3::X, dpdv: DVec3::Y }
    }
}

/// Every set, at the root and twice in instances.
pub(super) fn everything(builder: &mut WorldBuilder) {
    let child = builder.add_group();
    for group in [WorldBuilder::ROOT, child] {
        for example in examples() {
            builder.add_set(group, example.set);
        }
        builder.add_set(group, Arc::new(Rogue(group.0)));
        builder.add_set(group, Arc::new(Spheres::default()));
    }
    for (angle, scale) in [(0.3, 1.0), (2.0, -0.7)] {
        let turn =
            DMat3::from_rotation_y(angle) * DMat3::from_diagonal(DVec3::new(scale, 0.5, 1.0));
        let map = DAffine3 { matrix3: turn, translation: DVec3::new(0.5, angle, 0.1) };
        builder.add_instance(WorldBuilder::ROOT, child, Transform::new(map).expect("invertible"));
    }
}

#[test]
fn every_structure_level_and_batch_gives_the_same_hits_on_every_set() {
    let worlds = worlds(everything);
    let mut random = Random(1);
    let rays: Vec<_> = (0..600)
        .map(|i| {
            let (from, to) = (random.point(4.0), random.point(1.5));
            let mut ray = Ray::new(from, (to - from) * random.range(0.1, 3.0));
            if i % 5 == 0 {
                ray.direction = [Vec3::X, -Vec3::Y, Vec3::Z][i / 5 % 3];
            }
            ray.t_min = if i % 4 == 0 { random.range(-3.0, 3.0) } else { 0.0 };
            ray
        })
        .collect();
    let times: Vec<_> = rays.iter().map(|_| random.unit()).collect();
    assert!(agree(&worlds, &rays, &times) > 400);
}

#[test]
fn a_ray_that_leaves_a_set_does_not_find_it_where_it_starts() {
    for example in examples() {
        for offset in [DVec3::ZERO, DVec3::new(5376.0, 1234.0, -12423.0)] {
            let mut builder = WorldBuilder::default();
            let child = builder.add_group();
            builder.add_set(child, example.set.clone());
            builder.add_instance(WorldBuilder::ROOT, child, Transform::translation(offset));
            let world = builder.build(&BuildOptions::default()).expect("a world");
            let mut random = Random(6);
            let (mut hits, mut again) = (0, 0);
            for _ in 0..1500 {
                let (from, primitive) =
                    (random.point(5.0).as_dvec3(), random.unit() * example.set.len() as f32);
                let to = (example.ball)(primitive as usize, random.unit().into()).0;
                let ray = Ray::new((from + offset).as_vec3(), (to - from).as_vec3());
                let hit = world.closest_one(&ray, &AcceptAll);
                if !hit.is_hit() {
                    continue;
                }
                let surface = world.interaction(&ray, &hit);
                let d = random.direction();
                let next = Ray::new(surface.ray_origin(d), d);
                let found = world.all_one(&next, &AcceptAll);
                let own = found.iter().filter(|h| h.primitive == hit.primitive);
                let (radius, coarse) = (
                    example.largest_radius(hit.primitive as usize) as f32,
                    surface.position_error.max_element(),
                );
                // At creases a hit may be very near, but not at the very start of the ray.
                let near = own.filter(|h| h.t < 1e-5 * radius + coarse).count();
                let grazing = d.dot(surface.geometric_normal).abs() < 0.2;
                hits += 1;
                again += usize::from(near > 0 && !grazing && radius > 100.0 * coarse);
            }
            assert!(hits > 100, "{} {hits}", example.name);
            assert_eq!(again, 0, "{}: of {hits}", example.name);
        }
    }
}

#[test]
fn primitives_that_make_no_sense_are_skipped_and_counted() {
    let good = Vec4::new(0.0, 0.0, 5.0, 1.0);
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let at = |x: f32, r: f32| Vec4::new(x, 0.0, 5.0, r);
    let spheres = vec![
        good,
        at(nan, 1.0),
        at(inf, 1.0),
        at(0.0, nan),
        at(0.0, -1.0),
        at(0.0, 0.0),
        at(0.0, inf),
    ];
    let chain = LinearCurves::chain(vec![
        good,
        good,
        at(nan, 1.0),
        good,
        at(1.0, -1.0),
        good,
        at(0.0, 0.0),
        at(1.0, 0.0),
    ]);
    let mut linear = chain.clone();
    linear.segments.extend([7, 8, u32::MAX]);
    let cubic = |basis| {
        let mut points = vec![good; 4];
        points.extend([
            at(0.0, nan),
            good,
            good,
            good,
            at(0.0, -1.0),
            at(0.0, 0.0),
            at(0.0, 0.0),
            at(0.0, 0.0),
            at(0.0, 0.0),
        ]);
        CubicCurves {
            basis,
            points,
            tangents: Vec::new(),
            segments: vec![0, 4, 5, 9, 10, u32::MAX],
            exact: Vec::new(),
        }
    };
    let mut builder = WorldBuilder::default();
    builder.add_set(
        WorldBuilder::ROOT,
        Arc::new(Spheres { spheres, colors: vec![[0.5; 4]], exact: Vec::new() }),
    );
    builder.add_set(WorldBuilder::ROOT, Arc::new(linear));
    builder.add_set(WorldBuilder::ROOT, Arc::new(cubic(CurveBasis::Bezier)));
    // Without tangents no segment of a Hermite set can be hit.
    builder.add_set(WorldBuilder::ROOT, Arc::new(cubic(CurveBasis::Hermite)));
    let world = builder.build(&BuildOptions::default()).expect("a world");
    // Of the chain, only segments 0 (a ball) and 5 (a cone with a point) can be hit.
    assert_eq!(
        (world.stats().primitives, world.stats().skipped_primitives),
        (7 + 10 + 6 + 6, 6 + 8 + 5 + 6)
    );
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    let all = world.all_one(&ray, &AcceptAll);
    assert!(
        all.iter().all(|h| [(0, 0), (1, 0), (1, 5), (2, 0)].contains(&(h.geometry, h.primitive))),
        "{all:?}"
    );
    assert_eq!(all.iter().filter(|h| h.t == 4.0).count(), 4);
    let hit = world.closest_one(&ray, &AcceptAll);
    assert_eq!((hit.geometry, world.interaction(&ray, &hit).color), (0, [0.5; 4]));
}

#[test]
fn extreme_rays_and_primitives_end_in_an_answer() {
    let special = [0.0, -0.0, 1e-45, 1e-30, 1.0, -1.0, 1e30, 3e38, f32::INFINITY, f32::NAN];
    let pick = |i: u32, k: u32| special[pcg4d([i, k, 1, 2])[0] as usize % special.len()];
    let points: Vec<_> =
        (0..300).map(|i| Vec4::new(pick(i, 0), pick(i, 1), pick(i, 2), pick(i, 3).abs())).collect();
    let segments: Vec<u32> = (0..290).collect();
    let worlds = worlds(|builder| {
        let root = WorldBuilder::ROOT;
        builder.add_set(root, Arc::new(Spheres { spheres: points.clone(), ..Spheres::default() }));
        builder.add_set(
            root,
            Arc::new(LinearCurves {
                points: points.clone(),
                segments: segments.clone(),
                exact: Vec::new(),
            }),
        );
        for basis in
            [CurveBasis::Bezier, CurveBasis::BSpline, CurveBasis::CatmullRom, CurveBasis::Hermite]
        {
            let (points, tangents) = (points.clone(), points.clone());
            builder.add_set(
                root,
                Arc::new(CubicCurves {
                    basis,
                    points,
                    tangents,
                    segments: segments.clone(),
                    exact: Vec::new(),
                }),
            );
        }
    });
    let rays: Vec<_> = (0..1500u32)
        .map(|i| Ray {
            origin: Vec3::new(pick(i, 4), pick(i, 5), pick(i, 6)),
            direction: Vec3::new(pick(i, 7), pick(i, 8), pick(i, 9)),
            t_min: pick(i, 10),
            t_max: if i % 2 == 0 { f32::INFINITY } else { pick(i, 11) },
        })
        .collect();
    agree(&worlds, &rays, &vec![f32::NAN; rays.len()]);
    for ray in &rays {
        let hit = worlds[1].closest_one(ray, &AcceptAll);
        if hit.is_hit() {
            let s = worlds[1].interaction(ray, &hit);
            let finite = [
                s.position,
                s.position_error,
                s.geometric_normal,
                s.shading_normal,
                s.dpdu,
                s.dpdv,
            ];
            assert!(finite.iter().all(|v| v.is_finite()), "{ray:?} {s:?}");
        }
    }
}
