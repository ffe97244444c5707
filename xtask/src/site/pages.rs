//! Copies of the pages for the site. They have pictures, links that fit the site, and the layout of
//! lists that mkdocs expects.

use super::links::{relative, rewritten};
use super::pictures::Pictures;
use crate::page;
use std::path::Path;

/// Files of the root that are pages of the site, in `project/`.
const TOP: [&str; 5] =
    ["ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "THIRD_PARTY.md"];

/// The folder of the site with the page that needs no server, if that was built.
const PAGE: &str = "page";

/// Links to a scene of the gallery in that page.
const SCENE_PAGE: &str = "page/index.html?scene=";

/// Whether `cargo xtask page` has built the page that needs no server.
fn has_page() -> bool {
    Path::new(page::FOLDER).join("index.html").is_file()
}

/// The sections between these lines are cards of the gallery.
const GALLERY: [&str; 2] = ["<!-- gallery -->", "<!-- end of the gallery -->"];

/// What the start page has before its text, so that its gallery has the whole width.
const START_PAGE: &str = "---\nhide:\n  - navigation\n  - toc\n---\n\n";

/// Begins the line above a block of commands whose pictures the site shows.
const PICTURE: &str = "<!-- picture: ";

/// Begins a line that only the site shows.
const ONLY_IN_SITE: &str = "<!-- site: ";

/// The place in the site of a file, given from the repository's root; `None` if the site does not
/// have it.
pub fn place_in_site(path: &Path) -> Option<String> {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    match &*parts {
        [docs, rest @ ..] if docs == "docs" && !rest.is_empty() => Some(rest.join("/")),
        [name] if name == "README.md" => Some("index.md".into()),
        [name] if TOP.contains(&&**name) => Some(format!("project/{}", name.to_lowercase())),
        _ => None,
    }
}

/// Writes the copies of all pages into a fresh folder.
pub fn write(folder: &Path, pictures: &mut Pictures) -> Result<(), String> {
    let failed = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    if folder.exists() {
        std::fs::remove_dir_all(folder).map_err(|error| failed(folder, error))?;
    }
    copy_folder(Path::new("docs"), folder).map_err(|error| failed(folder, error))?;
    copy_folder(Path::new("xtask/site/assets"), &folder.join("assets"))
        .map_err(|error| failed(folder, error))?;
    let mut sources: Vec<_> = TOP.iter().map(|name| Path::new(name).to_path_buf()).collect();
    markdown_below(Path::new("docs"), &mut sources).map_err(|e| failed(Path::new("docs"), e))?;
    sources.sort();
    let repository = repository();
    for source in sources {
        let text = std::fs::read_to_string(&source).map_err(|error| failed(&source, error))?;
        let place = place_in_site(&source).unwrap_or_default();
        let text = with_lists_apart(&rewritten(&text, &source, &place, repository.as_deref()));
        let text = with_pictures(&text, &place, pictures)
            .map_err(|error| format!("{}: {error}", source.display()))?;
        let text = if place == "index.md" { format!("{START_PAGE}{text}") } else { text };
        let target = folder.join(&place);
        std::fs::create_dir_all(target.parent().unwrap_or(folder))
            .and_then(|()| std::fs::write(&target, text))
            .map_err(|error| failed(&target, error))?;
    }
    if has_page() {
        copy_folder(Path::new(page::FOLDER), &folder.join(PAGE))
            .map_err(|error| failed(Path::new(page::FOLDER), error))?;
    } else {
        println!("the site has no page without a server: `cargo xtask page` makes it");
    }
    pictures.copy_to(&folder.join("pictures"))
}

/// The address of the repository on the web, as `Cargo.toml` states it.
fn repository() -> Option<String> {
    let manifest = std::fs::read_to_string("Cargo.toml").ok()?;
    let line = manifest.lines().find(|line| line.starts_with("repository = "))?;
    line.split('"').nth(1).map(|address| address.trim_end_matches('/').to_string())
}

fn markdown_below(folder: &Path, found: &mut Vec<std::path::PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            markdown_below(&path, found)?;
        } else if path.extension().is_some_and(|e| e == "md") {
            found.push(path);
        }
    }
    Ok(())
}

/// Copies a folder with everything in it.
pub fn copy_folder(from: &Path, to: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let entry = entry?;
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy_folder(&path, &target)?;
        } else {
            std::fs::copy(&path, &target)?;
        }
    }
    Ok(())
}

/// Puts an empty line before each list that follows a paragraph, which mkdocs needs.
fn with_lists_apart(text: &str) -> String {
    let (mut out, mut is_code, mut is_paragraph) = (String::new(), false, false);
    for line in text.lines() {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        let is_item = !is_code && is_item(line);
        if is_item && is_paragraph {
            out.push('\n');
        }
        out += line;
        out.push('\n');
        let is_within_list = is_item || line.starts_with(' ');
        is_paragraph = !is_code && !is_fence && !is_within_list && !line.trim().is_empty();
    }
    out
}

fn is_item(line: &str) -> bool {
    let number = line.trim_start_matches(|c: char| c.is_ascii_digit());
    line.starts_with("* ")
        || line.starts_with("- ")
        || (number.len() < line.len() && number.starts_with(". "))
}

/// Puts the pictures of marked commands above these, makes cards of the gallery, and shows what
/// only the site has.
fn with_pictures(text: &str, place: &str, pictures: &mut Pictures) -> Result<String, String> {
    let (mut out, mut shown, mut scene) = (String::new(), None::<String>, String::new());
    let (mut is_gallery, mut is_card, mut block) = (false, false, None::<String>);
    for line in text.lines() {
        let end_of_card = is_card && (line.starts_with("### ") || line == GALLERY[1]);
        if end_of_card {
            out += "</div>\n\n";
            is_card = false;
        }
        if line == GALLERY[0] || line == GALLERY[1] {
            is_gallery = line == GALLERY[0];
            out += if is_gallery { "<div class=\"gallery\" markdown>\n\n" } else { "</div>\n" };
            continue;
        }
        if is_gallery && line.starts_with("### ") {
            out += "<div class=\"scene\" markdown>\n\n";
            is_card = true;
        }
        if let Some(about) = line.strip_prefix(PICTURE) {
            shown = Some(about.trim_end_matches(" -->").to_string());
            continue;
        }
        if let Some(markdown) = line.strip_prefix(ONLY_IN_SITE) {
            out += markdown.trim_end_matches(" -->");
            out.push('\n');
            continue;
        }
        match (&mut block, &shown) {
            (None, Some(_)) if line.starts_with("```sh") => block = Some(String::new()),
            (Some(commands), Some(about)) if line == "```" => {
                for command in commands_of(commands) {
                    let name = pictures.of(&command)?;
                    let path = relative(place, &format!("pictures/{name}"));
                    out += &format!("![{about}]({path}){{ .picture loading=lazy }}\n\n");
                    scene = command.split(' ').nth(2).unwrap_or_default().to_string();
                }
                out += &format!("```sh\n{commands}```\n");
                if is_card && !scene.contains('/') && has_page() {
                    out += &format!("\n[Open it in your browser]({SCENE_PAGE}{scene})\n");
                }
                (block, shown) = (None, None);
            }
            (Some(commands), _) => {
                *commands += line;
                commands.push('\n');
            }
            _ => {
                out += line;
                out.push('\n');
            }
        }
    }
    Ok(out)
}

/// The commands of a block that render, with continued lines joined.
fn commands_of(block: &str) -> Vec<String> {
    let joined = block.replace("\\\n", " ");
    let words = |line: &str| {
        let line = line.split(" # ").next().unwrap_or(line);
        line.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    joined.lines().map(words).filter(|line| line.starts_with("snell render ")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_get_an_empty_line_before_them() {
        assert_eq!(with_lists_apart("a:\n* b\n  c\n* d\n"), "a:\n\n* b\n  c\n* d\n");
        assert_eq!(with_lists_apart("a\n\n* b\n"), "a\n\n* b\n");
        assert_eq!(with_lists_apart("```\na\n* b\n```\n"), "```\na\n* b\n```\n");
    }

    #[test]
    fn files_have_their_places_in_the_site() {
        let place = |path: &str| place_in_site(Path::new(path));
        assert_eq!(place("docs/user/start.md").as_deref(), Some("user/start.md"));
        assert_eq!(place("SECURITY.md").as_deref(), Some("project/security.md"));
        assert_eq!(place("README.md").as_deref(), Some("index.md"));
        assert_eq!(place("crates/cli/Cargo.toml"), None);
    }

    #[test]
    fn commands_of_a_block_are_joined_and_only_renders_count() {
        let block = "snell render a \\\n  -o b.jpg\nsnell info a\n";
        assert_eq!(commands_of(block), ["snell render a -o b.jpg"]);
    }
}
