//! Renders that end early: by the time limit, or by Ctrl-C.

use super::support::Place;
use std::time::{Duration, Instant};

#[test]
fn a_time_limit_ends_the_render() {
    let place = Place::new();
    let start = Instant::now();
    place.run("render cornell-box --size 64x48 --time 1s -t 1 -q --stats s.json -o a.png").done();
    let seconds = start.elapsed().as_secs_f64();
    // The upper limit is much longer than the render should take, because the machine may be busy.
    assert!((0.9..30.0).contains(&seconds), "{seconds} s");
    let statistics = place.json("s.json");
    assert_eq!(statistics["complete"], false);
    assert!(statistics["spp"].as_u64().is_some_and(|n| n >= 1), "{statistics}");
}

#[test]
fn the_first_pass_is_finished_whatever_the_time_limit() {
    let place = Place::new();
    place
        .run("render cornell-box --size 200x150 --time 0.001s -t 1 -q --stats s.json -o a.png")
        .done();
    assert!(place.json("s.json")["spp"].as_u64().is_some_and(|n| n >= 1));
}

#[test]
fn a_time_limit_needs_no_memory_for_samples_that_are_never_taken() {
    let place = Place::new();
    let start = Instant::now();
    place
        .run("render cornell-box --size 1024x1024 --spp 16777216 --time 0.1s -t 2 -q -o a.png")
        .done();
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
}

/// Sends Ctrl-C once the command has reported some progress, or after some seconds; returns its
/// exit code and the messages since.
#[cfg(unix)]
fn interrupted(place: &Place, words: &str, seconds: Option<u64>) -> (Option<i32>, String) {
    use nix::sys::signal::{Signal, kill};
    use nix::unistd::Pid;
    use std::io::{BufRead, BufReader, Read};

    let mut child = place.command(words).spawn().expect("the command exists");
    let mut messages = BufReader::new(child.stderr.take().expect("it is piped"));
    if let Some(seconds) = seconds {
        std::thread::sleep(Duration::from_secs(seconds));
    } else {
        // The first progress message shows that the render runs.
        let mut line = String::new();
        messages.read_line(&mut line).expect("the command writes lines");
        serde_json::from_str::<serde_json::Value>(&line).expect("progress is JSON");
    }
    let start = Instant::now();
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).expect("the command is running");
    let status = child.wait().expect("the command was started");
    // The command ends at once, except on a busy machine. The renders would take much longer.
    assert!(start.elapsed() < Duration::from_secs(30), "{:?}", start.elapsed());
    let mut rest = String::new();
    messages.read_to_string(&mut rest).expect("messages are text");
    (status.code(), rest)
}

#[cfg(unix)]
#[test]
fn ctrl_c_saves_the_picture() {
    let place = Place::new();
    let words = "render cornell-box --size 200x150 --spp 1000000 -t 2 --progress json -o a.png";
    let (code, rest) = interrupted(&place, words, None);
    assert_eq!(code, Some(130), "{rest}");
    assert!(rest.contains("interrupted: the picture holds what was rendered"), "{rest}");
    assert_eq!((place.image("a.png").width, place.files()), (200, vec!["a.png".to_string()]));
}

#[cfg(unix)]
#[test]
fn ctrl_c_before_anything_is_rendered_leaves_the_picture_that_is_there() {
    let place = Place::new();
    place.run("render cornell-box --size 20x15 --spp 1 -q -o a.png").done();
    // The training of guided paths takes minutes.
    let words =
        "render door-ajar --guiding --size 400x300 --spp 1000000 -t 1 --progress none -o a.png";
    let (code, rest) = interrupted(&place, words, Some(4));
    assert_eq!(code, Some(130), "{rest}");
    assert!(rest.contains("interrupted before anything was rendered"), "{rest}");
    assert_eq!((place.image("a.png").width, place.files()), (20, vec!["a.png".to_string()]));
}

/// Coincident spheres, `each` times as many with every level: a ray near them intersects them all.
#[cfg(unix)]
fn crowd(levels: usize, each: usize) -> String {
    let children = |i: usize| format!("{{\"children\": {:?}}}, ", vec![i + 1; each]);
    let nodes: String = (0..levels).map(children).collect();
    let sphere = r#"{"surfaces": [{"shape": {"shape": "sphere", "radius": 1}}]}"#;
    format!(r#"{{"format": "snell scene", "version": 1, "root": 0, "nodes": [{nodes}{sphere}]}}"#)
}

#[cfg(unix)]
#[test]
fn rays_that_would_take_hours_are_refused_before_the_first() {
    let place = Place::new();
    place.write("a.snell", crowd(9, 10));
    let run = place.run("render a.snell --size 16x12 --spp 1 -o a.png");
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(run.err.contains("a.snell: instances overlap so much"), "{}", run.err);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_render_whose_rays_take_long() {
    let place = Place::new();
    place.write("a.snell", crowd(5, 13));
    for integrator in ["path", "whitted"] {
        let start = Instant::now();
        let words = format!(
            "render a.snell --size 400x300 --spp 64 -i {integrator} -t 2 --progress none -o a.png"
        );
        let (code, rest) = interrupted(&place, &words, Some(5));
        assert_eq!(code, Some(130), "{rest}");
        assert!(start.elapsed() < Duration::from_secs(15), "{:?}", start.elapsed());
    }
}
