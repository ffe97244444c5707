//! Generated scenes: a noisy terrain, and a closed room of long thin triangles.

use super::{joined, surface};
use snell_intersect::TriangleMesh;
use snell_math::{DAffine3, DMat3, DVec3, Transform, Vec3, real, rng};
use snell_scene::{Camera, Scene};
use std::f32::consts::TAU;

/// Vertices along a side of the terrain: 4 million triangles.
const TERRAIN_SIDE: u32 = 1449;

/// A noisy height field of 4 million triangles, seen from above a corner. It has no light.
pub fn terrain() -> (Scene, Option<Vec3>) {
    let mut scene = Scene::new("terrain");
    scene.nodes[0].surfaces.push(surface(height_field(TERRAIN_SIDE)));
    let (eye, target) = (Vec3::new(-0.7, 0.55, -0.7), Vec3::new(0.1, 0.0, 0.1));
    scene.cameras.push(Camera::look_at(eye, target, Vec3::Y, 0.5));
    (scene, None)
}

/// A height field over the square from -1 to 1: five octaves of smooth noise, plus roughness.
fn height_field(side: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for z in 0..side {
        for x in 0..side {
            let p = [x, z].map(|i| i as f32 / (side - 1) as f32 * 2.0 - 1.0);
            let octave =
                |k: u32| noise(p.map(|c| (c + 3.0) * (2u32 << k) as f32), k) / (1u32 << k) as f32;
            let rough = (random([x, z, 77]) - 0.5) / side as f32;
            let y = (0..5).map(octave).sum::<f32>() * 0.25 + rough;
            mesh.positions.push(Vec3::new(p[0], y, p[1]));
        }
    }
    for z in 0..side - 1 {
        for x in 0..side - 1 {
            let a = z * side + x;
            mesh.indices.extend([[a, a + side, a + 1], [a + 1, a + side, a + side + 1]]);
        }
    }
    mesh
}

/// Smooth noise in `[0, 1)`: random values at the points of a grid, interpolated.
fn noise(p: [f32; 2], seed: u32) -> f32 {
    let cell = p.map(f32::floor);
    let [u, v] = [p[0] - cell[0], p[1] - cell[1]].map(|t| t * t * (3.0 - 2.0 * t));
    let at = |dx: u32, dz: u32| random([cell[0] as u32 + dx, cell[1] as u32 + dz, seed]);
    let near = at(0, 0) * (1.0 - u) + at(1, 0) * u;
    let far = at(0, 1) * (1.0 - u) + at(1, 1) * u;
    near * (1.0 - v) + far * v
}

/// A hash of the numbers, in `[0, 1)`.
fn random([a, b, c]: [u32; 3]) -> f32 {
    rng::to_unit(rng::pcg4d([a, b, c, 1])[0])
}

/// Half of the room's size, in metres.
const ROOM: Vec3 = Vec3::new(20.0, 10.0, 20.0);

/// A closed room of 40 by 20 by 40 metres and 1.8 million triangles: rough balls, columns of
/// slivers as high as the room and 1.5 cm wide, and 300 long thin beams across it at all angles.
/// Its light hangs below the middle of the ceiling.
pub fn room() -> (Scene, Option<Vec3>) {
    let mut parts = vec![cuboid(ROOM, &|p| p, true)];
    for i in 0..12 {
        let u = |k: u32| random([i, k, 5]);
        let center = Vec3::new(u(0) * 32.0 - 16.0, u(1) * 5.0 - 8.0, u(2) * 28.0 - 16.0);
        parts.push(ball(center, 0.8 + 2.0 * u(3), 256, 280, i));
    }
    for i in 0..64 {
        let (x, z) = ((i % 8) as f32 * 5.0 - 17.0, (i / 8) as f32 * 5.0 - 18.5);
        parts.push(column(Vec3::new(x, 0.0, z), 0.8, 336));
    }
    for i in 0..300 {
        parts.push(beam(i));
    }
    let mut scene = Scene::new("room");
    scene.nodes[0].surfaces.push(surface(joined(parts)));
    let (eye, target) = (Vec3::new(1.0, 0.6, 19.0), Vec3::new(-1.0, -1.6, 0.0));
    scene.cameras.push(Camera::look_at(eye, target, Vec3::Y, 0.7));
    (scene, Some(Vec3::new(0.6, 9.3, 0.8)))
}

/// A box around the origin with its corners transformed by `map`; seen from inside if `inward`.
fn cuboid(half: Vec3, map: &dyn Fn(Vec3) -> Vec3, inward: bool) -> TriangleMesh {
    let corner = |i: u32| {
        let sign = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        map(Vec3::new(sign(0), sign(1), sign(2)) * half)
    };
    let positions = (0..8).map(corner).collect();
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let indices = indices.map(|[a, b, c]| if inward { [a, c, b] } else { [a, b, c] }).collect();
    TriangleMesh { positions, indices, ..TriangleMesh::default() }
}

/// A beam of 16 to 24 m by 8 cm near the middle of the room.
fn beam(i: u32) -> TriangleMesh {
    let u = |k: u32| f64::from(random([i, k, 9]));
    let towards = DVec3::new(u(0) - 0.5, (u(1) - 0.5) * 0.35, u(2) - 0.5).normalize_or(DVec3::X);
    let side = towards.any_orthonormal_vector();
    let turn = DMat3::from_cols(towards, side, towards.cross(side));
    let center = DVec3::new(u(3) * 12.0 - 6.0, u(4) * 6.0 - 2.0, u(5) * 12.0 - 6.0);
    let place = Transform::new(DAffine3::from_mat3_translation(turn, center))
        .unwrap_or(Transform::IDENTITY);
    let half = 8.0 + 4.0 * random([i, 6, 9]);
    cuboid(Vec3::new(half, 0.04, 0.04), &|p| place.point(p.as_dvec3()).as_vec3(), false)
}

/// A column from floor to ceiling of full-length slivers: two for each of its sides.
fn column(foot: Vec3, radius: f32, sides: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..sides {
        let (sin, cos) = real::sin_cos(i as f32 / sides as f32 * TAU);
        for y in [-ROOM.y, ROOM.y] {
            mesh.positions.push(foot + Vec3::new(cos * radius, y, sin * radius));
        }
        let (a, b) = (2 * i, 2 * ((i + 1) % sides));
        mesh.indices.extend([[a, a + 1, b], [b, a + 1, b + 1]]);
    }
    mesh
}

/// A rough ball of rings and segments, closed at the poles.
fn ball(center: Vec3, radius: f32, rings: u32, segments: u32, seed: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut push = |theta: f32, phi: f32| {
        let d = Vec3::new(
            real::sin(theta) * real::cos(phi),
            real::cos(theta),
            real::sin(theta) * real::sin(phi),
        );
        let bumps = noise([(d.x + 2.0) * 6.0, (d.y + d.z + 4.0) * 6.0], seed) - 0.5;
        mesh.positions.push(center + d * radius * (1.0 + 0.15 * bumps));
    };
    push(0.0, 0.0);
    for ring in 1..rings {
        for segment in 0..segments {
            push(ring as f32 / rings as f32 * TAU * 0.5, segment as f32 / segments as f32 * TAU);
        }
    }
    push(TAU * 0.5, 0.0);
    let last = mesh.positions.len() as u32 - 1;
    let at = |ring: u32, segment: u32| match ring {
        0 => 0,
        _ if ring == rings => last,
        _ => 1 + (ring - 1) * segments + segment % segments,
    };
    for ring in 0..rings {
        for segment in 0..segments {
            let (a, b) = (at(ring, segment), at(ring, segment + 1));
            let (c, d) = (at(ring + 1, segment), at(ring + 1, segment + 1));
            if ring > 0 {
                mesh.indices.push([a, b, c]);
            }
            if ring + 1 < rings {
                mesh.indices.push([b, d, c]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn balls_and_beams_are_closed_and_all_is_of_the_size_it_says() {
        for mesh in [ball(Vec3::ZERO, 1.0, 8, 9, 1), beam(3)] {
            let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
            for t in &mesh.indices {
                for k in 0..3 {
                    let (a, b) = (t[k], t[(k + 1) % 3]);
                    *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
                }
            }
            assert!(edges.values().all(|&sum| sum == 0));
        }
        let triangles = |scene: Scene| match &scene.nodes[0].surfaces[0].geometry {
            snell_scene::Geometry::Mesh(mesh) => mesh.indices.len(),
            snell_scene::Geometry::Shape(_) | snell_scene::Geometry::Curves(_) => 0,
        };
        assert_eq!(triangles(room().0) / 10_000, 176);
        assert_eq!(height_field(5).indices.len(), 32);
    }

    #[test]
    fn walls_face_inward_and_beams_outward() {
        let volume = |mesh: &TriangleMesh| {
            let six = mesh.indices.iter().map(|t| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
                a.dot(b.cross(c))
            });
            six.sum::<f64>() / 6.0
        };
        assert!(volume(&cuboid(Vec3::ONE, &|p| p, true)) < -7.9);
        assert!(volume(&cuboid(Vec3::ONE, &|p| p, false)) > 7.9);
        assert!(volume(&ball(Vec3::ZERO, 1.0, 32, 32, 1)) > 2.0);
    }
}
