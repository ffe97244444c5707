//! Pictures with layers.

use crate::{DenoiseError, Denoiser, Noisy};
use snell_scene::{Layer, LayeredImage};

impl Denoiser {
    /// Denoises the colours of a picture; the original colours become the layer `noisy`. The layers
    /// `albedo` and `normal` are the auxiliary images.
    pub fn denoise_picture(
        &self,
        picture: &mut LayeredImage,
        threads: usize,
    ) -> Result<(), DenoiseError> {
        let stride = picture.layers[0].channels.len();
        let color: Vec<f32> = picture.layers[0]
            .values
            .chunks(stride)
            .flat_map(|p| [p[0], p[1], p[2]])
            .map(|v| v.max(0.0))
            .collect();
        let guide = |name: &str| {
            let layer = picture.layer(name).filter(|l| l.channels.len() == 3);
            layer.map_or_else(|| vec![0.0; color.len()], |l| l.values.clone())
        };
        let (albedo, normal) = (guide("albedo"), guide("normal"));
        let albedo: Vec<f32> = albedo.into_iter().map(|v| v.clamp(0.0, 1.0)).collect();
        let (width, height) = (picture.width as usize, picture.height as usize);
        let clean = self.denoise(
            &Noisy { width, height, color: &color, albedo: &albedo, normal: &normal },
            threads,
        )?;
        for (pixel, clean) in picture.layers[0].values.chunks_mut(stride).zip(clean.chunks(3)) {
            pixel[..3].copy_from_slice(clean);
        }
        let channels = ["R", "G", "B"].map(String::from).to_vec();
        picture.layers.push(Layer { name: "noisy".into(), channels, values: color });
        Ok(())
    }
}
