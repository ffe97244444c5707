//! Comparing with a reference, without any state of the session: a picture file becomes linear
//! values, and two pictures become the numbers and errors of `snell compare`.

use crate::by_name;
use crate::halves;
use crate::protocol::FrameHeader;
use crate::session::{Session, Snapshot, lock};
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use serde_json::json;
use snell_formats::image::compare::{
    BYTES_PER_PIXEL, CompareOptions, LinearImage, compare as measure,
};
use snell_formats::image::{Display, Tonemap, read_image};
use snell_formats::memory::Available;
use snell_formats::{Input, ReadOptions};
use snell_math::{DVec2, Vec2};
use snell_render::{Aov, CompiledScene};
use snell_scene::CameraSample;
use std::path::Path;

/// Maximum number of pixels of a reference, as of a picture.
const MAX_PIXELS: u64 = 1 << 26;

/// Decodes a picture file of any format that Snell reads: a frame of linear half floats for the
/// page, see [`FrameHeader`]. The error is a message for the user.
pub fn reference(name: &str, bytes: Vec<u8>) -> Result<Vec<u8>, String> {
    // Files of pictures name no other files.
    let input = Input::from_bytes(name, bytes, Path::new(""), &ReadOptions::default());
    let image = read_image(&input).map_err(|e| e.to_string())?;
    let pixels = u64::from(image.width) * u64::from(image.height);
    if pixels == 0 || pixels > MAX_PIXELS {
        return Err(format!(
            "{name} has {} x {} pixels; a reference has 1 to {MAX_PIXELS} pixels: scale it down",
            image.width, image.height
        ));
    }
    let header = FrameHeader {
        kind: 1,
        frame: 0,
        seq: 0,
        generation: 0,
        size: [image.width, image.height],
        samples: 0,
        wanted: 0,
        milliseconds: 0.0,
        noise: f32::NAN,
        denoised: 0.0,
    };
    let pixels = LinearImage::from_image(&image).pixels;
    halves::compress(pixels.as_flattened(), image.width as usize, false, header.to_bytes().to_vec())
        .map_err(|e| e.to_string())
}

/// What a page compares the picture at rest with.
pub struct Against {
    /// Width and height of the reference.
    pub size: [u32; 2],
    /// Red, green, blue of the reference as 16-bit floats, little endian.
    pub halves: Vec<u8>,
    /// Exposure in stops.
    pub exposure: f64,
    /// Name of the tone map.
    pub tonemap: String,
}

/// Compares the picture at rest with a reference: the numbers as JSON, preceded by their length,
/// and the FLIP error of each pixel, as 16-bit floats. FLIP compares what is shown: both pictures
/// with the exposure and the tone map of the page.
pub fn difference(session: &Session, against: &Against) -> Result<Vec<u8>, String> {
    let finished = lock(&session.finished).clone();
    let (_, finished) = finished.ok_or("there is no picture yet; wait until the view rests")?;
    let [width, height] = against.size;
    let pixels = u64::from(width) * u64::from(height);
    if pixels > MAX_PIXELS || against.halves.len() as u64 != pixels * 6 {
        return Err("the reference has another number of pixels than its size says".into());
    }
    if !(-100.0..=100.0).contains(&against.exposure) {
        return Err("an exposure is a number of stops from -100 to 100".into());
    }
    let tonemap = by_name("tone map", &Tonemap::ALL, Tonemap::name, &against.tonemap)?;
    let display = Display { exposure: against.exposure, tonemap, srgb: true };
    let what = format!("comparing pictures of {width}x{height} pixels");
    Available::now()
        .admit(&what, pixels * BYTES_PER_PIXEL as u64)
        .map_err(|problem| format!("{problem}; make the window smaller"))?;
    let bits = against.halves.as_chunks::<2>().0;
    let values: Vec<f32> = bits.iter().map(|b| f16::from_le_bytes(*b).to_f32()).collect();
    let reference = LinearImage { width, height, pixels: values.as_chunks::<3>().0.to_vec() };
    let picture = finished.picture();
    let mut test = LinearImage::from_layer(&picture, &picture.layers[0]);
    // Both as the page has them: a picture that was kept must not differ from itself.
    test.pixels.par_iter_mut().for_each(|pixel| *pixel = pixel.map(|v| f16::from_f32(v).to_f32()));
    let options = CompareOptions { display: Some(display), ..CompareOptions::default() };
    let compared = measure(&reference, &test, &options).map_err(|e| e.to_string())?;
    let mut errors = vec![f16::ZERO; compared.flip.len()];
    errors.convert_from_f32_slice(&compared.flip);
    let errors = errors.iter().flat_map(|e| e.to_le_bytes());
    Ok(with_facts(&json!(compared.comparison), errors))
}

/// The exact values of a layer of the picture at rest: as JSON, preceded by its length, the name,
/// channels and size, and the range of the first channel in pixels that surfaces fill; then the
/// values as 32-bit floats, little endian. `None` while the picture with this layer is still to
/// come.
pub fn layer(session: &Session, name: &str) -> Result<Option<Vec<u8>>, String> {
    by_name("layer", &Aov::ALL, Aov::name, name)?;
    let Some((version, finished)) = lock(&session.finished).clone() else { return Ok(None) };
    let picture = finished.picture();
    let Some(layer) = picture.layers[1..].iter().find(|layer| layer.name == name) else {
        return Ok(None);
    };
    // The camera is known as long as nothing has changed.
    let now = session.now();
    let range = (now.version == version)
        .then(|| filled(&now, &finished.compiled))
        .and_then(|filled| range(&layer.values, layer.channels.len(), &filled));
    let facts = json!({
        "name": layer.name, "channels": layer.channels, "size": [picture.width, picture.height],
        "range": range,
    });
    Ok(Some(with_facts(&facts, layer.values.iter().flat_map(|v| v.to_le_bytes()))))
}

/// The least and the greatest of the first of so many channels, in the pixels that are filled.
/// `None` if none is.
fn range(values: &[f32], channels: usize, filled: &[bool]) -> Option<[f32; 2]> {
    let values = values.chunks_exact(channels.max(1)).map(|value| value[0]).zip(filled);
    let counted = values.filter(|(value, is_filled)| **is_filled && value.is_finite());
    counted.map(|(value, _)| [value; 2]).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// The pixels that surfaces fill: at silhouettes, values are means with those of the background.
/// There are surfaces in the middles of all pixels within reach of the filter.
fn filled(snapshot: &Snapshot, compiled: &CompiledScene) -> Vec<bool> {
    let [width, height] = snapshot.settings.size.map(|side| side as usize);
    let filter = snell_render::job::camera_filter(compiled);
    let is_hit = |i: usize| {
        let film = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let sample = CameraSample { film, lens: Vec2::splat(0.5) };
        let ray = snapshot.camera.ray(&sample, snapshot.settings.size).ray;
        compiled.world.closest_one(&ray, filter.at(0)).is_hit()
    };
    let hits: Vec<bool> = (0..width * height).into_par_iter().map(is_hit).collect();
    let reach = snapshot.settings.filter.radius().ceil() as usize;
    within(&within(&hits, reach, [width, height], 1), reach, [width, height], width)
}

/// Where all flags within reach along an axis are set, whose neighbours are `step` apart.
fn within(flags: &[bool], reach: usize, [width, height]: [usize; 2], step: usize) -> Vec<bool> {
    let all = |i: usize| {
        let (at, count) = if step == 1 { (i % width, width) } else { (i / width, height) };
        let first = i - at * step;
        let mut range = at.saturating_sub(reach)..(at + reach + 1).min(count);
        range.all(|place| flags[first + place * step])
    };
    (0..flags.len()).into_par_iter().map(all).collect()
}

/// JSON with its length before it, padded to whole words, and bytes after it.
fn with_facts(facts: &serde_json::Value, bytes: impl Iterator<Item = u8>) -> Vec<u8> {
    let mut text = facts.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = (text.len() as u32).to_le_bytes().to_vec();
    out.extend(text);
    out.extend(bytes);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_formats::image::{WriteOptions, encode_image_as};
    use snell_scene::{Layer, LayeredImage};

    fn grey(width: u32, value: f32) -> LayeredImage {
        let channels = ["R", "G", "B"].map(String::from).to_vec();
        let values = vec![value; 3 * width as usize];
        let layers = vec![Layer { name: String::new(), channels, values }];
        LayeredImage { width, height: 1, layers, metadata: Vec::new() }
    }

    #[test]
    fn references_of_every_format_become_the_same_linear_values() {
        for format in ["exr", "pfm", "hdr", "png"] {
            let bytes = encode_image_as(format, &grey(2, 0.5), &WriteOptions::default())
                .expect("a picture can be written");
            let frame = reference(&format!("grey.{format}"), bytes).expect("a picture");
            let values = halves::tests::unpack(&frame[FrameHeader::SIZE..], 2, 2);
            for value in values.into_iter().map(f16::from_bits) {
                assert!((value.to_f32() - 0.5).abs() < 0.004, "{format}: {value}");
            }
        }
    }

    #[test]
    fn pixels_at_silhouettes_are_not_in_the_range_of_a_layer() {
        let hits = [[1, 1, 1, 1, 0], [1, 1, 1, 1, 0], [1, 1, 1, 1, 1]];
        let hits = hits.map(|row| row.map(|hit| hit == 1));
        let rows = within(hits.as_flattened(), 1, [5, 3], 1);
        let filled = within(&rows, 1, [5, 3], 5);
        let wanted = [[1, 1, 1, 0, 0]; 3].map(|row| row.map(|hit| hit == 1));
        assert_eq!(filled, wanted.as_flattened());
        let depths = [2.0, f32::NAN, 3.0, 0.5, 0.0];
        assert_eq!(range(&depths, 1, &filled[..5]), Some([2.0, 3.0]));
        assert_eq!(range(&[1.0, 0.5], 1, &[false; 2]), None);
    }

    #[test]
    fn what_is_no_picture_is_an_error_that_names_the_file() {
        for bytes in [&b"ply\n"[..], b"", b"\x76\x2f\x31\x01 damaged"] {
            let said = reference("odd.exr", bytes.to_vec()).expect_err("no picture");
            assert!(said.contains("odd.exr"), "{said}");
        }
    }
}
