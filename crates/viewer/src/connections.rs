//! The open connections. A connection that has not presented the token yet has little time, and
//! only a few of them are kept: if there are too many, the oldest is closed, so that half-open
//! connections lock out no user.

use crate::session::lock;
use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::collections::VecDeque;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::AbortHandle;
use tokio::time::{sleep, timeout};

/// Time limit for a request's header, from the first byte or from the previous request.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// A connection that has not presented the token within this time is closed.
const STRANGER_TIME: Duration = Duration::from_secs(10);
/// A connection that has presented the token is closed after this time, unless it has become a
/// WebSocket.
const LIFETIME: Duration = Duration::from_secs(15 * 60);
/// Maximum number of connections that have not presented the token.
const MAX_STRANGERS: usize = 64;
/// Maximum number of connections that have presented the token, except for WebSockets.
const MAX_KNOWN: usize = 192;
/// Maximum number of bytes of a header.
const MAX_HEAD: usize = 64 << 10;
/// Time for which the server waits if it cannot accept a connection for lack of file descriptors.
const PAUSE: Duration = Duration::from_millis(50);

/// Connections that have not presented the token, the oldest first.
type Strangers = Mutex<VecDeque<(u64, AbortHandle)>>;

/// All connections.
struct Hall {
    strangers: Strangers,
    known: Arc<Semaphore>,
}

/// One connection.
pub struct Visitor {
    hall: Arc<Hall>,
    number: u64,
    place: OnceLock<OwnedSemaphorePermit>,
    /// The remote address.
    pub peer: SocketAddr,
    /// The local address.
    pub own: SocketAddr,
}

impl Visitor {
    /// Registers that the token was presented. False if too many connections have done so.
    pub fn admit(&self) -> bool {
        if self.is_known() {
            return true;
        }
        let Ok(place) = self.hall.known.clone().try_acquire_owned() else { return false };
        self.leave_strangers();
        // Two requests of one connection never run at once; if they did, the second permit would be
        // dropped.
        self.place.get_or_init(|| place);
        true
    }

    fn is_known(&self) -> bool {
        self.place.get().is_some()
    }

    fn leave_strangers(&self) {
        lock(&self.hall.strangers).retain(|(number, _)| *number != self.number);
    }
}

/// Accepts connections forever. Each request has its connection's [`Visitor`] as an extension.
pub async fn accept(listener: TcpListener, app: Router) {
    let hall =
        Arc::new(Hall { strangers: Mutex::default(), known: Arc::new(Semaphore::new(MAX_KNOWN)) });
    for number in 0.. {
        let stream = listener.accept().await;
        let visitor = stream.and_then(|(stream, peer)| {
            let own = stream.local_addr()?;
            Ok((stream, Visitor { hall: hall.clone(), number, place: OnceLock::new(), peer, own }))
        });
        let Ok((stream, visitor)) = visitor else {
            // Either the connection has ended already, or file descriptors have run out.
            turn_out(&mut lock(&hall.strangers), 0);
            sleep(PAUSE).await;
            continue;
        };
        // The lock is held so that the connection is in the list before it can be removed.
        let mut strangers = lock(&hall.strangers);
        let task = tokio::spawn(attend(stream, Arc::new(visitor), app.clone()));
        strangers.push_back((number, task.abort_handle()));
        turn_out(&mut strangers, MAX_STRANGERS);
    }
}

/// Closes the oldest connection without a token if there are more than `most`.
fn turn_out(strangers: &mut VecDeque<(u64, AbortHandle)>, most: usize) {
    if strangers.len() > most
        && let Some((_, task)) = strangers.pop_front()
    {
        task.abort();
    }
}

/// Serves the requests of one connection until it ends or its time is over.
async fn attend(stream: TcpStream, visitor: Arc<Visitor>, app: Router) {
    let service = TowerToHyperService::new(app.layer(Extension(visitor.clone())));
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(MAX_HEAD)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    let mut connection = pin!(connection);
    if timeout(STRANGER_TIME, connection.as_mut()).await.is_err() && visitor.is_known() {
        let _ = timeout(LIFETIME, connection).await;
    }
    visitor.leave_strangers();
}
