//! Renders that workers share through a folder.

use super::support::{Place, Run};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

fn bytes(place: &Place, name: &str) -> Vec<u8> {
    std::fs::read(place.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn started(place: &Place, words: &str) -> Child {
    let mut command = place.command(words);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("the command exists")
}

/// The files of a folder and its folders.
fn files(folder: &std::path::Path) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).expect("the folder is there");
    let paths = entries.map(|entry| entry.expect("it can be read").path());
    paths.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

fn results(place: &Place, plan: &str) -> Vec<std::path::PathBuf> {
    let mut all = files(&place.path(plan));
    all.retain(|path| path.extension().is_some_and(|e| e == "result"));
    all.sort();
    all
}

/// The picture of a plan has the bytes of that of one process.
fn check(place: &Place, scene: &str, more: &str, work: &[&str]) {
    let _ = std::fs::remove_dir_all(place.path("plan"));
    place.run(&format!("render {scene} -q -o whole.exr")).done();
    place.run(&format!("plan {scene} {more} -q -o plan")).done();
    for words in work {
        place.run(&format!("work plan -q {words}")).done();
    }
    place.run("merge plan -q -o merged.exr").done();
    assert!(bytes(place, "whole.exr") == bytes(place, "merged.exr"), "{scene} {more}");
}

#[test]
fn a_plan_gives_the_file_of_one_process() {
    let place = Place::new();
    place.write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
    place.write("a.mtl", "newmtl m\nKd 0.8 0.2 0.1\n");
    let layers = "--aov depth,normal,crypto-object --variance --filter mitchell";
    let box_of = |more: &str| format!("cornell-box --size 50x40 {more}");
    check(&place, &box_of(&format!("--spp 20 {layers}")), "", &["-t 1"]);
    check(&place, &box_of("--spp 70"), "--tiles-per-task 3 --samples-per-task 16", &["-t 2"]);
    check(&place, &box_of("--spp 20 --fog 0.001 --crop 10,5,40,33"), "", &["--tasks 1-8", ""]);
    check(&place, &box_of("--spp 300 --noise 0.1"), "--tiles-per-task 2", &[""]);
    check(&place, &box_of("--spp 16 --guiding=2"), "--tiles-per-task 4", &[""]);
    check(
        &place,
        "a.obj --size 40x30 --spp 16 -D material.m.reflectance.factor=[0.2,0.9,0.1]",
        "",
        &[""],
    );
}

#[test]
fn frames_of_a_plan_are_those_of_one_process() {
    let place = Place::new();
    let scene = "teapot --size 32x24 --spp 8 --turntable 4";
    place.run(&format!("render {scene} -q -o whole.#.png")).done();
    place.run(&format!("plan {scene} -q -o plan")).done();
    let mut workers = [started(&place, "work plan -t 1"), started(&place, "work plan -t 1")];
    for worker in &mut workers {
        assert!(worker.wait().expect("it was started").success());
    }
    place.run("merge plan -q -o merged.#.png").done();
    for frame in 0..4 {
        let [whole, merged] = ["whole", "merged"].map(|name| format!("{name}.{frame}.png"));
        assert!(bytes(&place, &whole) == bytes(&place, &merged), "picture {frame}");
    }
    let status = place.run("plan status plan").done();
    assert!(status.text().contains("4 of 4 pictures finished"), "{}", status.text());
}

#[cfg(unix)]
#[test]
fn workers_may_be_killed_at_any_moment() {
    let place = Place::new();
    let scene = "cornell-box --size 64x48 --spp 256 --noise 0.02";
    place.run(&format!("render {scene} -q -o whole.exr")).done();
    place.run(&format!("plan {scene} --tiles-per-task 1 -q -o plan")).done();
    let words = "work plan -t 1 --lease 0.3s";
    let mut kills = 0;
    for round in 0..12u64 {
        let mut workers = [started(&place, words), started(&place, words)];
        std::thread::sleep(Duration::from_millis(60 + 45 * round));
        for worker in &mut workers {
            kills += u32::from(worker.try_wait().expect("it was started").is_none());
            // If it has just ended, nothing is left to be killed.
            let _ = worker.kill();
            worker.wait().expect("it was started");
        }
    }
    assert!(kills > 4, "the render is too short to be killed");
    place.run("work plan -q --lease 0.3s").done();
    place.run("merge plan -q -o merged.exr").done();
    assert!(bytes(&place, "whole.exr") == bytes(&place, "merged.exr"), "the bits differ");
}

#[test]
fn what_is_missing_foreign_broken_or_different_is_named() {
    let place = Place::new();
    let plan = |seed: u32, folder: &str| {
        place.run(&format!(
            "plan cornell-box --size 64x32 --spp 4 --seed {seed} --tiles-per-task 2 -q -o {folder}"
        ))
    };
    let merge = |folders: &str| -> Run { place.run(&format!("merge {folders} -q -o a.exr")) };
    let refused = |run: Run, code: i32, words: &str| {
        assert_eq!(run.code, code, "{}", run.err);
        assert!(run.err.contains(words), "{}", run.err);
        assert!(!place.path("a.exr").exists());
    };
    plan(1, "plan").done();
    plan(2, "other").done();
    refused(plan(1, "plan"), 2, "there is a plan in this folder");
    refused(merge("plan"), 1, "4 of 4 tasks have no result (0, 1, 2, 3); run snell work plan");
    place.run("work plan -q --tasks 1-2").done();
    refused(merge("plan"), 1, "2 of 4 tasks have no result (0, 3)");
    refused(merge("plan other"), 2, "are not the same plan");
    place.run("work plan -q").done();
    place.run("work other -q").done();
    let (mine, foreign) = (results(&place, "plan"), results(&place, "other"));
    let first = std::fs::read(&mine[0]).expect("it is there");
    let put = |content: &[u8]| std::fs::write(&mine[0], content).expect("it is writable");

    put(&std::fs::read(&foreign[0]).expect("it is there"));
    refused(merge("plan"), 1, "this is a result of another plan (worker ");
    put(&std::fs::read(&mine[1]).expect("it is there"));
    refused(merge("plan"), 1, "this is the result of another task (worker ");
    let mut flipped = first.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 4;
    put(&flipped);
    refused(merge("plan"), 1, "this file is damaged");
    put(&first[..first.len() / 2]);
    refused(merge("plan"), 1, "it ends early");
    std::fs::remove_file(&mine[0]).expect("it is ours");
    // A copy of the folder has what this one lacks.
    let copy = place.path("copy");
    std::fs::create_dir_all(copy.join("frames/00000/0000000")).expect("it is writable");
    std::fs::copy(place.path("plan/plan.json"), copy.join("plan.json")).expect("it is there");
    let name = mine[0].file_name().expect("it has a name");
    std::fs::write(copy.join("frames/00000/0000000").join(name), &first).expect("it is writable");
    assert_eq!(merge("plan copy").code, 0);
    std::fs::remove_file(place.path("a.exr")).expect("it was written");
    // A broken machine had the same task.
    put(&first);
    let stem = name.to_str().expect("it is text").strip_suffix(".result").expect("it is a result");
    std::fs::copy(&mine[1], mine[0].with_file_name(format!("{stem}.bad-pc.other")))
        .expect("a copy");
    let run = merge("plan");
    assert!(run.err.contains("bad-pc differ"), "{}", run.err);
    refused(run, 1, "one of their machines is broken");

    let text = std::fs::read_to_string(place.path("plan/plan.json")).expect("it is there");
    place.write("plan/plan.json", text.replace("\"spp\": 4", "\"spp\": 5"));
    refused(place.run("work plan"), 2, "this plan was changed");
    refused(place.run("work nothing"), 1, "nothing/plan.json: No such file");
    for (words, message) in [
        ("plan cornell-box -o p --time 3", "--time"),
        ("plan cornell-box -o p --samples-per-task 20", "a multiple of 16"),
        ("plan cornell-box", "name the folder of the plan"),
        ("work other --tasks 2-4", "the plan has the tasks 0 to 3"),
    ] {
        refused(place.run(words), 2, message);
    }
}

#[test]
fn a_worker_that_is_told_to_end_gives_its_task_back() {
    let place = Place::new();
    place.run("plan cornell-box --size 320x240 --spp 4096 -q -o plan").done();
    let mut worker = started(&place, "work plan -t 1");
    let start = Instant::now();
    let leases = || {
        let all = files(&place.path("plan"));
        all.into_iter().filter(|path| path.extension().is_some_and(|e| e == "lease")).count()
    };
    while leases() == 0 && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(leases(), 1);
    #[cfg(unix)]
    {
        use nix::sys::signal::{Signal, kill};
        kill(nix::unistd::Pid::from_raw(worker.id() as i32), Signal::SIGTERM).expect("it runs");
        assert_eq!(worker.wait().expect("it was started").code(), Some(130));
        assert_eq!(leases(), 0);
    }
    // If it has just ended, nothing is left to be killed.
    let _ = worker.kill();
    let _ = worker.wait();
}

#[test]
fn a_wrong_tile_is_found_and_right_pictures_pass() {
    let place = Place::new();
    place.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    for name in ["a.exr", "a.png"] {
        place.run(&format!("render a.obj --size 48x32 --spp 8 --exposure 0.5 -q -o {name}")).done();
        let run = place.run(&format!("verify {name}")).done();
        assert!(run.text().contains("6 of 6 tiles rendered again, all the same bits"), "{run:?}");
    }
    // The picture with the receipt of another.
    place.run("render a.obj --size 48x32 --spp 8 --exposure 0.5 --seed 9 -q -o b.png").done();
    let mut other = place.layers("b.png");
    let mine = place.layers("a.png");
    let receipt = |of: &snell_scene::LayeredImage| {
        of.metadata.iter().find(|(key, _)| key == "Receipt").expect("there is one").clone()
    };
    other.metadata = vec![receipt(&mine)];
    let write = |name: &str, picture: &snell_scene::LayeredImage| {
        let options = snell_formats::image::WriteOptions::default();
        snell_formats::image::write_image(&place.path(name), picture, &options)
            .expect("it is writable");
    };
    write("c.png", &other);
    let run = place.run("verify c.png");
    assert_eq!(run.code, 1, "{run:?}");
    assert!(run.text().contains("is not what its settings give"), "{}", run.text());
    // One tile is wrong.
    let mut planted = place.layers("a.exr");
    planted.layers[0].values[(20 * 48 + 40) * 3] += 1e-6;
    write("d.exr", &planted);
    let run = place.run("verify d.exr");
    assert_eq!(run.code, 1, "{run:?}");
    assert_eq!(run.text().lines().count(), 1, "{}", run.text());
    assert!(run.text().contains("the tile at 32,16 is not what"), "{}", run.text());
    // The scene has changed.
    place.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n");
    let run = place.run("verify a.exr");
    assert_eq!(run.code, 2, "{run:?}");
    assert!(run.err.contains("is not the one of the picture"), "{}", run.err);
}

#[test]
fn a_receipt_of_a_stranger_writes_nothing_and_loads_nothing() {
    let place = Place::new();
    place.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    place.run("render a.obj --size 32x16 --spp 1 -q -o a.exr").done();
    let verify = |argument: &str| {
        let mut picture = place.layers("a.exr");
        for (key, text) in &mut picture.metadata {
            if key == "Receipt" {
                *text = text.replace("--spp=1", argument);
            }
        }
        let options = snell_formats::image::WriteOptions::default();
        snell_formats::image::write_image(&place.path("b.exr"), &picture, &options)
            .expect("it is writable");
        place.run("verify b.exr")
    };
    for argument in ["--stats=s.json", "--output=o.png", "--display=tev://127.0.0.1:9"] {
        let run = verify(argument);
        assert_eq!(run.code, 2, "{run:?}");
        assert!(run.err.contains("which no file may"), "{}", run.err);
    }
    // The library is not looked for, because nothing is denoised to verify.
    place.write("evil.so", "no library");
    let run = verify("--denoise=evil.so");
    assert!(!run.err.contains("evil"), "{}", run.err);
    assert!(!place.path("s.json").exists() && !place.path("o.png").exists());
}

#[test]
fn plans_are_written_as_jobs_of_schedulers() {
    let place = Place::new();
    place.run("plan cornell-box --size 64x32 --spp 4 --tiles-per-task 1 -q -o plan").done();
    place.run("plan cornell-box --size 64x32 --spp 4 --noise 0.1 -q -o rounds").done();
    let export = |words: &str| place.run(&format!("plan export {words}")).done();
    let run = export("openjd plan");
    assert!(run.text().contains("range: \"0-7\"") && run.text().contains("TASK_CHUNKING"));
    let run = export("openjd rounds --workers 3");
    assert!(run.text().contains("range: \"1-3\"") && !run.text().contains("TASK_CHUNKING"));
    let run = export("slurm plan --workers 5");
    assert!(run.text().contains("#SBATCH --array=1-5") && run.text().contains("--requeue"));
    let run = export("kubernetes plan --image registry/snell:1 --claim disk");
    assert!(run.text().contains("completionMode: Indexed"), "{}", run.text());
    export("slurm plan -o job.sh");
    assert!(bytes(&place, "job.sh").starts_with(b"#!/bin/bash\n"));
}
