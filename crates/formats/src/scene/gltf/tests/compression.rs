//! Files compressed with meshoptimizer.

use super::{meshes, read_text};
use base64::Engine;
use snell_math::Vec3;

/// A mesh of 20 vertices and 30 triangles whose positions, normals and indices are compressed;
/// `filter` is that of the normals.
fn compressed(damage: impl Fn(&mut Vec<u8>)) -> String {
    let positions: Vec<[f32; 3]> =
        (0..20u8).map(|i| [f32::from(i), f32::from(i) * f32::from(i), 1.0]).collect();
    let up: Vec<[f32; 4]> = vec![[0.6, 0.0, 0.8, 0.0]; 20];
    let normals = meshopt::encode_filter_oct::<i8>(&up, 8);
    let indices: Vec<u32> = (0..30).flat_map(|i| [i % 20, (i + 1) % 20, (i + 7) % 20]).collect();
    let parts = [
        meshopt::encode_vertex_buffer(&positions).expect("encodes"),
        meshopt::encode_vertex_buffer(&normals).expect("encodes"),
        meshopt::encode_index_buffer(&indices, 20).expect("encodes"),
    ];
    let mut bytes = parts.concat();
    damage(&mut bytes);
    let mut offset = 0;
    let mut view = |part: &[u8], count: usize, stride: usize, mode: &str, filter: &str| {
        let own_stride = if mode == "ATTRIBUTES" {
            format!(", \"byteStride\": {stride}")
        } else {
            String::new()
        };
        let text = format!(
            r#"{{"buffer": 1, "byteOffset": 0, "byteLength": {}{own_stride}, "extensions": {{"EXT_meshopt_compression":
            {{"buffer": 0, "byteOffset": {offset}, "byteLength": {}, "count": {count}, "byteStride": {stride},
            "mode": "{mode}", "filter": "{filter}"}}}}}}"#,
            count * stride,
            part.len()
        );
        offset += part.len();
        text
    };
    let views = [
        view(&parts[0], 20, 12, "ATTRIBUTES", "NONE"),
        view(&parts[1], 20, 4, "ATTRIBUTES", "OCTAHEDRAL"),
        view(&parts[2], 90, 4, "TRIANGLES", "NONE"),
    ];
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    format!(
        r#"{{"asset": {{"version": "2.0"}},
        "extensionsUsed": ["EXT_meshopt_compression", "KHR_mesh_quantization"],
        "extensionsRequired": ["EXT_meshopt_compression", "KHR_mesh_quantization"],
        "buffers": [{{"byteLength": {}, "uri": "data:;base64,{data}"}},
            {{"byteLength": 1000, "extensions": {{"EXT_meshopt_compression": {{"fallback": true}}}}}}],
        "bufferViews": [{}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 20, "type": "VEC3"}},
            {{"bufferView": 1, "componentType": 5120, "normalized": true, "count": 20, "type": "VEC3"}},
            {{"bufferView": 2, "componentType": 5125, "count": 90, "type": "SCALAR"}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "NORMAL": 1}}, "indices": 2}}]}}],
        "nodes": [{{"mesh": 0}}]}}"#,
        bytes.len(),
        views.join(",")
    )
}

#[test]
fn compressed_views_are_decoded() {
    let scene = read_text(&compressed(|_| {})).expect("the file is sound");
    let mesh = meshes(&scene)[0];
    assert_eq!((mesh.positions.len(), mesh.indices.len()), (20, 30));
    assert_eq!(mesh.positions[3], Vec3::new(3.0, 9.0, 1.0));
    // The encoder may rotate the corners of a triangle.
    let mut first = mesh.indices[0];
    first.sort();
    assert_eq!(first, [0, 1, 7]);
    assert!(
        mesh.normals.iter().all(|n| (*n - Vec3::new(0.6, 0.0, 0.8)).length() < 0.02),
        "{}",
        mesh.normals[0]
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn damaged_compression_is_an_error() {
    let broken = read_text(&compressed(|bytes| bytes[0] = 0)).expect_err("the header is wrong");
    assert!(broken.problem.contains("compressed data is damaged"), "{broken}");
    let sound = compressed(|_| {});
    for (from, to) in [
        ("\"count\": 20, \"byteStride\": 12", "\"count\": 21000000, \"byteStride\": 12"),
        ("OCTAHEDRAL", "SPIRAL"),
        ("\"byteStride\": 12", "\"byteStride\": 13"),
    ] {
        assert!(read_text(&sound.replace(from, to)).is_err(), "{to}");
    }
}
