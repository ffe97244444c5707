//! The viewer without a server: one page, one thread, the same messages.
//!
//! The page passes its messages to [`Alone::receive`] and its requests to [`Alone::ask`], calls
//! [`Alone::step`] in a loop, and takes what there is to say by [`Alone::take`].

mod answer;

pub use answer::Answer;

use crate::Source;
use crate::explain::Question;
use crate::pick;
use crate::protocol::{PartHeader, ToPage, ToServer};
use crate::session::{Frame, Session, lock};
use crate::worker::Worker;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::{self, error::TryRecvError};
use tokio::sync::watch;

/// Something for the page, in the form of the messages of the WebSocket.
#[derive(Debug)]
pub enum Message {
    /// JSON.
    Text(String),
    /// A frame as one part.
    Frame(Vec<u8>),
}

/// A view of a scene by one page.
pub struct Alone {
    session: &'static Session,
    worker: Worker<'static>,
    client: u32,
    events: broadcast::Receiver<ToPage>,
    frames: watch::Receiver<Option<Arc<Frame>>>,
    /// Answers to this page alone.
    answers: Vec<ToPage>,
}

impl Alone {
    /// Opens the first scene of `source`. The view lasts as long as the program: its memory is
    /// never freed. The error is a message for the user.
    pub fn new(
        source: Box<dyn Source>,
        is_gallery: bool,
        frames_per_second: f64,
    ) -> Result<Self, String> {
        let session: &'static Session = Box::leak(Box::new(Session::new(source, is_gallery)?));
        let (events, frames) = (session.events.subscribe(), session.frames.subscribe());
        let (client, answers) = session.join();
        let worker = Worker::alone(session, frames_per_second);
        Ok(Self { session, worker, client, events, frames, answers })
    }

    /// Handles a message of the page.
    pub fn receive(&mut self, text: &str) {
        let message = match serde_json::from_str::<ToServer>(text) {
            Ok(message) => message,
            Err(error) => return self.refuse(format!("not understood: {error}")),
        };
        match message {
            ToServer::Ack { frame } => self.session.pace.show(frame),
            ToServer::Pick { id, pixel, reach } => {
                let compiled = lock(&self.session.compiled).clone().map(|(_, compiled)| compiled);
                let hit = compiled
                    .and_then(|compiled| pick::near(&self.session.now(), &compiled, pixel, reach));
                self.answers.push(ToPage::Picked { id, hit });
            }
            ToServer::Select { id, path, width, surface } => {
                let (place, mask, material) = self.session.select(&path, width, surface);
                self.answers.push(ToPage::Selected { id, place, mask, material });
            }
            ToServer::Explain { id, pixel, sample, all } => {
                let report = self.session.explain(&Question { pixel, sample }, all);
                let report = report.map_err(|message| self.refuse(message)).ok().map(Box::new);
                self.answers.push(ToPage::Explained { id, report });
            }
            other => {
                if let Err(message) = self.session.handle(self.client, other) {
                    self.refuse(message);
                }
            }
        }
    }

    fn refuse(&mut self, message: String) {
        self.answers.push(ToPage::Error { message });
    }

    /// Answers a request, whose `query` is a JSON object of texts: `save` with
    /// `{"format": "png"}`.
    pub fn ask(&mut self, request: &str, query: &str, body: Vec<u8>) -> Answer {
        answer::answer(self.session, self.client, request, query, body)
    }

    /// Renders for about as long as `slice`; returns how long nothing is to be done, `None` if that
    /// is until the next message.
    pub fn step(&mut self, slice: Duration) -> Option<Duration> {
        self.worker.turn(slice)
    }

    /// What there is to say since the last call, in order.
    pub fn take(&mut self) -> Vec<Message> {
        let mut all = std::mem::take(&mut self.answers);
        loop {
            match self.events.try_recv() {
                Ok(event) => all.push(event),
                // More was said at once than is kept.
                Err(TryRecvError::Lagged(_)) => all.extend(self.session.all()),
                Err(TryRecvError::Empty | TryRecvError::Closed) => break,
            }
        }
        let texts = all.iter().filter_map(|message| serde_json::to_string(message).ok());
        let mut messages: Vec<_> = texts.map(Message::Text).collect();
        if self.frames.has_changed().unwrap_or(false) {
            let newest = self.frames.borrow_and_update().clone();
            messages.extend(newest.map(|frame| Message::Frame(whole(&frame))));
        }
        messages
    }
}

/// A frame as one part.
fn whole(frame: &Frame) -> Vec<u8> {
    let total = frame.bytes.len() as u32;
    let head = PartHeader { frame: frame.number, offset: 0, total };
    [&head.to_bytes()[..], &frame.bytes[..]].concat()
}
