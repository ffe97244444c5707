//! `snell view`: access control, and what the viewer does when memory or file descriptors are
//! scarce.

use crate::support::Place;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A viewer that runs until this value is dropped.
struct Viewer {
    child: Child,
    /// Address of the viewer: `127.0.0.1:PORT`.
    host: String,
    token: String,
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Viewer {
    /// Waits for the address that a command prints.
    fn of(mut command: Command) -> Self {
        let mut child =
            command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("it starts");
        let mut url = String::new();
        let out = child.stdout.take().expect("it has one");
        BufReader::new(out).read_line(&mut url).expect("it prints an address");
        let mut steps = url.trim().trim_end_matches('/').split('/').skip(2).map(String::from);
        let (host, token) = (steps.next().unwrap_or_default(), steps.next().unwrap_or_default());
        Self { child, host, token }
    }

    fn connect(&self) -> std::io::Result<TcpStream> {
        let stream = TcpStream::connect(&self.host)?;
        stream.set_read_timeout(Some(Duration::from_secs(30))).map(|()| stream)
    }

    /// The complete response to a request.
    fn ask(&self, method: &str, rest: &str, body: &str) -> String {
        let (host, token, length) = (&self.host, &self.token, body.len());
        let mut stream = self.connect().expect("it listens");
        let head = format!(
            "{method} /{token}/{rest} HTTP/1.1\r\nHost: {host}\r\nConnection: \
                close\r\nContent-Length: {length}\r\n\r\n"
        );
        stream.write_all((head + body).as_bytes()).expect("it reads");
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }
}

fn view(place: &Place, words: &str) -> Command {
    place.command(&format!("view --no-open --threads 1 {words}"))
}

#[test]
fn a_dropped_file_names_no_other_file() {
    let place = Place::new();
    place.write("secret.mtl", "newmtl secret\nKd 1 0 0\n");
    let viewer = Viewer::of(view(&place, "cornell-box -- --size 16x12 --spp 1"));
    let named = place.path("secret.mtl");
    let names =
        [named.display().to_string(), "/etc/passwd".into(), "../../../../etc/passwd".into()];
    for name in names {
        let answer = viewer.ask(
            "POST",
            "open?name=a.obj",
            &format!("mtllib {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        );
        assert!(
            answer.starts_with("HTTP/1.1 422")
                && answer.contains("drop it together with the files"),
            "{answer}"
        );
    }
    // The name in an address is not taken for an option either.
    let answer = viewer.ask("POST", "open?name=--environment=/etc/passwd", "");
    assert!(answer.starts_with("HTTP/1.1 422") && answer.contains("format"), "{answer}");
}

#[test]
fn the_token_may_come_from_the_environment() {
    let place = Place::new();
    let mut command = view(&place, "cornell-box -- --size 16x12 --spp 1");
    command.env("SNELL_VIEW_TOKEN", "fromTheEnvironment1");
    let viewer = Viewer::of(command);
    assert_eq!(viewer.token, "fromTheEnvironment1");
    assert!(viewer.ask("GET", "", "").starts_with("HTTP/1.1 200"));
    let mut command = view(&place, "cornell-box");
    let run = command.env("SNELL_VIEW_TOKEN", "short").output().expect("it runs");
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(
        run.status.code() == Some(2) && said.contains("SNELL_VIEW_TOKEN: a token has 16 to 64"),
        "{said}"
    );
}

/// A page that watches until the picture at rest has this many samples; returns the samples of the
/// first picture at rest.
fn watched(viewer: &Viewer, samples: u32) -> u32 {
    let url = format!("ws://{}/{}/ws", viewer.host, viewer.token);
    let stream = viewer.connect().expect("it listens");
    let (mut page, _) = tungstenite::client(url, stream).expect("it is a page");
    let mut first = None;
    loop {
        let tungstenite::Message::Binary(bytes) = page.read().expect("it sends") else { continue };
        // A part of a picture: its number, the place of the part, and the size of the whole. The
        // first part has the header of the picture.
        let word = |i: usize| u32::from_le_bytes(bytes[4 * i..][..4].try_into().expect("four"));
        let acknowledged = format!("{{\"type\":\"ack\",\"frame\":{}}}", word(0));
        page.send(tungstenite::Message::text(acknowledged)).expect("it listens");
        if word(1) == 0 && word(3) == 1 {
            first.get_or_insert(word(9));
            if word(9) >= samples {
                return first.unwrap_or_default();
            }
        }
    }
}

#[cfg(unix)]
#[test]
fn a_view_that_was_closed_goes_on_where_it_was_and_may_be_finished_without_it() {
    let place = Place::new();
    place.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let ended = |mut viewer: Viewer| {
        use nix::sys::signal::{Signal, kill};
        let id = nix::unistd::Pid::from_raw(viewer.child.id() as i32);
        kill(id, Signal::SIGTERM).expect("it runs");
        viewer.child.wait().expect("it was started");
    };
    let settings = "--size 32x24 --spp 160 -i path --max-depth 4";
    let words = format!("a.obj --checkpoint a.snellr -- {settings}");
    let viewer = Viewer::of(view(&place, &words));
    assert!(watched(&viewer, 40) < 40);
    ended(viewer);
    let run = place.run("info a.snellr --json").done();
    let kept: serde_json::Value = serde_json::from_str(run.text()).expect("it is JSON");
    assert!(kept["samples_of_each_pixel"].as_u64() >= Some(40), "{kept}");
    // The second view has what the first one had, whatever is given after --.
    let viewer = Viewer::of(view(&place, "a.obj --checkpoint a.snellr -- --seed 9"));
    assert!(watched(&viewer, 48) >= 40);
    ended(viewer);
    let render = format!("render a.obj {settings} -q");
    place.run(&format!("{render} --checkpoint a.snellr --resume -o a.exr")).done();
    place.run(&format!("{render} -o whole.exr")).done();
    let [a, whole] = ["a.exr", "whole.exr"].map(|name| place.layers(name));
    assert_eq!(a.layers, whole.layers);
    let run = place.run("view cornell-box --no-open --checkpoint a.snellr");
    assert_eq!(run.code, 2, "{}", run.err);
    assert!(run.err.contains("this is a picture of a.obj; name that scene"), "{}", run.err);
    place.write("b.snellr", "a text of something else");
    let run = place.run("view a.obj --no-open --checkpoint b.snellr");
    assert_eq!(run.code, 1, "{}", run.err);
    assert!(
        run.err.contains("this is not a checkpoint of Snell; name another file"),
        "{}",
        run.err
    );
}

#[test]
fn what_the_viewer_does_not_show_is_refused() {
    let place = Place::new();
    let refused = |words: &str, part: &str| {
        let run = view(&place, words).output().expect("it runs");
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(
            run.status.code().is_some_and(|c| c == 1 || c == 2) && said.contains(part),
            "{words}: {said}"
        );
    };
    refused("cornell-box -- --crop 0,0,10,10", "--crop");
    refused("cornell-box -- --size 16385x1 --spp 1", "16384");
    refused("cornell-box -- --spp 4 --fps 20", "--fps is an option of `snell view`: give it");
    refused("cornell-box -- --nonsense", "--nonsense");
}

/// The command under limits of the shell's `ulimit`, such as `-n 64`.
#[cfg(unix)]
fn limited(place: &Place, limit: &str, words: &str) -> Command {
    let mut command = Command::new("sh");
    let program = env!("CARGO_BIN_EXE_snell");
    command.args([
        "-c",
        &format!("ulimit {limit} && exec '{program}' view --no-open --threads 1 {words}"),
    ]);
    command.current_dir(place.path("."));
    command
}

#[cfg(target_os = "linux")]
#[test]
fn it_goes_on_when_descriptors_run_out() {
    let place = Place::new();
    let viewer = Viewer::of(limited(&place, "-n 48", "cornell-box -- --size 16x12 --spp 1"));
    let idle: Vec<_> = (0..200).filter_map(|_| viewer.connect().ok()).collect();
    assert!(idle.len() == 200 && viewer.ask("GET", "", "").starts_with("HTTP/1.1 200"));
}
