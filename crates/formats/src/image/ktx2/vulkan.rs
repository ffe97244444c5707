//! Formats of Vulkan, by number (`VkFormat`).

use super::super::texels::{Kind, Layout};
use snell_scene::Encoding;

const R: &[u8] = &[0];
const RG: &[u8] = &[0, 1];
const RGB: &[u8] = &[0, 1, 2];
const BGR: &[u8] = &[2, 1, 0];
const RGBA: &[u8] = &[0, 1, 2, 3];
const BGRA: &[u8] = &[2, 1, 0, 3];

/// The sizes of the blocks of ASTC, in the order of the formats.
const ASTC: [[u8; 2]; 14] = [
    [4, 4],
    [5, 4],
    [5, 5],
    [6, 5],
    [6, 6],
    [8, 5],
    [8, 6],
    [8, 8],
    [10, 5],
    [10, 6],
    [10, 8],
    [10, 10],
    [12, 10],
    [12, 12],
];

/// The layout of a format, and the encoding, if the format says it. `None` for other formats.
pub fn format(number: u32) -> Option<(Layout, Option<Encoding>)> {
    use Kind::{F16, F32, I8, I16, U8, U16};
    let plain = |kind, order| Layout::Plain { kind, order };
    let packed = |bytes, masks| Layout::Packed { bytes, masks };
    let layout = match number {
        2 => packed(2, [0xf << 12, 0xf << 8, 0xf << 4, 0xf]),
        3 => packed(2, [0xf << 4, 0xf << 8, 0xf << 12, 0xf]),
        4 => packed(2, [0x1f << 11, 0x3f << 5, 0x1f, 0]),
        5 => packed(2, [0x1f, 0x3f << 5, 0x1f << 11, 0]),
        6 => packed(2, [0x1f << 11, 0x1f << 6, 0x1f << 1, 1]),
        7 => packed(2, [0x1f << 1, 0x1f << 6, 0x1f << 11, 1]),
        8 => packed(2, [0x1f << 10, 0x1f << 5, 0x1f, 1 << 15]),
        9 | 15 => plain(U8, R),
        10 => plain(I8, R),
        16 | 22 => plain(U8, RG),
        17 => plain(I8, RG),
        23 | 29 => plain(U8, RGB),
        24 => plain(I8, RGB),
        30 | 36 => plain(U8, BGR),
        37 | 43 | 51 | 57 => plain(U8, RGBA),
        38 | 52 => plain(I8, RGBA),
        44 | 50 => plain(U8, BGRA),
        58 => packed(4, [0x3ff << 20, 0x3ff << 10, 0x3ff, 3 << 30]),
        64 => packed(4, [0x3ff, 0x3ff << 10, 0x3ff << 20, 3 << 30]),
        70 => plain(U16, R),
        71 => plain(I16, R),
        76 => plain(F16, R),
        77 => plain(U16, RG),
        78 => plain(I16, RG),
        83 => plain(F16, RG),
        84 => plain(U16, RGB),
        85 => plain(I16, RGB),
        90 => plain(F16, RGB),
        91 => plain(U16, RGBA),
        92 => plain(I16, RGBA),
        97 => plain(F16, RGBA),
        100 => plain(F32, R),
        103 => plain(F32, RG),
        106 => plain(F32, RGB),
        109 => plain(F32, RGBA),
        122 => Layout::SmallFloats,
        123 => Layout::SharedExponent,
        131..=134 => Layout::Bc1,
        135 | 136 => Layout::Bc2,
        137 | 138 => Layout::Bc3,
        139 => Layout::Bc4(false),
        140 => Layout::Bc4(true),
        141 => Layout::Bc5(false),
        142 => Layout::Bc5(true),
        143 => Layout::Bc6(false),
        144 => Layout::Bc6(true),
        145 | 146 => Layout::Bc7,
        147 | 148 => Layout::Etc2,
        149 | 150 => Layout::Etc2Punched,
        151 | 152 => Layout::Etc2Alpha,
        153 => Layout::EacR(false),
        154 => Layout::EacR(true),
        155 => Layout::EacRg(false),
        156 => Layout::EacRg(true),
        157..=184 => {
            let [x, y] = ASTC[(number - 157) as usize / 2];
            Layout::Astc(x, y)
        }
        _ => return None,
    };
    let is_srgb = match number {
        15 | 22 | 29 | 36 | 43 | 50 | 57 => true,
        132 | 134 | 136 | 138 | 146 | 148 | 150 | 152 => true,
        157..=184 => number.is_multiple_of(2),
        _ => false,
    };
    let encoding = match (is_srgb, layout.is_linear() || layout.has_two_channels()) {
        (true, _) => Some(Encoding::Srgb),
        (_, true) => Some(Encoding::Linear),
        _ => None,
    };
    Some((layout, encoding))
}
