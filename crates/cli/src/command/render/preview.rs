//! `--preview`: the picture so far, as a file that is written again and again.

use super::options::{DisplayEncoding, Options};
use snell_formats::atomic;
use snell_formats::error::one_line;
use snell_formats::image::{self, Display, Tonemap, WriteOptions};
use snell_render::{Film, IntegratorKind, Job};
use snell_scene::Scene;
use std::path::Path;
use std::time::Duration;

/// The file that shows the picture so far.
pub struct Preview<'a> {
    path: &'a Path,
    writing: WriteOptions,
    is_quiet: bool,
    has_failed: bool,
}

impl<'a> Preview<'a> {
    /// The time between two pictures.
    pub const INTERVAL: Duration = Duration::from_secs(10);

    /// The preview that the options ask for, if they ask for one.
    pub fn new(options: &'a Options, scene: &Scene, tonemap: Tonemap) -> Option<Self> {
        let display = display(options, scene, tonemap, options.request.integrator);
        let writing = WriteOptions { display, ..WriteOptions::default() };
        let path = options.preview.as_deref()?;
        Some(Self { path, writing, is_quiet: options.quiet, has_failed: false })
    }

    /// Writes the picture. A failure is told once, and rendering goes on.
    pub fn write(&mut self, film: &Film, job: &Job) {
        let picture = snell_render::picture(film, job.settings(), job.scene());
        let encoded = image::encode_image(self.path, &picture, &self.writing);
        let written = encoded.and_then(|bytes| atomic::write(self.path, &bytes));
        if let Err(error) = written
            && !std::mem::replace(&mut self.has_failed, true)
            && !self.is_quiet
        {
            eprintln!("warning: --preview: {}", one_line(&error.to_string()));
        }
    }
}

/// How a picture is shown in formats of display values.
pub fn display(
    options: &Options,
    scene: &Scene,
    tonemap: Tonemap,
    integrator: Option<IntegratorKind>,
) -> Display {
    let srgb = match options.encoding() {
        Some(encoding) => encoding == DisplayEncoding::Srgb,
        None => !scene.settings.raw_display && integrator != Some(IntegratorKind::Aov),
    };
    Display { exposure: options.exposure(scene), tonemap, srgb }
}
