//! Layers that users request by name: the AOVs that they need, the light groups, and the names of
//! the objects that cover pixels.

use crate::compile::CompiledScene;
use crate::film::Film;
use crate::integrator::IntegratorKind;
use crate::integrator::aov::{Aov, AovKind};
use crate::integrator::light_part::{LightPart, LightSource};
use crate::settings::LightGroup;
use snell_intersect::Hit;
use snell_scene::{LayeredImage, MaterialId, NodeId, Scene};
use std::collections::HashMap;

/// The largest number of light groups.
const MAX_GROUPS: usize = 100;

/// The name of the group of all emitters that are in no other group.
const OTHER: &str = "other";

/// The AOVs that the requested layers need, each once. Light groups need the light of each group as
/// a whole, and each requested part of the light by group. The integrator `aov` needs its first
/// layer, and a denoiser needs feature layers.
pub fn needed_aovs(
    asked: &[Aov],
    integrator: IntegratorKind,
    groups: &[LightGroup],
    denoise: bool,
) -> Vec<Aov> {
    let mut wanted = asked.to_vec();
    if wanted.is_empty() && integrator == IntegratorKind::Aov {
        wanted.push(Aov::Normal);
    }
    let mut parts: Vec<LightPart> = Vec::new();
    if !groups.is_empty() {
        parts.push(LightPart::default());
        parts.extend(
            wanted.iter().filter_map(|a| if let Aov::Light(part) = a { Some(*part) } else { None }),
        );
    }
    let of_group =
        |group| parts.iter().map(move |&part| Aov::Light(LightPart { group: Some(group), ..part }));
    wanted.extend((0..=groups.len()).flat_map(|group| of_group(group as u8)));
    if denoise {
        wanted.extend([Aov::Albedo, Aov::Normal]);
    }
    let mut aovs: Vec<Aov> = Vec::new();
    wanted.into_iter().for_each(|aov| {
        if !aovs.contains(&aov) {
            aovs.push(aov)
        }
    });
    aovs
}

/// Adds a light group. Each light is named by its number, by the name of an emissive material, or
/// as `environment`.
pub fn add_light_group(
    groups: &mut Vec<LightGroup>,
    name: &str,
    lights: &[String],
    scene: &Scene,
) -> Result<(), String> {
    if name == OTHER || groups.iter().any(|g| g.name == name) {
        return Err(format!("there is another group named \"{name}\"; choose another name"));
    }
    if groups.len() == MAX_GROUPS {
        return Err(format!(
            "there are more than {MAX_GROUPS} light groups; at most {MAX_GROUPS} are allowed"
        ));
    }
    let sources = lights.iter().map(|light| source(light, scene)).collect::<Result<_, _>>()?;
    groups.push(LightGroup { name: name.to_string(), sources });
    Ok(())
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
        let materials: Vec<_> =
            scene.materials.iter().filter(|m| m.is_emissive()).map(|m| m.name.as_str()).collect();
        let lights = match scene.lights.len() {
            0 => String::new(),
            1 => "light 0, ".into(),
            n => format!("lights 0 to {}, ", n - 1),
        };
        let materials = match materials.len() {
            0 => String::new(),
            _ => format!(", and emissive materials: {}", materials.join(", ")),
        };
        format!("there is no light \"{item}\"; there is {lights}environment{materials}")
    })
}

/// Gives the layers of light groups their names, `PART_GROUP`. After the picture, layers must stand
/// in the order of the film's AOVs.
pub fn name_groups(picture: &mut LayeredImage, film: &Film, groups: &[LightGroup]) {
    let with_layer = film.aovs().iter().filter(|a| a.kind() != AovKind::Coverage);
    for (layer, aov) in picture.layers[1..].iter_mut().zip(with_layer) {
        if let Aov::Light(LightPart { group: Some(group), .. }) = aov {
            let name = groups.get(usize::from(*group)).map_or(OTHER, |g| &g.name);
            layer.name = format!("{}_{name}", aov.name());
        }
    }
}

/// The objects or materials that cover the pixels of a picture.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    /// The names of the objects or materials.
    pub names: Vec<String>,
    /// For each pixel, row by row: indices into `names`, each with the fraction of the pixel that
    /// is covered.
    pub shares: Vec<Vec<(usize, f32)>>,
}

impl Coverage {
    /// The coverage of a film for an AOV of kind [`AovKind::Coverage`]; `None` if the film does not
    /// have the AOV.
    pub fn of(film: &Film, aov: Aov, scene: &Scene, compiled: &CompiledScene) -> Option<Self> {
        if !film.aovs().contains(&aov) {
            return None;
        }
        let (mut numbers, mut coverage) = (HashMap::new(), Self::default());
        for (keys, samples) in film.coverage(aov) {
            let shares = keys.iter().map(|&(key, count)| {
                let number = *numbers.entry(key).or_insert_with(|| {
                    coverage.names.push(thing_name(aov, key, scene, compiled));
                    coverage.names.len() - 1
                });
                (number, count as f32 / samples.max(1) as f32)
            });
            coverage.shares.push(shares.collect());
        }
        Some(coverage)
    }
}

/// The name that belongs to a key of [`Film::coverage`]. For an object it consists of the names of
/// its nodes below the root, joined by `/`.
fn thing_name(aov: Aov, key: u64, scene: &Scene, compiled: &CompiledScene) -> String {
    if aov == Aov::CryptoMaterial {
        let name =
            scene.materials.get(key as usize).map(|m| m.name.clone()).filter(|n| !n.is_empty());
        return name.unwrap_or_else(|| format!("material {key}"));
    }
    let hit = Hit { instance: (key >> 32) as u32, geometry: key as u32, ..Hit::MISS };
    let path: Vec<NodeId> = compiled.node_path(&hit);
    let named = |id: &NodeId| {
        Some(scene.nodes[id.index()].name.as_str()).filter(|n| !n.is_empty() && *id != scene.root)
    };
    let names: Vec<&str> = path.iter().filter_map(named).collect();
    if names.is_empty() { format!("object {}.{}", key >> 32, key as u32) } else { names.join("/") }
}
