//! The WebSocket of a page: handles its messages in order, and sends pictures as fast as it takes
//! them.

use crate::explain::Question;
use crate::protocol::{ToPage, ToServer};
use crate::routes::Shared;
use crate::session::{Frame, Session, lock};
use crate::{pace, pick};
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{broadcast, watch};
use tokio::time::{Interval, MissedTickBehavior, interval, timeout};

/// Maximum number of pages.
pub const MAX_PAGES: usize = 32;
/// Maximum number of bytes of a message from a page.
const MAX_MESSAGE: usize = 1 << 20;
/// Maximum number of pictures in transit to a page: one that is shown, and one on its way.
const MAX_UNDERWAY: u32 = 2;
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
    let mut connection = Connection { underway: 0, newest: None, heard: Instant::now(), beat };
    let mut is_open = send_all(&mut socket, &welcome).await;
    while is_open {
        is_open = connection.step(&mut socket, &session, client, &mut events, &mut frames).await;
    }
}

struct Connection {
    /// Number of pictures sent and not acknowledged.
    underway: u32,
    newest: Option<u32>,
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
            changed = frames.changed(), if self.underway < MAX_UNDERWAY => {
                if changed.is_err() {
                    return false;
                }
                // Only the newest picture is sent: a slow page skips pictures and never builds up a
                // queue.
                let frame = frames.borrow_and_update().clone();
                let Some(frame) = frame.filter(|f| self.newest != Some(f.number)) else {
                    return true;
                };
                self.underway += 1;
                self.newest = Some(frame.number);
                transmit(socket, Message::Binary(frame.bytes.clone())).await
            }
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
            ToServer::Ack { frame } => {
                self.underway = self.underway.saturating_sub(1);
                // A picture that was never sent cannot have been seen.
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
