//! Small pictures of scenes, for the gallery.

use crate::Opened;
use crate::denoise::denoise;
use snell_formats::image::{Display, WriteOptions, encode_image_as};
use snell_math::Rgb;
use snell_render::{Aov, CompiledScene, Job, Settings, picture};

/// Width and height in pixels.
const SIZE: [u32; 2] = [288, 180];
/// Samples per pixel; the remaining noise is filtered out.
const SPP: u32 = 16;

/// A picture of a scene as its camera sees it. The error is a message for the user.
pub fn png(opened: &Opened) -> Result<Vec<u8>, String> {
    let settings = Settings {
        size: SIZE,
        crop: None,
        spp: SPP,
        noise: None,
        guiding: None,
        aovs: vec![Aov::Albedo, Aov::Normal, Aov::Depth, Aov::MaterialId],
        ..opened.settings.clone()
    };
    let compiled = CompiledScene::new(&opened.scene, &settings.build).map_err(|e| e.to_string())?;
    let job = Job::new(&compiled, &opened.camera, &settings);
    let (film, _) = job.run(rayon::current_num_threads(), &|_| true);
    let mut image = picture(&film, &settings, &compiled);
    let stride = image.layers[0].channels.len();
    let mut rgb: Vec<f32> =
        image.layers[0].values.chunks(stride).flat_map(|p| [p[0], p[1], p[2]]).collect();
    denoise(&image, &compiled.materials, Rgb::BLACK, &mut rgb);
    image.layers.truncate(1);
    for (pixel, smooth) in image.layers[0].values.chunks_mut(stride).zip(rgb.chunks(3)) {
        pixel[..3].copy_from_slice(smooth);
    }
    let display: Display = opened.display;
    encode_image_as("png", &image, &WriteOptions { display, ..WriteOptions::default() })
        .map_err(|e| e.to_string())
}
