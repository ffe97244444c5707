//! Meshes of Mitsuba's simple shapes, with its texture coordinates.

use crate::scene::shapes::{AROUND, swept};
use snell_intersect::TriangleMesh;
use snell_math::{DVec3, Vec2, real};

/// The unit disk, with the distance from its middle as u and the longitude as v.
pub fn disk() -> TriangleMesh {
    let mut mesh = swept(360.0, [AROUND, 1], |phi, v| {
        let r = 1.0 - v;
        (DVec3::new(r * real::cos(phi), r * real::sin(phi), 0.0), DVec3::Z)
    });
    mesh.uvs[0].iter_mut().for_each(|uv| *uv = Vec2::new(1.0 - uv.y, uv.x));
    mesh
}

/// The square from -1 to 1 in the plane of x and y.
pub fn rectangle() -> TriangleMesh {
    face(&mut TriangleMesh::default(), DVec3::ZERO, DVec3::X, DVec3::Y)
}

/// The cube from -1 to 1, with Mitsuba's directions of u and v on its faces.
pub fn cube() -> TriangleMesh {
    let faces = [
        (DVec3::NEG_Y, DVec3::Z, DVec3::X),
        (DVec3::Y, DVec3::NEG_X, DVec3::NEG_Z),
        (DVec3::X, DVec3::Y, DVec3::NEG_Z),
        (DVec3::Z, DVec3::Y, DVec3::X),
        (DVec3::NEG_X, DVec3::Y, DVec3::Z),
        (DVec3::NEG_Z, DVec3::NEG_Y, DVec3::X),
    ];
    let mut mesh = TriangleMesh::default();
    for (middle, u, v) in faces {
        mesh = face(&mut mesh, middle, u, v);
    }
    mesh
}

/// Adds a square whose coordinates grow along `u` and `v`. It faces away from the origin, or along
/// `u x v` if its middle is the origin.
fn face(mesh: &mut TriangleMesh, middle: DVec3, u: DVec3, v: DVec3) -> TriangleMesh {
    let first = mesh.positions.len() as u32;
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        mesh.positions.push((middle + u * (2.0 * x - 1.0) + v * (2.0 * y - 1.0)).as_vec3());
        mesh.uvs[0].push(Vec2::new(x as f32, y as f32));
    }
    let faces_out = u.cross(v).dot(middle) >= 0.0;
    for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
        let [b, c] = if faces_out { [b, c] } else { [c, b] };
        mesh.indices.push([a, b, c].map(|i| first + i));
    }
    std::mem::take(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_of_the_cube_look_outwards() {
        let mesh = cube();
        assert_eq!((mesh.positions.len(), mesh.indices.len()), (24, 12));
        for t in 0..12 {
            let [a, b, c] = mesh.corners(t);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "{t}");
        }
        let [a, b, c] = rectangle().corners(0);
        assert!((b - a).cross(c - a).z > 0.0);
    }
}
