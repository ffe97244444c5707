//! Cameras: the map from a point on the film to a ray in the world, and back.

mod clip;
mod distortion;
mod matrix;
mod pinhole;
mod projection;
#[cfg(test)]
mod tests;

pub use matrix::{CameraAxes, CameraError};
pub use pinhole::CameraRays;
pub use projection::{FovAxis, Intrinsics, Projection, equal_area_direction, equal_area_place};

use crate::ranges::FARTHEST;
use pinhole::{Lens, Pinhole, USUAL};
use projection::resolve;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::simd::Wide;
use snell_math::{DRay, DVec2, DVec3, Ray, Vec2, Vec3, at_level, real, sampling};
use std::f64::consts::{PI, TAU};

/// The position on the film and on the lens that determines a camera ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSample {
    /// Position in pixels from the upper left corner of the picture: `(0.5, 0.5)` is the centre of
    /// the first pixel.
    pub film: DVec2,
    /// Uniform random position that is mapped to the lens, in `[0, 1)^2`.
    pub lens: Vec2,
}

snell_math::declare! {
    /// A camera in the world. Its own axes: `right`, `up` and `towards`, orthonormal.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Camera {
        /// Name by which `--camera` selects the camera.
        #[serde(default)]
        pub name: String,
        /// Position of the eye in the world.
        #[range(Range::Within(-FARTHEST, FARTHEST))]
        #[unit("scene units")]
        pub eye: DVec3,
        /// Unit view direction.
        #[range(Range::Direction)]
        pub towards: DVec3,
        /// Unit vector that points up in the picture, perpendicular to `towards`.
        #[range(Range::Direction)]
        pub up: DVec3,
        /// Map from directions to positions on the film.
        pub projection: Projection,
        /// Radius of the lens in scene units; 0 is a pinhole. Panoramic and fisheye cameras have no
        /// lens.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        #[serde(default)]
        pub aperture_radius: f64,
        /// Distance along `towards` to the plane in which points are sharp; positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub focus_distance: f64,
        /// Size in pixels of the pictures that the camera was made for, if it is given.
        #[range(Range::Positive)]
        #[unit("pixels")]
        pub resolution: Option<[u32; 2]>,
        /// A plane `[a, b, c, d]` that cuts the scene open: of what the camera sees directly, only
        /// points with `a x + b y + c z + d >= 0` are left. Light, shadows and reflections are
        /// those of the whole scene.
        #[range(Range::Within(-FARTHEST, FARTHEST))]
        pub clip: Option<[f64; 4]>,
    }
}

/// A camera ray with its footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// The ray, with a unit direction.
    pub ray: Ray,
    /// Width of the pixel's cone at the ray's origin.
    pub width: f32,
    /// Growth of the cone's width per unit of distance, which is the square root of the solid angle
    /// of a pixel.
    pub spread: f32,
    /// Weight of the sample: 1, except 0 where the projection has no ray (outside of a fisheye's
    /// circle).
    pub weight: f32,
}

/// A ray in camera coordinates `(right, up, towards)`, before the lens changes it.
struct LocalRay {
    origin: DVec2,
    /// Direction of any length. For projections with a lens its last coordinate is 1.
    direction: DVec3,
    width: f64,
    spread: f64,
    weight: f32,
}

impl Camera {
    /// A pinhole camera at `eye` that looks along `towards`. `up` need not be perpendicular or of
    /// unit length; if it is parallel to `towards` (or zero, or not finite), another direction is
    /// chosen. A view direction of length 0 becomes `-z`.
    pub fn from_direction(eye: DVec3, towards: DVec3, up: DVec3, projection: Projection) -> Self {
        let towards = unit(towards).unwrap_or(DVec3::NEG_Z);
        let right = unit(up).and_then(|up| {
            let right = towards.cross(up);
            (right.length_squared() > 1e-20).then(|| right.normalize())
        });
        let right = right.unwrap_or_else(|| any_right(towards));
        Self {
            name: String::new(),
            eye,
            towards,
            up: right.cross(towards),
            projection,
            aperture_radius: 0.0,
            focus_distance: 1.0,
            resolution: None,
            clip: None,
        }
    }

    /// A camera at `eye` that looks at the point `target` and is focused on it. The other arguments
    /// are those of [`Self::from_direction`].
    pub fn from_target(eye: DVec3, target: DVec3, up: DVec3, projection: Projection) -> Self {
        let distance = (target - eye).length();
        let focus_distance = if distance > 0.0 && distance.is_finite() { distance } else { 1.0 };
        Self { focus_distance, ..Self::from_direction(eye, target - eye, up, projection) }
    }

    /// A pinhole camera at `eye` that looks at `target`. `tan_half_fov_y` is the tangent of half of
    /// the vertical angle of view.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, tan_half_fov_y: f64) -> Self {
        let projection = Projection::Perspective { tan_half_fov: [None, Some(tan_half_fov_y)] };
        Self::from_target(eye.as_dvec3(), target.as_dvec3(), up.as_dvec3(), projection)
    }

    /// Makes `towards` a unit vector, and `up` a unit vector perpendicular to it. Vectors from
    /// files and from edits by hand may be neither.
    pub fn square_up(&mut self) {
        let is_unit = |v: DVec3| (v.length_squared() - 1.0).abs() < 1e-9;
        if is_unit(self.towards) && is_unit(self.up) && self.towards.dot(self.up).abs() < 1e-9 {
            return;
        }
        let squared = Self::from_direction(self.eye, self.towards, self.up, self.projection);
        (self.towards, self.up) = (squared.towards, squared.up);
    }

    /// The camera interpolated on a straight line between this one (`s` is 0) and another (`s` is
    /// 1). It keeps this camera's projection.
    pub fn on_its_way(&self, other: &Self, s: f64) -> Self {
        let (towards, up) = (self.towards.lerp(other.towards, s), self.up.lerp(other.up, s));
        let placed =
            Self::from_direction(self.eye.lerp(other.eye, s), towards, up, self.projection);
        Self { eye: placed.eye, towards: placed.towards, up: placed.up, ..self.clone() }
    }

    /// The same camera with a thin lens, sharp in the plane at distance `focus_distance` along
    /// `towards`.
    pub fn with_lens(self, aperture_radius: f64, focus_distance: f64) -> Self {
        Self { aperture_radius, focus_distance, ..self }
    }

    /// Unit vector that points to the right in the picture: `towards x up`.
    pub fn right(&self) -> DVec3 {
        self.towards.cross(self.up)
    }

    /// True if the projection has a lens that can be out of focus.
    pub fn has_lens(&self) -> bool {
        let flat = match &self.projection {
            Projection::Panoramic | Projection::EqualArea | Projection::Fisheye { .. } => false,
            Projection::Intrinsics(k) => k.fisheye.is_none(),
            _ => true,
        };
        flat && self.aperture_radius > 0.0 && self.focus_distance > 0.0
    }

    /// True if all rays start at one point, so that the samples of a pixel can be traced as a
    /// packet.
    pub fn has_common_origin(&self) -> bool {
        !matches!(self.projection, Projection::Orthographic { .. }) && !self.has_lens()
    }

    /// The camera prepared for a picture of `size` pixels.
    pub fn view(&self, size: [u32; 2]) -> CameraView<'_> {
        let right = self.right();
        let is_straight = self.projection.lens().is_none();
        let pinhole = Pinhole::of(&self.projection, size).filter(|_| is_straight);
        let lens = self.has_lens().then_some(Lens {
            eye: self.eye,
            axes: [right, self.up, self.towards],
            radius: self.aperture_radius,
            focus: self.focus_distance,
        });
        CameraView { camera: self, size, right, pinhole, lens }
    }

    /// The ray through a point of a picture of `size` pixels.
    pub fn ray(&self, sample: &CameraSample, size: [u32; 2]) -> CameraRay {
        self.view(size).ray(sample)
    }

    /// The ray through a point of a picture of `size` pixels and the centre of the lens, with a
    /// unit direction, in double precision; `None` where the projection has no ray.
    pub fn central_ray(&self, film: DVec2, size: [u32; 2]) -> Option<DRay> {
        let LocalRay { origin, direction, weight, .. } = self.local_ray(film, size);
        let (right, up) = (self.right(), self.up);
        let direction = right * direction.x + up * direction.y + self.towards * direction.z;
        let direction = unit(direction).unwrap_or(self.towards);
        let origin = self.eye + right * origin.x + up * origin.y;
        let ray = DRay::new(origin, direction);
        (weight > 0.0).then(|| self.clip.map_or(ray, |plane| clip::clipped(&ray, plane)))
    }

    fn local_ray(&self, film: DVec2, size: [u32; 2]) -> LocalRay {
        let [w, h] = size.map(|s| f64::from(s.max(1)));
        // The position on the film from -1 to 1, with y upwards.
        let p = DVec2::new(film.x / w * 2.0 - 1.0, 1.0 - film.y / h * 2.0);
        match &self.projection {
            Projection::Perspective { .. } | Projection::Intrinsics(_) => {
                let hidden = LocalRay { weight: 0.0, ..directed(DVec3::Z, 0.0) };
                let Some(pinhole) = Pinhole::of(&self.projection, size) else { return hidden };
                match self.projection.lens() {
                    Some(lens) => pinhole.distorted_ray(film, &lens).unwrap_or(hidden),
                    None => pinhole.local_ray(film),
                }
            }
            Projection::Orthographic { half_size } => {
                let [x, y] = resolve(*half_size, [w, h]);
                let width = (4.0 * x * y / (w * h)).abs().sqrt();
                LocalRay {
                    origin: p * DVec2::new(x, y),
                    direction: DVec3::Z,
                    width,
                    spread: 0.0,
                    weight: 1.0,
                }
            }
            Projection::Panoramic => {
                let (sin_phi, cos_phi) = real::sin_cos(p.x * PI);
                let (sin, cos) = real::sin_cos((1.0 - p.y) * 0.5 * PI);
                let spread = (TAU / w * (PI / h) * sin.abs()).sqrt();
                directed(DVec3::new(sin * sin_phi, cos, sin * cos_phi), spread)
            }
            Projection::EqualArea => {
                let d = equal_area_direction(DVec2::new(p.x, -p.y));
                directed(DVec3::new(d.x, d.z, d.y), (4.0 * PI / (w * h)).sqrt())
            }
            Projection::Fisheye { max_angle } => {
                let side = w.min(h);
                // The position in units of the circle's radius.
                let q = p * DVec2::new(w, h) / side;
                let r = q.length();
                let theta = r * max_angle * 0.5;
                let outside = r > 1.0 || !theta.is_finite();
                if outside {
                    return LocalRay { weight: 0.0, ..directed(DVec3::Z, 0.0) };
                }
                let (sin, cos) = real::sin_cos(theta);
                let rim = if r > 0.0 { q * (sin / r) } else { DVec2::ZERO };
                let stretch = if theta > 0.0 { (sin / theta).abs() } else { 1.0 };
                directed(rim.extend(cos), max_angle / side * stretch.sqrt())
            }
        }
    }

    /// The position at which a point in the world is seen, through the centre of the lens, in a
    /// picture of `size` pixels. It has the coordinates of [`CameraSample::film`] and may lie
    /// outside of the picture; the map is the inverse of [`Self::ray`]. `None` for points that are
    /// not in front of a flat view, not in a fisheye's circle, or beyond the rim of a distorting
    /// lens.
    pub fn project(&self, point: DVec3, size: [u32; 2]) -> Option<DVec2> {
        let [w, h] = size.map(|s| f64::from(s.max(1)));
        let d = point - self.eye;
        let d = DVec3::new(d.dot(self.right()), d.dot(self.up), d.dot(self.towards));
        let film = |x: f64, y: f64| DVec2::new((x + 1.0) * 0.5 * w, (1.0 - y) * 0.5 * h);
        let p = match &self.projection {
            Projection::Perspective { tan_half_fov } => {
                let [x, y] = resolve(*tan_half_fov, [w, h]);
                (d.z > 0.0).then(|| film(d.x / d.z / x, d.y / d.z / y))
            }
            Projection::Intrinsics(k) => {
                let d = DVec3::new(d.x, -d.y, d.z);
                let place = match k.lens() {
                    Some(lens) => lens.place(d),
                    None => (d.z > 0.0).then(|| d.truncate() / d.z),
                };
                place.map(|DVec2 { x, y }| {
                    let p = DVec2::new(k.focal_length[0] * x + k.skew * y, k.focal_length[1] * y);
                    let own = k.size.map(|side| f64::from(side.max(1)));
                    let scale = DVec2::new(w, h) / DVec2::from(own);
                    (p + DVec2::from(k.principal_point_on_film())) * scale
                })
            }
            Projection::Orthographic { half_size } => {
                let [x, y] = resolve(*half_size, [w, h]);
                (d.z > 0.0).then(|| film(d.x / x, d.y / y))
            }
            Projection::Panoramic => {
                let theta = real::atan2(real::hypot(d.x, d.z), d.y);
                (d != DVec3::ZERO).then(|| film(real::atan2(d.x, d.z) / PI, 1.0 - theta * 2.0 / PI))
            }
            Projection::EqualArea => d.try_normalize().map(|d| {
                let place = equal_area_place(DVec3::new(d.x, d.z, d.y));
                film(place.x, -place.y)
            }),
            Projection::Fisheye { max_angle } => {
                let theta = real::atan2(real::hypot(d.x, d.y), d.z);
                let r = theta * 2.0 / max_angle;
                let q = d.truncate().normalize_or_zero() * r * w.min(h) / DVec2::new(w, h);
                (r <= 1.0 && d != DVec3::ZERO).then(|| film(q.x, q.y))
            }
        };
        p.filter(|p| p.is_finite())
    }
}

/// A camera prepared for pictures of one size, with the values that all of its rays share.
#[derive(Clone, Copy, Debug)]
pub struct CameraView<'a> {
    camera: &'a Camera,
    size: [u32; 2],
    right: DVec3,
    /// The map from the film, if the view is flat.
    pinhole: Option<Pinhole>,
    lens: Option<Lens>,
}

impl<'a> CameraView<'a> {
    /// The camera that was prepared.
    pub fn camera(&self) -> &'a Camera {
        self.camera
    }

    /// The ray through a point of the film and of the lens.
    #[inline]
    pub fn ray(&self, sample: &CameraSample) -> CameraRay {
        let whole = self.whole_ray(sample);
        match self.camera.clip {
            Some(plane) => CameraRay { ray: clip::clipped_single(&whole.ray, plane), ..whole },
            None => whole,
        }
    }

    /// The ray without regard to [`Camera::clip`].
    #[inline]
    fn whole_ray(&self, sample: &CameraSample) -> CameraRay {
        let camera = self.camera;
        if let (Some(pinhole), Some(lens)) = (&self.pinhole, &self.lens) {
            let (origin, direction, spread, is_usual) = lens.ray(pinhole, sample.film, sample.lens);
            if is_usual {
                return CameraRay {
                    ray: Ray::new(origin, direction),
                    width: 0.0,
                    spread,
                    weight: 1.0,
                };
            }
        } else if let Some(pinhole) = &self.pinhole {
            let p = pinhole.point(sample.film);
            let direction = self.right * p.x + camera.up * p.y + camera.towards;
            let squared = direction.length_squared();
            if USUAL.contains(&squared) {
                let inverse = 1.0 / squared.sqrt();
                return CameraRay {
                    ray: Ray::new(camera.eye.as_vec3(), (direction * inverse).as_vec3()),
                    width: 0.0,
                    spread: pinhole.spread(inverse) as f32,
                    weight: 1.0,
                };
            }
        }
        self.any_ray(sample)
    }

    /// Computes [`Self::ray`] for many points of the picture and of the lens (x and y of each),
    /// with the same bits. Returns false, and no valid rays, unless all are ordinary rays of a flat
    /// view that is not clipped.
    pub fn many_rays<const N: usize>(
        &self,
        film: &[[f64; N]; 2],
        u_lens: &[[f32; N]; 2],
        wide: Option<Wide>,
        rays: &mut CameraRays<N>,
    ) -> bool {
        let Some(pinhole) = &self.pinhole else { return false };
        if self.camera.clip.is_some() {
            return false;
        }
        if let Some(lens) = &self.lens {
            return at_level!(
                wide,
                pinhole::lens_lanes,
                (
                    lens: &Lens = lens,
                    pinhole: &Pinhole = pinhole,
                    film: [&[f64]; 2] = [&film[0], &film[1]],
                    u: [&[f32]; 2] = [&u_lens[0], &u_lens[1]],
                    origin: [&mut [f32]; 3] =
                        rays.origin.each_mut().map(|axis| axis.as_mut_slice()),
                    direction: [&mut [f32]; 3] =
                        rays.direction.each_mut().map(|axis| axis.as_mut_slice()),
                    spread: &mut [f32] = &mut rays.spread,
                ) -> bool
            );
        }
        let axes = [self.right, self.camera.up, self.camera.towards];
        let eye = self.camera.eye.as_vec3();
        rays.origin = [[eye.x; N], [eye.y; N], [eye.z; N]];
        at_level!(
            wide,
            pinhole::lanes,
            (
                pinhole: &Pinhole = pinhole,
                axes: &[DVec3; 3] = &axes,
                film: [&[f64]; 2] = [&film[0], &film[1]],
                direction: [&mut [f32]; 3] =
                    rays.direction.each_mut().map(|axis| axis.as_mut_slice()),
                spread: &mut [f32] = &mut rays.spread,
            ) -> bool
        )
    }

    #[inline(never)]
    fn any_ray(&self, sample: &CameraSample) -> CameraRay {
        let camera = self.camera;
        let LocalRay { origin, direction, width, spread, weight } =
            camera.local_ray(sample.film, self.size);
        let (origin, direction) = if camera.has_lens() {
            // All rays through the lens meet in the point where the ray through the lens's centre
            // crosses the plane of focus.
            let lens = sampling::concentric_disk(sample.lens).as_dvec2() * camera.aperture_radius;
            (origin + lens, direction * camera.focus_distance - lens.extend(0.0))
        } else {
            (origin, direction)
        };
        let direction =
            self.right * direction.x + camera.up * direction.y + camera.towards * direction.z;
        let eye = camera.eye + self.right * origin.x + camera.up * origin.y;
        let direction = unit(direction).unwrap_or(camera.towards);
        CameraRay {
            ray: Ray::new(eye.as_vec3(), direction.as_vec3()),
            width: width as f32,
            spread: spread as f32,
            weight,
        }
    }
}

fn directed(direction: DVec3, spread: f64) -> LocalRay {
    LocalRay { origin: DVec2::ZERO, direction, width: 0.0, spread, weight: 1.0 }
}

/// The unit vector in this direction, at any scale that does not overflow; `None` for zero and for
/// vectors that are not finite.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (largest > 0.0 && v.is_finite()).then(|| (v / largest).normalize())
}

/// A vector to the right for a view direction without a usable up: perpendicular to `y`, or to `z`
/// for a view along `y`.
fn any_right(towards: DVec3) -> DVec3 {
    let up = if towards.y.abs() < 0.9 { DVec3::Y } else { DVec3::NEG_Z * towards.y.signum() };
    towards.cross(up).normalize()
}
