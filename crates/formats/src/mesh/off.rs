//! Object File Format (Geomview's OFF), text form.
//!
//! The header may be `OFF` with the prefixes `ST`, `C` and `N` in any order, may share a line with
//! the counts, may even touch them (`OFF8 6 12`), or may be missing. Each vertex and face begins
//! on a new line, and may go on in the next. Vertices have colours after the prefix `C`, and a face
//! has one where three or four numbers follow its corners: whole numbers from 0 to 255, or
//! fractions from 0 to 1, both sRGB. Anything else after the required numbers is ignored. Meshes
//! have no normals unless the prefix `N` is present: they are shaded flat.

use super::colors;
use super::notes::Notes;
use super::polygon::Triangulator;
use super::text::{Number, Reader, Text, decoded, number};
use super::too_many;
use crate::{Input, ReadError, SceneReader};
use snell_intersect::TriangleMesh;
use snell_math::Vec3;
use snell_math::spectrum::srgb_to_linear;

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
        let (mut mesh, colors) = parse_colored(input, &mut notes)?;
        if !colors.vertices.is_empty() {
            mesh.colors = colors.vertices.into_linear();
        } else if !colors.faces.is_empty() {
            colors::paint(&mut mesh, &colors.faces.into_linear());
        }
        Ok(super::scene_of(input, mesh, notes))
    },
};

/// The colours of a file.
#[derive(Default)]
struct Colors {
    /// One of each vertex, or none.
    vertices: Written,
    /// One of each triangle, or none.
    faces: Written,
}

/// Colours as they are written, each with whether it is in whole numbers; `None` for a face without
/// one.
#[derive(Default)]
struct Written(Vec<Option<([f32; 4], bool)>>);

impl Written {
    fn is_empty(&self) -> bool {
        self.0.iter().all(Option::is_none)
    }

    /// Linear colours. Whole numbers go to 255, unless all of them are 0 or 1.
    fn into_linear(self) -> Vec<[f32; 4]> {
        let mut whole = self.0.iter().flatten().filter(|(_, is_whole)| *is_whole);
        let are_bytes = whole.any(|(c, _)| c[..3].iter().any(|c| *c > 1.0));
        let linear = |(color, is_whole): ([f32; 4], bool)| {
            let scale = if is_whole && are_bytes { 1.0 / 255.0 } else { 1.0 };
            let [r, g, b, a] = color.map(|c| (c * scale).clamp(0.0, 1.0));
            let [r, g, b] = [r, g, b].map(srgb_to_linear);
            [r, g, b, a]
        };
        self.0.into_iter().map(|color| color.map_or([1.0; 4], linear)).collect()
    }
}

/// The colour in the words up to the end of the line, of which there are three or four numbers,
/// and after them `followers` numbers of something else.
fn color(reader: &mut Reader, followers: usize) -> Option<([f32; 4], bool)> {
    // Without its own value alpha is the largest.
    let (mut color, mut whole, mut count) = ([f32::MAX; 4], [true; 4], 0);
    while let Some(word) = reader.text.word() {
        let Number::Exact(value) = number(word.bytes) else { break };
        if let Some(channel) = color.get_mut(count) {
            *channel = if value.is_finite() { value } else { 1.0 };
            whole[count] = word.bytes.iter().all(|b| b.is_ascii_digit());
        }
        count += 1;
    }
    let count = count.checked_sub(followers)?;
    let whole = whole.get(..count)?.iter().all(|whole| *whole);
    // What follows three channels is no alpha.
    color.iter_mut().skip(count).for_each(|channel| *channel = f32::MAX);
    (count >= 3).then_some((color, whole))
}

/// The parts of the first word.
struct Header<'a> {
    normals: bool,
    colors: bool,
    /// True if lines of vertices end with two texture coordinates.
    coordinates: bool,
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
        let (normals, colors) = (prefix.contains(&b'N'), prefix.contains(&b'C'));
        let coordinates = prefix.starts_with(b"ST");
        known.then_some(Self { normals, colors, coordinates, dimensions, rest })
    }
}

/// Reads the mesh without its colours.
pub(super) fn parse(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    Ok(parse_colored(input, notes)?.0)
}

fn parse_colored(input: &Input, notes: &mut Notes) -> Result<(TriangleMesh, Colors), ReadError> {
    let bytes = decoded(&input.bytes);
    let text = Text::new(&bytes, 0).with_comments(b'#');
    let mut reader = Reader::new(input, &bytes, text);
    let attributes = skip_header(&mut reader)?;
    let vertices = reader.count("the number of vertices", true)?;
    let faces = reader.count("the number of faces", true)?;
    // The number of edges is often missing or wrong, and it is not needed.
    reader.text.next_line();
    let (mut mesh, mut colors) = (TriangleMesh::default(), Colors::default());
    read_vertices(&mut reader, vertices, attributes, &mut mesh, &mut colors.vertices)?;
    mesh.drop_needless_exact();
    read_faces(&mut reader, faces, &mut mesh, &mut colors.faces, notes)?;
    reader.note_commas(notes);
    super::repair_normals(&mut mesh, input, notes);
    Ok((mesh, colors))
}

/// The attributes that vertices have.
#[derive(Clone, Copy, Default)]
struct Attributes {
    normals: bool,
    colors: bool,
    coordinates: bool,
}

/// Reads the keyword, if there is one.
fn skip_header(reader: &mut Reader) -> Result<Attributes, ReadError> {
    let mut ahead = reader.text.clone();
    let Some(word) = ahead.word_on_any_line() else {
        return Err(reader.error(0, "the file is empty, expected OFF", "export the file again"));
    };
    let Some(header) = Header::of(word.bytes) else {
        // Without a keyword the counts come first; invalid counts are reported when they are read.
        return Ok(Attributes::default());
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
    let Header { normals, colors, coordinates, .. } = header;
    Ok(Attributes { normals, colors, coordinates })
}

fn read_vertices(
    reader: &mut Reader,
    count: u64,
    attributes: Attributes,
    mesh: &mut TriangleMesh,
    colors: &mut Written,
) -> Result<(), ReadError> {
    // A vertex takes at least six bytes, so a false count cannot reserve much.
    mesh.positions.reserve(count.min(reader.text.remaining() as u64 / 6 + 1) as usize);
    for i in 0..count {
        if mesh.positions.len() >= reader.input.options.limits.elements {
            return Err(too_many(reader.input, reader.here(), "vertices"));
        }
        let what = || format!("a coordinate of vertex {i} of {count}");
        let (position, exact) = reader.position(&what, true)?;
        mesh.positions.push(position);
        mesh.exact.extend(exact);
        if attributes.normals {
            let mut n = Vec3::ZERO;
            for k in 0..3 {
                n[k] = reader.number("a coordinate of a normal", false)?;
            }
            mesh.normals.push(n);
        }
        if attributes.colors {
            colors.0.push(color(reader, if attributes.coordinates { 2 } else { 0 }));
        }
        reader.text.next_line();
    }
    Ok(())
}

fn read_faces(
    reader: &mut Reader,
    count: u64,
    mesh: &mut TriangleMesh,
    colors: &mut Written,
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
            // Some programs write each corner on a line of its own.
            let Some(word) = reader.text.word_on_any_line() else {
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
        colors.0.resize(mesh.indices.len(), color(reader, 0));
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
