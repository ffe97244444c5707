//! Bump maps as normal maps.

use snell_math::{Rgb, Vec3};
use snell_scene::{Image, ImageTexture};

/// The normal map of a picture of heights, `height` for white, and its steepest slope: height over the width of the whole picture. The
/// map shows slopes relative to the steepest, so its scale is that slope over the width of the picture in the scene. `None` for a flat
/// one.
pub fn normal_map_of(heights: &Image, texture: &ImageTexture, height: f32) -> Option<(Image, f32)> {
    let (w, h) = (heights.width, heights.height);
    let at = |x: u32, y: u32| {
        let [r, g, b, _] = heights.rgba_as(x % w, y % h, texture.encoding);
        height * if heights.channels <= 2 { r } else { Rgb::new(r, g, b).luminance() }
    };
    let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
    let slopes: Vec<[f32; 2]> = pixels
        .map(|(x, y)| {
            let along = (at(x + 1, y) - at(x + w - 1, y)) * 0.5 * w as f32;
            // Rows run downwards, the map's second axis upwards.
            let up = (at(x, y + h - 1) - at(x, y + 1)) * 0.5 * h as f32;
            [along, up].map(|s| if s.is_finite() { s } else { 0.0 })
        })
        .collect();
    let steepest = slopes.iter().flatten().fold(0.0f32, |most, s| most.max(s.abs()));
    if steepest == 0.0 {
        return None;
    }
    let normal = |[x, y]: &[f32; 2]| Vec3::new(-x / steepest, -y / steepest, 1.0).normalize() * 0.5 + 0.5;
    let values = slopes.iter().flat_map(|s| normal(s).to_array()).collect();
    Some((Image::from_f32(w, h, 3, values), steepest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_scene::Encoding;
    use snell_scene::graph::ImageId;

    #[test]
    fn a_ramp_leans_against_its_rise() {
        let ramp = Image::from_f32(4, 2, 1, [0.0, 0.25, 0.5, 0.75].repeat(2));
        let texture = ImageTexture::new(ImageId(0), Encoding::Linear);
        let (map, slope) = normal_map_of(&ramp, &texture, 2.0).expect("a slope");
        let [r, g, b, _] = map.rgba(1, 0);
        let normal = Vec3::new(r, g, b) * 2.0 - 1.0;
        // Two units of height over the width of the picture, the other way at the seam.
        let shown = -normal.x / normal.z * slope;
        assert!((shown - 2.0).abs() < 1e-5 && normal.y.abs() < 1e-6, "{shown} {normal}");
        assert!(normal_map_of(&Image::from_f32(2, 2, 1, vec![0.5; 4]), &texture, 1.0).is_none());
    }
}
