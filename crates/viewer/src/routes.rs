//! The HTTP requests. Every path begins with the token; [`crate::security`] has the access rules.

use crate::compare::{self, Against};
use crate::connections::Visitor;
use crate::dropped::files;
use crate::peer::is_same_user;
use crate::security::{Guard, ONCE};
use crate::session::Session;
use crate::socket::{MAX_PAGES, socket};
use crate::upload::receive;
use crate::{Dropped, Which, edges as feature_edges, gallery, page};
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{AppendHeaders, IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Router};
use std::collections::HashMap;
use std::str::FromStr;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Semaphore;

/// Time that a request to save waits for the picture at rest.
const SAVE_PATIENCE: Duration = Duration::from_secs(60);
/// Time between two looks whether the picture at rest is there.
const SAVE_POLL: Duration = Duration::from_millis(50);

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
        .route("/{token}/scene", get(save_scene))
        .route("/{token}/cost", get(cost))
        .route("/{token}/thumbnail", get(thumbnail))
        .route("/{token}/texture", get(texture))
        .route("/{token}/open", post(open))
        .route("/{token}/reference", post(reference))
        .route("/{token}/difference", post(difference))
        .route("/{token}/layer", get(layer))
        .route("/{token}/edges", get(edges))
        .route("/{token}/picture", post(add_picture))
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

/// The picture at rest as a file: `?format=png`, `exr` or any other writable format. It is the one
/// of the current state: until that rests, the answer waits.
async fn save(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    let format = query.get("format").map_or("png", String::as_str).to_lowercase();
    let Ok(_turn) = shared.saving.acquire().await else { return refused() };
    let started = Instant::now();
    let written = loop {
        let (session, format) = (shared.session.clone(), format.clone());
        match tokio::task::spawn_blocking(move || session.save(&format)).await {
            Ok(None) if started.elapsed() < SAVE_PATIENCE => tokio::time::sleep(SAVE_POLL).await,
            written => break written,
        }
    };
    match written {
        Ok(Some(Ok((bytes, scene)))) => {
            let name = scene.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
            // A known format is a plain word, so it is safe in the name of a file.
            let place = format!("attachment; filename=\"{name}.{format}\"");
            (
                [
                    (header::CONTENT_TYPE, "application/octet-stream".to_string()),
                    (header::CONTENT_DISPOSITION, place),
                ],
                bytes,
            )
                .into_response()
        }
        Ok(Some(Err(message))) => (StatusCode::BAD_REQUEST, message + "\n").into_response(),
        Ok(None) => {
            let text = "the picture shown is not ready to be saved; save it when the view rests\n";
            (StatusCode::CONFLICT, text).into_response()
        }
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "the picture could not be written\n")
            .into_response(),
    }
}

/// The scene with all changes, and the present camera first: `?format=snell` or `glb`. What the
/// format leaves out is a header of the answer.
async fn save_scene(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    let format = query.get("format").cloned().unwrap_or_else(|| "snell".into());
    let Ok(_turn) = shared.saving.acquire().await else { return refused() };
    let session = shared.session;
    match tokio::task::spawn_blocking(move || session.scene_file(&format)).await {
        Ok(Ok((bytes, losses))) => {
            let kind = [(header::CONTENT_TYPE, "application/octet-stream".to_string())];
            // Headers are ASCII.
            let plain = |c: char| if c.is_ascii() && !c.is_ascii_control() { c } else { '?' };
            let losses = [("snell-losses", losses.join("; ").chars().map(plain).collect())];
            (kind, AppendHeaders::<[(&str, String); 1]>(losses), bytes).into_response()
        }
        Ok(Err(message)) => (StatusCode::BAD_REQUEST, message + "\n").into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "the scene could not be written\n").into_response()
        }
    }
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
async fn thumbnail(Query(query): Query<HashMap<String, String>>) -> Response {
    match gallery::picture(query.get("scene").map_or("", String::as_str)) {
        Some(bytes) => ([(header::CONTENT_TYPE, "image/jpeg")], bytes).into_response(),
        None => (StatusCode::NOT_FOUND, "there is no such picture\n").into_response(),
    }
}

/// A small picture of a texture of the scene: `?i=3`.
async fn texture(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    let number = query.get("i").and_then(|i| i.parse().ok()).unwrap_or(u32::MAX);
    let session = shared.session;
    match tokio::task::spawn_blocking(move || session.swatch(number)).await {
        Ok(Ok(bytes)) => ([(header::CONTENT_TYPE, "image/png")], bytes).into_response(),
        Ok(Err(message)) => (StatusCode::NOT_FOUND, message + "\n").into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "a fault; please report it\n").into_response()
        }
    }
}

/// Keeps a picture for edits, `?name=wood.png`; the answer is its name in them.
async fn add_picture(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
    request: Request,
) -> Response {
    let Ok(_turn) = shared.receiving.try_acquire() else {
        return closing(StatusCode::SERVICE_UNAVAILABLE, "another file is being read; try again\n");
    };
    let Some(name) = query.get("name").cloned() else {
        return closing(StatusCode::BAD_REQUEST, "name the picture: ?name=wood.png\n");
    };
    let (head, body) = request.into_parts();
    let bytes = match receive(&head.headers, body).await {
        Ok(bytes) => bytes,
        Err((status, text)) => return closing(status, text),
    };
    let session = shared.session.clone();
    match tokio::task::spawn_blocking(move || session.add_picture(&name, bytes)).await {
        Ok(Ok(name)) => name.into_response(),
        Ok(Err(message)) => (StatusCode::UNPROCESSABLE_ENTITY, message + "\n").into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "a fault; please report the file\n").into_response()
        }
    }
}

/// Files dropped on the page, or a built-in scene by name: `?builtin=teapot`, one file as
/// `?name=scene.glb`, or several as `?files`.
async fn open(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
    request: Request,
) -> Response {
    let client = query.get("client").and_then(|client| client.parse().ok()).unwrap_or(0);
    if let Err(message) = shared.session.check_steers(client) {
        return closing(StatusCode::CONFLICT, message + "\n");
    }
    let Ok(_turn) = shared.receiving.try_acquire() else {
        return closing(
            StatusCode::SERVICE_UNAVAILABLE,
            "another scene is being opened; try again\n",
        );
    };
    let which = if let Some(name) = query.get("builtin") {
        Which::Builtin(name.clone())
    } else {
        let name = query.get("name").cloned();
        if name.is_none() && !query.contains_key("files") {
            return closing(StatusCode::BAD_REQUEST, "name the file: ?name=scene.glb\n");
        }
        let (head, body) = request.into_parts();
        let received = receive(&head.headers, body).await.and_then(|bytes| match name {
            Some(name) => Ok(vec![Dropped { name, bytes }]),
            None => {
                files(&bytes).map_err(|problem| (StatusCode::BAD_REQUEST, format!("{problem}\n")))
            }
        });
        match received {
            Ok(files) => Which::Dropped(files),
            Err((status, text)) => return closing(status, text),
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

/// Bytes from work that may take long, no content while they are still to come, or a message.
async fn computed<T: Into<Option<Vec<u8>>> + Send + 'static>(
    work: impl FnOnce() -> Result<T, String> + Send + 'static,
) -> Response {
    match tokio::task::spawn_blocking(work).await {
        Ok(Ok(bytes)) => match bytes.into() {
            Some(bytes) => {
                ([(header::CONTENT_TYPE, "application/octet-stream")], bytes).into_response()
            }
            None => StatusCode::NO_CONTENT.into_response(),
        },
        Ok(Err(message)) => (StatusCode::UNPROCESSABLE_ENTITY, message + "\n").into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "a fault; please report it\n").into_response()
        }
    }
}

/// A number in the query; 0 if there is none.
fn number<T: FromStr + Default>(query: &HashMap<String, String>, name: &str) -> T {
    query.get(name).and_then(|text| text.parse().ok()).unwrap_or_default()
}

/// The body of a request, received while no other one is.
async fn received(shared: &Shared, request: Request) -> Result<Vec<u8>, Response> {
    let Ok(_turn) = shared.receiving.acquire().await else { return Err(refused()) };
    let (head, body) = request.into_parts();
    receive(&head.headers, body).await.map_err(|(status, text)| closing(status, text))
}

/// Decodes a picture to compare with: `?name=reference.exr`, and the file as the body.
async fn reference(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
    request: Request,
) -> Response {
    let name = query.get("name").cloned().unwrap_or_else(|| "the picture".into());
    match received(&shared, request).await {
        Ok(bytes) => {
            let Ok(_turn) = shared.saving.acquire().await else { return refused() };
            computed(move || compare::reference(&name, bytes)).await
        }
        Err(refusal) => refusal,
    }
}

/// Compares the picture at rest with linear values in the body:
/// `?width=320&height=200&exposure=0&tonemap=none`.
async fn difference(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
    request: Request,
) -> Response {
    let halves = match received(&shared, request).await {
        Ok(halves) => halves,
        Err(refusal) => return refusal,
    };
    let against = Against {
        size: [number(&query, "width"), number(&query, "height")],
        halves,
        exposure: number(&query, "exposure"),
        tonemap: query.get("tonemap").cloned().unwrap_or_else(|| "none".into()),
    };
    let Ok(_turn) = shared.saving.acquire().await else { return refused() };
    let session = shared.session.clone();
    computed(move || compare::difference(&session, &against)).await
}

/// The exact values of a layer of the picture at rest: `?name=depth`.
async fn layer(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    let name = query.get("name").cloned().unwrap_or_default();
    let Ok(_turn) = shared.saving.acquire().await else { return refused() };
    let session = shared.session.clone();
    computed(move || compare::layer(&session, &name)).await
}

/// The edges that a camera sees: `?camera=JSON&width=320&height=200`.
async fn edges(
    State(shared): State<Shared>,
    Query(query): Query<HashMap<String, String>>,
) -> Response {
    let camera = query.get("camera").cloned().unwrap_or_default();
    let size = [number(&query, "width"), number(&query, "height")];
    let Ok(_turn) = shared.saving.acquire().await else { return refused() };
    let session = shared.session.clone();
    computed(move || feature_edges::edges(&session, &camera, size)).await
}
