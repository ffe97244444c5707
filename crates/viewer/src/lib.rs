//! `snell view`: a local server that shows a scene and its live picture in the browser.
//!
//! [`serve`] binds a port, prints nothing, and returns a handle. The page (`web/`, built into the
//! binary) communicates with the server over one WebSocket: see [`protocol`]. The picture at rest
//! equals the one of `snell render` with the same settings, bit for bit.

#![forbid(unsafe_code)]

mod budget;
mod connections;
mod cost;
mod denoise;
mod describe;
mod encode;
pub mod explain;
mod forms;
mod memory;
mod pace;
mod page;
mod peer;
mod pick;
mod preview;
pub mod protocol;
mod routes;
mod security;
mod server;
mod session;
mod size;
mod socket;
mod state;
mod temporal;
mod thumbnail;
mod upload;
mod worker;

pub use server::{Server, ServerOptions, serve};

use snell_formats::image::Display;
use snell_formats::input::CONFINED;
use snell_formats::{ReadOptions, read_scene_bytes};
use snell_render::{Request, Settings};
use snell_scene::{Camera, Scene};
use std::path::Path;

/// A scene that is ready to be viewed.
pub struct Opened {
    /// The scene, with a camera and light.
    pub scene: Scene,
    /// The initial camera.
    pub camera: Camera,
    /// Number of the initial camera among the scene's cameras.
    pub camera_number: usize,
    /// True if the camera was made to frame the whole scene at this aspect ratio. At another aspect
    /// ratio, `snell render` makes another camera.
    pub is_camera_made: bool,
    /// The settings that the user asked for.
    pub request: Request,
    /// The settings of the picture at rest, which follow from `request`.
    pub settings: Settings,
    /// The display settings.
    pub display: Display,
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
    /// A file that was dropped on the page.
    Dropped {
        /// The name of the file.
        name: String,
        /// The contents of the file.
        bytes: Vec<u8>,
    },
}

/// A source of scenes.
pub trait Source: Send + Sync {
    /// Opens a scene; the error is a message for the user.
    fn open(&self, which: Which) -> Result<Opened, String>;
}

/// Reads a file that was dropped on the page. The file cannot name other files, whatever the
/// options allow, because its sender may not be the user who set them.
pub fn read_dropped(name: &str, bytes: Vec<u8>, options: &ReadOptions) -> Result<Scene, String> {
    // A folder that cannot exist, because its parent is not a folder.
    let nowhere = Path::new(if cfg!(windows) { "NUL\\dropped" } else { "/dev/null/dropped" });
    let confined = ReadOptions { confine: true, ..options.clone() };
    let told = |message: String| message.replace(CONFINED, DROPPED);
    let mut scene = read_scene_bytes(name, bytes, nowhere, &confined)
        .map_err(|error| told(error.to_string()))?;
    for warning in &mut scene.warnings {
        warning.message = told(std::mem::take(&mut warning.message));
    }
    Ok(scene)
}

/// The remedy for a dropped file that names others.
const DROPPED: &str = "a dropped file can name no others: open it with `snell view FILE`";

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_file_names_no_other_file_whatever_is_allowed() {
        let options = ReadOptions::default();
        for name in ["/etc/passwd", "../../../../../../etc/passwd", "passwd", "./a/../../passwd"] {
            for (file, text) in [
                ("a.obj", format!("mtllib {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")),
                (
                    "b.pbrt",
                    format!(
                        "WorldBegin\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \
                            \"{name}\"\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n"
                    ),
                ),
                ("a.pbrt", format!("WorldBegin\nInclude \"{name}\"\n")),
                (
                    "a.xml",
                    format!("<scene version=\"3.0.0\"><include filename=\"{name}\"/></scene>"),
                ),
            ] {
                let read = read_dropped(file, text.into_bytes(), &options);
                let said = match &read {
                    Ok(scene) => scene
                        .warnings
                        .iter()
                        .map(|w| w.message.clone())
                        .collect::<Vec<_>>()
                        .join("\n"),
                    Err(message) => message.clone(),
                };
                // Such a file is not opened, and the error does not reveal whether it could be.
                assert!(
                    said.contains("passwd") && !said.contains("root:"),
                    "{file} {name}: {said}"
                );
                assert!(!said.contains("--confine"), "{file} {name}: {said}");
            }
        }
    }
}
