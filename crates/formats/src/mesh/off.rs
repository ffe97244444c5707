//! Object File Format (Geomview's OFF), text form.
//!
//! The header may be `OFF` with the prefixes `ST`, `C` and `N` in any order, may share a line with
//! the counts, may even touch them (`OFF8 6 12`), or may be missing. There is one vertex or face
//! per line; anything after the required numbers is ignored, including colours. Meshes have no
//! normals unless the prefix `N` is present: they are shaded flat.

use super::notes::Notes;
use super::polygon::Triangulator;
use super::text::{Reader, Text, decoded};
use super::too_many;
use crate::{Input, ReadError, SceneReader};
use snell_intersect::TriangleMesh;
use snell_math::Vec3;

/// The reader of OFF files.
pub const READER: SceneReader = SceneReader {
    name: "off",
    description: "Object File Format: polygon meshes as text",
    extensions: &["off", "coff", "noff", "stoff"],
    recognises: |bytes| {
        let start = decoded(&bytes[..bytes.len().min(4096)]);
        let word = Text::new(&start, 0).with_comments(b'#').word_on_any_line();
        word.is_some_and(|w| Header::of(w.bytes).is_some())
    },
    read: |input| {
        let mut notes = Notes::default();
        let mesh = parse(input, &mut notes)?;
        Ok(super::scene_of(input, mesh, notes))
    },
};

/// The parts of the first word.
struct Header<'a> {
    normals: bool,
    /// True if there are more than three dimensions, which is not supported.
    dimensions: bool,
    /// Text that touches the keyword.
    rest: &'a [u8],
}

impl<'a> Header<'a> {
    fn of(word: &'a [u8]) -> Option<Self> {
        let at = word.windows(3).take(6).position(|w| w == b"OFF")?;
        let (prefix, rest) = (&word[..at], &word[at + 3..]);
        let known =
            prefix.iter().all(|b| b"STCN4n".contains(b)) && rest.iter().all(u8::is_ascii_digit);
        let dimensions = prefix.contains(&b'4') || prefix.contains(&b'n');
        known.then(|| Self { normals: prefix.contains(&b'N'), dimensions, rest })
    }
}

/// Reads the mesh.
pub(super) fn parse(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    let bytes = decoded(&input.bytes);
    let text = Text::new(&bytes, 0).with_comments(b'#');
    let mut reader = Reader::new(input, &bytes, text);
    let has_normals = skip_header(&mut reader)?;
    let vertices = reader.count("the number of vertices", true)?;
    let faces = reader.count("the number of faces", true)?;
    // The number of edges is often missing or wrong, and it is not needed.
    reader.text.next_line();
    let mut mesh = TriangleMesh::default();
    read_vertices(&mut reader, vertices, has_normals, &mut mesh)?;
    read_faces(&mut reader, faces, &mut mesh, notes)?;
    reader.note_commas(notes);
    super::repair_normals(&mut mesh, input, notes);
    Ok(mesh)
}

/// Reads the keyword, if there is one; true if vertices have normals.
fn skip_header(reader: &mut Reader) -> Result<bool, ReadError> {
    let mut ahead = reader.text.clone();
    let Some(word) = ahead.word_on_any_line() else {
        return Err(reader.error(0, "the file is empty, expected OFF", "export the file again"));
    };
    let Some(header) = Header::of(word.bytes) else {
        // Without a keyword the counts come first; invalid counts are reported when they are read.
        return Ok(false);
    };
    if header.dimensions {
        let problem = format!("{} is a mesh of more than three dimensions", word.quoted());
        return Err(reader.error(word.start, problem, "project it to three dimensions first"));
    }
    reader.text = Text::new(reader.bytes, word.start + word.bytes.len() - header.rest.len())
        .with_comments(b'#');
    let mut ahead = reader.text.clone();
    if let Some(word) = ahead.word_on_any_line().filter(|w| w.bytes.eq_ignore_ascii_case(b"BINARY"))
    {
        return Err(reader.error(
            word.start,
            "this is the binary form of OFF",
            "export it as text, or as PLY",
        ));
    }
    Ok(header.normals)
}

fn read_vertices(
    reader: &mut Reader,
    count: u64,
    has_normals: bool,
    mesh: &mut TriangleMesh,
) -> Result<(), ReadError> {
    // A vertex takes at least six bytes, so a false count cannot reserve much.
    mesh.positions.reserve(count.min(reader.text.remaining() as u64 / 6 + 1) as usize);
    for i in 0..count {
        if mesh.positions.len() >= reader.input.options.limits.elements {
            return Err(too_many(reader.input, reader.here(), "vertices"));
        }
        let what = || format!("a coordinate of vertex {i} of {count}");
        let mut p = [0.0; 3];
        for x in &mut p {
            *x = match reader.text.word_on_any_line() {
                Some(word) => match super::text::number(word.bytes) {
                    super::text::Number::Exact(value) => value,
                    super::text::Number::Comma(value) => {
                        reader.found_comma(word.start);
                        value
                    }
                    _ => return Err(reader.not_a_number(word, &what())),
                },
                None => return Err(reader.missing(&what())),
            };
        }
        mesh.positions.push(Vec3::from(p));
        if has_normals {
            let mut n = Vec3::ZERO;
            for k in 0..3 {
                n[k] = reader.number("a coordinate of a normal", false)?;
            }
            mesh.normals.push(n);
        }
        reader.text.next_line();
    }
    Ok(())
}

fn read_faces(
    reader: &mut Reader,
    count: u64,
    mesh: &mut TriangleMesh,
    notes: &mut Notes,
) -> Result<(), ReadError> {
    let mut triangulator = Triangulator::default();
    let mut face: Vec<u32> = Vec::new();
    let vertices = mesh.positions.len();
    for i in 0..count {
        let Some(first) = reader.text.word_on_any_line() else {
            return Err(reader.missing(&format!("face {i} of {count}")));
        };
        let corners = whole(reader, first.bytes, first.start, "the number of corners of a face")?;
        face.clear();
        for _ in 0..corners {
            let Some(word) = reader.text.word() else {
                return Err(reader.missing(&format!("a corner of a face of {corners}")));
            };
            let index = whole(reader, word.bytes, word.start, "a vertex number")?;
            if index >= vertices as u64 {
                let problem =
                    format!("vertex {index} of a face, but there are {vertices} vertices");
                let remedy = "vertices count from 0; export the file again";
                return Err(reader.error(word.start, problem, remedy));
            }
            face.push(index as u32);
        }
        if face.len() < 3 {
            notes.add("few corners", || {
                format!(
                    "{}: a face has fewer than 3 corners and was skipped",
                    reader.location(first.start)
                )
            });
        }
        super::push_polygon(reader.input, || reader.here(), mesh, &face, &mut triangulator)?;
        reader.text.next_line();
    }
    Ok(())
}

fn whole(reader: &Reader, word: &[u8], start: usize, what: &str) -> Result<u64, ReadError> {
    std::str::from_utf8(word).ok().and_then(|s| s.parse().ok()).ok_or_else(|| {
        let found = super::text::Word { bytes: word, start }.quoted();
        reader.error(
            start,
            format!("found {found}, expected {what}"),
            "write a whole number that is not negative",
        )
    })
}
