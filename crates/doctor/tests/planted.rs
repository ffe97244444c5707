//! Every flaw planted in the small files of `planted/` is found, and nothing else in these files;
//! scenes without flaws have no findings.

use snell_doctor::{Severity, examine};
use snell_formats::{ReadOptions, read_scene};
use std::path::Path;

/// File, and the check that finds its flaw with its severity.
const PLANTED: &[(&str, &str, Severity)] = &[
    ("albedo-above-one.pbrt", "materials", Severity::Warning),
    ("ball-in-glass-face.pbrt", "coplanar", Severity::Warning),
    ("camera-in-a-ball.pbrt", "cameras", Severity::Error),
    ("camera-turned-away.pbrt", "cameras", Severity::Warning),
    ("face-twice.obj", "faces", Severity::Warning),
    ("face-without-area.off", "faces", Severity::Note),
    ("far-from-the-origin.obj", "scale", Severity::Warning),
    ("fin-in-glass.pbrt", "holes", Severity::Warning),
    ("flattened.snell", "numbers", Severity::Warning),
    ("glass-on-table.pbrt", "coplanar", Severity::Warning),
    ("hole-in-glass.pbrt", "holes", Severity::Error),
    ("in-the-wrong-units.obj", "scale", Severity::Warning),
    ("inside-out-glass.pbrt", "winding", Severity::Error),
    ("inside-out-without-back.gltf", "winding", Severity::Warning),
    ("inside-out.obj", "winding", Severity::Note),
    ("lamp-faces-ceiling.pbrt", "lights", Severity::Warning),
    ("light-in-a-box.pbrt", "lights", Severity::Warning),
    ("light-without-light.pbrt", "lights", Severity::Warning),
    ("missing-library.obj", "reader", Severity::Error),
    ("missing-texture.obj", "reader", Severity::Error),
    ("not-a-number.obj", "numbers", Severity::Error),
    ("rough-beyond-reason.pbrt", "materials", Severity::Warning),
    ("spot-turned-away.pbrt", "lights", Severity::Warning),
    ("textured-without-coordinates.gltf", "textures", Severity::Warning),
    ("turned-face-of-glass.pbrt", "winding", Severity::Error),
    ("two-sheets.pbrt", "coplanar", Severity::Warning),
    ("unknown-material.pbrt", "reader", Severity::Warning),
];

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/planted"))
}

#[test]
fn every_planted_flaw_is_found_and_nothing_else() {
    let mut failures = Vec::new();
    for (file, check, severity) in PLANTED {
        let scene = read_scene(&folder().join(file), &ReadOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        let findings = examine(&scene).unwrap_or_else(|e| panic!("{file}: {e}"));
        let found = findings.iter().find(|f| f.check == *check && f.severity == *severity);
        let is_found = found.is_some_and(|f| !f.message.is_empty() && !f.remedy.is_empty());
        let others = findings.iter().filter(|f| f.check != *check && f.severity != Severity::Note);
        if !is_found || others.count() > 0 {
            failures.push(format!("{file}: {findings:#?}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_planted_file_is_looked_at() {
    let mut files: Vec<String> = std::fs::read_dir(folder())
        .expect("the folder is there")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| !name.ends_with(".mtl"))
        .collect();
    files.sort();
    let listed: Vec<_> = PLANTED.iter().map(|(file, ..)| *file).collect();
    assert_eq!(files, listed);
}

#[test]
fn scenes_that_are_sound_have_no_flaws() {
    for builtin in snell_scene::builtin::BUILTINS {
        let findings = examine(&(builtin.make)()).expect("a sound scene");
        assert!(
            findings.iter().all(|f| f.severity == Severity::Note),
            "{}: {findings:#?}",
            builtin.name
        );
    }
    let scenes = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes"));
    for entry in std::fs::read_dir(scenes).expect("the scenes are there") {
        let path = entry.expect("an entry").path();
        let known = ["obj", "gltf", "glb", "scn", "pbrt", "snell", "nff"];
        if path.extension().is_some_and(|e| known.contains(&e.to_string_lossy().as_ref())) {
            let scene =
                read_scene(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
            let findings = examine(&scene).expect("a sound scene");
            assert!(
                findings.iter().all(|f| f.severity == Severity::Note),
                "{}: {findings:#?}",
                path.display()
            );
        }
    }
}
