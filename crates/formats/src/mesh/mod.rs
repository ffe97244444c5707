//! Mesh files: each becomes a scene with one node, or one node per object.
//!
//! | format | file | normals where the file has none |
//! | --- | --- | --- |
//! | Wavefront OBJ, with MTL | [`obj`] | by smoothing groups; without them smooth up to 40° |
//! | Stanford PLY | [`ply`] | smooth up to 40° |
//! | STL | [`stl`] | equal positions are welded; smooth up to 40° (the file's own facet normals are ignored, since they follow from the triangles) |
//! | PCD | [`pcd`] | has points only |
//! | OFF | [`off`] | flat, as the programs that these files were made for show them |
//! | Princeton `.ray` | [`ray`] | has normals |
//!
//! Units are taken as they are, and so is the up axis. Vertices that are not finite stay, with a
//! warning: their triangles are never hit.

mod colors;
mod corners;
mod normals;
mod notes;
pub(crate) mod polygon;
pub(crate) mod text;
mod weld;

pub mod obj;
pub mod off;
pub mod pcd;
pub mod ply;
pub mod ray;
pub mod stl;

use crate::strokes::{Radii, Strokes};
use crate::{Input, ReadError, SceneReader};
use notes::Notes;
pub use ply::Attribute;
use snell_intersect::{Curves, TriangleMesh};
use snell_math::{Bounds3d, DAffine3, DVec3, Vec3};
use snell_scene::{Geometry, Node, Scene, Surface, Warning, WarningKind};
use std::sync::Arc;

/// A function that reads a mesh format.
type Parse = fn(&Input, &mut Notes) -> Result<TriangleMesh, ReadError>;

/// All mesh formats, in the order in which contents are tried, each with its reader for scenes and
/// its reader for bare meshes. Formats without a reliable signature come last.
pub(crate) const FORMATS: &[(SceneReader, Parse)] = &[
    (ply::READER, ply::parse),
    (pcd::READER, pcd::parse),
    (off::READER, off::parse),
    (stl::READER, stl::parse),
    (ray::READER, ray::parse),
    (obj::READER, obj::parse_mesh),
];

/// Reads a mesh file as one mesh, without materials, for scene files that name mesh files. The
/// format is chosen by content, then by extension. Normals are those of the file; a mesh without
/// any is shaded flat ([`smooth_normals`] computes some).
pub fn read_mesh(input: &Input) -> Result<TriangleMesh, ReadError> {
    read_noted(input, &mut Notes::default())
}

fn read_noted(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    let (_, parse) = format_of(input)?;
    parse(input, notes)
}

/// The format of a mesh file, by its content, then by its extension.
fn format_of(input: &Input) -> Result<&'static (SceneReader, Parse), ReadError> {
    let extension = input.extension();
    let by_content = FORMATS.iter().find(|(reader, _)| (reader.recognises)(&input.bytes));
    if by_content.is_none()
        && let Some((problem, remedy)) = crate::stranger::known_kind(&input.bytes, &extension)
    {
        return Err(input.error(crate::Place::Whole, problem, remedy));
    }
    let by_extension =
        || FORMATS.iter().find(|(reader, _)| reader.extensions.contains(&extension.as_str()));
    by_content.or_else(by_extension).ok_or_else(|| {
        let names: Vec<_> = FORMATS.iter().map(|(reader, _)| reader.name).collect();
        input.error(
            crate::Place::Whole,
            "this is not a mesh format that Snell knows, neither by its content nor by its \
                extension",
            format!("use one of: {}", names.join(", ")),
        )
    })
}

/// Reads a mesh again if it is far from zero for its size: then its coordinates are relative to a
/// point near it, and the root of the scene moves it to its place. (Single precision holds no
/// details of coordinates of millions.)
pub(crate) fn read_again_if_far(
    input: &mut Input,
    reader: &SceneReader,
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let bounds = scene.bounds().unwrap_or(Bounds3d::EMPTY);
    let Some(origin) = snell_scene::framing::far_origin(&bounds) else { return Ok(()) };
    input.origin = origin;
    *scene = (reader.read)(input)?;
    let root = scene.root.index();
    scene.nodes[root].transform = DAffine3::from_translation(origin);
    Ok(())
}

/// A mesh that a scene file names.
pub struct MeshRead {
    /// The mesh, as [`read_mesh`] reads it, relative to [`Self::origin`]. That of an OBJ file has
    /// the slots of its materials.
    pub mesh: TriangleMesh,
    /// The point of the file that is zero in the mesh: not zero only if the mesh is far from zero
    /// for its size, where single precision does not hold its shape.
    pub origin: DVec3,
    /// The names of the materials of an OBJ file by slot; empty for none.
    pub materials: Vec<String>,
    /// For a PLY file with other polygons than triangles, the number of triangles that each of its
    /// faces became, in the order of the triangles.
    pub faces: Option<Vec<u32>>,
    /// Warnings about the file, which name it, with the names of their kinds.
    pub warnings: Vec<(&'static str, Warning)>,
}

/// Reads a mesh that a scene file names.
pub fn read_named_mesh(input: &mut Input) -> Result<MeshRead, ReadError> {
    read_near(
        input,
        |read: &MeshRead| &read.mesh,
        |input| {
            let mut notes = Notes::default();
            let (mut faces, mut materials) = (None, Vec::new());
            let (reader, parse) = format_of(input)?;
            let mesh = match reader.name {
                "ply" => {
                    let (mesh, counts) = ply::parse_faces(input, &mut notes)?;
                    faces = counts;
                    mesh
                }
                "obj" => {
                    let (mesh, names) = obj::parse_with_materials(input, &mut notes)?;
                    materials = names;
                    mesh
                }
                _ => parse(input, &mut notes)?,
            };
            let warnings = notes.into_kinds();
            Ok(MeshRead { mesh, origin: input.origin, materials, faces, warnings })
        },
    )
}

/// Reads a mesh, and if it is far from zero for its size, reads it again relative to a point near
/// it, which becomes the origin of the input.
pub fn read_near<T>(
    input: &mut Input,
    mesh: impl Fn(&T) -> &TriangleMesh,
    read: impl Fn(&Input) -> Result<T, ReadError>,
) -> Result<T, ReadError> {
    let first = read(input)?;
    let Some(origin) = snell_scene::framing::far_origin(&mesh(&first).bounds().into()) else {
        return Ok(first);
    };
    input.origin = origin;
    read(input)
}

/// The attributes of the vertices at these places, in this order, without triangles.
pub fn vertices_at(mesh: &TriangleMesh, places: &[u32]) -> TriangleMesh {
    fn at<T: Copy>(values: &[T], places: &[u32]) -> Vec<T> {
        match values.is_empty() {
            true => Vec::new(),
            false => places.iter().map(|&i| values[i as usize]).collect(),
        }
    }
    TriangleMesh {
        positions: at(&mesh.positions, places),
        exact: at(&mesh.exact, places),
        normals: at(&mesh.normals, places),
        tangents: at(&mesh.tangents, places),
        uvs: mesh.uvs.each_ref().map(|set| at(set, places)),
        colors: at(&mesh.colors, places),
        ..TriangleMesh::default()
    }
}

/// The triangles of a mesh that are kept, by their numbers, with the vertices that they use. The
/// slots of materials are left out.
pub fn part_of(mesh: &TriangleMesh, keeps: impl Fn(usize) -> bool) -> TriangleMesh {
    const UNUSED: u32 = u32::MAX;
    let (mut numbers, mut places) = (vec![UNUSED; mesh.positions.len()], Vec::new());
    let mut indices = Vec::new();
    for (_, triangle) in mesh.indices.iter().enumerate().filter(|&(number, _)| keeps(number)) {
        indices.push(triangle.map(|vertex| {
            let number = &mut numbers[vertex as usize];
            if *number == UNUSED {
                *number = places.len() as u32;
                places.push(vertex);
            }
            *number
        }));
    }
    TriangleMesh { indices, ..vertices_at(mesh, &places) }
}

/// Reads an attribute of the vertices or faces (`element`) of a PLY file; `None` if it has none of
/// this name, or is no PLY file.
pub fn ply_attribute(
    input: &Input,
    element: &str,
    name: &str,
) -> Result<Option<Attribute>, ReadError> {
    match (ply::READER.recognises)(&input.bytes) {
        true => ply::attribute(input, element, name),
        false => Ok(None),
    }
}

/// Computes vertex normals: smooth, except across edges at which the faces meet at more than
/// `crease_degrees`, where vertices are split. Existing normals are replaced.
pub fn smooth_normals(mesh: &mut TriangleMesh, crease_degrees: f32) {
    normals::smooth(mesh, crease_degrees, &[]);
}

/// Makes a scene of one mesh.
fn scene_of(input: &Input, mesh: TriangleMesh, mut notes: Notes) -> Scene {
    let mut scene = Scene::new(input.stem());
    note_oddities(input, &mesh, &mut notes);
    let geometry = match mesh.indices.is_empty() {
        true => cloud(input, &mesh, &mut notes).map(|curves| Geometry::Curves(Arc::new(curves))),
        false => Some(Geometry::Mesh(Arc::new(mesh))),
    };
    if let Some(geometry) = geometry {
        let surface = Surface::new(geometry);
        let node = Node { surfaces: vec![surface], ..Node::named(input.stem()) };
        scene.add_child(scene.root, node);
    }
    notes.finish(&mut scene);
    scene
}

/// The vertices of a file without faces, as balls of their colours.
fn cloud(input: &Input, mesh: &TriangleMesh, notes: &mut Notes) -> Option<Curves> {
    let count = u32::try_from(mesh.positions.len()).ok()?;
    let mut points = Strokes::points((0..count).collect());
    points.keep_visible(&mesh.positions);
    let radii = Radii::of(&[&points], &mesh.positions, Bounds3d::EMPTY);
    if count == 0 {
        return None;
    }
    let said = radii.describe(&[&points]);
    notes.add_of(WarningKind::Choice, "points", || {
        format!("{}: there are no faces; {said}", input.name)
    });
    points.curves(&mesh.positions, &mesh.colors, radii)
}

/// Warns if a mesh is empty or has vertices that are not finite.
fn note_oddities(input: &Input, mesh: &TriangleMesh, notes: &mut Notes) {
    if mesh.indices.is_empty() && mesh.positions.is_empty() {
        let name = &input.name;
        notes.add("nothing to show", || {
            format!("{name}: there are no triangles to show; export it again with its faces")
        });
    }
    if mesh.indices.is_empty() {
        return;
    }
    for (i, _) in mesh.positions.iter().enumerate().filter(|(_, p)| !p.is_finite()) {
        let name = &input.name;
        notes.add_of(WarningKind::NotFinite, "not finite", || {
            format!(
                "{name}: vertex {i} (counted from 0) is not finite; triangles that use such \
                vertices are never hit"
            )
        });
    }
}

/// The error for too many elements, at the first one over the limit, or at the declared count.
fn too_many(input: &Input, place: crate::Place, what: &str) -> ReadError {
    input.error(
        place,
        format!("more than {} {what}, the limit", input.options.limits.elements),
        "split the file",
    )
}

/// Appends the triangles of a polygon with the given vertices. `place` is its place in the file.
fn push_polygon(
    input: &Input,
    place: impl FnOnce() -> crate::Place,
    mesh: &mut TriangleMesh,
    face: &[u32],
    triangulator: &mut polygon::Triangulator,
) -> Result<(), ReadError> {
    if mesh.indices.len() + face.len() > input.options.limits.elements {
        return Err(too_many(input, place(), "triangles"));
    }
    if let &[a, b, c] = face {
        mesh.indices.push([a, b, c]);
        return Ok(());
    }
    let positions = &mesh.positions;
    let triangles = triangulator.triangulate(face.iter().map(|&i| positions[i as usize]));
    mesh.indices.extend(triangles.iter().map(|t| t.map(|corner| face[corner])));
    Ok(())
}

/// Replaces normals that are not finite or have zero length by those of the adjacent faces.
fn repair_normals(mesh: &mut TriangleMesh, input: &Input, notes: &mut Notes) {
    let is_bad = |n: &Vec3| {
        !n.is_finite() || n.length_squared() < f32::MIN_POSITIVE || !n.length_squared().is_finite()
    };
    if !mesh.normals.iter().any(is_bad) {
        return;
    }
    let computed = mesh.computed_normals();
    for (i, (normal, computed)) in
        mesh.normals.iter_mut().zip(computed).enumerate().filter(|(_, (n, _))| is_bad(n))
    {
        *normal = computed;
        let name = &input.name;
        notes.add("bad normal", || {
            format!(
                "{name}: the normal of vertex {i} (counted from 0) has no direction; the faces \
                around give one"
            )
        });
    }
}

#[cfg(test)]
mod tests;
