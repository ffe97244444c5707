//! Pictures of textures as files: PNG for integers, OpenEXR for floating-point numbers.

use super::Output;
use crate::image::{WriteOptions, encode_image_as};
use snell_math::Rgb;
use snell_math::spectrum::{linear_to_srgb, srgb_to_linear};
use snell_scene::bsdf::fresnel;
use snell_scene::texture::missing_texture_image;
use snell_scene::{Encoding, Image, ImageTexture, Layer, LayeredImage, Pixels, Scene, TextureId};
use std::collections::HashMap;
use std::sync::Arc;

/// The part of an image that a file holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Whole,
    /// One channel of the image, as grey.
    Channel(u8),
    /// The colours, converted to the other encoding.
    Recoded,
    /// Computed from the texture's values.
    Baked(Baked),
}

/// A function of a texture's values that is written as a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Baked {
    /// The colours, multiplied by a factor.
    Tinted(Rgb),
    /// Light: colours times a factor, always linear.
    Light(Rgb),
    /// The reflectances of a diffuse base that shows the texture's colours, times `factor`, when
    /// seen through a clear layer of index `ior`.
    UnderCoat { factor: Rgb, ior: f32 },
    /// One channel, multiplied by a factor.
    Scaled { channel: u8, factor: f32 },
    /// The square of a channel times a factor.
    Squared { channel: u8, factor: f32 },
    /// 1 where a channel is at least `least`, else 0.
    Mask { channel: u8, least: f32 },
}

impl Baked {
    /// Reflectance of a diffuse base that shows the reflectance `seen` when seen through a clear
    /// layer: the inverse of the material "coated-diffuse".
    pub fn under_coat(seen: f32, ior: f32) -> f32 {
        let back = if ior > 1.0 {
            1.0 - (1.0 - fresnel::dielectric_average(ior)) / (ior * ior)
        } else {
            0.0
        };
        let seen = seen.clamp(0.0, 1.0);
        seen / (1.0 - back + seen * back)
    }

    fn is_color(self) -> bool {
        matches!(self, Self::Tinted(_) | Self::Light(_) | Self::UnderCoat { .. })
    }

    fn at(self, rgba: [f32; 4]) -> [f32; 3] {
        let color = Rgb::new(rgba[0], rgba[1], rgba[2]);
        let channel = |channel: u8| rgba[usize::from(channel & 3)];
        let Rgb { r, g, b } = match self {
            Self::Tinted(factor) | Self::Light(factor) => color * factor,
            Self::UnderCoat { factor, ior } => (color * factor).map(|c| Self::under_coat(c, ior)),
            Self::Scaled { channel: c, factor } => Rgb::splat(channel(c) * factor),
            Self::Squared { channel: c, factor } => {
                Rgb::splat((channel(c) * factor) * (channel(c) * factor))
            }
            Self::Mask { channel: c, least } => {
                Rgb::splat(f32::from(u8::from(channel(c) >= least)))
            }
        };
        [r, g, b]
    }

    /// The picture of the function's values. Colours from 0 to 1 are encoded as sRGB.
    fn of(self, image: &Image, encoding: Encoding) -> Image {
        let mut values = Vec::with_capacity(image.width as usize * image.height as usize * 3);
        for y in 0..image.height {
            for x in 0..image.width {
                let color = self.at(image.rgba_as(x, y, encoding));
                values.extend(&color[..if self.is_color() { 3 } else { 1 }]);
            }
        }
        let is_light = matches!(self, Self::Light(_));
        // Floating-point pictures are stored as linear.
        let is_float = matches!(image.pixels, Pixels::F32(_));
        if !self.is_color()
            || is_light
            || is_float
            || !values.iter().all(|x| (0.0..=1.0).contains(x))
        {
            let channels = if self.is_color() { 3 } else { 1 };
            return match is_light {
                true => Image::from_f32(image.width, image.height, channels, values),
                false => from_values(image, channels, values),
            };
        }
        values.iter_mut().for_each(|x| *x = linear_to_srgb(*x));
        from_values(image, 3, values)
    }
}

/// The pictures of a scene to be written, each once.
#[derive(Debug)]
pub struct Pictures<'a> {
    scene: &'a Scene,
    known: HashMap<String, String>,
}

/// The texture that stands for an invalid id.
fn missing() -> ImageTexture {
    ImageTexture::new(snell_scene::graph::ImageId(u32::MAX), Encoding::Srgb)
}

impl<'a> Pictures<'a> {
    /// Begins with no picture written.
    pub fn new(scene: &'a Scene) -> Self {
        Self { scene, known: HashMap::new() }
    }

    /// The texture of an id.
    pub fn texture(&self, id: TextureId) -> ImageTexture {
        self.scene
            .textures
            .get(id.index())
            .and_then(|t| t.as_image())
            .cloned()
            .unwrap_or_else(missing)
    }

    /// The image of a texture.
    pub fn image(&self, texture: &ImageTexture) -> Arc<Image> {
        let image = self.scene.images.get(texture.image.index()).filter(|image| is_sound(image));
        image.cloned().unwrap_or_else(|| Arc::new(missing_texture_image()))
    }

    /// The name of a file that shows a texture to a reader that decodes colours as `meant`.
    pub fn color(&mut self, output: &mut Output, id: TextureId, meant: Encoding) -> String {
        let texture = self.texture(id);
        let part = if texture.encoding == meant { Part::Whole } else { Part::Recoded };
        self.file(output, &texture, part)
    }

    /// The name of a file with a function of a texture; the stored picture if the function is the
    /// identity.
    pub fn baked(&mut self, output: &mut Output, id: TextureId, baked: Baked) -> String {
        match baked {
            Baked::Tinted(Rgb::WHITE) => self.file(output, &self.texture(id), Part::Whole),
            Baked::Scaled { channel, factor: 1.0 } => self.channel(output, id, channel),
            _ => self.file(output, &self.texture(id), Part::Baked(baked)),
        }
    }

    /// The encoding of the integers in a file of [`Self::baked`].
    pub fn encoding_of_baked(&self, id: TextureId, baked: Baked) -> Encoding {
        match baked {
            Baked::Tinted(Rgb::WHITE) => self.texture(id).encoding,
            _ if baked.is_color() => Encoding::Srgb,
            _ => Encoding::Linear,
        }
    }

    /// The name of a grey file that shows one channel to a reader that takes values as linear.
    pub fn channel(&mut self, output: &mut Output, id: TextureId, channel: u8) -> String {
        let texture = self.texture(id);
        let is_grey = channel < 3
            && self.image(&texture).channels == 1
            && texture.encoding == Encoding::Linear;
        self.file(output, &texture, if is_grey { Part::Whole } else { Part::Channel(channel & 3) })
    }

    fn file(&mut self, output: &mut Output, texture: &ImageTexture, part: Part) -> String {
        let key = format!("{} {:?} {part:?}", texture.image.0, texture.encoding);
        if let Some(name) = self.known.get(&key) {
            return name.clone();
        }
        let image = self.image(texture);
        let made = match part {
            Part::Whole => image,
            Part::Recoded => Arc::new(recoded(&image, texture.encoding)),
            Part::Channel(channel) => Arc::new(grey(&image, texture.encoding, channel)),
            Part::Baked(baked) => Arc::new(baked.of(&image, texture.encoding)),
        };
        let (bytes, extension) = encoded(&made);
        let name = output.file(&format!("picture-{}.{extension}", self.known.len()), bytes);
        self.known.insert(key, name.clone());
        name
    }
}

fn is_sound(image: &Image) -> bool {
    let values = image.width as usize * image.height as usize * image.channels as usize;
    let found = match &image.pixels {
        Pixels::U8(v) => v.len(),
        Pixels::U16(v) => v.len(),
        Pixels::F32(v) => v.len(),
    };
    values > 0 && found == values && image.channels <= 4
}

/// Numbers from 0 to 1 as 16-bit integers, others as floats.
fn from_values(image: &Image, channels: u32, values: Vec<f32>) -> Image {
    let fits =
        !matches!(image.pixels, Pixels::F32(_)) && values.iter().all(|x| (0.0..=1.0).contains(x));
    let pixels = match fits {
        true => Pixels::U16(values.iter().map(|x| (x * 65535.0).round() as u16).collect()),
        false => Pixels::F32(values),
    };
    Image { width: image.width, height: image.height, channels, pixels, encoding: Encoding::Linear }
}

/// The image with colours converted to the other encoding.
fn recoded(image: &Image, from: Encoding) -> Image {
    let colors = if matches!(image.channels, 2 | 4) { image.channels - 1 } else { image.channels };
    let map = |x: f32| match from {
        Encoding::Srgb => srgb_to_linear(x),
        Encoding::Linear => linear_to_srgb(x),
    };
    let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let value = |(x, y): (u32, u32)| {
        (0..image.channels).map(move |c| {
            let stored = image.value(x, y, c);
            if c < colors { map(stored) } else { stored }
        })
    };
    from_values(image, image.channels, pixels.flat_map(value).collect())
}

/// One channel of an image, decoded, as a grey image.
fn grey(image: &Image, encoding: Encoding, channel: u8) -> Image {
    let mut values = Vec::with_capacity(image.width as usize * image.height as usize);
    for y in 0..image.height {
        values
            .extend((0..image.width).map(|x| image.rgba_as(x, y, encoding)[usize::from(channel)]));
    }
    // 8-bit values that no curve changed stay 8-bit.
    if matches!(image.pixels, Pixels::U8(_)) && (encoding == Encoding::Linear || channel == 3) {
        let pixels = Pixels::U8(values.iter().map(|x| (x * 255.0).round() as u8).collect());
        return Image { channels: 1, pixels, encoding: Encoding::Linear, ..image.clone() };
    }
    from_values(image, 1, values)
}

/// The bytes of a picture file and its extension.
pub fn encoded(image: &Image) -> (Vec<u8>, &'static str) {
    let (depth, data) = match &image.pixels {
        Pixels::U8(values) => (png::BitDepth::Eight, values.clone()),
        Pixels::U16(values) => {
            (png::BitDepth::Sixteen, values.iter().flat_map(|x| x.to_be_bytes()).collect())
        }
        Pixels::F32(values) => return (open_exr(image, values), "exr"),
    };
    (png_bytes(image, depth, &data).unwrap_or_default(), "png")
}

fn png_bytes(
    image: &Image,
    depth: png::BitDepth,
    data: &[u8],
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_depth(depth);
    encoder.set_color(match image.channels {
        1 => png::ColorType::Grayscale,
        2 => png::ColorType::GrayscaleAlpha,
        3 => png::ColorType::Rgb,
        _ => png::ColorType::Rgba,
    });
    let mut writer = encoder.write_header()?;
    writer.write_image_data(data)?;
    writer.finish()?;
    Ok(bytes)
}

/// OpenEXR of 32-bit numbers; colours are multiplied by alpha, as the format requires.
fn open_exr(image: &Image, values: &[f32]) -> Vec<u8> {
    let has_alpha = matches!(image.channels, 2 | 4);
    let mut out = Vec::with_capacity(values.len() * if image.channels < 3 { 3 } else { 1 });
    for pixel in values.chunks_exact(image.channels as usize) {
        let alpha = if has_alpha { pixel[pixel.len() - 1] } else { 1.0 };
        let factor = if alpha > 0.0 { alpha } else { 1.0 };
        let [r, g, b] =
            if image.channels < 3 { [pixel[0]; 3] } else { [pixel[0], pixel[1], pixel[2]] };
        out.extend([r, g, b].map(|c| c * factor));
        if has_alpha {
            out.push(alpha);
        }
    }
    let channels = ["R", "G", "B", "A"]
        .into_iter()
        .take(if has_alpha { 4 } else { 3 })
        .map(String::from)
        .collect();
    let layer = Layer { name: String::new(), channels, values: out };
    let picture = LayeredImage {
        width: image.width,
        height: image.height,
        layers: vec![layer],
        metadata: Vec::new(),
    };
    encode_image_as("openexr", &picture, &WriteOptions::default()).unwrap_or_default()
}
