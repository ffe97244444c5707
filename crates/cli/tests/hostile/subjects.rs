//! The files that `smoke` damages: small valid files, each with the files beside it.

use super::mutate::{Random, change_png_chunk, correct_png_checksums, mutate_words};
use super::promise::{Case, files_in};
use super::seeds;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Files larger than this are left out: they consist mostly of numbers, and are slow to read a
/// thousand times.
const LARGEST: usize = 64 << 10;

/// The role of a file in the commands.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Scene,
    Picture,
}

/// A valid file, and the name of the file beside it that is damaged.
pub struct Subject {
    pub kind: Kind,
    /// The file that the commands are given.
    pub name: String,
    /// The damaged file: `name`, or a file that it names.
    pub damaged: String,
    pub files: BTreeMap<String, Vec<u8>>,
}

impl Subject {
    fn new(kind: Kind, name: &str, damaged: &str, files: &[(&str, &[u8])]) -> Self {
        let files = files.iter().map(|(name, bytes)| (name.to_string(), bytes.to_vec())).collect();
        Self { kind, name: name.into(), damaged: damaged.into(), files }
    }

    fn alone(kind: Kind, name: &str, bytes: &[u8]) -> Self {
        Self::new(kind, name, name, &[(name, bytes)])
    }

    /// The case of a command line for the undamaged file.
    pub fn case(&self, line: &str) -> Case {
        Case::new(self.files.clone(), &self.name, line)
    }

    /// The case with the damaged file; words of another subject may be inserted.
    pub fn damaged_case(&self, line: &str, other: &Self, random: &mut Random) -> Case {
        let mut case = self.case(line);
        let bytes = mutate_words(&self.files[&self.damaged], &other.files[&other.damaged], random);
        let entry = case.files.entry(self.damaged.clone()).or_default();
        *entry = bytes;
        if self.damaged.ends_with(".png") {
            match random.below(4) {
                0 => {}
                1 => correct_png_checksums(entry),
                _ => {
                    *entry = self.files[&self.damaged].clone();
                    change_png_chunk(entry, random);
                }
            }
        }
        case
    }
}

/// All subjects.
pub fn subjects() -> Vec<Subject> {
    let mut all: Vec<_> = seeds::scenes()
        .iter()
        .map(|seed| Subject::alone(Kind::Scene, &seed.name, &seed.bytes))
        .collect();
    all.extend(of_the_repository());
    all.extend(written());
    let pictures = seeds::images();
    for seed in &pictures {
        all.push(Subject::alone(Kind::Picture, &seed.name, &seed.bytes));
        let material = format!("newmtl m\nKd 1 1 1\nmap_Kd {0}\nmap_d {0}\nnewmtl n\n", seed.name);
        let mesh = seeds::MESH_WITH_MATERIALS;
        let files = [
            ("own.obj", mesh.as_bytes()),
            ("damaged.mtl", material.as_bytes()),
            (&seed.name, &seed.bytes),
        ];
        all.push(Subject::new(Kind::Scene, "own.obj", &seed.name, &files));
    }
    let material = seeds::materials();
    let picture = ("picture.png", &pictures[0].bytes[..]);
    let files = [
        ("own.obj", seeds::MESH_WITH_MATERIALS.as_bytes()),
        (&material.name, &material.bytes),
        picture,
    ];
    all.push(Subject::new(Kind::Scene, "own.obj", &material.name, &files));
    let files = [("own.xml", SERIALIZED_SCENE.as_bytes()), ("a.serialized", &serialized())];
    all.push(Subject::new(Kind::Scene, "own.xml", "a.serialized", &files));
    for damaged in ["own.gltf", "a.ies"] {
        let files = [("own.gltf", LUMINAIRE_SCENE.as_bytes()), ("a.ies", LUMINAIRE.as_bytes())];
        all.push(Subject::new(Kind::Scene, "own.gltf", damaged, &files));
    }
    all.retain(|subject| subject.files.values().all(|bytes| bytes.len() <= LARGEST));
    all
}

/// The scenes of this repository, each with all small files in its folder that it could name.
fn of_the_repository() -> Vec<Subject> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = [
        "scenes",
        "tests/golden/aov",
        "tests/golden/direct",
        "tests/golden/path",
        "tests/golden/whitted",
    ];
    let mut all = Vec::new();
    for folder in folders.map(|folder| repository.join(folder)) {
        let named =
            |path: &PathBuf| path.file_name().expect("it is a file").to_string_lossy().into_owned();
        let entries =
            std::fs::read_dir(&folder).expect("the folder is there").flatten().map(|e| e.path());
        let paths: Vec<_> = entries.filter(|p| p.extension().is_some_and(|e| e != "exr")).collect();
        let bytes = |path: &PathBuf| std::fs::read(path).expect("the file is readable");
        for path in &paths {
            let is_material = path.extension().is_some_and(|e| e == "mtl");
            let beside =
                if is_material { path.with_extension("obj") } else { path.with_extension("mtl") };
            let files = [path, &beside]
                .into_iter()
                .filter(|p| p.exists())
                .map(|p| (named(p), bytes(p)))
                .collect();
            let name = if is_material { named(&beside) } else { named(path) };
            all.push(Subject { kind: Kind::Scene, name, damaged: named(path), files });
        }
    }
    all
}

/// Small built-in scenes in every writable format.
fn written() -> Vec<Subject> {
    let folder = tempfile::TempDir::new().expect("temporary folders can be made");
    let mut all = Vec::new();
    for name in ["minray", "cornell-box", "drink", "fog", "prism", "spheres"] {
        let scene = snell_scene::builtin::builtin(name).expect("the scene is built in");
        for extension in ["snell", "gltf", "glb", "pbrt", "obj", "ply", "stl", "off"] {
            let path = folder
                .path()
                .join(format!("{name}-{extension}"))
                .join(format!("{name}.{extension}"));
            let beside = path.parent().expect("the path has a folder");
            std::fs::create_dir(beside).expect("the folder is writable");
            if snell_formats::write_scene(&path, &scene).is_err() {
                continue;
            }
            let file = format!("{name}.{extension}");
            all.push(Subject {
                kind: Kind::Scene,
                name: file.clone(),
                damaged: file,
                files: files_in(beside),
            });
        }
    }
    all
}

const SERIALIZED_SCENE: &str = "<scene version=\"3.0.0\"><shape type=\"serialized\">\
    <string name=\"filename\" value=\"a.serialized\"/><bsdf type=\"diffuse\"/></shape></scene>\n";

/// A serialized mesh of one triangle with an uncompressed zlib stream, so that damage passes it.
fn serialized() -> Vec<u8> {
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut mesh = [&0x1000u32.to_le_bytes()[..], b"a\0"].concat();
    mesh.extend([3u64, 1].map(u64::to_le_bytes).concat());
    mesh.extend(positions.map(f32::to_le_bytes).concat());
    mesh.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
    let length = mesh.len() as u16;
    let (a, b) = mesh.iter().fold((1u32, 0u32), |(a, b), &byte| {
        let a = (a + u32::from(byte)) % 65_521;
        (a, (b + a) % 65_521)
    });
    let mut bytes = b"\x1c\x04\x04\x00\x78\x01\x01".to_vec();
    bytes.extend([length, !length].map(u16::to_le_bytes).concat());
    bytes.extend([mesh, (b << 16 | a).to_be_bytes().to_vec()].concat());
    bytes.extend([0u64.to_le_bytes().to_vec(), 1u32.to_le_bytes().to_vec()].concat());
    bytes
}

/// A lamp above a floor.
const LUMINAIRE_SCENE: &str = r#"{"asset": {"version": "2.0"}, "extensionsUsed": ["EXT_lights_ies"],
    "extensions": {"EXT_lights_ies": {"lights": [{"uri": "a.ies"}]}}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
    "nodes": [{"mesh": 0}, {"translation": [0.3, 1, 0.3], "extensions": {"EXT_lights_ies": {"light": 0, "multiplier": 2}}}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36,
    "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}
"#;

const LUMINAIRE: &str = "IESNA:LM-63-2002\n[TEST] x\nTILT=INCLUDE\n1\n2\n0 90\n1.0 0.9\n1 1000 2.0 \
    3 2 1 2 0 0 0\n0.5 1.0 60\n\
    0 45 90\n0 90\n100 50 10\n90 40 5\n";
