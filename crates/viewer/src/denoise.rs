//! Smoothing of pictures of one sample a pixel, for moving views: an edge-avoiding wavelet filter (Dammertz, Sewtz, Hanika, Lensch
//! 2010, "Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination Filtering"), on light without the surface's colour,
//! as in Schied et al. 2017 ("Spatiotemporal Variance-Guided Filtering", section 4), with edges from normals, depth and material.

use rayon::prelude::*;
use snell_scene::{LayeredImage, Material};

/// Distances between taps double with each pass: these reach 31 pixels to each side.
const PASSES: u32 = 5;
/// Weights of a row of taps.
const TAPS: [f32; 3] = [0.25, 0.5, 0.25];
/// Colours below this are not divided out: there is no light to find under them.
const LEAST_ALBEDO: f32 = 0.02;
/// Light beyond this weighs less and less, so that bright dots do not spread: what is smoothed is `light / (1 + light / KNEE)`.
const KNEE: f32 = 4.0;
/// Power of the cosine between normals.
const NORMAL_POWER: i32 = 32;
/// Relative difference of depth between neighbours that still is one surface.
const DEPTH_TOLERANCE: f32 = 0.02;

/// What decides whether two pixels are of one surface.
#[derive(Clone, Copy)]
struct Feature {
    normal: [f32; 3],
    depth: f32,
    material: f32,
    /// What is seen in it is not its own: mirrors, glass, nothing at all.
    is_sharp: bool,
}

/// Smooths linear RGB values of a picture whose layers are its colours, albedo, normal, depth and material.
pub fn denoise(image: &LayeredImage, materials: &[Material], rgb: &mut [f32]) {
    let [_, albedo, normal, depth, material, ..] = &image.layers[..] else { return };
    let (width, pixels) = (image.width as usize, (image.width * image.height) as usize);
    let feature = |i: usize| {
        let id = material.values[i];
        let is_sharp = id < 0.0 || materials.get(id as usize).is_some_and(is_sharp);
        let normal = [normal.values[i * 3], normal.values[i * 3 + 1], normal.values[i * 3 + 2]];
        Feature { normal, depth: depth.values[i], material: id, is_sharp }
    };
    let features: Vec<Feature> = (0..pixels).into_par_iter().map(feature).collect();
    let color = |i: usize, c: usize| albedo.values[i * 3 + c].max(LEAST_ALBEDO);
    // Bright dots weigh less.
    let mut light: Vec<[f32; 3]> = (0..pixels)
        .into_par_iter()
        .map(|i| {
            let arriving = [0, 1, 2].map(|c| rgb[i * 3 + c] / color(i, c));
            let scale = 1.0 / (1.0 + brightest(arriving) / KNEE);
            arriving.map(|x| if x.is_finite() { x * scale } else { 0.0 })
        })
        .collect();
    let mut next = light.clone();
    for pass in 0..PASSES {
        let step = 1 << pass;
        next.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, out) in row.iter_mut().enumerate() {
                *out = smoothed(&light, &features, [x, y], [width, pixels / width], step);
            }
        });
        std::mem::swap(&mut light, &mut next);
    }
    rgb.par_chunks_exact_mut(3).enumerate().filter(|(i, _)| !features[*i].is_sharp).for_each(|(i, pixel)| {
        let scale = 1.0 / (1.0 - brightest(light[i]) / KNEE).max(1e-3);
        for (c, value) in pixel.iter_mut().enumerate() {
            *value = light[i][c] * scale * color(i, c);
        }
    });
}

fn brightest(light: [f32; 3]) -> f32 {
    light.into_iter().fold(0.0, f32::max)
}

fn is_sharp(material: &Material) -> bool {
    material.is_emissive() || matches!(material.kind.name(), "mirror" | "dielectric" | "conductor")
}

fn smoothed(
    light: &[[f32; 3]],
    features: &[Feature],
    [x, y]: [usize; 2],
    [width, height]: [usize; 2],
    step: usize,
) -> [f32; 3] {
    let here = y * width + x;
    let own = features[here];
    if own.is_sharp {
        return light[here];
    }
    let (mut sum, mut weights) = ([0.0; 3], 0.0);
    for (j, tap_y) in TAPS.iter().enumerate() {
        let Some(row) = (y + j * step).checked_sub(step).filter(|row| *row < height) else { continue };
        for (i, tap_x) in TAPS.iter().enumerate() {
            let Some(column) = (x + i * step).checked_sub(step).filter(|column| *column < width) else { continue };
            let there = row * width + column;
            let weight = tap_x * tap_y * alike(&own, &features[there], step);
            for (sum, value) in sum.iter_mut().zip(light[there]) {
                *sum += weight * value;
            }
            weights += weight;
        }
    }
    // The pixel itself always has a weight.
    sum.map(|s| s / weights)
}

fn alike(a: &Feature, b: &Feature, step: usize) -> f32 {
    if a.material != b.material {
        return 0.0;
    }
    let cos: f32 = a.normal.iter().zip(b.normal).map(|(x, y)| x * y).sum();
    let flat = if a.normal == [0.0; 3] { 1.0 } else { cos.clamp(0.0, 1.0).powi(NORMAL_POWER) };
    let difference = (a.depth - b.depth).abs() / (a.depth.abs() * DEPTH_TOLERANCE * step as f32 + 1e-20);
    // At least a little, so that a pixel is never without weight.
    flat.max(1e-6) * (-difference).exp().max(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::{Rgb, rng};
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
            values: (0..pixels).flat_map(|i| (0..channels).map(move |c| (i, c))).map(|(i, c)| value(i, c)).collect(),
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
        let materials =
            [Material::new("a", Diffuse::new(Rgb::splat(0.5))), Material::new("b", Diffuse::new(Rgb::splat(0.5)))];
        denoise(&image, &materials, &mut rgb);
        let column = |x: usize| (0..64).map(|y| rgb[(y * 64 + x) * 3]).sum::<f32>() / 64.0;
        let (left, right) = (column(31), column(32));
        // The compression of bright dots makes both a little darker.
        assert!((0.42..0.55).contains(&left) && (1.1..1.6).contains(&right), "{left} {right}");
        let spread = (0..64).map(|y| (rgb[(y * 64 + 10) * 3] - column(10)).powi(2)).sum::<f32>() / 64.0;
        assert!(spread.sqrt() < 0.06, "{}", spread.sqrt());
    }

    #[test]
    fn values_that_are_not_finite_do_not_spread() {
        let (image, mut rgb) = walls();
        rgb[3000] = f32::NAN;
        rgb[6000] = f32::INFINITY;
        denoise(&image, &[], &mut rgb);
        assert!(rgb.iter().all(|v| v.is_finite()));
    }
}
