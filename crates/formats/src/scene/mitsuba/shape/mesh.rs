//! Meshes in files.

use super::super::Builder;
use super::super::object::Object;
use super::super::serialized::{self, Serialized};
use super::super::texture::Attributes;
use super::super::value::shortened;
use super::Part;
use super::attribute::{self, Shown, Use};
use crate::Input;
use crate::mesh::{part_of, read_near};
use crate::scene::fault::Fault;
use crate::scene::shapes::wind_by_normals;
use snell_intersect::TriangleMesh;
use snell_math::{DVec3, Vec3};
use snell_scene::Warning;
use std::sync::Arc;

/// A mesh of a file.
#[derive(Clone, Debug)]
pub struct KnownMesh {
    pub mesh: Arc<TriangleMesh>,
    /// The place of the mesh's zero in the file.
    pub origin: DVec3,
    /// True if the normals of its vertices turned triangles over.
    pub is_turned: bool,
    /// The name of the material of each triangle in an OBJ file; empty without materials.
    materials: Arc<[Arc<str>]>,
}

/// A mesh that was read.
struct MeshRead {
    mesh: TriangleMesh,
    origin: DVec3,
    /// The name of the material of each triangle in an OBJ file; empty without materials.
    materials: Vec<Arc<str>>,
    /// True if the normals of its vertices turned triangles over.
    is_turned: bool,
    /// The attributes that are shown and that the mesh lacks.
    missing: Vec<String>,
    /// The attributes that are shown, but have another number of values than the mesh has vertices
    /// or triangles, with this number.
    misfits: Vec<(String, usize)>,
    /// Warnings about the file.
    warnings: Vec<(&'static str, Warning)>,
}

/// Options for reading a mesh from its file.
#[derive(Debug)]
struct Reading {
    is_serialized: bool,
    /// Index of the mesh in a serialized file.
    index: usize,
    flips_v: bool,
    is_flat: bool,
    /// Edges sharper than this stay sharp, in degrees.
    crease: Option<f64>,
    is_flipped: bool,
    /// True if its transform is a mirror.
    is_mirrored: bool,
    /// The attributes that the mesh keeps.
    shown: Attributes,
}

impl Reading {
    fn of(object: &Object, shown: Attributes) -> Result<Self, Fault> {
        for name in ["srgb", "collapse"] {
            object.get(name);
        }
        Ok(Self {
            is_serialized: object.kind == "serialized",
            index: object
                .integer_within("shape_index", [0, i64::from(u32::MAX)])?
                .map_or(0, |index| index as usize),
            flips_v: object.bool_or("flip_tex_coords", object.kind == "obj")?,
            is_flat: object.bool_or("face_normals", false)?,
            crease: object.float("max_smooth_angle")?,
            is_flipped: object.bool_or("flip_normals", false)?,
            is_mirrored: object.transform("to_world")?.matrix3.determinant() < 0.0,
            shown,
        })
    }

    /// Reads the mesh.
    fn mesh(&self, mut input: Input) -> Result<MeshRead, Fault> {
        let mut is_flat = self.is_flat;
        let (mut faces, mut materials, mut warnings) = (None, Vec::new(), Vec::new());
        let mut mesh = if self.is_serialized {
            let read = |input: &Input| serialized::read(input, self.index);
            let read = read_near(&mut input, |read: &Serialized| &read.mesh, read)?;
            is_flat |= read.is_flat;
            read.mesh
        } else {
            let read = crate::mesh::read_named_mesh(&mut input)?;
            (faces, warnings) = (read.faces, read.warnings);
            materials = of_triangles(&read.mesh, read.materials);
            read.mesh
        };
        let (input, origin) = (&input, input.origin);
        mesh.material_slots.clear();
        let mut on_triangles = Vec::new();
        let (mut missing, mut misfits) = (Vec::new(), Vec::new());
        let shown = [(&self.shown.number, Use::Number), (&self.shown.color, Use::Color)];
        for (name, use_as) in shown {
            let Some(name) = name else { continue };
            match attribute::show(input, &mut mesh, faces.as_deref(), name, use_as)? {
                Shown::OnVertices => {}
                Shown::OnTriangles(values) => on_triangles.push(values),
                Shown::Missing => missing.push(name.clone()),
                Shown::Misfit(count) => misfits.push((name.clone(), count)),
            }
        }
        if self.shown.color.as_ref().is_none_or(|name| {
            missing.contains(name) || misfits.iter().any(|(misfit, _)| misfit == name)
        }) {
            mesh.colors.clear();
        }
        let mut is_turned = false;
        // Mitsuba computes normals of the triangles as they are placed: a mirror turns them over.
        let has_normals = !is_flat && self.crease.is_none() && !mesh.normals.is_empty();
        if is_flat {
            mesh.normals.clear();
        } else if let Some(crease) = self.crease {
            crate::mesh::smooth_normals(&mut mesh, crease as f32);
        } else if mesh.normals.is_empty() {
            mesh.normals = mesh.computed_normals();
        } else {
            is_turned = wind_by_normals(&mut mesh);
        }
        repair_normals(&mut mesh);
        if self.is_flipped != (self.is_mirrored && !has_normals) {
            turn_over(&mut mesh);
        }
        if self.flips_v {
            mesh = flip_v(mesh);
        }
        on_triangles.iter().for_each(|values| values.put(&mut mesh));
        Ok(MeshRead { mesh, origin, materials, is_turned, missing, misfits, warnings })
    }
}

impl Builder<'_> {
    /// The mesh of a file, or the part of it that is being read; `None` if it has no triangles.
    pub(super) fn mesh_file(
        &mut self,
        object: &Object,
        shown: Attributes,
    ) -> Result<Option<KnownMesh>, Fault> {
        let (_, at) = object.file_name()?;
        let Some(whole) = self.whole_mesh(object, shown)? else { return Ok(None) };
        if self.shapes.part == Part::All {
            return Ok(Some(whole));
        }
        let name = |triangle: usize| whole.materials.get(triangle).map_or("", |name| name);
        let mesh = part_of(&whole.mesh, |triangle| self.shapes.part.has(name(triangle)));
        if mesh.indices.is_empty() {
            return Ok(None);
        }
        self.count_triangles(at, mesh.indices.len())?;
        Ok(Some(KnownMesh { mesh: Arc::new(mesh), ..whole }))
    }

    /// The whole mesh of a file, read once; `None` if it has no triangles.
    fn whole_mesh(
        &mut self,
        object: &Object,
        shown: Attributes,
    ) -> Result<Option<KnownMesh>, Fault> {
        let (name, at) = object.file_name()?;
        let reading = Reading::of(object, shown)?;
        let path =
            self.home(name).resolve(name).map_err(|e| Fault::new(at, e.problem, e.remedy))?;
        let key = (path.canonicalize().unwrap_or(path), format!("{reading:?}"));
        if let Some(known) = self.shapes.files.get(&key) {
            return Ok(Some(known.clone()));
        }
        let MeshRead { mesh, origin, materials, is_turned, missing, misfits, warnings } =
            reading.mesh(self.open(name, at)?)?;
        self.notes.add_of_mesh(at, warnings);
        for (attribute, count) in misfits {
            let name = shortened(name);
            let is_face = attribute.starts_with("face_");
            let what = if is_face { "triangles" } else { "vertices" };
            self.note(format!("misfit {attribute}"), at, || {
                format!(
                    "\"{name}\" has {count} values of the attribute \"{attribute}\", which is not \
                        the number of its {what}; 1 was used instead"
                )
            });
        }
        for attribute in missing {
            let name = shortened(name);
            self.note(format!("no {attribute}"), at, || {
                format!("\"{name}\" has no attribute \"{attribute}\"; 1 was used instead")
            });
        }
        self.count_triangles(at, mesh.indices.len())?;
        if mesh.indices.is_empty() {
            let name = shortened(name);
            self.note("empty mesh", at, || format!("\"{name}\" has no triangles; it was left out"));
            return Ok(None);
        }
        let (mesh, materials) = (Arc::new(mesh), materials.into());
        let known = KnownMesh { mesh, origin, is_turned, materials };
        self.shapes.files.insert(key, known.clone());
        Ok(Some(known))
    }
}

/// The name of the material of each triangle, from the names by slot.
fn of_triangles(mesh: &TriangleMesh, names: Vec<String>) -> Vec<Arc<str>> {
    let names: Vec<Arc<str>> = names.into_iter().map(Arc::from).collect();
    let slot = |triangle: usize| mesh.material_slots.get(triangle).map_or(0, |slot| (*slot).into());
    (0..mesh.indices.len())
        .map_while(|triangle| names.get::<usize>(slot(triangle)).cloned())
        .collect()
}

/// Reverses the orientation of a mesh.
pub fn turn_over(mesh: &mut TriangleMesh) {
    mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
    mesh.normals.iter_mut().for_each(|n| *n = -*n);
}

/// Reverses the direction of v.
pub fn flip_v(mut mesh: TriangleMesh) -> TriangleMesh {
    mesh.uvs[0].iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    mesh
}

/// Replaces normals of zero length by those of the adjacent faces.
fn repair_normals(mesh: &mut TriangleMesh) {
    let is_bad = |n: &Vec3| n.try_normalize().is_none();
    if mesh.normals.iter().any(is_bad) {
        let computed = mesh.computed_normals();
        let bad = mesh.normals.iter_mut().zip(computed).filter(|(n, _)| is_bad(n));
        bad.for_each(|(normal, computed)| *normal = computed);
    }
}
