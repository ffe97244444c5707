//! Tests of rays inside closed meshes.

use super::*;

/// Aims rays at every vertex and edge midpoint and at random points of a sphere mesh. Returns the
/// number of rays, of misses, and of rays that do not have exactly one hit.
fn leaks(center: Vec3, radius: f32) -> (usize, usize, usize) {
    let mesh = sphere_mesh(center, radius, 40, 80);
    let mut targets = mesh.positions.clone();
    for t in 0..mesh.indices.len() {
        let [a, b, c] = mesh.corners(t);
        targets.extend([(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5]);
    }
    let mut random = Random(5);
    targets.extend((0..5000).map(|_| center + random.direction() * radius));
    let world = mesh_world(mesh);
    let (mut rays, mut misses, mut wrong) = (0, 0, 0);
    for from in [Vec3::ZERO, Vec3::new(0.3, -0.2, 0.1), Vec3::new(0.0, 0.5, 0.0)] {
        let origin = center + from * radius;
        for &target in &targets {
            let ray = Ray::new(origin, target - origin);
            let count = world.all_one(&ray, &AcceptAll).len();
            rays += 1;
            misses += usize::from(count == 0);
            wrong += usize::from(count != 1);
        }
    }
    (rays, misses, wrong)
}

#[test]
fn rays_inside_a_closed_mesh_hit_it_exactly_once() {
    for (center, radius) in [
        (Vec3::ZERO, 2.0),
        (Vec3::ZERO, 2e-6),
        (Vec3::ZERO, 2e9),
        (Vec3::new(5.0, -3.0, 2.0), 2.0),
        (Vec3::ZERO, 1e-25),
        (Vec3::ZERO, 1e18),
    ] {
        let (rays, misses, wrong) = leaks(center, radius);
        assert!(rays > 50_000);
        assert_eq!((misses, wrong), (0, 0), "of {rays} rays, center {center}, radius {radius}");
    }
}

#[test]
fn rays_inside_a_closed_mesh_far_away_never_escape() {
    // The coordinates are so coarse there that the mesh folds over: for a few rays more than one
    // crossing is correct.
    let (rays, misses, wrong) = leaks(Vec3::new(148376.0, 1234.0, -223423.0), 2.0);
    assert_eq!(misses, 0);
    assert!(wrong < rays / 200, "{wrong} of {rays}");
}
