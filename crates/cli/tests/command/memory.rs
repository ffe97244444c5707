//! Memory and threads: requests that do not fit are refused before work begins, and `-t` limits all
//! threads.

#![cfg(target_os = "linux")]

use super::support::{Place, Run};
use std::fmt::Write;
use std::time::{Duration, Instant};

/// Runs `snell` with this much address space, in gigabytes. A signal fails the test.
fn run_within(place: &Place, gigabytes: u64, words: &str) -> Run {
    let mut shell = std::process::Command::new("sh");
    let script = format!("ulimit -v {}; exec \"$0\" \"$@\"", gigabytes * 1_000_000);
    shell.args(["-c", &script, env!("CARGO_BIN_EXE_snell")]).args(words.split_whitespace());
    shell.current_dir(place.path("")).env_remove("SNELL_SIMD");
    shell
        .stdin(std::process::Stdio::null())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped());
    place.finish(&mut shell, b"")
}

#[test]
fn a_picture_that_does_not_fit_is_refused_with_one_that_does() {
    let place = Place::new();
    let render = "render cornell-box -i flat --spp 1 -t 2 -q";
    for (words, size) in [
        ("--size 16000x16000 -o a.png", "16000x16000"),
        ("--size 6000x6000 --variance --aov all -o a.exr", "6000x6000"),
        ("--size 16000x16000 --turntable 3 -o a.gif", "16000x16000"),
        ("--size 16000x16000 --crop 0,0,9000,9000 -o a.png", "9000x9000"),
    ] {
        let run = run_within(&place, 2, &format!("{render} {words}"));
        let what = if words.contains("--crop") { "part" } else { "picture" };
        let parts =
            [format!("a picture of {size} pixels needs about "), format!("a {what} of at most ")];
        assert!(run.code == 2 && run.err.lines().count() == 1, "{words}: {}", run.err);
        assert!(
            parts.iter().all(|part| run.err.contains(part)) && run.err.contains("ulimit -v"),
            "{}",
            run.err
        );
    }
    assert!(place.files().iter().all(|file| !file.ends_with("png") && !file.ends_with("exr")));
    // The memory needed is that of the crop.
    run_within(&place, 2, &format!("{render} --size 16000x16000 --crop 0,0,64,64 -o a.png")).done();
    let run = run_within(&place, 2, "view cornell-box --no-open -- --size 8000x8000");
    assert!(run.code == 1 && run.err.contains("fits"), "{}", run.err);
}

#[test]
fn the_estimate_is_near_what_is_used() {
    let place = Place::new();
    for words in [
        "-o a.png",
        "--spp 17 --filter mitchell -o a.png",
        "--aov depth,normal --variance -o a.exr",
    ] {
        place
            .run(&format!(
                "render cornell-box -i flat --spp 1 --size 1200x1000 -t 2 -q --stats s.json {words}"
            ))
            .done();
        let statistics = place.json("s.json");
        let number =
            |key: &str| statistics[key].as_f64().unwrap_or_else(|| panic!("{key} is a number"));
        let ratio = number("estimated_memory_bytes") / number("peak_memory_bytes");
        assert!((0.9..1.6).contains(&ratio), "{words}: {ratio}");
    }
}

#[test]
fn a_scene_of_more_parts_than_fit_is_refused_by_whatever_makes_it_ready_for_rays() {
    let place = Place::new();
    let children = vec!["1"; 1_000_000].join(",");
    let ball = r#"{"surfaces": [{"shape": {"shape": "sphere", "radius": 1}}]}"#;
    let head = r#""format": "snell scene", "version": 1, "root": 0"#;
    place.write(
        "wide.snell",
        format!("{{{head}, \"nodes\": [{{\"children\": [{children}]}}, {ball}]}}"),
    );
    let small = "--size 8x6 --spp 1";
    for words in [
        &format!("render wide.snell {small} -o a.png"),
        &format!("explain wide.snell --pixel 1,1 -- {small}"),
        "doctor wide.snell",
        "view wide.snell --no-open",
        "bench rays wide.snell",
    ] {
        let run = run_within(&place, 1, words);
        assert!(
            [1, 2].contains(&run.code) && run.err.lines().count() == 1,
            "{words}: {} {}",
            run.code,
            run.err
        );
        assert!(
            run.err.contains("of memory, and") && run.err.contains("ulimit -v"),
            "{words}: {}",
            run.err
        );
    }
}

#[test]
fn a_million_spheres_of_few_bytes_are_not_written_out_but_counted() {
    let place = Place::new();
    let level = |i: usize| format!("{{\"children\": {:?}}}", [i + 1; 10]);
    let nodes: Vec<String> = (0..6).map(level).collect();
    let ball = r#"{"surfaces": [{"shape": {"shape": "sphere", "radius": 1}}]}"#;
    let head = r#""format": "snell scene", "version": 1, "root": 0"#;
    place.write("dag.snell", format!("{{{head}, \"nodes\": [{}, {ball}]}}", nodes.join(", ")));
    let start = Instant::now();
    for (format, problem) in
        [("stl", "9216000000 triangles"), ("obj", "9216000000 triangles"), ("glb", "2111111 nodes")]
    {
        let run = run_within(&place, 2, &format!("convert dag.snell out.{format}"));
        assert!(
            run.code == 1 && run.err.contains(problem) && run.err.contains(".snell"),
            "{}",
            run.err
        );
    }
    run_within(&place, 2, "convert dag.snell out.snell").done();
    run_within(&place, 1, "info dag.snell").done();
    run_within(&place, 1, "doctor dag.snell");
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
}

#[test]
fn a_pixel_of_many_samples_is_explained_in_little_memory() {
    let place = Place::new();
    let words = "explain cornell-box --pixel 5,5 --structures none -- --size 10x10 --max-depth 1 \
        --spp 100000";
    run_within(&place, 1, words).done();
}

/// The maximum number of threads of a command.
fn most_threads(place: &Place, words: &str) -> usize {
    let mut command = place.command(words);
    command.env("RAYON_NUM_THREADS", "300");
    let mut child =
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).spawn();
    let child = child.as_mut().expect("the command exists");
    let tasks = format!("/proc/{}/task", child.id());
    let mut most = 0;
    while child.try_wait().expect("it is our child").is_none() {
        most = most.max(std::fs::read_dir(&tasks).map_or(0, |tasks| tasks.count()));
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(child.wait().is_ok_and(|status| status.success()), "{words}");
    most
}

#[test]
fn one_thread_reads_builds_renders_and_writes_whatever_the_environment_says() {
    let place = Place::new();
    let (mut mesh, side) = (String::new(), 300);
    for (x, y) in (0..side * side).map(|i| (i % side, i / side)) {
        writeln!(mesh, "v {x} {} {y}", (x * y) % 7).expect("text grows");
    }
    for (x, y) in (0..side * side)
        .map(|i| (i % side, i / side))
        .filter(|&(x, y)| x + 1 < side && y + 1 < side)
    {
        let a = y * side + x + 1;
        writeln!(mesh, "f {a} {} {} {}", a + 1, a + side + 1, a + side).expect("text grows");
    }
    place.write("mesh.obj", mesh);
    // Expected are the thread that waits for signals, the one that cancels work on request, the
    // main thread, and one worker for each thread requested.
    let most =
        most_threads(&place, "render mesh.obj -i flat --spp 1 --size 300x200 -t 1 -q -o a.exr");
    assert!((2..=4).contains(&most), "{most} threads");
    let most =
        most_threads(&place, "render mesh.obj -i flat --spp 1 --size 300x200 -t 2 -q -o a.exr");
    assert!((3..=7).contains(&most), "{most} threads");
}

#[test]
fn threads_that_cannot_be_started_are_one_line() {
    let place = Place::new();
    // Each thread has a stack of two megabytes.
    let run = run_within(&place, 1, "render cornell-box --size 8x8 --spp 1 -t 4096 -q -o a.png");
    assert_eq!((run.code, run.err.lines().count()), (1, 1), "{}", run.err);
    assert!(
        run.err.starts_with("error: cannot start 4096 threads") && run.err.contains("-t"),
        "{}",
        run.err
    );
}
