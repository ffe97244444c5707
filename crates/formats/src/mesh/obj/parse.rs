//! The statements of an OBJ file.

use crate::mesh::notes::Notes;
use crate::mesh::text::{Number, Reader, Text, Word, decoded, number};
use crate::mesh::too_many;
use crate::{Input, ReadError};
use snell_math::spectrum::srgb_to_linear;
use snell_math::{Vec2, Vec3};
use std::collections::HashMap;

/// No such index.
pub const NONE: u32 = u32::MAX;

/// A corner of a face: numbers from 0, or [`NONE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Corner {
    pub position: u32,
    pub uv: u32,
    pub normal: u32,
}

/// A face.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Where its corners end in [`ObjFile::corners`].
    pub end: usize,
    /// Offset of its line in the text.
    pub offset: usize,
    /// Number of its material name, or [`NONE`].
    pub material: u32,
    /// Smoothing group; 0 is off and [`NONE`] is not said.
    pub smoothing: u32,
    /// Number of its object.
    pub object: u32,
}

/// What an OBJ file says.
#[derive(Clone, Debug, Default)]
pub struct ObjFile {
    pub positions: Vec<Vec3>,
    /// Linear vertex colours: empty, or as many as positions.
    pub colors: Vec<[f32; 4]>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub corners: Vec<Corner>,
    pub faces: Vec<Face>,
    /// Object names in order of appearance; the first is that of faces before any `o`.
    pub objects: Vec<String>,
    /// Material names in order of appearance, each with the offset of its first use.
    pub materials: Vec<(String, usize)>,
    /// What `mtllib` statements name, with their offsets.
    pub libraries: Vec<(String, usize)>,
}

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

/// Reads the statements.
pub fn parse(input: &Input, notes: &mut Notes) -> Result<ObjFile, ReadError> {
    let bytes = decoded(&input.bytes);
    let text = Text::new(&bytes, 0).with_continuations().with_comments(b'#');
    let mut parser = Parser {
        reader: Reader { input, bytes: &bytes, text },
        notes,
        file: ObjFile { objects: vec![String::new()], ..ObjFile::default() },
        material: NONE,
        smoothing: NONE,
        object: 0,
        material_numbers: HashMap::new(),
        known: 0,
        unknown: None,
    };
    while let Some(keyword) = parser.reader.text.word_on_any_line() {
        parser.statement(keyword)?;
        parser.reader.text.next_line();
    }
    if let (0, Some(offset)) = (parser.known, parser.unknown) {
        let problem = "found no statement of an OBJ file, expected v, f or the like";
        return Err(parser.reader.error(offset, problem, "this is not an OBJ file"));
    }
    parser.check_corners()?;
    Ok(parser.file)
}

struct Parser<'a, 'n> {
    reader: Reader<'a>,
    notes: &'n mut Notes,
    file: ObjFile,
    material: u32,
    smoothing: u32,
    object: u32,
    /// Numbers of material names; looked up only.
    material_numbers: HashMap<String, u32>,
    /// Number of statements understood.
    known: u64,
    /// Offset of the first one not understood.
    unknown: Option<usize>,
}

impl Parser<'_, '_> {
    fn statement(&mut self, keyword: Word) -> Result<(), ReadError> {
        self.known += 1;
        match keyword.bytes {
            b"v" => self.position(),
            b"vt" => self.uv(),
            b"vn" => self.normal(),
            b"f" | b"fo" => self.face(keyword.start),
            b"usemtl" => {
                self.material = self.material_number(keyword.start);
                Ok(())
            }
            b"mtllib" => {
                let name = self.name();
                self.file.libraries.push((name, keyword.start));
                Ok(())
            }
            b"o" => {
                let name = self.name();
                self.object = self.file.objects.len() as u32;
                self.file.objects.push(name);
                Ok(())
            }
            b"s" => {
                self.smoothing = match self.reader.text.word().map(|w| w.bytes) {
                    Some(b"off") | None => 0,
                    Some(b"on") => 1,
                    // Groups are compared, not counted with; whatever is not a number is one of its own.
                    Some(word) => std::str::from_utf8(word).ok().and_then(|s| s.parse().ok()).unwrap_or(1),
                };
                Ok(())
            }
            b"g" => Ok(()),
            b"l" | b"p" => {
                self.skipped("lines", keyword, "lines and points are not surfaces; they were skipped");
                Ok(())
            }
            b"vp" | b"deg" | b"cstype" | b"curv" | b"curv2" | b"surf" | b"parm" | b"trim" | b"hole" | b"scrv"
            | b"sp" | b"end" | b"con" | b"bmat" | b"step" | b"mg" | b"ctech" | b"stech" => {
                self.skipped(
                    "free-form",
                    keyword,
                    "free-form curves and surfaces are not supported; they were skipped",
                );
                Ok(())
            }
            b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj" | b"call" | b"csh"
            | b"maplib" | b"usemap" | b"vc" => {
                self.skipped("display", keyword, "display attributes such as this were skipped");
                Ok(())
            }
            _ => {
                self.known -= 1;
                self.unknown.get_or_insert(keyword.start);
                self.skipped("unknown", keyword, "not a statement of OBJ files; lines like this were skipped");
                Ok(())
            }
        }
    }

    fn skipped(&mut self, kind: &'static str, keyword: Word, what: &str) {
        let reader = &self.reader;
        self.notes.add(kind, || format!("{}: {}: {what}", reader.location(keyword.start), keyword.quoted()));
    }

    fn name(&mut self) -> String {
        String::from_utf8_lossy(self.reader.text.rest_of_line().bytes).into_owned()
    }

    fn material_number(&mut self, offset: usize) -> u32 {
        let name = self.name();
        let materials = &mut self.file.materials;
        *self.material_numbers.entry(name).or_insert_with_key(|name| {
            materials.push((name.clone(), offset));
            materials.len() as u32 - 1
        })
    }

    /// The numbers up to the end of the line, eight at most, and how many there are.
    fn numbers(&mut self, least: usize, what: &str) -> Result<([f32; 8], usize), ReadError> {
        let mut values = [0.0; 8];
        let mut count = 0;
        while count < values.len() {
            let Some(word) = self.reader.text.word() else { break };
            values[count] = match number(word.bytes) {
                Number::Exact(value) => value,
                Number::Prefix(value) if !word.bytes.contains(&b',') => {
                    let reader = &self.reader;
                    self.notes.add("odd number", || {
                        let place = reader.location(word.start);
                        format!("{place}: {} is not a number; its first part, {value}, was used", word.quoted())
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
        if count < self.reader.input.options.limits.elements { Ok(()) } else { Err(too_many(self.reader.input, what)) }
    }

    fn position(&mut self) -> Result<(), ReadError> {
        self.check_room(self.file.positions.len(), "vertices")?;
        let ([x, y, z, a, b, c, d, _], count) = self.numbers(3, "a coordinate of a vertex")?;
        // Four numbers are a weight, which only free-form surfaces use; six are a colour, seven a colour with alpha.
        if count >= 6 {
            let alpha = if count >= 7 { d } else { 1.0 };
            self.color([a, b, c, alpha]);
        } else if !self.file.colors.is_empty() {
            self.file.colors.push([1.0; 4]);
        }
        self.file.positions.push(Vec3::new(x, y, z));
        Ok(())
    }

    /// Notes the colour of the vertex about to be added.
    fn color(&mut self, color: [f32; 4]) {
        let linear = if color.iter().all(|c| c.is_finite()) {
            let [r, g, b, a] = color.map(|c| c.clamp(0.0, 1.0));
            let [r, g, b] = [r, g, b].map(srgb_to_linear);
            [r, g, b, a]
        } else {
            let reader = &self.reader;
            self.notes.add("bad color", || {
                let place = reader.location(reader.text.position());
                format!("{place}: a vertex colour is not finite; white was used")
            });
            [1.0; 4]
        };
        self.file.colors.resize(self.file.positions.len(), [1.0; 4]);
        self.file.colors.push(linear);
    }

    fn uv(&mut self) -> Result<(), ReadError> {
        self.check_room(self.file.uvs.len(), "texture coordinates")?;
        let ([u, v, ..], _) = self.numbers(1, "a texture coordinate")?;
        self.file.uvs.push(Vec2::new(u, v));
        Ok(())
    }

    fn normal(&mut self) -> Result<(), ReadError> {
        self.check_room(self.file.normals.len(), "normals")?;
        let ([x, y, z, ..], _) = self.numbers(3, "a coordinate of a normal")?;
        self.file.normals.push(Vec3::new(x, y, z));
        Ok(())
    }

    fn face(&mut self, offset: usize) -> Result<(), ReadError> {
        self.check_room(self.file.corners.len(), "corners of faces")?;
        let start = self.file.corners.len();
        while let Some(word) = self.reader.text.word() {
            let corner = self.corner(word)?;
            self.file.corners.push(corner);
        }
        let end = self.file.corners.len();
        if end - start < 3 {
            self.file.corners.truncate(start);
            let reader = &self.reader;
            self.notes.add("few corners", || {
                let place = reader.location(offset);
                format!("{place}: a face of {} corners, expected 3 or more; such faces were skipped", end - start)
            });
            return Ok(());
        }
        let (material, smoothing, object) = (self.material, self.smoothing, self.object);
        self.file.faces.push(Face { end, offset, material, smoothing, object });
        Ok(())
    }

    fn corner(&self, word: Word) -> Result<Corner, ReadError> {
        let bad = || {
            let problem = format!("found {}, expected vertex numbers such as 1, 1/2, 1//3 or 1/2/3", word.quoted());
            self.reader.error(word.start, problem, "correct the face, or export the file again")
        };
        let mut parts = word.bytes.split(|&b| b == b'/');
        let mut index = |list, count| self.index(parts.next().unwrap_or(b""), word, list, count);
        let position = index("v", self.file.positions.len())?.ok_or_else(bad)?;
        let uv = index("vt", self.file.uvs.len())?.unwrap_or(NONE);
        let normal = index("vn", self.file.normals.len())?.unwrap_or(NONE);
        if parts.next().is_some() { Err(bad()) } else { Ok(Corner { position, uv, normal }) }
    }

    /// An index from 0. Positive ones are checked at the end, for what they refer to may come later.
    fn index(&self, digits: &[u8], word: Word, list: &str, count: usize) -> Result<Option<u32>, ReadError> {
        let Some(value) = small_integer(digits) else {
            if digits.is_empty() {
                return Ok(None);
            }
            let problem = format!("found {}, expected vertex numbers such as 1, 1/2, 1//3 or 1/2/3", word.quoted());
            return Err(self.reader.error(word.start, problem, "correct the face, or export the file again"));
        };
        let index = if value > 0 { value - 1 } else { count as i64 + value };
        if value == 0 || index < 0 {
            let reason = if value == 0 {
                format!("index 0 into the {list} lines, but they count from 1")
            } else {
                format!("index {value} goes back before the first of the {count} {list} lines so far")
            };
            return Err(self.reader.error(word.start, reason, "correct the face, or export the file again"));
        }
        Ok(Some(index.min(i64::from(NONE - 1)) as u32))
    }

    /// Checks that what the faces refer to exists. Indices of `vt` or `vn` in files without any such line are dropped.
    fn check_corners(&mut self) -> Result<(), ReadError> {
        let file = &mut self.file;
        let (positions, uvs, normals) = (file.positions.len(), file.uvs.len(), file.normals.len());
        let mut dangling = false;
        if uvs == 0 || normals == 0 {
            for corner in &mut file.corners {
                if uvs == 0 && corner.uv != NONE {
                    corner.uv = NONE;
                    dangling = true;
                }
                if normals == 0 && corner.normal != NONE {
                    corner.normal = NONE;
                    dangling = true;
                }
            }
        }
        if dangling {
            let name = &self.reader.input.name;
            self.notes.add("no such attribute", || {
                format!("{name}: faces refer to vt or vn lines, but the file has none; those indices were ignored")
            });
        }
        let good = |index: u32, count: usize| index == NONE || (index as usize) < count;
        let is_bad = |c: &Corner| c.position as usize >= positions || !good(c.uv, uvs) || !good(c.normal, normals);
        let Some(at) = file.corners.iter().position(is_bad) else { return Ok(()) };
        let corner = file.corners[at];
        let (list, index, count) = if corner.position as usize >= positions {
            ("v", corner.position, positions)
        } else if !good(corner.uv, uvs) {
            ("vt", corner.uv, uvs)
        } else {
            ("vn", corner.normal, normals)
        };
        let face = file.faces.partition_point(|f| f.end <= at);
        let first = if face == 0 { 0 } else { file.faces[face - 1].end };
        let mut text = Text::new(self.reader.bytes, file.faces[face].offset).with_continuations();
        let word = (0..=at - first + 1).filter_map(|_| text.word()).last();
        let offset = word.map_or(file.faces[face].offset, |w| w.start);
        let problem = format!("index {} into the {list} lines, but the file has {count}", u64::from(index) + 1);
        Err(self.reader.error(offset, problem, "correct the face, or export the file again"))
    }
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
