use super::*;
use crate::ReadOptions;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use snell_math::DAffine3;
use snell_scene::medium::Medium;
use std::io::Write;
use std::path::Path;

/// Offsets of the parts of a grid with one node of each kind.
const ROOT: usize = 672 + 64;
const UPPER: usize = ROOT + 96;
const LOWER: usize = UPPER + 270_400;
const LEAF: usize = LOWER + 33_856;
const END: usize = LEAF + 2144;

/// The first corner of the leaf's voxels.
const FIRST: [i32; 3] = [8, 16, -8];

/// A grid in a file.
struct Written {
    name: &'static str,
    kind: u32,
    class: u32,
    size: f64,
    value: fn([i32; 3]) -> f32,
}

const SMOKE: Written = Written { name: "density", kind: 1, class: 2, size: 0.5, value: number };

/// A value that encodes its position.
fn number([x, y, z]: [i32; 3]) -> f32 {
    (x * 10_000 + y * 100 - z) as f32
}

fn put(bytes: &mut [u8], at: usize, value: impl IntoIterator<Item = u8>) {
    bytes[at..].iter_mut().zip(value).for_each(|(to, from)| *to = from);
}

/// A tree with one leaf, all of its 512 voxels active. World coordinates are `size` times the
/// indices, plus (1, 2, 3).
fn grid(of: &Written) -> Vec<u8> {
    let mut bytes = vec![0; END];
    put(&mut bytes, 0, *b"NanoVDB0");
    put(&mut bytes, 32, (END as u64).to_le_bytes());
    put(&mut bytes, 40, of.name.bytes());
    for (i, x) in [of.size, 0.0, 0.0, 0.0, of.size, 0.0, 0.0, 0.0, of.size].into_iter().enumerate()
    {
        put(&mut bytes, 296 + 88 + 8 * i, x.to_le_bytes());
        put(&mut bytes, 296 + 160 + 8 * i, if x == 0.0 { x } else { 1.0 / x }.to_le_bytes());
    }
    for (i, x) in [1.0f64, 2.0, 3.0].into_iter().enumerate() {
        put(&mut bytes, 296 + 232 + 8 * i, x.to_le_bytes());
    }
    put(&mut bytes, 632, of.class.to_le_bytes());
    put(&mut bytes, 636, of.kind.to_le_bytes());
    put(&mut bytes, 672 + 24, 64u64.to_le_bytes());
    let [x, y, z] = FIRST;
    let key = |shift: u32| [x, y, z].map(|c| (c as u32 >> shift) as u64);
    let [kx, ky, kz] = key(12);
    put(&mut bytes, ROOT + 24, 1u32.to_le_bytes());
    put(&mut bytes, ROOT + 64, (kz | ky << 21 | kx << 42).to_le_bytes());
    put(&mut bytes, ROOT + 72, ((UPPER - ROOT) as u64).to_le_bytes());
    let place = |node: [u64; 3], bits: u32| {
        let mask = (1 << bits) - 1;
        ((node[0] & mask) << (2 * bits) | (node[1] & mask) << bits | node[2] & mask) as usize
    };
    let (upper, lower) = (place(key(7), 5), place(key(3), 4));
    for (node, mask, table, place, child) in [
        (UPPER, 32 + 4096, 8256, upper, LOWER - UPPER),
        (LOWER, 32 + 512, 1088, lower, LEAF - LOWER),
    ] {
        bytes[node + mask + place / 8] |= 1 << (place % 8);
        put(&mut bytes, node + table + 8 * place, (child as u64).to_le_bytes());
    }
    bytes[LEAF + 16..LEAF + 80].fill(0xff);
    for i in 0..512 {
        let voxel = [x + (i >> 6), y + (i >> 3 & 7), z + (i & 7)];
        put(&mut bytes, LEAF + 96 + 4 * i as usize, (of.value)(voxel).to_le_bytes());
    }
    bytes
}

/// A file of grids with this compression: 0 for none, 1 for zip.
fn file(grids: &[Written], codec: u16) -> Vec<u8> {
    let mut bytes = b"NanoVDB0".to_vec();
    bytes.extend((32u32 << 21 | 3 << 10).to_le_bytes());
    bytes.extend((grids.len() as u16).to_le_bytes());
    bytes.extend(codec.to_le_bytes());
    for of in grids {
        let mut about = vec![0; 176];
        put(&mut about, 0, (END as u64).to_le_bytes());
        put(&mut about, 32, of.kind.to_le_bytes());
        put(&mut about, 36, of.class.to_le_bytes());
        for (i, x) in FIRST.into_iter().chain(FIRST.map(|x| x + 7)).enumerate() {
            put(&mut about, 88 + 4 * i, x.to_le_bytes());
        }
        put(&mut about, 136, (of.name.len() as u32 + 1).to_le_bytes());
        put(&mut about, 168, codec.to_le_bytes());
        bytes.extend(about);
        bytes.extend(of.name.bytes().chain([0]));
    }
    for of in grids {
        let grid = grid(of);
        if codec == 1 {
            let mut packer = ZlibEncoder::new(Vec::new(), Compression::fast());
            packer.write_all(&grid).expect("memory takes it");
            let packed = packer.finish().expect("memory takes it");
            bytes.extend((packed.len() as u64).to_le_bytes());
            bytes.extend(packed);
        } else {
            bytes.extend(grid);
        }
    }
    bytes
}

fn input(bytes: Vec<u8>) -> Input {
    Input::from_bytes("cloud.nvdb", bytes, Path::new("."), &ReadOptions::default())
}

fn error(bytes: Vec<u8>) -> String {
    let result =
        crate::read_scene_bytes("cloud.nvdb", bytes, Path::new("."), &ReadOptions::default());
    result.expect_err("the file is broken").to_string()
}

#[test]
fn voxels_are_where_the_file_says() {
    for codec in [0, 1] {
        let input = input(file(&[Written { name: "heat", size: 2.0, ..SMOKE }, SMOKE], codec));
        let volumes = Volumes::of(&input).expect("a sound file");
        assert_eq!(volumes.names().collect::<Vec<_>>(), ["heat", "density"]);
        let Volume { grid, world_from_grid } =
            volumes.volume("density").expect("it is sound").expect("it is there");
        // One more voxel on each side, with the background value.
        assert_eq!(grid.size(), [10; 3]);
        let at = |voxel: [f64; 3]| {
            let world = DVec3::from_array(voxel) * 0.5 + DVec3::new(1.0, 2.0, 3.0);
            grid.lookup(world_from_grid.inverse().transform_point3(world).as_vec3())
        };
        for voxel in [[8, 16, -8], [15, 23, -1], [9, 20, -3]] {
            assert!((at(voxel.map(f64::from)) - number(voxel)).abs() < 0.5, "{voxel:?}");
        }
        let between = 0.5 * (number([10, 18, -4]) + number([11, 18, -4]));
        assert!((at([10.5, 18.0, -4.0]) - between).abs() < 0.5);
        assert!(
            (at([7.5, 16.0, -8.0]) - 0.5 * number([8, 16, -8])).abs() < 0.5,
            "it fades to the background"
        );
        assert_eq!(at([6.0, 16.0, -8.0]), 0.0);
    }
}

#[test]
fn grids_of_other_voxels_are_looked_up_at_the_same_places() {
    let constant = |_| 7.0;
    let input = input(file(
        &[SMOKE, Written { name: "temperature", size: 0.5, value: constant, ..SMOKE }],
        0,
    ));
    let volumes = Volumes::of(&input).expect("a sound file");
    let [smoke, heat] =
        ["density", "temperature"].map(|name| volumes.volume(name).expect("sound").expect("there"));
    let over = heat.over(&smoke);
    assert_eq!(over.size(), smoke.grid.size());
    assert!(over.values().iter().zip(heat.grid.values()).all(|(a, b)| (a - b).abs() < 1e-3));
    let elsewhere = Volume {
        world_from_grid: smoke.world_from_grid * DAffine3::from_scale(DVec3::splat(2.0)),
        ..smoke
    };
    assert!(heat.over(&elsewhere).values().iter().all(|x| *x <= 7.0));
}

#[test]
fn a_file_is_a_scene_of_smoke() {
    for magic in [*b"NanoVDB0", *b"NanoVDB2"] {
        let mut bytes = file(&[Written { name: "heat", ..SMOKE }, SMOKE], 0);
        put(&mut bytes, 0, magic);
        let read = crate::read_scene_bytes("x", bytes, Path::new("."), &ReadOptions::default());
        let scene = read.expect("the content decides");
        let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
        assert!(grid.density.values().iter().any(|d| *d > 0.0) && grid.sigma_s.g > 0.0);
        assert_eq!(scene.warnings.len(), 1, "the other grid: {:?}", scene.warnings);
    }
}

#[test]
fn an_empty_grid_is_nothing() {
    let mut bytes = file(&[SMOKE], 0);
    // The index of the highest voxel is below that of the lowest.
    put(&mut bytes, 16 + 100, (-5i32).to_le_bytes());
    let read = crate::read_scene_bytes("x", bytes, Path::new("."), &ReadOptions::default())
        .expect("nothing is wrong");
    assert!(read.warnings.iter().any(|w| w.message.contains("is empty")), "{:?}", read.warnings);
}

#[test]
fn broken_files_are_told() {
    let sound = file(&[SMOKE], 0);
    let changed = |at: usize, with: &[u8]| {
        let mut bytes = sound.clone();
        put(&mut bytes, at, with.iter().copied());
        error(bytes)
    };
    let about = 16;
    let grid = about + 176 + 8;
    insta::assert_snapshot!(
        [
            error(b"NanoVDB1 and so on".to_vec()),
            error(b"NanoVDB0".to_vec()),
            error(sound[..100].to_vec()),
            error(sound[..5000].to_vec()),
            changed(8, &(31u32 << 21).to_le_bytes()),
            changed(14, &[2, 0]),
            changed(14, &[1, 0]),
            changed(12, &[200, 1]),
            changed(about, &u64::MAX.to_le_bytes()),
            changed(about + 32, &13u32.to_le_bytes()),
            changed(about + 36, &1u32.to_le_bytes()),
            changed(about + 100, &i32::MAX.to_le_bytes()),
            changed(about + 136, &u32::MAX.to_le_bytes()),
            changed(grid + 296 + 88, &[0; 8]),
            changed(grid + 296 + 232, &f64::NAN.to_le_bytes()),
            changed(grid + 672 + 24, &u64::MAX.to_le_bytes()),
            changed(grid + ROOT + 24, &u32::MAX.to_le_bytes()),
            changed(grid + ROOT + 72, &1_000_000u64.to_le_bytes()),
        ]
        .join("\n")
    );
}

#[test]
fn wild_bytes_are_never_more_than_an_error() {
    for codec in [0, 1] {
        let sound = file(&[SMOKE], codec);
        // The fields of the headers and the pointers to the nodes; the tables of the nodes are
        // nearly all zero.
        let places =
            (0..16 + 184 + 900).chain((0..64).map(|i| (16 + 184 + UPPER + i * 4200) % sound.len()));
        for at in places {
            for with in [0xff, 0x80, 1] {
                let mut bytes = sound.clone();
                bytes[at.min(sound.len() - 1)] ^= with;
                let mut options = ReadOptions::default();
                options.limits.elements = 1 << 16;
                let _ = crate::read_scene_bytes("cloud.nvdb", bytes, Path::new("."), &options);
            }
        }
    }
}

/// The grid of a pbrt scene with this medium, in a folder with the files that it names.
fn pbrt(grids: &[Written], medium: &str) -> Result<Grid, String> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.pbrt");
    std::fs::write(folder.path().join("cloud.nvdb"), file(grids, 1))
        .expect("the folder is writable");
    let head = r#"WorldBegin Translate 5 0 0 MakeNamedMedium "m" "string type" "nanovdb" "string filename" "cloud.nvdb""#;
    let tail = r#"MediumInterface "m" "" Shape "sphere" "float radius" 40"#;
    std::fs::write(&path, format!("{head} {medium}\n{tail}\n")).expect("the folder is writable");
    let scene = crate::read_scene(&path, &ReadOptions::default())
        .map_err(|e| format!("{:?}: {}", e.place, e.problem))?;
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
    Ok(grid.clone())
}

#[test]
fn media_of_pbrt_are_placed_and_scaled() {
    let medium = r#""rgb sigma_s" [ 1 2 3 ] "float scale" 0.5 "float g" 0.2"#;
    let grid = pbrt(&[SMOKE], medium).expect("nothing is wrong");
    assert_eq!(
        (grid.sigma_s, grid.sigma_a, grid.g),
        (Rgb::new(0.5, 1.0, 1.5), Rgb::splat(0.5), 0.2)
    );
    // The grid is mirrored in x, as pbrt's scenes are.
    let world = DVec3::new(-(5.0 + 1.0 + 0.5 * 9.0), 2.0 + 0.5 * 20.0, 3.0 - 0.5 * 3.0);
    let value =
        grid.density.lookup(grid.world_from_grid.inverse().transform_point3(world).as_vec3());
    assert!((value - number([9, 20, -3])).abs() < 0.5, "{value}");
    let other = pbrt(&[SMOKE], r#""string gridname" "smoke""#).expect_err("there is no such grid");
    assert!(other.contains(r#"no grid "smoke"; it has "density""#), "{other}");
}

#[test]
fn hot_gas_of_pbrt_glows_by_its_temperature() {
    let heat = Written { name: "temperature", value: |_| 20.0, ..SMOKE };
    let smoke = Written { value: |_| 2.0, ..SMOKE };
    let medium = r#""float temperaturescale" 200 "float temperatureoffset" 5 "float LeScale" 7"#;
    let grid = pbrt(&[smoke, heat], medium).expect("nothing is wrong");
    let middle = snell_math::Vec3::splat(0.5);
    let [kelvin, glow] = [&grid.temperature, &grid.emission_scale]
        .map(|g| g.as_ref().expect("it glows").lookup(middle));
    let expected = 2.0 * 7.0 * snell_scene::medium::blackbody_luminance(3000.0);
    assert!(
        (kelvin - 3000.0).abs() < 1.0 && (glow / expected - 1.0).abs() < 1e-3,
        "{kelvin} {glow} {expected}"
    );
}
