//! Who is connected. A connection that has not shown the token yet has little time, and few of them
//! are kept: the oldest goes when there are too many, so that half-open ones keep nobody out.

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

/// The lines before a request's body must be here within this time, from the first byte or from the
/// request before.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// A connection that has not shown the token by then is closed, whatever it does.
const STRANGER_TIME: Duration = Duration::from_secs(10);
/// Any other is closed after this time, unless it has become a WebSocket.
const LIFETIME: Duration = Duration::from_secs(15 * 60);
/// Connections that have not shown the token.
const MAX_STRANGERS: usize = 64;
/// Connections that have, WebSockets apart.
const MAX_KNOWN: usize = 192;
/// Bytes of the lines before a body.
const MAX_HEAD: usize = 64 << 10;
/// How long the server waits when it can accept no connection, because descriptors have run out.
const PAUSE: Duration = Duration::from_millis(50);

/// Connections that have not shown the token, the oldest first.
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
    /// The address of the other end.
    pub peer: SocketAddr,
    /// The address of this end.
    pub own: SocketAddr,
}

impl Visitor {
    /// It has shown the token. False if there are too many that have.
    pub fn admit(&self) -> bool {
        if self.is_known() {
            return true;
        }
        let Ok(place) = self.hall.known.clone().try_acquire_owned() else { return false };
        self.leave_strangers();
        // Two requests of one connection never run at once; the second place would be given back.
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

/// Accepts connections for ever. Requests have their [`Visitor`] as an extension.
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
            // The connection is gone already, or descriptors have run out.
            turn_out(&mut lock(&hall.strangers), 0);
            sleep(PAUSE).await;
            continue;
        };
        // It must be in the list before it can leave it.
        let mut strangers = lock(&hall.strangers);
        let task = tokio::spawn(attend(stream, Arc::new(visitor), app.clone()));
        strangers.push_back((number, task.abort_handle()));
        turn_out(&mut strangers, MAX_STRANGERS);
    }
}

/// Ends the oldest connection if there are more than this.
fn turn_out(strangers: &mut VecDeque<(u64, AbortHandle)>, most: usize) {
    if strangers.len() > most
        && let Some((_, task)) = strangers.pop_front()
    {
        task.abort();
    }
}

/// Answers the requests of one connection until it ends or its time is over.
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
