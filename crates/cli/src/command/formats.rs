//! `snell formats`.

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;
use crate::usd;
use snell_formats::SCENE_READERS;
use snell_formats::image::IMAGE_FORMATS;
use snell_formats::write::WRITERS;

/// Lists the file formats.
pub fn run() -> Result<ExitCode, Failure> {
    let mut text = String::from("Scenes and meshes\n");
    for reader in SCENE_READERS {
        let is_written = WRITERS.iter().any(|w| w.name == reader.name);
        text += &format!(
            "  {:8} {:20} {:14} {}\n",
            reader.name,
            extensions(reader.extensions),
            if is_written { "reads, writes" } else { "reads" },
            reader.description
        );
    }
    let needs = "Universal Scene Description, through a Python with the package usd-core";
    text += &format!("  {:8} {:20} {:14} {needs}\n", "usd", extensions(usd::EXTENSIONS), "reads");
    text += "\nPictures\n";
    for format in IMAGE_FORMATS {
        let use_ = match (format.reads(), format.writes()) {
            (true, true) => "reads, writes",
            (true, false) => "reads",
            _ => "writes",
        };
        text += &format!(
            "  {:8} {:20} {:14} {}\n",
            format.name,
            extensions(format.extensions),
            use_,
            format.description
        );
    }
    standard_output::write(text.as_bytes())?;
    Ok(ExitCode::SUCCESS)
}

fn extensions(list: &[&str]) -> String {
    list.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" ")
}
