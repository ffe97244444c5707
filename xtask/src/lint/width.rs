//! No line may be wider than 100 columns, except those that cannot be broken: tables, addresses,
//! and raw string literals, such as the snapshots of tests. Ruff checks the width of Python.

use std::path::{Path, PathBuf};

const WIDTH: usize = 100;
const EXTENSIONS: [&str; 7] = ["rs", "ts", "tsx", "mjs", "css", "toml", "sh"];
/// Folders whose files are generated.
const GENERATED: [&str; 4] = ["target", "node_modules", "page", "corpus"];

/// Prints every line of the repository's own files that is too wide; true if there is none.
pub fn check() -> bool {
    let mut files = vec![PathBuf::from(".ci/run")];
    collect(Path::new("."), &mut files);
    let mut is_narrow = files.len() > 1;
    for file in files {
        let Ok(text) = std::fs::read_to_string(&file) else { continue };
        for number in wide_lines(&text, file.extension().is_some_and(|e| e == "rs")) {
            eprintln!("{}:{number}: wider than {WIDTH} columns", file.display());
            is_narrow = false;
        }
    }
    is_narrow
}

/// Collects the files that people write, in a folder and its subfolders.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_ours = !name.starts_with('.') && !GENERATED.contains(&&*name);
        if path.is_dir() && is_ours && !path.is_symlink() {
            collect(&path, files);
        } else if !name.ends_with(".gen.ts")
            && path.extension().is_some_and(|e| EXTENSIONS.iter().any(|known| e == *known))
        {
            files.push(path);
        }
    }
}

/// The numbers of lines that are too wide and could be broken.
fn wide_lines(text: &str, is_rust: bool) -> Vec<usize> {
    let literals = if is_rust { raw_literals(text) } else { Vec::new() };
    let is_literal = |at: usize| literals.iter().any(|&(start, end)| (start..end).contains(&at));
    let mut found = Vec::new();
    let mut start = 0;
    for (index, line) in text.split('\n').enumerate() {
        if let Some((at, _)) = line.char_indices().nth(WIDTH)
            && !is_table(line)
            && !is_address(line, at)
            && !is_literal(start + at)
        {
            found.push(index + 1);
        }
        start += line.len() + 1;
    }
    found
}

/// True for a row of a Markdown table in a comment.
fn is_table(line: &str) -> bool {
    line.trim_start().trim_start_matches(['/', '!', '#', ' ']).starts_with('|')
}

/// True if the word at a byte of the line is an address.
fn is_address(line: &str, at: usize) -> bool {
    let start = line[..at].rfind(char::is_whitespace).map_or(0, |space| space + 1);
    line[start..].split_whitespace().next().is_some_and(|word| word.contains("://"))
}

/// The byte ranges of raw string literals in Rust code, and of snapshots after an `@`.
fn raw_literals(text: &str) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let rest = &text[at..];
        let after_name = text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(length) = raw_length(rest).filter(|_| !after_name) {
            found.push((at, at + length));
            length
        } else if rest.starts_with('"') {
            let length = string_length(rest);
            if text[..at].ends_with('@') {
                found.push((at, at + length));
            }
            length
        } else {
            char_length(rest)
        };
        at += length;
    }
    found
}

/// The length of the raw literal that a text starts with.
fn raw_length(text: &str) -> Option<usize> {
    let marks = text.strip_prefix("br").or_else(|| text.strip_prefix('r'))?;
    let content = marks.trim_start_matches('#');
    let hashes = &marks[..marks.len() - content.len()];
    let end = format!("\"{hashes}");
    let length = content.strip_prefix('"')?.find(&end)?;
    Some(text.len() - content.len() + 1 + length + end.len())
}

/// The length of the ordinary literal that a text starts with.
fn string_length(text: &str) -> usize {
    let mut is_escaped = false;
    for (at, byte) in text.bytes().enumerate().skip(1) {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = true,
            b'"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// The length of the first character of a text; or of the whole literal, if the text starts with a
/// character literal of a quote, such as `'"'`, since that quote starts no string.
fn char_length(text: &str) -> usize {
    let quoted = ["'\"'", "'\\\"'", "'\\''"].into_iter().find(|quoted| text.starts_with(quoted));
    quoted.map_or_else(|| text.chars().next().map_or(1, char::len_utf8), str::len)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<usize> {
        wide_lines(text, true)
    }

    #[test]
    fn lines_of_more_than_a_hundred_characters_are_found() {
        let hundred = "ü".repeat(100);
        assert_eq!(numbers(&format!("// short\n{hundred}\n{hundred}!\n")), [3]);
    }

    #[test]
    fn tables_addresses_and_raw_literals_may_be_wide() {
        let long = "x ".repeat(60);
        assert!(numbers(&format!("/// | {long} |")).is_empty());
        assert!(numbers(&format!("// https://example.org/{}", "x".repeat(100))).is_empty());
        assert!(numbers(&format!("let s = br#\"\n\"{long}\"#;")).is_empty());
        assert!(numbers(&format!("snapshot!(s, @\"{long}\\\"{long}\");")).is_empty());
    }

    #[test]
    fn a_quote_in_a_comment_or_a_character_starts_no_literal() {
        let long = "x ".repeat(60);
        assert_eq!(numbers(&format!("// r\"\n'\"'\n'\\''\nr\"\"; {long}")), [4]);
        assert_eq!(numbers(&format!("\"{long}\"")), [1]);
        assert_eq!(numbers(&format!("for\"{long}\"")), [1]);
    }
}
