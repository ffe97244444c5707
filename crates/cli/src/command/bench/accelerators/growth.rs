//! The scene with fewer and more triangles, and the growth of the cost with their number.

use super::super::scenes::{Bench, merged, subdivided};
use super::measure::Measured;
use crate::failure::Failure;
use snell_intersect::AcceleratorKind;
use snell_intersect::{BuildOptions, TriangleMesh, WorldBuilder};
use snell_math::Vec3;
use snell_math::real;
use std::collections::HashMap;
use std::sync::Arc;

/// The smallest number of triangles that is measured.
const LEAST: usize = 1000;

/// The scene with about a quarter, a sixteenth and so on of its triangles, the scene itself, and
/// the scene with four times, sixteen times and so on its triangles, in ascending order up to
/// `most` triangles. Shapes and other geometry are left out.
pub fn sizes(bench: &Bench, most: u64) -> Result<Vec<(u64, Bench)>, Failure> {
    let mesh = merged(&bench.world);
    if mesh.indices.is_empty() {
        return Err(Failure::Scene(format!(
            "{}: there are no triangles to refine; name a scene with a mesh",
            bench.name
        )));
    }
    let mut meshes = Vec::new();
    let mut target = mesh.indices.len() / 4;
    while target >= LEAST {
        meshes.push(simplified(&mesh, target));
        target /= 4;
    }
    meshes.reverse();
    meshes.push(mesh);
    while let Some(last) = meshes.last().filter(|m| m.indices.len() as u64 * 4 <= most) {
        meshes.push(subdivided(last));
    }
    meshes.retain(|m| !m.indices.is_empty() && m.indices.len() as u64 <= most);
    meshes.into_iter().map(|mesh| sized(bench, mesh)).collect()
}

/// The scene with `mesh` as its only geometry, and the number of triangles.
fn sized(bench: &Bench, mesh: TriangleMesh) -> Result<(u64, Bench), Failure> {
    let triangles = mesh.indices.len() as u64;
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    let options = BuildOptions { accelerator: AcceleratorKind::None, ..BuildOptions::default() };
    let world =
        builder.build(&options).map_err(|e| Failure::Scene(format!("{}: {e}", bench.name)))?;
    Ok((
        triangles,
        Bench { name: bench.name.clone(), world, camera: bench.camera.clone(), light: bench.light },
    ))
}

/// Simplifies a mesh to about `target` triangles: all vertices in one cell of a grid become one
/// (Rossignac and Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993).
/// The size of the cells is found by trial.
fn simplified(mesh: &TriangleMesh, target: usize) -> TriangleMesh {
    let size = mesh.bounds().size().max_element();
    let (mut coarse, mut fine) = (1.0f32, 4096.0f32);
    for _ in 0..14 {
        let middle = (coarse * fine).sqrt();
        if clustered(mesh, size / middle).indices.len() < target {
            coarse = middle
        } else {
            fine = middle
        }
    }
    clustered(mesh, size / fine)
}

fn clustered(mesh: &TriangleMesh, cell: f32) -> TriangleMesh {
    let low = mesh.bounds().min;
    let mut clusters: HashMap<[i32; 3], u32> = HashMap::new();
    let mut sums: Vec<(Vec3, f32)> = Vec::new();
    let number: Vec<u32> = mesh
        .positions
        .iter()
        .map(|&p| {
            let key = ((p - low) / cell).floor().to_array().map(|x| x as i32);
            let id = *clusters.entry(key).or_insert_with(|| {
                sums.push((Vec3::ZERO, 0.0));
                sums.len() as u32 - 1
            });
            let sum = &mut sums[id as usize];
            *sum = (sum.0 + p, sum.1 + 1.0);
            id
        })
        .collect();
    let triangles = mesh.indices.iter().map(|t| t.map(|v| number[v as usize]));
    let mut indices: Vec<[u32; 3]> =
        triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    // Removes triangles that have become equal.
    let sorted = |t: &[u32; 3]| {
        let mut t = *t;
        t.sort_unstable();
        t
    };
    indices.sort_by_key(sorted);
    indices.dedup_by_key(|t| sorted(t));
    let positions = sums.into_iter().map(|(sum, n)| sum / n).collect();
    TriangleMesh { positions, indices, ..TriangleMesh::default() }
}

/// The measurements of a structure at several sizes.
pub struct Growth {
    pub kind: AcceleratorKind,
    pub points: Vec<Point>,
}

/// The measurements at one size.
pub struct Point {
    pub triangles: f64,
    /// Seconds per diffuse ray.
    pub seconds: f64,
    /// Nodes, cells and primitives per diffuse ray.
    pub work: f64,
    pub build_seconds: f64,
}

impl Growth {
    pub fn new(kind: AcceleratorKind) -> Self {
        Self { kind, points: Vec::new() }
    }

    /// Adds the measurements at one size, for diffuse rays (the second kind measured).
    pub fn add(&mut self, triangles: u64, measured: &Measured) {
        let rays = &measured.kinds[1];
        self.points.push(Point {
            triangles: triangles as f64,
            seconds: 1.0 / rays.rays_per_second,
            work: rays.nodes + rays.cells + rays.primitives,
            build_seconds: measured.build_seconds,
        });
    }

    /// The estimated seconds to build a structure for this many triangles.
    pub fn would_take(&self, triangles: u64) -> f64 {
        self.points
            .last()
            .map_or(0.0, |p| p.build_seconds * real::powf(triangles as f64 / p.triangles, 1.1))
    }

    /// The exponents of time, of work and of build time: slopes of the fitted lines through the
    /// logarithms.
    pub fn exponents(&self) -> (f64, f64, f64) {
        let fit = |y: fn(&Point) -> f64| {
            slope(self.points.iter().map(|p| (real::ln(p.triangles), real::ln(y(p).max(1e-12)))))
        };
        (fit(|p| p.seconds), fit(|p| p.work), fit(|p| p.build_seconds))
    }
}

/// The slope of the least-squares line; NaN for fewer than two points.
fn slope(points: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let n = points.clone().count() as f64;
    let (sx, sy) = points.clone().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
    let (mx, my) = (sx / n, sy / n);
    let (xy, xx) =
        points.fold((0.0, 0.0), |s, (x, y)| (s.0 + (x - mx) * (y - my), s.1 + (x - mx) * (x - mx)));
    xy / xx
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_power_is_its_exponent() {
        let points =
            [1e3, 1e4, 1e6].map(|n: f64| (real::ln(n), real::ln(3.0 * real::powf(n, 0.37))));
        assert!((slope(points.into_iter()) - 0.37).abs() < 1e-12);
        assert!(slope([(1.0, 1.0)].into_iter()).is_nan());
    }

    #[test]
    fn a_simplified_mesh_keeps_its_place_and_has_about_the_number_asked_for() {
        let mut mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
            indices: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            ..TriangleMesh::default()
        };
        for _ in 0..5 {
            mesh = subdivided(&mesh);
        }
        let small = simplified(&mesh, 500);
        assert!((300..900).contains(&small.indices.len()), "{}", small.indices.len());
        assert!(small.validate().is_ok());
        assert!((small.bounds().size() - mesh.bounds().size()).abs().max_element() < 0.2);
    }
}
