//! Whatever the bytes are, reading them as the Draco stream of a glTF mesh ends in a scene without
//! cycles or in an error: the file around them is always whole, and its accessors declare as much
//! as the stream says that it holds, for any attribute.

#![no_main]

use snell_fuzz::Places;

/// What every stream begins with.
const MAGIC: &[u8] = b"DRACO";

/// The most elements that an accessor declares, unless the stream is only a few bytes long.
const COUNTS: [usize; 4] = [5, 100, 1_000, 4_000];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let stream = if bytes.starts_with(MAGIC) { bytes.to_vec() } else { [MAGIC, bytes].concat() };
    // The last byte, which decoders do not read, chooses the counts.
    let choice = stream.last().copied().unwrap_or(0) as usize;
    let (points, corners) = (COUNTS[choice % 4], 3 * COUNTS[choice / 4 % 4]);
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_draco_mesh_compression"],
        "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{
            "attributes": {{"POSITION": 0, "NORMAL": 2, "TEXCOORD_0": 3, "COLOR_0": 4}},
            "indices": 1, "extensions": {{"KHR_draco_mesh_compression": {{"bufferView": 0,
            "attributes": {{"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3}}}}}}}}]}}],
        "accessors": [
            {{"componentType": 5126, "count": {points}, "type": "VEC3"}},
            {{"componentType": 5125, "count": {corners}, "type": "SCALAR"}},
            {{"componentType": 5126, "count": {points}, "type": "VEC3"}},
            {{"componentType": 5126, "count": {points}, "type": "VEC2"}},
            {{"componentType": 5121, "normalized": true, "count": {points}, "type": "VEC4"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": {0}}}],
        "buffers": [{{"byteLength": {0}}}]}}"#,
        stream.len()
    );
    snell_fuzz::read("fuzz.glb", glb(&json, stream), Places::Mostly);
});

/// A binary glTF file of a document and its buffer.
fn glb(json: &str, mut buffer: Vec<u8>) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    let word = |length: usize| (length as u32).to_le_bytes();
    let length = 12 + 8 + json.len() + 8 + buffer.len();
    let mut file = [b"glTF", &word(2)[..], &word(length)].concat();
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", buffer)] {
        file.extend([&word(chunk.len())[..], kind, &chunk].concat());
    }
    file
}
