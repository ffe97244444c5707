//! Encodes pictures: JPEG while something moves, compressed 16-bit floats at rest. Where there are
//! threads, one encodes while the next picture is rendered.

use crate::halves;
use crate::protocol::{FrameHeader, ToPage};
use crate::session::{Frame, Session};
use half::f16;
use rayon::prelude::*;
use snell_formats::image::{Display, Tonemap, display_value};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::Scope;

/// Quality of JPEG while something moves.
const JPEG_QUALITY: u8 = 82;
/// The same if pictures would come too rarely: their size is half.
const LOW_QUALITY: u8 = 45;
/// Time that a moving picture may take on the line.
const ON_THE_LINE: f64 = 0.1;
/// Time that a picture at rest may take there, unless it is the last one, of which every bit is
/// shown.
const AT_REST: f64 = 1.0;

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

/// Encodes pictures and publishes them in order.
pub enum Encoder<'env> {
    /// On a thread of its own, which ends when the encoder is dropped.
    Beside(SyncSender<Picture>),
    /// On the thread that renders.
    Here(Publisher<'env>),
}

impl<'env> Encoder<'env> {
    /// An encoder for the pages of a session, on a thread of its own.
    pub fn beside<'scope>(scope: &'scope Scope<'scope, 'env>, session: &'env Session) -> Self {
        // The channel has no queue: a renderer that is faster than the encoder waits, so that
        // pictures are never outdated.
        let (pictures, incoming) = sync_channel::<Picture>(0);
        scope.spawn(move || {
            let mut publisher = Publisher::new(session);
            incoming.into_iter().for_each(|picture| publisher.publish(picture));
        });
        Self::Beside(pictures)
    }

    /// An encoder on the thread that renders.
    pub fn here(session: &'env Session) -> Self {
        Self::Here(Publisher::new(session))
    }

    /// Passes on a picture, once the previous one is encoded. Fails if the thread has panicked.
    pub fn send(&mut self, picture: Picture) -> Result<(), String> {
        let fault = |_| "a fault in the encoder; please start again".into();
        match self {
            Self::Beside(pictures) => pictures.send(picture).map_err(fault),
            Self::Here(publisher) => {
                publisher.publish(picture);
                Ok(())
            }
        }
    }
}

/// Encodes pictures for the pages of a session.
pub struct Publisher<'env> {
    session: &'env Session,
    table: DisplayTable,
}

impl<'env> Publisher<'env> {
    fn new(session: &'env Session) -> Self {
        Self { session, table: DisplayTable::new(Display::default()) }
    }

    fn publish(&mut self, picture: Picture) {
        let (session, table) = (self.session, &mut self.table);
        let number = picture.header.frame;
        let is_moving = picture.header.wanted == 0;
        let time = if is_moving { ON_THE_LINE } else { AT_REST };
        let most = session.pace.bytes_within(time);
        match catch_unwind(AssertUnwindSafe(|| bytes_of(picture, table, most))) {
            Ok(Some(bytes)) => {
                let frame = Frame { number, is_moving, bytes };
                session.frames.send_replace(Some(Arc::new(frame)));
            }
            Ok(None) | Err(_) => {
                let message = "a fault in the encoder: this picture is not shown".into();
                session.tell(ToPage::Error { message });
            }
        }
    }
}

/// The bytes of a picture for the pages. JPEG gets a lower quality, and floats at rest are rounded,
/// if they would have more than `most` bytes. `None` for sizes that JPEG does not support.
fn bytes_of(
    Picture { header, rgb, display }: Picture,
    table: &mut DisplayTable,
    most: usize,
) -> Option<Vec<u8>> {
    let Some(display) = display else {
        let compress = |is_rounded| {
            let (width, head) = (header.size[0] as usize, header.to_bytes().to_vec());
            halves::compress(&rgb, width, is_rounded, head).ok()
        };
        let bytes = compress(false)?;
        let is_last = header.samples >= header.wanted;
        return if bytes.len() > most && !is_last { compress(true) } else { Some(bytes) };
    };
    if *table.display() != display {
        *table = DisplayTable::new(display);
    }
    let bytes = jpeg(header, &rgb, table, JPEG_QUALITY)?;
    if bytes.len() > most { jpeg(header, &rgb, table, LOW_QUALITY) } else { Some(bytes) }
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
pub fn jpeg(
    header: FrameHeader,
    rgb: &[f32],
    table: &DisplayTable,
    quality: u8,
) -> Option<Vec<u8>> {
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
    let encoder = jpeg_encoder::Encoder::new(&mut out, quality);
    encoder.encode(&bytes, width, height, jpeg_encoder::ColorType::Rgb).ok()?;
    Some(out)
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
            denoised: 0.0,
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
    fn a_picture_follows_its_header_and_slow_lines_get_smaller_ones() {
        let (size, rgb) = ([64, 64], (0..64 * 64 * 3).map(|i| (i % 7) as f32 / 7.0).collect());
        let picture = |display| Picture { header: header(size), rgb: Vec::clone(&rgb), display };
        let mut table = DisplayTable::new(Display::default());
        let mut bytes = |display, most| {
            let bytes = bytes_of(picture(display), &mut table, most).expect("a small picture");
            assert_eq!(bytes[4..8], 1_u32.to_le_bytes());
            bytes.len()
        };
        assert!((FrameHeader::SIZE..bytes(None, usize::MAX)).contains(&bytes(None, 1)));
        let moving = Some(Display::default());
        assert!(bytes(moving, 1) < bytes(moving, usize::MAX));
    }

    #[test]
    fn a_jpeg_is_a_jpeg_and_sizes_beyond_its_limit_are_refused() {
        let table = DisplayTable::new(Display::default());
        let bytes =
            jpeg(header([2, 2]), &[0.5; 12], &table, JPEG_QUALITY).expect("a small picture");
        assert_eq!(bytes[FrameHeader::SIZE..][..2], [0xff, 0xd8]);
        assert!(jpeg(header([70_000, 1]), &[0.5; 210_000], &table, 50).is_none());
    }
}
