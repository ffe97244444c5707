//! Whole files: real ones, included ones, compressed ones, broken ones by the thousand.

use super::*;
use crate::{ReadOptions, read_scene};
use std::io::Write;

const SEED: &str = "# seed\nLookAt 3 4 1.5  .5 .5 0  0 0 1\nCamera \"perspective\" \"float fov\" \
    45\nSampler \"halton\" \"integer pixelsamples\" 128\n\
    Film \"rgb\" \"string filename\" \"a.png\" \"integer xresolution\" [400] \"integer \
    yresolution\" [400]\nWorldBegin\n\
    LightSource \"infinite\" \"rgb L\" [ .4 .45 .5 ]\nLightSource \"distant\" \"point3 from\" [ \
    -30 40 100 ] \"blackbody L\" 3000 \"float scale\" 1.5\n\
    AttributeBegin\nTexture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" [16] \"float \
    vscale\" [16] \"rgb tex1\" [.1 .1 .1] \"rgb tex2\" [.8 .8 .8]\n\
    Material \"diffuse\" \"texture reflectance\" \"c\"\nTranslate 0 0 -1\nShape \"bilinearmesh\" \
    \"point3 P\" [ -20 -20 0 20 -20 0 -20 20 0 20 20 1 ]\nAttributeEnd\n\
    MakeNamedMaterial \"m\" \"string type\" \"conductor\" \"spectrum eta\" \"metal-Ag-eta\" \
    \"spectrum k\" \"metal-Ag-k\"\nNamedMaterial \"m\"\n\
    ObjectBegin \"o\" Shape \"sphere\" \"float zmin\" 0 Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 \
    1 1 0 2 2 2] ObjectEnd\nObjectInstance \"o\"\n\
    Shape \"loopsubdiv\" \"integer levels\" 1 \"point3 P\" [0 0 0 1 0 0 0 1 0 0 0 1] \"integer \
    indices\" [0 1 2 0 3 1 1 3 2 2 3 0]\n";

#[test]
fn public_scenes_load_with_all_they_hold() {
    let mut lines = Vec::new();
    for name in [
        "bitterli/cornell-box",
        "bitterli/veach-mis",
        "bitterli/veach-bidir",
        "bitterli/coffee",
        "pbrt/killeroo-v3",
    ] {
        let file =
            if name.starts_with("pbrt") { "killeroo-simple.pbrt" } else { "pbrt/scene-v4.pbrt" };
        let Some(folder) = data(name) else { return };
        let mut scene = read_scene(&folder.join(file), &ReadOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        let prefix = format!("{}/", folder.display());
        scene.warnings.iter_mut().for_each(|w| w.message = w.message.replace(&prefix, ""));
        lines.push(format!("{name}: {}", summary(&scene)));
    }
    insta::assert_snapshot!(lines.join("\n"), @r#"
    bitterli/cornell-box: 8 mesh, 36 triangle, 8 material, lights [], 1 camera
    bitterli/veach-mis: 6 mesh, 3 sphere, 52 triangle, 8 material, lights [], 1 camera
    bitterli/veach-bidir: 14 mesh, 11544 triangle, 6 material, lights [], 1 camera, 1x "pbrt/scene-v4.pbrt:1:1: Integrator "bdpt": the integrator path was used instead"
    bitterli/coffee: 23 mesh, 235271 triangle, 8 material, lights [], 1 camera
    pbrt/killeroo-v3: 4 mesh, 1 sphere, 66532 triangle, 4 material, lights [], 1 camera
    "#);
}

#[test]
fn content_tells_the_format() {
    for text in
        ["WorldBegin", "# c\n\n  LookAt 0 0 0 1 1 1 0 1 0", "Film \"rgb\"", "AttributeBegin"]
    {
        assert!((READER.recognises)(text.as_bytes()), "{text}");
    }
    for text in ["", "camera 0 0 0", "{}", "ply\n", "Worldbegin", "v 0 0 0"] {
        assert!(!(READER.recognises)(text.as_bytes()), "{text}");
    }
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).expect("memory has room");
    encoder.finish().expect("memory has room")
}

#[test]
fn names_in_included_files_may_be_relative_to_them() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("parts")).expect("made");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("written");
    };
    write("parts/ball.pbrt", "Shape \"sphere\"");
    write("parts/red.ppm", "P3 1 1 255 255 0 0");
    write("ball.pbrt", "Shape \"disk\"");
    let picture = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"red.ppm\" \
        Material \"diffuse\" \"texture reflectance\" \"t\"";
    for confine in [false, true] {
        let options = ReadOptions { confine, ..ReadOptions::default() };
        let read = || {
            write("a.pbrt", "WorldBegin Include \"parts/all.pbrt\"");
            read_scene(&folder.path().join("a.pbrt"), &options).unwrap_or_else(|e| panic!("{e}"))
        };
        // The folder of the main file comes first, as in pbrt.
        write("parts/all.pbrt", &format!("{picture} Include \"ball.pbrt\""));
        let scene = read();
        assert!(scene.warnings.iter().all(|w| !w.message.contains("red.ppm")));
        let shape = |scene: &snell_scene::Scene| {
            let of = |node: &snell_scene::Node| format!("{:?}", node.surfaces);
            scene.nodes.iter().map(of).collect::<String>().to_lowercase()
        };
        assert!(!shape(&scene).contains("sphere"));
        std::fs::rename(folder.path().join("ball.pbrt"), folder.path().join("other")).expect("ok");
        assert!(shape(&read()).contains("sphere"));
        std::fs::rename(folder.path().join("other"), folder.path().join("ball.pbrt")).expect("ok");
    }
}

#[test]
fn included_and_compressed_files_are_parts_of_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, bytes).expect("written");
    };
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float \
        y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    write("mesh/a.ply.gz", &packed(ply.as_bytes()));
    // Names are relative to the main file, in whatever file they are.
    write(
        "parts/shape.pbrt.gz",
        &packed(b"Translate 1 0 0 Shape \"plymesh\" \"string filename\" \"mesh/a.ply.gz\""),
    );
    write(
        "a.pbrt",
        b"WorldBegin Import \"parts/shape.pbrt.gz\" Include \"parts/shape.pbrt.gz\" Include \
            \"parts/shape.pbrt.gz\"",
    );
    let scene = read_scene(&folder.path().join("a.pbrt"), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    let places: Vec<f64> = scene
        .nodes
        .iter()
        .filter(|n| !n.surfaces.is_empty())
        .map(|n| n.transform.translation.x)
        .collect();
    // Changes of the transform by an imported file end with the file. The first two shapes are at
    // the same place, so they share a node.
    assert_eq!(places, [1.0, 2.0]);
    let meshes = meshes(&scene);
    assert_eq!(meshes.len(), 3);
    assert!(meshes.iter().all(|m| std::sync::Arc::ptr_eq(m, &meshes[0])));
    write("b.pbrt.gz", &packed(b"WorldBegin Shape \"sphere\""));
    assert!(read_scene(&folder.path().join("b.pbrt.gz"), &ReadOptions::default()).is_ok());
}

#[test]
fn a_file_that_unpacks_to_much_more_is_refused() {
    let bomb = packed(&vec![b' '; 80 << 20]);
    let error = crate::read_scene_bytes("a.pbrt.gz", bomb, Path::new("."), &ReadOptions::default())
        .expect_err("a bomb");
    assert!(error.to_string().contains("unpacks to more than"), "{error}");
}

#[test]
fn broken_versions_of_a_scene_never_panic() {
    testing::read_broken_versions(&READER, SEED.as_bytes(), Path::new("/nonexistent"));
}
