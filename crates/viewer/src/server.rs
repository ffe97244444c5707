//! A server that runs: its threads, and how it is begun and ended.

use crate::connections::accept;
use crate::protocol::ToPage;
use crate::routes::{Shared, router};
use crate::security::{Guard, ONCE};
use crate::session::Session;
use crate::worker::Worker;
use crate::{Source, Which};
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::oneshot;

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
    /// Whether pages of others may show this one in a frame, such as notebooks: who knows the token
    /// lets them.
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
    guard: Arc<Guard>,
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

    /// An address for a browser's command line, which other users of the machine can read: it leads
    /// to the page once, soon, and only a program of the same user.
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

/// Opens the source's scene and serves it. Errors are for people.
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
        // Sockets of pages that do not answer must not keep the program.
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
