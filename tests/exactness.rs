//! The test of exactness. Rays start inside of closed meshes, aimed at every vertex and at the
//! middle of every edge, or in random directions. None may escape, and every crossing must count
//! exactly once: the number of crossings is odd, and exits minus entries is one.
//!
//! The environment variable `SNELL_EXACT_RAYS` sets the number of rays of either kind for each mesh
//! at each place (20,000 by default); a table is printed.

use rayon::prelude::*;
use snell_formats::ReadOptions;
use snell_intersect::{AcceptAll, BuildOptions, Hit, TriangleMesh, World, WorldBuilder};
use snell_math::rng::{pcg4d, to_unit};
use snell_math::sampling::uniform_sphere;
use snell_math::{Ray, Vec2, Vec3};
use snell_scene::Geometry;
use snell_tests::meshes::{closed, icosphere, latitude_longitude_sphere};
use std::path::Path;
use std::sync::Arc;

fn rays_per_case() -> usize {
    std::env::var("SNELL_EXACT_RAYS").ok().and_then(|s| s.parse().ok()).unwrap_or(20_000)
}

fn random(index: usize, stream: u32) -> [f32; 4] {
    pcg4d([index as u32, (index >> 32) as u32, stream, 77]).map(to_unit)
}

fn direction(index: usize, stream: u32) -> Vec3 {
    let u = random(index, stream);
    uniform_sphere(Vec2::new(u[0], u[1]))
}

/// The meshes to test. Meshes from files are skipped if the files do not exist.
fn meshes() -> Vec<(String, TriangleMesh)> {
    let mut meshes =
        vec![("lat-long sphere 100x200".to_string(), latitude_longitude_sphere(2.0, 100, 200))];
    meshes.extend(
        (0..6).map(|levels| (format!("icosphere {}", 20 << (2 * levels)), icosphere(2.0, levels))),
    );
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/meshes");
    for file in ["common/stanford-bunny.obj", "common/spot.obj", "trimesh/ballA.off"] {
        let Ok(scene) = snell_formats::read_scene(&data.join(file), &ReadOptions::default()) else {
            eprintln!("skipped: no {file}");
            continue;
        };
        let surfaces = scene.nodes.iter().flat_map(|n| &n.surfaces).map(|s| &s.geometry);
        let mesh = surfaces
            .filter_map(|g| if let Geometry::Mesh(mesh) = g { Some(mesh) } else { None })
            .next();
        let mesh = mesh.and_then(|m| closed(m)).unwrap_or_else(|| panic!("{file} can be closed"));
        meshes.push((file.to_string(), mesh));
    }
    meshes
}

/// The mesh scaled to a radius of about 2 around the origin, then scaled by `scale` and moved to
/// `center`, with a single rounding.
fn placed(mesh: &TriangleMesh, scale: f64, center: Vec3) -> TriangleMesh {
    let bounds = mesh.bounds();
    let (middle, size) = (bounds.center().as_dvec3(), f64::from(bounds.size().max_element()));
    let mut placed = mesh.clone();
    for p in &mut placed.positions {
        *p = ((p.as_dvec3() - middle) * (4.0 / size) * scale + center.as_dvec3()).as_vec3();
    }
    placed
}

/// The number of exits minus the number of entries over all crossings.
fn winding(mesh: &TriangleMesh, ray: &Ray, hits: &[Hit]) -> i32 {
    let sign = |hit: &Hit| {
        let [a, b, c] = mesh.corners(hit.primitive as usize).map(|p| p.as_dvec3());
        if (b - a).cross(c - a).dot(ray.direction.as_dvec3()) > 0.0 { 1 } else { -1 }
    };
    hits.iter().map(sign).sum()
}

/// Some points inside, well off the surface.
fn origins(world: &World, mesh: &TriangleMesh, radius: f32, center: Vec3) -> Vec<Vec3> {
    let is_inside = |p: Vec3| {
        let inside = |k: usize| {
            let ray = Ray::new(p, direction(k, 5));
            let hits = world.all_one(&ray, &AcceptAll);
            winding(mesh, &ray, &hits) == 1 && hits.iter().all(|h| h.t > radius * 0.01)
        };
        (0..31).filter(|&k| inside(k)).count() >= 30
    };
    let candidates = (0..10_000).map(|i| {
        let u = random(i, 9);
        center + (Vec3::new(u[0], u[1], u[2]) * 2.0 - 1.0) * radius
    });
    candidates.filter(|&p| is_inside(p)).take(4).collect()
}

#[derive(Clone, Copy, Default)]
struct Counts {
    rays: usize,
    misses: usize,
    /// Number of rays with an even number of crossings: one was lost or counted twice.
    wrong: usize,
    /// Number of rays for which exits minus entries is not one, or which cross a convex shape
    /// several times: projected along the ray the mesh is folded, so that some triangles face the
    /// wrong way.
    folded: usize,
}

impl Counts {
    fn plus(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            misses: self.misses + other.misses,
            wrong: self.wrong + other.wrong,
            folded: self.folded + other.folded,
        }
    }
}

fn probe(
    world: &World,
    mesh: &TriangleMesh,
    convex: bool,
    rays: usize,
    ray: impl Fn(usize) -> Ray + Sync,
) -> Counts {
    let one = |i: usize| {
        let ray = ray(i);
        let hits = world.all_one(&ray, &AcceptAll);
        let wrong = usize::from(hits.len().is_multiple_of(2));
        let folded = usize::from(winding(mesh, &ray, &hits) != 1 || (convex && hits.len() > 1));
        Counts { rays: 1, misses: usize::from(hits.is_empty()), wrong, folded }
    };
    (0..rays).into_par_iter().with_min_len(256).map(one).reduce(Counts::default, Counts::plus)
}

#[test]
fn no_ray_escapes_a_closed_mesh_and_every_crossing_counts_once() {
    let count = rays_per_case();
    let far = Vec3::new(148376.0, 1234.0, -223423.0);
    let mut total = Counts::default();
    for (name, mesh) in meshes() {
        let convex = name.contains("sphere");
        for (place, scale, center) in [
            ("origin", 1.0, Vec3::ZERO),
            ("far", 1.0, far),
            ("1e-6", 1e-6, Vec3::ZERO),
            ("1e9", 1e9, Vec3::ZERO),
        ] {
            let mesh = placed(&mesh, scale, center);
            let mut builder = WorldBuilder::default();
            builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh.clone()));
            let world = builder.build(&BuildOptions::default()).expect("a world");
            let origins = origins(&world, &mesh, 2.0 * scale as f32, center);
            assert!(!origins.is_empty(), "{name}, {place}: there are points inside");
            let targets = mesh.positions.len() + mesh.indices.len() * 3;
            // A stride without common factors covers all targets: sparsely with few rays, and
            // completely with many.
            let aimed = |i: usize| {
                let target = (i * 7919) % targets;
                let target = match target.checked_sub(mesh.positions.len()) {
                    None => mesh.positions[target],
                    Some(edge) => {
                        let t = mesh.corners(edge / 3);
                        (t[edge % 3] + t[(edge + 1) % 3]) * 0.5
                    }
                };
                let origin = origins[(i / targets.max(1) + i) % origins.len()];
                Ray::new(origin, target - origin)
            };
            let loose = |i: usize| Ray::new(origins[i % origins.len()], direction(i, 11));
            for (kind, counts) in [
                ("aimed", probe(&world, &mesh, convex, count, aimed)),
                ("random", probe(&world, &mesh, convex, count, loose)),
            ] {
                println!(
                    "{name:28} {place:7} {kind:7} {:9} rays {:4} misses {:4} wrong counts {:6} \
                        folded",
                    counts.rays, counts.misses, counts.wrong, counts.folded
                );
                assert_eq!(counts.misses, 0, "{name}, {place}, {kind}");
                // At these places, rounding of the coordinates has flipped some triangles.
                assert!(
                    place == "far" || counts.folded == 0,
                    "{name}, {place}, {kind}: {}",
                    counts.folded
                );
                assert_eq!(counts.wrong, 0, "{name}, {place}, {kind}");
                total = total.plus(counts);
            }
        }
    }
    println!("in all {} rays, {} misses, {} wrong counts", total.rays, total.misses, total.wrong);
}
