//! `--preview`: the picture so far, as a file that is written again and again.

use super::options::{DisplayEncoding, Options};
use snell_formats::atomic;
use snell_formats::error::one_line;
use snell_formats::image::{self, Display, Tonemap, WriteOptions};
use snell_persist::{Pace, Saved};
use snell_render::{IntegratorKind, Job, Underway};
use snell_scene::Scene;
use std::path::Path;
use std::time::Duration;

/// The file that shows the picture so far.
pub struct Preview<'a> {
    path: &'a Path,
    writing: WriteOptions,
    pace: Pace,
    has_failed: bool,
}

impl<'a> Preview<'a> {
    /// The time between two pictures.
    const INTERVAL: Duration = Duration::from_secs(10);

    /// The preview that the options ask for, if they ask for one.
    pub fn new(options: &'a Options, scene: &Scene, tonemap: Tonemap) -> Option<Self> {
        let display = display(options, scene, tonemap, options.request.integrator);
        let writing = WriteOptions { display, ..WriteOptions::default() };
        let path = options.preview.as_deref()?;
        Some(Self { path, writing, pace: Pace::new(Self::INTERVAL), has_failed: false })
    }
}

impl Saved for Preview<'_> {
    fn is_due(&self) -> bool {
        self.pace.is_due()
    }

    fn save(&mut self, underway: &Underway, job: &Job) -> Option<String> {
        let Self { path, writing, pace, has_failed } = self;
        let written = pace.save(|| {
            let picture = snell_render::picture(&underway.film, job.settings(), job.scene());
            let encoded = image::encode_image(path, &picture, writing);
            encoded.and_then(|bytes| atomic::write(path, &bytes))
        });
        let error = written.err().filter(|_| !std::mem::replace(has_failed, true))?;
        Some(format!("--preview: {}", one_line(&error.to_string())))
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
