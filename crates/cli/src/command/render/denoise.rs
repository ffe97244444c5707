//! `--denoise`: the picture without its noise.

use crate::failure::Failure;
use snell_oidn::Denoiser;
use snell_scene::LayeredImage;
use std::path::Path;

/// Finds Open Image Denoise. `named` is empty for wherever the system finds it.
pub fn load(named: &str) -> Result<Denoiser, Failure> {
    let path = Some(Path::new(named)).filter(|_| !named.is_empty());
    Denoiser::load(path).map_err(|e| Failure::Other(e.to_string()))
}

/// Replaces the colours of the picture, see [`Denoiser::denoise_picture`].
pub fn apply(denoiser: &Denoiser, picture: &mut LayeredImage, threads: usize) -> Result<(), Failure> {
    denoiser.denoise_picture(picture, threads).map_err(|e| Failure::Other(e.to_string()))
}
