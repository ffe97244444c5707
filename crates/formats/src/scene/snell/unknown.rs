//! Names in a file that no declaration has. The tables of the file refuse them; inside of what the
//! scene graph declares (cameras, lights, materials, textures, media, shapes) they are warnings.

use serde::Deserialize;
use serde_json::Value;
use snell_intersect::AnyShape;
use snell_math::parameters::{Kind, Value as Parameters};
use snell_scene::material::Material;
use snell_scene::texture::{ImageTexture, Pattern};
use snell_scene::written::unknown_names;
use snell_scene::{Camera, Light, Medium};

/// The tables of declared things. The rest of the file is skipped.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Tables {
    cameras: Vec<Value>,
    lights: Vec<Value>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    media: Vec<Value>,
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
    shape: Option<Value>,
}

/// Warnings of a file that has been read: each names the place and what is ignored there.
pub fn warnings(bytes: &[u8]) -> Vec<String> {
    let tables: Tables = serde_json::from_slice(bytes).unwrap_or_default();
    let mut warnings = Vec::new();
    let mut look = |place: String, kind: Kind, value: &Value| {
        let unknown = unknown_names(kind, value).into_iter();
        warnings.extend(unknown.map(|problem| format!("{place}: {problem}; it is ignored")));
    };
    let textures = |value: &Value| match value.get("pattern") {
        Some(_) => Pattern::KIND,
        None => ImageTexture::KIND,
    };
    let list = [
        ("cameras", &tables.cameras, &(|_: &Value| Camera::KIND) as &dyn Fn(&Value) -> Kind),
        ("lights", &tables.lights, &|_| Light::KIND),
        ("materials", &tables.materials, &|_| Material::KIND),
        ("textures", &tables.textures, &textures),
        ("media", &tables.media, &|_| Medium::KIND),
    ];
    for (table, values, kind) in list {
        for (i, value) in values.iter().enumerate() {
            look(format!("/{table}/{i}"), kind(value), value);
        }
    }
    for (i, node) in tables.nodes.iter().enumerate() {
        for (j, surface) in node.surfaces.iter().enumerate() {
            if let Some(shape) = &surface.shape {
                look(format!("/nodes/{i}/surfaces/{j}/shape"), AnyShape::KIND, shape);
            }
        }
    }
    warnings
}
