//! Shapes: what each kind is, and its place, materials and light.

use super::Builder;
use super::bsdf::Look;
use super::object::Object;
use super::serialized;
use super::value::shortened;
use crate::scene::fault::{Fault, Spot};
use crate::scene::shapes::{ALONG, AROUND, ShapeTable, around_z, swept};
use snell_intersect::shape::{Cylinder, Disk, Rectangle, Sphere};
use snell_intersect::{AnyShape, Shape, TriangleMesh};
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Transform, Vec2, Vec3};
use snell_scene::material::{AlphaMode, ColorParam, Interface, Interior};
use snell_scene::{Geometry, Material, MaterialId, Node, NodeId, Surface};
use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

/// What the shapes of a scene share.
#[derive(Debug, Default)]
pub struct Shapes {
    table: ShapeTable,
    /// Meshes by path and by how they were read.
    files: HashMap<(PathBuf, String), Arc<TriangleMesh>>,
    groups: HashMap<*const Object, NodeId>,
    triangles: usize,
    /// Materials by look and by what shapes add to it.
    materials: HashMap<(Option<*const Object>, String), Vec<MaterialId>>,
}

/// What a shape adds to its materials.
#[derive(Clone, Debug, Default)]
struct Finish {
    emission: Option<ColorParam>,
    interior: Option<Interior>,
    /// Width of the whole picture of bumps on the surface, if there are any.
    picture_width: Option<f32>,
}

/// A geometry and its place in the shape's own space.
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

    /// The node of a group, which is seen only where instances place it.
    fn group(&mut self, object: &Rc<Object>) -> Result<NodeId, Fault> {
        if let Some(node) = self.shapes.groups.get(&Rc::as_ptr(object)) {
            return Ok(*node);
        }
        let node = self.scene.add_node(Node::named(object.id.clone().unwrap_or_else(|| "group".into())));
        self.shapes_in(object, node)?;
        self.shapes.groups.insert(Rc::as_ptr(object), node);
        Ok(node)
    }

    fn instance(&mut self, object: &Rc<Object>, parent: NodeId) -> Result<(), Fault> {
        let Some(group) = self.inner(object, |o| o.class == "shape")? else {
            return Err(object.fault("there is no shapegroup in it", "refer to one"));
        };
        if group.kind != "shapegroup" {
            return Err(object.fault(format!("{} is not a shapegroup", group.owner()), "put it into one"));
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
            self.note("singular", object.at, || "its transform is singular, so this is flat and was left out".into());
        }
        is_singular
    }

    fn plain_shape(&mut self, object: &Rc<Object>, parent: NodeId) -> Result<(), Fault> {
        let place = object.transform("to_world")?;
        let parts = self.parts(object)?;
        let is_textured = parts.look.layers.iter().any(|l| format!("{l:?}").contains("TextureId"));
        let plain = !is_textured && !object.bool_or("flip_normals", false)?;
        let Some((geometry, own)) = self.geometry(object, plain, &parts.look)? else { return Ok(()) };
        if self.is_singular(place * own, object) {
            return Ok(());
        }
        let mut finish = Finish { emission: parts.emission, interior: parts.interior, picture_width: None };
        if parts.look.layers.iter().any(|l| l.normal_map.is_some_and(|m| self.bumps.contains(&m.texture))) {
            finish.picture_width = Some(width_of_coordinates(&geometry, place * own));
        }
        let materials = self.materials(object, parts, &finish);
        if materials.is_empty() {
            self.note("no surface", object.at, || {
                "surfaces without a bsdf that bound no medium are not seen, and were left out".into()
            });
            return Ok(());
        }
        let surfaces = materials.iter().map(|m| Surface::with_material(geometry.clone(), *m)).collect();
        let name = object.id.clone().unwrap_or_else(|| object.kind.clone());
        self.scene.add_child(parent, Node { transform: place * own, surfaces, ..Node::named(name) });
        Ok(())
    }

    /// What stands inside of a shape.
    fn parts(&mut self, object: &Object) -> Result<Parts, Fault> {
        let mut parts = Parts::default();
        for child in &object.children {
            let inner = self.resolve(child)?;
            let known = matches!(inner.class.as_str(), "bsdf" | "emitter" | "medium");
            child.used.set(known);
            match inner.class.as_str() {
                "bsdf" => {
                    parts.look = self.bsdf(&inner)?;
                    parts.key = Some(Rc::as_ptr(&inner));
                    parts.has_bsdf = true;
                }
                "emitter" => parts.emission = self.area_emitter(&inner)?,
                "medium" if child.name == "exterior" || inner.name == "exterior" => {
                    // What is outside is what other shapes have inside, or what is around the camera.
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
            parts.look.layers =
                vec![Material::new("default", snell_scene::material::Diffuse::new(snell_math::Rgb::splat(0.5)))];
        }
        Ok(parts)
    }

    fn materials(&mut self, object: &Object, parts: Parts, finish: &Finish) -> Vec<MaterialId> {
        let key = (parts.key, format!("{finish:?}"));
        if let Some(known) = self.shapes.materials.get(&key) {
            return known.clone();
        }
        let mut layers = parts.look.layers;
        if layers.is_empty() && (finish.interior.is_some() || finish.emission.is_some()) {
            layers.push(Material::new("interface", Interface {}));
        }
        if finish.emission.is_some() && layers.len() > 1 {
            self.note("emitting blend", object.at, || {
                "an emitter with a blend of bsdfs: the last of them was used alone".into()
            });
            layers.drain(..layers.len() - 1);
            layers.iter_mut().for_each(|l| l.alpha_mode = AlphaMode::Opaque);
        }
        let finished = layers.into_iter().map(|mut material| {
            material.interior = finish.interior.or(material.interior);
            if let Some(emission) = finish.emission {
                material.emission = emission;
            }
            if let (Some(map), Some(width)) = (&mut material.normal_map, finish.picture_width)
                && self.bumps.contains(&map.texture)
            {
                // The picture covers as much more of the surface as its coordinates are slower.
                let [[a, b, _], [c, d, _]] = self.scene.textures[map.texture.index()].uv_transform;
                let shrink = (a * d - b * c).abs().sqrt();
                map.scale *= if width > 0.0 { shrink / width } else { 0.0 };
            }
            material
        });
        let finished: Vec<_> = finished.collect();
        let ids: Vec<_> = finished.into_iter().map(|m| self.scene.add_material(m)).collect();
        self.shapes.materials.insert(key, ids.clone());
        ids
    }

    /// The geometry of a shape. `plain` if its texture coordinates do not matter and its outer side is the usual one.
    fn geometry(&mut self, object: &Object, plain: bool, look: &Look) -> Result<Option<Made>, Fault> {
        Ok(Some(match object.kind.as_str() {
            "sphere" => self.sphere(object, plain)?,
            "disk" if plain => self.analytic(Disk { radius: 1.0, inner_radius: 0.0 }, DAffine3::IDENTITY),
            "disk" => self.made(object, disk())?,
            "cylinder" => self.cylinder(object, plain)?,
            "rectangle" if plain => self.analytic(Rectangle { half_size: DVec2::ONE }, DAffine3::IDENTITY),
            "rectangle" => self.made(object, rectangle())?,
            "cube" => self.made(object, cube())?,
            "obj" | "ply" | "serialized" => {
                let keeps_colors = look.uses_vertex_colors;
                let Some(mesh) = self.mesh_file(object, keeps_colors)? else { return Ok(None) };
                (Geometry::Mesh(mesh), DAffine3::IDENTITY)
            }
            _ => {
                let owner = object.owner();
                self.ignore_all(object);
                self.note(owner.clone(), object.at, || format!("{owner} is not supported; it was left out"));
                return Ok(None);
            }
        }))
    }

    fn analytic(&mut self, shape: impl Into<AnyShape>, own: DAffine3) -> Made {
        (self.shapes.table.shared(shape.into()), own)
    }

    /// A mesh made here, turned inside out if the shape says so.
    fn made(&mut self, object: &Object, mut mesh: TriangleMesh) -> Result<Made, Fault> {
        if object.bool_or("flip_normals", false)? {
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
        Err(Fault::new(at, format!("the scene has more than {limit} triangles, the limit"), "split it"))
    }

    fn sphere(&mut self, object: &Object, plain: bool) -> Result<Made, Fault> {
        let radius = object.positive("radius", 1.0)?;
        let center = object.vector("center")?.unwrap_or(DVec3::ZERO);
        let flipped = object.bool_or("flip_normals", false)?;
        if plain || !flipped {
            return Ok(self.analytic(Sphere { radius }, DAffine3::from_mat3_translation(around_z(), center)));
        }
        let mesh = swept(360.0, [AROUND, ALONG], |phi, v| {
            let (sin, cos) = ((1.0 - v) * std::f64::consts::PI).sin_cos();
            let normal = DVec3::new(sin * phi.cos(), sin * phi.sin(), cos);
            (normal * radius + center, normal)
        });
        self.made(object, flip_v(mesh))
    }

    fn cylinder(&mut self, object: &Object, plain: bool) -> Result<Made, Fault> {
        let radius = object.positive("radius", 1.0)?;
        let (p0, p1) = (object.vector("p0")?.unwrap_or(DVec3::ZERO), object.vector("p1")?.unwrap_or(DVec3::Z));
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
            let normal = DVec3::new(phi.cos(), phi.sin(), 0.0);
            (p0 + frame * (normal * radius + DVec3::Z * (height * v)), frame * normal)
        });
        self.made(object, mesh)
    }

    fn mesh_file(&mut self, object: &Object, keeps_colors: bool) -> Result<Option<Arc<TriangleMesh>>, Fault> {
        let (name, at) = object.file_name()?;
        let flips_v = object.bool_or("flip_tex_coords", object.kind == "obj")?;
        let is_flat = object.bool_or("face_normals", false)?;
        let crease = object.float("max_smooth_angle")?;
        let is_flipped = object.bool_or("flip_normals", false)?;
        let index = match object.integer_within("shape_index", [0, i64::from(u32::MAX)])? {
            Some(index) => index as usize,
            None => 0,
        };
        for name in ["srgb", "collapse"] {
            object.get(name);
        }
        let path = self.main.resolve(name).map_err(|e| Fault::new(at, e.problem, e.remedy))?;
        let path = path.canonicalize().unwrap_or(path);
        let how = format!("{flips_v} {is_flat} {crease:?} {is_flipped} {index} {keeps_colors}");
        if let Some(known) = self.shapes.files.get(&(path.clone(), how.clone())) {
            return Ok(Some(known.clone()));
        }
        let input = self.open(name, at)?;
        let mut says_flat = false;
        let mut mesh = if object.kind == "serialized" {
            let read = serialized::read(&input, index)?;
            says_flat = read.is_flat;
            read.mesh
        } else {
            let mut mesh = crate::mesh::read_mesh(&input)?;
            mesh.material_slots.clear();
            mesh
        };
        if !keeps_colors {
            mesh.colors.clear();
        }
        self.count_triangles(at, mesh.indices.len())?;
        if is_flat || says_flat {
            mesh.normals.clear();
        } else if let Some(crease) = crease {
            crate::mesh::smooth_normals(&mut mesh, crease as f32);
        } else if mesh.normals.is_empty() {
            mesh.normals = mesh.computed_normals();
        }
        repair_normals(&mut mesh);
        if is_flipped {
            turn_over(&mut mesh);
        }
        if flips_v {
            mesh = flip_v(mesh);
        }
        if mesh.indices.is_empty() {
            let name = shortened(name);
            self.note("empty mesh", at, || format!("\"{name}\" has no triangles; it was left out"));
            return Ok(None);
        }
        let mesh = Arc::new(mesh);
        self.shapes.files.insert((path, how), mesh.clone());
        Ok(Some(mesh))
    }
}

/// What stands inside of a shape.
#[derive(Debug, Default)]
struct Parts {
    look: Look,
    key: Option<*const Object>,
    has_bsdf: bool,
    emission: Option<ColorParam>,
    interior: Option<Interior>,
}

fn turn_over(mesh: &mut TriangleMesh) {
    mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
    mesh.normals.iter_mut().for_each(|n| *n = -*n);
}

fn flip_v(mut mesh: TriangleMesh) -> TriangleMesh {
    mesh.uvs[0].iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    mesh
}

/// Normals without a direction become those of the faces around.
fn repair_normals(mesh: &mut TriangleMesh) {
    let is_bad = |n: &Vec3| n.try_normalize().is_none();
    if mesh.normals.iter().any(is_bad) {
        let computed = mesh.computed_normals();
        let bad = mesh.normals.iter_mut().zip(computed).filter(|(n, _)| is_bad(n));
        bad.for_each(|(normal, computed)| *normal = computed);
    }
}

/// The unit disk, with the distance from its middle as u and the longitude as v.
fn disk() -> TriangleMesh {
    let mut mesh = swept(360.0, [AROUND, 1], |phi, v| {
        let r = 1.0 - v;
        (DVec3::new(r * phi.cos(), r * phi.sin(), 0.0), DVec3::Z)
    });
    mesh.uvs[0].iter_mut().for_each(|uv| *uv = Vec2::new(1.0 - uv.y, uv.x));
    mesh
}

/// The square from -1 to 1 in the plane of x and y.
fn rectangle() -> TriangleMesh {
    face(&mut TriangleMesh::default(), DVec3::ZERO, DVec3::X, DVec3::Y)
}

/// The cube from -1 to 1: the directions in which u and v grow on its faces are Mitsuba's.
fn cube() -> TriangleMesh {
    let faces = [
        (DVec3::NEG_Y, DVec3::Z, DVec3::X),
        (DVec3::Y, DVec3::NEG_X, DVec3::NEG_Z),
        (DVec3::X, DVec3::Y, DVec3::NEG_Z),
        (DVec3::Z, DVec3::Y, DVec3::X),
        (DVec3::NEG_X, DVec3::Y, DVec3::Z),
        (DVec3::NEG_Z, DVec3::NEG_Y, DVec3::X),
    ];
    let mut mesh = TriangleMesh::default();
    for (middle, u, v) in faces {
        mesh = face(&mut mesh, middle, u, v);
    }
    mesh
}

/// Adds a square whose coordinates grow along `u` and `v`, seen from outside of the middle, or from `u x v` if that is the origin.
fn face(mesh: &mut TriangleMesh, middle: DVec3, u: DVec3, v: DVec3) -> TriangleMesh {
    let first = mesh.positions.len() as u32;
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        mesh.positions.push((middle + u * (2.0 * x - 1.0) + v * (2.0 * y - 1.0)).as_vec3());
        mesh.uvs[0].push(Vec2::new(x as f32, y as f32));
    }
    let faces_out = u.cross(v).dot(middle) >= 0.0;
    for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
        let [b, c] = if faces_out { [b, c] } else { [c, b] };
        mesh.indices.push([a, b, c].map(|i| first + i));
    }
    std::mem::take(mesh)
}

/// How much of the scene one unit of the texture coordinates covers, by area.
fn width_of_coordinates(geometry: &Geometry, place: DAffine3) -> f32 {
    let Geometry::Mesh(mesh) = geometry else {
        let Geometry::Shape(shape) = geometry else { return 0.0 };
        let scale = place.matrix3.determinant().abs().cbrt();
        return (shape.area().sqrt() * scale) as f32;
    };
    if mesh.uvs[0].is_empty() {
        return 0.0;
    }
    let (mut world, mut uv) = (0.0, 0.0);
    for (t, corners) in mesh.indices.iter().enumerate() {
        let [a, b, c] = mesh.corners(t).map(|p| place.transform_point3(p.as_dvec3()));
        world += (b - a).cross(c - a).length();
        let [a, b, c] = corners.map(|i| mesh.uvs[0][i as usize].as_dvec2());
        uv += (b - a).perp_dot(c - a).abs();
    }
    let width = if uv > 0.0 { (world / uv).sqrt() } else { 0.0 };
    if width.is_finite() { width as f32 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_of_the_cube_look_outwards() {
        let mesh = cube();
        assert_eq!((mesh.positions.len(), mesh.indices.len()), (24, 12));
        for t in 0..12 {
            let [a, b, c] = mesh.corners(t);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0, "{t}");
        }
        let [a, b, c] = rectangle().corners(0);
        assert!((b - a).cross(c - a).z > 0.0);
    }
}
