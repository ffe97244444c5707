//! The smooth surfaces that vertex normals imply, and the origins of rays that leave these
//! surfaces. They give coarse meshes of round objects a terminator between light and shadow that is
//! not jagged (the *shadow terminator problem*).
//!
//! A point of a triangle is lifted onto the mean, weighted by its barycentric coordinates, of the
//! planes through the corners that are perpendicular to the vertex normals (Hanika, Hacking the
//! Shadow Terminator, Ray Tracing Gems II, 2021, chapter 4). Where the surface is concave, seen
//! from the side of the incoming path, nothing is lifted, because no triangle is in the way there.
//!
//! Only rays that leave nearly along the triangle, or through its plane, start from the lifted
//! point. All others are correct from the unlifted point, and shadows of objects that touch the
//! surface stay where they are (as in Blender's Cycles, where this is the *geometry offset*).
//! Another remedy darkens the surface towards the terminator of the shading normals, by a factor of
//! the cosines alone (Chiang, Li and Burley, Taming the Shadow Terminator, 2019; Conty Estevez,
//! Lecocq and Stein, A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem,
//! 2019). That method is meant for normal maps, which have no underlying surface: on coarse
//! triangles it leaves the terminator at the edges of the triangles and blurs it, instead of moving
//! it to the terminator of the round surface.

use super::triangles::{HitVectors, TRIANGLE_HITS, TriangleHits, TrianglePoints};
use super::{Geometry, GeometryId, GroupId, World};
use crate::hit::{Hit, SurfaceInteraction};
use crate::mesh::TriangleMesh;
use crate::search::rays::{RayQuery, clamped_time};
use snell_math::simd::{Wide, max, min};
use snell_math::{DVec3, Vec3, at_level, robust};

/// The sine of the angle to the triangle's plane from which on a ray is not lifted at all.
const STEEP: f32 = 0.1;

/// Limits of the least cosine between the normal of a triangle and those of its corners: below the
/// first no point is lifted, above the second the lift is complete. Normals at larger angles only
/// round off the edges of objects such as boxes, and do not imply a smooth surface.
const BENT: [f32; 2] = [0.6, 0.8];

/// The offset from a point of a triangle to the smooth surface, on the side of `wo`.
#[inline(always)]
fn lift(corners: [Vec3; 3], normals: [Vec3; 3], [b1, b2]: [f32; 2], flat: Vec3, wo: Vec3) -> Vec3 {
    // Rounding takes hits on an edge a little beyond it, where the lift would have the wrong side.
    let b = [1.0 - b1 - b2, b1, b2].map(|b| max(b, 0.0));
    let edges = [corners[1] - corners[0], corners[2] - corners[0]];
    let first = edges[0] * b1 + edges[1] * b2;
    let from_corners = [first, first - edges[0], first - edges[1]];
    let blended = normals[0] * b[0] + normals[1] * b[1] + normals[2] * b[2];
    let turn = if blended.dot(flat) < 0.0 { -1.0 } else { 1.0 };
    let side = if flat.dot(wo) < 0.0 { -turn } else { turn };
    let (mut lift, mut least_cosine) = (Vec3::ZERO, 1.0);
    for i in 0..3 {
        let normal = normals[i] * (1.0 / normals[i].length());
        let height = min(from_corners[i].dot(normal) * side, 0.0) * side;
        lift -= normal * (height * b[i]);
        least_cosine = min(normal.dot(flat) * turn, least_cosine);
    }
    let share = min((least_cosine - BENT[0]) * (1.0 / (BENT[1] - BENT[0])), 1.0);
    let lift = lift * max(share, 0.0);
    let is_bent = normals[0] != normals[1] || normals[0] != normals[2];
    if is_bent & (lift.length_squared() < f32::INFINITY) { lift } else { Vec3::ZERO }
}

/// The origin of a ray that leaves a surface whose [`World::lift`] is `lift`; equal to
/// [`robust::offset_ray_origin`] if the lift is zero.
#[inline(always)]
pub fn lifted_ray_origin(
    position: Vec3,
    error: Vec3,
    normal: Vec3,
    lift: Vec3,
    direction: Vec3,
) -> Vec3 {
    let is_lifted = lift != Vec3::ZERO;
    let rise = if lift.dot(normal) < 0.0 { -direction.dot(normal) } else { direction.dot(normal) };
    let share = max(min(1.0 - rise * (1.0 / STEEP), 1.0), 0.0);
    let lifted = position + lift * share;
    let pick = |lifted: f32, plain: f32| if is_lifted { lifted } else { plain };
    let from = Vec3::new(
        pick(lifted.x, position.x),
        pick(lifted.y, position.y),
        pick(lifted.z, position.z),
    );
    let towards =
        Vec3::new(pick(lift.x, direction.x), pick(lift.y, direction.y), pick(lift.z, direction.z));
    robust::offset_ray_origin(from, error, normal, towards)
}

impl World {
    /// The offset from a point of a mesh with vertex normals to the smooth surface that the normals
    /// imply, on the side from which `ray` arrives; zero for all other geometry, and where the
    /// smooth surface is behind the mesh. [`lifted_ray_origin`] applies it to reflected rays.
    pub fn lift<'a>(&self, ray: impl Into<RayQuery<'a>>, surface: &SurfaceInteraction) -> Vec3 {
        let RayQuery { ray, time, .. } = ray.into();
        let &SurfaceInteraction { t, primitive_uv: uv, instance, geometry, primitive, .. } =
            surface;
        let hit = Hit { t, uv, instance, geometry, primitive };
        let is_smooth = match self.geometry(GeometryId(geometry)) {
            Geometry::Mesh(mesh) => !mesh.normals.is_empty(),
            Geometry::Quads(quads) => !quads.triangles().normals.is_empty(),
            Geometry::MovingMesh(mesh) => !mesh.first().normals.is_empty(),
            Geometry::Shape(..) | Geometry::Set(_) | Geometry::Heightfield(_) => false,
        };
        if !is_smooth {
            return Vec3::ZERO;
        }
        let lift = self
            .lift_in_group(
                GroupId(0),
                instance,
                -ray.direction.as_dvec3(),
                clamped_time(time),
                &hit,
            )
            .as_vec3();
        if lift.is_finite() { lift } else { Vec3::ZERO }
    }

    /// [`Self::lift`] in the coordinates of `group`, for the occurrence numbered `rest` relative to
    /// it.
    fn lift_in_group(&self, group: GroupId, rest: u32, wo: DVec3, time: f32, hit: &Hit) -> DVec3 {
        if let Some((step, left)) = self.step(group, rest) {
            let instance = &self.group(group).instances[step];
            let map = instance.at(time);
            return map.vector(self.lift_in_group(
                instance.child,
                left,
                map.inverse().vector(wo),
                time,
                hit,
            ));
        }
        match self.geometry(GeometryId(hit.geometry)) {
            Geometry::Mesh(mesh) => lift_in_mesh(mesh, wo, hit),
            Geometry::Quads(quads) => lift_in_mesh(quads.triangles(), wo, &quads.triangle_hit(hit)),
            Geometry::MovingMesh(mesh) => {
                let alone = mesh.triangle_at(hit.primitive as usize, time);
                lift_in_mesh(&alone, wo, &Hit { primitive: 0, ..*hit })
            }
            Geometry::Shape(..) | Geometry::Set(_) | Geometry::Heightfield(_) => DVec3::ZERO,
        }
    }
}

fn lift_in_mesh(mesh: &TriangleMesh, wo: DVec3, hit: &Hit) -> DVec3 {
    let indices = mesh.indices[hit.primitive as usize].map(|i| i as usize);
    let corners = indices.map(|i| mesh.positions[i]);
    let p = corners.map(|p| p.as_dvec3());
    let Some(flat) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else { return DVec3::ZERO };
    let normals = indices.map(|i| mesh.normals[i]);
    lift(corners, normals, [hit.uv.x, hit.uv.y], flat.as_vec3(), wo.as_vec3()).as_dvec3()
}

impl TriangleHits {
    /// Computes [`World::lift`] for all lanes, with the same bits, for paths that arrive from the
    /// directions `wo`.
    pub fn lifts(
        &self,
        points: &TrianglePoints,
        wo: &HitVectors,
        to: &mut HitVectors,
        wide: Option<Wide>,
    ) {
        at_level!(
            wide,
            lifts,
            (
                hits: &TriangleHits = self,
                points: &TrianglePoints = points,
                wo: &HitVectors = wo,
                to: &mut HitVectors = to,
            )
        );
    }
}

#[inline(always)]
fn lifts(hits: &TriangleHits, points: &TrianglePoints, wo: &HitVectors, to: &mut HitVectors) {
    for i in 0..TRIANGLE_HITS {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let corners =
            [vector(&hits.corners[0]), vector(&hits.corners[1]), vector(&hits.corners[2])];
        let normals =
            [vector(&hits.normals[0]), vector(&hits.normals[1]), vector(&hits.normals[2])];
        let weights = [hits.weights[0][i], hits.weights[1][i]];
        let lift = lift(corners, normals, weights, vector(&points.geometric_normal), vector(wo));
        (to[0][i], to[1][i], to[2][i]) = (lift.x, lift.y, lift.z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, WorldBuilder};
    use snell_math::simd::Level;
    use snell_math::{DMat4, Ray, Transform, Vec2, rng};

    /// A triangulated unit sphere whose triangles have at most this size.
    fn pieces_of_a_sphere(size: f32) -> TriangleMesh {
        let number = |i: u32, k: u32| rng::uniform2([i, k, 7, 7]).x * 2.0 - 1.0;
        let positions: Vec<Vec3> = (0..TRIANGLE_HITS as u32)
            .flat_map(|t| {
                let vector = |k: u32| {
                    Vec3::new(number(t, 3 * k), number(t, 3 * k + 1), number(t, 3 * k + 2))
                };
                [1, 2, 3].map(|k| (vector(0).normalize() + vector(k) * size).normalize())
            })
            .collect();
        let turned = |t: u32| {
            (positions[3 * t as usize + 1] - positions[3 * t as usize])
                .cross(positions[3 * t as usize + 2] - positions[3 * t as usize])
                .dot(positions[3 * t as usize])
                < 0.0
        };
        let indices = (0..TRIANGLE_HITS as u32)
            .map(|t| {
                if turned(t) {
                    [3 * t, 3 * t + 2, 3 * t + 1]
                } else {
                    [3 * t, 3 * t + 1, 3 * t + 2]
                }
            })
            .collect();
        TriangleMesh { normals: positions.clone(), positions, indices, ..TriangleMesh::default() }
    }

    fn world_of(mesh: TriangleMesh) -> World {
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, mesh.into());
        builder.build(&BuildOptions::default()).expect("a world")
    }

    fn hits() -> Vec<Hit> {
        let uv = |t: u32| rng::uniform2([t, 1, 2, 3]) * 0.5;
        let hit = |t: u32| Hit {
            t: 1.0,
            uv: Vec2::new(uv(t).x, uv(t).y),
            instance: 0,
            geometry: 0,
            primitive: t,
        };
        (0..TRIANGLE_HITS as u32).map(hit).collect()
    }

    #[test]
    fn rounding_beyond_an_edge_does_not_lift_to_the_other_side() {
        let mesh = pieces_of_a_sphere(0.2);
        for &[i, j, k] in &mesh.indices {
            let corners = [i, j, k].map(|i| mesh.positions[i as usize]);
            let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            for uv in [[0.5, 0.500_000_06], [-6e-8, 0.5], [0.5, -6e-8]] {
                for wo in [flat, -flat] {
                    let lift = lift(corners, corners, uv, flat, wo);
                    assert!(lift.dot(wo) >= 0.0, "{lift} at {uv:?} from {wo}");
                }
            }
        }
    }

    #[test]
    fn points_are_lifted_to_the_sphere_from_outside_and_not_at_all_from_inside() {
        let mesh = pieces_of_a_sphere(0.2);
        let world = world_of(mesh.clone());
        let mut deepest = 0.0f32;
        for hit in hits() {
            let outward =
                world.interaction(&Ray::new(Vec3::ZERO, Vec3::Z), &hit).position.normalize();
            let from_outside = Ray::new(outward * 2.0, -outward);
            let surface = world.interaction(&from_outside, &hit);
            let lift = world.lift(&from_outside, &surface);
            let depth = 1.0 - surface.position.length();
            let left = (surface.position + lift).length() - 1.0;
            // Slivers are excluded, because they do not lie along the sphere.
            let corners = mesh.indices[hit.primitive as usize].map(|i| mesh.normals[i as usize]);
            if corners.iter().all(|n| n.dot(surface.geometric_normal) > BENT[1]) {
                // The planes touch the sphere at the corners and are above it elsewhere, by as much
                // as the triangle is below it.
                assert!((0.8 * depth..1.2 * depth + 1e-6).contains(&left), "{left} of {depth}");
                deepest = deepest.max(depth);
            }
            assert_eq!(world.lift(&Ray::new(Vec3::ZERO, outward), &surface), Vec3::ZERO);
        }
        assert!(deepest > 0.01);
    }

    #[test]
    fn flat_triangles_shapes_and_normals_bent_too_far_are_not_lifted() {
        let mesh = pieces_of_a_sphere(0.2);
        let flat = |t: usize| {
            let [a, b, c] = mesh.indices[t].map(|i| mesh.positions[i as usize]);
            (b - a).cross(c - a).normalize()
        };
        let with = |normals: Vec<Vec3>| TriangleMesh { normals, ..mesh.clone() };
        let flat_normals = (0..mesh.positions.len()).map(|v| flat(v / 3)).collect();
        let bent = (0..mesh.positions.len())
            .map(|v| {
                let n = flat(v / 3);
                n + (mesh.normals[v] - n * n.dot(mesh.normals[v])).normalize() * 1.5
            })
            .collect();
        for mesh in [with(vec![]), with(flat_normals), with(bent)] {
            let world = world_of(mesh);
            for hit in hits() {
                let ray = Ray::new(Vec3::splat(5.0), Vec3::splat(-0.5));
                assert_eq!(world.lift(&ray, &world.interaction(&ray, &hit)), Vec3::ZERO);
            }
        }
    }

    #[test]
    fn many_lifts_are_those_of_single_points_at_every_level() {
        let world = world_of(pieces_of_a_sphere(0.3));
        let (mut gathered, mut wo) = (TriangleHits::default(), [[0.0; TRIANGLE_HITS]; 3]);
        let (mesh, hits) = (world.plain_mesh(GeometryId(0)).expect("a mesh"), hits());
        gathered.gather(hits.iter().enumerate().map(|(lane, hit)| (lane, &mesh, hit)));
        let rays: Vec<Ray> = (0..hits.len())
            .map(|lane| {
                let u = rng::uniform2([lane as u32, 8, 8, 8]) * 2.0 - 1.0;
                let direction = Vec3::new(u.x, u.y, 0.4).normalize();
                (0..3).for_each(|axis| wo[axis][lane] = -direction[axis]);
                Ray::new(Vec3::ZERO, direction)
            })
            .collect();
        for level in Level::ALL {
            let (mut points, mut lifts) = (TrianglePoints::default(), [[0.0; TRIANGLE_HITS]; 3]);
            gathered.points(&mut points, level.wide());
            gathered.lifts(&points, &wo, &mut lifts, level.wide());
            let mut lifted = 0;
            for (i, (hit, ray)) in hits.iter().zip(&rays).enumerate() {
                let single = world.lift(ray, &world.interaction(ray, hit));
                assert_eq!(Vec3::new(lifts[0][i], lifts[1][i], lifts[2][i]), single);
                lifted += usize::from(single != Vec3::ZERO);
            }
            assert!((20..TRIANGLE_HITS).contains(&lifted), "{lifted}");
        }
    }

    #[test]
    fn instances_lift_as_the_mesh_would_where_it_is_put() {
        let (scale, by) = (DVec3::new(-2.0, 2.0, 2.0), DVec3::new(1.0, 2.0, 3.0));
        let matrix = DMat4::from_translation(by) * DMat4::from_scale(scale);
        let map = Transform::from_matrix(matrix).expect("it can be undone");
        let mut builder = WorldBuilder::default();
        let group = builder.add_group();
        builder.add_mesh(group, pieces_of_a_sphere(0.2).into());
        builder.add_instance(WorldBuilder::ROOT, group, map);
        let (world, alone) = (
            builder.build(&BuildOptions::default()).expect("a world"),
            world_of(pieces_of_a_sphere(0.2)),
        );
        for hit in hits() {
            let ray = Ray::new(Vec3::splat(9.0), Vec3::splat(-0.5));
            let local = Ray::new(
                Vec3::splat(9.0),
                map.inverse().vector(ray.direction.as_dvec3()).as_vec3(),
            );
            let here = Hit { instance: 1, ..hit };
            let lift = world.lift(&ray, &world.interaction(&ray, &here));
            let expected = alone.lift(&local, &alone.interaction(&local, &hit));
            assert!((lift - map.vector(expected.as_dvec3()).as_vec3()).length() < 1e-6);
        }
    }

    #[test]
    fn only_rays_along_the_surface_start_from_the_lifted_point() {
        let origin = |lift, direction| {
            lifted_ray_origin(Vec3::X, Vec3::splat(1e-7), Vec3::Z, lift, direction)
        };
        let lift = Vec3::new(0.0, 0.0, 0.25);
        let near = |a: Vec3, b: Vec3| (a - b).length() < 1e-6;
        assert!(near(origin(lift, Vec3::new(0.6, 0.0, 0.8)), Vec3::X));
        assert!(near(origin(lift, Vec3::X), Vec3::X + lift));
        assert!(near(origin(lift, Vec3::new(0.8, 0.0, -0.6)), Vec3::X + lift));
        assert!(near(origin(-lift, Vec3::new(0.8, 0.0, 0.6)), Vec3::X - lift));
        for direction in [Vec3::Z, -Vec3::Z] {
            let plain = robust::offset_ray_origin(Vec3::X, Vec3::splat(1e-7), Vec3::Z, direction);
            assert_eq!(origin(Vec3::ZERO, direction), plain);
        }
        assert!(origin(lift * 1e-12, Vec3::new(0.8, 0.0, -0.6)).z > 0.0);
    }
}
