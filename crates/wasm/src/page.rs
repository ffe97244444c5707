//! The view that a page drives.

use serde::Deserialize;
use snell_viewer::{Alone, Answer, Builtins, Message};
use std::collections::VecDeque;
use std::path::Path;
use std::time::Duration;

/// Where the files are stored that the user opens, in the file system that the page makes.
const FILES: &str = "/tmp";

/// How a page begins.
#[derive(Deserialize)]
pub struct Opening {
    /// The name of the built-in scene that is shown first.
    pub scene: String,
    /// Whether the page offers scenes to begin with.
    pub is_gallery: bool,
    /// The wanted number of moving pictures per second.
    pub frames_per_second: f64,
}

/// Something that the page takes, with its bytes.
#[derive(Debug, PartialEq)]
pub enum Said {
    /// A message in JSON.
    Text(Vec<u8>),
    /// A frame.
    Frame(Vec<u8>),
}

/// A view, and what it has to say to its page.
pub struct Page {
    view: Alone,
    waiting: VecDeque<Message>,
}

impl Page {
    /// Opens a scene. `opening` is an [`Opening`] in JSON. The error is a message for the user.
    pub fn new(opening: &str) -> Result<Self, String> {
        let opening: Opening = serde_json::from_str(opening)
            .map_err(|error| format!("the page did not say how to begin: {error}"))?;
        if cfg!(target_family = "wasm") {
            // WASI knows no folder for temporary files. It fails only if one is set already.
            let _ = tempfile::env::override_temp_dir(Path::new(FILES));
        }
        let first = &*Box::leak(opening.scene.into_boxed_str());
        let source = Box::new(Builtins { first });
        let view = Alone::new(source, opening.is_gallery, opening.frames_per_second)?;
        Ok(Self { view, waiting: VecDeque::new() })
    }

    /// Handles a message of the page.
    pub fn receive(&mut self, text: &str) {
        self.view.receive(text);
    }

    /// Answers a request such as `save`, with its parameters as a JSON object of texts.
    pub fn ask(&mut self, request: &str, query: &str, body: Vec<u8>) -> Answer {
        self.view.ask(request, query, body)
    }

    /// Renders for about so many milliseconds. Returns for how many nothing is to be done; a
    /// negative number if that is until the next message.
    pub fn step(&mut self, milliseconds: f64) -> f64 {
        let slice = Duration::try_from_secs_f64(milliseconds / 1000.0).unwrap_or_default();
        self.view.step(slice).map_or(-1.0, |wait| wait.as_secs_f64() * 1000.0)
    }

    /// What is said next, if anything is.
    pub fn take(&mut self) -> Option<Said> {
        if self.waiting.is_empty() {
            self.waiting.extend(self.view.take());
        }
        Some(match self.waiting.pop_front()? {
            Message::Text(text) => Said::Text(text.into_bytes()),
            Message::Frame(bytes) => Said::Frame(bytes),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPENING: &str = r#"{"scene":"spheres","is_gallery":false,"frames_per_second":30}"#;

    #[test]
    fn a_view_greets_its_page_and_shows_a_picture() {
        let mut page = Page::new(OPENING).expect("built in");
        page.receive(r#"{"type":"size","size":[24,16]}"#);
        page.receive(r#"{"type":"render","spp":2}"#);
        let (mut texts, mut frames) = (0, 0);
        loop {
            let wait = page.step(5.0);
            while let Some(said) = page.take() {
                match said {
                    Said::Text(_) => texts += 1,
                    Said::Frame(bytes) => {
                        frames += 1;
                        let number = u32::from_le_bytes(bytes[..4].try_into().expect("a header"));
                        page.receive(&format!("{{\"type\":\"ack\",\"frame\":{number}}}"));
                    }
                }
            }
            if wait < 0.0 {
                break;
            }
            std::thread::sleep(Duration::from_secs_f64(wait / 1000.0));
        }
        assert!(texts > 2 && frames > 0, "{texts} messages, {frames} frames");
        let saved = page.ask("save", r#"{"format":"png"}"#, Vec::new());
        assert_eq!((saved.status, &saved.bytes[..4]), (200, &b"\x89PNG"[..]));
    }

    #[test]
    fn a_page_that_begins_wrongly_is_told_why() {
        let said = |opening: &str| Page::new(opening).err().unwrap_or_default();
        assert!(said("{").contains("did not say how to begin"));
        let unknown = OPENING.replace("spheres", "no-such-scene");
        assert!(said(&unknown).contains("no-such-scene"));
    }
}
