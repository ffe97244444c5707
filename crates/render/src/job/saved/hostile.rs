//! Files whose checksums fit but whose content was changed: they are refused, or read without a
//! panic.

use super::chunk;
use crate::compile::CompiledScene;
use crate::guiding::Guiding;
use crate::integrator::aov::Aov;
use crate::job::{Job, Split, TaskInput, TaskResult, Underway, facts};
use crate::settings::Settings;
use crate::{Header, Origin};
use snell_math::rng;

/// The contents of the chunks of a file.
fn contents(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut input = &bytes[8..];
    let mut all = Vec::new();
    while !input.is_empty() {
        all.push(chunk::read_content(&mut input).expect("it is whole"));
    }
    all
}

/// A file with the mark of another and these contents.
fn file(like: &[u8], contents: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = like[..8].to_vec();
    for content in contents {
        let packed = lz4_flex::block::compress(content);
        let head = [content.len() as u32, packed.len() as u32, crc32fast::hash(&packed)];
        bytes.extend(head.into_iter().flat_map(u32::to_le_bytes));
        bytes.extend(packed);
    }
    bytes
}

/// Calls `read` with many changed files.
fn try_changed(like: &[u8], seed: u32, read: &dyn Fn(&[u8])) {
    let whole = contents(like);
    for attempt in 0..600 {
        let mut changed = whole.clone();
        let random = |k| rng::pcg4d([attempt, seed, k, 3]);
        for k in 0..=attempt % 3 {
            let [which, place, value, kind] = random(k);
            let content = &mut changed[which as usize % whole.len()];
            if content.is_empty() {
                continue;
            }
            let at = place as usize % content.len();
            match kind % 5 {
                0 => content[at] = value as u8,
                1 => content[at] ^= 1 << (value % 8),
                2 => content[at] = 0xff,
                3 => content.truncate(at),
                _ => content.insert(at, value as u8),
            }
        }
        read(&file(like, &changed));
    }
}

#[test]
fn changed_contents_with_right_checksums_never_panic() {
    let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
    let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
        .expect("a valid scene");
    let settings = Settings {
        size: [20, 18],
        spp: 300,
        noise: Some(0.2),
        max_depth: 3,
        aovs: vec![Aov::Depth, Aov::CryptoObject],
        guiding: Some(Guiding::with_passes(1)),
        ..Settings::default()
    };
    let job = Job::new(&compiled, &scene.cameras[0], &settings);
    let facts = facts(&settings);
    let mut underway = job.begin(2, &|_| true);
    job.go_on(&mut underway, 160, 2, &|_| true);
    let mut state = Vec::new();
    underway.save(&settings, &facts, "", &mut state).expect("memory takes everything");
    try_changed(&state, 1, &|bytes| {
        if let Ok(mut restored) = job.restore(&mut &*bytes, &facts, 1, &|_| true) {
            // What is read can be gone on with.
            let task =
                restored.tasks(&settings, Split { tiles: 1, samples: None }).first().copied();
            if let Some(task) = task {
                job.perform(&mut restored, task, 1, &|_| true);
            }
            job.end_round(&mut restored);
            restored.film.image();
        }
        let mut input = bytes;
        if let Ok(header) = Header::read(&mut input) {
            let _ = header.film(&mut input);
        }
    });
    let mut field = Vec::new();
    underway.save_field(&facts, &mut field).expect("memory takes everything");
    try_changed(&field, 2, &|bytes| {
        if let Ok(mut begun) = job.begin_trained(&mut &*bytes, &facts) {
            let task = begun.tasks(&settings, Split { tiles: 1, samples: None })[0];
            job.perform(&mut begun, task, 1, &|progress| progress.done < 256);
        }
    });
    let task = underway.tasks(&settings, Split { tiles: 2, samples: None })[0];
    let input = underway.input(task).expect("the task is of this film");
    let mut bytes = Vec::new();
    input.save(&mut bytes).expect("memory takes everything");
    try_changed(&bytes, 3, &|bytes| {
        let Ok(input) = TaskInput::load(&mut &*bytes) else { return };
        let mut fresh = Underway::empty(&settings);
        job.perform_input(&mut fresh, input, 1, &|progress| progress.done < 256);
    });
    let result = job.perform(&mut underway, task, 2, &|_| true).expect("nothing ends it");
    let origin = Origin { plan: "a".into(), frame: 0, worker: "b".into() };
    let mut bytes = Vec::new();
    result.save(&origin, &mut bytes).expect("memory takes everything");
    try_changed(&bytes, 4, &|bytes| {
        let Ok((_, result)) = TaskResult::load(&mut &*bytes) else { return };
        let mut fresh = Underway::empty(&settings);
        if fresh.add(result) {
            fresh.film.image();
        }
    });
}
