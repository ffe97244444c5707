mod distances;
mod motions;
mod touching;

use super::{ClosestPair, PairMesh, PairQuery, PairScene, Pose, closest_pair, collides};
use snell_math::glam::DQuat;
use snell_math::rng::{hash32, to_unit};
use snell_math::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

type Triangle = [DVec3; 3];

/// Numbers that look random.
struct Rng(u32);

fn uniform(rng: &mut Rng) -> f64 {
    rng.0 += 1;
    f64::from(to_unit(hash32(rng.0)))
}

fn vector(rng: &mut Rng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| uniform(rng) - 0.5))
}

/// Triangles of different sizes, some of them degenerate.
fn soup(rng: &mut Rng, count: usize, size: f64) -> Vec<Triangle> {
    let mut triangle = |i: usize| {
        let center = vector(rng) * 2.0;
        let size = size * if i.is_multiple_of(5) { 3.0 } else { 1.0 };
        let [a, b, c] = [0; 3].map(|_| center + vector(rng) * size);
        match i % 17 {
            5 => [a, b, b],
            9 => [a, a, a],
            11 => [a, b, a.lerp(b, 0.5)],
            _ => [a, b, c],
        }
    };
    (0..count).map(&mut triangle).collect()
}

fn scene(triangles: &[Triangle]) -> PairScene {
    let mesh = Arc::new(PairMesh::new(triangles).expect("numbers in range"));
    PairScene::new(vec![(mesh, DAffine3::IDENTITY)]).expect("numbers in range")
}

fn rotation(rng: &mut Rng) -> DMat3 {
    DMat3::from_quat(DQuat::from_axis_angle(vector(rng).normalize(), 6.0 * uniform(rng)))
}

fn pose(rng: &mut Rng, away: f64) -> DAffine3 {
    DAffine3 { matrix3: rotation(rng), translation: vector(rng).normalize() * away }
}

fn nearest(a: (&PairScene, &Pose), b: (&PairScene, &Pose)) -> Option<ClosestPair> {
    closest_pair(a, b, &PairQuery::default()).expect("not stopped")
}

fn meet(a: (&PairScene, &Pose), b: (&PairScene, &Pose)) -> bool {
    collides(a, b, &PairQuery::default()).expect("not stopped")
}

/// The distance of two triangles by other means: it is convex in the parameters of a point of the
/// first, so nested golden sections find its least value. (To about 1e-8.)
fn distance(p: &Triangle, q: &Triangle) -> f64 {
    let metric = crate::Metric::new(DMat3::IDENTITY);
    let at = |u: f64, v: f64| {
        let point = p[0] + (p[1] - p[0]) * u + (p[2] - p[0]) * ((1.0 - u) * v);
        (crate::shape::nearest::on_triangle(&metric, point, q).0 - point).length()
    };
    golden(|u| golden(|v| at(u, v)))
}

fn golden(f: impl Fn(f64) -> f64) -> f64 {
    let share = (5f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (0.0, 1.0);
    let mut inner = [high - share * (high - low), low + share * (high - low)];
    let mut values = inner.map(&f);
    for _ in 0..60 {
        if values[0] <= values[1] {
            high = inner[1];
            (inner[1], values[1]) = (inner[0], values[0]);
            inner[0] = high - share * (high - low);
            values[0] = f(inner[0]);
        } else {
            low = inner[0];
            (inner[0], values[0]) = (inner[1], values[1]);
            inner[1] = low + share * (high - low);
            values[1] = f(inner[1]);
        }
    }
    values[0].min(values[1]).min(f(0.0)).min(f(1.0))
}

/// A sphere of triangles, `2 * n` strips around and `n` from pole to pole.
fn ball(n: usize) -> Vec<Triangle> {
    let at = |i: usize, j: usize| {
        let (around, down) = (i % (2 * n), j as f64 * std::f64::consts::PI / n as f64);
        let around = around as f64 * std::f64::consts::PI / n as f64;
        let height = if j == 0 || j == n { 0.0 } else { down.sin() };
        DVec3::new(height * around.cos(), height * around.sin(), down.cos())
    };
    let quads = (0..2 * n).flat_map(|i| (0..n).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            [[a, b, c], [a, c, d]]
        })
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect()
}

/// The twelve triangles of a box.
fn cuboid(min: DVec3, max: DVec3) -> Vec<Triangle> {
    let corner = |i: usize| {
        let pick = |k: usize| if i >> k & 1 == 1 { max[k] } else { min[k] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    faces
        .into_iter()
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|t| t.map(corner))
        .collect()
}
