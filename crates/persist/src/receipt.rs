//! The receipt of a picture: all that is needed to render parts of it again and to compare bits.
//!
//! A picture carries its receipt in its metadata. It does not depend on the machines, threads and
//! runs that made the picture.

use crate::Problem;
use base64::Engine;
use base64::prelude::BASE64_STANDARD_NO_PAD as BASE64;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use snell_render::{Film, FilmTile};
use snell_scene::LayeredImage;

/// Bytes of a tile's hash.
const HASH_BYTES: usize = 8;

/// The option of the time of a picture.
const AT: &str = "--at";

/// The option of the frames of an animation.
const FRAMES: &str = "--frames";

/// The receipt of a picture.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Receipt {
    /// The version of Snell.
    pub version: String,
    /// The name of the scene's file without its folder, or of the built-in scene.
    pub scene: String,
    /// The hash of the scene: see [`Receipt::hash_of_files`].
    pub scene_sha256: String,
    /// The options of `snell render` that change the picture, in alphabetical order.
    pub arguments: Vec<String>,
    /// The number of the picture among those of a turntable, from 0.
    pub picture: u32,
    /// The least and the largest number of samples of a pixel.
    pub samples: [u32; 2],
    /// A hash of each tile, from the top left, row by row: eight bytes in base64.
    pub tiles: String,
}

impl Receipt {
    /// The name of the receipt in the metadata of a picture.
    pub const KEY: &str = "Receipt";

    /// The receipt of a picture of this version of Snell, before its tiles are known. `arguments`
    /// are the options of `snell render` that change the picture.
    pub fn new(scene: String, scene_sha256: String, arguments: Vec<String>) -> Self {
        let version = env!("CARGO_PKG_VERSION").into();
        Self { version, scene, scene_sha256, ..Self::default() }.with_arguments(arguments)
    }

    /// The hash of a scene's files: the SHA-256 of the list of their names, relative to the scene's
    /// folder, and the SHA-256 of their contents. The name of the scene's own file is empty, so
    /// that it may have any.
    pub fn hash_of_files<'a>(files: impl IntoIterator<Item = (String, &'a [u8; 32])>) -> String {
        let line = |(name, hash): (String, &[u8; 32])| format!("{} {name}\n", hex(hash));
        let mut lines: Vec<String> = files.into_iter().map(line).collect();
        lines.sort();
        sha256(lines.concat().as_bytes())
    }

    /// The hash of a scene of one file with this content.
    pub fn hash_of_file(content: &[u8]) -> String {
        Self::hash_of_files([(String::new(), &Sha256::digest(content).into())])
    }

    /// The receipt with this argument in the place of those of the same option.
    pub fn with_argument(&self, argument: String) -> Self {
        let mut arguments = self.arguments.clone();
        arguments.retain(|known| name_of(known) != name_of(&argument));
        arguments.push(argument);
        self.clone().with_arguments(arguments)
    }

    /// The receipt of one frame of an animation: that of the picture at its time.
    pub fn of_frame(&self, time: f64) -> Self {
        let mut receipt = self.with_argument(format!("{AT}={time}"));
        receipt.arguments.retain(|argument| name_of(argument) != FRAMES);
        receipt
    }

    /// True if this option is among the arguments.
    pub fn has(&self, option: &str) -> bool {
        self.arguments.iter().any(|argument| name_of(argument) == option)
    }

    fn with_arguments(self, mut arguments: Vec<String>) -> Self {
        arguments.sort_by(|a, b| name_of(a).cmp(name_of(b)));
        Self { arguments, ..self }
    }

    /// The time that the picture shows, if it is given.
    pub fn time(&self) -> Option<f64> {
        let given = self.arguments.iter().find(|argument| name_of(argument) == AT);
        given?.split_once('=')?.1.parse().ok()
    }

    /// This receipt with the hashes of a film's tiles.
    pub fn of_film(&self, film: &Film) -> Self {
        let hashes: Vec<[u8; HASH_BYTES]> = film.tiles.par_iter().map(tile_hash).collect();
        let samples = [film.least_samples(), film.most_samples()];
        Self { samples, tiles: BASE64.encode(hashes.as_flattened()), ..self.clone() }
    }

    /// True if this is a receipt of the same picture, whatever samples and tiles both have.
    pub fn is_of_same_picture(&self, other: &Self) -> bool {
        let bare = |of: &Self| Self { samples: [0; 2], tiles: String::new(), ..of.clone() };
        bare(self) == bare(other)
    }

    /// The receipt as the text in a picture's metadata.
    pub fn text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Reads the text of a receipt.
    ///
    /// # Errors
    /// If it is none.
    pub fn parse(text: &str) -> Result<Self, Problem> {
        serde_json::from_str(text)
            .map_err(|error| Problem::Other(format!("the receipt cannot be read: {error}")))
    }

    /// The hashes of the tiles.
    pub fn hashes(&self) -> Option<Vec<[u8; HASH_BYTES]>> {
        let bytes = BASE64.decode(&self.tiles).ok()?;
        let (hashes, []) = bytes.as_chunks::<HASH_BYTES>() else { return None };
        Some(hashes.to_vec())
    }
}

/// The name of the option of an argument.
fn name_of(argument: &str) -> &str {
    argument.split('=').next().unwrap_or_default()
}

/// The hash of a tile: the first bytes of the SHA-256 of its values, in 32-bit floats.
pub fn tile_hash(tile: &FilmTile) -> [u8; HASH_BYTES] {
    let mut hasher = Sha256::new();
    for value in tile.values() {
        hasher.update(value.to_le_bytes());
    }
    let mut first = [0; HASH_BYTES];
    first.copy_from_slice(&hasher.finalize()[..HASH_BYTES]);
    first
}

/// The SHA-256 of the values of the first layer of a picture (rows from the top, channels
/// interleaved) as little-endian 32-bit floats.
pub fn image_sha256(picture: &LayeredImage) -> String {
    let mut hasher = Sha256::new();
    for value in picture.layers.first().iter().flat_map(|layer| &layer.values) {
        hasher.update(value.to_le_bytes());
    }
    hex(&hasher.finalize())
}

/// The SHA-256 of bytes, in hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_receipt_outlives_its_text_and_a_frame_has_its_time() {
        let arguments = ["--spp=4", "--frames=0..1@2", "--define=b=1", "--define=a=2"];
        let receipt = Receipt::new("a.obj".into(), "0".into(), arguments.map(String::from).into());
        // The order of the same option's values counts.
        assert_eq!(receipt.arguments[..2], ["--define=b=1", "--define=a=2"]);
        let frame = receipt.of_frame(0.5);
        assert_eq!(frame.time(), Some(0.5));
        assert!(!frame.text().contains("--frames"));
        assert_eq!(Receipt::parse(&frame.text()).expect("it is a receipt"), frame);
        assert!(Receipt::parse("{}").is_err());
    }

    #[test]
    fn the_name_of_a_scenes_file_does_not_count_but_those_of_others_do() {
        let [a, b] = [[1; 32], [2; 32]];
        let hash =
            |name: &str| Receipt::hash_of_files([(name.to_string(), &a), (String::new(), &b)]);
        assert_eq!(
            hash("a.mtl"),
            Receipt::hash_of_files([(String::new(), &b), ("a.mtl".into(), &a)])
        );
        assert_ne!(hash("a.mtl"), hash("b.mtl"));
    }
}
