//! What stands apart from the rest of a group, as a list beside the tree.

use super::bundle::Bundle;
use super::contents::{List, ListObject};
use crate::accel::bvh::GroupTree;
use snell_math::Bounds3;
use snell_math::simd::Doubles16;

/// Large primitives, planes without end, and where the rest of the group is.
#[derive(Clone, Debug)]
pub(crate) struct Apart {
    pub(super) list: Box<List>,
    bounds: Bounds3,
}

/// A ray that has yet to be searched for among [the rest](GroupTree::rest).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Begun<H> {
    /// Its number.
    pub number: u32,
    /// What it has hit so far; not to be looked at where any hit would do.
    pub hit: Option<H>,
}

impl Apart {
    /// `None` if nothing does, or it is not for lists.
    pub fn of(tree: &GroupTree) -> Option<Self> {
        let root = tree.nodes.first()?;
        let is_divided = tree.rest != tree.root;
        if !tree.rest.is_node() || !is_divided && tree.unbounded.is_empty() {
            return None;
        }
        // In the order of the nodes: what is below the root but not among the rest, which comes
        // first, ends the tree.
        let mut around = vec![];
        if is_divided {
            around.extend((1..8).map(|slot| (root.children[slot], root.slot_bounds(slot))));
        }
        let mut leaves = vec![];
        while let Some((child, bounds)) = around.pop() {
            if child.is_node() {
                let node = &tree.nodes[child.index()];
                around.extend((0..8).map(|slot| (node.children[slot], node.slot_bounds(slot))));
            } else {
                leaves.push((child, bounds));
            }
        }
        let bounds = if is_divided { root.slot_bounds(0) } else { root.bounds() };
        let list = List::apart(tree, &leaves, &bounds)?;
        let is_tested_in_lanes = |object: &ListObject| object.shape.is_some();
        list.objects.iter().all(is_tested_in_lanes).then_some(Self { list, bounds })
    }

    /// The rays that may meet any of the rest.
    #[inline(always)]
    pub(super) fn may_meet_rest<D: Doubles16>(&self, token: D::Token, bundle: &Bundle<D>) -> u32 {
        bundle.may_meet(token, &self.list, &self.bounds)
    }
}

#[cfg(test)]
mod tests {
    use crate::accel::{AcceleratorKind, Quality};
    use crate::hit::Hit;
    use crate::kernel::list::tests::{Sieve, quads};
    use crate::query::rays::Rays;
    use crate::query::{AcceptAll, Grouping};
    use crate::shape::{AnyShape, Plane, Rectangle, Sphere};
    use crate::world::tests::{
        Random, bits, build, check, default_world, dust, levels, soup, sphere_mesh,
    };
    use crate::world::{BuildOptions, GeometryId, Structure, World, WorldBuilder};
    use proptest::prelude::*;
    use snell_math::simd::Level;
    use snell_math::{DMat3, DVec2, DVec3, Ray, Transform, Vec3};
    use std::sync::Arc;

    /// What lies below and beside a heap of triangles.
    #[derive(Clone, Copy, Debug)]
    enum Ground {
        Floor,
        FloorAndWall,
        Slope,
        /// A floor that was turned, so that it is flat only nearly.
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

    /// A heap on a ground, of triangles or of instances of a few.
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
        // Before and after the ground in the order of ties.
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

    fn stands_apart(world: &World) -> bool {
        matches!(&world.structure, Structure::Bvh(forest) if forest.apart.is_some())
    }

    fn rays_around(seed: u32, count: usize, level: f32, scale: f32) -> Vec<Ray> {
        let mut random = Random(seed ^ 0x5555);
        let ray = |i: usize| {
            let (from, to) = (random.point(6.0), random.point(3.0));
            let above = [0.0, 1e-15, -1e-15, 1e-20, 2e-16, -3e-16, 4e-8][i / 8 % 7];
            let low = Vec3::new(from.x, level + above, from.z);
            // Corners and edges of the ground, and what lies in its plane.
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
        fn what_stands_apart_is_hit_as_the_oracle_says(
            (seed, ground) in (any::<u32>(), 0usize..GROUNDS.len()),
            // In the middle of the heap too: then grounds and triangles cut each other.
            (level, scale) in (prop_oneof![Just(-3.0f32), Just(0.0), Just(1.5), -4.0f32..2.0], -10i32..10),
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
            let masks: Vec<u32> = (0..rays.len() as u32).map(|i| [u32::MAX, 1, 2, 0][(i / 3 % 4) as usize]).collect();
            let oracle = make(AcceleratorKind::None, Level::Scalar);
            for simd in levels() {
                let world = make(AcceleratorKind::Bvh, simd);
                prop_assert!(stands_apart(&world));
                check(&world, &oracle, Rays::from(&rays), &AcceptAll)?;
                check(&world, &oracle, Rays::from(&rays[..20]), &AcceptAll)?;
                check(&world, &oracle, Rays::from(&rays).with_masks(&masks), &Sieve)?;
            }
        }
    }

    #[test]
    fn only_what_is_large_and_beside_the_rest_stands_apart() {
        let world = |edit: &dyn Fn(&mut WorldBuilder), quality: Quality| {
            let mut builder = WorldBuilder::default();
            builder.add_mesh(WorldBuilder::ROOT, Arc::new(sphere_mesh(Vec3::ZERO, 5.0, 10, 20)));
            edit(&mut builder);
            builder.build(&BuildOptions { quality, ..BuildOptions::default() }).expect("a world")
        };
        let floor = |builder: &mut WorldBuilder| add_ground(builder, Ground::Floor, -5.0, 1.0);
        assert!(
            stands_apart(&world(&floor, Quality::Medium))
                && stands_apart(&world(&floor, Quality::High))
        );
        assert!(!stands_apart(&world(&|_| {}, Quality::Medium)), "nothing is large");
        // Walls around everything.
        let walls = |builder: &mut WorldBuilder| {
            let wall = |x: f32| [[x, -5.5, -5.5], [x, 5.5, -5.5], [x, 5.5, 5.5], [x, -5.5, 5.5]];
            builder.add_mesh(WorldBuilder::ROOT, quads(&[wall(-5.5), wall(5.5)]));
        };
        assert!(!stands_apart(&world(&walls, Quality::Medium)), "most rays come near the rest");
        let many = |builder: &mut WorldBuilder| (0..20).for_each(|_| floor(builder));
        assert!(!stands_apart(&world(&many, Quality::Medium)), "too many are large");
    }

    /// Large trees are searched by sorted rays.
    #[test]
    fn large_batches_find_what_single_rays_find() {
        let mut random = Random(3);
        let mesh = dust(&mut random, 60_000);
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
        add_ground(&mut builder, Ground::Floor, -1.0, 0.25);
        let world = default_world(builder);
        assert!(stands_apart(&world));
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
