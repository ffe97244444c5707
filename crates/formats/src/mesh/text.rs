//! Words and numbers of line-based text formats.
//!
//! [`Text`] keeps only a position. Lines and columns are counted when a message needs them, so the
//! common path has no cost. Line ends are `\n`, `\r\n` or `\r`.

use super::notes::Notes;
use crate::{Input, Place, ReadError};
use snell_math::{DVec3, Vec3};
use std::borrow::Cow;
use std::cell::Cell;

/// A run of characters without white space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Word<'a> {
    /// The characters of the word.
    pub bytes: &'a [u8],
    /// Offset of the first character in the text.
    pub start: usize,
}

impl Word<'_> {
    /// The word for messages: in quotes, shortened if long.
    pub fn quoted(&self) -> String {
        let shown = String::from_utf8_lossy(&self.bytes[..self.bytes.len().min(40)]).into_owned();
        let dots = if self.bytes.len() > 40 { "…" } else { "" };
        format!("\"{}{dots}\"", shown.escape_debug())
    }
}

/// A text being read.
#[derive(Clone, Debug)]
pub struct Text<'a> {
    bytes: &'a [u8],
    position: usize,
    continuations: bool,
    comment: Option<u8>,
}

fn is_line_end(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c | 0)
}

impl<'a> Text<'a> {
    /// Starts at an offset.
    pub fn new(bytes: &'a [u8], position: usize) -> Self {
        Self { bytes, position, continuations: false, comment: None }
    }

    /// Returns the text with lines continued by a backslash at their end.
    pub fn with_continuations(self) -> Self {
        Self { continuations: true, ..self }
    }

    /// Returns the text with comments: a word that begins with `mark` hides the rest of its line.
    pub fn with_comments(self, mark: u8) -> Self {
        Self { comment: Some(mark), ..self }
    }

    /// Offset of the next byte.
    pub fn position(&self) -> usize {
        self.position
    }

    /// Number of bytes not read yet.
    pub fn remaining(&self) -> usize {
        self.bytes.len() - self.position
    }

    /// True at the end of the text.
    pub fn is_at_end(&self) -> bool {
        self.position >= self.bytes.len()
    }

    /// The next word of this line.
    pub fn word(&mut self) -> Option<Word<'a>> {
        self.skip_blanks();
        let start = self.position;
        let rest = &self.bytes[start..];
        if self.comment.is_some() && rest.first() == self.comment.as_ref() {
            return None;
        }
        let length = rest
            .iter()
            .position(|&b| b <= b' ' && (is_blank(b) || is_line_end(b)))
            .unwrap_or(rest.len());
        let mut word = &rest[..length];
        self.position = start + length;
        if self.continuations && word.len() > 1 && word.ends_with(b"\\") && self.is_at_line_end() {
            // The line is continued right after the word, so the backslash is left to the next
            // call.
            word = &word[..length - 1];
            self.position -= 1;
        }
        (!word.is_empty()).then_some(Word { bytes: word, start })
    }

    /// The next word of this or a later line; `None` at the end of the text.
    pub fn word_on_any_line(&mut self) -> Option<Word<'a>> {
        loop {
            if let Some(word) = self.word() {
                return Some(word);
            }
            if self.is_at_end() {
                return None;
            }
            self.next_line();
        }
    }

    /// The rest of this line, trimmed, including comments. Does not move to the next line.
    pub fn rest_of_line(&mut self) -> Word<'a> {
        self.skip_blanks();
        let start = self.position;
        let rest = &self.bytes[start..];
        let length = rest.iter().position(|&b| is_line_end(b)).unwrap_or(rest.len());
        self.position += length;
        let kept = rest[..length].iter().rposition(|&b| !is_blank(b)).map_or(0, |last| last + 1);
        Word { bytes: &rest[..kept], start }
    }

    /// Moves to the start of the next line.
    pub fn next_line(&mut self) {
        loop {
            let rest = &self.bytes[self.position..];
            let Some(length) = rest.iter().position(|&b| is_line_end(b)) else {
                self.position = self.bytes.len();
                return;
            };
            let continued = self.continuations && rest[..length].ends_with(b"\\");
            self.position += length;
            self.skip_line_end();
            if !continued {
                return;
            }
        }
    }

    fn is_at_line_end(&self) -> bool {
        self.bytes.get(self.position).is_some_and(|&b| is_line_end(b))
    }

    fn skip_line_end(&mut self) {
        let pair = self.bytes[self.position..].starts_with(b"\r\n");
        self.position += if pair { 2 } else { 1 };
    }

    fn skip_blanks(&mut self) {
        while let Some(&byte) = self.bytes.get(self.position) {
            if is_blank(byte) {
                self.position += 1;
            } else if self.continuations
                && byte == b'\\'
                && self.bytes.get(self.position + 1).is_some_and(|&b| is_line_end(b))
            {
                self.position += 1;
                self.skip_line_end();
            } else {
                return;
            }
        }
    }
}

/// Line and column of an offset, both from 1; columns count characters.
pub fn place_of(bytes: &[u8], offset: usize) -> Place {
    let before = &bytes[..offset.min(bytes.len())];
    let mut line = 1;
    let mut start = 0;
    for (i, &byte) in before.iter().enumerate() {
        let first_of_pair = byte == b'\r' && bytes.get(i + 1) == Some(&b'\n');
        if is_line_end(byte) && !first_of_pair {
            line += 1;
            start = i + 1;
        }
    }
    let column = before[start..].iter().filter(|&&b| b & 0xc0 != 0x80).count() + 1;
    Place::Column(line, column)
}

/// A word interpreted as a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// A number, which may be infinite or NaN if the word is.
    Exact(f32),
    /// A number with a comma for the point, such as `1,5`.
    Comma(f32),
    /// A number followed by something else, such as `3.1+e2`.
    Prefix(f32),
    /// The word does not begin with a number.
    None,
}

/// Parses a number: everything that C's `strtod` and Rust's `parse` accept in decimal, and
/// `1.#QNAN`, `-nan(ind)` and the like.
pub fn number(word: &[u8]) -> Number {
    if let Some(value) = short_decimal(word) {
        return Number::Exact(value);
    }
    let parse = |bytes| std::str::from_utf8(bytes).ok().and_then(|s: &str| s.parse::<f32>().ok());
    if let Some(value) = parse(word) {
        return Number::Exact(value);
    }
    if let Some(at) =
        word.iter().position(|&b| b == b'#').filter(|&at| at >= 2 && word[at - 1] == b'.')
    {
        // Old Microsoft libraries print such numbers: 1.#INF, -1.#IND, 1.#QNAN.
        let infinite = word[at..].to_ascii_uppercase().starts_with(b"#INF");
        let sign = if word[0] == b'-' { -1.0 } else { 1.0 };
        return Number::Exact(if infinite { sign * f32::INFINITY } else { f32::NAN });
    }
    if is_annotated_nan(word) {
        return Number::Exact(f32::NAN);
    }
    if let Some(value) = with_point(word).and_then(|word| word.parse().ok()) {
        return Number::Comma(value);
    }
    let numeric =
        word.iter().take(64).take_while(|b| b.is_ascii_digit() || b"+-.eE".contains(b)).count();
    (1..=numeric).rev().find_map(|n| parse(&word[..n])).map_or(Number::None, Number::Prefix)
}

/// Parses a number, and subtracts `origin` in double precision.
pub fn number_from(word: &[u8], origin: f64) -> Number {
    if origin == 0.0 {
        return number(word);
    }
    let parse = |text: &str| text.parse::<f64>().ok().map(|value| (value - origin) as f32);
    let moved = |value: f32| (f64::from(value) - origin) as f32;
    if let Some(value) = std::str::from_utf8(word).ok().and_then(parse) {
        return Number::Exact(value);
    }
    match number(word) {
        Number::Exact(value) => Number::Exact(moved(value)),
        Number::Comma(value) => {
            let exact = with_point(word).and_then(|word| parse(&word));
            Number::Comma(exact.unwrap_or_else(|| moved(value)))
        }
        Number::Prefix(value) => Number::Prefix(moved(value)),
        Number::None => Number::None,
    }
}

/// Parses a number in double precision, and subtracts `origin`. NaN unless [`number_from`] finds a
/// number in the word.
pub fn exact_from(word: &[u8], origin: f64) -> f64 {
    let parse = |text: &str| text.parse::<f64>().ok().map(|value| value - origin);
    let plain = std::str::from_utf8(word).ok().and_then(parse);
    let exact = plain.or_else(|| with_point(word).and_then(|word| parse(&word)));
    exact.unwrap_or_else(|| match number(word) {
        Number::Exact(value) | Number::Comma(value) | Number::Prefix(value) => {
            f64::from(value) - origin
        }
        Number::None => f64::NAN,
    })
}

/// True for NaN as newer Microsoft libraries and C's `printf` write it: `nan(ind)`, `-nan(snan)`,
/// `nan(0x8000)`.
fn is_annotated_nan(word: &[u8]) -> bool {
    let word = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word);
    word.len() >= 5 && word[..4].eq_ignore_ascii_case(b"nan(") && word.ends_with(b")")
}

/// The word with a point for its comma, if it has one comma with digits on both sides and no point.
fn with_point(word: &[u8]) -> Option<String> {
    let at = word.iter().position(|&b| b == b',')?;
    let is_digit = |b: Option<&u8>| b.is_some_and(u8::is_ascii_digit);
    let has_digits = is_digit(word.get(at.checked_sub(1)?)) && is_digit(word.get(at + 1));
    if !has_digits || word[at + 1..].iter().any(|b| b",.".contains(b)) || word[..at].contains(&b'.')
    {
        return None;
    }
    let mut word = word.to_vec();
    word[at] = b'.';
    String::from_utf8(word).ok()
}

/// Fast path for common numbers: up to about seven digits without exponent are a quotient of two
/// numbers that single precision holds exactly, rounded once (Clinger, How to read floating point
/// numbers accurately, 1990).
fn short_decimal(word: &[u8]) -> Option<f32> {
    const POWERS: [f32; 11] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10];
    const MOST: u32 = 1 << 24;
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, word),
    };
    if digits.len() > POWERS.len() {
        return None;
    }
    let (mut value, mut decimals, mut point) = (0u32, 0, false);
    for &byte in digits {
        match byte {
            b'0'..=b'9' if value <= MOST => {
                value = value * 10 + u32::from(byte - b'0');
                decimals += usize::from(point);
            }
            b'.' if !point => point = true,
            _ => return None,
        }
    }
    // A word without digits before or after the point is not a number.
    let has_digits = digits.len() > usize::from(point);
    let number = (has_digits && value <= MOST).then(|| value as f32 / POWERS[decimals])?;
    Some(if negative { -number } else { number })
}

/// Bytes as UTF-8 or similar 8-bit text: without a byte order mark, and UTF-16 converted.
pub fn decoded(bytes: &[u8]) -> Cow<'_, [u8]> {
    let convert = |unit: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        let text: String =
            char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        Cow::Owned(text.into_bytes())
    };
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => Cow::Borrowed(rest),
        [0xfe, 0xff, ..] => convert(u16::from_be_bytes),
        [0xff, 0xfe, ..] => convert(u16::from_le_bytes),
        _ => Cow::Borrowed(bytes),
    }
}

/// A text file being read: its words, and errors about them.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    /// The file.
    pub input: &'a Input,
    /// The decoded content of the file.
    pub bytes: &'a [u8],
    /// The words.
    pub text: Text<'a>,
    /// The offset of the first number that has a comma for the point.
    comma: Cell<Option<usize>>,
}

impl<'a> Reader<'a> {
    /// A reader of the words of `text`, which are those of `bytes`.
    pub fn new(input: &'a Input, bytes: &'a [u8], text: Text<'a>) -> Self {
        Self { input, bytes, text, comma: Cell::default() }
    }

    /// Remembers that the number at an offset has a comma for the point.
    pub fn found_comma(&self, offset: usize) {
        self.comma.set(Some(self.comma.get().unwrap_or(offset)));
    }

    /// Adds the warning about decimal commas, if there were any.
    pub fn note_commas(&self, notes: &mut Notes) {
        let Some(first) = self.comma.get() else { return };
        notes.add("decimal comma", || {
            format!(
                "{}: a number has a comma in place of the decimal point; such numbers were read \
                as decimal numbers",
                self.location(first)
            )
        });
    }

    /// An error at an offset.
    pub fn error(
        &self,
        offset: usize,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> ReadError {
        self.input.error(place_of(self.bytes, offset), problem, remedy)
    }

    /// The place where the search for the next word begins.
    pub fn here(&self) -> Place {
        place_of(self.bytes, self.bytes.len() - self.text.remaining())
    }

    /// `file:line:column`, for warnings.
    pub fn location(&self, offset: usize) -> String {
        match place_of(self.bytes, offset) {
            Place::Column(line, column) => format!("{}:{line}:{column}", self.input.name),
            _ => self.input.name.clone(),
        }
    }

    /// The next three words, on this line or on any line, as a position relative to
    /// [`Input::origin`]; and in double precision, if the options ask for it. `what` names one of
    /// its coordinates.
    pub fn position(
        &mut self,
        what: &dyn Fn() -> String,
        any_line: bool,
    ) -> Result<(Vec3, Option<DVec3>), ReadError> {
        let (mut near, mut exact) = (Vec3::ZERO, DVec3::ZERO);
        for axis in 0..3 {
            let word = if any_line { self.text.word_on_any_line() } else { self.text.word() };
            let Some(word) = word else { return Err(self.missing(&what())) };
            let origin = self.input.origin[axis];
            near[axis] = match number_from(word.bytes, origin) {
                Number::Exact(value) => value,
                Number::Comma(value) => {
                    self.found_comma(word.start);
                    value
                }
                _ => return Err(self.not_a_number(word, &what())),
            };
            if self.input.options.exact {
                exact[axis] = exact_from(word.bytes, origin);
            }
        }
        Ok((near, self.input.options.exact.then_some(exact)))
    }

    /// The next word as a number on this line, or on any line.
    pub fn number(&mut self, what: &str, any_line: bool) -> Result<f32, ReadError> {
        let word = if any_line { self.text.word_on_any_line() } else { self.text.word() };
        match word {
            Some(word) => self.number_in(word, what),
            None => Err(self.missing(what)),
        }
    }

    /// Parses a word as a number.
    pub fn number_in(&self, word: Word<'_>, what: &str) -> Result<f32, ReadError> {
        match number(word.bytes) {
            Number::Exact(value) => Ok(value),
            Number::Comma(value) => {
                self.found_comma(word.start);
                Ok(value)
            }
            _ => Err(self.not_a_number(word, what)),
        }
    }

    /// The error for a word that should be a number.
    pub fn not_a_number(&self, word: Word<'_>, what: &str) -> ReadError {
        let comma = word.bytes.contains(&b',');
        let remedy = if comma {
            "write a decimal point instead of a comma"
        } else {
            "write a decimal number"
        };
        self.error(word.start, format!("found {}, expected {what}", word.quoted()), remedy)
    }

    /// The error for a word that is not there.
    pub fn missing(&self, what: &str) -> ReadError {
        if self.text.is_at_end() {
            return self.error(
                self.text.position(),
                format!("the file ends where {what} is expected"),
                "the file seems cut off; export or copy it again",
            );
        }
        self.error(
            self.text.position(),
            format!("the line ends where {what} is expected"),
            "complete the line, or export the file again",
        )
    }

    /// The next word as a whole number from 0.
    pub fn count(&mut self, what: &str, any_line: bool) -> Result<u64, ReadError> {
        let word = if any_line { self.text.word_on_any_line() } else { self.text.word() };
        let word = word.ok_or_else(|| self.missing(what))?;
        std::str::from_utf8(word.bytes).ok().and_then(|s| s.parse().ok()).ok_or_else(|| {
            self.error(
                word.start,
                format!("found {}, expected {what}", word.quoted()),
                "write a whole number that is not negative",
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_end_with_blanks_and_lines() {
        let mut text = Text::new(b"a  bc\t\r\nd # e\rf", 0).with_comments(b'#');
        let words = |t: &mut Text| {
            std::iter::from_fn(|| t.word().map(|w| w.bytes.to_vec())).collect::<Vec<_>>()
        };
        assert_eq!(words(&mut text), [b"a".to_vec(), b"bc".to_vec()]);
        text.next_line();
        assert_eq!(words(&mut text), [b"d".to_vec()]);
        text.next_line();
        assert_eq!(words(&mut text), [b"f".to_vec()]);
        assert!(text.is_at_end());
    }

    #[test]
    fn a_backslash_at_the_end_of_a_line_continues_it() {
        let mut text = Text::new(b"f 1 2\\\r\n 3 \\\n4\nv", 0).with_continuations();
        let mut words = Vec::new();
        while let Some(word) = text.word() {
            words.push(word.bytes);
        }
        assert_eq!(words, [b"f", b"1", b"2", b"3", b"4"]);
        text.next_line();
        assert_eq!(text.word().map(|w| w.bytes), Some(&b"v"[..]));
    }

    #[test]
    fn places_count_every_kind_of_line_end_once() {
        let bytes = "a\r\nb\rc\n\u{e4}x".as_bytes();
        assert_eq!(place_of(bytes, 0), Place::Column(1, 1));
        assert_eq!(place_of(bytes, 3), Place::Column(2, 1));
        assert_eq!(place_of(bytes, 5), Place::Column(3, 1));
        assert_eq!(place_of(bytes, 9), Place::Column(4, 2));
    }

    #[test]
    fn numbers_come_in_many_spellings() {
        for (word, value) in
            [("1.", 1.0), (".5", 0.5), ("+1e3", 1000.0), ("-2.e+1", -20.0), ("1E2", 100.0)]
        {
            assert_eq!(number(word.as_bytes()), Number::Exact(value), "{word}");
        }
        for (value, digits) in (0..2000u64).map(|i| (i * i * 7919 % 33_554_432, i as usize % 9)) {
            let text = format!("{}.{:0digits$}", value / 1000, value % 1000);
            assert_eq!(
                number(text.as_bytes()),
                Number::Exact(text.parse().expect("a number")),
                "{text}"
            );
        }
        for word in ["-", ".", "-.", "", "1.2.3"] {
            assert!(!matches!(number(word.as_bytes()), Number::Exact(_)), "{word}");
        }
        assert_eq!(number(b"3.1+e2"), Number::Prefix(3.1));
        assert_eq!(number(b"-1,5e1"), Number::Comma(-15.0));
        for word in ["1,2,3", "1.5,2", "1,", ",5", "1,x"] {
            assert!(!matches!(number(word.as_bytes()), Number::Comma(_)), "{word}");
        }
        assert_eq!(number(b"-1.#INF"), Number::Exact(f32::NEG_INFINITY));
        assert!(matches!(number(b"1.#QNAN"), Number::Exact(x) if x.is_nan()));
        for word in ["nan", "-nan", "nan(ind)", "-nan(ind)", "NaN(snan)", "-1.#IND00"] {
            assert!(matches!(number(word.as_bytes()), Number::Exact(x) if x.is_nan()), "{word}");
        }
        assert_eq!(number(b"nana"), Number::None);
        assert_eq!(number(b"x"), Number::None);
        assert_eq!(number(b""), Number::None);
        assert_eq!(number_from(b"4649776.25", 4_649_776.0), Number::Exact(0.25));
        assert_eq!(number_from(b"4649776,25", 4_649_776.0), Number::Comma(0.25));
    }

    #[test]
    fn utf16_becomes_utf8() {
        assert_eq!(&*decoded(b"\xfe\xff\0v\0 \x001"), b"v 1");
        assert_eq!(&*decoded(b"\xff\xfev\0 \x001\0"), b"v 1");
        assert_eq!(&*decoded(b"\xef\xbb\xbfv"), b"v");
    }
}
