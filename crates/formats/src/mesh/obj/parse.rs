//! The statements of a piece of an OBJ file.

use super::file::{Corner, Counts, DANGLING, Faces, NONE, Run, State};
use crate::ReadError;
use crate::mesh::colors;
use crate::mesh::notes::Notes;
use crate::mesh::text::{Number, Reader, Text, Word, decoded, exact_from, number, number_from};
use crate::mesh::too_many;
use crate::search::text_of;
use snell_math::{DVec3, Vec2, Vec3};
use snell_scene::WarningKind;
use std::collections::HashMap;

/// True if the first lines are OBJ statements and nothing else.
pub fn recognises(bytes: &[u8]) -> bool {
    let start = decoded(&bytes[..bytes.len().min(8192)]);
    let mut text = Text::new(&start, 0).with_comments(b'#');
    let mut has_vertices = false;
    for _ in 0..64 {
        let Some(keyword) = text.word_on_any_line() else { break };
        match keyword.bytes {
            b"v" => {
                let numbers = std::iter::from_fn(|| text.word()).take(3);
                // The last line of the excerpt may be cut off.
                let good = numbers.filter(|w| number(w.bytes) != Number::None).count() == 3;
                if !good && !text.is_at_end() {
                    return false;
                }
                has_vertices |= good;
            }
            b"vt" | b"vn" | b"f" | b"l" | b"p" | b"o" | b"g" | b"s" | b"usemtl" | b"mtllib" => {}
            _ => return false,
        }
        text.next_line();
    }
    has_vertices
}

/// A point or line, as its vertices, and the number of its material, if any.
#[derive(Debug)]
pub struct Stroke {
    /// Offset of its statement.
    pub start: usize,
    pub vertices: Vec<u32>,
    pub material: Option<u32>,
}

/// The contents of a piece.
#[derive(Debug, Default)]
pub struct Piece {
    pub positions: Vec<Vec3>,
    /// The positions in double precision, if the options ask for them.
    pub exact: Vec<DVec3>,
    /// Vertex colours as they are written, finite: empty, or as many as positions.
    pub colors: Vec<[f32; 4]>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub faces: Faces,
    /// Points and lines: their vertices.
    pub strokes: Vec<Stroke>,
    /// Runs of faces; numbers of materials and objects count those of this piece.
    pub runs: Vec<Run>,
    /// The state after the last statement.
    pub end: State,
    /// Object names in order of appearance.
    pub objects: Vec<String>,
    /// Material names in order of appearance, each with the offset of its first use.
    pub materials: Vec<(String, usize)>,
    /// The names in `mtllib` statements, with their offsets.
    pub libraries: Vec<(String, usize)>,
    /// Number of statements understood.
    pub known: u64,
    /// Offset of the first unknown statement.
    pub unknown: Option<usize>,
    pub notes: Notes,
}

/// Reads the statements to the end of the reader's text. `before` has the numbers of lines of each
/// list in earlier pieces.
pub fn parse(reader: Reader, before: Counts) -> Result<Piece, ReadError> {
    let piece = Piece { faces: Faces::starting_at(reader.text.position()), ..Piece::default() };
    let mut parser =
        Parser { reader, before, piece, state: State::default(), material_numbers: HashMap::new() };
    while let Some(keyword) = parser.reader.text.word_on_any_line() {
        parser.statement(keyword)?;
        parser.reader.text.next_line();
    }
    parser.reader.note_commas(&mut parser.piece.notes);
    Ok(Piece { end: parser.state, ..parser.piece })
}

struct Parser<'a> {
    reader: Reader<'a>,
    before: Counts,
    piece: Piece,
    state: State,
    /// Numbers of material names. Never iterated, so order does not matter.
    material_numbers: HashMap<String, u32>,
}

impl Parser<'_> {
    /// The numbers of lines of each list so far.
    fn counts(&self) -> Counts {
        Counts {
            positions: self.before.positions + self.piece.positions.len(),
            uvs: self.before.uvs + self.piece.uvs.len(),
            normals: self.before.normals + self.piece.normals.len(),
        }
    }

    fn statement(&mut self, keyword: Word) -> Result<(), ReadError> {
        self.piece.known += 1;
        match keyword.bytes {
            b"v" => self.position(keyword.start),
            b"vt" => self.uv(),
            b"vn" => self.normal(),
            b"f" | b"fo" => self.face(keyword.start),
            b"usemtl" => {
                self.state.material = Some(self.material_number(keyword.start));
                Ok(())
            }
            b"mtllib" => {
                let name = self.name();
                self.piece.libraries.push((name, keyword.start));
                Ok(())
            }
            b"o" => {
                let name = self.name();
                self.state.object = Some(self.piece.objects.len() as u32);
                self.piece.objects.push(name);
                Ok(())
            }
            b"s" => {
                self.state.smoothing = Some(match self.reader.text.word().map(|w| w.bytes) {
                    Some(b"off") | None => 0,
                    Some(b"on") => 1,
                    // Group numbers are only compared for equality; a word that is not a number is
                    // a group of its own.
                    Some(word) => {
                        std::str::from_utf8(word).ok().and_then(|s| s.parse().ok()).unwrap_or(1)
                    }
                });
                Ok(())
            }
            b"g" => Ok(()),
            b"l" | b"p" => self.strokes(keyword),
            b"vp" | b"deg" | b"cstype" | b"curv" | b"curv2" | b"surf" | b"parm" | b"trim"
            | b"hole" | b"scrv" | b"sp" | b"end" | b"con" | b"bmat" | b"step" | b"mg"
            | b"ctech" | b"stech" => {
                self.skipped(
                    WarningKind::Changed,
                    "free-form",
                    keyword,
                    "free-form curves and surfaces are not supported; they were skipped",
                );
                Ok(())
            }
            b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj"
            | b"call" | b"csh" | b"maplib" | b"usemap" | b"vc" => {
                self.skipped(
                    WarningKind::Choice,
                    "display",
                    keyword,
                    "display attributes such as this were skipped",
                );
                Ok(())
            }
            _ => {
                self.piece.known -= 1;
                self.piece.unknown.get_or_insert(keyword.start);
                self.skipped(
                    WarningKind::Changed,
                    "unknown",
                    keyword,
                    "not a statement of OBJ files; lines like this were skipped",
                );
                Ok(())
            }
        }
    }

    fn skipped(&mut self, about: WarningKind, kind: &'static str, keyword: Word, what: &str) {
        let reader = &self.reader;
        self.piece.notes.add_of(about, kind, || {
            format!("{}: {}: {what}", reader.location(keyword.start), keyword.quoted())
        });
    }

    fn name(&mut self) -> String {
        text_of(self.reader.text.rest_of_line().bytes)
    }

    fn material_number(&mut self, offset: usize) -> u32 {
        let name = self.name();
        let materials = &mut self.piece.materials;
        *self.material_numbers.entry(name).or_insert_with_key(|name| {
            materials.push((name.clone(), offset));
            materials.len() as u32 - 1
        })
    }

    /// The numbers up to the end of the line, at most eight, and their count. `origin` is
    /// subtracted from the first three.
    fn numbers(
        &mut self,
        least: usize,
        origin: DVec3,
        what: &str,
    ) -> Result<([f32; 8], usize), ReadError> {
        let origin = origin.to_array();
        let mut values = [0.0; 8];
        let mut count = 0;
        while count < values.len() {
            let Some(word) = self.reader.text.word() else { break };
            let subtracted = origin.get(count).copied().unwrap_or(0.0);
            values[count] = match number_from(word.bytes, subtracted) {
                Number::Exact(value) => value,
                Number::Comma(value) => {
                    self.reader.found_comma(word.start);
                    value
                }
                Number::Prefix(value) if !word.bytes.contains(&b',') => {
                    let reader = &self.reader;
                    self.piece.notes.add("odd number", || {
                        let place = reader.location(word.start);
                        format!(
                            "{place}: {} is not a number; its first part, {value}, was used",
                            word.quoted()
                        )
                    });
                    value
                }
                _ if count >= least => break,
                _ => return Err(self.reader.not_a_number(word, what)),
            };
            count += 1;
        }
        if count < least { Err(self.reader.missing(what)) } else { Ok((values, count)) }
    }

    fn check_room(&self, count: usize, what: &str) -> Result<(), ReadError> {
        if count < self.reader.input.options.limits.elements {
            return Ok(());
        }
        Err(too_many(self.reader.input, self.reader.here(), what))
    }

    fn position(&mut self, start: usize) -> Result<(), ReadError> {
        self.check_room(self.counts().positions, "vertices")?;
        if self.reader.input.options.exact {
            let (mut text, origin) = (self.reader.text.clone(), self.reader.input.origin);
            let mut next = |axis: usize| {
                text.word().map_or(f64::NAN, |word| exact_from(word.bytes, origin[axis]))
            };
            self.piece.exact.push(DVec3::new(next(0), next(1), next(2)));
        }
        let ([x, y, z, a, b, c, d, _], count) =
            self.numbers(3, self.reader.input.origin, "a coordinate of a vertex")?;
        let position = Vec3::new(x, y, z);
        if !position.is_finite() {
            let reader = &self.reader;
            self.piece.notes.add_of(WarningKind::NotFinite, "not finite", || {
                let place = reader.location(start);
                format!(
                    "{place}: a vertex is not finite; triangles that use such vertices are \
                    never hit: give it finite coordinates"
                )
            });
        }
        // The fourth of four numbers is a weight, which only free-form surfaces use; six numbers
        // have a colour, seven a colour with alpha.
        if count >= 6 {
            let alpha = if count >= 7 { d } else { 1.0 };
            self.color([a, b, c, alpha]);
        } else if !self.piece.colors.is_empty() {
            self.piece.colors.push(colors::MISSING);
        }
        self.piece.positions.push(position);
        Ok(())
    }

    /// Stores the colour of the vertex about to be added.
    fn color(&mut self, color: [f32; 4]) {
        let color = if color.iter().all(|c| c.is_finite()) {
            color
        } else {
            let reader = &self.reader;
            self.piece.notes.add("bad color", || {
                let place = reader.location(reader.text.position());
                format!("{place}: a vertex colour is not finite; white was used")
            });
            colors::MISSING
        };
        self.piece.colors.resize(self.piece.positions.len(), colors::MISSING);
        self.piece.colors.push(color);
    }

    fn uv(&mut self) -> Result<(), ReadError> {
        self.check_room(self.counts().uvs, "texture coordinates")?;
        let ([u, v, ..], _) = self.numbers(1, DVec3::ZERO, "a texture coordinate")?;
        self.piece.uvs.push(Vec2::new(u, v));
        Ok(())
    }

    fn normal(&mut self) -> Result<(), ReadError> {
        self.check_room(self.counts().normals, "normals")?;
        let ([x, y, z, ..], _) = self.numbers(3, DVec3::ZERO, "a coordinate of a normal")?;
        self.piece.normals.push(Vec3::new(x, y, z));
        Ok(())
    }

    fn face(&mut self, offset: usize) -> Result<(), ReadError> {
        self.check_room(self.piece.faces.corner_count(), "corners of faces")?;
        let counts = self.counts();
        let start = self.piece.faces.corner_count();
        while let Some(word) = self.reader.text.word() {
            self.piece.faces.push_corner(corner(word.bytes, counts));
        }
        let corners = self.piece.faces.corner_count() - start;
        if corners < 3 {
            self.piece.faces.take_back(corners);
            let reader = &self.reader;
            self.piece.notes.add("few corners", || {
                let place = reader.location(offset);
                format!(
                    "{place}: a face of {corners} corners, expected 3 or more; such faces were \
                    skipped"
                )
            });
            return Ok(());
        }
        self.piece.faces.end_face(corners);
        Run::add_face(&mut self.piece.runs, self.state);
        Ok(())
    }
}

impl Parser<'_> {
    /// Reads a statement `p`, each vertex of which is a point, or `l`, a line through all.
    fn strokes(&mut self, keyword: Word) -> Result<(), ReadError> {
        self.check_room(self.piece.strokes.len(), "points and lines")?;
        let counts = self.counts();
        let (start, material) = (keyword.start, self.state.material);
        let words = std::iter::from_fn(|| self.reader.text.word());
        let vertices: Vec<u32> = words.map(|word| corner(word.bytes, counts).position).collect();
        match keyword.bytes {
            b"l" => self.piece.strokes.push(Stroke { start, vertices, material }),
            _ => self.piece.strokes.extend(vertices.into_iter().map(|i| Stroke {
                start,
                vertices: vec![i],
                material,
            })),
        }
        Ok(())
    }
}

/// The corner that a word names. What it does not name by a number of a line before is
/// [`DANGLING`]; numbers beyond the lines so far may name later ones, and are checked at the end.
fn corner(word: &[u8], counts: Counts) -> Corner {
    let mut parts = word.split(|&b| b == b'/');
    let mut index = |count| match parts.next().unwrap_or(b"") {
        b"" => NONE,
        digits => small_integer(digits).map_or(DANGLING, |value| {
            let index = if value > 0 { value - 1 } else { count as i64 + value };
            if value == 0 || index < 0 { DANGLING } else { index.min(i64::from(DANGLING)) as u32 }
        }),
    };
    let (position, uv, normal) =
        (index(counts.positions), index(counts.uvs), index(counts.normals));
    let is_good = position != NONE && parts.next().is_none();
    Corner { position: if is_good { position } else { DANGLING }, uv, normal }
}

/// A whole number of up to 18 digits with an optional sign.
fn small_integer(digits: &[u8]) -> Option<i64> {
    let (negative, digits) = match digits {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, digits),
    };
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let mut value = 0i64;
    for &byte in digits {
        if !byte.is_ascii_digit() {
            return None;
        }
        value = value * 10 + i64::from(byte - b'0');
    }
    Some(if negative { -value } else { value })
}
