//! Whole worlds: all structures and levels agree, closed meshes have no holes, rays leave surfaces.

use super::*;
use crate::hit::Hit;
use crate::query::{AcceptAll, Grouping, HitFilter};
use crate::shape::Sphere;
use snell_math::rng::{hash32, pcg4d, to_unit};
use snell_math::sampling::uniform_sphere;
use snell_math::{DAffine3, DMat3, DVec3, Ray, Vec2, Vec3};

/// Random numbers in order.
struct Random(u32);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 += 1;
        to_unit(pcg4d([self.0, 17, 3, 5])[0])
    }

    fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    fn point(&mut self, extent: f32) -> Vec3 {
        Vec3::new(self.range(-extent, extent), self.range(-extent, extent), self.range(-extent, extent))
    }

    fn direction(&mut self) -> Vec3 {
        let u = Vec2::new(self.unit(), self.unit());
        uniform_sphere(u)
    }

    /// Turned, stretched unevenly, sometimes mirrored, moved.
    fn transform(&mut self, extent: f32) -> Transform {
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

fn soup(random: &mut Random, triangles: usize) -> TriangleMesh {
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
fn nested_scene(seed: u32) -> WorldBuilder {
    let mut random = Random(hash32(seed));
    let mut builder = WorldBuilder::default();
    let mut group = WorldBuilder::ROOT;
    for level in 0..4 {
        let mesh = Arc::new(soup(&mut random, 60));
        builder.add_mesh(group, mesh.clone());
        // The same again: every hit is a tie between two geometries.
        builder.add_mesh(group, mesh);
        for _ in 0..3 {
            let radius = random.range(0.1, 0.5).into();
            let placed = random.transform(2.0);
            builder.add_shape(group, Arc::new(Sphere { radius }), placed);
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

fn build(builder: WorldBuilder, accelerator: AcceleratorKind, simd: Level) -> World {
    builder.build(&BuildOptions { accelerator, simd }).expect("a world")
}

fn default_world(builder: WorldBuilder) -> World {
    builder.build(&BuildOptions::default()).expect("a world")
}

fn bits(hit: &Hit) -> [u32; 6] {
    [hit.t.to_bits(), hit.uv.x.to_bits(), hit.uv.y.to_bits(), hit.instance, hit.geometry, hit.primitive]
}

fn levels() -> impl Iterator<Item = Level> {
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
