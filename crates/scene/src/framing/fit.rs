//! A camera whose view frames a box, or the contents of a box, as large as possible.

use crate::camera::{Camera, Projection};
use snell_math::{Bounds3d, DVec3, real};

/// Tangent of half the angle of view across the smaller side of the picture. The whole angle is 34
/// degrees, about that of a 60 mm lens.
const TAN_HALF_FOV: f64 = 0.3057;
/// The fraction of the way from the middle of the picture to its edges that the contents may fill.
const FILL: f64 = 0.88;
/// The largest number of steps. Each step leaves a fraction of the previous error, and two or three
/// are enough in most cases.
const CENTERING_STEPS: usize = 24;
/// Changes of a slope below this end the iteration.
const CENTERED: f64 = 1e-3;
/// Azimuth of the camera to the right, in radians.
const AZIMUTH: f64 = 0.5;
/// Elevation of the camera, in radians.
const ELEVATION: f64 = 0.3;

/// A camera that sees the whole box in a picture of this aspect ratio (width over height), from the
/// front, the right and slightly above. With `up = +y` the front is `+z`, with `up = +z` it is
/// `-y`; `+x` is to the right.
///
/// Infinite sides (of planes) are cut to the extent of the finite ones. An empty box counts as a
/// unit cube, and a point is given some extent. The camera is focused on the middle of the box.
pub fn frame(bounds: &Bounds3d, up: DVec3, aspect: f64) -> Camera {
    let bounds = sane(bounds);
    frame_content(&bounds, up, aspect, |directions| Extent::of_box(&bounds, directions))
}

/// Does what [`frame`] does for the contents of the box: `extent` returns their extent in four
/// directions.
pub(super) fn frame_content(
    bounds: &Bounds3d,
    up: DVec3,
    aspect: f64,
    extent: impl Fn(&[DVec3; 4]) -> Extent,
) -> Camera {
    let given = *bounds;
    let bounds = sane(bounds);
    let aspect =
        if aspect > 0.0 && aspect.is_finite() { aspect.clamp(1e-3, 1e3) } else { 4.0 / 3.0 };
    let (tan_x, tan_y) = if aspect >= 1.0 {
        (TAN_HALF_FOV * aspect, TAN_HALF_FOV)
    } else {
        (TAN_HALF_FOV, TAN_HALF_FOV / aspect)
    };
    let projection = Projection::Perspective {
        tan_half_fov: if aspect >= 1.0 {
            [None, Some(TAN_HALF_FOV)]
        } else {
            [Some(TAN_HALF_FOV), None]
        },
    };
    let up = up.try_normalize().filter(|u| u.is_finite()).unwrap_or(DVec3::Y);
    let center = bounds.center();
    let mut camera = Camera::from_direction(center, -from_object(up), up, projection);
    let (right, up, towards) = (camera.right(), camera.up, camera.towards);
    // The sides of a view pyramid with these slopes that touch the contents from outside:
    // `x - slope z <= reach` and so on, relative to the middle of the box.
    let reach = |slopes: [f64; 2]| -> [f64; 4] {
        let [x, y] = slopes.map(|slope| towards * slope);
        let normals = [right - x, -right - x, up - y, -up - y];
        let offset =
            |extent: &Extent| std::array::from_fn(|i| extent.reach[i] - normals[i].dot(center));
        let fits = |reach: &[f64; 4]| reach.iter().all(|r| r.is_finite()) && bounds == given;
        let content = Some(offset(&extent(&normals))).filter(fits);
        content.unwrap_or_else(|| offset(&Extent::of_box(&bounds, &normals)))
    };
    let [tan_x, tan_y] = [tan_x * FILL, tan_y * FILL];
    let outermost = reach([tan_x, tan_y]);
    let [mut x1, mut x2, mut y1, mut y2] = outermost;
    // The apex is where opposite sides meet, but no nearer than the other pair of sides allows.
    let back = ((x1 + x2) / (2.0 * tan_x)).max((y1 + y2) / (2.0 * tan_y));
    // A corner may point at the camera, which must stay outside of the box as seen along the view.
    let depth = (bounds.size() / 2.0).dot(towards.abs());
    let back = back.max(depth + bounds.radius() * 1e-3);
    // Sides that have room left move in until they touch too, which centres the contents.
    let mut slopes = [tan_x, tan_y];
    for _ in 0..CENTERING_STEPS {
        let slope = |a: f64, b: f64, tan: f64| ((a + b) / (2.0 * back)).clamp(0.0, tan);
        let before = std::mem::replace(&mut slopes, [slope(x1, x2, tan_x), slope(y1, y2, tan_y)]);
        if (slopes[0] - before[0]).abs().max((slopes[1] - before[1]).abs()) < CENTERED {
            break;
        }
        [x1, x2, y1, y2] = reach(slopes);
    }
    // The camera moves towards the middle as far as nothing leaves the picture.
    let aside =
        |middle: f64, a: f64, b: f64, tan: f64| middle.min(tan * back - b).max(a - tan * back);
    let x = aside((x1 - x2) / 2.0, outermost[0], outermost[1], tan_x);
    let y = aside((y1 - y2) / 2.0, outermost[2], outermost[3], tan_y);
    camera.eye = center + right * x + up * y - towards * back;
    camera.focus_distance = back;
    camera.name = "default".into();
    camera
}

/// The extent of an object in four directions: for each, the largest dot product with the object's
/// points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub reach: [f64; 4],
}

impl Extent {
    /// The extent of nothing.
    pub const EMPTY: Self = Self { reach: [f64::NEG_INFINITY; 4] };

    /// The extent of a box.
    pub fn of_box(bounds: &Bounds3d, directions: &[DVec3; 4]) -> Self {
        if bounds.is_empty() {
            return Self::EMPTY;
        }
        let (center, half) = (bounds.center(), bounds.size() / 2.0);
        Self { reach: directions.map(|d| d.dot(center) + d.abs().dot(half)) }
    }

    /// The extent of both objects together.
    pub fn union(self, other: Self) -> Self {
        Self { reach: std::array::from_fn(|i| self.reach[i].max(other.reach[i])) }
    }

    /// The extent of the object after a translation.
    pub fn moved(self, by: DVec3, directions: &[DVec3; 4]) -> Self {
        Self { reach: std::array::from_fn(|i| self.reach[i] + directions[i].dot(by)) }
    }
}

/// The direction from the object to the camera.
fn from_object(up: DVec3) -> DVec3 {
    let front = if up.z.abs() > 0.9 { DVec3::NEG_Y } else { DVec3::Z };
    let front = (front - up * up.dot(front)).normalize();
    let side = up.cross(front);
    let level = front * real::cos(AZIMUTH) + side * real::sin(AZIMUTH);
    level * real::cos(ELEVATION) + up * real::sin(ELEVATION)
}

/// The box with infinite sides made finite, and with a diagonal long enough that single precision
/// can distinguish the box from a point.
fn sane(bounds: &Bounds3d) -> Bounds3d {
    const LIMIT: f64 = 1e30;
    if bounds.is_empty() {
        return Bounds3d { min: DVec3::splat(-1.0), max: DVec3::ONE };
    }
    let finite = |axis: usize| bounds.min[axis].abs() <= LIMIT && bounds.max[axis].abs() <= LIMIT;
    let extent = (0..3).filter(|&a| finite(a)).map(|a| bounds.size()[a]).fold(0.0, f64::max);
    let extent = if extent > 0.0 { extent } else { 1.0 };
    let mut b = *bounds;
    for axis in (0..3).filter(|&a| !finite(a)) {
        let (min, max) = (bounds.min[axis], bounds.max[axis]);
        (b.min[axis], b.max[axis]) = match (min.abs() <= LIMIT, max.abs() <= LIMIT) {
            (true, _) => (min, min + extent),
            (_, true) => (max - extent, max),
            _ => (-extent / 2.0, extent / 2.0),
        };
    }
    let center = b.center();
    let least = (center.abs().max_element() * 1e-5).max(f64::MIN_POSITIVE.sqrt());
    if b.radius() >= least {
        return b;
    }
    let half = if center == DVec3::ZERO { 1.0 } else { least };
    Bounds3d { min: center - half, max: center + half }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use snell_math::DVec2;

    /// Largest distance of a projected corner from the middle, horizontally and vertically, as a
    /// fraction of the way to the edge.
    fn reach(camera: &Camera, bounds: &Bounds3d, size: [u32; 2]) -> DVec2 {
        (0..8).fold(DVec2::ZERO, |reach, i| {
            let pick =
                |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            let p = camera
                .project(DVec3::new(pick(0), pick(1), pick(2)), size)
                .expect("corners are in front");
            let half = DVec2::new(size[0].into(), size[1].into()) / 2.0;
            reach.max(((p - half) / half).abs())
        })
    }

    proptest! {
        #[test]
        fn all_corners_are_inside_and_touch_the_margin(
            center in prop::array::uniform3(-50.0..50.0f64),
            half in prop::array::uniform3(0.0..20.0f64),
            size in (1u32..2000, 1u32..2000),
            z_up in any::<bool>(),
        ) {
            let (center, half) = (DVec3::from(center), DVec3::from(half));
            prop_assume!(half.max_element() > 1e-2);
            let bounds = Bounds3d { min: center - half, max: center + half };
            let size = [size.0, size.1];
            let up = if z_up { DVec3::Z } else { DVec3::Y };
            let camera = frame(&bounds, up, f64::from(size[0]) / f64::from(size[1]));
            let reach = reach(&camera, &bounds, size);
            prop_assert!(reach.max_element() <= FILL + 1e-6, "{reach}");
            prop_assert!(reach.max_element() >= FILL - 1e-3, "{reach}");
            prop_assert!(camera.up.dot(up) > 0.9 && camera.right().dot(up).abs() < 1e-9);
        }
    }

    #[test]
    fn any_box_gives_a_camera_that_works() {
        let infinity = f64::INFINITY;
        let boxes = [
            Bounds3d::EMPTY,
            Bounds3d::INFINITE,
            Bounds3d { min: DVec3::splat(-1e-20), max: DVec3::splat(1e-20) },
            Bounds3d { min: DVec3::splat(-1e29), max: DVec3::splat(1e29) },
            Bounds3d { min: DVec3::splat(5.0), max: DVec3::splat(5.0) },
            Bounds3d { min: DVec3::ZERO, max: DVec3::ZERO },
            Bounds3d { min: DVec3::splat(f64::NAN), max: DVec3::ONE },
            Bounds3d {
                min: DVec3::new(-infinity, 0.0, -infinity),
                max: DVec3::new(infinity, 3.0, infinity),
            },
            Bounds3d { min: DVec3::new(0.0, -infinity, 0.0), max: DVec3::ONE },
            Bounds3d { min: DVec3::new(-1.0, 0.0, -1.0), max: DVec3::new(1.0, 0.0, 1.0) },
        ];
        for bounds in boxes {
            for up in
                [DVec3::Y, DVec3::Z, DVec3::NEG_Y, DVec3::X, DVec3::ZERO, DVec3::splat(f64::NAN)]
            {
                for aspect in [1.5, 0.5, 1e-9, 0.0, f64::NAN] {
                    let camera = frame(&bounds, up, aspect);
                    assert!(
                        camera.eye.is_finite() && camera.focus_distance > 0.0,
                        "{bounds:?} {camera:?}"
                    );
                    assert!(camera.towards.is_normalized() && camera.up.is_normalized());
                    assert_ne!(
                        camera.eye.as_vec3(),
                        sane(&bounds).center().as_vec3(),
                        "{bounds:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_view_comes_from_the_front_right_and_above() {
        let bounds = Bounds3d { min: DVec3::splat(-1.0), max: DVec3::ONE };
        let eye = frame(&bounds, DVec3::Y, 1.0).eye;
        assert!(eye.z > eye.x && eye.x > 0.0 && eye.y > 0.0, "{eye}");
        let eye = frame(&bounds, DVec3::Z, 1.0).eye;
        assert!(-eye.y > eye.x && eye.x > 0.0 && eye.z > 0.0, "{eye}");
    }
}
