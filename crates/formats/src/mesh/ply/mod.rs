//! Stanford PLY, text and binary of both byte orders.
//!
//! Elements and properties may come in any order; unknown ones are skipped. Used are `vertex`
//! (`x y z`, `nx ny nz`, texture coordinates `u v`, `s t` or `texture_u texture_v`, colours
//! `red green blue alpha`), `face` with a list `vertex_indices` or `vertex_index`, and `tristrips`
//! with a list of one of these names. A list `texcoord` of a face has the texture coordinates of
//! its corners; `comment TextureFile` names a picture, and `texnumber` of a face chooses one of
//! several. The words of the header may be in any case. Colours of integer types are sRGB (as
//! scanners and editors write them), those of floating-point types linear unless they go to 255.
//! Colours of faces are read where vertices have none; normals of faces are ignored, but scene
//! formats may ask for any attribute (`attribute.rs`).
//!
//! `header.rs` reads the declarations, `body.rs` the values, and `uniform.rs` the values of common
//! binary files on all cores.

mod attribute;
mod body;
mod header;
mod table;
mod uniform;

use super::colors;
use super::normals;
use super::notes::Notes;
use crate::textures::Textures;
use crate::{Input, ReadError, SceneReader};
pub use attribute::{Attribute, attribute};
use header::{Format, Header};
use snell_intersect::TriangleMesh;
use snell_math::Rgb;
use snell_scene::material::{ColorParam, Diffuse};
use snell_scene::{Encoding, Geometry, Material, Scene, WarningKind};
pub use table::points;

/// The reader of PLY files.
pub const READER: SceneReader = SceneReader {
    name: "ply",
    description: "Stanford polygon meshes, text and binary",
    extensions: &["ply"],
    recognises: |bytes| {
        let end = bytes.iter().take(80).position(|b| b"\r\n".contains(b));
        end.is_some_and(|end| bytes[..end].trim_ascii_end().eq_ignore_ascii_case(b"ply"))
    },
    read: |input| {
        let mut notes = Notes::default();
        let mut header = Header::read(input, &mut notes)?;
        header.reads_corners = true;
        let (mut mesh, faces) = parse_body(input, &header, &mut notes)?;
        if mesh.normals.is_empty() && !mesh.indices.is_empty() {
            normals::smooth(&mut mesh, normals::CREASE_ANGLE, &[]);
        }
        if !faces.colors.is_empty() {
            colors::paint(&mut mesh, &faces.colors);
        }
        let unread = body::unread(&header);
        if mesh.indices.is_empty() && !unread.is_empty() {
            notes.add_of(WarningKind::Choice, "properties", || {
                let names = unread.join(", ");
                format!("{}: these properties of the points are not shown: {names}", input.name)
            });
        }
        let mut scene = super::scene_of(input, mesh, notes);
        add_pictures(input, &header.textures, &mut scene);
        Ok(scene)
    },
};

/// Adds a diffuse material for each picture that the header names, and gives them to the mesh.
fn add_pictures(input: &Input, names: &[String], scene: &mut Scene) {
    let Some(at) = scene.nodes.iter().position(|node| !node.surfaces.is_empty()) else { return };
    let has_uvs = match &scene.nodes[at].surfaces[0].geometry {
        Geometry::Mesh(mesh) => !mesh.uvs[0].is_empty(),
        _ => false,
    };
    if let (false, Some(name)) = (has_uvs, names.first()) {
        scene.warn(format!(
            "{}: the picture \"{name}\" is not shown, because there are no texture coordinates",
            input.name
        ));
        return;
    }
    let limit = input.options.limits.files;
    if names.len() > limit {
        let count = names.len();
        scene.warn(format!(
            "{}: it names {count} pictures; those after the first {limit} are not read",
            input.name
        ));
    }
    let chooses = match &scene.nodes[at].surfaces[0].geometry {
        Geometry::Mesh(mesh) => !mesh.material_slots.is_empty(),
        _ => false,
    };
    if let (false, [first, _, ..]) = (chooses, names) {
        scene.warn(format!(
            "{}: it names {} pictures, but no \"texnumber\" of the faces chooses one; \"{first}\" \
                is shown on all",
            input.name,
            names.len()
        ));
    }
    let mut textures = Textures::default();
    let mut materials = Vec::new();
    for name in names.iter().take(input.options.limits.files) {
        let texture = textures.texture(scene, input, name, Encoding::Srgb);
        let texture = scene.add_texture(texture);
        let reflectance = ColorParam::textured(Rgb::WHITE, Some(texture));
        let material = Material::new(name.clone(), Diffuse { reflectance });
        materials.push(Some(scene.add_material(material)));
    }
    scene.nodes[at].surfaces[0].materials = materials;
}

/// Reads the mesh.
pub(super) fn parse(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    Ok(parse_faces(input, notes)?.0)
}

/// Reads the mesh, and if any face is no triangle, the number of triangles that each became.
pub(super) fn parse_faces(
    input: &Input,
    notes: &mut Notes,
) -> Result<(TriangleMesh, Option<Vec<u32>>), ReadError> {
    let header = Header::read(input, notes)?;
    let (mesh, faces) = parse_body(input, &header, notes)?;
    Ok((mesh, faces.counts))
}

fn parse_body(
    input: &Input,
    header: &Header,
    notes: &mut Notes,
) -> Result<(TriangleMesh, body::Triangulated), ReadError> {
    let mut mesh = TriangleMesh::default();
    let faces = match header.format {
        Format::Ascii => {
            let mut source = body::AsciiSource::new(input, header);
            body::read(&mut source, input, header, &mut mesh, notes)?
        }
        Format::LittleEndian => {
            let mut source = body::BinarySource::<false>::new(input, header);
            body::read(&mut source, input, header, &mut mesh, notes)?
        }
        Format::BigEndian => {
            let mut source = body::BinarySource::<true>::new(input, header);
            body::read(&mut source, input, header, &mut mesh, notes)?
        }
    };
    super::repair_normals(&mut mesh, input, notes);
    Ok((mesh, faces))
}
