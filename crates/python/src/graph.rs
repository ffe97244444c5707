//! Converts the contents of a scene to the scene graph that is rendered and saved.
//!
//! Objects become nodes below the root, instanced scenes nodes with several parents. A scene that
//! was read from a file and whose objects were not changed is the file's own graph. The tables of
//! instanced scenes are appended to those of the scene that holds them.

use crate::contents::{Contents, Kind, Nodes, Object};
use crate::mesh::Mesh;
use crate::origins::Origins;
use crate::value;
use snell_intersect::shape::Sphere;
use snell_intersect::{AnyShape, Curves, Spheres, TriangleMesh};
use snell_math::{Bounds3d, DAffine3, Transform};
use snell_scene::motion::{AnimatedTransform, Channel, Clip, Joint, Placement, Track};
use snell_scene::{Geometry, MaterialId, Node, NodeId, Scene, Surface};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// What a scene graph is for.
#[derive(Clone, Copy, PartialEq)]
pub enum Purpose {
    /// Pictures, for which meshes are in single precision.
    Picture,
    /// A file, for which they keep what is known in double precision.
    File,
}

/// The scene graph of a scene.
pub fn graph(contents: &Contents, purpose: Purpose) -> Result<Scene, String> {
    graph_with_origins(contents, purpose).map(|(scene, _)| scene)
}

/// The scene graph of a scene, and the objects that its nodes stand for.
pub fn graph_with_origins(
    contents: &Contents,
    purpose: Purpose,
) -> Result<(Scene, Origins), String> {
    let mut scene = Scene::clone(&contents.stage);
    if let Some(nodes) = contents.nodes() {
        let Nodes { nodes, root, motion, origins } = &**nodes;
        (scene.nodes, scene.root) = (nodes.clone(), *root);
        scene.motion.clone_from(motion);
        return Ok((scene, origins.clone()));
    }
    // A motion of the file is that of its nodes.
    scene.motion = None;
    (scene.nodes, scene.root) = (vec![Node::named("root")], NodeId(0));
    let mut writer = Writer {
        scene,
        purpose,
        moving: Vec::new(),
        origins: Origins::default(),
        stages: HashMap::new(),
        children: HashMap::new(),
    };
    writer.stages.insert(Arc::as_ptr(&contents.stage), 0);
    let root = writer.scene.root;
    writer.fill(root, contents)?;
    writer.scene.motion = motion_of(writer.moving, &writer.scene.nodes);
    Ok((writer.scene, writer.origins))
}

/// The motion of these nodes.
fn motion_of(
    moving: Vec<(NodeId, AnimatedTransform)>,
    nodes: &[Node],
) -> Option<Arc<snell_scene::Motion>> {
    let joint = |(node, _): &(NodeId, AnimatedTransform)| Joint {
        name: nodes[node.index()].name.clone(),
        rest: Placement::Matrix(nodes[node.index()].transform),
        node: Some(*node),
        ..Joint::default()
    };
    let joints: Vec<Joint> = moving.iter().map(joint).collect();
    let channels = (0..)
        .zip(moving)
        .map(|(joint, (_, transform))| Channel { joint, track: Track::Transform(transform) });
    let clip = Clip { name: "motion".into(), channels: channels.collect(), ..Clip::default() };
    let motion =
        snell_scene::Motion { joints, clips: vec![clip], ..snell_scene::Motion::default() };
    (!motion.joints.is_empty()).then(|| Arc::new(motion))
}

/// Strands that are known in double precision relative to a point among them, and the map back;
/// others as they are.
fn centered(curves: &Arc<Curves>) -> (Arc<Curves>, Transform) {
    let exact = curves.exact_points();
    let bounds = Bounds3d::of(exact.iter().map(|p| p.truncate()));
    if bounds.is_empty() {
        return (curves.clone(), Transform::IDENTITY);
    }
    // The centre is rounded, so that subtracting it from nearby points is exact.
    let center = bounds.center().as_vec3().as_dvec3();
    let near = exact.iter().map(|p| *p - center.extend(0.0)).collect();
    match Curves::exact(curves.basis(), near, curves.strands().to_vec()) {
        Ok(near) => (Arc::new(near), Transform::translation(center)),
        Err(_) => (curves.clone(), Transform::IDENTITY),
    }
}

struct Writer {
    scene: Scene,
    origins: Origins,
    purpose: Purpose,
    /// The nodes that move.
    moving: Vec<(NodeId, AnimatedTransform)>,
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
            let (mut inner, mut below, mut numbers) = (None, None, None);
            // The map from the coordinates of what the node holds.
            let mut own = Transform::IDENTITY;
            let mut node = Node::named(object.name.as_deref().unwrap_or_default());
            match &object.kind {
                Kind::Mesh(given) => {
                    let mesh;
                    (mesh, own) = self.mesh(given);
                    node.surfaces.push(Surface {
                        geometry: Geometry::Mesh(mesh),
                        materials: materials(object),
                    });
                }
                Kind::Heightfield(field) => {
                    let triangles = field.triangles();
                    let mesh;
                    (mesh, own) = self.mesh(&triangles.mesh);
                    numbers.clone_from(&triangles.numbers);
                    node.surfaces.push(Surface {
                        geometry: Geometry::Mesh(mesh),
                        materials: materials(object),
                    });
                }
                Kind::Shape(shape) => {
                    let geometry = Geometry::Shape(shape.clone());
                    node.surfaces.push(Surface { geometry, materials: materials(object) });
                }
                Kind::Curves(given) => {
                    let curves;
                    (curves, own) = centered(given);
                    let geometry = Geometry::Curves(curves);
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
            let placed = object.transform.unwrap_or(Transform::IDENTITY);
            let node = match &object.motion {
                // Keys are those of the object, so what is not at its origin is a node below.
                Some(motion) if !own.is_identity() => {
                    let mut moving = Node::named(node.name.as_str());
                    moving.transform = *placed.matrix();
                    let moving = self.scene.add_child(parent, moving);
                    self.moving.push((moving, motion.smooth().clone()));
                    node.transform = *own.matrix();
                    self.scene.add_child(moving, node)
                }
                motion => {
                    node.transform = *placed.compose(&own).matrix();
                    let node = self.scene.add_child(parent, node);
                    self.moving.extend(motion.iter().map(|m| (node, m.smooth().clone())));
                    node
                }
            };
            self.origins.first.insert(node, id);
            numbers.map(|numbers| self.origins.triangles.insert(node, numbers));
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
            && let (mesh, own) = self.mesh(mesh)
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

    /// A mesh, and the map from its coordinates.
    fn mesh(&self, mesh: &Mesh) -> (Arc<TriangleMesh>, Transform) {
        match self.purpose {
            Purpose::Picture => mesh.rendered(),
            Purpose::File => mesh.written(),
        }
    }

    /// A node for each sphere of an object; spheres of one radius share their shape.
    fn spheres(&mut self, spheres: &Spheres, id: u32) -> Vec<NodeId> {
        let mut shapes: BTreeMap<u64, Arc<AnyShape>> = BTreeMap::new();
        let each = (0..spheres.spheres.len()).map(|number| {
            let ball = spheres.exact_sphere(number);
            let shape = shapes
                .entry(ball.w.to_bits())
                .or_insert_with(|| Arc::new(Sphere { radius: ball.w }.into()));
            let transform = DAffine3::from_translation(ball.truncate());
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
