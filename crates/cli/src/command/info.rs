//! `snell info`: what is in a scene file.

use crate::failure::Failure;
use crate::scene_source;
use serde_json::{Value, json};
use snell_formats::ReadOptions;
use snell_math::Bounds3d;
use snell_scene::{Geometry, NodeId, Scene};
use std::collections::{BTreeMap, HashSet};
use std::process::ExitCode;

/// Options of `snell info`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Scene or mesh file, `-` for standard input, or the name of a built-in scene
    scene: String,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Nodes of the tree to show at most
    #[arg(long, value_name = "N", default_value_t = 60)]
    nodes: usize,
    /// Let the scene name files outside of its folder
    #[arg(long)]
    allow_outside: bool,
}

/// Prints what is in the scene.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let read = ReadOptions { allow_outside: options.allow_outside, ..ReadOptions::default() };
    let scene = scene_source::load(&options.scene, &read)?;
    let bounds = scene.node_bounds().map_err(|e| Failure::Scene(format!("{}: {e}", options.scene)))?;
    let facts = Facts { counts: Counts::of(&scene, &bounds), scene: &scene, bounds };
    if options.json {
        println!("{:#}", facts.json());
    } else {
        facts.print(options.nodes);
    }
    Ok(ExitCode::SUCCESS)
}

struct Counts {
    nodes: usize,
    meshes: usize,
    shapes: usize,
    triangles: usize,
    vertices: usize,
    degenerate: usize,
}

impl Counts {
    fn of(scene: &Scene, reachable: &BTreeMap<NodeId, Bounds3d>) -> Self {
        let mut counts =
            Self { nodes: reachable.len(), meshes: 0, shapes: 0, triangles: 0, vertices: 0, degenerate: 0 };
        let mut seen = HashSet::new();
        for node in reachable.keys() {
            for surface in &scene.nodes[node.index()].surfaces {
                match &surface.geometry {
                    Geometry::Shape(_) => counts.shapes += 1,
                    Geometry::Mesh(mesh) if seen.insert(std::sync::Arc::as_ptr(mesh)) => {
                        counts.meshes += 1;
                        counts.triangles += mesh.indices.len();
                        counts.vertices += mesh.positions.len();
                        counts.degenerate += if mesh.validate().is_ok() { mesh.degenerate_triangles() } else { 0 };
                    }
                    Geometry::Mesh(_) => {}
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
            "triangles": counts.triangles, "vertices": counts.vertices, "degenerate_triangles": counts.degenerate,
            "bounds": bounds_json(&self.scene_bounds()),
            "materials": scene.materials,
            "textures": scene.textures.len(),
            "images": scene.images.iter().map(|i| json!({ "width": i.width, "height": i.height, "channels": i.channels }))
                .collect::<Vec<_>>(),
            "lights": scene.lights,
            "environment": self.environment(),
            "cameras": scene.cameras,
            "warnings": scene.warnings.iter().map(|w| json!({ "message": w.message, "count": w.count })).collect::<Vec<_>>(),
            "tree": self.tree_json(scene.root, 64),
        })
    }

    fn tree_json(&self, id: NodeId, depth: usize) -> Value {
        let node = &self.scene.nodes[id.index()];
        let children: Vec<_> = if depth == 0 {
            vec![json!("…")]
        } else {
            node.children.iter().map(|&c| self.tree_json(c, depth - 1)).collect()
        };
        json!({
            "id": id.0, "name": node.name, "bounds": bounds_json(&self.bounds[&id]),
            "surfaces": node.surfaces.iter().map(|s| describe(&s.geometry)).collect::<Vec<_>>(),
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

    fn print(&self, limit: usize) {
        let (scene, counts) = (self.scene, &self.counts);
        println!("{}", scene.name);
        println!(
            "{} nodes, {} meshes ({} triangles, {} vertices), {} shapes",
            counts.nodes, counts.meshes, counts.triangles, counts.vertices, counts.shapes
        );
        let b = self.scene_bounds();
        if b.is_empty() {
            println!("bounds: nothing to see");
        } else {
            println!("bounds: {:.4} to {:.4}, size {:.4}", b.min, b.max, b.size());
        }
        if counts.degenerate > 0 {
            println!("{} degenerate or non-finite triangles, which are never hit", counts.degenerate);
        }
        println!("\nTree");
        let mut left = limit;
        self.print_node(scene.root, 1, &mut left, &mut HashSet::new());
        self.print_tables();
        if !scene.warnings.is_empty() {
            println!("\nWarnings");
            for warning in &scene.warnings {
                println!("  {} ({}x)", warning.message, warning.count);
            }
        }
    }

    fn print_node(&self, id: NodeId, depth: usize, left: &mut usize, shown: &mut HashSet<NodeId>) {
        let indent = "  ".repeat(depth.min(40));
        if *left == 0 {
            return;
        }
        *left -= 1;
        if *left == 0 {
            println!("{indent}… (more with --nodes N)");
            return;
        }
        let node = &self.scene.nodes[id.index()];
        let name = if node.name.is_empty() { format!("node {}", id.0) } else { node.name.clone() };
        let surfaces: Vec<_> = node.surfaces.iter().map(|s| describe(&s.geometry)).collect();
        let again = !shown.insert(id) && !node.children.is_empty();
        println!("{indent}{name}  {}{}", surfaces.join(", "), if again { "(shared, shown above)" } else { "" });
        if !again && depth < 200 {
            for &child in &node.children {
                self.print_node(child, depth + 1, left, shown);
            }
        }
    }

    fn print_tables(&self) {
        let scene = self.scene;
        if !scene.materials.is_empty() {
            println!("\nMaterials");
            for (i, material) in scene.materials.iter().enumerate() {
                let emits = if material.is_emissive() { ", emits" } else { "" };
                println!("  {i} \"{}\" {}{emits}", material.name, material.kind.name());
            }
        }
        if !scene.images.is_empty() {
            println!("\nImages");
            for (i, image) in scene.images.iter().enumerate() {
                println!("  {i} {}x{}, {} channels", image.width, image.height, image.channels);
            }
        }
        println!("\nLights: {} and environment: {}", scene.lights.len(), self.environment());
        for (i, light) in scene.lights.iter().enumerate() {
            println!("  {i} {}", light.name());
        }
        println!(
            "\nCameras{}",
            if scene.cameras.is_empty() { ": none (one is made that frames the scene)" } else { "" }
        );
        for (i, camera) in scene.cameras.iter().enumerate() {
            println!("  {i} \"{}\" at {:.3} towards {:.3}", camera.name, camera.eye, camera.towards);
        }
    }
}

fn describe(geometry: &Geometry) -> String {
    match geometry {
        Geometry::Shape(shape) => shape.name().to_string(),
        Geometry::Mesh(mesh) => format!("mesh of {} triangles", mesh.indices.len()),
    }
}

fn bounds_json(b: &Bounds3d) -> Value {
    if b.is_empty() {
        return Value::Null;
    }
    let side = |v: [f64; 3]| v.map(|x| if x.is_finite() { json!(x) } else { json!(x.to_string()) });
    json!({ "min": side(b.min.to_array()), "max": side(b.max.to_array()) })
}
