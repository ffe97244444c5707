//! Measures builds, memory and ray rates of spheres, curves and moving meshes:
//! `cargo bench -p snell-intersect --bench sets [-- NAME]`.
//!
//! If NAME is given, only sets whose name contains it are measured. The measurements use one
//! thread, and processor time where Linux provides it. Rays start around the cloud and aim into it.
//! The best of five batches counts.

#![expect(clippy::disallowed_methods, reason = "times need no certain bits")]

mod clock;

use snell_intersect::{
    AcceptAll, BuildOptions, CubicCurves, CurveBasis, Curves, Grouping, Hit, LinearCurves, MeshKey,
    MovingMesh, PrimitiveSet, Rays, Spheres, StrandBasis, TriangleMesh, World, WorldBuilder,
};
use snell_math::{Ray, Vec3, Vec4, rng};
use std::sync::Arc;
use std::time::Instant;

fn random(i: u32, k: u32) -> f32 {
    rng::to_unit(rng::pcg4d([i, k, 3, 4])[0])
}

fn point(i: u32, k: u32) -> Vec3 {
    Vec3::new(random(i, k), random(i, k + 1), random(i, k + 2)) * 2.0 - 1.0
}

fn report(
    name: &str,
    primitives: usize,
    source_bytes: usize,
    fill: impl FnOnce(&mut WorldBuilder),
) {
    if std::env::args().nth(1).is_some_and(|wanted| wanted != "--bench" && !name.contains(&wanted))
    {
        return;
    }
    let start = Instant::now();
    let mut builder = WorldBuilder::default();
    fill(&mut builder);
    let world: World = builder.build(&BuildOptions::default()).expect("a world");
    let build = start.elapsed().as_secs_f64();
    let rays: Vec<_> = (0..200_000)
        .map(|i| {
            let from = point(i, 10).normalize_or(Vec3::X) * 3.0;
            Ray::new(from, point(i, 20) - from)
        })
        .collect();
    let times: Vec<_> = (0..200_000).map(|i| random(i, 30)).collect();
    let queries = Rays::new(&rays).with_times(&times);
    let mut hits = vec![Hit::MISS; rays.len()];
    let best = (0..9)
        .map(|_| {
            let start = clock::of_thread();
            world.closest(queries, Grouping::None, &AcceptAll, &mut hits);
            clock::of_thread() - start
        })
        .fold(f64::INFINITY, f64::min);
    let found = hits.iter().filter(|h| h.is_hit()).count();
    let costs = (0..2000).map(|i| world.closest_counted(queries.get(i), &AcceptAll).1);
    let (nodes, tests) =
        costs.fold((0, 0), |a, c| (a.0 + c.nodes_visited, a.1 + c.primitives_tested));
    println!(
        "{name}: {primitives} primitives, built in {build:.2} s, {:.1} + {:.1} bytes each, {:.2} \
            Mrays/s, {:.0} % hit, {:.1} nodes and {:.1} tests a ray",
        world.memory_bytes() as f64 / primitives as f64,
        source_bytes as f64 / primitives as f64,
        rays.len() as f64 * 1e-6 / best,
        100.0 * found as f64 / rays.len() as f64,
        f64::from(nodes) / 2000.0,
        f64::from(tests) / 2000.0,
    );
}

fn report_set(name: &str, set: impl PrimitiveSet + 'static, source_bytes: usize) {
    let count = set.len();
    report(name, count, source_bytes, |b| {
        b.add_set(WorldBuilder::ROOT, Arc::new(set));
    });
}

/// A random walk of `n` points from a random place, as a strand.
fn strand(i: u32, n: u32, step: f32, radius: f32) -> impl Iterator<Item = Vec4> {
    let start = point(i, 50);
    let drift = point(i, 53) * step;
    (0..n).map(move |k| {
        let p = start + drift * k as f32 + point(i * 64 + k, 60) * (0.5 * step);
        p.extend(radius * (1.0 - 0.7 * k as f32 / n as f32))
    })
}

fn main() {
    let radius = |n: u32| 0.7 / (n as f32).cbrt();
    for n in [10_000, 1_000_000, 4_000_000] {
        let spheres: Vec<_> =
            (0..n).map(|i| point(i, 0).extend(radius(n) * (0.3 + 0.4 * random(i, 3)))).collect();
        let bytes = size_of_val(spheres.as_slice());
        report_set("spheres", Spheres { spheres, ..Spheres::default() }, bytes);
    }
    let strands = 20_000;
    let points: Vec<_> = (0..strands).flat_map(|i| strand(i, 16, 0.02, 0.001)).collect();
    let segments: Vec<u32> = (0..strands).flat_map(|i| (0..15).map(move |k| 16 * i + k)).collect();
    let bytes = size_of_val(points.as_slice()) + size_of_val(segments.as_slice());
    report_set(
        "linear curves",
        LinearCurves { points: points.clone(), segments, exact: Vec::new() },
        bytes,
    );
    let segments: Vec<u32> = (0..strands).flat_map(|i| (0..13).map(move |k| 16 * i + k)).collect();
    let curves = CubicCurves {
        basis: CurveBasis::BSpline,
        points: points.clone(),
        tangents: Vec::new(),
        segments,
        exact: Vec::new(),
    };
    report_set("b-splines", curves, bytes);
    for (name, basis) in
        [("strands, linear", StrandBasis::Linear), ("strands, b-spline", StrandBasis::BSpline)]
    {
        let curves = Curves::new(basis, points.clone(), vec![16; strands as usize]);
        report_set(name, curves.expect("whole segments"), bytes);
    }

    let n = 300;
    let mut mesh = TriangleMesh::default();
    for i in 0..n * n {
        let (x, y) = ((i % n) as f32 / n as f32 * 2.0 - 1.0, (i / n) as f32 / n as f32 * 2.0 - 1.0);
        mesh.positions.push(Vec3::new(x, y, (x * 4.0).sin() * (y * 5.0).cos() * 0.3));
        if i % n + 1 < n && i / n + 1 < n {
            mesh.indices.extend([[i, i + 1, i + n], [i + 1, i + n + 1, i + n]]);
        }
    }
    let triangles = mesh.indices.len();
    let bytes = size_of_val(mesh.positions.as_slice()) + size_of_val(mesh.indices.as_slice());
    let moved = mesh.positions.iter().map(|p| *p + Vec3::Z * 0.01).collect();
    let moving =
        MovingMesh::new(mesh.clone(), vec![MeshKey { positions: moved, normals: Vec::new() }]);
    report("a mesh", triangles, bytes, |b| {
        b.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    });
    report("the same, moving", triangles, bytes, |b| {
        b.add_moving_mesh(WorldBuilder::ROOT, Arc::new(moving.expect("valid")));
    });
}
