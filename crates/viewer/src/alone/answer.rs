//! Requests of a page without a server: those of the routes of `snell view`.

use crate::compare::{self, Against};
use crate::dropped::files;
use crate::session::Session;
use crate::{Dropped, Which, edges};
use std::collections::HashMap;
use std::str::FromStr;

/// An answer to a request, with the status that the server of `snell view` gives it.
#[derive(Debug, PartialEq)]
pub struct Answer {
    /// The status of HTTP.
    pub status: u16,
    /// What was asked for, or a message for the user.
    pub bytes: Vec<u8>,
    /// What a saved scene leaves out.
    pub note: String,
}

impl Answer {
    fn of(bytes: Vec<u8>) -> Self {
        Self { status: 200, bytes, note: String::new() }
    }

    fn nothing() -> Self {
        Self { status: 204, bytes: Vec::new(), note: String::new() }
    }

    fn refusal(status: u16, message: impl Into<String>) -> Self {
        Self { status, bytes: message.into().into_bytes(), note: String::new() }
    }
}

/// The parameters of a request.
struct Query(HashMap<String, String>);

impl Query {
    fn text(&self, name: &str) -> &str {
        self.0.get(name).map_or("", String::as_str)
    }

    fn number<T: FromStr + Default>(&self, name: &str) -> T {
        self.text(name).parse().unwrap_or_default()
    }
}

/// Answers a request of a page.
pub fn answer(session: &Session, client: u32, request: &str, query: &str, body: Vec<u8>) -> Answer {
    let Ok(query) = serde_json::from_str(query).map(Query) else {
        return Answer::refusal(400, "the request was not understood");
    };
    match request {
        "open" => open(session, client, &query, body),
        "save" => match session.save(&query.text("format").to_lowercase()) {
            Some(Ok((bytes, _))) => Answer::of(bytes),
            Some(Err(message)) => Answer::refusal(400, message),
            None => Answer::refusal(
                409,
                "the picture shown is not ready to be saved; save it when the view rests",
            ),
        },
        "scene" => match session.scene_file(query.text("format")) {
            Ok((bytes, losses)) => Answer { note: losses.join("; "), ..Answer::of(bytes) },
            Err(message) => Answer::refusal(400, message),
        },
        "picture" => {
            computed(session.add_picture(query.text("name"), body).map(String::into_bytes))
        }
        "reference" => computed(compare::reference(query.text("name"), body)),
        "difference" => {
            let against = Against {
                size: [query.number("width"), query.number("height")],
                halves: body,
                exposure: query.number("exposure"),
                tonemap: query.text("tonemap").into(),
            };
            computed(compare::difference(session, &against))
        }
        "layer" => computed(compare::layer(session, query.text("name"))),
        "edges" => {
            let size = [query.number("width"), query.number("height")];
            computed(edges::edges(session, query.text("camera"), size))
        }
        "cost" => computed(session.cost(query.text("structure"), query.number("width"))),
        "texture" => computed(session.swatch(query.number("i"))),
        "sha256" => computed(session.sha256()),
        other => {
            Answer::refusal(404, format!("{other}: a page without a server has no such thing"))
        }
    }
}

/// Bytes, no content while they are still to come, or a message.
fn computed<T: Into<Option<Vec<u8>>>>(outcome: Result<T, String>) -> Answer {
    match outcome.map(T::into) {
        Ok(Some(bytes)) => Answer::of(bytes),
        Ok(None) => Answer::nothing(),
        Err(message) => Answer::refusal(422, message),
    }
}

/// Opens a built-in scene or files.
fn open(session: &Session, client: u32, query: &Query, body: Vec<u8>) -> Answer {
    if let Err(message) = session.check_steers(client) {
        return Answer::refusal(409, message);
    }
    let (builtin, name) = (query.text("builtin"), query.text("name"));
    let which = if !builtin.is_empty() {
        Ok(Which::Builtin(builtin.into()))
    } else if !name.is_empty() {
        Ok(Which::Dropped(vec![Dropped { name: name.into(), bytes: body }]))
    } else {
        files(&body).map(Which::Dropped)
    };
    match which.and_then(|which| session.open(which)) {
        Ok(()) => Answer::nothing(),
        Err(message) => Answer::refusal(422, message),
    }
}
