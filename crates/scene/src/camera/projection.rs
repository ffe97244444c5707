//! Projections: the maps from directions to positions on the film.

use super::distortion::Distortion;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{DVec2, DVec3, real};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

snell_math::declare! {
    /// Map from directions to positions on the film.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub enum Projection tagged "projection" {
        /// A flat picture through a pinhole or a thin lens.
        "perspective" => Perspective {
            /// Tangents of the half-angles of view, horizontal and vertical. One that is `null` (in
            /// Python `None`) is computed from the other and the aspect ratio of the picture; at
            /// least one is given.
            #[range(Range::Positive)]
            tan_half_fov: [Option<f64>; 2],
        },
        /// A pinhole or thin lens given by the matrix `[fx s cx; 0 fy cy; 0 0 1]` of computer
        /// vision.
        "intrinsics" => Intrinsics(matrix: Intrinsics),
        /// Parallel rays, as in a plan.
        "orthographic" => Orthographic {
            /// Half of the width and height of what is seen, in scene units. One that is `null` (in
            /// Python `None`) is computed from the other and the aspect ratio of the picture; at
            /// least one is given.
            #[range(Range::Positive)]
            #[unit("scene units")]
            half_size: [Option<f64>; 2],
        },
        /// All directions, as a latitude-longitude picture. The middle shows `towards`, the top
        /// edge `up`, both side edges what is behind; right of `towards` is right in the picture.
        "panoramic" => Panoramic,
        /// All directions, as a square of equal areas (Clarberg, Fast Equal-Area Mapping of the
        /// (Hemi)Sphere using SIMD, 2008): the middle is `up`, the middle of the right edge is
        /// right of `towards`, that of the bottom edge is `towards`, and the corners are down.
        "equal-area" => EqualArea,
        /// Equidistant fisheye: the angle from `towards` grows linearly with the distance from the
        /// middle of the picture. The circle touches the nearer edges of the picture; outside of it
        /// there are no rays.
        "fisheye" => Fisheye {
            /// Total angle of view across the circle, radians, in `(0, 2 pi]`.
            #[range(Range::Within(f64::MIN_POSITIVE, std::f64::consts::TAU))]
            #[unit("radians")]
            max_angle: f64,
        },
    }
}

snell_math::declare! {
    /// A camera matrix, in pixels of a picture of the given size. A picture rendered at another
    /// size shows the same view.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Intrinsics {
        /// Focal lengths `fx` and `fy`, not 0.
        #[unit("pixels")]
        pub focal_length: [f64; 2],
        /// Principal point `cx` and `cy`. The centre of the first pixel is at `pixel_center` in x
        /// and in y.
        #[unit("pixels")]
        pub principal_point: [f64; 2],
        /// Skew `s`; 0 for most cameras.
        #[serde(default)]
        pub skew: f64,
        /// Width and height in pixels of the picture that the other numbers refer to.
        #[range(Range::Positive)]
        #[unit("pixels")]
        pub size: [u32; 2],
        /// Coordinate of the centre of the first pixel: 0.5 as in this library, Open3D and pbrt,
        /// or 0 as in OpenCV and ROS.
        #[range(Range::Within(0.0, 0.5))]
        #[unit("pixels")]
        #[serde(default = "half")]
        pub pixel_center: f64,
        /// Distortion of the lens as in OpenCV: `k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4`.
        #[serde(default)]
        pub distortion: [f64; 12],
        /// Coefficients `k1` to `k4` of OpenCV's fisheye model, in place of `distortion`.
        #[serde(default)]
        pub fisheye: Option<[f64; 4]>,
    }
}

fn half() -> f64 {
    0.5
}

impl Intrinsics {
    /// A camera without skew and distortion for pictures of `size` pixels; the centre of the first
    /// pixel is `(0.5, 0.5)`.
    pub fn new(focal_length: [f64; 2], principal_point: [f64; 2], size: [u32; 2]) -> Self {
        let [skew, pixel_center] = [0.0, half()];
        let (distortion, fisheye) = ([0.0; 12], None);
        Self { focal_length, principal_point, skew, size, pixel_center, distortion, fisheye }
    }

    /// The principal point in the coordinates of [`super::CameraSample::film`].
    pub fn principal_point_on_film(&self) -> [f64; 2] {
        self.principal_point.map(|c| c + half() - self.pixel_center)
    }

    /// True if straight lines may be seen as bent.
    pub fn is_distorted(&self) -> bool {
        self.lens().is_some()
    }

    /// The lens, if it distorts.
    pub(super) fn lens(&self) -> Option<Distortion> {
        let is_flat = self.distortion.iter().all(|&k| k == 0.0);
        let flat = (!is_flat).then_some(Distortion::Flat(self.distortion));
        self.fisheye.map(Distortion::Fisheye).or(flat)
    }
}

/// Returns the unit direction for a point of the square `[-1, 1]^2`, which covers the sphere with
/// equal areas: its middle is `+z`, its corners are `-z` (Clarberg, Fast Equal-Area Mapping of the
/// (Hemi)Sphere using SIMD, 2008).
pub fn equal_area_direction(p: DVec2) -> DVec3 {
    let (u, v) = (p.x.abs(), p.y.abs());
    let distance = 1.0 - (u + v);
    let r = 1.0 - distance.abs();
    let phi = if r == 0.0 { 1.0 } else { (v - u) / r + 1.0 } * FRAC_PI_4;
    let z = (1.0 - r * r).copysign(distance);
    let side = r * (2.0 - r * r).max(0.0).sqrt();
    let (sin, cos) = real::sin_cos(phi);
    DVec3::new(cos.copysign(p.x) * side, sin.copysign(p.y) * side, z)
}

/// Returns the point of the square for a unit direction, as the inverse of
/// [`equal_area_direction`].
pub fn equal_area_place(d: DVec3) -> DVec2 {
    let (x, y, z) = (d.x.abs(), d.y.abs(), d.z.abs());
    let radius = (1.0 - z).max(0.0).sqrt();
    let angle = real::atan2(x.min(y), x.max(y)) / FRAC_PI_2;
    let angle = if x < y { 1.0 - angle } else { angle };
    let (mut v, mut u) = (angle * radius, radius - angle * radius);
    if d.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    DVec2::new(u.copysign(d.x), v.copysign(d.y))
}

/// Which side of the picture an angle of view is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FovAxis {
    /// The width.
    X,
    /// The height.
    Y,
    /// The larger of width and height.
    Larger,
    /// The smaller of width and height.
    Smaller,
}

/// Maximum of half-angles of view in radians, just under 90 degrees: a flat picture cannot show
/// more.
const MAX_HALF_ANGLE: f64 = 1.570;
/// Minimum of half-angles of view in radians, because an angle of 0 shows nothing.
const MIN_HALF_ANGLE: f64 = 1e-6;

impl Projection {
    /// An example of each kind. Documentation and bindings to other languages take the parameters
    /// from them.
    pub fn examples() -> Vec<Self> {
        let focal_length = [900.0, 900.0];
        vec![
            Self::Perspective { tan_half_fov: [Some(0.6), Some(0.4)] },
            Self::Intrinsics(Intrinsics::new(focal_length, [640.0, 360.0], [1280, 720])),
            Self::Orthographic { half_size: [Some(1.6), Some(0.9)] },
            Self::Panoramic,
            Self::EqualArea,
            Self::Fisheye { max_angle: std::f64::consts::PI },
        ]
    }

    /// The lens, if it distorts.
    pub(super) fn lens(&self) -> Option<Distortion> {
        let Self::Intrinsics(intrinsics) = self else { return None };
        intrinsics.lens()
    }

    /// A perspective view whose horizontal angle is twice `half_angle` (radians), the Θ of the view
    /// frustum. It is clamped to the limits of a flat picture.
    pub fn from_half_angle_x(half_angle: f64) -> Self {
        Self::Perspective { tan_half_fov: [Some(tan_of_half_angle(half_angle)), None] }
    }

    /// A perspective view whose vertical angle is twice `half_angle` (radians), clamped to the
    /// limits of a flat picture.
    pub fn from_half_angle_y(half_angle: f64) -> Self {
        Self::Perspective { tan_half_fov: [None, Some(tan_of_half_angle(half_angle))] }
    }

    /// A perspective view with a full angle of view in degrees. `axis` is the side that the angle
    /// refers to, and `size` determines which side of the picture is the larger one.
    pub fn from_fov_degrees(degrees: f64, axis: FovAxis, size: [u32; 2]) -> Self {
        let half_angle = degrees.to_radians() / 2.0;
        let wide = size[0] >= size[1];
        match axis {
            FovAxis::X => Self::from_half_angle_x(half_angle),
            FovAxis::Y => Self::from_half_angle_y(half_angle),
            FovAxis::Larger if wide => Self::from_half_angle_x(half_angle),
            FovAxis::Smaller if !wide => Self::from_half_angle_x(half_angle),
            FovAxis::Larger | FovAxis::Smaller => Self::from_half_angle_y(half_angle),
        }
    }
}

fn tan_of_half_angle(half_angle: f64) -> f64 {
    let angle = if half_angle.is_nan() { 0.35 } else { half_angle };
    real::tan(angle.clamp(MIN_HALF_ANGLE, MAX_HALF_ANGLE))
}

/// Both extents of a picture. If one is `None`, it follows from the other and the aspect ratio.
pub(super) fn resolve(extent: [Option<f64>; 2], size: [f64; 2]) -> [f64; 2] {
    let [w, h] = size;
    match extent {
        [Some(x), Some(y)] => [x, y],
        [Some(x), None] => [x, x * h / w],
        [None, Some(y)] => [y * w / h, y],
        [None, None] => [w / h, 1.0],
    }
}
