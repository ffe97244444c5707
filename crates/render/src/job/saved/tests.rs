//! Renders that are saved, and gone on with.

use super::*;
use crate::compile::CompiledScene;
use crate::film::Film;
use crate::film::filter::Filter;
use crate::guiding::Guiding;
use crate::integrator::aov::Aov;
use crate::settings::Crop;
use std::sync::atomic::{AtomicUsize, Ordering};

fn with_job<T>(settings: &Settings, test: impl FnOnce(&Job) -> T) -> T {
    let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
    let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
        .expect("a valid scene");
    test(&Job::new(&compiled, &scene.cameras[0], settings))
}

fn settings() -> Settings {
    Settings { size: [20, 36], spp: 40, max_depth: 3, ..Settings::default() }
}

fn saved(job: &Job, underway: &Underway, facts: &[Fact]) -> Vec<u8> {
    let mut bytes = Vec::new();
    underway.save(job.settings(), facts, "a note", &mut bytes).expect("memory takes everything");
    bytes
}

/// Renders until `keep_going` was asked so many times.
fn part_of(job: &Job, asks: usize) -> Underway {
    let mut underway = job.begin(2, &|_| true);
    let asked = AtomicUsize::new(0);
    let goes_on = |_: &Progress| asked.fetch_add(1, Ordering::Relaxed) < asks;
    job.go_on(&mut underway, u32::MAX, 2, &goes_on);
    underway
}

#[test]
fn a_render_that_is_saved_anywhere_goes_on_to_the_same_bits() {
    let guiding = Some(Guiding::with_passes(2));
    let aovs = vec![Aov::Depth, Aov::CryptoObject, Aov::Samples];
    let filter = Filter::Mitchell;
    for settings in [
        settings(),
        Settings { aovs, filter, ..settings() },
        Settings { noise: Some(0.1), spp: 300, ..settings() },
        Settings { guiding, ..settings() },
    ] {
        with_job(&settings, |job| {
            let facts = facts(&settings);
            let (whole, statistics) = job.run(2, &|_| true);
            for asks in [0, 1, 7, 30] {
                let bytes = saved(job, &part_of(job, asks), &facts);
                let mut underway = job
                    .restore(&mut bytes.as_slice(), &facts, 1, &|_| true)
                    .unwrap_or_else(|e| panic!("{e}"));
                assert!(!job.go_on(&mut underway, u32::MAX, 1, &|_| true));
                assert_eq!(underway.film.image(), whole.image(), "{asks} {settings:?}");
                assert_eq!(underway.film.variance(), whole.variance(), "{asks} {settings:?}");
                assert_eq!(underway.statistics.samples, statistics.samples);
                assert_eq!(underway.statistics.rays, statistics.rays);
                let covered = |film: &Film| {
                    let lists = film.coverage(Aov::CryptoObject);
                    lists.iter().map(|(list, n)| (list.to_vec(), *n)).collect::<Vec<_>>()
                };
                assert_eq!(covered(&underway.film), covered(&whole));
            }
        });
    }
}

#[test]
fn a_render_goes_on_with_more_samples_where_they_do_not_depend_on_their_number() {
    let more = Settings { spp: 64, ..settings() };
    let bytes =
        with_job(&settings(), |job| saved(job, &part_of(job, usize::MAX), &facts(job.settings())));
    with_job(&more, |job| {
        let mut underway = job
            .restore(&mut bytes.as_slice(), &facts(&more), 1, &|_| true)
            .expect("both numbers have points of sets of 64");
        job.go_on(&mut underway, u32::MAX, 1, &|_| true);
        assert_eq!(underway.film.image(), job.run(1, &|_| true).0.image());
    });
    let too_many = Settings { spp: 65, ..settings() };
    with_job(&too_many, |job| {
        let error = job.restore(&mut bytes.as_slice(), &facts(&too_many), 1, &|_| true);
        let error = error.err().expect("other points").to_string();
        assert!(error.contains("--spp") && error.contains("was 64 and is 128"), "{error}");
    });
    let too_few = Settings { spp: 33, ..settings() };
    with_job(&too_few, |job| {
        let error = job.restore(&mut bytes.as_slice(), &facts(&too_few), 1, &|_| true);
        let error = error.err().expect("too few").to_string();
        assert!(error.contains("40 samples already, and --spp is 33 now"), "{error}");
    });
}

#[test]
fn what_is_cut_or_changed_is_told_from_what_is_whole() {
    let settings = Settings { size: [20, 20], spp: 20, noise: Some(0.1), ..settings() };
    with_job(&settings, |job| {
        let facts = facts(&settings);
        let bytes = saved(job, &part_of(job, usize::MAX), &facts);
        let read = |bytes: &[u8]| job.restore(&mut &*bytes, &facts, 1, &|_| true).map(drop);
        read(&bytes).expect("it is whole");
        for length in (0..bytes.len()).step_by(7) {
            let error = read(&bytes[..length]).expect_err("it is cut");
            assert!(matches!(error, SavedError::Damaged(_)), "{length}: {error}");
        }
        for place in (0..bytes.len()).step_by(5) {
            let mut bytes = bytes.clone();
            bytes[place] ^= 1 << (place % 8);
            read(&bytes).expect_err("a bit is wrong");
        }
        assert!(matches!(read(b"a picture or something else"), Err(SavedError::Foreign(_))));
        let older = [b"snellR00", &bytes[8..]].concat();
        assert!(matches!(read(&older), Err(SavedError::Version(..))));
    });
}

#[test]
fn a_checkpoint_of_another_picture_is_refused_by_what_differs() {
    let bytes = with_job(&settings(), |job| saved(job, &part_of(job, 3), &facts(job.settings())));
    for (other, what) in [
        (Settings { seed: 5, ..settings() }, "--seed was 0 and is 5 now"),
        (Settings { max_depth: 4, ..settings() }, "--max-depth was 3 and is 4 now"),
        (Settings { size: [20, 37], ..settings() }, "--size was 20x36 and is 20x37 now"),
    ] {
        with_job(&other, |job| {
            let error = job.restore(&mut bytes.as_slice(), &facts(&other), 1, &|_| true);
            let error = error.err().expect("it differs").to_string();
            assert!(error.contains(what), "{error}");
        });
    }
}

#[test]
fn values_are_those_of_the_command() {
    let settings = Settings {
        crop: Some(Crop { min: [1, 2], max: [3, 4] }),
        guiding: Some(Guiding::with_passes(5)),
        aovs: vec![Aov::Depth, Aov::Normal],
        ..settings()
    };
    let facts = facts(&settings);
    for (name, value) in [
        ("--size", "20x36"),
        ("--crop", "1,2,3,4"),
        ("--sampler", "zsobol"),
        ("--guiding", "5"),
        ("--aov", "depth,normal"),
    ] {
        let found = facts.iter().find(|fact| fact.0 == name);
        assert_eq!(found.map(|fact| fact.1.as_str()), Some(value), "{name}");
    }
}

#[test]
fn pictures_of_an_animation_differ_in_their_frame_alone() {
    with_job(&settings(), |job| {
        let with = |frame: Option<&str>, seed: u32| -> Vec<Fact> {
            let settings = Settings { seed, ..settings() };
            facts(&settings).into_iter().chain(fact(FRAME, frame)).collect()
        };
        let bytes = saved(job, &part_of(job, 3), &with(Some("a.0001.png"), 0));
        let header = Header::read(&mut bytes.as_slice()).expect("it is whole");
        let differs = |frame, seed| {
            let difference = header.difference_from_animation(&with(frame, seed));
            difference.map(|difference| difference.name)
        };
        assert_eq!(differs(Some("a.0002.png"), 0), None);
        assert_eq!(differs(None, 0).as_deref(), Some(FRAME));
        assert_eq!(differs(Some("a.0002.png"), 7).as_deref(), Some("--seed"));
    });
}
