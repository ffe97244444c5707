//! Moving pictures with four times as many pixels as are rendered: each picture has new samples at
//! one of four positions in every pixel, and the other three come from the previous picture,
//! reprojected by the motion of their surface (temporal antialiasing and upsampling: Karis 2014,
//! "High Quality Temporal Supersampling"; Yang, Liu and Salvi 2020, "A Survey of Temporal
//! Antialiasing Techniques").

use rayon::prelude::*;
use snell_math::{DVec2, DVec3, Vec2};
use snell_scene::{Camera, CameraSample};

/// The quarter of every pixel that each picture samples, in turn: its column (1 is the right one)
/// and its row (1 is the lower one).
const PHASES: [[usize; 2]; 4] = [[0, 0], [1, 1], [1, 0], [0, 1]];
/// Weight of the old picture at new samples, if samples are noisy.
const MEMORY: f32 = 0.6;
/// Distance of the background.
const FAR: f64 = 1e12;
/// Minimum number of rows per thread.
const ROWS: usize = 16;

/// The quarter of every pixel that the picture with number `frame` samples.
pub fn phase(frame: u32) -> [usize; 2] {
    PHASES[frame as usize % 4]
}

/// The position of a quarter's centre in the pixel, each coordinate from 0 to 1.
pub fn pixel_position(phase: [usize; 2]) -> [f64; 2] {
    phase.map(|side| 0.25 + 0.5 * side as f64)
}

/// A picture that was shown, and its camera.
pub struct History {
    camera: Camera,
    size: [usize; 2],
    rgb: Vec<f32>,
}

/// The previous position of the surface that a pixel sees.
#[derive(Clone, Copy)]
struct Motion {
    /// Squared distance of the surface from the eye.
    distance: f64,
    /// The position in the previous picture that corresponds to the centre of pixel `[0, 0]` of the
    /// new one, if everything moved as this surface did; `None` if it is not visible there.
    place: Option<DVec2>,
}

impl Motion {
    fn nearer(self, other: Self) -> Self {
        if other.distance < self.distance { other } else { self }
    }
}

/// A picture with one sample per pixel.
pub struct Fresh<'a> {
    /// The camera of the picture.
    pub camera: &'a Camera,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The quarter of each pixel that is sampled.
    pub phase: [usize; 2],
    /// Linear values, three per pixel.
    pub rgb: &'a [f32],
    /// Hit points of the samples, three coordinates per pixel.
    pub positions: &'a [f32],
    /// Ids of the hits; negative for misses.
    pub ids: &'a [f32],
    /// True if new samples are to be averaged with old ones.
    pub is_noisy: bool,
}

impl History {
    /// The next picture, of twice the width and height of `fresh`. Three quarters of its pixels
    /// come from `before`, where that shows the surface.
    pub fn next(before: Option<&Self>, fresh: &Fresh) -> Self {
        let size = fresh.size.map(|side| 2 * side as usize);
        let mut rgb = vec![0.0; size[0] * size[1] * 3];
        let motions = before.map(|before| before.motions(fresh, size));
        let rows = rgb.par_chunks_mut((2 * size[0] * 3).max(1)).enumerate();
        rows.with_min_len(ROWS).for_each(|(y, rows)| {
            for x in 0..size[0] / 2 {
                // At edges, pixels move with the surface in front.
                let place = |motions: &Vec<Motion>| {
                    fresh.around([x, y]).map(|i| motions[i]).reduce(Motion::nearer)
                };
                let old = before
                    .zip(motions.as_ref().and_then(place))
                    .map(|(before, motion)| (before, motion.place));
                for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let at = [2 * x + dx, 2 * y + dy];
                    let color = fresh.resolved(
                        [x, y],
                        at,
                        old.and_then(|(b, place)| Some(b.sample(place?, at, size))),
                    );
                    let i = (dy * size[0] + at[0]) * 3;
                    rows[i..i + 3].copy_from_slice(&color);
                }
            }
        });
        Self { camera: fresh.camera.clone(), size, rgb }
    }

    /// Width and height.
    pub fn size(&self) -> [u32; 2] {
        self.size.map(|side| side as u32)
    }

    /// Linear values, three per pixel.
    pub fn rgb(&self) -> &[f32] {
        &self.rgb
    }

    fn motions(&self, fresh: &Fresh, size: [usize; 2]) -> Vec<Motion> {
        let width = size[0] / 2;
        let pixels = (0..width * (size[1] / 2)).into_par_iter().with_min_len(ROWS * 256);
        pixels.map(|i| self.motion(fresh, [i % width, i / width], size)).collect()
    }

    fn motion(&self, fresh: &Fresh, [x, y]: [usize; 2], size: [usize; 2]) -> Motion {
        let i = y * (size[0] / 2) + x;
        let film = DVec2::new(
            (2 * x + fresh.phase[0]) as f64 + 0.5,
            (2 * y + fresh.phase[1]) as f64 + 0.5,
        );
        let seen = if fresh.ids[i] < 0.0 {
            // A miss counts as a point far away.
            let sample = CameraSample { film, lens: Vec2::splat(0.5) };
            let ray = fresh.camera.ray(&sample, size.map(|side| side as u32)).ray;
            self.camera.eye + ray.direction.as_dvec3() * FAR
        } else {
            DVec3::from([0, 1, 2].map(|axis| f64::from(fresh.positions[i * 3 + axis])))
        };
        let place = self
            .camera
            .project(seen, self.size())
            .map(|before| before - (film - 0.5) * self.scale(size));
        Motion { distance: (seen - fresh.camera.eye).length_squared(), place }
    }

    /// Pixels of this picture per pixel of a picture of size `size`.
    fn scale(&self, size: [usize; 2]) -> DVec2 {
        DVec2::new(self.size[0] as f64 / size[0] as f64, self.size[1] as f64 / size[1] as f64)
    }

    /// The interpolated colour for pixel `at` of the new picture, if `place` is that of its
    /// [`Motion`]. `None` outside of this picture.
    fn sample(&self, place: DVec2, at: [usize; 2], size: [usize; 2]) -> Option<[f32; 3]> {
        let p = place + DVec2::new(at[0] as f64, at[1] as f64) * self.scale(size) - 0.5;
        let [width, height] = self.size;
        let is_inside =
            p.x >= -0.5 && p.y >= -0.5 && p.x <= width as f64 - 0.5 && p.y <= height as f64 - 0.5;
        if !is_inside {
            return None;
        }
        let (x, y) = (p.x.max(0.0), p.y.max(0.0));
        let (column, row) = ((x as usize).min(width - 1), (y as usize).min(height - 1));
        let (fx, fy) = ((x - column as f64) as f32, (y - row as f64) as f32);
        let (right, below) = ((column + 1).min(width - 1), (row + 1).min(height - 1));
        let value = |x: usize, y: usize, c: usize| self.rgb[(y * width + x) * 3 + c];
        Some([0, 1, 2].map(|c| {
            let upper = value(column, row, c) * (1.0 - fx) + value(right, row, c) * fx;
            let lower = value(column, below, c) * (1.0 - fx) + value(right, below, c) * fx;
            upper * (1.0 - fy) + lower * fy
        }))
    }
}

impl Fresh<'_> {
    /// The colour of pixel `at` of the large picture, which lies in pixel `[x, y]` of this one.
    /// `old` is its colour in the previous picture.
    fn resolved(
        &self,
        [x, y]: [usize; 2],
        at: [usize; 2],
        old: Option<Option<[f32; 3]>>,
    ) -> [f32; 3] {
        let own = self.color(x, y);
        let is_new = [at[0] % 2, at[1] % 2] == self.phase;
        if is_new && !self.is_noisy {
            return own;
        }
        let Some(Some(old)) = old else { return own };
        // Old colours are clamped to the range of the new neighbours.
        let [low, high] = self.range(x, y);
        let old = [0, 1, 2].map(|c| old[c].clamp(low[c], high[c]));
        if is_new { [0, 1, 2].map(|c| own[c] + (old[c] - own[c]) * MEMORY) } else { old }
    }

    /// Indices of a pixel and its neighbours.
    fn around(&self, [x, y]: [usize; 2]) -> impl Iterator<Item = usize> {
        let [width, height] = self.size.map(|side| side as usize);
        let (rows, columns) =
            (y.saturating_sub(1)..(y + 2).min(height), x.saturating_sub(1)..(x + 2).min(width));
        rows.flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }

    fn color(&self, x: usize, y: usize) -> [f32; 3] {
        let i = (y * self.size[0] as usize + x) * 3;
        [self.rgb[i], self.rgb[i + 1], self.rgb[i + 2]]
    }

    /// Minimum and maximum of each channel in a pixel and its neighbours.
    fn range(&self, x: usize, y: usize) -> [[f32; 3]; 2] {
        let (mut low, mut high) = (self.color(x, y), self.color(x, y));
        for i in self.around([x, y]) {
            for c in 0..3 {
                let value = self.rgb[i * 3 + c];
                low[c] = if value < low[c] { value } else { low[c] };
                high[c] = if value > high[c] { value } else { high[c] };
            }
        }
        [low, high]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec3;

    const SIZE: [u32; 2] = [16, 12];

    fn camera(eye: Vec3) -> Camera {
        Camera::look_at(eye, Vec3::new(eye.x, eye.y, 0.0), Vec3::Y, 0.5)
    }

    /// A wall of vertical stripes at z = 0, as seen at a phase.
    fn picture(camera: &Camera, phase: [usize; 2]) -> (Vec<f32>, Vec<f32>) {
        let (mut rgb, mut positions) = (Vec::new(), Vec::new());
        for y in 0..SIZE[1] {
            for x in 0..SIZE[0] {
                let [dx, dy] = pixel_position(phase);
                let film = DVec2::new(f64::from(x) + dx, f64::from(y) + dy);
                let ray = camera.ray(&CameraSample { film, lens: Vec2::splat(0.5) }, SIZE).ray;
                let seen = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
                rgb.extend([stripe(seen.x); 3]);
                positions.extend(seen.to_array());
            }
        }
        (rgb, positions)
    }

    fn stripe(x: f32) -> f32 {
        0.5 + 0.4 * (x * 3.0).sin()
    }

    /// The picture after some frames of a moving camera, and its mean error.
    fn error_after(frames: u32, speed: f32, is_noisy: bool) -> f32 {
        let mut history: Option<History> = None;
        let mut last = camera(Vec3::ZERO);
        for frame in 0..frames {
            last = camera(Vec3::new(speed * frame as f32, 0.0, 4.0));
            let phase = phase(frame);
            let (rgb, positions) = picture(&last, phase);
            let ids = vec![0.0; rgb.len() / 3];
            let fresh = Fresh {
                camera: &last,
                size: SIZE,
                phase,
                rgb: &rgb,
                positions: &positions,
                ids: &ids,
                is_noisy,
            };
            history = Some(History::next(history.as_ref(), &fresh));
        }
        let history = history.expect("there were frames");
        let size = history.size();
        let mut sum = 0.0;
        for y in 0..size[1] {
            for x in 0..size[0] {
                let film = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let ray = last.ray(&CameraSample { film, lens: Vec2::splat(0.5) }, size).ray;
                let wanted =
                    stripe((ray.origin - ray.direction * (ray.origin.z / ray.direction.z)).x);
                sum += (history.rgb()[((y * size[0] + x) * 3) as usize] - wanted).abs();
            }
        }
        sum / (size[0] * size[1]) as f32
    }

    #[test]
    fn four_pictures_of_a_camera_at_rest_make_one_of_four_times_the_pixels() {
        // Only pixels that are brighter or darker than all neighbours are lost.
        let (one, four) = (error_after(1, 0.0, false), error_after(4, 0.0, false));
        assert!(four < 0.1 * one, "{four} after {one}");
    }

    #[test]
    fn a_moving_camera_finds_what_it_has_seen() {
        let (first, later) = (error_after(1, 0.05, false), error_after(12, 0.05, false));
        assert!(later < 0.5 * first, "{later} after {first}");
        assert!(error_after(12, 0.05, true) < first);
    }
}
