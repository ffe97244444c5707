//! Renders that workers share through a folder.

use super::support::{Place, Run};
use snell_math::simd::Level;
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
    assert!(!mine[0].exists() && mine[0].with_extension("result.useless").exists());
    put(&std::fs::read(&mine[1]).expect("it is there"));
    refused(merge("plan"), 1, "this is the result of another task (worker ");
    let mut flipped = first.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 4;
    put(&flipped);
    refused(merge("plan"), 1, "this file is damaged");
    put(&first[..first.len() / 2]);
    refused(merge("plan"), 1, "it ends early; it was renamed to 00000-0000000.result-4.useless");
    assert!(!mine[0].exists());
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
    refused(place.run("work nothing"), 1, "nothing: there is no such folder");
    refused(merge("nothing.snellr"), 1, "no folder of a plan and no checkpoint of this name");
    refused(place.run("work plan/plan.json"), 2, "this is a file; give the folder of a plan");
    let is_scene = |path: &std::path::PathBuf| path.extension().is_some_and(|e| e == "snell");
    let scene = files(&place.path("other")).into_iter().find(is_scene);
    std::fs::write(scene.expect("there is one"), "{}").expect("it is writable");
    refused(place.run("work other"), 2, "this is not the scene of the plan");
    for (words, message) in [
        ("plan cornell-box -o p --time 3", "--time"),
        ("plan cornell-box -o p --preview p.png", "--preview"),
        ("work other --lease 0s", "above 0"),
        ("work other --lease 25h", "0.2s to 24h"),
        ("plan cornell-box -o p --samples-per-task 20", "a multiple of 16"),
        ("plan cornell-box", "name the folder of the plan"),
        ("work other --tasks 2-4", "the plan has the tasks 0 to 3"),
    ] {
        refused(place.run(words), 2, message);
    }
}

#[test]
fn results_that_vanish_after_the_end_are_rendered_again() {
    let place = Place::new();
    for (more, is_round) in [("--spp 4 --tiles-per-task 2", false), ("--spp 64 --noise 0.3", true)]
    {
        let _ = std::fs::remove_dir_all(place.path("plan"));
        place.run(&format!("plan cornell-box --size 64x32 {more} -q -o plan")).done();
        place.run("work plan -q").done();
        place.run("merge plan -q -o a.exr").done();
        let whole = bytes(&place, "a.exr");
        let kind = if is_round { "state" } else { "result" };
        let mut all = files(&place.path("plan"));
        all.retain(|path| path.extension().is_some_and(|e| e == kind));
        all.sort();
        let last = all.last().expect("there is one");
        for spoil in [None, Some(0), Some(40)] {
            match spoil {
                None => std::fs::remove_file(last).expect("it is there"),
                Some(length) => {
                    let content = std::fs::read(last).expect("it is there");
                    std::fs::write(last, &content[..length]).expect("it is writable");
                }
            }
            let status = place.run("plan status plan").done();
            if !is_round && spoil != Some(40) {
                assert!(status.text().contains("3 of 4 tasks"), "{}", status.text());
            }
            // The round of pixels that stop is put together again from its results.
            let run = place.run("merge plan -q -o a.exr");
            assert_eq!(run.code == 0, is_round, "{}", run.err);
            place.run("work plan -q").done();
            place.run("merge plan -q -o a.exr").done();
            assert!(bytes(&place, "a.exr") == whole, "{more} {spoil:?}");
        }
    }
}

#[test]
fn missing_pictures_are_merged_and_whole_ones_stay() {
    let place = Place::new();
    let words = "plan teapot --size 32x24 --spp 8 --turntable 3 --tiles-per-task 9 -q -o plan";
    place.run(words).done();
    let run = place.run("work plan --tasks 1").done();
    assert!(run.err.contains("task 1 of 0 to 2 (picture 0001): "), "{}", run.err);
    let run = place.run("merge plan -o t.png");
    assert!(run.err.contains("picture 0000: 1 of 1 tasks have no result (0)"), "{}", run.err);
    place.run("work plan -q").done();
    place.run("merge plan -q -o t.png").done();
    let names = [0, 1, 2].map(|number| format!("t.000{number}.png"));
    let whole = names.each_ref().map(|name| bytes(&place, name));
    let time = || place.path("t.0000.png").metadata().and_then(|known| known.modified());
    let written = time().expect("it is there");
    std::fs::remove_file(place.path("t.0001.png")).expect("it is there");
    place.write("t.0002.png", &whole[2][..whole[2].len() / 2]);
    let run = place.run("merge plan --resume -o t.png").done();
    assert!(run.err.contains("2 merged") && !run.err.contains("rendered"), "{}", run.err);
    assert!(run.err.contains("merged again: 1, the first is ./t.0002.png"), "{}", run.err);
    assert_eq!(time().expect("it is there"), written);
    assert!(names.each_ref().map(|name| bytes(&place, name)) == whole);
    let status = place.run("plan status plan --frame 2 --picture s.png").done();
    assert!(status.text().contains("picture 0002: finished"), "{}", status.text());
    assert_eq!(place.run("plan status plan --frame 3 --picture s.png").code, 2);
}

#[test]
fn a_worker_that_is_told_to_end_gives_its_task_back() {
    let place = Place::new();
    place.run("plan cornell-box --size 320x240 --spp 4096 -q -o plan").done();
    let mut worker = started(&place, "work plan -t 1 --name tester");
    let start = Instant::now();
    let leases = || {
        let all = files(&place.path("plan"));
        all.into_iter().filter(|path| path.extension().is_some_and(|e| e == "lease")).count()
    };
    while leases() == 0 && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(leases(), 1);
    let status = place.run("plan status plan").done();
    assert!(status.text().contains("worker tester-"), "{}", status.text());
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
fn workers_with_other_instructions_give_the_same_file() {
    let place = Place::new();
    let scene = "cornell-box --size 50x40 --spp 32 --fog 0.001 --aov depth,normal";
    place.run(&format!("render {scene} -q -o whole.exr")).done();
    place.run(&format!("plan {scene} --tiles-per-task 1 -q -o plan")).done();
    let levels: Vec<Level> = Level::ALL.into_iter().filter(|level| level.is_supported()).collect();
    // The tasks of the last level are all that are left.
    for (number, level) in levels.iter().enumerate() {
        let tasks = match number + 1 < levels.len() {
            true => format!("--tasks {}-{}", 4 * number, 4 * number + 3),
            false => String::new(),
        };
        let mut command = place.command(&format!("work plan -q {tasks}"));
        place.finish(command.env("SNELL_SIMD", level.name()), b"").done();
    }
    place.run("merge plan -q -o merged.exr").done();
    assert!(bytes(&place, "whole.exr") == bytes(&place, "merged.exr"), "{levels:?}");
    for level in levels {
        let mut command = place.command("verify merged.exr --tiles all");
        let run = place.finish(command.env("SNELL_SIMD", level.name()), b"").done();
        assert!(run.text().contains("all the same bits"), "{level}: {}", run.text());
    }
}

#[test]
fn a_wrong_tile_is_found_and_right_pictures_pass() {
    let place = Place::new();
    place.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    for name in ["a.exr", "a.png"] {
        place.run(&format!("render a.obj --size 48x32 --spp 8 --exposure 0.5 -q -o {name}")).done();
        let run = place.run(&format!("verify {name}")).done();
        assert!(run.text().contains("6 of 6 tiles rendered again: all the same bits"), "{run:?}");
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

#[test]
fn the_help_of_a_plan_is_about_plans() {
    let help = Place::new().run("plan --help").done();
    assert!(help.text().contains("New folder for the plan"), "{}", help.text());
    for option in ["--checkpoint", "--preview", "--resume", "--time", "--stats"] {
        assert!(!help.text().contains(option), "{option}");
    }
}

#[cfg(unix)]
#[test]
fn no_name_breaks_out_of_a_job() {
    let place = Place::new();
    let with = |words: &str, name: &str| place.finish(place.command(words).arg(name), b"");
    let name = "a\ntouch broken";
    with("plan cornell-box --size 16x16 --spp 1 -q -o", name).done();
    for scheduler in ["slurm", "openjd", "kubernetes"] {
        let run = with(&format!("plan export {scheduler}"), name);
        assert_eq!(run.code, 2, "{}", run.err);
        assert!(run.err.contains("a line break or a control character"), "{}", run.err);
    }
    // What is to be copied is one word.
    let run = with("plan cornell-box --size 16x16 --spp 1 -o", "it's mine");
    assert!(run.err.contains(r"snell work 'it'\''s mine'"), "{}", run.err);
}

#[cfg(unix)]
#[test]
fn a_job_of_slurm_that_is_told_to_end_is_queued_again() {
    use std::os::unix::fs::PermissionsExt;
    let place = Place::new();
    place.run("plan cornell-box --size 16x16 --spp 1 -q -o plan").done();
    place.run("plan export slurm plan -o job.sh").done();
    let program = |name: &str, text: &str| {
        place.write(name, format!("#!/bin/bash\n{text}\n"));
        std::fs::set_permissions(place.path(name), PermissionsExt::from_mode(0o755))
            .expect("it is ours");
    };
    program("scontrol", "echo \"$@\" >requeued");
    // It ends at once, or not before it has saved something.
    for (worker, code) in [
        ("trap 'exit 130' TERM; touch started; sleep 9 & wait", 130),
        ("trap 'sleep 0.3; exit 130' TERM; touch started; sleep 9 & wait", 130),
        ("touch started; exec sleep 9", 143),
        ("touch started; exit 3", 3),
    ] {
        program("snell", worker);
        let path = std::env::var("PATH").unwrap_or_default();
        let mut job = std::process::Command::new("bash")
            .arg("job.sh")
            .current_dir(place.path(""))
            .env("PATH", format!("{}:{path}", place.path("").display()))
            .env("SLURM_JOB_ID", "7")
            .stderr(Stdio::null())
            .spawn()
            .expect("there is a shell");
        let start = Instant::now();
        while !place.path("started").exists() && start.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(10));
        }
        use nix::sys::signal::{Signal, kill};
        if code != 3 {
            kill(nix::unistd::Pid::from_raw(job.id() as i32), Signal::SIGTERM).expect("it runs");
        }
        assert_eq!(job.wait().expect("it was started").code(), Some(code), "{worker}");
        let requeued = std::fs::read_to_string(place.path("requeued"));
        assert_eq!(requeued.ok().as_deref(), (code != 3).then_some("requeue 7\n"), "{worker}");
        for name in ["started", "requeued"] {
            let _ = std::fs::remove_file(place.path(name));
        }
    }
}
