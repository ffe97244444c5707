//! Converts a film to the final picture.

use crate::compile::CompiledScene;
use crate::film::Film;
use crate::integrator::IntegratorKind;
use crate::settings::Settings;
use snell_scene::{Background, LayeredImage};

/// The linear picture of a film, with its layers. The alpha channel is kept only with a transparent
/// background.
pub fn picture(film: &Film, settings: &Settings, compiled: &CompiledScene) -> LayeredImage {
    let mut picture = film.image();
    if settings.integrator == IntegratorKind::Aov
        && let (Some(&aov), true) = (film.aovs().first(), picture.layers.len() > 1)
    {
        let channels = picture.layers[1].channels.len();
        let previews: Vec<_> = picture.layers[1]
            .values
            .chunks(channels)
            .map(|v| aov.preview(v, compiled.radius))
            .collect();
        for (pixel, color) in picture.layers[0].values.chunks_mut(4).zip(previews) {
            // Colours in the picture are premultiplied by alpha.
            let premultiplied = color * pixel[3];
            pixel[..3].copy_from_slice(&premultiplied.to_array());
        }
    }
    if compiled.background != Background::Transparent {
        let main = &mut picture.layers[0];
        main.channels.truncate(3);
        let pixels = main.values.len() / 4;
        // Alpha is removed in place, because pictures are large.
        (0..pixels).for_each(|i| main.values.copy_within(4 * i..4 * i + 3, 3 * i));
        main.values.truncate(3 * pixels);
        main.values.shrink_to_fit();
    }
    picture
}
