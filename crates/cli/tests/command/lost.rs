//! Rendered results are not lost when signals arrive, places are unwritable, or the user's files
//! lie where the program would write its own.
#![cfg(unix)]

use super::support::{BALL, Place, Run};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::{Duration, Instant};

const SMALL: &str = "--size 32x24 --spp 1 -t 1";
/// A render of hours, whose first pass takes only moments.
const LONG: &str = "--size 64x48 --spp 1000000 -t 1 --progress json";
/// A render of a single pass that takes some seconds.
const ONE_PASS: &str = "--size 1200x900 --spp 16 -t 1 --progress json";

/// A command at work.
struct Running {
    child: Child,
    messages: BufReader<ChildStderr>,
}

impl Running {
    fn new(mut command: Command) -> Self {
        let mut child = command.spawn().expect("the command exists");
        let messages = BufReader::new(child.stderr.take().expect("it is piped"));
        Self { child, messages }
    }

    /// Waits until this many samples are taken.
    fn until(mut self, samples: u64) -> Self {
        loop {
            let mut line = String::new();
            self.messages.read_line(&mut line).expect("the command writes lines");
            assert!(!line.is_empty(), "it ended before it was interrupted");
            let Ok(progress) = serde_json::from_str::<serde_json::Value>(&line) else { continue };
            if progress["samples"].as_u64().is_some_and(|n| n >= samples) {
                return self;
            }
        }
    }

    fn send(&self, signal: Signal) {
        kill(Pid::from_raw(self.child.id() as i32), signal).expect("the command is running");
    }

    /// Sends a signal and waits for the end.
    #[track_caller]
    fn ended_by(self, signal: Signal) -> Run {
        self.send(signal);
        self.end()
    }

    /// Waits for the end, which comes at once except on a busy machine.
    #[track_caller]
    fn end(mut self) -> Run {
        let start = Instant::now();
        let mut err = String::new();
        self.messages.read_to_string(&mut err).expect("messages are text");
        let mut out = Vec::new();
        self.child
            .stdout
            .take()
            .expect("it is piped")
            .read_to_end(&mut out)
            .expect("it can be read");
        let status = self.child.wait().expect("the command was started");
        assert!(start.elapsed() < Duration::from_secs(30), "{:?}", start.elapsed());
        Run { code: status.code().unwrap_or_else(|| panic!("{status}: {err}")), out, err }
    }
}

/// A shell command that ends with `exec snell` and these words.
fn shell(place: &Place, before: &str, words: &str) -> Command {
    let mut command = Command::new("sh");
    command.arg("-c").arg(format!("{before} exec \"$0\" {words}")).arg(env!("CARGO_BIN_EXE_snell"));
    command
        .current_dir(place.path(""))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

fn read(place: &Place, name: &str) -> Vec<u8> {
    std::fs::read(place.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn signals_of_schedulers_and_closed_terminals_save_the_picture() {
    for signal in [Signal::SIGTERM, Signal::SIGHUP, Signal::SIGXCPU] {
        let place = Place::new();
        let running = Running::new(place.command(&format!("render cornell-box {LONG} -o a.png")))
            .until(64 * 48);
        // Terminals and `timeout` send signals twice.
        running.send(signal);
        running.send(signal);
        let run = running.end();
        assert_eq!(run.code, 130, "{signal}: {}", run.err);
        assert!(
            run.err.contains("interrupted: the picture holds what was rendered"),
            "{signal}: {}",
            run.err
        );
        assert_eq!((place.image("a.png").width, place.files()), (64, vec!["a.png".to_string()]));
    }
}

#[test]
fn a_render_under_nohup_goes_on_when_the_terminal_closes() {
    let place = Place::new();
    let words = format!("render cornell-box {LONG} -o a.png");
    let mut running = Running::new(shell(&place, "trap '' HUP;", &words)).until(64 * 48);
    running.send(Signal::SIGHUP);
    std::thread::sleep(Duration::from_millis(500));
    assert!(running.child.try_wait().expect("it was started").is_none(), "it goes on");
    running.send(Signal::SIGTERM);
    assert_eq!(running.end().code, 130);
}

#[test]
fn a_signal_while_the_scene_is_read_ends_the_command_at_once() {
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP] {
        for words in ["render - -o a.png", "info -", "convert - a.ply", "doctor -"] {
            let place = Place::new();
            let mut command = place.command(words);
            // The command waits for a scene that never comes.
            command.stdin(Stdio::piped());
            let mut running = Running::new(command);
            let input = running.child.stdin.take();
            std::thread::sleep(Duration::from_millis(300));
            let run = running.ended_by(signal);
            drop(input);
            assert_eq!(run.code, 130, "{words}: {}", run.err);
            assert!(run.err.starts_with("interrupted"), "{words}: {}", run.err);
            assert!(place.files().is_empty(), "{words}: {:?}", place.files());
        }
    }
}

#[test]
fn the_viewer_ends_when_it_is_asked_to() {
    for signal in [Signal::SIGTERM, Signal::SIGHUP] {
        let mut child = Place::new()
            .command("view cornell-box --no-open -t 1")
            .spawn()
            .expect("the command exists");
        let mut line = String::new();
        let mut out = BufReader::new(child.stdout.take().expect("it is piped"));
        out.read_line(&mut line).expect("it says its address");
        kill(Pid::from_raw(child.id() as i32), signal).expect("it is running");
        assert!(child.wait().expect("it was started").success(), "{signal}");
    }
}

#[test]
fn a_picture_with_holes_does_not_replace_a_whole_one() {
    let place = Place::new();
    place.run(&format!("render cornell-box {SMALL} -q -o a.png")).done();
    let whole = read(&place, "a.png");
    let running =
        Running::new(place.command(&format!("render cornell-box {ONE_PASS} -o a.png"))).until(1);
    let run = running.ended_by(Signal::SIGINT);
    assert_eq!(run.code, 130, "{}", run.err);
    let message = "interrupted in the first pass: a.partial.png holds what was rendered, with \
        holes; a.png is as it was";
    assert!(run.err.contains(message), "{}", run.err);
    assert!(read(&place, "a.png") == whole, "it is as it was");
    assert_eq!(
        (place.image("a.partial.png").width, place.files()),
        (1200, vec!["a.partial.png".into(), "a.png".into()])
    );
}

#[test]
fn a_picture_with_holes_does_not_go_to_standard_output() {
    let place = Place::new();
    let running =
        Running::new(place.command(&format!("render cornell-box {ONE_PASS} -o -"))).until(1);
    let run = running.ended_by(Signal::SIGINT);
    assert_eq!(
        (run.code, run.out.len(), place.files()),
        (130, 0, vec!["cornell-box.partial.png".to_string()])
    );
}

#[test]
fn a_picture_whose_folder_is_gone_is_saved_elsewhere_over_nothing() {
    let place = Place::new();
    std::fs::create_dir(place.path("gone")).expect("the folder is writable");
    place.write("a.png", "precious");
    let words = format!("render cornell-box {LONG} -o gone/a.png --stats gone/s.json");
    let running = Running::new(place.command(&words)).until(64 * 48);
    std::fs::remove_dir(place.path("gone")).expect("nothing is in it");
    let run = running.ended_by(Signal::SIGTERM);
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(
        run.err.contains("error: gone/a.png: cannot write: No such file or directory"),
        "{}",
        run.err
    );
    assert!(run.err.contains("; the picture is saved as ./a-1.png instead"), "{}", run.err);
    assert!(run.err.contains("; the JSON is saved as ./s.json instead"), "{}", run.err);
    assert_eq!((place.image("a-1.png").width, read(&place, "a.png")), (64, b"precious".to_vec()));
    assert_eq!(place.json("s.json")["complete"], false);
    assert_eq!(place.files(), ["a-1.png", "a.png", "s.json"]);
}

#[test]
fn a_frame_whose_folder_is_gone_is_saved_elsewhere() {
    let place = Place::new();
    std::fs::create_dir(place.path("gone")).expect("the folder is writable");
    let words = "render cornell-box --turntable 2 --size 64x48 --spp 4000 -t 1 --progress json -o \
        gone/a.png";
    let running = Running::new(place.command(words)).until(1);
    std::fs::remove_dir_all(place.path("gone")).expect("it is ours");
    let run = running.end();
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(run.err.contains("the picture is saved as ./a.0000.png instead"), "{}", run.err);
    assert_eq!(
        (place.image("a.0000.png").width, place.files()),
        (64, vec!["a.0000.png".to_string()])
    );
}

#[test]
fn a_limit_on_the_size_of_files_is_an_error_and_not_the_end() {
    let place = Place::new();
    place.write("a.png", "precious");
    let words = "render cornell-box --size 64x48 --spp 1 -t 1 -q -o a.png";
    let run = place.finish(&mut shell(&place, "ulimit -f 1; export TMPDIR=.;", words), b"");
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(run.err.starts_with("error: a.png: cannot write: File too large"), "{}", run.err);
    assert_eq!(
        (place.files(), read(&place, "a.png")),
        (vec!["a.png".to_string()], b"precious".to_vec())
    );
}

#[test]
fn messages_that_nobody_can_read_are_no_fault() {
    let place = Place::new();
    for (number, redirected) in ["2>&-", "2>/dev/full", "1>&- 2>&-"].into_iter().enumerate() {
        let words =
            format!("render cornell-box {SMALL} -v --progress plain -o {number}.png {redirected}");
        assert_eq!(place.finish(&mut shell(&place, "", &words), b"").code, 0, "{redirected}");
        assert_eq!(place.image(&format!("{number}.png")).width, 32);
    }
    let run = place.finish(&mut shell(&place, "", "render nothing 2>/dev/full"), b"");
    assert_eq!(run.code, 1);
}

#[test]
fn a_picture_that_standard_output_does_not_take_is_saved_in_the_folder() {
    let place = Place::new();
    let run = place.finish(
        &mut shell(&place, "", &format!("render cornell-box {SMALL} -q -o - >/dev/full")),
        b"",
    );
    assert_eq!(run.code, 1);
    assert!(run.err.contains("the picture is saved as ./cornell-box.png instead"), "{}", run.err);
    assert_eq!(place.image("cornell-box.png").width, 32);
}

#[test]
fn files_have_the_mode_that_the_mask_allows_or_that_they_had() {
    let place = Place::new();
    place.write("old.png", "old");
    std::fs::set_permissions(place.path("old.png"), PermissionsExt::from_mode(0o660))
        .expect("it is ours");
    let mode = |name: &str| {
        std::fs::metadata(place.path(name)).expect("it is there").permissions().mode() & 0o777
    };
    for (mask, name, expected) in
        [("077", "a.png", 0o600), ("000", "b.png", 0o666), ("027", "old.png", 0o660)]
    {
        let words = format!("render cornell-box {SMALL} -q -o {name} --stats {name}.json");
        let run = place.finish(&mut shell(&place, &format!("umask {mask};"), &words), b"");
        assert_eq!((run.code, mode(name)), (0, expected), "{name}: {}", run.err);
    }
    assert_eq!(mode("a.png.json"), 0o600);
}

#[test]
fn a_link_as_output_is_followed() {
    let place = Place::new();
    std::fs::create_dir(place.path("store")).expect("the folder is writable");
    symlink("store/a.png", place.path("a.png")).expect("the folder is writable");
    symlink("/dev/null", place.path("null.png")).expect("the folder is writable");
    for name in ["a.png", "a.png", "null.png"] {
        place.run(&format!("render cornell-box {SMALL} -q -o {name}")).done();
        assert!(place.path(name).symlink_metadata().is_ok_and(|m| m.is_symlink()), "{name}");
    }
    assert_eq!(place.image("store/a.png").width, 32);
    assert_eq!(std::fs::read_dir(place.path("store")).expect("it is there").count(), 1);
}

#[test]
fn what_is_no_name_of_a_file_is_known_before_the_render() {
    let place = Place::new();
    let longest = format!("{}.png", "n".repeat(251));
    place.run(&format!("render cornell-box {SMALL} -q -o {longest}")).done();
    assert_eq!(place.files(), [longest.as_str()]);
    // Renders of this size would take hours.
    for name in [format!("n{longest}"), "a.png/".into(), "a.png/.".into()] {
        let run =
            place.run(&format!("render cornell-box --size 4000x4000 --spp 100000 -q -o {name}"));
        assert!(run.code == 1 && run.err.starts_with(&format!("error: {name}: ")), "{}", run.err);
    }
}

#[test]
fn names_need_not_be_text() {
    let place = Place::new();
    let name = |bytes: &'static [u8]| OsStr::from_bytes(bytes);
    place.write("a.ply", BALL);
    std::fs::rename(place.path("a.ply"), place.path("").join(name(b"\xff.ply")))
        .expect("the folder is writable");
    let run = |words: &str, names: &[&OsStr]| {
        let mut command = place.command(words);
        place.finish(command.args(names), b"").done()
    };
    let small = format!("render {SMALL} -q");
    run(
        &small,
        &[
            name(b"\xff.ply"),
            name(b"-o\xfe.png"),
            name(b"--stats=\xfd.json"),
            name(b"--bvh-cache=\xfc"),
        ],
    );
    run(&small, &[name(b"\xff.ply")]);
    run(&small, &[name(b"\xff.ply"), name(b"--environment=\xfe.png"), name(b"-o\xfb.png")]);
    run(&small, &[name(b"cornell-box"), name(b"--turntable=2"), name(b"-o\xfa_##.png")]);
    run("compare", &[name(b"\xfe.png"), name(b"\xff.png")]);
    run("convert", &[name(b"\xff.ply"), name(b"\xf9.obj")]);
    for command in ["info", "doctor"] {
        let mut command = place.command(command);
        assert!(place.finish(command.arg(name(b"\xff.ply")), b"").err.is_empty());
    }
    for file in [
        &b"\xfe.png"[..],
        b"\xff.png",
        b"\xfb.png",
        b"\xfd.json",
        b"\xfa_00.png",
        b"\xfa_01.png",
        b"\xf9.obj",
    ] {
        assert!(
            place.path("").join(OsStr::from_bytes(file)).is_file(),
            "{}",
            String::from_utf8_lossy(file)
        );
    }
}

#[test]
fn what_is_in_the_folder_of_waiting_frames_and_not_ours_stays() {
    let place = Place::new();
    let words = format!("render cornell-box --turntable 2 {SMALL} -o a.gif");
    std::fs::create_dir(place.path("a.gif.frames")).expect("the folder is writable");
    place.write("a.gif.frames/notes.txt", "mine").write("a.gif.frames/0007.png", "mine too");
    place.run(&words).done();
    assert!(read(&place, "a.gif").starts_with(b"GIF89a"));
    let left: Vec<_> =
        std::fs::read_dir(place.path("a.gif.frames")).expect("it is there").flatten().collect();
    assert_eq!((left.len(), read(&place, "a.gif.frames/0007.png")), (2, b"mine too".to_vec()));
    // A user's file in the place of a frame is neither replaced nor removed.
    place.write("a.gif.frames/0001.png", "mine");
    let run = place.run(&words);
    assert!(
        run.code == 1 && run.err.contains("a.gif.frames/0001.png: this file is not Snell's"),
        "{}",
        run.err
    );
    assert_eq!(read(&place, "a.gif.frames/0001.png"), b"mine");
    // Nor is one with the name of the record.
    place.write("b.resume", "my diary");
    let run = place.run(&format!("render cornell-box --turntable 2 {SMALL} -o b.png"));
    assert!(run.code == 1 && run.err.contains("b.resume: this file is not Snell's"), "{}", run.err);
    assert_eq!(read(&place, "b.resume"), b"my diary");
}

#[test]
fn frames_of_what_has_changed_since_are_rendered_again() {
    let place = Place::new();
    place.write(
        "a.obj",
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n",
    );
    place.write("a.mtl", "newmtl m\nmap_Kd a.ppm\n").write("a.ppm", "P3 1 1 255 9 9 9\n");
    place.write("sky.ppm", "P3 1 1 255 90 90 90\n");
    let words = format!("render a.obj --turntable 3 {SMALL} --environment sky.ppm -o a.png");
    // The state after an interruption: the last frame could not be written, and the first two
    // exist.
    let interrupted = || {
        let _ = std::fs::remove_file(place.path("a.0002.png"));
        std::fs::create_dir(place.path("a.0002.png")).expect("the folder is writable");
        assert_eq!(place.run(&words).code, 1);
        std::fs::remove_dir(place.path("a.0002.png")).expect("it is empty");
    };
    let again = || place.run(&format!("{words} --resume")).done().err;
    interrupted();
    let err = again();
    assert!(
        err.contains("frame 3 of 3") && !err.contains("frame 1 of 3") && !err.contains("warning"),
        "{err}"
    );
    for (name, text) in [
        ("a.ppm", "P3 1 1 255 9 9 8\n"),
        ("a.mtl", "newmtl m\nKd 1 0 0\nmap_Kd a.ppm\n"),
        ("sky.ppm", "P3 1 1 255 9 9 9\n"),
    ] {
        interrupted();
        let before =
            std::fs::metadata(place.path(name)).and_then(|m| m.modified()).expect("it is there");
        place.write(name, text);
        // The size and the modification time of the file do not change with its content.
        let file = std::fs::File::options().write(true).open(place.path(name)).expect("it is ours");
        file.set_modified(before).expect("it is ours");
        let err = again();
        assert!(
            err.contains("other files or options") && err.contains("frame 1 of 3"),
            "{name}: {err}"
        );
    }
    interrupted();
    place.write("a.0001.png", "damaged");
    let err = again();
    assert!(err.contains("a.0001.png: the file has changed since it was written"), "{err}");
    assert!(err.contains("frame 2 of 3") && !err.contains("frame 1 of 3"), "{err}");
    assert_eq!(place.image("a.0001.png").width, 32);
}

#[test]
fn a_memory_of_frames_without_hashes_counts_as_made_in_another_way() {
    let place = Place::new();
    place.write("a.resume", format!("{}\n0\n1\n", "0123456789abcdef".repeat(4)));
    let run =
        place.run(&format!("render cornell-box --turntable 2 {SMALL} --resume -o a.png")).done();
    assert!(
        run.err.contains("other files or options") && run.err.contains("frame 1 of 2"),
        "{}",
        run.err
    );
    assert_eq!(place.files(), ["a.0000.png", "a.0001.png"]);
}

#[test]
fn a_signal_ends_the_wait_for_a_reader_of_a_pipe_and_the_picture_is_kept() {
    let place = Place::new();
    assert!(
        Command::new("mkfifo")
            .arg(place.path("a.png"))
            .status()
            .expect("it is part of Unix")
            .success()
    );
    let running =
        Running::new(place.command(&format!("render cornell-box -i flat {SMALL} -o a.png")));
    // The command shows no sign that it waits; a render that had not begun would end with 130.
    std::thread::sleep(Duration::from_secs(3));
    let run = running.ended_by(Signal::SIGTERM);
    assert!(
        run.code == 1 && run.err.contains("nothing reads this pipe"),
        "{} {}",
        run.code,
        run.err
    );
    assert!(place.path("a-1.png").is_file() && run.err.contains("a-1.png"), "{}", run.err);
}
