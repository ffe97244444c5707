//! `snell formats`.

use crate::failure::Failure;
use snell_formats::SCENE_READERS;
use snell_formats::image::IMAGE_FORMATS;
use std::process::ExitCode;

/// Lists the file formats.
pub fn run() -> Result<ExitCode, Failure> {
    println!("Scenes and meshes (read)");
    for reader in SCENE_READERS {
        println!("  {:8} {:20} {}", reader.name, extensions(reader.extensions), reader.description);
    }
    println!("\nPictures");
    for format in IMAGE_FORMATS {
        let use_ = match (format.reads(), format.writes()) {
            (true, true) => "reads, writes",
            (true, false) => "reads",
            _ => "writes",
        };
        println!("  {:8} {:20} {:14} {}", format.name, extensions(format.extensions), use_, format.description);
    }
    Ok(ExitCode::SUCCESS)
}

fn extensions(list: &[&str]) -> String {
    list.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" ")
}
