//! KTX2 pictures with Basis Universal compression (ETC1S and UASTC), as in `KHR_texture_basisu` of
//! glTF. The crate `basisu` transcodes them to plain pixels.

use super::picture::check_size;
use crate::{Input, Place, ReadError};
use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use half::f16;
use snell_scene::{Encoding, Image, Pixels};

/// The first bytes of every KTX2 file.
pub const IDENTIFIER: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Bytes of a pixel of four display values.
const DISPLAY_BYTES: u64 = 4;

/// Bytes of a pixel of four linear values: those that the decoder makes, of 16 bits, and those that
/// are returned.
const LINEAR_BYTES: u64 = 8 + 16;

/// Remedy for files that are not what glTF allows.
const REMEDY: &str = "save it as PNG, or as KTX2 with Basis Universal compression";

/// Decodes the largest level of the first picture of a file.
pub fn read(input: &Input) -> Result<Image, ReadError> {
    let damaged = || {
        input.error(
            Place::Whole,
            "the KTX2 picture is damaged, or not compressed as Basis Universal",
            REMEDY,
        )
    };
    if !input.bytes.starts_with(IDENTIFIER) {
        return Err(damaged());
    }
    let word = |at: usize| {
        let bytes = input.bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    };
    let header = || -> Option<[u32; 3]> { Some([word(12)?, word(20)?, word(24)?]) };
    let [vulkan_format, width, height] = header().ok_or_else(damaged)?;
    check_size(input, width.into(), height.into(), DISPLAY_BYTES)?;
    let pixels = u64::from(width) * u64::from(height);
    if !fits_picture(input, word, pixels) {
        return Err(damaged());
    }
    let transcoder = Transcoder::new(&input.bytes).map_err(|_| match vulkan_format {
        0 => damaged(),
        format => input.error(
            Place::Whole,
            format!("the KTX2 picture has the Vulkan format {format}, which is not supported"),
            REMEDY,
        ),
    })?;
    use SourceFormat::{AstcHdr6x6, Etc1s, UastcHdr4x4, UastcHdr6x6, UastcLdr};
    let format = transcoder.source_format();
    // Other formats unpack to sizes that the file's header does not tell.
    if !matches!(format, Etc1s | UastcLdr | UastcHdr4x4 | UastcHdr6x6 | AstcHdr6x6) {
        let problem = "the KTX2 picture is neither ETC1S nor UASTC";
        return Err(input.error(Place::Whole, problem, REMEDY));
    }
    let transcode = |target| {
        let bytes = transcoder.transcode_image(0, 0, 0, target, DecodeFlags::NONE);
        bytes.map_err(|_| damaged())
    };
    match format {
        UastcHdr4x4 | AstcHdr6x6 | UastcHdr6x6 => {
            input.charge(pixels * (LINEAR_BYTES - DISPLAY_BYTES), "a KTX2 picture")?;
            let values = transcode(TargetFormat::RgbaHalf)?;
            let values = values.as_chunks::<2>().0.iter().map(|b| f16::from_le_bytes(*b).to_f32());
            let pixels = Pixels::F32(values.collect());
            Ok(Image { width, height, channels: 4, pixels, encoding: Encoding::Linear })
        }
        _ => {
            let pixels = Pixels::U8(transcode(TargetFormat::Rgba32)?);
            Ok(Image { width, height, channels: 4, pixels, encoding: Encoding::Srgb })
        }
    }
}

/// True if the decompressed size that the file declares for its largest level is no more than its
/// pixels can take: blocks of 16 bytes have at least 16 pixels, and a side may be cut in a block.
fn fits_picture(input: &Input, word: impl Fn(usize) -> Option<u32>, pixels: u64) -> bool {
    const LAYERS: usize = 32;
    const FACES: usize = 36;
    const DECOMPRESSED_BYTES: usize = 96;
    let words = [LAYERS, FACES, DECOMPRESSED_BYTES, DECOMPRESSED_BYTES + 4].map(word);
    let [Some(layers), Some(faces), Some(low), Some(high)] = words else { return false };
    let length = u64::from(low) | u64::from(high) << 32;
    let pictures = u64::from(layers.max(1)) * u64::from(faces.max(1));
    let most = pixels.saturating_mul(16).saturating_add(64).saturating_mul(pictures);
    length <= most && input.charge(length, "a KTX2 picture").is_ok()
}
