//! Checks of the finished site: every link leads to a file and every anchor is on its page, and no
//! page loads anything from another server.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Folder of pages that rustdoc has checked.
const RUST: &str = "rust";

/// Follows the links of all pages; the error lists what is wrong.
pub fn links(site: &Path) -> Result<(), String> {
    let mut files = Vec::new();
    files_below(site, &mut files).map_err(|error| format!("{}: {error}", site.display()))?;
    let is_page = |path: &&PathBuf| {
        path.extension().is_some_and(|e| e == "html") && !path.starts_with(site.join(RUST))
    };
    let pages: Vec<&PathBuf> = files.iter().filter(is_page).collect();
    let read = |path: &Path| std::fs::read_to_string(path).unwrap_or_default();
    let texts: BTreeMap<PathBuf, String> =
        pages.iter().map(|path| (path.to_path_buf(), read(path))).collect();
    let anchors: BTreeMap<&PathBuf, BTreeSet<String>> =
        texts.iter().map(|(path, text)| (path, values(text, "id").collect())).collect();
    let (mut problems, mut count) = (BTreeSet::new(), 0);
    for (path, text) in &texts {
        let page = path.strip_prefix(site).unwrap_or(path).display().to_string();
        for address in loaded(text).filter(|address| is_elsewhere(address)) {
            problems.insert(format!("{page} loads {address}"));
        }
        for address in values(text, "href").chain(values(text, "src")) {
            if is_elsewhere(&address)
                || ["mailto:", "data:", "javascript:"].iter().any(|s| address.starts_with(s))
            {
                continue;
            }
            count += 1;
            let (file, anchor) = address.split_once('#').unwrap_or((&address, ""));
            let target = target(site, path, file.split('?').next().unwrap_or(file));
            if !target.is_file() {
                // The page for errors has addresses from the root of a server.
                if page != "404.html" {
                    problems.insert(format!("{page}: {address} leads nowhere"));
                }
            } else if let Some(there) = anchors.get(&target)
                && !anchor.is_empty()
                && !there.contains(anchor)
            {
                problems.insert(format!("{page}: {address} has no such anchor"));
            }
        }
    }
    println!("{} pages, {count} links", pages.len());
    match problems.is_empty() {
        true => Ok(()),
        false => Err(problems.into_iter().collect::<Vec<_>>().join("\nxtask: docs: ")),
    }
}

fn is_elsewhere(address: &str) -> bool {
    address.contains("://") || address.starts_with("//")
}

/// The file that a link of a page leads to.
fn target(site: &Path, page: &Path, file: &str) -> PathBuf {
    if file.is_empty() {
        return page.to_path_buf();
    }
    let mut path = match file.strip_prefix('/') {
        Some(rest) => site.join(rest),
        None => page.parent().unwrap_or(site).to_path_buf(),
    };
    for part in file.split('/').filter(|_| !file.starts_with('/')) {
        match part {
            ".." => drop(path.pop()),
            "" | "." => {}
            part => path.push(part.replace("%20", " ")),
        }
    }
    if path.is_dir() { path.join("index.html") } else { path }
}

/// The values of an attribute in a page.
fn values<'a>(text: &'a str, attribute: &'a str) -> impl Iterator<Item = String> + 'a {
    let start = format!(" {attribute}=");
    let mut rest = text;
    std::iter::from_fn(move || {
        rest = &rest[rest.find(&start)? + start.len()..];
        let value = match rest.chars().next()? {
            quote @ ('"' | '\'') => rest[1..].split(quote).next(),
            _ => rest.split([' ', '>']).next(),
        };
        Some(value?.replace("&amp;", "&"))
    })
}

/// The addresses that a browser loads with a page: scripts, pictures, style sheets.
fn loaded(text: &str) -> impl Iterator<Item = String> + '_ {
    let tags = text.split('<').skip(1).filter_map(|tag| tag.split('>').next());
    tags.filter_map(|tag| {
        let attribute = match tag.split_whitespace().next()? {
            "script" | "img" | "iframe" | "source" | "video" => "src",
            "link" if !tag.contains("canonical") => "href",
            _ => return None,
        };
        values(tag, attribute).next()
    })
}

fn files_below(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            files_below(&path, found)?;
        } else {
            found.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_that_lead_nowhere_are_found() {
        let site = std::env::temp_dir().join(format!("snell-site-{}", std::process::id()));
        std::fs::create_dir_all(site.join("a")).expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(site.join(name), text).expect("a file");
        write("b.html", "<h1 id=\"there\">b</h1>");
        write("a/a.html", "<a href=\"../b.html#there\">b</a> <a href=\"#x\" id=x>x</a>");
        assert_eq!(links(&site), Ok(()));
        write("a/a.html", "<a href=\"../b.html#gone\">b</a><img src=\"c.png\">");
        let problems = links(&site).expect_err("two links are wrong");
        assert!(problems.contains("b.html#gone has no such anchor"), "{problems}");
        assert!(problems.contains("c.png leads nowhere"), "{problems}");
        write("a/a.html", "<script src=\"https://example.org/a.js\"></script>");
        assert!(links(&site).expect_err("it loads a script").contains("loads https://"));
        std::fs::remove_dir_all(&site).expect("the folder can go");
    }
}
