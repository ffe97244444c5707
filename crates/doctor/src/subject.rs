//! A scene with data shared by several checks: its placed surfaces, their use, and the topology of
//! their meshes.

use crate::topology::Topology;
use rayon::prelude::*;
use snell_intersect::{BuildOptions, Shape, TriangleMesh, World, WorldBuilder};
use snell_math::{Bounds3d, DVec3, real};
use snell_scene::placed::{Placed, placed};
use snell_scene::{Geometry, Material, MaterialId, Scene};
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

/// The use of a mesh, over all of its placements.
#[derive(Clone, Copy, Debug, Default)]
pub struct Role {
    /// True if light enters the mesh: it bounds glass or a medium.
    pub bounds_inside: bool,
    /// True if the back of the mesh is invisible.
    pub is_one_sided: bool,
    /// True if the mesh emits on its outer side only.
    pub emits_outwards: bool,
}

/// A mesh, stored once for all its placements.
pub struct Body<'a> {
    /// The triangles.
    pub mesh: &'a Arc<TriangleMesh>,
    /// The topology of the triangles.
    pub topology: Topology,
    /// Indices of the mesh's placements in [`Subject::placed`].
    pub places: Vec<usize>,
    /// The use of the mesh.
    pub role: Role,
}

/// A scene to examine.
pub struct Subject<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// All placed surfaces of the scene.
    pub placed: Vec<Placed<'a>>,
    /// All valid meshes of the scene.
    pub bodies: Vec<Body<'a>>,
    /// For each placed surface, the index of its body; `None` if it is not a valid mesh.
    pub body_of: Vec<Option<usize>>,
    /// Invalid meshes: the placement and the error.
    pub broken: Vec<(usize, String)>,
    default: Material,
    world: OnceLock<Option<World>>,
}

impl<'a> Subject<'a> {
    /// Examines the graph and all meshes.
    pub fn new(scene: &'a Scene) -> Result<Self, String> {
        let placed = placed(scene)?;
        let mut numbers: HashMap<*const TriangleMesh, Option<usize>> = HashMap::new();
        let mut bodies: Vec<Body> = Vec::new();
        let mut broken = Vec::new();
        let mut body_of = Vec::new();
        for (i, place) in placed.iter().enumerate() {
            let Geometry::Mesh(mesh) = &place.surface.geometry else {
                body_of.push(None);
                continue;
            };
            let number = *numbers.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                if let Err(error) = mesh.validate() {
                    broken.push((i, error.to_string()));
                    return None;
                }
                bodies.push(Body {
                    mesh,
                    topology: Topology::default(),
                    places: Vec::new(),
                    role: Role::default(),
                });
                Some(bodies.len() - 1)
            });
            if let Some(number) = number {
                bodies[number].places.push(i);
            }
            body_of.push(number);
        }
        let default = snell_scene::framing::default_material();
        let mut this =
            Self { scene, placed, bodies, body_of, broken, default, world: OnceLock::new() };
        for i in 0..this.bodies.len() {
            this.bodies[i].role = this.role(&this.bodies[i]);
        }
        this.bodies.par_iter_mut().for_each(|body| body.topology = Topology::of(body.mesh));
        Ok(this)
    }

    fn role(&self, body: &Body) -> Role {
        let mut role = Role::default();
        let mut last = None;
        for &place in &body.places {
            let place = &self.placed[place];
            // Instances of one object have the same use, so consecutive ones are skipped.
            let key = (std::ptr::from_ref(place.surface), place.material(0));
            if last == Some(key) {
                continue;
            }
            last = Some(key);
            for (_, id) in place.slots() {
                let material = self.material(id);
                role.bounds_inside |= bounds_inside(material);
                role.is_one_sided |= !material.double_sided;
                role.emits_outwards |= material.is_emissive() && !material.emits_on_both_sides;
            }
        }
        role
    }

    /// The material of an id, or the default one.
    pub fn material(&self, id: Option<MaterialId>) -> &Material {
        id.and_then(|id| self.scene.materials.get(id.index())).unwrap_or(&self.default)
    }

    /// The material of a face of a placed mesh.
    pub fn material_of_face(&self, place: usize, mesh: &TriangleMesh, face: u32) -> &Material {
        let slot = mesh.material_slots.get(face as usize).copied().unwrap_or(0);
        self.material(self.placed[place].material(usize::from(slot)))
    }

    /// The name of a placed surface: the name of its node, or of its material if no node has a
    /// name.
    pub fn name(&self, place: usize) -> String {
        let placed = &self.placed[place];
        let kind = match &placed.surface.geometry {
            Geometry::Mesh(_) => "mesh",
            Geometry::Shape(shape) => shape.name(),
            Geometry::Curves(_) => "curves",
        };
        let (id, material) = (placed.node.0, &self.material(placed.material(0)).name);
        let is_named = !placed.name.is_empty()
            && placed.name != self.scene.nodes[self.scene.root.index()].name;
        match (is_named, material.as_str()) {
            (true, _) => format!("{kind} \"{}\" (node {id})", placed.name),
            (false, "") => format!("{kind} of node {id}"),
            (false, material) => format!("{kind} of node {id}, of material \"{material}\""),
        }
    }

    /// The name of a mesh, by its first placement.
    pub fn body_name(&self, body: &Body) -> String {
        let others = body.places.len().saturating_sub(1);
        let name = body.places.first().map(|&place| self.name(place)).unwrap_or_default();
        match others {
            0 => name,
            1 => format!("{name}, and at 1 more place"),
            n => format!("{name}, and at {n} more places"),
        }
    }

    /// The position of a face of a mesh, at its first placement.
    pub fn face_position(&self, body: &Body, face: u32) -> Option<[f64; 3]> {
        let place = &self.placed[*body.places.first()?];
        let [a, b, c] = body.mesh.corners(face as usize).map(|p| p.as_dvec3());
        let p = place.world_from_surface.point((a + b + c) / 3.0);
        p.is_finite().then(|| p.to_array())
    }

    /// The box around a placed surface in the world; may be infinite.
    pub fn bounds(&self, place: usize) -> Bounds3d {
        let placed = &self.placed[place];
        placed.world_from_surface.bounds(&placed.surface.geometry.bounds())
    }

    /// The box around everything that is finite.
    pub fn finite_bounds(&self) -> Bounds3d {
        let all = (0..self.placed.len()).map(|i| self.bounds(i));
        all.filter(|b| !b.is_empty() && b.is_finite()).fold(Bounds3d::EMPTY, |a, b| a.union(&b))
    }

    /// A world of everything that rays hit; `None` if it cannot be built.
    pub fn world(&self) -> Option<&World> {
        let build = || {
            let mut builder = WorldBuilder::default();
            let (mut groups, mut strands) = (HashMap::new(), HashMap::new());
            for (i, place) in self.placed.iter().enumerate() {
                match &place.surface.geometry {
                    Geometry::Shape(shape) => {
                        let shape: Arc<dyn Shape> =
                            Arc::new(snell_intersect::AnyShape::clone(shape));
                        builder.add_shape(WorldBuilder::ROOT, shape, place.world_from_surface);
                    }
                    Geometry::Mesh(mesh) if self.body_of[i].is_some() => {
                        let group = *groups.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                            let group = builder.add_group();
                            builder.add_mesh(group, mesh.clone());
                            group
                        });
                        builder.add_instance(WorldBuilder::ROOT, group, place.world_from_surface);
                    }
                    Geometry::Curves(curves) => {
                        let group = *strands.entry(Arc::as_ptr(curves)).or_insert_with(|| {
                            let group = builder.add_group();
                            builder.add_set(group, curves.clone());
                            group
                        });
                        builder.add_instance(WorldBuilder::ROOT, group, place.world_from_surface);
                    }
                    Geometry::Mesh(_) => {}
                }
            }
            builder.build(&BuildOptions::default()).ok()
        };
        self.world.get_or_init(build).as_ref()
    }

    /// The closed surfaces around a point: for each the index of its placement, and the component
    /// if it is a mesh.
    pub fn around(&self, point: DVec3) -> Vec<(usize, Option<usize>)> {
        let mut found = Vec::new();
        for (i, placed) in self.placed.iter().enumerate() {
            if !self.bounds(i).contains(point) {
                continue;
            }
            let local = placed.world_from_surface.inverse().point(point);
            match (&placed.surface.geometry, self.body_of[i]) {
                (Geometry::Shape(shape), _) => {
                    let metric = snell_intersect::shape::Metric::EUCLIDEAN;
                    if shape.is_closed() && shape.winding_number(local, &metric).abs() > 0.5 {
                        found.push((i, None));
                    }
                }
                (Geometry::Mesh(_), Some(body)) => {
                    let body = &self.bodies[body];
                    let closed: Vec<usize> = (0..body.topology.components.len())
                        .filter(|&c| {
                            let component = &body.topology.components[c];
                            component.is_closed()
                                && Bounds3d::from(component.bounds).contains(local)
                        })
                        .collect();
                    found.extend(
                        closed
                            .into_iter()
                            .filter(|&c| winding(body, c, local).abs() > 0.5)
                            .map(|c| (i, Some(c))),
                    );
                }
                _ => {}
            }
        }
        found
    }
}

/// The winding number of a component around a point: its solid angle over the full one (van
/// Oosterom and Strackee, The Solid Angle of a Plane Triangle, 1983).
fn winding(body: &Body, component: usize, point: DVec3) -> f64 {
    let faces = 0..body.mesh.indices.len();
    let angle = |face: usize| {
        if body.topology.component_of[face] as usize != component {
            return 0.0;
        }
        let [a, b, c] = body.mesh.corners(face).map(|p| p.as_dvec3() - point);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let volume = a.dot(b.cross(c));
        2.0 * real::atan2(volume, la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    };
    // Sums in blocks of fixed size, so that threads do not change the result.
    let blocks: Vec<usize> = faces.step_by(1 << 14).collect();
    let sums: Vec<f64> = blocks
        .into_par_iter()
        .map(|start| (start..(start + (1 << 14)).min(body.mesh.indices.len())).map(angle).sum())
        .collect();
    sums.iter().sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// True if light enters the interior of the surface.
pub fn bounds_inside(material: &Material) -> bool {
    material.bounded_interior().is_some()
}
