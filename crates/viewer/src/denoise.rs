//! Smooths light over surfaces: an edge-avoiding wavelet filter (Dammertz, Sewtz, Hanika, Lensch
//! 2010, "Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination Filtering"), on
//! light divided by albedo, as in Schied et al. 2017 ("Spatiotemporal Variance-Guided Filtering",
//! section 4), with edges from normals, planes and materials. Every value counts by a weight of its
//! own, so that values are also carried to where there are none (Knutsson and Westin 1993,
//! "Normalized and Differential Convolution").

use crate::surfaces::{Color, Surfaces};
use rayon::prelude::*;
use std::ops::Range;

/// Weights of the three taps of a row.
const TAPS: [f32; 3] = [0.25, 0.5, 0.25];
/// How far neighbours on one surface may lie from each other's plane, relative to their distance
/// from the eye, per pixel between them.
const FLATNESS: f32 = 0.002;
/// Minimum number of rows per thread: waking other threads for fewer takes longer than the work.
const ROWS: usize = 32;

/// A value of every pixel, row by row.
type Plane = Vec<f32>;

/// The data that decide whether two pixels belong to one surface.
pub struct Guide {
    width: usize,
    position: [Plane; 3],
    normal: [Plane; 3],
    /// Distance from the eye.
    distance: Plane,
    material: Plane,
}

impl Guide {
    /// The guide for light on some of the points of a picture: those with these numbers, in rows of
    /// `width`.
    pub fn new(surfaces: &Surfaces, width: usize, numbers: &[usize]) -> Self {
        let eye = surfaces.eye().as_vec3();
        let points = || numbers.par_iter().with_min_len(1 << 12).map(|&i| &surfaces.points[i]);
        Self {
            width,
            position: [0, 1, 2].map(|c| points().map(|p| p.position[c]).collect()),
            normal: [0, 1, 2].map(|c| points().map(|p| p.normal[c]).collect()),
            distance: points().map(|p| (p.position - eye).length()).collect(),
            material: points().map(|p| p.material as f32).collect(),
        }
    }

    /// Smooths values that count by their weights, in passes. The distances between taps double
    /// with each pass, so that n passes reach 2^n - 1 pixels to each side. Where nothing is near
    /// that has a weight, the weight stays 0.
    pub fn smooth(&self, values: &mut [Color], weights: &mut [f32], passes: u32) {
        let width = self.width.max(1);
        let plane = |c: usize| values.iter().map(|v| v[c]).collect::<Plane>();
        // Values are kept multiplied by their weights.
        let mut light = [plane(0), plane(1), plane(2), weights.to_vec()];
        for plane in 0..3 {
            let (colors, weights) = light.split_at_mut(3);
            for (value, weight) in colors[plane].iter_mut().zip(&weights[0]) {
                *value = if *weight > 0.0 && value.is_finite() { *value * weight } else { 0.0 };
            }
        }
        let mut next = light.clone();
        for pass in 0..passes {
            let [r, g, b, w] = &mut next;
            let rows = r.par_chunks_mut(width).zip(g.par_chunks_mut(width));
            let rows = rows.zip(b.par_chunks_mut(width)).zip(w.par_chunks_mut(width)).enumerate();
            rows.with_min_len(ROWS).for_each(|(y, (((r, g), b), w))| {
                self.smooth_row([r, g, b, w], &light, y, 1 << pass);
            });
            std::mem::swap(&mut light, &mut next);
        }
        for (i, (value, weight)) in values.iter_mut().zip(weights).enumerate() {
            *weight = light[3][i];
            if *weight > 0.0 {
                *value = [0, 1, 2].map(|c| light[c][i] / *weight);
            }
        }
    }

    /// One pass over a row, tap by tap: plain loops that the compiler vectorises.
    fn smooth_row(&self, to: [&mut [f32]; 4], light: &[Plane; 4], y: usize, step: usize) {
        let (width, pixels) = (to[0].len(), light[0].len());
        let mut sums = [0, 1, 2, 3].map(|_| vec![0.0; width]);
        let mut shares = vec![0.0; width];
        for (j, tap_y) in TAPS.iter().enumerate() {
            let Some(row) = (y + j * step).checked_sub(step).filter(|row| row * width < pixels)
            else {
                continue;
            };
            for (i, tap_x) in TAPS.iter().enumerate() {
                // The columns whose neighbour is inside the picture.
                let first = step.saturating_sub(i * step).min(width);
                let last = (width + step).saturating_sub(i * step).clamp(first, width);
                if first == last {
                    continue;
                }
                let (here, there) =
                    (y * width + first, (row * width + first + i * step).saturating_sub(step));
                let count = last - first;
                let taps = Taps {
                    here: here..here + count,
                    there: there..there + count,
                    weight: tap_x * tap_y,
                    step,
                };
                let [r, g, b, w] = &mut sums;
                let sums = [
                    &mut r[first..last],
                    &mut g[first..last],
                    &mut b[first..last],
                    &mut w[first..last],
                ];
                taps.add(light, self, sums, &mut shares[first..last]);
            }
        }
        for (to, sums) in to.into_iter().zip(&sums) {
            for i in 0..width {
                // The centre pixel always has a share.
                to[i] = sums[i] / shares[i];
            }
        }
    }
}

/// A tap for consecutive pixels of a row: each pixel and its neighbour at one offset.
struct Taps {
    here: Range<usize>,
    there: Range<usize>,
    weight: f32,
    step: usize,
}

impl Taps {
    fn add(self, light: &[Plane; 4], guide: &Guide, sums: [&mut [f32]; 4], shares: &mut [f32]) {
        let Self { here, there, weight, step } = self;
        let count = here.len();
        let pair = |plane| both(plane, &here, &there);
        let [nx, ny, nz] = guide.normal.each_ref().map(pair);
        let [px, py, pz] = guide.position.each_ref().map(pair);
        let distance = &guide.distance[here.clone()];
        let material = pair(&guide.material);
        let [r, g, b, w] = light.each_ref().map(|plane| &plane[there.clone()]);
        let [to_r, to_g, to_b, to_w] = sums;
        let tolerance = FLATNESS * step as f32;
        for i in 0..count {
            // The weight of the normals is the 32nd power of the cosine between them.
            let cos = nx[0][i] * nx[1][i] + ny[0][i] * ny[1][i] + nz[0][i] * nz[1][i];
            let cos = if cos > 0.0 { cos } else { 0.0 };
            let c4 = cos * cos * (cos * cos);
            let c16 = c4 * c4 * (c4 * c4);
            // Without a normal, all neighbours are accepted.
            let has_normal = nx[0][i] != 0.0 || ny[0][i] != 0.0 || nz[0][i] != 0.0;
            let flat = if has_normal { c16 * c16 } else { 1.0 };
            let (dx, dy, dz) = (px[1][i] - px[0][i], py[1][i] - py[0][i], pz[1][i] - pz[0][i]);
            let off = (dx * nx[0][i] + dy * ny[0][i] + dz * nz[0][i]).abs();
            // The weight of the plane approximates exp(-ratio), and is 0 from 4 on.
            let near = 1.0 - 0.25 * (off / (distance[i] * tolerance + 1e-20));
            let near = if near > 0.0 { near } else { 0.0 };
            let near = near * near * (near * near);
            // A small minimum keeps the share of every pixel positive.
            let flat = if flat > 1e-6 { flat } else { 1e-6 };
            let near = if near > 1e-6 { near } else { 1e-6 };
            let share = if material[0][i] == material[1][i] { weight * flat * near } else { 0.0 };
            to_r[i] += share * r[i];
            to_g[i] += share * g[i];
            to_b[i] += share * b[i];
            to_w[i] += share * w[i];
            shares[i] += share;
        }
    }
}

/// The values of a plane at both ends of a tap.
fn both<'p>(plane: &'p Plane, here: &Range<usize>, there: &Range<usize>) -> [&'p [f32]; 2] {
    [&plane[here.clone()], &plane[there.clone()]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surfaces::Point;
    use snell_math::{Vec3, rng};
    use snell_scene::Camera;

    const SIZE: usize = 64;

    /// Two walls side by side, of different material, with noise of mean 1 and 3.
    fn walls() -> (Surfaces, Vec<Color>) {
        let side = |i: usize| i % SIZE / (SIZE / 2);
        let point = |i: usize| Point {
            position: Vec3::new((i % SIZE) as f32, (i / SIZE) as f32, -60.0) * 0.1,
            normal: Vec3::Z,
            material: side(i) as i32,
            ..Point::default()
        };
        let camera = Camera::look_at(Vec3::ZERO, -Vec3::Z, Vec3::Y, 0.5);
        let points = (0..SIZE * SIZE).map(point).collect();
        let noise = |i: usize| rng::to_unit(rng::hash32(i as u32)) * (2 + 4 * side(i)) as f32;
        let light = (0..SIZE * SIZE).map(|i| [noise(i); 3]).collect();
        (Surfaces { camera, size: [SIZE; 2], offset: [0.5; 2], points }, light)
    }

    fn smooth(surfaces: &Surfaces, light: &mut [Color], weights: &mut [f32]) {
        let all: Vec<usize> = (0..surfaces.count()).collect();
        Guide::new(surfaces, SIZE, &all).smooth(light, weights, 5);
    }

    #[test]
    fn noise_goes_and_edges_between_materials_stay() {
        let (surfaces, mut light) = walls();
        smooth(&surfaces, &mut light, &mut [1.0; SIZE * SIZE]);
        let column = |x: usize| (0..SIZE).map(|y| light[y * SIZE + x][0]).sum::<f32>() / 64.0;
        let (left, right) = (column(31), column(32));
        assert!((0.93..1.07).contains(&left) && (2.8..3.2).contains(&right), "{left} {right}");
        let mean = column(10);
        let spread = (0..SIZE).map(|y| (light[y * SIZE + 10][0] - mean).powi(2)).sum::<f32>();
        assert!((spread / 64.0).sqrt() < 0.08, "{spread}");
    }

    #[test]
    fn values_are_carried_to_where_there_are_none_on_the_same_surface() {
        let (surfaces, mut light) = walls();
        let mut weights = vec![0.0; light.len()];
        light.fill([f32::NAN; 3]);
        (light[20 * SIZE + 20], weights[20 * SIZE + 20]) = ([5.0; 3], 1.0);
        smooth(&surfaces, &mut light, &mut weights);
        assert!((light[24 * SIZE + 28][0] - 5.0).abs() < 1e-3 && weights[24 * SIZE + 28] > 0.0);
        assert_eq!(weights[24 * SIZE + 34], 0.0);
    }
}
