//! `--denoise`: removes the picture's noise.

use crate::failure::Failure;
use crate::interrupt;
use snell_oidn::Denoiser;
use snell_render::Denoise;
use snell_scene::LayeredImage;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Interval between checks for a signal during denoising.
const LOOK: Duration = Duration::from_millis(50);

/// Loads Open Image Denoise.
pub fn load(wish: &Denoise) -> Result<Denoiser, Failure> {
    let path = match wish {
        Denoise::Found => None,
        Denoise::At(path) => Some(path.as_path()),
    };
    Denoiser::load(path).map_err(|e| Failure::Other(e.to_string()))
}

/// The result of denoising.
pub enum Denoised {
    Done,
    /// A signal came during denoising; the picture is unchanged.
    Interrupted,
}

/// Denoises the colours of the picture, see [`Denoiser::denoise_picture`]. The library cannot be
/// stopped, so it works on a copy, which is abandoned when a signal comes.
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
                return Err(Failure::Other("Open Image Denoise failed".into()));
            }
        }
    }
}
