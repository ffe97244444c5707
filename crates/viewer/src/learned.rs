//! Denoises pictures at rest by Open Image Denoise, if it is installed, on a thread of its own: it
//! takes longer than a moving picture may take, and cannot be stopped.

use crate::session::lock;
use crate::surfaces::{Color, Surfaces};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex};
#[cfg(feature = "server")]
use {
    rayon::prelude::*,
    snell_oidn::{Denoiser, Noisy},
    std::panic::{AssertUnwindSafe, catch_unwind},
    std::sync::mpsc::{Receiver, sync_channel},
    std::thread::Scope,
};

/// A picture to be denoised.
pub struct Raw {
    /// The version of the state that it shows.
    pub version: u64,
    /// The mean number of samples.
    pub samples: f32,
    /// Linear RGB values.
    pub rgb: Vec<f32>,
    /// What its pixels see.
    pub surfaces: Arc<Surfaces>,
}

/// A denoised picture.
#[derive(Clone)]
pub struct Clean {
    /// The version of the state that it shows.
    pub version: u64,
    /// The mean number of samples from which it was made.
    pub samples: f32,
    /// Linear colours.
    pub colors: Arc<Vec<Color>>,
}

/// Denoises one picture at a time. Its thread ends when the value is dropped.
pub struct Learned {
    /// `None` if there is no such thread: then every picture is refused.
    pictures: Option<SyncSender<Raw>>,
    newest: Arc<Mutex<Option<Clean>>>,
}

impl Learned {
    /// No library and no thread.
    pub fn none() -> Self {
        Self { pictures: None, newest: Arc::default() }
    }

    /// Loads the library when the first picture comes; `threads` is the number of its threads.
    #[cfg(feature = "server")]
    pub fn new<'scope>(scope: &'scope Scope<'scope, '_>, threads: usize) -> Self {
        let (pictures, incoming) = sync_channel(0);
        let newest = Arc::new(Mutex::new(None));
        let slot = newest.clone();
        scope.spawn(move || {
            // A fault in the library ends this thread; then there is the viewer's own filter.
            let _ = catch_unwind(AssertUnwindSafe(|| work(&incoming, &slot, threads)));
        });
        Self { pictures: Some(pictures), newest }
    }

    /// Begins to denoise a picture; false if the thread is busy, or there is no library.
    pub fn begin(&self, raw: Raw) -> bool {
        self.pictures.as_ref().is_some_and(|pictures| pictures.try_send(raw).is_ok())
    }

    /// The newest denoised picture of a version.
    pub fn newest(&self, version: u64) -> Option<Clean> {
        lock(&self.newest).clone().filter(|clean| clean.version == version)
    }
}

#[cfg(feature = "server")]
fn work(incoming: &Receiver<Raw>, newest: &Mutex<Option<Clean>>, threads: usize) {
    let mut denoiser = None;
    for Raw { version, samples, rgb, surfaces } in incoming {
        if denoiser.is_none() {
            denoiser = Denoiser::load(None).ok();
        }
        // Later pictures are refused.
        let Some(denoiser) = &denoiser else { return };
        let color: Vec<f32> = rgb.iter().map(|v| if *v > 0.0 { *v } else { 0.0 }).collect();
        let plane = |value: &(dyn Fn(usize) -> Color + Sync)| -> Vec<f32> {
            (0..surfaces.count()).into_par_iter().flat_map_iter(value).collect()
        };
        let albedo = plane(&|i| surfaces.points[i].albedo.map(|c| c.clamp(0.0, 1.0)));
        let normal = plane(&|i| surfaces.points[i].normal.to_array());
        let [width, height] = surfaces.size;
        let noisy = Noisy { width, height, color: &color, albedo: &albedo, normal: &normal };
        if let Ok(clean) = denoiser.denoise(&noisy, threads) {
            let colors = Arc::new(clean.as_chunks::<3>().0.to_vec());
            *lock(newest) = Some(Clean { version, samples, colors });
        }
    }
}
