//! The layers that are asked for: which, and what names they have in the file.

use crate::failure::{Failure, choice};
use snell_formats::image::cryptomatte;
use snell_render::integrator::aov::AovKind;
use snell_render::integrator::light_part::{LightPart, LightSource};
use snell_render::{Aov, CompiledScene, Film, IntegratorKind, LightGroup};
use snell_scene::{LayeredImage, MaterialId, NodeId, Scene};
use std::collections::HashMap;

/// Most light groups.
const MAX_GROUPS: usize = 100;

/// The group of all light that is in no other.
const OTHER: &str = "other";

/// The AOVs of `--aov`, each once; with light groups, all light of each, and each part of the light by group.
pub fn aovs(
    names: &[String],
    integrator: IntegratorKind,
    groups: &[LightGroup],
    denoise: bool,
) -> Result<Vec<Aov>, Failure> {
    let mut asked = Vec::new();
    for name in names.iter().filter(|n| !n.is_empty()) {
        if name == "all" {
            asked.extend(Aov::ALL);
        } else {
            asked.push(choice("layer", name, &Aov::ALL, Aov::name)?);
        }
    }
    if asked.is_empty() && integrator == IntegratorKind::Aov {
        asked.push(Aov::Normal);
    }
    let mut parts: Vec<LightPart> = Vec::new();
    if !groups.is_empty() {
        parts.push(LightPart::default());
        parts.extend(asked.iter().filter_map(|a| if let Aov::Light(part) = a { Some(*part) } else { None }));
    }
    let of_group = |group| parts.iter().map(move |&part| Aov::Light(LightPart { group: Some(group), ..part }));
    asked.extend((0..=groups.len()).flat_map(|group| of_group(group as u8)));
    if denoise {
        asked.extend([Aov::Albedo, Aov::Normal]);
    }
    let mut aovs: Vec<Aov> = Vec::new();
    asked.into_iter().for_each(|aov| {
        if !aovs.contains(&aov) {
            aovs.push(aov)
        }
    });
    Ok(aovs)
}

/// The groups of `--light-group NAME=LIST`.
pub fn light_groups(definitions: &[String], scene: &Scene) -> Result<Vec<LightGroup>, Failure> {
    let mut groups: Vec<LightGroup> = Vec::new();
    for definition in definitions {
        let usage = |problem: &str| Failure::Usage(format!("--light-group {definition}: {problem}"));
        let Some((name, list)) = definition.split_once('=').filter(|(name, list)| !name.is_empty() && !list.is_empty())
        else {
            return Err(usage("write NAME=LIST, such as key=0,lamp"));
        };
        if name == OTHER || groups.iter().any(|g| g.name == name) {
            return Err(usage(&format!("there is another group named \"{name}\"; choose another name")));
        }
        let sources = list.split(',').map(|item| source(item.trim(), scene).map_err(|e| usage(&e)));
        groups.push(LightGroup { name: name.to_string(), sources: sources.collect::<Result<_, _>>()? });
    }
    if groups.len() > MAX_GROUPS {
        return Err(Failure::Usage(format!(
            "there are {} light groups; at most {MAX_GROUPS} are allowed",
            groups.len()
        )));
    }
    Ok(groups)
}

fn source(item: &str, scene: &Scene) -> Result<LightSource, String> {
    if item == "environment" {
        return Ok(LightSource::Environment);
    }
    if let Some(material) = scene.materials.iter().position(|m| m.name == item && m.is_emissive()) {
        return Ok(LightSource::Material(MaterialId(material as u32)));
    }
    let number = item.parse::<u32>().ok().filter(|&n| (n as usize) < scene.lights.len());
    number.map(LightSource::Light).ok_or_else(|| {
        let materials: Vec<_> = scene.materials.iter().filter(|m| m.is_emissive()).map(|m| m.name.as_str()).collect();
        let lights = match scene.lights.len() {
            0 => "no other lights".to_string(),
            n => format!("lights 0 to {}", n - 1),
        };
        format!(
            "there is no light \"{item}\"; there are {lights}, environment, and emissive materials: {}",
            materials.join(", ")
        )
    })
}

/// Gives the layers of light groups their names, `PART_GROUP`. Layers stand in the order of the AOVs, after the picture.
pub fn name_groups(picture: &mut LayeredImage, film: &Film, groups: &[LightGroup]) {
    let with_layer = film.aovs().iter().filter(|a| a.kind() != AovKind::Coverage);
    for (layer, aov) in picture.layers[1..].iter_mut().zip(with_layer) {
        if let Aov::Light(LightPart { group: Some(group), .. }) = aov {
            let name = groups.get(usize::from(*group)).map_or(OTHER, |g| &g.name);
            layer.name = format!("{}_{name}", aov.name());
        }
    }
}

/// Adds the layers and the metadata of Cryptomatte.
pub fn add_cryptomatte(picture: &mut LayeredImage, film: &Film, scene: &Scene, compiled: &CompiledScene) {
    for (aov, kind) in [(Aov::CryptoObject, "CryptoObject"), (Aov::CryptoMaterial, "CryptoMaterial")] {
        if !film.aovs().contains(&aov) {
            continue;
        }
        let (mut numbers, mut names, mut things) = (HashMap::new(), Vec::new(), Vec::new());
        for (keys, samples) in film.coverage(aov) {
            let shares = keys.iter().map(|&(key, count)| {
                let number = *numbers.entry(key).or_insert_with(|| {
                    names.push(thing_name(aov, key, scene, compiled));
                    names.len() - 1
                });
                (number, count as f32 / samples.max(1) as f32)
            });
            things.push(shares.collect::<Vec<_>>());
        }
        let matte = cryptomatte::encode(kind, &names, things.iter().map(Vec::as_slice));
        picture.layers.extend(matte.layers);
        picture.metadata.extend(matte.metadata);
    }
}

/// The name of what a key of [`Film::coverage`] stands for: of an object the names of its nodes below the root, joined by `/`.
fn thing_name(aov: Aov, key: u64, scene: &Scene, compiled: &CompiledScene) -> String {
    if aov == Aov::CryptoMaterial {
        let name = scene.materials.get(key as usize).map(|m| m.name.clone()).filter(|n| !n.is_empty());
        return name.unwrap_or_else(|| format!("material {key}"));
    }
    let hit = snell_intersect::Hit { instance: (key >> 32) as u32, geometry: key as u32, ..snell_intersect::Hit::MISS };
    let path: Vec<NodeId> = compiled.node_path(&hit);
    let named =
        |id: &NodeId| Some(scene.nodes[id.index()].name.as_str()).filter(|n| !n.is_empty() && *id != scene.root);
    let names: Vec<&str> = path.iter().filter_map(named).collect();
    if names.is_empty() { format!("object {}.{}", key >> 32, key as u32) } else { names.join("/") }
}
