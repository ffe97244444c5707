//! Finds names in a file that no declaration has. The tables of the file refuse unknown names;
//! inside cameras, lights, materials, textures, media and shapes, which the scene graph declares,
//! unknown names are warnings.

use serde::{Deserialize, Deserializer};
use serde_json::Value;
use snell_intersect::AnyShape;
use snell_math::parameters::{Kind, Value as Parameters};
use snell_scene::material::Material;
use snell_scene::texture::{ImageTexture, Pattern};
use snell_scene::written::unknown_names;
use snell_scene::{Camera, Light, Medium};
use std::marker::PhantomData;

/// The unknown names in a declared value; the value itself is not kept.
struct Unknown<T>(Vec<String>, PhantomData<T>);

/// The kind of declared value that a JSON value stands for.
trait Declared {
    fn kind(written: &Value) -> Kind;
}

impl<T: Parameters> Declared for T {
    fn kind(_: &Value) -> Kind {
        T::KIND
    }
}

/// A texture, which is an image texture or a pattern.
struct AnyTexture;

impl Declared for AnyTexture {
    fn kind(written: &Value) -> Kind {
        if written.get("pattern").is_some() { Pattern::KIND } else { ImageTexture::KIND }
    }
}

impl<'de, T: Declared> Deserialize<'de> for Unknown<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let written = Value::deserialize(deserializer)?;
        Ok(Self(unknown_names(T::kind(&written), &written), PhantomData))
    }
}

/// The tables of declared values. The rest of the file is skipped.
#[derive(Default, Deserialize)]
#[serde(default, bound = "")]
struct Tables {
    cameras: Vec<Unknown<Camera>>,
    lights: Vec<Unknown<Light>>,
    materials: Vec<Unknown<Material>>,
    textures: Vec<Unknown<AnyTexture>>,
    media: Vec<Unknown<Medium>>,
    nodes: Vec<Node>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Node {
    surfaces: Vec<Surface>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Surface {
    shape: Option<Unknown<AnyShape>>,
}

/// Warnings of a file that has been read: each names the place and what is ignored there.
pub fn warnings(bytes: &[u8]) -> Vec<String> {
    let tables: Tables = serde_json::from_slice(bytes).unwrap_or_default();
    let mut warnings = Vec::new();
    let mut note = |place: &str, names: &[String]| {
        warnings.extend(names.iter().map(|name| format!("{place}: {name}; it is ignored")));
    };
    note_table("cameras", &tables.cameras, &mut note);
    note_table("lights", &tables.lights, &mut note);
    note_table("materials", &tables.materials, &mut note);
    note_table("textures", &tables.textures, &mut note);
    note_table("media", &tables.media, &mut note);
    for (i, node) in tables.nodes.iter().enumerate() {
        for (j, surface) in node.surfaces.iter().enumerate() {
            if let Some(Unknown(names, _)) = &surface.shape {
                note(&format!("/nodes/{i}/surfaces/{j}/shape"), names);
            }
        }
    }
    warnings
}

fn note_table<T>(table: &str, things: &[Unknown<T>], note: &mut dyn FnMut(&str, &[String])) {
    for (i, Unknown(names, _)) in things.iter().enumerate() {
        note(&format!("/{table}/{i}"), names);
    }
}
