//! The outliers of a group, as a list that is tested before the tree.

use super::packet::ListPacket;
use crate::tree::list::Outliers;
use snell_math::simd::Doubles16;

/// A ray that must still be traced through [the rest](GroupTree::rest) of the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unresolved<H> {
    /// The number of the ray.
    pub number: u32,
    /// The nearest hit so far; meaningless for occlusion queries.
    pub hit: Option<H>,
}

impl Outliers {
    /// The rays that may hit the bounds of the rest.
    #[inline(always)]
    pub(super) fn may_meet_rest<D: Doubles16>(
        &self,
        token: D::Token,
        packet: &ListPacket<D>,
    ) -> u32 {
        packet.may_meet(token, &self.list, &self.bounds)
    }
}

#[cfg(test)]
mod tests {
    use crate::build::Quality;
    use crate::hit::Hit;
    use crate::kernel::list::tests::{Sieve, quads};
    use crate::search::rays::Rays;
    use crate::search::{AcceptAll, Grouping};
    use crate::shape::{AnyShape, Plane, Rectangle, Sphere};
    use crate::world::AcceleratorKind;
    use crate::world::tests::{
        Random, bits, build, check, default_world, dust, levels, soup, sphere_mesh,
    };
    use crate::world::{BuildOptions, GeometryId, Structure, World, WorldBuilder};
    use proptest::prelude::*;
    use snell_math::simd::Level;
    use snell_math::{DMat3, DVec2, DVec3, Ray, Transform, Vec3};
    use std::sync::Arc;

    /// The objects below and beside a heap of triangles.
    #[derive(Clone, Copy, Debug)]
    enum Ground {
        Floor,
        FloorAndWall,
        Slope,
        /// A floor that was rotated, so that it is only nearly flat.
        Turned,
        Plane,
        Rectangle,
    }

    const GROUNDS: [Ground; 6] = [
        Ground::Floor,
        Ground::FloorAndWall,
        Ground::Slope,
        Ground::Turned,
        Ground::Plane,
        Ground::Rectangle,
    ];

    fn add_ground(builder: &mut WorldBuilder, ground: Ground, level: f32, scale: f32) {
        let (size, level) = (24.0 * scale, level * scale);
        let quad = |corners: [[f32; 3]; 4]| corners.map(|v| v.map(|x| x * scale));
        let flat = [
            [-24.0, level / scale, -24.0],
            [24.0, level / scale, -24.0],
            [24.0, level / scale, 24.0],
            [-24.0, level / scale, 24.0],
        ];
        let wall =
            [[-24.0, -4.0, 20.0], [24.0, -4.0, 20.0], [24.0, 16.0, 20.0], [-24.0, 16.0, 20.0]];
        let turned = Transform::new(snell_math::DAffine3 {
            matrix3: DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2),
            translation: DVec3::new(0.0, level.into(), 0.0),
        })
        .expect("invertible");
        match ground {
            Ground::Floor => {
                builder.add_mesh(WorldBuilder::ROOT, quads(&[quad(flat)]));
            }
            Ground::FloorAndWall => {
                builder.add_mesh(WorldBuilder::ROOT, quads(&[quad(flat), quad(wall)]));
            }
            Ground::Slope => {
                let slope = flat.map(|[x, y, z]| [x, y + 0.25 * x - 0.125 * z, z]);
                builder.add_mesh(WorldBuilder::ROOT, quads(&[quad(slope)]));
            }
            Ground::Turned => {
                let turned = flat.map(|[x, y, z]| [x, y + 1.1e-16 * z, z]);
                builder.add_mesh(WorldBuilder::ROOT, quads(&[quad(turned)]));
            }
            Ground::Plane => {
                let at = Transform::translation(DVec3::new(0.0, level.into(), 0.0));
                builder.add_shape(WorldBuilder::ROOT, Arc::new(AnyShape::from(Plane {})), at);
            }
            Ground::Rectangle => {
                let half_size = DVec2::splat(size.into());
                builder.add_shape(
                    WorldBuilder::ROOT,
                    Arc::new(AnyShape::from(Rectangle { half_size })),
                    turned,
                );
            }
        }
    }

    /// A heap, of triangles or of a few instances, on a ground.
    fn heap(
        seed: u32,
        ground: Ground,
        level: f32,
        scale: f32,
        has_instances: bool,
    ) -> WorldBuilder {
        let mut random = Random(seed);
        let mut mesh = soup(&mut random, if has_instances { 12 } else { 150 });
        mesh.positions.iter_mut().for_each(|p| *p *= scale);
        let mesh = Arc::new(mesh);
        let mut builder = WorldBuilder::default();
        // Before and after the ground, in the order that decides ties.
        if !has_instances {
            builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
        }
        add_ground(&mut builder, ground, level, scale);
        if has_instances {
            let child = builder.add_group();
            builder.add_mesh(child, mesh);
            for _ in 0..80 {
                let at = random.point(1.0) * scale;
                builder.add_instance(
                    WorldBuilder::ROOT,
                    child,
                    Transform::translation(at.as_dvec3()),
                );
            }
        } else {
            let sphere = Sphere { radius: f64::from(scale) };
            builder.add_shape(
                WorldBuilder::ROOT,
                Arc::new(sphere),
                Transform::translation(DVec3::ZERO),
            );
            builder.add_mesh(WorldBuilder::ROOT, mesh);
        }
        builder
    }

    fn has_outliers(world: &World) -> bool {
        matches!(&world.structure, Structure::Bvh(forest) if forest.outliers.is_some())
    }

    fn rays_around(seed: u32, count: usize, level: f32, scale: f32) -> Vec<Ray> {
        let mut random = Random(seed ^ 0x5555);
        let ray = |i: usize| {
            let (from, to) = (random.point(6.0), random.point(3.0));
            let above = [0.0, 1e-15, -1e-15, 1e-20, 2e-16, -3e-16, 4e-8][i / 8 % 7];
            let low = Vec3::new(from.x, level + above, from.z);
            // Some rays are aimed at corners and edges of the ground, or along its plane.
            let corner = Vec3::new([24.0, -24.0, 0.0][i / 8 % 3], level, [24.0, 0.0][i / 24 % 2]);
            let (from, to) = match i % 8 {
                0 => (from, to),
                1 | 2 => (low, low + random.direction()),
                3 => (from, corner),
                4 => (low, corner),
                5 => (from * 8.0, to),
                6 => (from, Vec3::new(to.x, level, to.z)),
                _ => (Vec3::new(from.x, 9.0, from.z), Vec3::new(from.x, -9.0, from.z)),
            };
            let ray = Ray::new(from * scale, (to - from) * scale);
            match i / 8 % 5 {
                0 => ray.with_t_max(1.0),
                1 => Ray { t_min: 0.25, ..ray },
                2 => Ray { t_min: -1.0, ..ray },
                _ => ray,
            }
        };
        (0..count).map(ray).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn outliers_are_hit_as_the_oracle_says(
            (seed, ground) in (any::<u32>(), 0usize..GROUNDS.len()),
            // The ground is below the heap, above it, or in the middle, where ground and triangles
            // intersect.
            level in prop_oneof![Just(-3.0f32), Just(0.0), Just(1.5), -4.0f32..2.0],
            scale in -10i32..10,
            (has_instances, restricted) in (any::<bool>(), any::<bool>()),
        ) {
            let scale = 2.0f32.powi(scale);
            let make = |accelerator, simd| {
                let mut builder = heap(seed, GROUNDS[ground], level, scale, has_instances);
                if restricted {
                    builder.set_mask(GeometryId(0), 2);
                    builder.set_filtered(GeometryId(1));
                }
                build(builder, accelerator, simd)
            };
            let rays = rays_around(seed, 200, level, scale);
            let mask = |i: usize| [u64::MAX, 1, 2, 0][i / 3 % 4];
            let masks: Vec<u64> = (0..rays.len()).map(mask).collect();
            let oracle = make(AcceleratorKind::None, Level::Scalar);
            for simd in levels() {
                let world = make(AcceleratorKind::Bvh, simd);
                prop_assert!(has_outliers(&world));
                check(&world, &oracle, Rays::from(&rays), &AcceptAll)?;
                check(&world, &oracle, Rays::from(&rays[..20]), &AcceptAll)?;
                check(&world, &oracle, Rays::from(&rays).with_masks(&masks), &Sieve)?;
            }
        }
    }

    #[test]
    fn only_what_is_large_and_beside_the_rest_is_an_outlier() {
        let world = |edit: &dyn Fn(&mut WorldBuilder), quality: Quality| {
            let mut builder = WorldBuilder::default();
            builder.add_mesh(WorldBuilder::ROOT, Arc::new(sphere_mesh(Vec3::ZERO, 5.0, 10, 20)));
            edit(&mut builder);
            builder.build(&BuildOptions { quality, ..BuildOptions::default() }).expect("a world")
        };
        let floor = |builder: &mut WorldBuilder| add_ground(builder, Ground::Floor, -5.0, 1.0);
        assert!(
            has_outliers(&world(&floor, Quality::Medium))
                && has_outliers(&world(&floor, Quality::High))
        );
        assert!(!has_outliers(&world(&|_| {}, Quality::Medium)), "nothing is large");
        // Walls around the whole scene.
        let walls = |builder: &mut WorldBuilder| {
            let wall = |x: f32| [[x, -5.5, -5.5], [x, 5.5, -5.5], [x, 5.5, 5.5], [x, -5.5, 5.5]];
            builder.add_mesh(WorldBuilder::ROOT, quads(&[wall(-5.5), wall(5.5)]));
        };
        assert!(!has_outliers(&world(&walls, Quality::Medium)), "most rays come near the rest");
        let many = |builder: &mut WorldBuilder| (0..20).for_each(|_| floor(builder));
        assert!(!has_outliers(&world(&many, Quality::Medium)), "too many are large");
    }

    /// Large trees are traversed by rays in sorted order.
    #[test]
    fn large_batches_find_what_single_rays_find() {
        let mut random = Random(3);
        let mesh = dust(&mut random, 60_000);
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
        add_ground(&mut builder, Ground::Floor, -1.0, 0.25);
        let world = default_world(builder);
        assert!(has_outliers(&world));
        let rays: Vec<Ray> = (0..100_000)
            .map(|i| {
                let from =
                    random.point(1.0) * Vec3::new(4.0, if i % 2 == 0 { 0.0 } else { 1.0 }, 4.0);
                Ray::new(from - Vec3::Y * 0.25, random.direction())
            })
            .collect();
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
        world.occluded(&rays, Grouping::None, &AcceptAll, &mut blocked);
        for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked) {
            assert_eq!(bits(&world.closest_one(ray, &AcceptAll)), bits(hit));
            assert_eq!(hit.is_hit(), *blocked);
        }
    }
}
