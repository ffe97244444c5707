//! Writing OpenEXR: one part of scan lines, ZIP; the picture's channels bare, those of other layers as `layer.channel`.

use super::super::WriteOptions;
use super::super::picture::{Unfit, check_layers};
use super::attributes;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, LayerAttributes, LineOrder, Text, Vec2,
    WritableImage,
};
use half::f16;
use snell_scene::{Layer, LayeredImage};
use std::io::Cursor;

/// Encodes all layers, and the metadata as text attributes. Same input, same bytes.
pub fn encode(image: &LayeredImage, options: &WriteOptions) -> Result<Vec<u8>, Unfit> {
    check_layers(image)?;
    let mut channels = Vec::new();
    for layer in &image.layers {
        for (index, name) in layer.channels.iter().enumerate() {
            let full_name = if layer.name.is_empty() { name.clone() } else { format!("{}.{name}", layer.name) };
            check_name(&full_name)?;
            channels.push((full_name, samples(layer, index, options.exr_half)));
        }
    }
    channels.sort_by(|a, b| a.0.cmp(&b.0));
    if let Some(twice) = channels.windows(2).find(|w| w[0].0 == w[1].0) {
        return Err(Unfit::new(format!("two channels have the name \"{}\"", twice[0].0), "rename one of the layers"));
    }
    let long_names = channels.iter().any(|c| c.0.len() > 31);
    let list = channels.into_iter().map(|(name, data)| AnyChannel::new(text(&name), data)).collect();

    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = Vec2(image.width as usize, image.height as usize);
    let layer = exr::prelude::Layer::new(size, LayerAttributes::default(), encoding, AnyChannels::sort(list));
    let mut bytes = Cursor::new(Vec::new());
    exr::prelude::Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|e| Unfit::new(format!("the picture cannot be encoded as OpenEXR: {e}"), "try another format"))?;
    Ok(attributes::insert(bytes.into_inner(), &image.metadata, long_names))
}

/// Names are bytes to the format; UTF-8 by custom.
fn text(name: &str) -> Text {
    Text::from_slice_unchecked(name.as_bytes())
}

fn check_name(name: &str) -> Result<(), Unfit> {
    if name.is_empty() || name.len() > 255 || name.contains('\0') {
        return Err(Unfit::new(
            format!("\"{name}\" cannot be the name of a channel in OpenEXR"),
            "use a name of 1 to 255 bytes",
        ));
    }
    Ok(())
}

/// The values of one channel. Half only for colours: its 11 bits are too few for depth, positions and ids.
fn samples(layer: &Layer, index: usize, half: bool) -> FlatSamples {
    let values = layer.values.iter().skip(index).step_by(layer.channels.len());
    let is_colour = match layer.channels[index].as_str() {
        "R" | "G" | "B" | "A" => true,
        // Luminance, unless it is a coordinate.
        "Y" => !layer.channels.iter().any(|c| c == "X"),
        _ => false,
    };
    if half && is_colour {
        FlatSamples::F16(values.map(|v| to_half(*v)).collect())
    } else {
        FlatSamples::F32(values.copied().collect())
    }
}

/// To nearest; what is finite stays finite.
fn to_half(value: f32) -> f16 {
    let limit = f16::MAX.to_f32();
    f16::from_f32(if value.is_finite() { value.clamp(-limit, limit) } else { value })
}
