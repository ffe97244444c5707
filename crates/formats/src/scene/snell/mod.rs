//! Snell's own scene files: the complete scene graph in JSON, without loss.
//!
//! The declarations of the scene graph are the format: materials, lights, cameras, textures and
//! shapes are serialised by `serde`, so every declared field is read and written. Meshes and images
//! are tables of their own here, because several nodes may share one; their numbers are lists or,
//! if they are long, base64 ([`numbers`]).

mod complete;
mod document;
mod motion;
mod numbers;
#[cfg(test)]
mod tests;
mod unknown;

use crate::write::{Output, SceneWriter};
use crate::{Input, Place, ReadError, SceneReader};
use document::Document;
use serde::Serialize;
use serde_json::Value;
use snell_scene::Scene;

/// The reader of Snell's scene files.
pub const READER: SceneReader = SceneReader {
    name: "snell",
    description: "Snell's own scene files: all of a scene, without loss, as JSON",
    extensions: &["snell"],
    recognises,
    read,
};

/// The writer of Snell's scene files.
pub const WRITER: SceneWriter =
    SceneWriter { name: READER.name, extensions: READER.extensions, knows: |_| true, write };

/// The value of `format` in every file.
const FORMAT: &str = "snell scene";

/// The version that is written, and the latest that can be read.
const VERSION: u32 = 1;

/// True for a JSON object that has the format's name near its start.
fn recognises(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(256)];
    let has = |key: &[u8]| start.windows(key.len()).any(|part| part == key);
    start.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{')
        && has(b"\"format\"")
        && has(b"\"snell scene\"")
}

fn read(input: &Input) -> Result<Scene, ReadError> {
    let document = document(&input.bytes).map_err(|error| {
        let message = error.to_string();
        let problem = message.split(" at line ").next().unwrap_or(&message).to_string();
        let remedy = "see the page on Snell's scene files for what belongs there";
        input.error(Place::Column(error.line().max(1), error.column().max(1)), problem, remedy)
    })?;
    if document.format != FORMAT {
        let problem = format!("format is {:?}, expected {FORMAT:?}", document.format);
        return Err(input.error(Place::Json("/format".into()), problem, "give another file"));
    }
    if document.version == 0 || document.version > VERSION {
        let problem =
            format!("version is {}, and this program reads 1 to {VERSION}", document.version);
        return Err(input.error(Place::Json("/version".into()), problem, "use a newer Snell"));
    }
    let mut scene = document.scene(input).map_err(|(place, problem)| {
        input.error(Place::Json(place), problem, "write the scene again, or correct the file")
    })?;
    for warning in unknown::warnings(&input.bytes) {
        scene.warn(format!("{}: {warning}", input.name));
    }
    Ok(scene)
}

/// The document of a file. If it leaves out what has no default, these fields are added.
fn document(bytes: &[u8]) -> Result<Document, serde_json::Error> {
    let error = match serde_json::from_slice(bytes) {
        Ok(document) => return Ok(document),
        Err(error) => error,
    };
    if !error.to_string().contains("missing field") {
        return Err(error);
    }
    let mut tree: Value = serde_json::from_slice(bytes)?;
    complete::complete(&mut tree);
    // What is wrong in the completed document is the fault, unless a field is missing there too:
    // then the first error has the place of such a field.
    serde_json::from_value(tree).map_err(|other: serde_json::Error| {
        if other.to_string().contains("missing field") { error } else { other }
    })
}

/// Converts a scene to text; fails if the format cannot express it.
pub fn text(scene: &Scene) -> Result<String, String> {
    let document = Document::of(scene)?;
    let mut out = Out { text: String::from("{"), error: None };
    out.field("format", &document.format);
    out.field("version", &document.version);
    out.field("name", &document.name);
    out.field("settings", &document.settings);
    out.field("background", &document.background);
    out.field("ambient", &document.ambient);
    out.field("environment", &document.environment);
    if !document.portals.is_empty() {
        out.table("portals", &document.portals);
    }
    out.table("cameras", &document.cameras);
    out.table("lights", &document.lights);
    out.table("materials", &document.materials);
    out.table("textures", &document.textures);
    out.table("images", &document.images);
    out.table("media", &document.media);
    out.table("grids", &document.grids);
    out.table("media_grids", &document.media_grids);
    out.field("medium", &document.medium);
    out.field("root", &document.root);
    out.table("nodes", &document.nodes);
    out.table("meshes", &document.meshes);
    if !document.curves.is_empty() {
        out.table("curves", &document.curves);
    }
    if let Some(motion) = &document.motion {
        out.field("motion", motion);
    }
    out.text += "\n}\n";
    match out.error {
        Some(error) => Err(error),
        None => Ok(out.text),
    }
}

fn write(scene: &Scene, output: &mut Output) -> Result<(), String> {
    output.set(text(scene)?.into_bytes());
    Ok(())
}

/// JSON output with one item per line.
struct Out {
    text: String,
    error: Option<String>,
}

impl Out {
    fn key(&mut self, key: &str) {
        let comma = if self.text.len() > 1 { "," } else { "" };
        self.text += &format!("{comma}\n\"{key}\": ");
    }

    fn value(&mut self, value: &impl Serialize) {
        match serde_json::to_string(value) {
            Ok(text) => self.text += &text,
            Err(error) => self.error = Some(error.to_string()),
        }
    }

    fn field(&mut self, key: &str, value: &impl Serialize) {
        self.key(key);
        self.value(value);
    }

    /// Writes a list with one item per line.
    fn table(&mut self, key: &str, items: &[impl Serialize]) {
        self.key(key);
        self.text += "[";
        for (i, item) in items.iter().enumerate() {
            self.text += if i == 0 { "\n  " } else { ",\n  " };
            self.value(item);
        }
        self.text += if items.is_empty() { "]" } else { "\n]" };
    }
}
