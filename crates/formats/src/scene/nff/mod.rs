//! Neutral File Format, the language of Haines' Standard Procedural Databases (1987; format 3.1 of
//! 1992).
//!
//! One-letter entities: `v` view, `b` background, `l` light, `f` fill (material), `c` cone or
//! cylinder, `s` sphere, `p` polygon, `pp` polygon with normals. A `#` starts a comment. Choices
//! that the format leaves open:
//!
//! * A light without a colour has intensity `1 / sqrt(number of lights)`, so that pictures with
//!   many lights are brighter, but not burnt out. Lights do not attenuate with distance. Because
//!   the format was made for the classic formula `kd cos` without `1 / pi`, all intensities are
//!   multiplied by pi.
//! * Highlights and mirror reflection are `Ks` times the fill colour; transmission is `T` for all
//!   channels.
//! * Surfaces are double-sided.
//!
//! Assimp's own entities (`tet`, `oct`, `hex`, `dod`, `tpp`, `tess`, `shader`) and the name of a
//! picture after a fill are left out with a warning.

mod entity;
mod surface;
#[cfg(test)]
mod tests;

use crate::scene::shapes::ShapeTable;
use crate::scene::tokens::{Token, Tokens};
use crate::{Input, ReadError, SceneReader};
use snell_math::{DVec3, Rgb};
use snell_scene::{MaterialId, Scene};
use std::collections::{BTreeMap, HashMap};

/// The reader of NFF scenes.
pub const READER: SceneReader = SceneReader {
    name: "nff",
    description: "Neutral File Format of the Standard Procedural Databases",
    extensions: &["nff"],
    recognises,
    read,
};

/// The state after some entities.
struct Builder {
    scene: Scene,
    shapes: ShapeTable,
    /// Materials by the bits of their fill entity, because the generators repeat fills.
    fills: HashMap<[u64; 8], MaterialId>,
    /// Material of the following objects.
    fill: Option<MaterialId>,
    /// Positions of the lights, each with its colour if the file gives one.
    lights: Vec<(DVec3, Option<Rgb>)>,
    /// Polygons by material.
    polygons: BTreeMap<MaterialId, surface::Polygons>,
    entities: usize,
}

fn read(input: &Input) -> Result<Scene, ReadError> {
    let mut tokens = Tokens::with_comments(input);
    let mut builder = Builder {
        scene: Scene::new(""),
        shapes: ShapeTable::default(),
        fills: HashMap::new(),
        fill: None,
        lights: Vec::new(),
        polygons: BTreeMap::new(),
        entities: 0,
    };
    while let Some(keyword) = tokens.take() {
        builder.count(&tokens, &keyword, 1)?;
        builder.read_entity(&mut tokens, &keyword)?;
    }
    builder.finish_lights();
    builder.finish_polygons();
    // The pictures published with the databases show clamped linear values, for which their colours
    // were chosen.
    builder.scene.settings.raw_display = true;
    builder.scene.settings.integrator = Some("whitted".into());
    Ok(builder.scene)
}

impl Builder {
    /// Counts entities or corners against the limit.
    fn count(&mut self, tokens: &Tokens, token: &Token, more: usize) -> Result<(), ReadError> {
        self.entities += more;
        let limit = tokens.input().options.limits.elements;
        if self.entities <= limit {
            return Ok(());
        }
        let problem = format!("the scene has more than {limit} entities and corners, the limit");
        Err(tokens.error(token, problem, "split the scene"))
    }
}

/// True if the text has, after comments, background and lights, a view: `v` followed by `from`.
fn recognises(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let lines = text.lines().map(|l| l.split('#').next().unwrap_or_default());
    let mut words = lines.flat_map(str::split_whitespace);
    while let Some(word) = words.next() {
        match word {
            "v" => return words.next() == Some("from"),
            "b" | "l" => {}
            number if number.parse::<f64>().is_ok() => {}
            _ => return false,
        }
    }
    false
}
