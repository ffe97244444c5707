//! `--denoise`: the picture without its noise.

use crate::failure::Failure;
use snell_oidn::{Denoiser, Noisy};
use snell_scene::{Layer, LayeredImage};
use std::path::Path;

/// Finds Open Image Denoise. `named` is empty for wherever the system finds it.
pub fn load(named: &str) -> Result<Denoiser, Failure> {
    let path = Some(Path::new(named)).filter(|_| !named.is_empty());
    Denoiser::load(path).map_err(|e| Failure::Other(e.to_string()))
}

/// Replaces the colours of the picture; what they were becomes the layer `noisy`. The layers `albedo` and `normal` guide.
pub fn apply(denoiser: &Denoiser, picture: &mut LayeredImage, threads: usize) -> Result<(), Failure> {
    let stride = picture.layers[0].channels.len();
    let color: Vec<f32> =
        picture.layers[0].values.chunks(stride).flat_map(|p| [p[0], p[1], p[2]]).map(|v| v.max(0.0)).collect();
    let guide = |name: &str| {
        let layer = picture.layer(name).filter(|l| l.channels.len() == 3);
        layer.map_or_else(|| vec![0.0; color.len()], |l| l.values.clone())
    };
    let (albedo, normal) = (guide("albedo"), guide("normal"));
    let albedo: Vec<f32> = albedo.into_iter().map(|v| v.clamp(0.0, 1.0)).collect();
    let (width, height) = (picture.width as usize, picture.height as usize);
    let noisy = Noisy { width, height, color: &color, albedo: &albedo, normal: &normal };
    let clean = denoiser.denoise(&noisy, threads).map_err(|e| Failure::Other(e.to_string()))?;
    for (pixel, clean) in picture.layers[0].values.chunks_mut(stride).zip(clean.chunks(3)) {
        pixel[..3].copy_from_slice(clean);
    }
    let channels = ["R", "G", "B"].map(String::from).to_vec();
    picture.layers.push(Layer { name: "noisy".into(), channels, values: color });
    Ok(())
}
