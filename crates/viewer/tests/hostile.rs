//! A server among hostile programs and pages. Their requests are refused, cost little, and lock out
//! no other client.

use serde_json::{Value, json};
use snell_formats::ReadOptions;
use snell_formats::image::Display;
use snell_render::{Request, Settings};
use snell_viewer::{Opened, Server, ServerOptions, Source, Which, read_dropped, serve};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

const PATIENCE: Duration = Duration::from_secs(60);

/// The scenes of the test: the Cornell box, and dropped files.
struct Small;

impl Source for Small {
    fn open(&self, which: Which) -> Result<Opened, String> {
        let scene = match which {
            Which::Dropped(files) => read_dropped(files, &ReadOptions::default())?.1,
            _ => snell_scene::builtin::builtin("cornell-box").ok_or("it is built in")?,
        };
        Ok(Opened {
            camera: scene.cameras.first().cloned().ok_or("the scene has no camera")?,
            scene,
            camera_number: 0,
            camera_for_size: None,
            is_encoding_given: false,
            writer: std::sync::Arc::new(snell_viewer::PlainWriter),
            request: Request::default(),
            settings: Settings { size: [16, 12], spp: 1, ..Settings::default() },
            display: Display::default(),
            animate: None,
            command: Vec::new(),
        })
    }
}

fn start() -> Server {
    let options = ServerOptions {
        host: [127, 0, 0, 1].into(),
        port: 0,
        frames_per_second: 30.0,
        threads: 1,
        is_gallery: false,
        may_be_framed: false,
        token: None,
    };
    serve(Box::new(Small), &options).expect("a port is free")
}

fn connect(server: &Server) -> TcpStream {
    let stream = TcpStream::connect(server.address).expect("the server listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a timeout can be set");
    stream
}

/// The response to `sent`, read until the server closes the connection.
fn exchange(server: &Server, sent: &str) -> String {
    let mut stream = connect(server);
    stream.write_all(sent.as_bytes()).expect("the server reads");
    let mut answer = Vec::new();
    // A connection that is reset has already delivered its response.
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

/// The status of a request.
fn status(server: &Server, first_line: &str, headers: &str) -> u32 {
    let host = server.address;
    let sent =
        format!("{first_line} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{headers}\r\n");
    status_of(&exchange(server, &sent))
}

fn status_of(answer: &str) -> u32 {
    answer.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0)
}

/// The path of the page, with its token.
fn path(server: &Server) -> String {
    server.url.splitn(4, '/').nth(3).map(|rest| format!("/{rest}")).expect("a path")
}

type Page = WebSocket<TcpStream>;

fn page(server: &Server) -> Result<Page, u32> {
    let url = format!("{}ws", server.url.replace("http:", "ws:"));
    match tungstenite::client(url, connect(server)) {
        Ok((page, _)) => Ok(page),
        Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
            Err(answer.status().as_u16().into())
        }
        Err(error) => panic!("{error}"),
    }
}

fn say(page: &mut Page, message: &Value) {
    page.send(Message::text(message.to_string())).expect("the server listens");
}

/// Reads on, acknowledging pictures, until a message or picture satisfies the condition; returns
/// the errors on the way.
fn until(page: &mut Page, is_it: impl Fn(&Message) -> bool) -> Vec<String> {
    let mut errors = Vec::new();
    loop {
        let message = page.read().expect("the server goes on");
        if let Message::Binary(bytes) = &message {
            let number = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes"));
            say(page, &json!({"type": "ack", "frame": number}));
        }
        if let Message::Text(text) = &message {
            let value: Value = serde_json::from_str(text).expect("JSON");
            errors.extend((value["type"] == "error").then(|| value["message"].to_string()));
        }
        if is_it(&message) {
            return errors;
        }
    }
}

/// The first part of a picture at rest of this size. The header of the picture follows the number
/// of the picture, the place of the part, and the size of the whole.
fn is_picture(message: &Message, size: [u32; 2]) -> bool {
    let Message::Binary(bytes) = message else { return false };
    let word =
        |i: usize| u32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().expect("four bytes"));
    word(1) == 0 && word(3) == 1 && [word(7), word(8)] == size
}

#[test]
fn connections_that_say_nothing_are_closed_and_keep_nobody_out() {
    let server = start();
    let start = Instant::now();
    let begun = |n: usize| {
        let mut stream = connect(&server);
        let some =
            ["", "GET / HTTP/1.1\r\n", "GET / HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\n"]
                [n % 3];
        stream.write_all(some.as_bytes()).map(|()| stream)
    };
    let idle: Vec<TcpStream> = (0..300).filter_map(|n| begun(n).ok()).collect();
    let path = path(&server);
    assert_eq!(status(&server, &format!("GET {path}"), ""), 200);
    assert!(start.elapsed() < Duration::from_secs(4), "{:?}", start.elapsed());
    for mut stream in idle {
        // The connection ends, or is reset.
        assert!(
            matches!(stream.read(&mut [0]), Ok(0) | Err(_)),
            "nothing is said to strangers who say nothing"
        );
    }
    assert!(start.elapsed() < Duration::from_secs(15), "{:?}", start.elapsed());
    assert_eq!(status(&server, &format!("GET {path}"), ""), 200);
}

#[test]
fn what_can_be_read_in_two_ways_is_a_bad_request() {
    let server = start();
    let (path, host) = (path(&server), server.address);
    let ask = |target: &str, headers: &str| {
        status_of(&exchange(
            &server,
            &format!("GET {target} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n"),
        ))
    };
    assert_eq!(ask(&path, &format!("Host: {host}\r\n")), 200);
    assert_eq!(ask(&format!("http://{host}{path}"), &format!("Host: {host}\r\n")), 200);
    let own = format!("Host: {host}\r\n");
    assert_eq!(ask(&path, &format!("{own}{own}")), 400);
    assert_eq!(ask(&path, &format!("{own}Host: evil.example\r\n")), 400);
    assert_eq!(ask(&path, ""), 400);
    assert_eq!(
        ask(&path, &format!("{own}Origin: http://{host}\r\nOrigin: http://evil.example\r\n")),
        400
    );
    assert_eq!(ask(&format!("http://evil.example{path}"), &own), 400);
    assert_eq!(ask(&path, "Host: evil.example\r\n"), 403);
    for place in
        ["/", "//", "/..", "/once/", "/once/x", &path[..path.len() - 2], &format!("/%2e{path}")]
    {
        assert_eq!(ask(place, &own), 403, "{place}");
    }
    for place in ["..%2fapp.js", "%00", "app.js%00", "..", "nothing"] {
        assert!([400, 403, 404].contains(&ask(&format!("{path}{place}"), &own)), "{place}");
    }
}

#[test]
fn files_over_the_limit_are_refused_before_they_are_sent_or_as_soon_as_they_pass_it() {
    let server = start();
    let (path, host) = (path(&server), server.address);
    let start = Instant::now();
    let said =
        status(&server, &format!("POST {path}open?name=a.obj"), "Content-Length: 300000000\r\n");
    assert_eq!(said, 413);
    assert!(start.elapsed() < Duration::from_secs(3));

    let mut stream = connect(&server);
    let head = format!(
        "POST {path}open?name=a.obj HTTP/1.1\r\nHost: {host}\r\nTransfer-Encoding: chunked\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).expect("the server reads");
    let mut piece = b"100000\r\n".to_vec();
    piece.resize(piece.len() + (1 << 20), b'#');
    piece.extend(b"\r\n");
    let sent = (0..600).take_while(|_| stream.write_all(&piece).is_ok()).count();
    assert!((256..320).contains(&sent), "{sent} MB were taken");

    // Two uploads at a time would take twice the memory.
    let head = format!(
        "POST {path}open?name=a.obj HTTP/1.1\r\nHost: {host}\r\nContent-Length: 100\r\n\r\nv"
    );
    let end = Instant::now() + PATIENCE;
    let second =
        || status(&server, &format!("POST {path}open?name=a.obj"), "Content-Length: 0\r\n");
    loop {
        // The upload is sent again until it begins before the second, which would otherwise refuse
        // it.
        let mut first = connect(&server);
        first.write_all(head.as_bytes()).expect("the server reads");
        std::thread::sleep(Duration::from_millis(50));
        if second() == 503 {
            break;
        }
        assert!(Instant::now() < end, "the first is being taken");
    }
    while second() == 503 {
        assert!(Instant::now() < end, "a file that broke off is given up");
    }
}

#[test]
fn a_code_leads_to_the_page_once_and_tells_a_second_time_nothing() {
    let server = start();
    let url = server.url_for_browser().expect("random numbers");
    let code = url.splitn(4, '/').nth(3).expect("a path");
    assert!(
        url.starts_with(&format!("http://{}/once/", server.address))
            && !url.contains(&path(&server))
    );
    let ask = || {
        let host = server.address;
        exchange(
            &server,
            &format!("GET /{code} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"),
        )
    };
    let (first, second) = (ask(), ask());
    assert!(
        status_of(&first) == 303 && first.contains(&format!("location: {}\r\n", path(&server))),
        "{first}"
    );
    assert!(status_of(&second) == 403 && !second.contains(&path(&server)), "{second}");
}

#[test]
fn pages_over_their_number_are_refused_until_one_goes() {
    let server = start();
    let mut pages: Vec<Page> = (0..32).map(|_| page(&server).expect("there is room")).collect();
    assert_eq!(page(&server).err(), Some(503));
    drop(pages.pop());
    let end = Instant::now() + PATIENCE;
    while page(&server).is_err() {
        assert!(Instant::now() < end, "there is room again");
    }
}

#[test]
fn the_renderer_lives_whatever_a_page_asks() {
    let server = start();
    let mut page = page(&server).expect("there is room");
    until(&mut page, |m| is_picture(m, [16, 12]));
    say(&mut page, &json!({"type": "render", "integrator": "path", "aov": "nope"}));
    let errors = until(&mut page, |m| m.to_text().is_ok_and(|t| t.contains("nope")));
    assert!(errors.last().is_some_and(|e| e.contains("there is no layer")), "{errors:?}");
    let large = [[0, 1], [16385, 1], [16384, 16384], [u32::MAX, u32::MAX]];
    let bad = large.map(|size| json!({"type": "size", "size": size}).to_string());
    let camera = |name: &str, value: Value| {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        let mut camera = serde_json::to_value(&scene.cameras[0]).expect("plain data");
        camera[name] = value;
        json!({"type": "camera", "seq": 1, "camera": camera}).to_string()
    };
    let cameras = [
        camera("eye", json!([1e300, 0, 0])),
        camera("eye", json!([null, 0, 0])),
        camera("towards", json!([0, 0, 0])),
        camera("up", json!([0, 0, 0])),
        camera("focus_distance", json!(0)),
        camera("aperture_radius", json!(-1)),
        camera("projection", json!({"projection": "perspective", "tan_half_fov": [null, null]})),
        camera("projection", json!({"projection": "perspective", "tan_half_fov": [0, null]})),
        camera("projection", json!({"projection": "fisheye", "max_angle": 1e9})),
    ];
    let rest = [
        r#"{"type":"render","spp":0}"#,
        r#"{"type":"render","spp":1e9999}"#,
        r#"{"type":"render","spp":4294967295}"#,
        r#"{"type":"render","max_depth":4294967295}"#,
        r#"{"type":"display","exposure":null,"tonemap":"none"}"#,
        r#"{"type":"display","exposure":1e30,"tonemap":"none"}"#,
        r#"{"type":"show","node":4294967295,"visible":false}"#,
        r#"{"type":"explain","id":1,"pixel":[4294967295,0]}"#,
        "[[[[[[[[",
        "",
    ];
    for text in bad.iter().chain(&cameras).map(String::as_str).chain(rest) {
        page.send(Message::text(text)).expect("the server listens");
        let errors =
            until(&mut page, |m| m.to_text().is_ok_and(|t| t.starts_with("{\"type\":\"error\"")));
        assert!(!errors.concat().contains("fault"), "{text}: {errors:?}");
    }
    // An up vector parallel to the view is corrected, and layers can be switched on and off.
    page.send(Message::text(camera("up", json!([0, 0, -1])))).expect("the server listens");
    for render in [
        json!({"integrator": "aov", "aov": ""}),
        json!({"aov": "depth"}),
        json!({"integrator": "ao"}),
    ] {
        let mut render = render;
        render["type"] = json!("render");
        say(&mut page, &render);
    }
    say(&mut page, &json!({"type": "size", "size": [24, 10]}));
    let errors = until(&mut page, |m| is_picture(m, [24, 10]));
    assert_eq!(errors, [""; 0]);
}

#[test]
fn messages_over_the_limit_and_floods_end_one_page_and_no_other() {
    let server = start();
    let mut good = page(&server).expect("there is room");
    // The message is sent in one frame, and in small pieces.
    let mut bad = page(&server).expect("there is room");
    let _ = bad.send(Message::text("x".repeat(2 << 20)));
    while bad.read().is_ok() {}
    let mut bad =
        page(&server).expect("there is room").get_ref().try_clone().expect("one more handle");
    let piece = |first: bool| {
        [&[u8::from(first), 0xfe, 0xff, 0xff, 0, 0, 0, 0][..], &[b'x'; 65535]].concat()
    };
    let sent = (0..2000).take_while(|n| bad.write_all(&piece(*n == 0)).is_ok()).count();
    assert!(sent < 1000, "{sent} pieces were taken");
    // This page asks and never reads.
    let mut deaf = page(&server).expect("there is room");
    deaf.get_ref()
        .set_write_timeout(Some(Duration::from_millis(200)))
        .expect("a timeout can be set");
    let flood =
        (0..20_000).take_while(|_| deaf.send(Message::Ping(vec![7; 100].into())).is_ok()).count();
    assert!(flood > 0);
    say(&mut good, &json!({"type": "steer"}));
    say(&mut good, &json!({"type": "size", "size": [20, 10]}));
    until(&mut good, |m| is_picture(m, [20, 10]));
}

#[test]
fn pictures_and_questions_that_make_no_sense_are_refused() {
    let server = start();
    let (host, path) = (server.address, path(&server));
    let ask = |line: &str, body: &str| {
        let length = body.len();
        status_of(&exchange(
            &server,
            &format!(
                "{line} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Length: \
                 {length}\r\n\r\n{body}"
            ),
        ))
    };
    for question in [
        "edges",
        "edges?camera=x&width=8&height=8",
        "edges?camera=%7B%7D&width=8&height=8",
        "edges?camera=%7B%7D&width=4294967295&height=4294967295",
        "layer?name=nope",
    ] {
        assert_eq!(ask(&format!("GET {path}{question}"), ""), 422, "{question}");
    }
    for question in [
        "reference",
        "reference?name=a.exr",
        "difference?width=4294967295&height=4294967295",
        "difference?width=1&height=1&exposure=nan",
        "difference?width=1&height=1&tonemap=nope",
    ] {
        assert_eq!(ask(&format!("POST {path}{question}"), "nonsense"), 422, "{question}");
    }
}
