//! Valid files to be damaged: small, of every format.

use snell_formats::image::{WriteOptions, encode_image_as};
use snell_scene::{Layer, LayeredImage};
use std::path::{Path, PathBuf};

/// A valid file.
pub struct Seed {
    /// The format, for the report.
    pub format: &'static str,
    pub name: String,
    pub bytes: Vec<u8>,
    /// The folder of the files that the seed names.
    pub folder: PathBuf,
}

pub const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");

/// Formats and small files of the collection.
const COLLECTED: &[(&str, &[&str])] = &[
    (
        "gltf",
        &[
            "gltf/gltf-transform/Box_glTF-Embedded/Box.gltf",
            "gltf/magnum-valid/mesh-embedded.gltf",
            "gltf/magnum-valid/skin-embedded.gltf",
            "gltf/magnum-valid/light.gltf",
            "gltf/magnum-valid/camera.gltf",
            "gltf/magnum-valid/material-clearcoat.gltf",
            "gltf/magnum-valid/mesh-sparse.gltf",
        ],
    ),
    (
        "glb",
        &[
            "gltf/gltf-transform/Box_glTF-Binary/Box.glb",
            "gltf/gltf-rs/box_sparse.glb",
            "gltf/magnum-valid/mesh-embedded.glb",
            "gltf/magnum-valid/image-embedded.glb",
        ],
    ),
    (
        "obj",
        &[
            "meshes/assimp-obj/box.obj",
            "meshes/assimp-obj/cube_usemtl.obj",
            "meshes/trimesh/negative_indices.obj",
        ],
    ),
    ("ply-ascii", &["meshes/assimp-ply/cube_uv.ply", "meshes/trimesh/multi.ply"]),
    ("ply-binary", &["meshes/assimp-ply/cube_binary.ply"]),
    ("stl-ascii", &["meshes/assimp-stl/triangle.stl"]),
    ("stl-binary", &["meshes/trimesh/unit_cube.STL"]),
    ("off", &["meshes/assimp-off/Cube.off", "meshes/trimesh/comments.off"]),
    (
        "scn",
        &[
            "scn/scenes/cornell.scn",
            "scn/scenes/transform.scn",
            "scn/scenes/lights.scn",
            "scn/scenes/glass_spheres.scn",
            "scn/scenes/cylinder.scn",
            "scn/scenes/softshadow.scn",
        ],
    ),
    ("nff", &["nff/tetra-s2.nff", "nff/tree-s3.nff"]),
    ("minray", &["minray/test1.json"]),
];

/// Small files that are part of this test.
const OWN: &[(&str, &str, &str)] = &[
    (
        "gltf",
        "own.gltf",
        r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0, "rotation": [0, 0, 0, 1], "scale": [1, 2, 1]}, {"camera": 0, "translation": [0.3, 0.3, 2]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.2, 0.5], "roughnessFactor": 0.3},
        "alphaMode": "MASK", "emissiveFactor": [0.1, 0.2, 0.3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36,
        "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#,
    ),
    (
        "obj",
        "own.obj",
        "mtllib own.mtl\no a\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 \
            1\ns 1\nusemtl m\n\
         f 1/1/1 2/2/1 3//1 \\\n 4\nf -1 -2 -3\no b\ns off\nf 1 2 3\nl 1 2\n",
    ),
    (
        "ply-ascii",
        "own.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty \
            float z\nproperty float nx\n\
         property float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty \
         uchar blue\nelement face 1\n\
         property list uchar int vertex_indices\nelement tristrips 1\nproperty list int int \
         vertex_indices\nend_header\n\
         0 0 0 0 0 1 255 0 0\n1 0 0 0 0 1 255 0 0\n1 1 0 0 0 0 255 0 0\n0 1 0 0 0 1 9 9 9\n4 0 1 2 \
         3\n5 0 1 2 -1 3\n",
    ),
    (
        "off",
        "own.off",
        "OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0.2 0.1 0\n0 1 0\n3 0 1 2\n5 0 1 2 3 4 0.5 0 0\n",
    ),
    (
        "stl-ascii",
        "own.stl",
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 \
            0\nendloop\nendfacet\nendsolid a\n",
    ),
    (
        "scn",
        "own.scn",
        "camera 0 0 5 0 0 -1 0 1 0 0.5 1 100\nambient 0.1 0.1 0.1\nmaterial .1 .1 .1 .5 .5 .5 .2 \
            .2 .2 .3 .3 .3 0 0 0 20 1.5 0\n\
         point_light 1 1 1 0 3 3 1 0 0\nbegin 0 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\nsphere 0 0 0 0 \
         1\nbox -1 -1 -1 -1 -0.5 1 1\nend\n",
    ),
    (
        "nff",
        "own.nff",
        "v\nfrom 0 0 5\nat 0 0 0\nup 0 1 0\nangle 40\nhither 1\nresolution 16 16\nb 0.1 0.2 0.3\nl \
            3 4 5\n\
         f 1 0.5 0.2 0.5 0.5 20 0.3 1.5\ns 0 0 0 1\nc\n0 -1 0 0.5\n0 1 0 0.2\np 3\n-2 -2 -1\n2 -2 \
         -1\n0 2 -1\n",
    ),
    (
        "pbrt",
        "own.pbrt",
        "LookAt 3 4 1.5  .5 .5 0  0 0 1\nCamera \"perspective\" \"float fov\" 45\nFilm \"rgb\" \
            \"integer xresolution\" [16] \"integer yresolution\" [16]\n\
         WorldBegin\nLightSource \"infinite\" \"rgb L\" [ .4 .45 .5 \
         ]\nAttributeBegin\nAreaLightSource \"diffuse\" \"blackbody L\" 3000 \"float power\" 9\n\
         Translate 0 0 3 Shape \"disk\" \"float radius\" 0.5\nAttributeEnd\nTexture \"c\" \
         \"spectrum\" \"checkerboard\" \"float uscale\" [4] \"rgb tex1\" [.1 .1 .1]\n\
         Material \"coateddiffuse\" \"texture reflectance\" \"c\" \"float roughness\" 0.1\n\
         Shape \"bilinearmesh\" \"point3 P\" [ -9 -9 0 9 -9 0 -9 9 0 9 9 1 ]\nObjectBegin \"o\" \
         Shape \"sphere\" \"float zmin\" 0 ObjectEnd\n\
         ObjectInstance \"o\" Translate 1 0 0 ObjectInstance \"o\"\nMaterial \"dielectric\" Shape \
         \"loopsubdiv\" \"integer levels\" 1\n\
         \"point3 P\" [0 0 0 1 0 0 0 1 0 0 0 1] \"integer indices\" [0 1 2 0 3 1 1 3 2 2 3 0] \
         \"float alpha\" 0.5\n",
    ),
    (
        "mitsuba",
        "own.xml",
        "<scene version=\"3.0.0\"><default name=\"spp\" value=\"4\"/><integrator \
            type=\"path\"><integer name=\"max_depth\" value=\"8\"/></integrator>\n\
         <sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"0,-6,2\" \
         target=\"0,0,0\" up=\"0,0,1\"/></transform>\n\
         <film type=\"hdrfilm\"><integer name=\"width\" value=\"16\"/><integer name=\"height\" \
         value=\"16\"/></film></sensor>\n\
         <bsdf type=\"blendbsdf\" id=\"b\"><float name=\"weight\" value=\"0.25\"/><bsdf \
         type=\"dielectric\"/><bsdf type=\"roughconductor\"/></bsdf>\n\
         <shape type=\"shapegroup\" id=\"g\"><shape type=\"cube\"><ref \
         id=\"b\"/></shape></shape><shape type=\"instance\"><ref id=\"g\"/></shape>\n\
         <shape type=\"sphere\"><float name=\"radius\" value=\"0.5\"/><emitter type=\"area\"><rgb \
         name=\"radiance\" value=\"9 8 7\"/></emitter></shape></scene>\n",
    ),
];

/// A material file, tested with a mesh that uses all of its materials.
const MTL: &str = "newmtl m\nKa 1 1 1\nKd 0.5 0.4 0.3\nKs 0.1 0.1 0.1\nKe 0 0 0\nNs 20\nNi 1.5\nd \
    0.5\nTr 0.5\nillum 7\n\
    Pr 0.3\nPm 0.5\nTf 1 0.9 0.8\nmap_Kd -s 1 1 1 -o 0 0 0 picture.png\nnewmtl n\nKd xyz 0.1 0.2 \
    0.3\nNs 1000\nillum 5\n";

/// The mesh that uses a damaged material file.
pub const MESH_WITH_MATERIALS: &str = "mtllib damaged.mtl\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nv 0 0 \
    1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\nusemtl n\nf 1/1 2/2 4/3\n";

/// Seeds of scene files, material files excepted.
pub fn scenes() -> Vec<Seed> {
    let folder = std::env::temp_dir();
    let own = OWN.iter().map(|&(format, name, text)| {
        (format, name.to_string(), text.as_bytes().to_vec(), folder.clone())
    });
    let mut seeds: Vec<_> =
        own.map(|(format, name, bytes, folder)| Seed { format, name, bytes, folder }).collect();
    for (format, paths) in COLLECTED {
        for path in *paths {
            let path = Path::new(DATA).join(path);
            let Ok(bytes) = std::fs::read(&path) else {
                eprintln!("skipped: {} is absent", path.display());
                continue;
            };
            let name =
                path.file_name().expect("the path names a file").to_string_lossy().into_owned();
            let folder = path.parent().expect("the file is in a folder").to_path_buf();
            seeds.push(Seed { format, name, bytes, folder });
        }
    }
    seeds
}

/// The seed of material files.
pub fn materials() -> Seed {
    Seed {
        format: "mtl",
        name: "damaged.mtl".into(),
        bytes: MTL.into(),
        folder: std::env::temp_dir(),
    }
}

/// Small pictures of every format that Snell reads.
pub fn images() -> Vec<Seed> {
    let formats =
        [("png", 8), ("png", 16), ("jpg", 8), ("hdr", 8), ("exr", 8), ("pfm", 8), ("ppm", 8)];
    let seed = |(format, bits): (&'static str, u8)| {
        let values = (0..12 * 6 * 3).map(|i| (i * 7 % 32) as f32 / 16.0).collect();
        let layer = Layer {
            name: String::new(),
            channels: ["R", "G", "B"].map(String::from).to_vec(),
            values,
        };
        let picture =
            LayeredImage { width: 12, height: 6, layers: vec![layer], metadata: Vec::new() };
        let options = WriteOptions { png_bits: bits, ..WriteOptions::default() };
        let bytes = encode_image_as(format, &picture, &options).unwrap_or_else(|e| panic!("{e}"));
        Seed { format, name: format!("a.{format}"), bytes, folder: std::env::temp_dir() }
    };
    let unwritten = [
        ("png", palette_png()),
        ("bmp", bmp()),
        ("tga", tga()),
        ("webp", WEBP.to_vec()),
        ("ppm", PGM.to_vec()),
    ];
    let unwritten = unwritten.into_iter().map(|(format, bytes)| Seed {
        format,
        name: format!("b.{format}"),
        bytes,
        folder: std::env::temp_dir(),
    });
    formats.map(seed).into_iter().chain(unwritten).collect()
}

/// A lossy WebP of one pixel.
const WEBP: &[u8] =
    b"RIFF\"\0\0\0WEBPVP8 \x16\0\0\x000\x01\0\x9d\x01*\x01\0\x01\0\x0e\xc0\xfe%\xa4\0\x03p\0\0\0\0";

const PGM: &[u8] = b"P2\n# grey\n4 2\n15\n0 3 7 15\n1 2 4 8\n";

/// A PNG of 4x2 pixels with a palette of four colours, two of them transparent.
fn palette_png() -> Vec<u8> {
    let header = [0, 0, 0, 4, 0, 0, 0, 2, 2, 3, 0, 0, 0];
    // Two rows of one byte, each after the number of its filter, in an uncompressed zlib stream.
    let rows = b"\x78\x01\x01\x04\x00\xfb\xff\x00\x1b\x00\xe4\x02\x1b\x01\x00";
    let palette = [255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 9, 9];
    let chunks: [(&[u8; 4], &[u8]); 5] = [
        (b"IHDR", &header),
        (b"PLTE", &palette),
        (b"tRNS", &[0, 128]),
        (b"IDAT", rows),
        (b"IEND", b""),
    ];
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for (kind, data) in chunks {
        bytes.extend((data.len() as u32).to_be_bytes());
        bytes.extend([&kind[..], data, &[0; 4]].concat());
    }
    super::mutate::correct_png_checksums(&mut bytes);
    bytes
}

/// A bitmap of 4x2 pixels with a palette of four colours.
fn bmp() -> Vec<u8> {
    let palette = [[0, 0, 255, 0], [0, 255, 0, 0], [255, 0, 0, 0], [9, 9, 9, 0]].concat();
    let numbers: [u32; 13] = [78, 0, 70, 40, 4, 2, 1 | 8 << 16, 0, 8, 2835, 2835, 4, 4];
    let numbers = numbers.map(u32::to_le_bytes).concat();
    [&b"BM"[..], &numbers, &palette, &[0, 1, 2, 3, 3, 2, 1, 0]].concat()
}

/// A Targa picture of 4x2 pixels in runs: three of one colour, and five literal ones.
fn tga() -> Vec<u8> {
    let header = [0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 2, 0, 24, 0];
    let pixels: Vec<u8> = (0..15).map(|i| i * 17).collect();
    [&header[..], &[0x82, 1, 2, 3, 0x84], &pixels, &[0; 8], b"TRUEVISION-XFILE.\0"].concat()
}
