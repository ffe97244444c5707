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
            answer.starts_with("HTTP/1.1 422") && answer.contains("can name no others"),
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
