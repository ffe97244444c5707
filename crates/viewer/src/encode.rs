//! Encodes pictures: JPEG while something moves, 16-bit floats at rest. A thread encodes while the
//! next picture is rendered.

use crate::protocol::{FrameHeader, ToPage};
use crate::session::{Frame, Session};
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use snell_formats::image::{Display, Tonemap, display_value};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::Scope;

/// Quality of JPEG while something moves.
const JPEG_QUALITY: u8 = 82;

/// A picture for the pages.
pub struct Picture {
    /// The header that precedes the picture's bytes.
    pub header: FrameHeader,
    /// Linear values, three per pixel.
    pub rgb: Vec<f32>,
    /// Display settings if the picture is sent as JPEG; otherwise it is sent as half floats, which
    /// the pages convert themselves.
    pub display: Option<Display>,
}

/// Encodes pictures and publishes them in order. Its thread ends when the encoder is dropped.
pub struct Encoder {
    pictures: SyncSender<Picture>,
}

impl Encoder {
    /// An encoder for the pages of a session.
    pub fn new<'scope, 'env>(scope: &'scope Scope<'scope, 'env>, session: &'env Session) -> Self {
        // The channel has no queue: a renderer that is faster than the encoder waits, so that
        // pictures are never outdated.
        let (pictures, incoming) = sync_channel::<Picture>(0);
        scope.spawn(move || {
            let mut table = DisplayTable::new(Display::default());
            for picture in incoming {
                let number = picture.header.frame;
                match catch_unwind(AssertUnwindSafe(|| bytes_of(picture, &mut table))) {
                    Ok(Some(bytes)) => {
                        session
                            .frames
                            .send_replace(Some(Arc::new(Frame { number, bytes: bytes.into() })));
                    }
                    Ok(None) | Err(_) => {
                        let message = "a fault in the encoder: this picture is not shown".into();
                        session.tell(ToPage::Error { message });
                    }
                }
            }
        });
        Self { pictures }
    }

    /// Passes on a picture, once the previous one is encoded. Fails if the thread has panicked.
    pub fn send(&self, picture: Picture) -> Result<(), String> {
        self.pictures.send(picture).map_err(|_| "a fault in the encoder; please start again".into())
    }
}

/// The bytes of a picture for the pages. `None` for sizes that JPEG does not support.
fn bytes_of(
    Picture { header, rgb, display }: Picture,
    table: &mut DisplayTable,
) -> Option<Vec<u8>> {
    let Some(display) = display else { return Some(half_floats(header, &rgb)) };
    if *table.display() != display {
        *table = DisplayTable::new(display);
    }
    jpeg(header, &rgb, table)
}

/// Table of display values by half float, for tone maps that treat channels independently. It is
/// made once per exposure.
pub struct DisplayTable {
    display: Display,
    /// Display values from 0 to 255, indexed by the bits of a half float; empty if the tone map
    /// mixes channels.
    table: Vec<u8>,
}

impl DisplayTable {
    /// A table for these display settings.
    pub fn new(display: Display) -> Self {
        let byte =
            |bits: u16| to_byte(display_value([f16::from_bits(bits).to_f32(); 3], &display)[0]);
        let is_separable = display.tonemap == Tonemap::None;
        let table = if is_separable {
            (0..=u16::MAX).into_par_iter().map(byte).collect()
        } else {
            Vec::new()
        };
        Self { display, table }
    }

    /// The display settings of this table.
    pub fn display(&self) -> &Display {
        &self.display
    }

    fn pixel(&self, rgb: [f32; 3]) -> [u8; 3] {
        if self.table.is_empty() {
            return display_value(rgb, &self.display).map(to_byte);
        }
        rgb.map(|v| self.table[usize::from(f16::from_f32(v).to_bits())])
    }
}

fn to_byte(value: f32) -> u8 {
    (value * 255.0 + 0.5) as u8
}

/// A JPEG of linear RGB values (three per pixel), after its header. `None` for sizes that JPEG does
/// not support.
pub fn jpeg(header: FrameHeader, rgb: &[f32], table: &DisplayTable) -> Option<Vec<u8>> {
    let [width, height] = header.size;
    let row = width as usize * 3;
    let mut bytes = vec![0; rgb.len()];
    bytes.par_chunks_mut(row.max(1)).zip(rgb.par_chunks(row.max(1))).with_min_len(64).for_each(
        |(to, from)| {
            for (to, from) in to.chunks_exact_mut(3).zip(from.chunks_exact(3)) {
                to.copy_from_slice(&table.pixel([from[0], from[1], from[2]]));
            }
        },
    );
    let mut out = header.to_bytes().to_vec();
    let (width, height) = (u16::try_from(width).ok()?, u16::try_from(height).ok()?);
    let encoder = jpeg_encoder::Encoder::new(&mut out, JPEG_QUALITY);
    encoder.encode(&bytes, width, height, jpeg_encoder::ColorType::Rgb).ok()?;
    Some(out)
}

/// Encodes linear RGB values as half floats, after the header.
pub fn half_floats(header: FrameHeader, rgb: &[f32]) -> Vec<u8> {
    let mut halves = vec![f16::ZERO; rgb.len()];
    halves
        .par_chunks_mut(1 << 15)
        .zip(rgb.par_chunks(1 << 15))
        .for_each(|(to, from)| to.convert_from_f32_slice(from));
    let mut out = Vec::with_capacity(FrameHeader::SIZE + rgb.len() * 2);
    out.extend_from_slice(&header.to_bytes());
    out.extend(halves.iter().flat_map(|h| h.to_le_bytes()));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(size: [u32; 2]) -> FrameHeader {
        FrameHeader {
            kind: 0,
            frame: 1,
            seq: 2,
            generation: 3,
            size,
            samples: 4,
            wanted: 5,
            milliseconds: 6.0,
            noise: 0.5,
        }
    }

    #[test]
    fn a_table_gives_what_the_formula_gives() {
        let display = Display { exposure: 0.7, ..Display::default() };
        let table = DisplayTable::new(display);
        for value in [0.0, 1e-4, 0.18, 0.5, 1.0, 1e6, f32::NAN, -1.0] {
            let exact = display_value([value; 3], &display)[0] * 255.0;
            assert!((f32::from(table.pixel([value; 3])[0]) - exact).abs() < 0.7, "{value}");
        }
    }

    #[test]
    fn half_floats_follow_the_header() {
        let bytes = half_floats(header([1, 1]), &[0.5, 1.0, 1e9]);
        assert_eq!(bytes.len(), FrameHeader::SIZE + 6);
        assert_eq!(bytes[4..8], 1_u32.to_le_bytes());
        let values: Vec<f32> = bytes[FrameHeader::SIZE..]
            .chunks(2)
            .map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32())
            .collect();
        assert_eq!(values, [0.5, 1.0, f32::INFINITY]);
    }

    #[test]
    fn a_jpeg_is_a_jpeg_and_sizes_beyond_its_limit_are_refused() {
        let table = DisplayTable::new(Display::default());
        let bytes = jpeg(header([2, 2]), &[0.5; 12], &table).expect("a small picture");
        assert_eq!(bytes[FrameHeader::SIZE..][..2], [0xff, 0xd8]);
        assert!(jpeg(header([70_000, 1]), &[0.5; 210_000], &table).is_none());
    }
}
