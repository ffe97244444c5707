//! Which sizes of a picture are accepted. Every size, of whatever origin, goes through [`fits`].

use snell_render::Settings;

/// Longest side of a picture in pixels.
const MAX_SIDE: u32 = 16384;
/// Most pixels of a picture.
const MAX_PIXELS: u64 = 1 << 26;
/// Bytes that a pixel of the first layer takes: film, picture, its copy for pages and for saving.
const PIXEL_BYTES: u64 = 350;
/// Bytes that one more channel of a pixel takes: two sums of the film and of its block in double
/// precision, and the value in the picture.
const CHANNEL_BYTES: u64 = 36;

/// Whether a picture of these settings can be made: by its size, and by the memory that can be had
/// now. The error names what is possible.
pub fn fits(settings: &Settings) -> Result<(), String> {
    let [width, height] = settings.size;
    let pixels = u64::from(width) * u64::from(height);
    if width.min(height) == 0 || width.max(height) > MAX_SIDE || pixels > MAX_PIXELS {
        return Err(format!(
            "a picture of {width}x{height} pixels; the viewer shows sides of 1 to {MAX_SIDE} pixels, \
             and {MAX_PIXELS} pixels in all"
        ));
    }
    let channels: u64 = settings.aovs.iter().map(|aov| aov.channels().len() as u64).sum();
    let bytes = pixels * (PIXEL_BYTES + channels * CHANNEL_BYTES);
    let has_room = usize::try_from(bytes).is_ok_and(|b| Vec::<u8>::new().try_reserve_exact(b).is_ok());
    if has_room {
        return Ok(());
    }
    Err(format!(
        "a picture of {width}x{height} pixels needs {:.1} GB of memory, more than there is; choose a \
         smaller one",
        bytes as f64 * 1e-9
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_limited_by_side_and_by_area() {
        let of = |size| fits(&Settings { size, ..Settings::default() });
        for good in [[1, 1], [640, 480], [16384, 1], [1, 16384]] {
            assert_eq!(of(good), Ok(()));
        }
        for bad in [[0, 1], [1, 0], [16385, 1], [1, 16385], [8192, 8193], [u32::MAX, u32::MAX]] {
            assert!(of(bad).is_err_and(|e| e.contains(&format!("{}x{}", bad[0], bad[1]))), "{bad:?}");
        }
    }
}
