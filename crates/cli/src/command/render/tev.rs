//! `--display tev://HOST:PORT`: sends tiles to the viewer tev while they are rendered.
//!
//! The protocol follows tev's documentation: little-endian messages over TCP, each preceded by its
//! length. One creates the picture, the others update rectangles of it.

use crate::failure::Failure;
use snell_render::FilmTile;
use snell_render::Settings;
use std::io::Write;
use std::net::TcpStream;
use std::sync::Mutex;
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

const CREATE: u8 = 4;
const UPDATE: u8 = 6;
const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];
/// The default port of tev.
const PORT: u16 = 14158;
/// Maximum number of queued tiles; if tev is slower, tiles are left out until they change again.
const WAITING: usize = 4096;
/// Time limit for a message.
const PATIENCE: Duration = Duration::from_secs(5);

/// A picture in tev.
pub struct Tev {
    sender: Mutex<Option<SyncSender<Vec<u8>>>>,
    thread: Option<JoinHandle<Result<(), std::io::Error>>>,
    name: String,
    address: String,
    /// Upper left corner of the rendered rectangle.
    corner: [u32; 2],
}

impl Tev {
    /// Connects, and creates the picture.
    pub fn open(url: &str, name: &str, settings: &Settings) -> Result<Self, Failure> {
        let wrong = || {
            Failure::Usage(format!(
                "--display {url}: expected tev://HOST:PORT, such as tev://127.0.0.1:{PORT}"
            ))
        };
        let place = url.strip_prefix("tev://").ok_or_else(wrong)?.trim_end_matches('/');
        if place.is_empty() {
            return Err(wrong());
        }
        if place
            .rsplit_once(':')
            .is_some_and(|(host, port)| host.is_empty() || port.parse::<u16>().is_err())
        {
            return Err(wrong());
        }
        let address =
            if place.contains(':') { place.to_string() } else { format!("{place}:{PORT}") };
        let failed = |e: std::io::Error| {
            Failure::Other(format!("--display {url}: {e}; check that tev is running there"))
        };
        let mut stream = TcpStream::connect(&address).map_err(failed)?;
        stream.set_write_timeout(Some(PATIENCE)).map_err(failed)?;
        let crop = settings.crop.unwrap_or(snell_render::Crop::full(settings.size));
        stream.write_all(&create(name, crop.size())).map_err(failed)?;
        let (sender, receiver) = sync_channel::<Vec<u8>>(WAITING);
        let thread = std::thread::spawn(move || {
            receiver.iter().try_for_each(|message| stream.write_all(&message))
        });
        let sender = Mutex::new(Some(sender));
        Ok(Self { sender, thread: Some(thread), name: name.into(), address, corner: crop.min })
    }

    /// Sends a tile, if tev keeps up.
    pub fn send(&self, tile: &FilmTile) {
        let message = update(&self.name, self.corner, tile);
        let mut sender = self.sender.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(channel) = &*sender
            && let Err(TrySendError::Disconnected(_)) = channel.try_send(message)
        {
            *sender = None;
        }
    }

    /// Sends the whole current picture, and waits until it has arrived. The render does not fail if
    /// the viewer was closed.
    pub fn finish(mut self, tiles: &[FilmTile]) {
        let sender = self.sender.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take();
        if let Some(sender) = sender {
            let _ = tiles
                .iter()
                .try_for_each(|tile| sender.send(update(&self.name, self.corner, tile)));
        }
        if let Some(Ok(Err(error))) = self.thread.take().map(JoinHandle::join) {
            eprintln!("warning: {}: {error}; the picture there is not complete", self.address);
        }
    }
}

/// A message: its length, including these four bytes, and its contents.
fn message(contents: &[u8]) -> Vec<u8> {
    let length = (contents.len() + 4) as u32;
    [&length.to_le_bytes(), contents].concat()
}

fn text(out: &mut Vec<u8>, text: &str) {
    out.extend(text.bytes().filter(|b| *b != 0));
    out.push(0);
}

fn numbers<const N: usize, T>(
    out: &mut Vec<u8>,
    numbers: impl IntoIterator<Item = T>,
    bytes: impl Fn(T) -> [u8; N],
) {
    numbers.into_iter().for_each(|n| out.extend(bytes(n)));
}

fn create(name: &str, size: [u32; 2]) -> Vec<u8> {
    let mut out = vec![CREATE, 1];
    text(&mut out, name);
    numbers(&mut out, [size[0], size[1], CHANNELS.len() as u32], u32::to_le_bytes);
    CHANNELS.iter().for_each(|channel| text(&mut out, channel));
    message(&out)
}

fn update(name: &str, corner: [u32; 2], tile: &FilmTile) -> Vec<u8> {
    let (min, size) = (tile.area.min, tile.area.size());
    let mut out = vec![UPDATE, 0];
    text(&mut out, name);
    numbers(&mut out, [CHANNELS.len() as u32], u32::to_le_bytes);
    CHANNELS.iter().for_each(|channel| text(&mut out, channel));
    numbers(&mut out, [min[0] - corner[0], min[1] - corner[1], size[0], size[1]], u32::to_le_bytes);
    let count = CHANNELS.len() as u64;
    numbers(&mut out, 0..count, u64::to_le_bytes);
    numbers(&mut out, CHANNELS.map(|_| count), u64::to_le_bytes);
    numbers(&mut out, tile.colors(), f32::to_le_bytes);
    message(&out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::net::TcpListener;

    #[test]
    fn a_listener_gets_the_whole_picture() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let url = format!("tev://{}", listener.local_addr().expect("it listens"));
        let heard = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            listener
                .accept()
                .map(|(mut stream, _)| stream.read_to_end(&mut bytes))
                .expect("a client")
                .expect("its bytes");
            bytes
        });
        let settings = Settings { size: [20, 18], ..Settings::default() };
        let tev = Tev::open(&url, "box", &settings).expect("a listener");
        let film = snell_render::Film::new(snell_render::Crop::full(settings.size), &[]);
        tev.send(&film.tiles[0]);
        tev.finish(&film.tiles);
        let bytes = heard.join().expect("no panic");
        // Every message has its declared length, and the last four cover the picture.
        let (mut at, mut kinds, mut pixels) = (0, Vec::new(), 0);
        while at < bytes.len() {
            let length =
                u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize;
            kinds.push(bytes[at + 4]);
            assert_eq!(&bytes[at + 6..at + 10], b"box\0");
            if bytes[at + 4] == UPDATE {
                let head = 4 + 2 + 4 + 4 + 8;
                let word = |i: usize| {
                    u32::from_le_bytes(
                        bytes[at + head + 4 * i..][..4].try_into().expect("four bytes"),
                    )
                };
                let [x, y, w, h] = [0, 1, 2, 3].map(word);
                assert!(x + w <= 20 && y + h <= 18, "{x} {y} {w} {h}");
                assert_eq!(length, head + 16 + 64 + (w * h * 16) as usize);
                pixels += w * h;
            }
            at += length;
        }
        assert_eq!(kinds, [4, 6, 6, 6, 6, 6]);
        assert_eq!(pixels, 20 * 18 + 16 * 16);
    }

    #[test]
    fn nobody_there_is_said() {
        let settings = Settings::default();
        for (url, what) in [
            ("tev://127.0.0.1:1", "running"),
            ("127.0.0.1:1", "tev://HOST:PORT"),
            ("tev://", "tev://HOST"),
        ] {
            let error =
                Tev::open(url, "x", &settings).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(error.contains(what), "{url}: {error}");
        }
    }
}
