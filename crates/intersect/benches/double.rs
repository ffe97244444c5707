//! Compares worlds in double precision with worlds in single precision on the same rays:
//! `cargo bench -p snell-intersect --bench double -- [bunny] [bunnies:15] [terrain:724] [room]`.
//!
//! The measurements use one thread, and processor time where Linux provides it; they are medians of
//! alternating runs. Single precision traces the scene where it is; double precision traces it
//! there, and once more with everything moved to a city in UTM coordinates.

mod clock;
mod scenes;

use scenes::{diffuse_rays, primary_rays};
use snell_intersect::{
    AcceptAll, BuildOptions, DHit, DTriangleMesh, DWorld, DWorldBuilder, Grouping, Hit,
    TriangleMesh, World, WorldBuilder,
};
use snell_math::{DRay, DVec3, Ray, Vec3, rng};
use std::sync::Arc;

const CITY: DVec3 = DVec3::new(500_000.123, 4_649_776.22, 300.0);

fn single_world(mesh: &Arc<TriangleMesh>) -> World {
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
    builder.build(&BuildOptions::default()).expect("a mesh builds")
}

fn double_world(mesh: &TriangleMesh, offset: DVec3) -> DWorld {
    let mut mesh = DTriangleMesh::from(mesh);
    mesh.positions.iter_mut().for_each(|p| *p += offset);
    let mut builder = DWorldBuilder::default();
    builder.add_mesh(DWorldBuilder::ROOT, Arc::new(mesh));
    builder.build(&BuildOptions::default()).expect("a mesh builds")
}

/// The median time of each function; the functions run in turn.
fn medians<const N: usize>(mut runs: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut times = [const { Vec::new() }; N];
    for _ in 0..7 {
        for (run, times) in runs.iter_mut().zip(&mut times) {
            let before = clock::of_thread();
            run();
            times.push(clock::of_thread() - before);
        }
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    })
}

struct Worlds {
    single: World,
    double: DWorld,
    city: DWorld,
}

fn moved(rays: &[Ray], offset: DVec3) -> Vec<DRay> {
    rays.iter().map(DRay::from).map(|ray| DRay { origin: ray.origin + offset, ..ray }).collect()
}

fn closest(kind: &str, worlds: &Worlds, rays: &[Ray], grouping: Grouping) {
    let (double, city) = (moved(rays, DVec3::ZERO), moved(rays, CITY));
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut double_hits = vec![DHit::MISS; rays.len()];
    let mut city_hits = vec![DHit::MISS; rays.len()];
    let times = medians([
        &mut || worlds.single.closest(rays, grouping, &AcceptAll, &mut hits),
        &mut || worlds.double.closest(&double, grouping, &AcceptAll, &mut double_hits),
        &mut || worlds.city.closest(&city, grouping, &AcceptAll, &mut city_hits),
    ]);
    let same =
        |other: &[DHit]| hits.iter().zip(other).filter(|(a, b)| a.primitive == b.primitive).count();
    report(kind, rays.len(), times, [same(&double_hits), same(&city_hits)]);
}

fn occluded(kind: &str, worlds: &Worlds, rays: &[Ray], grouping: Grouping) {
    let (double, city) = (moved(rays, DVec3::ZERO), moved(rays, CITY));
    let mut blocked = [const { Vec::new() }; 3].map(|_: Vec<bool>| vec![false; rays.len()]);
    let [a, b, c] = &mut blocked;
    let times = medians([
        &mut || worlds.single.occluded(rays, grouping, &AcceptAll, a),
        &mut || worlds.double.occluded(&double, grouping, &AcceptAll, b),
        &mut || worlds.city.occluded(&city, grouping, &AcceptAll, c),
    ]);
    let same = |other: &[bool]| blocked[0].iter().zip(other).filter(|(a, b)| a == b).count();
    report(kind, rays.len(), times, [same(&blocked[1]), same(&blocked[2])]);
}

fn report(kind: &str, n: usize, times: [f64; 3], same: [usize; 2]) {
    let [single, double, city] = times.map(|t| n as f64 / t * 1e-6);
    println!(
        "  {kind:9} f32 {single:6.2} Mrays/s, f64 {double:6.2} ({:.2}), f64 in a city {city:6.2} \
            ({:.2}); of {n} answers {} and {} differ",
        double / single,
        city / single,
        n - same[0],
        n - same[1]
    );
}

fn main() {
    let names: Vec<String> = std::env::args().skip(1).filter(|name| name != "--bench").collect();
    let names = if names.is_empty() { vec!["bunny".into(), "terrain:724".into()] } else { names };
    for name in &names {
        let Some(mesh) = scenes::by_name(name) else {
            eprintln!("{name} is no scene");
            continue;
        };
        let mesh = Arc::new(mesh);
        let worlds = Worlds {
            single: single_world(&mesh),
            double: double_world(&mesh, DVec3::ZERO),
            city: double_world(&mesh, CITY),
        };
        println!("{name}: {} triangles", mesh.indices.len());
        let primary = primary_rays(&worlds.single);
        closest("primary", &worlds, &primary, Grouping::None);
        closest("together", &worlds, &primary, Grouping::Coherent);
        let mut diffuse = diffuse_rays(&worlds.single, &primary);
        closest("diffuse", &worlds, &diffuse, Grouping::None);
        let light = worlds.single.bounds().max.as_vec3() + worlds.single.bounds().radius() as f32;
        let shadow: Vec<Ray> = diffuse.iter().map(|r| shadow_ray(r.origin, light)).collect();
        occluded("shadow", &worlds, &shadow, Grouping::None);
        occluded("together", &worlds, &shadow, Grouping::Coherent);
        for i in (1..diffuse.len()).rev() {
            diffuse.swap(i, rng::hash32(i as u32) as usize % (i + 1));
        }
        closest("shuffled", &worlds, &diffuse, Grouping::None);
    }
}

fn shadow_ray(origin: Vec3, light: Vec3) -> Ray {
    Ray::new(origin, light - origin).with_t_max(1.0)
}
