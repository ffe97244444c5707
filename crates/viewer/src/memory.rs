//! Checks that there is memory for the picture at rest, before it is begun.

use crate::rest::is_denoised;
use snell_formats::memory::Available;
use snell_render::Settings;
use snell_render::memory::{Estimate, Uses, of_picture};

/// Bytes per pixel in addition to film and picture: the shown linear colours and the previous ones,
/// the frame in transit, and temporary data. The value was measured.
const BESIDE: u64 = 2 * 12 + 12 + 24;
/// The same for the denoised picture: points, light and colours, the data of the filter, and those
/// of Open Image Denoise.
const DENOISED: u64 = 64 + 3 * 16 + 2 * 12 + 100 + 100;

/// The memory that the picture at rest takes, without its scene.
pub fn estimate(settings: &Settings) -> Estimate {
    let threads = rayon::current_num_threads();
    let beside = BESIDE + if is_denoised(settings.size) { DENOISED } else { 0 };
    of_picture(settings, &Uses { threads, variance: true, denoise: false, beside })
}

/// Fails if there is too little memory for a picture with these settings; the message gives what
/// fits.
pub fn check(settings: &Settings) -> Result<(), String> {
    let estimate = estimate(settings);
    let available = Available::now();
    let [width, height] = estimate.size;
    let what = format!("a picture of {width}x{height} pixels");
    let refused = available.admit(&what, estimate.bytes());
    refused.map_err(|problem| format!("{problem}; {}", estimate.advice(available.bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_nothing_can_hold_is_refused_with_one_that_fits() {
        let of = |size| check(&Settings { size, ..Settings::default() });
        assert_eq!(of([64, 48]), Ok(()));
        // The test holds on any machine with less than a terabyte.
        if Available::now().bytes < 1 << 40 {
            let message = of([1 << 16, 1 << 16]).expect_err("a picture of 4 billion pixels");
            assert!(message.contains("65536x65536") && message.contains("fits"), "{message}");
        }
    }
}
