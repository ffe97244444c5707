//! Nodes: the hierarchy of a glTF file as nodes of the scene graph.

use super::json::Json;
use super::{Reader, camera, instancing, light, mesh, morph, skin};
use crate::ReadError;
use snell_intersect::TriangleMesh;
use snell_math::glam::DQuat;
use snell_math::{DAffine3, DMat3, DVec3};
use snell_scene::{Geometry, MaterialId, Node, NodeId, Surface};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

/// All nodes of a document with their places in the world.
pub(super) struct Hierarchy<'a> {
    nodes: Vec<Json<'a>>,
    children: Vec<Vec<usize>>,
    is_root: Vec<bool>,
    local: Vec<DAffine3>,
    world: Vec<DAffine3>,
}

impl<'a> Hierarchy<'a> {
    /// Reads all nodes; refuses cycles, nodes with two parents, and transforms that overflow.
    fn read(reader: &Reader<'a>) -> Result<Self, ReadError> {
        let nodes = reader.root.items_of("nodes")?;
        let mut is_root = vec![true; nodes.len()];
        let mut children = Vec::with_capacity(nodes.len());
        for node in &nodes {
            let mut below = Vec::new();
            for child in node.items_of("children")? {
                let i = child.size()?;
                if !std::mem::replace(&mut is_root[i], false) {
                    return Err(child.error(format!("node {i} is a child already; a node has one parent at most")));
                }
                below.push(i);
            }
            children.push(below);
        }
        let local = nodes.iter().map(local_transform).collect::<Result<Vec<_>, _>>()?;
        let mut this = Self { world: local.clone(), nodes, children, is_root, local };
        this.place(reader.input.options.limits.depth)?;
        Ok(this)
    }

    /// Computes the world transforms, level by level. Nodes never reached lie on cycles, because every node has one parent at most.
    fn place(&mut self, max_depth: usize) -> Result<(), ReadError> {
        let mut level: Vec<usize> = (0..self.nodes.len()).filter(|&i| self.is_root[i]).collect();
        let mut reached = vec![false; self.nodes.len()];
        let mut depth = 0;
        while let Some(&first) = level.first() {
            depth += 1;
            if depth > max_depth {
                return Err(self.nodes[first]
                    .error_with(format!("nodes are nested deeper than {max_depth} levels"), "flatten the hierarchy"));
            }
            let mut below = Vec::new();
            for i in level {
                reached[i] = true;
                if !self.world[i].is_finite() {
                    return Err(self.nodes[i].error("its transform, with those above it, is too large to be computed"));
                }
                for &child in &self.children[i] {
                    self.world[child] = self.world[i] * self.local[child];
                    below.push(child);
                }
            }
            level = below;
        }
        match reached.iter().position(|r| !r) {
            Some(i) => Err(self.nodes[i].error("the node is its own descendant; nodes must form trees")),
            None => Ok(()),
        }
    }

    /// `world_from_node` of the node that `index` refers to.
    pub fn world(&self, index: &Json) -> Result<DAffine3, ReadError> {
        let i = index.size()?;
        self.world.get(i).copied().ok_or_else(|| index.error(format!("there is no node {i}")))
    }

    /// The nodes at the top of the scene to be shown: the default scene, else the first, else all nodes without a parent.
    fn shown_roots(&self, reader: &mut Reader<'a>) -> Result<Vec<usize>, ReadError> {
        let scenes = reader.root.items_of("scenes")?;
        let chosen = reader.root.get("scene")?.map(|s| s.size()).transpose()?;
        if let Some(index) = chosen.filter(|&i| i >= scenes.len()) {
            let count = scenes.len();
            reader.scene.warn(format!(
                "the default scene is number {index}, but there are {count}; the first, or else every node, is shown"
            ));
        }
        let index = chosen.filter(|&i| i < scenes.len()).unwrap_or(0);
        let Some(scene) = scenes.get(index) else {
            return Ok((0..self.nodes.len()).filter(|&i| self.is_root[i]).collect());
        };
        if scenes.len() > 1 {
            reader.scene.warn(format!("the file has {} scenes; number {index} is shown", scenes.len()));
        }
        let mut roots: Vec<usize> = Vec::new();
        let mut listed = vec![false; self.nodes.len()];
        for node in scene.items_of("nodes")? {
            let i = node.size()?;
            if std::mem::replace(&mut listed[i], true) {
                reader.scene.warn("a node is listed twice in its scene; it is shown once");
            } else if self.is_root[i] {
                roots.push(i);
            } else {
                return Err(node.error(format!("node {i} is at the top of a scene, but is a child of another node")));
            }
        }
        Ok(roots)
    }
}

/// `parent_from_node`: the matrix, or translation, rotation and scale.
fn local_transform(node: &Json) -> Result<DAffine3, ReadError> {
    let Some(matrix) = node.get("matrix")? else {
        let translation = node.numbers_or("translation", [0.0; 3])?;
        let rotation = node.numbers_or("rotation", [0.0, 0.0, 0.0, 1.0])?;
        let scale = node.numbers_or("scale", [1.0; 3])?;
        return Ok(from_parts(translation, rotation, scale));
    };
    let m = matrix.numbers::<16>()?;
    if [m[3], m[7], m[11]].iter().any(|x| x.abs() > 1e-6) || (m[15] - 1.0).abs() > 1e-6 {
        return Err(matrix.error("the matrix is a projection; its last row must be 0 0 0 1"));
    }
    let column = |c: usize| DVec3::new(m[c], m[c + 1], m[c + 2]);
    Ok(DAffine3 { matrix3: DMat3::from_cols(column(0), column(4), column(8)), translation: column(12) })
}

/// Scale, then rotation (a quaternion x y z w of any length but 0, which counts as none), then translation.
pub(super) fn from_parts(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> DAffine3 {
    let rotation = DQuat::from_array(rotation);
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DAffine3::from_scale_rotation_translation(scale.into(), rotation, translation.into())
}

/// What of the file's meshes is in the scene already.
#[derive(Default)]
struct MeshNodes {
    /// Nodes of meshes, by number and weights (their bits).
    shared: BTreeMap<(usize, Vec<u64>), NodeId>,
    /// Numbers of all meshes shown, the skinned ones too.
    shown: BTreeSet<usize>,
}

/// Reads the scene to be shown into the scene graph.
pub(super) fn read_scene(reader: &mut Reader) -> Result<(), ReadError> {
    let hierarchy = Hierarchy::read(reader)?;
    let light_scale = light::scale(reader)?;
    let mut meshes = MeshNodes::default();
    let root = reader.scene.root;
    let mut queue: VecDeque<(usize, NodeId)> = hierarchy.shown_roots(reader)?.into_iter().map(|i| (i, root)).collect();
    while let Some((i, parent)) = queue.pop_front() {
        let node = &hierarchy.nodes[i];
        let transform = hierarchy.local[i];
        let id = reader.scene.add_child(parent, Node { transform, ..Node::named(node.name()) });
        queue.extend(hierarchy.children[i].iter().map(|&child| (child, id)));
        camera::read(reader, node, &hierarchy.world[i])?;
        light::read(reader, node, &hierarchy.world[i], light_scale)?;
        light::read_ies(reader, node, &hierarchy.world[i], light_scale)?;
        read_mesh(reader, &hierarchy, i, id, &mut meshes)?;
    }
    if hierarchy.nodes.is_empty() {
        read_meshes_without_nodes(reader, &mut meshes)?;
    }
    check_unseen(reader, &hierarchy, &meshes.shown)
}

/// Shows all meshes of a file that has no nodes at all, where their vertices say: a library of meshes rather than a scene.
fn read_meshes_without_nodes(reader: &mut Reader, shown: &mut MeshNodes) -> Result<(), ReadError> {
    for (i, mesh) in reader.root.items_of("meshes")?.iter().enumerate() {
        if i == 0 {
            reader
                .scene
                .warn("the file has meshes, but no nodes to place them; they are shown where their vertices are");
        }
        let primitives = mesh::read_primitives(reader, mesh, &[])?;
        let surfaces = primitives.into_iter().map(|p| surface(reader, p.mesh, p.material)).collect();
        let root = reader.scene.root;
        reader.scene.add_child(root, Node { surfaces, ..Node::named(mesh.name()) });
        shown.shown.insert(i);
    }
    Ok(())
}

/// Checks what the shown scene does not use, too: a damaged file should be noticed whichever scene is shown.
fn check_unseen(reader: &mut Reader, hierarchy: &Hierarchy, seen: &BTreeSet<usize>) -> Result<(), ReadError> {
    for skin in reader.root.items_of("skins")? {
        skin::joint_matrices(reader, &skin, hierarchy)?;
    }
    let warnings = reader.scene.warnings.clone();
    for (i, mesh) in reader.root.items_of("meshes")?.iter().enumerate() {
        if !seen.contains(&i) {
            mesh::read_primitives(reader, mesh, &[])?;
        }
    }
    // What is approximated in meshes that nobody sees is of no interest.
    reader.scene.warnings = warnings;
    if seen.is_empty() && !reader.root.items_of("meshes")?.is_empty() {
        reader.scene.warn("the file has meshes, but no node of the scene shows one");
    }
    Ok(())
}

/// Places the mesh of a node, if it has one.
fn read_mesh(
    reader: &mut Reader,
    hierarchy: &Hierarchy,
    i: usize,
    id: NodeId,
    meshes: &mut MeshNodes,
) -> Result<(), ReadError> {
    let node = &hierarchy.nodes[i];
    let Some(index) = node.get("mesh")? else { return Ok(()) };
    let mesh = &reader.root.entry("meshes", &index)?;
    let weights = morph::weights(node, mesh)?;
    meshes.shown.insert(index.size()?);
    if let Some(skin) = node.get("skin")? {
        // The skin places the mesh in the world; where the node is does not count (glTF 2.0, section 3.7.3.3).
        let skinned = skinned_mesh(reader, hierarchy, mesh, &weights, &skin)?;
        let root = reader.scene.root;
        reader.scene.add_child(root, skinned);
        return Ok(());
    }
    let key = (index.size()?, weights.iter().map(|w| w.to_bits()).collect());
    let shared = match meshes.shared.get(&key) {
        Some(&shared) => shared,
        None => {
            let primitives = mesh::read_primitives(reader, mesh, &weights)?;
            let surfaces = primitives.into_iter().map(|p| surface(reader, p.mesh, p.material)).collect();
            let shared = reader.scene.add_node(Node { surfaces, ..Node::named(mesh.name()) });
            meshes.shared.insert(key, shared);
            shared
        }
    };
    match instancing::transforms(reader, node)? {
        None => reader.scene.nodes[id.index()].children.push(shared),
        Some(instances) => {
            for transform in instances {
                reader.scene.add_child(id, Node { transform, children: vec![shared], ..Node::default() });
            }
        }
    }
    Ok(())
}

fn skinned_mesh(
    reader: &mut Reader,
    hierarchy: &Hierarchy,
    mesh: &Json,
    weights: &[f64],
    skin: &Json,
) -> Result<Node, ReadError> {
    let matrices = skin::joint_matrices(reader, &reader.root.entry("skins", skin)?, hierarchy)?;
    let mut surfaces = Vec::new();
    for mut primitive in mesh::read_primitives(reader, mesh, weights)? {
        if let Some(influences) = &primitive.influences {
            skin::apply(&mut primitive.mesh, influences, &matrices).map_err(|joint| {
                mesh.error(format!("a vertex is moved by joint {joint}, but its skin has {} joints", matrices.len()))
            })?;
        }
        surfaces.push(surface(reader, primitive.mesh, primitive.material));
    }
    Ok(Node { surfaces, ..Node::named(mesh.name()) })
}

fn surface(reader: &mut Reader, mut mesh: TriangleMesh, material: Option<usize>) -> Surface {
    let material = match material {
        Some(index) => MaterialId(index as u32),
        None => super::material::default_material(reader),
    };
    mesh::drop_unused(&mut mesh);
    Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material)
}
