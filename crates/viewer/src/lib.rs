//! `snell view`: a local server that shows a scene and its live picture in the browser.
//!
//! [`serve`] binds a port, prints nothing, and returns a handle. The page (`web/`, built into the
//! binary) communicates with the server over one WebSocket: see [`protocol`]. The picture at rest
//! equals the one of `snell render` with the same settings, bit for bit.
//!
//! [`Alone`] is the same without a server, a thread or a socket, for a page that has the renderer
//! in it.

#![cfg_attr(
    test,
    expect(clippy::disallowed_methods, reason = "tests compare with the standard library")
)]
#![forbid(unsafe_code)]
// Without the server, some parts of it are left over.
#![cfg_attr(not(feature = "server"), allow(dead_code))]

mod alone;
mod animation;
mod budget;
mod command;
mod compare;
#[cfg(feature = "server")]
mod connections;
mod cost;
mod denoise;
mod describe;
mod dropped;
mod edges;
mod edits;
mod encode;
pub mod explain;
mod face;
mod forms;
#[cfg(feature = "server")]
mod gallery;
mod halves;
mod history;
mod learned;
mod light;
mod memory;
mod opening;
mod pace;
#[cfg(feature = "server")]
mod page;
#[cfg(feature = "server")]
mod peer;
mod pick;
mod pictures;
mod plain;
mod preview;
pub mod protocol;
mod rest;
#[cfg(feature = "server")]
mod routes;
#[cfg(feature = "server")]
mod security;
mod selection;
#[cfg(feature = "server")]
mod server;
mod session;
mod size;
#[cfg(feature = "server")]
mod socket;
mod state;
mod subject;
mod surfaces;
mod swatch;
mod temporal;
#[cfg(feature = "server")]
mod upload;
mod viewpoint;
mod words;
mod worker;
mod writer;

pub use alone::{Alone, Answer, Message};
pub use animation::{Animated, Prepare};
pub use dropped::{Dropped, read_dropped};
pub use plain::{Builtins, opened};
#[cfg(feature = "server")]
pub use server::{Server, ServerOptions, serve};
pub use writer::{Finished, PlainWriter, Writer};

use snell_formats::image::Display;
use snell_render::{Request, Settings};
use snell_scene::{Camera, Scene};
use std::sync::Arc;

/// Makes a camera for a picture of this size in pixels.
pub type CameraForSize = Arc<dyn Fn([u32; 2]) -> Option<Camera> + Send + Sync>;

/// A scene that is ready to be viewed.
pub struct Opened {
    /// The scene, with a camera and light.
    pub scene: Scene,
    /// The initial camera.
    pub camera: Camera,
    /// Number of the initial camera among the scene's cameras.
    pub camera_number: usize,
    /// The camera that `snell render` makes for a picture of another size, in pixels; `None` if the
    /// camera is the file's.
    pub camera_for_size: Option<CameraForSize>,
    /// The settings that the user asked for.
    pub request: Request,
    /// The settings of the picture at rest, which follow from `request`.
    pub settings: Settings,
    /// The display settings of a picture of light.
    pub display: Display,
    /// True if the user asked for display values with or without the curve of sRGB. Otherwise
    /// layers are shown without.
    pub is_encoding_given: bool,
    /// Writes the picture at rest as a file.
    pub writer: Arc<dyn Writer>,
    /// Prepares the scene for its motion, if it has any.
    pub animate: Option<Arc<Prepare>>,
    /// The words of a command that renders the same picture, without size, samples, integrator,
    /// camera and changes of the scene.
    pub command: Vec<String>,
}

/// A scene to be opened.
#[derive(Clone, Debug)]
pub enum Which {
    /// The scene named when the viewer was started, read again.
    Given,
    /// A built-in scene.
    Builtin(String),
    /// Files that were dropped on the page, for [`read_dropped`].
    Dropped(Vec<Dropped>),
}

/// A source of scenes.
pub trait Source: Send + Sync {
    /// Opens a scene; the error is a message for the user.
    fn open(&self, which: Which) -> Result<Opened, String>;
}

/// The element of this name. The error is a message for the user.
fn by_name<T: Copy>(
    what: &str,
    all: &[T],
    name_of: impl Fn(T) -> &'static str,
    name: &str,
) -> Result<T, String> {
    let known = all.iter().copied().find(|&x| name_of(x) == name);
    known.ok_or_else(|| {
        format!("there is no {what} {:?}", name.chars().take(80).collect::<String>())
    })
}
