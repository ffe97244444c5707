//! Pictures at rest as files.

use snell_formats::image::{Display, WriteOptions, encode_image_as};
use snell_persist::Checkpoint;
use snell_render::{CompiledScene, Film, Settings, Statistics};
use snell_scene::{LayeredImage, Scene};
use std::sync::Arc;

/// A picture at rest with all that made it.
pub struct Finished {
    /// The scene.
    pub scene: Arc<Scene>,
    /// The compiled scene.
    pub compiled: Arc<CompiledScene>,
    /// The settings of the render.
    pub settings: Settings,
    /// The samples so far.
    pub film: Film,
    /// Statistics of these samples.
    pub statistics: Statistics,
    /// True if all samples were taken.
    pub is_whole: bool,
}

impl Finished {
    /// The layers of the picture.
    pub fn picture(&self) -> LayeredImage {
        snell_render::picture(&self.film, &self.settings, &self.compiled)
    }
}

/// Writes pictures as files.
pub trait Writer: Send + Sync {
    /// The file of a picture that the command of these words makes, in a format named by its file
    /// extension. `display` is how the page shows it. The error is a message for the user.
    fn write(
        &self,
        picture: &Finished,
        command: &[String],
        display: Display,
        format: &str,
    ) -> Result<Vec<u8>, String>;

    /// The file that keeps the picture at rest that this command renders, so that a later view or
    /// `snell render` goes on with it; `None` if none is kept. The error is a message for the user.
    fn checkpoint(
        &self,
        command: &[String],
        settings: &Settings,
    ) -> Option<Result<Checkpoint, String>> {
        let _ = (command, settings);
        None
    }
}

/// Writes pictures with the default options and without metadata.
pub struct PlainWriter;

impl Writer for PlainWriter {
    fn write(
        &self,
        picture: &Finished,
        _: &[String],
        display: Display,
        format: &str,
    ) -> Result<Vec<u8>, String> {
        let options = WriteOptions { display, ..WriteOptions::default() };
        encode_image_as(format, &picture.picture(), &options).map_err(|e| e.to_string())
    }
}
