//! HTTP and WebSocket. Every path begins with the token; see [`crate::security`] for who is let in.

use crate::explain::Question;
use crate::protocol::{ToPage, ToServer};
use crate::security::Guard;
use crate::session::{Frame, Session, lock};
use crate::worker::Worker;
use crate::{Source, Which, pace, page, pick};
use axum::Router;
use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use snell_formats::image::{Display, WriteOptions, encode_image_as};
use snell_scene::LayeredImage;
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::{broadcast, oneshot, watch};

/// Bytes of a text message from a page.
const MAX_MESSAGE: usize = 1 << 20;
/// Bytes of a file that is dropped on the page.
const MAX_UPLOAD: usize = 1 << 30;
/// Pictures on their way to a page at once: one that is shown, one that travels.
const MAX_UNDERWAY: u32 = 2;
/// A page that takes longer than this for a message is gone.
const PATIENCE: Duration = Duration::from_secs(20);
/// Pages at once.
const MAX_PAGES: usize = 32;

/// How the server runs.
#[derive(Clone, Debug)]
pub struct ServerOptions {
    /// Where it listens.
    pub host: IpAddr,
    /// 0 for any that is free.
    pub port: u16,
    /// While something moves.
    pub frames_per_second: f64,
    /// For rendering.
    pub threads: usize,
    /// True if nobody has named a scene: pages begin with a choice of built-in ones.
    pub is_gallery: bool,
    /// Whether pages of others may show this one in a frame, such as notebooks: who knows the token lets them.
    pub may_be_framed: bool,
    /// In the place of a random one: letters and digits.
    pub token: Option<String>,
}

/// A running server; it stops when it is dropped.
pub struct Server {
    /// Where it listens.
    pub address: SocketAddr,
    /// The address of the page, with its token.
    pub url: String,
    session: Arc<Session>,
    stop: Option<oneshot::Sender<()>>,
    threads: Vec<JoinHandle<()>>,
}

impl Server {
    /// Reads the scene again, because its files have changed.
    pub fn reload(&self) {
        if let Err(message) = self.session.open(Which::Given) {
            self.session.tell(ToPage::Error { message });
        }
    }

    /// Stops and waits for all threads.
    pub fn stop(mut self) {
        self.end();
    }

    fn end(&mut self) {
        self.session.stop();
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.end();
    }
}

#[derive(Clone)]
struct Shared {
    may_be_framed: bool,
    session: Arc<Session>,
    guard: Arc<Guard>,
}

/// Opens the source's scene and serves it. Errors are for people.
pub fn serve(source: Box<dyn Source>, options: &ServerOptions) -> Result<Server, String> {
    let session = Arc::new(Session::new(source, options.is_gallery)?);
    let place = SocketAddr::new(options.host, options.port);
    let listener = std::net::TcpListener::bind(place)
        .and_then(|l| l.set_nonblocking(true).map(|()| l))
        .map_err(|e| format!("cannot listen on {place}: {e}; choose another --port, or leave it out for any"))?;
    let address = listener.local_addr().map_err(|e| e.to_string())?;
    let guard = Arc::new(Guard::new(address, options.token.clone())?);
    let shown =
        if address.ip().is_unspecified() { SocketAddr::new([127, 0, 0, 1].into(), address.port()) } else { address };
    let url = format!("http://{shown}/{}/", guard.token());

    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(8)
        .thread_name("snell-view-net")
        .enable_all()
        .build()
        .map_err(|e| format!("cannot start the server: {e}"))?;
    let (stop, stopped) = oneshot::channel::<()>();
    let app = router(Shared { may_be_framed: options.may_be_framed, session: session.clone(), guard });
    let network = std::thread::Builder::new().name("snell-view".into()).spawn(move || {
        runtime.block_on(async move {
            let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
            tokio::select! {
                _ = axum::serve(listener, app) => {}
                _ = stopped => {}
            }
        });
        // Sockets of pages that do not answer must not keep the program.
        runtime.shutdown_timeout(Duration::from_secs(1));
    });
    let network = network.map_err(|e| format!("cannot start the server: {e}"))?;
    let (for_worker, threads, rate) = (session.clone(), options.threads, options.frames_per_second);
    let worker = std::thread::Builder::new()
        .name("snell-view-render".into())
        .spawn(move || Worker::run(&for_worker, threads, rate))
        .map_err(|e| format!("cannot start the renderer: {e}"))?;
    Ok(Server { address, url, session, stop: Some(stop), threads: vec![network, worker] })
}

fn router(shared: Shared) -> Router {
    Router::new()
        .route("/{token}/", get(serve_page))
        .route("/{token}/{file}", get(serve_page))
        .route("/{token}/ws", get(socket))
        .route("/{token}/save", get(save))
        .route("/{token}/cost", get(cost))
        .route("/{token}/thumbnail", get(thumbnail))
        .route("/{token}/open", post(open))
        .layer(DefaultBodyLimit::max(MAX_UPLOAD))
        .fallback(|| async { refused() })
        .layer(middleware::from_fn_with_state(shared.clone(), check))
        .with_state(shared)
}

fn refused() -> Response {
    let text = "Not the address of a scene: open the one that `snell view` has printed, with all of its letters.\n";
    (StatusCode::FORBIDDEN, text).into_response()
}

/// Lets in who may, and says to browsers what the page may do.
async fn check(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let guard = &shared.guard;
    let token = request.uri().path().split('/').nth(1).unwrap_or("");
    if !guard.is_for_us(request.headers()) || !guard.is_from_us(request.headers()) || !guard.knows(token) {
        return refused();
    }
    let mut response = next.run(request).await;
    const FRAMED: &str = "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'";
    const ALONE: &str = "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'self'; base-uri 'none'; form-action 'none'";
    let rules = [
        (header::CONTENT_SECURITY_POLICY, if shared.may_be_framed { FRAMED } else { ALONE }),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
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

/// The picture at rest as a file: `?format=png`, `exr` or any other that is written.
async fn save(State(shared): State<Shared>, Query(query): Query<HashMap<String, String>>) -> Response {
    let format = query.get("format").cloned().unwrap_or_else(|| "png".into());
    let Some(finished) = lock(&shared.session.finished).clone() else {
        return (StatusCode::CONFLICT, "there is no picture yet; wait until the view rests\n").into_response();
    };
    let display = shared.session.now().display;
    let name = finished.name.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    let encoded = tokio::task::spawn_blocking(move || encode(&finished.picture, &format, display)).await;
    match encoded {
        Ok(Ok((bytes, extension))) => {
            let place = format!("attachment; filename=\"{name}.{extension}\"");
            (
                [(header::CONTENT_TYPE, "application/octet-stream".to_string()), (header::CONTENT_DISPOSITION, place)],
                bytes,
            )
                .into_response()
        }
        Ok(Err(message)) => (StatusCode::BAD_REQUEST, message + "\n").into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "the picture could not be written\n").into_response(),
    }
}

fn encode(picture: &LayeredImage, format: &str, display: Display) -> Result<(Vec<u8>, String), String> {
    let options = WriteOptions { display, ..WriteOptions::default() };
    let bytes = encode_image_as(format, picture, &options).map_err(|e| e.to_string())?;
    Ok((bytes, format.to_string()))
}

/// What each pixel costs in a structure: `?structure=kdtree&width=320`.
async fn cost(State(shared): State<Shared>, Query(query): Query<HashMap<String, String>>) -> Response {
    let structure = query.get("structure").cloned().unwrap_or_default();
    let width = query.get("width").and_then(|w| w.parse().ok()).unwrap_or(320);
    let session = shared.session;
    match tokio::task::spawn_blocking(move || session.cost(&structure, width)).await {
        Ok(Ok(bytes)) => ([(header::CONTENT_TYPE, "application/octet-stream")], bytes).into_response(),
        Ok(Err(message)) => (StatusCode::BAD_REQUEST, message + "\n").into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "a fault; please report it\n").into_response(),
    }
}

/// A small picture of a built-in scene: `?scene=teapot`.
async fn thumbnail(State(shared): State<Shared>, Query(query): Query<HashMap<String, String>>) -> Response {
    let name = query.get("scene").cloned().unwrap_or_default();
    let session = shared.session;
    match tokio::task::spawn_blocking(move || session.thumbnail(&name)).await {
        Ok(Ok(bytes)) => ([(header::CONTENT_TYPE, "image/png")], bytes.to_vec()).into_response(),
        Ok(Err(message)) => (StatusCode::NOT_FOUND, message + "\n").into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "a fault; please report it\n").into_response(),
    }
}

/// A file dropped on the page, or a built-in scene by name.
async fn open(State(shared): State<Shared>, Query(query): Query<HashMap<String, String>>, body: Bytes) -> Response {
    let which = match (query.get("builtin"), query.get("name")) {
        (Some(name), _) => Which::Builtin(name.clone()),
        (None, Some(name)) => Which::Dropped { name: name.clone(), bytes: body.to_vec() },
        (None, None) => return (StatusCode::BAD_REQUEST, "name the file: ?name=scene.glb\n").into_response(),
    };
    let session = shared.session;
    match tokio::task::spawn_blocking(move || session.open(which)).await {
        Ok(Ok(())) => StatusCode::NO_CONTENT.into_response(),
        Ok(Err(message)) => (StatusCode::UNPROCESSABLE_ENTITY, message + "\n").into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "a fault in the reader; please report the file\n").into_response()
        }
    }
}

async fn socket(State(shared): State<Shared>, headers: HeaderMap, upgrade: WebSocketUpgrade) -> Response {
    if shared.session.events.receiver_count() >= MAX_PAGES {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages watch this scene\n").into_response();
    }
    // Browsers always say where a page comes from; without it, anything could be behind the socket.
    if !headers.contains_key(header::ORIGIN) && headers.contains_key(header::COOKIE) {
        return refused();
    }
    upgrade.max_message_size(MAX_MESSAGE).on_upgrade(move |socket| talk(socket, shared.session))
}

/// Talks to one page until it goes.
async fn talk(mut socket: WebSocket, session: Arc<Session>) {
    let mut events = session.events.subscribe();
    let mut frames = session.frames.subscribe();
    frames.mark_changed();
    let (client, welcome) = session.join();
    let mut connection = Connection { underway: 0, newest: None };
    let mut is_open = true;
    for message in welcome {
        is_open &= send(&mut socket, &message).await;
    }
    while is_open {
        is_open = connection.step(&mut socket, &session, client, &mut events, &mut frames).await;
    }
    session.leave(client);
}

struct Connection {
    /// Pictures sent and not acknowledged.
    underway: u32,
    newest: Option<u32>,
}

impl Connection {
    /// Waits for one thing and does it; false if the page is gone.
    async fn step(
        &mut self,
        socket: &mut WebSocket,
        session: &Arc<Session>,
        client: u32,
        events: &mut broadcast::Receiver<ToPage>,
        frames: &mut watch::Receiver<Option<Arc<Frame>>>,
    ) -> bool {
        tokio::select! {
            message = socket.recv() => match message {
                Some(Ok(Message::Text(text))) => self.received(socket, session, client, &text).await,
                Some(Ok(Message::Binary(_))) => {
                    send(socket, &ToPage::Error { message: "messages are JSON text".into() }).await
                }
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => true,
                Some(Ok(Message::Close(_)) | Err(_)) | None => false,
            },
            event = events.recv() => match event {
                Ok(event) => send(socket, &event).await,
                // A page that was too slow has missed some; what counts is told again with the next change.
                Err(broadcast::error::RecvError::Lagged(_)) => true,
                Err(broadcast::error::RecvError::Closed) => false,
            },
            changed = frames.changed(), if self.underway < MAX_UNDERWAY => {
                if changed.is_err() {
                    return false;
                }
                // Only the newest: a slow page skips pictures and never makes a queue.
                let frame = frames.borrow_and_update().clone();
                let Some(frame) = frame.filter(|f| self.newest != Some(f.number)) else { return true };
                self.underway += 1;
                self.newest = Some(frame.number);
                transmit(socket, Message::Binary(Bytes::from(frame.bytes.clone()))).await
            }
        }
    }

    async fn received(&mut self, socket: &mut WebSocket, session: &Arc<Session>, client: u32, text: &str) -> bool {
        let message = match serde_json::from_str::<ToServer>(text) {
            Ok(message) => message,
            Err(error) => return send(socket, &ToPage::Error { message: format!("not understood: {error}") }).await,
        };
        match message {
            ToServer::Ack { frame } => {
                self.underway = self.underway.saturating_sub(1);
                // Nobody has seen what was never sent.
                if self.newest.is_some_and(|newest| !pace::is_before(newest, frame)) {
                    session.pace.show(frame);
                }
                true
            }
            ToServer::Pick { id, pixel } => {
                let session = session.clone();
                let picked = tokio::task::spawn_blocking(move || {
                    let compiled = lock(&session.compiled).clone().map(|(_, compiled)| compiled)?;
                    pick::pick(&session.now(), &compiled, pixel)
                });
                send(socket, &ToPage::Picked { id, hit: picked.await.ok().flatten() }).await
            }
            ToServer::Explain { id, pixel, sample, all } => {
                let session = session.clone();
                let question = Question { pixel, sample };
                let told = tokio::task::spawn_blocking(move || session.explain(&question, all)).await;
                let report = match told.unwrap_or_else(|_| Err("a fault; please report it".into())) {
                    Ok(report) => Some(Box::new(report)),
                    Err(message) => {
                        if !send(socket, &ToPage::Error { message }).await {
                            return false;
                        }
                        None
                    }
                };
                send(socket, &ToPage::Explained { id, report }).await
            }
            other => {
                let session = session.clone();
                let done = tokio::task::spawn_blocking(move || session.handle(client, other)).await;
                match done {
                    Ok(Ok(())) => true,
                    Ok(Err(message)) => send(socket, &ToPage::Error { message }).await,
                    Err(_) => send(socket, &ToPage::Error { message: "a fault; please report it".into() }).await,
                }
            }
        }
    }
}

async fn send(socket: &mut WebSocket, message: &ToPage) -> bool {
    match serde_json::to_string(message) {
        Ok(text) => transmit(socket, Message::Text(text.into())).await,
        Err(_) => true,
    }
}

/// A page that does not take its messages is given up, so that it holds nothing.
async fn transmit(socket: &mut WebSocket, message: Message) -> bool {
    matches!(tokio::time::timeout(PATIENCE, socket.send(message)).await, Ok(Ok(())))
}
