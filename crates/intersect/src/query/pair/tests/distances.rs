//! Distances, against all pairs of triangles.

use super::super::triangles;
use super::*;

/// The least distance of all pairs.
fn of_all_pairs(a: &[Triangle], b: &[Triangle]) -> f64 {
    let distance = |p: &Triangle, q: &Triangle| {
        let near = triangles::nearest(p, q, f64::INFINITY, 1e-13).expect("finite");
        let [x, y] = near.points;
        assert!(((y - x).length() - near.distance).abs() < 1e-15);
        near.distance
    };
    a.iter()
        .flat_map(|p| b.iter().map(move |q| (p, q)))
        .fold(f64::INFINITY, |least, (p, q)| least.min(distance(p, q)))
}

#[test]
fn triangles_are_as_far_apart_as_their_nearest_points() {
    let mut rng = Rng(1 << 20);
    for i in 0..1500 {
        let size = [0.3, 1.5, 4.0][i % 3];
        let (p, q) = (soup(&mut rng, i % 18 + 1, size), soup(&mut rng, 1, size));
        let (p, q) = (p[p.len() - 1], q[0]);
        let near = triangles::nearest(&p, &q, f64::INFINITY, 1e-13).expect("finite");
        let expected = distance(&p, &q);
        assert!((near.distance - expected).abs() < 2e-7, "{i}: {near:?} {expected}");
        let metric = crate::Metric::new(DMat3::IDENTITY);
        for (point, on) in near.points.into_iter().zip([p, q]) {
            let foot = crate::shape::nearest::on_triangle(&metric, point, &on).0;
            assert!((foot - point).length() < 1e-12, "{i}: {near:?}");
        }
        assert_eq!(near.distance == 0.0, expected < 1e-9, "{i}");
        // A limit leaves out no pair within it.
        assert!(triangles::nearest(&p, &q, near.distance * (1.0 + 1e-12), 1e-13).is_some());
    }
}

#[test]
fn edges_that_are_almost_parallel_keep_their_digits() {
    for angle in [0.0, 1e-4, 1e-7, 1e-10] {
        // Two edges cross at a height of 1e-3, far from their ends.
        let a = [DVec3::new(-1.0, 0.0, 0.0), DVec3::new(1.3, 0.0, 0.0), DVec3::new(0.0, 0.5, -1.0)];
        let b = [
            DVec3::new(-1.2, -1.2 * angle, 1e-3),
            DVec3::new(0.9, 0.9 * angle, 1e-3),
            DVec3::new(0.0, 0.5, 1.0),
        ];
        let near = triangles::nearest(&a, &b, f64::INFINITY, 1e-13).expect("finite");
        assert!((near.distance - 1e-3).abs() < 1e-15, "{angle}: {}", near.distance);
    }
}

#[test]
fn scenes_are_as_far_apart_as_their_nearest_triangles() {
    let mut rng = Rng(2 << 20);
    let mut meeting = 0;
    for i in 0..120 {
        let (a, b) = (soup(&mut rng, 1 + i % 90, 0.2), soup(&mut rng, 1 + i % 70, 0.2));
        let (map_a, map_b) = (pose(&mut rng, 0.3), pose(&mut rng, (i % 7) as f64 * 0.5));
        let posed = [map_a, map_b].map(|map| Pose::new(map).expect("rigid"));
        let moved = |all: &[Triangle], map: DAffine3| -> Vec<Triangle> {
            all.iter().map(|t| t.map(|p| map.transform_point3(p))).collect()
        };
        let (in_world_a, in_world_b) = (moved(&a, map_a), moved(&b, map_b));
        let expected = of_all_pairs(&in_world_a, &in_world_b);
        let (a, b) = (scene(&a), scene(&b));
        let near = nearest((&a, &posed[0]), (&b, &posed[1])).expect("a pair");
        assert!((near.distance - expected).abs() < 1e-13, "{i}: {near:?} {expected}");
        assert_eq!(meet((&a, &posed[0]), (&b, &posed[1])), expected == 0.0, "{i}");
        meeting += usize::from(expected == 0.0);
        // The ids are those of the triangles that the points are on.
        let pair = [in_world_a[near.triangles[0] as usize], in_world_b[near.triangles[1] as usize]];
        let metric = crate::Metric::new(DMat3::IDENTITY);
        for (point, on) in near.points.into_iter().zip(pair) {
            let foot = crate::shape::nearest::on_triangle(&metric, point, &on).0;
            assert!((foot - point).length() < 1e-12, "{i}");
        }
        // The largest distance is inclusive, and nothing beyond it is found.
        for (limit, is_found) in [(near.distance, true), (near.distance * 0.999 - 1e-9, false)] {
            let query = PairQuery { max_distance: limit, ..PairQuery::default() };
            let found = closest_pair((&a, &posed[0]), (&b, &posed[1]), &query).expect("runs");
            assert_eq!(found.is_some(), is_found, "{i} {limit}");
        }
    }
    assert!((20..100).contains(&meeting), "{meeting} of 120 meet");
}

#[test]
fn far_from_zero_distances_keep_their_digits() {
    let far = DVec3::new(5e6, -4e6, 300.0);
    let step = f64::from(f32::EPSILON);
    let round = |p: DVec3| (p / step).round() * step;
    let near_zero: Vec<Triangle> = ball(12).into_iter().map(|t| t.map(round)).collect();
    let shifted =
        |by: DVec3| -> Vec<Triangle> { near_zero.iter().map(|t| t.map(|p| p + by)).collect() };
    let gap = DVec3::new(2.0, 0.5, 0.25);
    let here =
        nearest((&scene(&near_zero), &Pose::IDENTITY), (&scene(&shifted(gap)), &Pose::IDENTITY));
    let there = nearest(
        (&scene(&shifted(far)), &Pose::IDENTITY),
        (&scene(&shifted(far + gap)), &Pose::IDENTITY),
    );
    let (here, there) = (here.expect("a pair"), there.expect("a pair"));
    assert!((here.distance - there.distance).abs() < 1e-14, "{here:?} {there:?}");
    // By a pose that is far away, of a mesh that is not.
    let posed = |by: DVec3| Pose::new(DAffine3::from_translation(by)).expect("a translation");
    let ball = scene(&near_zero);
    let there = nearest((&ball, &posed(far)), (&ball, &posed(far + gap))).expect("a pair");
    assert!((here.distance - there.distance).abs() < 1e-14, "{here:?} {there:?}");
    assert!((there.points[0] - here.points[0] - far).length() < 2e-9);
}

#[test]
fn instances_are_as_their_triangles_are() {
    let mut rng = Rng(3 << 20);
    let mesh = soup(&mut rng, 40, 0.2);
    let shared = Arc::new(PairMesh::new(&mesh).expect("in range"));
    let mut parts = Vec::new();
    let mut flat: Vec<Triangle> = Vec::new();
    for i in 0..30 {
        let mut map = pose(&mut rng, 6.0);
        map.matrix3 *= match i % 4 {
            0 => DMat3::from_diagonal(DVec3::new(0.3, 1.0, 2.0)),
            1 => DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)),
            2 => DMat3::IDENTITY * 0.4,
            _ => DMat3::IDENTITY,
        };
        parts.push((shared.clone(), map));
        flat.extend(mesh.iter().map(|t| t.map(|p| map.transform_point3(p))));
    }
    let many = PairScene::new(parts).expect("in range");
    let flat = scene(&flat);
    for _ in 0..40 {
        let posed = Pose::new(pose(&mut rng, 5.0)).expect("rigid");
        let probe = scene(&soup(&mut rng, 20, 0.1));
        let (near, expected) = (
            nearest((&many, &Pose::IDENTITY), (&probe, &posed)).expect("a pair"),
            nearest((&flat, &Pose::IDENTITY), (&probe, &posed)).expect("a pair"),
        );
        assert!((near.distance - expected.distance).abs() < 1e-12, "{near:?} {expected:?}");
        if near.distance > 0.0 {
            assert_eq!(near.parts[0] * 40 + near.triangles[0], expected.triangles[0]);
        }
    }
}

#[test]
fn queries_stop_and_odd_input_is_an_error_or_finds_nothing() {
    let ball = scene(&ball(40));
    let away = Pose::new(DAffine3::from_translation(DVec3::X * 2.1)).expect("rigid");
    let query = PairQuery { max_steps: 1, ..PairQuery::default() };
    let inside = Pose::new(DAffine3::from_scale(DVec3::splat(0.99))).expect("a scale");
    assert!(closest_pair((&ball, &inside), (&ball, &Pose::IDENTITY), &query).is_err());
    let stopped = std::sync::atomic::AtomicBool::new(true);
    let query = PairQuery { cancel: Some(&stopped), ..PairQuery::default() };
    assert!(closest_pair((&ball, &inside), (&ball, &Pose::IDENTITY), &query).is_err());
    for max_distance in [-1.0, f64::NAN] {
        let query = PairQuery { max_distance, ..PairQuery::default() };
        assert_eq!(closest_pair((&ball, &away), (&ball, &Pose::IDENTITY), &query), Ok(None));
    }
    let nothing = PairScene::default();
    assert!(nearest((&nothing, &Pose::IDENTITY), (&ball, &away)).is_none());
    assert!(!meet((&ball, &away), (&nothing, &Pose::IDENTITY)));
    for bad in [f64::NAN, f64::INFINITY, 1e91] {
        assert!(PairMesh::new(&[[DVec3::ZERO, DVec3::X, DVec3::Y * bad]]).is_err());
        assert!(Pose::new(DAffine3::from_translation(DVec3::X * bad)).is_err());
    }
    assert!(Pose::new(DAffine3::from_scale(DVec3::new(1.0, 1.0, 1.001))).is_err());
    assert!(Pose::new(DAffine3::from_scale(DVec3::ZERO)).is_err());
}

#[test]
fn each_body_has_a_point() {
    let mut two = ball(6);
    two.extend(ball(5).into_iter().map(|t| t.map(|p| p * 0.5 + DVec3::X * 4.0)));
    let mut points = scene(&two).body_points();
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    assert_eq!(points.len(), 2);
    assert!((points[0].length() - 1.0).abs() < 1e-12);
    assert!(((points[1] - DVec3::X * 4.0).length() - 0.5).abs() < 1e-12);
}
