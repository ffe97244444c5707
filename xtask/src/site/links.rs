//! Links of pages: in the repository they lead to files beside the page, in the site to pages and
//! pictures of the site, or to the repository on the web.

use super::pages::place_in_site;
use std::path::{Component, Path, PathBuf};

/// Rewrites the links of a page at `source` (from the root) for its place in the site.
/// `repository` is the address of the repository on the web; without one, links to files that are
/// not in the site become plain text.
pub fn rewritten(text: &str, source: &Path, place: &str, repository: Option<&str>) -> String {
    let mut is_code = false;
    let mut out = String::new();
    for line in text.lines() {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        if is_fence || is_code {
            out += line;
        } else {
            out += &rewritten_line(line, source, place, repository);
        }
        out.push('\n');
    }
    out
}

fn rewritten_line(line: &str, source: &Path, place: &str, repository: Option<&str>) -> String {
    let mut out = String::new();
    let mut rest = line;
    while let Some(at) = rest.find("](") {
        let (before, after) = rest.split_at(at);
        let Some(end) = after.find(')') else { break };
        out += before;
        let target = &after[2..end];
        rest = &after[end + 1..];
        // An odd number of backquotes before the link: it is part of code.
        if out.matches('`').count() % 2 == 1 {
            out += &format!("]({target})");
            continue;
        }
        match site_target(target, source, place, repository) {
            Some(target) => out += &format!("]({target})"),
            None => unlink(&mut out),
        }
    }
    out + rest
}

/// Removes the bracket that opened the link, so that its text stays.
fn unlink(out: &mut String) {
    let mut depth = 0;
    for (at, c) in out.char_indices().rev() {
        match c {
            ']' => depth += 1,
            '[' if depth == 0 => {
                out.remove(at);
                return;
            }
            '[' => depth -= 1,
            _ => {}
        }
    }
}

/// The target of a link in the site; `None` if it leads out of it to no known address.
fn site_target(
    target: &str,
    source: &Path,
    place: &str,
    repository: Option<&str>,
) -> Option<String> {
    let (file, anchor) = match target.split_once('#') {
        Some((file, anchor)) => (file, format!("#{anchor}")),
        None => (target, String::new()),
    };
    if file.is_empty() || file.contains("://") || file.starts_with("mailto:") {
        return Some(target.to_string());
    }
    let wanted = normal(&source.parent().unwrap_or(Path::new("")).join(file));
    match place_in_site(&wanted) {
        Some(wanted) => Some(format!("{}{anchor}", relative(place, &wanted))),
        None => {
            repository.map(|address| format!("{address}/blob/main/{}{anchor}", slashed(&wanted)))
        }
    }
}

/// A path without `..` and `.`.
fn normal(path: &Path) -> PathBuf {
    let mut parts = Vec::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(parts.pop()),
            Component::CurDir => {}
            other => parts.push(other),
        }
    }
    parts.iter().collect()
}

/// The path as addresses write it.
fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}

/// The path from a page to another file of the site.
pub fn relative(from: &str, to: &str) -> String {
    let folders: Vec<&str> = from.split('/').collect();
    let folders = &folders[..folders.len() - 1];
    let parts: Vec<&str> = to.split('/').collect();
    let last = parts.len() - 1;
    let common = folders.iter().zip(&parts[..last]).take_while(|(a, b)| a == b).count();
    "../".repeat(folders.len() - common) + &parts[common..].join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_lead_to_pages_of_the_site_or_to_the_repository() {
        let source = Path::new("docs/user/start.md");
        let new = |line: &str, web| rewritten_line(line, source, "user/start.md", web);
        assert_eq!(new("[a](viewer.md#x)", None), "[a](viewer.md#x)");
        assert_eq!(new("[a](../../CHANGELOG.md)", None), "[a](../project/changelog.md)");
        assert_eq!(new("[a](../lecture.md)", None), "[a](../lecture.md)");
        assert_eq!(new("see [`a`](../../crates/cli), b", None), "see `a`, b");
        let web = Some("https://example.org/snell");
        let address = "[a](https://example.org/snell/blob/main/crates/cli)";
        assert_eq!(new("[a](../../crates/cli)", web), address);
        assert_eq!(new("`[a](../../crates/cli)`", web), "`[a](../../crates/cli)`");
        assert_eq!(new("[a](https://b.org) [c](#d)", None), "[a](https://b.org) [c](#d)");
    }

    #[test]
    fn paths_between_pages_go_up_and_down() {
        assert_eq!(relative("index.md", "user/start.md"), "user/start.md");
        assert_eq!(relative("user/start.md", "user/viewer.md"), "viewer.md");
        assert_eq!(relative("user/python/rays.md", "user/a.md"), "../a.md");
        assert_eq!(relative("user/python/rays.md", "pictures/a.jpg"), "../../pictures/a.jpg");
    }
}
