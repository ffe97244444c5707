//! The text output of `snell info`.

use super::Facts;
use snell_scene::NodeId;
use std::collections::{BTreeMap, HashSet};

/// Adds a line to a text.
macro_rules! line {
    ($out:ident, $($what:tt)*) => {{
        $out.push_str(&printable(&format!($($what)*)));
        $out.push('\n');
    }};
}

/// Removes control characters: names from a file must not control the terminal.
fn printable(line: &str) -> String {
    let escaped = |c: char| {
        if c.is_control() && c != '\n' { c.escape_unicode().collect() } else { c.to_string() }
    };
    line.chars().map(escaped).collect()
}

impl Facts<'_> {
    /// The contents of the scene as text; at most `limit` nodes of the tree.
    pub fn text(&self, limit: usize) -> String {
        let mut out = String::new();
        let (scene, counts) = (self.scene, &self.counts);
        line!(out, "{}", scene.name);
        line!(
            out,
            "{} nodes, {} meshes ({} triangles, {} vertices), {} shapes",
            counts.nodes,
            counts.meshes,
            counts.triangles,
            counts.vertices,
            counts.shapes
        );
        if counts.strands > 0 {
            line!(out, "{} strands ({} segments of curves)", counts.strands, counts.curve_segments);
        }
        let b = self.scene_bounds();
        if b.is_empty() {
            line!(out, "bounds: none, as nothing is visible");
        } else {
            line!(out, "bounds: {:.4} to {:.4}, size {:.4}", b.min, b.max, b.size());
        }
        if counts.degenerate > 0 {
            line!(
                out,
                "{} degenerate or non-finite triangles, which are never hit",
                counts.degenerate
            );
        }
        line!(out, "\nTree");
        let mut left = limit;
        self.add_node(&mut out, scene.root, 1, &mut left, &mut HashSet::new());
        self.add_tables(&mut out);
        if !scene.notes.is_empty() {
            line!(out, "\nHow the file was converted");
            for note in &scene.notes {
                line!(out, "  {} ({}x)", note.message, note.count);
            }
        }
        if !scene.warnings.is_empty() {
            line!(out, "\nWarnings");
            for warning in &scene.warnings {
                line!(out, "  {} ({}x)", warning.message, warning.count);
            }
        }
        out
    }

    fn add_node(
        &self,
        out: &mut String,
        id: NodeId,
        depth: usize,
        left: &mut usize,
        shown: &mut HashSet<NodeId>,
    ) {
        let indent = "  ".repeat(depth.min(40));
        if *left == 0 {
            return;
        }
        *left -= 1;
        if *left == 0 {
            line!(out, "{indent}… (more with --nodes N)");
            return;
        }
        let node = &self.scene.nodes[id.index()];
        let name = if node.name.is_empty() { format!("node {}", id.0) } else { node.name.clone() };
        let surfaces: Vec<_> = node.surfaces.iter().map(|s| s.geometry.describe()).collect();
        let again = !shown.insert(id) && !node.children.is_empty();
        let what =
            format!("{}{}", surfaces.join(", "), if again { "(shared, shown above)" } else { "" });
        line!(out, "{}", format!("{indent}{name}  {what}").trim_end());
        if !again && depth < 200 {
            for &child in &node.children {
                self.add_node(out, child, depth + 1, left, shown);
            }
        }
    }

    fn add_tables(&self, out: &mut String) {
        let scene = self.scene;
        if !scene.materials.is_empty() {
            line!(out, "\nMaterials");
            for (i, material) in scene.materials.iter().enumerate() {
                let emits = if material.is_emissive() { ", emits" } else { "" };
                // In RGB all colours have the index of refraction at the d line.
                let disperses =
                    if material.is_dispersive() { ", disperses with --color spectral" } else { "" };
                line!(
                    out,
                    "  {i} \"{}\" {}{emits}{disperses}",
                    material.name,
                    material.kind.name()
                );
            }
        }
        let patterns: Vec<_> =
            scene.textures.iter().filter_map(|texture| texture.as_pattern()).collect();
        if !patterns.is_empty() {
            let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
            patterns.iter().for_each(|pattern| *counts.entry(pattern.name()).or_default() += 1);
            let kinds: Vec<_> =
                counts.iter().map(|(name, count)| format!("{count} {name}")).collect();
            line!(out, "\nPatterns: {}", kinds.join(", "));
        }
        if !scene.images.is_empty() {
            line!(out, "\nImages");
            for (i, image) in scene.images.iter().enumerate() {
                line!(out, "  {i} {}x{}, {} channels", image.width, image.height, image.channels);
            }
        }
        line!(out, "\nLights: {} and environment: {}", scene.lights.len(), self.environment());
        for (i, light) in scene.lights.iter().enumerate() {
            line!(out, "  {i} {}", light.name());
        }
        if !scene.media.is_empty() {
            line!(out, "\nMedia");
            for (i, medium) in scene.media.iter().enumerate() {
                let fills = if scene.medium.is_some_and(|m| m.index() == i) {
                    ", outside of all surfaces"
                } else {
                    ""
                };
                line!(out, "  {i} {}{fills}", medium.name());
            }
        }
        line!(
            out,
            "\nCameras{}",
            if scene.cameras.is_empty() {
                ": none (one is made that frames the scene)"
            } else {
                ""
            }
        );
        for (i, camera) in scene.cameras.iter().enumerate() {
            line!(
                out,
                "  {i} \"{}\" at {:.3} towards {:.3}",
                camera.name,
                camera.eye,
                camera.towards
            );
        }
        self.add_choices(out);
    }

    /// Adds the choices that the file offers.
    fn add_choices(&self, out: &mut String) {
        let scene = self.scene;
        if let Some(motion) = &scene.motion {
            line!(
                out,
                "\nAnimations ({} joints, {} deformed meshes)",
                motion.joints.len(),
                motion.deformed.len()
            );
            for (i, clip) in motion.clips.iter().enumerate() {
                let [start, end] = clip.span();
                line!(
                    out,
                    "  {i} \"{}\" {start:.3} s to {end:.3} s, {} channels",
                    clip.name,
                    clip.channels.len()
                );
            }
        }
        let list = |out: &mut String, title: &str, names: &[String]| {
            if !names.is_empty() {
                line!(out, "\n{title}");
                for (i, name) in names.iter().enumerate() {
                    line!(out, "  {i} \"{name}\"");
                }
            }
        };
        list(out, "Variants of materials", &scene.variants);
        if scene.scenes.len() > 1 {
            list(out, "Scenes of the file", &scene.scenes);
        }
    }
}
