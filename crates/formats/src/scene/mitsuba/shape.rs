//! Shapes: their geometry, transform, materials and emission.

mod attribute;
mod curve;
mod distances;
mod mesh;
mod primitive;

use super::Builder;
use super::bsdf::{GRAY, Look};
use super::emitter::Emission;
use super::object::{Child, Object};
use crate::scene::fault::{Fault, Spot};
use crate::scene::shapes::{ALONG, AROUND, ShapeTable, around_z, swept};
use mesh::{KnownMesh, flip_v, turn_over};
use primitive::{cube, disk, rectangle};
use snell_intersect::shape::{Cylinder, Disk, Rectangle, Sphere};
use snell_intersect::{AnyShape, Shape, StrandBasis, TriangleMesh};
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb, Transform, Vec3, real};
use snell_scene::material::{
    AlphaMode, Diffuse, Interface, Interior, MaterialKind, MetallicRoughness,
};
use snell_scene::{Geometry, Material, MaterialId, Node, NodeId, Surface};
use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

/// State that the shapes of a scene share.
#[derive(Debug, Default)]
pub struct Shapes {
    table: ShapeTable,
    /// Meshes by path and reading options.
    files: HashMap<(PathBuf, String), KnownMesh>,
    groups: HashMap<*const Object, NodeId>,
    triangles: usize,
    /// The part of a mesh that is being read; see [`Part`].
    part: Part,
    /// Materials by the BSDF's object and the text of the finish.
    materials: HashMap<(Option<*const Object>, String), Vec<MaterialId>>,
}

/// The faces of a mesh that have one of several BSDFs. Mitsuba 0.6 gives each BSDF of an OBJ mesh
/// to the faces whose material (`usemtl`) has its name.
#[derive(Clone, Debug, Default, PartialEq)]
enum Part {
    /// All faces: the usual case.
    #[default]
    All,
    /// The faces of a material, and the BSDF of its name.
    Named(String),
    /// The faces of all other materials, and no BSDF.
    Others(Vec<String>),
}

impl Part {
    /// True if a face with this material belongs to the part.
    fn has(&self, material: &str) -> bool {
        match self {
            Self::All => true,
            Self::Named(name) => name == material,
            Self::Others(names) => !names.iter().any(|name| name == material),
        }
    }
}

/// Properties that a shape adds to its materials.
#[derive(Clone, Debug, Default)]
struct Finish {
    emission: Option<Emission>,
    interior: Option<Interior>,
    /// True for a surface that is seen from outside only.
    is_one_sided: bool,
}

/// A geometry, and its transform to the shape's own space.
type Made = (Geometry, DAffine3);

impl Builder<'_> {
    /// Adds a shape below a node.
    pub(super) fn shape(&mut self, object: &Rc<Object>, parent: NodeId) -> Result<(), Fault> {
        self.enter(object)?;
        match object.kind.as_str() {
            "shapegroup" => {
                self.group(object)?;
            }
            "instance" => self.instance(object, parent)?,
            "merge" => self.shapes_in(object, parent)?,
            "obj" => self.obj_shape(object, parent)?,
            _ => self.plain_shape(object, parent)?,
        }
        self.leave();
        self.note_unused(object);
        Ok(())
    }

    fn shapes_in(&mut self, object: &Object, parent: NodeId) -> Result<(), Fault> {
        for child in object.children_where(|_| true).collect::<Vec<_>>() {
            let inner = self.resolve(child)?;
            if inner.class == "shape" {
                self.shape(&inner, parent)?;
            } else {
                child.used.set(false);
            }
        }
        Ok(())
    }

    /// The node of a group, which is visible only through instances.
    fn group(&mut self, object: &Rc<Object>) -> Result<NodeId, Fault> {
        if let Some(node) = self.shapes.groups.get(&Rc::as_ptr(object)) {
            return Ok(*node);
        }
        let node =
            self.scene.add_node(Node::named(object.id.clone().unwrap_or_else(|| "group".into())));
        self.shapes_in(object, node)?;
        self.shapes.groups.insert(Rc::as_ptr(object), node);
        Ok(node)
    }

    fn instance(&mut self, object: &Rc<Object>, parent: NodeId) -> Result<(), Fault> {
        let Some(group) = self.inner(object, |o| o.class == "shape")? else {
            return Err(object.fault("there is no shapegroup in it", "refer to one"));
        };
        if group.kind != "shapegroup" {
            return Err(
                object.fault(format!("{} is not a shapegroup", group.owner()), "put it into one")
            );
        }
        let children = vec![self.group(&group)?];
        let transform = object.transform("to_world")?;
        if self.is_singular(transform, object) {
            return Ok(());
        }
        self.scene.add_child(parent, Node { transform, children, ..Node::named("instance") });
        Ok(())
    }

    fn is_singular(&mut self, transform: DAffine3, object: &Object) -> bool {
        let is_singular = Transform::new(transform).is_none();
        if is_singular {
            self.note("singular", object.at, || {
                "its transform is singular, so this is flat and was left out".into()
            });
        }
        is_singular
    }

    /// Adds a shape of an OBJ file: in parts, if it has several BSDFs, each with a name.
    fn obj_shape(&mut self, object: &Rc<Object>, parent: NodeId) -> Result<(), Fault> {
        let mut names = Vec::new();
        for child in &object.children {
            let inner = self.resolve(child)?;
            if inner.class == "bsdf" {
                names.push(name_of(child, &inner).to_owned());
            }
        }
        if names.len() < 2 || names.iter().any(String::is_empty) {
            return self.plain_shape(object, parent);
        }
        let named = names.iter().cloned().map(Part::Named).collect::<Vec<_>>();
        for part in named.into_iter().chain([Part::Others(names)]) {
            self.shapes.part = part;
            let added = self.plain_shape(object, parent);
            self.shapes.part = Part::All;
            added?;
        }
        Ok(())
    }

    fn plain_shape(&mut self, object: &Rc<Object>, parent: NodeId) -> Result<(), Fault> {
        let place = object.transform("to_world")?;
        let mut parts = self.parts(object)?;
        let is_textured = parts.look.layers.iter().any(|layer| !layer.textures().is_empty())
            || parts.emission.as_ref().is_some_and(|e| e.radiance.texture.is_some());
        let plain = !is_textured && !is_turned_over(object)?;
        let basis = match object.kind.as_str() {
            "bsplinecurve" => Some(StrandBasis::BSpline),
            "linearcurve" => Some(StrandBasis::Linear),
            _ => None,
        };
        let (made, place) = match basis {
            // The points of curves are transformed here, because their radii are not scaled.
            Some(basis) => {
                let curves = self.curves(object, basis, place)?;
                (
                    curves.map(|curves| (Geometry::Curves(curves), DAffine3::IDENTITY)),
                    DAffine3::IDENTITY,
                )
            }
            None => (self.geometry(object, plain, &parts)?, place),
        };
        let Some((geometry, own)) = made else {
            return Ok(());
        };
        if self.is_singular(place * own, object) {
            return Ok(());
        }
        let back = self.back(object, &mut parts, &geometry)?;
        let is_one_sided = back.is_some();
        let finish =
            Finish { emission: parts.emission.clone(), interior: parts.interior, is_one_sided };
        let materials = self.materials(object, parts, &finish);
        if materials.is_empty() {
            self.mention("no surface", object.at, || {
                "surfaces without a bsdf that bound no medium are not seen, and were left out"
                    .into()
            });
            return Ok(());
        }
        let mut surfaces: Vec<_> =
            materials.iter().map(|m| Surface::with_material(geometry.clone(), *m)).collect();
        if let Some(back) = back
            && let Some(turned) = turned(&geometry)
        {
            let finish = Finish { is_one_sided, ..Finish::default() };
            let materials = self.materials(object, back, &finish);
            self.count_triangles(object.at, turned.indices.len())?;
            let turned = Geometry::Mesh(Arc::new(turned));
            surfaces.extend(materials.iter().map(|m| Surface::with_material(turned.clone(), *m)));
        }
        let name = object.id.clone().unwrap_or_else(|| object.kind.clone());
        self.scene
            .add_child(parent, Node { transform: place * own, surfaces, ..Node::named(name) });
        Ok(())
    }

    /// Reads the nested objects of a shape.
    fn parts(&mut self, object: &Object) -> Result<Parts, Fault> {
        let mut parts = Parts::default();
        for child in &object.children {
            let inner = self.resolve(child)?;
            let known = matches!(inner.class.as_str(), "bsdf" | "emitter" | "medium");
            child.used.set(known);
            match inner.class.as_str() {
                "bsdf" => {
                    match &self.shapes.part {
                        Part::Named(name) if *name == name_of(child, &inner) => {}
                        Part::Named(_) | Part::Others(_) => continue,
                        Part::All if !parts.has_bsdf => {}
                        Part::All => self.note("several bsdfs", child.at, || {
                            "a shape with several bsdfs: the last is that of all its faces".into()
                        }),
                    }
                    parts.look = self.bsdf(&inner)?;
                    parts.key = Some(Rc::as_ptr(&inner));
                    parts.has_bsdf = true;
                }
                "emitter" => parts.emission = self.area_emitter(&inner)?,
                "medium" if child.name == "exterior" || inner.name == "exterior" => {
                    // The exterior is the interior of another shape, or the medium around the
                    // camera.
                    self.medium(&inner)?;
                }
                "medium" => {
                    let medium = self.medium(&inner)?;
                    self.media.inside.extend(medium);
                    parts.interior = Some(Interior { medium, ..Interior::default() });
                }
                _ => {}
            }
        }
        if !parts.has_bsdf && parts.interior.is_none() {
            // Emitters without a BSDF reflect nothing.
            let reflectance = if parts.emission.is_some() { 0.0 } else { GRAY };
            let diffuse = Diffuse::new(Rgb::splat(reflectance));
            parts.look.layers = vec![Material::new("default", diffuse)];
            parts.look.is_one_sided = true;
        }
        Ok(parts)
    }

    /// The materials of the back, if it differs and can be seen. Bodies with the same bsdf on both
    /// sides, or with a black back, are seen from outside only, unless they are turned over.
    fn back(
        &self,
        object: &Object,
        parts: &mut Parts,
        geometry: &Geometry,
    ) -> Result<Option<Parts>, Fault> {
        let mut layers = std::mem::take(&mut parts.look.back);
        if layers.is_empty() && parts.look.is_one_sided && parts.interior.is_none() {
            layers = blackened(&parts.look.layers);
            let is_closed = match geometry {
                Geometry::Mesh(mesh) => is_closed(mesh),
                Geometry::Shape(_) | Geometry::Curves(_) => true,
            };
            let is_black = layers.iter().zip(&parts.look.layers).all(|(a, b)| a.kind == b.kind);
            if is_black || (is_closed && !is_open(object) && !is_turned_over(object)?) {
                return Ok(None);
            }
        }
        let names = |layers: &[Material]| layers.iter().map(|l| l.kind.clone()).collect::<Vec<_>>();
        let differs = names(&layers) != names(&parts.look.layers);
        let is_seen = differs || is_open(object) || is_turned_over(object)?;
        if layers.is_empty() || !is_seen || object.kind.ends_with("curve") {
            return Ok(None);
        }
        let look = Look { layers, ..parts.look.clone() };
        Ok(Some(Parts { look, key: parts.key, has_bsdf: true, ..Parts::default() }))
    }

    fn materials(&mut self, object: &Object, parts: Parts, finish: &Finish) -> Vec<MaterialId> {
        // One bsdf has other materials on the back of a surface.
        let sides =
            if finish.is_one_sided { format!("{:?}", parts.look.layers) } else { String::new() };
        let key = (parts.key, format!("{finish:?} {sides}"));
        if let Some(known) = self.shapes.materials.get(&key) {
            return known.clone();
        }
        let is_lamp = finish.emission.is_some();
        let look = if is_lamp { parts.look.with_solid_panes() } else { parts.look };
        let mut layers = look.layers;
        let is_pane = |m: &Material| matches!(m.alpha_mode, AlphaMode::Sheet(_));
        if finish.interior.is_some() && layers.last().is_some_and(is_pane) {
            // What goes through the pane enters the medium.
            layers.push(Material::new("interface", Interface {}));
        }
        if layers.is_empty() && finish.emission.is_some() && finish.interior.is_none() {
            layers.push(clear_sheet());
        } else if layers.is_empty() && (finish.interior.is_some() || finish.emission.is_some()) {
            layers.push(Material::new("interface", Interface {}));
        }
        if finish.emission.is_some() && layers.len() > 1 {
            self.note("emitting blend", object.at, || {
                "an emitter with a blend of bsdfs: the last of them was used alone".into()
            });
            layers.drain(..layers.len() - 1);
            layers.iter_mut().for_each(|l| l.alpha_mode = AlphaMode::Opaque);
        }
        if let Some(emission) = finish.emission.clone()
            && let Some(lamp) = layers.last_mut()
        {
            self.light_up(lamp, emission, object.at);
        }
        let finished = layers.into_iter().map(|mut material| {
            if !is_pane(&material) {
                material.interior = finish.interior.or(material.interior);
            }
            material.double_sided &= !finish.is_one_sided;
            material
        });
        let finished: Vec<_> = finished.collect();
        let ids: Vec<_> = finished.into_iter().map(|m| self.scene.add_material(m)).collect();
        self.shapes.materials.insert(key, ids.clone());
        ids
    }

    /// Makes a material emit. A mask leaves Mitsuba's emission as it is; here it hides the lamp
    /// from a part of the rays, and the others find more.
    fn light_up(&mut self, material: &mut Material, emission: Emission, at: Spot) {
        let Emission { mut radiance, attribute } = emission;
        if material.is_interface() {
            self.note("emitting interface", at, || {
                "an emitter with a medium inside and no bsdf: it hides what is behind it".into()
            });
        }
        if material.alpha_mode != AlphaMode::Opaque {
            let opacity = material.alpha.factor;
            if material.alpha.texture.is_some() {
                self.note("emitting mask", at, || {
                    "an emitter with a mask by a texture: its light is masked too".into()
                });
            } else if opacity > 0.0 {
                radiance.factor = radiance.factor * (1.0 / opacity);
            } else {
                *material = Material { name: material.name.clone(), ..clear_sheet() };
            }
        }
        let is_black = match &material.kind {
            MaterialKind::Diffuse(diffuse) => diffuse.reflectance.factor.is_black(),
            _ => false,
        };
        if attribute.is_some() && !is_black {
            self.mention("vertex colours of emitter", at, || {
                "an emitter by vertex colours: its bsdf has them too".into()
            });
        }
        material.emission = radiance;
        material.emission_takes_vertex_color = attribute.is_some();
        material.visible_to_camera = !self.hides_emitters;
    }

    /// The geometry of a shape. `plain` means that texture coordinates do not matter and the shape
    /// is not inverted.
    fn geometry(
        &mut self,
        object: &Object,
        plain: bool,
        parts: &Parts,
    ) -> Result<Option<Made>, Fault> {
        Ok(Some(match object.kind.as_str() {
            "sphere" => self.sphere(object, plain)?,
            "disk" if plain => {
                self.analytic(Disk { radius: 1.0, inner_radius: 0.0 }, DAffine3::IDENTITY)
            }
            "disk" => self.made(object, disk())?,
            "cylinder" => self.cylinder(object, plain)?,
            // An emitter is sampled better as a whole; other shapes are traced faster as triangles.
            "rectangle" if plain && parts.emission.is_some() => {
                self.analytic(Rectangle { half_size: DVec2::ONE }, DAffine3::IDENTITY)
            }
            "rectangle" => self.made(object, rectangle())?,
            "cube" => self.made(object, cube())?,
            "sdfgrid" => return self.distances(object),
            "obj" | "ply" | "serialized" => {
                let mut shown = parts.look.attributes.clone();
                let emitted = parts.emission.as_ref().and_then(|e| e.attribute.as_ref());
                emitted.into_iter().for_each(|name| shown.add_color(name));
                if shown.is_crowded {
                    self.note("crowded attributes", object.at, || {
                        "several attributes of a mesh for colours, or for numbers: the first of \
                            each was used for all"
                            .into()
                    });
                }
                let Some(KnownMesh { mesh, origin, is_turned, .. }) =
                    self.mesh_file(object, shown)?
                else {
                    return Ok(None);
                };
                if is_turned && parts.interior.is_some() {
                    self.note("winding around medium", object.at, || {
                        "a medium in a mesh whose vertex normals oppose its winding: it is inside \
                            by the normals, and outside in Mitsuba"
                            .into()
                    });
                }
                (Geometry::Mesh(mesh), DAffine3::from_translation(origin))
            }
            _ => {
                let owner = object.owner();
                self.ignore_all(object);
                self.note(owner.clone(), object.at, || {
                    format!("{owner} is not supported; it was left out")
                });
                return Ok(None);
            }
        }))
    }

    fn analytic(&mut self, shape: impl Into<AnyShape>, own: DAffine3) -> Made {
        (self.shapes.table.shared(shape.into()), own)
    }

    /// A mesh that was generated here, inverted if the shape requires it.
    fn made(&mut self, object: &Object, mut mesh: TriangleMesh) -> Result<Made, Fault> {
        if is_turned_over(object)? {
            turn_over(&mut mesh);
        }
        self.count_triangles(object.at, mesh.indices.len())?;
        Ok((Geometry::Mesh(Arc::new(mesh)), DAffine3::IDENTITY))
    }

    fn count_triangles(&mut self, at: Spot, count: usize) -> Result<(), Fault> {
        self.shapes.triangles += count;
        let limit = self.main.options.limits.elements;
        if self.shapes.triangles <= limit {
            return Ok(());
        }
        Err(Fault::new(
            at,
            format!("the scene has more than {limit} triangles, the limit"),
            "split it",
        ))
    }

    fn sphere(&mut self, object: &Object, plain: bool) -> Result<Made, Fault> {
        let radius = object.positive("radius", 1.0)?;
        let center = object.vector("center")?.unwrap_or(DVec3::ZERO);
        if !is_similarity(object.transform("to_world")?.matrix3) {
            self.note("stretched sphere", object.at, || {
                "a sphere that \"to_world\" stretches became an ellipsoid; Mitsuba draws a sphere"
                    .into()
            });
        }
        if plain || !is_turned_over(object)? {
            return Ok(self
                .analytic(Sphere { radius }, DAffine3::from_mat3_translation(around_z(), center)));
        }
        let mesh = swept(360.0, [AROUND, ALONG], |phi, v| {
            let (sin, cos) = real::sin_cos((1.0 - v) * std::f64::consts::PI);
            let normal = DVec3::new(sin * real::cos(phi), sin * real::sin(phi), cos);
            (normal * radius + center, normal)
        });
        self.made(object, flip_v(mesh))
    }

    fn cylinder(&mut self, object: &Object, plain: bool) -> Result<Made, Fault> {
        let radius = object.positive("radius", 1.0)?;
        let (p0, p1) =
            (object.vector("p0")?.unwrap_or(DVec3::ZERO), object.vector("p1")?.unwrap_or(DVec3::Z));
        let height = (p1 - p0).length();
        let Some(axis) = (p1 - p0).try_normalize() else {
            return Err(object.fault("p0 and p1 coincide", "give its ends"));
        };
        let (x, y) = axis.any_orthonormal_pair();
        let frame = DMat3::from_cols(x, y, axis);
        if plain {
            let place = DAffine3::from_mat3_translation(frame * around_z(), (p0 + p1) * 0.5);
            return Ok(self.analytic(Cylinder { radius, height, caps: false }, place));
        }
        let mesh = swept(360.0, [AROUND, 1], |phi, v| {
            let normal = DVec3::new(real::cos(phi), real::sin(phi), 0.0);
            (p0 + frame * (normal * radius + DVec3::Z * (height * v)), frame * normal)
        });
        self.made(object, mesh)
    }
}

/// The name of a nested object.
fn name_of<'a>(child: &'a Child, inner: &'a Object) -> &'a str {
    if child.name.is_empty() { &inner.name } else { &child.name }
}

/// True if the shape emits and has its bsdf on the other side: with `flip_normals`, and for a
/// sphere with a mirror in its transform (Sphere::update of Mitsuba), but not with both.
fn is_turned_over(object: &Object) -> Result<bool, Fault> {
    let is_mirrored =
        object.kind == "sphere" && object.transform("to_world")?.matrix3.determinant() < 0.0;
    Ok(object.bool_or("flip_normals", false)? != is_mirrored)
}

/// True if a transform keeps the ratios of all lengths, or leaves nothing to see.
fn is_similarity(matrix: DMat3) -> bool {
    if matrix.determinant() == 0.0 {
        return true;
    }
    let gram = matrix.transpose() * matrix;
    let scale = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    gram.abs_diff_eq(DMat3::from_diagonal(DVec3::splat(scale)), 1e-4 * scale)
}

/// True for shapes whose both sides can be seen from outside.
fn is_open(object: &Object) -> bool {
    matches!(object.kind.as_str(), "rectangle" | "disk" | "cylinder")
}

/// True if every edge of a mesh joins triangles that face the same way. The edges are compared by
/// sums of their hashes, of which those with opposite directions cancel.
fn is_closed(mesh: &TriangleMesh) -> bool {
    let hash = |p: Vec3| {
        // Zeros of both signs are the same place.
        let [x, y, z] = (p + Vec3::ZERO).to_array().map(|x| u64::from(x.to_bits()));
        let mixed = (x ^ y.rotate_left(21) ^ z.rotate_left(42)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9)
    };
    let sum = mesh.indices.iter().fold(0u64, |sum, triangle| {
        let [a, b, c] = triangle.map(|i| hash(mesh.positions[i as usize]));
        let edge = |a: u64, b: u64| a.wrapping_mul(b.rotate_left(17) | 1);
        let along = [(a, b), (b, c), (c, a)];
        along.iter().fold(sum, |sum, &(a, b)| sum.wrapping_add(edge(a, b)).wrapping_sub(edge(b, a)))
    });
    sum == 0
}

/// The layers with the same shares of the surface, in black.
fn blackened(layers: &[Material]) -> Vec<Material> {
    let black = |layer: &Material| Material {
        kind: Diffuse::new(Rgb::BLACK).into(),
        normal_map: None,
        bump_map: None,
        ..layer.clone()
    };
    layers.iter().map(black).collect()
}

/// A surface that lets all light through, as `null`, and may emit.
fn clear_sheet() -> Material {
    let kind = MetallicRoughness {
        ior: 1.0,
        base_color: Rgb::WHITE.into(),
        transmission: 1.0.into(),
        ..MetallicRoughness::default()
    };
    Material::new("null", kind)
}

/// The triangles of a geometry, turned over; `None` for curves.
fn turned(geometry: &Geometry) -> Option<TriangleMesh> {
    let mut mesh = match geometry {
        Geometry::Mesh(mesh) => TriangleMesh::clone(mesh),
        Geometry::Shape(shape) => shape.tessellate(AROUND)?,
        Geometry::Curves(_) => return None,
    };
    turn_over(&mut mesh);
    Some(mesh)
}

/// The nested objects of a shape.
#[derive(Debug, Default)]
struct Parts {
    look: Look,
    key: Option<*const Object>,
    has_bsdf: bool,
    emission: Option<Emission>,
    interior: Option<Interior>,
}
