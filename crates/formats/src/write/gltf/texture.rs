//! Textures. glTF fixes the meaning of each channel of a picture, so pictures with other layouts
//! are repacked.

use super::Document;
use crate::write::picture::{Pictures, encoded};
use serde_json::{Value, json};
use snell_math::real;
use snell_math::spectrum::linear_to_srgb;
use snell_scene::texture::{Filtering, Wrap};
use snell_scene::{Encoding, Image, ImageTexture, Pixels, TextureId};
use std::collections::HashMap;

/// The source of each of a picture's four channels: a texture and one of its channels.
pub type Channels = [Option<(TextureId, u8)>; 4];

/// The textures of a document.
#[derive(Debug, Default)]
pub struct Textures {
    pub textures: Vec<Value>,
    pub samplers: Vec<Value>,
    pub images: Vec<Value>,
    known_images: HashMap<(Channels, bool), usize>,
}

/// The three colour channels of a texture.
pub fn colors(id: TextureId) -> Channels {
    [Some((id, 0)), Some((id, 1)), Some((id, 2)), None]
}

/// A texture with only one channel.
pub fn single(scalar: (TextureId, u8), channel: usize) -> Channels {
    let mut channels = [None; 4];
    channels[channel] = Some(scalar);
    channels
}

impl Document<'_, '_> {
    /// The `textureInfo` for a texture with these channels; `is_color` if its colours are read as
    /// sRGB. `who` is for messages.
    pub fn texture_info(&mut self, channels: Channels, is_color: bool, who: &str) -> Value {
        let pictures = Pictures::new(self.scene);
        let mut sources = channels.iter().flatten().map(|(id, _)| pictures.texture(*id));
        let Some(texture) = sources.next() else { return Value::Null };
        let is_placed_alike = |t: &ImageTexture| {
            (t.uv_set, t.uv_transform, t.wrap, t.filtering)
                == (texture.uv_set, texture.uv_transform, texture.wrap, texture.filtering)
        };
        if !sources.all(|t| is_placed_alike(&t)) {
            self.output.lose(format!(
                "{who}: textures that share a picture in glTF are all placed like the first"
            ));
        }
        let image = self.image_number(channels, is_color, who);
        let sampler = self.sampler(&texture);
        let entry = json!({ "source": image, "sampler": sampler });
        let index = number_of(&mut self.textures.textures, entry);
        let mut info = json!({ "index": index });
        if texture.uv_set != 0 {
            info["texCoord"] = texture.uv_set.into();
        }
        if let Some(transform) = self.transform(&texture, who) {
            self.extensions.insert("KHR_texture_transform");
            info["extensions"] = json!({ "KHR_texture_transform": transform });
        }
        info
    }

    /// Offset, rotation and scale of a texture's coordinates: the inverse of the reader's formula.
    fn transform(&mut self, texture: &ImageTexture, who: &str) -> Option<Value> {
        let [[a, b, c], [d, e, f]] = texture.uv_transform.map(|row| row.map(f64::from));
        if texture.uv_transform == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
            return None;
        }
        let (scale_x, rotation) = (real::hypot(a, d), real::atan2(-d, a));
        let (sin, cos) = real::sin_cos(rotation);
        let scale_y = b * sin + e * cos;
        if (b * cos - e * sin).abs() > 1e-5 * scale_y.abs().max(1e-9) {
            self.output.lose(format!("{who}: the shear of a texture is left out"));
        }
        let mut value = json!({ "offset": [c, f], "scale": [scale_x, scale_y] });
        if rotation != 0.0 {
            value["rotation"] = rotation.into();
        }
        Some(value)
    }

    fn sampler(&mut self, texture: &ImageTexture) -> usize {
        let wrap = texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 10497,
            Wrap::Mirror => 33648,
            Wrap::Clamp => 33071,
            Wrap::Black => {
                self.output.lose("a texture that is black outside of its picture is clamped");
                33071
            }
        });
        let [min, mag] = match texture.filtering {
            Filtering::Nearest => [9728; 2],
            Filtering::Bilinear => [9729; 2],
            Filtering::Trilinear => [9987, 9729],
        };
        let sampler =
            json!({ "wrapS": wrap[0], "wrapT": wrap[1], "minFilter": min, "magFilter": mag });
        number_of(&mut self.textures.samplers, sampler)
    }

    fn image_number(&mut self, channels: Channels, is_color: bool, who: &str) -> usize {
        if let Some(&known) = self.textures.known_images.get(&(channels, is_color)) {
            return known;
        }
        let (image, exceeds) = packed(&Pictures::new(self.scene), channels, is_color);
        if exceeds {
            self.output
                .lose(format!("{who}: a picture of floating-point numbers is clamped to 0 to 1"));
        }
        let (bytes, _) = encoded(&image);
        let number = self.textures.images.len();
        let entry = if self.output.extension == "glb" {
            json!({ "bufferView": self.buffer.view(bytes, None), "mimeType": "image/png" })
        } else {
            json!({ "uri": self.output.file(&format!("picture-{number}.png"), bytes) })
        };
        let number = number_of(&mut self.textures.images, entry);
        self.textures.known_images.insert((channels, is_color), number);
        number
    }
}

fn number_of(list: &mut Vec<Value>, entry: Value) -> usize {
    list.iter().position(|e| *e == entry).unwrap_or_else(|| {
        list.push(entry);
        list.len() - 1
    })
}

/// A picture of integers with these channels, and whether values had to be clamped. A stored
/// picture is used unchanged if possible.
fn packed(pictures: &Pictures, channels: Channels, is_color: bool) -> (Image, bool) {
    let encoding = if is_color { Encoding::Srgb } else { Encoding::Linear };
    let mut ids = channels.iter().flatten().map(|c| c.0);
    let first = ids.next().unwrap_or(TextureId(u32::MAX));
    let (texture, is_one) = (pictures.texture(first), ids.all(|id| id == first));
    let image = pictures.image(&texture);
    let in_place = channels
        .iter()
        .enumerate()
        .all(|(i, c)| c.is_none_or(|(_, channel)| usize::from(channel & 3) == i));
    // The alpha of a colour picture would be read as opacity.
    let says_more = is_color && channels[3].is_none() && matches!(image.channels, 2 | 4);
    if is_one
        && in_place
        && texture.encoding == encoding
        && !says_more
        && !matches!(image.pixels, Pixels::F32(_))
    {
        return ((*image).clone(), false);
    }
    let sources = channels.map(|c| c.map(|(id, channel)| (pictures.texture(id), channel & 3)));
    let images = sources.clone().map(|s| s.map(|(texture, _)| pictures.image(&texture)));
    let [width, height] = [|i: &Image| i.width, |i: &Image| i.height]
        .map(|size| images.iter().flatten().map(|image| size(image)).max().unwrap_or(1));
    let is_deep = images.iter().flatten().any(|image| !matches!(image.pixels, Pixels::U8(_)));
    let count = if channels[3].is_some() { 4 } else { 3 };
    let mut exceeds = false;
    let mut values = Vec::with_capacity(width as usize * height as usize * count);
    for y in 0..height {
        for x in 0..width {
            for c in 0..count {
                let (Some((texture, channel)), Some(image)) = (&sources[c], &images[c]) else {
                    values.push(1.0);
                    continue;
                };
                let at =
                    |i: u32, of: u32, n: u32| (u64::from(i) * u64::from(of) / u64::from(n)) as u32;
                let (x, y) = (at(x, image.width, width), at(y, image.height, height));
                let value = image.rgba_as(x, y, texture.encoding)[usize::from(*channel)];
                exceeds |= !(-1e-6..=1.0 + 1e-6).contains(&value);
                let value = if value > 0.0 { value.min(1.0) } else { 0.0 };
                values.push(if is_color && c < 3 { linear_to_srgb(value) } else { value });
            }
        }
    }
    let pixels = if is_deep {
        Pixels::U16(values.iter().map(|v| (v * 65535.0).round() as u16).collect())
    } else {
        Pixels::U8(values.iter().map(|v| (v * 255.0).round() as u8).collect())
    };
    (Image { width, height, channels: count as u32, pixels, encoding }, exceeds)
}
