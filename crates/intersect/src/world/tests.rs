//! Whole worlds: all structures and levels agree, closed meshes have no holes, rays leave surfaces.

use super::*;
use crate::hit::Hit;
use crate::query::rays::Rays;
use crate::query::{AcceptAll, Grouping, HitFilter};
use crate::shape::{AnyShape, Sphere};
use snell_math::rng::{hash32, pcg4d, to_unit};
use snell_math::sampling::uniform_sphere;
use snell_math::{DAffine3, DMat3, DRay, DVec3, Ray, Vec2, Vec3};

/// Random numbers in order.
pub(crate) struct Random(pub u32);

impl Random {
    pub fn unit(&mut self) -> f32 {
        self.0 += 1;
        to_unit(pcg4d([self.0, 17, 3, 5])[0])
    }

    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    pub fn point(&mut self, extent: f32) -> Vec3 {
        Vec3::new(self.range(-extent, extent), self.range(-extent, extent), self.range(-extent, extent))
    }

    pub fn direction(&mut self) -> Vec3 {
        let u = Vec2::new(self.unit(), self.unit());
        uniform_sphere(u)
    }

    /// Turned, stretched unevenly, sometimes mirrored, moved.
    pub fn transform(&mut self, extent: f32) -> Transform {
        let turn = DMat3::from_axis_angle(self.direction().as_dvec3(), f64::from(self.range(0.0, 6.0)));
        let mut scale =
            DVec3::new(self.range(0.3, 1.5).into(), self.range(0.3, 1.5).into(), self.range(0.3, 1.5).into());
        if self.unit() < 0.5 {
            scale.x = -scale.x;
        }
        let linear = turn * DMat3::from_diagonal(scale);
        let map = DAffine3 { matrix3: linear, translation: self.point(extent).as_dvec3() };
        Transform::new(map).expect("an invertible map")
    }
}

pub(crate) fn soup(random: &mut Random, triangles: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..triangles as u32 {
        let center = random.point(2.0);
        // Every tenth sliver is long, every seventh triangle repeats its predecessor: ties.
        let size = if i % 10 == 0 { 3.0 } else { 0.3 };
        if i % 7 == 6 {
            mesh.indices.push([3 * i - 3, 3 * i - 2, 3 * i - 1]);
            mesh.positions.extend([center; 3]);
            continue;
        }
        mesh.positions.extend([center, center + random.point(size), center + random.point(0.3)]);
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

/// Meshes, spheres and instances of the group before, four deep.
pub(crate) fn nested_scene(seed: u32) -> WorldBuilder {
    let mut random = Random(hash32(seed));
    let mut builder = WorldBuilder::default();
    let mut group = WorldBuilder::ROOT;
    for level in 0..4 {
        let mesh = Arc::new(soup(&mut random, 60));
        builder.add_mesh(group, mesh.clone());
        // The same again: every hit is a tie between two geometries.
        builder.add_mesh(group, mesh);
        for _ in 0..3 {
            let shapes = AnyShape::examples();
            let shape = shapes[(random.unit() * shapes.len() as f32) as usize].clone();
            let size = shape.bounds().size().max_element();
            let size = if size.is_finite() { 0.7 / size } else { 1.0 };
            let placed = random.transform(2.0).compose(&scaling(size));
            builder.add_shape(group, Arc::new(shape), placed);
        }
        if level < 3 {
            let child = builder.add_group();
            for _ in 0..3 {
                let placed = random.transform(2.0);
                builder.add_instance(group, child, placed);
                if random.unit() < 0.4 {
                    builder.add_instance(group, child, placed);
                }
            }
            group = child;
        }
    }
    builder
}

pub(crate) fn scaling(factor: f64) -> Transform {
    Transform::new(DAffine3::from_scale(DVec3::splat(factor))).expect("invertible")
}

pub(crate) fn build(builder: WorldBuilder, accelerator: AcceleratorKind, simd: Level) -> World {
    builder.build(&BuildOptions { accelerator, simd, ..BuildOptions::default() }).expect("a world")
}

pub(crate) fn default_world(builder: WorldBuilder) -> World {
    builder.build(&BuildOptions::default()).expect("a world")
}

pub(crate) fn bits(hit: &Hit) -> [u32; 6] {
    [hit.t.to_bits(), hit.uv.x.to_bits(), hit.uv.y.to_bits(), hit.instance, hit.geometry, hit.primitive]
}

pub(crate) fn levels() -> impl Iterator<Item = Level> {
    Level::ALL.into_iter().filter(|l| l.is_supported())
}

#[test]
fn every_structure_and_level_gives_the_same_hits_bit_for_bit() {
    let mut hits = 0;
    for seed in 0..4 {
        let oracle = build(nested_scene(seed), AcceleratorKind::None, Level::Scalar);
        let worlds: Vec<_> = levels().map(|l| build(nested_scene(seed), AcceleratorKind::Bvh, l)).collect();
        let mut random = Random(seed * 1000);
        for i in 0..500 {
            let (from, to) = (random.point(6.0), random.point(2.0));
            let mut ray = Ray::new(from, (to - from) * random.range(0.1, 10.0));
            if i % 3 == 0 {
                // Along an axis, aimed at a lattice, and sometimes backwards too.
                ray.direction = [Vec3::X, -Vec3::Y, Vec3::Z][i / 3 % 3];
                ray.t_min = random.range(-5.0, 5.0);
                ray.t_max = ray.t_min + random.range(0.0, 10.0);
            }
            let expected = oracle.closest_one(&ray, &AcceptAll);
            let occluded = oracle.occluded_one(&ray, &AcceptAll);
            let all = oracle.all_one(&ray, &AcceptAll);
            assert_eq!(occluded, expected.is_hit());
            assert_eq!(all.first().map(bits), expected.is_hit().then(|| bits(&expected)));
            hits += usize::from(expected.is_hit());
            for world in &worlds {
                let found = world.closest_one(&ray, &AcceptAll);
                assert_eq!(bits(&found), bits(&expected), "{} {ray:?} {found:?} {expected:?}", world.simd());
                assert_eq!(world.occluded_one(&ray, &AcceptAll), occluded, "{ray:?}");
                assert_eq!(world.all_one(&ray, &AcceptAll), all);
            }
        }
    }
    assert!(hits > 600, "{hits}");
}

/// A closed latitude-longitude sphere around `center`, normals outward.
/// The lecture keeps the last hit in the node to test it first: a data race, and answers that depend on who asked before.
#[test]
fn errata_e8_a_world_keeps_nothing_between_rays_and_is_shared_by_threads() {
    let world = default_world(nested_scene(8));
    let mut random = Random(88);
    let rays: Vec<Ray> = (0..2000).map(|_| Ray::new(random.point(3.0), random.direction())).collect();
    let alone: Vec<_> = rays.iter().map(|r| bits(&world.closest_one(r, &AcceptAll))).collect();
    assert!(alone.iter().collect::<std::collections::BTreeSet<_>>().len() > 20, "rays must hit different things");
    std::thread::scope(|scope| {
        for step in [1, 7, 13, 1999] {
            let (world, rays, alone) = (&world, &rays, &alone);
            scope.spawn(move || {
                for i in (0..rays.len()).map(|i| i * step % rays.len()) {
                    assert_eq!(bits(&world.closest_one(&rays[i], &AcceptAll)), alone[i], "ray {i}, every {step}th");
                }
            });
        }
    });
}

pub(crate) fn sphere_mesh(center: Vec3, radius: f32, rings: u32, segments: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut add = |z: f64, r: f64, phi: f64| {
        let p = DVec3::new(r * phi.cos(), r * phi.sin(), z) * f64::from(radius) + center.as_dvec3();
        mesh.positions.push(p.as_vec3());
    };
    add(1.0, 0.0, 0.0);
    for ring in 1..rings {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        (0..segments).for_each(|s| {
            add(theta.cos(), theta.sin(), std::f64::consts::TAU * f64::from(s) / f64::from(segments));
        });
    }
    add(-1.0, 0.0, 0.0);
    let last = 1 + (rings - 1) * segments;
    let at = |ring: u32, s: u32| match ring {
        0 => 0,
        r if r == rings => last,
        r => 1 + (r - 1) * segments + s % segments,
    };
    for ring in 0..rings {
        for s in 0..segments {
            let (a, b, c, d) = (at(ring, s), at(ring + 1, s), at(ring + 1, s + 1), at(ring, s + 1));
            if ring + 1 < rings {
                mesh.indices.push([a, b, c]);
            }
            if ring > 0 {
                mesh.indices.push([a, c, d]);
            }
        }
    }
    mesh
}

pub(crate) fn mesh_world(mesh: TriangleMesh) -> World {
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    default_world(builder)
}

/// Aims at every vertex and edge midpoint and at random points, and returns (rays, misses, counts other than one).
fn leaks(center: Vec3, radius: f32) -> (usize, usize, usize) {
    let mesh = sphere_mesh(center, radius, 40, 80);
    let mut targets = mesh.positions.clone();
    for t in 0..mesh.indices.len() {
        let [a, b, c] = mesh.corners(t);
        targets.extend([(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5]);
    }
    let mut random = Random(5);
    targets.extend((0..5000).map(|_| center + random.direction() * radius));
    let world = mesh_world(mesh);
    let (mut rays, mut misses, mut wrong) = (0, 0, 0);
    for from in [Vec3::ZERO, Vec3::new(0.3, -0.2, 0.1), Vec3::new(0.0, 0.5, 0.0)] {
        let origin = center + from * radius;
        for &target in &targets {
            let ray = Ray::new(origin, target - origin);
            let count = world.all_one(&ray, &AcceptAll).len();
            rays += 1;
            misses += usize::from(count == 0);
            wrong += usize::from(count != 1);
        }
    }
    (rays, misses, wrong)
}

#[test]
fn rays_inside_a_closed_mesh_hit_it_exactly_once() {
    for (center, radius) in [
        (Vec3::ZERO, 2.0),
        (Vec3::ZERO, 2e-6),
        (Vec3::ZERO, 2e9),
        (Vec3::new(5.0, -3.0, 2.0), 2.0),
        (Vec3::ZERO, 1e-25),
        (Vec3::ZERO, 1e18),
    ] {
        let (rays, misses, wrong) = leaks(center, radius);
        assert!(rays > 50_000);
        assert_eq!((misses, wrong), (0, 0), "of {rays} rays, center {center}, radius {radius}");
    }
}

#[test]
fn rays_inside_a_closed_mesh_far_away_never_escape() {
    // The coordinates are so coarse there that the mesh folds over: more than one crossing is right for a few rays.
    let (rays, misses, wrong) = leaks(Vec3::new(148376.0, 1234.0, -223423.0), 2.0);
    assert_eq!(misses, 0);
    assert!(wrong < rays / 200, "{wrong} of {rays}");
}

/// Maps from the harmless to the extreme.
fn placements() -> Vec<Transform> {
    let turn = DMat3::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1);
    let map = |scale: DVec3, translation: DVec3| {
        Transform::new(DAffine3 { matrix3: turn * DMat3::from_diagonal(scale), translation }).expect("invertible")
    };
    let far = DVec3::new(148376.0, 1234.0, -223423.0);
    vec![
        Transform::IDENTITY,
        map(DVec3::ONE, DVec3::new(1.0, 2.0, 3.0)),
        map(DVec3::new(-1.0, 1.0, 1.0), DVec3::ZERO),
        map(DVec3::new(1.0, 20.0, 0.05), DVec3::new(-3.0, 0.0, 7.0)),
        map(DVec3::splat(1e-6), DVec3::ZERO),
        map(DVec3::splat(1e9), DVec3::splat(1e9)),
        map(DVec3::splat(1e-3), DVec3::splat(10.0)),
        map(DVec3::new(100.0, -300.0, 50.0), far),
        map(DVec3::splat(1.0), far),
    ]
}

/// The thing in a group, instanced through two levels whose product is `placed`.
fn instanced(placed: &Transform, add: impl Fn(&mut WorldBuilder, GroupId)) -> World {
    let mut builder = WorldBuilder::default();
    let (outer, inner) = (builder.add_group(), builder.add_group());
    let extra = Transform::translation(DVec3::new(1e4, -3e3, 77.0));
    builder.add_instance(WorldBuilder::ROOT, outer, placed.compose(&extra.inverse()));
    builder.add_instance(outer, inner, extra);
    add(&mut builder, inner);
    default_world(builder)
}

/// Rays at the thing from outside, each with what it hit.
fn hits_on(world: &World, placed: &Transform, n: usize) -> Vec<(Ray, Hit)> {
    let mut random = Random(99);
    let rays = (0..n).map(|_| {
        let from = placed.point(random.direction().as_dvec3() * 3.0).as_vec3();
        let to = placed.point(random.point(0.5).as_dvec3()).as_vec3();
        Ray::new(from, to - from)
    });
    rays.map(|r| (r, world.closest_one(&r, &AcceptAll))).filter(|(_, h)| h.is_hit()).collect()
}

#[test]
fn a_ray_that_leaves_a_triangle_never_hits_it_again() {
    for placed in placements() {
        // Once around the origin of its own coordinates, once away from it.
        for center in [Vec3::ZERO, Vec3::new(0.0, 0.0, 1.0)] {
            let mesh = Arc::new(sphere_mesh(center, 1.0, 12, 24));
            let world = instanced(&placed, |b, g| {
                b.add_mesh(g, mesh.clone());
            });
            let hits = hits_on(&world, &placed, 400);
            assert!(hits.len() > 150, "{}", hits.len());
            let mut random = Random(7);
            for (ray, hit) in hits {
                let surface = world.interaction(&ray, &hit);
                for _ in 0..8 {
                    let d = random.direction();
                    let next = Ray::new(surface.ray_origin(d), d);
                    let all = world.all_one(&next, &AcceptAll);
                    let same = all.iter().find(|h| h.primitive == hit.primitive);
                    assert!(same.is_none(), "{placed:?} {hit:?} {next:?} {same:?}");
                    if d.dot(surface.geometric_normal) > 1e-3 {
                        assert_eq!(all, [], "convex: nothing lies outside");
                    }
                }
            }
        }
    }
}

#[test]
fn a_ray_that_leaves_a_sphere_meets_it_only_on_the_other_side() {
    for placed in placements() {
        for radius in [1.0, 1e-3, 250.0] {
            let placed =
                placed.compose(&Transform::new(DAffine3::from_scale(DVec3::splat(1.0 / radius))).expect("map"));
            let world = instanced(&placed, |b, g| {
                b.add_shape(g, Arc::new(Sphere { radius }), Transform::IDENTITY);
            });
            let outside = placed.compose(&Transform::new(DAffine3::from_scale(DVec3::splat(radius))).expect("map"));
            let hits = hits_on(&world, &outside, 200);
            assert!(hits.len() > 100);
            let mut random = Random(7);
            for (ray, hit) in hits {
                let surface = world.interaction(&ray, &hit);
                for _ in 0..8 {
                    let d = random.direction();
                    let cos = d.dot(surface.geometric_normal);
                    let next = Ray::new(surface.ray_origin(d), d);
                    let count = world.all_one(&next, &AcceptAll).len();
                    if cos.abs() > 1e-3 {
                        assert_eq!(count, usize::from(cos < 0.0), "{placed:?} {next:?} {cos}");
                    }
                }
            }
        }
    }
}

#[test]
fn normals_point_outward_under_every_transform() {
    for placed in placements() {
        let mut mesh = sphere_mesh(Vec3::ZERO, 1.0, 40, 80);
        mesh.normals = mesh.positions.clone();
        // Some authors' normals point inward: the shading normal still keeps to the geometric side.
        mesh.normals.iter_mut().step_by(3).for_each(|n| *n = -*n);
        let (mesh, sphere) = (Arc::new(mesh), Arc::new(Sphere { radius: 1.0 }));
        let worlds = [
            instanced(&placed, |b, g| {
                b.add_mesh(g, mesh.clone());
            }),
            instanced(&placed, |b, g| {
                b.add_shape(g, sphere.clone(), Transform::IDENTITY);
            }),
        ];
        for world in &worlds {
            for (ray, hit) in hits_on(world, &placed, 200) {
                let s = world.interaction(&ray, &hit);
                let outward = match world.geometry(GeometryId(0)) {
                    Geometry::Mesh(mesh) => {
                        let [a, b, c] = mesh.corners(hit.primitive as usize).map(|p| placed.point(p.as_dvec3()));
                        let n = (b - a).cross(c - a);
                        if n.dot(a - placed.point(DVec3::ZERO)) < 0.0 { -n } else { n }
                    }
                    _ => placed.normal(placed.inverse().point(s.position.as_dvec3())),
                };
                let expected = outward.normalize().as_vec3();
                // Far away positions are coarse.
                assert!(s.geometric_normal.dot(expected) > 0.999, "{placed:?} {} {expected}", s.geometric_normal);
                assert!(s.geometric_normal.is_normalized() && s.shading_normal.is_normalized());
                assert!(s.shading_normal.dot(s.geometric_normal) >= 0.0);
                assert!(s.is_front_facing(ray.direction));
                assert!(s.dpdu.is_finite() && s.dpdu != Vec3::ZERO && s.dpdv != Vec3::ZERO);
            }
        }
    }
}

#[test]
fn errata_e5_directions_keep_their_parameter_and_normals_do_not_follow_directions() {
    // The lecture transforms directions by the inverse transpose; that is for normals only.
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Z);
    let placed = Transform::new(DAffine3 { matrix3: shear, translation: DVec3::ZERO }).expect("invertible");
    let mesh = TriangleMesh {
        positions: vec![Vec3::new(0.0, -9.0, -9.0), Vec3::new(0.0, 9.0, -9.0), Vec3::new(0.0, 0.0, 9.0)],
        indices: vec![[0, 1, 2]],
        ..TriangleMesh::default()
    };
    let mut builder = WorldBuilder::default();
    let group = builder.add_group();
    builder.add_mesh(group, Arc::new(mesh));
    builder.add_instance(WorldBuilder::ROOT, group, placed);
    let world = default_world(builder);
    let ray = Ray::new(Vec3::new(-2.0, 1.0, 0.0), Vec3::new(0.5, 0.0, 0.0));
    let hit = world.closest_one(&ray, &AcceptAll);
    // The plane x = 0 becomes x = y.
    assert_eq!(hit.t, 6.0);
    let s = world.interaction(&ray, &hit);
    assert!((s.position - Vec3::new(1.0, 1.0, 0.0)).length() < 1e-6);
    assert!((s.geometric_normal - Vec3::new(1.0, -1.0, 0.0).normalize()).length() < 1e-6);
}

#[test]
fn attributes_are_interpolated() {
    let mesh = TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 4.0],
        indices: vec![[0, 1, 2]],
        normals: vec![Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::Z],
        tangents: vec![Vec3::X.extend(-1.0); 3],
        uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::Y], vec![Vec2::ONE, Vec2::ONE * 3.0, Vec2::ONE]],
        colors: vec![[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 0.0]],
        material_slots: Vec::new(),
    };
    let world = mesh_world(mesh);
    let ray = Ray::new(Vec3::new(0.5, 1.0, 5.0), -Vec3::Z);
    let hit = world.closest_one(&ray, &AcceptAll);
    assert_eq!((hit.t, hit.uv), (5.0, Vec2::splat(0.25)));
    let s = world.interaction(&ray, &hit);
    assert_eq!((s.position, s.geometric_normal), (Vec3::new(0.5, 1.0, 0.0), Vec3::Z));
    assert!((s.shading_normal - Vec3::new(0.25, 0.0, 1.0).normalize()).length() < 1e-6);
    assert_eq!(s.uv, [Vec2::splat(0.25), Vec2::splat(1.5)]);
    assert_eq!((s.dpdu, s.dpdv), (Vec3::X * 2.0, Vec3::Y * 4.0));
    assert_eq!(s.tangent, Some((Vec3::X, -1.0)));
    assert_eq!(s.color, [0.25, 0.5, 0.0, 0.75]);
}

/// A chain of groups, each holding the next, with a sphere in the last.
fn chain(length: usize) -> WorldBuilder {
    let mut builder = WorldBuilder::default();
    let mut group = WorldBuilder::ROOT;
    for i in 0..length {
        let child = builder.add_group();
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        builder.add_instance(group, child, Transform::translation(DVec3::X * side));
        group = child;
    }
    builder.add_shape(group, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
    builder
}

#[test]
fn instances_nest_512_deep_and_no_deeper() {
    let ray = Ray::new(Vec3::new(0.0, 0.0, -5.0), Vec3::Z);
    for accelerator in AcceleratorKind::ALL {
        let world = build(chain(512), accelerator, Level::best());
        let hit = world.closest_one(&ray, &AcceptAll);
        assert_eq!((hit.t, hit.instance, hit.geometry), (4.0, 512, 0));
        assert_eq!(world.instance_path(512).len(), 512);
        let s = world.interaction(&ray, &hit);
        assert!((s.position + Vec3::Z).length() < 1e-6 && s.geometric_normal == -Vec3::Z);
    }
    let error = chain(513).build(&BuildOptions::default()).expect_err("too deep");
    assert!(matches!(&error, WorldError::Limit(text) if text.contains("512")), "{error}");
}

#[test]
fn cycles_are_refused() {
    let mut builder = WorldBuilder::default();
    let (a, b) = (builder.add_group(), builder.add_group());
    builder.add_instance(WorldBuilder::ROOT, a, Transform::IDENTITY);
    builder.add_instance(a, b, Transform::IDENTITY);
    builder.add_instance(b, a, Transform::IDENTITY);
    assert!(matches!(builder.build(&BuildOptions::default()), Err(WorldError::Cycle(_))));
}

#[test]
fn too_many_occurrences_are_refused() {
    let mut builder = WorldBuilder::default();
    let mut group = WorldBuilder::ROOT;
    for _ in 0..40 {
        let child = builder.add_group();
        builder.add_instance(group, child, Transform::IDENTITY);
        builder.add_instance(group, child, Transform::IDENTITY);
        group = child;
    }
    assert_eq!(builder.build(&BuildOptions::default()).err(), Some(WorldError::TooManyInstances));
}

#[test]
fn occurrences_are_numbered_depth_first() {
    let world = default_world(nested_scene(1));
    // The textbook enumeration.
    fn visit(world: &World, group: GroupId, path: &mut Vec<(GroupId, usize)>, all: &mut Vec<Vec<(GroupId, usize)>>) {
        all.push(path.clone());
        for (i, instance) in world.group(group).instances.iter().enumerate() {
            path.push((group, i));
            visit(world, instance.child, path, all);
            path.pop();
        }
    }
    let mut all = Vec::new();
    visit(&world, GroupId(0), &mut Vec::new(), &mut all);
    assert_eq!(all.len(), world.instance_count() as usize);
    for (number, path) in all.iter().enumerate() {
        assert_eq!(&world.instance_path(number as u32), path);
        let composed = path
            .iter()
            .fold(Transform::IDENTITY, |m, &(group, i)| m.compose(&world.group(group).instances[i].group_from_child));
        let p = DVec3::new(0.3, 0.2, 0.1);
        assert!((composed.point(p) - world.world_from_instance(number as u32).point(p)).length() < 1e-12);
    }
}

/// Rejects some primitives, and checks what it is told.
struct Cutout {
    reject: Vec<u32>,
    geometry: u32,
}

impl HitFilter for Cutout {
    fn accept(&self, ray: &Ray, hit: &Hit) -> bool {
        assert_eq!((hit.geometry, ray.origin), (self.geometry, Vec3::new(0.1, 0.1, 0.0)));
        !self.reject.contains(&hit.primitive)
    }
}

#[test]
fn the_filter_decides_about_marked_geometries_only() {
    // Ten sheets one behind the other, the first two in an unmarked geometry if seen from the other side.
    let sheets = |first: u32, n: u32| {
        let mut mesh = TriangleMesh::default();
        for i in 0..n {
            let z = (first + i) as f32;
            mesh.positions.extend([Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z)]);
            mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        Arc::new(mesh)
    };
    for accelerator in AcceleratorKind::ALL {
        let mut builder = WorldBuilder::default();
        let group = builder.add_group();
        builder.add_instance(WorldBuilder::ROOT, group, Transform::IDENTITY);
        let cut = builder.add_mesh(group, sheets(1, 20));
        builder.add_mesh(group, sheets(21, 1));
        builder.set_filtered(cut);
        let world = build(builder, accelerator, Level::best());
        let ray = Ray::new(Vec3::new(0.1, 0.1, 0.0), Vec3::Z);
        let ask = |reject: Vec<u32>| Cutout { reject, geometry: cut.0 };
        let closest = |reject: Vec<u32>| {
            let h = world.closest_one(&ray, &ask(reject));
            (h.t, h.geometry, h.primitive)
        };
        assert_eq!(closest(vec![]), (1.0, 0, 0));
        assert_eq!(closest(vec![0, 1, 3]), (3.0, 0, 2));
        assert_eq!(closest((0..20).collect()), (21.0, 1, 0));
        assert!(world.occluded_one(&ray, &ask((0..20).collect())));
        assert!(!world.occluded_one(&ray.with_t_max(20.5), &ask((0..20).collect())));
        assert_eq!(world.all_one(&ray, &ask(vec![4])).len(), 20);
    }
}

#[test]
fn a_rejected_crossing_of_a_shape_uncovers_the_next_one() {
    struct FarSide;
    impl HitFilter for FarSide {
        fn accept(&self, _: &Ray, hit: &Hit) -> bool {
            hit.t > 5.0
        }
    }
    for accelerator in AcceleratorKind::ALL {
        let mut builder = WorldBuilder::default();
        let id = builder.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
        builder.set_filtered(id);
        let world = build(builder, accelerator, Level::best());
        let ray = Ray::new(Vec3::new(0.0, 0.0, -5.0), Vec3::Z);
        assert_eq!(world.closest_one(&ray, &FarSide).t, 6.0);
        assert_eq!(world.all_one(&ray, &AcceptAll).iter().map(|h| h.t).collect::<Vec<_>>(), [4.0, 6.0]);
    }
}

#[test]
fn masks_of_rays_choose_geometries_and_instances() {
    let sheet = |z: f32| {
        let positions = vec![Vec3::new(-9.0, -9.0, z), Vec3::new(9.0, -9.0, z), Vec3::new(0.0, 9.0, z)];
        Arc::new(TriangleMesh { positions, indices: vec![[0, 1, 2]], ..Default::default() })
    };
    for accelerator in AcceleratorKind::ALL {
        let mut builder = WorldBuilder::default();
        let near = builder.add_mesh(WorldBuilder::ROOT, sheet(1.0));
        builder.set_mask(near, 0b001);
        let child = builder.add_group();
        let inner = builder.add_mesh(child, sheet(2.0));
        builder.set_mask(inner, 0b110);
        builder.add(WorldBuilder::ROOT, Instance { mask: 0b010, ..Instance::new(child, Transform::IDENTITY) });
        builder.add_shape(
            WorldBuilder::ROOT,
            Arc::new(Sphere { radius: 1.0 }),
            Transform::translation(DVec3::new(0.0, 0.0, 6.0)),
        );
        let world = build(builder, accelerator, Level::best());
        let rays = vec![Ray::new(Vec3::ZERO, Vec3::Z); 40];
        let masks: Vec<u32> = (0..40).map(|i| [u32::MAX, 0b001, 0b010, 0b100, 0][i % 5]).collect();
        let expected = [1.0, 1.0, 2.0, 5.0, f32::INFINITY];
        let queries = Rays::new(&rays).with_masks(&masks);
        let mut hits = vec![Hit::MISS; 40];
        world.closest(queries, Grouping::None, &AcceptAll, &mut hits);
        let mut blocked = vec![false; 40];
        world.occluded(queries, Grouping::None, &AcceptAll, &mut blocked);
        for i in 0..40 {
            assert_eq!(hits[i].t, expected[i % 5], "{accelerator:?}, mask {:b}", masks[i]);
            assert_eq!(world.closest_one(queries.get(i), &AcceptAll), hits[i]);
            assert_eq!(blocked[i], i % 5 != 4);
        }
    }
}

#[test]
fn invalid_and_extreme_rays_end_in_an_answer() {
    let mut builder = nested_scene(3);
    let mut broken = sphere_mesh(Vec3::ZERO, 1.0, 6, 8);
    broken.positions[3].x = f32::NAN;
    broken.positions[9].y = f32::INFINITY;
    broken.positions.extend([Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::splat(3e38), -Vec3::splat(3e38)]);
    let n = broken.positions.len() as u32;
    broken.indices.extend([[n - 5, n - 4, n - 3], [n - 5; 3], [n - 1, n - 2, n - 4], [0, 5, n - 1]]);
    let skipped = broken.degenerate_triangles();
    assert!(skipped > 4);
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(broken));
    let world = default_world(builder);
    assert!(world.skipped_triangles() >= skipped as u64);
    let special = [0.0, -0.0, 1e-45, 1e-30, 1.0, -1.0, 1e30, 3e38, f32::INFINITY, f32::NAN];
    for i in 0..20_000u32 {
        let pick = |k: u32| special[pcg4d([i, k, 1, 2])[0] as usize % special.len()];
        let ray = Ray {
            origin: Vec3::new(pick(0), pick(1), pick(2)),
            direction: Vec3::new(pick(3), pick(4), pick(5)),
            t_min: pick(6),
            t_max: if i % 2 == 0 { f32::INFINITY } else { pick(7) },
        };
        let hit = world.closest_one(&ray, &AcceptAll);
        assert_eq!(world.occluded_one(&ray, &AcceptAll), hit.is_hit());
        assert!(ray.is_valid() || !hit.is_hit());
        if hit.is_hit() {
            assert!(hit.t > ray.t_min && hit.t < ray.t_max);
            let s = world.interaction(&ray, &hit);
            let finite = [s.position, s.position_error, s.geometric_normal, s.shading_normal, s.dpdu, s.dpdv];
            assert!(finite.iter().all(|v| v.is_finite()), "{ray:?} {s:?}");
        }
    }
}

#[test]
fn the_cost_of_a_ray_is_counted() {
    let mesh = sphere_mesh(Vec3::ZERO, 1.0, 40, 80);
    let triangles = mesh.indices.len() as u32;
    let ray = Ray::new(Vec3::new(0.1, 0.2, -5.0), Vec3::Z);
    let (hit, cost) = mesh_world(mesh.clone()).closest_counted(&ray, &AcceptAll);
    assert!(hit.is_hit() && cost.nodes_visited >= 3 && cost.primitives_tested > 0 && cost.primitives_tested < 100);
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    let (same, cost) = build(builder, AcceleratorKind::None, Level::Scalar).closest_counted(&ray, &AcceptAll);
    assert_eq!((same, cost.nodes_visited, cost.primitives_tested), (hit, 0, triangles));
}

#[test]
fn triangles_are_counted_once_and_as_often_as_they_occur() {
    let mut builder = WorldBuilder::default();
    let group = builder.add_group();
    builder.add_mesh(group, Arc::new(sphere_mesh(Vec3::ZERO, 1.0, 4, 8)));
    for i in 0..5 {
        builder.add_instance(WorldBuilder::ROOT, group, Transform::translation(DVec3::X * f64::from(i)));
    }
    let world = default_world(builder);
    assert_eq!((world.triangle_count(), world.instanced_triangle_count()), (48, 240));
    assert!(world.memory_bytes() > 0 && world.stats().nodes > 0);
}

#[test]
fn batches_answer_as_single_rays_do() {
    let world = default_world(nested_scene(2));
    let mut random = Random(3);
    let rays: Vec<_> = (0..333).map(|_| Ray::new(random.point(5.0), random.direction())).collect();
    let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    world.occluded(&rays, Grouping::None, &AcceptAll, &mut blocked);
    for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked) {
        assert_eq!(bits(hit), bits(&world.closest_one(ray, &AcceptAll)));
        assert_eq!(*blocked, world.occluded_one(ray, &AcceptAll));
    }
}

mod properties {
    use super::*;
    use proptest::prelude::*;

    /// On a lattice, so that rays meet edges, vertices and flat boxes all the time.
    fn lattice_point() -> impl Strategy<Value = Vec3> {
        [-3i8..=3, -3i8..=3, -3i8..=3].prop_map(|p| Vec3::from_array(p.map(f32::from)))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn lattices_are_hit_alike_by_every_structure_level_and_batch(
            positions in proptest::collection::vec(lattice_point(), 3..20),
            corners in proptest::collection::vec(proptest::array::uniform3(0u32..1000), 1..60),
            rays in proptest::collection::vec((lattice_point(), lattice_point(), -1i8..3), 20..40),
        ) {
            let n = positions.len() as u32;
            let indices = corners.iter().map(|t| t.map(|i| i % n)).collect();
            let mesh = Arc::new(TriangleMesh { positions, indices, ..TriangleMesh::default() });
            let make = |accelerator, simd| {
                let mut builder = WorldBuilder::default();
                builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
                build(builder, accelerator, simd)
            };
            let rays: Vec<_> =
                rays.into_iter().map(|(o, d, t_min)| Ray { t_min: t_min.into(), ..Ray::new(o, d) }).collect();
            let oracle = make(AcceleratorKind::None, Level::Scalar);
            for level in levels() {
                let world = make(AcceleratorKind::Bvh, level);
                let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
                world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
                world.occluded(&rays, Grouping::None, &AcceptAll, &mut blocked);
                for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(blocked) {
                    let expected = oracle.closest_one(ray, &AcceptAll);
                    prop_assert_eq!(bits(hit), bits(&expected), "{} {:?}", level, ray);
                    prop_assert_eq!(bits(&world.closest_one(ray, &AcceptAll)), bits(&expected));
                    prop_assert_eq!(blocked, expected.is_hit());
                }
            }
        }
    }
}

#[test]
fn batches_with_rejections_agree_with_the_oracle() {
    struct Sieve;
    impl HitFilter for Sieve {
        fn accept(&self, _: &Ray, hit: &Hit) -> bool {
            hash32(hit.primitive ^ hit.instance) & 3 != 0
        }
    }
    let make = |accelerator, simd| {
        let mut builder = nested_scene(7);
        (0..builder.geometries.len() as u32).step_by(2).for_each(|g| builder.set_filtered(GeometryId(g)));
        build(builder, accelerator, simd)
    };
    let oracle = make(AcceleratorKind::None, Level::Scalar);
    let mut random = Random(11);
    let mut rays: Vec<_> = (0..400).map(|_| Ray::new(random.point(5.0), random.direction())).collect();
    rays.iter_mut().step_by(9).for_each(|r| r.direction = Vec3::ZERO);
    for level in levels() {
        let world = make(AcceleratorKind::Bvh, level);
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        world.closest(&rays, Grouping::None, &Sieve, &mut hits);
        world.occluded(&rays, Grouping::None, &Sieve, &mut blocked);
        for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked) {
            let expected = oracle.closest_one(ray, &Sieve);
            assert_eq!((bits(hit), *blocked), (bits(&expected), expected.is_hit()), "{level} {ray:?}");
        }
    }
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let mesh = Arc::new(soup(&mut Random(1), 90_000));
    let tree = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
        let world = pool.install(|| default_world(builder));
        let Structure::Bvh(forest) = &world.structure else { panic!("a tree") };
        let node = |n: &crate::kernel::node::WideNode| (n.children, n.bounds.map(|s| s.map(|a| a.map(f32::to_bits))));
        let nodes: Vec<_> = forest.trees[0].nodes.iter().map(node).collect();
        (nodes, forest.trees[0].blocks.iter().map(|b| b.ids).collect::<Vec<_>>())
    };
    assert!(tree(1) == tree(4));
}

#[test]
fn a_ray_that_leaves_a_shape_does_not_find_it_where_it_starts() {
    for shape in AnyShape::examples() {
        let size = shape.bounds().size().max_element();
        let size = if size.is_finite() { 2.0 / size } else { 1.0 };
        let shape = Arc::new(shape);
        for placed in placements() {
            let world = instanced(&placed, |b, g| {
                b.add_shape(g, shape.clone(), scaling(size));
            });
            let mut random = Random(7);
            for (ray, hit) in hits_on(&world, &placed, 60) {
                let surface = world.interaction(&ray, &hit);
                for _ in 0..6 {
                    let d = random.direction();
                    if d.dot(surface.geometric_normal).abs() < 1e-2 {
                        continue;
                    }
                    let next = Ray::new(surface.ray_origin(d), d);
                    let again = world.closest_one(&next, &AcceptAll);
                    let from = placed.inverse().ray(&DRay::from(&next));
                    let way = from.direction.length() * f64::from(again.t);
                    // Edges and apexes are near in earnest, but not at the very start.
                    let coarse = placed.inverse().vector(surface.position_error.as_dvec3()).length();
                    let found = again.primitive == hit.primitive && way < 1e-9 + 0.5 * coarse;
                    assert!(!found, "{shape:?} {placed:?} {hit:?} {next:?} {again:?} {way}");
                }
            }
        }
    }
}
