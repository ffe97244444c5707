//! Whether spatial splits are worthwhile: an estimate from the boxes of single triangles.

use super::binning::{Box8, Primitive};
use super::primitive::{CHUNK, Numbered, OBJECT, Triangles};
use rayon::prelude::*;

/// Boxes of less than this share of the total area are ignored.
const LEAST_AREA: f32 = 1e-5;

/// A box of up to this many times the area of its triangle is not wasteful; the box of a slanted
/// triangle typically has about three times the area.
const TYPICAL: f32 = 5.0;

/// Spatial splits are worthwhile if a random line through the set enters on average more than this
/// many boxes of large triangles without a hit. (Tracing a ray through a tree over scans or terrain
/// takes about 10 to 40 steps; scans have a waste of about 0.1, the room of the examples of some
/// hundreds.)
const LARGE: f64 = 4.0;

/// True if large triangles fill so little of their boxes that splitting them makes up for the
/// longer build.
pub(super) fn is_large(primitives: &[Primitive], triangles: &Triangles) -> bool {
    waste(primitives, triangles) > LARGE
}

/// The expected number of boxes of large triangles that a random line through the set enters
/// without a hit.
fn waste(primitives: &[Primitive], triangles: &Triangles) -> f64 {
    let bounds =
        |primitives: &[Primitive]| primitives.iter().fold(Box8::EMPTY, |b, p| b.union(p.bounds()));
    let all = primitives
        .par_chunks(CHUNK)
        .map(bounds)
        .reduce(|| Box8::EMPTY, |a, b| a.union(&b))
        .half_area();
    let of = |p: &Primitive| {
        let area = p.bounds().half_area();
        if p.id() & OBJECT != 0 || area < LEAST_AREA * all {
            return 0.0;
        }
        let [a, b, c] = triangles.corners(p.id());
        f64::from((area - TYPICAL * 0.5 * (b - a).cross(c - a).length()).max(0.0) / all)
    };
    // The pieces have the same size for any number of threads and are added in order, so that the
    // sum is the same.
    let sums: Vec<f64> = primitives.par_chunks(CHUNK).map(|c| c.iter().map(of).sum()).collect();
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::primitive::triangle_primitives;
    use crate::group::GroupList;
    use crate::mesh::TriangleMesh;
    use snell_math::Vec3;
    use std::sync::Arc;

    fn waste_of(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> f64 {
        let mut mesh = TriangleMesh::default();
        for corners in triangles {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.indices.push([first, first + 1, first + 2]);
        }
        let list = GroupList { meshes: vec![(0, Arc::new(mesh))], ..GroupList::default() };
        let triangles = Triangles::new(&list, &[(0, 0)]);
        let (primitives, count) = triangle_primitives(&triangles, 0);
        waste(&primitives[..count], &triangles)
    }

    #[test]
    fn diagonal_slivers_waste_and_compact_triangles_do_not() {
        let beam = |i: i32| {
            let at = Vec3::new(i as f32 * 0.1, 0.0, 0.0);
            [at, at + Vec3::new(5.0, 5.0, 5.0), at + Vec3::new(5.0, 5.0, 5.01)]
        };
        assert!(waste_of((0..20).map(beam)) > 2.0 * LARGE);
        let sheet = |i: i32| {
            let at = Vec3::new((i % 30) as f32, (i / 30) as f32, (i % 3) as f32);
            [at, at + Vec3::X, at + Vec3::Y + Vec3::Z]
        };
        assert!(waste_of((0..900).map(sheet)) < 0.1 * LARGE);
    }
}
