//! The old Princeton mesh format, `.ray`: records `#vertex px py pz nx ny nz s t` and
//! `#shape_polygon material n i1 .. in`. All other records are skipped.

use super::notes::Notes;
use super::polygon::Triangulator;
use super::text::{Reader, Text, decoded};
use super::too_many;
use crate::{Input, ReadError, SceneReader};
use snell_intersect::TriangleMesh;
use snell_math::{Vec2, Vec3};

/// The reader of `.ray` files.
pub const READER: SceneReader = SceneReader {
    name: "ray",
    description: "old Princeton meshes: #vertex and #shape_polygon records",
    extensions: &["ray"],
    recognises: |_| false,
    read: |input| {
        let mut notes = Notes::default();
        let mesh = parse(input, &mut notes)?;
        Ok(super::scene_of(input, mesh, notes))
    },
};

/// Reads the mesh.
pub(super) fn parse(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    let bytes = decoded(&input.bytes);
    let mut reader = Reader::new(input, &bytes, Text::new(&bytes, 0));
    let mut mesh = TriangleMesh::default();
    let mut triangulator = Triangulator::default();
    while let Some(word) = reader.text.word_on_any_line() {
        match word.bytes {
            b"#vertex" => read_vertex(&mut reader, &mut mesh)?,
            b"#shape_polygon" => read_face(&mut reader, None, &mut mesh, &mut triangulator)?,
            b"#shape_triangle" => read_face(&mut reader, Some(3), &mut mesh, &mut triangulator)?,
            other if other.starts_with(b"#shape_") => notes.add("other shape", || {
                format!(
                    "{}: {} is not a mesh and was skipped",
                    reader.location(word.start),
                    word.quoted()
                )
            }),
            _ => {}
        }
    }
    reader.note_commas(notes);
    mesh.drop_needless_exact();
    super::repair_normals(&mut mesh, input, notes);
    Ok(mesh)
}

fn read_vertex(reader: &mut Reader, mesh: &mut TriangleMesh) -> Result<(), ReadError> {
    if mesh.positions.len() >= reader.input.options.limits.elements {
        return Err(too_many(reader.input, reader.here(), "vertices"));
    }
    const WHAT: &str = "one of the 8 numbers of a #vertex (position, normal, s, t)";
    let (position, exact) = reader.position(&|| WHAT.into(), true)?;
    let mut rest = [0.0; 5];
    for x in &mut rest {
        *x = reader.number(WHAT, true)?;
    }
    mesh.positions.push(position);
    mesh.exact.extend(exact);
    mesh.normals.push(Vec3::new(rest[0], rest[1], rest[2]));
    mesh.uvs[0].push(Vec2::new(rest[3], rest[4]));
    Ok(())
}

fn read_face(
    reader: &mut Reader,
    corners: Option<u64>,
    mesh: &mut TriangleMesh,
    triangulator: &mut Triangulator,
) -> Result<(), ReadError> {
    reader.number("the material number of a shape", true)?;
    let corners = match corners {
        Some(corners) => corners,
        None => reader.count("the number of corners", true)?,
    };
    let mut face = Vec::new();
    for _ in 0..corners {
        let index = reader.count("a vertex number", true)?;
        if index >= mesh.positions.len() as u64 {
            let problem = format!(
                "vertex {index} of a shape, but there are {} vertices so far",
                mesh.positions.len()
            );
            let remedy = "vertices count from 0 and come before the shapes; export the file again";
            return Err(reader.error(reader.text.position(), problem, remedy));
        }
        face.push(index as u32);
    }
    super::push_polygon(reader.input, || reader.here(), mesh, &face, triangulator)
}
