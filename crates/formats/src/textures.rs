//! Images that scene files name; each is read once.

use crate::Input;
use crate::image::read_image;
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
    /// The image that `input` names. If it is missing or broken, or may not be opened, there is a
    /// warning, and a magenta checkerboard that is easily seen stands in for it.
    pub fn image(&mut self, scene: &mut Scene, input: &Input, name: &str) -> ImageId {
        let path = input.resolve(name).unwrap_or_else(|_| input.directory.join(name));
        if let Some(&id) = self.images.get(&path) {
            return id;
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
        id
    }

    /// A repeating texture of the image that `input` names, for formats whose `v` points up:
    /// coordinates (0, 0) are the lower left corner of the image.
    pub fn texture(
        &mut self,
        scene: &mut Scene,
        input: &Input,
        name: &str,
        encoding: Encoding,
    ) -> ImageTexture {
        let mut texture = ImageTexture::new(self.image(scene, input, name), encoding);
        texture.uv_transform = [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]];
        texture
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
        let first = textures.image(&mut scene, &input(), "no such file.png");
        let second = textures.image(&mut scene, &input(), "no such file.png");
        assert_eq!((first, scene.images.len(), scene.warnings.len()), (second, 1, 1));
        assert_eq!(*scene.images[0], missing_texture_image());
    }

    #[test]
    fn a_confined_scene_shows_a_checkerboard_for_an_image_outside_of_its_folder() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("a.ppm"), "P3 1 1 255 9 9 9\n").expect("writable");
        let inside = folder.path().join("scene");
        std::fs::create_dir_all(&inside).expect("writable");
        for (confine, is_drawn) in [(false, true), (true, false)] {
            let options = ReadOptions { confine, ..ReadOptions::default() };
            let input = Input::from_bytes("a.obj", Vec::new(), &inside, &options);
            let mut scene = Scene::new("");
            Textures::default().image(&mut scene, &input, "../a.ppm");
            assert_eq!(*scene.images[0] != missing_texture_image(), is_drawn);
            let said = scene.warnings.first().map_or("", |warning| &warning.message);
            assert_eq!(said.contains("lies outside of the scene's folder"), !is_drawn, "{said}");
        }
    }
}
