//! Whether triangles meet, against separating axes in whole numbers.

use super::super::meeting::common_point;
use super::{Triangle, cuboid, meet, scene};
use crate::query::pair::Pose;
use proptest::prelude::*;
use snell_math::{DAffine3, DVec3};

type Whole = [i128; 3];

fn minus(a: Whole, b: Whole) -> Whole {
    std::array::from_fn(|i| a[i] - b[i])
}

fn cross(a: Whole, b: Whole) -> Whole {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

/// True if no axis separates the hulls of some points: among the normals and the differences of
/// corners, their products, and products of these. (More than needed, so that it also is right for
/// triangles that are degenerate.)
fn overlap(p: &[Whole; 3], q: &[Whole; 3]) -> bool {
    let all: Vec<Whole> = p.iter().chain(q).copied().collect();
    let mut edges = Vec::new();
    for i in 0..6 {
        edges.extend((0..i).map(|j| minus(all[i], all[j])).filter(|e| *e != [0; 3]));
    }
    let mut axes = edges.clone();
    for i in 0..edges.len() {
        for j in 0..i {
            let normal = cross(edges[i], edges[j]);
            if normal != [0; 3] {
                axes.push(normal);
                axes.extend(edges.iter().map(|&e| cross(normal, e)));
            }
        }
    }
    !axes.into_iter().any(|axis| {
        let along = |p: &Whole| (0..3).map(|i| p[i] * axis[i]).sum::<i128>();
        let range = |t: &[Whole; 3]| {
            let all = t.map(|p| along(&p));
            (all[0].min(all[1]).min(all[2]), all[0].max(all[1]).max(all[2]))
        };
        let (p, q) = (range(p), range(q));
        p.1 < q.0 || q.1 < p.0
    })
}

fn small() -> impl Strategy<Value = [Whole; 3]> {
    prop::array::uniform3(prop::array::uniform3(-2i128..=2))
}

/// The triangle in plain numbers.
fn placed(t: &[Whole; 3]) -> Triangle {
    t.map(|p| DVec3::from_array(p.map(|x| x as f64)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn triangles_meet_if_no_axis_separates_them(p in small(), q in small()) {
        let found = common_point(&placed(&p), &placed(&q), DVec3::ZERO).is_some();
        prop_assert_eq!(found, overlap(&p, &q));
        prop_assert_eq!(common_point(&placed(&q), &placed(&p), DVec3::ZERO).is_some(), found);
    }

    /// The second triangle has a corner or a point of an edge on the plane of the first, and is
    /// then moved by one step of a lattice with 2^40 steps.
    #[test]
    fn one_step_decides(
        p in small(), q in small(), at in 0usize..3, step in prop::array::uniform3(-1i128..=1),
    ) {
        let large = |t: [Whole; 3]| t.map(|c| c.map(|x| x << 40));
        let (p, mut q) = (large(p), large(q));
        q[at] = std::array::from_fn(|i| (p[0][i] + p[1][i]) / 2 + step[i]);
        let found = common_point(&placed(&p), &placed(&q), DVec3::ZERO).is_some();
        // The oracle's products of five coordinates do not fit, so corners are compared only where
        // they can be: in the plane or beside it.
        let normal = cross(minus(p[1], p[0]), minus(p[2], p[0]));
        let above = |c: Whole| (0..3).map(|i| (c[i] - p[0][i]) * normal[i]).sum::<i128>().signum();
        let sides = q.map(above);
        if sides == [1; 3] || sides == [-1; 3] {
            prop_assert!(!found);
        }
        if step == [0; 3] {
            prop_assert!(found);
        }
    }
}

#[test]
fn boxes_touch_at_faces_edges_and_corners_and_not_a_rounding_step_away() {
    let unit = scene(&cuboid(DVec3::ZERO, DVec3::ONE));
    let away = |by: DVec3| Pose::new(DAffine3::from_translation(by)).expect("a translation");
    for touching in [DVec3::X, DVec3::new(1.0, 1.0, 0.5), DVec3::ONE, DVec3::new(-1.0, 0.3, 1.0)] {
        assert!(meet((&unit, &away(touching)), (&unit, &Pose::IDENTITY)), "{touching}");
        let farther = touching + DVec3::X * touching.x * f64::EPSILON;
        assert!(!meet((&unit, &away(farther)), (&unit, &Pose::IDENTITY)), "{farther}");
        let near = super::nearest((&unit, &away(farther)), (&unit, &Pose::IDENTITY));
        assert_eq!(near.expect("a pair").distance, f64::EPSILON, "{farther}");
    }
}
