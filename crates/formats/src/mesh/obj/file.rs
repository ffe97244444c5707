//! The contents of an OBJ file, read in pieces on all cores.
//!
//! Lines are independent with three exceptions. Face indices may count back from the latest vertex,
//! so the lines of each list are counted first. The material, smoothing group and object of a face
//! are set by earlier statements, so they stay open until the pieces are joined in order. And a
//! face may refer to later lines, so indices are checked at the end.

use super::parse::{self, Piece, Stroke};
use crate::mesh::colors;
use crate::mesh::notes::Notes;
use crate::mesh::text::{Reader, Text, Word, decoded};
use crate::mesh::too_many;
use crate::{Input, ReadError};
use rayon::prelude::*;
use snell_math::{DVec3, Vec2, Vec3};
use std::collections::HashMap;
use std::ops::Range;

/// Marks a missing index.
pub const NONE: u32 = u32::MAX;

/// Stands for the index of a line that no file has.
pub const DANGLING: u32 = NONE - 1;

/// The approximate size of a piece in bytes. Tests cut small files too.
const PIECE: usize = if cfg!(test) { 48 } else { 1 << 20 };

/// A corner of a face: numbers from 0, or [`NONE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Corner {
    pub position: u32,
    pub uv: u32,
    pub normal: u32,
}

/// Numbers of lines of each list.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    pub positions: usize,
    pub uvs: usize,
    pub normals: usize,
}

/// The state set by the latest statements; `None` before any.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Number of the material name.
    pub material: Option<u32>,
    /// Smoothing group; 0 is off.
    pub smoothing: Option<u32>,
    /// Number of the object.
    pub object: Option<u32>,
}

/// A run of faces that have the same state.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    pub faces: usize,
    pub state: State,
}

impl Run {
    /// Appends a face to the last run, or begins another.
    pub fn add_face(runs: &mut Vec<Self>, state: State) {
        match runs.last_mut() {
            Some(last) if last.state == state => last.faces += 1,
            _ => runs.push(Self { faces: 1, state }),
        }
    }
}

/// The faces of a piece. Attributes that a file lacks take no memory.
#[derive(Debug, Default)]
pub struct Faces {
    /// Offset of the piece in the text.
    start: usize,
    positions: Vec<u32>,
    /// Empty, or one per corner up to the last that has one.
    uvs: Vec<u32>,
    normals: Vec<u32>,
    /// Corners of each face; empty if all have three.
    sizes: Vec<u32>,
}

impl Faces {
    /// An empty list, for the piece of the text that starts at an offset.
    pub fn starting_at(start: usize) -> Self {
        Self { start, ..Self::default() }
    }

    /// Corners of all faces.
    pub fn corner_count(&self) -> usize {
        self.positions.len()
    }

    /// Adds a corner to the current face.
    pub fn push_corner(&mut self, corner: Corner) {
        let put = |list: &mut Vec<u32>, index: u32, at: usize| {
            if index != NONE || !list.is_empty() {
                list.resize(at, NONE);
                list.push(index);
            }
        };
        put(&mut self.uvs, corner.uv, self.positions.len());
        put(&mut self.normals, corner.normal, self.positions.len());
        self.positions.push(corner.position);
    }

    /// Removes the last corners.
    pub fn take_back(&mut self, corners: usize) {
        let left = self.positions.len() - corners;
        for list in [&mut self.positions, &mut self.uvs, &mut self.normals] {
            list.truncate(left);
        }
    }

    /// Ends a face that consists of the last corners.
    pub fn end_face(&mut self, corners: usize) {
        if corners != 3 && self.sizes.is_empty() {
            self.sizes.resize((self.positions.len() - corners) / 3, 3);
            self.sizes.push(corners as u32);
        } else if !self.sizes.is_empty() {
            self.sizes.push(corners as u32);
        }
    }

    /// The corner with this number.
    pub fn corner(&self, at: usize) -> Corner {
        let index = |list: &[u32]| list.get(at).copied().unwrap_or(NONE);
        Corner { position: self.positions[at], uv: index(&self.uvs), normal: index(&self.normals) }
    }

    /// The corners of each face.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let count = if self.sizes.is_empty() { self.positions.len() / 3 } else { self.sizes.len() };
        let mut end = 0;
        (0..count).map(move |face| {
            let start = end;
            end += self.sizes.get(face).map_or(3, |&size| size as usize);
            start..end
        })
    }

    /// The first corner with an index out of range.
    fn first_dangling(&self, counts: Counts) -> Option<usize> {
        let bad = |list: &[u32], count: usize| {
            list.par_iter().position_first(|&i| i != NONE && i as usize >= count)
        };
        let lists = [
            bad(&self.positions, counts.positions.min(NONE as usize)),
            bad(&self.uvs, counts.uvs),
            bad(&self.normals, counts.normals),
        ];
        lists.into_iter().flatten().min()
    }

    /// The faces without those for which `is_bad` holds, and their runs.
    fn without(&self, runs: &[Run], is_bad: impl Fn(Corner) -> bool) -> (Self, Vec<Run>) {
        let (mut kept, mut kept_runs) = (Self::starting_at(self.start), Vec::new());
        let mut ranges = self.ranges();
        for run in runs {
            for range in ranges.by_ref().take(run.faces) {
                if range.clone().any(|at| is_bad(self.corner(at))) {
                    continue;
                }
                let corners = range.len();
                range.for_each(|at| kept.push_corner(self.corner(at)));
                kept.end_face(corners);
                Run::add_face(&mut kept_runs, run.state);
            }
        }
        (kept, kept_runs)
    }
}

/// The contents of an OBJ file.
#[derive(Debug, Default)]
pub struct ObjFile {
    pub positions: Vec<Vec3>,
    /// The positions in double precision, if the options ask for them.
    pub exact: Vec<DVec3>,
    /// Linear vertex colours: empty, or as many as positions.
    pub colors: Vec<[f32; 4]>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    /// The faces and their states. Every face has an object number.
    pub pieces: Vec<(Faces, Vec<Run>)>,
    /// Points and lines, whose vertices exist.
    pub strokes: Vec<Stroke>,
    /// Object names in order of appearance; the first is that of faces before any `o`.
    pub objects: Vec<String>,
    /// Material names in order of appearance, each with the offset of its first use.
    pub materials: Vec<(String, usize)>,
    /// The names in `mtllib` statements, with their offsets.
    pub libraries: Vec<(String, usize)>,
}

/// Reads a file.
pub fn parse(input: &Input, notes: &mut Notes) -> Result<ObjFile, ReadError> {
    let bytes = decoded(&input.bytes);
    let ranges = pieces(&bytes);
    let text = |range: &Range<usize>| {
        Text::new(&bytes[..range.end], range.start).with_continuations().with_comments(b'#')
    };
    let reader = |range: &Range<usize>| Reader::new(input, &bytes, text(range));
    let counts: Vec<Counts> = if ranges.len() == 1 {
        vec![Counts::default()]
    } else {
        ranges.par_iter().map(|range| count_lines(text(range))).collect()
    };
    let before: Vec<Counts> =
        counts.iter().scan(Counts::default(), |sum, &c| Some(sum.then(c))).collect();
    let read: Vec<_> = ranges
        .par_iter()
        .zip(before)
        .map(|(range, before)| parse::parse(reader(range), before))
        .collect();
    let mut joiner = Joiner::default();
    for piece in read {
        joiner.join(piece?, notes);
    }
    if let (0, Some(offset)) = (joiner.known, joiner.unknown) {
        let problem = "found no statement of an OBJ file, expected v, f or the like";
        return Err(reader(&(0..bytes.len())).error(offset, problem, "this is not an OBJ file"));
    }
    let mut file = joiner.file;
    colors::to_linear(&mut file.colors);
    let elements = input.options.limits.elements;
    for (count, what) in [
        (file.positions.len(), "vertices"),
        (file.uvs.len(), "texture coordinates"),
        (file.normals.len(), "normals"),
        (file.pieces.iter().map(|(faces, _)| faces.corner_count()).sum(), "corners of faces"),
    ] {
        if count > elements {
            // The position of the first element over the limit is not known: the file was read in
            // pieces.
            return Err(too_many(input, crate::mesh::text::place_of(&bytes, bytes.len()), what));
        }
    }
    drop_indices_into_nothing(input, &mut file, notes);
    drop_dangling_faces(&mut file, &reader(&(0..bytes.len())), notes);
    drop_dangling_strokes(&mut file, &reader(&(0..bytes.len())), notes);
    Ok(file)
}

impl Counts {
    /// Adds `more` to the counts, and returns the counts before the addition.
    fn then(&mut self, more: Self) -> Self {
        let before = *self;
        self.positions += more.positions;
        self.uvs += more.uvs;
        self.normals += more.normals;
        before
    }
}

/// Pieces of whole lines; lines that continue on the next stay together.
fn pieces(bytes: &[u8]) -> Vec<Range<usize>> {
    let mut pieces = Vec::with_capacity(bytes.len() / PIECE + 1);
    let mut start = 0;
    while bytes.len() - start > PIECE {
        // A cut must not lie between a backslash and the end of its line, nor inside a line end.
        let cut = bytes[start..start + PIECE]
            .iter()
            .rposition(|b| !b"\\\r".contains(b))
            .map_or(start, |at| start + at + 1);
        let mut text = Text::new(bytes, cut).with_continuations();
        text.next_line();
        let end = text.position();
        pieces.push(start..end);
        start = end;
    }
    pieces.push(start..bytes.len());
    pieces
}

/// Counts the lines of each list.
fn count_lines(mut text: Text) -> Counts {
    let mut counts = Counts::default();
    while let Some(keyword) = text.word_on_any_line() {
        match keyword.bytes {
            b"v" => counts.positions += 1,
            b"vt" => counts.uvs += 1,
            b"vn" => counts.normals += 1,
            _ => {}
        }
        text.next_line();
    }
    counts
}

/// Joins pieces.
struct Joiner {
    file: ObjFile,
    /// The state at the end of the pieces so far.
    state: State,
    /// Numbers of material names. Never iterated, so order does not matter.
    material_numbers: HashMap<String, u32>,
    known: u64,
    unknown: Option<usize>,
}

impl Default for Joiner {
    fn default() -> Self {
        Self {
            file: ObjFile { objects: vec![String::new()], ..ObjFile::default() },
            state: State { object: Some(0), ..State::default() },
            material_numbers: HashMap::new(),
            known: 0,
            unknown: None,
        }
    }
}

impl Joiner {
    fn join(&mut self, piece: Piece, notes: &mut Notes) {
        let file = &mut self.file;
        if !piece.colors.is_empty() || !file.colors.is_empty() {
            file.colors.resize(file.positions.len(), colors::MISSING);
            file.colors.extend(&piece.colors);
            file.colors.resize(file.positions.len() + piece.positions.len(), colors::MISSING);
        }
        file.positions.extend(piece.positions);
        file.exact.extend(piece.exact);
        file.uvs.extend(piece.uvs);
        file.normals.extend(piece.normals);
        file.libraries.extend(piece.libraries);
        let first_object = file.objects.len() as u32;
        file.objects.extend(piece.objects);
        let materials: Vec<u32> = piece
            .materials
            .into_iter()
            .map(|(name, offset)| {
                *self.material_numbers.entry(name).or_insert_with_key(|name| {
                    file.materials.push((name.clone(), offset));
                    file.materials.len() as u32 - 1
                })
            })
            .collect();
        let before = self.state;
        let said = |state: State| State {
            material: state.material.map(|m| materials[m as usize]).or(before.material),
            smoothing: state.smoothing.or(before.smoothing),
            object: state.object.map(|o| first_object + o).or(before.object),
        };
        let runs = piece
            .runs
            .into_iter()
            .map(|run| Run { faces: run.faces, state: said(run.state) })
            .collect();
        file.pieces.push((piece.faces, runs));
        file.strokes.extend(piece.strokes.into_iter().map(|stroke| Stroke {
            material: stroke.material.map(|m| materials[m as usize]).or(before.material),
            ..stroke
        }));
        self.state = said(piece.end);
        self.known += piece.known;
        self.unknown = self.unknown.or(piece.unknown);
        notes.append(piece.notes);
    }
}

/// Drops indices of `vt` or `vn` in files without any such line.
fn drop_indices_into_nothing(input: &Input, file: &mut ObjFile, notes: &mut Notes) {
    let (uvs, normals) = (file.uvs.is_empty(), file.normals.is_empty());
    let mut dangling = false;
    for (faces, _) in &mut file.pieces {
        dangling |= (uvs && !faces.uvs.is_empty()) || (normals && !faces.normals.is_empty());
        if uvs {
            faces.uvs = Vec::new();
        }
        if normals {
            faces.normals = Vec::new();
        }
    }
    if dangling {
        let name = &input.name;
        notes.add("no such attribute", || {
            format!(
                "{name}: faces refer to vt or vn lines, but the file has none; those indices \
                were ignored"
            )
        });
    }
}

/// Drops the faces that name vertices, texture coordinates or normals that the file lacks.
fn drop_dangling_faces(file: &mut ObjFile, reader: &Reader, notes: &mut Notes) {
    let counts = Counts {
        positions: file.positions.len(),
        uvs: file.uvs.len(),
        normals: file.normals.len(),
    };
    let is_bad = |corner: Corner| {
        let dangles = |index: u32, count: usize| index != NONE && index as usize >= count;
        dangles(corner.position, counts.positions)
            || dangles(corner.uv, counts.uvs)
            || dangles(corner.normal, counts.normals)
    };
    for (faces, runs) in &mut file.pieces {
        let Some(at) = faces.first_dangling(counts) else { continue };
        let (kept, kept_runs) = faces.without(runs, is_bad);
        let dropped = faces.ranges().count() - kept.ranges().count();
        let message = || {
            let (place, word) = corner_in_text(reader, faces.start, at);
            let Counts { positions, uvs, normals } = counts;
            format!(
                "{place}: {word} is not a corner of this file, which has {positions} v, {uvs} vt \
                and {normals} vn lines; such faces were skipped"
            )
        };
        notes.add_times(dropped as u64, "dangling", message);
        (*faces, *runs) = (kept, kept_runs);
    }
}

/// Drops the points and lines that name vertices that the file lacks, and lines of one vertex.
fn drop_dangling_strokes(file: &mut ObjFile, reader: &Reader, notes: &mut Notes) {
    let count = file.positions.len();
    file.strokes.retain(|stroke| {
        let is_good =
            !stroke.vertices.is_empty() && stroke.vertices.iter().all(|&i| (i as usize) < count);
        if !is_good {
            notes.add("dangling stroke", || {
                format!(
                    "{}: a point or line of vertices that the file lacks, which has {count} v \
                    lines; such points and lines were skipped",
                    reader.location(stroke.start)
                )
            });
        }
        is_good
    });
}

/// The place of a piece's corner in the text and its word in quotes, found by reading the piece
/// again.
fn corner_in_text(reader: &Reader, start: usize, at: usize) -> (String, String) {
    let mut text = Text::new(reader.bytes, start).with_continuations().with_comments(b'#');
    let mut before = 0;
    while let Some(keyword) = text.word_on_any_line() {
        if matches!(keyword.bytes, b"f" | b"fo") {
            let corners: Vec<Word> = std::iter::from_fn(|| text.word()).collect();
            // Faces with fewer corners were skipped.
            if corners.len() >= 3 {
                if let Some(word) = corners.get(at - before) {
                    return (reader.location(word.start), word.quoted());
                }
                before += corners.len();
            }
        }
        text.next_line();
    }
    (reader.location(start), "a word".into())
}
