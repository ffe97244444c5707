//! Rays in closed rooms, reflected again and again.

use super::*;
use crate::mesh::DTriangleMesh;
use crate::search::AcceptAll;
use crate::shape::{AnyShape, BoxShape, Sphere};
use crate::world::double::DWorldBuilder;
use crate::world::tests::{Random, double_sphere};
use crate::world::{BuildOptions, WorldBuilder};
use snell_math::Transform;
use std::sync::Arc;

/// A closed room around a point.
struct Room {
    kind: Kind,
    /// True if its walls are flat, so that a ray cannot meet the wall that it leaves.
    is_flat: bool,
    center: DVec3,
    half: DVec3,
}

enum Kind {
    Shape(Arc<AnyShape>),
    Mesh(DTriangleMesh),
}

/// The corners and triangles of a box.
fn box_mesh(center: DVec3, half: DVec3) -> DTriangleMesh {
    let sign = |i: u32, bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let corner = |i: u32| center + half * DVec3::new(sign(i, 0), sign(i, 1), sign(i, 2));
    let faces =
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let indices = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    DTriangleMesh { positions: (0..8).map(corner).collect(), indices }
}

/// Rooms of this size around a point.
fn rooms(size: f64, center: DVec3) -> Vec<Room> {
    let half = DVec3::new(3.5, 2.5, 1.5) * size;
    let walls = BoxShape { min: center - half, max: center + half };
    let ball = Sphere { radius: half.x };
    let round = DVec3::splat(half.x);
    vec![
        Room { kind: Kind::Shape(Arc::new(walls.into())), is_flat: true, center, half },
        Room { kind: Kind::Shape(Arc::new(ball.into())), is_flat: false, center, half: round },
        Room { kind: Kind::Mesh(box_mesh(center, half)), is_flat: true, center, half },
        Room {
            kind: Kind::Mesh(double_sphere(center, half.x, 50, 52)),
            is_flat: true,
            center,
            half: round,
        },
    ]
}

fn placed(room: &Room) -> Transform {
    match &room.kind {
        Kind::Shape(shape) if matches!(**shape, AnyShape::Sphere(_)) => {
            Transform::translation(room.center)
        }
        _ => Transform::IDENTITY,
    }
}

fn single(room: &Room) -> World {
    let mut builder = WorldBuilder::default();
    match &room.kind {
        Kind::Shape(shape) => {
            _ = builder.add_shape(WorldBuilder::ROOT, shape.clone(), placed(room))
        }
        Kind::Mesh(mesh) => {
            let positions = mesh.positions.iter().map(|p| p.as_vec3()).collect();
            let indices = mesh.indices.clone();
            let mesh = crate::TriangleMesh { positions, indices, ..Default::default() };
            builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
        }
    }
    builder.build(&BuildOptions::default()).expect("a world")
}

fn double(room: &Room) -> DWorld {
    let mut builder = DWorldBuilder::default();
    match &room.kind {
        Kind::Shape(shape) => {
            _ = builder.add_shape(WorldBuilder::ROOT, shape.clone(), placed(room))
        }
        Kind::Mesh(mesh) => _ = builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh.clone())),
    }
    builder.build(&BuildOptions::default()).expect("a world")
}

/// Directions from the centre: some exactly into edges and corners, others anywhere.
fn directions(room: &Room, random: &mut Random, count: usize) -> Vec<DVec3> {
    let aimed = (0..27)
        .map(|i| DVec3::new(f64::from(i % 3 - 1), f64::from(i / 3 % 3 - 1), f64::from(i / 9 - 1)));
    let aimed = aimed.filter(|d| *d != DVec3::ZERO).map(|d| d * room.half);
    aimed.chain((0..count).map(|_| random.direction().as_dvec3())).collect()
}

fn stay_inside<W: Spawning>(world: &W, room: &Room, is_diffuse: bool, bounces: usize, name: &str) {
    let mut random = Random(7);
    let mut directions = directions(room, &mut random, 100);
    let mut origins = vec![room.center; directions.len()];
    let mut last = vec![[Hit::NONE; 3]; origins.len()];
    let mut hits = vec![<W::Precision as Precision>::Hit::default(); origins.len()];
    for bounce in 0..bounces {
        let rays: Vec<_> =
            origins.iter().zip(&directions).map(|(o, d)| W::ray(&DRay::new(*o, *d))).collect();
        world.closest(Rays::new(&rays), Grouping::None, &AcceptAll, &mut hits);
        for (i, hit) in hits.iter().enumerate() {
            let ids = W::Precision::ids(hit);
            let (o, d) = (origins[i], directions[i]);
            assert!(ids[1] != Hit::NONE, "{name}: ray {i} left at bounce {bounce}: {o} {d}");
            assert!(!room.is_flat || ids != last[i], "{name}: ray {i}, bounce {bounce}: {o} {d}");
            last[i] = ids;
            let site = world.site(RayQuery { ray: &rays[i], mask: u64::MAX, time: 0.0 }, hit);
            let d = W::Precision::exact(&rays[i]).direction;
            let n = site.geometric_normal;
            directions[i] = if is_diffuse {
                let facing = if d.dot(n) > 0.0 { -n } else { n };
                (facing + random.direction().as_dvec3() * 0.9999).normalize()
            } else {
                (d - n * (2.0 * d.dot(n))).normalize()
            };
        }
        spawn_all(world, Rays::new(&rays), &AcceptAll, &hits, &directions, &mut origins);
    }
}

#[test]
fn reflected_rays_stay_in_a_closed_room_and_leave_their_wall() {
    let far = DVec3::new(448_262.0, 5_411_932.0, 120.0);
    for (size, center) in [
        (1.0, DVec3::ZERO),
        (1.0, DVec3::new(3.5, 2.5, 1.5)),
        (1e-6, DVec3::new(3.5e-6, 2.5e-6, 1.5e-6)),
        (1e6, DVec3::ZERO),
        (1e3, far),
    ] {
        for (number, room) in rooms(size, center).iter().enumerate() {
            for is_diffuse in [false, true] {
                let name = format!("room {number} of {size} at {center}, diffuse {is_diffuse}");
                let bounces = 150;
                stay_inside(&single(room), room, is_diffuse, bounces, &format!("f32 {name}"));
                stay_inside(&double(room), room, is_diffuse, bounces, &format!("f64 {name}"));
            }
        }
    }
}

#[test]
fn origins_are_beside_the_hit_on_the_side_of_the_direction() {
    let room = &rooms(1.0, DVec3::new(30.0, 20.0, 10.0))[2];
    let (single, double) = (single(room), double(room));
    let rays = [Ray::new(room.center.as_vec3(), snell_math::Vec3::X); 3];
    let exact = rays.map(|ray| DRay::from(&ray));
    let (mut hits, mut dhits) = ([Hit::MISS; 3], [DHit::MISS; 3]);
    single.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    double.closest(&exact, Grouping::None, &AcceptAll, &mut dhits);
    (hits[2], dhits[2]) = (Hit::MISS, DHit::MISS);
    let directions = [DVec3::NEG_X, DVec3::X, DVec3::X];
    for (found, margin) in [
        (
            {
                let mut origins = [DVec3::ZERO; 3];
                single.spawn(&rays, &AcceptAll, &hits, &directions, &mut origins);
                origins
            },
            2e-5,
        ),
        (
            {
                let mut origins = [DVec3::ZERO; 3];
                double.spawn(&exact, &AcceptAll, &dhits, &directions, &mut origins);
                origins
            },
            1e-12,
        ),
    ] {
        let wall = room.center.x + room.half.x;
        assert!(found[0].x < wall && found[0].x > wall - margin, "{}", found[0]);
        assert!(found[1].x > wall && found[1].x < wall + margin, "{}", found[1]);
        assert!(found[2].is_nan());
    }
}

#[test]
fn what_the_earlier_ray_did_not_meet_does_not_move_an_origin() {
    let mut builder = WorldBuilder::default();
    let mut add = |z: f64, mask: u64| {
        let sheet = crate::shape::Plane {};
        let id = builder.add_shape(
            WorldBuilder::ROOT,
            Arc::new(AnyShape::from(sheet)),
            Transform::translation(DVec3::Z * z),
        );
        builder.set_mask(id, mask);
    };
    add(0.0, 1);
    add(1.0, 2);
    let world = builder.build(&BuildOptions::default()).expect("a world");
    let (o, d) = (snell_math::Vec3::Z * 2.0, snell_math::Vec3::NEG_Z);
    for (t_min, mask) in [(0.0, 1), (1.5, u64::MAX)] {
        let (rays, masks) = ([Ray { t_min, ..Ray::new(o, d) }], [mask]);
        let rays = Rays::new(&rays).with_masks(&masks);
        let (mut hits, mut origins) = ([Hit::MISS], [DVec3::NAN]);
        world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
        world.spawn(rays, &AcceptAll, &hits, &[DVec3::Z], &mut origins);
        assert!(origins[0].z > 0.0 && origins[0].z < 1e-6, "{}", origins[0]);
    }
}
