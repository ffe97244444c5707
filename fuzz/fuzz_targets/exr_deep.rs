//! Whatever the bytes are, reading them as the chunks of an OpenEXR picture with deep samples ends
//! in finite pixels or in an error. Headers and tables are always whole; the first bytes choose
//! what they say.

#![no_main]

/// The channels, their types (0 for integers, 1 for half, 2 for float) in this order.
const CHANNELS: [(&str, i32); 4] = [("A", 1), ("R", 2), ("Z", 2), ("id", 0)];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let [how, width, height, rest @ ..] = bytes else { return };
    let size = [1 + i32::from(width % 8), 1 + i32::from(height % 8)];
    let (compression, is_tiled, parts) = (how % 4, how & 4 != 0, 1 + usize::from(how >> 3) % 2);
    let tile = is_tiled.then_some([1 + i32::from(width >> 3) % 4, 1 + i32::from(height >> 3) % 4]);
    let flags = 0x08 | u8::from(parts > 1) << 4;
    let mut file = vec![0x76, 0x2f, 0x31, 0x01, 2, flags, 0, 0];
    for part in 0..parts {
        header(part, compression, size, tile, &mut file);
    }
    if parts > 1 {
        file.push(0);
    }
    let lines = if compression == 3 { 16 } else { 1 };
    let [across, down] = tile.unwrap_or([size[0], lines]);
    let (columns, rows) = ((size[0] + across - 1) / across, (size[1] + down - 1) / down);
    let places: Vec<[i32; 3]> = (0..parts as i32)
        .flat_map(|p| (0..rows).flat_map(move |y| (0..columns).map(move |x| [p, x, y])))
        .collect();
    let (mut rest, mut chunks, mut offset) = (rest, Vec::new(), file.len() + 8 * places.len());
    for [part, x, y] in places {
        let mut chunk = Vec::new();
        if parts > 1 {
            chunk.extend(part.to_le_bytes());
        }
        match tile {
            Some(_) => chunk.extend([x, y, 0, 0].map(i32::to_le_bytes).concat()),
            None => chunk.extend((y * down).to_le_bytes()),
        }
        // Lengths of the counts and of the samples, and 14 bytes for each sample.
        let [counts, samples, number, after @ ..] = rest else { return };
        let counts = usize::from(*counts).min(after.len());
        let (counts, after) = after.split_at(counts);
        let samples = usize::from(*samples).min(after.len());
        let (samples, after) = after.split_at(samples);
        let sizes = [counts.len(), samples.len(), 14 * usize::from(*number)];
        chunk.extend(sizes.map(|n| (n as u64).to_le_bytes()).concat());
        chunk.extend([counts, samples].concat());
        rest = after;
        file.extend((offset as u64).to_le_bytes());
        offset += chunk.len();
        chunks.extend(chunk);
    }
    snell_fuzz::read_image("fuzz.exr", [file, chunks].concat());
});

fn header(
    part: usize,
    compression: u8,
    size: [i32; 2],
    tile: Option<[i32; 2]>,
    file: &mut Vec<u8>,
) {
    let ints = |values: &[i32]| values.iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<u8>>();
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        file.extend([name.as_bytes(), &[0], kind.as_bytes(), &[0]].concat());
        file.extend((value.len() as i32).to_le_bytes());
        file.extend(value);
    };
    let channel =
        |(name, kind): (&str, i32)| [name.as_bytes(), &[0], &ints(&[kind, 0, 1, 1])].concat();
    let list: Vec<u8> = CHANNELS.into_iter().flat_map(channel).chain([0]).collect();
    let window = ints(&[0, 0, size[0] - 1, size[1] - 1]);
    attribute("channels", "chlist", &list);
    attribute("compression", "compression", &[compression]);
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("name", "string", format!("part {part}").as_bytes());
    attribute("pixelAspectRatio", "float", &1f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1f32.to_le_bytes());
    attribute("version", "int", &ints(&[1]));
    match tile {
        Some(tile) => {
            attribute("tiles", "tiledesc", &[ints(&tile), vec![0]].concat());
            attribute("type", "string", b"deeptile");
        }
        None => attribute("type", "string", b"deepscanline"),
    }
    file.push(0);
}
