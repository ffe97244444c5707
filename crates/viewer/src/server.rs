//! A running server: its threads, and how it starts and stops.

use crate::Source;
use crate::connections::accept;
use crate::protocol::ToPage;
use crate::routes::{Shared, router};
use crate::security::{Guard, ONCE};
use crate::session::Session;
use crate::worker::Worker;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::oneshot;

/// Options of the server.
#[derive(Clone, Debug)]
pub struct ServerOptions {
    /// The address to listen on.
    pub host: IpAddr,
    /// The port; 0 for any free one.
    pub port: u16,
    /// Frames per second while something moves.
    pub frames_per_second: f64,
    /// Number of render threads.
    pub threads: usize,
    /// True if no scene was named: pages begin with a choice of built-in ones.
    pub is_gallery: bool,
    /// True if pages of other origins, such as notebooks, may embed this one in a frame: the token
    /// authorises them.
    pub may_be_framed: bool,
    /// A token of letters and digits instead of a random one.
    pub token: Option<String>,
}

/// A running server; it stops when it is dropped.
pub struct Server {
    /// The address that the server listens on.
    pub address: SocketAddr,
    /// The address of the page, with its token.
    pub url: String,
    session: Arc<Session>,
    guard: Arc<Guard>,
    stop: Option<oneshot::Sender<()>>,
    threads: Vec<JoinHandle<()>>,
}

impl Server {
    /// Reloads the scene, because its files have changed.
    pub fn reload(&self) {
        if let Err(message) = self.session.reload() {
            self.session.tell(ToPage::Error { message });
        }
    }

    /// An address for a browser's command line, which other users of the machine can read: it leads
    /// to the page once, within a short time, and on Linux only for a program of the same user.
    pub fn url_for_browser(&self) -> Result<String, String> {
        let (place, code) = (self.url.trim_end_matches('/'), self.guard.new_code()?);
        let place = place.rsplit_once('/').map_or(place, |(place, _token)| place);
        Ok(format!("{place}/{ONCE}/{code}"))
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

/// Opens the source's scene and serves it. Errors are messages for the user.
pub fn serve(source: Box<dyn Source>, options: &ServerOptions) -> Result<Server, String> {
    if !(1.0..=240.0).contains(&options.frames_per_second) {
        return Err(format!("{} frames per second; choose 1 to 240", options.frames_per_second));
    }
    let session = Arc::new(Session::new(source, options.is_gallery)?);
    let place = SocketAddr::new(options.host, options.port);
    let listener = std::net::TcpListener::bind(place)
        .and_then(|l| l.set_nonblocking(true).map(|()| l))
        .map_err(|e| {
            format!("cannot listen on {place}: {e}; choose another --port, or leave it out for any")
        })?;
    let address = listener.local_addr().map_err(|e| e.to_string())?;
    let guard = Arc::new(Guard::new(address, options.token.clone())?);
    let shown = if address.ip().is_unspecified() {
        SocketAddr::new([127, 0, 0, 1].into(), address.port())
    } else {
        address
    };
    let url = format!("http://{shown}/{}/", guard.token());

    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(8)
        .thread_name("snell-view-net")
        .enable_all()
        .build()
        .map_err(|e| format!("cannot start the server: {e}"))?;
    let (stop, stopped) = oneshot::channel::<()>();
    let app = router(Shared::new(session.clone(), guard.clone(), options.may_be_framed));
    let network = std::thread::Builder::new().name("snell-view".into()).spawn(move || {
        runtime.block_on(async move {
            let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
            tokio::select! {
                () = accept(listener, app) => {}
                _ = stopped => {}
            }
        });
        // Sockets of unresponsive pages must not delay the exit.
        runtime.shutdown_timeout(Duration::from_secs(1));
    });
    let network = network.map_err(|e| format!("cannot start the server: {e}"))?;
    let (for_worker, threads, rate) = (session.clone(), options.threads, options.frames_per_second);
    let worker = std::thread::Builder::new()
        .name("snell-view-render".into())
        .spawn(move || Worker::run(&for_worker, threads, rate))
        .map_err(|e| format!("cannot start the renderer: {e}"))?;
    Ok(Server { address, url, session, guard, stop: Some(stop), threads: vec![network, worker] })
}
