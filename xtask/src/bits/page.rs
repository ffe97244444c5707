//! The results of columns, kept between runs in `target/bits`, and the page made of them.

use super::{Column, Results};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};

/// The page that is written.
pub const PAGE: &str = "docs/the-same-bits.md";

/// What follows is replaced by the tables.
const MARK: &str = "<!-- Tables: `cargo xtask bits` writes what follows. -->\n";

fn file(column: &Column) -> PathBuf {
    Path::new("target/bits").join(column.name)
}

/// Saves the results of a column: a line for each, or the reason why there are none.
pub fn save(column: &Column, results: &Results) -> io::Result<()> {
    let text = match results {
        Ok(results) => results.iter().map(|(name, value)| format!("{name}\t{value}\n")).collect(),
        Err(reason) => format!("\t{reason}\n"),
    };
    std::fs::create_dir_all("target/bits")?;
    std::fs::write(file(column), text)
}

/// The saved results of a column, by name; the reason why there are none has no name. Empty if the
/// column never ran.
fn saved(column: &Column) -> Vec<(String, String)> {
    let text = std::fs::read_to_string(file(column)).unwrap_or_default();
    let parts = text.lines().filter_map(|line| line.split_once('\t'));
    parts.map(|(name, value)| (name.into(), value.into())).collect()
}

/// Writes the page from all saved results; true if all columns that ran have the same bits.
pub fn write(columns: &[Column]) -> io::Result<bool> {
    let results: Vec<_> = columns.iter().map(|column| (column, saved(column))).collect();
    let page = std::fs::read_to_string(PAGE)?;
    let (head, _) = page.split_once(MARK).ok_or_else(|| {
        io::Error::other("it lacks the line after which `cargo xtask bits` writes its tables")
    })?;
    let (tables, differences) = tables(&results);
    std::fs::write(PAGE, format!("{head}{MARK}\n{tables}"))?;
    for difference in &differences {
        eprintln!("xtask: {difference}");
    }
    if differences.is_empty() {
        println!("all columns have the same bits: {PAGE}");
    }
    Ok(differences.is_empty())
}

/// The tables of the page, and what differs.
fn tables(columns: &[(&Column, Vec<(String, String)>)]) -> (String, Vec<String>) {
    let mut text = String::from("| column | what it is | Rust |\n|---|---|---|\n");
    for (column, results) in columns {
        let value = |name| results.iter().find(|(n, _)| n == name).map(|(_, value)| &**value);
        let rust = value("Rust").or(value("")).unwrap_or("not computed");
        let _ = writeln!(text, "| `{}` | {} | {rust} |", column.name, column.about);
    }
    let ran: Vec<_> =
        columns.iter().filter(|(_, results)| results.iter().any(|(n, _)| n == "Rust")).collect();
    // The first column that has a result gives the reference.
    let (mut names, mut reference) = (Vec::new(), BTreeMap::new());
    for (name, value) in ran.iter().flat_map(|(_, results)| results).filter(|(n, _)| n != "Rust") {
        reference.entry(name).or_insert_with(|| {
            names.push(name);
            value
        });
    }
    let titles: Vec<_> = ran.iter().map(|(column, _)| column.name).collect();
    let _ = writeln!(text, "\n| picture or rays | SHA-256 or hash | {} |", titles.join(" | "));
    let _ = writeln!(text, "|---|---|{}", "---|".repeat(ran.len()));
    let mut differences = Vec::new();
    for name in names {
        let expected = reference[name];
        let _ = write!(text, "| {name} | `{expected}` |");
        for (column, results) in &ran {
            let found = results.iter().find(|(n, _)| n == name).map(|(_, value)| value);
            let cell = match found {
                Some(value) if value == expected => "same".to_string(),
                Some(value) => {
                    differences
                        .push(format!("{name}: {} has {value}, not {expected}", column.name));
                    format!("**{value}**")
                }
                None => "—".into(),
            };
            let _ = write!(text, " {cell} |");
        }
        text.push('\n');
    }
    (text, differences)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_hash_is_a_difference() {
        let columns = &super::super::COLUMNS[..3];
        let pair = |name: &str, value: &str| (name.to_string(), value.to_string());
        let results = [
            (&columns[0], vec![pair("Rust", "1.95.0"), pair("fog", "12"), pair("hair", "34")]),
            (&columns[1], vec![pair("Rust", "1.96.0"), pair("fog", "12"), pair("hair", "35")]),
            (&columns[2], vec![pair("", "not on this machine")]),
        ];
        let (text, differences) = tables(&results);
        assert_eq!(differences, ["hair: avx2 has 35, not 34"]);
        assert!(text.contains("| fog | `12` | same | same |\n| hair | `34` | same | **35** |\n"));
        assert!(text.contains("not on this machine"), "{text}");
    }
}
