//! The page *How it is tested*: its text is written by hand, its figures are counted in the tree
//! and written between two marks.

use std::fs;
use std::path::{Path, PathBuf};

const PAGE: &str = "docs/how-it-is-tested.md";
const START: &str = "<!-- Figures: `cargo xtask how-tested` writes what follows. -->\n";
const END: &str = "<!-- End of the figures. -->";
/// Relative tolerance of the figures, so that one more test does not make the page stale.
const TOLERANCE: f64 = 0.1;

/// Writes the figures into the page.
pub fn write() -> std::io::Result<()> {
    let page = fs::read_to_string(PAGE)?;
    let (before, _, after) =
        parts(&page).ok_or_else(|| std::io::Error::other(format!("{PAGE} has lost its marks")))?;
    fs::write(PAGE, format!("{before}{START}{}{END}{after}", figures()?))
}

/// True if the figures of the page match the tree, within the tolerance.
pub fn check() -> std::io::Result<bool> {
    let page = fs::read_to_string(PAGE)?;
    let is_current = parts(&page)
        .is_some_and(|(_, written, _)| figures().is_ok_and(|now| are_near(written, &now)));
    if !is_current {
        eprintln!("xtask: the figures of {PAGE} are out of date: run cargo xtask how-tested");
    }
    Ok(is_current)
}

/// The text before, between and after the marks.
fn parts(page: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = page.split_once(START)?;
    let (within, after) = rest.split_once(END)?;
    Some((before, within, after))
}

/// True if two texts have the same words and nearly the same numbers.
fn are_near(a: &str, b: &str) -> bool {
    let (a, b): (Vec<_>, Vec<_>) = (a.split_whitespace().collect(), b.split_whitespace().collect());
    let near = |(a, b): (&&str, &&str)| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => (a - b).abs() <= (TOLERANCE * a.max(b)).max(5.0),
        _ => a == b,
    };
    a.len() == b.len() && a.iter().zip(&b).all(near)
}

/// The figures as Markdown.
fn figures() -> std::io::Result<String> {
    let mut rows = Vec::new();
    let mut crates: Vec<PathBuf> = fs::read_dir("crates")?.flatten().map(|e| e.path()).collect();
    crates.sort();
    let (mut code, mut tests) = (0, 0);
    for folder in crates.into_iter().chain(["tests", "xtask"].map(PathBuf::from)) {
        let count = Count::of_rust(&folder)?;
        (code, tests) = (code + count.code, tests + count.lines);
        let [code, lines] = [count.code, count.lines].map(rounded);
        rows.push(format!(
            "| `{}` | {} | {code} | {lines} |",
            folder.display(),
            rounded(count.tests)
        ));
    }
    let [python, web] = [("python/tests", "py", "def test_"), ("web/tests", "", "test(")];
    for (folder, extension, start) in [python, web] {
        let (count, lines) = count_in(Path::new(folder), extension, start)?;
        tests += lines;
        rows.push(format!("| `{folder}` | {} | | {} |", rounded(count), rounded(lines)));
    }
    let golden = files(Path::new("tests/golden"), "exr")?.len();
    let targets = files(Path::new("fuzz/fuzz_targets"), "rs")?.len();
    let found = files(Path::new("crates/cli/tests/hostile/found"), "")?.len();
    let (promises, shown) = promises()?;
    let executions = executions_on_record()?;
    let [code, tests] = [code, tests].map(rounded);
    Ok(format!(
        "| where | tests | lines of code | lines of tests |\n|---|---|---|---|\n{}\n\n\
         * {code} lines of Rust, without tests, comments and blank lines; {tests} lines of tests.\n\
         * {golden} golden pictures in `tests/golden/`.\n\
         * {targets} fuzz targets in `fuzz/fuzz_targets/`; {executions} million executions are on \
         record.\n\
         * {found} files that once broke a promise, or are of such a kind, in \
         `crates/cli/tests/hostile/found/`.\n\
         * {promises} promises in [the table](../ARCHITECTURE.md#6-promises), shown by {shown} \
         tests that are named there.\n",
        rows.join("\n")
    ))
}

/// A number rounded to two significant digits, so that it does not change with every commit.
fn rounded(n: usize) -> usize {
    let mut unit = 1;
    while n / unit >= 100 {
        unit *= 10;
    }
    (n + unit / 2) / unit * unit
}

/// The counts of a folder of Rust code.
#[derive(Default)]
struct Count {
    tests: usize,
    /// Lines outside of tests that are neither blank nor only a comment.
    code: usize,
    /// The same kind of lines in tests.
    lines: usize,
}

impl Count {
    fn of_rust(folder: &Path) -> std::io::Result<Self> {
        let mut count = Self::default();
        for path in files(folder, "rs")? {
            let text = fs::read_to_string(&path)?;
            let is_test =
                |part: &str| part == "tests" || part == "tests.rs" || part == "testing.rs";
            let mut in_tests = path.iter().any(|part| is_test(&part.to_string_lossy()));
            let mut is_marked = false;
            for line in text
                .lines()
                .map(str::trim)
                .filter(|line| !line.is_empty() && !line.starts_with("//"))
            {
                // The tests of a file are in a module at its end.
                in_tests |= is_marked && line.starts_with("mod ") && line.ends_with('{');
                is_marked = line == "#[cfg(test)]";
                count.tests += usize::from(line == "#[test]");
                *if in_tests { &mut count.lines } else { &mut count.code } += 1;
            }
        }
        Ok(count)
    }
}

/// The number of lines that begin with `start` in the files of a folder, and the number that are
/// not blank.
fn count_in(folder: &Path, extension: &str, start: &str) -> std::io::Result<(usize, usize)> {
    let (mut count, mut lines) = (0, 0);
    for path in files(folder, extension)? {
        let text = fs::read_to_string(path)?;
        count += text.lines().filter(|line| line.trim_start().starts_with(start)).count();
        lines += text.lines().filter(|line| !line.trim().is_empty()).count();
    }
    Ok((count, lines))
}

/// Files below a folder with an extension, or all files.
fn files(folder: &Path, extension: &str) -> std::io::Result<Vec<PathBuf>> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder)?.flatten().map(|e| e.path()) {
            if path.is_dir() {
                folders.push(path);
            } else if extension.is_empty() || path.extension().is_some_and(|e| e == extension) {
                found.push(path);
            }
        }
    }
    Ok(found)
}

/// The number of promises in ARCHITECTURE.md, and of different tests that it names for them.
fn promises() -> std::io::Result<(usize, usize)> {
    let text = fs::read_to_string("ARCHITECTURE.md")?;
    let section =
        text.split("\n## ").find(|section| section.starts_with("6. Promises")).unwrap_or_default();
    let rows: Vec<_> = section.lines().filter(|line| line.starts_with("| ")).skip(1).collect();
    let mut names: Vec<_> = rows.iter().flat_map(|row| row.split('`').skip(1).step_by(2)).collect();
    names.retain(|name| name.matches('_').count() >= 3);
    names.sort_unstable();
    names.dedup();
    Ok((rows.len(), names.len()))
}

/// Millions of executions in the table of the fuzzers' record, from its third column.
fn executions_on_record() -> std::io::Result<f64> {
    let text = fs::read_to_string("fuzz/README.md")?;
    let cells = text.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").nth(2));
    let sum: f64 = cells.filter_map(|cell| cell.parse::<f64>().ok()).sum();
    Ok(sum.round())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_more_tests_do_not_make_the_page_stale() {
        assert!(are_near("| `a` | 100 | 1200 |", "| `a` | 104 | 1300 |"));
        assert!(!are_near("| `a` | 100 |", "| `a` | 140 |"));
        assert!(!are_near("| `a` | 100 |", "| `b` | 100 |"));
    }

    #[test]
    fn numbers_are_rounded_to_two_digits() {
        assert_eq!([7, 99, 104, 1249, 29_469].map(rounded), [7, 99, 100, 1200, 29_000]);
    }
}
