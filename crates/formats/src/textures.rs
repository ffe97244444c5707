//! Images that scene files name; each is read once.

use crate::image::read_image;
use crate::{Input, ReadError};
use snell_scene::graph::ImageId;
use snell_scene::texture::missing_texture_image;
use snell_scene::{Encoding, ImageTexture, Scene, WarningKind};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// The images read for one scene, by path.
#[derive(Clone, Debug, Default)]
pub struct Textures {
    images: BTreeMap<PathBuf, ImageId>,
}

impl Textures {
    /// The image that `input` names. A missing or broken one becomes a warning and a magenta
    /// checkerboard that is easily seen; one outside of the scene's folder is an error (see
    /// [`Input::resolve`]).
    pub fn image(
        &mut self,
        scene: &mut Scene,
        input: &Input,
        name: &str,
    ) -> Result<ImageId, ReadError> {
        let path = input.resolve(name)?;
        if let Some(&id) = self.images.get(&path) {
            return Ok(id);
        }
        let read = input.open_relative(name).and_then(|file| read_image(&file));
        let image = read.unwrap_or_else(|error| {
            scene.warn_of(
                WarningKind::Missing,
                format!("{error}; a magenta checkerboard stands in for this texture"),
            );
            missing_texture_image()
        });
        let id = scene.add_image(Arc::new(image));
        self.images.insert(path, id);
        Ok(id)
    }

    /// A repeating texture of the image that `input` names, for formats whose `v` points up:
    /// coordinates (0, 0) are the lower left corner of the image.
    pub fn texture(
        &mut self,
        scene: &mut Scene,
        input: &Input,
        name: &str,
        encoding: Encoding,
    ) -> Result<ImageTexture, ReadError> {
        let mut texture = ImageTexture::new(self.image(scene, input, name)?, encoding);
        texture.uv_transform = [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]];
        Ok(texture)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadOptions;

    fn input() -> Input {
        Input::from_bytes("a.obj", Vec::new(), &std::env::temp_dir(), &ReadOptions::default())
    }

    #[test]
    fn a_missing_image_is_a_warning_and_a_checkerboard_made_once() {
        let (mut scene, mut textures) = (Scene::new(""), Textures::default());
        let first = textures
            .image(&mut scene, &input(), "no such file.png")
            .expect("a missing file is not an error");
        let second = textures
            .image(&mut scene, &input(), "no such file.png")
            .expect("a missing file is not an error");
        assert_eq!((first, scene.images.len(), scene.warnings.len()), (second, 1, 1));
        assert_eq!(*scene.images[0], missing_texture_image());
    }

    #[test]
    fn an_image_outside_of_the_folder_is_an_error() {
        let error = Textures::default()
            .image(&mut Scene::new(""), &input(), "../secret.png")
            .expect_err("outside");
        assert!(error.to_string().contains("--allow-outside"), "{error}");
    }
}
