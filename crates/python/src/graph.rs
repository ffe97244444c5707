//! Converts the contents of a scene to the scene graph that is rendered and saved.
//!
//! Objects become nodes below the root, instanced scenes nodes with several parents. A scene that
//! was read from a file and whose objects were not changed is the file's own graph. The tables of
//! instanced scenes are appended to those of the scene that holds them.

use crate::contents::{Contents, Kind, Nodes, Object};
use crate::origins::Origins;
use crate::value;
use snell_intersect::shape::Sphere;
use snell_intersect::{AnyShape, Spheres};
use snell_math::{DAffine3, DVec3, Transform};
use snell_scene::{Geometry, MaterialId, Node, NodeId, Scene, Surface};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// The scene graph of a scene.
pub fn graph(contents: &Contents) -> Result<Scene, String> {
    graph_with_origins(contents).map(|(scene, _)| scene)
}

/// The scene graph of a scene, and the objects that its nodes stand for.
pub fn graph_with_origins(contents: &Contents) -> Result<(Scene, Origins), String> {
    let mut scene = Scene::clone(&contents.stage);
    if let Some(nodes) = contents.nodes() {
        let Nodes { nodes, root, origins } = &**nodes;
        (scene.nodes, scene.root) = (nodes.clone(), *root);
        return Ok((scene, origins.clone()));
    }
    (scene.nodes, scene.root) = (vec![Node::named("root")], NodeId(0));
    let mut writer = Writer {
        scene,
        origins: Origins::default(),
        stages: HashMap::new(),
        children: HashMap::new(),
    };
    writer.stages.insert(Arc::as_ptr(&contents.stage), 0);
    let root = writer.scene.root;
    writer.fill(root, contents)?;
    Ok((writer.scene, writer.origins))
}

struct Writer {
    scene: Scene,
    origins: Origins,
    /// The id of the first material of each stage.
    stages: HashMap<*const Scene, u32>,
    /// The node of each scene that is instanced.
    children: HashMap<*const Contents, NodeId>,
}

impl Writer {
    /// Adds the objects of a scene below a node.
    fn fill(&mut self, parent: NodeId, contents: &Contents) -> Result<(), String> {
        let first = self.stage(&contents.stage)?;
        let materials = |object: &Object| -> Vec<Option<MaterialId>> {
            object.materials.iter().map(|m| m.map(|m| MaterialId(m.0 + first))).collect()
        };
        for (id, object) in contents.objects() {
            let (mut inner, mut below) = (None, None);
            let mut node = Node::named(object.name.as_deref().unwrap_or_default());
            let placed = object.transform.unwrap_or(Transform::IDENTITY);
            node.transform = *placed.matrix();
            match &object.kind {
                Kind::Mesh(mesh) => {
                    let (mesh, own) = mesh.rendered();
                    node.transform = *placed.compose(&own).matrix();
                    node.surfaces.push(Surface {
                        geometry: Geometry::Mesh(mesh),
                        materials: materials(object),
                    });
                }
                Kind::Shape(shape) => {
                    let geometry = Geometry::Shape(shape.clone());
                    node.surfaces.push(Surface { geometry, materials: materials(object) });
                }
                Kind::Curves(curves) => {
                    let geometry = Geometry::Curves(curves.clone());
                    node.surfaces.push(Surface { geometry, materials: materials(object) });
                }
                Kind::Spheres(spheres) => {
                    node.material = materials(object).first().copied().flatten();
                    node.children = self.spheres(spheres, id);
                }
                Kind::Instance(child) => {
                    node.material = materials(object).first().copied().flatten();
                    inner = self.instance(&mut node, child)?;
                    below = node.children.first().copied();
                }
            }
            let node = self.scene.add_child(parent, node);
            self.origins.first.insert(node, id);
            inner.map(|inner| self.origins.inner.insert((node, 0), inner));
            below.map(|below| self.origins.steps.insert((node, below), id));
        }
        Ok(())
    }

    /// Adds an instanced scene to a node. A scene of a single mesh is added as a surface of the
    /// node, because a mesh may be used several times; returns the id of this mesh.
    fn instance(&mut self, node: &mut Node, child: &Arc<Contents>) -> Result<Option<u32>, String> {
        let mut objects = child.objects();
        if let (Some((id, only)), None) = (objects.next(), objects.next())
            && let Object { kind: Kind::Mesh(mesh), transform: None, materials, .. } = only
            && let (mesh, own) = mesh.rendered()
            && own.is_identity()
        {
            let first = self.stage(&child.stage)?;
            let materials = materials.iter().map(|m| m.map(|m| MaterialId(m.0 + first))).collect();
            node.surfaces.push(Surface { geometry: Geometry::Mesh(mesh), materials });
            return Ok(Some(id));
        }
        let below = match self.children.get(&Arc::as_ptr(child)) {
            Some(&known) => known,
            None => {
                let made = self.scene.add_node(Node::default());
                self.fill(made, child)?;
                self.children.insert(Arc::as_ptr(child), made);
                made
            }
        };
        node.children.push(below);
        Ok(None)
    }

    /// A node for each sphere of an object; spheres of one radius share their shape.
    fn spheres(&mut self, spheres: &Spheres, id: u32) -> Vec<NodeId> {
        let mut shapes: BTreeMap<u32, Arc<AnyShape>> = BTreeMap::new();
        let each = spheres.spheres.iter().enumerate().map(|(number, s)| {
            let shape = shapes
                .entry(s.w.to_bits())
                .or_insert_with(|| Arc::new(Sphere { radius: f64::from(s.w) }.into()));
            let transform =
                DAffine3::from_translation(DVec3::from(s.truncate().to_array().map(f64::from)));
            let surfaces = vec![Surface::new(Geometry::Shape(shape.clone()))];
            let node = self.scene.add_node(Node { transform, surfaces, ..Node::default() });
            self.origins.first.insert(node, id);
            self.origins.primitives.insert(node, number as u32);
            node
        });
        each.collect()
    }

    /// Adds the tables of a stage if needed; returns the number of its first material.
    fn stage(&mut self, stage: &Arc<Scene>) -> Result<u32, String> {
        if let Some(&first) = self.stages.get(&Arc::as_ptr(stage)) {
            return Ok(first);
        }
        let scene = &mut self.scene;
        let (images, textures) = (scene.images.len() as u32, scene.textures.len() as u32);
        let first = scene.materials.len() as u32;
        scene.images.extend(stage.images.iter().cloned());
        for texture in &stage.textures {
            scene.textures.push(value::with_ids(texture, |kind, id| match kind {
                "ImageId" => id + images,
                "TextureId" => id + textures,
                _ => id,
            })?);
        }
        let media = scene.media.len() as u32;
        scene.media.extend(stage.media.iter().cloned());
        for material in &stage.materials {
            scene.materials.push(value::with_ids(material, |kind, id| match kind {
                "TextureId" => id + textures,
                "MediumId" => id + media,
                _ => id,
            })?);
        }
        self.stages.insert(Arc::as_ptr(stage), first);
        Ok(first)
    }
}
