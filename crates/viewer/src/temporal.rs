//! Moving pictures with four times as many pixels as are rendered: each picture has new samples at
//! one of four positions in every pixel, which are blended into the previous picture, reprojected
//! by the motion of its surfaces (temporal antialiasing and upsampling: Karis 2014, "High Quality
//! Temporal Supersampling"; Yang, Liu and Salvi 2020, "A Survey of Temporal Antialiasing
//! Techniques").

use crate::surfaces::{Color, PIXELS, Surfaces};
use rayon::prelude::*;
use snell_math::{DVec2, Vec3, real};
use snell_scene::Camera;

/// The quarter of every pixel that each picture samples, in turn: its column (1 is the right one)
/// and its row (1 is the lower one).
const PHASES: [[u32; 2]; 4] = [[0, 0], [1, 1], [1, 0], [0, 1]];
/// How far samples lie from the middle of their quarters at most, in pixels: where edges are, every
/// picture sees another part of the quarter.
const SPREAD: f64 = 0.11;
/// Weight of new samples in a pixel far from them, and in one around a sample; the other weight is
/// that of the old picture.
const SHARES: [f32; 2] = [0.06, 0.6];
/// The same for what moves: the pixels around samples change with every picture, so that weights
/// that differ would make combs of edges.
const MOVING_SHARES: [f32; 2] = [0.24, 0.26];
/// What moves so many pixels from one picture to the next has these weights.
const FAST: f64 = 0.25;
/// The same, if samples are noisy.
const NOISY_SHARES: [f32; 2] = [0.05, 0.2];
/// Minimum number of rows per thread.
const ROWS: usize = 16;

/// The position in the pixels that the picture with number `frame` samples, each coordinate from 0
/// to 1.
pub fn offset(frame: u32) -> [f64; 2] {
    // Additive recurrence along the plastic number (Roberts 2018).
    let round = f64::from(frame / 4 % 64);
    let spread = [0.754_877_67, 0.569_840_29].map(|step| (0.5 + round * step).fract() - 0.5);
    let quarter = PHASES[frame as usize % 4].map(|side| 0.25 + 0.5 * f64::from(side));
    [0, 1].map(|axis| quarter[axis] + 2.0 * SPREAD * spread[axis])
}

/// A picture that was shown, and its camera.
pub struct History {
    camera: Camera,
    size: [usize; 2],
    /// Compressed colours.
    colors: Vec<Color>,
}

/// The previous position of the surface that a pixel sees.
#[derive(Clone, Copy)]
struct Motion {
    /// Squared distance of the surface from the eye.
    distance: f32,
    /// The position in the previous picture that corresponds to the upper left corner of the new
    /// one, if everything moved as this surface did; `None` if it is not visible there.
    place: Option<DVec2>,
}

/// A picture with one sample per pixel.
pub struct Fresh<'a> {
    /// What the pixels see.
    pub surfaces: &'a Surfaces,
    /// Its linear colours.
    pub colors: &'a [Color],
    /// Whether the colour of a pixel is noisy.
    pub is_noisy: &'a (dyn Fn(usize) -> bool + Sync),
}

/// How one of the four pixels of the larger picture in a pixel is interpolated from the samples of
/// that pixel and its neighbours.
struct Reconstruction {
    /// Offsets of the samples in columns and rows, and their weights, which add up to 1.
    taps: [([isize; 2], f32); 4],
    /// From 0 between four samples to 1 where one lies in the middle.
    certainty: f32,
}

impl Reconstruction {
    fn new(offset: [f64; 2], part: [usize; 2]) -> Self {
        let [x, y] = [0, 1].map(|axis| 0.25 + 0.5 * part[axis] as f64 - offset[axis]);
        let along = |x: f64| {
            let (first, share) = (x.floor() as isize, (x - x.floor()) as f32);
            [(first, 1.0 - share), (first + 1, share)]
        };
        let (columns, rows) = (along(x), along(y));
        let taps = [(0, 0), (1, 0), (0, 1), (1, 1)]
            .map(|(i, j)| ([columns[i].0, rows[j].0], columns[i].1 * rows[j].1));
        let most = taps.iter().map(|tap| tap.1).fold(0.0, f32::max);
        Self { taps, certainty: real::powi((most - 0.25) / 0.75, 2) }
    }
}

/// Bright colours count less, so that edges beside them are smooth too (Karis 2014).
fn compressed(color: Color) -> Color {
    let color = color.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 });
    let scale = 1.0 / (1.0 + color.into_iter().fold(0.0, f32::max));
    color.map(|c| c * scale)
}

fn expanded(color: Color) -> Color {
    let scale = 1.0 / (1.0 - color.into_iter().fold(0.0, f32::max)).max(1e-4);
    color.map(|c| c * scale)
}

impl History {
    /// The next picture, of twice the width and height of `fresh`.
    pub fn next(before: Option<&Self>, fresh: &Fresh) -> Self {
        // What one plane has cut away is no part of the picture of another.
        let before = before.filter(|before| before.camera.clip == fresh.surfaces.camera.clip);
        let [width, height] = fresh.surfaces.size;
        let size = [2 * width, 2 * height];
        let new: Vec<Color> =
            fresh.colors.par_iter().with_min_len(PIXELS).map(|&c| compressed(c)).collect();
        let motions = before.map(|before| before.motions(fresh.surfaces));
        let parts = [[0, 0], [1, 0], [0, 1], [1, 1]]
            .map(|part| (part, Reconstruction::new(fresh.surfaces.offset, part)));
        let mut colors = vec![[0.0; 3]; size[0] * size[1]];
        let rows = colors.par_chunks_mut(2 * size[0]).enumerate().with_min_len(ROWS);
        rows.for_each(|(y, rows)| {
            for x in 0..width {
                let around = Around::new([x, y], [width, height]);
                let is_noisy = (fresh.is_noisy)(y * width + x);
                // At edges, pixels move with the surface in front.
                let old = before.zip(motions.as_ref()).and_then(|(before, motions)| {
                    let front = |a: Motion, b: Motion| if b.distance < a.distance { b } else { a };
                    let motion = around.all().map(|i| motions[i]).reduce(front);
                    Some((before, motion?.place?, around.range(&new)))
                });
                let [least, most] = match &old {
                    _ if is_noisy => NOISY_SHARES,
                    Some((_, place, _)) => {
                        let is_as_large = before.is_some_and(|before| before.size == size);
                        let speed = if is_as_large { place.length() / FAST } else { 1.0 };
                        let share = speed.min(1.0) as f32;
                        [0, 1].map(|i| SHARES[i] + share * (MOVING_SHARES[i] - SHARES[i]))
                    }
                    None => SHARES,
                };
                for (part, reconstruction) in &parts {
                    let color = around.mean(&new, &reconstruction.taps);
                    let at = [0, 1].map(|axis| 2 * [x, y][axis] + part[axis]);
                    let old = old.as_ref().and_then(|(before, place, [low, high])| {
                        let old = before.sample(*place, at, size, sharp)?;
                        // Old colours are clamped to the range of the new neighbours.
                        Some([0, 1, 2].map(|c| old[c].clamp(low[c], high[c])))
                    });
                    let share = least + (most - least) * reconstruction.certainty;
                    let blend =
                        |old: Color| [0, 1, 2].map(|c| old[c] + (color[c] - old[c]) * share);
                    rows[part[1] * size[0] + at[0]] = old.map_or(color, blend);
                }
            }
        });
        Self { camera: fresh.surfaces.camera.clone(), size, colors }
    }

    /// Width and height.
    pub fn size(&self) -> [u32; 2] {
        self.size.map(|side| side as u32)
    }

    /// True if the picture is that of this camera.
    pub fn is_of(&self, camera: &Camera) -> bool {
        self.camera == *camera
    }

    /// The linear colour for a pixel of a picture of another size, in which no pixels of this one
    /// are seen if it is larger.
    pub fn color(&self, at: [usize; 2], size: [usize; 2]) -> Color {
        let weights = if self.scale(size).x < 1.0 { smooth } else { sharp };
        self.sample(DVec2::ZERO, at, size, weights).map_or([0.0; 3], expanded)
    }

    /// Linear values, three per pixel.
    pub fn rgb(&self) -> Vec<f32> {
        self.colors.iter().flat_map(|&color| expanded(color)).collect()
    }

    fn motions(&self, surfaces: &Surfaces) -> Vec<Motion> {
        let count = surfaces.count();
        let motion = |i| self.motion(surfaces, i);
        (0..count).into_par_iter().with_min_len(PIXELS / 2).map(motion).collect()
    }

    fn motion(&self, surfaces: &Surfaces, i: usize) -> Motion {
        let [width, height] = surfaces.size;
        let position: Vec3 = surfaces.points[i].position;
        let offset = DVec2::from(surfaces.offset);
        let own = (DVec2::new((i % width) as f64, (i / width) as f64) + offset) * 2.0;
        let scale = self.scale([2 * width, 2 * height]);
        let before = self.camera.project(position.as_dvec3(), self.size());
        let distance = (position - surfaces.camera.eye.as_vec3()).length_squared();
        Motion { distance, place: before.map(|before| before - own * scale) }
    }

    /// Pixels of this picture per pixel of a picture of size `size`.
    fn scale(&self, size: [usize; 2]) -> DVec2 {
        DVec2::new(self.size[0] as f64 / size[0] as f64, self.size[1] as f64 / size[1] as f64)
    }

    /// The colour for pixel `at` of the new picture, interpolated with these weights, if `place` is
    /// that of its [`Motion`]. `None` outside of this picture.
    fn sample(
        &self,
        place: DVec2,
        at: [usize; 2],
        size: [usize; 2],
        weights: fn(f32) -> [f32; 4],
    ) -> Option<Color> {
        let middle = DVec2::new(at[0] as f64 + 0.5, at[1] as f64 + 0.5);
        let p = place + middle * self.scale(size) - 0.5;
        let [width, height] = self.size;
        let is_inside =
            p.x >= -0.5 && p.y >= -0.5 && p.x <= width as f64 - 0.5 && p.y <= height as f64 - 0.5;
        if !is_inside {
            return None;
        }
        let (columns, rows) = (cubic(p.x, width, weights), cubic(p.y, height, weights));
        let mut color = [0.0; 3];
        for (y, weight) in rows {
            let row = &self.colors[y * width..][..width];
            let mut sum = [0.0; 3];
            for &(x, weight) in &columns {
                (0..3).for_each(|c| sum[c] += weight * row[x][c]);
            }
            (0..3).for_each(|c| color[c] += weight * sum[c]);
        }
        Some(color)
    }
}

/// The four values around `x` of a row of so many, each with its weight.
fn cubic(x: f64, count: usize, weights: fn(f32) -> [f32; 4]) -> [(usize, f32); 4] {
    let first = x.floor();
    let weights = weights((x - first) as f32);
    let place = |i: usize| (first + i as f64 - 1.0).clamp(0.0, (count - 1) as f64) as usize;
    [0, 1, 2, 3].map(|i| (place(i), weights[i]))
}

/// Weights of four values at a share of the way from the second to the third (Catmull and Rom
/// 1974). Unlike linear interpolation, they leave pictures sharp that are reprojected many times.
fn sharp(t: f32) -> [f32; 4] {
    [
        t * (t * (1.0 - 0.5 * t) - 0.5),
        1.0 + t * t * (1.5 * t - 2.5),
        t * (t * (2.0 - 1.5 * t) + 0.5),
        t * t * (0.5 * t - 0.5),
    ]
}

/// The weights of the cubic B-spline: in a picture that is made larger, no squares are seen.
fn smooth(t: f32) -> [f32; 4] {
    let (inner, outer) = (|x: f32| (4.0 + x * x * (3.0 * x - 6.0)) / 6.0, |x: f32| x * x * x / 6.0);
    [outer(1.0 - t), inner(t), inner(1.0 - t), outer(t)]
}

/// A pixel and its neighbours, those at borders repeated.
struct Around([[usize; 3]; 3]);

impl Around {
    fn new([x, y]: [usize; 2], [width, height]: [usize; 2]) -> Self {
        let columns = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
        Self(rows.map(|row| columns.map(|column| row * width + column)))
    }

    fn all(&self) -> impl Iterator<Item = usize> {
        self.0.into_iter().flatten()
    }

    fn mean(&self, colors: &[Color], taps: &[([isize; 2], f32)]) -> Color {
        let mut mean = [0.0; 3];
        for &([x, y], weight) in taps {
            let color = &colors[self.0[(y + 1) as usize][(x + 1) as usize]];
            (0..3).for_each(|c| mean[c] += weight * color[c]);
        }
        mean
    }

    /// Minimum and maximum of each channel.
    fn range(&self, colors: &[Color]) -> [Color; 2] {
        let (mut low, mut high) = ([f32::MAX; 3], [0.0_f32; 3]);
        for i in self.all() {
            for c in 0..3 {
                low[c] = low[c].min(colors[i][c]);
                high[c] = high[c].max(colors[i][c]);
            }
        }
        [low, high]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surfaces::Point;

    const SIZE: [usize; 2] = [16, 12];

    fn camera(eye: Vec3) -> Camera {
        Camera::look_at(eye, Vec3::new(eye.x, eye.y, 0.0), Vec3::Y, 0.5)
    }

    /// Where on a wall at z = 0 a point of the film is seen.
    fn on_wall(camera: &Camera, film: DVec2, size: [usize; 2]) -> Vec3 {
        let ray = camera.central_ray(film, size.map(|side| side as u32)).expect("a flat view");
        (ray.origin - ray.direction * (ray.origin.z / ray.direction.z)).as_vec3()
    }

    fn surfaces(camera: &Camera, offset: [f64; 2]) -> Surfaces {
        let point = |i: usize| {
            let film = DVec2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
            let position = on_wall(camera, film + DVec2::from(offset), SIZE);
            Point { position, normal: Vec3::Z, material: 0, ..Point::default() }
        };
        let points = (0..SIZE[0] * SIZE[1]).map(point).collect();
        Surfaces { camera: camera.clone(), size: SIZE, offset, points }
    }

    fn stripe(x: f32) -> f32 {
        0.5 + 0.4 * (x * 3.0).sin()
    }

    fn edge(x: f32) -> f32 {
        f32::from(x > 0.031)
    }

    /// The picture after some frames of a moving camera, and its mean error.
    fn after(frames: u32, speed: f32, paint: fn(f32) -> f32) -> (History, f32) {
        let mut history: Option<History> = None;
        let mut last = camera(Vec3::ZERO);
        for frame in 0..frames {
            last = camera(Vec3::new(speed * frame as f32, 0.0, 4.0));
            let surfaces = surfaces(&last, offset(frame));
            let colors: Vec<_> = surfaces.points.iter().map(|p| [paint(p.position.x); 3]).collect();
            let fresh = Fresh { surfaces: &surfaces, colors: &colors, is_noisy: &|_| false };
            history = Some(History::next(history.as_ref(), &fresh));
        }
        let history = history.expect("there were frames");
        let (size, rgb) = (history.size, history.rgb());
        let mut sum = 0.0;
        for y in 0..size[1] {
            for x in 0..size[0] {
                let film = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let wanted = paint(on_wall(&last, film, size).x);
                sum += (rgb[(y * size[0] + x) * 3] - wanted).abs();
            }
        }
        let error = sum / (size[0] * size[1]) as f32;
        (history, error)
    }

    #[test]
    fn pictures_of_a_camera_at_rest_become_no_worse() {
        let (one, many) = (after(1, 0.0, stripe).1, after(16, 0.0, stripe).1);
        assert!(many < 1.05 * one, "{many} after {one}");
    }

    #[test]
    fn a_moving_camera_finds_what_it_has_seen() {
        let (first, later) = (after(1, 0.05, stripe).1, after(16, 0.05, stripe).1);
        assert!(later < 2.0 * first, "{later} after {first}");
    }

    #[test]
    fn edges_are_smooth() {
        // The edge crosses one pixel: that has a shade between.
        let (history, _) = after(32, 0.0, edge);
        let row = &history.rgb()[5 * 32 * 3..6 * 32 * 3];
        let shades = row.chunks(3).filter(|pixel| (0.1..0.9).contains(&pixel[0])).count();
        assert!((1..3).contains(&shades), "{row:?}");
        // All rows are alike: nothing is like a comb.
        let columns = |y: usize| history.rgb()[y * 32 * 3..(y + 1) * 32 * 3].to_vec();
        let pairs = columns(5).into_iter().zip(columns(6));
        assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 0.2);
    }

    #[test]
    fn edges_that_move_are_no_combs() {
        fn lamp(x: f32) -> f32 {
            if x > 0.031 { 20.0 } else { 0.05 }
        }
        for paint in [edge as fn(f32) -> f32, lamp] {
            for speed in [0.0, 0.004, 0.01, 0.02, 0.037, 0.05, 0.1] {
                for frames in 16..24 {
                    let rgb = after(frames, speed, paint).0.rgb();
                    let at = |x: usize, y: usize| rgb[(y * 32 + x) * 3].min(1.0);
                    let comb = |x| (at(x, 11) - (at(x, 10) + at(x, 12)) / 2.0).abs();
                    let worst = (0..32).map(comb).fold(0.0, f32::max);
                    assert!(worst < 0.15, "{worst} at {speed} a frame");
                }
            }
        }
    }

    #[test]
    fn a_small_picture_that_is_made_large_has_no_squares() {
        let (history, _) = after(1, 0.0, edge);
        // The largest steps between neighbours: those of a line of squares are those of its edge.
        let [width, height] = [32 * 8, 24 * 8];
        let row: Vec<f32> =
            (0..width).map(|x| history.color([x, height / 2], [width, height])[0]).collect();
        let step = row.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
        assert!((0.02..0.15).contains(&step), "{step}");
        // Weights of either kind make a mean.
        for t in [0.0, 0.3, 0.9] {
            for weights in [sharp(t), smooth(t)] {
                assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{weights:?}");
            }
        }
    }

    #[test]
    fn bright_lamps_keep_their_light() {
        for color in [[0.0; 3], [0.5, 0.2, 0.9], [30.0, 20.0, 10.0]] {
            let again = expanded(compressed(color));
            assert!((0..3).all(|c| (again[c] - color[c]).abs() < 1e-3 * color[c].max(1.0)));
        }
    }
}
