//! The HTTP requests. Every path begins with the token; [`crate::security`] has the access rules.

use crate::connections::Visitor;
use crate::peer::is_same_user;
use crate::security::{Guard, ONCE};
use crate::session::{Session, lock};
use crate::socket::{MAX_PAGES, socket};
use crate::upload::receive;
use crate::{Which, page};
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Router};
use snell_formats::image::{Display, WriteOptions, encode_image_as};
use snell_scene::LayeredImage;
use std::collections::HashMap;
use std::sync::Arc;
use tokio::sync::Semaphore;

/// State shared by all requests.
#[derive(Clone)]
pub struct Shared {
    may_be_framed: bool,
    guard: Arc<Guard>,
    /// The session.
    pub session: Arc<Session>,
    /// Limits the number of pages.
    pub pages: Arc<Semaphore>,
    /// Held while a picture is encoded to a file: one at a time, to save memory.
    saving: Arc<Semaphore>,
    /// Held while a file is uploaded: one at a time, to save memory.
    receiving: Arc<Semaphore>,
}

impl Shared {
    /// Shared state for the pages of a session.
    pub fn new(session: Arc<Session>, guard: Arc<Guard>, may_be_framed: bool) -> Self {
        let one = || Arc::new(Semaphore::new(1));
        let pages = Arc::new(Semaphore::new(MAX_PAGES));
        Self { may_be_framed, guard, session, pages, saving: one(), receiving: one() }
    }
}

/// All routes.
pub fn router(shared: Shared) -> Router {
    Router::new()
        .route("/{token}/", get(serve_page))
        .route("/{token}/{file}", get(serve_page))
        .route("/{token}/ws", get(socket))
        .route("/{token}/save", get(save))
        .route("/{token}/cost", get(cost))
        .route("/{token}/thumbnail", get(thumbnail))
        .route("/{token}/open", post(open))
        .fallback(|| async { refused() })
        .layer(middleware::from_fn_with_state(shared.clone(), check))
        .with_state(shared)
}

fn refused() -> Response {
    closing(
        StatusCode::FORBIDDEN,
        "Not the address of a scene: open the one that `snell view` has printed, with all of its \
            letters.\n",
    )
}

/// A refusal that closes the connection, so that the rest of the request is not read.
fn closing(status: StatusCode, text: impl Into<String>) -> Response {
    (status, [(header::CONNECTION, "close")], text.into()).into_response()
}

/// Checks access, and sets the headers that restrict the page in the browser.
async fn check(
    State(shared): State<Shared>,
    Extension(visitor): Extension<Arc<Visitor>>,
    request: Request,
    next: Next,
) -> Response {
    let guard = &shared.guard;
    if let Err(problem) = guard.check_form(&request) {
        return closing(StatusCode::BAD_REQUEST, format!("{problem}\n"));
    }
    if !guard.is_for_us(request.headers()) || !guard.is_from_us(request.headers()) {
        return refused();
    }
    let mut steps = request.uri().path().split('/').skip(1);
    let (first, second) = (steps.next().unwrap_or(""), steps.next().unwrap_or(""));
    if first == ONCE && is_same_user(visitor.own, visitor.peer) && guard.takes_code(second) {
        let place = format!("/{}/", guard.token());
        return (
            StatusCode::SEE_OTHER,
            [(header::LOCATION, place)],
            [(header::CACHE_CONTROL, "no-store")],
        )
            .into_response();
    }
    if !guard.knows(first) {
        return refused();
    }
    if !visitor.admit() {
        return closing(
            StatusCode::SERVICE_UNAVAILABLE,
            "too many connections; close some pages\n",
        );
    }
    let mut response = next.run(request).await;
    const FRAMED: &str = "default-src 'self'; img-src 'self' blob: data:; style-src 'self' \
        'unsafe-inline'; base-uri 'none'; form-action 'none'; object-src 'none'";
    const ALONE: &str = "default-src 'self'; img-src 'self' blob: data:; style-src 'self' \
        'unsafe-inline'; frame-ancestors 'self'; base-uri 'none'; form-action 'none'; object-src \
        'none'";
    let rules = [
        (header::CONTENT_SECURITY_POLICY, if shared.may_be_framed { FRAMED } else { ALONE }),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ];
    for (name, value) in rules {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn serve_page(Path(parts): Path<HashMap<String, String>>) -> Response {
    match page::file(parts.get("file").map_or("", String::as_str)) {
        Some(file) => ([(header::CONTENT_TYPE, file.media_type)], file.bytes).into_response(),
        None => (StatusCode::NOT_FOUND, "there is no such file\n").into_response(),
    }
}

/// The picture at rest as a file: `?format=png`, `exr` or any other writable format.
async fn save(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    let format = query.get("format").cloned().unwrap_or_else(|| "png".into());
    let Some(finished) = lock(&shared.session.finished).clone() else {
        return (StatusCode::CONFLICT, "there is no picture yet; wait until the view rests\n")
            .into_response();
    };
    let display = shared.session.now().display;
    let name = finished.name.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    let Ok(_turn) = shared.saving.acquire().await else { return refused() };
    let encoded =
        tokio::task::spawn_blocking(move || encode(&finished.picture, &format, display)).await;
    match encoded {
        Ok(Ok((bytes, extension))) => {
            let place = format!("attachment; filename=\"{name}.{extension}\"");
            (
                [
                    (header::CONTENT_TYPE, "application/octet-stream".to_string()),
                    (header::CONTENT_DISPOSITION, place),
                ],
                bytes,
            )
                .into_response()
        }
        Ok(Err(message)) => (StatusCode::BAD_REQUEST, message + "\n").into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "the picture could not be written\n")
            .into_response(),
    }
}

fn encode(
    picture: &LayeredImage,
    format: &str,
    display: Display,
) -> Result<(Vec<u8>, String), String> {
    let options = WriteOptions { display, ..WriteOptions::default() };
    let bytes = encode_image_as(format, picture, &options).map_err(|e| e.to_string())?;
    // A known format is a plain word, so it is safe in the name of a file.
    Ok((bytes, format.to_lowercase()))
}

/// The cost of each pixel in a structure: `?structure=kdtree&width=320`.
async fn cost(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    let structure = query.get("structure").cloned().unwrap_or_default();
    let width = query.get("width").and_then(|w| w.parse().ok()).unwrap_or(320);
    let session = shared.session;
    let Ok(_turn) = session.examining.clone().acquire_owned().await else { return refused() };
    match tokio::task::spawn_blocking(move || session.cost(&structure, width)).await {
        Ok(Ok(bytes)) => {
            ([(header::CONTENT_TYPE, "application/octet-stream")], bytes).into_response()
        }
        Ok(Err(message)) => (StatusCode::BAD_REQUEST, message + "\n").into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "a fault; please report it\n").into_response()
        }
    }
}

/// A small picture of a built-in scene: `?scene=teapot`.
async fn thumbnail(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    let name = query.get("scene").cloned().unwrap_or_default();
    let session = shared.session;
    let Ok(_turn) = shared.saving.acquire().await else { return refused() };
    match tokio::task::spawn_blocking(move || session.thumbnail(&name)).await {
        Ok(Ok(bytes)) => ([(header::CONTENT_TYPE, "image/png")], bytes.to_vec()).into_response(),
        Ok(Err(message)) => (StatusCode::NOT_FOUND, message + "\n").into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "a fault; please report it\n").into_response()
        }
    }
}

/// A file dropped on the page, or a built-in scene by name.
async fn open(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
    request: Request,
) -> Response {
    let Ok(_turn) = shared.receiving.try_acquire() else {
        return closing(
            StatusCode::SERVICE_UNAVAILABLE,
            "another scene is being opened; try again\n",
        );
    };
    let which = match (query.get("builtin"), query.get("name")) {
        (Some(name), _) => Which::Builtin(name.clone()),
        (None, Some(name)) => {
            let (head, body) = request.into_parts();
            match receive(&head.headers, body).await {
                Ok(bytes) => Which::Dropped { name: name.clone(), bytes },
                Err((status, text)) => return closing(status, text),
            }
        }
        (None, None) => {
            return closing(StatusCode::BAD_REQUEST, "name the file: ?name=scene.glb\n");
        }
    };
    let session = shared.session.clone();
    match tokio::task::spawn_blocking(move || session.open(which)).await {
        Ok(Ok(())) => StatusCode::NO_CONTENT.into_response(),
        Ok(Err(message)) => (StatusCode::UNPROCESSABLE_ENTITY, message + "\n").into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "a fault in the reader; please report the file\n")
                .into_response()
        }
    }
}
