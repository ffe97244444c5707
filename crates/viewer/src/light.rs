//! Light on surfaces: what arrives at the points that a picture shows. Light on matte surfaces is
//! the same from everywhere, so that of one picture is that of the next, which shows most of the
//! same points from another place.

use crate::denoise::Guide;
use crate::surfaces::{Color, PIXELS, Point, Surfaces};
use rayon::prelude::*;
use std::sync::Arc;

/// Light arriving at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// Radiance over albedo, see [`Point::light`].
    pub light: Color,
    /// The number of samples on which it rests; 0 if it is not known.
    pub trust: f32,
}

/// Light at the points of a picture.
pub struct Lit {
    /// The points.
    pub surfaces: Arc<Surfaces>,
    /// The light at each of them.
    pub known: Vec<Known>,
}

impl Lit {
    /// The light at a point, if this picture shows its surroundings.
    pub fn at(&self, point: &Point) -> Known {
        let Some(place) = self.surfaces.place(point.position) else { return Known::default() };
        let tolerance = self.surfaces.tolerance(point);
        let (mut light, mut trust, mut sum) = ([0.0; 3], 0.0, 0.0);
        for (i, share) in self.surfaces.around(place) {
            let known = &self.known[i];
            if share > 0.0
                && known.trust > 0.0
                && point.continues(&self.surfaces.points[i], tolerance)
            {
                (0..3).for_each(|c| light[c] += share * known.light[c]);
                trust += share * known.trust;
                sum += share;
            }
        }
        if sum < 1e-3 {
            return Known::default();
        }
        Known { light: light.map(|c| c / sum), trust: trust / sum }
    }
}

/// Every second pixel of every second row of a picture: those that get new samples.
pub struct Quarter {
    /// Width and height.
    pub size: [usize; 2],
    /// The pixels of the picture, row by row.
    pub numbers: Vec<usize>,
    /// Column and row of the first.
    first: [usize; 2],
    width: usize,
}

/// The light samples of a quarter: radiance over albedo, where one was taken.
pub type Samples = Vec<Option<Color>>;

/// What light is worth after the scene has changed. Everything that is found counts at least 1.
pub const CHANGED: f32 = 0.5;
/// Light from before a change is limited to this multiple of what new samples find: what is
/// brighter would be seen long after what has lit it is gone.
const BRIGHTEST_BEFORE: f32 = 4.0;
/// How much new samples count, at least.
const LEAST_SHARE: f32 = 0.08;
/// Samples are limited to this multiple of the light around them: fewer would never grow quiet.
const BRIGHTEST: f32 = 12.0;
/// Samples that are limited together lie in squares of this size.
const SQUARE: usize = 8;
/// Passes of the filter for what the samples say: on surfaces, and in media, where it knows no
/// edges.
const PASSES: [u32; 2] = [5, 2];

/// The passes of the filter, at most `most`.
pub fn passes(most: u32, has_media: bool) -> u32 {
    most.min(PASSES[usize::from(has_media)])
}

impl Quarter {
    /// The quarter of a picture of this size, even in both directions, that begins at a pixel.
    pub fn new([width, height]: [usize; 2], first: [usize; 2]) -> Self {
        let size = [width / 2, height / 2];
        let rows = (0..size[1]).map(|y| (2 * y + first[1]) * width + first[0]);
        let numbers = rows.flat_map(|row| (0..size[0]).map(move |x| row + 2 * x)).collect();
        Self { size, numbers, first, width }
    }

    /// Where a sample at `offset` in a pixel of the picture lies in a pixel of the quarter.
    pub fn offset(&self, offset: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| (self.first[axis] as f64 + offset[axis]) / 2.0)
    }

    /// What is known of the light after new samples. Where it was known, the smoothed difference of
    /// the samples corrects it, which keeps shadows sharp; elsewhere, it is that of samples and
    /// surroundings. Points with endless trust stay as they are.
    pub fn update(&self, surfaces: &Surfaces, known: &mut [Known], samples: &Samples, passes: u32) {
        let mut lights: Vec<Color> = samples.iter().map(|s| s.unwrap_or_default()).collect();
        let taken: Vec<f32> = samples.iter().map(|s| f32::from(s.is_some())).collect();
        limit(&mut lights, &taken, self.size[0], |i| known[self.numbers[i]].light);
        let sample = |i: usize| (taken[i] > 0.0).then_some(lights[i]);
        let usual = Usual::new(&lights, &taken, self.size[0]);
        if usual.all > 0.0 {
            let is_old = |known: &Known| known.trust > 0.0 && known.trust <= CHANGED;
            for (i, known) in known.iter_mut().enumerate().filter(|(_, known)| is_old(known)) {
                let near = i / self.width / 2 * self.size[0] + i % self.width / 2;
                let most = BRIGHTEST_BEFORE * usual.at(near).max(usual.all);
                known.light = limited(known.light, most);
            }
        }
        let guide = Guide::new(surfaces, self.size[0], &self.numbers);
        let of = |i: usize| known[self.numbers[i]];
        let count = self.numbers.len();
        let (mut errors, mut weights) = (vec![[0.0; 3]; count], vec![0.0; count]);
        for i in 0..count {
            let before = of(i);
            let is_open = before.trust > 0.0 && before.trust.is_finite();
            if let Some(light) = sample(i).filter(|_| is_open) {
                errors[i] = [0, 1, 2].map(|c| light[c] - before.light[c]);
                weights[i] = 1.0;
            }
        }
        guide.smooth(&mut errors, &mut weights, passes);
        let share = |trust: f32| (1.0 / (trust + 1.0)).max(LEAST_SHARE);
        let corrected = |known: Known, error: Color| Known {
            light: [0, 1, 2].map(|c| known.light[c] + share(known.trust) * error[c]),
            trust: known.trust + 1.0,
        };
        let (mut all, mut certain) = (vec![[0.0; 3]; count], vec![0.0; count]);
        for i in 0..count {
            let before = of(i);
            (all[i], certain[i]) = match sample(i) {
                _ if before.trust == f32::INFINITY => (before.light, 16.0),
                _ if before.trust > 0.0 && weights[i] > 0.0 => {
                    (corrected(before, errors[i]).light, before.trust.min(16.0))
                }
                _ if before.trust > 0.0 => (before.light, before.trust.min(16.0)),
                Some(light) => (light, 1.0),
                None => ([0.0; 3], 0.0),
            };
        }
        let own = all.clone();
        guide.smooth(&mut all, &mut certain, passes);
        // What is known is a better guess for its neighbours than the mean of a large area.
        for i in (0..count).filter(|&i| of(i).trust > 0.0) {
            all[i] = own[i];
        }
        let between = |point: usize, values: &[Color], weights: &[f32]| {
            self.between(surfaces, point, values, weights)
        };
        known.par_iter_mut().enumerate().with_min_len(PIXELS / 4).for_each(|(i, known)| {
            if known.trust == 0.0 {
                if let Some(light) = between(i, &all, &certain) {
                    *known = Known { light, trust: 1.0 };
                }
            } else if known.trust.is_finite()
                && let Some(error) = between(i, &errors, &weights)
            {
                *known = corrected(*known, error);
            }
        });
    }

    /// The value for a pixel of the picture, from those of the quarter around it that lie on the
    /// same surface.
    fn between(
        &self,
        surfaces: &Surfaces,
        pixel: usize,
        values: &[Color],
        weights: &[f32],
    ) -> Option<Color> {
        let point = &surfaces.points[pixel];
        let tolerance = surfaces.tolerance(point);
        let at = [pixel % self.width, pixel / self.width];
        let low = [0, 1].map(|axis| (at[axis] + 2 - self.first[axis]) / 2);
        let (mut light, mut sum) = ([0.0; 3], 0.0);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let [x, y] = [low[0] + dx, low[1] + dy];
            // One is added above, so that nothing is negative.
            let (Some(x), Some(y)) = (x.checked_sub(1), y.checked_sub(1)) else { continue };
            if x >= self.size[0] || y >= self.size[1] {
                continue;
            }
            let i = y * self.size[0] + x;
            if weights[i] > 0.0 && point.continues(&surfaces.points[self.numbers[i]], tolerance) {
                let apart =
                    |x: usize, axis: usize| (2 * x + self.first[axis]).abs_diff(at[axis]) as f32;
                let share = (2.1 - apart(x, 0)).max(0.1) * (2.1 - apart(y, 1)).max(0.1);
                (0..3).for_each(|c| light[c] += share * values[i][c]);
                sum += share;
            }
        }
        (sum > 0.0).then(|| light.map(|c| c / sum))
    }
}

/// Limits values that are much brighter than all around, in rows of `width`: they come from rare
/// paths, and the light that these stand for is spread over more time. Values of weight 0 do not
/// count, and what is `known` of the light at a value is never too bright.
pub fn limit(
    values: &mut [Color],
    weights: &[f32],
    width: usize,
    known: impl Fn(usize) -> Color + Sync,
) {
    let usual = Usual::new(values, weights, width);
    values.par_iter_mut().enumerate().with_min_len(PIXELS).for_each(|(i, value)| {
        let usual = brightest(known(i)).max(usual.at(i));
        *value = limited(*value, BRIGHTEST * usual);
    });
}

/// How bright values are around each place, in rows of `width`.
struct Usual {
    width: usize,
    /// The mean in each square; 0 where no value counts.
    squares: Vec<f32>,
    /// The mean of all.
    all: f32,
}

impl Usual {
    fn new(values: &[Color], weights: &[f32], width: usize) -> Self {
        let rows = (values.len() / width.max(1)).div_ceil(SQUARE);
        let mut sums = vec![(0.0_f32, 0.0_f32); width.div_ceil(SQUARE) * rows];
        for (i, value) in values.iter().enumerate().filter(|(i, _)| weights[*i] > 0.0) {
            let (sum, count) = &mut sums[Self::square(i, width)];
            (*sum, *count) = (*sum + brightest(*value), *count + 1.0);
        }
        let mean = |(sum, count): (f32, f32)| sum / count.max(1.0);
        let all = sums.iter().fold((0.0, 0.0), |all, one| (all.0 + one.0, all.1 + one.1));
        Self { width, squares: sums.into_iter().map(mean).collect(), all: mean(all) }
    }

    fn square(i: usize, width: usize) -> usize {
        i / width / SQUARE * width.div_ceil(SQUARE) + i % width / SQUARE
    }

    fn at(&self, i: usize) -> f32 {
        self.squares[Self::square(i, self.width)]
    }
}

fn brightest(light: Color) -> f32 {
    light.into_iter().fold(0.0, f32::max)
}

/// Light that is at most so bright, of the same hue.
fn limited(light: Color, most: f32) -> Color {
    let scale = (most / brightest(light).max(1e-20)).min(1.0);
    light.map(|c| c * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::{Vec3, rng};
    use snell_scene::Camera;

    const SIZE: [usize; 2] = [32, 24];

    /// A wall with a step of light in the middle, seen from a place.
    fn wall(eye: Vec3) -> Lit {
        let camera = Camera::look_at(eye, Vec3::new(eye.x, eye.y, 0.0), Vec3::Y, 0.5);
        let point = |i: usize| {
            let [x, y] = [i % SIZE[0], i / SIZE[0]].map(|p| p as f64 + 0.5);
            let size = SIZE.map(|side| side as u32);
            let ray = camera.central_ray([x, y].into(), size).expect("a flat view");
            let at = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
            Point { position: at.as_vec3(), normal: Vec3::Z, material: 0, ..Point::default() }
        };
        let points: Vec<Point> = (0..SIZE[0] * SIZE[1]).map(point).collect();
        let lit = |p: &Point| Known { light: [step(p.position.x); 3], trust: 4.0 };
        let known = points.iter().map(lit).collect();
        let surfaces = Arc::new(Surfaces { camera, size: SIZE, offset: [0.5; 2], points });
        Lit { surfaces, known }
    }

    fn step(x: f32) -> f32 {
        if x < 0.0 { 1.0 } else { 3.0 }
    }

    #[test]
    fn light_stays_on_its_surface_when_the_camera_moves() {
        let (before, now) = (wall(Vec3::new(0.0, 0.0, 4.0)), wall(Vec3::new(0.3, 0.1, 3.5)));
        let found: Vec<_> = now.surfaces.points.iter().map(|point| before.at(point)).collect();
        let is_right = |(found, wanted): (&Known, &Known)| {
            found.trust > 0.0 && (found.light[0] - wanted.light[0]).abs() < 0.5
        };
        let right = found.iter().zip(&now.known).filter(|pair| is_right(*pair)).count();
        assert!(right > SIZE[0] * SIZE[1] * 9 / 10, "{right}");
        // Another material is another surface.
        let other = Point { material: 1, ..now.surfaces.points[400] };
        assert_eq!(before.at(&other).trust, 0.0);
    }

    #[test]
    fn samples_correct_the_light_and_keep_its_shadows() {
        let mut lit = wall(Vec3::new(0.0, 0.0, 4.0));
        let truth: Vec<f32> = lit.known.iter().map(|k| k.light[0] + 1.0).collect();
        let row = 12 * SIZE[0];
        for frame in 0..40_u32 {
            let quarter = Quarter::new(SIZE, [frame as usize % 2, frame as usize / 2 % 2]);
            let noise = |i: usize| 2.0 * rng::to_unit(rng::hash_combine(frame, i as u32));
            let samples = quarter.numbers.iter().map(|&i| Some([truth[i] * noise(i); 3])).collect();
            quarter.update(&lit.surfaces, &mut lit.known, &samples, 5);
        }
        for x in 4..28 {
            let (found, wanted) = (lit.known[row + x].light[0], truth[row + x]);
            assert!((found - wanted).abs() < 0.35, "{x}: {found} and not {wanted}");
        }
        // What is unknown is found from around.
        lit.known[row + 5] = Known::default();
        let quarter = Quarter::new(SIZE, [0, 0]);
        let nothing = vec![None; quarter.numbers.len()];
        quarter.update(&lit.surfaces, &mut lit.known, &nothing, 5);
        assert!((lit.known[row + 5].light[0] - truth[row + 5]).abs() < 0.5);
        let fixed = Known { light: [7.0; 3], trust: f32::INFINITY };
        lit.known[row + 5] = fixed;
        quarter.update(&lit.surfaces, &mut lit.known, &nothing, 5);
        assert_eq!(lit.known[row + 5], fixed);
    }
}
