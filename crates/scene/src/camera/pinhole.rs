//! Flat views through a pinhole or a thin lens, in which the rays of a point on the film pass
//! through one plane in front of the eye.

use super::distortion::Distortion;
use super::projection::resolve;
use super::{CameraRay, LocalRay, Projection, directed};
use snell_math::{DVec2, DVec3, Ray, Vec2, Vec3, sampling};

/// The range of squared lengths that lose no precision.
pub(super) const USUAL: std::ops::Range<f64> = 1e-200..1e200;

/// The map from the film to the plane at distance 1 in front of the eye.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pinhole {
    /// Factors on the two film coordinates, and an offset, for x and for y on the plane.
    x: DVec3,
    y: DVec3,
    /// Square root of the area that a pixel has on the plane.
    pixel: f64,
}

impl Pinhole {
    pub fn of(projection: &Projection, size: [u32; 2]) -> Option<Self> {
        let [w, h] = size.map(|s| f64::from(s.max(1)));
        let (x, y) = match projection {
            Projection::Perspective { tan_half_fov } => {
                let [x, y] = resolve(*tan_half_fov, [w, h]);
                (DVec3::new(2.0 * x / w, 0.0, -x), DVec3::new(0.0, -2.0 * y / h, y))
            }
            Projection::Intrinsics(k) => {
                let ([fx, fy], [cx, cy]) = (k.focal_length, k.principal_point_on_film());
                let scale =
                    DVec2::new(f64::from(k.size[0].max(1)) / w, f64::from(k.size[1].max(1)) / h);
                let down = DVec3::new(0.0, scale.y / fy, -cy / fy);
                (DVec3::new(scale.x / fx, 0.0, -cx / fx) - down * (k.skew / fx), -down)
            }
            _ => return None,
        };
        Some(Self { x, y, pixel: (x.x * y.y).abs().sqrt() })
    }

    #[inline(always)]
    pub fn point(&self, film: DVec2) -> DVec2 {
        let along = |axis: DVec3| axis.x * film.x + axis.y * film.y + axis.z;
        DVec2::new(along(self.x), along(self.y))
    }

    /// The square root of a pixel's solid angle in a direction with this cosine to the view
    /// direction. The solid angle of a small patch of the plane falls with the cube of the cosine.
    #[inline(always)]
    pub fn spread(&self, cosine: f64) -> f64 {
        self.pixel * cosine * cosine.sqrt()
    }

    pub fn local_ray(&self, film: DVec2) -> LocalRay {
        let direction = self.point(film).extend(1.0);
        directed(direction, self.spread(1.0 / direction.length()))
    }

    /// The ray that a distorting lens sends to a point of the film, if there is one.
    pub fn distorted_ray(&self, film: DVec2, lens: &Distortion) -> Option<LocalRay> {
        let place = self.point(film);
        let found = lens.direction(DVec2::new(place.x, -place.y))?;
        let DVec3 { x, y, z } = found.direction;
        Some(directed(DVec3::new(x, -y, z), self.pixel * found.solid_angle.sqrt()))
    }
}

/// A thin lens in front of the eye.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    pub eye: DVec3,
    /// Unit vectors to the right, up, and along the view direction.
    pub axes: [DVec3; 3],
    pub radius: f64,
    /// Distance of the plane of focus from the eye.
    pub focus: f64,
}

impl Lens {
    /// The ray from a point of the lens, chosen by `u`, to the point where the ray through the
    /// lens's centre crosses the plane of focus. Returns the origin, the unit direction, the
    /// spread, and false if the numbers are too large or small. It has no branches, so that loops
    /// over it are vectorised.
    #[inline(always)]
    pub fn ray(&self, pinhole: &Pinhole, film: DVec2, u: Vec2) -> (Vec3, Vec3, f32, bool) {
        let Self { eye, axes: [right, up, towards], radius, focus } = *self;
        let p = pinhole.point(film);
        let from = sampling::concentric_disk(u).as_dvec2() * radius;
        let across = p * focus - from;
        let direction = right * across.x + up * across.y + towards * focus;
        let squared = direction.length_squared();
        let is_usual = USUAL.contains(&squared);
        let spread = pinhole.spread(1.0 / (p.length_squared() + 1.0).sqrt());
        let origin = eye + right * from.x + up * from.y;
        (origin.as_vec3(), (direction * (1.0 / squared.sqrt())).as_vec3(), spread as f32, is_usual)
    }
}

/// Rays of a flat view as columns: by axis, then by ray.
#[derive(Clone, Debug)]
pub struct CameraRays<const N: usize> {
    pub(super) origin: [[f32; N]; 3],
    pub(super) direction: [[f32; N]; 3],
    pub(super) spread: [f32; N],
}

impl<const N: usize> Default for CameraRays<N> {
    fn default() -> Self {
        Self { origin: [[0.0; N]; 3], direction: [[0.0; N]; 3], spread: [0.0; N] }
    }
}

impl<const N: usize> CameraRays<N> {
    /// The ray with index `i`.
    #[inline]
    pub fn get(&self, i: usize) -> CameraRay {
        let vector = |v: &[[f32; N]; 3]| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let ray = Ray::new(vector(&self.origin), vector(&self.direction));
        CameraRay { ray, width: 0.0, spread: self.spread[i], weight: 1.0 }
    }
}

/// [`CameraView::many_rays`] for a camera with a lens.
#[inline(always)]
pub(super) fn lens_lanes(
    lens: &Lens,
    pinhole: &Pinhole,
    film: [&[f64]; 2],
    u: [&[f32]; 2],
    origin: [&mut [f32]; 3],
    direction: [&mut [f32]; 3],
    spread: &mut [f32],
) -> bool {
    let count = spread.len();
    let (film, u) = (film.map(|film| &film[..count]), u.map(|u| &u[..count]));
    let (origin, direction) =
        (origin.map(|axis| &mut axis[..count]), direction.map(|axis| &mut axis[..count]));
    let mut are_usual = true;
    for i in 0..count {
        let at = (DVec2::new(film[0][i], film[1][i]), Vec2::new(u[0][i], u[1][i]));
        let (from, way, growth, is_usual) = lens.ray(pinhole, at.0, at.1);
        for axis in 0..3 {
            origin[axis][i] = from[axis];
            direction[axis][i] = way[axis];
        }
        spread[i] = growth;
        are_usual &= is_usual;
    }
    are_usual
}

/// [`CameraView::many_rays`] for a pinhole camera: the steps of [`CameraView::ray`] in the same
/// order.
#[inline(always)]
pub(super) fn lanes(
    pinhole: &Pinhole,
    axes: &[DVec3; 3],
    film: [&[f64]; 2],
    direction: [&mut [f32]; 3],
    spread: &mut [f32],
) -> bool {
    let [right, up, towards] = *axes;
    let [to_x, to_y, to_z] = direction;
    let count = spread.len();
    let (film_x, film_y) = (&film[0][..count], &film[1][..count]);
    let (to_x, to_y, to_z) = (&mut to_x[..count], &mut to_y[..count], &mut to_z[..count]);
    let mut is_usual = true;
    for i in 0..count {
        let p = pinhole.point(DVec2::new(film_x[i], film_y[i]));
        let x = right.x * p.x + up.x * p.y + towards.x;
        let y = right.y * p.x + up.y * p.y + towards.y;
        let z = right.z * p.x + up.z * p.y + towards.z;
        let squared = x * x + y * y + z * z;
        is_usual &= USUAL.contains(&squared);
        let inverse = 1.0 / squared.sqrt();
        to_x[i] = (x * inverse) as f32;
        to_y[i] = (y * inverse) as f32;
        to_z[i] = (z * inverse) as f32;
        spread[i] = pinhole.spread(inverse) as f32;
    }
    is_usual
}
