//! Tests that every structure gives the same hits as `none`, bit for bit: random scenes of mixed
//! shapes, meshes and nested instances, at all scales, with degenerate and coincident triangles,
//! and rays chosen to be difficult. `SNELL_TEST_CASES` is the number of scenes (300 by default);
//! with `SNELL_TEST_BVH` set, the `bvh` is compared too, whose kernels have separate tests.

use super::AcceleratorOptions;
use crate::hit::Hit;
use crate::mesh::TriangleMesh;
use crate::search::{AcceptAll, Grouping};
use crate::shape::{AnyShape, Shape};
use crate::world::{AcceleratorKind, BuildOptions, GroupId, World, WorldBuilder};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use snell_math::rng::{hash32, pcg4d, to_unit};
use snell_math::simd::Level;
use snell_math::{DAffine3, DMat3, DVec3, Ray, Transform, Vec3};
use std::sync::Arc;

/// A sequence of pseudo-random numbers.
struct Random(u32);

impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(1);
        pcg4d([self.0, 11, 7, 5])[0]
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() as usize) % n
    }

    fn unit(&mut self) -> f32 {
        to_unit(self.bits())
    }

    fn signed(&mut self) -> f32 {
        self.unit() * 2.0 - 1.0
    }

    fn chance(&mut self, p: f32) -> bool {
        self.unit() < p
    }

    /// A coordinate in -1 to 1, often on a lattice, so that many coordinates coincide.
    fn coordinate(&mut self) -> f32 {
        if self.chance(0.5) { (self.below(9) as f32 - 4.0) * 0.25 } else { self.signed() }
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.coordinate(), self.coordinate(), self.coordinate())
    }

    fn transform(&mut self) -> Transform {
        let axis =
            Vec3::new(self.signed(), self.signed(), self.signed() + 1.5).as_dvec3().normalize();
        let turn = if self.chance(0.3) { 0.0 } else { f64::from(self.unit()) * 6.0 };
        let mut scale =
            DVec3::new(self.unit().into(), self.unit().into(), self.unit().into()) + 0.2;
        scale *= [1.0, 1.0, 1.0, 1e-3, 30.0][self.below(5)];
        let linear = DMat3::from_axis_angle(axis, turn) * DMat3::from_diagonal(scale);
        let map = DAffine3 { matrix3: linear, translation: self.point().as_dvec3() };
        Transform::new(map).expect("invertible")
    }
}

/// Triangles of many kinds: large, small, slivers, perpendicular to axes, degenerate, repeated, and
/// not finite.
fn soup(random: &mut Random, triangles: usize, scale: f32, center: Vec3) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..triangles as u32 {
        let a = random.point();
        let size = [1.0, 0.1, 0.01][random.below(3)];
        let (mut b, mut c) = (a + random.point() * size, a + random.point() * size);
        match random.below(8) {
            0 => (b, c) = (a + (b - a) * 5.0, a + (b - a) * 5.0 + random.point() * 1e-3),
            1 => {
                let axis = random.below(3);
                (b[axis], c[axis]) = (a[axis], a[axis]);
            }
            2 => c = b,
            3 if random.chance(0.3) => {
                c[random.below(3)] = [f32::NAN, f32::INFINITY][random.below(2)]
            }
            _ => {}
        }
        mesh.positions.extend([a, b, c].map(|p| p * scale + center));
        let repeats = i > 0 && random.chance(0.1);
        let first = if repeats { 3 * random.below(i as usize) as u32 } else { 3 * i };
        mesh.indices.push([first, first + 1, first + 2]);
    }
    mesh
}

/// A height field over a lattice, with shared edges and vertices and many coplanar triangles.
fn terrain(random: &mut Random, n: u32, scale: f32, center: Vec3) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for y in 0..=n {
        for x in 0..=n {
            let z = if random.chance(0.7) { 0.0 } else { random.signed() * 0.2 };
            let p = Vec3::new(x as f32, y as f32, 0.0) * (2.0 / n as f32) - Vec3::new(1.0, 1.0, -z);
            mesh.positions.push(p * scale + center);
        }
    }
    for y in 0..n {
        for x in 0..n {
            let [a, b, c, d] =
                [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| (y + j) * (n + 1) + x + i);
            mesh.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// A random scene, and points of it at which to aim rays.
fn scene(seed: u32) -> (WorldBuilder, Vec<Vec3>) {
    let mut random = Random(hash32(seed));
    let mut builder = WorldBuilder::default();
    let scale = [1.0, 1.0, 1.0, 1e-6, 1e9, 1e-20, 1e18][random.below(7)];
    let center = if random.chance(0.7) { Vec3::ZERO } else { random.point() * scale * 1000.0 };
    let mut points = Vec::new();
    let mut group = WorldBuilder::ROOT;
    let levels = 1 + random.below(3);
    for level in 0..levels {
        let (scale, center) = if level == 0 { (scale, center) } else { (1.0, Vec3::ZERO) };
        fill(&mut random, &mut builder, group, scale, center, &mut points);
        if level + 1 < levels {
            let child = builder.add_group();
            for _ in 0..1 + random.below(3) {
                let mut placed = random.transform();
                if level == 0 {
                    let to_scene = DAffine3 {
                        matrix3: DMat3::from_diagonal(DVec3::splat(scale.into())),
                        translation: center.as_dvec3(),
                    };
                    placed = Transform::new(to_scene).expect("invertible").compose(&placed);
                }
                builder.add_instance(group, child, placed);
            }
            group = child;
        }
    }
    points.extend((0..10).map(|_| random.point() * scale + center));
    (builder, points)
}

fn fill(
    random: &mut Random,
    builder: &mut WorldBuilder,
    group: GroupId,
    scale: f32,
    center: Vec3,
    points: &mut Vec<Vec3>,
) {
    for _ in 0..random.below(3) {
        let mesh = if random.chance(0.3) {
            let n = 1 + random.below(8) as u32;
            terrain(random, n, scale, center)
        } else {
            let n = 1 + random.below(80);
            soup(random, n, scale, center)
        };
        if group == WorldBuilder::ROOT {
            points.extend(mesh.positions.iter().take(30).filter(|p| p.is_finite()));
        }
        let mesh = Arc::new(mesh);
        builder.add_mesh(group, mesh.clone());
        if random.chance(0.2) {
            builder.add_mesh(group, mesh);
        }
    }
    for _ in 0..random.below(4) {
        let shapes = AnyShape::examples();
        let shape = shapes[random.below(shapes.len())].clone();
        let size = shape.bounds().size().max_element();
        let size = if size.is_finite() { f64::from(random.unit() + 0.01) / size } else { 1.0 };
        let map = DAffine3 {
            matrix3: DMat3::from_diagonal(DVec3::splat(size * f64::from(scale))),
            translation: (random.point() * scale + center).as_dvec3(),
        };
        if let Some(placed) = Transform::new(map) {
            builder.add_shape(group, Arc::new(shape), placed);
        }
    }
}

/// Rays of all kinds, aimed from and at the points.
fn rays(seed: u32, points: &[Vec3], n: usize) -> Vec<Ray> {
    let mut random = Random(hash32(seed ^ 0x5eed));
    let size =
        points.iter().fold(0.0f32, |a, p| a.max(p.abs().max_element())).max(f32::MIN_POSITIVE);
    let mut rays = Vec::with_capacity(n);
    for _ in 0..n {
        let (from, to) = (points[random.below(points.len())], points[random.below(points.len())]);
        let mut origin = match random.below(6) {
            // From a vertex along an edge, a face or anywhere, from slightly beside it, from
            // outside, from far outside.
            0 | 1 => from,
            2 => from + random.point() * size * 1e-6,
            3 | 4 => to + random.point() * size * 3.0,
            _ => to + random.point() * size * [1e2, 1e4, 1e7][random.below(3)],
        };
        let mut direction = to - origin;
        if random.chance(0.3) {
            direction = [Vec3::X, Vec3::Y, Vec3::Z][random.below(3)]
                * if random.chance(0.5) { -1.0 } else { 1.0 };
        } else if random.chance(0.2) {
            direction[random.below(3)] *= [0.0, -0.0, 1e-20, 1e-40][random.below(4)];
        }
        direction *= [1.0, 1e-3, 1e10, 1e-25][random.below(4)];
        if random.chance(0.02) {
            [&mut origin, &mut direction][random.below(2)][random.below(3)] =
                [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX][random.below(4)];
        }
        let mut ray = Ray::new(origin, direction);
        if random.chance(0.3) {
            let reach = size / direction.length().max(f32::MIN_POSITIVE);
            ray.t_min = random.signed() * reach;
            ray.t_max = ray.t_min + random.signed() * reach * 3.0;
        } else if random.chance(0.1) {
            (ray.t_min, ray.t_max) =
                (f32::NEG_INFINITY, [0.0, f32::INFINITY, f32::NAN][random.below(3)]);
        }
        rays.push(ray);
    }
    rays
}

fn build(
    builder: WorldBuilder,
    accelerator: AcceleratorKind,
    accelerator_options: AcceleratorOptions,
) -> World {
    let options = BuildOptions {
        accelerator,
        accelerator_options,
        simd: Level::Scalar,
        ..BuildOptions::default()
    };
    builder.build(&options).expect("a world")
}

fn bits(hit: &Hit) -> [u32; 6] {
    [
        hit.t.to_bits(),
        hit.uv.x.to_bits(),
        hit.uv.y.to_bits(),
        hit.instance,
        hit.geometry,
        hit.primitive,
    ]
}

/// The structures and options to be compared with `none`.
fn variants() -> Vec<(AcceleratorKind, AcceleratorOptions)> {
    let plain = AcceleratorOptions::default();
    let mut all = Vec::new();
    for kind in AcceleratorKind::ALL.into_iter().filter(|k| k.build().is_some()) {
        all.push((kind, plain));
        all.push((
            kind,
            AcceleratorOptions { front_to_back: false, last_hit_cache: true, ..plain },
        ));
    }
    if std::env::var_os("SNELL_TEST_BVH").is_some() {
        all.push((AcceleratorKind::Bvh, plain));
    }
    all.push((
        AcceleratorKind::Grid,
        AcceleratorOptions { grid_resolution: Some(40), nested_grids: false, ..plain },
    ));
    all.push((AcceleratorKind::Grid, AcceleratorOptions { grid_resolution: Some(3), ..plain }));
    all
}

/// Compares all structures on one scene. Returns the number of rays that hit.
fn compare(seed: u32, count: usize) -> usize {
    let (_, points) = scene(seed);
    let rays = rays(seed, &points, count);
    let oracle = build(scene(seed).0, AcceleratorKind::None, AcceleratorOptions::default());
    let all: Vec<Vec<Hit>> = rays.iter().map(|r| oracle.all_one(r, &AcceptAll)).collect();
    let closest: Vec<Hit> = rays.iter().map(|r| oracle.closest_one(r, &AcceptAll)).collect();
    for (kind, options) in variants() {
        let world = build(scene(seed).0, kind, options);
        let what =
            |i: usize| format!("scene {seed}, {} {options:?}, ray {i} {:?}", kind.name(), rays[i]);
        let mut hits = vec![Hit::MISS; rays.len()];
        world.closest(&rays[..], Grouping::None, &AcceptAll, &mut hits);
        let mut blocked = vec![false; rays.len()];
        world.occluded(&rays[..], Grouping::None, &AcceptAll, &mut blocked);
        for i in 0..rays.len() {
            let expected = closest[i];
            assert_eq!(
                bits(&hits[i]),
                bits(&expected),
                "{}: {:?} is not {expected:?}",
                what(i),
                hits[i]
            );
            assert_eq!(blocked[i], expected.is_hit(), "{}", what(i));
            let found = world.all_one(&rays[i], &AcceptAll);
            assert_eq!(
                found.iter().map(bits).collect::<Vec<_>>(),
                all[i].iter().map(bits).collect::<Vec<_>>(),
                "{}",
                what(i)
            );
            assert_eq!(
                bits(&world.closest_counted(&rays[i], &AcceptAll).0),
                bits(&expected),
                "{}",
                what(i)
            );
        }
    }
    all.iter().filter(|h| !h.is_empty()).count()
}

#[test]
fn every_structure_gives_the_hits_of_none_bit_for_bit() {
    let cases = std::env::var("SNELL_TEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(300);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner =
        TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let hits = std::cell::Cell::new(0);
    let result = runner.run(&any::<u32>(), |seed| {
        hits.set(hits.get() + compare(seed, 40));
        Ok(())
    });
    result.expect("agreement");
    assert!(hits.get() > 8 * cases as usize, "only {} hits", hits.get());
}
