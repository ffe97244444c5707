//! The Utah teapot (M. Newell, 1975), from its Bezier patches.
//!
//! The classic data of rim, body, lid and bottom are quarter patches of surfaces of revolution, and
//! handle and spout are symmetric. Only the profiles are stored here; the 32 patches are computed.
//! In Newell's axes `z` points up and the spout along `+x`. The scene has `y` up.

use super::palette::{matte, plastic};
use super::quads::ground;
use crate::camera::{Camera, Projection};
use crate::framing::sky_seen_by;
use crate::graph::{Geometry, Node, Scene, Surface};
use snell_intersect::TriangleMesh;
use snell_math::{DAffine3, DVec3, Rgb, Vec2, real, rotation};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};
use std::sync::Arc;

/// Profiles of the surfaces of revolution, as control points `(radius, height)`.
const PROFILES: [[[f64; 2]; 4]; 6] = [
    // Rim.
    [[1.4, 2.4], [1.3375, 2.53125], [1.4375, 2.53125], [1.5, 2.4]],
    // Body, upper and lower half.
    [[1.5, 2.4], [1.75, 1.875], [2.0, 1.35], [2.0, 0.9]],
    [[2.0, 0.9], [2.0, 0.45], [1.5, 0.225], [1.5, 0.15]],
    // Knob and lid.
    [[0.0, 3.15], [0.8, 3.15], [0.0, 2.85], [0.2, 2.7]],
    [[0.2, 2.7], [0.4, 2.55], [1.3, 2.55], [1.3, 2.4]],
    // Bottom.
    [[1.5, 0.15], [1.5, 0.075], [1.425, 0.0], [0.0, 0.0]],
];

/// The distance of the inner control points of Newell's quarter circles, as a fraction of the
/// radius.
const QUARTER: f64 = 0.56;

/// The seven rows of control points of the handle or the spout. A row has `x` and `z` at both ends
/// of half a cross-section, and half of the section's width.
type Tube = [[f64; 5]; 7];

const HANDLE: Tube = [
    [-1.6, 2.025, -1.5, 2.25, 0.3],
    [-2.3, 2.025, -2.5, 2.25, 0.3],
    [-2.7, 2.025, -3.0, 2.25, 0.3],
    [-2.7, 1.8, -3.0, 1.8, 0.3],
    [-2.7, 1.575, -3.0, 1.35, 0.3],
    [-2.5, 1.125, -2.65, 0.9375, 0.3],
    [-2.0, 0.9, -1.9, 0.6, 0.3],
];

const SPOUT: Tube = [
    [1.7, 1.425, 1.7, 0.6, 0.66],
    [2.6, 1.425, 3.1, 0.825, 0.66],
    [2.3, 2.1, 2.4, 2.025, 0.25],
    [2.7, 2.4, 3.3, 2.4, 0.25],
    [2.8, 2.475, 3.525, 2.49375, 0.25],
    [2.9, 2.475, 3.45, 2.5125, 0.15],
    [2.8, 2.4, 3.2, 2.4, 0.15],
];

/// The sixteen control points of a patch, row by row.
type Patch = [[DVec3; 4]; 4];

/// All patches, oriented so that the derivative along a row, crossed with the derivative from row
/// to row, points outwards.
fn patches() -> Vec<Patch> {
    let mut patches = Vec::with_capacity(32);
    for profile in PROFILES {
        for quarter in 0..4 {
            let (s, c) = real::sin_cos(f64::from(quarter) * FRAC_PI_2);
            let ring = |[r, z]: [f64; 2]| {
                [(r, 0.0), (r, QUARTER * r), (QUARTER * r, r), (0.0, r)]
                    .map(|(x, y)| DVec3::new(c * x - s * y, s * x + c * y, z))
            };
            // From the top down the profiles run against the axis, so the patch is flipped.
            patches.push(profile.map(|row| flipped(ring(row))));
        }
    }
    for tube in [HANDLE, SPOUT] {
        for (first, side) in [(0, -1.0), (0, 1.0), (3, -1.0), (3, 1.0)] {
            let row = |i: usize| {
                let [x0, z0, x1, z1, width] = tube[first + i];
                let y = width * side;
                let row = [
                    DVec3::new(x0, 0.0, z0),
                    DVec3::new(x0, y, z0),
                    DVec3::new(x1, y, z1),
                    DVec3::new(x1, 0.0, z1),
                ];
                if side < 0.0 { row } else { flipped(row) }
            };
            patches.push([row(0), row(1), row(2), row(3)]);
        }
    }
    patches
}

fn flipped(mut row: [DVec3; 4]) -> [DVec3; 4] {
    row.reverse();
    row
}

/// The cubic Bernstein polynomials at `t`, and their derivatives.
fn bernstein(t: f64) -> ([f64; 4], [f64; 4]) {
    let s = 1.0 - t;
    (
        [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t],
        [-3.0 * s * s, 3.0 * s * (s - 2.0 * t), 3.0 * t * (2.0 * s - t), 3.0 * t * t],
    )
}

/// The point of a patch, and the derivatives along and across the rows.
fn evaluate(patch: &Patch, u: f64, v: f64) -> (DVec3, DVec3, DVec3) {
    let ((bu, du), (bv, dv)) = (bernstein(u), bernstein(v));
    let sum = |a: &[f64; 4], b: &[f64; 4]| {
        (0..16).map(|k| patch[k / 4][k % 4] * (a[k % 4] * b[k / 4])).fold(DVec3::ZERO, |s, p| s + p)
    };
    (sum(&bu, &bv), sum(&du, &bv), sum(&bu, &dv))
}

/// The unit normal. At the poles, where a row shrinks to a point, it is the normal of nearby
/// points.
fn normal(patch: &Patch, u: f64, v: f64) -> DVec3 {
    let at = |v: f64| {
        let (_, du, dv) = evaluate(patch, u, v);
        let n = du.cross(dv);
        (n.length() > 1e-9).then(|| n.normalize())
    };
    let inward = if v < 0.5 { 1e-3 } else { -1e-3 };
    at(v).or_else(|| at(v + inward)).unwrap_or(DVec3::Z)
}

/// The teapot with `n` times `n` cells per patch, in Newell's axes. Texture coordinates cover each
/// patch once.
fn teapot(n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for patch in patches() {
        let first = mesh.positions.len() as u32;
        for j in 0..=n {
            for i in 0..=n {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                mesh.positions.push(evaluate(&patch, u, v).0.as_vec3());
                mesh.normals.push(normal(&patch, u, v).as_vec3());
                mesh.uvs[0].push(Vec2::new(u as f32, v as f32));
            }
        }
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            let a = first + j * (n + 1) + i;
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            mesh.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    // Triangles at the poles are degenerate.
    let positions = &mesh.positions;
    mesh.indices.retain(|t| {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        (b - a).cross(c - a).length_squared() > 0.0
    });
    mesh
}

/// The built-in scene of the teapot on a ground.
pub fn scene() -> Scene {
    let mut scene = Scene::new("teapot");
    let floor = scene.add_material(matte("ground", Rgb::splat(0.5)));
    let glaze = scene.add_material(plastic("glaze", Rgb::new(0.16, 0.33, 0.42), 0.12));
    scene.add_child(
        scene.root,
        Node { surfaces: vec![ground(0.0, 60.0, floor)], ..Node::named("ground") },
    );
    let transform = DAffine3::from_mat3(
        rotation::about(DVec3::Y, FRAC_PI_3 / 2.0) * rotation::about(DVec3::X, -FRAC_PI_2),
    );
    let surfaces = vec![Surface::with_material(Geometry::Mesh(Arc::new(teapot(24))), glaze)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::named("teapot") });
    let camera = Camera::from_target(
        DVec3::new(0.0, 4.2, 10.5),
        DVec3::new(0.1, 1.35, 0.0),
        DVec3::Y,
        Projection::from_half_angle_x(0.36),
    );
    scene.environment = Some(sky_seen_by(&camera, DVec3::Y));
    scene.cameras.push(Camera { name: "main".into(), ..camera });
    scene.settings.size = Some([800, 600]);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec3;

    #[test]
    fn there_are_32_patches_and_the_pot_has_its_known_extent() {
        assert_eq!(patches().len(), 32);
        let bounds = teapot(16).bounds();
        // The control points of handle and spout extend beyond the surface.
        assert!((bounds.min.z, bounds.max.z) == (0.0, 3.15));
        assert!(
            (bounds.min.y + 2.0).abs() < 2e-3 && (bounds.max.y - 2.0).abs() < 2e-3,
            "{bounds:?}"
        );
        assert!(
            (-3.0..-2.9).contains(&bounds.min.x) && (3.2..3.5).contains(&bounds.max.x),
            "{bounds:?}"
        );
    }

    #[test]
    fn neighbouring_patches_meet() {
        let patches = patches();
        // Neighbouring patches must fit around each surface of revolution, and between the upper
        // and the lower half of body, handle and spout.
        for profile in 0..6 {
            for quarter in 0..4 {
                let (a, b) =
                    (patches[profile * 4 + quarter], patches[profile * 4 + (quarter + 1) % 4]);
                for row in 0..4 {
                    assert!((a[row][0] - b[row][3]).length() < 1e-12);
                }
            }
        }
        for (upper, lower) in [(4, 8), (24, 26), (25, 27), (28, 30), (29, 31)] {
            assert_eq!(patches[upper][3], patches[lower][0]);
        }
    }

    #[test]
    fn normals_point_outwards_and_agree_with_the_triangles() {
        let mesh = teapot(8);
        for (t, indices) in mesh.indices.iter().enumerate() {
            let [a, b, c] = mesh.corners(t);
            let face = (b - a).cross(c - a).normalize();
            for &i in indices {
                assert!(face.dot(mesh.normals[i as usize]) > 0.0, "triangle {t}");
            }
        }
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            // Normals point away from the axis on the body, down on the bottom, and up on top of
            // the knob.
            if p.z > 0.3 && p.z < 2.3 && p.truncate().length() > 1.99 && p.x.abs() < 1.0 {
                assert!(n.dot(Vec3::new(p.x, p.y, 0.0)) > 0.0, "{p} {n}");
            }
            if p.truncate().length() < 1e-6 && p.z < 1.0 {
                assert!(n.z < -0.99, "{p} {n}");
            }
            if p.z > 3.149 {
                assert!(n.z > 0.9, "{p} {n}");
            }
        }
        // The far side of the handle faces away from the pot, and the underside of the spout faces
        // forward and down.
        let at = |p: Vec3| {
            let near = |q: &&usize| mesh.positions[**q].distance_squared(p);
            let all: Vec<usize> = (0..mesh.positions.len()).collect();
            let i = *all.iter().min_by(|a, b| near(a).total_cmp(&near(b))).expect("vertices");
            mesh.normals[i]
        };
        assert!(at(Vec3::new(-3.0, 0.0, 1.8)).x < -0.9);
        assert!(at(Vec3::new(2.8, 0.0, 1.0)).z < 0.0);
    }
}
