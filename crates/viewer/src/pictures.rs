//! Pictures that were dropped on the page: environments and textures that edits name.

use snell_scene::{Image, Pixels};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum size of all pictures in memory, in bytes.
const MAX_BYTES: usize = 1 << 30;

/// The pictures of a session, by the name of their file.
#[derive(Debug, Default)]
pub struct Pictures {
    known: Mutex<BTreeMap<String, Arc<Image>>>,
}

impl Pictures {
    /// Keeps a picture, and returns its name here: that of its file, unless another picture has it.
    pub fn add(&self, file: &str, image: Image) -> Result<String, String> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let (stem, extension) = file.rsplit_once('.').unwrap_or((file, ""));
        let numbered = (2..).map(|n| format!("{stem}-{n}.{extension}"));
        let is_free = |name: &String| known.get(name).is_none_or(|there| **there == image);
        let name = std::iter::once(file.to_string()).chain(numbered).find(is_free);
        let name = name.ok_or("there is no free name")?;
        let all: usize = known.values().map(|image| bytes_of(image)).sum();
        if all + bytes_of(&image) > MAX_BYTES {
            return Err(format!(
                "{file}: the pictures of this session would take more than {} MB; restart the \
                    viewer to forget those that are not used",
                MAX_BYTES >> 20
            ));
        }
        known.entry(name.clone()).or_insert_with(|| Arc::new(image));
        Ok(name)
    }

    /// The picture of a name.
    pub fn get(&self, name: &str) -> Result<Arc<Image>, String> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.get(name).cloned().ok_or_else(|| format!("no picture {name} was dropped here"))
    }
}

fn bytes_of(image: &Image) -> usize {
    match &image.pixels {
        Pixels::U8(values) => values.len(),
        Pixels::U16(values) => 2 * values.len(),
        Pixels::F32(values) => 4 * values.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_picture_of_the_same_name_gets_a_name_of_its_own() {
        let pictures = Pictures::default();
        let image = |x: f32| Image::from_f32(1, 1, 1, vec![x]);
        assert_eq!(pictures.add("a.png", image(0.0)), Ok("a.png".into()));
        assert_eq!(pictures.add("a.png", image(0.0)), Ok("a.png".into()));
        assert_eq!(pictures.add("a.png", image(1.0)), Ok("a-2.png".into()));
        assert_eq!(pictures.get("a-2.png").map(|image| image.value(0, 0, 0)), Ok(1.0));
        assert!(pictures.get("b.png").is_err());
    }
}
