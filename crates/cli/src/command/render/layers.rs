//! The requested layers and their names in the file.

use crate::failure::{Failure, choice};
use snell_formats::image::cryptomatte;
use snell_render::layers::Coverage;
use snell_render::{Aov, CompiledScene, Film};
use snell_scene::{LayeredImage, Scene};

/// The AOVs of `--aov`.
pub fn aovs(names: &[String]) -> Result<Vec<Aov>, Failure> {
    let mut asked = Vec::new();
    if !names.is_empty() && names.iter().all(|n| n.trim().is_empty()) {
        return Err(Failure::Usage(
            "--aov: expected names of layers, such as depth,normal, or `all`".into(),
        ));
    }
    for name in names.iter().map(|n| n.trim()).filter(|n| !n.is_empty()) {
        if name == "all" {
            asked.extend(Aov::ALL);
        } else {
            asked.push(choice("layer", name, &Aov::ALL, Aov::name)?);
        }
    }
    Ok(asked)
}

/// Parses `--light-group NAME=LIST`: the names of the groups, and their lists.
pub fn light_groups(definitions: &[String]) -> Result<Vec<(String, Vec<String>)>, Failure> {
    let group = |definition: &String| {
        let parts = definition.split_once('=');
        let parts = parts.filter(|(name, list)| !name.is_empty() && !list.is_empty());
        let (name, list) = parts.ok_or_else(|| {
            let problem = "write NAME=LIST, such as key=0,lamp";
            Failure::Usage(format!("--light-group {definition}: {problem}"))
        })?;
        Ok((name.to_string(), list.split(',').map(|item| item.trim().to_string()).collect()))
    };
    definitions.iter().map(group).collect()
}

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
