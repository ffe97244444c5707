//! A hint for pictures that show nothing because they are far too dark or too bright.

use snell_math::real;
use snell_scene::Layer;

/// Values below this are black on a screen.
const BLACK: f64 = 0.002;

/// The share of pixels that may show something in a picture that gets a hint.
const SHOWN: f64 = 0.002;

/// What to do about a picture that is black or white nearly everywhere at this exposure (in stops);
/// `None` if it is not. Pixels of alpha 0 do not count.
pub fn exposure_hint(picture: &Layer, exposure: f64) -> Option<String> {
    let channels = picture.channels.len();
    let factor = real::exp2(exposure);
    let (mut pixels, mut dark, mut bright, mut sum) = (0_u64, 0_u64, 0_u64, 0.0);
    for pixel in picture.values.chunks_exact(channels.max(3)) {
        if pixel.get(3).is_some_and(|&alpha| alpha == 0.0) {
            continue;
        }
        let of = |f: fn(f32, f32) -> f32| f64::from(f(f(pixel[0], pixel[1]), pixel[2]));
        let (least, most) = (of(f32::min), of(f32::max));
        pixels += 1;
        sum += most;
        dark += u64::from(most * factor < BLACK);
        bright += u64::from(least * factor > 1.001);
    }
    let most_are = |count: u64| count as f64 >= (1.0 - SHOWN) * pixels.max(1) as f64;
    let stops = real::log2(0.4 * pixels as f64 / sum).round();
    if most_are(dark) && sum == 0.0 {
        let hint = "the picture is black: no light reaches the camera, which may be inside of \
            something; `snell doctor` may say why, and --environment sky adds light";
        return Some(hint.into());
    }
    let helps = |up: bool| stops.is_finite() && (stops > exposure) == up && stops != exposure;
    if most_are(dark) && helps(true) {
        return Some(format!("nearly all of the picture is black; --exposure {stops} shows more"));
    }
    let is_white = most_are(bright) && helps(false);
    is_white.then(|| format!("nearly all of the picture is white; --exposure {stops} shows more"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hint(values: &[f32], channels: usize, exposure: f64) -> String {
        let channels = ["R", "G", "B", "A"][..channels].iter().map(|c| c.to_string()).collect();
        let layer = Layer { name: String::new(), channels, values: values.to_vec() };
        exposure_hint(&layer, exposure).unwrap_or_default()
    }

    #[test]
    fn pictures_that_show_nothing_are_told() {
        assert_eq!(hint(&[0.5, 0.2, 0.1, 0.0, 0.0, 0.0], 3, 0.0), "");
        assert!(hint(&[0.0; 6], 3, 0.0).contains("no light reaches the camera"));
        assert!(hint(&[1e-3, 0.0, 0.0, 0.0, 0.0, 0.0], 3, 0.0).contains("--exposure 10 "));
        assert_eq!(hint(&[1e-3, 0.0, 0.0, 0.0, 0.0, 0.0], 3, 9.0), "");
        assert!(hint(&[50.0; 12], 3, 0.0).contains("white; --exposure -7 "));
        assert_eq!(hint(&[1.0; 12], 3, 0.0), "", "a furnace");
        let mut spark = vec![0.0; 3_000_000];
        spark[0] = 1e7;
        assert_eq!(hint(&spark, 3, 0.0), "", "less light would not show more");
        assert_eq!(hint(&[0.0; 8], 4, 0.0), "", "nothing in front of nothing");
        assert_eq!(hint(&[0.4, 0.4, 0.4, 1.0, 0.0, 0.0, 0.0, 0.0], 4, 0.0), "");
    }
}
