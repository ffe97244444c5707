//! Thousands of damaged variants of small valid files. The environment variable `SNELL_MUTATIONS`
//! sets the number of variants for each format.

use super::mutate::{correct_png_checksums, mutate};
use super::seeds::{MESH_WITH_MATERIALS, Seed, images, materials, scenes};
use super::watch::Report;
use super::{render, seeds};
use std::collections::BTreeMap;

/// Variants of each format.
fn variants() -> u32 {
    std::env::var("SNELL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(400)
}

/// Runs all variants of all seeds, the seeds shared among threads.
fn run(seeds: Vec<Seed>, case: impl Fn(&Seed, &str, Vec<u8>, &mut Report) + Sync) {
    let mut formats: BTreeMap<&str, Vec<Seed>> = BTreeMap::new();
    for seed in seeds {
        formats.entry(seed.format).or_default().push(seed);
    }
    let mut failures = Vec::new();
    for (format, seeds) in formats {
        let each = variants().div_ceil(seeds.len() as u32);
        let mut report = Report::default();
        let parts: Vec<_> = std::thread::scope(|scope| {
            let case = &case;
            let work = |seed| move || one_seed(seed, each, case);
            let threads: Vec<_> = seeds.iter().map(|seed| scope.spawn(work(seed))).collect();
            threads.into_iter().map(|t| t.join().expect("cases catch panics")).collect()
        });
        parts.into_iter().for_each(|part| report.add(part));
        // More than one file in fifty must be rendered: otherwise only first lines would have been
        // tested.
        assert!(
            report.pictures * 50 > report.files,
            "{format}: only {} of {} rendered",
            report.pictures,
            report.files
        );
        failures.extend(report.conclude(format));
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

fn one_seed(seed: &Seed, count: u32, case: impl Fn(&Seed, &str, Vec<u8>, &mut Report)) -> Report {
    let mut report = Report::default();
    case(seed, &format!("{} as it is", seed.name), seed.bytes.clone(), &mut report);
    assert_eq!(
        (report.pictures, report.invalid_samples),
        (1, 0),
        "{}: the seed is good",
        seed.name
    );
    for number in 0..count {
        case(seed, &format!("{} {number}", seed.name), mutate(&seed.bytes, number), &mut report);
    }
    report
}

#[test]
fn damaged_scenes_end_in_pictures_or_errors() {
    run(scenes(), |seed, what, bytes, report| {
        report.case(what, || render::scene(&seed.name, bytes, &seed.folder));
    });
}

#[test]
fn damaged_materials_end_in_pictures_or_errors() {
    let folder = tempfile::TempDir::new().expect("temporary folders can be made");
    run(vec![materials()], |seed, what, bytes, report| {
        std::fs::write(folder.path().join(&seed.name), bytes).expect("the folder is writable");
        report.case(what, || {
            render::scene("a.obj", seeds::MESH_WITH_MATERIALS.into(), folder.path())
        });
    });
    assert!(MESH_WITH_MATERIALS.contains("damaged.mtl"));
}

#[test]
fn damaged_images_end_in_pictures_or_errors() {
    run(images(), |seed, what, mut bytes, report| {
        if seed.format == "png" {
            correct_png_checksums(&mut bytes);
        }
        report.case(what, || render::environment(&seed.name, bytes, &seed.folder));
    });
}
