//! The list of pages, `nav` in `xtask/site/mkdocs.yml`, and the configuration that mkdocs gets.

use std::path::Path;

/// The configuration that people write.
const CONFIGURATION: &str = "xtask/site/mkdocs.yml";

/// Marks a page of `nav` that is left out as long as its file is not there.
const IF_THERE: &str = "# if it is there";

/// Writes the configuration for the copies of the pages that are in `folder`.
pub fn write_configuration(folder: &Path) -> Result<(), String> {
    let text = read(CONFIGURATION)?;
    let is_there = |page: &str| folder.join("pages").join(page).is_file();
    std::fs::write(folder.join("mkdocs.yml"), configured(&text, &is_there))
        .map_err(|error| format!("{}: {error}", folder.join("mkdocs.yml").display()))
}

fn read(path: &str) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))
}

/// The configuration without the optional pages that are not there.
fn configured(text: &str, is_there: &dyn Fn(&str) -> bool) -> String {
    let stays = |line: &&str| !line.ends_with(IF_THERE) || page_of(line).is_none_or(is_there);
    text.lines().filter(stays).map(|line| format!("{line}\n")).collect()
}

/// The page that a line of `nav` names.
fn page_of(line: &str) -> Option<&str> {
    line.trim_start().strip_prefix("- ")?;
    line.split_whitespace().find(|word| word.ends_with(".md"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::site::pages::place_in_site;
    use std::collections::BTreeSet;
    use std::path::PathBuf;

    /// Folders of the site whose pages are made from the source.
    const GENERATED: [&str; 2] = ["user/api/python/", "rust/"];

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
    }

    /// The places in the site of all Markdown files in `docs/`.
    fn pages() -> BTreeSet<String> {
        let (mut found, mut folders) = (BTreeSet::new(), vec![root().join("docs")]);
        while let Some(folder) = folders.pop() {
            for path in std::fs::read_dir(folder).expect("a folder").flatten().map(|e| e.path()) {
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "md") {
                    let path = path.strip_prefix(root()).expect("it is below");
                    found.insert(place_in_site(path).expect("docs are in the site"));
                }
            }
        }
        found
    }

    #[test]
    fn every_page_is_in_the_navigation_and_every_entry_is_a_page() {
        let text = std::fs::read_to_string(root().join(CONFIGURATION)).expect("it is there");
        let nav = text.split_once("\nnav:\n").expect("there is a nav").1;
        let listed: BTreeSet<String> = nav.lines().filter_map(page_of).map(String::from).collect();
        let there = pages();
        let missing: Vec<_> = there.difference(&listed).collect();
        assert!(missing.is_empty(), "{CONFIGURATION} does not name {missing:?} in nav");
        let is_optional = |page: &str| {
            nav.lines().any(|line| line.ends_with(IF_THERE) && page_of(line) == Some(page))
        };
        for page in listed.difference(&there).filter(|page| !is_optional(page)) {
            let top = page.strip_prefix("project/").map(|name| {
                root().join(format!("{}.md", name.trim_end_matches(".md").to_uppercase()))
            });
            let is_made = GENERATED.iter().any(|folder| page.starts_with(folder));
            assert!(is_made || top.is_some_and(|file| file.is_file()), "nav: there is no {page}");
        }
    }

    #[test]
    fn optional_pages_are_left_out_until_they_are_there() {
        let text = "nav:\n  - A: a.md\n  - B: b.md # if it is there\n";
        assert_eq!(configured(text, &|_| false), "nav:\n  - A: a.md\n");
        assert_eq!(configured(text, &|_| true), text);
    }
}
