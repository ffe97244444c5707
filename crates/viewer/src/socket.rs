//! The WebSocket of a page: handles its messages in order, and sends pictures as fast as it takes
//! them.

use crate::explain::Question;
use crate::pick;
use crate::protocol::{PartHeader, ToPage, ToServer};
use crate::routes::Shared;
use crate::session::{Frame, Session, lock};
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{broadcast, watch};
use tokio::time::{Interval, MissedTickBehavior, interval, timeout};

/// Maximum number of pages.
pub const MAX_PAGES: usize = 32;
/// Maximum number of bytes of a message from a page.
const MAX_MESSAGE: usize = 1 << 20;
/// Bytes of the first part of a picture that is sent to a page.
const FIRST_PART: usize = 32 << 10;
/// Bytes of the smallest and largest part.
const PARTS: [usize; 2] = [8 << 10, 16 << 20];
/// Parts become larger below, and smaller above these times until they are acknowledged.
const ROUND_TRIP: [Duration; 2] = [Duration::from_millis(60), Duration::from_millis(250)];
/// From this size of parts on, the line is so fast that one part is on its way while another is
/// shown.
const FAST: usize = 128 << 10;
/// A page that takes longer than this for a message is disconnected.
const PATIENCE: Duration = Duration::from_secs(20);
/// Interval of keep-alive messages.
const BEAT: Duration = Duration::from_secs(30);
/// A page that sends nothing for this time is disconnected.
const SILENCE: Duration = Duration::from_secs(120);
/// Maximum length of an error about a message, which may quote much of the message.
const MAX_ERROR: usize = 500;

/// Opens the WebSocket of a page.
pub async fn socket(
    State(shared): State<Shared>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let Ok(place) = shared.pages.clone().try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages watch this scene\n")
            .into_response();
    };
    // Browsers always send an origin; without it, the client could be anything.
    if !headers.contains_key(header::ORIGIN) && headers.contains_key(header::COOKIE) {
        return (StatusCode::FORBIDDEN, "a page must say where it comes from\n").into_response();
    }
    upgrade.max_message_size(MAX_MESSAGE).max_frame_size(MAX_MESSAGE).on_upgrade(
        async move |socket| {
            talk(socket, shared.session).await;
            drop(place);
        },
    )
}

/// A connected page. Dropping the value removes the page from the session.
struct Watching {
    session: Arc<Session>,
    client: u32,
}

impl Drop for Watching {
    fn drop(&mut self) {
        self.session.leave(self.client);
    }
}

/// Serves one page until it disconnects.
async fn talk(mut socket: WebSocket, session: Arc<Session>) {
    let mut events = session.events.subscribe();
    let mut frames = session.frames.subscribe();
    frames.mark_changed();
    let (client, welcome) = session.join();
    let _watching = Watching { session: session.clone(), client };
    let mut beat = interval(BEAT);
    beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut connection = Connection {
        underway: VecDeque::new(),
        current: None,
        newest: None,
        part: FIRST_PART,
        heard: Instant::now(),
        beat,
    };
    let mut is_open = send_all(&mut socket, &welcome).await;
    while is_open {
        is_open = connection.step(&mut socket, &session, client, &mut events, &mut frames).await;
    }
}

/// A part that was sent and is not acknowledged.
struct Underway {
    bytes: usize,
    sent: Instant,
    /// Number of the frame, if this is its last part.
    ends: Option<u32>,
}

struct Connection {
    underway: VecDeque<Underway>,
    /// A picture of which only so many bytes were sent.
    current: Option<(Arc<Frame>, usize)>,
    newest: Option<u32>,
    /// Bytes of the next part.
    part: usize,
    /// Time when the page last sent anything.
    heard: Instant,
    beat: Interval,
}

impl Connection {
    /// Waits for one event and handles it; false if the page is gone.
    async fn step(
        &mut self,
        socket: &mut WebSocket,
        session: &Arc<Session>,
        client: u32,
        events: &mut broadcast::Receiver<ToPage>,
        frames: &mut watch::Receiver<Option<Arc<Frame>>>,
    ) -> bool {
        tokio::select! {
            message = socket.recv() => {
                self.heard = Instant::now();
                match message {
                    Some(Ok(Message::Text(text))) => {
                        self.received(socket, session, client, &text).await
                            && self.send_parts(socket, frames).await
                    }
                    Some(Ok(Message::Binary(_))) => {
                        send_error(socket, "messages are JSON text".into()).await
                    }
                    // The answer is sent here and waited for: answers to a flood of pings must not
                    // pile up.
                    Some(Ok(Message::Ping(bytes))) => transmit(socket, Message::Pong(bytes)).await,
                    Some(Ok(Message::Pong(_))) => true,
                    Some(Ok(Message::Close(_)) | Err(_)) | None => false,
                }
            }
            event = events.recv() => match event {
                Ok(event) => send(socket, &event).await,
                // A page that was too slow has missed some messages.
                Err(broadcast::error::RecvError::Lagged(_)) => {
                    send_all(socket, &session.all()).await
                }
                Err(broadcast::error::RecvError::Closed) => false,
            },
            _ = self.beat.tick() => {
                self.heard.elapsed() < SILENCE
                    && transmit(socket, Message::Ping(Default::default())).await
            }
            changed = frames.changed(), if self.has_room() => {
                changed.is_ok() && self.send_parts(socket, frames).await
            }
        }
    }

    fn has_room(&self) -> bool {
        self.underway.len() < if self.part >= FAST { 2 } else { 1 }
    }

    /// Sends as much as the line takes; false if the page is gone. Only the newest picture is
    /// begun: a slow page skips pictures and never builds up a queue. One at rest is given up when
    /// something moves.
    async fn send_parts(
        &mut self,
        socket: &mut WebSocket,
        frames: &mut watch::Receiver<Option<Arc<Frame>>>,
    ) -> bool {
        while self.has_room() {
            let newer = || frames.borrow().clone().filter(|f| self.newest != Some(f.number));
            let is_outdated = |(frame, _): &(Arc<Frame>, usize)| {
                !frame.is_moving && newer().is_some_and(|newer| newer.is_moving)
            };
            let current = self.current.take().filter(|current| !is_outdated(current));
            let Some((frame, start)) = current.or_else(|| Some((newer()?, 0))) else {
                return true;
            };
            frames.mark_unchanged();
            self.newest = Some(frame.number);
            let end = frame.bytes.len().min(start + self.part);
            let is_last = end == frame.bytes.len();
            let head = PartHeader {
                frame: frame.number,
                offset: start as u32,
                total: frame.bytes.len() as u32,
            };
            let message = [&head.to_bytes()[..], &frame.bytes[start..end]].concat();
            let ends = is_last.then_some(frame.number);
            self.underway.push_back(Underway { bytes: end - start, sent: Instant::now(), ends });
            self.current = (!is_last).then_some((frame, end));
            if !transmit(socket, Message::Binary(message.into())).await {
                return false;
            }
        }
        true
    }

    /// Records that a page got a part.
    fn acknowledged(&mut self, session: &Session) {
        let Some(Underway { bytes, sent, ends }) = self.underway.pop_front() else { return };
        let time = sent.elapsed();
        if time < ROUND_TRIP[0] && 2 * bytes >= self.part {
            self.part = (self.part * 2).min(PARTS[1]);
        } else if time > ROUND_TRIP[1] {
            self.part = (self.part / 2).max(PARTS[0]);
        }
        if bytes >= PARTS[0] / 2 {
            session.pace.measure(bytes, time);
        }
        if let Some(frame) = ends {
            session.pace.show(frame);
        }
    }

    async fn received(
        &mut self,
        socket: &mut WebSocket,
        session: &Arc<Session>,
        client: u32,
        text: &str,
    ) -> bool {
        let message = match serde_json::from_str::<ToServer>(text) {
            Ok(message) => message,
            Err(error) => return send_error(socket, format!("not understood: {error}")).await,
        };
        match message {
            // Parts are acknowledged in order.
            ToServer::Ack { frame: _ } => {
                self.acknowledged(session);
                true
            }
            ToServer::Pick { id, pixel, reach } => {
                let session = session.clone();
                let picked = tokio::task::spawn_blocking(move || {
                    let compiled = lock(&session.compiled).clone().map(|(_, compiled)| compiled)?;
                    pick::near(&session.now(), &compiled, pixel, reach)
                });
                send(socket, &ToPage::Picked { id, hit: picked.await.ok().flatten() }).await
            }
            ToServer::Select { id, path, width, surface } => {
                let session = session.clone();
                let found =
                    tokio::task::spawn_blocking(move || session.select(&path, width, surface));
                let (place, mask, material) = found.await.unwrap_or((None, None, None));
                send(socket, &ToPage::Selected { id, place, mask, material }).await
            }
            ToServer::Explain { id, pixel, sample, all } => {
                let session = session.clone();
                let question = Question { pixel, sample };
                let Ok(_turn) = session.examining.clone().acquire_owned().await else {
                    return false;
                };
                let explained =
                    tokio::task::spawn_blocking(move || session.explain(&question, all)).await;
                let report =
                    match explained.unwrap_or_else(|_| Err("a fault; please report it".into())) {
                        Ok(report) => Some(Box::new(report)),
                        Err(message) => {
                            if !send_error(socket, message).await {
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
                    Ok(Err(message)) => send_error(socket, message).await,
                    Err(_) => send_error(socket, "a fault; please report it".into()).await,
                }
            }
        }
    }
}

async fn send_error(socket: &mut WebSocket, message: String) -> bool {
    let message = match message.char_indices().nth(MAX_ERROR) {
        Some((end, _)) => format!("{}…", &message[..end]),
        None => message,
    };
    send(socket, &ToPage::Error { message }).await
}

async fn send_all(socket: &mut WebSocket, messages: &[ToPage]) -> bool {
    for message in messages {
        if !send(socket, message).await {
            return false;
        }
    }
    true
}

async fn send(socket: &mut WebSocket, message: &ToPage) -> bool {
    match serde_json::to_string(message) {
        Ok(text) => transmit(socket, Message::Text(text.into())).await,
        Err(_) => true,
    }
}

/// Sends a message. A page that does not accept its messages is disconnected, so that it blocks
/// nothing.
async fn transmit(socket: &mut WebSocket, message: Message) -> bool {
    matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(())))
}
