//! The requested layers and their names in the file.

use snell_formats::image::cryptomatte;
use snell_render::layers::Coverage;
use snell_render::{Aov, CompiledScene, Film};
use snell_scene::{LayeredImage, Scene};

/// Adds the layers and the metadata of Cryptomatte.
pub fn add_cryptomatte(
    picture: &mut LayeredImage,
    film: &Film,
    scene: &Scene,
    compiled: &CompiledScene,
) {
    for (aov, kind) in
        [(Aov::CryptoObject, "CryptoObject"), (Aov::CryptoMaterial, "CryptoMaterial")]
    {
        if let Some(coverage) = Coverage::of(film, aov, scene, compiled) {
            let matte = cryptomatte::encode(
                kind,
                &coverage.names,
                coverage.shares.iter().map(Vec::as_slice),
            );
            picture.layers.extend(matte.layers);
            picture.metadata.extend(matte.metadata);
        }
    }
}
