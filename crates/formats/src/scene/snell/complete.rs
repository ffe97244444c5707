//! Fields that a file leaves out: they are what the reference page of parameters says.

use serde_json::{Map, Value, json};
use snell_scene::families::Family;
use std::collections::HashMap;

/// The required fields of all kinds that were needed so far, by family and kind.
#[derive(Default)]
struct Usual {
    known: HashMap<(&'static str, String), Map<String, Value>>,
}

impl Usual {
    /// Adds what a thing of a family lacks.
    fn complete(&mut self, family: &'static str, thing: &mut Value) {
        let Some(family) = Family::named(family) else { return };
        let Some(fields) = thing.as_object_mut() else { return };
        let Some(kind) = fields.get(family.tag).and_then(Value::as_str) else { return };
        let key = (family.name, kind.to_string());
        let usual = self.known.entry(key).or_insert_with(|| family.usual(kind));
        add(fields, usual);
    }
}

fn add(fields: &mut Map<String, Value>, usual: &Map<String, Value>) {
    for (name, value) in usual {
        fields.entry(name.as_str()).or_insert_with(|| value.clone());
    }
}

/// Adds the fields that a document lacks.
pub fn complete(document: &mut Value) {
    let mut usual = Usual::default();
    let camera = Family::named("projection").map(Family::usual_common).unwrap_or_default();
    let items = |document: &mut Value, name: &str, visit: &mut dyn FnMut(&mut Value)| {
        let list = document.get_mut(name).and_then(Value::as_array_mut);
        list.into_iter().flatten().for_each(visit);
    };
    items(document, "cameras", &mut |thing| {
        let Some(fields) = thing.as_object_mut() else { return };
        let perspective = || json!({ "projection": "perspective" });
        usual.complete("projection", fields.entry("projection").or_insert_with(perspective));
        add(fields, &camera);
    });
    items(document, "materials", &mut |thing| {
        let Some(fields) = thing.as_object_mut() else { return };
        let diffuse = || json!({ "material": "diffuse" });
        usual.complete("material", fields.entry("kind").or_insert_with(diffuse));
    });
    items(document, "lights", &mut |light| usual.complete("light", light));
    items(document, "media", &mut |medium| usual.complete("medium", medium));
    items(document, "nodes", &mut |node| {
        items(node, "surfaces", &mut |surface| {
            if let Some(shape) = surface.get_mut("shape") {
                usual.complete("shape", shape);
            }
        });
    });
}
