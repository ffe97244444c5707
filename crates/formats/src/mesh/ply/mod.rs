//! Stanford PLY, text and binary of both byte orders.
//!
//! Elements and properties may come in any order; unknown ones are skipped. Used are `vertex` (`x y
//! z`, `nx ny nz`, texture coordinates `u v`, `s t` or `texture_u texture_v`, colours `red green
//! blue alpha`), `face` with a list `vertex_indices` or `vertex_index`, and `tristrips` with a list
//! of one of these names. Colours of integer types are sRGB (as scanners and editors write them),
//! those of floating-point types linear. Colours and normals of faces are ignored, but scene formats
//! may ask for any attribute (`attribute.rs`).
//!
//! `header.rs` reads the declarations, `body.rs` the values, and `uniform.rs` the values of common
//! binary files on all cores.

mod attribute;
mod body;
mod header;
mod uniform;

use super::normals;
use super::notes::Notes;
use crate::{Input, ReadError, SceneReader};
pub use attribute::{Attribute, attribute};
use header::{Format, Header};
use snell_intersect::TriangleMesh;

/// The reader of PLY files.
pub const READER: SceneReader = SceneReader {
    name: "ply",
    description: "Stanford polygon meshes, text and binary",
    extensions: &["ply"],
    recognises: |bytes| bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r"),
    read: |input| {
        let mut notes = Notes::default();
        let mut mesh = parse(input, &mut notes)?;
        if mesh.normals.is_empty() {
            normals::smooth(&mut mesh, normals::CREASE_ANGLE, &[]);
        }
        Ok(super::scene_of(input, mesh, notes))
    },
};

/// Reads the mesh.
pub(super) fn parse(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    Ok(parse_faces(input, notes)?.0)
}

/// Reads the mesh, and if any face is no triangle, the number of triangles that each became.
pub(super) fn parse_faces(
    input: &Input,
    notes: &mut Notes,
) -> Result<(TriangleMesh, Option<Vec<u32>>), ReadError> {
    let header = Header::read(input)?;
    let mut mesh = TriangleMesh::default();
    let faces = match header.format {
        Format::Ascii => {
            let mut source = body::AsciiSource::new(input, &header);
            body::read(&mut source, input, &header, &mut mesh, notes)?
        }
        Format::LittleEndian => {
            let mut source = body::BinarySource::<false>::new(input, &header);
            body::read(&mut source, input, &header, &mut mesh, notes)?
        }
        Format::BigEndian => {
            let mut source = body::BinarySource::<true>::new(input, &header);
            body::read(&mut source, input, &header, &mut mesh, notes)?
        }
    };
    super::repair_normals(&mut mesh, input, notes);
    Ok((mesh, faces))
}
