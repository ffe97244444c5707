//! KTX2 pictures with Basis Universal compression (ETC1S and UASTC), as in `KHR_texture_basisu` of
//! glTF. The crate `basisu` transcodes them to plain pixels.

use super::{Header, REMEDY, ZSTD, charge_window, damaged};
use crate::image::picture::check_size;
use crate::{Input, Place, ReadError};
use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use half::f16;
use snell_scene::{Encoding, Image, Pixels};

/// Bytes of a pixel of four display values.
const DISPLAY_BYTES: u64 = 4;

/// Bytes of a pixel of four linear values: those that the decoder makes, of 16 bits, and those that
/// are returned.
const LINEAR_BYTES: u64 = 8 + 16;

/// Decodes the largest level of the first picture of a file.
pub fn read(input: &Input, header: &Header) -> Result<Image, ReadError> {
    let [width, height] = header.size;
    check_size(input, width.into(), height.into(), DISPLAY_BYTES)?;
    let pixels = u64::from(width) * u64::from(height);
    check_level(input, header, pixels)?;
    let transcoder = Transcoder::new(&input.bytes).map_err(|_| match header.format {
        0 => {
            let problem = format!(
                "the KTX2 picture is damaged, or has a newer compression by Basis Universal, which \
                is not supported (colour model {}, supercompression {})",
                header.model, header.supercompression
            );
            input.error(Place::Whole, problem, REMEDY)
        }
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
        let problem =
            format!("the KTX2 picture has the compression {format:?}, which is not supported");
        return Err(input.error(Place::Whole, problem, REMEDY));
    }
    let transcode = |target| {
        let bytes = transcoder.transcode_image(0, 0, 0, target, DecodeFlags::NONE);
        bytes.map_err(|_| damaged(input, "its texels cannot be decoded"))
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

/// Charges the decompressed size that the file declares for its largest level, and refuses it if it
/// is more than its pixels can take: blocks of 16 bytes have at least 16 pixels, and a side may be
/// cut in a block.
fn check_level(input: &Input, header: &Header, pixels: u64) -> Result<(), ReadError> {
    let most = pixels.saturating_mul(16).saturating_add(64).saturating_mul(header.pictures());
    if header.level_bytes > most {
        let problem = format!(
            "the KTX2 picture declares {} bytes for its largest level, and its pixels take no more \
            than {most}",
            header.level_bytes
        );
        return Err(input.error(Place::Whole, problem, "copy or export it again"));
    }
    input.charge(header.level_bytes, "the KTX2 picture with all of its faces and layers")?;
    let packed = input.bytes.get(header.level.clone());
    match packed {
        Some(packed) if header.supercompression == ZSTD => charge_window(input, packed),
        _ => Ok(()),
    }
}
