//! Small pictures of textures, for the panel.

use snell_formats::image::{WriteOptions, encode_image_as};
use snell_math::{Vec2, Vec3};
use snell_render::CompiledScene;
use snell_scene::texture::surface_at;
use snell_scene::{Encoding, Layer, LayeredImage, Pixels, Scene, Texture, TextureId};

/// Width and height in pixels.
const SIZE: u32 = 64;

/// A small picture of a texture, as PNG. Pictures of data, such as roughness, look as their file.
pub fn png(scene: &Scene, compiled: &CompiledScene, number: u32) -> Result<Vec<u8>, String> {
    let texture = scene.textures.get(number as usize);
    let texture = texture.ok_or_else(|| format!("there is no texture {number}"))?;
    let color = |x: u32, y: u32| -> [f32; 3] {
        let [r, g, b, _] = match texture {
            Texture::Image(texture) => match scene.images.get(texture.image.index()) {
                Some(image) => {
                    let at = |i: u32, side: u32| {
                        (u64::from(2 * i + 1) * u64::from(side) / u64::from(2 * SIZE)) as u32
                    };
                    // Values of whole numbers are shown as the file looks, whatever they mean.
                    let encoding = match image.pixels {
                        Pixels::F32(_) => Encoding::Linear,
                        _ => Encoding::Srgb,
                    };
                    image.rgba_as(at(x, image.width), at(y, image.height), encoding)
                }
                None => [1.0, 0.0, 1.0, 1.0],
            },
            Texture::Pattern(_) => {
                let uv = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / SIZE as f32;
                let position = Vec3::new(uv.x, 1.0 - uv.y, 0.0) * 2.0 * compiled.radius;
                let surface = surface_at(position, Vec3::Z, uv);
                compiled.textures.lookup(TextureId(number), &surface, 1.0 / SIZE as f32)
            }
        };
        [r, g, b]
    };
    let places = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
    let layer = Layer {
        name: String::new(),
        channels: ["R", "G", "B"].map(String::from).to_vec(),
        values: places.flat_map(|(x, y)| color(x, y)).collect(),
    };
    let image = LayeredImage { width: SIZE, height: SIZE, layers: vec![layer], metadata: vec![] };
    encode_image_as("png", &image, &WriteOptions::default()).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_scene::{Image, ImageTexture};
    use std::sync::Arc;

    #[test]
    fn a_texture_has_a_small_picture_and_a_missing_one_is_an_error() {
        let mut scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        let image = scene.add_image(Arc::new(Image::from_f32(2, 1, 1, vec![0.0, 1.0])));
        scene.add_texture(ImageTexture::new(image, Encoding::Srgb));
        let compiled = CompiledScene::new(&scene, &Default::default()).expect("valid");
        let png = super::png(&scene, &compiled, 0).expect("a picture");
        assert_eq!(&png[1..4], b"PNG");
        assert!(super::png(&scene, &compiled, 1).is_err());
    }
}
