//! How cameras of the scene follow the shape of the picture.

use snell_scene::Camera;
use snell_scene::camera::Projection;

/// The camera with its angle of view widened in one direction, so that a picture of this size shows
/// all that a picture with the aspect ratio `frame` (width over height) shows. Projections without
/// an angle of view stay.
pub fn keeping_frame(camera: &Camera, frame: f64, size: [u32; 2]) -> Camera {
    let projection = match camera.projection {
        Projection::Perspective { tan_half_fov } => {
            Projection::Perspective { tan_half_fov: widened(tan_half_fov, frame, size) }
        }
        Projection::Orthographic { half_size } => {
            Projection::Orthographic { half_size: widened(half_size, frame, size) }
        }
        other => other,
    };
    Camera { projection, ..camera.clone() }
}

/// The extents with one side given: the one that the picture must not cut off.
fn widened(extents: [Option<f64>; 2], frame: f64, size: [u32; 2]) -> [Option<f64>; 2] {
    let [x, y] = match extents {
        [Some(x), Some(y)] => [x, y],
        [Some(x), None] => [x, x / frame],
        [None, Some(y)] => [y * frame, y],
        [None, None] => return extents,
    };
    let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
    if aspect * y < x { [Some(x), None] } else { [None, Some(y)] }
}

/// True if two projections are the same, but for the rounding of their numbers on the way through
/// a page.
pub fn is_same_projection(a: &Projection, b: &Projection) -> bool {
    let near = |a: [Option<f64>; 2], b: [Option<f64>; 2]| {
        a.iter().zip(b).all(|(a, b)| match (*a, b) {
            (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * a.abs(),
            (a, b) => a == b,
        })
    };
    match (*a, *b) {
        (
            Projection::Perspective { tan_half_fov: a },
            Projection::Perspective { tan_half_fov: b },
        )
        | (Projection::Orthographic { half_size: a }, Projection::Orthographic { half_size: b }) => {
            near(a, b)
        }
        (a, b) => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::{DVec3, Vec3};

    #[test]
    fn nothing_of_the_frame_is_cut_off_in_any_shape_of_the_page() {
        let across = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 0.5);
        let upright = Camera {
            projection: Projection::Perspective { tan_half_fov: [Some(0.3), None] },
            ..across.clone()
        };
        let both = Camera {
            projection: Projection::Orthographic { half_size: [Some(0.3), Some(0.4)] },
            ..across.clone()
        };
        for (camera, frame) in [(across, [640, 480]), (upright, [480, 640]), (both, [300, 400])] {
            let aspect = f64::from(frame[0]) / f64::from(frame[1]);
            // The corners of the frame, in the world.
            let [right, up] = [camera.right(), camera.up];
            let [x, y] = match camera.projection {
                Projection::Perspective { tan_half_fov: [x, y] }
                | Projection::Orthographic { half_size: [x, y] } => [
                    x.unwrap_or_else(|| y.unwrap() * aspect),
                    y.unwrap_or_else(|| x.unwrap() / aspect),
                ],
                _ => unreachable!(),
            };
            for size in [[390, 700], [1280, 600], [500, 500], [480, 640], [640, 480]] {
                let fitted = keeping_frame(&camera, aspect, size);
                let mut outermost: f64 = 0.0;
                for (a, b) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                    let corner = camera.eye + camera.towards + right * (a * x) + up * (b * y);
                    let at = fitted.project(corner, size).expect("in front");
                    let share = [at.x / f64::from(size[0]), at.y / f64::from(size[1])];
                    let beyond = share.map(|s| (s - 0.5).abs() * 2.0);
                    outermost = outermost.max(beyond[0]).max(beyond[1]);
                }
                assert!((outermost - 1.0).abs() < 1e-9, "{size:?}: {outermost}");
                assert_eq!(fitted.eye, DVec3::Z);
            }
        }
    }
}
