//! The layers that are asked for: which, and what names they have in the file.

use crate::failure::{Failure, choice};
use snell_formats::image::cryptomatte;
use snell_render::layers::{Coverage, add_light_group};
use snell_render::{Aov, CompiledScene, Film, LightGroup};
use snell_scene::{LayeredImage, Scene};

/// The AOVs of `--aov`.
pub fn aovs(names: &[String]) -> Result<Vec<Aov>, Failure> {
    let mut asked = Vec::new();
    if !names.is_empty() && names.iter().all(|n| n.trim().is_empty()) {
        return Err(Failure::Usage("--aov: expected names of layers, such as depth,normal, or `all`".into()));
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

/// The groups of `--light-group NAME=LIST`.
pub fn light_groups(definitions: &[String], scene: &Scene) -> Result<Vec<LightGroup>, Failure> {
    let mut groups: Vec<LightGroup> = Vec::new();
    for definition in definitions {
        let usage = |problem: String| Failure::Usage(format!("--light-group {definition}: {problem}"));
        let Some((name, list)) = definition.split_once('=').filter(|(name, list)| !name.is_empty() && !list.is_empty())
        else {
            return Err(usage("write NAME=LIST, such as key=0,lamp".into()));
        };
        let lights: Vec<String> = list.split(',').map(|item| item.trim().to_string()).collect();
        add_light_group(&mut groups, name, &lights, scene).map_err(usage)?;
    }
    Ok(groups)
}

/// Adds the layers and the metadata of Cryptomatte.
pub fn add_cryptomatte(picture: &mut LayeredImage, film: &Film, scene: &Scene, compiled: &CompiledScene) {
    for (aov, kind) in [(Aov::CryptoObject, "CryptoObject"), (Aov::CryptoMaterial, "CryptoMaterial")] {
        if let Some(coverage) = Coverage::of(film, aov, scene, compiled) {
            let matte = cryptomatte::encode(kind, &coverage.names, coverage.shares.iter().map(Vec::as_slice));
            picture.layers.extend(matte.layers);
            picture.metadata.extend(matte.metadata);
        }
    }
}
