//! Tests of heightfields in worlds, against the meshes of their triangles.

use super::{Random, agree, worlds};
use crate::geometry::{Heightfield, HeightfieldError, HeightfieldMesh, Heights};
use crate::hit::{DHit, DNearestPoint, Hit, NearestPoint};
use crate::mesh::TriangleMesh;
use crate::search::AcceptAll;
use crate::search::points::Points;
use crate::world::{BuildOptions, GeometryId, World, WorldBuilder};
use crate::{DWorld, DWorldBuilder};
use snell_math::{DAffine3, DMat3, DRay, DVec3, Ray, Vec3};
use std::sync::Arc;

/// A random raster, some of it without data, at `offset` from the origin.
fn random_field(seed: u32, offset: f64) -> Heightfield {
    let mut random = Random(seed * 1000);
    let mut number = |low: f32, high: f32| random.range(low, high);
    let (rows, columns) = (number(2.0, 40.0) as usize, number(2.0, 40.0) as usize);
    let holes = if seed.is_multiple_of(3) { 0.0 } else { 0.1 };
    let (rough, cell) = ([0.1, 2.0, 30.0][seed as usize % 3], [1.0, 10.0, 0.3][seed as usize % 3]);
    let heights: Vec<f64> = (0..rows * columns)
        .map(|i| {
            let wave = ((i % columns) as f64 * 0.3).sin() * ((i / columns) as f64 * 0.2).cos();
            let z = 10.0 * wave + f64::from(number(-rough, rough));
            if number(0.0, 1.0) < holes { f64::NAN } else { z }
        })
        .collect();
    let heights = if seed.is_multiple_of(2) {
        Heights::Single(heights.into_iter().map(|z| z as f32).collect())
    } else {
        Heights::of_doubles(heights)
    };
    let turn = DMat3::from_rotation_z(f64::from(number(0.0, 6.3)));
    let shear = DMat3::from_cols(
        DVec3::X * cell,
        DVec3::new(f64::from(number(-0.3, 0.3)), 1.0, 0.0)
            * if seed.is_multiple_of(4) { cell } else { -cell },
        DVec3::Z,
    );
    let tilt = if seed % 5 == 4 { DMat3::from_rotation_x(0.4) } else { DMat3::IDENTITY };
    let map =
        DAffine3 { matrix3: tilt * turn * shear, translation: DVec3::new(0.9, 1.0, 0.0) * offset };
    Heightfield::new(rows, columns, heights, map).expect("valid")
}

/// Rays at, along and away from the surface, and through its nodes and edges.
fn random_rays(field: &Heightfield, seed: u32) -> Vec<DRay> {
    let mut random = Random(seed * 1000 + 500);
    let bounds = field.bounds();
    let size = bounds.size().max(DVec3::ONE);
    let mut rays = Vec::new();
    let in_box = |random: &mut Random, grown: f64| {
        let place = DVec3::new(random.unit().into(), random.unit().into(), random.unit().into());
        bounds.center() + (place - 0.5) * size * grown
    };
    let mut all_nodes = (0..field.rows())
        .flat_map(|row| (0..field.columns()).map(move |column| (row, column)))
        .map(|(row, column)| field.node(row, column))
        .filter(|p| p.is_finite())
        .step_by(7)
        .take(120);
    for i in 0..500 {
        let from = in_box(&mut random, if i % 2 == 0 { 1.0 } else { 4.0 });
        let to = in_box(&mut random, 1.0);
        rays.push(DRay::new(from, to - from));
        // Down, up, and nearly along the ground.
        let up = if i % 3 == 0 { -1.0 } else { 1.0 };
        rays.push(DRay::new(from + DVec3::Z * size.z * 4.0 * up, DVec3::new(0.0, 0.0, -up)));
        let flat = random.direction().as_dvec3() * DVec3::new(1.0, 1.0, 0.02);
        rays.push(DRay {
            t_max: 3.0 * size.max_element(),
            ..DRay::new(in_box(&mut random, 1.0), flat)
        });
        let axis = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y][i % 4];
        rays.push(DRay { t_min: 0.5, ..DRay::new(in_box(&mut random, 1.5), axis) });
    }
    let mut last = None;
    for node in all_nodes.by_ref() {
        rays.push(DRay::new(node + DVec3::Z * 50.0, DVec3::NEG_Z));
        rays.push(DRay::new(in_box(&mut random, 3.0), DVec3::ZERO));
        let ray = rays.last_mut().expect("one was added");
        ray.direction = node - ray.origin;
        if let Some(last) = last {
            rays.push(DRay::new(node, last - node));
        }
        last = Some(node);
    }
    rays.retain(DRay::is_valid);
    rays
}

fn double_worlds(field: &Arc<Heightfield>, mesh: &HeightfieldMesh) -> [DWorld; 2] {
    let (mut ours, mut theirs) = (DWorldBuilder::default(), DWorldBuilder::default());
    ours.add_heightfield(DWorldBuilder::ROOT, field.clone());
    theirs.add_mesh(DWorldBuilder::ROOT, Arc::new(mesh.mesh.clone()));
    [ours, theirs].map(|builder| builder.build(&BuildOptions::default()).expect("a world"))
}

/// The mesh in single precision.
fn rounded(mesh: &HeightfieldMesh) -> Arc<TriangleMesh> {
    Arc::new(TriangleMesh {
        positions: mesh.mesh.positions.iter().map(|p| p.as_vec3()).collect(),
        indices: mesh.mesh.indices.clone(),
        ..TriangleMesh::default()
    })
}

fn single_worlds(field: &Arc<Heightfield>, mesh: &HeightfieldMesh) -> [World; 2] {
    let (mut ours, mut theirs) = (WorldBuilder::default(), WorldBuilder::default());
    ours.add_heightfield(WorldBuilder::ROOT, field.clone());
    theirs.add_mesh(WorldBuilder::ROOT, rounded(mesh));
    [ours, theirs].map(|builder| builder.build(&BuildOptions::default()).expect("a world"))
}

#[test]
fn rays_hit_the_triangles_as_those_of_a_mesh_bit_for_bit() {
    let mut met = [0; 2];
    for seed in 0..40 {
        for offset in [0.0, 5e6] {
            let field = Arc::new(random_field(seed, offset));
            let mesh = field.to_mesh();
            let named = |mut hit: DHit| {
                hit.primitive = mesh.numbers[hit.primitive as usize];
                hit
            };
            let [ours, theirs] = double_worlds(&field, &mesh);
            assert_eq!(ours.stats().triangles, theirs.stats().triangles);
            for ray in random_rays(&field, seed) {
                let expected: Vec<_> =
                    theirs.all_one(&ray, &AcceptAll).into_iter().map(named).collect();
                assert_eq!(ours.all_one(&ray, &AcceptAll), expected, "{seed} {offset} {ray:?}");
                let nearest = expected.first().copied().unwrap_or(DHit::MISS);
                assert_eq!(ours.closest_one(&ray, &AcceptAll), nearest, "{seed} {ray:?}");
                assert_eq!(ours.occluded_one(&ray, &AcceptAll), !expected.is_empty());
                let mut count = [0];
                ours.count(&[ray][..], &AcceptAll, &mut count);
                assert_eq!(count[0] as usize, expected.len());
                met[0] += expected.len();
            }
            let named = |mut hit: Hit| {
                hit.primitive = mesh.numbers[hit.primitive as usize];
                hit
            };
            let [ours, theirs] = single_worlds(&field, &mesh);
            for ray in random_rays(&field, seed) {
                let ray = Ray {
                    t_min: ray.t_min as f32,
                    t_max: ray.t_max as f32,
                    ..Ray::new(ray.origin.as_vec3(), ray.direction.as_vec3())
                };
                let expected: Vec<_> =
                    theirs.all_one(&ray, &AcceptAll).into_iter().map(named).collect();
                assert_eq!(ours.all_one(&ray, &AcceptAll), expected, "{seed} {offset} {ray:?}");
                let nearest = expected.first().copied().unwrap_or(Hit::MISS);
                assert_eq!(ours.closest_one(&ray, &AcceptAll), nearest, "{seed} {ray:?}");
                assert_eq!(ours.occluded_one(&ray, &AcceptAll), !expected.is_empty());
                met[1] += expected.len();
            }
        }
    }
    assert!(met[0] > 50_000 && met[1] > 50_000, "many are hit: {met:?}");
}

#[test]
fn every_structure_and_level_finds_the_same_hits_on_heightfields() {
    for seed in [1, 2, 3] {
        let field = Arc::new(random_field(seed, 100.0));
        let ball = Arc::new(crate::Spheres {
            spheres: vec![field.bounds().center().as_vec3().extend(3.0)],
            ..crate::Spheres::default()
        });
        let worlds = worlds(|builder| {
            builder.add_set(WorldBuilder::ROOT, ball.clone());
            builder.add_heightfield(WorldBuilder::ROOT, field.clone());
            let group = builder.add_group();
            builder.add_heightfield(group, field.clone());
            let place = snell_math::Transform::translation(DVec3::new(3.0, 5.0, 20.0));
            builder.add_instance(WorldBuilder::ROOT, group, place);
        });
        let rays: Vec<Ray> = random_rays(&field, seed)
            .iter()
            .map(|ray| Ray::new(ray.origin.as_vec3(), ray.direction.as_vec3()))
            .collect();
        let met = agree(&worlds, &rays, &vec![0.0; rays.len()]);
        assert!(met > 300, "{met} of {} rays hit", rays.len());
    }
}

#[test]
fn the_nearest_points_are_those_of_the_mesh() {
    for seed in 0..12 {
        for offset in [0.0, 5e6] {
            let field = Arc::new(random_field(seed, offset));
            let mesh = field.to_mesh();
            let points: Vec<DVec3> =
                random_rays(&field, seed).iter().step_by(5).map(|ray| ray.origin).collect();
            let [ours, theirs] = double_worlds(&field, &mesh);
            let mut found = [(); 2].map(|()| vec![DNearestPoint::NONE; points.len()]);
            ours.nearest_point(Points::of_doubles(&points), &mut found[0]);
            theirs.nearest_point(Points::of_doubles(&points), &mut found[1]);
            for (ours, theirs) in found[0].iter().zip(&found[1]) {
                let primitive = mesh.numbers[theirs.primitive as usize];
                assert_eq!(*ours, DNearestPoint { primitive, ..*theirs });
            }
            let points: Vec<Vec3> = points.iter().map(|p| p.as_vec3()).collect();
            let [ours, theirs] = single_worlds(&field, &mesh);
            let mut found = [(); 2].map(|()| vec![NearestPoint::NONE; points.len()]);
            ours.nearest_point(Points::new(&points), &mut found[0]);
            theirs.nearest_point(Points::new(&points), &mut found[1]);
            for (ours, theirs) in found[0].iter().zip(&found[1]) {
                let primitive = mesh.numbers[theirs.primitive as usize];
                assert_eq!(*ours, NearestPoint { primitive, ..*theirs });
            }
        }
    }
}

#[test]
fn a_ray_from_above_crosses_a_whole_surface_once_whatever_it_goes_through() {
    let heights = (0..33 * 25).map(|i| ((i * 37) % 101) as f32 * 0.25).collect();
    let map = DAffine3 {
        matrix3: DMat3::from_diagonal(DVec3::new(2.0, -2.0, 1.0)),
        translation: DVec3::new(448_000.0, 5_412_000.0, 0.0),
    };
    let field = Heightfield::new(33, 25, Heights::Single(heights), map).expect("valid");
    let mut builder = DWorldBuilder::default();
    builder.add_heightfield(DWorldBuilder::ROOT, Arc::new(field));
    let world = builder.build(&BuildOptions::default()).expect("a world");
    // Through nodes, edges, diagonals and the borders of blocks.
    for row in 1..128 {
        for column in 1..96 {
            let grid = DVec3::new(f64::from(column) / 4.0 + 0.5, f64::from(row) / 4.0 + 0.5, 0.0);
            let place = map.transform_point3(grid).with_z(1000.0);
            for direction in [DVec3::NEG_Z, DVec3::new(1e-3, 2e-3, -1.0)] {
                let hits = world.all_one(&DRay::new(place, direction), &AcceptAll);
                let is_near_border = row > 124 || column > 92 || row < 4 || column < 4;
                assert!(
                    hits.len() == 1 || (is_near_border && direction.x > 0.0),
                    "{row} {column}: {hits:?}"
                );
            }
        }
    }
    let mut inside = [true];
    let below = [DVec3::new(448_020.0, 5_411_980.0, -5.0)];
    world.occupancy(Points::of_doubles(&below), &mut inside);
    assert_eq!(inside, [false], "a sheet has no inside");
}

#[test]
fn triangles_face_up_whatever_the_transform() {
    for seed in 0..8 {
        let field = Arc::new(random_field(seed, 0.0));
        let up = field.group_from_grid().matrix3.z_axis;
        for triangle in 0..2 * field.cell_count() {
            let Some([a, b, c]) = field.corners(triangle) else { continue };
            let normal = (b - a).cross(c - a);
            assert!(normal.dot(up) > 0.0, "{seed} {triangle}");
        }
        let mut builder = WorldBuilder::default();
        builder.add_heightfield(WorldBuilder::ROOT, field.clone());
        let world = builder.build(&BuildOptions::default()).expect("a world");
        assert!(matches!(world.geometry(GeometryId(0)), crate::Geometry::Heightfield(_)));
        let mut seen = 0;
        for ray in random_rays(&field, seed) {
            let ray = Ray::new(ray.origin.as_vec3(), ray.direction.as_vec3());
            let hit = world.closest_one(&ray, &AcceptAll);
            if hit.is_hit() {
                let surface = world.interaction(&ray, &hit);
                assert!(surface.geometric_normal.as_dvec3().dot(up) > 0.0);
                assert!(surface.uv[0].cmpgt(snell_math::Vec2::ZERO).all());
                seen += 1;
            }
        }
        assert!(seen > 100);
    }
}

#[test]
fn wrong_rasters_are_refused() {
    let made = |rows, columns, heights: Vec<f32>, map| {
        Heightfield::new(rows, columns, Heights::Single(heights), map).map(|_| ())
    };
    let flat = DAffine3::IDENTITY;
    assert_eq!(
        made(1, 3, vec![0.0; 3], flat),
        Err(HeightfieldError::TooSmall { rows: 1, columns: 3 })
    );
    assert_eq!(
        made(2, 3, vec![0.0; 5], flat),
        Err(HeightfieldError::WrongCount { rows: 2, columns: 3, found: 5 })
    );
    assert_eq!(
        made(1 << 16, 1 << 16, Vec::new(), flat),
        Err(HeightfieldError::TooLarge(0xfffe_0001))
    );
    let mut heights = vec![0.0; 6];
    heights[4] = f32::NEG_INFINITY;
    assert_eq!(
        made(2, 3, heights, flat),
        Err(HeightfieldError::Infinite { row: 1, column: 1, value: f64::NEG_INFINITY })
    );
    let collapsed = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    assert_eq!(made(2, 3, vec![0.0; 6], collapsed), Err(HeightfieldError::Singular));
    let far = DAffine3::from_translation(DVec3::splat(1e300));
    assert_eq!(made(2, 3, vec![0.0; 6], far), Err(HeightfieldError::TooFar));
    let nothing = Heightfield::new(2, 2, Heights::Single(vec![f32::NAN; 4]), flat).expect("valid");
    assert!(nothing.bounds().is_empty() && nothing.to_mesh().numbers.is_empty());
}
