//! Wavefront OBJ, with its materials in MTL files.
//!
//! `parse.rs` turns a piece of the text into lists of vertices and faces as they stand in the file,
//! and `file.rs` joins the pieces; `build.rs` makes indexed meshes of them, one per object (`o`);
//! `mtl.rs` reads the materials, and `material.rs` converts them. Polygons of any size are
//! triangulated; points and lines become balls and tubes (`strokes.rs`); free-form surfaces are
//! skipped with a warning.
//!
//! Normals: those of the file (`vn`). Faces without any: smoothed within their smoothing group (`s
//! 1`), flat after `s off`, and by angle (40°) in files without `s`. Vertex colours (`v x y z r g
//! b`) are sRGB.

mod build;
mod file;
mod material;
mod mtl;
mod parse;

pub use material::HEIGHT_OF_BUMPS;

use super::notes::Notes;
use crate::strokes::{Radii, Strokes};
use crate::{Input, ReadError, SceneReader};
use snell_intersect::TriangleMesh;
use snell_math::{Bounds3d, DVec3};
use snell_scene::{Geometry, MaterialId, Node, Scene, Surface, WarningKind};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The emission `Ke` from which on a surface is a lamp. Some files have `Ke 1 1 1` for these.
const LEAST_LAMP: f32 = 0.99;

/// The reader of OBJ files. OBJ has no reliable signature, so it must be tried last.
pub const READER: SceneReader = SceneReader {
    name: "obj",
    description: "Wavefront OBJ polygon meshes, with MTL materials",
    extensions: &["obj"],
    recognises: parse::recognises,
    read,
};

fn read(input: &Input) -> Result<Scene, ReadError> {
    let mut notes = Notes::default();
    let mut file = file::parse(input, &mut notes)?;
    let objects = build::objects(input, &mut file, &mut notes)?;
    let mut scene = Scene::new(input.stem());
    let materials = material::materials(input, &file, &mut scene, &mut notes)?;
    let parent = match objects.len() {
        0 | 1 => scene.root,
        _ => scene.add_child(scene.root, Node::named(input.stem())),
    };
    let strokes = stroke_surfaces(input, &file, &materials, &mut notes);
    if objects.is_empty() && strokes.is_empty() {
        notes.add("nothing to show", || {
            format!(
                "{}: there are no triangles to show; export it again with its faces",
                input.name
            )
        });
    }
    for object in objects {
        let name = if object.name.is_empty() { input.stem() } else { object.name };
        let surface = Surface {
            geometry: Geometry::Mesh(Arc::new(object.mesh)),
            materials: object
                .materials
                .iter()
                .map(|&m| materials.get(m as usize).copied().flatten())
                .collect(),
        };
        scene.add_child(parent, Node { surfaces: vec![surface], ..Node::named(name) });
    }
    if !strokes.is_empty() {
        let name = format!("{} (points and lines)", input.stem());
        scene.add_child(scene.root, Node { surfaces: strokes, ..Node::named(name) });
    }
    notes.finish(&mut scene);
    snell_scene::framing::light_unless_lit(&mut scene, DVec3::Y, LEAST_LAMP);
    Ok(scene)
}

/// Points and lines as balls and tubes, one surface for each material.
fn stroke_surfaces(
    input: &Input,
    file: &file::ObjFile,
    materials: &[Option<MaterialId>],
    notes: &mut Notes,
) -> Vec<Surface> {
    let mut by_material: BTreeMap<Option<u32>, Strokes> = BTreeMap::new();
    for stroke in &file.strokes {
        by_material.entry(stroke.material).or_default().push(stroke.vertices.iter().copied());
    }
    by_material.values_mut().for_each(|strokes| strokes.keep_visible(&file.positions));
    let all: Vec<&Strokes> = by_material.values().collect();
    if all.is_empty() {
        return Vec::new();
    }
    let finite = file.positions.iter().map(|p| p.as_dvec3()).filter(|p| p.is_finite());
    let around = finite.fold(Bounds3d::EMPTY, |all, at| all.union(&Bounds3d { min: at, max: at }));
    let radii = Radii::of(&all, &file.positions, around);
    let said = radii.describe(&all);
    notes.add_of(WarningKind::Choice, "lines", || format!("{}: {said}", input.name));
    let surface = |(material, strokes): (&Option<u32>, &Strokes)| {
        let curves = strokes.curves(&file.positions, &file.colors, radii)?;
        let material = material.and_then(|m| materials.get(m as usize).copied().flatten());
        Some(Surface { geometry: Geometry::Curves(Arc::new(curves)), materials: vec![material] })
    };
    by_material.iter().filter_map(surface).collect()
}

/// Reads all objects as one mesh without materials and without computed normals.
pub(super) fn parse_mesh(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    let (mut mesh, _) = parse_with_materials(input, notes)?;
    mesh.material_slots = Vec::new();
    Ok(mesh)
}

/// Reads all objects as one mesh without computed normals, and the names of its materials by slot;
/// empty for none.
pub(super) fn parse_with_materials(
    input: &Input,
    notes: &mut Notes,
) -> Result<(TriangleMesh, Vec<String>), ReadError> {
    let mut file = file::parse(input, notes)?;
    if !file.strokes.is_empty() {
        notes.add_times(file.strokes.len() as u64, "strokes", || {
            format!("{}: points and lines are left out of a mesh that a scene names", input.name)
        });
    }
    let build::Object { mesh, materials, .. } = build::one_object(input, &mut file, notes)?;
    let name = |number: u32| file.materials.get(number as usize).map(|(name, _)| name.clone());
    Ok((mesh, materials.into_iter().map(|number| name(number).unwrap_or_default()).collect()))
}
