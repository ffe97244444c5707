//! The reference page of formats: `docs/user/parameters/formats.md`.

use crate::SCENE_READERS;
use crate::image::IMAGE_FORMATS;
use crate::write::WRITERS;

const START: &str = "# Table of formats

The formats of scenes, meshes and pictures that Snell reads and writes. `cargo xtask parameters`
writes this page from the lists in the source; `snell formats` prints the same.
[Formats](../formats.md) says what is read from each, and what is approximated.

## Scenes and meshes

A file is recognised by its content, else by its extension.

| format | extensions | | what it is |
|---|---|---|---|
";

const PICTURES: &str = "
USD stages (`.usd`, `.usda`, `.usdc`, `.usdz`) are read through the Python package `usd-core`, see
[its section](../formats.md#usd-usd-usda-usdc-usdz).

## Pictures

| format | extensions | | what it is |
|---|---|---|---|
";

/// The page in Markdown.
pub fn formats_page() -> String {
    let mut text = START.to_string();
    for reader in SCENE_READERS {
        let is_written = WRITERS.iter().any(|writer| writer.name == reader.name);
        text += &row(reader.name, reader.extensions, true, is_written, reader.description);
    }
    text += PICTURES;
    for format in IMAGE_FORMATS {
        let (reads, writes) = (format.reads(), format.writes());
        text += &row(format.name, format.extensions, reads, writes, format.description);
    }
    text
}

fn row(name: &str, extensions: &[&str], reads: bool, writes: bool, about: &str) -> String {
    let extensions: Vec<_> = extensions.iter().map(|e| format!("`.{e}`")).collect();
    let uses: Vec<_> =
        [(reads, "reads"), (writes, "writes")].iter().filter(|(is, _)| *is).map(|u| u.1).collect();
    let (extensions, uses) = (extensions.join(" "), uses.join(", "));
    format!("| {name} | {extensions} | {uses} | {} |\n", about.replace('|', "\\|"))
}
