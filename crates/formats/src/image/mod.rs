//! Image files: decodes bytes to pixels, and encodes them.
//!
//! [`IMAGE_FORMATS`] lists all formats; reading, writing and `snell formats` follow from it. The
//! content decides the format, the extension only for formats without a signature (TGA).
//! Well-maintained crates do the decoding, except for PFM, which is small enough to be done here.
//! Nothing here knows light or materials: [`read_image`] returns stored values and how they are
//! encoded.

mod animated;
pub mod compare;
pub mod cryptomatte;
mod dds;
mod flip;
mod ktx2;
mod openexr;
mod pfm;
mod picture;
mod radiance;
mod raster;
mod texels;
mod tiff;
mod tonemap;
mod write;

#[cfg(test)]
mod tests;

pub use animated::{AnimatedFormat, AnimatedWriter};
pub(crate) use openexr::rec709_from;
pub use tonemap::display_value;

use crate::{Input, Place, ReadError, WriteError};
use picture::Unfit;
use snell_scene::{Image, Layer, LayeredImage};
use std::path::Path;

/// How scene-linear values become display values, for formats that hold display values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// Exposure in stops: values are multiplied by two to this power.
    pub exposure: f64,
    /// The tone map.
    pub tonemap: Tonemap,
    /// False for formats that store the clamped linear values.
    pub srgb: bool,
}

impl Default for Display {
    fn default() -> Self {
        Self { exposure: 0.0, tonemap: Tonemap::None, srgb: true }
    }
}

/// Tone maps for display formats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tonemap {
    /// Values are only clamped to 0 to 1.
    #[default]
    None,
    /// The filmic curve of ACES.
    Aces,
    /// AgX, by Troy Sobotka.
    Agx,
}

impl Tonemap {
    /// All tone maps.
    pub const ALL: [Self; 3] = [Self::None, Self::Aces, Self::Agx];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Aces => "aces",
            Self::Agx => "agx",
        }
    }
}

/// Settings of the writers.
#[derive(Clone, Debug, PartialEq)]
pub struct WriteOptions {
    /// Conversion to display values, for display formats.
    pub display: Display,
    /// Bits per channel of PNG: 8 or 16.
    pub png_bits: u8,
    /// True to write colour channels of OpenEXR as half instead of float. Other channels (depth,
    /// positions, ids) stay float.
    pub exr_half: bool,
    /// Quality of JPEG, 1 to 100.
    pub jpeg_quality: u8,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { display: Display::default(), png_bits: 8, exr_half: false, jpeg_quality: 92 }
    }
}

/// An image format.
#[derive(Clone, Copy)]
pub struct ImageFormat {
    /// Short name, such as `openexr`.
    pub name: &'static str,
    /// Extensions in lower case, without the dot; the preferred one first.
    pub extensions: &'static [&'static str],
    /// One line for `snell formats`.
    pub description: &'static str,
    /// True if the bytes can only be this format.
    recognises: fn(&[u8]) -> bool,
    read: Option<fn(&Input) -> Result<Image, ReadError>>,
    write: Option<fn(&LayeredImage, &WriteOptions) -> Result<Vec<u8>, Unfit>>,
}

impl ImageFormat {
    /// True if [`read_image`] supports the format.
    pub fn reads(&self) -> bool {
        self.read.is_some()
    }

    /// True if [`encode_image`] supports the format.
    pub fn writes(&self) -> bool {
        self.write.is_some()
    }
}

/// All formats, in the order in which contents are tried.
pub const IMAGE_FORMATS: &[ImageFormat] = &[
    ImageFormat {
        name: "openexr",
        extensions: &["exr"],
        description: "OpenEXR: scene-linear half or float, layers, metadata",
        recognises: |b| b.starts_with(&[0x76, 0x2f, 0x31, 0x01]),
        read: Some(openexr::read_image),
        write: Some(openexr::encode),
    },
    ImageFormat {
        name: "png",
        extensions: &["png"],
        description: "PNG: sRGB display values of 8 or 16 bits, alpha, metadata",
        recognises: |b| b.starts_with(b"\x89PNG\r\n\x1a\n"),
        read: Some(|input| raster::read(input, ::image::ImageFormat::Png)),
        write: Some(write::png),
    },
    ImageFormat {
        name: "jpeg",
        extensions: &["jpg", "jpeg"],
        description: "JPEG: sRGB display values of 8 bits, lossy",
        recognises: |b| b.starts_with(&[0xff, 0xd8, 0xff]),
        read: Some(|input| raster::read(input, ::image::ImageFormat::Jpeg)),
        write: Some(write::jpeg),
    },
    ImageFormat {
        name: "radiance",
        extensions: &["hdr", "pic"],
        description: "Radiance HDR (RGBE): scene-linear, shared exponent",
        recognises: |b| b.starts_with(b"#?"),
        read: Some(radiance::read),
        write: Some(write::radiance),
    },
    ImageFormat {
        name: "pfm",
        extensions: &["pfm"],
        description: "Portable float map: scene-linear float, RGB or grey",
        recognises: pfm::recognises,
        read: Some(pfm::read),
        write: Some(pfm::encode),
    },
    ImageFormat {
        name: "ppm",
        extensions: &["ppm", "pgm", "pbm", "pnm", "pam"],
        description: "Portable any map: display values; written as binary PPM of 8 bits",
        recognises: |b| matches!(b, [b'P', b'1'..=b'7', space, ..] if space.is_ascii_whitespace()),
        read: Some(|input| raster::read(input, ::image::ImageFormat::Pnm)),
        write: Some(write::ppm),
    },
    ImageFormat {
        name: "bmp",
        extensions: &["bmp"],
        description: "Windows bitmap: sRGB display values of 8 bits",
        recognises: |b| b.starts_with(b"BM"),
        read: Some(|input| raster::read(input, ::image::ImageFormat::Bmp)),
        write: None,
    },
    ImageFormat {
        name: "webp",
        extensions: &["webp"],
        description: "WebP: sRGB display values of 8 bits",
        recognises: |b| b.starts_with(b"RIFF") && b.get(8..12) == Some(b"WEBP"),
        read: Some(|input| raster::read(input, ::image::ImageFormat::WebP)),
        write: None,
    },
    ImageFormat {
        name: "gif",
        extensions: &["gif"],
        description: "GIF: sRGB display values of 8 bits; the first frame",
        recognises: |b| b.starts_with(b"GIF8"),
        read: Some(|input| raster::read(input, ::image::ImageFormat::Gif)),
        write: None,
    },
    ImageFormat {
        name: "tiff",
        extensions: &["tif", "tiff"],
        description: "TIFF: sRGB display values of 8 or 16 bits, or linear float; the first page",
        recognises: |b| b.starts_with(b"II*\0") || b.starts_with(b"MM\0*"),
        read: Some(tiff::read),
        write: None,
    },
    ImageFormat {
        name: "dds",
        extensions: &["dds"],
        description: "DirectDraw surface: display or linear, plain or in blocks (BC1 to BC7)",
        recognises: |b| b.starts_with(dds::IDENTIFIER),
        read: Some(dds::read),
        write: None,
    },
    ImageFormat {
        name: "ktx2",
        extensions: &["ktx2"],
        description: "KTX2: plain, BC1 to BC7, ETC2, EAC, ASTC, Basis Universal; the largest level",
        recognises: |b| b.starts_with(ktx2::IDENTIFIER),
        read: Some(ktx2::read),
        write: None,
    },
    ImageFormat {
        name: "tga",
        extensions: &["tga"],
        description: "Targa: sRGB display values of 8 bits",
        recognises: |b| b.ends_with(b"TRUEVISION-XFILE.\0"),
        read: Some(|input| raster::read(input, ::image::ImageFormat::Tga)),
        write: None,
    },
];

/// Decodes an image file. The content decides the format, then the extension. NaN becomes 0,
/// infinity the largest half (65504) with its sign, so that callers need not check.
pub fn read_image(input: &Input) -> Result<Image, ReadError> {
    let read = reader_of(input)?;
    let mut image = guarded(input, || read(input))?;
    picture::make_finite(&mut image);
    Ok(image)
}

/// Decodes an image file with all of its layers and its metadata. Values are as stored, except that
/// display values are linearised. Formats other than OpenEXR have one layer, and only OpenEXR and
/// PNG have metadata.
pub fn read_layers(input: &Input) -> Result<LayeredImage, ReadError> {
    if is_openexr(&input.bytes) {
        return guarded(input, || openexr::read_layers(input));
    }
    let image = read_image(input)?;
    let has_alpha = matches!(image.channels, 2 | 4);
    let names = if has_alpha { &["R", "G", "B", "A"][..] } else { &["R", "G", "B"] };
    let mut values = Vec::with_capacity(image.width as usize * image.height as usize * names.len());
    for y in 0..image.height {
        for x in 0..image.width {
            let [r, g, b, a] = image.rgba(x, y);
            values.extend_from_slice(&[r * a, g * a, b * a, a][..names.len()]);
        }
    }
    let channels = names.iter().map(|n| (*n).into()).collect();
    let layers = vec![Layer { name: String::new(), channels, values }];
    let metadata = raster::png_metadata(&input.bytes);
    Ok(LayeredImage { width: image.width, height: image.height, layers, metadata })
}

fn is_openexr(bytes: &[u8]) -> bool {
    (IMAGE_FORMATS[0].recognises)(bytes)
}

fn reader_of(input: &Input) -> Result<fn(&Input) -> Result<Image, ReadError>, ReadError> {
    let extension = input.extension();
    let by_content = IMAGE_FORMATS.iter().find(|f| (f.recognises)(&input.bytes));
    if by_content.is_none()
        && let Some((problem, remedy)) = crate::stranger::known_kind(&input.bytes, "")
    {
        return Err(input.error(Place::Whole, problem, remedy));
    }
    let format = by_content
        .or_else(|| IMAGE_FORMATS.iter().find(|f| f.extensions.contains(&extension.as_str())));
    format.and_then(|f| f.read).ok_or_else(|| {
        let start = picture::first_bytes(&input.bytes);
        let (problem, remedy) = match unreadable(&input.bytes) {
            Some((name, remedy)) => (format!("{name} is not supported"), remedy.into()),
            None => (
                format!("this is not an image that Snell knows: it starts with {start}"),
                format!("convert it to one of: {}", names(ImageFormat::reads)),
            ),
        };
        input.error(Place::Whole, problem, remedy)
    })
}

/// The name of a format that is known, but not read, and a remedy. (Decoders of AVIF, HEIC and JPEG
/// XL are in C, or not safe to use, or under licences that bind their users.)
fn unreadable(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    const BY_MAGICK: &str = "convert it to PNG, for example with `magick FILE picture.png`";
    let is_brand = |brands: &[&[u8; 4]]| {
        bytes.get(4..8) == Some(b"ftyp")
            && bytes.get(8..12).is_some_and(|brand| brands.iter().any(|known| brand == *known))
    };
    let starts = |start: &[u8]| bytes.starts_with(start);
    Some(match () {
        () if is_brand(&[b"avif", b"avis"]) => {
            let remedy = "convert it to PNG, for example with `avifdec FILE picture.png`";
            ("AVIF", remedy)
        }
        () if is_brand(&[b"heic", b"heix", b"hevc", b"mif1", b"msf1"]) => ("HEIF", BY_MAGICK),
        () if starts(b"\0\0\0\x0cJXL ") || starts(&[0xff, 0x0a]) => {
            ("JPEG XL", "convert it to PNG, for example with `djxl FILE picture.png`")
        }
        () if starts(b"\0\0\0\x0cjP  ") || starts(&[0xff, 0x4f, 0xff, 0x51]) => {
            ("JPEG 2000", BY_MAGICK)
        }
        () if starts(b"\xabKTX 11\xbb") => {
            ("KTX of version 1", "convert it to KTX2 with `ktx2ktx2 FILE`")
        }
        () if starts(b"8BPS") => ("Photoshop's format", "save it as PNG"),
        () => return None,
    })
}

fn names(which: fn(&ImageFormat) -> bool) -> String {
    IMAGE_FORMATS.iter().filter(|f| which(f)).map(|f| f.name).collect::<Vec<_>>().join(", ")
}

/// Decodes the image of an environment light.
pub fn read_environment(input: &Input) -> Result<Image, ReadError> {
    let image = read_image(input)?;
    charge_environment(input, &image)?;
    Ok(image)
}

/// Bytes that a renderer takes per pixel of an environment for sampling: three floats.
const ENVIRONMENT_BYTES: u64 = 12;

/// Charges the memory that rendering takes for an environment.
pub(crate) fn charge_environment(input: &Input, image: &Image) -> Result<(), ReadError> {
    let pixels = u64::from(image.width) * u64::from(image.height);
    input.charge(pixels * ENVIRONMENT_BYTES, "light from the environment's image")
}

/// Turns a panic of a decoder into an error of the file.
fn guarded<T>(input: &Input, read: impl FnOnce() -> Result<T, ReadError>) -> Result<T, ReadError> {
    crate::guard::guarded(read).unwrap_or_else(|| {
        Err(input.error(
            Place::Whole,
            "the image is damaged: its decoder failed",
            "export the image again",
        ))
    })
}

/// Encodes a picture in the format that `path`'s extension names.
pub fn encode_image(
    path: &Path,
    image: &LayeredImage,
    options: &WriteOptions,
) -> Result<Vec<u8>, WriteError> {
    let extension =
        path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    encode(path, &extension, image, options)
}

/// Encodes a picture in the format of this name or extension, such as `png` or `exr`, for writing
/// to standard output.
pub fn encode_image_as(
    format: &str,
    image: &LayeredImage,
    options: &WriteOptions,
) -> Result<Vec<u8>, WriteError> {
    encode(Path::new("-"), &format.to_lowercase(), image, options)
}

fn encode(
    path: &Path,
    name: &str,
    image: &LayeredImage,
    options: &WriteOptions,
) -> Result<Vec<u8>, WriteError> {
    let unfit =
        |u: Unfit| WriteError::Format { path: path.into(), problem: u.problem, remedy: u.remedy };
    let write = writer(name).map_err(unfit)?;
    write(image, options).map_err(unfit)
}

type Writer = fn(&LayeredImage, &WriteOptions) -> Result<Vec<u8>, Unfit>;

/// The writer of the format with this name or extension.
fn writer(name: &str) -> Result<Writer, Unfit> {
    let known = IMAGE_FORMATS.iter().find(|f| f.name == name || f.extensions.contains(&name));
    known.and_then(|f| f.write).ok_or_else(|| {
        let problem = match name {
            "" => "the name has no extension that says which image format to write".to_string(),
            _ => format!("\"{name}\" is not an image format that Snell writes"),
        };
        let extensions: Vec<_> = IMAGE_FORMATS
            .iter()
            .filter(|f| f.writes())
            .map(|f| format!(".{}", f.extensions[0]))
            .collect();
        Unfit::new(problem, format!("use one of: {}", extensions.join(" ")))
    })
}

/// Memory that an encoder takes in addition to the picture, in bytes per pixel, for layers of
/// `values` channels in total: its input, compressed data and its output. `name` is the name or
/// extension of a format.
pub fn encoder_bytes(name: &str, values: u64, png_bits: u8) -> u64 {
    let known = IMAGE_FORMATS.iter().find(|f| f.name == name || f.extensions.contains(&name));
    match known.map(|f| f.name) {
        Some("openexr") => 4 * values + 4 * values / 2,
        Some("radiance") => 12 + 4 + 4,
        Some("pfm") => 12,
        Some("png") => 3 * values.min(4) * u64::from(png_bits) / 8,
        _ => 3 * values.min(4),
    }
}

/// Checks that [`write_image`] supports the format of `path`, so that a long render does not end in
/// an error.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let extension =
        path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let unfit =
        |u: Unfit| WriteError::Format { path: path.into(), problem: u.problem, remedy: u.remedy };
    writer(&extension).map(|_| ()).map_err(unfit)
}

/// Encodes and writes a picture: to a temporary file first, which is then renamed.
pub fn write_image(
    path: &Path,
    image: &LayeredImage,
    options: &WriteOptions,
) -> Result<(), WriteError> {
    crate::atomic::write(path, &encode_image(path, image, options)?)
}
