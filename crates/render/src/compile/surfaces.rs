//! Compiles nodes and surfaces to groups and geometries of the world.

use super::{CompileError, Moving, index};
use snell_intersect::{
    Curves, GeometryId, GroupId, Instance, MeshKey, MovingMesh, TriangleMesh, World, WorldBuilder,
};
use snell_math::{DAffine3, DVec3, Transform, Vec3};
use snell_scene::{Geometry, Material, MaterialId, NodeId, Scene, Surface, Warning};
use std::collections::HashMap;
use std::sync::Arc;

/// Meshes with fewer triangles are copied to each place of use, which is cheaper than an instance.
const SMALL_MESH: usize = 64;

/// The materials of all primitives of all geometries, and the nodes that hold them.
#[derive(Debug)]
pub struct SurfaceTable {
    geometries: Vec<GeometryMaterials>,
    /// For each group, what each of its instances passes on to the contents.
    instances: Vec<Vec<Handed>>,
    /// Nodes as they were folded into groups, once for each surface of a node.
    visits: Vec<Visit>,
    default: MaterialId,
    /// True if any geometry needs the hit filter.
    pub any_filtered: bool,
}

/// A node that was folded into a group.
#[derive(Clone, Copy, Debug)]
struct Visit {
    node: NodeId,
    /// The position in [`SurfaceTable::visits`] of the node above it in the same group.
    above: Option<u32>,
    /// The number of the surface of the node.
    surface: u32,
}

/// What an instance passes on to the group inside.
#[derive(Clone, Copy, Debug)]
struct Handed {
    /// The material for contents without a material.
    material: Option<MaterialId>,
    /// The node that holds the instance, as a position in [`SurfaceTable::visits`].
    visit: u32,
}

#[derive(Debug)]
struct GeometryMaterials {
    /// The material of each slot; `None` means the material that the instance passes on.
    slots: Vec<Option<MaterialId>>,
    /// The mesh whose triangles have slots; `None` if all use slot 0.
    mesh: Option<Arc<TriangleMesh>>,
    /// The node that holds the surface; `None` for a mesh in a group of its own.
    visit: Option<u32>,
    /// For a mesh that was transformed into the coordinates of its group: the original, the
    /// transform, and the result.
    placed: Option<(Arc<TriangleMesh>, Transform, Arc<TriangleMesh>)>,
}

impl SurfaceTable {
    /// The material of a primitive.
    pub fn material(
        &self,
        world: &World,
        instance: u32,
        geometry: u32,
        primitive: u32,
    ) -> MaterialId {
        let materials = &self.geometries[geometry as usize];
        let slot = materials
            .mesh
            .as_ref()
            .map_or(0, |m| m.material_slots.get(primitive as usize).copied().unwrap_or(0));
        if let Some(Some(id)) = materials.slots.get(usize::from(slot)) {
            return *id;
        }
        if instance == 0 {
            return self.default;
        }
        // The innermost instance that passes a material on decides.
        let path = world.instance_path(instance);
        let handed = path
            .iter()
            .rev()
            .find_map(|&(group, step)| self.instances[group.0 as usize][step].material);
        handed.unwrap_or(self.default)
    }

    /// The material of all primitives of a geometry in the root group; `None` if there may be
    /// several.
    pub fn only_material(&self, geometry: u32) -> Option<MaterialId> {
        let materials = &self.geometries[geometry as usize];
        let is_only = materials.mesh.as_ref().is_none_or(|mesh| mesh.material_slots.is_empty());
        is_only.then(|| materials.slots.first().copied().flatten().unwrap_or(self.default))
    }

    /// The materials that a geometry may have, except for those that instances pass on.
    pub fn own_materials(&self, geometry: u32) -> impl Iterator<Item = MaterialId> {
        self.geometries[geometry as usize].slots.iter().filter_map(|&m| m)
    }

    /// True if some primitive of the geometry takes its material from the instance.
    pub fn inherits(&self, geometry: u32) -> bool {
        let slots = &self.geometries[geometry as usize].slots;
        slots.is_empty() || slots.iter().any(Option::is_none)
    }

    /// The materials that instances pass on, and the default material.
    pub fn handed_down(&self) -> impl Iterator<Item = MaterialId> {
        self.instances.iter().flatten().filter_map(|i| i.material).chain([self.default])
    }

    /// The nodes from the root to the one that holds a surface.
    pub fn node_path(&self, world: &World, instance: u32, geometry: u32) -> Vec<NodeId> {
        let mut path = Vec::new();
        for (group, step) in world.instance_path(instance) {
            self.extend_path(&mut path, self.instances[group.0 as usize][step].visit);
        }
        if let Some(visit) = self.geometries[geometry as usize].visit {
            self.extend_path(&mut path, visit);
        }
        path
    }

    /// The number of a surface in the node that holds it.
    pub fn surface_number(&self, world: &World, instance: u32, geometry: u32) -> u32 {
        // A mesh in a group of its own is held by the node with its instance.
        let visit = self.geometries[geometry as usize].visit.or_else(|| {
            let &(group, step) = world.instance_path(instance).last()?;
            Some(self.instances[group.0 as usize][step].visit)
        });
        visit.map_or(0, |visit| self.visits[visit as usize].surface)
    }

    fn extend_path(&self, path: &mut Vec<NodeId>, visit: u32) {
        let start = path.len();
        let mut next = Some(visit);
        while let Some(visit) = next {
            let Visit { node, above, .. } = self.visits[visit as usize];
            path.push(node);
            next = above;
        }
        path[start..].reverse();
    }
}

/// Identifies a mesh in a group of its own, by its address and the materials that it is used with.
type MeshUse = (*const TriangleMesh, Vec<Option<MaterialId>>);

/// Identifies curves in a group of their own, by their address and material.
type CurvesUse = (*const Curves, Option<MaterialId>);

struct Compiler<'a> {
    scene: &'a Scene,
    moving: &'a Moving,
    /// The table of the same scene in another pose, if there is one.
    previous: Option<&'a SurfaceTable>,
    /// For each node: whether the node, or one below, has surfaces.
    has_surfaces: Vec<bool>,
    builder: WorldBuilder,
    table: SurfaceTable,
    parents: Vec<u32>,
    mesh_uses: HashMap<*const TriangleMesh, u32>,
    mesh_groups: HashMap<MeshUse, GroupId>,
    curve_groups: HashMap<CurvesUse, GroupId>,
    node_groups: HashMap<NodeId, GroupId>,
    warnings: &'a mut Vec<Warning>,
}

/// Compiles all surfaces of a scene. `previous` is the table of the same scene in another pose, if
/// there is one.
pub fn compile(
    scene: &Scene,
    moving: &Moving,
    materials: &[Material],
    default: MaterialId,
    previous: Option<&SurfaceTable>,
    warnings: &mut Vec<Warning>,
) -> Result<(WorldBuilder, SurfaceTable), CompileError> {
    let order = scene.topological_order()?;
    let mut parents = vec![0; scene.nodes.len()];
    let mut mesh_uses = HashMap::new();
    let mut has_surfaces = vec![false; scene.nodes.len()];
    // Children come before their parents.
    for id in &order {
        let node = &scene.nodes[id.index()];
        has_surfaces[id.index()] = !node.surfaces.is_empty();
        for child in &node.children {
            parents[child.index()] += 1;
            has_surfaces[id.index()] |= has_surfaces[child.index()];
        }
        for surface in &node.surfaces {
            if let Geometry::Mesh(mesh) = &surface.geometry {
                *mesh_uses.entry(Arc::as_ptr(mesh)).or_insert(0) += 1;
                mesh.validate()
                    .map_err(|source| CompileError::Mesh { node: node.name.clone(), source })?;
            }
        }
    }
    let table = SurfaceTable {
        geometries: Vec::new(),
        instances: vec![Vec::new()],
        visits: Vec::new(),
        default,
        any_filtered: false,
    };
    let mut compiler = Compiler {
        scene,
        moving,
        previous,
        has_surfaces,
        builder: WorldBuilder::default(),
        table,
        parents,
        mesh_uses,
        mesh_groups: HashMap::new(),
        curve_groups: HashMap::new(),
        node_groups: HashMap::new(),
        warnings,
    };
    // Shared and moving nodes are compiled first, children before parents, then the root.
    for &id in order.iter().filter(|&&id| id != scene.root) {
        let moves = moving.nodes.contains(&id) && compiler.has_surfaces[id.index()];
        if compiler.parents[id.index()] > 1 || moves {
            let group = compiler.add_group();
            compiler.fold_node(id, group, &Transform::IDENTITY, None)?;
            compiler.node_groups.insert(id, group);
        }
    }
    match Transform::new(scene.nodes[scene.root.index()].transform) {
        Some(world_from_root) => {
            compiler.fold_node(scene.root, WorldBuilder::ROOT, &world_from_root, None)?
        }
        None => compiler.warn_singular(&scene.nodes[scene.root.index()].name),
    }
    // The hit filter is decided for each geometry once all materials that may be passed on are
    // collected.
    let Compiler { mut builder, mut table, .. } = compiler;
    let needs_filter = |id: MaterialId| materials[id.index()].needs_filter();
    let handed_down = table.handed_down().any(needs_filter);
    for geometry in 0..table.geometries.len() as u32 {
        if table.own_materials(geometry).any(needs_filter)
            || (handed_down && table.inherits(geometry))
        {
            builder.set_filtered(GeometryId(geometry));
            table.any_filtered = true;
        }
    }
    Ok((builder, table))
}

impl Compiler<'_> {
    fn add_group(&mut self) -> GroupId {
        self.table.instances.push(Vec::new());
        self.builder.add_group()
    }

    fn add_instance(&mut self, group: GroupId, instance: Instance, handed: Handed) {
        self.builder.add(group, instance);
        self.table.instances[group.0 as usize].push(handed);
    }

    fn warn_singular(&mut self, name: &str) {
        self.warn(format!(
            "node \"{name}\" has a singular or non-finite transform; it and what is below it is \
                left out"
        ));
    }

    fn warn(&mut self, message: String) {
        Warning::note(self.warnings, message, 1);
    }

    /// Adds to `group` the surfaces of a node and of the nodes that only this node holds.
    /// `inherited` is the material that comes from above.
    fn fold_node(
        &mut self,
        id: NodeId,
        group: GroupId,
        group_from_node: &Transform,
        inherited: Option<MaterialId>,
    ) -> Result<(), CompileError> {
        let scene = self.scene;
        // The stack is explicit, because files may nest deeper than a thread's stack allows.
        let mut stack = vec![(id, *group_from_node, inherited, None)];
        while let Some((id, group_from_node, inherited, above)) = stack.pop() {
            let node = &scene.nodes[id.index()];
            let visit = self.table.visits.len() as u32;
            self.table.visits.push(Visit { node: id, above, surface: 0 });
            let material = node.material.or(inherited);
            for (number, surface) in node.surfaces.iter().enumerate() {
                let later = self.later_meshes(id, number, surface);
                let mut visit = visit;
                if number > 0 {
                    visit = self.table.visits.len() as u32;
                    self.table.visits.push(Visit { node: id, above, surface: number as u32 });
                }
                self.add_surface(
                    surface,
                    &later,
                    group,
                    &group_from_node,
                    Handed { material, visit },
                );
            }
            // Children are pushed in reverse, so that the first one is folded first.
            for &child in node.children.iter().rev() {
                let moves = self.moving.nodes.contains(&child);
                if moves && !self.has_surfaces[child.index()] {
                    continue;
                }
                let Some(node_from_child) = Transform::new(scene.nodes[child.index()].transform)
                else {
                    // Moving nodes give no warning, because animations scale things to nothing to
                    // hide them.
                    if !moves {
                        self.warn_singular(&scene.nodes[child.index()].name);
                    }
                    continue;
                };
                let group_from_child = group_from_node.compose(&node_from_child);
                let Some(&own) = self.node_groups.get(&child) else {
                    stack.push((child, group_from_child, material, Some(visit)));
                    continue;
                };
                let later = self.later_places(child, &group_from_node, &node_from_child);
                let instance = Instance { later, ..Instance::new(own, group_from_child) };
                self.add_instance(group, instance, Handed { material, visit });
            }
        }
        Ok(())
    }

    /// The places of a node at the poses after the first while the shutter is open; empty if the
    /// node does not move.
    fn later_places(
        &self,
        node: NodeId,
        group_from_parent: &Transform,
        first: &Transform,
    ) -> Vec<Transform> {
        let still = self.scene.nodes[node.index()].transform;
        let of_pose =
            |pose: &snell_scene::Pose| pose.transforms.get(&node).copied().unwrap_or(still);
        let places: Vec<DAffine3> = self.moving.later.iter().map(of_pose).collect();
        if places.iter().all(|place| *place == still) {
            return Vec::new();
        }
        // A node with a singular transform stays where it was before.
        let mut last = *first;
        let mut place = |map: &DAffine3| {
            last = Transform::new(*map).unwrap_or(last);
            group_from_parent.compose(&last)
        };
        places.iter().map(&mut place).collect()
    }

    /// The meshes of a surface at the poses after the first while the shutter is open; empty if the
    /// surface does not deform.
    fn later_meshes(
        &self,
        node: NodeId,
        number: usize,
        surface: &Surface,
    ) -> Vec<Arc<TriangleMesh>> {
        let Geometry::Mesh(first) = &surface.geometry else { return Vec::new() };
        let of_pose =
            |pose: &snell_scene::Pose| pose.meshes.get(&(node, number)).unwrap_or(first).clone();
        let meshes: Vec<_> = self.moving.later.iter().map(of_pose).collect();
        if meshes.iter().all(|mesh| Arc::ptr_eq(mesh, first)) { Vec::new() } else { meshes }
    }

    fn add_surface(
        &mut self,
        surface: &Surface,
        later: &[Arc<TriangleMesh>],
        group: GroupId,
        placed: &Transform,
        handed: Handed,
    ) {
        let inherited = handed.material;
        let visit = Some(handed.visit);
        let resolve = |m: &Option<MaterialId>| m.or(inherited);
        match &surface.geometry {
            Geometry::Shape(shape) => {
                self.builder.add_shape(group, shape.clone(), *placed);
                let slots = surface.materials.first().map_or(vec![inherited], |m| vec![resolve(m)]);
                self.table.geometries.push(GeometryMaterials {
                    slots,
                    mesh: None,
                    visit,
                    placed: None,
                });
            }
            Geometry::Curves(curves) => {
                let slot = surface.materials.first().map_or(inherited, resolve);
                self.add_curves(curves, slot, group, placed, handed);
            }
            Geometry::Mesh(mesh) => {
                let slot_count =
                    mesh.material_slots.iter().max().map_or(1, |&m| usize::from(m) + 1);
                let mut slots: Vec<_> = surface.materials.iter().map(resolve).collect();
                slots.resize(slots.len().max(slot_count), inherited);
                if !later.is_empty() {
                    self.add_moving_mesh(mesh, later, placed, group, slots, visit);
                    return;
                }
                let shared =
                    self.mesh_uses[&Arc::as_ptr(mesh)] > 1 && mesh.indices.len() >= SMALL_MESH;
                if shared {
                    let mesh_use = (Arc::as_ptr(mesh), slots.clone());
                    let child = match self.mesh_groups.get(&mesh_use) {
                        Some(&child) => child,
                        None => {
                            let child = self.add_group();
                            self.add_mesh(mesh.clone(), child, slots, None);
                            self.mesh_groups.insert(mesh_use, child);
                            child
                        }
                    };
                    self.add_instance(group, Instance::new(child, *placed), handed);
                } else if placed.is_identity() {
                    self.add_mesh(mesh.clone(), group, slots, visit);
                } else {
                    let there = self.brought(mesh, placed);
                    self.add_mesh(there.clone(), group, slots, visit);
                    self.table.geometries.last_mut().expect("one was added").placed =
                        Some((mesh.clone(), *placed, there));
                }
            }
        }
    }

    /// Adds curves. They stay in their own coordinates, in which they are round, so they become an
    /// instance unless `placed` is the identity.
    fn add_curves(
        &mut self,
        curves: &Arc<Curves>,
        material: Option<MaterialId>,
        group: GroupId,
        placed: &Transform,
        handed: Handed,
    ) {
        let alone =
            |visit| GeometryMaterials { slots: vec![material], mesh: None, visit, placed: None };
        if placed.is_identity() {
            self.builder.add_set(group, curves.clone());
            self.table.geometries.push(alone(Some(handed.visit)));
            return;
        }
        let curves_use = (Arc::as_ptr(curves), material);
        let child = match self.curve_groups.get(&curves_use) {
            Some(&child) => child,
            None => {
                let child = self.add_group();
                self.builder.add_set(child, curves.clone());
                self.table.geometries.push(alone(None));
                self.curve_groups.insert(curves_use, child);
                child
            }
        };
        self.add_instance(group, Instance::new(child, *placed), handed);
    }

    /// The mesh in the coordinates of a group. The transformed mesh of the previous table is used
    /// if it came from the same mesh and transform.
    fn brought(&self, mesh: &Arc<TriangleMesh>, placed: &Transform) -> Arc<TriangleMesh> {
        let before = self
            .previous
            .and_then(|table| table.geometries.get(self.table.geometries.len())?.placed.as_ref());
        match before {
            Some((old, at, there)) if Arc::ptr_eq(old, mesh) && at == placed => there.clone(),
            _ => Arc::new(mesh.transformed(placed)),
        }
    }

    fn add_moving_mesh(
        &mut self,
        first: &TriangleMesh,
        later: &[Arc<TriangleMesh>],
        placed: &Transform,
        group: GroupId,
        slots: Vec<Option<MaterialId>>,
        visit: Option<u32>,
    ) {
        let key = |mesh: &Arc<TriangleMesh>| {
            let mesh = mesh.transformed(placed);
            MeshKey { positions: mesh.positions, normals: mesh.normals }
        };
        let first = first.transformed(placed);
        match MovingMesh::new(first.clone(), later.iter().map(key).collect()) {
            Ok(moving) => {
                let mesh = (!first.material_slots.is_empty()).then(|| moving.first().clone());
                self.builder.add_moving_mesh(group, Arc::new(moving));
                self.table.geometries.push(GeometryMaterials { slots, mesh, visit, placed: None });
            }
            Err(error) => {
                self.warn(format!("a mesh is shown without its motion: {error}"));
                self.add_mesh(Arc::new(first), group, slots, visit);
            }
        }
    }

    fn add_mesh(
        &mut self,
        mesh: Arc<TriangleMesh>,
        group: GroupId,
        slots: Vec<Option<MaterialId>>,
        visit: Option<u32>,
    ) {
        let degenerate = mesh.degenerate_triangles();
        if degenerate > 0 {
            let message =
                "a degenerate or non-finite triangle is never hit; `snell doctor` on the file \
                    shows where"
                    .to_string();
            Warning::note(self.warnings, message, degenerate as u64);
        }
        let count = mesh.indices.len();
        if degenerate < count
            && (0..count).all(|i| mesh.is_degenerate(i) || is_flat(&mesh.corners(i)))
        {
            self.warn(
                "no face of a mesh has an area, so nothing is seen of it: export it again with its \
                    faces".to_string(),
            );
        }
        let id = self.builder.add_mesh(group, mesh.clone());
        debug_assert_eq!(index(id), self.table.geometries.len());
        let mesh = (!mesh.material_slots.is_empty()).then_some(mesh);
        self.table.geometries.push(GeometryMaterials { slots, mesh, visit, placed: None });
    }
}

/// True for a triangle whose corners lie on a line.
fn is_flat(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    (b - a).cross(c - a) == DVec3::ZERO
}
