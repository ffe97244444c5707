use super::*;

const ALL: [Layout; 24] = [
    Layout::Plain { kind: Kind::U8, order: &[0, 1] },
    Layout::Plain { kind: Kind::I8, order: &[2, 1, 0, 4] },
    Layout::Plain { kind: Kind::U16, order: &[0] },
    Layout::Plain { kind: Kind::I16, order: &[0, 1, 2, 3] },
    Layout::Plain { kind: Kind::F16, order: &[0, 1, 2] },
    Layout::Plain { kind: Kind::F32, order: &[0, 1] },
    Layout::Packed { bytes: 2, masks: [0x1f << 11, 0x3f << 5, 0x1f, 0] },
    Layout::Packed { bytes: 3, masks: [1 << 23, 0, 0, 0x7fff] },
    Layout::SharedExponent,
    Layout::SmallFloats,
    Layout::Bc1,
    Layout::Bc2,
    Layout::Bc3,
    Layout::Bc4(false),
    Layout::Bc4(true),
    Layout::Bc5(false),
    Layout::Bc5(true),
    Layout::Bc6(false),
    Layout::Bc6(true),
    Layout::Bc7,
    Layout::Etc2,
    Layout::EacR(true),
    Layout::EacRg(false),
    Layout::Astc(12, 10),
];

/// The pixels of a picture of one colour encoding, as stored values.
fn pixels(layout: Layout, size: [u32; 2], bytes: &[u8]) -> Vec<[f32; 4]> {
    let image = decode(layout, Encoding::Linear, size, bytes).expect("enough bytes");
    let [width, height] = size;
    let at = |y| (0..width).map(move |x| (x, y));
    (0..height).flat_map(at).map(|(x, y)| image.rgba(x, y)).collect()
}

#[test]
fn every_layout_makes_as_many_values_as_pixels_and_refuses_too_few_bytes() {
    for layout in ALL {
        for size in [[1, 1], [5, 3], [4, 4], [13, 11]] {
            let stored = layout.stored_bytes(size[0], size[1]) as usize;
            for byte in [0, 0x5a, 0xff] {
                let bytes = vec![byte; stored];
                let Ok(image) = decode(layout, Encoding::Linear, size, &bytes) else {
                    // Its decoder checks nothing.
                    assert!(matches!(layout, Layout::Astc(..)), "{layout:?}");
                    continue;
                };
                let values = match &image.pixels {
                    Pixels::U8(values) => values.len(),
                    Pixels::U16(values) => values.len() * 2,
                    Pixels::F32(values) => values.len() * 4,
                };
                let pixels = (size[0] * size[1]) as usize;
                assert!(values <= pixels * layout.pixel_bytes() as usize, "{layout:?}");
                assert!((1..=4).contains(&image.channels));
                assert_eq!(values % (pixels * image.channels as usize), 0, "{layout:?}");
                assert!(decode(layout, Encoding::Linear, size, &bytes[1..]).is_err());
            }
        }
    }
}

#[test]
fn plain_and_packed_values_go_to_their_channels() {
    let bgr = Layout::Plain { kind: Kind::U8, order: &[2, 1, 0, 4] };
    assert_eq!(pixels(bgr, [1, 1], &[0, 51, 255, 7]), [[1.0, 0.2, 0.0, 1.0]]);
    let signed = Layout::Plain { kind: Kind::I8, order: &[0] };
    assert_eq!(pixels(signed, [3, 1], &[0x80, 0x81, 127]).map_first(), [0.0, 0.0, 1.0]);
    let half = Layout::Plain { kind: Kind::F16, order: &[0] };
    assert_eq!(pixels(half, [2, 1], &[0, 0x3c, 0, 0xc0]).map_first(), [1.0, -2.0]);
    let rgb565 = Layout::Packed { bytes: 2, masks: [0x1f << 11, 0x3f << 5, 0x1f, 0] };
    let words = [0xf800u16, 0x07e0, 0x001f].map(u16::to_le_bytes).concat();
    let one = |i: usize| std::array::from_fn(|c| f32::from(u8::from(c == i || c == 3)));
    assert_eq!(pixels(rgb565, [3, 1], &words), [one(0), one(1), one(2)]);
    let ten = Layout::Packed { bytes: 4, masks: [0x3ff, 0x3ff << 10, 0x3ff << 20, 3 << 30] };
    let word = (1023u32 | 1 << 30).to_le_bytes();
    let [r, g, b, a] = pixels(ten, [1, 1], &word)[0];
    assert_eq!((r, g, b), (1.0, 0.0, 0.0));
    assert!((a - 1.0 / 3.0).abs() < 1e-4, "{a}");
    // Exponent 16 and numbers of 1, 1/2 and 0: 2, 1 and 0.
    let word = 256u32 | 128 << 9 | 17 << 27;
    assert_eq!(
        pixels(Layout::SharedExponent, [1, 1], &word.to_le_bytes())[0][..3],
        [2.0, 1.0, 0.0]
    );
    let word = 0x3c0u32 | 0x400 << 11 | 0x1c0 << 22;
    assert_eq!(pixels(Layout::SmallFloats, [1, 1], &word.to_le_bytes())[0][..3], [1.0, 2.0, 0.5]);
}

trait First {
    /// The first channel of each pixel.
    fn map_first(&self) -> Vec<f32>;
}

impl First for Vec<[f32; 4]> {
    fn map_first(&self) -> Vec<f32> {
        self.iter().map(|pixel| pixel[0]).collect()
    }
}

/// A block of interpolated values: the ends, and the index of each pixel.
fn ramp(ends: [u8; 2], index: impl Fn(u64) -> u64) -> Vec<u8> {
    let indices = (0..16).fold(0u64, |bits, i| bits | index(i) << (3 * i));
    [&ends[..], &indices.to_le_bytes()[..6]].concat()
}

#[test]
fn one_and_two_channels_are_interpolated_and_have_signs() {
    // The index is the column: the ends, and one seventh from the first end.
    let block = ramp([210, 0], |i| i % 4);
    assert_eq!(
        pixels(Layout::Bc4(false), [4, 1], &block).map_first(),
        [210.0, 0.0, 180.0, 150.0].map(|v| v / 255.0)
    );
    let block = ramp([127, 0x81], |i| i % 2);
    assert_eq!(pixels(Layout::Bc4(true), [2, 1], &block).map_first(), [1.0, 0.0]);
    let both = [ramp([255, 0], |_| 1), ramp([255, 0], |_| 0)].concat();
    let image = decode(Layout::Bc5(false), Encoding::Linear, [1, 1], &both).unwrap();
    assert_eq!((image.channels, image.pixels), (2, Pixels::U8(vec![0, 255])));
    let both = [ramp([127, 0x81], |_| 1), ramp([127, 0x81], |_| 0)].concat();
    let image = decode(Layout::Bc5(true), Encoding::Linear, [1, 1], &both).unwrap();
    assert_eq!((image.channels, image.pixels), (2, Pixels::U16(vec![0, 65535])));
}

#[test]
fn blocks_of_colours_are_decoded() {
    // White and black by turns in the columns.
    let bc1 = [0xff, 0xff, 0, 0, 0x44, 0x44, 0x44, 0x44];
    assert_eq!(
        pixels(Layout::Bc1, [5, 1], &[bc1, bc1].concat()).map_first(),
        [1.0, 0.0, 1.0, 0.0, 1.0]
    );
    // Without the first colour being larger, the last index is transparent.
    let clear = pixels(Layout::Bc1, [1, 1], &[0, 0, 0xff, 0xff, 3, 0, 0, 0]);
    assert_eq!(clear[0][3], 0.0);
    let bc3 = [&ramp([102, 0], |_| 0)[..], &bc1].concat();
    assert_eq!(pixels(Layout::Bc3, [1, 1], &bc3), [[1.0, 1.0, 1.0, 0.4]]);
    // BC7 in mode 5 (bits 0 to 5: 100000): colours of 7 bits for both ends, then alpha of 8.
    let mut bits: u128 = 1 << 5;
    for (channel, value) in [127u128, 0, 64].into_iter().enumerate() {
        bits |= value << (8 + 14 * channel) | value << (15 + 14 * channel);
    }
    bits |= 51 << 50 | 51 << 58;
    let [r, g, b, a] = pixels(Layout::Bc7, [1, 1], &bits.to_le_bytes())[0];
    assert_eq!([r, g, b, a].map(|v| (v * 255.0).round()), [255.0, 0.0, 129.0, 51.0]);
    // BC6H in mode 11 (bits 00011): three colours of 10 bits for both ends; their halves are about
    // 31/64 of the numbers as 16 bits.
    let mut bits: u128 = 0b00011;
    for (channel, value) in [496u128, 0, 256].into_iter().enumerate() {
        bits |= value << (5 + 10 * channel) | value << (35 + 10 * channel);
    }
    let [r, g, b, _] = pixels(Layout::Bc6(false), [1, 1], &bits.to_le_bytes())[0];
    let half = |value: u32| {
        f32::from(half::f16::from_bits(((((value << 16 | 0x8000) >> 10) * 31) >> 6) as u16))
    };
    assert_eq!([r, g, b], [half(496), 0.0, half(256)]);
}

#[test]
fn blocks_of_etc2_eac_and_astc_are_decoded() {
    // Two halves of one colour (4 bits a channel: 15, 0, 8), table 0, all indices 0: 2 is added.
    let etc = [0xff, 0x00, 0x88, 0, 0, 0, 0, 0];
    let pixel = pixels(Layout::Etc2, [1, 1], &etc)[0];
    assert_eq!(pixel.map(|v| (v * 255.0).round()), [255.0, 2.0, 138.0, 255.0]);
    // A planar block (blue overflows) whose three colours are equal.
    let planar = planar([63, 0, 32]);
    for pixel in pixels(Layout::Etc2, [4, 4], &planar) {
        assert_eq!(pixel.map(|v| (v * 255.0).round()), [255.0, 0.0, 130.0, 255.0]);
    }
    // Without a multiplier of alpha and index 4 of table 0: 2 is added.
    let alpha = [100, 0, 0x92, 0x49, 0x24, 0x92, 0x49, 0x24];
    let both = [alpha, etc].concat();
    let [.., a] = pixels(Layout::Etc2Alpha, [1, 1], &both)[0];
    assert!((98.0..=102.0).contains(&(a * 255.0)), "{a}");
    // Base 100 and 1/2; index 4 of table 0 adds 2, in units of 1/2047, or times eight.
    let near = |value: f32, units: f32| (value * 2047.0 - units).abs() < 0.51;
    let small = pixels(Layout::EacR(false), [4, 4], &alpha);
    assert!(small.iter().all(|pixel| near(pixel[0], 806.0)), "{small:?}");
    let large = [100, 0x30, 0x92, 0x49, 0x24, 0x92, 0x49, 0x24];
    assert!(near(pixels(Layout::EacR(false), [1, 1], &large)[0][0], 852.0));
    // The first pixel has the highest bits of the indices, and the second is below it.
    let first = [100, 0x10, 0xe0, 0, 0, 0, 0, 0];
    let found = pixels(Layout::EacR(false), [4, 4], &first).map_first();
    assert!(near(found[0], 100.0 * 8.0 + 4.0 + 14.0 * 8.0) && near(found[4], 780.0), "{found:?}");
    let signed = [0x81, 0x10, 0, 0, 0, 0, 0, 0];
    assert_eq!(pixels(Layout::EacR(true), [1, 1], &signed).map_first(), [0.0]);
    // A void-extent block: one colour in 16 bits a channel.
    let mut astc = vec![0xfc, 0xfd, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff];
    astc.extend([0xffffu16, 0x3333, 0, 0x6666].map(u16::to_le_bytes).concat());
    assert_eq!(pixels(Layout::Astc(6, 5), [2, 2], &astc), [[1.0, 0.2, 0.0, 0.4]; 4]);
}

/// A planar block of ETC2 whose three colours (6, 7 and 6 bits) are equal.
fn planar([r, g, b]: [u64; 3]) -> [u8; 8] {
    let bit = |value: u64, from: u32, to: u32| (value >> from & 1) << to;
    let bits =
        |value: u64, from: u32, count: u32, to: u32| (value >> from & ((1 << count) - 1)) << to;
    let mut block = r << 57 | bit(g, 6, 56) | bits(g, 0, 6, 49) | bit(b, 5, 48);
    block |= bits(b, 3, 2, 43) | bits(b, 0, 3, 39);
    block |= bits(r, 1, 5, 34) | 1 << 33 | bit(r, 0, 32);
    block |= g << 25 | b << 19 | r << 13 | g << 6 | b;
    // The bits of blue that are free make it overflow: 1110 for a negative step from a small one.
    let (high, low) = (bits(b, 3, 2, 0), bits(b, 1, 2, 0));
    block |= if high + low >= 4 { 7 << 45 } else { 1 << 42 };
    block.to_be_bytes()
}

#[test]
fn two_channels_become_a_normal_map_only_if_all_pixels_can_be_normals() {
    let image = |values: Vec<u8>| Image {
        width: values.len() as u32 / 2,
        height: 1,
        channels: 2,
        pixels: Pixels::U8(values),
        encoding: Encoding::Linear,
    };
    let mut normals = image(vec![128, 128, 255, 128, 218, 218]);
    assert!(complete(&mut normals));
    let Pixels::U8(values) = &normals.pixels else { panic!("8 bits stay 8 bits") };
    assert_eq!((normals.channels, values[2]), (3, 255));
    assert!((120..=136).contains(&values[5]) && (120..=136).contains(&values[8]), "{values:?}");
    let mut data = image(vec![128, 128, 255, 255]);
    assert!(!complete(&mut data));
    assert_eq!(data.pixels, Pixels::U8(vec![128, 128, 0, 255, 255, 0]));
}

#[test]
fn channels_are_rearranged_and_rows_turned() {
    let image = Image {
        width: 1,
        height: 2,
        channels: 2,
        pixels: Pixels::U8(vec![1, 2, 3, 4]),
        encoding: Encoding::Linear,
    };
    let with =
        |letters| swizzle(image.clone(), letters).map(|image| (image.channels, image.pixels));
    assert_eq!(with("rrrg"), Some((2, Pixels::U8(vec![1, 2, 3, 4]))));
    assert_eq!(with("ggg1"), Some((1, Pixels::U8(vec![2, 4]))));
    assert_eq!(with("gr01"), Some((3, Pixels::U8(vec![2, 1, 0, 4, 3, 0]))));
    assert_eq!(with("1bra"), Some((4, Pixels::U8(vec![255, 0, 1, 255, 255, 0, 3, 255]))));
    assert_eq!(with("rgb"), None);
    assert_eq!(with("xyzw"), None);
    let mut turned = image;
    flip(&mut turned);
    assert_eq!(turned.pixels, Pixels::U8(vec![3, 4, 1, 2]));
}
