//! Tests of beams, pencils and cones against rays, and against known results.

use super::*;
use snell_intersect::AcceleratorKind;
use snell_intersect::Sphere;
use snell_intersect::{AcceptAll, Grouping};
use snell_intersect::{BuildOptions, World, WorldBuilder};
use snell_intersect::{Hit, TriangleMesh};
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Ray, Transform, Vec3, rng};
use std::sync::Arc;

fn random(i: u32, k: u32) -> DVec3 {
    let (a, b) = (rng::uniform2([i, k, 1, 2]), rng::uniform2([i, k, 3, 4]));
    DVec3::new(a.x.into(), a.y.into(), b.x.into())
}

/// Random triangles in the unit cube.
fn soup(seed: u32, count: u32, size: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..count {
        let middle = random(seed * 1000 + i, 0);
        for k in 0..3 {
            mesh.positions.push((middle + (random(seed * 1000 + i, k + 1) - 0.5) * size).as_vec3());
        }
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

fn world_of(meshes: Vec<TriangleMesh>, instances: &[Transform]) -> World {
    let mut builder = WorldBuilder::default();
    for mesh in &meshes {
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh.clone()));
    }
    if !instances.is_empty() {
        let group = builder.add_group();
        builder.add_mesh(group, Arc::new(meshes[0].clone()));
        for placed in instances {
            builder.add_instance(WorldBuilder::ROOT, group, *placed);
        }
    }
    builder.build(&BuildOptions::default()).expect("small")
}

/// The soups of the tests: coarse and fine, some with instances.
fn soups() -> Vec<World> {
    let turned = |angle: f64, scale: f64, to: DVec3| {
        let map = DAffine3::from_mat3_translation(DMat3::from_rotation_y(angle) * scale, to);
        Transform::new(map).expect("not flat")
    };
    vec![
        world_of(vec![soup(1, 3, 1.0)], &[]),
        world_of(vec![soup(2, 40, 0.7)], &[]),
        world_of(vec![soup(3, 2000, 0.1), soup(4, 30, 0.5)], &[]),
        world_of(
            vec![soup(5, 100, 0.3)],
            &[
                turned(0.3, 0.5, DVec3::new(0.1, 0.2, 0.3)),
                turned(2.0, -1.0, DVec3::new(1.0, 0.8, 0.9)),
            ],
        ),
    ]
}

const EYE: Vec3 = Vec3::new(0.4, 0.6, -1.5);

/// A perspective view of the unit cube from [`EYE`].
fn view() -> View {
    let corner = DVec3::new(-0.6, 0.6, 1.3);
    View::perspective(EYE.as_dvec3(), corner, DVec3::X * 1.2, DVec3::NEG_Y * 1.2)
        .expect("independent")
}

fn camera_rays(side: u32) -> Vec<Ray> {
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
    let place = |i: u32| DVec2::new(at(i % side), at(i / side));
    (0..side * side)
        .map(|i| Ray::new(EYE, view().direction(place(i)).as_vec3().normalize()))
        .collect()
}

fn closest(world: &World, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
    hits
}

/// Rays from the hit points of primary rays to a light.
fn shadow_rays(world: &World, rays: &[Ray], light: Vec3) -> Vec<Ray> {
    let hits = closest(world, rays);
    let of = |(ray, hit): (&Ray, &Hit)| {
        let surface = hit.is_hit().then(|| world.interaction(ray, hit))?;
        let origin = surface.ray_origin(light - surface.position);
        Some(Ray { t_min: 1e-5, t_max: 1.0, ..Ray::new(origin, light - origin) })
    };
    rays.iter().zip(&hits).filter_map(of).collect()
}

const LIGHTS: [Vec3; 2] = [Vec3::new(0.8, 3.0, -1.0), Vec3::new(0.5, 0.45, 0.55)];

#[test]
fn beams_give_the_hits_of_rays_bit_for_bit() {
    for (i, world) in soups().iter().enumerate() {
        let rays = camera_rays(64);
        let expected = closest(world, &rays);
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut tracer = BeamTracer::new(world).expect("triangles");
        tracer.closest(&view(), &rays, &mut hits);
        let wrong = hits.iter().zip(&expected).filter(|(a, b)| a != b).count();
        assert_eq!(wrong, 0, "{i}");
        assert!(tracer.work().rays < rays.len() as u64 / 2 + 1, "{i}: {:?}", tracer.work());
    }
}

#[test]
fn beams_from_lights_give_the_shadows_of_rays() {
    for (i, world) in soups().iter().enumerate() {
        for light in LIGHTS {
            let rays = shadow_rays(world, &camera_rays(64), light);
            let (mut expected, mut blocked) = (vec![false; rays.len()], vec![false; rays.len()]);
            world.occluded(&rays, Grouping::None, &AcceptAll, &mut expected);
            let mut tracer = BeamTracer::new(world).expect("triangles");
            tracer.occluded(light.as_dvec3(), &rays, &mut blocked);
            let wrong = blocked.iter().zip(&expected).filter(|(a, b)| a != b).count();
            assert!(wrong * 1000 <= rays.len(), "{i}: {wrong} of {}", rays.len());
            assert!(expected.iter().any(|b| *b) || i == 0);
        }
    }
}

#[test]
fn the_pieces_of_a_beam_cover_its_region_once_and_show_what_rays_hit() {
    for (i, world) in soups().iter().enumerate() {
        let region = ConvexPolygon::triangle(
            DVec2::new(0.1, 0.1),
            DVec2::new(0.9, 0.2),
            DVec2::new(0.3, 0.8),
        );
        let mut pieces = Vec::new();
        BeamTracer::new(world)
            .expect("triangles")
            .visible(&view(), &region, |piece| pieces.push(*piece));
        let area: f64 = pieces.iter().map(|p| p.polygon.area()).sum();
        assert!((area - region.area()).abs() < 1e-11, "{i}: {area}");
        for (k, piece) in pieces.iter().enumerate().filter(|(_, p)| p.polygon.area() > 1e-9) {
            let place = piece.polygon.middle();
            let at = pieces
                .iter()
                .filter(|p| p.polygon.area() > 0.0 && p.polygon.contains(place, -1e-9))
                .count();
            assert_eq!(at, 1, "{i} {k}");
            let ray = Ray::new(EYE, view().direction(place).as_vec3());
            let hit = closest(world, &[ray])[0];
            let seen = piece.primitive.map(|p| [p.instance, p.geometry, p.primitive]);
            // The direction of the ray is rounded, so slivers may be missed.
            if piece.polygon.contains(
                view().place_of_direction(ray.direction.as_dvec3()).expect("ahead"),
                -1e-6,
            ) {
                assert_eq!(
                    seen,
                    hit.is_hit().then_some([hit.instance, hit.geometry, hit.primitive]),
                    "{i} {k}"
                );
                if hit.is_hit() {
                    let t = 1.0 / piece.nearness(place) * f64::from(1.0f32);
                    assert!((t - f64::from(hit.t)).abs() < 1e-4, "{i} {k}: {t} {}", hit.t);
                }
            }
        }
    }
}

/// A rectangle perpendicular to z.
fn rectangle(low: [f32; 2], high: [f32; 2], z: f32) -> TriangleMesh {
    let corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
    TriangleMesh {
        positions: corners.map(|[x, y]| Vec3::new(x, y, z)).to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }
}

#[test]
fn coverage_of_known_polygons_is_exact() {
    // The farther rectangle fills a quarter of the picture, half of which the nearer one hides;
    // another rectangle intersects both planes and is behind.
    let world = world_of(
        vec![
            rectangle([0.0; 2], [2.0; 2], 4.0),
            rectangle([0.0; 2], [0.5, 1.0], 2.0),
            rectangle([0.0; 2], [0.1; 2], -3.0),
        ],
        &[],
    );
    let view = View::cube_side(DVec3::ZERO, 2, true);
    let region = ConvexPolygon::rectangle(DVec2::splat(-1.0), DVec2::ONE);
    let mut areas = [0.0; 3];
    let mut nothing = 0.0;
    BeamTracer::new(&world).expect("triangles").visible(&view, &region, |piece| {
        match piece.primitive {
            Some(primitive) => areas[primitive.geometry as usize] += piece.polygon.area(),
            None => nothing += piece.polygon.area(),
        }
    });
    for (area, expected) in areas.iter().chain([&nothing]).zip([0.125, 0.125, 0.0, 3.75]) {
        assert!((area - expected).abs() < 1e-14, "{area} {expected}");
    }
}

#[test]
fn crowds_that_no_division_thins_out_are_seen() {
    // The mesh has sixty copies of one triangle, sixty triangles that intersect in a line, and a
    // fan of two hundred triangles around a point.
    let mut mesh = TriangleMesh::default();
    let mut add = |corners: [Vec3; 3]| {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.indices.push([first, first + 1, first + 2]);
    };
    for i in 0..60 {
        add([Vec3::new(-2.0, -2.0, 3.0), Vec3::new(2.0, -2.0, 3.0), Vec3::new(0.0, 2.0, 3.0)]);
        let slope = i as f32 * 0.03;
        add([
            Vec3::new(-2.0, -2.0, 3.0 - slope),
            Vec3::new(2.0, -2.0, 3.0 + slope),
            Vec3::new(0.0, 2.0, 3.0),
        ]);
    }
    for i in 0..200 {
        let at = |k: i32| {
            Vec3::new(
                (k as f32 * 0.0314).cos(),
                (k as f32 * 0.0314).sin(),
                1.5 + 0.3 * (k & 1) as f32,
            )
        };
        add([Vec3::new(0.0, 0.0, 1.6), at(i), at(i + 1)]);
    }
    let world = world_of(vec![mesh], &[]);
    let view = View::cube_side(DVec3::ZERO, 2, true);
    let region = ConvexPolygon::rectangle(DVec2::splat(-1.0), DVec2::ONE);
    let (mut area, mut count) = (0.0, 0);
    let mut tracer = BeamTracer::new(&world).expect("triangles");
    tracer.visible(&view, &region, |piece| {
        area += piece.polygon.area();
        count += 1;
        let geometry_of_copies =
            piece.primitive.is_some_and(|p| p.primitive < 120 && p.primitive % 2 == 0);
        assert!(!geometry_of_copies || piece.primitive.is_some_and(|p| p.primitive == 0));
    });
    assert!((area - 4.0).abs() < 1e-11 && count < 20_000, "{area} {count}");
    assert!(tracer.work().regions < 5_000, "{:?}", tracer.work());
}

#[test]
fn parallel_beams_see_what_is_ahead() {
    let world = world_of(
        vec![rectangle([0.0; 2], [1.0; 2], 4.0), rectangle([0.0; 2], [0.5, 1.0], -1.0)],
        &[],
    );
    let view = View::parallel(DVec3::Z, DVec3::ZERO, DVec3::X, DVec3::Y).expect("independent");
    let region = ConvexPolygon::rectangle(DVec2::ZERO, DVec2::splat(2.0));
    let mut areas = [0.0; 2];
    BeamTracer::new(&world).expect("triangles").visible(&view, &region, |piece| {
        if let Some(primitive) = piece.primitive {
            areas[primitive.geometry as usize] += piece.polygon.area();
            assert_eq!(piece.nearness(piece.polygon.middle()), -4.0);
        }
    });
    assert_eq!(areas, [1.0, 0.0]);
}

#[test]
fn the_beam_through_a_triangle_tells_how_much_of_it_is_lit() {
    let world = world_of(
        vec![rectangle([0.0; 2], [2.0; 2], 4.0), rectangle([0.0; 2], [0.5, 0.5], 2.0)],
        &[],
    );
    let corners = [DVec3::new(0.0, 0.0, 4.0), DVec3::new(2.0, 0.0, 4.0), DVec3::new(2.0, 2.0, 4.0)];
    let view = View::through_triangle(DVec3::ZERO, corners).expect("not flat");
    let region = ConvexPolygon::triangle(DVec2::ZERO, DVec2::X, DVec2::Y);
    let mut lit = 0.0;
    BeamTracer::new(&world).expect("triangles").visible(&view, &region, |piece| {
        if piece.primitive.is_some_and(|p| p.geometry == 0) {
            lit += piece.polygon.area() / region.area();
        }
    });
    assert!((lit - 0.75).abs() < 1e-13, "{lit}");
}

#[test]
fn pencils_give_the_hits_of_rays_within_their_tolerance() {
    for (i, world) in soups().iter().enumerate() {
        let rays = camera_rays(128);
        let expected = closest(world, &rays);
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut tracer = PencilTracer::new(world, 1e-5).expect("triangles");
        tracer.closest(&view(), &rays, &mut hits);
        for (k, (a, b)) in hits.iter().zip(&expected).enumerate() {
            assert_eq!(
                [a.instance, a.geometry, a.primitive],
                [b.instance, b.geometry, b.primitive],
                "{i} {k}"
            );
            if b.is_hit() {
                assert!(
                    (a.t - b.t).abs() <= 1.2e-5 * b.t && (a.uv - b.uv).length() < 1e-2,
                    "{i} {k}: {a:?} {b:?}"
                );
            }
        }
        assert!(
            i == 2 || tracer.linear_rays() > rays.len() as u64 / 4,
            "{i}: {}",
            tracer.linear_rays()
        );
    }
}

#[test]
fn pencils_from_lights_give_the_shadows_of_rays() {
    for world in &soups() {
        for light in LIGHTS {
            let rays = shadow_rays(world, &camera_rays(96), light);
            let (mut expected, mut blocked) = (vec![false; rays.len()], vec![true; rays.len()]);
            world.occluded(&rays, Grouping::None, &AcceptAll, &mut expected);
            let mut tracer = PencilTracer::new(world, 1e-5).expect("triangles");
            tracer.occluded(light.as_dvec3(), &rays, &mut blocked);
            assert_eq!(blocked, expected);
            assert!(tracer.linear_rays() > 0);
        }
    }
}

/// A rectangle covers half of each cone, and a larger rectangle behind it covers all of the cone.
#[test]
fn cones_are_covered_by_the_share_of_their_section() {
    let world = world_of(
        vec![rectangle([0.0, -9.0], [9.0, 9.0], 5.0), rectangle([-9.0; 2], [9.0; 2], 7.0)],
        &[],
    );
    let mut tracer = ConeTracer::new(&world).expect("triangles");
    for cone in [
        Cone { origin: DVec3::ZERO, direction: DVec3::Z, width: 0.0, spread: 0.1 },
        Cone { origin: DVec3::ZERO, direction: DVec3::Z, width: 0.3, spread: 0.1 },
        Cone { origin: DVec3::ZERO, direction: DVec3::Z, width: 0.3, spread: 0.0 },
    ] {
        let hits = tracer.trace(&cone, [0.0, f64::INFINITY]).hits;
        let near: f64 = hits.iter().filter(|h| h.primitive.geometry == 0).map(|h| h.coverage).sum();
        assert!((near - 0.5).abs() < 1e-12, "{cone:?} {near}");
        let last = hits.last().expect("covered");
        assert!((last.opacity - 1.0).abs() < 1e-12 && last.primitive.geometry == 1);
        assert!((last.distance - 7.0).abs() < 1e-9 && (hits[0].distance - 5.0).abs() < 1e-9);
        // The limits of depth: up to 6, from 6 on, and from 8 on.
        assert!((tracer.trace(&cone, [0.0, 6.0]).opacity() - 0.5).abs() < 1e-12);
        assert!(tracer.trace(&cone, [6.0, 99.0]).hits.iter().all(|h| h.primitive.geometry == 1));
        assert!(tracer.trace(&cone, [8.0, 99.0]).hits.is_empty());
    }
    // A ball of radius 1/2 at height 6, half hidden.
    let lit = tracer.visibility_of_ball(DVec3::ZERO, DVec3::Z * 6.0, 0.5, 0.0);
    assert!((lit - 0.5).abs() < 1e-12);
}

#[test]
fn cone_coverage_agrees_with_many_rays() {
    for (i, world) in soups().iter().enumerate() {
        let mut tracer = ConeTracer::new(world).expect("triangles");
        for k in 0..6 {
            let to = random(k, 99);
            let direction = (to - EYE.as_dvec3()).normalize();
            let cone = Cone { origin: EYE.as_dvec3(), direction, width: 0.0, spread: 0.3 };
            let hits = tracer.trace(&cone, [0.0, f64::INFINITY]);
            let (right, up) = direction.any_orthonormal_pair();
            let rays: Vec<Ray> = (0..20_000)
                .map(|j| {
                    let disk = snell_math::sampling::concentric_disk(rng::uniform2([j, k, 5, 6]))
                        .as_dvec2()
                        * 0.15;
                    Ray::new(EYE, (direction + right * disk.x + up * disk.y).as_vec3())
                })
                .collect();
            let found = closest(world, &rays);
            let share = |f: &dyn Fn(&Hit) -> bool| {
                found.iter().filter(|h| f(h)).count() as f64 / rays.len() as f64
            };
            assert!((share(&|h| h.is_hit()) - hits.opacity()).abs() < 0.015, "{i} {k}");
            for hit in &hits.hits {
                let PrimitiveId { instance, geometry, primitive } = hit.primitive;
                let is_it = |h: &Hit| {
                    [h.instance, h.geometry, h.primitive] == [instance, geometry, primitive]
                };
                assert!((share(&is_it) - hit.coverage).abs() < 0.015, "{i} {k}");
            }
        }
    }
}

#[test]
fn footprints_grow_with_distance_and_stretch_with_the_angle() {
    let cone = Cone::around(&Ray::new(Vec3::ZERO, Vec3::Z * 3.0), 0.5, 0.1);
    assert_eq!(cone.width_at(5.0), 1.0);
    let slanted = DVec3::new(0.0, 0.6, -0.8);
    let Footprint { major, minor } = cone.footprint(5.0, slanted);
    assert!((major.length() - 1.25).abs() < 1e-12 && (minor.length() - 1.0).abs() < 1e-12);
    assert!(
        major.dot(slanted).abs() < 1e-12
            && minor.dot(slanted).abs() < 1e-12
            && major.dot(minor).abs() < 1e-12
    );
}

#[test]
fn other_structures_and_other_shapes_are_refused() {
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(soup(1, 3, 1.0)));
    let options = BuildOptions { accelerator: AcceleratorKind::Grid, ..BuildOptions::default() };
    let world = builder.clone().build(&options).expect("small");
    assert_eq!(BeamTracer::new(&world).err(), Some(CoherenceError::NotBvh));
    builder.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
    let world = builder.build(&BuildOptions::default()).expect("small");
    assert_eq!(ConeTracer::new(&world).err(), Some(CoherenceError::NotTriangles));
}

#[test]
fn nothing_is_seen_in_an_empty_world_and_odd_rays_miss() {
    let empty = WorldBuilder::default().build(&BuildOptions::default()).expect("empty");
    let some = world_of(vec![soup(2, 40, 0.7)], &[]);
    let odd = [
        Ray::new(Vec3::NAN, Vec3::Z),
        Ray::new(EYE, Vec3::ZERO),
        Ray::new(EYE, Vec3::INFINITY),
        Ray { t_max: -1.0, ..Ray::new(EYE, Vec3::Z) },
    ];
    for world in [&empty, &some] {
        let mut hits = [Hit { t: 1.0, ..Hit::MISS }; 4];
        BeamTracer::new(world).expect("triangles").closest(&view(), &odd, &mut hits);
        assert_eq!(hits, [Hit::MISS; 4]);
        PencilTracer::new(world, 1e-5).expect("triangles").occluded(
            DVec3::ONE,
            &odd,
            &mut [true; 4],
        );
        let cone = Cone { origin: DVec3::NAN, direction: DVec3::Z, width: 0.1, spread: 0.1 };
        assert_eq!(
            ConeTracer::new(world).expect("triangles").trace(&cone, [0.0, 1.0]),
            ConeHits::default()
        );
        let flat = Cone { origin: DVec3::ZERO, direction: DVec3::Z, width: 0.0, spread: 0.0 };
        assert_eq!(
            ConeTracer::new(world).expect("triangles").trace(&flat, [0.0, 1.0]),
            ConeHits::default()
        );
    }
}

/// A ray in double precision that is reflected or refracted by a ball of radius 1 at the origin,
/// from its start plane to a plane beyond.
fn through_ball(ray: snell_math::DRay, ratio: Option<f64>) -> (DVec3, DVec3) {
    let d = ray.direction.normalize();
    let b = ray.origin.dot(d);
    let t = -b - (b * b - ray.origin.length_squared() + 1.0).sqrt();
    let (p, n) = (ray.origin + d * t, (ray.origin + d * t).normalize());
    let out = match ratio {
        None => d - n * (2.0 * d.dot(n)),
        Some(ratio) => {
            let arriving = -d.dot(n);
            d * ratio
                + n * (ratio * arriving
                    - (1.0 - ratio * ratio * (1.0 - arriving * arriving)).sqrt())
        }
    };
    (p, out)
}

#[test]
fn the_system_matrix_follows_rays_to_second_order_through_mirrors_and_glass() {
    let (origin, direction) = (DVec3::new(0.3, -0.2, -3.0), DVec3::new(0.02, 0.05, 1.0));
    for ratio in [None, Some(1.0 / 1.5)] {
        let start = Pencil::new(origin, direction);
        let axis = snell_math::DRay::new(origin, direction);
        let (p, _) = through_ball(axis, ratio);
        let mut pencil = start;
        pencil.transfer((p - origin).length());
        let surface = CurvedSurface::ball(p.normalize(), 1.0);
        match ratio {
            None => pencil.reflect(&surface),
            Some(ratio) => assert!(pencil.refract(&surface, ratio)),
        }
        pencil.transfer(0.7);
        // The system scales areas in phase space by the squared ratio of the indices of refraction.
        let expected = ratio.map_or(1.0, |r| r * r);
        assert!(
            (pencil.system().determinant() - expected).abs() < 1e-9,
            "{:?}",
            pencil.system().determinant()
        );
        let error = |size: f64| {
            let state = snell_math::DVec4::new(0.5, -0.3, 0.7, 0.4) * size;
            let (p, out) = through_ball(start.ray(state), ratio);
            let ray = pencil.ray(state);
            // Where the actual ray crosses the plane across the axis there.
            let t = (pencil.origin() - p).dot(pencil.direction()) / out.dot(pencil.direction());
            let slope = out / out.dot(pencil.direction());
            (p + out * t - ray.origin).length() + (slope - ray.direction).length()
        };
        let (coarse, fine) = (error(1e-2), error(1e-3));
        assert!(fine < 1e-5 && fine < coarse * 0.015 && coarse > 1e-7, "{coarse} {fine}");
    }
}

#[test]
fn the_interpolated_normal_changes_as_the_surface_says() {
    let corners =
        [DVec3::new(0.1, 0.0, 0.2), DVec3::new(1.2, 0.1, 0.0), DVec3::new(0.3, 1.1, -0.1)];
    let normals = [DVec3::new(0.1, 0.0, 1.0), DVec3::new(0.4, 0.1, 0.9), DVec3::new(0.0, 0.5, 0.8)];
    let at = |b: [f64; 2]| {
        (normals[0] * (1.0 - b[0] - b[1]) + normals[1] * b[0] + normals[2] * b[1]).normalize()
    };
    let place =
        |b: [f64; 2]| corners[0] * (1.0 - b[0] - b[1]) + corners[1] * b[0] + corners[2] * b[1];
    let b = [0.3, 0.2];
    let surface = CurvedSurface::triangle(corners, normals, b).expect("not flat");
    for step in [[1e-5, 0.0], [0.0, 1e-5], [1e-5, -2e-5]] {
        let moved = [b[0] + step[0], b[1] + step[1]];
        let change = surface.curvature * (place(moved) - place(b));
        assert!((at(moved) - surface.normal - change).length() < 1e-9);
    }
}
