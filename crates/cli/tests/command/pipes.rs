//! Named pipes and devices in place of files are refused with a message, and never block a command;
//! piped standard input is read as a scene.

use super::support::{BALL, Place};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A folder with a pipe of each name. They have no writer, so opening one would block forever.
fn with_pipes(names: &[&str]) -> Place {
    let place = Place::new();
    for name in names {
        assert!(
            Command::new("mkfifo")
                .arg(place.path(name))
                .status()
                .expect("it is part of Unix")
                .success()
        );
    }
    place
}

/// The exit code and all output of a command, which must end by itself.
#[track_caller]
fn ends(place: &Place, words: &str) -> (i32, String) {
    let mut child = place.command(words).spawn().expect("the command exists");
    let start = Instant::now();
    while child.try_wait().expect("it is ours").is_none() {
        if start.elapsed() > Duration::from_secs(60) {
            _ = child.kill();
            panic!("{words}: hangs");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().expect("it is ours");
    (
        output.status.code().expect("it ended by itself"),
        String::from_utf8_lossy(&[output.stderr, output.stdout].concat()).into_owned(),
    )
}

#[test]
fn a_pipe_or_a_device_that_is_named_as_a_scene_is_refused() {
    let place = with_pipes(&["a.obj", "a.usda"]);
    let commands = ["render", "info", "doctor", "explain --pixel 0,0", "convert"];
    for (i, command) in commands.into_iter().enumerate() {
        for name in ["a.obj", "a.usda", "/dev/zero"] {
            let more = if command == "convert" { format!("out{i}.ply") } else { String::new() };
            let (code, said) = ends(&place, &format!("{command} {name} {more}"));
            let what = if name == "/dev/zero" { "device" } else { "pipe" };
            let expected = format!("{name}: this is a {what}, not a file; ");
            assert!(code != 0 && said.contains(&expected), "{command} {name}: {code}: {said}");
        }
    }
}

#[test]
fn pipes_in_place_of_the_files_that_a_scene_or_an_option_names_are_refused() {
    let place = with_pipes(&["lib.mtl", "tex.png", "inc.scn", "sky.hdr", "paint.spd", "b.bin"]);
    place.write("lib.obj", "mtllib lib.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    place.write("good.mtl", "newmtl a\nmap_Kd tex.png\n");
    place.write("tex.obj", "mtllib good.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    place.write("ball.ply", BALL);
    place.write(
        "b.gltf",
        "{\"asset\": {\"version\": \"2.0\"}, \"buffers\": [{\"uri\": \"b.bin\", \
        \"byteLength\": 36}], \
        \"bufferViews\": [{\"buffer\": 0, \"byteLength\": 36}], \"accessors\": [{\"bufferView\": \
        0, \"componentType\": 5126, \
        \"count\": 3, \"type\": \"VEC3\", \"min\": [0, 0, 0], \"max\": [1, 1, 0]}], \"meshes\": \
        [{\"primitives\": \
        [{\"attributes\": {\"POSITION\": 0}}]}], \"nodes\": [{\"mesh\": 0}], \"scenes\": \
        [{\"nodes\": [0]}]}",
    );
    for words in [
        "info lib.obj",
        "info tex.obj",
        "info b.gltf",
        "render ball.ply --size 8x8 --environment sky.hdr -o o.png",
        "render ball.ply --size 8x8 -D material.0.reflectance.spectrum=paint.spd -o o.png",
        "compare tex.png tex.png",
    ] {
        let (_, said) = ends(&place, words);
        assert!(said.contains("this is a pipe, not a file"), "{words}: {said}");
    }
}

#[test]
fn a_pipe_of_the_shell_is_read_as_a_scene() {
    let place = Place::new();
    place.write("ball.ply", BALL);
    let scene = std::fs::read(place.path("ball.ply")).expect("it was written");
    let mut command = place.command("info /dev/stdin");
    let run = place.finish(command.stdin(Stdio::piped()), &scene).done();
    assert!(run.text().contains("triangle"), "{}", run.text());
}
