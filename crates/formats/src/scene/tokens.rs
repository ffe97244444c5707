//! Text as a stream of words with their places, for formats without line structure.

use crate::{Input, Place, ReadError};
use snell_math::{DVec3, Rgb};

/// Numbers beyond this cannot be rendered in single precision.
const LARGEST: f64 = f32::MAX as f64;

/// A word of a file and where it starts.
#[derive(Clone, Copy, Debug)]
pub struct Token<'a> {
    bytes: &'a [u8],
    start: usize,
    line: usize,
    line_start: usize,
}

impl<'a> Token<'a> {
    /// The word; bytes that are not UTF-8 show as replacement characters.
    pub fn text(&self) -> std::borrow::Cow<'a, str> {
        String::from_utf8_lossy(self.bytes)
    }

    /// The word if it is valid UTF-8.
    pub fn utf8(&self) -> Option<&'a str> {
        std::str::from_utf8(self.bytes).ok()
    }

    /// The word for a message: in quotes and shortened.
    pub fn quoted(&self) -> String {
        let shown: String = self.text().chars().take(60).flat_map(char::escape_debug).collect();
        let dots = if self.text().chars().nth(60).is_some() { "..." } else { "" };
        format!("\"{shown}{dots}\"")
    }
}

/// Words of a file, separated by white space.
#[derive(Debug)]
pub struct Tokens<'a> {
    input: &'a Input,
    bytes: &'a [u8],
    next: usize,
    line: usize,
    line_start: usize,
    hash_is_comment: bool,
    usage: &'static str,
}

impl<'a> Tokens<'a> {
    /// Words of `input`, without comments; `#` is an ordinary character.
    pub fn new(input: &'a Input) -> Self {
        // Editors may put a byte order mark first.
        let next = if input.bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self {
            input,
            bytes: &input.bytes,
            next,
            line: 1,
            line_start: next,
            hash_is_comment: false,
            usage: "",
        }
    }

    /// Words of `input`; a comment runs from any `#` to the end of its line.
    pub fn with_comments(input: &'a Input) -> Self {
        Self { hash_is_comment: true, ..Self::new(input) }
    }

    /// The file.
    pub fn input(&self) -> &'a Input {
        self.input
    }

    /// Sets the syntax of the command being read: errors in its arguments show it.
    pub fn set_usage(&mut self, usage: &'static str) {
        self.usage = usage;
    }

    /// Takes the next word; `None` at the end of the file.
    pub fn take(&mut self) -> Option<Token<'a>> {
        let token = self.peek()?;
        self.next = token.start + token.bytes.len();
        Some(token)
    }

    /// The next word without taking it; `None` at the end of the file.
    pub fn peek(&mut self) -> Option<Token<'a>> {
        loop {
            match *self.bytes.get(self.next)? {
                b'\n' => {
                    self.next += 1;
                    self.line += 1;
                    self.line_start = self.next;
                }
                b'#' if self.hash_is_comment => self.skip_line(),
                // The vertical tab is white space to the C library, which most of these files were
                // written and read with.
                b if b.is_ascii_whitespace() || b == 0x0b => self.next += 1,
                _ => break,
            }
        }
        let start = self.next;
        let ends =
            |&b: &u8| b.is_ascii_whitespace() || b == 0x0b || (b == b'#' && self.hash_is_comment);
        let length = self.bytes[start..].iter().position(ends).unwrap_or(self.bytes.len() - start);
        let bytes = &self.bytes[start..start + length];
        Some(Token { bytes, start, line: self.line, line_start: self.line_start })
    }

    /// The next word without taking it; `None` if it is on another line than the last one taken.
    pub fn peek_on_line(&mut self) -> Option<Token<'a>> {
        let line = self.line;
        self.peek().filter(|token| token.line == line)
    }

    /// Skips the rest of the current line.
    pub fn skip_line(&mut self) {
        let rest = &self.bytes[self.next..];
        self.next += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
    }

    /// Line and column (in characters) of a word.
    pub fn place(&self, token: &Token) -> Place {
        let before = String::from_utf8_lossy(&self.bytes[token.line_start..token.start]);
        Place::Column(token.line, before.chars().count() + 1)
    }

    /// An error at a word.
    pub fn error(
        &self,
        token: &Token,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> ReadError {
        self.input.error(self.place(token), problem, remedy)
    }

    /// The next word, which is required. `what` names the expected word in messages.
    pub fn expect(&mut self, what: &str) -> Result<Token<'a>, ReadError> {
        match self.take() {
            Some(token) => Ok(token),
            None => {
                let problem = format!("the file ends where {what} was expected");
                Err(self.input.error(Place::Line(self.line), problem, self.remedy()))
            }
        }
    }

    fn remedy(&self) -> String {
        if self.usage.is_empty() {
            "complete it".into()
        } else {
            format!("write it as: {}", self.usage)
        }
    }

    /// The error for an unexpected word.
    pub fn unexpected(&self, token: &Token, what: &str) -> ReadError {
        let problem = format!("found {}, expected {what}", token.quoted());
        let remedy = if token.bytes.starts_with(b"#") {
            "move the comment to where a command could start".into()
        } else {
            self.remedy()
        };
        self.error(token, problem, remedy)
    }

    /// The next word as a finite number that single precision can hold.
    pub fn number(&mut self, what: &str) -> Result<f64, ReadError> {
        let token = self.expect(what)?;
        let number: Option<f64> = token.utf8().and_then(|t| t.parse().ok());
        let Some(number) = number else {
            return Err(self.unexpected(&token, &format!("{what}, a number")));
        };
        if number.abs() <= LARGEST {
            return Ok(number);
        }
        let problem =
            format!("{what} is {}, which is not a number that can be rendered", token.quoted());
        Err(self.error(&token, problem, "use a finite number below 3.4e38"))
    }

    /// The next word as a whole number.
    pub fn integer(&mut self, what: &str) -> Result<i64, ReadError> {
        let token = self.expect(what)?;
        token
            .utf8()
            .and_then(|t| t.parse().ok())
            .ok_or_else(|| self.unexpected(&token, &format!("{what}, a whole number")))
    }

    /// The next words as numbers.
    pub fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], ReadError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number(what)?;
        }
        Ok(numbers)
    }

    /// The next three words as a point or vector.
    pub fn vector(&mut self, what: &str) -> Result<DVec3, ReadError> {
        self.numbers::<3>(what).map(DVec3::from_array)
    }

    /// The next three words as a linear colour.
    pub fn color(&mut self, what: &str) -> Result<Rgb, ReadError> {
        let [r, g, b] = self.numbers::<3>(what)?.map(|x| x as f32);
        Ok(Rgb::new(r, g, b))
    }

    /// The next three words as a direction, normalised. Fails for the zero vector.
    pub fn direction(&mut self, what: &str) -> Result<DVec3, ReadError> {
        let first = self.peek();
        let vector = self.vector(what)?;
        match (vector.try_normalize(), first) {
            (Some(unit), _) => Ok(unit),
            (None, first) => {
                let place = first.map_or(Place::Whole, |t| self.place(&t));
                let problem = format!("{what} is the zero vector, which points nowhere");
                Err(self.input.error(place, problem, "give at least one coordinate that is not 0"))
            }
        }
    }

    /// True if the next word is a number.
    pub fn number_follows(&mut self) -> bool {
        self.peek().and_then(|t| t.utf8()).is_some_and(|t| t.parse::<f64>().is_ok())
    }
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
    fn words_have_the_line_and_column_where_they_start() {
        let input = input("one\n  twö three\r\n");
        let mut tokens = Tokens::new(&input);
        let mut places = Vec::new();
        while let Some(token) = tokens.take() {
            places.push((token.text().into_owned(), tokens.place(&token)));
        }
        let expected = [("one", 1, 1), ("twö", 2, 3), ("three", 2, 7)];
        assert_eq!(places, expected.map(|(t, l, c)| (t.to_string(), Place::Column(l, c))));
    }

    #[test]
    fn a_comment_runs_to_the_end_of_its_line_and_may_touch_a_word() {
        let input = input("# all\n1#x 2\n3");
        let mut tokens = Tokens::with_comments(&input);
        assert_eq!(tokens.numbers::<2>("a number"), Ok([1.0, 3.0]));
        assert!(tokens.take().is_none());
    }

    #[test]
    fn numbers_are_those_of_c_but_finite() {
        for (text, value) in [("1", 1.0), (".5", 0.5), ("-1e3", -1000.0), ("+2.", 2.0)] {
            assert_eq!(Tokens::new(&input(text)).number("x"), Ok(value));
        }
        for text in ["nan", "inf", "-1e39", "1e999", "1,5", "x", ""] {
            assert!(Tokens::new(&input(text)).number("x").is_err(), "{text}");
        }
    }
}
