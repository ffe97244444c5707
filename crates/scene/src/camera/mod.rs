//! Cameras: from a point on the film to a ray in the world.

use serde::{Deserialize, Serialize};
use snell_math::{DVec2, DVec3, Ray, Vec2, Vec3};

/// Where on the film and on the lens a ray passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSample {
    /// Position in pixels from the upper left corner of the picture: `(0.5, 0.5)` is the centre of the first pixel.
    pub film: DVec2,
    /// Uniform position on the lens, in `[0, 1)^2`.
    pub lens: Vec2,
}

/// How directions map to the film.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "projection", rename_all = "kebab-case")]
pub enum Projection {
    /// A pinhole or thin lens.
    Perspective {
        /// Tangents of the half-angles of view, horizontal and vertical. `None` follows from the other and the shape of the
        /// picture; at least one is given.
        tan_half_fov: [Option<f64>; 2],
    },
}

/// A camera in the world. Its own axes: `right`, `up` and `towards`, orthonormal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// For `--camera`.
    pub name: String,
    /// Eye position.
    pub eye: DVec3,
    /// Unit view direction.
    pub towards: DVec3,
    /// Unit vector that points up in the picture, perpendicular to `towards`.
    pub up: DVec3,
    /// How directions map to the film.
    pub projection: Projection,
    /// Radius of the lens in scene units; 0 is a pinhole.
    pub aperture_radius: f64,
    /// Distance along `towards` at which points are sharp.
    pub focus_distance: f64,
    /// Picture size the camera was made for, if it says.
    pub resolution: Option<[u32; 2]>,
}

/// A camera ray with its footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// The ray; unit direction.
    pub ray: Ray,
    /// Width of the pixel's cone at the ray's origin.
    pub width: f32,
    /// Growth of the cone's width per unit of distance.
    pub spread: f32,
    /// Weight of the sample: 1, except 0 where the projection has no ray (outside of a fisheye's circle).
    pub weight: f32,
}

impl Camera {
    /// The ray through a point of a picture of `size` pixels.
    pub fn ray(&self, sample: &CameraSample, size: [u32; 2]) -> CameraRay {
        let Projection::Perspective { tan_half_fov } = self.projection;
        let [w, h] = size.map(f64::from);
        let x = tan_half_fov[0].unwrap_or_else(|| tan_half_fov[1].unwrap_or(1.0) * w / h);
        let y = tan_half_fov[1].unwrap_or(x * h / w);
        let p = sample.film / DVec2::new(w, h) * 2.0 - 1.0;
        let right = self.towards.cross(self.up);
        let direction = self.towards + right * (p.x * x) - self.up * (p.y * y);
        let ray = Ray::new(self.eye.as_vec3(), direction.normalize_or(DVec3::Z).as_vec3());
        CameraRay { ray, width: 0.0, spread: (2.0 * y / h) as f32, weight: 1.0 }
    }

    /// True if all rays leave from one point (so that the samples of a pixel can be traced as a packet).
    pub fn has_common_origin(&self) -> bool {
        self.aperture_radius == 0.0
    }

    /// A pinhole camera at `eye`, looking at `target`.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, tan_half_fov_y: f64) -> Self {
        let towards = (target - eye).as_dvec3().normalize_or(DVec3::NEG_Z);
        let right = towards.cross(up.as_dvec3()).try_normalize().unwrap_or_else(|| towards.any_orthonormal_vector());
        Self {
            name: String::new(),
            eye: eye.as_dvec3(),
            towards,
            up: right.cross(towards),
            projection: Projection::Perspective { tan_half_fov: [None, Some(tan_half_fov_y)] },
            aperture_radius: 0.0,
            focus_distance: 1.0,
            resolution: None,
        }
    }
}
