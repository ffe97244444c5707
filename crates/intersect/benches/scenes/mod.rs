//! Meshes for benchmarks, and rays into them.

#![expect(clippy::disallowed_methods, reason = "times need no certain bits")]

use snell_intersect::{AcceptAll, Grouping, Hit, TriangleMesh, World};
use snell_math::{DMat3, DVec3, Frame, Ray, Vec3, rng, sampling};

/// The mesh with this name; `None` for an unknown name.
pub fn by_name(name: &str) -> Option<TriangleMesh> {
    let (kind, n) =
        name.split_once(':').map_or((name, None), |(kind, n)| (kind, n.parse::<usize>().ok()));
    Some(match kind {
        "bunny" => bunny(),
        "bunnies" => copies(&bunny(), n.unwrap_or(100)),
        "terrain" => terrain(n.unwrap_or(1448)),
        "room" => room(n.unwrap_or(24)),
        _ => return None,
    })
}

/// Uniform in [0, 1).
fn uniform(i: usize, k: u32) -> f64 {
    f64::from(rng::to_unit(rng::pcg4d([i as u32, k, 7, 0])[0]))
}

fn bunny() -> TriangleMesh {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/meshes/common/stanford-bunny.obj"
    );
    let mut mesh = TriangleMesh::default();
    for line in std::fs::read_to_string(path).expect("the bunny, beside the repository").lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let x: Vec<f32> = words.filter_map(|w| w.parse().ok()).collect();
                mesh.positions.push(Vec3::new(x[0], x[1], x[2]));
            }
            Some("f") => {
                let first = |w: &str| {
                    w.split('/').next().and_then(|i| i.parse::<u32>().ok()).map(|i| i - 1)
                };
                let corners: Vec<u32> = words.filter_map(first).collect();
                mesh.indices
                    .extend((2..corners.len()).map(|i| [corners[0], corners[i - 1], corners[i]]));
            }
            _ => {}
        }
    }
    mesh
}

fn add(all: &mut TriangleMesh, mesh: &TriangleMesh, place: impl Fn(DVec3) -> DVec3) {
    let first = all.positions.len() as u32;
    all.positions.extend(mesh.positions.iter().map(|p| place(p.as_dvec3()).as_vec3()));
    all.indices.extend(mesh.indices.iter().map(|t| t.map(|v| v + first)));
}

fn turn(i: usize) -> DMat3 {
    DMat3::from_axis_angle(
        DVec3::new(uniform(i, 0), uniform(i, 1), uniform(i, 2) + 0.1).normalize(),
        uniform(i, 3) * 6.0,
    )
}

/// Many rotated copies of a mesh side by side, as one mesh.
fn copies(mesh: &TriangleMesh, n: usize) -> TriangleMesh {
    let spread = f64::from(mesh.bounds().size().max_element()) * (n as f64).cbrt() * 0.7;
    let mut all = TriangleMesh::default();
    for i in 0..n {
        let offset = DVec3::new(uniform(i, 4), uniform(i, 5), uniform(i, 6)) * spread;
        let turn = turn(i);
        add(&mut all, mesh, |p| turn * p + offset);
    }
    all
}

/// A noisy height field of n by n squares.
fn terrain(n: usize) -> TriangleMesh {
    let height = |x: usize, y: usize| {
        let (u, v) = (x as f32 / n as f32, y as f32 / n as f32);
        let noise = rng::to_unit(rng::pcg4d([x as u32, y as u32, 3, 4])[0]);
        0.1 * ((u * 9.0).sin() * (v * 7.0).cos() + 0.3 * (u * 40.0).sin() * (v * 50.0).sin())
            + noise / n as f32
    };
    let mut mesh = TriangleMesh::default();
    for y in 0..=n {
        mesh.positions.extend(
            (0..=n).map(|x| Vec3::new(x as f32 / n as f32, height(x, y), y as f32 / n as f32)),
        );
    }
    let at = |x: usize, y: usize| (y * (n + 1) + x) as u32;
    for y in 0..n {
        for x in 0..n {
            let (a, b, c, d) = (at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1));
            mesh.indices.extend([[a, d, c], [a, c, b]]);
        }
    }
    mesh
}

/// A closed room with bunnies, columns of tall slivers, and long thin beams from wall to wall.
fn room(bunnies: usize) -> TriangleMesh {
    let size = DVec3::new(20.0, 6.0, 14.0);
    let mut all = TriangleMesh::default();
    let cube = cube();
    add(&mut all, &cube, |p| p * size);
    let bunny = bunny();
    let scale = 1.2 / f64::from(bunny.bounds().size().max_element());
    for i in 0..bunnies {
        let at = DVec3::new(
            1.0 + uniform(i, 10) * 18.0,
            0.2 + uniform(i, 11) * 3.0,
            1.0 + uniform(i, 12) * 12.0,
        );
        let turn = turn(i + 1000);
        add(&mut all, &bunny, |p| turn * p * scale + at);
    }
    for i in 0..40 {
        let at = DVec3::new(2.0 + uniform(i, 20) * 16.0, 0.0, 2.0 + uniform(i, 21) * 10.0);
        add(&mut all, &column(256), |p| p * DVec3::new(0.3, 6.0, 0.3) + at);
    }
    for i in 0..300 {
        let end = |k: u32| DVec3::new(uniform(i, k), uniform(i, k + 1), uniform(i, k + 2)) * size;
        let (a, b) = (end(30), end(40));
        let frame = Frame::from_z((b - a).normalize().as_vec3());
        let (x, y) = (frame.x.as_dvec3() * 0.015, frame.y.as_dvec3() * 0.015);
        add(&mut all, &cube, |p| a + (b - a) * p.z + x * p.x + y * p.y);
    }
    all
}

fn cube() -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    mesh.positions
        .extend((0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32)));
    for [a, b, c, d] in
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    {
        mesh.indices.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// An open cylinder of radius and height 1.
fn column(n: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..n {
        let (y, x) = (i as f32 / n as f32 * std::f32::consts::TAU).sin_cos();
        mesh.positions.extend([Vec3::new(x, 0.0, y), Vec3::new(x, 1.0, y)]);
        let (a, b) = (2 * i as u32, 2 * ((i + 1) % n) as u32);
        mesh.indices.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
    }
    mesh
}

/// 1024 by 1024 rays of a pinhole camera in front of the scene (in a room, inside it), in Morton
/// order.
pub fn primary_rays(world: &World) -> Vec<Ray> {
    let bounds = world.bounds();
    let (center, radius) = (bounds.center().as_vec3(), bounds.radius() as f32);
    let is_room = bounds.size().x == 20.0;
    let distance = if is_room { 0.4 } else { 1.9 };
    let eye = center
        + Vec3::new(0.3, if is_room { 0.1 } else { 0.4 }, 1.0).normalize() * radius * distance;
    let frame = Frame::from_z((center - eye).normalize());
    let ray = |i: u32| {
        let bits = |shift: u32| (0..10).map(|b| ((i >> (2 * b + shift)) & 1) << b).sum::<u32>();
        let plane = |p: u32| (p as f32 + 0.5) / 512.0 - 1.0;
        Ray::new(eye, frame.z + (frame.x * plane(bits(0)) + frame.y * plane(bits(1))) * 0.5)
    };
    (0..1u32 << 20).map(ray).collect()
}

/// Rays of one cosine-distributed bounce from the hits.
pub fn diffuse_rays(world: &World, rays: &[Ray]) -> Vec<Ray> {
    let mut hits = vec![Hit::MISS; rays.len()];
    world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
    let bounce = |(i, (ray, hit)): (usize, (&Ray, &Hit))| {
        let surface = world.interaction(ray, hit);
        let up = if ray.direction.dot(surface.geometric_normal) > 0.0 { -1.0 } else { 1.0 };
        let u = rng::uniform2([i as u32, 1, 2, 3]);
        let d =
            Frame::from_z(surface.geometric_normal * up).from_local(sampling::cosine_hemisphere(u));
        Ray::new(surface.ray_origin(d), d)
    };
    rays.iter().zip(&hits).enumerate().filter(|(_, (_, h))| h.is_hit()).map(bounce).collect()
}
