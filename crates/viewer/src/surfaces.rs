//! What the pixels of a picture see first: one point of a surface for each.

use rayon::prelude::*;
use snell_math::{DVec2, DVec3, Vec2, Vec3};
use snell_render::film::FilmPart;
use snell_render::film::noise::positions;
use snell_render::{Aov, CompiledScene, IntegratorKind, Job, Settings};
use snell_scene::{Background, Camera, CameraSample};

/// The material of a point where nothing is hit.
pub const NOTHING: i32 = -1;
/// Distance of the points where nothing is hit.
const FAR: f32 = 1e12;
/// Smaller albedos are not divided out, because they reflect almost no light.
const LEAST_ALBEDO: f32 = 0.02;
/// Minimum number of pixels per thread: waking other threads for fewer takes longer than the work.
pub const PIXELS: usize = 1 << 12;

/// Linear red, green and blue.
pub type Color = [f32; 3];

/// The first surface that a pixel sees.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Position in the world.
    pub position: Vec3,
    /// Shading normal; zero where nothing is hit.
    pub normal: Vec3,
    /// Fraction of the light that is reflected towards the eye.
    pub albedo: Color,
    /// Radiance that does not come from other surfaces: emission, or the background.
    pub glow: Color,
    /// Number of the material, or [`NOTHING`].
    pub material: i32,
}

impl Default for Point {
    fn default() -> Self {
        let (position, normal) = (Vec3::ZERO, Vec3::ZERO);
        Self { position, normal, albedo: [1.0; 3], glow: [0.0; 3], material: NOTHING }
    }
}

impl Point {
    /// True if both are points of one smooth surface, near each other in the picture: they have one
    /// material, similar normals, and lie in each other's plane up to `tolerance`.
    pub fn continues(&self, other: &Self, tolerance: f32) -> bool {
        let between = other.position - self.position;
        self.material == other.material
            && (self.material == NOTHING
                || self.normal.dot(other.normal) > 0.8
                    && between.dot(self.normal).abs() < tolerance
                    && between.dot(other.normal).abs() < tolerance)
    }

    /// The light that arrives, given the radiance towards the eye.
    pub fn light(&self, radiance: Color) -> Color {
        [0, 1, 2].map(|c| (radiance[c] - self.glow[c]) / self.albedo[c].max(LEAST_ALBEDO))
    }

    /// The radiance towards the eye, given the light that arrives.
    pub fn radiance(&self, light: Color) -> Color {
        [0, 1, 2].map(|c| self.glow[c] + light[c].max(0.0) * self.albedo[c].max(LEAST_ALBEDO))
    }
}

/// The points that a camera sees.
#[derive(Clone, Debug)]
pub struct Surfaces {
    /// The camera.
    pub camera: Camera,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// The position of every point in its pixel, from 0 to 1.
    pub offset: [f64; 2],
    /// The points, row by row.
    pub points: Vec<Point>,
}

impl Surfaces {
    /// The surfaces in a picture with these settings. Camera and scene are those of the job.
    pub fn seen(
        compiled: &CompiledScene,
        camera: &Camera,
        settings: &Settings,
        offset: [f64; 2],
        threads: usize,
    ) -> Self {
        // In media, light is scattered before it arrives from a surface, and a catcher of shadows
        // is no surface; there, all light counts as arriving.
        let is_clear = !compiled.has_media();
        let has_glow = is_clear && !matches!(compiled.background, Background::ShadowCatcher(_));
        let settings = Settings {
            pixel_position: Some(offset),
            spp: 1,
            max_depth: 0,
            integrator: if is_clear { IntegratorKind::Path } else { IntegratorKind::Aov },
            aovs: vec![Aov::Position, Aov::Normal, Aov::Albedo, Aov::MaterialId],
            ..settings.clone()
        };
        let parts = Job::new(compiled, camera, &settings).glance(threads, &|_| true);
        let size = settings.size.map(|side| side as usize);
        let mut points = vec![Point::default(); size[0] * size[1]];
        scatter(&parts, size[0], |pixel, color, values| {
            let of = |first: usize| [0, 1, 2].map(|c| values[first + c]);
            let material = values[9] as i32;
            let (albedo, glow) = match (is_clear, material) {
                (true, NOTHING) => ([1.0; 3], if has_glow { color } else { [0.0; 3] }),
                (true, _) => (of(6), color),
                (false, _) => ([1.0; 3], [0.0; 3]),
            };
            let (position, normal) = (Vec3::from(of(0)), Vec3::from(of(3)));
            points[pixel] = Point { position, normal, albedo, glow, material };
        });
        let view = camera.view(settings.size);
        points.par_iter_mut().enumerate().with_min_len(PIXELS).for_each(|(i, point)| {
            if point.material == NOTHING {
                let film = [(i % size[0]) as f64 + offset[0], (i / size[0]) as f64 + offset[1]];
                let film = DVec2::from(film);
                let ray = view.ray(&CameraSample { film, lens: Vec2::splat(0.5) }).ray;
                point.position = ray.origin + ray.direction * FAR;
            }
        });
        Self { camera: camera.clone(), size, offset, points }
    }

    /// The number of points.
    pub fn count(&self) -> usize {
        self.points.len()
    }

    /// How far points of one plane may lie apart from it: a fraction of their distance from the
    /// eye.
    pub fn tolerance(&self, point: &Point) -> f32 {
        0.01 * (point.position - self.camera.eye.as_vec3()).length()
    }

    /// The position of a point in this picture, in pixels between its points: (0, 0) is the first
    /// of them. `None` if the camera does not see it.
    pub fn place(&self, position: Vec3) -> Option<DVec2> {
        let size = self.size.map(|side| side as u32);
        let place = self.camera.project(position.as_dvec3(), size)?;
        let [x, y] = [place.x - self.offset[0], place.y - self.offset[1]];
        let is_inside = x > -1.0 && y > -1.0 && x < self.size[0] as f64 && y < self.size[1] as f64;
        is_inside.then_some(DVec2::new(x, y))
    }

    /// The four points around a place of [`Self::place`], each with its weight in bilinear
    /// interpolation.
    pub fn around(&self, place: DVec2) -> [(usize, f32); 4] {
        let (x, y) = (place.x.floor(), place.y.floor());
        let (fx, fy) = ((place.x - x) as f32, (place.y - y) as f32);
        let column = |x: f64| x.clamp(0.0, (self.size[0] - 1) as f64) as usize;
        let row = |y: f64| y.clamp(0.0, (self.size[1] - 1) as f64) as usize * self.size[0];
        let ([left, right], [upper, lower]) =
            ([column(x), column(x + 1.0)], [row(y), row(y + 1.0)]);
        [
            (upper + left, (1.0 - fx) * (1.0 - fy)),
            (upper + right, fx * (1.0 - fy)),
            (lower + left, (1.0 - fx) * fy),
            (lower + right, fx * fy),
        ]
    }

    /// For each point, whether all neighbours in its row and column are of the same surface.
    pub fn inner(&self) -> Vec<bool> {
        let [width, height] = self.size;
        let is_inner = |i: usize| {
            let (x, y, point) = (i % width, i / width, &self.points[i]);
            let tolerance = self.tolerance(point);
            let is_same = |other: usize| point.continues(&self.points[other], tolerance);
            (x == 0 || is_same(i - 1))
                && (x + 1 == width || is_same(i + 1))
                && (y == 0 || is_same(i - width))
                && (y + 1 == height || is_same(i + width))
        };
        (0..self.count()).into_par_iter().with_min_len(PIXELS).map(is_inner).collect()
    }

    /// The eye, from which points are seen.
    pub fn eye(&self) -> DVec3 {
        self.camera.eye
    }
}

/// Calls `take` for each sample of some parts of a picture of this width, with the pixel's number,
/// its colour and its further values.
pub fn scatter(parts: &[FilmPart], width: usize, mut take: impl FnMut(usize, Color, &[f32])) {
    for part in parts {
        let all: Vec<usize> =
            positions(&part.area).map(|[x, y]| y as usize * width + x as usize).collect();
        let channels = part.aovs.len() / part.values.len().max(1);
        for (number, sample) in part.values.iter().enumerate() {
            let pixel = part.pixels.as_ref().map_or(number, |pixels| pixels[number] as usize);
            let values = &part.aovs[number * channels..][..channels];
            take(all[pixel], sample.color.to_array(), values);
        }
    }
}
