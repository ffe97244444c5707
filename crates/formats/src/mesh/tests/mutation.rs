//! Broken files by the thousand: small files with bytes changed, cut off, repeated. No reader may
//! panic, hang or allocate much.

use super::*;
use snell_math::rng::pcg4d;

const OBJ: &str = "mtllib none.mtl\no a\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 \
    1\nvn 0 0 1\ns 1\nusemtl m\n\
    f 1/1/1 2/2/1 3//1 \\\n 4\nf -1 -2 -3\no b\ns off\nf 1 2 3\nl 1 2\n";
const OFF: &str =
    "OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0.2 0.1 0\n0 1 0\n3 0 1 2\n5 0 1 2 3 4 0.5 0 0\n";
const NOFF: &str = "NOFF 3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n";
const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 \
    0\nendloop\nendfacet\n\
    facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 \
    0\nendloop\nendfacet\nendsolid a\n";
const RAY: &str = "#vertex 0 0 0 0 0 1 0 0\n#vertex 1 0 0 0 0 1 1 0\n#vertex 0 1 0 0 0 1 0 \
    1\n#shape_polygon 0 3 0 1 2\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float \
    y\nproperty float z\n\
    property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar \
    green\nproperty uchar blue\n\
    element face 1\nproperty list uchar int vertex_indices\nelement tristrips 1\nproperty list int \
    int vertex_indices\n\
    end_header\n0 0 0 0 0 1 255 0 0\n1 0 0 0 0 1 255 0 0\n1 1 0 0 0 0 255 0 0\n0 1 0 0 0 1 9 9 \
    9\n4 0 1 2 3\n5 0 1 2 -1 3\n";

fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(2u32.to_le_bytes());
    for facet in 0..2 {
        for value in 0..12 {
            bytes.extend(((value * value + facet) as f32).to_le_bytes());
        }
        bytes.extend([0, 0]);
    }
    bytes
}

fn binary_ply(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty double x\nproperty \
            float y\nproperty short z\n\
         property float u\nproperty float v\nelement face 2\nproperty list uchar ushort \
         vertex_index\nproperty list int char \
         other\nelement edge 1\nproperty int a\nend_header\n"
    )
    .into_bytes();
    let mut put = |little: &[u8]| {
        let start = bytes.len();
        bytes.extend(little);
        if big {
            bytes[start..].reverse();
        }
    };
    for i in 0..4u8 {
        put(&f64::from(i % 2).to_le_bytes());
        put(&f32::from(i / 2).to_le_bytes());
        put(&i16::from(i).to_le_bytes());
        put(&0.5f32.to_le_bytes());
        put(&0.25f32.to_le_bytes());
    }
    for face in [[0u16, 1, 2], [1, 3, 2]] {
        put(&[3]);
        face.iter().for_each(|i| put(&i.to_le_bytes()));
        put(&2i32.to_le_bytes());
        put(&[1]);
        put(&[2]);
    }
    put(&7i32.to_le_bytes());
    bytes
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("a.obj", OBJ.into()),
        ("a.off", OFF.into()),
        ("n.off", NOFF.into()),
        ("a.stl", STL.into()),
        ("b.stl", binary_stl()),
        ("a.ray", RAY.into()),
        ("a.ply", PLY.into()),
        ("l.ply", binary_ply(false)),
        ("b.ply", binary_ply(true)),
    ]
}

/// The words that hostile files are made of.
const WORDS: [&[u8]; 14] = [
    b"-1",
    b"0",
    b"4294967295",
    b"999999999999999999",
    b"1e39",
    b"nan",
    b"/",
    b"\n",
    b"\\\n",
    b"\r",
    b"#",
    b"f 1 2 3\n",
    b"\xff\xff\xff\x7f",
    b"\0",
];

fn mutate(seed: &[u8], rng: &mut impl FnMut(usize) -> usize) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + rng(4) {
        let at = rng(bytes.len().max(1)).min(bytes.len().saturating_sub(1));
        match rng(6) {
            _ if bytes.is_empty() => return bytes,
            0 => bytes[at] ^= 1 << rng(8),
            1 => bytes[at] = rng(256) as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.splice(at..at, WORDS[rng(WORDS.len())].iter().copied())),
            4 => drop(bytes.drain(at..(at + 1 + rng(8)).min(bytes.len()))),
            _ => {
                let end = (at + 1 + rng(60)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                drop(bytes.splice(at..at, copy));
            }
        }
    }
    bytes
}

#[test]
fn the_seeds_themselves_are_read_without_loss() {
    let found: Vec<_> = seeds()
        .into_iter()
        .map(|(name, bytes)| {
            (name, triangles(&read(name, bytes).unwrap_or_else(|e| panic!("{e}"))))
        })
        .collect();
    let expected = [
        ("a.obj", 4),
        ("a.off", 4),
        ("n.off", 1),
        ("a.stl", 2),
        ("b.stl", 2),
        ("a.ray", 1),
        ("a.ply", 3),
        ("l.ply", 2),
        ("b.ply", 2),
    ];
    assert_eq!(found, expected);
}

#[test]
fn broken_files_end_in_a_scene_or_an_error() {
    for (name, seed) in seeds() {
        let mut counter = 0;
        let mut rng = |n: usize| {
            counter += 1;
            pcg4d([counter, 0, 0, 0])[0] as usize % n
        };
        let mut good = 0;
        for _ in 0..4000 {
            let bytes = mutate(&seed, &mut rng);
            let own_reader = SCENE_READERS
                .iter()
                .find(|r| name.ends_with(r.extensions[0]))
                .expect("a mesh format");
            let input = Input::from_bytes(
                name,
                bytes.clone(),
                Path::new("/nonexistent"),
                &ReadOptions::default(),
            );
            if let Ok(scene) = (own_reader.read)(&input) {
                check(&scene, name);
                good += 1;
            }
            match read(name, bytes) {
                Ok(scene) => check(&scene, name),
                Err(error) => assert!(!error.problem.is_empty(), "{name}"),
            }
        }
        // Some files must be read, and some refused; otherwise only the first lines would have been
        // tested.
        assert!((100..3900).contains(&good), "{name}: {good} of 4000 read");
    }
}

#[test]
fn every_prefix_of_a_file_ends_in_a_scene_or_an_error() {
    for (name, seed) in seeds() {
        for end in 0..seed.len() {
            if let Ok(scene) = read(name, &seed[..end]) {
                check(&scene, name);
            }
        }
    }
}
