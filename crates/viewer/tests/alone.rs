//! The viewer without a server, as a page without one drives it.

use snell_render::{CompiledScene, Job, Request};
use snell_scene::Camera;
use snell_viewer::{Alone, Builtins, Message};
use std::time::{Duration, Instant};

/// What a page hears until nothing is left to do.
fn heard(view: &mut Alone, texts: &mut Vec<serde_json::Value>) -> Option<Vec<u8>> {
    let (start, mut newest) = (Instant::now(), None);
    loop {
        let wait = view.step(Duration::from_millis(5));
        for message in view.take() {
            match message {
                Message::Text(text) => texts.push(serde_json::from_str(&text).expect("JSON")),
                Message::Frame(bytes) => {
                    let number = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
                    view.receive(&format!("{{\"type\":\"ack\",\"frame\":{number}}}"));
                    newest = Some(bytes);
                }
            }
        }
        match wait {
            None => return newest,
            Some(wait) => std::thread::sleep(wait),
        }
        assert!(start.elapsed() < Duration::from_secs(60), "it never rests");
    }
}

fn view() -> Alone {
    let mut view =
        Alone::new(Box::new(Builtins { first: "spheres" }), true, 30.0).expect("built in");
    view.receive(r#"{"type":"size","size":[32,20]}"#);
    view.receive(r#"{"type":"render","spp":8}"#);
    view
}

#[test]
fn a_view_without_threads_rests_at_the_picture_of_a_render() {
    let mut view = view();
    let mut texts = Vec::new();
    heard(&mut view, &mut texts).expect("a picture");
    assert_eq!(texts[0]["type"], "welcome");
    let scene = snell_scene::builtin::builtin("spheres").expect("built in");
    let shown = texts.iter().rev().find(|text| text["type"] == "view").expect("it was told");
    let camera: Camera = serde_json::from_value(shown["view"]["camera"].clone()).expect("valid");
    let request = Request { size: Some([32, 20]), spp: Some(8), ..Request::default() };
    let settings = request.resolve(&scene, &camera).expect("valid");
    let compiled = CompiledScene::new(&scene, &settings.build).expect("valid");
    let (film, _) = Job::new(&compiled, &camera, &settings).run(2, &|_| true);
    let picture = snell_render::picture(&film, &settings, &compiled);
    let answer = view.ask("sha256", "{}", Vec::new());
    assert_eq!(answer.bytes, snell_persist::image_sha256(&picture).into_bytes());
    assert_eq!(view.ask("save", r#"{"format":"png"}"#, Vec::new()).bytes[..4], *b"\x89PNG");
}

#[test]
fn files_are_opened_and_what_cannot_be_is_said() {
    let mut view = view();
    let mesh = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec();
    let answer = view.ask("open", r#"{"name":"a.obj"}"#, mesh);
    assert_eq!((answer.status, answer.bytes), (204, Vec::new()));
    let mut texts = Vec::new();
    heard(&mut view, &mut texts).expect("a picture");
    let names: Vec<_> = texts.iter().filter(|t| t["type"] == "scene").collect();
    assert!(names.iter().any(|t| t["scene"]["name"] == "a"), "{names:?}");
    let answer = view.ask("open", r#"{"name":"b.obj"}"#, b"nonsense".to_vec());
    assert_eq!(answer.status, 422);
    assert!(String::from_utf8_lossy(&answer.bytes).contains("b.obj"));
    for (request, query) in [("nothing", "{}"), ("open", "{"), ("layer", r#"{"name":"no"}"#)] {
        assert!(view.ask(request, query, Vec::new()).status >= 400, "{request}");
    }
}

#[test]
fn a_message_during_a_pass_is_heard_before_the_pass_ends() {
    let mut view = view();
    view.receive(r#"{"type":"size","size":[256,256]}"#);
    view.receive(r#"{"type":"render","spp":4096}"#);
    let start = Instant::now();
    while start.elapsed() < Duration::from_millis(600) {
        let begun = Instant::now();
        view.step(Duration::from_millis(1));
        view.take();
        assert!(begun.elapsed() < Duration::from_secs(20));
    }
    view.receive(r#"{"type":"render","spp":1}"#);
    assert!(heard(&mut view, &mut Vec::new()).is_some());
}
