//! Measures builds: `cargo bench -p snell-intersect --bench builds -- [SCENE...] [--quality LIST]
//! [--rays] [--cache FOLDER]`.
//!
//! The scenes are `bunny`, `bunnies` (100 rotated copies in one mesh, 7M triangles), `terrain`
//! (4.2M), `room` (columns and long thin beams, 1.8M), and `terrain:N` with N by N squares. The
//! output has for each quality the best time of five builds, triangles per second, the cost by the
//! surface area heuristic (the nodes and blocks that a random ray through the bounds would visit),
//! bytes per triangle and, with `--rays`, rates on one thread. With `--cache`, trees are cached in
//! files in that folder, as by `snell render --bvh-cache`, and the time is that of reading the file
//! once it exists.
//!
//! Cargo runs the benchmark in the crate's folder, so paths must be absolute.

mod clock;
mod scenes;

use scenes::{diffuse_rays, primary_rays};
use snell_intersect::{
    AcceptAll, BuildOptions, Grouping, Hit, Quality, TriangleMesh, World, WorldBuilder,
};
use std::sync::Arc;
use std::time::Instant;

fn build(mesh: &Arc<TriangleMesh>, options: &BuildOptions) -> World {
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
    builder.build(options).expect("a mesh builds")
}

fn rate(world: &World, rays: &[snell_math::Ray]) -> f64 {
    let mut hits = vec![Hit::MISS; rays.len()];
    let seconds = (0..3).map(|_| {
        let start = Instant::now();
        world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
        start.elapsed().as_secs_f64()
    });
    rays.len() as f64 * 1e-6 / seconds.fold(f64::INFINITY, f64::min)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str| {
        arguments.iter().position(|a| a == name).and_then(|i| arguments.get(i + 1)).cloned()
    };
    let qualities: Vec<Quality> = match value("--quality") {
        Some(list) => list.split(',').filter_map(Quality::from_name).collect(),
        None => Quality::ALL.to_vec(),
    };
    let repeat: u32 = value("--repeat").and_then(|n| n.parse().ok()).unwrap_or(5);
    let cache = value("--cache").map(std::path::PathBuf::from);
    let with_rays = arguments.iter().any(|a| a == "--rays");
    for name in arguments.iter().take_while(|a| !a.starts_with("--")) {
        let start = Instant::now();
        let Some(mesh) = scenes::by_name(name) else {
            eprintln!("no scene {name}");
            continue;
        };
        let n = mesh.indices.len();
        println!("{name}: {n} triangles, made in {:.2} s", start.elapsed().as_secs_f64());
        let mesh = Arc::new(mesh);
        for &quality in &qualities {
            let options = BuildOptions { quality, cache: cache.clone(), ..BuildOptions::default() };
            let (mut best, mut processor) = (f64::INFINITY, f64::INFINITY);
            let mut last = None;
            for _ in 0..repeat {
                drop(last.take());
                let (start, before) = (Instant::now(), clock::of_process());
                last = Some(build(&mesh, &options));
                best = best.min(start.elapsed().as_secs_f64());
                processor = processor.min(clock::of_process() - before);
            }
            let Some(world) = last else { continue };
            let stats = world.stats();
            print!(
                "  {:6} {best:.3} s {:6.2} Mtri/s, {processor:.2} s of processors ({:.2} Mtri/s on \
                    four)  cost {:6.1}  {:5.1} B/tri, {} nodes, {} blocks, depth {}",
                quality.name(),
                n as f64 * 1e-6 / best,
                n as f64 * 4e-6 / processor,
                stats.sah_cost,
                stats.memory_bytes as f64 / n as f64,
                stats.nodes,
                stats.triangle_blocks,
                stats.depth,
            );
            if with_rays {
                let primary = primary_rays(&world);
                let diffuse = diffuse_rays(&world, &primary);
                print!(
                    "  Mrays/s: primary {:.2} diffuse {:.2}",
                    rate(&world, &primary),
                    rate(&world, &diffuse)
                );
            }
            println!("{}", if stats.cached_groups > 0 { "  from a file" } else { "" });
        }
    }
}
