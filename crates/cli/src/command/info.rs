//! `snell info`: the contents of a scene file, or of a checkpoint.

mod checkpoint;
mod text;

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::{messages, scene_source, standard_output};
use serde_json::{Value, json};
use snell_formats::ReadOptions;
use snell_math::Bounds3d;
use snell_scene::families::{self, FAMILIES};
use snell_scene::overrides::nearest;
use snell_scene::{Geometry, NodeId, Scene};
use std::collections::{BTreeMap, HashSet};
use std::path::PathBuf;

/// Options of `snell info`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Scene or mesh file, `-` for standard input, the name of a built-in scene, or a checkpoint of
    /// `snell render`
    #[arg(required_unless_present = "kind")]
    scene: Option<PathBuf>,
    /// Show the parameters of a kind of material, light, medium, pattern, shape or camera, such as
    /// open-pbr, or the kinds of one of these, such as material
    #[arg(long, value_name = "NAME", conflicts_with_all = ["scene", "json", "define"])]
    kind: Option<String>,
    /// Write the picture that a checkpoint holds so far
    #[arg(long, value_name = "FILE", conflicts_with = "kind")]
    picture: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Maximum number of nodes of the tree to show
    #[arg(long, value_name = "N", default_value_t = 60)]
    nodes: usize,
    /// Change the scene: material.NAME.PARAMETER=VALUE, camera.…, light.NUMBER.…, medium.NUMBER.…,
    /// `ambient=[r,g,b]`; or NAME=VALUE, a parameter of a Mitsuba scene
    #[arg(short = 'D', long = "define", value_name = "key=value")]
    define: Vec<String>,
    /// Refuse to open files outside of the scene's folder
    #[arg(long)]
    confine: bool,
}

/// Prints the contents of the scene.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    if let Some(kind) = &options.kind {
        let text = described(kind)?;
        standard_output::write(text.as_bytes())?;
        return Ok(ExitCode::SUCCESS);
    }
    let path = options.scene.as_deref().expect("there is a scene where there is no kind");
    if let Some(found) = checkpoint::found(path)? {
        let text = checkpoint::described(&found.header, options.json);
        standard_output::write(text.as_bytes())?;
        if let Some(picture) = &options.picture {
            checkpoint::write_picture(&found.path, picture)?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    if options.picture.is_some() {
        let problem = "--picture is for checkpoints; snell render makes the picture of a scene";
        return Err(Failure::Usage(problem.into()));
    }
    let read = ReadOptions {
        confine: options.confine,
        parameters: scene_source::parameters(&options.define),
        ..ReadOptions::default()
    };
    let mut scene = scene_source::load(path, &read)?;
    scene_source::apply(&mut scene, &options.define)?;
    let bounds =
        scene.node_bounds().map_err(|e| Failure::Scene(format!("{}: {e}", path.display())))?;
    let facts = Facts { counts: Counts::of(&scene, &bounds), scene: &scene, bounds };
    let text =
        if options.json { format!("{:#}\n", facts.json()) } else { facts.text(options.nodes) };
    standard_output::write(text.as_bytes())?;
    Ok(ExitCode::SUCCESS)
}

/// The parameters of a kind, or the kinds of a family.
fn described(name: &str) -> Result<String, Failure> {
    families::describe(name).ok_or_else(|| {
        let kinds = FAMILIES.iter().flat_map(|f| f.kinds.iter().map(|kind| kind.name));
        let names: Vec<_> = FAMILIES.iter().map(|f| f.name).chain(kinds).collect();
        let hint = nearest(name, &names).map(|n| format!("; did you mean {n}?"));
        let families: Vec<_> = FAMILIES.iter().map(|f| f.name).collect();
        Failure::Usage(format!(
            "there is no kind \"{name}\"{}; --kind lists those of {}",
            hint.unwrap_or_default(),
            families.join(", ")
        ))
    })
}

#[derive(Default)]
struct Counts {
    nodes: usize,
    meshes: usize,
    shapes: usize,
    strands: usize,
    curve_segments: usize,
    triangles: usize,
    vertices: usize,
    degenerate: usize,
}

impl Counts {
    fn of(scene: &Scene, reachable: &BTreeMap<NodeId, Bounds3d>) -> Self {
        let mut counts = Self { nodes: reachable.len(), ..Self::default() };
        let (mut seen, mut seen_curves) = (HashSet::new(), HashSet::new());
        for node in reachable.keys() {
            for surface in &scene.nodes[node.index()].surfaces {
                match &surface.geometry {
                    Geometry::Shape(_) => counts.shapes += 1,
                    Geometry::Mesh(mesh) if seen.insert(std::sync::Arc::as_ptr(mesh)) => {
                        counts.meshes += 1;
                        counts.triangles += mesh.indices.len();
                        counts.vertices += mesh.positions.len();
                        counts.degenerate +=
                            if mesh.validate().is_ok() { mesh.degenerate_triangles() } else { 0 };
                    }
                    Geometry::Curves(curves)
                        if seen_curves.insert(std::sync::Arc::as_ptr(curves)) =>
                    {
                        counts.strands += curves.strands().len();
                        counts.curve_segments += curves.segment_count();
                    }
                    Geometry::Mesh(_) | Geometry::Curves(_) => {}
                }
            }
        }
        counts
    }
}

struct Facts<'a> {
    scene: &'a Scene,
    bounds: BTreeMap<NodeId, Bounds3d>,
    counts: Counts,
}

impl Facts<'_> {
    fn json(&self) -> Value {
        let (scene, counts) = (self.scene, &self.counts);
        json!({
            "name": scene.name,
            "nodes": counts.nodes, "meshes": counts.meshes, "shapes": counts.shapes,
            "strands": counts.strands, "curve_segments": counts.curve_segments,
            "triangles": counts.triangles, "vertices": counts.vertices,
            "degenerate_triangles": counts.degenerate,
            "bounds": bounds_json(&self.scene_bounds()),
            "materials": scene.materials,
            "textures": scene.textures.len(),
            "patterns": scene.textures.iter()
                .filter_map(|texture| texture.as_pattern())
                .collect::<Vec<_>>(),
            "images": scene.images.iter()
                .map(|i| json!({ "width": i.width, "height": i.height, "channels": i.channels }))
                .collect::<Vec<_>>(),
            "lights": scene.lights,
            "media": scene.media,
            "medium": scene.medium,
            "environment": self.environment(),
            "cameras": scene.cameras,
            "animations": scene.motion.iter().flat_map(|m| &m.clips).map(|clip| {
                let [start, end] = clip.span();
                json!({
                    "name": clip.name, "start": start, "end": end, "channels": clip.channels.len(),
                })
            }).collect::<Vec<_>>(),
            "variants": scene.variants,
            "scenes": scene.scenes,
            "warnings": messages::as_json(&scene.warnings),
            "notes": messages::as_json(&scene.notes),
            "tree": self.tree_json(scene.root, 64, &mut HashSet::new()),
        })
    }

    /// The node tree; a node that several nodes share is written out once, because a small file may
    /// use one node billions of times.
    fn tree_json(&self, id: NodeId, depth: usize, shown: &mut HashSet<NodeId>) -> Value {
        let node = &self.scene.nodes[id.index()];
        if !shown.insert(id) {
            return json!({ "id": id.0, "name": node.name, "shared": true });
        }
        let children: Vec<_> = if depth == 0 && !node.children.is_empty() {
            vec![json!("…")]
        } else {
            node.children.iter().map(|&c| self.tree_json(c, depth - 1, shown)).collect()
        };
        json!({
            "id": id.0, "name": node.name, "bounds": bounds_json(&self.bounds[&id]),
            "surfaces": node.surfaces.iter().map(|s| s.geometry.describe()).collect::<Vec<_>>(),
            "children": children,
        })
    }

    fn scene_bounds(&self) -> Bounds3d {
        self.scene.bounds().unwrap_or(Bounds3d::EMPTY)
    }

    fn environment(&self) -> &'static str {
        match self.scene.environment {
            None => "none",
            Some(snell_scene::Environment::Constant(_)) => "constant",
            Some(snell_scene::Environment::Image { .. }) => "image",
        }
    }
}

fn bounds_json(b: &Bounds3d) -> Value {
    if b.is_empty() {
        return Value::Null;
    }
    let side = |v: [f64; 3]| v.map(|x| if x.is_finite() { json!(x) } else { json!(x.to_string()) });
    json!({ "min": side(b.min.to_array()), "max": side(b.max.to_array()) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_scene::Node;

    #[test]
    fn a_shared_node_is_shown_once() {
        let mut scene = Scene::new("doubled");
        let mut below = scene.add_node(Node::named("bottom"));
        for _ in 0..100 {
            below = scene.add_node(Node { children: vec![below, below], ..Node::default() });
        }
        scene.nodes[0].children.push(below);
        let bounds = scene.node_bounds().expect("no cycle");
        let facts = Facts { counts: Counts::of(&scene, &bounds), scene: &scene, bounds };
        let tree = facts.json()["tree"].to_string();
        assert!(tree.len() < 10_000 && tree.contains("\"shared\":true"), "{} bytes", tree.len());
        assert!(facts.text(1000).lines().count() < 300);
    }
}
