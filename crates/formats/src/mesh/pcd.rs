//! PCD, the clouds of points of the Point Cloud Library (PCL): text, binary and compressed binary.
//!
//! The header has lines of a word and its values: `FIELDS`, `SIZE`, `TYPE` (`I`, `U` or `F`),
//! `COUNT`, `WIDTH`, `HEIGHT`, `VIEWPOINT`, `POINTS` and `DATA`. Used are `x y z` and the colour
//! `rgb` or `rgba`: 32 bits, of which the lowest are blue, declared as a float or an integer.
//! Points of NaN are those that a scan has missed. As in PCL, the viewpoint does not move the
//! points.
//!
//! Compressed data are the size before and after, and one block of LZF in which each field is one
//! piece.

use super::colors;
use super::notes::{Notes, listed};
use super::text::{Reader, Text, Word};
use crate::points::{Column, PointTable, Values};
use crate::{Input, Place, ReadError, SceneReader};
use snell_intersect::TriangleMesh;
use snell_math::DVec3;
use snell_scene::WarningKind;

/// The reader of PCD files.
pub const READER: SceneReader = SceneReader {
    name: "pcd",
    description: "clouds of points of the Point Cloud Library, drawn as balls",
    extensions: &["pcd"],
    recognises: |bytes| {
        let start = &bytes[..bytes.len().min(256)];
        let has_fields = || start.windows(8).any(|word| word == b"\nFIELDS ");
        start.starts_with(b"# .PCD") || (start.starts_with(b"VERSION") && has_fields())
    },
    read: |input| {
        let mut notes = Notes::default();
        let mesh = parse(input, &mut notes)?;
        Ok(super::scene_of(input, mesh, notes))
    },
};

/// Names of the packed colour.
const COLORS: [&str; 2] = ["rgb", "rgba"];

/// Reads the points as vertices.
pub(super) fn parse(input: &Input, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    let table = points(input)?;
    let count = table.width * table.height;
    let axes = ["x", "y", "z"].map(|name| table.column(name));
    let [Some(x), Some(y), Some(z)] = axes else {
        return Err(input.error(
            Place::Whole,
            "the points have no fields x, y and z",
            "give the coordinates these names in the line FIELDS",
        ));
    };
    let at = |i: usize| {
        let place = [x, y, z].map(|axis| axis.values.get(i * axis.channels));
        DVec3::from_array(place) - input.origin
    };
    let mut mesh = TriangleMesh {
        positions: (0..count).map(|i| at(i).as_vec3()).collect(),
        ..TriangleMesh::default()
    };
    if input.options.exact {
        mesh.exact = (0..count).map(at).collect();
        mesh.drop_needless_exact();
    }
    if let Some(column) = COLORS.iter().find_map(|name| table.column(name)) {
        let bits = |i: usize| match &column.values {
            Values::F32(all) => all[i * column.channels].to_bits(),
            other => other.get(i * column.channels) as u32,
        };
        // The alpha of `rgb` is not set, and many programs leave that of `rgba` 0, too.
        let has_alpha = column.name == "rgba" && (0..count).any(|i| bits(i) >> 24 != 0);
        let color = |i: usize| {
            let bits = bits(i);
            let alpha = if has_alpha { bits >> 24 } else { 255 };
            [bits >> 16 & 255, bits >> 8 & 255, bits & 255, alpha].map(|byte| byte as f32)
        };
        mesh.colors = (0..count).map(color).collect();
        colors::bytes_to_linear(&mut mesh.colors);
    }
    let shown = ["x", "y", "z", COLORS[0], COLORS[1], "_"];
    let unread: Vec<&str> = table.columns.iter().map(|column| &*column.name).collect();
    let unread: Vec<&str> = unread.into_iter().filter(|name| !shown.contains(name)).collect();
    if !unread.is_empty() {
        notes.add_of(WarningKind::Choice, "fields", || {
            let names = listed(&unread);
            format!("{}: these fields of the points are not shown: {names}", input.name)
        });
    }
    Ok(mesh)
}

/// How the numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Text,
    Binary,
    Compressed,
}

/// Reads all fields. Padding (fields with the name `_`) is left out.
pub fn points(input: &Input) -> Result<PointTable, ReadError> {
    let mut reader = Reader::new(input, &input.bytes, Text::new(&input.bytes, 0));
    let (mut table, encoding) = header(&mut reader)?;
    let count = table.width * table.height;
    let sizes: Vec<usize> = table.columns.iter().map(|c| c.values.size() * c.channels).collect();
    let size: usize = sizes.iter().sum();
    let body = &input.bytes[reader.text.position()..];
    let cut_off = |needed: usize, found: usize| {
        input.error(
            Place::Byte(input.bytes.len() as u64),
            format!("there are {found} bytes of points, expected {needed}"),
            "the file seems cut off; export or copy it again",
        )
    };
    let total = count.checked_mul(size).ok_or_else(|| cut_off(usize::MAX, body.len()))?;
    match encoding {
        Encoding::Text => text_body(&mut reader, &mut table, count)?,
        Encoding::Binary => {
            let body = body.get(..total).ok_or_else(|| cut_off(total, body.len()))?;
            if size > 0 {
                for point in body.chunks_exact(size) {
                    let mut rest = point;
                    for column in &mut table.columns {
                        for _ in 0..column.channels {
                            let (number, after) = rest.split_at(column.values.size());
                            column.values.push_bytes(number);
                            rest = after;
                        }
                    }
                }
            }
        }
        Encoding::Compressed => {
            let number = |at: usize| {
                let bytes = body.get(at..).and_then(|rest| rest.first_chunk::<4>());
                let number = bytes.map(|bytes| u32::from_le_bytes(*bytes) as usize);
                number.ok_or_else(|| cut_off(8, body.len()))
            };
            let (packed, unpacked) = (number(0)?, number(4)?);
            let damaged = |problem: String| {
                input.error(
                    Place::Byte(reader.text.position() as u64),
                    problem,
                    "the file is damaged; copy or export it again",
                )
            };
            if unpacked != total {
                return Err(damaged(format!(
                    "the compressed points have {unpacked} bytes, expected {total}"
                )));
            }
            let body = body.get(8..8 + packed).ok_or_else(|| cut_off(8 + packed, body.len()))?;
            let Some(all) = unpack(body, unpacked) else {
                return Err(damaged("the compressed points cannot be unpacked".into()));
            };
            let mut rest = &all[..];
            for (column, size) in table.columns.iter_mut().zip(sizes) {
                let (piece, after) = rest.split_at(size * count);
                let numbers = piece.chunks_exact(column.values.size());
                numbers.for_each(|number| column.values.push_bytes(number));
                rest = after;
            }
        }
    }
    table.columns.retain(|column| column.name != "_");
    Ok(table)
}

/// Reads the header, up to the first byte of the points.
fn header(reader: &mut Reader<'_>) -> Result<(PointTable, Encoding), ReadError> {
    const EXPORT_AGAIN: &str = "correct the header, or export the file again";
    let mut lists: [Option<Vec<Word<'_>>>; 4] = [const { None }; 4];
    let mut sizes: [Option<usize>; 3] = [None; 3];
    let encoding = loop {
        let Some(word) = reader.text.word() else {
            if reader.text.is_at_end() {
                return Err(reader.missing("DATA"));
            }
            reader.text.next_line();
            continue;
        };
        let list =
            [&b"FIELDS"[..], b"SIZE", b"TYPE", b"COUNT"].iter().position(|k| *k == word.bytes);
        let size = [&b"WIDTH"[..], b"HEIGHT", b"POINTS"].iter().position(|k| *k == word.bytes);
        // The name of old files for FIELDS.
        let list = list.or((word.bytes == b"COLUMNS").then_some(0));
        if let Some(list) = list {
            lists[list] = Some(std::iter::from_fn(|| reader.text.word()).collect());
        } else if let Some(size) = size {
            let count = reader.count("a number of points", false)?;
            sizes[size] = Some(count as usize);
        } else if word.bytes == b"DATA" {
            let kind = reader.text.word().ok_or_else(|| reader.missing("ascii or binary"))?;
            break match kind.bytes {
                b"ascii" => Encoding::Text,
                b"binary" => Encoding::Binary,
                b"binary_compressed" => Encoding::Compressed,
                _ => {
                    let problem = format!(
                        "found DATA {}, expected ascii, binary or binary_compressed",
                        kind.quoted()
                    );
                    return Err(reader.error(kind.start, problem, EXPORT_AGAIN));
                }
            };
        } else if !word.bytes.starts_with(b"#") && !matches!(word.bytes, b"VERSION" | b"VIEWPOINT")
        {
            let problem = format!("{} is not a word of a header", word.quoted());
            return Err(reader.error(word.start, problem, EXPORT_AGAIN));
        }
        reader.text.next_line();
    };
    reader.text.next_line();
    let [Some(names), Some(bytes), Some(kinds), counts] = lists else {
        return Err(reader.error(0, "a line FIELDS, SIZE or TYPE is missing", EXPORT_AGAIN));
    };
    let lengths = [bytes.len(), kinds.len(), counts.as_ref().map_or(names.len(), Vec::len)];
    if lengths.iter().any(|length| *length != names.len()) {
        let problem = "the lines FIELDS, SIZE, TYPE and COUNT have different lengths";
        return Err(reader.error(
            names.first().map_or(0, |word| word.start),
            problem,
            EXPORT_AGAIN,
        ));
    }
    let mut columns = Vec::with_capacity(names.len());
    for (i, name) in names.iter().enumerate() {
        let Some(values) = empty(kinds[i].bytes, bytes[i].bytes) else {
            let problem = format!(
                "found type {} of size {}, expected I or U of 1, 2, 4 or 8 bytes, or F of 4 or 8",
                kinds[i].quoted(),
                bytes[i].quoted()
            );
            return Err(reader.error(kinds[i].start, problem, EXPORT_AGAIN));
        };
        let channels = match counts.as_ref().map(|counts| counts[i]) {
            None => 1,
            Some(word) => {
                let number = std::str::from_utf8(word.bytes).ok().and_then(|w| w.parse().ok());
                number.filter(|n| (1..=1 << 16).contains(n)).ok_or_else(|| {
                    let problem = format!("found COUNT {}, expected 1 or more", word.quoted());
                    reader.error(word.start, problem, EXPORT_AGAIN)
                })?
            }
        };
        columns.push(Column { name: String::from_utf8_lossy(name.bytes).into(), channels, values });
    }
    let [width, height, points] = sizes;
    let (width, height) = match (width, height, points) {
        (Some(width), height, _) => (width, height.unwrap_or(1)),
        (None, _, Some(points)) => (points, 1),
        (None, _, None) => return Err(reader.error(0, "a line WIDTH is missing", EXPORT_AGAIN)),
    };
    let product = width.checked_mul(height);
    if points.is_some_and(|points| product != Some(points)) {
        let problem =
            format!("there are {} points in {height} rows of {width}", points.unwrap_or_default());
        return Err(reader.error(0, problem, EXPORT_AGAIN));
    }
    // Every point takes a byte or more, packed by at most a hundred.
    let most = reader.text.remaining().saturating_mul(100);
    if product.is_none_or(|count| count > most) {
        let problem = format!("{width} × {height} points are more than the file can hold");
        return Err(reader.error(0, problem, EXPORT_AGAIN));
    }
    Ok((PointTable { width, height, columns }, encoding))
}

/// An empty list of numbers of a type and size.
fn empty(kind: &[u8], size: &[u8]) -> Option<Values> {
    Some(match (kind, size) {
        (b"I", b"1") => Values::I8(Vec::new()),
        (b"I", b"2") => Values::I16(Vec::new()),
        (b"I", b"4") => Values::I32(Vec::new()),
        (b"I", b"8") => Values::I64(Vec::new()),
        (b"U", b"1") => Values::U8(Vec::new()),
        (b"U", b"2") => Values::U16(Vec::new()),
        (b"U", b"4") => Values::U32(Vec::new()),
        (b"U", b"8") => Values::U64(Vec::new()),
        (b"F", b"4") => Values::F32(Vec::new()),
        (b"F", b"8") => Values::F64(Vec::new()),
        _ => return None,
    })
}

/// Reads points as text.
fn text_body(
    reader: &mut Reader<'_>,
    table: &mut PointTable,
    count: usize,
) -> Result<(), ReadError> {
    for _ in 0..count {
        for column in &mut table.columns {
            for _ in 0..column.channels {
                let Some(word) = reader.text.word_on_any_line() else {
                    return Err(reader.missing("another number"));
                };
                let text = std::str::from_utf8(word.bytes).unwrap_or("");
                if !column.values.push_word(text) {
                    return Err(reader.not_a_number(word, "a number"));
                }
            }
        }
    }
    Ok(())
}

/// Unpacks LZF (Lehmann's format) to exactly this size; `None` if the data are damaged.
fn unpack(packed: &[u8], size: usize) -> Option<Vec<u8>> {
    // A reference of 3 bytes stands for 264 at most.
    if size > packed.len().saturating_mul(264) {
        return None;
    }
    let mut out = Vec::with_capacity(size);
    let mut rest = packed;
    while let [control, after @ ..] = rest {
        let control = usize::from(*control);
        if control < 32 {
            let (literal, after) = after.split_at_checked(control + 1)?;
            out.extend_from_slice(literal);
            rest = after;
        } else {
            let (long, after) = match (control >> 5, after) {
                (7, [more, after @ ..]) => (usize::from(*more), after),
                (7, []) => return None,
                _ => (0, after),
            };
            let (low, after) = after.split_first()?;
            let back = ((control & 31) << 8 | usize::from(*low)) + 1;
            let start = out.len().checked_sub(back)?;
            // The piece may overlap what it is copied to.
            (0..(control >> 5) + long + 2).for_each(|i| out.push(out[start + i]));
            rest = after;
        }
        if out.len() > size {
            return None;
        }
    }
    (out.len() == size).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadOptions;
    use std::path::Path;

    fn input(bytes: &[u8]) -> Input {
        Input::from_bytes("a.pcd", bytes.to_vec(), Path::new("."), &ReadOptions::default())
    }

    fn file(data: &str, body: &[u8]) -> Vec<u8> {
        let header = format!(
            "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb ring\nSIZE \
            4 4 4 4 2\nTYPE F F F F U\nCOUNT 1 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 \
            0\nPOINTS 2\nDATA {data}\n"
        );
        [header.as_bytes(), body].concat()
    }

    /// The fields of two points, point after point and field after field.
    fn numbers() -> [Vec<u8>; 2] {
        let red = f32::from_bits(0x00ff_0000);
        let points = [([1.0f32, 2.0, 3.0, red], 7u16), ([4.0, 5.0, 6.0, 0.0], 9)];
        let rows = points.iter().flat_map(|(floats, ring)| {
            let floats = floats.iter().flat_map(|f| f.to_le_bytes());
            floats.chain(ring.to_le_bytes()).collect::<Vec<_>>()
        });
        let mut columns: Vec<u8> =
            (0..4).flat_map(|k| points.map(|point| point.0[k].to_le_bytes())).flatten().collect();
        columns.extend(points.iter().flat_map(|point| point.1.to_le_bytes()));
        [rows.collect(), columns]
    }

    #[test]
    fn text_binary_and_compressed_points_are_equal() {
        let [rows, columns] = numbers();
        let mut packed = Vec::new();
        for piece in columns.chunks(32) {
            packed.push(piece.len() as u8 - 1);
            packed.extend(piece);
        }
        let sizes = [packed.len() as u32, columns.len() as u32].map(u32::to_le_bytes).concat();
        let red = f32::from_bits(0x00ff_0000);
        let text = format!("1 2 3 {red:e} 7\n4 5 6 0 9\n");
        let read = |data, body: &[u8]| points(&input(&file(data, body))).expect("a cloud");
        let all = [
            read("ascii", text.as_bytes()),
            read("binary", &rows),
            read("binary_compressed", &[sizes, packed].concat()),
        ];
        assert_eq!(all[0], all[1]);
        assert_eq!(all[1], all[2]);
        assert_eq!(all[0].columns[4].values, Values::U16(vec![7, 9]));
        let mesh = parse(&input(&file("binary", &rows)), &mut Notes::default()).expect("a cloud");
        assert_eq!(mesh.colors, [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]);
        assert_eq!(mesh.positions[1].to_array(), [4.0, 5.0, 6.0]);
    }

    #[test]
    fn repeated_pieces_are_unpacked() {
        // One literal, then the same byte again 9 + 2 + 7 times, in one long reference.
        assert_eq!(unpack(&[0, b'a', 7 << 5, 9, 0], 19), Some(vec![b'a'; 19]));
        assert_eq!(unpack(&[1, b'a', b'b', 2 << 5, 1], 6), Some(b"ababab".to_vec()));
        assert_eq!(unpack(&[0, b'a', 1 << 5, 1], 4), None, "it begins before the start");
        assert_eq!(unpack(&[5, b'a'], 6), None);
        assert_eq!(unpack(&[], 1 << 40), None);
    }

    #[test]
    fn damaged_files_are_refused_with_their_place() {
        let [rows, _] = numbers();
        for (bytes, problem) in [
            (file("binary", &rows[1..]), "35 bytes of points, expected 36"),
            (file("gzip", &rows), "expected ascii, binary or binary_compressed"),
            (file("ascii", b"1 2 3 0 7\n4 5 six 0 9\n"), "\"six\""),
            (file("ascii", b"1 2 3 0 7\n4"), "another number"),
            (file("binary_compressed", &[255; 12]), "expected 36"),
            (b"VERSION 0.7\nFIELDS x\nSIZE 4 4\nTYPE F\nWIDTH 1\nDATA ascii\n1".into(), "lengths"),
            (b"VERSION 0.7\nFIELDS x\nSIZE 3\nTYPE F\nWIDTH 1\nDATA ascii\n1".into(), "size"),
        ] {
            let error = points(&input(&bytes)).expect_err("refused").to_string();
            assert!(error.contains(problem), "{error}");
        }
    }
}
