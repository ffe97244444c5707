//! Renders that are saved on their way and gone on with.

use super::support::{Place, Run};
use std::time::Duration;

/// A render whose every part of a second counts. The picture has layers, so that all sums are
/// saved.
const RENDER: &str = "render cornell-box --size 64x48 --spp 512 --aov depth,crypto-object -q -o";

fn hash(place: &Place, name: &str) -> Vec<u8> {
    std::fs::read(place.path(name)).expect("the picture was written")
}

/// Kills the command after a time, as a power cut would end it. Returns true if it was running.
#[cfg(unix)]
fn killed(place: &Place, words: &str, time: Duration) -> bool {
    let mut child = place.command(words).spawn().expect("the command exists");
    std::thread::sleep(time);
    let is_running = child.try_wait().expect("the command was started").is_none();
    // If it has just ended, nothing is left to be killed.
    let _ = child.kill();
    child.wait().expect("the command was started");
    is_running
}

#[cfg(unix)]
#[test]
fn a_render_that_is_killed_again_and_again_ends_with_the_same_bits() {
    let place = Place::new();
    place.run(&format!("{RENDER} whole.exr -t 2")).done();
    let words = |threads: usize| {
        format!(
            "{RENDER} a.exr -t {threads} --checkpoint a.snellr --checkpoint-interval 0.02 --resume"
        )
    };
    let kills = (1..=12u64)
        .filter(|&n| killed(&place, &words(1 + n as usize % 2), Duration::from_millis(70 * n)))
        .count();
    assert!(kills > 2, "the render is too short to be killed");
    let last = place.run(&words(2)).done();
    assert!(!last.err.contains("no checkpoint"), "{}", last.err);
    assert!(hash(&place, "a.exr") == hash(&place, "whole.exr"), "the bits differ");
}

#[test]
fn a_checkpoint_serves_more_samples_and_refuses_another_picture() {
    let place = Place::new();
    let run = |more: &str, spp: u32, output: &str| -> Run {
        place.run(&format!(
            "render cornell-box --size 32x24 --spp {spp} {more} --checkpoint a.snellr -o {output}"
        ))
    };
    run("", 40, "a.exr").done();
    let again = run("", 64, "b.exr");
    assert_eq!(again.code, 2, "{}", again.err);
    assert!(again.err.contains("a.snellr exists; add --resume"), "{}", again.err);
    run("--resume", 64, "b.exr").done();
    place.run("render cornell-box --size 32x24 --spp 64 -q -o whole.exr").done();
    assert!(hash(&place, "b.exr") == hash(&place, "whole.exr"), "the bits differ");
    let kept = hash(&place, "a.snellr");
    for (more, what) in
        [("--resume --seed 3", "--seed"), ("--resume -D ambient=[1,1,1]", "--define")]
    {
        let other = run(more, 64, "c.exr");
        assert_eq!(other.code, 1, "{}", other.err);
        assert!(
            other.err.contains("of another picture") && other.err.contains(what),
            "{}",
            other.err
        );
    }
    assert!(hash(&place, "a.snellr") == kept && !place.path("c.exr").exists());
}

#[test]
fn a_changed_file_of_the_scene_is_named() {
    let place = Place::new();
    let scene = |more: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{more}f 1 2 3\n");
    place.write("a.obj", scene(""));
    let words = "render a.obj --size 16x12 --spp 4 --checkpoint a.snellr --resume -o a.png";
    place.run(words).done();
    place.write("a.obj", scene("# changed\n"));
    let run = place.run(words);
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(run.err.contains("the file a.obj has changed"), "{}", run.err);
}

#[test]
fn a_torn_checkpoint_gives_way_to_the_one_before_it() {
    let place = Place::new();
    let words = |spp: u32| {
        format!(
            "render cornell-box --size 32x24 --spp {spp} -t 1 --checkpoint a.snellr --resume \
                -o a.exr"
        )
    };
    place.run(&words(40)).done();
    place.run(&words(48)).done();
    place.run("render cornell-box --size 32x24 --spp 64 -q -o whole.exr").done();
    let whole = hash(&place, "a.snellr");
    for torn in [&whole[..whole.len() / 2], &[]] {
        place.write("a.snellr", torn);
        let run = place.run(&words(64)).done();
        assert!(run.err.contains("it ends early") && run.err.contains(".before"), "{}", run.err);
        assert!(hash(&place, "a.exr") == hash(&place, "whole.exr"), "the bits differ");
    }
    place.write("a.snellr", "a letter to somebody").write("a.snellr.before", "");
    let run = place.run(&words(64));
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(run.err.contains("this is not a checkpoint of Snell"), "{}", run.err);
}

#[test]
fn nothing_beside_a_checkpoint_is_lost() {
    let place = Place::new();
    place.write("w.new", "a scene of the user");
    let run = place.run("render cornell-box --size 8x6 --checkpoint w -o a.png");
    assert_eq!(run.code, 2, "{}", run.err);
    assert!(run.err.contains("w.new would be overwritten"), "{}", run.err);
    assert_eq!(hash(&place, "w.new"), b"a scene of the user");
    let words =
        |spp| format!("render cornell-box --size 8x6 --spp {spp} --checkpoint b --resume -o a.png");
    place.run(&words(32)).done();
    let run = place.run(&words(20));
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(run.err.contains("32 samples already, and --spp is 20 now"), "{}", run.err);
    let whole = hash(&place, "b");
    place.run("info b").done();
    place.write("b", &whole[..whole.len() - 9]);
    let run = place.run("info b");
    assert!(run.code == 1 && run.err.contains("it ends early"), "{}", run.err);
}

#[test]
fn checkpoints_that_make_no_sense_are_refused() {
    let place = Place::new();
    for (words, what) in [
        ("--resume", "--checkpoint FILE"),
        ("--checkpoint-interval 5s", "--checkpoint FILE"),
        ("--checkpoint c --checkpoint-interval 0s", "above 0"),
        ("--checkpoint -", "name a file"),
        ("--checkpoint a.png", "same file"),
        ("--checkpoint ./a.png", "same file"),
        ("--checkpoint s.json --stats s.json", "same file"),
    ] {
        let run = place.run(&format!("render cornell-box --size 8x6 {words} -o a.png"));
        assert_eq!(run.code, 2, "{words}: {}", run.err);
        assert!(run.err.contains(what), "{words}: {}", run.err);
    }
    let run = place.run("render cornell-box --size 8x6 --checkpoint no/a.snellr -o a.png");
    assert_eq!(run.code, 1, "{}", run.err);
}

#[cfg(unix)]
#[test]
fn frames_go_on_within_a_frame() {
    let place = Place::new();
    let words = |name: &str, more: &str| {
        format!("render spheres --turntable 3 --size 40x30 --spp 256 -t 2 -q -o {name}.png {more}")
    };
    place.run(&words("whole", "")).done();
    let kept = words("a", "--checkpoint a.snellr --checkpoint-interval 0.02 --resume");
    for n in 1..=6 {
        killed(&place, &kept, Duration::from_millis(120 * n));
    }
    place.run(&kept).done();
    for number in 0..3 {
        let [a, whole] = ["a", "whole"].map(|name| place.image(&format!("{name}.000{number}.png")));
        assert!(a == whole, "frame {number} differs");
    }
}

#[test]
fn checkpoints_are_shown_and_merged_without_the_command_that_made_them() {
    let place = Place::new();
    let words = "render cornell-box --size 40x32 --aov depth,crypto-object";
    place.run(&format!("{words} --spp 32 --checkpoint a.snellr -q -o a.exr")).done();
    place.run("info a.snellr --picture seen.exr").done();
    let [seen, whole] = ["seen.exr", "a.exr"].map(|name| place.layers(name));
    // The picture of the checkpoint has alpha.
    let colors = seen.layers[0].values.chunks(4).flat_map(|pixel| pixel[..3].to_vec());
    assert!(colors.eq(whole.layers[0].values.iter().copied()));
    place.run("merge a.snellr -q -o merged.exr").done();
    assert!(hash(&place, "merged.exr") == hash(&place, "a.exr"), "the bits differ");
    // One of both has fewer samples.
    place.run(&format!("{words} --spp 20 --checkpoint b.snellr -q -o b.exr")).done();
    place.run("merge b.snellr a.snellr -q -o both.exr").done();
    let [both, whole] = ["both.exr", "a.exr"].map(|name| place.layers(name));
    assert_eq!(both.layers, whole.layers);
    place.run(&format!("{words} --spp 32 --seed 4 --checkpoint c.snellr -q -o c.exr")).done();
    let run = place.run("merge a.snellr c.snellr -o d.exr");
    assert_eq!(run.code, 2, "{}", run.err);
    let words = "a.snellr and c.snellr are of different pictures: --seed is 0 in the first and 4";
    assert!(run.err.contains(words), "{}", run.err);
}

#[test]
fn a_torn_checkpoint_is_shown_and_merged_by_the_one_before_it() {
    let place = Place::new();
    let words = "render cornell-box --size 40x32 --checkpoint a.snellr --resume -q -o a.exr";
    place.run(&format!("{words} --spp 20")).done();
    place.run(&format!("{words} --spp 32")).done();
    let whole = hash(&place, "a.snellr");
    place.run("merge a.snellr.before -q -o before.exr").done();
    for torn in [&whole[..whole.len() - 7], &[]] {
        place.write("a.snellr", torn);
        for command in ["info a.snellr", "merge a.snellr -o merged.exr"] {
            let run = place.run(command).done();
            assert!(run.err.contains("continuing with a.snellr.before"), "{}", run.err);
        }
        assert!(hash(&place, "merged.exr") == hash(&place, "before.exr"));
    }
    // Trying again never helps where neither is whole.
    for content in [&b""[..], b"no checkpoint", &whole[..50]] {
        place.write("b.snellr", content);
        let run = place.run("merge b.snellr -o c.exr");
        assert_eq!(run.code, 2, "{}", run.err);
        let run = place.run("info b.snellr");
        assert!(run.code == 1 && run.err.contains("b.snellr: this "), "{}", run.err);
    }
}

#[test]
fn an_animation_does_not_replace_the_checkpoint_of_another_picture() {
    let place = Place::new();
    let scene = "render spheres --size 16x12";
    let still = |seed: u32, name: &str| {
        place.run(&format!("{scene} --spp 8 --seed {seed} --checkpoint {name} -q -o a.png")).done();
        hash(&place, name)
    };
    let kept = still(1, "a.snellr");
    let turn = |more: &str| {
        place.run(&format!(
            "{scene} --turntable 2 --checkpoint a.snellr --resume -q -o t.png {more}"
        ))
    };
    for (more, what) in [
        ("--spp 8 --seed 1", "--turntable was not given and is 2 now"),
        ("--spp 8 --seed 2", "of another picture"),
        ("--spp 64 --seed 1", "of another picture"),
    ] {
        let run = turn(more);
        assert_eq!(run.code, 1, "{}", run.err);
        assert!(run.err.contains(what), "{}", run.err);
    }
    assert!(hash(&place, "a.snellr") == kept && !place.path("t.0000.png").exists());
    // Nor that of another animation.
    std::fs::remove_file(place.path("a.snellr")).expect("it is there");
    turn("--spp 8 --seed 1").done();
    let kept = hash(&place, "a.snellr");
    let run = turn("--spp 8 --seed 2");
    assert!(run.code == 1 && run.err.contains("--seed was 1 and is 2 now"), "{}", run.err);
    let run = turn("--spp 7 --seed 1 --sampler zsobol");
    assert!(run.code == 1 && run.err.contains("8 samples already"), "{}", run.err);
    assert!(hash(&place, "a.snellr") == kept);
    turn("--spp 8 --seed 1").done();
}

#[cfg(unix)]
#[test]
fn one_render_saves_to_a_checkpoint_at_a_time() {
    let place = Place::new();
    let words = |spp: u32| {
        format!("render cornell-box --size 16x12 --spp {spp} --checkpoint a.snellr -q -o a.png")
    };
    let mut first = place.command(&words(1 << 20)).spawn().expect("the command exists");
    let start = std::time::Instant::now();
    while !place.path("a.snellr.lock").exists() && start.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let second = place.run(&words(1));
    assert_eq!(second.code, 2, "{}", second.err);
    assert!(second.err.contains("a.snellr: another render saves to this file"), "{}", second.err);
    // The system unlocks what a killed program leaves.
    first.kill().expect("it runs");
    first.wait().expect("it was started");
    assert!(place.path("a.snellr.lock").exists() && !place.path("a.snellr").exists());
    place.run(&words(1)).done();
    assert_eq!(place.files(), ["a.png", "a.snellr"]);
    place.write("b.lock", "of somebody else");
    let run = place.run("render cornell-box --size 16x12 --spp 1 --checkpoint b -q -o a.png");
    assert!(run.code == 2 && run.err.contains("b.lock is not a lock of Snell"), "{}", run.err);
    std::os::unix::fs::symlink("a.snellr", place.path("link")).expect("it is writable");
    let run = place.run("render cornell-box --checkpoint link --resume -o a.png");
    assert!(run.code == 2 && run.err.contains("link is a symbolic link"), "{}", run.err);
}

#[test]
fn a_preview_is_there_and_its_failure_ends_nothing() {
    let place = Place::new();
    place.run("render cornell-box --size 32x24 --spp 8 --preview p.png -q -o a.png").done();
    let [preview, picture] = ["p.png", "a.png"].map(|name| place.layers(name));
    assert_eq!(preview.layers, picture.layers);
    let run = place.run("render cornell-box --size 32x24 --spp 8 --preview b.png -o b.png");
    assert_eq!(run.code, 2, "{}", run.err);
    assert!(run.err.contains("the picture would be written there too"), "{}", run.err);
}
