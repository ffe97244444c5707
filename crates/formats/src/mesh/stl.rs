//! STL, text and binary.
//!
//! Binary files are recognised by their size: 84 bytes plus 50 per facet, whatever the first word
//! is (many begin with `solid`). Programs that write a stream may leave the count of facets at 0 or
//! at its largest value; where the rest of the file is a whole number of facets, that is the count.
//! Facet normals are ignored; equal positions become one vertex.
//!
//! Colours of binary files are in the attribute of each facet, five bits a channel. Magics writes
//! `COLOR=` and a colour into the header; there the facet's own colour holds if bit 15 is 0, and
//! red is in the lowest bits. VisCAM and SolidView set bit 15 of facets with a colour, and blue is
//! in the lowest bits.

use super::colors;
use super::normals;
use super::notes::Notes;
use super::polygon::Triangulator;
use super::text::{Reader, Text, decoded};
use super::too_many;
use super::weld::{Welder, exact_key, key};
use crate::{Input, Place, ReadError, SceneReader};
use snell_intersect::TriangleMesh;
use snell_math::{DVec3, Vec3};

/// The reader of STL files.
pub const READER: SceneReader = SceneReader {
    name: "stl",
    description: "stereolithography meshes, text and binary",
    extensions: &["stl"],
    recognises: |bytes| has_binary_size(bytes) || looks_like_text(bytes),
    read: |input| {
        let mut notes = Notes::default();
        let mut mesh = parse(input, &mut notes)?;
        normals::smooth(&mut mesh, normals::CREASE_ANGLE, &[]);
        if let Some(colors) = facet_colors(&input.bytes, mesh.indices.len()) {
            colors::paint(&mut mesh, &colors);
        }
        let mut scene = super::scene_of(input, mesh, notes);
        // STL is written for machines that build in layers; programs that write it place objects on
        // the xy plane.
        scene.settings.up = Some(DVec3::Z);
        Ok(scene)
    },
};

/// Bytes before the facets of the binary form.
const HEADER: usize = 84;
/// Bytes of a binary facet: normal, three corners, attribute.
const FACET: usize = 50;

fn declared_facets(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    Some(u64::from(u32::from_le_bytes([count[0], count[1], count[2], count[3]])))
}

fn has_binary_size(bytes: &[u8]) -> bool {
    declared_facets(bytes).is_some_and(|n| bytes.len() as u64 == HEADER as u64 + n * FACET as u64)
}

/// The linear colour of each facet of a binary file, if it has any. Other programs leave other
/// numbers in the attributes, so without the mark of Magics all must be colours or 0.
fn facet_colors(bytes: &[u8], facets: usize) -> Option<Vec<[f32; 4]>> {
    let body = bytes.get(HEADER..HEADER + facets.checked_mul(FACET)?)?;
    if !is_binary(bytes) {
        return None;
    }
    let attributes =
        || body.chunks_exact(FACET).map(|f| u16::from_le_bytes([f[FACET - 2], f[FACET - 1]]));
    let from_srgb = |c: f32| snell_math::spectrum::srgb_to_linear(c);
    let five_bits = |bits: u16| from_srgb(f32::from(bits & 31) / 31.0);
    if let Some(at) = bytes[..HEADER - 4].windows(6).position(|w| w == b"COLOR=") {
        let [r, g, b, _] = bytes.get(at + 6..at + 10)?.try_into().ok()?;
        let [r, g, b] = [r, g, b].map(|c: u8| from_srgb(f32::from(c) / 255.0));
        let color = |a: u16| match a & 0x8000 {
            0 => [five_bits(a), five_bits(a >> 5), five_bits(a >> 10), 1.0],
            _ => [r, g, b, 1.0],
        };
        return Some(attributes().map(color).collect());
    }
    let are_colors = attributes().all(|a| a == 0 || a & 0x8000 != 0);
    if !are_colors || attributes().all(|a| a == 0) {
        return None;
    }
    let color = |a: u16| match a {
        0 => [1.0; 4],
        _ => [five_bits(a >> 10), five_bits(a >> 5), five_bits(a), 1.0],
    };
    Some(attributes().map(color).collect())
}

fn looks_like_text(bytes: &[u8]) -> bool {
    let start = decoded(&bytes[..bytes.len().min(4096)]);
    let mut text = Text::new(&start, 0);
    if !text.word_on_any_line().is_some_and(|w| w.bytes.eq_ignore_ascii_case(b"solid")) {
        return false;
    }
    text.next_line();
    text.word_on_any_line().is_some_and(|w| {
        [&b"facet"[..], b"endsolid", b"color"].iter().any(|word| w.bytes.eq_ignore_ascii_case(word))
    })
}

/// Reads the mesh; the file's normals are ignored.
pub(super) fn parse(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    if is_binary(&input.bytes) { parse_binary(input, notes) } else { parse_text(input, notes) }
}

fn is_binary(bytes: &[u8]) -> bool {
    let starts_as_text = || {
        decoded(&bytes[..bytes.len().min(64)])
            .trim_ascii_start()
            .to_ascii_lowercase()
            .starts_with(b"solid")
    };
    has_binary_size(bytes) || !(looks_like_text(bytes) || (starts_as_text() && !bytes.contains(&0)))
}

/// Collects corners as welded vertices.
#[derive(Default)]
struct Builder {
    mesh: TriangleMesh,
    welder: Welder<[u32; 3]>,
    exact_welder: Welder<[u64; 3]>,
}

impl Builder {
    /// The vertex at a position, given in double precision too if all are.
    fn vertex(&mut self, position: Vec3, exact: Option<DVec3>) -> u32 {
        let number = match exact {
            Some(exact) => self.exact_welder.weld(exact_key(exact)),
            None => self.welder.weld(key(position)),
        };
        if number as usize == self.mesh.positions.len() {
            self.mesh.positions.push(position + Vec3::ZERO);
            self.mesh.exact.extend(exact.map(|exact| exact + DVec3::ZERO));
        }
        number
    }
}

fn parse_binary(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    let bytes = &input.bytes;
    let Some(declared) = declared_facets(bytes) else {
        return Err(input.error(
            Place::Byte(bytes.len() as u64),
            format!(
                "found {} bytes, expected \"solid\" or a header of {HEADER} bytes",
                bytes.len()
            ),
            "this is not an STL file, or it is cut off; export or copy it again",
        ));
    };
    let rest = bytes.len() - HEADER;
    let there = (rest / FACET) as u64;
    let is_whole = rest.is_multiple_of(FACET);
    if declared > there && !is_whole {
        return Err(input.error(
            Place::Byte(bytes.len() as u64),
            format!("the file ends after {there} of {declared} facets of {FACET} bytes"),
            "the file seems cut off; export or copy it again",
        ));
    }
    let counted = if is_whole { there } else { declared };
    if counted != declared {
        notes.add("count", || {
            format!(
                "{}: its header counts {declared} facets, but by its size it has {counted}; all of \
                them were read",
                input.name
            )
        });
    }
    let declared = counted;
    let extra = rest as u64 - declared * FACET as u64;
    if extra > 0 {
        notes.add("extra", || {
            format!("{}: {extra} bytes after the last facet were ignored", input.name)
        });
    }
    if declared > input.options.limits.elements as u64 {
        return Err(too_many(input, Place::Byte(HEADER as u64 - 4), "triangles"));
    }
    let declared = declared as usize;
    let mut builder = Builder::default();
    builder.mesh.indices.reserve(declared);
    for facet in bytes[HEADER..HEADER + declared * FACET].chunks_exact(FACET) {
        let float =
            |i: usize| f32::from_le_bytes([facet[i], facet[i + 1], facet[i + 2], facet[i + 3]]);
        let corner = |i: usize| input.near(Vec3::new(float(i), float(i + 4), float(i + 8)));
        let triangle = [12, 24, 36].map(|i| builder.vertex(corner(i), None));
        builder.mesh.indices.push(triangle);
    }
    Ok(builder.mesh)
}

fn parse_text(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    let bytes = decoded(&input.bytes);
    let mut reader = Reader::new(input, &bytes, Text::new(&bytes, 0));
    let mut builder = Builder::default();
    let mut triangulator = Triangulator::default();
    let mut loop_vertices: Vec<u32> = Vec::new();
    while let Some(word) = reader.text.word_on_any_line() {
        match word.bytes.to_ascii_lowercase().as_slice() {
            b"vertex" => {
                let (position, exact) =
                    reader.position(&|| "a coordinate of a vertex".into(), false)?;
                loop_vertices.push(builder.vertex(position, exact));
            }
            b"outer" => {
                loop_vertices.clear();
                reader.text.next_line();
            }
            b"endloop" => {
                if loop_vertices.len() < 3 {
                    let problem =
                        format!("a facet of {} vertices, expected 3", loop_vertices.len());
                    return Err(reader.error(word.start, problem, "export the file again"));
                }
                super::push_polygon(
                    input,
                    || reader.here(),
                    &mut builder.mesh,
                    &loop_vertices,
                    &mut triangulator,
                )?;
                loop_vertices.clear();
            }
            b"endfacet" => {}
            b"facet" | b"solid" | b"endsolid" | b"color" => reader.text.next_line(),
            _ => {
                let problem =
                    format!("found {}, expected facet, vertex, endloop or the like", word.quoted());
                return Err(reader.error(
                    word.start,
                    problem,
                    "this is not an STL file, or it is damaged",
                ));
            }
        }
    }
    if !loop_vertices.is_empty() {
        return Err(reader.missing("endloop"));
    }
    reader.note_commas(notes);
    builder.mesh.drop_needless_exact();
    Ok(builder.mesh)
}
