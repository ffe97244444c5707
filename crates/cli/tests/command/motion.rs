//! Times, frames, turntables, and resuming after an interruption.

use super::support::Place;

/// A folder with a pendulum that swings once in 2 s.
fn place() -> Place {
    let place = Place::new();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/pendulum.gltf");
    place.write("pendulum.gltf", std::fs::read(file).expect("the scene is there"));
    place
}

const SMALL: &str = "-s 24x18 --spp 2 -i direct -t 2";

fn bytes(place: &Place, name: &str) -> Vec<u8> {
    std::fs::read(place.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn a_frame_is_the_picture_of_its_moment() {
    let place = place();
    place
        .run(&format!(
            "render pendulum.gltf --frames 0.5..1.25@4 -o swing.png --stats s.json {SMALL}"
        ))
        .done();
    assert_eq!(
        place.files(),
        ["pendulum.gltf", "s.json", "swing.0002.png", "swing.0003.png", "swing.0004.png"]
    );
    place.run(&format!("render pendulum.gltf --at 0.75 -o moment.png {SMALL} -q")).done();
    assert_eq!(bytes(&place, "moment.png"), bytes(&place, "swing.0003.png"));
    assert_ne!(bytes(&place, "moment.png"), bytes(&place, "swing.0004.png"));
    let statistics = place.json("s.json");
    assert_eq!(
        (statistics["frames"][2]["frame"].as_i64(), statistics["frames"][2]["time"].as_f64()),
        (Some(4), Some(1.0))
    );
    assert!(
        statistics["build_share"].as_f64().is_some_and(|share| share > 0.0 && share < 1.0),
        "{statistics}"
    );

    let sharp = bytes(&place, "moment.png");
    place
        .run(&format!("render pendulum.gltf --at 0.75 --shutter 0..0.1 -o moment.png {SMALL} -q"))
        .done();
    assert_ne!(bytes(&place, "moment.png"), sharp);
}

#[test]
fn animated_pictures_hold_all_frames_and_leave_nothing_else() {
    let place = place();
    place.run(&format!("render pendulum.gltf --frames @4 -o swing.gif {SMALL} -q")).done();
    place.run(&format!("render pendulum.gltf --turntable 3@2 -o around.apng {SMALL} -q")).done();
    assert_eq!(place.files(), ["around.apng", "pendulum.gltf", "swing.gif"]);
    assert!(bytes(&place, "swing.gif").starts_with(b"GIF89a"));
    let chunks =
        |name: &[u8]| bytes(&place, "around.apng").windows(4).filter(|w| *w == name).count();
    assert_eq!((chunks(b"acTL"), chunks(b"fcTL")), (1, 3));
    let run = place.run(&format!("render pendulum.gltf --frames 0..0.5s@4 -o - {SMALL}")).done();
    let header = b"YUV4MPEG2 W24 H18 F4:1 Ip A1:1 C444\n";
    assert!(run.out.starts_with(header), "{}", run.err);
    assert_eq!(run.out.len(), header.len() + 2 * (6 + 3 * 24 * 18));
}

#[cfg(unix)]
#[test]
fn an_interrupted_animation_goes_on_where_it_was() {
    use nix::sys::signal::{Signal, kill};
    use nix::unistd::Pid;
    use std::io::{BufRead, BufReader, Read};

    let place = place();
    let words = "render pendulum.gltf --frames 0..1s@4 -o swing.png -s 64x48 --spp 256 -t 2 \
        --progress none";
    let mut child = place.command(words).spawn().expect("the command exists");
    let mut messages = BufReader::new(child.stderr.take().expect("it is piped"));
    let mut line = String::new();
    while !line.contains("frame 1 of 4") {
        line.clear();
        assert!(
            messages.read_line(&mut line).expect("the command writes lines") > 0,
            "it ends too early"
        );
    }
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).expect("the command is running");
    let status = child.wait().expect("the command was started");
    let mut rest = String::new();
    messages.read_to_string(&mut rest).expect("messages are text");
    assert_eq!(status.code(), Some(130), "{rest}");
    assert!(rest.contains("--resume"), "{rest}");
    let done = place.files().len() - 2;
    assert!(
        (1..4).contains(&done) && place.files().contains(&"swing.resume".to_string()),
        "{:?}",
        place.files()
    );
    // With other settings no previous frame is reused.
    let other = place.run(&format!("{words} --resume --seed 1 --time 0.01s"));
    assert!(
        other.err.contains("other files or options") && other.err.contains("frame 4 of 4"),
        "{}",
        other.err
    );
    let first = bytes(&place, "swing.0000.png");
    let again = place.run(&format!("{words} --resume")).done();
    assert!(again.err.contains("nothing was interrupted"), "{}", again.err);
    assert_ne!(bytes(&place, "swing.0000.png"), first);
    assert!(!place.files().contains(&"swing.resume".to_string()));
}

#[test]
fn only_frames_that_are_missing_are_rendered() {
    let place = place();
    let words = format!("render pendulum.gltf --frames 0..1s@4 -o swing.png {SMALL}");
    // The state after an interruption: the last frame could not be written.
    std::fs::create_dir(place.path("swing.0003.png")).expect("the folder is writable");
    assert_eq!(place.run(&words).code, 1);
    std::fs::remove_dir(place.path("swing.0003.png")).expect("it is empty");
    let again = place.run(&format!("{words} --resume")).done();
    assert!(
        again.err.contains("frame 4 of 4") && !again.err.contains("frame 3 of 4"),
        "{}",
        again.err
    );
    assert!(place.path("swing.0003.png").is_file() && !place.path("swing.resume").exists());
}

#[test]
fn what_cannot_move_or_is_not_there_is_said() {
    let place = place();
    for (words, expected) in [
        ("render teapot --at 1", "nothing in the scene moves"),
        (
            "render pendulum.gltf --animation jump",
            "no animation \"jump\"; the scene has: 0 \"swing\"",
        ),
        ("render pendulum.gltf --frames 2..1@24", "not a range of frames"),
        ("render pendulum.gltf --frames 0..1e6@1000", "at most"),
        ("render pendulum.gltf --shutter 1", "not when a shutter"),
        ("render teapot --variant red", "no variants"),
        ("render teapot --scene red", "no scenes"),
    ] {
        let run = place.run(words);
        assert_eq!(run.code, 2, "{words}: {}", run.err);
        assert!(run.err.contains(expected), "{words}: {}", run.err);
    }
    let run = place.run("render pendulum.gltf --variant green");
    assert!(run.code == 1 && run.err.contains("choose one of brass, ruby"), "{}", run.err);
    let info = place.run("info pendulum.gltf").done();
    assert!(info.text().contains("0 \"swing\" 0.000 s to 2.000 s, 1 channels"), "{}", info.text());
}
