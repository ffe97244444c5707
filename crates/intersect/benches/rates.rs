//! Measures build time and ray rates on a mesh: `cargo bench -p snell-intersect --bench rates --
//! mesh.obj [copies [kinds]]`, where kinds may be `diffuse,shuffled` (then nothing else is
//! measured). If `SNELL_SIMD` is set, only that level is measured.
//!
//! The measurements use one thread, and processor time where the system provides it (so that other
//! work on the machine counts less). The rays are primary rays over 1024x1024 pixels in blocks of
//! 4x4, one cosine-distributed bounce from the hits, the bounces shuffled, and shadow rays to a
//! point above. The best of five runs counts.
//!
//! Cargo runs the benchmark in the crate's folder, so paths must be absolute.

#![expect(clippy::disallowed_methods, reason = "times need no certain bits")]

mod clock;

use snell_intersect::{
    AcceleratorKind, AcceptAll, BuildOptions, Grouping, Hit, TriangleMesh, World, WorldBuilder,
};
use snell_math::simd::Level;
use snell_math::{DMat3, DVec3, Frame, Ray, Vec3, rng, sampling};
use std::sync::Arc;
use std::time::Instant;

/// The mesh that is measured by default.
const BUNNY: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/meshes/common/stanford-bunny.obj");

/// The `n`-th argument, without the argument that Cargo appends.
fn argument(n: usize) -> Option<String> {
    std::env::args().nth(n).filter(|word| word != "--bench")
}

fn read_obj(path: &str) -> std::io::Result<TriangleMesh> {
    let mut mesh = TriangleMesh::default();
    for line in std::fs::read_to_string(path)?.lines() {
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
    Ok(mesh)
}

fn best_of<T>(n: u32, mut run: impl FnMut() -> T) -> (f64, T) {
    let mut best = (f64::INFINITY, run());
    for _ in 0..n {
        let start = clock::of_thread();
        let result = run();
        best = (best.0.min(clock::of_thread() - start), result);
    }
    best
}

/// Many rotated copies of a mesh side by side, as one mesh.
fn copies(mesh: &TriangleMesh, n: usize) -> TriangleMesh {
    let size = mesh.bounds().size().max_element();
    let mut all = TriangleMesh::default();
    for i in 0..n {
        let u = |k: u32| f64::from(rng::to_unit(rng::pcg4d([i as u32, k, 0, 0])[0]));
        let turn =
            DMat3::from_axis_angle(DVec3::new(u(0), u(1), u(2) + 0.1).normalize(), u(3) * 6.0);
        let spread = f64::from(size) * (n as f64).cbrt() * 0.7;
        let first = all.positions.len() as u32;
        let offset = DVec3::new(u(4), u(5), u(6)) * spread;
        all.positions
            .extend(mesh.positions.iter().map(|p| (turn * p.as_dvec3() + offset).as_vec3()));
        all.indices.extend(mesh.indices.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

fn primary_rays(world: &World) -> Vec<Ray> {
    let bounds = world.bounds();
    let (center, radius) = (bounds.center().as_vec3(), bounds.radius() as f32);
    let eye = center + Vec3::new(0.3, 0.4, 1.0).normalize() * radius * 1.9;
    let frame = Frame::from_z((center - eye).normalize());
    let mut rays = Vec::new();
    for i in 0..1u32 << 20 {
        // Pixels are in Morton order.
        let bit = |shift: u32| (0..10).map(|b| ((i >> (2 * b + shift)) & 1) << b).sum::<u32>();
        let plane = |p: u32| (p as f32 + 0.5) / 512.0 - 1.0;
        let d = frame.z + (frame.x * plane(bit(0)) + frame.y * plane(bit(1))) * 0.5;
        rays.push(Ray::new(eye, d));
    }
    rays
}

/// True if this kind of ray is to be measured.
fn is_wanted(name: &str) -> bool {
    argument(3).is_none_or(|kinds| kinds.split(',').any(|kind| kind == name))
}

fn report(name: &str, world: &World, rays: &[Ray], grouping: Grouping) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    if !is_wanted(name) {
        world.closest(rays, grouping, &AcceptAll, &mut hits);
        return hits;
    }
    let (seconds, ()) = best_of(5, || world.closest(rays, grouping, &AcceptAll, &mut hits));
    let (alone, ()) = best_of(3, || {
        for (ray, hit) in rays.iter().zip(&mut hits) {
            *hit = world.closest_one(ray, &AcceptAll);
        }
    });
    let found = hits.iter().filter(|h| h.is_hit()).count();
    let mut sum = (0u64, 0u64);
    for ray in rays.iter().step_by(17) {
        let c = world.closest_counted(ray, &AcceptAll).1;
        sum = (sum.0 + u64::from(c.nodes_visited), sum.1 + u64::from(c.primitives_tested));
    }
    let n = rays.len().div_ceil(17) as f64;
    println!(
        "  {name:9} {:6.2} Mrays/s, one ray a call {:6.2}  ({} rays, {found} hits, {:.1} nodes and \
            {:.1} primitives a ray)",
        rays.len() as f64 / seconds * 1e-6,
        rays.len() as f64 / alone * 1e-6,
        rays.len(),
        sum.0 as f64 / n,
        sum.1 as f64 / n
    );
    hits
}

fn main() -> std::io::Result<()> {
    let path = argument(1).unwrap_or_else(|| BUNNY.into());
    let n = argument(2).and_then(|n| n.parse().ok()).unwrap_or(1);
    let mesh = read_obj(&path)?;
    let mesh = Arc::new(if n == 1 { mesh } else { copies(&mesh, n) });
    let only = std::env::var("SNELL_SIMD").ok();
    let is_chosen = |level: &Level| only.as_ref().is_none_or(|only| *only == level.to_string());
    for simd in Level::ALL.into_iter().filter(|level| level.is_supported() && is_chosen(level)) {
        let options =
            BuildOptions { accelerator: AcceleratorKind::Bvh, simd, ..BuildOptions::default() };
        let start = Instant::now();
        let (_, world) = best_of(0, || {
            let mut builder = WorldBuilder::default();
            builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
            builder.build(&options).expect("a mesh builds")
        });
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{simd}: {} triangles built in {seconds:.3} s, {:?}",
            mesh.indices.len(),
            world.stats()
        );
        let rays = primary_rays(&world);
        let hits = report("primary", &world, &rays, Grouping::Coherent);
        let light = world.bounds().max.as_vec3() + world.bounds().radius() as f32;
        let (mut bounces, mut shadows) = (Vec::new(), Vec::new());
        for (i, (ray, hit)) in rays.iter().zip(&hits).enumerate().filter(|(_, (_, h))| h.is_hit()) {
            let surface = world.interaction(ray, hit);
            let up = if ray.direction.dot(surface.geometric_normal) > 0.0 { -1.0 } else { 1.0 };
            let u = rng::uniform2([i as u32, 1, 2, 3]);
            let d = Frame::from_z(surface.geometric_normal * up)
                .from_local(sampling::cosine_hemisphere(u));
            bounces.push(Ray::new(surface.ray_origin(d), d));
            let d = light - surface.position;
            shadows.push(Ray::new(surface.ray_origin(d), d).with_t_max(1.0));
        }
        report("diffuse", &world, &bounces, Grouping::None);
        for i in (1..bounces.len()).rev() {
            bounces.swap(i, rng::hash32(i as u32) as usize % (i + 1));
        }
        report("shuffled", &world, &bounces, Grouping::None);
        if !is_wanted("shadow") {
            continue;
        }
        let mut blocked = vec![false; shadows.len()];
        let (seconds, ()) =
            best_of(5, || world.occluded(&shadows, Grouping::Coherent, &AcceptAll, &mut blocked));
        let occluded = blocked.iter().filter(|b| **b).count();
        println!(
            "  shadow    {:6.2} Mrays/s  ({} rays, {occluded} occluded)",
            shadows.len() as f64 / seconds * 1e-6,
            shadows.len()
        );
    }
    Ok(())
}
