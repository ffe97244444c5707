//! Cameras as definitions of `-D`.

use snell_scene::Camera;

/// The definitions of `snell render -D` that turn the scene's camera of this number, which is
/// `before`, into another; with `all`, also what both have in common.
pub fn camera_definitions(number: usize, before: &Camera, now: &Camera, all: bool) -> Vec<String> {
    let [before, now] = [before, now].map(|c| serde_json::to_value(c).unwrap_or_default());
    let fields = now.as_object().into_iter().flatten();
    let is_said = |key: &str, value: &serde_json::Value| {
        key != "name" && (before.get(key) != Some(value) || (all && !value.is_null()))
    };
    fields
        .filter(|(key, value)| is_said(key, value))
        .map(|(key, value)| format!("camera.{number}.{key}={value}"))
        .collect()
}
