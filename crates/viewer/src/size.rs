//! The accepted sizes of a picture. Every size, of whatever origin, goes through [`fits`].

use snell_render::Settings;

/// Maximum side of a picture in pixels.
const MAX_SIDE: u32 = 16384;
/// Maximum number of pixels of a picture.
const MAX_PIXELS: u64 = 1 << 26;

/// Checks that a picture with these settings can be made: its size, and the memory available now.
/// The error states the limit.
pub fn fits(settings: &Settings) -> Result<(), String> {
    let [width, height] = settings.size;
    let pixels = u64::from(width) * u64::from(height);
    if width.min(height) == 0 || width.max(height) > MAX_SIDE || pixels > MAX_PIXELS {
        return Err(format!(
            "a picture of {width}x{height} pixels; the viewer shows sides of 1 to {MAX_SIDE} \
                pixels, \
             and {MAX_PIXELS} pixels in all"
        ));
    }
    crate::memory::check(settings)
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
            assert!(
                of(bad).is_err_and(|e| e.contains(&format!("{}x{}", bad[0], bad[1]))),
                "{bad:?}"
            );
        }
    }
}
