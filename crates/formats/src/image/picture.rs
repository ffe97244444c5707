//! Shared by readers and writers: limits on sizes, and the picture's pixels as RGBA.

use crate::memory::Available;
use crate::{Input, Place, ReadError};
use snell_scene::{Image, LayeredImage, Pixels};

/// The reason why a picture does not fit a format.
#[derive(Debug)]
pub struct Unfit {
    /// The property of the picture that does not fit.
    pub problem: String,
    /// A way to avoid the problem.
    pub remedy: String,
}

impl Unfit {
    pub fn new(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { problem: problem.into(), remedy: remedy.into() }
    }
}

/// The maximum expansion of any compression in use here, in bytes per byte (deflate stops at 1032,
/// JPEG near 1024).
const MAX_EXPANSION: u64 = 4096;
/// Images up to this many bytes in memory are decoded whatever the file's size: enough for 4 Mi
/// pixels of RGBA floats.
const ALWAYS_ALLOWED_BYTES: u64 = 64 << 20;
/// Images above this many bytes in memory (8192 x 8192 pixels of RGBA) may expand only by
/// [`MAX_EXPANSION_OF_LARGE`]. Real pictures of that size stay far below that ratio; a file above
/// it is made to exhaust the memory.
const LARGE_BYTES: u64 = 256 << 20;
/// The largest ratio of an image's bytes in memory to the bytes of its file, for images above
/// [`LARGE_BYTES`].
const MAX_EXPANSION_OF_LARGE: u64 = 128;

/// Refuses an image that is empty or over the limit, or that declares more pixels than its bytes
/// can hold or the scene may take; otherwise charges its memory. Decoders call this once, before
/// they allocate anything.
pub fn check_size(
    input: &Input,
    width: u64,
    height: u64,
    bytes_per_pixel: u64,
) -> Result<(), ReadError> {
    let limit = input.options.limits.image_pixels;
    if width == 0 || height == 0 {
        return Err(input.error(Place::Whole, "the image has no pixels", "export the image again"));
    }
    let pixels = width
        .checked_mul(height)
        .filter(|p| *p <= limit && width.max(height) <= u64::from(u32::MAX));
    let Some(pixels) = pixels else {
        return Err(input.error(
            Place::Whole,
            format!("the image declares {width} x {height} pixels, more than the limit of {limit}"),
            "scale the image down, or cut it into parts",
        ));
    };
    let (needed, given) = (pixels.saturating_mul(bytes_per_pixel), input.bytes.len() as u64);
    let plausible = given.saturating_mul(MAX_EXPANSION).saturating_add(ALWAYS_ALLOWED_BYTES);
    if needed > plausible
        || (needed > LARGE_BYTES && needed > given.saturating_mul(MAX_EXPANSION_OF_LARGE))
    {
        return Err(input.error(
            Place::Whole,
            format!(
                "the image declares {width} x {height} pixels, but the file has only {} \
                bytes",
                input.bytes.len()
            ),
            "the file is cut off, damaged or made to fill the memory: export the image again, or \
                scale it down",
        ));
    }
    input.charge(needed, "the image")?;
    // The memory is that of the decoder's own pixels and of the returned ones.
    let needed = needed.saturating_mul(2);
    if needed > ALWAYS_ALLOWED_BYTES {
        let what = format!("the image of {width} x {height} pixels");
        let fits = Available::now().admit(&what, needed);
        fits.map_err(|problem| {
            input.error(Place::Whole, problem, "scale the image down, or give it more memory")
        })?;
    }
    Ok(())
}

/// The first bytes of a file, for messages.
pub fn first_bytes(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "nothing (the file is empty)".into();
    }
    let shown: Vec<_> = bytes.iter().take(8).map(|b| format!("{b:02x}")).collect();
    format!("the bytes {}", shown.join(" "))
}

/// The largest finite half-precision number; infinities are read as this.
const LARGEST: f32 = 65504.0;

/// Replaces NaN by 0 and infinity by the largest half.
pub fn finite(value: f32) -> f32 {
    match value {
        v if v.is_finite() => v,
        v if v.is_nan() => 0.0,
        v => LARGEST.copysign(v),
    }
}

/// Applies [`finite`] to all values.
pub fn make_finite(image: &mut Image) {
    if let Pixels::F32(values) = &mut image.pixels {
        values.iter_mut().for_each(|v| *v = finite(*v));
    }
}

/// The first layer of a picture as RGBA.
pub struct Picture<'a> {
    /// Values of all channels, pixel after pixel.
    values: &'a [f32],
    stride: usize,
    rgb: [usize; 3],
    alpha: Option<usize>,
    pub width: usize,
    pub height: usize,
}

impl<'a> Picture<'a> {
    /// The first layer: its channels `R`, `G`, `B` and `A` if it has them; otherwise the first
    /// three, or the only one for all three.
    pub fn of(image: &'a LayeredImage) -> Result<Self, Unfit> {
        check_layers(image)?;
        let layer = &image.layers[0];
        let find = |name: &str| layer.channels.iter().position(|c| c == name);
        let rgb = match (find("R"), find("G"), find("B")) {
            (Some(r), Some(g), Some(b)) => [r, g, b],
            _ if find("Y").is_none() && layer.channels.len() >= 3 => [0, 1, 2],
            _ => [find("Y").unwrap_or(0); 3],
        };
        Ok(Self {
            values: &layer.values,
            stride: layer.channels.len(),
            alpha: find("A").filter(|a| !rgb.contains(a)),
            rgb,
            width: image.width as usize,
            height: image.height as usize,
        })
    }

    /// True if there is an alpha channel.
    pub fn has_alpha(&self) -> bool {
        self.alpha.is_some()
    }

    /// True if all three colours are one channel.
    pub fn is_grey(&self) -> bool {
        self.rgb[0] == self.rgb[1]
    }

    /// Premultiplied RGB, and alpha (1 if absent), of pixel `i`, as stored.
    pub fn rgba(&self, i: usize) -> [f32; 4] {
        let pixel = &self.values[i * self.stride..][..self.stride];
        let [r, g, b] = self.rgb.map(|c| pixel[c]);
        [r, g, b, self.alpha.map_or(1.0, |a| pixel[a])]
    }
}

/// Checks that there is at least one layer, and that each has one value per channel and pixel.
pub fn check_layers(image: &LayeredImage) -> Result<(), Unfit> {
    let pixels = image.width as usize * image.height as usize;
    if pixels == 0 || image.layers.is_empty() {
        return Err(Unfit::new(
            "the picture is empty",
            "give it a size of at least 1 x 1 and one layer",
        ));
    }
    for layer in &image.layers {
        if layer.channels.is_empty() || layer.values.len() != pixels * layer.channels.len() {
            let problem = format!(
                "layer \"{}\" has {} values for {pixels} pixels of {} channels",
                layer.name,
                layer.values.len(),
                layer.channels.len()
            );
            return Err(Unfit::new(problem, "give one value per channel and pixel"));
        }
    }
    Ok(())
}
