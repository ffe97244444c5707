//! `--denoise`: the picture without its noise.

use crate::failure::Failure;
use crate::interrupt;
use snell_oidn::Denoiser;
use snell_scene::LayeredImage;
use std::ffi::OsStr;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How often a signal is looked for meanwhile.
const LOOK: Duration = Duration::from_millis(50);

/// Finds Open Image Denoise. `named` is empty for wherever the system finds it.
pub fn load(named: &OsStr) -> Result<Denoiser, Failure> {
    let path = Some(Path::new(named)).filter(|_| !named.is_empty());
    Denoiser::load(path).map_err(|e| Failure::Other(e.to_string()))
}

/// Whether the noise is gone.
pub enum Denoised {
    Done,
    /// A signal came meanwhile; the picture is as it was.
    Interrupted,
}

/// Replaces the colours of the picture, see [`Denoiser::denoise_picture`]. The library cannot be
/// stopped, so it works on a copy that is left to it when a signal comes.
pub fn apply(
    denoiser: &Arc<Denoiser>,
    picture: &mut LayeredImage,
    threads: usize,
) -> Result<Denoised, Failure> {
    let is_used = |name: &str| matches!(name, "albedo" | "normal");
    let used =
        picture.layers.iter().enumerate().filter(|(i, layer)| *i == 0 || is_used(&layer.name));
    let layers: Vec<_> = used.map(|(_, layer)| layer.clone()).collect();
    let own_layers = layers.len();
    let mut copy = LayeredImage { layers, metadata: Vec::new(), ..*picture };
    let (denoiser, known) = (denoiser.clone(), interrupt::requests());
    interrupt::save_first();
    let (sender, done) = channel();
    std::thread::spawn(move || {
        let result = denoiser.denoise_picture(&mut copy, threads).map(|()| copy);
        let _ = sender.send(result);
    });
    loop {
        match done.recv_timeout(LOOK) {
            Ok(Ok(mut clean)) => {
                picture.layers.extend(clean.layers.split_off(own_layers));
                picture.layers[0] = clean.layers.swap_remove(0);
                return Ok(Denoised::Done);
            }
            Ok(Err(error)) => return Err(Failure::Other(error.to_string())),
            Err(RecvTimeoutError::Timeout) if interrupt::requests() == known => {}
            Err(RecvTimeoutError::Timeout) => return Ok(Denoised::Interrupted),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Failure::Other("Open Image Denoise gave up".into()));
            }
        }
    }
}
