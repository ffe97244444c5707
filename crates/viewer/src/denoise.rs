//! Denoises pictures of one sample per pixel, for moving views: an edge-avoiding wavelet filter
//! (Dammertz, Sewtz, Hanika, Lensch 2010, "Edge-Avoiding À-Trous Wavelet Transform for fast Global
//! Illumination Filtering"), on light divided by albedo, as in Schied et al. 2017 ("Spatiotemporal
//! Variance-Guided Filtering", section 4), with edges from normals, depth and material.

use rayon::prelude::*;
use snell_math::Rgb;
use snell_scene::{LayeredImage, Material};
use std::ops::Range;

/// Number of passes. The distances between taps double with each pass, so that all passes together
/// reach 31 pixels to each side.
const PASSES: u32 = 5;
/// Weights of the three taps of a row.
const TAPS: [f32; 3] = [0.25, 0.5, 0.25];
/// Smaller albedos are not divided out, because they reflect almost no light.
const LEAST_ALBEDO: f32 = 0.02;
/// Light is compressed to `light / (1 + light / KNEE)` before filtering, so that bright dots do not
/// spread.
const KNEE: f32 = 4.0;
/// Maximum relative difference of depth between neighbours on one surface.
const DEPTH_TOLERANCE: f32 = 0.02;

/// Minimum number of rows per thread: waking other threads for fewer takes longer than the work.
const ROWS: usize = 64;

/// A value of every pixel, row by row.
type Plane = Vec<f32>;

/// Data that decides whether two pixels belong to one surface.
struct Surfaces {
    normal: [Plane; 3],
    depth: Plane,
    material: Plane,
    /// 1 where the pixel shows other objects or nothing (mirrors, glass, background), else 0.
    sharp: Plane,
}

/// Denoises the linear RGB values of a picture with the layers colour, albedo, normal, depth and
/// material. `fill` is additional light that surfaces reflect.
pub fn denoise(image: &LayeredImage, materials: &[Material], fill: Rgb, rgb: &mut [f32]) {
    let [_, albedo, normal, depth, material, ..] = &image.layers[..] else { return };
    let (width, pixels) = (image.width as usize, (image.width * image.height) as usize);
    let sharp = |id: &f32| *id < 0.0 || materials.get(*id as usize).is_some_and(is_sharp);
    let surfaces = Surfaces {
        normal: [0, 1, 2].map(|c| normal.values[c..].iter().step_by(3).copied().collect()),
        depth: depth.values.clone(),
        material: material.values.clone(),
        sharp: material.values.iter().map(|id| f32::from(sharp(id))).collect(),
    };
    let color = |i: usize, c: usize| albedo.values[i * 3 + c].max(LEAST_ALBEDO);
    let mut light = [0, 1, 2].map(|_| vec![0.0; pixels]);
    for i in 0..pixels {
        let arriving = [0, 1, 2].map(|c| rgb[i * 3 + c] / color(i, c));
        // Bright dots are compressed, so that they get less weight.
        let scale = 1.0 / (1.0 + brightest(arriving) / KNEE);
        for (plane, x) in light.iter_mut().zip(arriving) {
            plane[i] = if x.is_finite() { x * scale } else { 0.0 };
        }
    }
    let mut next = light.clone();
    for pass in 0..PASSES {
        let [r, g, b] = &mut next;
        let rows =
            r.par_chunks_mut(width).zip(g.par_chunks_mut(width)).zip(b.par_chunks_mut(width));
        let step = 1 << pass;
        rows.enumerate()
            .with_min_len(ROWS)
            .for_each(|(y, ((r, g), b))| smooth_row([r, g, b], &light, &surfaces, y, step));
        std::mem::swap(&mut light, &mut next);
    }
    let fill = fill.to_array();
    rgb.par_chunks_exact_mut(3)
        .with_min_len(1 << 14)
        .enumerate()
        .filter(|(i, _)| surfaces.sharp[*i] == 0.0)
        .for_each(|(i, pixel)| {
            let light = [0, 1, 2].map(|c| light[c][i]);
            let scale = 1.0 / (1.0 - brightest(light) / KNEE).max(1e-3);
            for (c, value) in pixel.iter_mut().enumerate() {
                *value = (light[c] * scale + fill[c]) * color(i, c);
            }
        });
}

fn brightest(light: [f32; 3]) -> f32 {
    light.into_iter().fold(0.0, f32::max)
}

/// True if a surface shows other objects by reflection or refraction, or emits.
pub fn is_sharp(material: &Material) -> bool {
    material.is_emissive() || matches!(material.kind.name(), "mirror" | "dielectric" | "conductor")
}

/// One pass over a row, tap by tap: plain loops that the compiler vectorises.
fn smooth_row(to: [&mut [f32]; 3], light: &[Plane; 3], surfaces: &Surfaces, y: usize, step: usize) {
    let (width, pixels) = (to[0].len(), light[0].len());
    let mut sums = [0, 1, 2].map(|_| vec![0.0; width]);
    let mut weights = vec![0.0; width];
    for (j, tap_y) in TAPS.iter().enumerate() {
        let Some(row) = (y + j * step).checked_sub(step).filter(|row| row * width < pixels) else {
            continue;
        };
        for (i, tap_x) in TAPS.iter().enumerate() {
            // The columns whose neighbour is inside the picture.
            let first = step.saturating_sub(i * step).min(width);
            let last = (width + step).saturating_sub(i * step).clamp(first, width);
            let (here, there) =
                (y * width + first, (row * width + first + i * step).saturating_sub(step));
            let count = last - first;
            let taps = Taps {
                here: here..here + count,
                there: there..there + count,
                weight: tap_x * tap_y,
                step,
            };
            let [r, g, b] = &mut sums;
            let sums = [&mut r[first..last], &mut g[first..last], &mut b[first..last]];
            taps.add(light, surfaces, sums, &mut weights[first..last]);
        }
    }
    for ((to, sums), light) in to.into_iter().zip(&sums).zip(light) {
        let own = &light[y * width..][..width];
        let sharp = &surfaces.sharp[y * width..][..width];
        for i in 0..width {
            // The centre pixel always has a weight.
            to[i] = if sharp[i] == 0.0 { sums[i] / weights[i] } else { own[i] };
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
    fn add(
        self,
        light: &[Plane; 3],
        surfaces: &Surfaces,
        sums: [&mut [f32]; 3],
        weights: &mut [f32],
    ) {
        let Self { here, there, weight, step } = self;
        let count = here.len();
        let [nx, ny, nz] = [0, 1, 2]
            .map(|c| (&surfaces.normal[c][here.clone()], &surfaces.normal[c][there.clone()]));
        let depth = (&surfaces.depth[here.clone()], &surfaces.depth[there.clone()]);
        let material = (&surfaces.material[here], &surfaces.material[there.clone()]);
        let [r, g, b] = [0, 1, 2].map(|c| &light[c][there.clone()]);
        let [to_r, to_g, to_b] = sums;
        let tolerance = DEPTH_TOLERANCE * step as f32;
        for i in 0..count {
            // The weight of the normals is the 32nd power of the cosine between them.
            let cos = nx.0[i] * nx.1[i] + ny.0[i] * ny.1[i] + nz.0[i] * nz.1[i];
            let cos = if cos > 0.0 { cos } else { 0.0 };
            let c4 = cos * cos * (cos * cos);
            let c16 = c4 * c4 * (c4 * c4);
            // Without a normal, all neighbours are accepted.
            let has_normal = nx.0[i] != 0.0 || ny.0[i] != 0.0 || nz.0[i] != 0.0;
            let flat = if has_normal { c16 * c16 } else { 1.0 };
            let difference =
                (depth.0[i] - depth.1[i]).abs() / (depth.0[i].abs() * tolerance + 1e-20);
            // The weight of the depth approximates exp(-difference), and is 0 from 4 on.
            let near = 1.0 - 0.25 * difference;
            let near = if near > 0.0 { near } else { 0.0 };
            let near = near * near * (near * near);
            // A small minimum keeps the weight of every pixel positive.
            let flat = if flat > 1e-6 { flat } else { 1e-6 };
            let near = if near > 1e-6 { near } else { 1e-6 };
            let share = if material.0[i] == material.1[i] { weight * flat * near } else { 0.0 };
            to_r[i] += share * r[i];
            to_g[i] += share * g[i];
            to_b[i] += share * b[i];
            weights[i] += share;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng;
    use snell_scene::Layer;
    use snell_scene::material::Diffuse;

    /// Two walls side by side, of different material, lit by noise of mean 1 and 3.
    fn walls() -> (LayeredImage, Vec<f32>) {
        let (width, height) = (64, 64);
        let side = |i: usize| if i % width < width / 2 { 0.0_f32 } else { 1.0 };
        let pixels = width * height;
        let layer = |name: &str, channels: usize, value: &dyn Fn(usize, usize) -> f32| Layer {
            name: name.into(),
            channels: vec!["V".into(); channels],
            values: (0..pixels)
                .flat_map(|i| (0..channels).map(move |c| (i, c)))
                .map(|(i, c)| value(i, c))
                .collect(),
        };
        let noise = |i: usize| 2.0 * rng::to_unit(rng::hash32(i as u32)) * (1.0 + 2.0 * side(i));
        let colors = layer("", 3, &|i, _| noise(i) * 0.5);
        let rgb = colors.values.clone();
        let layers = vec![
            colors,
            layer("albedo", 3, &|_, _| 0.5),
            layer("normal", 3, &|_, c| f32::from(c == 2)),
            layer("depth", 1, &|_, _| 5.0),
            layer("material-id", 1, &|i, _| side(i)),
        ];
        (LayeredImage { width: 64, height: 64, layers, metadata: Vec::new() }, rgb)
    }

    #[test]
    fn noise_goes_and_edges_between_materials_stay() {
        let (image, mut rgb) = walls();
        let materials = [
            Material::new("a", Diffuse::new(Rgb::splat(0.5))),
            Material::new("b", Diffuse::new(Rgb::splat(0.5))),
        ];
        denoise(&image, &materials, Rgb::BLACK, &mut rgb);
        let column = |x: usize| (0..64).map(|y| rgb[(y * 64 + x) * 3]).sum::<f32>() / 64.0;
        let (left, right) = (column(31), column(32));
        // The compression of bright dots darkens both slightly.
        assert!((0.42..0.55).contains(&left) && (1.1..1.6).contains(&right), "{left} {right}");
        let spread =
            (0..64).map(|y| (rgb[(y * 64 + 10) * 3] - column(10)).powi(2)).sum::<f32>() / 64.0;
        assert!(spread.sqrt() < 0.06, "{}", spread.sqrt());
    }

    #[test]
    fn values_that_are_not_finite_do_not_spread() {
        let (image, mut rgb) = walls();
        rgb[3000] = f32::NAN;
        rgb[6000] = f32::INFINITY;
        denoise(&image, &[], Rgb::BLACK, &mut rgb);
        assert!(rgb.iter().all(|v| v.is_finite()));
    }
}
