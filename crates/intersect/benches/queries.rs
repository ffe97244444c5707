//! Measures the queries other than closest hits, and commits of a world that changes:
//! `cargo bench -p snell-intersect --bench queries -- bunny`.
//!
//! The measurements use one thread, and processor time where Linux provides it. The inputs are
//! points in the mesh's box enlarged by half, points near the surface, and rays through the box.
//! The best of three runs counts.

mod clock;
#[allow(dead_code, reason = "shared with other benchmarks")]
mod scenes;

use snell_intersect::{AcceptAll, BuildOptions, DynamicWorld, NearestPoint, WorldBuilder};
use snell_math::{DVec3, Ray, Transform, Vec3, rng};
use std::sync::Arc;
use std::time::Instant;

fn main() {
    let path =
        std::env::args().nth(1).filter(|name| name != "--bench").unwrap_or_else(|| "bunny".into());
    let mesh = Arc::new(scenes::by_name(&path).expect("a scene"));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    let mut builder = WorldBuilder::default();
    let group = builder.add_group();
    let id = builder.add_mesh(group, mesh.clone());
    let instance = builder.add_instance(WorldBuilder::ROOT, group, Transform::IDENTITY);
    let world = builder.clone().build(&BuildOptions::default()).expect("a world");
    let n = 100_000;
    let bounds = mesh.bounds();
    let random = |i: usize, k: u32| {
        let u = rng::pcg4d([i as u32, k, 3, 9]).map(rng::to_unit);
        bounds.center() + (Vec3::new(u[0], u[1], u[2]) - 0.5) * bounds.size() * 1.5
    };
    let spread: Vec<Vec3> = (0..n).map(|i| random(i, 0)).collect();
    let near: Vec<Vec3> = (0..n)
        .map(|i| {
            let p = mesh.positions[rng::hash32(i as u32) as usize % mesh.positions.len()];
            p + (random(i, 1) - bounds.center()) * 0.02
        })
        .collect();
    let rays: Vec<Ray> =
        (0..n).map(|i| Ray::new(random(i, 2), random(i, 3) - random(i, 2))).collect();
    println!("{} triangles", mesh.indices.len());
    let mut nearest = vec![NearestPoint::NONE; n];
    let (mut distances, mut numbers, mut inside) = (vec![0.0; n], vec![0.0; n], vec![false; n]);
    let start = Instant::now();
    world.winding_number(&spread[..1], &mut numbers[..1]);
    println!("winding tree {:.3} s", start.elapsed().as_secs_f64());
    for (name, points) in [("spread", &spread), ("near", &near)] {
        rate(&format!("nearest_point {name}"), n, || world.nearest_point(points, &mut nearest));
        rate(&format!("winding_number {name}"), n, || world.winding_number(points, &mut numbers));
        rate(&format!("occupancy {name}"), n, || world.occupancy(points, &mut inside));
        rate(&format!("signed_distance {name}"), n, || {
            world.signed_distance(points, &mut distances)
        });
    }
    let mut counts = vec![0; n];
    rate("count", n, || world.count(&rays, &AcceptAll, &mut counts));
    let mut hits = 0;
    rate("all", n, || hits = world.all(&rays, &AcceptAll).hits.len());
    println!("{:.2} crossings a ray", hits as f64 / n as f64);
    rate("one exact winding number", 1, || numbers[0] = world.winding_number_exact(spread[0]));

    let mut dynamic = DynamicWorld::from_builder(builder, BuildOptions::default());
    let time = |name: &str, dynamic: &mut DynamicWorld| {
        let start = Instant::now();
        let world = pool.install(|| dynamic.commit()).expect("a world");
        println!("{name} {:.2} ms {:?}", start.elapsed().as_secs_f64() * 1e3, world.stats().reuse);
    };
    time("build", &mut dynamic);
    dynamic.edit().move_instance(instance, Transform::translation(DVec3::X));
    time("move an instance", &mut dynamic);
    let moved = mesh.positions.iter().map(|&p| p * 1.01).collect();
    dynamic.edit().set_positions(id, moved).expect("as many");
    time("move all vertices", &mut dynamic);
}

/// Prints the number of items processed per second.
fn rate(name: &str, count: usize, mut run: impl FnMut()) {
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let before = clock::of_thread();
        run();
        best = best.min(clock::of_thread() - before);
    }
    println!(
        "{name}: {:.3} M/s ({:.2} us each)",
        count as f64 / best * 1e-6,
        best / count as f64 * 1e6
    );
}
