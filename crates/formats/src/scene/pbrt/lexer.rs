//! Converts bytes to tokens: words, strings, numbers and brackets, each with its place.

use crate::Input;
use crate::scene::fault::{Fault, Spot};

/// Numbers beyond this cannot be rendered in single precision.
const LARGEST: f64 = f32::MAX as f64;

/// A token of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Token<'a> {
    /// A bare word: a directive, a number, `true` or `false`.
    Word(&'a [u8]),
    /// The content of a string in double quotes.
    String(&'a [u8]),
    /// The bracket `[`.
    Open,
    /// The bracket `]`.
    Close,
}

impl Token<'_> {
    /// The token for a message: in quotes and shortened.
    pub fn quoted(&self) -> String {
        match self {
            Self::Word(bytes) | Self::String(bytes) => quoted(bytes),
            Self::Open => "\"[\"".into(),
            Self::Close => "\"]\"".into(),
        }
    }
}

/// Bytes of a file for a message: in quotes and shortened.
pub fn quoted(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let shown: String = text.chars().take(60).flat_map(char::escape_debug).collect();
    let dots = if text.chars().nth(60).is_some() { "..." } else { "" };
    format!("\"{shown}{dots}\"")
}

/// The tokens of a file. Comments run from a `#` to the end of the line.
#[derive(Debug)]
pub struct Lexer<'a> {
    bytes: &'a [u8],
    next: usize,
    file: u32,
    line: u32,
    /// A position on the current line and its column. Counting continues from there, so that long
    /// lines take no more time.
    mark: (usize, u32),
}

impl<'a> Lexer<'a> {
    /// The tokens of a file, which has the number `file` in the scene.
    pub fn new(input: &'a Input, file: u32) -> Self {
        let start = if input.bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { bytes: &input.bytes, next: start, file, line: 1, mark: (start, 1) }
    }

    /// Skips blanks and comments; true if anything follows.
    pub fn something_follows(&mut self) -> bool {
        while let Some(&byte) = self.bytes.get(self.next) {
            match byte {
                b'\n' => {
                    self.next += 1;
                    self.line += 1;
                    self.mark = (self.next, 1);
                }
                b' ' | b'\t' | b'\r' | 0x0b | 0x0c => self.next += 1,
                b'#' => {
                    let rest = &self.bytes[self.next..];
                    self.next += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                }
                _ => return true,
            }
        }
        false
    }

    /// The place of the next token.
    pub fn spot(&mut self) -> Spot {
        let (from, column) = self.mark;
        // Continuation bytes of UTF-8 do not start a character.
        let characters = self.bytes[from..self.next].iter().filter(|&&b| b & 0xc0 != 0x80).count();
        self.mark = (self.next, column + characters as u32);
        Spot { file: self.file, line: self.line, column: self.mark.1 }
    }

    /// True if the next byte is `byte`. The caller has skipped blanks.
    fn is_at(&self, byte: u8) -> bool {
        self.bytes.get(self.next) == Some(&byte)
    }

    /// True if a string follows.
    pub fn string_follows(&mut self) -> bool {
        self.something_follows() && self.is_at(b'"')
    }

    /// Takes a bracket if it is the next byte; true if it was.
    pub fn take_bracket(&mut self, bracket: u8) -> bool {
        let follows = self.something_follows() && self.is_at(bracket);
        self.next += usize::from(follows);
        follows
    }

    /// The next token and its place; `None` at the end of the file.
    pub fn token(&mut self) -> Result<Option<(Token<'a>, Spot)>, Fault> {
        if !self.something_follows() {
            return Ok(None);
        }
        let spot = self.spot();
        let token = match self.bytes[self.next] {
            b'[' => Token::Open,
            b']' => Token::Close,
            b'"' => return Ok(Some((Token::String(self.string(spot)?), spot))),
            _ => return Ok(Some((Token::Word(self.word()), spot))),
        };
        self.next += 1;
        Ok(Some((token, spot)))
    }

    /// The next token, which must exist. `what` names the expected token in messages.
    pub fn expect(&mut self, what: &str) -> Result<(Token<'a>, Spot), Fault> {
        match self.token()? {
            Some(token) => Ok(token),
            None => Err(self.ends(what)),
        }
    }

    /// The error for a file that ends too early.
    pub fn ends(&mut self, what: &str) -> Fault {
        let spot = self.spot();
        Fault::new(
            spot,
            format!("the file ends where {what} was expected"),
            "complete the file, which may be cut off",
        )
    }

    /// A required string. `what` describes it for messages.
    pub fn expect_string(&mut self, what: &str) -> Result<(&'a str, Spot), Fault> {
        let (token, spot) = self.expect(what)?;
        let Token::String(bytes) = token else {
            let problem = format!("found {}, expected {what} in double quotes", token.quoted());
            return Err(Fault::new(spot, problem, "correct the directive"));
        };
        Ok((utf8(bytes, spot)?, spot))
    }

    /// A required number. `what` describes it for messages.
    pub fn expect_number(&mut self, what: &str) -> Result<f64, Fault> {
        let (token, spot) = self.expect(what)?;
        let Token::Word(word) = token else {
            let problem = format!("found {}, expected {what}, a number", token.quoted());
            return Err(Fault::new(spot, problem, "correct the directive"));
        };
        number(word).ok_or_else(|| not_a_number(word, spot, what))
    }

    /// A number, if one follows: fast, for long lists.
    pub fn take_number(&mut self, what: &str) -> Result<Option<f64>, Fault> {
        if !self.something_follows() {
            return Err(self.ends("a number or \"]\""));
        }
        if matches!(self.bytes[self.next], b']' | b'[' | b'"') {
            return Ok(None);
        }
        let start = self.next;
        let word = self.word();
        match number(word) {
            Some(number) => Ok(Some(number)),
            None => {
                self.next = start;
                let spot = self.spot();
                Err(not_a_number(word, spot, what))
            }
        }
    }

    /// True if a bare word follows that could be a value.
    pub fn word_follows(&mut self) -> bool {
        self.something_follows() && !matches!(self.bytes[self.next], b']' | b'[' | b'"')
    }

    fn word(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.next..];
        let ends = |b: &u8| {
            matches!(b, b' ' | b'\n' | b'\r' | b'\t' | b'"' | b'[' | b']' | b'#' | 0x0b | 0x0c)
        };
        let word = &rest[..rest.iter().position(ends).unwrap_or(rest.len())];
        self.next += word.len();
        word
    }

    /// The content up to the closing quote; a string ends on the line on which it starts.
    fn string(&mut self, spot: Spot) -> Result<&'a [u8], Fault> {
        let rest = &self.bytes[self.next + 1..];
        let length = rest.iter().position(|&b| b == b'"' || b == b'\n').unwrap_or(rest.len());
        if rest.get(length) != Some(&b'"') {
            return Err(Fault::new(
                spot,
                "this string has no closing quote on its line",
                "close it",
            ));
        }
        self.next += length + 2;
        Ok(&rest[..length])
    }
}

/// A string of the file as text.
pub fn utf8(bytes: &[u8], spot: Spot) -> Result<&str, Fault> {
    std::str::from_utf8(bytes).map_err(|_| {
        Fault::new(
            spot,
            format!("the string {} is not valid UTF-8", quoted(bytes)),
            "save the file as UTF-8",
        )
    })
}

fn not_a_number(word: &[u8], spot: Spot, what: &str) -> Fault {
    let is_too_large = std::str::from_utf8(word).is_ok_and(|w| w.parse::<f64>().is_ok());
    if is_too_large {
        let problem = format!("{} in {what} is not a number that can be rendered", quoted(word));
        return Fault::new(spot, problem, "use a finite number below 3.4e38");
    }
    let remedy = if word.contains(&b',') {
        "write a decimal point instead of a comma"
    } else {
        "write a number"
    };
    Fault::new(spot, format!("found {}, expected a number of {what}", quoted(word)), remedy)
}

/// A finite number that single precision can hold.
fn number(word: &[u8]) -> Option<f64> {
    let number = match small_decimal(word) {
        Some(number) => number,
        None => std::str::from_utf8(word).ok()?.parse().ok()?,
    };
    (number.abs() <= LARGEST).then_some(number)
}

/// Powers of ten that are exact in double precision.
const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Fast path for common numbers: at most 15 digits without exponent are a quotient of two exact
/// numbers, rounded once (Clinger, How to read floating point numbers accurately, 1990).
fn small_decimal(word: &[u8]) -> Option<f64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    if digits.is_empty() || digits.len() > 16 {
        return None;
    }
    let (mut value, mut decimals, mut point, mut count) = (0u64, 0, false, 0);
    for &byte in digits {
        match byte {
            b'0'..=b'9' => {
                value = value * 10 + u64::from(byte - b'0');
                decimals += usize::from(point);
                count += 1;
            }
            b'.' if !point => point = true,
            _ => return None,
        }
    }
    if count == 0 || count > 15 {
        return None;
    }
    let number = value as f64 / POWERS[decimals];
    Some(if negative { -number } else { number })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadOptions;
    use std::path::Path;

    fn input(text: &str) -> Input {
        Input::from_bytes("t", text.as_bytes().to_vec(), Path::new("."), &ReadOptions::default())
    }

    #[test]
    fn tokens_have_the_line_and_column_where_they_start() {
        let input = input("Shape \"sphère\" # \"no\"\n [1 -2.5]x");
        let mut lexer = Lexer::new(&input, 0);
        let mut found = Vec::new();
        while let Some((token, spot)) = lexer.token().expect("well formed") {
            found.push((token.quoted(), spot.line, spot.column));
        }
        let expected = [
            ("Shape", 1, 1),
            ("sphère", 1, 7),
            ("[", 2, 2),
            ("1", 2, 3),
            ("-2.5", 2, 5),
            ("]", 2, 9),
        ];
        let expected = expected.into_iter().chain([("x", 2, 10)]);
        assert_eq!(found, expected.map(|(t, l, c)| (format!("\"{t}\""), l, c)).collect::<Vec<_>>());
    }

    #[test]
    fn numbers_are_those_of_the_standard_library_but_finite() {
        for text in [
            "0",
            "-0",
            "1",
            "+2.",
            ".5",
            "-.25",
            "123456789.123456",
            "0.1",
            "1e3",
            "-1.5E-7",
            "9007199254740993",
        ] {
            assert_eq!(
                number(text.as_bytes()).map(f64::to_bits),
                text.parse().ok().map(f64::to_bits),
                "{text}"
            );
        }
        for text in ["", "-", ".", "1,5", "nan", "inf", "1e39", "1e999", "x", "1.2.3", "--1"] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
    }
}
