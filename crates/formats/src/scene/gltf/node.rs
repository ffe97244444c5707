//! Nodes: converts the hierarchy of a glTF file to nodes of the scene graph.

use super::animation::Placed;
use super::json::Json;
use super::mesh::Primitive;
use super::{Reader, animation, camera, instancing, light, mesh, morph, skin};
use crate::ReadError;
use crate::strokes::{Radii, Strokes};
use snell_intersect::TriangleMesh;
use snell_math::glam::DQuat;
use snell_math::{Bounds3d, DAffine3, DMat3, DVec3};
use snell_scene::motion::{Deformed, Morph, Placement, Skin, Switched, morph_mesh};
use snell_scene::{Geometry, MaterialId, Node, NodeId, Surface, WarningKind};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

/// All nodes of a document with their world transforms.
pub(super) struct Hierarchy<'a> {
    nodes: Vec<Json<'a>>,
    children: Vec<Vec<usize>>,
    is_root: Vec<bool>,
    local: Vec<Placement>,
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
                    return Err(child.error(format!(
                        "node {i} is a child already; a node has one parent at most"
                    )));
                }
                below.push(i);
            }
            children.push(below);
        }
        let local = nodes.iter().map(placement).collect::<Result<Vec<_>, _>>()?;
        let world = local.iter().map(Placement::matrix).collect();
        let mut this = Self { world, nodes, children, is_root, local };
        this.place(reader.input.options.limits.depth)?;
        Ok(this)
    }

    /// Takes nodes away from their parents, so that they are roots.
    fn detach(&mut self, detached: &[usize], max_depth: usize) -> Result<(), ReadError> {
        for &node in detached {
            self.is_root[node] = true;
            self.world[node] = self.local[node].matrix();
        }
        let is_root = &self.is_root;
        self.children.iter_mut().for_each(|below| below.retain(|&child| !is_root[child]));
        self.place(max_depth)
    }

    /// Computes the world transforms, level by level. Nodes that are never reached lie on cycles,
    /// because every node has at most one parent.
    fn place(&mut self, max_depth: usize) -> Result<(), ReadError> {
        let mut level: Vec<usize> = (0..self.nodes.len()).filter(|&i| self.is_root[i]).collect();
        let mut reached = vec![false; self.nodes.len()];
        let mut depth = 0;
        while let Some(&first) = level.first() {
            depth += 1;
            if depth > max_depth {
                return Err(self.nodes[first].error_with(
                    format!("nodes are nested deeper than {max_depth} levels"),
                    "flatten the hierarchy",
                ));
            }
            let mut below = Vec::new();
            for i in level {
                reached[i] = true;
                if !self.world[i].is_finite() {
                    return Err(self.nodes[i]
                        .error("its transform, with those above it, is too large to be computed"));
                }
                for &child in &self.children[i] {
                    self.world[child] = self.world[i] * self.local[child].matrix();
                    below.push(child);
                }
            }
            level = below;
        }
        match reached.iter().position(|r| !r) {
            Some(i) => {
                Err(self.nodes[i].error("the node is its own descendant; nodes must form trees"))
            }
            None => Ok(()),
        }
    }

    /// The matrix `world_from_node` of a node.
    pub fn world(&self, node: usize) -> DAffine3 {
        self.world[node]
    }

    /// The number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// All nodes, parents before children: number, parent's number, placement relative to the
    /// parent, and the node.
    pub fn top_down(&self) -> Vec<(usize, Option<usize>, Placement, &Json<'a>)> {
        let mut order: Vec<(usize, Option<usize>)> =
            (0..self.nodes.len()).filter(|&i| self.is_root[i]).map(|i| (i, None)).collect();
        let mut next = 0;
        while let Some(&(i, _)) = order.get(next) {
            order.extend(self.children[i].iter().map(|&child| (child, Some(i))));
            next += 1;
        }
        order.into_iter().map(|(i, parent)| (i, parent, self.local[i], &self.nodes[i])).collect()
    }

    /// The root nodes of the scene to be shown: the requested one, or the default scene, or the
    /// first, or else all nodes without a parent.
    ///
    /// A root may not be a child of another node, but in some files it is. Such a node is shown
    /// once: below its parent if a root leads there, otherwise at the top, without its parent.
    fn shown_roots(&mut self, reader: &mut Reader<'a>) -> Result<Vec<usize>, ReadError> {
        let scenes = reader.root.items_of("scenes")?;
        reader.scene.scenes = scenes.iter().map(Json::name).collect();
        let usual = reader.root.get("scene")?.map(|s| s.size()).transpose()?;
        let wanted = wanted_scene(reader)?;
        let chosen = wanted.or(usual);
        if let Some(index) = chosen.filter(|&i| i >= scenes.len()) {
            let name = &reader.input.name;
            let rest = match scenes.len() {
                0 => "there are none; every node is shown".into(),
                count => format!("there are {count}; number 0 is shown"),
            };
            reader
                .scene
                .warn(format!("{name}: \"scene\" asks for scene number {index}, but {rest}"));
        }
        let index = chosen.filter(|&i| i < scenes.len()).unwrap_or(0);
        let Some(scene) = scenes.get(index) else {
            return Ok((0..self.nodes.len()).filter(|&i| self.is_root[i]).collect());
        };
        if scenes.len() > 1 && wanted.is_none() {
            reader.scene.warn_of(
                WarningKind::Choice,
                format!("the file has {} scenes; number {index} is shown", scenes.len()),
            );
        }
        let mut roots: Vec<usize> = Vec::new();
        let mut listed = vec![false; self.nodes.len()];
        for node in scene.items_of("nodes")? {
            let i = node.size()?;
            if std::mem::replace(&mut listed[i], true) {
                reader.scene.warn("a node is listed twice in its scene; it is shown once");
            } else {
                roots.push(i);
            }
        }
        let mut parent = vec![None; self.nodes.len()];
        for (i, below) in self.children.iter().enumerate() {
            below.iter().for_each(|&child| parent[child] = Some(i));
        }
        let mut detached = Vec::new();
        roots.retain(|&root| {
            let Some(first) = parent[root] else { return true };
            let mut above = std::iter::successors(Some(first), |&i| parent[i]);
            let is_below_shown = above.any(|i| listed[i]);
            reader.scene.warn(if is_below_shown {
                "a node at the top of the scene is also a child of another; it is shown once, as \
                    that child"
            } else {
                "a node at the top of the scene is a child of another, which is not shown; it is \
                    shown without it"
            });
            if !is_below_shown {
                detached.push(root);
            }
            !is_below_shown
        });
        if !detached.is_empty() {
            self.detach(&detached, reader.input.options.limits.depth)?;
        }
        Ok(roots)
    }
}

/// Index of the scene that was requested by name or number.
fn wanted_scene(reader: &Reader) -> Result<Option<usize>, ReadError> {
    let Some(wanted) = &reader.input.options.scene else { return Ok(None) };
    let names = &reader.scene.scenes;
    let by_number = || wanted.parse().ok().filter(|&i| i < names.len());
    if let Some(i) = names.iter().position(|name| name == wanted).or_else(by_number) {
        return Ok(Some(i));
    }
    let known: Vec<String> =
        names.iter().enumerate().map(|(i, name)| format!("{i} \"{name}\"")).collect();
    let remedy = if known.is_empty() {
        "the file has none".into()
    } else {
        format!("choose one of {}", known.join(", "))
    };
    Err(reader.root.error_with(format!("there is no scene \"{wanted}\""), remedy))
}

/// Reads `parent_from_node`: the matrix, or translation, rotation and scale.
fn placement(node: &Json) -> Result<Placement, ReadError> {
    let Some(matrix) = node.get("matrix")? else {
        let translation = node.numbers_or("translation", [0.0; 3])?;
        let rotation = node.numbers_or("rotation", [0.0, 0.0, 0.0, 1.0])?;
        let scale = node.numbers_or("scale", [1.0; 3])?;
        return Ok(from_parts(translation, rotation, scale));
    };
    let m = matrix.numbers::<16>()?;
    // A matrix of zeros hides what is in the node, as a scale of 0 does.
    let is_zero = m.iter().all(|&x| x == 0.0);
    let is_affine = [m[3], m[7], m[11], m[15] - 1.0].iter().all(|x| x.abs() <= 1e-6);
    if !is_zero && !is_affine {
        return Err(matrix.error("the matrix is a projection; its last row must be 0 0 0 1"));
    }
    let column = |c: usize| DVec3::new(m[c], m[c + 1], m[c + 2]);
    let linear = DMat3::from_cols(column(0), column(4), column(8));
    Ok(Placement::Matrix(DAffine3 { matrix3: linear, translation: column(12) }))
}

/// A placement that scales, then rotates (by a quaternion x y z w, normalised here; zero is the
/// identity), then translates.
pub(super) fn from_parts(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> Placement {
    let rotation = DQuat::from_array(rotation);
    let rotation =
        if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    Placement::Parts { translation: translation.into(), rotation, scale: scale.into() }
}

/// Meshes of the file that are already in the scene.
#[derive(Default)]
struct MeshNodes {
    /// Mesh nodes, by the number of the mesh and the bits of its morph weights.
    shared: BTreeMap<(usize, Vec<u64>), NodeId>,
    /// Numbers of all meshes shown, including skinned ones.
    shown: BTreeSet<usize>,
}

/// A node of the file still to be read.
struct Waiting {
    node: usize,
    /// The parent node in the scene.
    parent: NodeId,
    /// False if the node or an ancestor is never shown.
    is_visible: bool,
    /// The nodes whose visibility changes, among the node and its ancestors.
    switches: Vec<usize>,
}

/// Reads the scene to be shown into the scene graph.
pub(super) fn read_scene(reader: &mut Reader) -> Result<(), ReadError> {
    let mut hierarchy = Hierarchy::read(reader)?;
    let roots = hierarchy.shown_roots(reader)?.into_iter();
    let light_scale = light::scale(reader)?;
    let mut rig = animation::Rig::read(reader, &hierarchy)?;
    let mut meshes = MeshNodes::default();
    let root = reader.scene.root;
    let mut placed = Placed { light_scale, ..Placed::default() };
    let mut queue: VecDeque<Waiting> = roots
        .map(|node| Waiting { node, parent: root, is_visible: true, switches: Vec::new() })
        .collect();
    while let Some(Waiting { node: i, parent, mut is_visible, mut switches }) = queue.pop_front() {
        let node = &hierarchy.nodes[i];
        let transform = hierarchy.local[i].matrix();
        let id = reader.scene.add_child(parent, Node { transform, ..Node::named(node.name()) });
        rig.carries_node(i, id);
        let (cameras, lights) = (reader.scene.cameras.len(), reader.scene.lights.len());
        if let Some(camera) = camera::read(reader, node, &hierarchy.world[i])? {
            placed.cameras.push((cameras, camera));
            rig.carries_cameras(i, cameras..cameras + 1);
        }
        // The content of a node whose visibility changes is put into a node of its own.
        let mut content = id;
        if rig.is_switched(i) {
            content = reader.scene.add_child(id, Node::default());
            rig.switches(&[i], Switched::Node(id, content));
            switches.push(i);
        } else {
            is_visible &= animation::is_visible(node)?;
        }
        let below = |&child: &usize| Waiting {
            node: child,
            parent: content,
            is_visible,
            switches: switches.clone(),
        };
        queue.extend(hierarchy.children[i].iter().map(below));
        if !is_visible {
            continue;
        }
        if let Some(light) = light::read(reader, node, &hierarchy.world[i], light_scale)? {
            placed.lights.push((lights, light, hierarchy.world[i]));
        }
        light::read_ies(reader, node, &hierarchy.world[i], light_scale)?;
        rig.carries_lights(i, lights..reader.scene.lights.len());
        (lights..reader.scene.lights.len())
            .for_each(|light| rig.switches(&switches, Switched::Light(light)));
        read_mesh(reader, &hierarchy, (i, &switches), content, &mut meshes, &mut rig)?;
    }
    rig.finish(reader, &placed)?;
    if hierarchy.nodes.is_empty() {
        read_meshes_without_nodes(reader, &mut meshes)?;
    }
    check_unseen(reader, &meshes.shown)
}

/// Shows all meshes of a file without nodes, untransformed: such a file is a library of meshes
/// rather than a scene.
fn read_meshes_without_nodes(reader: &mut Reader, shown: &mut MeshNodes) -> Result<(), ReadError> {
    for (i, mesh) in reader.root.items_of("meshes")?.iter().enumerate() {
        if i == 0 {
            reader.scene.warn_of(
                WarningKind::Choice,
                "the file has meshes, but no nodes to place them; they are shown where their \
                    vertices are",
            );
        }
        let surfaces = still_surfaces(reader, mesh, &[])?;
        let root = reader.scene.root;
        reader.scene.add_child(root, Node { surfaces, ..Node::named(mesh.name()) });
        shown.shown.insert(i);
    }
    Ok(())
}

/// Checks everything that the shown scene does not use, so that a damaged file is reported
/// whichever scene is shown.
fn check_unseen(reader: &mut Reader, seen: &BTreeSet<usize>) -> Result<(), ReadError> {
    for skin in reader.root.items_of("skins")? {
        skin::read(reader, &skin)?;
    }
    let warnings = reader.scene.warnings.clone();
    for (i, mesh) in reader.root.items_of("meshes")?.iter().enumerate() {
        if !seen.contains(&i) {
            mesh::read_primitives(reader, mesh, &[], false)?;
        }
    }
    // Warnings about meshes that are not shown are dropped.
    reader.scene.warnings = warnings;
    if reader.root.items_of("meshes")?.is_empty() {
        reader.scene.warn("the file has no meshes, so that nothing is visible");
    } else if seen.is_empty() {
        reader.scene.warn("the file has meshes, but no node of the scene shows one");
    }
    Ok(())
}

/// Places the mesh of a node, if it has one.
fn read_mesh(
    reader: &mut Reader,
    hierarchy: &Hierarchy,
    (i, switches): (usize, &[usize]),
    id: NodeId,
    meshes: &mut MeshNodes,
    rig: &mut animation::Rig,
) -> Result<(), ReadError> {
    let node = &hierarchy.nodes[i];
    let Some(index) = node.get("mesh")? else { return Ok(()) };
    let mesh = &reader.root.entry("meshes", &index)?;
    let weights = morph::weights(node, mesh)?;
    meshes.shown.insert(index.size()?);
    if let Some(skin) = node.get("skin")? {
        // The skin places the mesh in the world; the node's own transform is ignored (glTF 2.0,
        // section 3.7.3.3).
        let skin = skin::read(reader, &reader.root.entry("skins", &skin)?)?;
        let matrices = skin::joint_matrices(&skin, hierarchy);
        let mut parent = reader.scene.root;
        if !switches.is_empty() {
            parent = reader.scene.add_child(parent, Node::default());
        }
        let shown = reader.scene.add_child(parent, Node::named(mesh.name()));
        rig.switches(switches, Switched::Node(parent, shown));
        return bent_mesh(reader, mesh, i, shown, &weights, Some((skin, matrices)), rig);
    }
    let shared = if rig.has_weights(i) {
        let shown = reader.scene.add_node(Node::named(mesh.name()));
        bent_mesh(reader, mesh, i, shown, &weights, None, rig)?;
        shown
    } else {
        let key = (index.size()?, weights.iter().map(|w| w.to_bits()).collect());
        match meshes.shared.get(&key) {
            Some(&shared) => shared,
            None => {
                let surfaces = still_surfaces(reader, mesh, &weights)?;
                let shared = reader.scene.add_node(Node { surfaces, ..Node::named(mesh.name()) });
                meshes.shared.insert(key, shared);
                shared
            }
        }
    };
    match instancing::transforms(reader, node)? {
        None => reader.scene.nodes[id.index()].children.push(shared),
        Some(instances) => {
            for transform in instances {
                reader
                    .scene
                    .add_child(id, Node { transform, children: vec![shared], ..Node::default() });
            }
        }
    }
    Ok(())
}

/// The surfaces of a mesh that is never deformed after reading.
fn still_surfaces(
    reader: &mut Reader,
    mesh: &Json,
    weights: &[f64],
) -> Result<Vec<Surface>, ReadError> {
    let mut surfaces = Vec::new();
    for mut primitive in mesh::read_primitives(reader, mesh, weights, false)? {
        if !primitive.targets.is_empty() {
            morph_mesh(&mut primitive.mesh, &primitive.targets, weights);
        }
        mesh::drop_unused(&mut primitive);
        let Primitive { mesh: shown, strokes, material, .. } = primitive;
        match strokes {
            None => surfaces.push(surface(reader, shown, material)),
            Some(mut strokes) => {
                surfaces.extend(drawn(reader, mesh, &shown, &mut strokes, material));
            }
        }
    }
    Ok(surfaces)
}

/// Gives a node the surfaces of a mesh, deformed by the mesh's current weights and skin (with the
/// skin's matrices), and records the surfaces for the motion.
fn bent_mesh(
    reader: &mut Reader,
    mesh: &Json,
    bearer: usize,
    shown: NodeId,
    weights: &[f64],
    skin: Option<(Skin, Vec<DAffine3>)>,
    rig: &mut animation::Rig,
) -> Result<(), ReadError> {
    let (skin, matrices) = skin.unwrap_or_default();
    let skin = Arc::new(rig.with_joints(skin));
    for mut primitive in mesh::read_primitives(reader, mesh, weights, rig.has_weights(bearer))? {
        mesh::drop_unused(&mut primitive);
        let Primitive { mesh: rest, targets, influences, strokes, material } = primitive;
        let (weights, joint) = (weights.to_vec(), rig.joint(bearer));
        let deformed = Deformed {
            node: shown,
            surface: reader.scene.nodes[shown.index()].surfaces.len(),
            rest: Arc::new(rest),
            morph: (!targets.is_empty()).then_some(Morph {
                targets,
                weights: weights.clone(),
                joint,
            }),
            skin: (!influences.is_empty() && !matrices.is_empty())
                .then(|| (skin.clone(), influences)),
        };
        let now = deformed.mesh(&weights, &matrices).map_err(|joint| {
            mesh.error(format!(
                "a vertex is moved by joint {joint}, but its skin has {} joints",
                matrices.len()
            ))
        })?;
        if let Some(mut strokes) = strokes {
            let surface = drawn(reader, mesh, &now, &mut strokes, material);
            reader.scene.nodes[shown.index()].surfaces.extend(surface);
            if rig.has_weights(bearer) || deformed.skin.is_some() {
                let place = mesh.place();
                reader.scene.warn(format!(
                    "{place}: points and lines do not deform in motion; they keep their first shape"
                ));
            }
            continue;
        }
        let surface = surface(reader, now, material);
        reader.scene.nodes[shown.index()].surfaces.push(surface);
        rig.bends(deformed);
    }
    Ok(())
}

/// Points and lines of the vertices of a mesh, as balls and tubes; the first are named in a
/// warning.
fn drawn(
    reader: &mut Reader,
    json: &Json,
    mesh: &TriangleMesh,
    strokes: &mut Strokes,
    material: Option<usize>,
) -> Option<Surface> {
    strokes.keep_visible(&mesh.positions);
    let radii = Radii::of(&[strokes], &mesh.positions, Bounds3d::EMPTY);
    let said = radii.describe(&[strokes]);
    reader.drawn.get_or_insert_with(|| (format!("{}: {said}", json.place()), 0)).1 += 1;
    let curves = strokes.curves(&mesh.positions, &mesh.colors, radii)?;
    let material = material_id(reader, material);
    Some(Surface::with_material(Geometry::Curves(Arc::new(curves)), material))
}

fn surface(reader: &mut Reader, mesh: TriangleMesh, material: Option<usize>) -> Surface {
    let material = material_id(reader, material);
    Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material)
}

fn material_id(reader: &mut Reader, material: Option<usize>) -> MaterialId {
    match material {
        Some(index) => MaterialId(index as u32),
        None => super::material::default_material(reader),
    }
}
